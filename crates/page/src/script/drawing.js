// Drawing of a chart: only the part inside the window.

const ROW = 34, AXIS = 22, STRIP = 22, LETTER = 6.6, MANY = 400;

// Assigns the bars of a lane to rows without overlap: each bar gets the first free row. Planned bars are drawn
// above executed ones, so the two do not exclude each other. With `spread`, bands also occupy their row.
function packed(bars, groupings, grouping, plan, spread) {
  const reach = spread ? widest : extent;
  const lanes = groupings[grouping].lanes.map((name) => ({ name, rows: [], bars: [] }));
  const order = [...bars.keys()].filter((index) => plan === -1 || bars[index].plan === plan);
  order.sort((a, b) => extent(bars[a])[0] - extent(bars[b])[0] || a - b);
  for (const index of order) {
    const bar = bars[index], lane = lanes[bar.lanes[grouping]];
    const whole = spread ? widest(bar) : bar.actual ?? bar.planned;
    const thin = spread ? whole : bar.planned ?? bar.actual;
    let row = lane.rows.findIndex(([done, planned]) => done <= whole[0] && planned <= thin[0]);
    if (row === -1) row = lane.rows.push([]) - 1;
    lane.rows[row] = [whole[1], thin[1]];
    lane.bars.push({ index, row });
  }
  const rows = [];
  const used = lanes.filter((lane) => lane.bars.length);
  for (const lane of used) {
    lane.top = rows.length;
    for (let row = 0; row < lane.rows.length; row++) rows.push([]);
    for (const { index, row } of lane.bars) rows[lane.top + row].push(index);
  }
  const rowOf = new Map(rows.flatMap((row, position) => row.map((index) => [index, position])));
  return { lanes: used, rows, rowOf, order, reach };
}

// The interval of time for which a bar occupies its row.
function extent({ planned, actual }) {
  if (!planned || !actual) return planned ?? actual;
  return [Math.min(planned[0], actual[0]), Math.max(planned[1], actual[1])];
}

// The same with its bands.
function widest(bar) {
  let [from, to] = extent(bar);
  for (const band of [bar.starts, bar.ends]) {
    if (!band) continue;
    from = Math.min(from, band[0] ?? -Infinity);
    to = Math.max(to, band[1] ?? Infinity);
  }
  return [from, to];
}

