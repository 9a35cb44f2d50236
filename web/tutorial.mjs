// The chapters of the tutorial as HTML, with buttons for the commands that the playground can try.

import { readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import { Marked } from "marked";

const escaped = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll("\"", "&quot;");
const ASKS = ["check", "plan", "envelope", "run"];
// Options that only concern files of the command line.
const FILES = { "--trace": 1, "-o": 1, "--plan": 1 };
// Options that the playground replaces by its own controls.
const ELSEWHERE = ["--planner", "--world-process", "--replay", "--json"];

const words = (line) => [...line.matchAll(/"([^"]*)"|(\S+)/g)].map((match) => match[1] ?? match[2]);
const quoted = (word) => (/\s/.test(word) ? `"${word}"` : word);

// Converts a command to input for the playground; null if the playground does not support it.
function trial(line, state) {
  const [program, ask, ...rest] = words(line);
  if (program !== "elbowroom" || !ASKS.includes(ask)) return null;
  const options = [], found = { ask, example: null, world: "", likelihoods: "" };
  while (rest.length) {
    const word = rest.shift();
    const [, name] = /^cases\/([a-z-]+)\//.exec(word) ?? [];
    if (ELSEWHERE.includes(word)) return null;
    if (name) found.example = name;
    else if (word in FILES) rest.shift();
    else if (word === "--world" || word === "--likelihoods") {
      const kind = word.slice(2);
      rest.shift();
      if (!state[kind]) return null;
      found[kind] = state[kind];
    } else if (word.startsWith("--")) {
      options.push(word);
      if (rest.length && !rest[0].startsWith("--")) options.push(quoted(rest.shift()));
    } else if (!/\.plan$/.test(word)) return null;
  }
  return found.example || ask === "check" ? { ...found, options: options.join(" ") } : null;
}

export function chapters(root) {
  const folders = ["crates/elbowroom/docs/tutorial", "crates/laboratory/docs/tutorial"];
  const files = folders.flatMap((folder) => readdirSync(join(root, folder)).sort().map((name) => join(root, folder, name)));
  const state = {};
  return files.map((file) => {
    const trials = [];
    const marked = new Marked({
      renderer: {
        // A self-contained page has no link targets outside.
        link({ tokens }) { return this.parser.parseInline(tokens); },
        // The playground shows the answer itself instead of a picture of it.
        image() { return ""; },
        code({ text, lang }) {
          const [, format] = /^format = "elbowroom-(world|likelihoods)"/.exec(text) ?? [];
          if (format) state[format] = `${text}\n`;
          // Hidden lines of documentation tests.
          const shown = lang === "rust" ? text.split("\n").filter((line) => !/^# |^#$/.test(line)).join("\n") : text;
          const commands = lang === "text" ? text.replaceAll("\\\n", " ").split("\n").filter((line) => line.startsWith("elbowroom ")) : [];
          const buttons = commands.flatMap((line) => {
            const found = trial(line, state);
            if (!found) return [];
            trials.push({ ...found, command: line.replace(/\s+/g, " ") });
            const about = commands.length > 1 ? `: ${line.replace(/\s+/g, " ").slice(0, 70)}…` : "";
            return [`<button type="button" data-try="${trials.length - 1}">Try it${escaped(about)}</button>`];
          });
          return `<pre tabindex="0"><code>${escaped(shown)}</code></pre>${buttons.length ? `<p>${buttons.join(" ")}</p>` : ""}\n`;
        },
      },
    });
    const text = readFileSync(file, "utf8");
    const [, title] = /^# (.*)$/m.exec(text);
    // The title is removed, because the list of chapters contains it and the page has its own title.
    const html = marked.parse(text.replace(/^# .*$/m, "")).replaceAll(/<(\/?)h2/g, "<$1h3");
    return { title, html, trials };
  });
}
