"""Exact translation of unified-planning's problems to PDDL, and of plans back.

Numbers are written as fractions; nothing is rounded. Names become valid and unique PDDL names.
Features without a counterpart are rejected; the message names them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import Any

from unified_planning.model import (
    DurativeAction,
    FNode,
    InstantaneousAction,
    Problem as UPProblem,
    TimeInterval,
    Timing,
)
from unified_planning.plans import ActionInstance, PlanKind, SequentialPlan, STNPlan, TimeTriggeredPlan

from ._answers import Verdict
from ._errors import UnsupportedError
from ._problem import Problem, read
from ._texts import AnyPlan
from ._up_bounds import Bounds
from ._up_expressions import Expressions, first_of
from ._up_timed import TimedEffects

COST = "action-costs"
"""Name of the additional fluent for the costs of actions."""


class Translation:
    """A problem of unified-planning, and its translation to PDDL.

    Raises:
        UnsupportedError: if the problem has a feature without a counterpart; the message names it.
    """

    def __init__(self, problem: UPProblem) -> None:
        if not isinstance(problem, UPProblem):
            raise UnsupportedError(
                f"a {type(problem).__name__} is not an action-based problem; only these are supported"
            )
        self.original = problem
        self._say = Expressions(problem, [COST])
        self._refuse_what_has_no_counterpart()
        for action in problem.actions:
            # Actions keep their names; additional facts get others.
            self._say.name("action", action)
        self._bounds = Bounds(problem, self._say)
        self._timed = TimedEffects(problem, self._say, self._bounds)
        self.domain_text = "\n".join(self._domain())
        self.problem_text = "\n".join(self._problem())
        self.actions: dict[str, Any] = {
            self._say.name("action", action): action for action in problem.actions
        }
        self.objects: dict[str, Any] = {
            self._say.name("object", it): it for it in problem.all_objects
        }
        self.timed_actions = self._timed.times()
        """The actions that represent timed effects, as in Elbowroom's plans, each with its time."""
        self.problem: Problem = read(self.domain_text, self.problem_text, epsilon=self._timed.epsilon)

    @property
    def rules(self) -> str:
        """The rules of unified-planning for valid plans: see :meth:`elbowroom.Problem.check`."""
        return "unified-planning-with-epsilon" if self.original.epsilon else "unified-planning"

    @property
    def is_temporal(self) -> bool:
        """``True`` if plans of the problem have times."""
        return bool(self.original.kind.has_continuous_time())

    def is_refuted_by(self, certificate: dict[str, Any]) -> bool:
        """``True`` if a certificate that no plan of the translation exists also holds for the problem itself.

        Without an ε, it holds if its proof relies neither on a separation of happenings nor on an order of simultaneous
        ones. This is so for certificates that only list the facts that can become true, without pairs or states.
        """
        return bool(self.original.epsilon) or not (certificate.get("apart") or certificate.get("closed"))

    # Refusals.

    def _refuse_what_has_no_counterpart(self) -> None:
        problem = self.original
        if problem.kind.has_discrete_time():
            raise UnsupportedError("discrete time is not supported: times of plans are arbitrary fractions")
        if problem.timed_goals:
            raise UnsupportedError("timed goals are not supported")
        if problem.trajectory_constraints or getattr(problem, "state_invariants", None):
            raise UnsupportedError("trajectory constraints are not supported")
        if problem.kind.has_undefined_initial_symbolic():
            raise UnsupportedError("facts whose initial truth is not defined are not supported")
        for what in ("processes", "events"):
            if getattr(problem, what, None):
                raise UnsupportedError(f"{what} are not supported")
        for fluent in problem.fluents:
            of = fluent.type
            if of.is_user_type():
                raise UnsupportedError(f"the object fluent {fluent.name} is not supported")

    # The domain.

    def _domain(self) -> Iterator[str]:
        problem = self.original
        yield "(define (domain d)"
        yield (
            "  (:requirements :typing :adl :negative-preconditions :fluents :durative-actions "
            ":duration-inequalities :timed-initial-literals :conditional-effects)"
        )
        types = [
            f"{self._say.name('type', it)} - {self._say.name('type', it.father) if it.father else 'object'}"
            for it in problem.user_types
        ]
        yield f"  (:types {' '.join(types)})"
        constants = [
            f"{self._say.name('object', it)} - {self._say.type_name(it.type)}" for it in problem.all_objects
        ]
        yield f"  (:constants {' '.join(constants)})"
        is_fact = [fluent for fluent in problem.fluents if fluent.type.is_bool_type()]
        predicates = [*(self._signature(fluent) for fluent in is_fact), *self._timed.predicates()]
        yield f"  (:predicates {' '.join(predicates)})"
        functions = [self._signature(fluent) for fluent in problem.fluents if fluent not in is_fact]
        if self._costs() is not None:
            functions.append(f"({COST})")
        yield f"  (:functions {' '.join(functions)})"
        for action in problem.actions:
            yield from self._action(action)
        yield from self._timed.domain()
        yield ")"

    def _signature(self, fluent: Any) -> str:
        return f"({self._say.name('fluent', fluent)} {self._say.declared(fluent.signature)})"

    def _action(self, action: Any) -> Iterator[str]:
        name = self._say.name("action", action)
        parameters = self._say.declared(action.parameters)
        if getattr(action, "simulated_effect", None) or getattr(action, "simulated_effects", None):
            raise UnsupportedError(f"the simulated effect of {action.name} is not supported")
        cost = self._cost(action)
        if isinstance(action, InstantaneousAction):
            conditions = " ".join(
                [
                    *(self._say.condition(it) for it in action.preconditions),
                    *self._bounds.before(action.effects),
                ]
            )
            effects = " ".join([*(self._say.effect(it) for it in action.effects), *cost])
            yield f"  (:action {name} :parameters ({parameters})"
            yield f"    :precondition (and {conditions})"
            yield f"    :effect (and {effects}))"
        elif isinstance(action, DurativeAction):
            if getattr(action, "continuous_effects", None):
                raise UnsupportedError(
                    f"the continuous effects of {action.name} are not supported"
                )
            yield f"  (:durative-action {name} :parameters ({parameters})"
            yield f"    :duration {self._duration(action.duration)}"
            conditions = " ".join(
                f"({when} {self._say.condition(it)})"
                for interval, found in action.conditions.items()
                for when in _whens(interval, action)
                for it in found
            )
            strict = " ".join(f"(at start {it})" for it in self._strict(action.duration))
            bounds = " ".join(
                f"({_when_of(timing, action)} {it})"
                for timing, found in action.effects.items()
                for it in self._bounds.before(found)
            )
            yield f"    :condition (and {conditions} {strict} {bounds})"
            effects = " ".join(
                f"({_when_of(timing, action)} {part})"
                for timing, found in action.effects.items()
                for it in found
                for part in _split(self._say.effect(it))
            )
            at_end = " ".join(f"(at end {it})" for it in cost)
            yield f"    :effect (and {effects} {at_end}))"
        else:
            raise UnsupportedError(f"the {type(action).__name__} {action.name} is not supported")

    def _duration(self, duration: Any) -> str:
        lower, upper = self._say.condition(duration.lower), self._say.condition(duration.upper)
        if lower == upper:
            return f"(= ?duration {lower})"
        return f"(and (>= ?duration {lower}) (<= ?duration {upper}))"

    def _strict(self, duration: Any) -> Iterator[str]:
        """Returns the ends of an open interval as conditions, because PDDL has no strict bounds on durations."""
        if duration.is_left_open():
            yield f"(> ?duration {self._say.condition(duration.lower)})"
        if duration.is_right_open():
            yield f"(< ?duration {self._say.condition(duration.upper)})"

    def _costs(self) -> dict[Any, FNode] | None:
        """Returns the cost of each action, if the metric is the sum of costs."""
        metrics = self.original.quality_metrics
        if len(metrics) != 1:
            return None
        metric = metrics[0]
        if metric.is_minimize_action_costs():
            return {action: metric.get_action_cost(action) for action in self.original.actions}
        if metric.is_minimize_sequential_plan_length():
            one = self.original.environment.expression_manager.Int(1)
            return dict.fromkeys(self.original.actions, one)
        return None

    def _cost(self, action: Any) -> list[str]:
        cost = (self._costs() or {}).get(action)
        if cost is None or (cost.is_constant() and cost.constant_value() == 0):
            return []
        return [f"(increase ({COST}) {self._say.condition(cost)})"]

    # The problem.

    def _problem(self) -> Iterator[str]:
        problem = self.original
        yield "(define (problem p) (:domain d)"
        yield "  (:init"
        for fluent, value in problem.initial_values.items():
            if value is None:
                continue
            target = self._say.target(fluent)
            if fluent.type.is_bool_type():
                if value.is_true():
                    yield f"    {target}"
            else:
                yield f"    (= {target} {self._say.condition(value)})"
        if self._costs() is not None:
            yield f"    (= ({COST}) 0)"
        for timed in self._timed.initials():
            yield f"    {timed}"
        yield "  )"
        goals = [self._say.condition(goal) for goal in problem.goals]
        goals += [*self._bounds.goals(), *self._timed.goals()]
        yield f"  (:goal (and {' '.join(goals)}))"
        metric = self._metric()
        if metric is not None:
            yield f"  (:metric {metric})"
        yield ")"

    def _metric(self) -> str | None:
        metrics = self.original.quality_metrics
        if len(metrics) != 1:
            return None
        metric = metrics[0]
        if self._costs() is not None:
            return f"minimize ({COST})"
        if metric.is_minimize_makespan():
            return "minimize (total-time)"
        if metric.is_minimize_expression_on_final_state():
            return f"minimize {self._say.condition(metric.expression)}"
        if metric.is_maximize_expression_on_final_state():
            return f"maximize {self._say.condition(metric.expression)}"
        # Other metrics rank plans and do not affect their validity.
        return None

    # Plans.

    def steps(self, plan: Any) -> list[tuple[Fraction, str, Fraction | None]]:
        """Converts a plan of unified-planning to (start, action, duration), with the actions for timed effects.

        Raises:
            UnsupportedError: if it is neither a sequential nor a time-triggered plan.
        """
        if isinstance(plan, SequentialPlan):
            # Actions follow each other at distances greater than any ε.
            gap = max(Fraction(1), 2 * Fraction(self.original.epsilon or 0))
            steps = [(gap * (i + 1), self.name_of(it), None) for i, it in enumerate(plan.actions)]
            return [*steps, *self._timed_steps()]
        if isinstance(plan, TimeTriggeredPlan):
            timed = [
                (Fraction(start), self.name_of(it), None if d is None else Fraction(d))
                for start, it, d in plan.timed_actions
            ]
            return [*timed, *self._timed_steps()]
        if isinstance(plan, STNPlan):
            converted = plan.convert_to(PlanKind.TIME_TRIGGERED_PLAN, self.original)
            return self.steps(converted)
        raise UnsupportedError(
            f"a {type(plan).__name__} is not supported; give a sequential or time-triggered plan"
        )

    def _timed_steps(self) -> list[tuple[Fraction, str, None]]:
        return [(time, name, None) for name, time in self.timed_actions.items()]

    def check(self, steps: AnyPlan) -> Verdict:
        """Validates a plan with exactly these numbers, by the rules of unified-planning."""
        return self.problem.check(steps, tolerance=0, rules=self.rules)

    def name_of(self, instance: ActionInstance) -> str:
        """Returns an action of the original problem in the notation of the translation: ``(drive r a b)``."""
        words = [self._say.name("action", instance.action)]
        words += [self._say.walk(it) for it in instance.actual_parameters]
        return f"({' '.join(words)})"

    def instance(self, action: str) -> ActionInstance:
        """Converts an action in the notation of the translation to one of the original problem."""
        name, *arguments = action.strip("()").split()
        manager = self.original.environment.expression_manager
        objects = [manager.ObjectExp(self.objects[it]) for it in arguments]
        return ActionInstance(self.actions[name], tuple(objects))

    def plan_back(self, steps: Iterable[Any]) -> Any:
        """Converts a plan of the translation to a sequential plan (without time) or a time-triggered one."""
        made = [
            (s.start, self.instance(s.action), s.duration)
            for s in steps
            if s.action not in self.timed_actions
        ]
        environment = self.original.environment
        if self.is_temporal:
            return TimeTriggeredPlan(made, environment)
        ordered = sorted(made, key=lambda it: it[0])
        return SequentialPlan([it for _, it, _ in ordered], environment)


def _split(text: str) -> Iterator[str]:
    """Iterates over the expressions of a text."""
    while text:
        first, text = first_of(text)
        yield first


def _point(timing: Timing, action: Any) -> str:
    if timing.delay != 0:
        raise UnsupportedError(
            f"{action.name} has a condition or effect at {timing}; only its start and its end are supported"
        )
    if timing.is_from_start() and not timing.is_global():
        return "start"
    if timing.is_from_end() and not timing.is_global():
        return "end"
    raise UnsupportedError(f"{action.name} refers to {timing}, which is not its own start or end")


def _when_of(timing: Timing, action: Any) -> str:
    return f"at {_point(timing, action)}"


def _whens(interval: TimeInterval, action: Any) -> list[str]:
    lower, upper = _point(interval.lower, action), _point(interval.upper, action)
    if lower == upper:
        return [f"at {lower}"]
    if (lower, upper) != ("start", "end"):
        raise UnsupportedError(f"{action.name} has a condition over {interval}")
    whens = ["over all"]
    if not interval.is_left_open():
        whens.insert(0, "at start")
    if not interval.is_right_open():
        whens.append("at end")
    return whens
