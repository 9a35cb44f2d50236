// Mission control of an executive with a long trace: bytes sent to a page, memory, and time to the first view.
//
//   LINES=1000000 SECONDS=60 node long_trace.cjs ELBOWROOM CASES WORK [CHROMIUM]
//
// The world reports numbers until the trace has LINES lines (20,000 by default), then ten a second, while a robot patrols. The
// limits are those of the product: 50 kB a minute, 200 MB, and a first view below a second. The time of the first view is only
// printed unless LIMIT_TIME is set, because it depends on the load of the machine.

"use strict";
const assert = require("node:assert/strict");
const { spawn } = require("node:child_process");
const fs = require("node:fs");
const path = require("node:path");
const { cases, close, file, open, start, test } = require("./harness.cjs");

const elbowroom = path.resolve(process.argv[2]);
const LINES = Number(process.env.LINES ?? 20_000);
const SECONDS = Number(process.env.SECONDS ?? 10);
const ROBOTS = ["r1", "r2", "r3"];

const domain = `(define (domain patrol) (:requirements :typing :durative-actions :numeric-fluents)
  (:types robot place)
  (:predicates (at ?r - robot ?p - place) (seen ?r - robot ?p - place) (next ?p ?q - place))
  (:functions (battery ?r - robot))
  (:durative-action move :parameters (?r - robot ?p ?q - place) :duration (= ?duration 20)
    :condition (and (at start (at ?r ?p)) (at start (next ?p ?q)))
    :effect (and (at start (not (at ?r ?p))) (at end (at ?r ?q)) (at end (seen ?r ?q)))))`;
const places = Array.from({ length: 40 }, (_, i) => `p${i}`);
const problem = `(define (problem day) (:domain patrol) (:objects ${ROBOTS.join(" ")} - robot ${places.join(" ")} - place)
  (:init ${ROBOTS.map((r) => `(at ${r} p0) (= (battery ${r}) 100)`).join(" ")}
    ${places.slice(1).map((place, i) => `(next p${i} ${place})`).join(" ")})
  (:goal (and ${ROBOTS.map((r) => `(seen ${r} p39)`).join(" ")})))`;
// Each report is a line of the trace.
const world = `import sys, threading, time
sys.path.insert(0, ${JSON.stringify(path.join(path.dirname(cases), "clients/python"))})
from elbowroom_world import World
world = World("patrol")

@world.action("move")
def move(action):
    action.sleep(20)

def report():
    sent = 0
    while True:
        burst = 80 if sent < ${LINES} else 1
        for _ in range(burst):
            sent += 1
            world.value("(battery r%d)" % (sent % 3 + 1), 100 - sent % 97)
        time.sleep(0.02 if burst > 1 else 0.1)

threading.Thread(target=report, daemon=True).start()
world.run()
`;
for (const [name, text] of Object.entries({ "patrol.pddl": domain, "patrol-day.pddl": problem, "patrol.py": world })) fs.writeFileSync(file(name), text);

function served() {
  fs.rmSync(file("long.trace"), { force: true });
  const child = spawn(elbowroom, ["serve", file("patrol.pddl"), file("patrol-day.pddl"), "--http", "0", "--trace", file("long.trace"),
    "--world-process", `python3 ${file("patrol.py")}`]);
  process.on("exit", () => child.kill("SIGKILL"));
  return new Promise((done, failed) => {
    let said = "";
    child.stderr.on("data", (data) => {
      said += data;
      const found = /http:\S+\//.exec(said);
      if (found) done({ child, address: found[0] });
    });
    child.on("close", () => failed(new Error(said)));
  });
}

// Number of lines of the trace, read as it grows.
function lineCounter() {
  const chunk = Buffer.alloc(1 << 20);
  let [position, lines] = [0, 0];
  return () => {
    // The address is known before the trace is created.
    if (!fs.existsSync(file("long.trace"))) return 0;
    const source = fs.openSync(file("long.trace"), "r");
    for (let read; (read = fs.readSync(source, chunk, 0, chunk.length, position)) > 0; position += read) {
      for (let at = chunk.indexOf(10); at >= 0 && at < read; at = chunk.indexOf(10, at + 1)) lines += 1;
    }
    fs.closeSync(source);
    return lines;
  };
}
const memory = (pid) => Number(/VmRSS:\s+(\d+)/.exec(fs.readFileSync(`/proc/${pid}/status`, "utf8"))[1]) / 1000;
const pause = (seconds) => new Promise((done) => setTimeout(done, 1000 * seconds));

// Bytes that the stream of the page sends in some seconds, after the first document.
async function bytesIn(address, seconds) {
  const abort = new AbortController();
  const answer = await fetch(`${address}v1/state/events`, { signal: abort.signal });
  const [first, later] = [{ bytes: 0 }, { bytes: 0 }];
  let part = first;
  setTimeout(() => { part = later; }, 1000);
  setTimeout(() => abort.abort(), 1000 * (seconds + 1));
  try {
    for await (const data of answer.body) part.bytes += data.length;
  } catch (error) {
    assert.equal(error.name, "AbortError");
  }
  return { document: first.bytes, changes: later.bytes };
}

test("a long trace leaves the page small and quick", async () => {
  const { child, address } = await served();
  const lines = lineCounter();
  let largest = 0;
  while (lines() < LINES) {
    assert.equal(child.exitCode, null, `the executive has ended after ${lines()} lines`);
    largest = Math.max(largest, memory(child.pid));
    await pause(0.5);
  }
  await pause(2);
  const begin = performance.now();
  const tab = await open(address, { offline: false, bypassCSP: true });
  await tab.waitForFunction(() => document.getElementById("connection").textContent === "connected" && document.querySelectorAll("#open-goals > *").length > 0);
  const view = (performance.now() - begin) / 1000;
  const { document: whole, changes } = await bytesIn(address, SECONDS);
  const aMinute = (changes * 60) / SECONDS;
  largest = Math.max(largest, memory(child.pid));
  console.log(`${lines()} lines: ${(whole / 1000).toFixed(1)} kB for the document, ${(aMinute / 1000).toFixed(1)} kB a minute, ${largest.toFixed(1)} MB, first view after ${view.toFixed(2)} s`);
  await close(tab);
  child.kill("SIGKILL");
  assert.ok(aMinute < 50_000, `${aMinute} bytes a minute`);
  assert.ok(largest < 200, `${largest} MB`);
  assert.ok(!process.env.LIMIT_TIME || view < 1, `${view} s`);
});

start();
