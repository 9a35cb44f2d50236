"""The depot of `examples/mujoco_depot`, with physics in plain Python."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT

import elbowroom

DEPOT = ROOT / "examples/mujoco_depot"
sys.path.insert(0, str(DEPOT))

from depot import Week, shortest_plan  # noqa: E402
from physics import PlainEngine  # noqa: E402
from promise import BROKEN, KEPT, OUTSIDE, promise  # noqa: E402


def run_depot(*options: str) -> str:
    package = str(Path(elbowroom.__file__).parents[1])
    paths = os.pathsep.join([package, os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, str(DEPOT / "depot.py"), *options],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_two_days_keep_the_promise(tmp_path: Path) -> None:
    files = ["--picture", str(tmp_path / "depot.svg"), "--report", str(tmp_path / "depot.html")]
    options = ["--days", "2", "--samples", "2", "--planning-budget", "1", "--engine", "plain", "--seed", "3"]
    output = run_depot(*options, *files)
    assert "engine: plain Python" in output
    assert "promise broken on 0 of them" in output
    assert all(len(line) <= 80 for line in output.splitlines())
    assert (tmp_path / "depot.svg").read_text().startswith("<svg")
    assert "<html" in (tmp_path / "depot.html").read_text()


def test_day_has_the_same_trace_again(tmp_path: Path) -> None:
    model = tmp_path / "as planned.toml"
    model.write_text('format = "elbowroom-world"\nversion = 1\n')
    week = Week(PlainEngine, seed=5)
    plan = shortest_plan(week)
    first, again = (week.day(1, plan, model) for _ in range(2))
    assert first.run.trace_text == again.run.trace_text
    assert week.day(2, plan, model).run.trace_text != first.run.trace_text


def trace(duration: float, verdict: str, *, outcome: str = "succeeded", plans: int = 1) -> list[dict[str, Any]]:
    plan = {
        "event": "plan",
        "now": 0.0,
        "steps": [{"action": "(cross alba)"}],
        "parameters": [{"name": "dur_0", "envelope": (8.0, 18.0)}],
    }
    executed = {"start": 0.0, "action": "(cross alba)", "duration": duration, "outcome": outcome}
    over = {"event": "over", "verdict": verdict, "time": 40.0, "executed": [executed]}
    return [plan, *({**plan, "now": 20.0} for _ in range(plans - 1)), over]


@pytest.mark.parametrize(
    ("entries", "expected"),
    [
        (trace(12, "goal-reached"), KEPT),
        (trace(12, "unsolvable-from-here"), BROKEN),
        (trace(12, "goal-reached", plans=2), BROKEN),
        (trace(19, "unsolvable-from-here"), OUTSIDE),
        (trace(7, "goal-reached"), OUTSIDE),
        (trace(12, "unsolvable-from-here", outcome="failed"), OUTSIDE),
        (trace(12, "unsolvable-from-here", outcome="cancelled"), BROKEN),
        (trace(19, "unsolvable-from-here", outcome="cancelled"), OUTSIDE),
    ],
)
def test_promise_counts_only_inside_the_envelope(entries: list[dict[str, Any]], expected: str) -> None:
    assert promise(entries) == expected


def test_trace_of_a_run_has_an_envelope_for_each_duration() -> None:
    problem = elbowroom.read(DEPOT / "domain.pddl", DEPOT / "problem.pddl")
    slow = 'format = "elbowroom-world"\nversion = 1\n[[duration]]\naction = "cross"\nconstant = 60\n'
    run = problem.run([*problem.plans(jobs=1)][-1], world=slow, planning_time=0)
    assert json.loads((run.trace_text or "").splitlines()[-1])["event"] == "over"
    assert promise(run.trace()) == OUTSIDE
    assert promise(problem.run([*problem.plans(jobs=1)][-1]).trace()) == KEPT
