// A slider for each quantity that may deviate: shows whether the plan works, the changed times, and the first violated condition.

function slidersView(section, textOf, onTimes, onValues) {
  const system = readSystem(section.system);
  const own = section.sliders;
  const nominal = own.map((it) => parsed(it.nominal));
  const values = [...nominal];
  const planned = checkPoint(system, nominal);

  const verdict = element("p", { class: "verdict plain", role: "status", "aria-live": "polite", id: "point" });
  const moved = element("div", { class: "moved" });
  const limits = element("p", { class: "note", id: "limits", "aria-live": "polite" });
  let touched = -1, timer = null;

  // The value of a slider as a text, and as a number.
  const decimal = (value) => rounded(toNumber(value), 1e-6);
  const inputs = own.map((it, index) => {
    const input = element("input", { type: "range", id: `slider-${index}`, min: it.from, max: it.to, step: it.step, "data-slider": it.name,
      oninput: () => set(index, parsed(rounded(Number(input.value), 1e-6))) });
    const output = element("output", { for: `slider-${index}` });
    const guaranteed = element("span", { class: "note" }, it.guaranteed);
    const row = element("div", { class: "slider" }, element("label", { for: `slider-${index}` }, words(it.quantity)), output, input, guaranteed);
    return { input, output, row };
  });

  function set(index, value) {
    values[index] = value;
    touched = index;
    update();
  }

  function update() {
    for (const [index, { input, output, row }] of inputs.entries()) {
      output.textContent = decimal(values[index]);
      input.setAttribute("aria-valuetext", output.textContent);
      row.classList.toggle("changed", sign(minus(values[index], nominal[index])) !== 0);
    }
    const found = checkPoint(system, values);
    const tone = { true: "good", false: "bad", null: "plain" }[found.works];
    verdict.className = `verdict ${tone}`;
    verdict.dataset.works = found.works;
    verdict.replaceChildren(words(found.works === null
      ? `Undecided: ${found.words}, but the plan may work in another order.`
      : found.works ? "The plan works with these values." : `The plan fails: ${found.words}.`));
    const spans = found.works ? section.bars.map(([start, end]) => ({
      planned: [found.earliest[start], found.earliest[end]],
      starts: [found.earliest[start], found.latest[start]],
      ends: start === end ? null : [found.earliest[end], found.latest[end]],
    })) : null;
    onTimes(spans);
    onValues(values.map(toNumber));
    describeMoves(found);
    clearTimeout(timer);
    limits.textContent = "";
    if (touched >= 0 && found.works !== null) timer = setTimeout(describeLimits, 150);
  }

  // Starts and ends whose times differ from the planned ones.
  function describeMoves(found) {
    if (!found.works || !planned.works) { moved.replaceChildren(); return; }
    const moves = section.bars.map(([start, end], bar) => {
      const by = [start, end].map((node) => found.earliest[node] - planned.earliest[node]);
      return { bar, start: by[0], end: by[1] };
    }).filter(({ start, end }) => Math.abs(start) > 1e-9 || Math.abs(end) > 1e-9);
    if (!moves.length) { moved.replaceChildren(element("p", { class: "note" }, "No times change.")); return; }
    const signed = (by) => (Math.abs(by) < 1e-9 ? "0" : `${by > 0 ? "+" : "−"}${rounded(Math.abs(by), 0.001)}`);
    const rows = moves.map(({ bar, start, end }) => element("tr", {}, element("td", {}, words(textOf(section.names[bar]))),
      element("td", { class: "number" }, signed(start)), element("td", { class: "number" }, signed(end))));
    const heads = ["changed", "start", "end"].map((name, column) => element("th", { scope: "col", class: column ? "number" : null }, name));
    moved.replaceChildren(element("div", { class: "wide", tabindex: "0", role: "region", "aria-label": "Changed times" },
      element("table", { id: "moves" }, element("thead", {}, element("tr", {}, ...heads)), element("tbody", {}, ...rows))));
  }

  // The range of the slider moved last, with the others fixed, and the condition that limits it.
  function describeLimits() {
    const quantity = own[touched].quantity;
    if (!checkPoint(system, values).works) { limits.textContent = ""; return; }
    const step = parsed(own[touched].step);
    const sides = [[-1n, own[touched].from, "Down"], [1n, own[touched].to, "Up"]].map(([direction, far, way]) => {
      const at = (count) => {
        const point = [...values];
        point[touched] = plus(values[touched], times([direction * count, 1n], step));
        return point;
      };
      const distance = over(minus(parsed(far), values[touched]), times([direction, 1n], step));
      const most = distance[0] / distance[1];
      if (most <= 0n) return null;
      let [good, bad] = [0n, most];
      let end = checkPoint(system, at(most));
      if (end.works) return `${way} to ${decimal(at(most)[touched])}: works.`;
      while (bad - good > 1n) {
        const middle = (good + bad) / 2n, there = checkPoint(system, at(middle));
        if (there.works) good = middle; else [bad, end] = [middle, there];
      }
      return `${way} to ${decimal(at(good)[touched])}: works; the first violation beyond: ${end.words}.`;
    });
    limits.replaceChildren(words(`${quantity}. ${sides.filter(Boolean).join(" ")}`));
  }

  const reset = element("button", { type: "button", onclick: () => {
    for (const [index, { input }] of inputs.entries()) { values[index] = nominal[index]; input.value = toNumber(nominal[index]); }
    touched = -1;
    update();
    onTimes(null);
  } }, "as planned");
  for (const [index, { input }] of inputs.entries()) input.value = toNumber(nominal[index]);
  const node = element("section", { id: "sliders" }, element("h2", {}, section.heading), element("p", { class: "note" }, section.note),
    verdict, limits, element("div", { class: "controls" }, reset), element("div", { class: "sliders" }, ...inputs.map((it) => it.row)), moved);
  update();
  onTimes(null);
  return { node };
}
