// Watches a run while it goes on, and is a bad client of its server.

"use strict";
const assert = require("node:assert/strict");
const { spawn } = require("node:child_process");
const fs = require("node:fs");
const net = require("node:net");
const path = require("node:path");
const { accessible, cellsOf, close, file, open, pddl, rowsOf, run, screenshots, start, test } = require("./harness.cjs");

const elbowroom = path.resolve(process.argv[2]);
const TOKEN = "a-word-of-sixteen-letters";
fs.writeFileSync(file("token"), `${TOKEN}\n`);
// An earlier run may have left the file, with its mode.
fs.chmodSync(file("token"), 0o600);

// Starts a run whose page is served, and waits until it says where.
function served(pace, ...more) {
  const child = spawn(elbowroom, ["run", ...pddl("delivery"), "--realtime", String(pace), "--seed", "3", "--serve", ...more]);
  const said = { out: "", err: "" };
  child.stdout.on("data", (data) => { said.out += data; });
  child.stderr.on("data", (data) => { said.err += data; });
  const over = new Promise((done) => child.on("close", (code) => done({ code, ...said })));
  const address = new Promise((done, failed) => {
    child.stderr.on("data", () => {
      const found = /http:\S+\//.exec(said.err);
      if (found) done(found[0]);
    });
    over.then((end) => failed(new Error(JSON.stringify(end))));
  });
  return { child, address, over };
}
const watched = (address, hash = "", options = {}) => open(address, { offline: false, ...options }, hash);
const verdict = (tab) => tab.locator("#verdict").textContent();

test("the page follows the run to its end, and then says what the report of its trace says", async () => {
  const { address, over } = served(8, "--trace", file("live.jsonl"));
  const tab = await watched(await address);
  await tab.waitForFunction(() => document.querySelector("#live [role=status]").textContent === "The run continues.");
  assert.match(await verdict(tab), /^The run continues; its time is /);
  const rows = rowsOf(tab, "Every decision");
  const early = await rows.count();
  await tab.waitForFunction((early) => document.querySelectorAll("section tbody tr").length > early + 4, early);
  await tab.waitForFunction(() => document.getElementById("verdict").classList.contains("good"), null, { timeout: 30_000 });
  const { code } = await over;
  assert.equal(code, 0);
  assert.equal(await tab.locator("#live [role=status]").textContent(), "The run is over.");
  run("report", file("live.jsonl"), "-o", file("live.html"));
  const stored = await open(file("live.html"));
  assert.equal(await verdict(tab), await verdict(stored));
  assert.deepEqual(await cellsOf(rows), await cellsOf(rowsOf(stored, "Every decision")));
  await close(stored);
  await close(tab);
});

test("a reader who looks back in time, filters or stops following is left alone", async () => {
  const { child, address, over } = served(2);
  const tab = await watched(await address);
  await tab.waitForFunction(() => Number(document.getElementById("time")?.max) > 5, null, { timeout: 30_000 });
  await tab.getByRole("button", { name: "earlier" }).click();
  await tab.getByRole("button", { name: "earlier" }).click();
  const [at, most] = await tab.locator("#time").evaluate((it) => [it.value, it.max]);
  await tab.waitForFunction((most) => Number(document.getElementById("time").max) > Number(most), most, { timeout: 30_000 });
  assert.equal(await tab.locator("#time").inputValue(), at);
  const filter = tab.getByRole("searchbox").last();
  await filter.pressSequentially("decision", { delay: 200 });
  assert.equal(await filter.inputValue(), "decision");
  assert.equal(await filter.evaluate((it) => it === document.activeElement), true, "one can go on typing");
  await tab.getByLabel("follow").uncheck();
  const still = await tab.locator("#time").getAttribute("max");
  await tab.waitForTimeout(1500);
  assert.equal(await tab.locator("#time").getAttribute("max"), still);
  await tab.getByLabel("follow").check();
  await tab.waitForFunction((still) => Number(document.getElementById("time").max) > Number(still), still);
  child.kill("SIGINT");
  await over;
  await close(tab);
});

test("only who knows the token may stop the run", async () => {
  const { address, over } = served(1, "--token", file("token"));
  const base = await address;
  for (const headers of [{}, { authorization: `Bearer ${TOKEN}x` }, { authorization: "Bearer" }]) {
    assert.equal((await fetch(`${base}stop`, { method: "POST", headers })).status, 401);
  }
  assert.equal((await fetch(`${base}stop`)).status, 405);
  const looking = await watched(base);
  assert.equal(await looking.getByRole("button", { name: "stop the run" }).count(), 0);
  await close(looking);
  const tab = await watched(base, `#token=${TOKEN}`);
  await tab.waitForFunction(() => document.querySelector("#live [role=status]").textContent === "The run continues.");
  await tab.getByRole("button", { name: "stop the run" }).click();
  await tab.waitForFunction(() => document.querySelector("#live [role=status]").textContent === "The run is over.");
  assert.equal((await over).code, 130);
  await close(tab);
});

