// Close-ups: the same few pixels of every picture, side by side.

function setUpCrops(article, study, state, gallery) {
  const section = article.querySelector(".closeup");
  const [, , width, height] = study.places[0];
  section.style.setProperty("--patch", `${width} / ${height}`);
  const rows = [];

  function addRow(element, index) {
    const images = element ? [...element.querySelectorAll("img")] : [];
    const cells = study.pictures.map((name, i) => {
      const canvas = make("canvas", { role: "img", width, height }), old = images[i];
      if (old) old.replaceWith(canvas);
      return { canvas, figure: old ? null : make("figure", {}, canvas, make("figcaption", {}, name)) };
    });
    const row = element ?? make("div", { class: "place" }, make("h3"), make("div", { class: "crops" }, ...cells.map((c) => c.figure)));
    if (!element) section.append(row);
    rows[index] = { row, heading: row.querySelector("h3"), cells };
  }
  section.querySelectorAll(".place").forEach(addRow);

  function paint() {
    const { places, show } = state.values;
    places.forEach(([x, y, w, h], index) => {
      if (!rows[index]) addRow(null, index);
      const { heading, cells } = rows[index];
      const where = `${w}×${h} pixels at (${x}, ${y})`;
      heading.replaceChildren(index < study.places.length ? `Place ${index + 1} ` : "Your place ", make("small", {}, where));
      cells.forEach(({ canvas }, i) => {
        canvas.setAttribute("aria-label", `${study.pictures[i]}, ${where}${show === "picture" ? "" : ", error"}`);
        gallery.part(i, show, [x, y, w, h], canvas);
      });
    });
  }
  state.follow(["places", "show", "exposure", "tone", "arrived"], paint);
  paint();
}
