// Opens pages in a real browser, and compares what is on them with the documents they were made of.

"use strict";
const assert = require("node:assert/strict");
const fs = require("node:fs");
const path = require("node:path");
const { accessible, cases, cellsOf, close, file, open, page, pddl, rowsOf, run, screenshots, start, test } = require("./harness.cjs");

const delivery = pddl("delivery"), plan = path.join(cases, "delivery/plan.plan");
const world = `format = "elbowroom-world"
version = 1
[[duration]]
action = "drive"
uniform = { from = 0.8, to = 1.6 }
relative = true
[[failure]]
action = "pick"
probability = 0.1
`;

test("the intervals on the page are those of the document", async () => {
  const text = run("envelope", ...delivery, plan, "--json");
  fs.writeFileSync(file("envelope.json"), text);
  const { parameters, timeline } = JSON.parse(text);
  const tab = await open(page("envelope.html", file("envelope.json")));
  const cells = await cellsOf(rowsOf(tab, "How far each quantity may deviate"));
  assert.equal(cells.length, parameters.length);
  for (const [index, parameter] of parameters.entries()) {
    const [name, quantity, nominal, lower, upper, timeout, low, high] = cells[index];
    assert.deepEqual([name, quantity, low, high],
      [parameter.name, parameter.quantity, parameter.lower_limit ?? "", parameter.upper_limit ?? ""]);
    assert.equal(Number(nominal), parameter.nominal.decimal);
    assert.equal(Number(timeout), parameter.timeout.decimal);
    // Rounded inwards, to three digits.
    assert.ok(Number(lower) >= parameter.lower.decimal && Number(lower) - parameter.lower.decimal < 0.001);
    assert.ok(Number(upper) <= parameter.upper.decimal && parameter.upper.decimal - Number(upper) < 0.001);
  }
  const bars = await tab.locator("svg rect[data-bar]").count();
  assert.equal(bars, timeline.actions.length);
  await close(tab);
});

test("bars lie where the document says, whatever the zoom", async () => {
  const { timeline } = JSON.parse(fs.readFileSync(file("envelope.json"), "utf8"));
  const tab = await open(file("envelope.html"));
  const compare = async () => {
    const boxes = await tab.locator("svg rect[data-bar]").evaluateAll((all) =>
      all.map((it) => [Number(it.dataset.bar), Number(it.getAttribute("width"))]));
    boxes.sort((a, b) => a[0] - b[0]);
    const [first, width] = boxes[0];
    const scale = width / (timeline.actions[first].end.decimal - timeline.actions[first].start.decimal);
    for (const [index, wide] of boxes) {
      const { start, end } = timeline.actions[index];
      assert.ok(Math.abs(wide - Math.max(2, (end.decimal - start.decimal) * scale)) < 0.5, `bar ${index}`);
    }
    return scale;
  };
  const before = await compare();
  await tab.getByRole("button", { name: "zoom in" }).click();
  await tab.locator(".scroll").evaluate((it) => { it.scrollLeft = 0; });
  await tab.waitForTimeout(200);
  assert.ok(await compare() > before * 1.3);
  await close(tab);
});

test("arrow keys go from action to action and say what limits it", async () => {
  const tab = await open(file("envelope.html"));
  const { parameters, timeline } = JSON.parse(fs.readFileSync(file("envelope.json"), "utf8"));
  await tab.locator(".scroll").focus();
  const seen = new Set();
  for (let step = 0; step < timeline.actions.length; step++) {
    await tab.keyboard.press("ArrowRight");
    const text = await tab.locator(".panel").textContent();
    const action = timeline.actions.find((it) => text.startsWith(it.action) && !seen.has(it.instance));
    assert.ok(action, text);
    seen.add(action.instance);
    const limit = parameters.find((it) => it.name === action.parameter).upper_limit;
    if (limit) assert.ok(text.includes(limit), text);
  }
  assert.equal(seen.size, timeline.actions.length);
  await close(tab);
});

