// Puts the page together.

const data = JSON.parse(document.getElementById("data").textContent);
const textOf = (text) => (typeof text === "number" ? data.texts[text] : text);
const main = document.getElementById("main");
document.getElementById("verdict").classList.add(data.verdict.tone);
document.querySelector("header").append(element("dl", { class: "facts" },
  ...data.facts.map(([name, value]) => element("div", {}, element("dt", {}, name), element("dd", {}, words(value))))));

let firstChart = null;
const tables = [], moving = [], charts = [];
for (const section of data.sections) {
  if (section.type === "chart") {
    const isFirst = firstChart === null;
    const view = chartView(section, textOf, (bar) => { if (isFirst) for (const table of tables) table.pick?.(bar); });
    main.append(view.node);
    charts.push(view);
    if (isFirst) firstChart = { view, section };
    if (section.is_run) moving.push(view.cursor);
  } else if (section.type === "table") {
    const view = tableView(section, textOf, (bar) => firstChart?.view.pick(bar));
    tables.push(view);
    main.append(view.node);
    if (view.at) moving.push(view.at);
  } else if (section.type === "rates") {
    main.append(ratesView(section));
  } else if (section.type === "series") {
    const view = seriesView(section);
    main.append(view.node);
    moving.push(view.at);
  } else if (section.type === "sliders") {
    main.append(slidersView(section, textOf, (spans) => firstChart?.view.move(spans)).node);
  } else {
    main.append(proseView(section));
  }
}
if (firstChart?.section.is_run && firstChart.section.decisions.length) {
  const scrub = scrubView(firstChart.section, textOf, (time, isMoved) => { for (const move of moving) move(time, isMoved); });
  firstChart.view.node.after(scrub.node);
  scrub.show();
}
for (const chart of charts) chart.paint();
document.documentElement.dataset.ready = "true";