// Draws the part of a chart that `view` shows into its svg.
function draw(svg, chart, layout, view) {
  const { width, height, left, top, gutter, scale, current, cursor, marksTop } = view;
  const x = (time) => gutter + time * scale - left;
  const clamp = (value) => Math.max(gutter - 20, Math.min(width + 20, value));
  const back = [], front = [], texts = [];
  const lines = { grid: "", starts: "", ends: "" };
  const head = view.head;

  // The grid.
  const step = niceStep((width - gutter) / scale, (width - gutter) / 80);
  const first = Math.floor(left / scale / step) * step;
  const ticks = [];
  for (let time = Math.max(0, first); x(time) < width; time += step) {
    if (x(time) < gutter - 1) continue;
    lines.grid += `M${x(time)} ${AXIS - 5}V${height}`;
    const text = rounded(time, step);
    if (x(time) + text.length * LETTER + 4 <= width) ticks.push(shape("text", { x: x(time) + 3, y: 14, class: "faint" }, text));
  }

  // The visible bars.
  const seen = [];
  const from = Math.max(0, Math.floor(top / ROW) - 1);
  const to = Math.min(layout.rows.length, Math.ceil((top + height - head) / ROW) + 1);
  for (let row = from; row < to; row++) {
    const bars = layout.rows[row];
    let covered = -Infinity;
    for (let position = firstInSight(chart.bars, bars, left / scale, layout.reach); position < bars.length; position++) {
      const index = bars[position], bar = chart.bars[index];
      const [begin, end] = layout.reach(bar);
      if (x(begin) > width) break;
      // A bar of at most one pixel on a pixel that is already drawn is invisible.
      if (x(end) < gutter || x(end) < covered + 0.7 && index !== current) continue;
      covered = Math.max(covered, x(end));
      seen.push({ bar, index, row, next: chart.bars[bars[position + 1]], y: head + row * ROW - top });
    }
  }

  // Many bars of one kind share one shape, because one shape for each bar would take too long.
  const boxes = seen.length > MANY ? {} : null;
  let row = -1, covered;
  for (const one of seen) {
    const { bar, index, y, next } = one, isCurrent = index === current;
    if (one.row !== row) { row = one.row; covered = { starts: -Infinity, ends: -Infinity }; }
    const [begin, end] = drawnSpan(bar);
    if ((end - begin) * scale > 3 || isCurrent) {
      lines.starts += band(bar.starts, "starts", y + 25, isCurrent);
      lines.ends += band(bar.ends, "ends", y + 30, isCurrent);
    }
    drawBox(front, boxes, bar, index, x, clamp, y, isCurrent);
    const following = next === undefined ? width : x(drawnSpan(next)[0]);
    label(texts, bar, Math.max(gutter, x(begin)), x(end), following, y);
  }
  for (const kind in boxes) front.unshift(shape("path", { class: kind, d: boxes[kind] }));

  // Bands: possible start and end times. Of overlapping bands in a row, the first is drawn, and that of the bar pointed
  // at.
  function band(range, kind, height, isCurrent) {
    if (!range) return "";
    const [a, b] = [clamp(x(range[0] ?? -Infinity)), clamp(x(range[1] ?? Infinity))];
    if (b < a || a < covered[kind] && !isCurrent) return "";
    covered[kind] = Math.max(covered[kind], b);
    const cap = (at) => `M${at} ${height - 3}v6`;
    return `M${a} ${height}H${Math.max(b, a + 1)}${range[0] === null ? "" : cap(a)}${range[1] === null ? "" : cap(b)}`;
  }

  // Moments.
  for (const mark of chart.marks) {
    const at = x(mark.at);
    if (at < gutter || at > width) continue;
    back.push(shape("line", { class: mark.is_event ? "event" : "mark", x1: at, x2: at, y1: AXIS - 4, y2: height }));
  }
  if (cursor !== null && x(cursor) >= gutter) {
    front.push(shape("line", { class: "cursor", x1: x(cursor), x2: x(cursor), y1: 0, y2: height }));
  }

  // The fixed head: axis, guarantee, names of the moments.
  const fixed = [shape("rect", { class: "gutter", x: 0, y: 0, width, height: head }), ...ticks];
  for (const segment of chart.guarantee) {
    const [a, b] = [Math.max(gutter, clamp(x(segment.from))), clamp(x(segment.to))];
    if (b <= gutter || a >= width) continue;
    const level = segment.level < 0 ? "none" : segment.level;
    fixed.push(shape("rect", { class: `g${level}`, x: a, y: AXIS, width: Math.max(1, b - a), height: STRIP - 5, rx: 2 }));
    const name = ["luck", "as planned", "part", "envelope"][segment.level] ?? "none";
    if (b - a > name.length * LETTER + 6) fixed.push(shape("text", { class: "on-strip", x: a + 4, y: AXIS + 12.5 }, name));
  }
  let free = gutter;
  if (marksTop !== null) {
    for (const mark of chart.marks) {
      const at = x(mark.at);
      if (at < gutter - 1 || at > width) continue;
      const y = marksTop + 8;
      fixed.push(shape("path", { class: mark.is_event ? "crossing" : "diamond", d: `M${at} ${y - 5}l5 5l-5 5l-5 -5z` }));
      // To the right of its diamond if there is space, otherwise to the left.
      const length = mark.name.length * LETTER + 8;
      if (at + 6 >= free && at + length <= width) {
        fixed.push(shape("text", { x: at + 8, y: y + 4, direction: "ltr" }, mark.name));
        free = at + 8 + length;
      } else if (at - 8 - length >= free) {
        fixed.push(shape("text", { x: at - 8, y: y + 4, "text-anchor": "end", direction: "ltr" }, mark.name));
        free = at;
      } else if (at + 30 <= width && at + 6 >= free) {
        fixed.push(shape("text", { x: at + 8, y: y + 4, direction: "ltr" }, cut(mark.name, width - at - 8)));
        free = width;
      }
    }
  }

  // The names of the lanes, in front of the scrolling part.
  const names = [shape("rect", { class: "gutter", x: 0, y: head, width: gutter, height: height - head })];
  for (const [position, lane] of layout.lanes.entries()) {
    const y = head + lane.top * ROW - top;
    const bottom = head + (layout.lanes[position + 1]?.top ?? layout.rows.length) * ROW - top;
    if (bottom < head || y > height) continue;
    lines.grid += `M0 ${y}H${width}`;
    const textY = Math.min(Math.max(y, head) + 17, bottom - 5);
    if (textY < head + 8) continue;
    names.push(shape("text", { class: "lane", x: 6, y: textY, direction: "ltr" }, cut(lane.name, gutter - 10)));
  }
  fixed.push(shape("line", { class: "grid", x1: 0, x2: width, y1: head, y2: head }));
  const path = (kind) => shape("path", { class: kind, d: lines[kind] });
  svg.replaceChildren(path("grid"), ...back, path("starts"), path("ends"), ...front, ...texts, ...names, ...fixed);
}

