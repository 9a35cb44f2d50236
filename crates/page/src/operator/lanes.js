// One lane for each robot: its last, running and next action, and their possible durations.

// The lengths of the axis, which is labelled at its quarters.
const SPANS = [4, 8, 20, 40, 80, 120, 240, 400, 800, 1200, 2400, 4800, 14400, 43200, 86400];
const PAST = 0.25;
const DRAWN_EVERY = 200;
// The lane of the actions without a robot.
const OTHERS = "others";

// The interval of the duration of a step, if the guarantee has one. Without an upper limit it ends at infinity.
function durationOf(step, state) {
  const guarantee = state.guarantee ?? {};
  const it = step?.parameter === undefined ? undefined : guarantee.parameters?.[step.parameter];
  if (it?.least === undefined) return null;
  const end = (value) => (typeof value === "number" ? value : value === "-inf" ? -Infinity : Infinity);
  return { least: Math.max(0, end(it.least)), most: end(it.most), nominal: it.nominal };
}

// The possible duration of an action under the guarantee.
function windowWords(it) {
  if (!it) return "";
  return it.most === Infinity ? `, may take ${nearest(it.least)} or longer` : `, may take ${nearest(it.least)} to ${nearest(it.most)}`;
}

// The actions of the state: those that ended, those that run and those to come, each with start and end.
function actionsOf(state, now) {
  const steps = members(state.plan?.steps);
  const ended = members(state.plan?.ended).map((it) => ({ ...it, start: it.since, kind: it.state }));
  const running = members(state.running).map((it) => {
    const step = steps.find((own) => own.ticket === it.ticket);
    const room = durationOf(step, state);
    // A plan that was adopted during the action has a different start time for it.
    const start = step && it.since < (state.plan.since ?? 0) ? step.start : it.since;
    const planned = step?.duration ?? it.planned ?? 0;
    return { ...it, kind: "running", start: it.since, end: Math.max(now, start + planned), room, from: start };
  });
  const toCome = steps.filter((it) => it.state === "to-come").map((it) => {
    const start = Math.max(now, it.start);
    return { ...it, kind: "to-come", start, planned: it.start, end: start + (it.duration ?? 0), room: durationOf(it, state), from: start };
  });
  return [...ended, ...running, ...toCome.sort((a, b) => a.planned - b.planned)];
}

const laneOf = (state, action) => state.lanes?.[action] ?? action.replace(/^\(|\)$/g, "").split(" ")[0];

function laneItem() {
  const fact = (name) => element("div", {}, element("dt", {}, name), element("dd", { "data-part": name }));
  return element("li", { class: "lane" },
    element("h3", { "data-part": "name" }),
    element("div", { class: "strip", "data-part": "strip", "aria-hidden": "true" }, element("div", { class: "now" })),
    element("dl", {}, fact("done"), fact("running"), fact("next")));
}

function showLane(node, { name, actions }, now) {
  setText(part(node, "name"), name);
  const done = actions.filter((it) => "state" in it && it.kind === it.state && it.kind !== "to-come").sort((a, b) => a.end - b.end).at(-1);
  setText(part(node, "done"), done ? `${done.action} ${done.state}, from ${nearest(done.start)} to ${nearest(done.end)}` : "nothing");
  const running = actions.filter((it) => it.kind === "running");
  const words = running.map((it) => `${it.action} ${runningWords(it)} (for ${seconds(Math.max(0, now - it.start))}${windowWords(it.room)})`);
  setText(part(node, "running"), words.join("; ") || "nothing");
  const next = actions.filter((it) => it.kind === "to-come");
  const [first] = next;
  const takes = first && first.duration !== undefined ? `, planned ${nearest(first.duration)}${windowWords(first.room)}` : "";
  const more = next.length > 1 ? `; then ${next.length - 1} more` : "";
  setText(part(node, "next"), first ? `${first.action} at ${nearest(first.planned)} (${first.planned > now ? distance(first.planned, now) : "due"})${takes}${more}` : "nothing");
  node.actions = actions;
}

