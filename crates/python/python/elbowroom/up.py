"""Engines for unified-planning; importing this module registers them.

    import elbowroom.up
    from unified_planning.shortcuts import OneshotPlanner, PlanValidator

    with OneshotPlanner(name="elbowroom") as planner: ...
    with PlanValidator(name="elbowroom-val") as validator: ...

``elbowroom`` is a one-shot planner, an anytime planner, and a planner for changing problems (``Replanner``).
``elbowroom-val`` validates sequential, time-triggered and STN plans exactly. Questions for which
unified-planning has no operation mode are functions here: :func:`envelope`, :func:`to_stn`, :func:`execute`.
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
    """Computes how far each quantity of a plan may deviate while the plan still works.

    Options are those of :meth:`elbowroom.Problem.envelope`; actions in them have their names in PDDL,
    which are those of the problem in lower case.

    Raises:
        UnsupportedError: if the problem or the plan has a feature without a counterpart in PDDL; the message names it.
    """
    translated = Translation(problem)
    return translated.problem.envelope(_given(translated, plan), **options)


def to_stn(problem: UPProblem, plan: Any) -> STNPlan:
    """Relaxes a plan to the necessary orders and bounds; durations have the domain's intervals.

    Unlike a conversion inside unified-planning, it does not freeze durations. An STN plan has no
    absolute times: times that timed effects fix are relative to the plan's start.

    Raises:
        UnsupportedError: if the problem or the plan has a feature without a counterpart in PDDL; the message names it.
        RequestError: if the plan does not work.
    """
    translated = Translation(problem)
    return stn_plan(translated, _given(translated, plan))


def _given(translated: Translation, plan: Any) -> Any:
    """Converts a plan of unified-planning to a form that :class:`~elbowroom.Problem` reads."""
    return stn_text(translated, plan) if isinstance(plan, STNPlan) else translated.steps(plan)


def execute(problem: UPProblem, plan: Any, **options: Any) -> Run:
    """Executes a plan; options are those of :meth:`elbowroom.Problem.run`.

    Raises:
        UnsupportedError: if the problem or the plan has a feature without a counterpart in PDDL; the message names it.
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
