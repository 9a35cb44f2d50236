// Slice of a region by two quantities: the values for which the plan works, with the others at chosen values.

// The lines of boxes: colours of Okabe and Ito, each with a different dash pattern.
const BOX_DASHES = ["", "9 4", "3 3", "11 3 2 3"];
const PLANE = { left: 58, top: 8, side: 360, below: 46 };

// `isDriven`: other sliders set the values, by `set`.
function planeView(section, isDriven) {
  const own = section.quantities;
  const values = own.map((it) => it.nominal);
  let axes = own.length > 1 ? [0, 1] : [0, 0];
  const choice = (label, axis) => {
    const select = element("select", { "data-axis": axis, onchange: () => {
      const other = axes[1 - axis], chosen = Number(select.value);
      if (chosen === other) axes = [axes[1], axes[0]];
      else axes[axis] = chosen;
      draw();
    } }, ...own.map((it, index) => element("option", { value: index }, `${it.name}: ${it.quantity}`)));
    return { select, node: element("label", {}, label, select) };
  };
  const choices = [choice("Horizontal axis", 0), choice("Vertical axis", 1)];
  const svg = shape("svg", { class: "plane", viewBox: `0 0 ${PLANE.left + PLANE.side + 12} ${PLANE.top + PLANE.side + PLANE.below}`, role: "img" });
  const told = element("p", { role: "status", "aria-live": "polite", class: "note", "data-told": true });
  const rows = own.map((it, index) => {
    const input = element("input", { type: "range", id: `plane-${index}`, min: it.from, max: it.to, step: "any", "data-plane": it.name,
      oninput: () => { values[index] = Number(input.value); draw(); } });
    const output = element("output", { for: `plane-${index}` });
    const row = element("div", { class: "slider" }, element("label", { for: `plane-${index}` }, words(`${it.name}: ${it.quantity}`)), output, input);
    return { input, output, row };
  });
  const legend = element("ul", { class: "legend" });

  // Returns the inequalities of a piece after substituting the values of all but some quantities.
  const cut = (piece, free) => piece.map(({ factors, bound }) => {
    const row = { factors: free.map(() => 0), bound };
    for (const [index, factor] of factors) {
      const axis = free.indexOf(index);
      if (axis >= 0) row.factors[axis] += factor;
      else row.bound -= factor * values[index];
    }
    return row;
  });

  // Returns the intervals of one quantity with the others fixed, one for each piece.
  function reach(index) {
    return section.pieces.map((piece) => {
      let [low, high] = [-Infinity, Infinity];
      for (const { factors: [factor], bound } of cut(piece, [index])) {
        if (factor > 0) high = Math.min(high, bound / factor);
        else if (factor < 0) low = Math.max(low, bound / factor);
        else if (bound < -1e-9) return null;
      }
      return low <= high + 1e-9 ? [low, high] : null;
    }).filter(Boolean);
  }

  function draw() {
    for (const [axis, { select }] of choices.entries()) select.value = axes[axis];
    for (const [index, { input, output, row }] of rows.entries()) {
      output.textContent = rounded(values[index], 1e-3);
      input.value = values[index];
      input.setAttribute("aria-valuetext", output.textContent);
      row.classList.toggle("changed", Math.abs(values[index] - own[index].nominal) > 1e-9);
    }
    const [from, to] = [axes.map((axis) => own[axis].from), axes.map((axis) => own[axis].to)];
    const span = axes.map((_, axis) => to[axis] - from[axis] || 1);
    const x = (value) => PLANE.left + (value - from[0]) / span[0] * PLANE.side;
    const y = (value) => PLANE.top + PLANE.side - (value - from[1]) / span[1] * PLANE.side;
    const parts = [];
    const line = (kind, x1, y1, x2, y2, more) => parts.push(shape("line", { class: kind, x1, y1, x2, y2, ...more }));
    for (const axis of [0, 1]) {
      const step = niceStep(span[axis], 6);
      for (let at = Math.ceil(from[axis] / step) * step; at <= to[axis] + 1e-9; at += step) {
        const label = rounded(at, step);
        if (axis === 0) {
          line("grid", x(at), PLANE.top, x(at), PLANE.top + PLANE.side);
          parts.push(shape("text", { x: x(at), y: PLANE.top + PLANE.side + 16, "text-anchor": "middle" }, label));
        } else {
          line("grid", PLANE.left, y(at), PLANE.left + PLANE.side, y(at));
          parts.push(shape("text", { x: PLANE.left - 6, y: y(at) + 4, "text-anchor": "end" }, label));
        }
      }
    }
    const clipped = (corners, { factors, bound }) => {
      const excess = ([a, b]) => factors[0] * a + factors[1] * b - bound;
      const kept = [];
      corners.forEach((end, index) => {
        const start = corners[(index + corners.length - 1) % corners.length];
        const [before, after] = [excess(start), excess(end)];
        if ((before > 0) !== (after > 0) && before !== 0 && after !== 0) {
          const share = before / (before - after);
          kept.push([0, 1].map((axis) => start[axis] + (end[axis] - start[axis]) * share));
        }
        if (after <= 0) kept.push(end);
      });
      return kept;
    };
    for (const piece of section.pieces) {
      let corners = [[from[0], from[1]], [to[0], from[1]], [to[0], to[1]], [from[0], to[1]]];
      for (const row of cut(piece, axes)) corners = clipped(corners, row);
      if (corners.length > 2) parts.push(shape("polygon", { class: "works", points: corners.map(([a, b]) => `${x(a).toFixed(2)},${y(b).toFixed(2)}`).join(" ") }));
    }
    for (const [index, { name, intervals }] of section.boxes.entries()) {
      const side = (axis, end, infinite) => intervals[axes[axis]][end] ?? infinite;
      const [left, right, low, high] = [side(0, 0, -Infinity), side(0, 1, Infinity), side(1, 0, -Infinity), side(1, 1, Infinity)];
      const within = (axis, value) => Math.min(to[axis], Math.max(from[axis], value));
      const more = { "stroke-dasharray": BOX_DASHES[index % 4], "data-box": name };
      for (const value of [left, right]) {
        if (value >= from[0] && value <= to[0]) line(`box b${index % 4}`, x(value), y(within(1, low)), x(value), y(within(1, high)), more);
      }
      for (const value of [low, high]) {
        if (value >= from[1] && value <= to[1]) line(`box b${index % 4}`, x(within(0, left)), y(value), x(within(0, right)), y(value), more);
      }
    }
    const [a, b] = axes.map((axis) => values[axis]);
    if (a >= from[0] && a <= to[0] && b >= from[1] && b <= to[1]) {
      parts.push(shape("path", { class: "here", d: `M${x(a) - 7} ${y(b)}h14M${x(a)} ${y(b) - 7}v14` }));
    }
    parts.push(shape("rect", { class: "frame", x: PLANE.left, y: PLANE.top, width: PLANE.side, height: PLANE.side }));
    parts.push(shape("text", { class: "faint", x: PLANE.left + PLANE.side / 2, y: PLANE.top + PLANE.side + 36, "text-anchor": "middle" }, own[axes[0]].name));
    const middle = PLANE.top + PLANE.side / 2;
    parts.push(shape("text", { class: "faint", x: 12, y: middle, "text-anchor": "middle", transform: `rotate(-90 12 ${middle})` }, own[axes[1]].name));
    svg.replaceChildren(...parts);
    const sentences = [...new Set(axes)].map((axis) => {
      const spans = reach(axis).map(([low, high]) => {
        if (Number.isFinite(low) && Number.isFinite(high)) return `${rounded(low, 1e-3)} to ${rounded(high, 1e-3)}`;
        if (Number.isFinite(low)) return `${rounded(low, 1e-3)} or more`;
        return Number.isFinite(high) ? `${rounded(high, 1e-3)} or less` : "anything";
      });
      return `With the chosen values of the others, ${own[axis].name} may be ${spans.length ? spans.join(", or ") : "nothing"}.`;
    });
    told.textContent = sentences.join(" ");
    svg.setAttribute("aria-label", `Feasible values of ${own[axes[0]].name} and ${own[axes[1]].name}. ${told.textContent}`);
  }

  const swatch = (kind, dashes) => shape("svg", { width: 26, height: 12, "aria-hidden": "true" }, kind === "works"
    ? shape("rect", { class: "works", x: 1, y: 1, width: 24, height: 10 })
    : kind === "here" ? shape("path", { class: "here", d: "M7 6h12M13 0v12" }) : shape("line", { class: kind, x1: 0, x2: 26, y1: 6, y2: 6, "stroke-dasharray": dashes }));
  legend.append(element("li", {}, swatch("works"), "the plan works"),
    ...section.boxes.map((box, index) => element("li", {}, swatch(`box b${index % 4}`, BOX_DASHES[index % 4]), box.name)),
    element("li", {}, swatch("here"), "the values chosen"));
  const reset = element("button", { type: "button", onclick: () => { own.forEach((it, index) => { values[index] = it.nominal; }); draw(); } }, "as planned");
  draw();
  const node = element("section", { id: "plane" }, element("h2", {}, section.heading), element("p", { class: "note" }, section.note),
    element("div", { class: "controls" }, ...choices.map((it) => it.node), isDriven ? null : reset), svg, legend, told, isDriven ? null :
    element("details", {}, element("summary", {}, "Choose the values of all quantities"), element("div", { class: "sliders" }, ...rows.map((it) => it.row))));
  return { node, set(chosen) { chosen.forEach((value, index) => { values[index] = value; }); draw(); } };
}
