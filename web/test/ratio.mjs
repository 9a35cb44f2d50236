// How much longer envelopes take in WebAssembly than in the program, by the seconds that both report.
//
//   node ratio.mjs ELBOWROOM CASES MODULE.wasm
//
// The program should be a release build.

import { spawnSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { asker } from "./ask.mjs";

const [, , elbowroom, cases, file] = process.argv;
const module = await WebAssembly.compile(readFileSync(file));
const { exports } = await WebAssembly.instantiate(module, { elbowroom: { now: () => performance.now() } });

const ask = asker(exports);

const median = (numbers) => numbers.sort((a, b) => a - b)[numbers.length >> 1];
console.log("| case | boxes checked | WebAssembly | native | ratio |\n|---|--:|--:|--:|--:|");
for (const name of ["delivery", "battery", "paintshop"]) {
  const paths = ["domain.pddl", "problem.pddl", "plan.plan"].map((part) => join(cases, name, part));
  const [domain, problem, plan] = paths.map((path) => ({ name: path, text: readFileSync(path, "utf8") }));
  const both = { module: [], native: [] };
  let checks = 0;
  // In turn, so that both meet the same machine.
  for (let turn = 0; turn < 60; turn++) {
    const own = JSON.parse(ask({ ask: "envelope", domain, problem, plan }).document);
    checks = own.checks;
    both.module.push(own.seconds);
    const run = spawnSync(elbowroom, ["envelope", ...paths, "--json"], { encoding: "utf8" });
    both.native.push(JSON.parse(run.stdout).seconds);
  }
  const [module, native] = [median(both.module), median(both.native)];
  const milliseconds = (seconds) => `${(seconds * 1e3).toFixed(2)} ms`;
  console.log(`| ${name} | ${checks} | ${milliseconds(module)} | ${milliseconds(native)} | ${(module / native).toFixed(2)} |`);
}
