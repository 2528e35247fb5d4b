// Error maps: the value under the pointer, at the same pixel of every map.

const colourNumbers = new Map(shared.palette.map((colour, i) => [parseInt(colour.slice(1), 16), i]));

/** The nearest colour's number: browsers that guard against fingerprinting change a canvas by a little. */
function nearestColour(r, g, b) {
  const exact = colourNumbers.get((r << 16) | (g << 8) | b);
  if (exact !== undefined) return exact;
  let best = 0, least = Infinity;
  for (const [colour, i] of colourNumbers) {
    const distance = ((colour >> 16) - r) ** 2 + (((colour >> 8) & 255) - g) ** 2 + ((colour & 255) - b) ** 2;
    if (distance < least) [best, least] = [i, distance];
  }
  return best;
}

const pixelsOfMap = new WeakMap();

/** The colour number at a pixel of a map that has been loaded, else null. */
function colourAt(image, x, y) {
  if (!image.complete || !image.naturalWidth) return null;
  if (!pixelsOfMap.has(image)) {
    const canvas = make("canvas", { width: image.naturalWidth, height: image.naturalHeight });
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(image, 0, 0);
    pixelsOfMap.set(image, context.getImageData(0, 0, canvas.width, canvas.height));
  }
  const { data, width } = pixelsOfMap.get(image);
  const at = 4 * (y * width + x);
  return nearestColour(data[at], data[at + 1], data[at + 2]);
}

/** The error that a colour stands for. */
const errorOfColour = (scale, number) => scale.low * (scale.high / scale.low) ** (number / 255);

/** In words: at the ends of the scale it is only known to be beyond. */
function errorText(scale, number) {
  const bound = number === 0 ? "≤ " : number === 255 ? "≥ " : "";
  return bound + percent(errorOfColour(scale, number));
}

function setUpMaps(article, study, state) {
  const [width, height] = study.size;
  for (const figure of article.querySelectorAll(".maps")) {
    const scale = study.maps[figure.dataset.kind];
    const ramp = figure.querySelector('[data-role="ramp"]');
    const cells = [...figure.querySelectorAll(".grid figure")].map((cell) => {
      const image = cell.querySelector("img"), cross = make("i", { class: "cross", hidden: true });
      cell.append(cross);
      const tick = ramp.appendChild(make("i", { hidden: true }));
      const look = (event) => {
        const box = image.getBoundingClientRect();
        state.set({ probe: pixelAt((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height) });
      };
      image.addEventListener("pointermove", look);
      image.addEventListener("pointerdown", look);
      image.addEventListener("pointerleave", () => { if (document.activeElement !== image) state.set({ probe: null }); });
      image.addEventListener("focus", () => { if (!state.values.probe) state.set({ probe: pixelAt(0.5, 0.5) }); });
      image.addEventListener("blur", () => state.set({ probe: null }));
      image.addEventListener("keydown", (event) => {
        const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
        const move = moves[event.key], probe = state.values.probe;
        if (!move || !probe) return;
        event.preventDefault();
        const step = event.shiftKey ? 10 : 1;
        state.set({ probe: [clamp(probe[0] + step * move[0], 0, width - 1), clamp(probe[1] + step * move[1], 0, height - 1)] });
      });
      return { image, cross, tick, output: cell.querySelector("output") };
    });
    state.follow(["probe"], ({ probe }) => {
      for (const { image, cross, tick, output } of cells) {
        const number = probe ? colourAt(image, ...probe) : null;
        cross.hidden = tick.hidden = number === null;
        output.textContent = number === null ? "" : errorText(scale, number);
        if (number === null) continue;
        cross.style.left = `${((probe[0] + 0.5) / width) * image.clientWidth}px`;
        cross.style.top = `${((probe[1] + 0.5) / height) * image.clientHeight}px`;
        tick.style.left = `${(100 * number) / 255}%`;
      }
    });
  }

  function pixelAt(u, v) {
    return [clamp(Math.floor(u * width), 0, width - 1), clamp(Math.floor(v * height), 0, height - 1)];
  }
}
