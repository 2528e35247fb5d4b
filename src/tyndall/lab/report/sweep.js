// A sweep's plots: any measure against anything that varies or was measured, a panel for each value of a third.

function setUpSweep(article) {
  const study = JSON.parse(article.querySelector("script.data").textContent);
  article.querySelectorAll(".explorer").forEach((section) => setUpExplorer(section, study));
  article.querySelectorAll(".sortable").forEach(setUpTable);
}

function setUpExplorer(section, study) {
  const part = (role) => section.querySelector(`[data-role="${role}"]`);
  const dimension = (name) => study.dimensions.find((d) => d.name === name);
  const measure = (name) => study.measures.find((m) => m.name === name);
  const count = (study.dimensions[0] ?? study.measures[0]).places?.length ?? study.measures[0].values.length;
  const filters = new Map(); // what is kept of a dimension, by its name

  /** A filter for each dimension that is neither drawn nor told by another one that is. */
  function showFilters() {
    const used = ["x", "series", "facet"].map((role) => part(role).value);
    const open = study.dimensions.filter((d) => !used.includes(d.name) && d.name !== "variant" && !(used.includes("variant") && (d.name === "technique" || d.name.includes("."))));
    for (const name of [...filters.keys()]) if (!open.some((d) => d.name === name)) filters.delete(name);
    part("filters").replaceChildren(...open.map((d) => {
      const options = ["all", ...d.values].map((text, i) => make("option", { value: i - 1, selected: (filters.get(d.name) ?? -1) === i - 1 }, text));
      const choose = (event) => { filters.set(d.name, Number(event.target.value)); paint(); };
      return make("label", {}, make("span", {}, `Only ${d.name}`), make("select", { change: choose }, ...options));
    }));
  }

  function paint() {
    const width = part("plots").clientWidth;
    if (!width) return;
    const across = dimension(part("x").value), acrossMeasure = measure(part("x").value), up = measure(part("y").value);
    const series = dimension(part("series").value), facet = dimension(part("facet").value);
    const kept = (row) => [...filters].every(([name, place]) => place < 0 || dimension(name).places[row] === null || dimension(name).places[row] === place);
    const xOf = (row) => {
      if (acrossMeasure) return acrossMeasure.values[row];
      const place = across.places[row];
      return place === null ? null : across.numbers ? across.numbers[place] : place;
    };
    const logX = acrossMeasure ? acrossMeasure.log : Boolean(across.numbers) && Math.min(...across.numbers) > 0 && Math.max(...across.numbers) / Math.min(...across.numbers) >= 4;
    const positive = (value, log) => value !== null && Number.isFinite(value) && (!log || value > 0);
    const rows = Array.from({ length: count }, (_, row) => row).filter((row) => kept(row) && positive(xOf(row), logX) && positive(up.values[row], up.log));

    const seriesUsed = [...new Set(rows.map((row) => series.places[row]))].filter((place) => place !== null).sort((a, b) => a - b);
    part("legend").replaceChildren(...seriesUsed.map((place) => make("span", {},
      draw("svg", { width: 14, height: 14, viewBox: "0 0 14 14", "aria-hidden": "true" }, draw("path", { d: shapeOf(place)(7, 7, 5), fill: colourOf(place) })), ` ${series.values[place]}`)));
    if (!rows.length) {
      part("plots").replaceChildren(make("p", { class: "note" }, "No point has both."));
      return;
    }

    const panels = facet ? facet.values.map((name, place) => [name, rows.filter((row) => facet.places[row] === place)]).filter(([, own]) => own.length) : [["", rows]];
    const columns = clamp(Math.floor(width / 340), 1, panels.length), panel = Math.floor((width - 24 * (columns - 1)) / columns);
    part("plots").style.setProperty("--columns", columns);
    part("plots").replaceChildren(...panels.map(([name, own]) => drawPanel(name, own, panel)));

    function drawPanel(name, own, size) {
      const height = clamp(size * 0.68, 240, 400), left = 58, right = 14, top = name ? 30 : 12, bottom = 46;
      const x = across && !across.numbers ? categories(across, left, size - right) : makeScale(rows.map(xOf), logX, left, size - right);
      if (across?.numbers && across.numbers.length <= 8) Object.assign(x, { ticks: across.numbers, minor: [] });
      const y = makeScale(rows.map((row) => up.values[row]), up.log, height - bottom, top);
      const unit = (m) => (m.unit ? `${m.name} (${m.unit})` : m.name), xName = acrossMeasure ? unit(acrossMeasure) : across.name;
      const svg = draw("svg", { viewBox: `0 0 ${size} ${height}`, height, role: "img", "aria-label": `${name ? `${name}: ` : ""}${unit(up)} against ${xName}, ${own.length} points` });
      for (const t of x.ticks) {
        svg.append(draw("g", { class: "tick" }, draw("line", { x1: x.at(t), x2: x.at(t), y1: top, y2: height - bottom + 5 }),
          draw("text", { x: x.at(t), y: height - bottom + 18, "text-anchor": "middle" }, x.label?.(t) ?? plainNumber(t))));
      }
      for (const t of y.ticks) {
        svg.append(draw("g", { class: "tick" }, draw("line", { x1: left - 5, x2: size - right, y1: y.at(t), y2: y.at(t) }),
          draw("text", { x: left - 9, y: y.at(t) + 4, "text-anchor": "end" }, plainNumber(t))));
      }
      svg.append(draw("rect", { x: left, y: top, width: size - left - right, height: height - top - bottom, class: "frame" }),
        draw("text", { x: (left + size - right) / 2, y: height - 8, "text-anchor": "middle" }, xName),
        draw("text", { transform: `translate(13 ${(top + height - bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, unit(up)));
      if (name) svg.append(draw("text", { x: left, y: 18, "font-weight": 600 }, name));

      if (across) {
        // Points that differ in nothing else.
        const others = study.dimensions.filter((d) => d !== across && !(d.name === "variant" && across.name.includes(".")));
        const lines = new Map();
        for (const row of own) {
          const key = others.map((d) => d.places[row]).join();
          lines.set(key, [...(lines.get(key) ?? []), row]);
        }
        for (const line of lines.values()) {
          line.sort((a, b) => xOf(a) - xOf(b));
          const d = line.map((row, i) => `${i ? "L" : "M"}${x.at(xOf(row))},${y.at(up.values[row])}`).join("");
          svg.append(draw("path", { d, fill: "none", stroke: colourOf(series.places[line[0]] ?? 0), "stroke-width": 1.8, opacity: 0.7 }));
        }
      } else {
        // Only what solves the same problem competes: a front for each, without what draws nothing.
        const technique = dimension("technique"), problem = ["scene", "lights", "size"].map(dimension).filter(Boolean);
        const problems = new Map();
        for (const row of own) {
          if (technique?.values[technique.places[row]] === "off") continue;
          const key = problem.map((d) => d.places[row]).join();
          problems.set(key, [...(problems.get(key) ?? []), { cost: xOf(row), error: up.values[row] }]);
        }
        for (const points of problems.values()) {
          const front = paretoFront(points);
          svg.append(draw("path", { class: "front", d: front.map((p, i) => (i ? `H${x.at(p.cost)}V${y.at(p.error)}` : `M${x.at(p.cost)},${top}V${y.at(p.error)}`)).join("") + `H${size - right}` }));
        }
      }
      for (const row of own) {
        const place = series.places[row] ?? 0;
        const told = study.dimensions.filter((d) => d.places[row] !== null && d.name !== "variant").map((d) => `${d.name} ${d.values[d.places[row]]}`);
        const values = [acrossMeasure, up].filter(Boolean).map((m) => `${m.name} ${m.hidden.includes(row) ? "< " : ""}${significant(m.values[row], 3)} ${m.unit}`);
        svg.append(draw("path", { class: "dot", "data-row": row, d: shapeOf(place)(x.at(xOf(row)), y.at(up.values[row]), 5), fill: colourOf(place), stroke: "var(--paper)" },
          draw("title", {}, [...told, ...values].join("\n"))));
      }
      return svg;
    }
  }

  function categories(across, from, to) {
    const ticks = across.values.map((_, i) => i);
    return { at: (place) => from + ((place + 0.5) / ticks.length) * (to - from), ticks, label: (place) => across.values[place] };
  }

  for (const role of ["x", "y", "series", "facet"]) part(role).addEventListener("change", () => { showFilters(); paint(); });
  showFilters();
  new ResizeObserver(paint).observe(part("plots"));
}
