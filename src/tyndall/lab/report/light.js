// Linear light out of the page, and its way to the screen: exposure, tone curve, sRGB. See light.py for the format.

const CODES = 0x7bff >> 3;

/** The light that each code stands for. */
const lightOfCode = Float32Array.from({ length: CODES + 1 }, (_, code) => {
  const half = code << 3, exponent = half >> 10, fraction = half & 1023;
  return exponent ? 2 ** (exponent - 15) * (1 + fraction / 1024) : 2 ** -14 * (fraction / 1024);
});

/** Codes of red, green and blue, pixel by pixel, from the text of a block. */
async function decodeLight(text, width, height) {
  const packed = Uint8Array.from(atob(text.trim()), (character) => character.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const count = width * height;
  const codes = new Uint16Array(3 * count);
  const step = (at) => {
    const folded = bytes[at] | (bytes[at + 3 * count] << 8);
    return (folded >>> 1) ^ -(folded & 1);
  };
  for (let y = 0, at = 0; y < height; y++) {
    let green = 0, red = 0, blue = 0; // red and blue less green
    for (let x = 0; x < width; x++, at++) {
      green += step(at);
      red += step(count + at);
      blue += step(2 * count + at);
      codes[3 * at] = green + red;
      codes[3 * at + 1] = green;
      codes[3 * at + 2] = green + blue;
    }
  }
  return codes;
}

const LEVELS = 8191;
const srgbOfLevel = Uint8ClampedArray.from({ length: LEVELS + 1 }, (_, level) => {
  const x = level / LEVELS;
  return 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);
});
const encode = (x) => srgbOfLevel[x <= 0 ? 0 : x >= 1 ? LEVELS : (x * LEVELS + 0.5) | 0];

// The curves of tyndall's tonemap.wesl, without its dither: each maps light to three bytes of `out` from `at` on.
const TONES = {
  none(r, g, b, out, at) {
    out[at] = encode(r);
    out[at + 1] = encode(g);
    out[at + 2] = encode(b);
  },
  aces(r, g, b, out, at) {
    // Rec.709 to the fit's input space, rational fit of RRT and ODT, and back (Hill 2016).
    const fit = (v) => (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.432951) + 0.238081);
    const x = fit(0.59719 * r + 0.35458 * g + 0.04823 * b);
    const y = fit(0.076 * r + 0.90834 * g + 0.01566 * b);
    const z = fit(0.0284 * r + 0.13383 * g + 0.83777 * b);
    out[at] = encode(1.60475 * x - 0.53108 * y - 0.07367 * z);
    out[at + 1] = encode(-0.10208 * x + 1.10813 * y - 0.00605 * z);
    out[at + 2] = encode(-0.00327 * x - 0.07276 * y + 1.07602 * z);
  },
  agx(r, g, b, out, at) {
    // Sobotka's AgX in the polynomial form of Wrensch 2023; its output is display-encoded already.
    const curve = (v) => {
      const x = (clamp(Math.log2(Math.max(v, 1e-10)), -12.47393, 4.026069) + 12.47393) / 16.499999;
      const x2 = x * x, x4 = x2 * x2;
      return 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    };
    const x = curve(0.842479062253094 * r + 0.0784335999999992 * g + 0.0792237451477643 * b);
    const y = curve(0.0423282422610123 * r + 0.878468636469772 * g + 0.0791661274605434 * b);
    const z = curve(0.0423756549057051 * r + 0.0784336 * g + 0.879142973793104 * b);
    out[at] = 255 * (1.19687900512017 * x - 0.0980208811401368 * y - 0.0990297440797205 * z);
    out[at + 1] = 255 * (-0.0528968517574562 * x + 1.15190312990417 * y - 0.0989611768448433 * z);
    out[at + 2] = 255 * (-0.0529716355144438 * x - 0.0980434501171241 * y + 1.15107367264116 * z);
  },
};

/** Draw a part (x, y, w, h) of a picture's light at an exposure in EV into a canvas of that size. */
function develop(codes, width, [x, y, w, h], exposure, tone, canvas) {
  const context = canvas.getContext("2d"), picture = context.createImageData(w, h);
  const out = picture.data, curve = TONES[tone] ?? TONES.aces;
  const exposed = lightOfCode.map((light) => light * 2 ** exposure);
  for (let row = 0, at = 0; row < h; row++) {
    for (let i = 3 * ((y + row) * width + x), end = i + 3 * w; i < end; i += 3, at += 4) {
      curve(exposed[codes[i]], exposed[codes[i + 1]], exposed[codes[i + 2]], out, at);
      out[at + 3] = 255;
    }
  }
  context.putImageData(picture, 0, 0);
}

/**
 * The pictures and error maps of a comparison, ready to be drawn.
 *
 * What is there now is used at once; when something better is ready, `arrived` is called.
 */
function makeGallery(article, study, state, arrived) {
  const [width, height] = study.size;
  const images = study.pictures.map((_, i) => article.querySelector(`.strip img[data-picture="${i}"]`));
  for (const image of article.querySelectorAll(".strip img, .maps img")) image.addEventListener("load", arrived);
  const codes = new Map(), developed = new Map();
  const able = study.light && typeof DecompressionStream !== "undefined";

  /** A picture's light, or null until it is decoded. */
  function lightOf(index) {
    if (!able) return null;
    if (codes.has(index)) return codes.get(index);
    codes.set(index, null);
    const block = document.getElementById(`${article.id}-light-${index}`);
    decodeLight(block.textContent, width, height).then((found) => {
      codes.set(index, found);
      arrived();
    }, (error) => {
      codes.set(index, undefined); // its 8-bit picture stays
      console.error(`picture ${index} cannot be decoded: ${error}`);
    });
    return null;
  }

  const exposure = () => study.exposure + state.values.exposure;
  const loaded = (image) => (image?.complete ? image : null);

  /** A whole picture in 8 bits as a canvas or image, or null. */
  function whole(index, show) {
    if (show !== "picture") return loaded(findMap(article, show, study.pictures[index]));
    const light = lightOf(index);
    if (!light) return loaded(images[index]);
    const name = `${exposure()} ${state.values.tone}`;
    const found = developed.get(index) ?? { canvas: make("canvas", { width, height }) };
    if (found.name !== name) develop(light, width, [0, 0, width, height], exposure(), state.values.tone, found.canvas);
    developed.set(index, { ...found, name });
    return found.canvas;
  }

  return {
    whole,
    /** Whether light is still being decoded. */
    busy: () => [...codes.values()].includes(null),
    /** Draw a part (x, y, w, h) of a picture into a canvas of that size: of a large picture no more than that is developed. */
    part(index, show, place, canvas) {
      const light = show === "picture" ? lightOf(index) : null;
      if (light) {
        develop(light, width, place, exposure(), state.values.tone, canvas);
        return;
      }
      const [, , w, h] = place, context = canvas.getContext("2d"), source = whole(index, show);
      context.fillStyle = shared.palette[0];
      context.fillRect(0, 0, w, h);
      if (source) context.drawImage(source, ...place, 0, 0, w, h);
    },
    /** Linear light at a pixel, or null. */
    at(index, x, y) {
      const light = codes.get(index);
      return light ? [0, 1, 2].map((c) => lightOfCode[light[3 * (y * width + x) + c]]) : null;
    },
  };
}

/** The image of a technique's error map, or null: truth has none. */
function findMap(article, kind, label) {
  const figure = [...article.querySelectorAll(".maps")].find((f) => f.dataset.kind === kind);
  return figure ? [...figure.querySelectorAll("img")].find((image) => image.dataset.map === label) ?? null : null;
}
