// Syntax highlighting only; the library determines the meaning of a text.

/** A stretch of a line, in units of UTF-16. */
export interface Stretch {
  from: number;
  to: number;
  kind: string;
}

const PDDL = /(?<comment>;.*)|(?<keyword>:[\w-]+)|(?<variable>\?[\w-]+)|(?<number>(?<![\w-])\d+(?:\.\d+)?(?![\w-]))|(?<word>(?<![\w-])(?:define|domain|problem|and|or|not|imply|when|forall|exists|either|at|over|start|end|all|increase|decrease|assign|scale-up|scale-down|minimize|maximize|total-time)(?![\w-]))/gi;
const TOML = /(?<comment>#.*)|(?<string>"[^"]*"?)|(?<keyword>^\s*\[\[?[^\]]*\]?\]?)|(?<number>(?<![\w-])-?\d+(?:\.\d+)?(?![\w-]))|(?<word>\b(?:true|false)\b)/g;

/** The stretches of a line that have a colour. */
export function stretches(line: string, language: "pddl" | "toml"): Stretch[] {
  const found: Stretch[] = [];
  for (const match of line.matchAll(language === "pddl" ? PDDL : TOML)) {
    const kind = Object.entries(match.groups ?? {}).find(([, text]) => text !== undefined)?.[0];
    if (kind) found.push({ from: match.index, to: match.index + match[0].length, kind });
  }
  return found;
}
