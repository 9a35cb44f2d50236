"""Plans of several planners for the same problems, one after the other, each with one processor core.

    python3 testing/compare_planners.py PROGRAM OUTPUT --seconds 10 --planner NAME=COMMAND [--planner …] PROBLEM…

PROGRAM is `elbowroom`, whose `check` judges each plan. The domain of a problem is `domain.pddl` in its folder, or given as
DOMAIN:PROBLEM. In a COMMAND, `{domain}`, `{problem}`, `{seconds}` and `{plan}` (a file for the plan, or the beginning of
its name) are replaced; plans are read from standard output and from files. OUTPUT is a file of comma-separated values, to
which a line is added for each problem and planner; a second call continues where the first ended. A plan with rounded
times, or with less than a millisecond between happenings, is also accepted: `--tolerance` and `--epsilon` of PROGRAM's
`check`. Prints a table with the shortest accepted makespans. Standard library only.
"""

import argparse
import contextlib
import csv
import os
import pathlib
import re
import shlex
import signal
import subprocess
import tempfile
import time

STEP = re.compile(r"^\s*([0-9.]+):\s*(\(.*?\))\s*(?:\[\s*(?:D:)?([0-9.]+).*?\])?")


def plans_in(text):
    """The plans in a planner's output: a step that begins earlier than the first one begins another plan."""
    plans, steps = [], []
    for line in text.splitlines():
        found = STEP.match(line)
        if not found:
            if steps:
                plans.append(steps)
                steps = []
            continue
        steps.append((float(found[1]), found[2].lower(), float(found[3] or 0)))
    return plans + [steps] if steps else plans


def length(steps):
    return max(start + duration for start, _, duration in steps)


def is_accepted(program, domain, problem, steps, folder):
    path = folder / "judged.plan"
    path.write_text("".join(f"{start:.6f}: {name} [{duration:.6f}]\n" for start, name, duration in steps))
    command = [program, "check", domain, problem, str(path)]
    for extra in ([], ["--tolerance", "0.002"], ["--epsilon", "0.0001", "--tolerance", "0.0002"]):
        try:
            if subprocess.run(command + extra, capture_output=True, timeout=60).returncode == 0:
                return True
        except subprocess.TimeoutExpired:
            return False
    return False


def solve(program, command, domain, problem, seconds):
    """Runs a planner. Returns the shortest accepted makespan, the seconds, and the number of rejected plans."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        places = {"domain": domain, "problem": problem, "seconds": seconds, "plan": folder / "plan"}
        words = [word.format(**places) for word in shlex.split(command)]
        begun = time.monotonic()
        process = subprocess.Popen(["taskset", "-c", str(os.cpu_count() - 1), *words], stdout=subprocess.PIPE,
                                   stderr=subprocess.DEVNULL, text=True, cwd=folder, start_new_session=True)
        try:
            text, _ = process.communicate(timeout=seconds + 2)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGINT)
            try:
                text, _ = process.communicate(timeout=3)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                text, _ = process.communicate()
        finally:
            # Also if this program is interrupted.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
        took = time.monotonic() - begun
        texts = [text] + [path.read_text(errors="replace") for path in sorted(folder.glob("plan*"))]
        plans = sorted((steps for text in texts for steps in plans_in(text)), key=length)
        rejected = 0
        for steps in plans:
            if is_accepted(program, domain, problem, steps, folder):
                return length(steps), took, rejected
            rejected += 1
        return None, took, rejected


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("output", type=pathlib.Path)
    parser.add_argument("problems", nargs="+")
    parser.add_argument("--seconds", type=int, default=10)
    parser.add_argument("--planner", action="append", required=True)
    arguments = parser.parse_args()
    planners = dict(text.split("=", 1) for text in arguments.planner)
    rows = []
    if arguments.output.exists():
        with arguments.output.open(newline="") as file:
            rows = list(csv.DictReader(file))
    known = {(row["problem"], row["planner"], row["seconds"]): row for row in rows}
    fields = ["problem", "planner", "seconds", "makespan", "took", "rejected"]
    table = []
    for given in arguments.problems:
        domain, _, problem = given.rpartition(":")
        path = pathlib.Path(problem).resolve()
        domain = pathlib.Path(domain or path.parent / "domain.pddl").resolve()
        label = f"{path.parent.name}/{path.stem}" + ("" if domain.stem == "domain" else f" ({domain.stem})")
        cells = []
        for name, command in planners.items():
            row = known.get((label, name, str(arguments.seconds)))
            if row is None:
                makespan, took, rejected = solve(arguments.program, command, str(domain), str(path), arguments.seconds)
                row = {"problem": label, "planner": name, "seconds": str(arguments.seconds), "took": f"{took:.1f}",
                       "makespan": "" if makespan is None else f"{makespan:.3f}", "rejected": str(rejected)}
                is_new = not arguments.output.exists()
                with arguments.output.open("a", newline="") as file:
                    writer = csv.DictWriter(file, fields)
                    if is_new:
                        writer.writeheader()
                    writer.writerow(row)
            cells.append(row["makespan"] or ("rejected" if row["rejected"] != "0" else "–"))
        table.append([label, *cells])
    print("| problem | " + " | ".join(planners) + " |")
    print("|---|" + "--:|" * len(planners))
    for row in table:
        print("| " + " | ".join(row) + " |")
    solved = [sum(row[place + 1][0].isdigit() for row in table) for place in range(len(planners))]
    print("| **solved** | " + " | ".join(f"{count} of {len(table)}" for count in solved) + " |")


if __name__ == "__main__":
    main()
