// Compares what the page says of values with what the command says of them: same verdicts, exactly.
//
//   node points.cjs ELBOWROOM CASES [POINTS]
//
// Values are at random around the planned ones, and on the limits of the envelope and just beyond them. The page
// knows the inequalities of the document only; the command knows the plan.

"use strict";
const assert = require("node:assert/strict");
const { spawnSync } = require("node:child_process");
const fs = require("node:fs");
const path = require("node:path");
const vm = require("node:vm");

const [, , elbowroom, cases, count = "12"] = process.argv;
const scripts = path.join(__dirname, "../../src/script");
const source = fs.readFileSync(path.join(scripts, "points.js"), "utf8");
const page = vm.runInThisContext(`(() => { ${source}; return { readSystem, checkPoint, parsed, plus, times, fraction, hasSolution }; })()`);

// The same numbers every time.
let state = 42;
const random = (below) => { state = (state * 1103515245 + 12345) % 2147483648; return Math.floor((state / 2147483648) * below); };
const text = ([a, b]) => `${a}/${b}`;

// The slow and plainly right twin: whether inequalities (coefficients and a constant, `<= 0` or `< 0`) have a solution, by
// putting each with a variable at most something together with each with it at least something (Fourier and Motzkin).
function eliminated(rows, count) {
  for (let variable = 0; variable < count; variable++) {
    const sign = (row) => (row.by[variable][0] > 0n ? 1 : row.by[variable][0] < 0n ? -1 : 0);
    const kept = rows.filter((row) => sign(row) === 0);
    for (const up of rows.filter((row) => sign(row) > 0)) {
      for (const down of rows.filter((row) => sign(row) < 0)) {
        const [a, b] = [up.by[variable], [-down.by[variable][0], down.by[variable][1]]];
        const sum = (x, y) => page.plus(page.times(x, b), page.times(y, a));
        kept.push({ by: up.by.map((it, index) => sum(it, down.by[index])), constant: sum(up.constant, down.constant), isStrict: up.isStrict || down.isStrict });
      }
    }
    rows = kept;
  }
  return rows.every(({ constant: [value], isStrict }) => value < 0n || value === 0n && !isStrict);
}

function compareWithTwin(tries) {
  const counts = { true: 0, false: 0 };
  for (let attempt = 0; attempt < tries; attempt++) {
    const count = 1 + random(3);
    // Rows as the page has them: a network with time zero, two sums to be at most something, all times from 0 on.
    const network = [], bad = [];
    const difference = () => {
      const [to, from] = [random(count + 1), random(count + 1)];
      const by = new Map([[to, 1], [from, -1]].filter(([time]) => time !== 0 && to !== from));
      return { by, constant: random(9) - 4 - (to === from ? 9 : 0), isStrict: false };
    };
    for (let time = 1; time <= count; time++) network.push({ by: new Map([[time, -1]]), constant: 0, isStrict: false });
    for (let extra = 0; extra < count * 2; extra++) network.push(difference());
    for (let extra = 1 + random(2); extra > 0; extra--) {
      const by = new Map(Array.from({ length: count }, (_, index) => [index + 1, random(7) - 3]).filter(([, it]) => it !== 0));
      bad.push({ by, constant: random(15) - 7, isStrict: random(2) === 0 });
    }
    if (random(2)) bad.push({ ...difference(), isStrict: random(2) === 0 });
    const written = ({ by, constant, isStrict }) => [...[...by].map(([time, it]) => `${it}/1*t${time}`), `${constant}/2`].join(" + ") + (isStrict ? " < 0" : " <= 0");
    // Halves, so that bounds are no whole numbers.
    const system = page.readSystem({
      times: Array.from({ length: count + 1 }, (_, it) => `n${it}`),
      network: network.map((row) => ({ row: written(row), is_need: false, words: null })),
      requirements: [{ words: "this", is_order: false, broken_if: [bad.map(written)] }],
    });
    const exactly = (row) => ({
      by: Array.from({ length: count }, (_, index) => [BigInt(row.by.get(index + 1) ?? 0), 1n]),
      constant: page.fraction(BigInt(row.constant), 2n), isStrict: row.isStrict,
    });
    const hasSchedule = eliminated(network.map(exactly), count);
    const canBreak = hasSchedule && eliminated([...network, ...bad].map(exactly), count);
    const { works } = page.checkPoint(system, []);
    assert.equal(works, hasSchedule && !canBreak, JSON.stringify(system, (_, it) => (typeof it === "bigint" ? `${it}` : it)));
    counts[works] += 1;
  }
  assert.ok(counts.true > tries / 50 && counts.false > tries / 50, JSON.stringify(counts));
  console.log(`${tries} random systems have the verdicts of their twin (${counts.true} work)`);
}

function plans() {
  const found = [];
  for (const name of fs.readdirSync(cases).sort()) {
    for (const plan of ["plan.plan", "plan.stn"]) {
      if (fs.existsSync(path.join(cases, name, plan))) found.push([name, plan]);
    }
  }
  assert.ok(found.length >= 7, `cases of ${cases}`);
  return found;
}

compareWithTwin(3000);
const seen = { true: 0, false: 0, null: 0 };
for (const [name, plan] of plans()) {
  const files = ["domain.pddl", "problem.pddl", plan].map((it) => path.join(cases, name, it));
  const ask = (...options) => spawnSync(elbowroom, ["envelope", ...files, ...options], { encoding: "utf8", maxBuffer: 1 << 28 });
  const answer = JSON.parse(ask("--json", "--sharpen").stdout);
  assert.equal(answer.answer, "envelope", `${name}/${plan}`);
  assert.ok(answer.inequalities, `${name}/${plan} is written out`);
  const system = page.readSystem(answer.inequalities);
  const nominal = answer.parameters.map((it) => page.parsed(it.nominal.exact));
  const points = [nominal];
  for (const [index, parameter] of answer.parameters.entries()) {
    for (const [end, by] of [[parameter.lower, -1n], [parameter.upper, 1n]]) {
      if (end.exact.includes("inf")) continue;
      for (const beyond of [0n, 1n]) {
        const point = [...nominal];
        point[index] = page.plus(page.parsed(end.exact), [by * beyond, 1_000_000n]);
        if (point[index][0] >= 0n) points.push(point);
      }
    }
  }
  for (let extra = 0; extra < Number(count); extra++) {
    const spread = [20, 60, 300][extra % 3];
    points.push(nominal.map((value) => page.times(value, page.fraction(BigInt(100 - Math.min(100, spread) + random(2 * spread)), 100n))));
  }
  for (const values of points) {
    const box = answer.parameters.map((it, index) => `${it.name}=[${text(values[index])},${text(values[index])}]`).join(" ");
    const { works, words } = page.checkPoint(system, values);
    seen[works] += 1;
    const done = ask("--contains", box);
    assert.ok(done.status === 0 || done.status === 1, `${name}: ${box}: ${done.stderr}`);
    // In another order of happenings a plan may work: the page says that it does not know.
    if (works !== null) assert.equal(works, done.status === 0, `${name}/${plan} at ${box}: ${words}\n${done.stdout}`);
  }
}
assert.ok(seen.true > 20 && seen.false > 20 && seen.null * 10 < seen.true + seen.false, JSON.stringify(seen));
console.log(`the page and the command agree: ${seen.true} points work, ${seen.false} fail; of ${seen.null} the page says that it does not know`);
