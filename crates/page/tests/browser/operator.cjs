// Watches an executive on its page for the operator: words, clock, silence, requests, keyboard, width.

"use strict";
const assert = require("node:assert/strict");
const { spawn, spawnSync } = require("node:child_process");
const fs = require("node:fs");
const path = require("node:path");
const { accessible, cases, close, file, open, pddl, screenshots, start, test } = require("./harness.cjs");

const elbowroom = path.resolve(process.argv[2]);
const root = path.dirname(cases);
// Number of moments at which the words are compared.
const MOMENTS = Number(process.env.MOMENTS ?? 24);
const TOKEN = "a-word-of-sixteen-letters";
fs.writeFileSync(file("token"), `${TOKEN}\n`);
// An earlier run may have left the file, with its mode.
fs.chmodSync(file("token"), 0o600);

const simulation = ["--realtime", "1", "--seed", "3"];
const program = ["--world-process", `python3 ${path.join(root, "clients/python/example_simulation.py")}`];

// Starts an executive at a free port, and waits until it says where.
function served(...more) {
  const child = spawn(elbowroom, ["serve", ...pddl("delivery"), "--http", "0", "--token", file("token"), ...more]);
  // A failed test leaves nothing behind.
  process.on("exit", () => child.kill("SIGKILL"));
  let said = "";
  const over = new Promise((done) => child.on("close", (code) => done({ code, said })));
  const address = new Promise((done, failed) => {
    child.stderr.on("data", (data) => {
      said += data;
      const found = /http:\S+\//.exec(said);
      if (found) done(found[0]);
    });
    over.then((end) => failed(new Error(JSON.stringify(end))));
  });
  return { child, address, over };
}
const end = async ({ child, over }) => {
  child.kill("SIGKILL");
  await over;
};
// The process of its world.
const worldOf = ({ child }) => Number(spawnSync("pgrep", ["-P", String(child.pid)], { encoding: "utf8" }).stdout.trim().split("\n").at(-1));
const watched = async (address, options = {}, hash = "") => {
  const tab = await open(address, { offline: false, bypassCSP: true, ...options }, hash);
  await tab.waitForFunction(() => document.getElementById("connection").textContent === "connected");
  return tab;
};
const control = async (address, ...line) => {
  const done = spawnSync(elbowroom, ["ctl", "--to", new URL(address).host, "--token", file("token"), ...line], { encoding: "utf8" });
  assert.equal(done.status, 0, done.stderr);
  return done.stdout;
};
const state = async (address) => (await fetch(`${address}v1/state`)).json();
const textOf = (tab, id) => tab.locator(`#${id}`).textContent();
const shows = (tab, id, text, timeout) => tab.waitForFunction(([id, text]) => document.getElementById(id).textContent.includes(text), [id, text], { timeout });
// What `ctl state` and the page say, without the time.
const timeless = (words) => words.replace(/ at -?[0-9.]+(?=, plan)/, "").trim();

// Waits until the actions of the plan are on the page.
const planned = (tab) => tab.waitForFunction(() => document.querySelectorAll("#lanes .bar").length > 0, null, { timeout: 30_000 });

test("its words are those of ctl state, ctl goals, ctl guarantee and ctl next", async () => {
  const own = served(...simulation);
  const address = await own.address;
  const tab = await watched(address);
  await tab.evaluate(() => {
    window.seen = {};
    const note = () => {
      for (const id of ["state", "goals-seen", "promise", "decision", "next"]) {
        const node = id === "goals-seen" ? document.getElementById("open-goals") : document.getElementById(id);
        const text = id === "goals-seen" ? [...node.children].map((card) => `${card.querySelector("h3").textContent}: ${card.querySelector(".badge").textContent}`).join("\n") : node.textContent;
        (window.seen[id] ??= new Set()).add(text.replace(/ at -?[0-9.]+(?=, plan)/, "").trim());
      }
    };
    note();
    new MutationObserver(note).observe(document.body, { subtree: true, childList: true, characterData: true });
  });
  const told = async () => {
    const { goals } = JSON.parse(await control(address, "goals", "--json"));
    const open = goals.filter((it) => !["achieved", "cancelled", "failed"].includes(it.state));
    const first = async (what) => (await control(address, what)).split("\n")[0];
    return {
      state: timeless(await first("state")),
      promise: await first("guarantee"),
      decision: await first("next"),
      "goals-seen": open.map((it) => `${it.name}: ${it.state.replaceAll("-", " ")}`).join("\n"),
    };
  };
  const activities = new Set();
  let compared = 0;
  for (let moment = 0; moment < MOMENTS; moment++) {
    const [round, phase] = [Math.floor(moment / 24), moment % 24];
    if (phase === 4) await control(address, "pause");
    if (phase === 8) await control(address, "resume");
    const place = round % 2 === 0 ? "depot" : "shelf";
    if (phase === 12) await control(address, "goal", `(at rover ${place})`, "--name", "home", "--within", "500");
    if (moment === 16) await control(address, "cancel", "problem");
    for (let look = 0; phase === 20 && look < 100 && (await state(address)).activity !== "resting"; look++) await tab.waitForTimeout(300);
    const words = await told();
    await tab.waitForTimeout(600);
    // The page receives at most five messages a second, and need not show what lasts for less.
    const later = await told();
    const seen = await tab.evaluate(() => Object.fromEntries(Object.entries(window.seen).map(([id, texts]) => [id, [...texts]])));
    for (const [id, text] of Object.entries(words)) {
      if (later[id] !== text) continue;
      compared += 1;
      assert.ok(seen[id].includes(text), `${id}: ${text}\nnot in\n${seen[id].join("\n")}`);
    }
    activities.add(words.state.split(",")[0]);
  }
  assert.ok(compared >= 3 * MOMENTS, `${compared} compared`);
  assert.ok(["executing", "paused", "idle"].every((it) => activities.has(it)), [...activities].join());
  await close(tab);
  await end(own);
});

