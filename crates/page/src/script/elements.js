// Elements and texts. Data is set as text, never as markup.

const SVG = "http://www.w3.org/2000/svg";
const LONG = 400;

function put(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes ?? {})) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value !== false && value !== null && value !== undefined) node.setAttribute(name, value === true ? "" : value);
  }
  for (const child of children) if (child !== null && child !== undefined) node.append(child);
  return node;
}

const element = (tag, attributes, ...children) => put(document.createElement(tag), attributes, children);
const shape = (tag, attributes, ...children) => put(document.createElementNS(SVG, tag), attributes, children);

// A text of the data, in its own writing direction; a long text is folded.
function words(text) {
  if (text.length <= LONG) return element("span", { class: "text", dir: "auto" }, text);
  const start = element("summary", { class: "text", dir: "auto" }, `${text.slice(0, 120)}… (${text.length} characters)`);
  return element("details", { class: "long" }, start, element("span", { class: "text", dir: "auto" }, text));
}

// Formats a time for a slider or an axis, with as many digits as are needed to distinguish the times.
function rounded(value, step) {
  const digits = Math.max(0, Math.min(6, Math.ceil(-Math.log10(step))));
  const text = value.toFixed(digits);
  return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
}

// Returns a round step, so that about `count` steps fit.
function niceStep(range, count) {
  const raw = range / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(raw));
  return power * ([1, 2, 5, 10].find((factor) => factor * power >= raw) ?? 10);
}

// Calls a function once before the next frame, even if it was requested several times.
function soon(task) {
  let waiting = false;
  return () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; task(); });
  };
}

// Returns the last position with a time of at most `time`, or -1; `times` is ascending.
function lastAt(times, time) {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}
