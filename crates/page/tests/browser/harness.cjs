// What the tests in a browser have in common. Wants `playwright-core` and `axe-core` from npm on NODE_PATH.
//
//   node TEST.cjs ELBOWROOM CASES WORK [CHROMIUM]
//
// ELBOWROOM is the command, CASES the folder of that name, WORK a folder for what is made. With SCREENSHOTS=DIR, tests also
// write pictures.

"use strict";
const assert = require("node:assert/strict");
const { spawnSync } = require("node:child_process");
const fs = require("node:fs");
const path = require("node:path");
const { pathToFileURL } = require("node:url");
const { chromium } = require("playwright-core");

const paths = process.argv.map((it, index) => (index > 1 ? path.resolve(it) : it));
const [, , elbowroom, cases, work, executablePath = "/usr/bin/chromium"] = paths;
const screenshots = process.env.SCREENSHOTS;
fs.mkdirSync(work, { recursive: true });

const file = (name) => path.join(work, name);
const pddl = (name) => ["domain.pddl", "problem.pddl"].map((it) => path.join(cases, name, it));
// Exit code 1 says that the answer is no, which is an answer.
const run = (...args) => {
  const done = spawnSync(elbowroom, args, { encoding: "utf8", maxBuffer: 1 << 28 });
  assert.ok(done.status === 0 || done.status === 1, `${args.join(" ")}: ${done.stderr}`);
  return done.stdout;
};
const page = (name, input) => { run("report", input, "-o", file(name)); return file(name); };

let browser;
const tests = [];
const test = (name, body) => tests.push([name, body]);

// A tab in which nothing goes wrong unseen, and which reaches nothing but the server that its page is from, if it is from one.
async function open(name, options = {}, hash = "") {
  const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, offline: true, ...options });
  const tab = await context.newPage();
  tab.wrong = [];
  tab.on("pageerror", (error) => tab.wrong.push(String(error)));
  tab.on("console", (message) => { if (message.type() === "error") tab.wrong.push(message.text()); });
  const address = /^http:/.test(name) ? name : pathToFileURL(name).href;
  const isOwn = (url) => /^(file|blob|about):/.test(url) || (address === name && url.startsWith(name));
  tab.on("request", (request) => { if (!isOwn(request.url())) tab.wrong.push(`asks for ${request.url()}`); });
  await tab.goto(address + hash);
  await tab.waitForFunction(() => document.documentElement.dataset.ready === "true", null, { timeout: 120_000 });
  return tab;
}
async function close(tab) {
  assert.deepEqual(tab.wrong, []);
  await tab.context().close();
}
const rowsOf = (tab, heading) => tab.locator("section", { has: tab.locator("h2", { hasText: heading }) }).locator("tbody tr");
const cellsOf = (rows) => rows.evaluateAll((all) => all.map((row) => [...row.cells].map((cell) => cell.textContent)));

// What axe objects to, and whether the page is wider than its window.
async function accessible(tab, name) {
  const over = await tab.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(over <= 0, `${name}: ${over} px too wide`);
  await tab.evaluate(fs.readFileSync(require.resolve("axe-core/axe.min.js"), "utf8"));
  // What is in a frame is tested as a page of its own.
  const { violations } = await tab.evaluate(() => axe.run(document, { iframes: false }));
  assert.deepEqual(violations.map((it) => `${it.id}: ${it.nodes.map((node) => node.html.slice(0, 200)).join(" | ")}`), [], name);
}

// Runs the tests that have been named, one after the other.
async function start() {
  browser = await chromium.launch({ executablePath, args: ["--no-sandbox"] });
  let failed = 0;
  for (const [name, body] of tests) {
    try {
      await body();
      console.log(`ok  ${name}`);
    } catch (error) {
      failed += 1;
      console.log(`NOT ${name}\n${error.stack}`);
    }
  }
  await browser.close();
  console.log(failed ? `${failed} of ${tests.length} failed` : `all ${tests.length} hold`);
  process.exit(failed ? 1 : 0);
}

module.exports = { cases, screenshots, file, pddl, run, page, test, open, close, rowsOf, cellsOf, accessible, start };