test("its clock is that of the executive, also when nothing happens", async () => {
  const own = served(...simulation);
  const address = await own.address;
  const tab = await watched(address);
  await control(address, "pause");
  await tab.waitForTimeout(2000);
  let worst = 0;
  for (let sample = 0; sample < 40; sample++) {
    const before = Number(await textOf(tab, "clock"));
    const { now } = await state(address);
    const after = Number(await textOf(tab, "clock"));
    worst = Math.max(worst, before - now.decimal, now.decimal - after);
    await tab.waitForTimeout(200);
  }
  assert.ok(worst < 0.5, `the clock is ${worst} s off`);
  await close(tab);
  await end(own);
});

test("an executive or a world that is stopped or killed is shown within three seconds", async () => {
  const own = served(...program);
  const address = await own.address;
  const tab = await watched(address);
  await planned(tab);
  own.child.kill("SIGSTOP");
  await shows(tab, "connection", "no answer for ", 3000);
  assert.match(await textOf(tab, "warning-list"), /^no answer for [0-9]+ s: /);
  const at = Number(await textOf(tab, "clock"));
  await tab.waitForTimeout(1000);
  assert.ok(Number(await textOf(tab, "clock")) > at + 0.5, "the clock runs on");
  own.child.kill("SIGCONT");
  await shows(tab, "connection", "connected", 5000);
  await tab.waitForFunction(() => document.getElementById("warnings").hidden, null, { timeout: 20_000 });
  const world = worldOf(own);
  process.kill(world, "SIGSTOP");
  await shows(tab, "warning-list", "the world has not answered for ", 3000);
  const [, words] = (await control(address, "state")).split("\n");
  assert.match(words, /the world has not answered for [0-9]+ s: until it does, no action is started/);
  process.kill(world, "SIGCONT");
  await tab.waitForFunction(() => document.getElementById("warnings").hidden, null, { timeout: 20_000 });
  own.child.kill("SIGKILL");
  await shows(tab, "connection", "no answer for ", 3000);
  tab.wrong = tab.wrong.filter((it) => !/ERR_CONNECTION_REFUSED|ERR_INCOMPLETE|ERR_CONNECTION_RESET/.test(it));
  await close(tab);
  await own.over;
});

test("a world that is started again is shown as such", async () => {
  const own = served(...program, "--restart-world", "5");
  const address = await own.address;
  const tab = await watched(address);
  await planned(tab);
  await tab.evaluate(() => {
    window.seen = "";
    new MutationObserver(() => { window.seen += document.getElementById("warning-list").textContent; }).observe(document.body, { subtree: true, childList: true, characterData: true });
  });
  // The second restart is a second after its cause.
  for (let restart = 1; restart <= 2; restart++) {
    const before = worldOf(own);
    process.kill(before, "SIGKILL");
    const words = `the world is restarted (restart ${restart} of 5)`;
    await tab.waitForFunction((words) => window.seen.includes("world restarting: ") && window.seen.includes(words), words, { timeout: 3000 });
    for (let look = 0; look < 100 && [before, NaN, 0].includes(worldOf(own)); look++) await tab.waitForTimeout(100);
  }
  await tab.waitForFunction(() => document.getElementById("warnings").hidden, null, { timeout: 20_000 });
  await close(tab);
  await end(own);
});

