// Putting the page together: theme, tables, one comparison after another.

function setUpTheme() {
  const button = document.getElementById("theme"), order = ["auto", "light", "dark"];
  let theme = "auto";
  try { theme = localStorage.getItem("tyndall-theme") ?? "auto"; } catch { /* a browser may keep no storage for files */ }
  const show = () => {
    if (theme === "auto") delete document.documentElement.dataset.theme;
    else document.documentElement.dataset.theme = theme;
    button.textContent = `Theme: ${theme}`;
  };
  button.addEventListener("click", () => {
    theme = order[(order.indexOf(theme) + 1) % order.length];
    try { localStorage.setItem("tyndall-theme", theme); } catch { /* as above */ }
    show();
  });
  show();
}

function setUpTable(table) {
  const body = table.tBodies[0], heads = [...table.querySelectorAll("thead tr:last-child th")];
  heads.forEach((head, column) => {
    head.querySelector("button")?.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      heads.forEach((h) => h.setAttribute("aria-sort", "none"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const value = (row) => row.cells[column].dataset.value;
      const compare = (a, b) => {
        const [u, v] = [value(a), value(b)];
        if (column === 0) return a.cells[0].textContent.localeCompare(b.cells[0].textContent) * (down ? -1 : 1);
        if (u === undefined || v === undefined) return (u === undefined) - (v === undefined); // unknown ones last
        return (u - v) * (down ? -1 : 1);
      };
      body.append(...[...body.rows].sort(compare));
    });
  });
}

/** A technique under the pointer stands out in the plots and the tables of its comparison. */
function setUpLinks(article) {
  const light = (result) => {
    for (const mark of article.querySelectorAll(".plot .mark")) mark.classList.toggle("faint", result !== null && mark.dataset.result !== result);
    for (const row of article.querySelectorAll("tr[data-result]")) row.classList.toggle("lit", row.dataset.result === result);
  };
  const over = (event) => light(event.target.closest("[data-result]")?.dataset.result ?? null);
  for (const section of article.querySelectorAll(".cost, section:has(.sortable)")) {
    section.addEventListener("pointerover", over);
    section.addEventListener("focusin", over);
    section.addEventListener("pointerleave", () => light(null));
    section.addEventListener("focusout", () => light(null));
  }
}

function setUpCopying(article) {
  for (const button of article.querySelectorAll(".copy")) {
    button.addEventListener("click", async () => {
      const code = button.parentElement.querySelector("code");
      try {
        await navigator.clipboard.writeText(code.textContent);
        button.textContent = "Copied";
      } catch { // no clipboard for a page from disk: select it, so that one key copies
        getSelection().selectAllChildren(code);
        button.textContent = "Selected";
      }
      setTimeout(() => { button.textContent = "Copy"; }, 1800);
    });
  }
}

function setUpComparison(article) {
  const study = JSON.parse(article.querySelector("script.data").textContent);
  const state = makeState({
    left: study.opening[0], right: study.opening[1], split: 0.5, show: "picture", exposure: 0, tone: study.tone,
    places: study.places, frames: true, probe: null, view: "", arrived: 0,
  });
  let arrivals = 0;
  const gallery = makeGallery(article, study, state, () => state.set({ arrived: ++arrivals }));
  setUpViewer(article, study, state, gallery);
  setUpMaps(article, study, state);
  setUpCrops(article, study, state, gallery);
  setUpPlots(article, study, state);
  setUpLinks(article);
  setUpCopying(article);
  article.querySelectorAll(".sortable").forEach(setUpTable);
}

/** Of several comparisons one is shown; the address says which, so that a link can name it. */
function setUpChoice() {
  const articles = [...document.querySelectorAll(".comparison")], which = document.getElementById("which");
  const ready = new Set();
  function show(id) {
    for (const article of articles) {
      article.hidden = article.id !== id;
      if (article.hidden || ready.has(article)) continue;
      ready.add(article);
      setUpComparison(article);
    }
    if (which) which.value = id;
    for (const anchor of document.querySelectorAll("nav [data-anchor]")) anchor.href = `#${id}-${anchor.dataset.anchor}`;
  }
  const fromAddress = () => /^#(c\d+)/.exec(location.hash)?.[1];
  const known = (id) => articles.find((article) => article.id === id)?.id ?? articles[0].id;
  show(known(fromAddress()));
  which?.addEventListener("change", () => show(which.value));
  addEventListener("hashchange", () => { if (fromAddress()) show(known(fromAddress())); });
}

setUpTheme();
if (document.querySelector(".comparison")) setUpChoice();
document.querySelectorAll(".sweep").forEach(setUpSweep);

// Paper does not scroll: wide tables are made to fit it.
const PAPER = 680;
addEventListener("beforeprint", () => document.querySelectorAll(".scroll table").forEach((table) => {
  const width = table.scrollWidth;
  if (width > PAPER) Object.assign(table.style, { width: `${width}px`, zoom: PAPER / width });
}));
addEventListener("afterprint", () => document.querySelectorAll(".scroll table").forEach((table) => {
  Object.assign(table.style, { width: "", zoom: "" });
}));
