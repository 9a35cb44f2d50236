// A run at one moment: the running actions, the last decision, and the true facts.

const MOST_FACTS = 300;

function scrubView(chart, textOf, onTime) {
  const decided = chart.decisions.map((decision) => decision.at);
  const secured = chart.guarantee.map((segment) => segment.from);
  const ends = [chart.bars.map((bar) => bar.actual?.[1] ?? 0), decided, chart.changes.map((change) => change.at)];
  const last = ends.flat().reduce((a, b) => Math.max(a, b), 0);
  const step = niceStep(last || 1, 1000);
  const slider = element("input", { type: "range", min: 0, max: last, step: "any", value: last, id: "time", oninput: () => show(Number(slider.value), true) });
  const output = element("output", { for: "time" });
  const now = element("div", { class: "now", role: "region", "aria-label": "The run at this time" });
  const moments = [...new Set([...decided, ...chart.changes.map((change) => change.at)])].sort((a, b) => a - b);
  const go = (by) => {
    const at = Number(slider.value);
    const next = by > 0 ? moments.find((moment) => moment > at + 1e-9) : moments[lastAt(moments, at - 1e-9)];
    if (next !== undefined) { slider.value = next; show(next, true); }
  };
  slider.addEventListener("keydown", (event) => {
    const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (!by) return;
    event.preventDefault();
    go(by);
  });

  function state(time) {
    const facts = new Map(), numbers = new Map();
    for (const change of chart.changes) {
      if (change.at > time) break;
      const name = textOf(change.name);
      if (change.kind === "number") numbers.set(name, change.value);
      else if (change.value === null) facts.delete(name);
      else facts.set(name, change.value);
    }
    return { facts: [...facts.keys()].sort(), numbers: [...numbers].sort(([a], [b]) => (a < b ? -1 : 1)) };
  }

  function show(time, isMoved) {
    output.textContent = rounded(time, step / 10);
    slider.setAttribute("aria-valuetext", `time ${rounded(time, step / 10)}`);
    const running = chart.bars.filter((bar) => bar.actual && bar.actual[0] <= time && (time < bar.actual[1] || bar.outcome === "running"));
    const decision = chart.decisions[lastAt(decided, time)];
    const guarantee = chart.guarantee[lastAt(secured, time)];
    const { facts, numbers } = state(time);
    const names = (list) => (list.length ? element("ul", {}, ...list.map((text) => element("li", {}, words(text)))) : "none");
    const rows = [
      ["running", names(running.map((bar) => bar.name))],
      ["last decision", decision ? words(`${rounded(decision.at, 0.001)}: ${decision.words}`) : "none yet"],
      guarantee ? ["the rest", words(guarantee.words)] : null,
      numbers.length ? ["numbers", fold(numbers.map(([name, value]) => `${name} = ${value}`), "number", "numbers")] : null,
      chart.changes.length ? ["facts", fold(facts, "true fact", "true facts")] : null,
    ];
    now.replaceChildren(element("dl", {}, ...rows.filter(Boolean).flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)])));
    onTime(time, isMoved);
  }

  // A list that keeps its open or closed state.
  const open = new Map();
  function fold(list, one, many) {
    const more = list.length > MOST_FACTS ? [element("li", {}, `and ${list.length - MOST_FACTS} more`)] : [];
    const details = element("details", { open: open.get(many) ?? list.length <= 12, ontoggle: () => open.set(many, details.open) },
      element("summary", {}, `${list.length} ${list.length === 1 ? one : many}`),
      element("ul", {}, ...list.slice(0, MOST_FACTS).map((text) => element("li", {}, words(text))), ...more));
    return details;
  }

  const node = element("section", {}, element("h2", {}, "State at one time"),
    element("div", { class: "scrub" },
      element("div", { class: "controls" },
        element("label", { for: "time" }, "Time"), output,
        element("button", { type: "button", onclick: () => go(-1) }, "earlier"),
        element("button", { type: "button", onclick: () => go(1) }, "later")),
      slider),
    now);
  // If the slider is at the end, it stays there when new data arrives.
  const chosen = () => (Number(slider.value) < last ? { time: Number(slider.value) } : null);
  const choose = (before) => { slider.value = before.time; };
  return { node, show: () => show(Number(slider.value), false), chosen, choose };
}
