// Options as on the command line, as members of a question.

/** An option that a question does not have, or one without its value. */
export class WrongOption extends Error {}

type Kind = "flag" | "value" | "list" | "number";

/** The options of each question, by their names on the command line. */
const KNOWN: Record<string, Record<string, Kind>> = {
  check: { epsilon: "value", tolerance: "value" },
  plan: { epsilon: "value", "time-limit": "value", first: "flag" },
  envelope: {
    epsilon: "value", vary: "list", controllable: "list", guarantee: "value", enforce: "flag", contains: "value", timeout: "value", method: "value",
    objective: "value", symmetric: "flag", precision: "value", growth: "value", sharpen: "flag", "time-limit": "value", volume: "flag",
  },
  run: { epsilon: "value", executor: "value", seed: "number", guarantee: "value", timeout: "value", "max-replans": "number" },
};

/** The words of a line; quotes keep spaces together. */
export function split(line: string): string[] {
  return [...line.matchAll(/"([^"]*)"|'([^']*)'|(\S+)/g)].map((match) => match[1] ?? match[2] ?? match[3] ?? "");
}

/** What the options of a line say, for a question of that kind. */
export function members(ask: string, line: string): Record<string, unknown> {
  const known = KNOWN[ask] ?? {}, found: Record<string, unknown> = {};
  const words = split(line);
  for (let word = words.shift(); word !== undefined; word = words.shift()) {
    const [, name = "", joined] = /^--([a-z-]+)(?:=(.*))?$/s.exec(word) ?? [];
    const kind = known[name];
    if (!kind) throw new WrongOption(`\`${ask}\` has no option \`${word}\` here; it has ${Object.keys(known).map((it) => `--${it}`).join(", ")}.`);
    if (kind === "flag") {
      found[name] = true;
      continue;
    }
    const value = joined ?? words.shift();
    if (value === undefined) throw new WrongOption(`\`--${name}\` needs a value.`);
    if (kind === "list") found[name] = [...(found[name] as string[] | undefined ?? []), value];
    else if (kind === "value") found[name] = value;
    else if (/^\d+$/.test(value)) found[name] = Number(value);
    else throw new WrongOption(`\`--${name}\` needs a whole number, not \`${value}\`.`);
  }
  return found;
}