test("pointing at a bar says what it is", async () => {
  const tab = await open(file("envelope.html"));
  const { timeline } = JSON.parse(fs.readFileSync(file("envelope.json"), "utf8"));
  for (const [index, action] of timeline.actions.entries()) {
    const box = await tab.locator(`svg rect[data-bar="${index}"]`).boundingBox();
    await tab.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await tab.waitForTimeout(100);
    assert.equal(await tab.locator(".panel strong").textContent(), action.action);
  }
  await close(tab);
});

test("lanes can be chosen, and the first choice is the robot", async () => {
  const tab = await open(file("envelope.html"));
  const lanes = () => tab.locator("svg text.lane").allTextContents();
  assert.deepEqual(await lanes(), ["rover", "others"]);
  await tab.getByLabel("Lanes").selectOption({ label: "place" });
  assert.deepEqual(new Set(await lanes()), new Set(["depot", "shelf", "office"]));
  await close(tab);
});

test("a run is shown beside its plan, and any moment of it can be looked at", async () => {
  fs.writeFileSync(file("world.toml"), world);
  run("run", ...delivery, "--plan", plan, "--world", file("world.toml"), "--seed", "3", "--executor", "live", "--trace", file("run.jsonl"));
  const lines = fs.readFileSync(file("run.jsonl"), "utf8").trim().split("\n").map((line) => JSON.parse(line));
  const over = lines.at(-1);
  const tab = await open(page("run.html", file("run.jsonl")));
  const cells = await cellsOf(rowsOf(tab, "Planned and actual times"));
  assert.equal(cells.length, over.executed.length);
  for (const [index, done] of over.executed.entries()) {
    assert.equal(cells[index][0], done.action);
    assert.ok(Math.abs(Number(cells[index][2]) - done.start.decimal) < 0.001);
    assert.ok(Math.abs(Number(cells[index][4]) - done.start.decimal - done.duration.decimal) < 0.001);
    assert.equal(cells[index][5], done.outcome);
  }
  // In the middle of each action it is running, and the last decision is the last one of the trace.
  const slider = tab.locator("#time");
  for (const done of over.executed) {
    const time = done.start.decimal + done.duration.decimal / 2;
    await slider.evaluate((it, value) => { it.value = value; it.dispatchEvent(new Event("input")); }, time);
    const now = await tab.locator(".now").textContent();
    assert.ok(now.includes(done.action), `${done.action} at ${time}: ${now}`);
    const decision = lines.filter((line) => line.event === "decided" && line.now.decimal <= time).at(-1);
    assert.ok(now.includes(decision.reason.words), now);
  }
  // Dragged to the left end with the mouse, and on with a key.
  const box = await slider.boundingBox();
  await tab.mouse.move(box.x + box.width - 3, box.y + box.height / 2);
  await tab.mouse.down();
  await tab.mouse.move(box.x, box.y + box.height / 2, { steps: 5 });
  await tab.mouse.up();
  assert.equal(Number(await slider.inputValue()), 0);
  await slider.press("ArrowRight");
  assert.ok(Number(await slider.inputValue()) > 0);
  // Each decision is in the log, with its reason.
  const log = await cellsOf(rowsOf(tab, "Events and reasons"));
  const decided = lines.filter((line) => line.event === "decided");
  const rows = log.filter((row) => row[1] === "decision");
  assert.deepEqual(rows.map((row) => row[4]), decided.map((line) => line.reason.words));
  await close(tab);
});

