// Drags the sliders of an envelope's page, and compares what the page says with the command.

"use strict";
const assert = require("node:assert/strict");
const { spawnSync } = require("node:child_process");
const fs = require("node:fs");
const path = require("node:path");
const { accessible, cases, cellsOf, close, file, open, page, pddl, run, screenshots, start, test } = require("./harness.cjs");

const elbowroom = path.resolve(process.argv[2]);
const plans = ["delivery", "battery", "match", "paintshop", "tank"];
const answers = {};
for (const name of plans) {
  // Durations that the executor chooses have sliders where they are asked for.
  const own = [...pddl(name), path.join(cases, name, "plan.plan"), "--vary", "durations"];
  const text = run("envelope", ...own, "--json");
  fs.writeFileSync(file(`${name}.json`), text);
  answers[name] = { own, page: page(`${name}.html`, file(`${name}.json`)), ...JSON.parse(text) };
}
const verdict = (tab) => tab.locator("#point");
// What the command says of the values of all sliders.
async function command(tab, name) {
  const outputs = await tab.locator(".slider output").allTextContents();
  const box = answers[name].parameters.map((it, index) => `${it.name}=[${outputs[index]},${outputs[index]}]`).join(" ");
  const { status, stdout } = spawnSync(elbowroom, ["envelope", ...answers[name].own, "--contains", box, "--json"], { encoding: "utf8" });
  return { works: status === 0, answer: JSON.parse(stdout) };
}

test("as planned, each plan works, and its sliders stand at the nominal values", async () => {
  for (const name of plans) {
    const tab = await open(answers[name].page);
    assert.equal(await verdict(tab).getAttribute("data-works"), "true", name);
    const outputs = await tab.locator(".slider output").allTextContents();
    assert.deepEqual(outputs.map(Number), answers[name].parameters.map((it) => it.nominal.decimal), name);
    await close(tab);
  }
});

test("dragged with the mouse from end to end, each slider says what the command says", async () => {
  const seen = new Set();
  for (const name of plans) {
    const tab = await open(answers[name].page);
    for (const slider of await tab.locator(".slider input").all()) {
      await slider.scrollIntoViewIfNeeded();
      for (const share of [0, 0.3, 0.7, 1]) {
        const box = await slider.boundingBox();
        const y = box.y + box.height / 2;
        const at = await slider.evaluate((it) => (it.value - it.min) / (it.max - it.min));
        await tab.mouse.move(box.x + 8 + at * (box.width - 16), y);
        await tab.mouse.down();
        await tab.mouse.move(box.x + 2 + share * (box.width - 4), y, { steps: 4 });
        await tab.mouse.up();
        const said = await verdict(tab).getAttribute("data-works");
        if (said !== "null") assert.equal(said === "true", (await command(tab, name)).works, `${name}: ${await verdict(tab).textContent()}`);
        seen.add(said);
      }
      await tab.getByRole("button", { name: "as planned" }).click();
    }
    await close(tab);
  }
  assert.ok(seen.has("true") && seen.has("false"), [...seen].join());
});

test("a longer action moves what comes after it, on the chart and in the list", async () => {
  const tab = await open(answers.delivery.page);
  const left = () => tab.locator("svg rect[data-bar]").evaluateAll((all) => Object.fromEntries(all.map((it) => [it.dataset.bar, Number(it.getAttribute("x"))])));
  const before = await left();
  const slider = tab.locator(".slider input").first();
  await slider.focus();
  for (let step = 0; step < 20; step++) await slider.press("ArrowRight");
  await tab.waitForTimeout(300);
  assert.equal(await verdict(tab).getAttribute("data-works"), "true");
  const moves = await cellsOf(tab.locator("#moves tbody tr"));
  assert.ok(moves.length > 0);
  const after = await left();
  const later = Object.keys(before).filter((bar) => after[bar] > before[bar] + 0.2);
  const { actions } = answers.delivery.timeline;
  assert.deepEqual(new Set(later.map((bar) => actions[bar].action)), new Set(moves.filter((row) => row[1] !== "0").map((row) => row[0])));
  await tab.getByRole("button", { name: "as planned" }).click();
  await tab.waitForTimeout(200);
  assert.deepEqual(await left(), before);
  await close(tab);
});

test("it says how far a slider can go, and beyond that the command says that the plan fails", async () => {
  const tab = await open(answers.delivery.page);
  const slider = tab.locator(".slider input").first();
  await slider.focus();
  await slider.press("ArrowRight");
  await tab.waitForFunction(() => document.getElementById("limits").textContent.includes("first violation beyond"));
  const limit = Number(/Up to ([\d.]+): works; the first violation beyond/.exec(await tab.locator("#limits").textContent())[1]);
  const step = Number(await slider.getAttribute("step"));
  for (const [value, works] of [[limit, true], [limit + step, false]]) {
    await slider.evaluate((it, to) => { it.value = to; it.dispatchEvent(new Event("input")); }, value);
    assert.equal(await verdict(tab).getAttribute("data-works"), String(works));
    assert.equal((await command(tab, "delivery")).works, works);
  }
  if (screenshots) {
    await tab.screenshot({ path: path.join(screenshots, "sliders.png"), fullPage: true });
  }
  await close(tab);
});

test("a page with sliders at other values is no wider than a telephone, and axe has no objection", async () => {
  for (const width of [1280, 400]) {
    for (const colorScheme of ["light", "dark"]) {
      const tab = await open(answers.battery.page, { viewport: { width, height: 900 }, colorScheme, bypassCSP: true });
      const slider = tab.locator(".slider input").first();
      await slider.focus();
      for (let step = 0; step < 60; step++) await slider.press("ArrowRight");
      await tab.waitForTimeout(400);
      await accessible(tab, `sliders at ${width}, ${colorScheme}`);
      if (screenshots) await tab.screenshot({ path: path.join(screenshots, `sliders-${width}-${colorScheme}.png`), fullPage: true });
      await close(tab);
    }
  }
});

start();
