// Two pictures under a divider: zoom, pan, exposure, and the values under the pointer.

const MOST_ZOOM = 64; // screen pixels for one of the picture

function setUpViewer(article, study, state, gallery) {
  const part = (role) => article.querySelector(`.viewer [data-role="${role}"]`);
  const stage = part("stage"), canvas = part("canvas"), divider = part("divider"), context = canvas.getContext("2d");
  const [width, height] = study.size;
  const view = { scale: 0, x: width / 2, y: height / 2 }; // 0: the whole picture; else CSS pixels for one; its middle
  let pixels = [0, 0], ratio = 1;

  const whole = () => Math.min(stage.clientWidth / width, stage.clientHeight / height);
  const scaleNow = () => view.scale || whole();
  const origin = () => {
    const s = scaleNow();
    return view.scale ? [stage.clientWidth / 2 - view.x * s, stage.clientHeight / 2 - view.y * s]
      : [(stage.clientWidth - width * s) / 2, (stage.clientHeight - height * s) / 2];
  };

  // --- drawing ----------------------------------------------------------------------------------------------------

  function measure() {
    ratio = window.devicePixelRatio || 1;
    pixels = [Math.round(stage.clientWidth * ratio), Math.round(stage.clientHeight * ratio)];
    if (canvas.width !== pixels[0] || canvas.height !== pixels[1]) [canvas.width, canvas.height] = pixels;
  }

  function paint() {
    if (!stage.clientWidth) return;
    measure();
    const { left, right, split, show } = state.values;
    const [x, y] = origin(), s = scaleNow() * ratio;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = "#08090a";
    context.fillRect(0, 0, ...pixels);
    const middle = Math.round(split * pixels[0]);
    paintHalf(left, 0, middle);
    paintHalf(right, middle, pixels[0] - middle);
    stage.setAttribute("aria-busy", gallery.busy());
    if (state.values.frames) paintPlaces(x * ratio, y * ratio, s);
    divider.style.left = `${100 * split}%`;
    divider.setAttribute("aria-valuenow", Math.round(100 * split));
    divider.setAttribute("aria-valuetext", `${Math.round(100 * split)} % ${study.pictures[left]}, the rest ${study.pictures[right]}`);

    function paintHalf(index, from, extent) {
      if (extent <= 0) return;
      context.save();
      context.beginPath();
      context.rect(from, 0, extent, pixels[1]);
      context.clip();
      context.imageSmoothingEnabled = s < 1;
      context.imageSmoothingQuality = "high";
      const source = gallery.whole(index, show);
      if (source) context.drawImage(source, x * ratio, y * ratio, width * s, height * s);
      else if (show !== "picture") {
        context.fillStyle = shared.palette[0];
        context.fillRect(x * ratio, y * ratio, width * s, height * s);
      }
      context.restore();
    }
  }

  function paintPlaces(x, y, s) {
    context.font = `600 ${12 * ratio}px system-ui, sans-serif`;
    state.values.places.forEach(([px, py, w, h], i) => {
      const box = [x + px * s, y + py * s, w * s, h * s].map(Math.round);
      context.lineWidth = 3 * ratio;
      context.strokeStyle = "rgb(0 0 0 / 0.7)";
      context.strokeRect(...box);
      context.lineWidth = ratio;
      context.strokeStyle = "#fff";
      context.strokeRect(...box);
      const name = placeName(study, i);
      context.lineWidth = 3 * ratio;
      context.strokeStyle = "rgb(0 0 0 / 0.8)";
      context.strokeText(name, box[0] + 4 * ratio, box[1] + 14 * ratio);
      context.fillStyle = "#fff";
      context.fillText(name, box[0] + 4 * ratio, box[1] + 14 * ratio);
    });
  }

  function describe() {
    const { left, right, show, exposure } = state.values;
    const names = [study.pictures[left], study.pictures[right]];
    const kind = show === "picture" ? "" : `, error of the ${shared.kinds[show] ?? show}`;
    part("name-left").textContent = names[0];
    part("name-right").textContent = names[1];
    const scale = study.maps[show];
    part("scale").hidden = !scale;
    if (scale) part("scale").querySelectorAll("span").forEach((end, i) => { end.textContent = percent([scale.low, scale.high][i]); });
    canvas.setAttribute("aria-label", `${study.scene}: ${names[0]} on the left, ${names[1]} on the right${kind}`);
    part("left").value = left;
    part("right").value = right;
    if (part("exposed")) {
      part("exposed").textContent = `${exposure > 0 ? "+" : exposure < 0 ? "−" : "±"}${Math.abs(exposure).toFixed(exposure ? 1 : 0)} EV`;
      part("exposure").value = exposure;
    }
    part("zoom").textContent = `${Math.round(100 * scaleNow())}\u00a0%`;
    stage.classList.toggle("zoomed", Boolean(view.scale));
    article.querySelectorAll(".strip button").forEach((button, i) => button.setAttribute("aria-pressed", i === left || i === right));
  }

  const refresh = () => { describe(); paint(); };
  state.follow(["left", "right", "split", "show", "exposure", "tone", "view", "places", "frames", "arrived"], refresh);
  new ResizeObserver(refresh).observe(stage);

  // --- zoom and pan -------------------------------------------------------------------------------------------------

  /** Zoom by a factor; the point (cx, cy) of the stage, in CSS pixels, stays where it is. */
  function zoom(factor, cx = stage.clientWidth / 2, cy = stage.clientHeight / 2) {
    const old = scaleNow(), [x, y] = origin();
    const next = clamp(old * factor, whole(), MOST_ZOOM);
    if (next <= whole() * 1.001) return fit();
    const at = [(cx - x) / old, (cy - y) / old];
    view.scale = next;
    view.x = at[0] - (cx - stage.clientWidth / 2) / next;
    view.y = at[1] - (cy - stage.clientHeight / 2) / next;
    settle();
  }

  function pan(dx, dy) {
    if (!view.scale) return;
    view.x -= dx / view.scale;
    view.y -= dy / view.scale;
    settle();
  }

  function fit() {
    Object.assign(view, { scale: 0, x: width / 2, y: height / 2 });
    settle();
  }

  function settle() {
    view.x = clamp(view.x, 0, width);
    view.y = clamp(view.y, 0, height);
    state.set({ view: `${view.scale} ${view.x} ${view.y}` });
  }

  const local = (event) => {
    const box = stage.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };

  function pixelUnder(event) {
    const [cx, cy] = local(event), [x, y] = origin(), s = scaleNow();
    const found = [Math.floor((cx - x) / s), Math.floor((cy - y) / s)];
    return found[0] >= 0 && found[1] >= 0 && found[0] < width && found[1] < height ? found : null;
  }

  stage.addEventListener("wheel", (event) => {
    // A page that scrolls must not be caught by a picture under the pointer: the wheel zooms once it has been chosen.
    if (!event.ctrlKey && !event.metaKey && !stage.contains(document.activeElement)) {
      part("hint").hidden = false;
      clearTimeout(stage.hinting);
      stage.hinting = setTimeout(() => { part("hint").hidden = true; }, 1400);
      return;
    }
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 16 : 1;
    zoom(2 ** (-clamp(event.deltaY * lines, -240, 240) / (event.ctrlKey ? 120 : 240)), ...local(event));
  }, { passive: false });

  // Pointers: one drags the divider or the picture, two pinch.
  const pointers = new Map();
  let drag = null;

  stage.addEventListener("pointerdown", (event) => {
    if (event.button > 0) return;
    pointers.set(event.pointerId, local(event));
    stage.setPointerCapture(event.pointerId);
    const onDivider = Math.abs(local(event)[0] - state.values.split * stage.clientWidth) < 22;
    const moves = pointers.size > 1 ? "pinch" : onDivider ? "divider" : view.scale ? "picture" : "divider from afar";
    drag = { moves, start: local(event), far: moves === "pinch" }; // what has been far is no click
    if (event.target.closest('[role="slider"]')) return;
    stage.focus({ preventScroll: true });
  });

  stage.addEventListener("pointermove", (event) => {
    state.set({ probe: pixelUnder(event) });
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const now = local(event);
    if (pointers.size === 2) {
      const [other] = [...pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      const apart = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]);
      zoom(apart(now) / Math.max(apart(before), 1), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
      pan((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
    } else if (drag) {
      drag.far ||= Math.hypot(now[0] - drag.start[0], now[1] - drag.start[1]) > 4;
      if (drag.moves === "divider" || (drag.moves === "divider from afar" && drag.far)) {
        state.set({ split: clamp(now[0] / stage.clientWidth, 0, 1) });
      } else if (drag.moves === "picture" && drag.far) {
        stage.classList.add("moving");
        pan(now[0] - before[0], now[1] - before[1]);
      }
    }
    pointers.set(event.pointerId, now);
  });

  function release(event) {
    const click = drag && !drag.far && drag.moves !== "divider" && pointers.size === 1 && event.type === "pointerup";
    pointers.delete(event.pointerId);
    stage.classList.remove("moving");
    const at = click ? pixelUnder(event) : null;
    if (at) pick(at);
    if (!pointers.size) drag = null;
  }
  stage.addEventListener("pointerup", release);
  stage.addEventListener("pointercancel", release);
  stage.addEventListener("pointerleave", () => { if (!pointers.size) state.set({ probe: null }); });

  /** A close-up of one's own, the last in the list. */
  function pick([x, y]) {
    const [w, h] = study.patch;
    const place = [clamp(x - (w >> 1), 0, width - w), clamp(y - (h >> 1), 0, height - h), w, h];
    state.set({ places: [...state.values.places.slice(0, study.places.length), place] });
  }

  // --- keys -------------------------------------------------------------------------------------------------------

  divider.addEventListener("keydown", (event) => {
    const step = event.shiftKey ? 0.1 : 0.01, { split } = state.values;
    const targets = { ArrowLeft: split - step, ArrowDown: split - step, ArrowRight: split + step, ArrowUp: split + step,
      PageDown: split - 0.1, PageUp: split + 0.1, Home: 0, End: 1 };
    if (!(event.key in targets) || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation();
    state.set({ split: clamp(Math.round(1000 * targets[event.key]) / 1000, 0, 1) });
  });

  const swap = () => state.set({ left: state.values.right, right: state.values.left });
  stage.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const far = event.shiftKey ? 160 : 40;
    const digit = /^Digit([1-9])$/.exec(event.code)?.[1];
    const actions = { "+": () => zoom(Math.SQRT2), "=": () => zoom(Math.SQRT2), "-": () => zoom(Math.SQRT1_2), 0: fit,
      x: swap, X: swap, ArrowLeft: () => pan(far, 0), ArrowRight: () => pan(-far, 0), ArrowUp: () => pan(0, far),
      ArrowDown: () => pan(0, -far), Enter: () => pick([Math.floor(view.x), Math.floor(view.y)]) };
    if (digit && digit <= study.pictures.length) {
      state.set({ [event.shiftKey ? "right" : "left"]: digit - 1 });
    } else if (actions[event.key] && (view.scale || !event.key.startsWith("Arrow"))) actions[event.key]();
    else return;
    event.preventDefault();
  });

  // --- controls ---------------------------------------------------------------------------------------------------

  for (const side of ["left", "right"]) part(side).addEventListener("change", (event) => state.set({ [side]: Number(event.target.value) }));
  part("swap").addEventListener("click", swap);
  part("in").addEventListener("click", () => zoom(Math.SQRT2));
  part("out").addEventListener("click", () => zoom(Math.SQRT1_2));
  part("fit").addEventListener("click", fit);
  for (const radio of article.querySelectorAll('.viewer [data-role="show"]')) {
    radio.addEventListener("change", () => state.set({ show: radio.value }));
  }
  part("exposure")?.addEventListener("input", (event) => state.set({ exposure: Number(event.target.value) }));
  part("exposure")?.addEventListener("dblclick", () => state.set({ exposure: 0 }));
  part("frames").addEventListener("change", (event) => state.set({ frames: event.target.checked }));
  part("tone")?.addEventListener("change", (event) => state.set({ tone: event.target.value }));

  // The pictures below choose the left one, with Shift the right one.
  article.querySelectorAll(".strip figure").forEach((figure, i) => {
    const image = figure.querySelector("img"), name = study.pictures[i];
    const choose = (event) => state.set({ [event.shiftKey ? "right" : "left"]: i });
    const button = make("button", { type: "button", click: choose, "aria-label": `Show ${name} on the left; with Shift on the right` });
    image.replaceWith(button);
    button.append(image);
  });

  // --- values -----------------------------------------------------------------------------------------------------

  state.follow(["probe", "left", "right"], ({ probe, left, right }) => {
    const line = part("values");
    if (!probe) {
      line.textContent = "Move the pointer over the picture to read its values.";
      return;
    }
    const values = [left, right].map((index) => {
      const light = gallery.at(index, ...probe);
      const errors = Object.entries(study.maps).map(([kind, scale]) => {
        const map = findMap(article, kind, study.pictures[index]);
        const number = map ? colourAt(map, ...probe) : null;
        const what = study.pictures[index] === TRUTH ? "standard error" : "error";
        return number === null ? null : `${what} of the ${shared.kinds[kind] ?? kind} ${errorText(scale, number)}`;
      });
      const words = [light && `radiance ${light.map((v) => significant(v, 2)).join(", ")}`, ...errors].filter(Boolean);
      return [make("b", {}, study.pictures[index]), ` ${words.join(" · ")}`];
    });
    line.replaceChildren(`pixel ${probe.join(", ")} `, make("br"), ...values[0], make("br"), ...values[1]);
  });

  refresh();
}

/** What a place is called: the ones found by the report are numbered, the reader's own is not. */
const placeName = (study, index) => (index < study.places.length ? String(index + 1) : "yours");
