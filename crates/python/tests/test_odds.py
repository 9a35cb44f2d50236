"""Success probabilities of plans."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from conftest import ROOT

import elbowroom

FOLDER = ROOT / "experiments" / "olisipo"
LIKELY = """format = "elbowroom-likelihoods"
version = 1
defaults = { becomes_true = 0.0, becomes_false = 0.0, start = 0.5, effect = 0.9 }
facts.whole.becomes_false = 0.25
"""


@pytest.fixture
def lamp() -> elbowroom.Problem:
    return elbowroom.read(
        """(define (domain lamp) (:predicates (whole) (lit))
        (:durative-action screw :parameters () :duration (= ?duration 5)
          :condition (over all (whole)) :effect (at end (lit))))""",
        "(define (problem evening) (:domain lamp) (:init (whole)) (:goal (lit)))",
    )


def test_a_published_value_is_found() -> None:
    problem = elbowroom.read(FOLDER / "sf3-domain.pddl", FOLDER / "sf3-problem.pddl")
    odds = problem.odds(likelihoods=FOLDER / "sf3-p1.toml")
    assert odds.is_best and odds.is_proven
    # The result of the authors' code, to four digits.
    assert abs(odds.probability - 0.1575) < 0.00006
    assert abs(odds.probability + sum(loss.mass for loss in odds.rows()) - 1) < 1e-9
    gains = odds.gains
    assert gains["as_the_state_asks"] is not None and gains["any_action"] is not None
    assert odds.probability < gains["as_the_state_asks"] <= gains["any_action"] + 1e-12


def test_the_odds_are_tables(lamp: elbowroom.Problem) -> None:
    odds = lamp.odds("0: (screw) [5]", likelihoods=LIKELY)
    assert odds and odds.probability == pytest.approx(0.5 * 0.75 * 0.9)
    assert [it.kind for it in odds.happenings] == ["start", "end"]
    assert odds.actions[0].if_certain > odds.probability
    assert odds.facts[0].fact == "(whole)"
    assert {loss.reason for loss in odds.rows()} == {"start", "throughout", "goal"}
    assert odds._repr_html_().startswith("<table>")
    frame = pytest.importorskip("pandas") and odds.to_pandas()
    assert frame["mass"].sum() == pytest.approx(1 - odds.probability)


def test_the_plan_is_executed_in_samples_of_a_world(lamp: elbowroom.Problem) -> None:
    world = """format = "elbowroom-world"
version = 1
[[failure]]
action = "screw"
probability = 0.5
"""
    odds = lamp.odds("0: (screw) [5]", likelihoods=LIKELY, world=world, executors=["live"], samples=50)
    assert [it.executor for it in odds.executed] == ["live", "live"]
    without, _ = odds.executed
    assert without.samples == 50 and without.interval is not None
    low, high = without.interval
    assert low < 0.5 < high


def test_all_orders_are_drawn(lamp: elbowroom.Problem) -> None:
    odds = lamp.odds("0: (screw) [5]", likelihoods=LIKELY, lattice=True)
    assert odds.lattice_svg is not None and odds.lattice_svg.startswith("<svg")
    assert lamp.odds("0: (screw) [5]", likelihoods=LIKELY).lattice_svg is None


def test_what_has_no_odds_says_why(lamp: elbowroom.Problem) -> None:
    odds = lamp.odds("", likelihoods=LIKELY)
    assert not odds and odds.answer == "invalid" and odds.why_not
    assert odds._repr_html_() and odds.rows() == []
    with pytest.raises(elbowroom.ReadError) as wrong:
        lamp.odds("0: (screw) [5]", likelihoods="format = 1\n")
    assert wrong.value.diagnostics[0].line == 1
    with pytest.raises(elbowroom.RequestError, match="adaptable"):
        lamp.odds("0: (screw) [5]", likelihoods=LIKELY, executors=["nobody"])


def test_the_command_of_the_package_gives_the_same_answer(lamp: elbowroom.Problem) -> None:
    program = shutil.which("elbowroom", path=Path(sys.executable).parent)
    command = [program] if program else [sys.executable, "-m", "elbowroom"]
    # Also works if the package is not installed.
    environment = {**os.environ, "PYTHONPATH": str(Path(elbowroom.__file__).parents[1])}

    def run(arguments: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
        line = [*command, *arguments]
        return subprocess.run(
            line, cwd=folder, env=environment, capture_output=True, text=True, check=False
        )

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        texts = {
            "d.pddl": lamp.domain_text, "p.pddl": lamp.problem_text, "p.plan": "0: (screw) [5]\n",
            "l.toml": LIKELY,
        }  # fmt: skip
        for file, text in texts.items():
            (folder / file).write_text(text)
        asked = ["odds", "d.pddl", "p.pddl", "p.plan", "--likelihoods", "l.toml", "--json"]
        done = run(asked, folder)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["order"]["probability"] == pytest.approx(
            lamp.odds("0: (screw) [5]", likelihoods=LIKELY).probability
        )
        wrong = run(["check", "d.pddl", "none.pddl"], folder)
    assert wrong.returncode == 2 and "none.pddl" in wrong.stderr
