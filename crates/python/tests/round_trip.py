"""Counts the results of converting plans to unified-planning and back.

    python crates/python/tests/round_trip.py DATA

DATA is a folder with `plans.csv` (columns `domain_file`, `problem_file`, `plan_file`). Domain, problem and plan are
read by unified-planning's own reader, translated by `elbowroom.up`, and judged; so are the files themselves.
Prints a row for each outcome, and names each plan whose two verdicts differ.
"""

from __future__ import annotations

import collections
import csv
import signal
import sys
import warnings
from pathlib import Path
from typing import Any

from unified_planning.environment import get_environment
from unified_planning.io import PDDLReader

import elbowroom
import elbowroom.up

SECONDS = 30
TOLERANCE = "0.001"


class Slow(Exception):
    """unified-planning took too long."""


def ring(*_: Any) -> None:
    raise Slow


def outcome(domain: Path, problem: Path, plan: Path) -> tuple[str, str]:
    """Result of one plan, with details."""
    try:
        read = elbowroom.read(domain, problem)
        steps = read.read_plan(plan).steps
        ours = bool(read.check(plan, tolerance=TOLERANCE))
    except elbowroom.ElbowroomError as error:
        return "not read by Elbowroom", str(error).splitlines()[0]
    signal.alarm(SECONDS)
    try:
        reader = PDDLReader()
        theirs = reader.parse_problem(str(domain), str(problem))
        text = "\n".join(
            f"{float(s.start):.9f}: {s.action}" + ("" if s.duration is None else f" [{float(s.duration):.9f}]")
            for s in steps
        )
        parsed = reader.parse_plan_string(theirs, text)
    except Slow:
        return f"not read by unified-planning within {SECONDS} s", ""
    except Exception as error:
        return "not read by unified-planning", f"{type(error).__name__}: {str(error)[:80]}"
    finally:
        signal.alarm(0)
    try:
        translated = elbowroom.up.Translation(theirs)
        verdict = bool(translated.problem.check(translated.steps(parsed), tolerance=TOLERANCE))
    except elbowroom.UnsupportedError as error:
        return "refused by name", str(error)[:80]
    same = "valid" if ours else "invalid"
    return (f"the same verdict: {same}" if verdict == ours else "another verdict"), f"{ours} {verdict}"


def main(data: Path) -> None:
    warnings.filterwarnings("ignore")
    signal.signal(signal.SIGALRM, ring)
    get_environment().credits_stream = None
    counts: collections.Counter[str] = collections.Counter()
    reasons: collections.Counter[str] = collections.Counter()
    with open(data / "plans.csv", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            files = (data / row[f"{what}_file"] for what in ("domain", "problem", "plan"))
            what, details = outcome(*files)
            counts[what] += 1
            if what == "another verdict":
                print(row["plan_file"], details, flush=True)
            elif not what.startswith("the same"):
                reasons[f"{what}: {details}"] += 1
    for what, count in counts.most_common():
        print(f"| {what} | {count} |")
    for reason, count in reasons.most_common(12):
        print(f"{count} {reason}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
