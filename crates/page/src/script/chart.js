// A chart that scrolls, zooms, and supports navigation with the arrow keys.

// `life` ends when the chart is replaced by another.
function chartView(chart, textOf, onPick, life) {
  const svg = shape("svg", { "aria-hidden": "true" });
  const sizer = element("div", {}, svg);
  const scroll = element("div", {
    class: "scroll", tabindex: "0", role: "application", "aria-roledescription": "chart",
    "aria-label": `${chart.heading}: ${chart.bars.length} actions. Arrow keys move between actions, plus and minus zoom. The table below has the same content.`,
  }, sizer);
  const panel = element("div", { class: "panel", role: "status", "aria-live": "polite" });
  let grouping = chart.chosen, plan = -1, zoom = 1, current = -1, cursor = null;
  // In a short plan, each action with its bands has a separate row.
  let spread = !chart.is_run && chart.bars.length <= 60;
  let layout = packed(chart.bars, chart.groupings, grouping, plan, spread);

  const strip = chart.guarantee.length ? STRIP : 0;
  const marks = chart.marks.length ? 20 : 0;
  const head = AXIS + strip + marks;
  let isPrinted = false;

  function geometry() {
    const width = isPrinted ? 1000 : Math.max(200, scroll.clientWidth);
    const longest = Math.max(4, ...layout.lanes.map((lane) => Math.min(24, lane.name.length)));
    const gutter = Math.min(longest * (LETTER + 0.6) + 16, width * 0.3);
    const inner = width - gutter - 12;
    const scale = (inner * (isPrinted ? 1 : zoom)) / chart.end;
    return { width, gutter, inner, scale };
  }

  function paint() {
    const { width, gutter, scale } = geometry();
    const full = head + layout.rows.length * ROW + 4;
    const height = isPrinted ? full : Math.min(full, Math.max(160, Math.floor(window.innerHeight * 0.75)));
    sizer.style.width = `${Math.min(3e7, gutter + 12 + chart.end * scale)}px`;
    sizer.style.height = `${full}px`;
    svg.setAttribute("width", width);
    svg.setAttribute("height", height);
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    draw(svg, chart, layout, {
      width, height, gutter, scale, head, current, cursor,
      marksTop: marks ? AXIS + strip : null,
      left: isPrinted ? 0 : scroll.scrollLeft,
      top: isPrinted ? 0 : scroll.scrollTop,
    });
  }
  const repaint = soon(paint);

  function describe() {
    if (current < 0) {
      panel.replaceChildren(element("p", { class: "note" }, "Point at an action, or go to one with the arrow keys, to see its times and what limits them."));
      return;
    }
    const bar = chart.bars[current];
    const list = bar.details.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, words(textOf(value)))]);
    const plans = chart.plans[bar.plan];
    if (plans) list.push(element("dt", {}, "plan"), element("dd", {}, plans));
    panel.replaceChildren(element("strong", {}, words(bar.name)), element("dl", {}, ...list));
  }

  function pick(index, isToBeSeen) {
    if (index === current && !isToBeSeen) return;
    current = index;
    describe();
    if (isToBeSeen && index >= 0) show(index);
    repaint();
    onPick(index);
  }

  // Scrolls until the bar is visible.
  function show(index) {
    const { width, gutter, scale } = geometry();
    const [begin, end] = extent(chart.bars[index]);
    const row = layout.rowOf.get(index);
    if (row === undefined) return;
    const [a, b] = [begin * scale, end * scale];
    if (a < scroll.scrollLeft || a > scroll.scrollLeft + width - gutter - 60) {
      scroll.scrollLeft = Math.max(0, a - Math.min(60, (b - a) / 2) - 10);
    }
    const y = row * ROW, height = scroll.clientHeight - head;
    if (y < scroll.scrollTop) scroll.scrollTop = y;
    if (y + ROW > scroll.scrollTop + height) scroll.scrollTop = y + ROW - height;
  }

  // Zooms about the moment at `fraction` of the window.
  function zoomBy(factor, fraction = 0.5) {
    const before = geometry();
    const middle = (scroll.scrollLeft + before.inner * fraction) / before.scale;
    zoom = Math.max(1, Math.min(zoom * factor, 2e7 / before.inner));
    paint();
    scroll.scrollLeft = middle * geometry().scale - before.inner * fraction;
    repaint();
  }

  // Returns the row of a bar above or below, at about the same time.
  function besides(by) {
    const row = layout.rowOf.get(current);
    const bars = layout.rows[row + by];
    if (!bars?.length) return current;
    const time = extent(chart.bars[current])[0];
    const distance = (index) => Math.abs(extent(chart.bars[index])[0] - time);
    return bars.reduce((best, index) => (distance(index) < distance(best) ? index : best));
  }

  const along = (by) => {
    const position = layout.order.indexOf(current);
    if (position === -1) return layout.order[by > 0 ? 0 : layout.order.length - 1] ?? -1;
    return layout.order[Math.max(0, Math.min(layout.order.length - 1, position + by))];
  };
  const keys = {
    ArrowRight: () => pick(along(1), true),
    ArrowLeft: () => pick(along(-1), true),
    ArrowDown: () => pick(current < 0 ? along(1) : besides(1), true),
    ArrowUp: () => pick(current < 0 ? along(1) : besides(-1), true),
    Home: () => pick(layout.order[0] ?? -1, true),
    End: () => pick(layout.order.at(-1) ?? -1, true),
    Escape: () => pick(-1, false),
    "+": () => zoomBy(1.6),
    "=": () => zoomBy(1.6),
    "-": () => zoomBy(1 / 1.6),
    "0": () => { zoom = 1; paint(); },
  };
  scroll.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  });
  scroll.addEventListener("scroll", repaint, { passive: true });
  scroll.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    const box = scroll.getBoundingClientRect(), { gutter, inner } = geometry();
    zoomBy(event.deltaY < 0 ? 1.25 : 0.8, Math.max(0, Math.min(1, (event.clientX - box.left - gutter) / inner)));
  }, { passive: false });
  // Returns the bar within two pixels of the pointer.
  function under(event) {
    const box = scroll.getBoundingClientRect(), { gutter, scale } = geometry();
    const [across, down] = [event.clientX - box.left - gutter, event.clientY - box.top - head];
    if (across < 0 || down < 0) return;
    const time = (scroll.scrollLeft + across) / scale, near = 2 / scale;
    const row = layout.rows[Math.floor((scroll.scrollTop + down) / ROW)];
    const bar = row?.find((index) => {
      const [begin, end] = drawnSpan(chart.bars[index]);
      return begin - near <= time && time <= end + near;
    });
    if (bar !== undefined) pick(bar, false);
  }
  svg.addEventListener("pointermove", under);
  svg.addEventListener("click", under);
  const resized = new ResizeObserver(repaint);
  resized.observe(scroll);
  life.addEventListener("abort", () => resized.disconnect());
  addEventListener("beforeprint", () => { isPrinted = true; paint(); }, { signal: life });
  addEventListener("afterprint", () => { isPrinted = false; paint(); }, { signal: life });

  const choose = (name, options, chosen, onChoose) => {
    const select = element("select", { onchange: () => onChoose(Number(select.value)) },
      ...options.map(([value, text]) => element("option", { value, selected: value === chosen }, text)));
    return element("label", {}, name, select);
  };
  const lanes = choose("Lanes", chart.groupings.map((it, index) => [index, it.name]), grouping, (value) => { grouping = value; relayout(); });
  const relayout = () => { layout = packed(chart.bars, chart.groupings, grouping, plan, spread); pick(-1, false); paint(); };
  const spreading = element("input", { type: "checkbox", checked: spread, onchange: () => { spread = spreading.checked; relayout(); } });
  const controls = element("div", { class: "controls" },
    lanes,
    chart.plans.length
      ? choose("Plan", [[-1, "all"], ...chart.plans.map((name, index) => [index, name])], plan, (value) => { plan = value; relayout(); })
      : null,
    chart.bars.some((bar) => bar.starts || bar.ends) ? element("label", {}, spreading, "separate bands for each action") : null,
    element("span", { role: "group", "aria-label": "Zoom" },
      element("button", { type: "button", "aria-label": "zoom out", onclick: () => zoomBy(1 / 1.6) }, "−"), " ",
      element("button", { type: "button", "aria-label": "zoom in", onclick: () => zoomBy(1.6) }, "+"), " ",
      element("button", { type: "button", onclick: keys["0"] }, "fit")));

  // Draws the actions at other times, or at the planned ones again. Descriptions keep the planned times.
  const asPlanned = chart.bars.map(({ planned, starts, ends }) => ({ planned, starts, ends }));
  const asPlannedEnd = chart.end;
  const move = (spans) => {
    const times = spans ?? asPlanned;
    for (const [index, bar] of chart.bars.entries()) Object.assign(bar, times[index]);
    chart.end = Math.max(asPlannedEnd, ...chart.bars.map((bar) => extent(bar)[1]));
    layout = packed(chart.bars, chart.groupings, grouping, plan, spread);
    repaint();
  };

  describe();
  const node = element("section", {}, element("h2", {}, chart.heading), controls, legend(chart), scroll, panel, marksList(chart), guaranteeTable(chart));
  const chosen = () => ({ grouping, spread, zoom, left: scroll.scrollLeft, top: scroll.scrollTop, bar: current, name: chart.bars[current]?.name });
  const restore = (before) => {
    if (chart.groupings[before.grouping]) grouping = lanes.querySelector("select").value = before.grouping;
    spreading.checked = spread = before.spread;
    zoom = before.zoom;
    relayout();
    [scroll.scrollLeft, scroll.scrollTop] = [before.left, before.top];
    if (before.bar >= 0 && chart.bars[before.bar]?.name === before.name) pick(before.bar, false);
  };
  return { node, pick: (index) => pick(index, true), paint, move, cursor: (time) => { cursor = time; repaint(); }, chosen, choose: restore };
}

