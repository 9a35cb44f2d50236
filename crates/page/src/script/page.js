// Builds the page, and rebuilds it whenever a live run has new data.

let data = JSON.parse(document.getElementById("data").textContent);
// The previous pages, with their scroll positions.
const before = [];
const textOf = (text) => (typeof text === "number" ? data.texts[text] : text);
const main = document.getElementById("main");
const facts = element("dl", { class: "facts" });
document.querySelector("header").append(facts);
let views = [], life = null;

function open(page) {
  before.push([data, scrollY]);
  data = data.more[page];
  views = [];
  show();
  const back = element("button", { type: "button", id: "back", onclick: () => {
    back.remove();
    const [document, scrolled] = before.pop();
    data = document;
    views = [];
    show();
    scrollTo(0, scrolled);
  } }, "Back to the experiment");
  document.getElementById("title").before(back);
  scrollTo(0, 0);
  back.focus();
}

function show() {
  // The user's selections are kept.
  const kept = new Map(views.map(([heading, view]) => [heading, view.chosen?.()]));
  life?.abort();
  life = new AbortController();
  views = [];
  const parts = [];
  document.title = data.title;
  document.getElementById("title").textContent = data.title;
  const verdict = document.getElementById("verdict");
  verdict.className = `verdict ${data.verdict.tone}`;
  verdict.textContent = data.verdict.words;
  facts.replaceChildren(...data.facts.map(([name, value]) => element("div", {}, element("dt", {}, name), element("dd", {}, words(value)))));

  let firstChart = null, plane = null, hasSliders = false;
  const tables = [], moving = [], charts = [];
  const add = (heading, view) => {
    parts.push(view.node);
    views.push([heading, view]);
    return view;
  };
  for (const section of data.sections) {
    if (section.type === "chart") {
      const isFirst = firstChart === null;
      const view = add(section.heading, chartView(section, textOf, (bar) => { if (isFirst) for (const table of tables) table.pick?.(bar); }, life.signal));
      charts.push(view);
      if (isFirst) firstChart = { view, section };
      if (section.is_run) moving.push(view.cursor);
      if (isFirst && section.is_run && section.decisions.length) {
        const scrub = add("scrub", scrubView(section, textOf, (time, isMoved) => { for (const move of moving) move(time, isMoved); }));
        firstChart.scrub = scrub;
      }
    } else if (section.type === "table") {
      const view = add(section.heading, tableView(section, textOf, (bar) => firstChart?.view.pick(bar), open));
      tables.push(view);
      if (view.at) moving.push(view.at);
    } else if (section.type === "rates") {
      parts.push(ratesView(section));
    } else if (section.type === "series") {
      const view = add(section.heading, seriesView(section));
      moving.push(view.at);
    } else if (section.type === "sliders") {
      hasSliders = true;
      parts.push(slidersView(section, textOf, (spans) => firstChart?.view.move(spans), (values) => plane?.set(values)).node);
    } else if (section.type === "plane") {
      // Both are about the same quantities.
      plane = planeView(section, hasSliders);
      parts.push(plane.node);
    } else {
      parts.push(proseView(section));
    }
  }
  main.replaceChildren(...parts);
  for (const [heading, view] of views) if (kept.get(heading)) view.choose(kept.get(heading));
  firstChart?.scrub?.show();
  for (const chart of charts) chart.paint();
}

show();
if ("live" in document.documentElement.dataset) {
  facts.before(liveView((newer) => {
    const goBack = place(main);
    data = newer;
    show();
    goBack();
  }));
}
document.documentElement.dataset.ready = "true";
