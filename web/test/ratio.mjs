// How much longer envelopes take in WebAssembly than in the program, by the seconds that both report.
//
//   node ratio.mjs ELBOWROOM CASES MODULE.wasm
//
// The program should be a release build.

import { spawnSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";

const [, , elbowroom, cases, file] = process.argv;
const module = await WebAssembly.compile(readFileSync(file));
const { exports } = await WebAssembly.instantiate(module, { elbowroom: { now: () => performance.now() } });

function ask(question) {
  const bytes = new TextEncoder().encode(JSON.stringify(question));
  const room = exports.elbowroom_reserve(bytes.length);
  new Uint8Array(exports.memory.buffer, room, bytes.length).set(bytes);
  const reply = exports.elbowroom_ask(room, bytes.length);
  exports.elbowroom_release(room, bytes.length);
  const length = new DataView(exports.memory.buffer).getUint32(reply, true);
  const text = new TextDecoder().decode(new Uint8Array(exports.memory.buffer, reply + 4, length));
  exports.elbowroom_release(reply, length + 4);
  return JSON.parse(JSON.parse(text).document);
}

const median = (numbers) => numbers.sort((a, b) => a - b)[numbers.length >> 1];
console.log("| case | boxes checked | WebAssembly | native | ratio |\n|---|--:|--:|--:|--:|");
for (const name of ["delivery", "battery", "paintshop"]) {
  const paths = ["domain.pddl", "problem.pddl", "plan.plan"].map((part) => join(cases, name, part));
  const [domain, problem, plan] = paths.map((path) => ({ name: path, text: readFileSync(path, "utf8") }));
  const both = { module: [], native: [] };
  let checks = 0;
  // In turn, so that both meet the same machine.
  for (let turn = 0; turn < 60; turn++) {
    const own = ask({ ask: "envelope", domain, problem, plan });
    checks = own.checks;
    both.module.push(own.seconds);
    const run = spawnSync(elbowroom, ["envelope", ...paths, "--json"], { encoding: "utf8" });
    both.native.push(JSON.parse(run.stdout).seconds);
  }
  const [module, native] = [median(both.module), median(both.native)];
  const milliseconds = (seconds) => `${(seconds * 1e3).toFixed(2)} ms`;
  console.log(`| ${name} | ${checks} | ${milliseconds(module)} | ${milliseconds(native)} | ${(module / native).toFixed(2)} |`);
}
