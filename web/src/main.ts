// The playground: input texts on one side, answers on the other.

import examples from "given:examples";
import { Editor, type Finding } from "./editor";
import { Engine, Stopped, Trouble } from "./engine";
import type { Reply } from "./module";
import { members, WrongOption } from "./options";
import { packed, unpacked } from "./share";
import { tutorial, type Trial } from "./tutorial";

const by = <T extends HTMLElement>(id: string): T => {
  const found = document.getElementById(id);
  if (!found) throw new Error(`there is no #${id}`);
  return found as T;
};
const status = by("status"), findings = by("findings");
let frame = by<HTMLIFrameElement>("page");
const stop = by<HTMLButtonElement>("stop"), save = by<HTMLButtonElement>("save");
const example = by<HTMLSelectElement>("example");
const choices = { guarantee: by<HTMLSelectElement>("guarantee"), executor: by<HTMLSelectElement>("executor"), seed: by<HTMLInputElement>("seed"), options: by<HTMLInputElement>("options") };
const askers = [...document.querySelectorAll<HTMLButtonElement>("button[data-ask]")];

const editors = [
  new Editor("domain.pddl", "Domain, in PDDL", "pddl", edited),
  new Editor("problem.pddl", "Problem, in PDDL", "pddl", edited),
  new Editor("plan.plan", "Plan: start: (action arguments) [duration]", "pddl", edited),
  new Editor("world.toml", "World, in TOML; without one, everything goes as planned", "toml", edited),
  new Editor("likelihoods.toml", "Likelihoods, in TOML: what executors believe that go by them", "toml", edited),
] as const;
const [domain, problem, plan, world, likelihoods] = editors;
const [panels, tabs] = [by("editors"), by("tabs")];
const buttons = editors.map((editor, index) => {
  const tab = document.createElement("button");
  const name = ["Domain", "Problem", "Plan", "World", "Likelihoods"][index] ?? "";
  Object.assign(tab, { type: "button", textContent: name, id: `tab-${index}` });
  tab.setAttribute("role", "tab");
  tab.setAttribute("aria-controls", `panel-${index}`);
  tab.addEventListener("click", () => show(index));
  tab.addEventListener("keydown", (event) => {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!by) return;
    const next = (index + by + editors.length) % editors.length;
    show(next);
    buttons[next]?.focus();
  });
  editor.node.id = `panel-${index}`;
  editor.node.setAttribute("role", "tabpanel");
  editor.node.setAttribute("aria-labelledby", tab.id);
  tabs.append(tab);
  panels.append(editor.node);
  return tab;
});

function show(shown: number): void {
  for (const [index, tab] of buttons.entries()) {
    tab.setAttribute("aria-selected", String(index === shown));
    tab.tabIndex = index === shown ? 0 : -1;
    const panel = editors[index];
    if (panel) panel.node.hidden = index !== shown;
  }
}

let engine: Engine | null = null;
/** Counts questions, so that only the last one is answered. */
let turn = 0;
let waiting: ReturnType<typeof setTimeout> | undefined;
let made = "";

const text = (editor: Editor): { name: string; text: string } => ({ name: editor.name, text: editor.text });
const texts = (): Record<string, unknown> => ({ domain: text(domain), problem: text(problem) });
const withPlan = (): Record<string, unknown> => (plan.text.trim() ? { ...texts(), plan: text(plan) } : texts());

function say(words: string, tone: "good" | "bad" | "plain"): void {
  status.textContent = words;
  status.className = `verdict ${tone}`;
}

/** A document of the library; which members it has, depends on its format. */
interface Answer {
  format: string;
  answer?: string;
  message?: string;
  makespan?: { exact: string; decimal: number };
  violation?: { message: string };
  plan?: string;
  reason?: string;
  diagnostics?: Finding[];
  nodes?: unknown[];
}

/** Shows what is wrong in the texts where it is wrong, and as a list. */
function mark(answer: Answer): void {
  const all = answer.diagnostics ?? [];
  for (const [index, editor] of editors.entries()) {
    const own = all.filter((it) => it.file === editor.name || editor === world && it.file === "world");
    editor.mark(own);
    buttons[index]?.classList.toggle("wrong", own.some((it) => it.severity === "error"));
  }
  findings.replaceChildren(...all.slice(0, 100).map((finding) => {
    const item = document.createElement("li"), button = document.createElement("button");
    button.type = "button";
    button.className = finding.severity;
    button.dir = "auto";
    button.textContent = `${finding.file}, line ${finding.line}: ${finding.severity}: ${finding.message}${finding.advice ? ` (${finding.advice})` : ""}`;
    button.addEventListener("click", () => {
      const index = editors.findIndex((editor) => editor.name === finding.file || finding.file === "world" && editor === world);
      show(index);
      editors[index]?.goTo(finding);
    });
    item.append(button);
    return item;
  }));
}