// The first bar of a row that reaches into the window; both ends of the bars of a row ascend.
function firstInSight(bars, row, time, reach) {
  let [low, high] = [0, row.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (reach(bars[row[middle]])[1] < time) low = middle + 1;
    else high = middle;
  }
  // One more bar, whose bands may extend beyond it.
  return Math.max(0, low - 1);
}

// Start and end of the bar itself.
const drawnSpan = (bar) => bar.actual ?? bar.planned;

// Draws a bar, the planned bar above it, and a frame if it is pointed at. With `boxes`, adds to these.
function drawBox(into, boxes, bar, index, x, clamp, y, isCurrent) {
  const box = (span, kind, top, height) => {
    const [a, b] = [clamp(x(span[0])), clamp(x(span[1]))];
    const width = Math.max(2, b - a);
    if (boxes) boxes[kind] = `${boxes[kind] ?? ""}M${a} ${y + top}h${width}v${height}h${-width}z`;
    else into.push(shape("rect", { class: kind, x: a, y: y + top, width, height, rx: 2, "data-bar": index }));
    return [a, b];
  };
  if (bar.actual && bar.planned) box(bar.planned, "plan", 2, 4);
  const [top, height] = bar.actual ? [7, 14] : [4, 16];
  const [a, b] = box(drawnSpan(bar), `bar ${bar.outcome}`, top, height);
  // Failed actions are crossed out, so that colour is not the only mark.
  if (bar.outcome === "failed" && b - a > 10) {
    into.push(shape("path", { class: "cross", d: `M${b - 9} ${y + 10}l6 8m0 -8l-6 8` }));
  }
  if (isCurrent) into.push(shape("rect", { class: "current", x: a - 3, y: y + 1, width: b - a + 6, height: 22, rx: 3 }));
}

// Writes the name in the bar or behind it, or omits it if there is no space.
function label(into, bar, begin, end, following, y) {
  const name = bar.name.replace(/^\(|\)$/g, "");
  const inside = end - begin - 8, behind = following - end - 10;
  const baseline = y + (bar.actual ? 18 : 16);
  const isFilled = bar.outcome === "succeeded" || bar.outcome === "failed" || bar.outcome === "cancelled";
  const kind = `inside ${isFilled && bar.actual ? "succeeded" : ""}`;
  const needed = name.length * LETTER;
  if (inside >= needed) into.push(shape("text", { class: kind, x: begin + 4, y: baseline, direction: "ltr" }, name));
  else if (behind >= needed) into.push(shape("text", { x: end + 5, y: baseline, direction: "ltr" }, name));
  else if (inside >= 40 || inside >= behind && inside >= 26) {
    into.push(shape("text", { class: kind, x: begin + 4, y: baseline, direction: "ltr" }, cut(name, inside)));
  } else if (behind >= 40) into.push(shape("text", { x: end + 5, y: baseline, direction: "ltr" }, cut(name, behind)));
}

function cut(text, width) {
  const letters = Math.floor(width / LETTER);
  return text.length <= letters ? text : `${text.slice(0, Math.max(1, letters - 1))}…`;
}
