"""Measures what docs/reference/python.md claims: measure.py [up|world]."""

from __future__ import annotations

import resource
import sys
import time
import warnings
from collections.abc import Callable
from typing import Any

import elbowroom

warnings.filterwarnings("ignore")


def seconds(work: Callable[[], Any], times: int = 5) -> float:
    """The best of some tries."""
    best = float("inf")
    for _ in range(times):
        begun = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - begun)
    return best


def compare_with_unified_planning(actions: int = 400) -> None:
    """A chain of durative actions: judged, and made a network, by both."""
    from unified_planning import shortcuts as up
    from unified_planning.engines.plan_validator import TimeTriggeredPlanValidator
    from unified_planning.plans import PlanKind, TimeTriggeredPlan
    from unified_planning.plans.plan import ActionInstance

    from elbowroom.up import ElbowroomValidator, to_stn

    up.get_environment().credits_stream = None
    problem = up.Problem("chain")
    place = up.UserType("Place")
    at = problem.add_fluent("at", default_initial_value=False, p=place)
    go = up.DurativeAction("go", here=place, there=place)
    go.set_closed_duration_interval(1, 3)
    go.add_condition(up.StartTiming(), at(go.here))
    go.add_effect(up.StartTiming(), at(go.here), False)
    go.add_effect(up.EndTiming(), at(go.there), True)
    problem.add_action(go)
    places = [problem.add_object(f"p{i}", place) for i in range(2)]
    problem.set_initial_value(at(places[0]), True)
    problem.add_goal(at(places[actions % 2]))
    object_ = problem.environment.expression_manager.ObjectExp
    steps: list[Any] = [
        (
            _fraction(3 * i),
            ActionInstance(go, (object_(places[i % 2]), object_(places[(i + 1) % 2]))),
            _fraction(2),
        )
        for i in range(actions)
    ]
    plan = TimeTriggeredPlan(steps)
    for name, validator in (("elbowroom-val", ElbowroomValidator()), ("unified-planning", TimeTriggeredPlanValidator())):
        took = seconds(lambda v=validator: v.validate(problem, plan), 3)  # type: ignore[misc]
        print(f"{name}: {actions} actions judged in {1000 * took:.1f} ms")
    ours = seconds(lambda: to_stn(problem, plan), 3)
    theirs = seconds(lambda: plan.convert_to(PlanKind.STN_PLAN, problem), 1)
    print(f"network: {1000 * ours:.1f} ms, unified-planning {1000 * theirs:.1f} ms")


def _fraction(number: int) -> Any:
    from fractions import Fraction

    return Fraction(number)


class Chatty(elbowroom.World):
    """Reports a fact in each second before it lets the one action end."""

    def __init__(self, events: int) -> None:
        self.left, self.action = events, None

    def start(self, action: elbowroom.Action) -> None:
        self.action, self.is_told = action, False

    def wait(self, until: Any) -> Any:
        if not self.is_told:
            self.is_told = True
            return self.action.now, [elbowroom.started(self.action, self.action.now)]
        self.left -= 1
        now = self.action.now + (100_000 - self.left)
        if self.left <= 0:
            return now, [elbowroom.ended(self.action, now)]
        return now, [elbowroom.fact("(seen)", self.left % 2 == 0, now)]


def world(events: int = 100_000) -> None:
    """A run of so many events in a world in Python."""
    problem = elbowroom.read(
        "(define (domain d) (:requirements :durative-actions) (:predicates (done) (seen))"
        "(:durative-action a :parameters () :duration (>= ?duration 1) :effect (at end (done))))",
        "(define (problem q) (:domain d) (:init) (:goal (done)))",
    )
    begun = time.perf_counter()
    run = problem.run(
        f"0: (a) [{events}]", world=Chatty(events), executor="stn", trace=False,
        time_limit=10 * events,
    )  # fmt: skip
    took = time.perf_counter() - begun
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{run.verdict} at {run.time}: {events} events in {took:.1f} s, {memory:.0f} MB at most")


if __name__ == "__main__":
    {"up": compare_with_unified_planning, "world": world}[sys.argv[1]]()