function showPage(page: string | undefined): void {
  made = page ?? "";
  // Each page gets a new frame, because navigation within a frame adds an entry to the history.
  const next = frame.cloneNode() as HTMLIFrameElement;
  next.hidden = save.hidden = !page;
  if (page) next.srcdoc = page;
  else next.removeAttribute("srcdoc");
  frame.replaceWith(next);
  frame = next;
}

/** Asks, unless another question has been asked since. */
async function ask(question: Record<string, unknown>): Promise<{ reply: Reply; answer: Answer; milliseconds: number } | null> {
  if (!engine) return null;
  const own = ++turn;
  stop.disabled = false;
  try {
    const { reply, milliseconds } = await engine.ask(question);
    if (own !== turn) return null;
    return { reply, milliseconds, answer: (reply.document ? JSON.parse(reply.document) : {}) as Answer };
  } catch (error) {
    if (own !== turn) return null;
    if (error instanceof Stopped) say("Stopped.", "plain");
    else if (error instanceof Trouble) say(`The library came to an end that it should not come to; please report this with your texts. (${error.message})`, "bad");
    else throw error;
    return null;
  } finally {
    if (own === turn) stop.disabled = true;
  }
}

/** What came of a question that has a page. */
async function pageOf(name: string, text: string): Promise<void> {
  const found = await ask({ ask: "page", of: { name, text } });
  if (found) showPage(found.reply.page);
}

const took = (milliseconds: number): string => (milliseconds < 1000 ? `${Math.max(1, Math.round(milliseconds))} ms` : `${(milliseconds / 1000).toFixed(1)} s`);

async function check(isQuiet: boolean): Promise<void> {
  const found = await ask({ ask: "check", ...withPlan() });
  if (!found) return;
  const { answer, reply } = found;
  mark(answer);
  if (!isQuiet) showPage(undefined);
  if (answer.format === "elbowroom-failure") say(answer.message ?? "", "bad");
  else if (reply.exit === 0 && answer.makespan) say(`Valid: the plan reaches the goal at ${answer.makespan.decimal}.`, "good");
  else if (reply.exit === 0) say("Domain and problem can be read.", "good");
  else say(`The plan does not work: ${answer.violation?.message ?? ""}`, "bad");
}

async function act(what: string): Promise<void> {
  if (what === "check") return check(false);
  if (what === "envelope" && !plan.text.trim()) return say("There is no plan: write one, or have one found.", "bad");
  let more: Record<string, unknown>;
  try {
    more = members(what, choices.options.value);
  } catch (error) {
    if (!(error instanceof WrongOption)) throw error;
    return say(error.message, "bad");
  }
  say("Working…", "plain");
  showPage(undefined);
  const options: Record<string, Record<string, unknown>> = {
    plan: { ...texts(), first: true },
    // The region has only one kind of guarantee, and its answer includes boxes.
    envelope: { ...withPlan(), ...(more.method === "exact" ? { volume: true } : { guarantee: choices.guarantee.value }) },
    run: {
      ...withPlan(), guarantee: choices.guarantee.value, executor: choices.executor.value, seed: Math.max(0, Math.trunc(Number(choices.seed.value) || 0)),
      ...(world.text.trim() ? { world: text(world) } : {}),
      ...(likelihoods.text.trim() ? { likelihoods: text(likelihoods) } : {}),
    },
  };
  const found = await ask({ ask: what, ...options[what], ...more });
  if (!found) return;
  const { answer, reply, milliseconds } = found;
  mark(answer);
  if (answer.format === "elbowroom-failure") return say(answer.message ?? "", "bad");
  const tone = reply.exit === 0 ? "good" : reply.exit === 1 ? "bad" : "plain";
  const words: Record<string, string> = {
    plan: answer.plan && answer.answer === "plan" ? `A plan was found in ${took(milliseconds)}; it stands in the editor.` : `No plan: ${answer.reason ?? ""}`,
    envelope: { envelope: `The envelope was found in ${took(milliseconds)}.`, region: `The region was found in ${took(milliseconds)}.`,
      inside: "The plan works in all of the box.", outside: "The plan does not work in all of the box; the page says why." }[answer.answer ?? ""] ?? "There is no envelope; the page says why.",
    run: reply.exit === 0 ? `The goal was reached. The run took ${took(milliseconds)}.` : "The goal was not reached; the page says why.",
  };
  say(words[what] ?? "", tone);
  if (what === "plan" && answer.answer === "plan" && answer.plan) {
    plan.text = answer.plan;
    show(2);
  }
  const name = { run: "run.jsonl", plan: "plan.json", envelope: plan.name }[what] ?? what;
  await pageOf(name, reply.trace ?? reply.document);
}