test("numbers over time are drawn with what conditions allowed", async () => {
  run("run", ...pddl("battery"), "--trace", file("battery.jsonl"));
  const tab = await open(page("battery.html", file("battery.jsonl")));
  const curves = tab.locator(".curve-box", { has: tab.locator("h3", { hasText: "charge" }) });
  assert.ok(await curves.count() > 0);
  assert.ok(await curves.first().locator("line.limit").count() > 0);
  const closest = await curves.first().locator("[data-closest]").textContent();
  // All went as planned: no limit was broken.
  assert.match(closest, /^Least slack at [0-9.]+: [0-9.]+ to [<>]=? [0-9.]+ (at the start of|during|at the end of) \(/);
  await close(tab);
});

test("a table is filtered by what is typed", async () => {
  const tab = await open(file("run.html"));
  const rows = rowsOf(tab, "Events and reasons");
  const all = await rows.count();
  await tab.getByLabel("Filter: Events and reasons").fill("has succeeded");
  const some = await cellsOf(rows);
  assert.ok(some.length > 0 && some.length < all);
  assert.ok(some.every((row) => row.join(" ").includes("has succeeded")));
  await close(tab);
});

test("the rates of an experiment are those of its results", async () => {
  fs.writeFileSync(file("experiment.toml"), `format = "elbowroom-experiment"
version = 1
title = "Busy <b>corridors</b>"
domain = ${JSON.stringify(delivery[0])}
problem = ${JSON.stringify(delivery[1])}
trials = 40
executors = ["guarded", "live", "fixed:20"]
[[column]]
name = "busy"
world = "world.toml"
`);
  run("compare", file("experiment.toml"), "-o", file("results"));
  const results = JSON.parse(fs.readFileSync(file("results/results.json"), "utf8"));
  const tab = await open(page("experiment.html", file("results")));
  assert.equal(await tab.locator("h1").textContent(), "Busy <b>corridors</b>");
  const rates = await tab.locator(".rate .words").allTextContents();
  assert.equal(rates.length, results.rows.length);
  for (const [row, words] of rates.entries()) {
    const { runs, successes } = results.cells[row][0];
    assert.ok(words.includes(`, ${successes} of ${runs}`), words);
    assert.ok(words.startsWith(`${((100 * successes) / runs).toFixed(1)} %`), words);
  }
  const pairs = await cellsOf(rowsOf(tab, "Compared with guarded"));
  assert.deepEqual(pairs.map((row) => row.slice(2, 4).map(Number)),
    results.pairs.slice(1).map(([pair]) => [pair.only_first, pair.only_this]));
  // Failed runs by kind; the first of each can be looked at.
  const kinds = results.cells.flatMap(([cell]) => cell.failures ?? []);
  const rows = rowsOf(tab, "Where runs fail");
  const failures = await cellsOf(rows);
  assert.equal(failures.length, kinds.length);
  assert.ok(kinds.length > 0);
  const sum = (numbers) => numbers.reduce((a, b) => a + b, 0);
  assert.equal(sum(failures.map((row) => Number(row[5]))), sum(results.cells.map(([cell]) => cell.runs - cell.successes)));
  const [, executor, verdict] = failures[0];
  await rows.first().getByRole("button", { name: "show" }).click();
  assert.match(await tab.locator("h1").textContent(), /^Run of /);
  assert.ok((await tab.locator("#verdict").textContent()).includes(verdict));
  assert.ok((await tab.locator(".facts").textContent()).includes(executor));
  await tab.locator("#time").press("ArrowLeft");
  assert.equal(await tab.evaluate(() => document.activeElement.id), "time");
  await accessible(tab, "a run in an experiment");
  await tab.getByRole("button", { name: "Back to the experiment" }).click();
  assert.equal(await tab.locator("h1").textContent(), "Busy <b>corridors</b>");
  assert.equal(await rows.count(), kinds.length);
  await close(tab);
});

test("trials in a world without time fail by what ended them, and the first of each kind can be read step by step", async () => {
  const own = (name) => JSON.stringify(path.join(cases, "../experiments/olisipo", name));
  fs.writeFileSync(file("untimed.toml"), `format = "elbowroom-perturbed-experiment"
version = 1
title = "Machines that break"
domain = ${own("sf3-domain.pddl")}
problem = ${own("sf3-problem.pddl")}
trials = 60
seed = 1
worlds = ["sound"]
executors = ["esterel", "adaptable"]
[optimum]
most_running = 3
[[case]]
name = "first"
likelihoods = ${own("sf3-p1.toml")}
`);
  run("compare", file("untimed.toml"), "-o", file("untimed"));
  const { rows } = JSON.parse(fs.readFileSync(file("untimed/results.json"), "utf8"));
  const tab = await open(page("untimed.html", file("untimed")));
  const failures = rowsOf(tab, "Where trials fail");
  const cells = await cellsOf(failures);
  const counted = rows.map((row) => row.failures.reduce((sum, it) => sum + it.runs, 0));
  assert.deepEqual(counted, rows.map((row) => row.success.count - row.success.successes));
  assert.equal(cells.reduce((sum, row) => sum + Number(row[6]), 0), counted[0] + counted[1]);
  await failures.first().getByRole("button", { name: "show" }).click();
  const [, , executor, why, last, came, , first] = cells[0];
  assert.equal(await tab.locator("h1").textContent(), `Trial ${first.replace("show", "").trim()} of first, ${executor}`);
  assert.equal((await tab.locator("#verdict").textContent()).toLowerCase(), `${why}.`);
  const steps = await cellsOf(rowsOf(tab, "Step by step"));
  assert.equal(steps.at(-1)[2], last);
  assert.ok(steps.at(-1)[3].startsWith(came), `${steps.at(-1)}, not ${came}`);
  await accessible(tab, "a trial without time");
  await tab.getByRole("button", { name: "Back to the experiment" }).click();
  assert.equal(await failures.count(), cells.length);
  await close(tab);
});

test("the page of a region says how far two quantities may go, whatever the others are", async () => {
  const text = run("envelope", ...delivery, plan, "--method", "exact", "--volume", "--json");
  fs.writeFileSync(file("region.json"), text);
  const { parameters, pieces, boxes, timeline } = JSON.parse(text);
  const tab = await open(page("region.html", file("region.json")));
  const values = Object.fromEntries(parameters.map((it) => [it.name, it.nominal.decimal]));
  // From where to where one quantity satisfies all rows, the others being what they are.
  const alone = (name) => {
    let [low, high] = [-Infinity, Infinity];
    for (const { factors, bound } of pieces[0].rows) {
      const rest = Object.entries(factors).reduce((left, [own, factor]) => (own === name ? left : left - factor.decimal * values[own]), bound.decimal);
      const factor = factors[name]?.decimal ?? 0;
      if (factor > 0) high = Math.min(high, rest / factor);
      if (factor < 0) low = Math.max(low, rest / factor);
    }
    return [low, high];
  };
  const compare = async (...names) => {
    const told = await tab.locator("[data-told]").textContent();
    for (const name of names) {
      const [low, high] = alone(name);
      const [, from, to] = told.match(new RegExp(`${name} may be (-?[0-9]+(?:[.][0-9]+)?) to (-?[0-9]+(?:[.][0-9]+)?)`));
      assert.ok(Math.abs(from - low) < 0.002 && Math.abs(to - high) < 0.002, `${name}: ${told}, not ${low} to ${high}`);
    }
  };
  assert.equal(pieces.length, 1);
  await compare("dur_0", "dur_1");
  await tab.locator("[data-axis='0']").selectOption("3");
  await compare("dur_3", "dur_1");
  // The chart of the plan, and its sliders: they are those of the picture, too.
  assert.equal(await tab.locator("svg rect[data-bar]").count(), timeline.actions.length);
  const slider = tab.locator("[data-slider='dur_4']");
  await slider.focus();
  for (let step = 0; step < 5; step++) await tab.keyboard.press("ArrowRight");
  values.dur_4 = Number(await slider.inputValue());
  assert.ok(values.dur_4 > 3);
  await compare("dur_3", "dur_1");
  const works = pieces[0].rows.every(({ factors, bound, strict }) => {
    const sum = Object.entries(factors).reduce((sum, [name, factor]) => sum + factor.decimal * values[name], 0);
    return strict ? sum < bound.decimal : sum <= bound.decimal;
  });
  assert.equal(await tab.locator("#point").getAttribute("data-works"), String(works));
  const rooms = await tab.locator("#sliders .slider .note").allTextContents();
  for (const [index, { name, nominal }] of parameters.entries()) {
    const chosen = values.dur_4;
    values.dur_4 = parameters[4].nominal.decimal;
    const [low, high] = alone(name);
    values.dur_4 = chosen;
    assert.ok(low <= nominal.decimal && nominal.decimal <= high);
    const [, from, to] = rooms[index].match(/planned: (-?[0-9.]+) to (-?[0-9.]+)$/);
    assert.ok(Math.abs(from - low) < 0.002 && Math.abs(to - high) < 0.002, `${name}: ${rooms[index]}, not ${low} to ${high}`);
  }
  assert.equal(await tab.locator("polygon.works").count(), 1);
  const shares = await cellsOf(rowsOf(tab, "Share of the region in each box"));
  assert.deepEqual(shares.map(([, share]) => share), boxes.map((it) => `${(100 * it.share.decimal).toFixed(2)} %`));
  const rows = await cellsOf(rowsOf(tab, "Inequalities"));
  assert.deepEqual(rows.map((row) => row[0]), pieces[0].rows.map((row) => row.text));
  await tab.getByRole("button", { name: "as planned" }).click();
  values.dur_4 = parameters[4].nominal.decimal;
  await compare("dur_3", "dur_1");
  await close(tab);
});

const hostile = [
  "(<img src=x onerror=window.hit=1> a)", "</script><script>window.hit=1</script>", "(go \"' & <!--)",
  `(${"x".repeat(10_000)} a)`, "(اذهب إلى المكتب)", "(a \u202e desrever \u2028 b)", "(javascript:window.hit=1 a)",
];
test("hostile names and texts are shown as text", async () => {
  const envelope = JSON.parse(fs.readFileSync(file("envelope.json"), "utf8"));
  const { actions } = envelope.timeline;
  envelope.timeline.actions = hostile.map((action, index) => ({ ...actions[index % actions.length], action, instance: `n${index}` }));
  envelope.timeline.timed[0].changes = [hostile[1]];
  envelope.problem = envelope.domain = envelope.plan = hostile[1];
  envelope.parameters[0].name = envelope.parameters[0].upper_limit = hostile[0];
  fs.writeFileSync(file("hostile.json"), JSON.stringify(envelope));
  const tab = await open(page("hostile.html", file("hostile.json")));
  const names = (await cellsOf(rowsOf(tab, "Actions"))).map((row) => row[0]);
  for (const name of hostile) assert.ok(names.some((cell) => cell.endsWith(name)), name.slice(0, 40));
  await tab.locator(".scroll").focus();
  for (let step = 0; step < hostile.length; step++) await tab.keyboard.press("ArrowRight");
  assert.equal(await tab.evaluate(() => window.hit), undefined);
  assert.equal(await tab.locator("img").count(), 0);
  const width = await tab.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(width <= 0, `the page is ${width} px too wide`);
  await close(tab);
});

test("no page is wider than a telephone, and none has what axe objects to", async () => {
  for (const name of ["envelope", "region", "run", "battery", "experiment", "untimed", "hostile"]) {
    for (const width of [1280, 400]) {
      for (const colorScheme of ["light", "dark"]) {
        const tab = await open(file(`${name}.html`), { viewport: { width, height: 900 }, colorScheme, bypassCSP: true });
        await accessible(tab, `${name} at ${width}, ${colorScheme}`);
        if (screenshots) await tab.screenshot({ path: path.join(screenshots, `${name}-${width}-${colorScheme}.png`), fullPage: true });
        await close(tab);
      }
    }
  }
});

test("a printed page has all lanes and no controls", async () => {
  const tab = await open(file("run.html"));
  await tab.emulateMedia({ media: "print" });
  assert.equal(await tab.locator(".controls:visible").count(), 0);
  const printed = await tab.pdf({ format: "A4" });
  assert.ok(printed.length > 10_000 && printed.subarray(0, 4).toString() === "%PDF");
  if (screenshots) fs.writeFileSync(path.join(screenshots, "run.pdf"), printed);
  await close(tab);
});

test("ten thousand actions load, scroll and scrub smoothly", async () => {
  const envelope = JSON.parse(fs.readFileSync(file("envelope.json"), "utf8"));
  const number = (value) => ({ exact: String(value), decimal: value });
  const many = Array.from({ length: 10_000 }, (_, index) => {
    const start = Math.floor(index / 10) * 11;
    return {
      instance: `n${index}`, action: `(drive rover${index % 10} place${index % 97} place${(index + 1) % 97})`,
      start: number(start), end: number(start + 10),
      start_window: { earliest: number(start), latest: number(start + 4) },
      end_window: { earliest: number(start + 7), latest: number(start + 14) },
    };
  });
  envelope.timeline = { ...envelope.timeline, actions: many, types: Object.fromEntries(Array.from({ length: 10 }, (_, it) => [`rover${it}`, "robot"])) };
  fs.writeFileSync(file("many.json"), JSON.stringify(envelope));
  const made = page("many.html", file("many.json"));
  const begun = Date.now();
  const tab = await open(made);
  const loaded = Date.now() - begun;
  await tab.getByRole("button", { name: "zoom in" }).click({ clickCount: 8 });
  // The time of the frames while it scrolls from one end to the other.
  const frames = await tab.evaluate(() => new Promise((resolve) => {
    const scroll = document.querySelector(".scroll"), times = [];
    let last = performance.now(), step = 0;
    const next = (now) => {
      times.push(now - last);
      last = now;
      scroll.scrollLeft = (step / 60) * scroll.scrollWidth;
      scroll.scrollTop = (step % 10) * 40;
      if (step++ < 60) requestAnimationFrame(next);
      else resolve(times.slice(1));
    };
    requestAnimationFrame(next);
  }));
  frames.sort((a, b) => a - b);
  const [middle, worst] = [frames[frames.length >> 1], frames.at(-1)];
  const drawn = await tab.locator("svg rect[data-bar]").count();
  console.log(`   10,000 actions: ${(fs.statSync(made).size / 1e6).toFixed(1)} MB, loaded in ${loaded} ms, frames ${middle.toFixed(0)} ms in the middle, ${worst.toFixed(0)} ms at worst, ${drawn} bars in the page`);
  assert.ok(drawn < 2000, `${drawn} bars are in the page`);
  if (screenshots) await tab.screenshot({ path: path.join(screenshots, "many.png") });
  await close(tab);
});

test("a long run loads, and its log follows the slider", async () => {
  // A stored run, with its middle repeated.
  const lines = fs.readFileSync(file("run.jsonl"), "utf8").trim().split("\n");
  const decided = lines.filter((line) => line.startsWith('{"event":"decided"'));
  const many = Array.from({ length: 3000 }, () => decided).flat();
  fs.writeFileSync(file("long.jsonl"), [lines[0], lines[1], ...many, ...lines.slice(2)].join("\n"));
  const tab = await open(page("long.html", file("long.jsonl")));
  const rows = rowsOf(tab, "Events and reasons");
  assert.equal(await rows.count(), 200);
  const times = await tab.evaluate(() => {
    const slider = document.getElementById("time"), times = [];
    for (let step = 0; step <= 20; step++) {
      slider.value = (step / 20) * Number(slider.max);
      const begun = performance.now();
      slider.dispatchEvent(new Event("input"));
      times.push(performance.now() - begun);
    }
    return times.sort((a, b) => a - b);
  });
  console.log(`   ${many.length} decisions: a step of the slider takes ${times[10].toFixed(0)} ms in the middle, ${times.at(-1).toFixed(0)} ms at worst`);
  assert.equal(await rows.count(), 200);
  assert.equal(await tab.locator("tr.current").count(), 1);
  await close(tab);
});

test("the same input gives the same bytes", async () => {
  assert.equal(run("report", file("run.jsonl")), fs.readFileSync(file("run.html"), "utf8"));
});

start();
