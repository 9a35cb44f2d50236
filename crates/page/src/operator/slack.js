// The guarantee, and the remaining part of its intervals.

const TIGHTEST = 6;

// The promise and its condition, as `ctl guarantee` writes them.
function promiseWords(guarantee) {
  const before = !guarantee.timeout || guarantee.timeout === "none" ? "" : " and each action ends before its time-out";
  const works = (condition) => `the plan works as long as ${condition}${before}`;
  switch (guarantee.promise) {
    case "envelope": return ["envelope", works("each quantity stays inside its interval")];
    case "part-of-envelope": return ["part-of-envelope", works("each quantity stays inside a part of its interval")];
    case "planned": return ["none, feasible at nominal durations", works("each action still to start takes as long as planned")];
    case undefined: return ["none", ""];
    default: return ["none, may still work", ""];
  }
}

// The slack of each action that runs or is to come and whose duration has an upper limit, the least first.
function slacks(state, now) {
  const found = actionsOf(state, now).filter((it) => it.room && it.room.most < Infinity);
  const measured = found.map((it) => {
    const { least, most, nominal } = it.room;
    const isRunning = it.kind === "running";
    const spent = isRunning ? Math.max(0, now - it.from) : 0;
    const left = most - Math.max(spent, nominal);
    return { key: `${it.kind} ${it.ticket ?? it.parameter}`, action: it.action, isRunning, spent, least, most, nominal, left, share: most > 0 ? left / most : 0 };
  });
  return measured.sort((a, b) => b.isRunning - a.isRunning || a.share - b.share);
}

function gauge() {
  const bar = element("div", { class: "gauge", role: "meter", "aria-valuemin": 0, "data-part": "meter" },
    element("div", { class: "allowed", "data-part": "allowed" }), element("div", { class: "spent", "data-part": "spent" }), element("div", { class: "planned", "data-part": "planned" }));
  return element("li", {}, element("p", { class: "what", "data-part": "what" }), bar, element("p", { class: "note", "data-part": "words" }));
}

function showGauge(node, it) {
  setText(part(node, "what"), it.action);
  const left = Math.max(0, it.left);
  const passed = it.isRunning ? `${seconds(it.spent)} of at most ${nearest(it.most)}` : "to come";
  const slack = it.left < 0 ? "no slack is left" : `slack ${seconds(left)}`;
  const text = `${slack}; ${passed}; planned ${nearest(it.nominal)}, from ${nearest(it.least)} to ${nearest(it.most)}`;
  setText(part(node, "words"), text);
  const meter = part(node, "meter");
  const scale = Math.max(it.most, it.spent) || 1;
  const share = (value) => `${(100 * value / scale).toFixed(2)}%`;
  meter.setAttribute("aria-label", `slack of ${it.action}`);
  meter.setAttribute("aria-valuemax", it.most.toFixed(1));
  meter.setAttribute("aria-valuenow", left.toFixed(1));
  meter.setAttribute("aria-valuetext", text);
  meter.classList.toggle("low", it.share < 0.1);
  const allowed = part(node, "allowed").style;
  allowed.insetInlineStart = share(it.least);
  allowed.width = share(it.most - it.least);
  part(node, "spent").style.width = share(it.spent);
  part(node, "planned").style.insetInlineStart = share(it.nominal);
}

function showQuantities(guarantee) {
  const all = members(guarantee.parameters);
  byId("quantities").hidden = all.length === 0;
  setText(byId("quantity-count"), String(all.length));
  if (!byId("quantities").open) return;
  const row = () => element("tr", {}, element("th", { scope: "row", "data-part": "meaning" }), ...["nominal", "least", "most", "timeout"].map((it) => element("td", { class: "number", "data-part": it })));
  reconcile(byId("quantity-rows"), all, (it) => it.name, row, (node, it) => {
    setText(part(node, "meaning"), `${it.name}, ${it.meaning}`);
    for (const name of ["nominal", "least", "most", "timeout"]) setText(part(node, name), nearest(it[name]));
  });
}

function showSlack(state, now) {
  const guarantee = state.guarantee ?? {};
  const [promise, condition] = promiseWords(guarantee);
  setText(byId("promise"), `guarantee: ${promise}${guarantee.since === undefined ? "" : `, since ${nearest(guarantee.since)}`}`);
  byId("promise").className = `promise ${guarantee.promise ?? "none"}`;
  setText(byId("condition"), condition);
  setText(byId("deviation"), guarantee.deviation ? `last deviation: ${guarantee.deviation}` : "");
  const all = slacks(state, now);
  const running = all.filter((it) => it.isRunning).length;
  reconcile(byId("gauges"), all.slice(0, running + TIGHTEST), (it) => it.key, gauge, showGauge);
  byId("no-gauge").hidden = all.length > 0 || !["envelope", "part-of-envelope"].includes(guarantee.promise);
  showQuantities(guarantee);
}
