"""VAL's verdicts on the plans that Elbowroom writes.

    python testing/val_plans.py ELBOWROOM VALIDATE DATA RESULTS.csv [SECONDS]

plans for each problem in the folder DATA with `ELBOWROOM plan --first`, at most SECONDS (4) of processor time each, writes
the plan to a file, and runs VAL's program VALIDATE on it with `-t 0.001`. RESULTS.csv gets one row for each
problem; problems that it has already are skipped, so an interrupted measurement can be continued. The last lines
count the rows and list those that VAL does not accept.

A problem is a row of a `manifest.csv`, or a pair `d.pddl`, `p.pddl` or `NAME.d.pddl`, `NAME.p.pddl`, or
`domain.pddl` with another file of its folder.
"""

import csv
import re
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

COLUMNS = ["domain", "problem", "plan", "actions", "numbers", "check", "val", "why"]
# A time or a duration that is written as a fraction.
FRACTION = re.compile(r"^\d+/\d+:|\[\d+/\d+\]", re.MULTILINE)
UNREADABLE = ("Problem in domain", "Bad problem", "Type problem", "Error", "Bad plan")


def problems(data):
    """Pairs of a domain file and a problem file."""
    found = set()
    for manifest in data.rglob("manifest.csv"):
        with manifest.open(newline="") as rows:
            for row in csv.DictReader(rows):
                pair = (row.get("domain_file"), row.get("problem_file"))
                if all(pair):
                    found.add(tuple(manifest.parent / name for name in pair))
    for domain in data.rglob("*d.pddl"):
        if domain.name == "d.pddl" or domain.name.endswith(".d.pddl"):
            problem = domain.with_name(domain.name.removesuffix("d.pddl") + "p.pddl")
            if problem.exists():
                found.add((domain, problem))
    for domain in data.rglob("domain.pddl"):
        for problem in domain.parent.glob("*.pddl"):
            if problem != domain and "(:goal" in problem.read_text(errors="replace"):
                found.add((domain, problem))
    return sorted(found)


def limited(seconds):
    """Ends a process after this much processor time."""
    return lambda: resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))


def call(words, seconds):
    """Exit code and output of a command."""
    try:
        done = subprocess.run(
            words,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=30 * seconds,
            preexec_fn=limited(seconds),
        )
    except subprocess.TimeoutExpired:
        return None, ""
    return done.returncode, done.stdout + done.stderr


def verdict(code, text):
    """Returns VAL's verdict, and the line with the reason."""
    if "Plan valid" in text:
        return "valid", ""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if any(word in text for word in UNREADABLE):
        return "unreadable", next((line for line in lines if any(w in line for w in UNREADABLE)), "")
    if "failed to execute" in text or "Goal not satisfied" in text or "Plan invalid" in text:
        start = next((i for i, line in enumerate(lines) if "Repair Advice" in line), 0)
        return "invalid", " ".join(lines[start + 1 : start + 3])
    return "no answer", f"exit code {code}"


def measured(elbowroom, val, pair, seconds):
    """The row of a problem."""
    domain, problem = pair
    row = dict.fromkeys(COLUMNS, "")
    row |= {"domain": domain, "problem": problem}
    with tempfile.TemporaryDirectory() as folder:
        plan = Path(folder) / "plan"
        words = [elbowroom, "plan", domain, problem, "--first", "--jobs", "1", "-o", plan]
        code, _ = call(words, seconds)
        if code != 0 or not plan.exists():
            row["plan"] = {1: "none exists", 2: "not read", 3: "none found"}.get(code, "limit")
            return row
        text = plan.read_text()
        row["plan"] = "found"
        row["actions"] = sum(line.lstrip()[:1].isdigit() for line in text.splitlines())
        row["numbers"] = "fractions" if FRACTION.search(text) else "decimals"
        code, _ = call([elbowroom, "check", domain, problem, plan], 60)
        row["check"] = {0: "valid", 1: "invalid"}.get(code, f"exit code {code}")
        row["val"], row["why"] = verdict(*call([val, "-t", "0.001", domain, problem, plan], 60))
        if row["val"] == "unreadable":
            # VAL also reports errors in domain and problem if the plan is empty.
            empty = Path(folder) / "empty"
            empty.write_text("")
            alone, _ = verdict(*call([val, "-t", "0.001", domain, problem, empty], 60))
            row["val"] = "problem unreadable" if alone in ("unreadable", "no answer") else "plan unreadable"
    return row


def main():
    elbowroom, val, data, results = (Path(word).absolute() for word in sys.argv[1:5])
    seconds = int(sys.argv[5]) if len(sys.argv) > 5 else 4
    rows = []
    if results.exists():
        with results.open(newline="") as file:
            rows = list(csv.DictReader(file))
    known = {(row["domain"], row["problem"]) for row in rows}
    with results.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        if not rows:
            writer.writeheader()
        for pair in problems(data):
            names = tuple(str(path.relative_to(data)) for path in pair)
            if names in known:
                continue
            row = measured(elbowroom, val, pair, seconds)
            row |= {"domain": names[0], "problem": names[1]}
            writer.writerow(row)
            file.flush()
            rows.append({column: str(row[column]) for column in COLUMNS})
    for column in ("plan", "numbers", "check", "val"):
        print(f"{column}:", dict(Counter(row[column] for row in rows if row[column])))
    for row in rows:
        if row["plan"] == "found" and (row["val"] != "valid" or row["check"] != "valid"):
            print(f"{row['problem']}: check {row['check']}, VAL {row['val']}: {row['why']}")


if __name__ == "__main__":
    main()
