"""Engines for unified-planning; importing this module registers them.

    import elbowroom.up
    from unified_planning.shortcuts import OneshotPlanner, PlanValidator

    with OneshotPlanner(name="elbowroom") as planner: ...
    with PlanValidator(name="elbowroom-val") as validator: ...

``elbowroom`` plans once, anytime, and again and again as the problem changes (``Replanner``);
``elbowroom-val`` judges sequential, time-triggered and STN plans exactly. What unified-planning has
no mode for are functions here: :func:`envelope`, :func:`to_stn`, :func:`execute`.
"""

from __future__ import annotations

from typing import Any

from unified_planning.environment import get_environment
from unified_planning.model import Problem as UPProblem
from unified_planning.plans import STNPlan

from ._answers import Envelope, Run
from ._up_engines import ElbowroomPlanner, ElbowroomValidator
from ._up_stn import stn_plan, stn_text
from ._up_translate import Translation


def envelope(problem: UPProblem, plan: Any, **options: Any) -> Envelope:
    """How far each quantity of a plan may deviate while the plan still works.

    Options are those of :meth:`elbowroom.Problem.envelope`; actions in them have their names in PDDL,
    which are those of the problem in lower case.

    Raises:
        UnsupportedError: if the problem or the plan has what has no counterpart; it says what.
    """
    translated = Translation(problem)
    return translated.problem.envelope(_given(translated, plan), **options)


def to_stn(problem: UPProblem, plan: Any) -> STNPlan:
    """A plan with only the orders and bounds that it needs; durations have the domain's intervals.

    Unlike a conversion inside unified-planning, it does not freeze durations. An STN plan has no
    absolute times: what is fixed by timed effects counts from the plan's start.

    Raises:
        UnsupportedError: if the problem or the plan has what has no counterpart; it says what.
        RequestError: if the plan does not work.
    """
    translated = Translation(problem)
    return stn_plan(translated, _given(translated, plan))


def _given(translated: Translation, plan: Any) -> Any:
    """A plan of unified-planning's in a form that a problem of ours reads."""
    return stn_text(translated, plan) if isinstance(plan, STNPlan) else translated.steps(plan)


def execute(problem: UPProblem, plan: Any, **options: Any) -> Run:
    """Executes a plan; options are those of :meth:`elbowroom.Problem.run`.

    Raises:
        UnsupportedError: if the problem or the plan has what has no counterpart; it says what.
    """
    translated = Translation(problem)
    return translated.problem.run(translated.steps(plan), **options)


def register(environment: Any = None) -> None:
    """Adds the engines to an environment; done for the global one when this module is imported."""
    factory = (environment or get_environment()).factory
    for name, of in (("elbowroom", "ElbowroomPlanner"), ("elbowroom-val", "ElbowroomValidator")):
        if name not in factory.engines:
            factory.add_engine(name, __name__, of)


__all__ = ["ElbowroomPlanner", "ElbowroomValidator", "Translation", "envelope", "execute",
           "register", "to_stn"]  # fmt: skip
register()
