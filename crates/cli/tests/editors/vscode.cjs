// The libraries of the PDDL extension of Visual Studio Code, with our command in VAL's place.
//
//   node vscode.cjs ELBOWROOM CASES WORK
//
// Wants `ai-planning-val` and `pddl-workspace` from npm on NODE_PATH.

"use strict";
const assert = require("node:assert/strict");
const fs = require("node:fs");
const path = require("node:path");
const { Parser } = require("ai-planning-val/dist/Parser");
const { PlanValidator } = require("ai-planning-val/dist/PlanValidator");
const workspace = require("pddl-workspace");
const { URI } = require("vscode-uri");

const [, , elbowroom, cases, work] = process.argv.map((it, index) => (index > 1 ? path.resolve(it) : it));
fs.mkdirSync(work, { recursive: true });
const validate = path.join(work, "Validate");
fs.rmSync(validate, { force: true });
fs.symlinkSync(elbowroom, validate);

const uri = (name) => URI.file(name);
const read = (name) => fs.readFileSync(path.join(cases, "delivery", name), "utf8");
const domainOf = (text) => workspace.parser.PddlDomainParser.parseText(text, uri("/domain.pddl"));
const problemOf = (text) => workspace.parser.PddlProblemParser.parseText(text, uri("/problem.pddl"));
const planOf = (text) => new workspace.parser.PddlPlanParser().parseText(text, 0.001, uri("/a.plan"));

async function judged(text, domain = read("domain.pddl")) {
  const outcome = await new PlanValidator(() => {}).validate(domainOf(domain), await problemOf(read("problem.pddl")), planOf(text), {
    epsilon: 0.001, validatePath: validate, cwd: work,
  });
  return { error: outcome.getError(), problems: outcome.getPlanProblems() };
}

class OurParser extends Parser {
  getSyntax() { return ["check", "--diagnostics", "lines", "$(domain)", "$(problem)"]; }
}

(async () => {
  const valid = await judged(read("plan.plan"));
  assert.deepEqual([valid.error, valid.problems], [undefined, []]);

  // The line of the action that fails is marked, with our message.
  const late = await judged(read("late.plan"));
  const failing = read("late.plan").split("\n").findIndex((line) => line.includes("(drop"));
  assert.ok(late.problems.length > 0);
  assert.match(late.problems[0].problem, /counter-open office/);
  assert.equal(late.problems[0].range.start.line, failing);

  // The goal is not reached.
  const short = read("plan.plan").split("\n").filter((line) => !line.includes("(drop")).join("\n");
  const unfinished = await judged(short);
  assert.match(unfinished.problems.map((it) => it.problem).join(), /lies parcel office/);

  const garbage = await judged("0.0: (no such action) [1]\n");
  assert.equal(garbage.error, "Invalid plan description.");

  // Mistakes in the domain, at their lines.
  const wrong = read("domain.pddl").replace("(carries ?r ?x)", "(caries ?r ?x)");
  const parsed = await new OurParser({ executablePath: elbowroom }).validate(domainOf(wrong), await problemOf(read("problem.pddl")));
  const found = [...parsed.values()].flat();
  assert.ok(found.length > 0, "the misspelt predicate is found");
  const line = wrong.split("\n").findIndex((it) => it.includes("caries"));
  assert.ok(found.some((it) => it.range.start.line === line), JSON.stringify(found));
  console.log("the libraries of the editor understand every answer");
})().catch((error) => { console.log(error.stack); process.exit(1); });
