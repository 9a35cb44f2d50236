"""Elbowroom: computes how far a temporal plan may deviate, and executes it under that guarantee.

    >>> import elbowroom
    >>> problem = elbowroom.read(DOMAIN, PROBLEM)
    >>> envelope = problem.envelope(PLAN)
    >>> envelope.answer
    'envelope'

Times and amounts are exact: :class:`fractions.Fraction`, and ``math.inf`` where there is no limit.
Notebooks display answers as tables. ``.to_pandas()`` and ``.to_polars()`` convert them to data
frames, ``.plot()`` draws them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from . import _native
from ._answers import (
    Constraint,
    Envelope,
    Execution,
    Margin,
    NoPlan,
    Plan,
    QuantityInterval,
    Run,
    Step,
    Stn,
    Verdict,
    Violation,
)
from ._errors import (
    BugError,
    CampaignError,
    ClockWarning,
    DamagedWarning,
    Diagnostic,
    ElbowroomError,
    ExecutiveError,
    ExecutiveWarning,
    InterruptedWarning,
    PlannerError,
    ReadError,
    RequestError,
    UndecidedError,
    UnsupportedError,
    WorldError,
)
from ._execution import Cancel, Look, Over, Start, Stepped, Wait
from ._executive import Executive
from ._executive_answers import Doubt, Goal, PlannedAction, RunningAction, Status, WhatIf
from ._odds import ActionShare, FactShare, Happening, Loss, Odds, Sampled
from ._plans import Plans
from ._problem import Problem, read
from ._stepped import SteppedWorld
from ._stop import Stop
from ._tables import Progress
from ._world import Action, AsyncWorld, Observation, World, ended, fact, started, value
from .campaign import Comparison, Experiment, compare

__version__ = _native.__version__


class ExecutorInfo(NamedTuple):
    """Description of an available executor."""

    name: str
    argument: str | None
    """The meaning of the number after its name and a colon, if it takes one."""
    summary: str
    source: str


def executors() -> list[ExecutorInfo]:
    """Returns the executors that :meth:`Problem.run` supports.

    >>> import elbowroom
    >>> "guarded" in [executor.name for executor in elbowroom.executors()]
    True
    """
    return [ExecutorInfo(*it) for it in _native.executors()]


def envelope(problem: Any, plan: Any, **options: Any) -> Envelope:
    """Returns the envelope of a plan, also for problems and plans of unified-planning.

    Options and errors are those of :meth:`Problem.envelope`.
    """
    if isinstance(problem, Problem):
        return problem.envelope(plan, **options)
    from . import up

    return up.envelope(problem, plan, **options)


__all__ = [
    "Action",
    "ActionShare",
    "AsyncWorld",
    "BugError",
    "CampaignError",
    "Cancel",
    "ClockWarning",
    "Comparison",
    "Constraint",
    "DamagedWarning",
    "Diagnostic",
    "Doubt",
    "ElbowroomError",
    "Envelope",
    "Execution",
    "Executive",
    "ExecutiveError",
    "ExecutiveWarning",
    "ExecutorInfo",
    "Experiment",
    "FactShare",
    "Goal",
    "Happening",
    "InterruptedWarning",
    "Look",
    "Loss",
    "Margin",
    "NoPlan",
    "Observation",
    "Odds",
    "Over",
    "Plan",
    "PlannedAction",
    "PlannerError",
    "Plans",
    "Problem",
    "Progress",
    "QuantityInterval",
    "ReadError",
    "RequestError",
    "Run",
    "RunningAction",
    "Sampled",
    "Start",
    "Status",
    "Step",
    "Stepped",
    "SteppedWorld",
    "Stn",
    "Stop",
    "UndecidedError",
    "UnsupportedError",
    "Verdict",
    "Violation",
    "Wait",
    "WhatIf",
    "World",
    "WorldError",
    "compare",
    "ended",
    "envelope",
    "executors",
    "fact",
    "read",
    "started",
    "value",
]