// Legend of the shapes that occur.
function legend(chart) {
  const has = (test) => chart.bars.some(test);
  const entry = (text, ...shapes) => element("li", {}, shape("svg", { width: 30, height: 16, "aria-hidden": "true" }, ...shapes), text);
  const box = (kind, height = 12) => shape("rect", { class: kind, x: 1, y: 8 - height / 2, width: 27, height, rx: 2 });
  const whisker = (kind) => [[2, 8, 28, 8], [2, 4, 2, 12], [28, 4, 28, 12]]
    .map(([x1, y1, x2, y2]) => shape("line", { class: kind, x1, y1, x2, y2 }));
  const outcome = (name, text) => (has((bar) => bar.outcome === name) ? entry(text, box(`bar ${name}`)) : null);
  return element("ul", { class: "legend" },
    chart.is_run ? entry("planned", box("plan", 4)) : entry("planned", box("bar")),
    outcome("succeeded", "done"),
    outcome("failed", "failed (crossed)"),
    outcome("cancelled", "cancelled"),
    outcome("running", "live" in document.documentElement.dataset ? "running" : "still running at the end of the record"),
    outcome("not-started", "planned, not started"),
    has((bar) => bar.starts) ? entry("may start", ...whisker("starts")) : null,
    has((bar) => bar.ends) ? entry("may end", ...whisker("ends")) : null,
    chart.marks.some((mark) => !mark.is_event) ? entry("fact or number changes by itself", shape("path", { class: "diamond", d: "M14 3l5 5l-5 5l-5 -5z" })) : null,
    chart.marks.some((mark) => mark.is_event) ? entry("plan abandoned", shape("line", { class: "event", x1: 14, x2: 14, y1: 1, y2: 15 }), shape("path", { class: "crossing", d: "M14 3l5 5l-5 5l-5 -5z" })) : null);
}

// The moments as text, because the chart truncates their names.
function marksList(chart) {
  if (!chart.marks.length) return null;
  const rows = chart.marks.slice(0, 1000).map((mark) => element("li", {}, `${rounded(mark.at, 0.001)}: `, words(mark.name)));
  return element("details", {}, element("summary", {}, `Deadlines and other events (${chart.marks.length})`), element("ul", {}, ...rows));
}

// The guarantee over time as a table.
function guaranteeTable(chart) {
  if (!chart.guarantee.length) return null;
  const rows = chart.guarantee.map((segment) => element("tr", {},
    element("td", { class: "number" }, rounded(segment.from, 0.001)),
    element("td", { class: "number" }, rounded(segment.to, 0.001)),
    element("td", {}, words(segment.words))));
  const heads = ["from", "to", "the rest of the plan"].map((name, column) => element("th", { scope: "col", class: column < 2 ? "number" : null }, name));
  return element("div", { class: "wide", tabindex: "0", role: "region", "aria-label": "The guarantee over time" }, element("table", { id: "guarantee" },
    element("caption", {}, "The guarantee over time"),
    element("thead", {}, element("tr", {}, ...heads)), element("tbody", {}, ...rows)));
}
