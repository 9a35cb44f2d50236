// Makes the pictures of README and docs/reference/pages.md again, from pages that are made again:
//
//   node pictures.cjs ELBOWROOM CASES WORK [CHROMIUM]
//
// writes them to docs/pictures. See harness.cjs for what it wants.

"use strict";
const fs = require("node:fs");
const path = require("node:path");
const { cases, close, file, open, page, pddl, run, start, test } = require("./harness.cjs");

// Pages name files as they were given.
const root = path.dirname(cases);
const pictures = path.join(root, "docs/pictures");
const plan = ["domain.pddl", "problem.pddl", "plan.plan"].map((it) => path.join("cases/delivery", it));
fs.mkdirSync(pictures, { recursive: true });

// The page from its title to the end of what comes before a heading.
async function picture(tab, name, before) {
  const top = await tab.locator("section", { has: tab.locator("h2", { hasText: before }) }).boundingBox();
  const { width } = tab.viewportSize();
  await tab.screenshot({ path: path.join(pictures, name), fullPage: true, clip: { x: 0, y: 0, width, height: top.y - 8 } });
}

test("an envelope", async () => {
  process.chdir(root);
  fs.writeFileSync(file("envelope.json"), run("envelope", ...plan, "--json"));
  const tab = await open(page("envelope.html", file("envelope.json")), { viewport: { width: 900, height: 700 }, deviceScaleFactor: 1.5 });
  await tab.locator(".scroll").first().focus();
  for (let step = 0; step < 4; step += 1) await tab.keyboard.press("ArrowRight");
  await tab.locator("h1").click();
  await picture(tab, "envelope.png", "What if?");
  await close(tab);
});

test("a slice of a region", async () => {
  process.chdir(root);
  run("envelope", ...plan, "--method", "exact", "--slice", "dur_0", "dur_3", "--picture", path.join(pictures, "region.svg"));
});

test("a run", async () => {
  process.chdir(path.dirname(file("run.jsonl")));
  run("run", ...pddl("delivery"), "--world", path.join(cases, "delivery", "world.toml"), "--seed", "10", "--trace", "run.jsonl");
  const tab = await open(page("run.html", "run.jsonl"), { viewport: { width: 900, height: 700 }, deviceScaleFactor: 1.5 });
  await picture(tab, "run.png", "State at one time");
  await close(tab);
});

start();
