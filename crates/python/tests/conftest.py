"""Shared data of the tests: the cases of the repository."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import elbowroom

ROOT = Path(__file__).resolve().parents[3]
CASES = ROOT / "cases"
DELIVERY = CASES / "delivery"


@pytest.fixture
def problem() -> elbowroom.Problem:
    return elbowroom.read(DELIVERY / "domain.pddl", DELIVERY / "problem.pddl")


@pytest.fixture
def plan() -> Path:
    return DELIVERY / "plan.plan"


def names() -> dict[str, Any]:
    """Names that the examples in docstrings use."""
    domain = (DELIVERY / "domain.pddl").read_text()
    text = (DELIVERY / "problem.pddl").read_text()
    return {
        "elbowroom": elbowroom,
        "DOMAIN": domain,
        "PROBLEM": text,
        "PLAN": (DELIVERY / "plan.plan").read_text(),
        "problem": elbowroom.read(domain, text),
    }
