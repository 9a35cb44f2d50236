"""The example of a stepped world in docs/reference/python.md is run."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

from conftest import ROOT

import elbowroom


def test_stepped_world_of_the_documentation_runs(problem: elbowroom.Problem, plan: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "reference" / "python.md").read_text(), re.DOTALL)
    (example,) = (block for block in blocks if "SteppedWorld" in block)
    names = {"problem": problem, "plan": plan}
    exec(example, names)
    run = names["run"]
    assert run.verdict == "goal-reached"
    first = min(run.rows(), key=lambda row: (row.start, row.action))
    assert (first.action, first.duration) == ("(drive rover depot shelf)", Fraction(9))
