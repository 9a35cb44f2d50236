// The module's answers are those of the command, byte for byte; and how large and how fast it is.
//
//   node module.mjs ELBOWROOM CASES MODULE.wasm MODULE.wasm.gz
//
// The last is the module as the page holds it.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { existsSync, readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import { gunzipSync } from "node:zlib";
import { asker } from "./ask.mjs";

const [, , elbowroom, cases, file, packed] = process.argv;
const bytes = readFileSync(file);
assert.deepEqual(gunzipSync(readFileSync(packed)), bytes, "the page holds this module");
const compressed = readFileSync(packed).length;
console.log(`the module: ${bytes.length} bytes, ${compressed} compressed`);
if (compressed > 3e6) console.warn("warning: the module has more than 3 MB compressed, which takes long to load");

const module = await WebAssembly.compile(bytes);
// It wants a clock, and nothing else.
assert.deepEqual(WebAssembly.Module.imports(module), [{ module: "elbowroom", name: "now", kind: "function" }]);
const { exports: library } = await WebAssembly.instantiate(module, { elbowroom: { now: () => performance.now() } });

const ask = asker(library);
const text = (path) => ({ name: path, text: readFileSync(path, "utf8") });
// Without what depends on the machine: how long something took, and how much memory; addresses are half as long here.
// Nor what the command advises, which is about its own options.
const timeless = (document) => document.replace(/^(\s*"(?:(?:first_plan_)?seconds|memory_bytes|advice)":).*$/gm, "$1 0");

function compare(question, ...args) {
  const done = spawnSync(elbowroom, [...args, "--json"], { encoding: "utf8", maxBuffer: 1 << 28 });
  const reply = ask(question);
  assert.equal(timeless(reply.document), timeless(done.stdout), args.join(" "));
  assert.equal(reply.exit, done.status, args.join(" "));
}

let count = 0;
for (const name of readdirSync(cases).sort()) {
  const [domain, problem, plan, stn, world] = ["domain.pddl", "problem.pddl", "plan.plan", "plan.stn", "world.toml"].map((it) => join(cases, name, it));
  const texts = { domain: text(domain), problem: text(problem) };
  compare({ ask: "check", ...texts }, "check", domain, problem);
  compare({ ask: "plan", ...texts }, "plan", domain, problem);
  count += 2;
  for (const given of [plan, stn].filter((it) => existsSync(it))) {
    const own = { ...texts, plan: text(given) };
    const asks = given === stn ? ["stn", "envelope"] : ["check", "stn", "envelope", "run"];
    for (const which of asks) compare({ ask: which, ...own }, which, domain, problem, given);
    compare({ ask: "envelope", ...own, contains: "all=±30%" }, "envelope", domain, problem, given, "--contains", "all=±30%");
    count += asks.length + 1;
  }
  if (existsSync(world)) {
    for (const seed of [0, 1, 2, 3]) {
      compare({ ask: "run", ...texts, plan: text(plan), world: text(world), seed }, "run", domain, problem, plan, "--world", world, "--seed", String(seed));
      count += 1;
    }
  }
}
const domain = join(cases, "delivery/domain.pddl");
compare({ ask: "check", domain: text(domain), problem: text(domain) }, "check", domain, domain);
console.log(`${count + 1} answers are the same, byte for byte but for seconds and memory`);

// A question that makes no sense does no harm, and the module still answers afterwards.
for (const question of [null, 1, {}, { ask: "check" }, { ask: "\u0000" }, { ask: "page", of: { name: "x", text: "x".repeat(1e6) } }]) {
  assert.equal(ask(question).exit, 2);
}
assert.equal(ask({ ask: "about" }).exit, 0);
