// Plots: cost against error with the Pareto front, and stacked bars. Each is drawn for the width that it has.

const COSTS = {
  gpu: { name: "GPU time of the technique (ms)", of: (r) => r.gpu?.median, spread: (r) => r.gpu, text: milliseconds },
  frame: { name: "GPU time of the frame (ms)", of: (r) => r.frame?.median, spread: (r) => r.frame, text: milliseconds },
  memory: { name: "memory of the technique (MiB)", of: (r) => r.memory / 2 ** 20, spread: () => null, text: (v) => bytesText(v * 2 ** 20) },
};
// Larger is better: their axes run the other way, so that down and left is better in every plot.
const turned = (key) => ["more", "one"].includes(shared.metrics[key]?.better);
const logarithmic = (key) => shared.metrics[key]?.better === "less" && key !== "flip";
const SHAPES = [
  (x, y, r) => `M${x - r},${y}a${r},${r} 0 1 0 ${2 * r},0a${r},${r} 0 1 0 ${-2 * r},0Z`,
  (x, y, r) => `M${x - r * 0.9},${y - r * 0.9}h${1.8 * r}v${1.8 * r}h${-1.8 * r}Z`,
  (x, y, r) => `M${x},${y - 1.25 * r}L${x + 1.15 * r},${y + 0.8 * r}H${x - 1.15 * r}Z`,
  (x, y, r) => `M${x},${y - 1.3 * r}L${x + 1.3 * r},${y}L${x},${y + 1.3 * r}L${x - 1.3 * r},${y}Z`,
  (x, y, r) => `M${x},${y + 1.25 * r}L${x + 1.15 * r},${y - 0.8 * r}H${x - 1.15 * r}Z`,
];
const shapeOf = (index) => SHAPES[index % SHAPES.length];

/** A scale from values to pixels, with its ticks: logarithmic over a decade or more of positive values. */
function makeScale(values, log, from, to) {
  let low = Math.min(...values), high = Math.max(...values);
  if (log) {
    [low, high] = [Math.log10(low), Math.log10(high)];
    const pad = Math.max(0.12 * (high - low), 0.15);
    [low, high] = [low - pad, high + pad];
    const powers = [];
    for (let p = Math.floor(low); p <= Math.ceil(high); p++) powers.push(p);
    const steps = high - low < 2.3 ? [1, 2, 5] : [1];
    const ticks = powers.flatMap((p) => steps.map((s) => s * 10 ** p)).filter((t) => Math.log10(t) >= low && Math.log10(t) <= high);
    const minor = powers.flatMap((p) => [2, 3, 4, 5, 6, 7, 8, 9].map((s) => s * 10 ** p)).filter((t) => Math.log10(t) >= low && Math.log10(t) <= high);
    return { at: (v) => from + ((Math.log10(v) - low) / (high - low)) * (to - from), ticks, minor };
  }
  if (low === high) [low, high] = [low - 0.5, high + 0.5];
  const pad = 0.08 * (high - low);
  [low, high] = [low - pad, high + pad];
  const rough = (high - low) / 5, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((s) => s * power).find((s) => s >= rough);
  const ticks = [];
  for (let t = Math.ceil(low / step) * step; t <= high + step / 1e6; t += step) ticks.push(Number(t.toPrecision(10)));
  return { at: (v) => from + ((v - low) / (high - low)) * (to - from), ticks, minor: [] };
}

/** Labels of those that no other beats at both: smaller is better. */
function paretoFront(points) {
  const sorted = [...points].sort((a, b) => a.cost - b.cost || a.error - b.error);
  const front = [];
  for (const point of sorted) {
    const last = front.at(-1);
    if (!last || point.error < last.error || (point.cost === last.cost && point.error === last.error)) front.push(point);
  }
  return front;
}