test("nothing is stopped or cancelled without a confirmation, and all can be done by keyboard", async () => {
  const own = served(...simulation);
  const address = await own.address;
  const reader = await watched(address);
  assert.equal(await reader.getByRole("button", { name: /^(pause|stop|cancel)/ }).count(), 0);
  await close(reader);
  const tab = await watched(address, {}, `#token=${TOKEN}`);
  await planned(tab);
  const focused = () => tab.evaluate(() => document.activeElement.id || document.activeElement.getAttribute("aria-label"));
  const reach = async (id) => {
    for (let step = 0; step < 40 && (await focused()) !== id; step++) await tab.keyboard.press("Tab");
    assert.equal(await focused(), id);
  };
  await reach("pause");
  await tab.keyboard.press("Enter");
  await shows(tab, "activity", "paused");
  await shows(tab, "pause", "resume");
  assert.equal(await focused(), "pause");
  // A paused executive does not reach the goal before it is cancelled.
  await reach("cancel the goal problem");
  await tab.keyboard.press("Enter");
  assert.equal(await focused(), "no");
  await tab.keyboard.press("Escape");
  assert.equal(await focused(), "cancel the goal problem");
  assert.equal((await state(address)).goals.length, 1);
  await tab.keyboard.press("Enter");
  await accessible(tab, "a question");
  await reach("yes");
  await tab.keyboard.press("Enter");
  await shows(tab, "closed-goals", "cancelled");
  assert.equal((await state(address)).goals.length, 0);
  await reach("pause");
  await tab.keyboard.press("Enter");
  await shows(tab, "pause", "pause");
  await tab.locator("#stop").click();
  await tab.locator("#no").click();
  await tab.waitForTimeout(500);
  assert.equal(own.child.exitCode, null);
  await tab.locator("#stop").click();
  await tab.locator("#yes").click();
  await shows(tab, "activity", "over");
  await shows(tab, "connection", "the executive has ended");
  assert.equal((await own.over).code, 0);
  tab.wrong = tab.wrong.filter((it) => !/ERR_CONNECTION_REFUSED/.test(it));
  await close(tab);
});

test("it receives differences, and they add up to the documents", async () => {
  const own = served(...simulation);
  const address = await own.address;
  const read = async (milliseconds) => {
    const abort = new AbortController();
    const timer = setTimeout(() => abort.abort(), milliseconds);
    let text = "";
    try {
      const answer = await fetch(`${address}v1/state/events`, { signal: abort.signal });
      for await (const bytes of answer.body) text += Buffer.from(bytes).toString();
    } catch (error) { if (error.name !== "AbortError") throw error; }
    clearTimeout(timer);
    return text.split("\n\n").slice(0, -1).map((event) => /^event: (.*)\ndata: (.*)$/.exec(event).slice(1));
  };
  const merge = (target, patch) => {
    for (const [name, value] of Object.entries(patch)) {
      if (value === null) delete target[name];
      else if (typeof value === "object") target[name] = merge(typeof target[name] === "object" ? target[name] : {}, value);
      else target[name] = value;
    }
    return target;
  };
  const events = await read(6000);
  assert.deepEqual(events.filter(([name]) => name !== "change").map(([name]) => name), ["document"]);
  assert.ok(events.length >= 10);
  await control(address, "pause");
  await new Promise((done) => setTimeout(done, 1500));
  const stream = read(3000);
  await new Promise((done) => setTimeout(done, 1000));
  await control(address, "goal", "(at rover depot)", "--name", "home");
  const later = await stream;
  const merged = later.map(([, data]) => JSON.parse(data)).reduce((target, patch) => merge(target, patch));
  assert.ok(Object.values(merged.goals).some((it) => it.name === "home"));
  const [[, fresh]] = await read(300);
  const { now, ...known } = merged;
  const { now: since, ...expected } = JSON.parse(fresh);
  assert.deepEqual(known, expected);
  assert.ok(since >= now);
  // Without events, a minute is a few kilobytes.
  const quiet = (await read(3000)).slice(1).map(([, data]) => data.length);
  assert.ok(quiet.length >= 4 && Math.max(...quiet) < 100, quiet.join());
  await end(own);
});

test("it can be read at any width, in light and dark, with lanes, slack and warnings", async () => {
  const own = served(...simulation);
  const address = await own.address;
  await control(address, "goal", "(at rover depot)", "--name", "home", "--within", "55");
  for (const [width, colorScheme] of [[1280, "light"], [1280, "dark"], [400, "light"], [400, "dark"]]) {
    const tab = await watched(address, { viewport: { width, height: 900 }, colorScheme }, `#token=${TOKEN}`);
    await planned(tab);
    for (const details of await tab.locator("details:visible > summary").all()) await details.click();
    if (screenshots) await tab.screenshot({ path: path.join(screenshots, `operator-${width}-${colorScheme}.png`), fullPage: true });
    await accessible(tab, `operator at ${width}, ${colorScheme}`);
    await close(tab);
  }
  await end(own);
});

start();