// Draws the bars of a lane between the ends of the axis.
function drawStrip(node, from, span) {
  const strip = part(node, "strip");
  const at = (time) => `${(100 * (time - from) / span).toFixed(2)}%`;
  const long = (start, end) => `${Math.max(0.3, 100 * (Math.min(end, from + span) - Math.max(start, from)) / span).toFixed(2)}%`;
  const shown = (node.actions ?? []).filter((it) => it.end >= from && it.start <= from + span);
  const bars = shown.map((it) => ({ key: `${it.ticket ?? it.parameter} ${it.action} ${it.kind} ${it.ticket === undefined ? it.planned : ""}`, it, start: it.start, end: it.end, kind: it.kind, label: it.action.replace(/^\(|\)$/g, "") }));
  // The windows of the ends of the running actions, or of the next one if none is running.
  const running = shown.filter((it) => it.kind === "running");
  for (const it of running.length ? running : shown.filter((own) => own.kind === "to-come").slice(0, 1)) {
    if (!it.room) continue;
    const [start, end] = [it.from + it.room.least, it.from + it.room.most];
    if (end >= from && end > start && start <= from + span) bars.push({ key: `window ${it.ticket ?? it.parameter} ${it.kind}`, start, end, kind: "window", label: "" });
  }
  reconcile(strip, [{ key: "now", kind: "now" }, ...bars], (it) => it.key, (it) => element("div", {}, element("span", {}, it.label)), (bar, it) => {
    bar.className = it.kind === "now" ? "now" : `bar ${it.kind}`;
    bar.style.insetInlineStart = it.kind === "now" ? `${100 * PAST}%` : at(Math.max(it.start, from));
    if (it.kind !== "now") bar.style.width = long(it.start, it.end);
  });
}

function drawAxis(span) {
  const axis = byId("axis");
  if (axis.dataset.span === String(span)) return;
  axis.dataset.span = span;
  const label = (share) => {
    const time = (share - PAST) * span;
    return element("span", { style: null }, time === 0 ? "now" : `${time > 0 ? "+" : "−"}${nearest(Math.abs(time))} s`);
  };
  axis.replaceChildren(...[0, 0.25, 0.5, 0.75].map((share) => {
    const node = label(share);
    node.style.insetInlineStart = `${100 * share}%`;
    return node;
  }));
}

let drawn = 0;
function showLanes(state, now, isChanged) {
  const time = performance.now();
  if (!isChanged && time - drawn < DRAWN_EVERY) return;
  drawn = time;
  const lanes = new Map();
  const actions = actionsOf(state, now);
  for (const it of actions) {
    const name = laneOf(state, it.action);
    lanes.set(name, [...(lanes.get(name) ?? []), it]);
  }
  const order = (a, b) => (a.name === OTHERS) - (b.name === OTHERS) || a.name.localeCompare(b.name, "en", { numeric: true });
  const sorted = [...lanes].map(([name, own]) => ({ name, actions: own })).sort(order);
  reconcile(byId("lanes"), sorted, (it) => it.name, laneItem, (node, it) => showLane(node, it, now));
  byId("no-lane").hidden = sorted.length > 0;
  for (const id of ["axis", "legend"]) byId(id).hidden = sorted.length === 0;
  // The axis shows all actions that have not ended; if there are none, the last one that ended.
  const ahead = Math.max(0, ...actions.filter((it) => it.kind === "running" || it.kind === "to-come").map((it) => it.end - now));
  const last = actions.filter((it) => it.end <= now).sort((a, b) => a.end - b.end).at(-1);
  const wanted = ahead > 0 || !last ? ahead / (1 - PAST) * 0.8 : (now - last.start) / PAST;
  const span = SPANS.find((it) => it >= wanted) ?? SPANS.at(-1);
  drawAxis(span);
  for (const node of byId("lanes").children) drawStrip(node, now - PAST * span, span);
}
