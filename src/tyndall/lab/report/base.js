"use strict";
// What all parts of the page share: elements, numbers, and the state that the figures follow.

const shared = JSON.parse(document.getElementById("shared").textContent);
const TRUTH = "truth";

/** An element; `attributes` with a function value are listeners, null and false ones are left out. */
function make(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

/** The same for SVG. */
function draw(tag, attributes = {}, ...children) {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
}

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value);
    else if (value !== null && value !== undefined && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

/** So many significant digits, without an exponent, with a true minus sign. */
function significant(value, digits) {
  if (value === 0) return "0";
  const rounded = Number(value.toPrecision(digits));
  const places = clamp(digits - 1 - Math.floor(Math.log10(Math.abs(rounded))), 0, 12);
  return rounded.toFixed(places).replace("-", "−");
}

// Numbers keep their unit on their line.
const percent = (fraction) => `${significant(100 * fraction, Math.abs(fraction) >= 1 ? 3 : 2)}\u00a0%`;
const milliseconds = (ms) => `${significant(ms, 3)}\u00a0ms`;

/** Bytes in the largest unit that they fill. */
function bytesText(bytes) {
  const [size, unit] = bytes < 1024 ? [1, "B"] : bytes < 2 ** 20 ? [1024, "KiB"] : [2 ** 20, "MiB"];
  return `${significant(bytes / size, 3)}\u00a0${unit}`;
}

/** A metric's value with its unit. */
function scored(key, value) {
  const unit = shared.metrics[key]?.unit ?? "";
  if (unit === "%") return percent(value);
  return significant(value, 3) + (unit ? `\u00a0${unit}` : "");
}

/** The colour of a technique in every figure of the page. */
const colourOf = (index) => `var(--k${index % shared.colours})`;

/** Values that figures follow: `set` tells each listener which have changed, once per frame. */
function makeState(values) {
  const listeners = [];
  let changed = null;
  return {
    values,
    follow(names, listener) { listeners.push([names, listener]); },
    set(changes) {
      for (const [name, value] of Object.entries(changes)) {
        if (values[name] === value) continue;
        values[name] = value;
        if (!changed) {
          changed = new Set();
          requestAnimationFrame(() => {
            const told = changed;
            changed = null;
            for (const [names, listener] of listeners) if (names.some((n) => told.has(n))) listener(values);
          });
        }
        changed.add(name);
      }
    },
  };
}