/** A text has changed: what is wrong in it is said soon. */
function edited(): void {
  example.value = "";
  clearTimeout(waiting);
  waiting = setTimeout(() => { void check(true); }, 400);
}

function fill(texts: (typeof examples)[number]): void {
  [domain.text, problem.text, plan.text, world.text, likelihoods.text] = [texts.domain, texts.problem, texts.plan, texts.world, texts.likelihoods];
}

/** A command of the tutorial, with the texts that it is about. */
async function attempt(trial: Trial): Promise<void> {
  const chosen = examples.find((it) => it.name === trial.example);
  if (chosen) fill({ ...chosen, world: trial.world, likelihoods: trial.likelihoods });
  // Options with their own controls are set there.
  let line = trial.options;
  for (const name of ["guarantee", "executor", "seed"] as const) {
    line = line.replace(new RegExp(`--${name} (\\S+)`), (_, value: string) => { choices[name].value = value; return ""; });
  }
  choices.options.value = line.trim();
  example.value = "";
  clearTimeout(waiting);
  await act(trial.ask);
  status.scrollIntoView({ block: "nearest" });
}

function open(name: string): void {
  const chosen = examples.find((it) => it.name === name);
  if (!chosen) return;
  fill(chosen);
  choices.options.value = "";
  showPage(undefined);
  void check(true);
}

function state(): Record<string, string> {
  const own = editors.map((editor): [string, string] => [editor.name, editor.text]);
  return Object.fromEntries([...own, ...Object.entries(choices).map(([name, it]): [string, string] => [name, it.value])]);
}

/** The texts and choices of the address, if it has any. */
async function restore(): Promise<boolean> {
  const hash = location.hash.slice(1);
  if (!hash) return false;
  const found = await unpacked(hash);
  if (!found) {
    say("The address of this page is damaged, so an example is shown instead of what was shared.", "bad");
    return false;
  }
  for (const editor of editors) editor.text = found[editor.name] ?? "";
  for (const [name, choice] of Object.entries(choices)) if (found[name] !== undefined) choice.value = found[name];
  example.value = "";
  return true;
}

by("share").addEventListener("click", async () => {
  location.hash = await packed(state());
  let isCopied = true;
  try { await navigator.clipboard.writeText(location.href); } catch { isCopied = false; }
  say(`The address of this page now holds all texts and choices (${location.href.length} characters${isCopied ? ", copied" : ""}).`, "plain");
});
addEventListener("hashchange", async () => {
  if (location.hash.slice(1) !== await packed(state()) && await restore()) void check(true);
});
save.addEventListener("click", () => {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([made], { type: "text/html" }));
  link.download = "elbowroom.html";
  link.click();
  URL.revokeObjectURL(link.href);
});
stop.addEventListener("click", () => engine?.stop());
for (const button of askers) button.addEventListener("click", () => { clearTimeout(waiting); void act(button.dataset.ask ?? ""); });
example.append(new Option("own texts", ""), ...examples.map(({ name }) => new Option(name, name)));
example.addEventListener("change", () => open(example.value));

tutorial(by<HTMLSelectElement>("chapter"), by("text"), (trial) => { void attempt(trial); });

async function begin(): Promise<void> {
  show(2);
  const isShared = await restore();
  try {
    engine = await Engine.load(by("module").textContent ?? "");
    const about = await ask({ ask: "about" });
    const known = about?.answer as unknown as { default_executor: string; executors: { example: string; summary: string }[]; default_guarantee: string; guarantees: { name: string; meaning: string }[] } | undefined;
    const wanted = choices.executor.value || known?.default_executor;
    choices.executor.replaceChildren(...(known?.executors ?? []).map(({ example, summary }) => {
      const option = new Option(example, example, false, example === wanted);
      option.title = summary;
      return option;
    }));
    choices.guarantee.replaceChildren(...(known?.guarantees ?? []).map(({ name, meaning }) => {
      const option = new Option(name, name, false, name === known?.default_guarantee);
      option.title = meaning;
      return option;
    }));
    if (isShared) await restore();
  } catch (error) {
    say(`The library cannot be loaded: ${String(error)}. This page needs a browser with WebAssembly.`, "bad");
    return;
  }
  if (isShared) await check(true);
  else if (!location.hash) {
    example.value = "delivery";
    open("delivery");
  } else {
    const words = status.textContent ?? "";
    example.value = "delivery";
    fill(examples.find((it) => it.name === "delivery") ?? examples[0]!);
    say(words, "bad");
  }
  document.documentElement.dataset.ready = "true";
}
void begin();