/** A technique's error; where the truth's noise hides it, what it may be at most. As `judged_error` in verdict.py. */
function errorOf(result, kind, key) {
  const scores = result.errors[kind] ?? {}, value = scores[key] ?? null;
  if (value === null) return null;
  if (key === "rel_rmse_corrected" && scores.within_noise && scores.rel_rmse_limit) return { value: scores.rel_rmse_limit, hidden: true };
  return { value: key === "bias" ? Math.abs(value) : value, hidden: false };
}

function setUpScatter(article, study, state) {
  const holder = article.querySelector('[data-role="scatter"]');
  const picker = (role) => article.querySelector(`.cost [data-role="${role}"]`);
  if (!study.judged) {
    holder.replaceWith(make("p", { class: "note" }, "There are no errors to plot."));
    return;
  }

  function paint() {
    const width = holder.clientWidth;
    if (!width) return;
    const kind = picker("kind")?.value ?? study.judged[0], key = picker("metric").value, cost = COSTS[picker("cost")?.value ?? "gpu"];
    const percentage = shared.metrics[key].unit === "%" ? 100 : 1;
    const sign = turned(key) ? -1 : 1;
    const scores = study.results.map((result, index) => {
      const error = errorOf(result, kind, key);
      return { result, index, error: error?.value ?? null, hidden: error?.hidden ?? false, cost: cost.of(result) };
    }).filter((p) => p.error !== null);
    const worded = (p) => (p.hidden ? "<\u00a0" : "") + scored(key, p.error);
    const log = logarithmic(key) || key === "bias";
    // What cannot stand on a logarithmic axis is told below the plot rather than drawn at a false place.
    const fits = (v, isLog) => Number.isFinite(v) && (!isLog || v > 0);
    const lines = scores.filter((p) => p.result.baseline && fits(p.error, log));
    const points = scores.filter((p) => !p.result.baseline && fits(p.error, log) && fits(p.cost, true));
    const absent = study.results.filter((r) => ![...lines, ...points].some((p) => p.result === r));
    const noise = key === "rel_rmse" ? study.noise[kind] : null; // the others have it taken off

    const height = clamp(width * 0.56, 300, 460), left = 62, right = 16, top = 16, bottom = 48;
    const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, height, role: "group" });
    const told = points.map((p) => `${p.result.label} ${cost.text(p.cost)}, ${worded(p)}`).join("; ");
    svg.setAttribute("aria-label", `${shared.metrics[key].name} against ${cost.name}: ${told || "no points"}`);
    const spread = points.flatMap((p) => { const s = cost.spread(p.result); return [p.cost, s?.min, s?.p95].filter((v) => v > 0); });
    const x = makeScale(spread.length ? spread : [1, 10], true, left, width - right);
    const errors = [...points, ...lines].map((p) => p.error * percentage);
    if (noise) errors.push(noise * percentage);
    const y = makeScale(errors.length ? errors : [1, 10], log, sign > 0 ? height - bottom : top, sign > 0 ? top : height - bottom);

    svg.append(draw("defs", {}, draw("pattern", { id: `${article.id}-hatch`, width: 7, height: 7, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" },
      draw("line", { x1: 0, y1: 0, x2: 0, y2: 7, stroke: "var(--edge)", "stroke-width": 1.6, opacity: 0.5 }))));
    for (const t of x.minor) svg.append(draw("g", { class: "tick" }, draw("line", { x1: x.at(t), x2: x.at(t), y1: height - bottom, y2: height - bottom + 3 })));
    for (const t of x.ticks) {
      svg.append(draw("g", { class: "tick" }, draw("line", { x1: x.at(t), x2: x.at(t), y1: top, y2: height - bottom + 6 }),
        draw("text", { x: x.at(t), y: height - bottom + 20, "text-anchor": "middle" }, plainNumber(t))));
    }
    for (const t of y.ticks) {
      svg.append(draw("g", { class: "tick" }, draw("line", { x1: left - 6, x2: width - right, y1: y.at(t), y2: y.at(t) }),
        draw("text", { x: left - 10, y: y.at(t) + 4, "text-anchor": "end" }, plainNumber(t))));
    }
    if (noise) {
      const at = y.at(noise * percentage);
      svg.append(draw("rect", { x: left, width: width - left - right, y: at, height: Math.max(0, height - bottom - at), fill: `url(#${article.id}-hatch)` }),
        draw("text", { x: width - right - 6, y: height - bottom - 7, "text-anchor": "end", class: "soft label" }, "truth’s own standard error"));
    }
    svg.append(draw("rect", { x: left, y: top, width: width - left - right, height: height - top - bottom, class: "frame" }));
    const metricName = `${shared.metrics[key].name}${key === "bias" ? ", absolute" : ""}`;
    const unit = shared.metrics[key].unit ? ` (${shared.metrics[key].unit})` : "";
    svg.append(draw("text", { x: (left + width - right) / 2, y: height - 8, "text-anchor": "middle" }, cost.name),
      draw("text", { transform: `translate(15 ${(top + height - bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, metricName + unit));

    // Errors that the truth's noise hides are equal: nothing tells them apart.
    const ranked = points.map((p) => ({ ...p, shown: p.error, error: p.hidden ? 0 : sign * p.error }));
    const front = paretoFront(ranked).map((p) => [x.at(p.cost), y.at(p.shown * percentage)]);
    const step = front.map(([fx], i) => [fx, Math.max(...front.slice(0, i + 1).map(([, fy]) => fy))]); // it never rises
    if (front.length) {
      // A step: between two points nothing better is known than the one on the left.
      const path = step.map(([fx, fy], i) => (i ? `H${fx}V${fy}` : `M${fx},${top}V${fy}`)).join("") + `H${width - right}`;
      svg.append(draw("path", { d: path, class: "front" }));
    }
    // Labels keep off marks, whiskers and lines.
    const taken = front.flatMap(([fx, fy], i) => [[fx - 2, i ? front[i - 1][1] : top, fx + 2, fy], [fx, fy - 2, front[i + 1]?.[0] ?? width - right, fy + 2]]);
    const marks = points.map((p) => [x.at(p.cost), y.at(p.error * percentage)]);
    for (const { result, index, error } of lines) {
      // Its label stands where the marks leave room.
      const at = y.at(error * percentage), text = `${result.label}: ${scored(key, error)}`;
      const near = (toRight) => marks.some(([mx, my]) => Math.abs(my - at) < 28 && (toRight ? width - right - mx < 170 : mx - left < 170));
      const toRight = near(false) && !near(true);
      svg.append(draw("g", { "data-result": index, class: "mark" }, draw("line", { class: "baseline", x1: left, x2: width - right, y1: at, y2: at }),
        draw("text", { x: toRight ? width - right - 8 : left + 8, y: at - 6, "text-anchor": toRight ? "end" : "start", class: "soft label" }, text)));
      taken.push(toRight ? [width - right - 150, at - 18, width - right, at + 2] : [left, at - 18, left + 150, at + 2]);
    }
    for (const point of points) {
      const { result, index, error, cost: value, hidden } = point;
      const px = x.at(value), py = y.at(error * percentage), color = colourOf(index), onFront = front.some(([fx, fy]) => fx === px && fy === py);
      const text = `${result.label}: ${cost.text(value)}, ${worded(point)}${onFront ? ", on the Pareto front" : ""}`;
      const choose = () => chooseTechnique(study, state, result.label, article);
      const mark = draw("g", { class: "point mark", "data-result": index, tabindex: 0, role: "button", "aria-label": `${text}; show it against the truth`,
        click: choose, keydown: (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); choose(); } } },
        draw("title", {}, text), draw("circle", { class: "halo", cx: px, cy: py, r: 15 }));
      const ends = cost.spread(result);
      if (ends?.min > 0 && ends.p95 > 0) mark.append(draw("path", { class: "whisker", stroke: color, fill: "none", d: `M${x.at(ends.min)},${py}H${x.at(ends.p95)}M${x.at(ends.min)},${py - 4}v8M${x.at(ends.p95)},${py - 4}v8` }));
      if (hidden) mark.append(draw("path", { class: "whisker", stroke: color, fill: "none", d: `M${px},${py}v26m-4,-6l4,6l4,-6` }));
      mark.append(draw("path", { d: shapeOf(index)(px, py, 6.5), fill: onFront ? color : "var(--paper)", stroke: color, "stroke-width": 2.2 }));
      svg.append(mark);
      taken.push([px - 9, py - 9, px + 9, py + (hidden ? 27 : 9)]);
      if (ends) taken.push([x.at(ends.min ?? value), py - 4, x.at(ends.p95 ?? value), py + 4]);
    }
    holder.replaceChildren(svg);
    if (absent.length) holder.append(make("p", { class: "note" }, `Without a place in this plot: ${absent.map((r) => r.label).join(", ")}.`));
    svg.querySelectorAll(".point").forEach((mark, i) => placeLabel(svg, mark, points[i], taken, [left, top, width - right, height - bottom]));

    function placeLabel(parent, mark, point, occupied, [x0, y0, x1, y1]) {
      const px = x.at(point.cost), py = y.at(point.error * percentage);
      const text = draw("text", { class: "label" }, point.result.label);
      mark.append(text);
      const w = text.getComputedTextLength(), h = 13;
      const places = [[12, 4], [-12 - w, 4], [-w / 2, -14], [-w / 2, 23], [10, -12], [10, 20], [-10 - w, -12], [-10 - w, 20]];
      const boxes = places.map(([dx, dy]) => [px + dx, py + dy - h, px + dx + w, py + dy + 3]);
      const overlap = ([a, b, c, d]) => occupied.reduce((sum, [e, f, g, k]) => sum + Math.max(0, Math.min(c, g) - Math.max(a, e)) * Math.max(0, Math.min(d, k) - Math.max(b, f)), 0)
        + 1000 * (Math.max(0, x0 - a) + Math.max(0, c - x1) + Math.max(0, y0 - b) + Math.max(0, d - y1));
      const best = boxes.reduce((found, box, i) => (overlap(box) < overlap(boxes[found]) - 1 ? i : found), 0);
      text.setAttribute("x", boxes[best][0]);
      text.setAttribute("y", boxes[best][3] - 3);
      occupied.push(boxes[best]);
    }
  }
  for (const role of ["kind", "metric", "cost"]) picker(role)?.addEventListener("change", paint);
  new ResizeObserver(paint).observe(holder);
}

/** A tick's label: 0.01, 10, 20 000. */
function plainNumber(value) {
  if (Math.abs(value) >= 1e4) return value.toLocaleString("en").replaceAll(",", " ");
  return String(Number(value.toPrecision(6))).replace("-", "−");
}

/** Show a technique against the truth, or against what is on the right. */
function chooseTechnique(study, state, label, article) {
  const left = study.pictures.indexOf(label), right = study.pictures.indexOf(TRUTH);
  if (left < 0) return;
  state.set({ left, ...(right >= 0 && right !== left ? { right } : {}) });
  article.querySelector(".viewer").scrollIntoView({ block: "start" });
}

/**
 * Stacked bars, one per technique.
 *
 * `parts` gives [name, value, own] of a result; those that are not its own are one part, and only drawn when asked for.
 */
function setUpBars(article, study, role, unit, parts, text) {
  const holder = article.querySelector(`.plot[data-role="${role}"]`);
  if (!holder) return;
  const all = article.querySelector(`[data-role="${role}-all"]`);

  function paint() {
    const width = holder.clientWidth;
    if (!width) return;
    const rows = study.results.map((result, index) => ({ result, index, parts: parts(result).filter(([, value, own]) => value > 0 && (own || all.checked)) }));
    const totals = rows.map((row) => row.parts.reduce((sum, [, value]) => sum + value, 0));
    const most = Math.max(...totals, 1e-12);
    const gutter = Math.min(150, width * 0.3), space = 74, line = 34, top = 6, height = top + rows.length * line + 40;
    const rough = most / Math.max(2, Math.floor((width - gutter - space) / 90)), power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((s) => s * power).find((s) => s >= rough);
    const at = (value) => gutter + (value / most) * (width - gutter - space);
    const told = rows.map(({ result }, i) => `${result.label} ${text(totals[i])}`).join("; ");
    const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, height, role: "group", "aria-label": `${unit} per technique: ${told}` });
    for (let t = 0; t <= most * 1.0001; t += step) {
      svg.append(draw("g", { class: "tick" }, draw("line", { x1: at(t), x2: at(t), y1: top, y2: height - 36 }),
        draw("text", { x: at(t), y: height - 21, "text-anchor": "middle" }, plainNumber(t))));
    }
    svg.append(draw("text", { x: gutter + (width - gutter - space) / 2, y: height - 3, "text-anchor": "middle" }, unit));
    const legend = make("p", { class: "legend", "aria-live": "polite" });
    rows.forEach(({ result, index, parts: found }, i) => {
      const y = top + i * line, group = draw("g", { class: "mark", "data-result": index });
      const name = draw("text", { x: gutter - 10, y: y + line / 2 + 2, "text-anchor": "end" }, result.label);
      group.append(name);
      let from = 0;
      found.forEach(([label, value, own], n) => {
        const owned = found.filter((p) => p[2]).length;
        // A technique's own parts are shades of its colour, told apart by their edges too; the rest is grey.
        const shade = owned > 1 ? 100 - (45 * n) / Math.max(1, owned - 1) : 100;
        const colour = own ? `color-mix(in oklab, ${colourOf(index)} ${shade}%, var(--paper))` : "color-mix(in oklab, var(--edge) 55%, var(--paper))";
        const share = `${result.label}: ${label}, ${text(value)}`;
        const tell = () => { legend.textContent = share; };
        group.append(draw("rect", { class: "part", x: at(from), y: y + 5, width: Math.max(1, at(from + value) - at(from)), height: line - 12, fill: colour,
          tabindex: 0, role: "img", "aria-label": share, pointerenter: tell, focus: tell }, draw("title", {}, share)));
        from += value;
      });
      group.append(draw("text", { x: at(totals[i]) + 7, y: y + line / 2 + 2, class: "soft" }, text(totals[i])));
      svg.append(group);
    });
    holder.replaceChildren(svg, legend);
    svg.querySelectorAll("g.mark > text:first-child").forEach((name) => shorten(name, gutter - 14));
  }
  all.addEventListener("change", paint);
  new ResizeObserver(paint).observe(holder);
}

/** Cut a label that is too long for its place; the whole one stays in the table and in the part's name. */
function shorten(element, room) {
  let text = element.textContent;
  while (text.length > 3 && element.getComputedTextLength() > room) {
    text = text.slice(0, -1);
    element.textContent = `${text}…`;
  }
}

/** Name and value of each pass of a frame: the technique's own by its last words, the others by their whole names. */
function partsOf(family, items) {
  return items.map(([name, value]) => {
    const own = name === family || name.startsWith(`${family}.`);
    return [own ? name.split(".").slice(2).join(".") || name.split(".").at(-1) : name, value, own];
  }).sort((a, b) => b[2] - a[2]);
}

function setUpPlots(article, study, state) {
  setUpScatter(article, study, state);
  setUpBars(article, study, "passes", "GPU ms", (r) => partsOf(study.family, r.passes), milliseconds);
  const owners = (r) => (r.owners.length ? partsOf(study.family, r.owners) : [[study.family, r.memory ?? 0, true]]);
  setUpBars(article, study, "memory", "MiB", (r) => owners(r).map(([name, bytes, own]) => [name, bytes / 2 ** 20, own]), (v) => bytesText(v * 2 ** 20));
}
