// Text editor with syntax highlighting and error marks.

import { stretches, type Stretch } from "./highlight";

/** What is remarked on a text: docs/reference/formats/diagnostics.md. */
export interface Finding {
  severity: string;
  message: string;
  advice: string | null;
  file: string;
  line: number;
  column: number;
  length: number;
}

/** Longer texts have no colours: that would take too long with every key. */
const MOST_COLOURED = 200_000;

export class Editor {
  readonly node = document.createElement("div");
  private readonly area = document.createElement("textarea");
  private readonly paint = document.createElement("pre");
  private findings: Finding[] = [];

  constructor(readonly name: string, label: string, private readonly language: "pddl" | "toml", onInput: () => void) {
    this.node.className = "editor";
    this.area.setAttribute("aria-label", label);
    this.area.spellcheck = false;
    this.area.autocapitalize = "off";
    this.area.dir = "ltr";
    this.paint.setAttribute("aria-hidden", "true");
    this.node.append(this.paint, this.area);
    this.area.addEventListener("input", () => { this.findings = []; this.colour(); onInput(); });
    this.area.addEventListener("scroll", () => { this.paint.scrollTop = this.area.scrollTop; this.paint.scrollLeft = this.area.scrollLeft; }, { passive: true });
  }

  get text(): string {
    return this.area.value;
  }

  set text(text: string) {
    this.area.value = text;
    this.findings = [];
    this.area.scrollTop = 0;
    this.colour();
  }

  /** Marks what is wrong. */
  mark(findings: Finding[]): void {
    this.findings = findings;
    this.area.setAttribute("aria-invalid", String(findings.some((it) => it.severity === "error")));
    this.colour();
  }

  /** Goes to where it is wrong. */
  goTo(finding: Finding): void {
    const lines = this.text.split("\n");
    const before = lines.slice(0, finding.line - 1).reduce((sum, line) => sum + line.length + 1, 0);
    const { from, to } = this.placeOf(finding, lines[finding.line - 1] ?? "");
    this.area.focus();
    this.area.setSelectionRange(before + from, before + to);
    this.area.scrollTop = Math.max(0, (finding.line - 4) * parseFloat(getComputedStyle(this.area).lineHeight));
  }

  // Columns count characters, and strings count units of UTF-16.
  private placeOf(finding: Finding, line: string): Stretch {
    const characters = Array.from(line);
    const units = (count: number): number => characters.slice(0, count).join("").length;
    const from = units(finding.column - 1);
    return { from, to: Math.max(units(finding.column - 1 + finding.length), from), kind: finding.severity };
  }

  private colour(): void {
    const text = this.text;
    if (text.length > MOST_COLOURED) {
      this.area.classList.add("plain");
      this.paint.replaceChildren();
      return;
    }
    this.area.classList.remove("plain");
    const lines = text.split("\n").map((line, index) => {
      const own = this.findings.filter((it) => it.line === index + 1).map((it) => this.placeOf(it, line));
      return this.lineOf(line, stretches(line, this.language), own);
    });
    this.paint.replaceChildren(...lines.flatMap((parts) => [...parts, "\n"]));
    this.paint.scrollTop = this.area.scrollTop;
    this.paint.scrollLeft = this.area.scrollLeft;
  }

  private lineOf(line: string, coloured: Stretch[], marked: Stretch[]): (Node | string)[] {
    const cuts = new Set([0, line.length]);
    for (const { from, to } of [...coloured, ...marked]) cuts.add(from).add(to);
    const places = [...cuts].sort((a, b) => a - b);
    const parts: (Node | string)[] = [];
    for (const [index, from] of places.entries()) {
      // Mark of an empty range: a missing text.
      const gap = marked.find((it) => it.from === from && it.to === from);
      if (gap) parts.push(this.part("", `mark gap ${gap.kind}`));
      const to = places[index + 1];
      if (to === undefined) break;
      const colour = coloured.find((it) => it.from <= from && to <= it.to)?.kind;
      const mark = marked.find((it) => it.from <= from && to <= it.to)?.kind;
      const kinds = [colour, mark ? `mark ${mark}` : undefined].filter((it) => it !== undefined).join(" ");
      parts.push(kinds ? this.part(line.slice(from, to), kinds) : line.slice(from, to));
    }
    return parts;
  }

  private part(text: string, kinds: string): HTMLElement {
    const part = document.createElement("span");
    part.className = kinds;
    part.textContent = text;
    return part;
  }
}
