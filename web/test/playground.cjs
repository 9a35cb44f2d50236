// Opens the playground from the disk, without a network, and compares what it answers with the command.
//
//   node playground.cjs ELBOWROOM CASES WORK [CHROMIUM]

"use strict";
const assert = require("node:assert/strict");
const { spawnSync } = require("node:child_process");
const fs = require("node:fs");
const path = require("node:path");
const { accessible, cases, cellsOf, close, file, open, pddl, run, screenshots, start, test } = require("../../crates/page/tests/browser/harness.cjs");

const elbowroom = path.resolve(process.argv[2]);
const playground = path.join(__dirname, "../dist/index.html");
const plan = path.join(cases, "delivery/plan.plan"), world = path.join(cases, "delivery/world.toml");
const status = (tab) => tab.locator("#status");
const says = (tab, words) => tab.waitForFunction((it) => document.getElementById("status").textContent.includes(it), words, { timeout: 60_000 });
const press = (tab, name) => tab.getByRole("button", { name, exact: true }).click();
const choose = async (tab, name) => { await tab.locator("#example").selectOption(name); await tab.waitForFunction(() => !document.getElementById("status").textContent.startsWith("Loading")); };
const editor = (tab, name) => tab.locator(`#panel-${["domain", "problem", "plan", "world"].indexOf(name)} textarea`);
const write = async (tab, name, text) => {
  await tab.getByRole("tab", { name: { domain: "Domain", problem: "Problem", plan: "Plan", world: "World" }[name] }).click();
  await editor(tab, name).fill(text);
};
// The page of an answer, when it is ready.
async function answer(tab) {
  await tab.locator("#page").waitFor({ state: "visible", timeout: 60_000 });
  const frame = await (await tab.locator("#page").elementHandle()).contentFrame();
  await frame.waitForFunction(() => document.documentElement.dataset.ready === "true", null, { timeout: 60_000 });
  return frame;
}

test("it begins with an example whose plan is valid", async () => {
  const begun = Date.now();
  const tab = await open(playground);
  await says(tab, "Valid: the plan reaches the goal at");
  console.log(`   loaded and checked in ${Date.now() - begun} ms, ${(fs.statSync(playground).size / 1e6).toFixed(2)} MB`);
  await close(tab);
});

test("the envelope of each example has the numbers of the command, and sliders that work", async () => {
  const tab = await open(playground);
  const verdicts = new Set();
  for (const name of ["delivery", "battery", "match", "paintshop"]) {
    await choose(tab, name);
    await press(tab, "Envelope");
    await says(tab, "The envelope was found");
    const frame = await answer(tab);
    const { parameters } = JSON.parse(run("envelope", ...pddl(name), path.join(cases, name, "plan.plan"), "--json"));
    const table = frame.locator("section", { has: frame.locator("h2", { hasText: "How far each quantity may deviate" }) });
    const cells = await cellsOf(table.locator("tbody tr"));
    assert.equal(cells.length, parameters.length, name);
    for (const [index, it] of parameters.entries()) {
      assert.equal(cells[index][0], it.name);
      if (it.upper.decimal !== null) assert.ok(it.upper.decimal - Number(cells[index][4]) < 0.001 && Number(cells[index][4]) <= it.upper.decimal);
    }
    const slider = frame.locator(".slider input").first();
    await slider.press("End");
    // Whether the plan works with these values is what the command says.
    const outputs = await frame.locator(".slider output").allTextContents();
    const box = parameters.map((it, index) => `${it.name}=[${outputs[index]},${outputs[index]}]`).join(" ");
    const { status: exit } = spawnSync(elbowroom, ["envelope", ...pddl(name), path.join(cases, name, "plan.plan"), "--contains", box], { encoding: "utf8" });
    verdicts.add(exit);
    assert.equal(await frame.locator("#point").getAttribute("data-works"), String(exit === 0), name);
  }
  assert.deepEqual([...verdicts].sort(), [0, 1], "both verdicts occur");
  await close(tab);
});

test("a plan is found, written into the editor, and is valid", async () => {
  const tab = await open(playground);
  await choose(tab, "errand");
  await press(tab, "Find a plan");
  await says(tab, "A plan was found");
  await answer(tab);
  assert.equal(await editor(tab, "plan").inputValue(), JSON.parse(run("plan", ...pddl("errand"), "--json")).plan);
  await press(tab, "Check");
  await says(tab, "Valid");
  await close(tab);
});