test("a paused run starts nothing, and goes on when it is told to; its trace replays", async () => {
  const { address, over } = served(4, "--token", file("token"), "--trace", file("paused.jsonl"));
  const tab = await watched(await address, `#token=${TOKEN}`);
  const time = () => tab.evaluate(() => Number(document.getElementById("time").max));
  await tab.getByRole("button", { name: "pause" }).click();
  await tab.waitForFunction(() => document.getElementById("verdict").textContent.startsWith("The run is paused"), null, { timeout: 20_000 });
  await tab.getByRole("button", { name: "continue" }).waitFor();
  // What is under way ends; then nothing is, however long one waits.
  const starts = () => fs.readFileSync(file("paused.jsonl"), "utf8").split("\n").filter((line) => line.includes('"event":"command"')).length;
  await tab.waitForTimeout(4500);
  const [before, then] = [starts(), await time()];
  await tab.waitForTimeout(1500);
  assert.equal(starts(), before);
  assert.ok(before < 5, `${before} commands`);
  // Somebody who comes now sees that it is paused.
  const late = await watched(await address, `#token=${TOKEN}`);
  await late.getByRole("button", { name: "continue" }).waitFor();
  await late.getByRole("button", { name: "continue" }).click();
  await close(late);
  await tab.waitForFunction(() => document.getElementById("verdict").textContent.startsWith("The goal was reached"), null, { timeout: 40_000 });
  assert.equal((await over).code, 0);
  assert.ok(await time() > then);
  assert.equal(await tab.getByRole("button", { name: /pause|continue|cancel/ }).count(), 0);
  const replay = JSON.parse(run("run", "--json", "--replay", file("paused.jsonl")));
  assert.deepEqual([replay.agrees, replay.complete], [true, true]);
  await close(tab);
});

test("a run whose goal is given up starts nothing more, and is over when the running actions have ended", async () => {
  const { address, over } = served(4, "--token", file("token"), "--trace", file("cancelled.jsonl"));
  const tab = await watched(await address, `#token=${TOKEN}`);
  await tab.waitForFunction(() => document.querySelectorAll("section tbody tr").length > 2);
  await tab.getByRole("button", { name: "cancel" }).click();
  const { code } = await over;
  assert.equal(code, 130);
  const lines = fs.readFileSync(file("cancelled.jsonl"), "utf8").trim().split("\n").map((line) => JSON.parse(line));
  const asked = lines.findIndex((line) => line.observation?.type === "abandon");
  assert.ok(asked > 0);
  assert.ok(lines.slice(asked).every((line) => line.event !== "command"));
  const end = lines.at(-1);
  assert.equal(end.verdict, "interrupted");
  // What had begun has ended by itself.
  assert.ok(end.executed.length > 0 && end.executed.every((it) => it.outcome === "succeeded"), JSON.stringify(end.executed));
  await close(tab);
});

test("without a token nobody may, and a page of another host may not read it", async () => {
  const { child, address, over } = served(1);
  const base = await address;
  assert.equal((await fetch(`${base}stop`, { method: "POST" })).status, 403);
  assert.equal((await fetch(`${base}nothing`)).status, 404);
  const { port } = new URL(base);
  const answer = await new Promise((done) => {
    const socket = net.connect(port, "127.0.0.1", () => socket.write("GET /document HTTP/1.1\r\nHost: elsewhere.example\r\n\r\n"));
    socket.on("data", (data) => { done(String(data)); socket.destroy(); });
  });
  assert.match(answer, /^HTTP\/1.1 403 /);
  child.kill("SIGINT");
  await over;
});

test("clients that say nothing, say nonsense or do not listen do not delay the run", async () => {
  const { address, over } = served(10);
  const { port } = new URL(await address);
  const sockets = [];
  for (let index = 0; index < 200; index += 1) {
    const socket = net.connect(port, "127.0.0.1");
    socket.on("error", () => {});
    socket.pause();
    if (index % 4 === 1) socket.write("\u0000\u0001 nonsense\r\n\r\n");
    if (index % 4 === 2) socket.write("GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n");
    if (index % 4 === 3) socket.write("GET /document HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999999999999\r\n");
    sockets.push(socket);
  }
  const { code, out } = await over;
  for (const socket of sockets) socket.destroy();
  assert.equal(code, 0, out);
});

test("it can be read at any width, in light and dark, while the run goes on", async () => {
  const { child, address, over } = served(2, "--token", file("token"));
  const base = await address;
  for (const [width, colorScheme] of [[1280, "light"], [400, "dark"]]) {
    const tab = await watched(base, `#token=${TOKEN}`, { viewport: { width, height: 900 }, colorScheme });
    await tab.waitForFunction(() => document.getElementById("time"));
    if (screenshots) await tab.screenshot({ path: path.join(screenshots, `live-${width}-${colorScheme}.png`), fullPage: true });
    await accessible(tab, `live ${width}`);
    await close(tab);
  }
  child.kill("SIGINT");
  await over;
});

start();
