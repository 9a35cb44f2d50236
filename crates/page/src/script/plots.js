// Shares with intervals, and numbers over time.

function ratesView(section) {
  const groups = section.groups.map((group) => element("div", {},
    element("h3", {}, words(group.name)),
    ...group.rates.map((rate) => element("div", { class: "rate" },
      element("div", {}, words(rate.name)), interval(rate), element("div", { class: "words" }, rate.words)))));
  return element("section", {}, element("h2", {}, section.heading), element("p", { class: "note" }, section.note), ...groups);
}

function interval(rate) {
  const svg = shape("svg", { viewBox: "0 0 400 18", height: 18, preserveAspectRatio: "none", role: "img", "aria-label": `${rate.name}: ${rate.words}` });
  const x = (share) => 4 + share * 392;
  const line = (kind, x1, x2, y1, y2) => svg.append(shape("line", { class: kind, x1, x2, y1, y2, "vector-effect": "non-scaling-stroke" }));
  line("grid", x(0), x(1), 9, 9);
  for (const share of [0, 0.25, 0.5, 0.75, 1]) line("grid", x(share), x(share), 5, 13);
  if (rate.mark !== null) line("compare", x(rate.mark), x(rate.mark), 0, 18);
  if (rate.share) {
    const [share, lower, upper] = rate.share;
    line("interval", x(lower), x(upper), 9, 9);
    line("interval", x(lower), x(lower), 5, 13);
    line("interval", x(upper), x(upper), 5, 13);
    svg.append(shape("rect", { class: "point", x: x(share) - 2, y: 4, width: 4, height: 10 }));
  }
  return svg;
}

function seriesView(section) {
  const cursors = [];
  const lines = section.lines.map((line) => {
    const values = [...line.points.map(([, value]) => value), ...line.limits.map((limit) => limit.value)];
    const [low, high] = [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
    const range = high - low || 1;
    const x = (time) => 2 + (time / section.end) * 396, y = (value) => 64 - ((value - low) / range) * 56;
    const path = [...line.points, [section.end, values.at(-1)]].map(([time, value], index) => `${index ? "L" : "M"}${x(time).toFixed(2)} ${y(value).toFixed(2)}`).join("");
    const cursor = shape("line", { class: "cursor", x1: -1, x2: -1, y1: 0, y2: 72, "vector-effect": "non-scaling-stroke" });
    // A limit is a line with the forbidden side hatched; a moment has the smallest visible width.
    const limits = line.limits.map((limit) => {
        const [from, to] = [Math.max(2, x(limit.from)), Math.min(398, x(limit.to))];
        const [left, right] = to - from < 4 ? [from - 2, from + 2] : [from, to];
        return shape("g", {}, shape("title", {}, limit.words),
          limit.side ? shape("rect", { class: "forbidden", x: left, width: right - left, y: limit.side > 0 ? y(limit.value) - 5 : y(limit.value), height: 5 }) : null,
          shape("line", { class: "limit", x1: left, x2: right, y1: y(limit.value), y2: y(limit.value), "vector-effect": "non-scaling-stroke" }));
    });
    cursors.push((time) => { cursor.setAttribute("x1", x(time)); cursor.setAttribute("x2", x(time)); });
    return element("div", { class: "curve-box" },
      element("h3", {}, words(line.name)),
      shape("svg", { viewBox: "0 0 400 72", height: 72, preserveAspectRatio: "none", role: "img", "aria-label": `${line.name} over time: ${line.words}` },
        shape("line", { class: "grid", x1: 0, x2: 400, y1: 64, y2: 64, "vector-effect": "non-scaling-stroke" }),
        shape("line", { class: "grid", x1: 0, x2: 400, y1: 8, y2: 8, "vector-effect": "non-scaling-stroke" }),
        ...limits,
        shape("path", { class: "curve", d: path, "vector-effect": "non-scaling-stroke" }), cursor),
      element("p", { class: "note" }, line.words),
      line.closest ? element("p", { class: "note", "data-closest": true }, line.closest) : null);
  });
  const node = element("section", {}, element("h2", {}, section.heading), ...lines);
  return { node, at: (time) => cursors.forEach((move) => move(time)) };
}

function proseView(section) {
  return element("section", {}, element("h2", {}, section.heading), ...section.paragraphs.map((text) => element("p", {}, words(text))));
}