test("the commands of the tutorial can be tried, and answer as they do in a terminal", async () => {
  const tab = await open(playground);
  await says(tab, "Valid");
  await tab.locator("#tutorial summary").click();
  const chapters = await tab.locator("#chapter option").count();
  assert.equal(chapters, 5);
  let tried = 0;
  for (let chapter = 0; chapter < chapters; chapter++) {
    await tab.locator("#chapter").selectOption(String(chapter));
    // No line that only documentation tests need.
    assert.doesNotMatch(await tab.locator("#text").textContent(), /^# fn main/m);
    const buttons = tab.locator("#text button[data-try]");
    for (let index = 0; index < await buttons.count(); index++) {
      const command = await buttons.nth(index).evaluate((it) => it.closest("p").previousElementSibling.textContent);
      await tab.evaluate(() => { document.getElementById("status").textContent = "not yet"; });
      await buttons.nth(index).click();
      await tab.waitForFunction(() => !/^(not yet|Working)/.test(document.getElementById("status").textContent), null, { timeout: 60_000 });
      const words = await status(tab).textContent();
      const expected = /--contains/.test(command) && await tab.locator("#options").inputValue() ? /works? in all of the box/ : /Valid|was found|goal was/;
      assert.match(words, expected, `${command}: ${words}`);
      tried += 1;
    }
  }
  assert.ok(tried >= 9, `${tried}`);
  // The last but one chapter ended with a run in a world that the tutorial describes.
  assert.match(await editor(tab, "world").inputValue(), /relative = true/);
  assert.match(await tab.locator("#panel-4 textarea").inputValue(), /elbowroom-likelihoods/);
  await close(tab);
});

test("options are those of the command line", async () => {
  const tab = await open(playground);
  await says(tab, "Valid");
  await tab.locator("#options").fill('--method best --vary "duration drive"');
  await press(tab, "Envelope");
  await says(tab, "The envelope was found");
  const frame = await answer(tab);
  const { parameters } = JSON.parse(run("envelope", ...pddl("delivery"), plan, "--method", "best", "--vary", "duration drive", "--json"));
  const table = frame.locator("section", { has: frame.locator("h2", { hasText: "How far each quantity may deviate" }) });
  const cells = await cellsOf(table.locator("tbody tr"));
  assert.deepEqual(cells.map((row) => row[0]), parameters.map((it) => it.name));
  for (const [index, it] of parameters.entries()) assert.ok(it.upper.decimal - Number(cells[index][4]) < 0.001);
  await tab.locator("#options").fill("--method exact");
  await press(tab, "Envelope");
  await says(tab, "The region was found");
  const region = await answer(tab);
  const { pieces } = JSON.parse(run("envelope", ...pddl("delivery"), plan, "--method", "exact", "--json"));
  const rows = region.locator("section", { has: region.locator("h2", { hasText: "Inequalities" }) }).locator("tbody tr");
  assert.deepEqual((await cellsOf(rows)).map((row) => row[0]), pieces[0].rows.map((row) => row.text));
  await tab.locator("#options").fill("--metod best");
  await press(tab, "Envelope");
  await says(tab, "has no option `--metod`");
  await tab.locator("#options").fill("--vary");
  await press(tab, "Envelope");
  await says(tab, "needs a value");
  await close(tab);
});

test("a run with a seed is the run of the command, and its page goes through time", async () => {
  for (const seed of [1, 4]) {
    // The page of an earlier answer would be ready at once.
    const tab = await open(playground);
    await tab.locator("#seed").fill(String(seed));
    await tab.locator("#executor").selectOption("live");
    await press(tab, "Run");
    const frame = await answer(tab);
    const done = spawnSync(elbowroom, ["run", ...pddl("delivery"), plan, "--world", world, "--seed", String(seed), "--executor", "live", "--json"], { encoding: "utf8" });
    const { executed } = JSON.parse(done.stdout);
    const table = frame.locator("section", { has: frame.locator("h2", { hasText: "Planned and actual times" }) });
    const cells = await cellsOf(table.locator("tbody tr"));
    // The table also has the steps that were never started, without a time.
    const started = cells.filter((row) => /^\d/.test(row[2]));
    assert.deepEqual(started.map((row) => row[0]), executed.map((it) => it.action));
    for (const [index, it] of executed.entries()) assert.ok(Math.abs(Number(started[index][2]) - it.start.decimal) < 0.001);
    const slider = frame.locator("#time");
    await slider.press("Home");
    const before = await slider.inputValue();
    await frame.getByRole("button", { name: "later" }).click();
    assert.ok(Number(await slider.inputValue()) >= Number(before));
    await frame.getByRole("button", { name: "later" }).click();
    assert.ok(Number(await slider.inputValue()) > Number(before));
    await close(tab);
  }
});

test("what is wrong in a text is said where it is wrong, in the words of the command", async () => {
  const tab = await open(playground);
  const text = fs.readFileSync(plan, "utf8").replace("(drive", "(drvie");
  await write(tab, "plan", text);
  await tab.locator("#findings button").first().waitFor();
  fs.writeFileSync(file("wrong.plan"), text);
  const { diagnostics: [own] } = JSON.parse(spawnSync(elbowroom, ["check", ...pddl("delivery"), file("wrong.plan"), "--json"], { encoding: "utf8" }).stdout);
  const said = await tab.locator("#findings button").first().textContent();
  assert.ok(said.includes(own.message) && said.includes(own.advice) && said.includes(`line ${own.line}:`), said);
  assert.equal(await tab.locator(".mark.error").first().textContent(), "drvie");
  await tab.locator("#findings button").first().click();
  const chosen = await editor(tab, "plan").evaluate((it) => it.value.slice(it.selectionStart, it.selectionEnd));
  assert.equal(chosen, "drvie");
  await close(tab);
});

test("an address that was shared shows the same texts and choices", async () => {
  const tab = await open(playground);
  await write(tab, "plan", "; ein Zettel für später ☂\n0: (drive rover depot shelf) [12]\n");
  await tab.locator("#seed").fill("17");
  await tab.locator("#guarantee").selectOption("strong");
  await press(tab, "Share");
  await says(tab, "The address of this page now holds");
  const hash = await tab.evaluate(() => location.hash);
  await close(tab);
  const other = await open(playground, {}, hash);
  assert.ok((await editor(other, "plan").inputValue()).startsWith("; ein Zettel für später ☂"));
  assert.equal(await other.locator("#seed").inputValue(), "17");
  assert.equal(await other.locator("#guarantee").inputValue(), "strong");
  await close(other);
  const damaged = await open(playground, {}, "#nothing-of-that-kind");
  await says(damaged, "The address of this page is damaged");
  await close(damaged);
});

test("hostile texts are texts, in the editors, in the findings and on the pages", async () => {
  const tab = await open(playground);
  const wrong = "</script><img src=x onerror=window.hit=1>";
  await write(tab, "problem", `(define (problem ${wrong}) (:domain x)) ${"x".repeat(10_000)} \u202e(`);
  await tab.locator("#findings button").first().waitFor();
  assert.ok((await tab.locator("#panel-1 pre").textContent()).includes(wrong));
  await choose(tab, "delivery");
  const text = (await editor(tab, "problem").inputValue()).replace(/\(problem [^)]*\)/, "(problem <img/src=x/onerror=parent.hit=1>)");
  await write(tab, "problem", text);
  await press(tab, "Envelope");
  await tab.waitForFunction(() => !/Working|Valid/.test(document.getElementById("status").textContent));
  assert.equal(await tab.evaluate(() => window.hit), undefined);
  for (const frame of tab.frames()) assert.equal(await frame.locator("img").count(), 0);
  await close(tab);
});

test("what takes too long can be stopped, and the next question is answered", async () => {
  const tab = await open(playground);
  await press(tab, "Envelope");
  await tab.locator("#stop").evaluate((it) => it.click());
  await press(tab, "Check");
  await says(tab, "Valid");
  await close(tab);
});

test("it is no wider than a telephone, and axe has no objection, in light and dark", async () => {
  for (const width of [1280, 400]) {
    for (const colorScheme of ["light", "dark"]) {
      const tab = await open(playground, { viewport: { width, height: 900 }, colorScheme, bypassCSP: true });
      await press(tab, "Envelope");
      await answer(tab);
      await write(tab, "domain", `${await editor(tab, "domain").inputValue()}\n(`);
      await tab.locator("#findings button").first().waitFor();
      await accessible(tab, `at ${width}, ${colorScheme}`);
      // What has not been in sight is not drawn.
      await tab.locator("#page").scrollIntoViewIfNeeded();
      if (screenshots) await tab.screenshot({ path: path.join(screenshots, `playground-${width}-${colorScheme}.png`), fullPage: true });
      await close(tab);
    }
  }
});

start();
