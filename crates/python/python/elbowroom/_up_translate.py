"""From unified-planning's problems to PDDL, exactly, and from plans back.

Numbers are written as fractions; nothing is rounded. Names become valid PDDL names, and no two the
same. What has no counterpart is refused by name.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import Any

from unified_planning.engines import CompilationKind
from unified_planning.engines.compilers.bounded_types_remover import BoundedTypesRemover
from unified_planning.model import (
    DurativeAction,
    FNode,
    InstantaneousAction,
    OperatorKind,
    Problem as UPProblem,
    TimeInterval,
    Timing,
)
from unified_planning.plans import ActionInstance, PlanKind, SequentialPlan, STNPlan, TimeTriggeredPlan

from ._errors import UnsupportedError
from ._problem import Problem, read

# Words that may not be names of anything.
_TAKEN = frozenset(
    "define domain problem requirements types constants predicates functions action process event "
    "durative-action derived parameters precondition condition effect duration vars init goal "
    "metric objects and or not imply exists forall when at over start end all increase decrease "
    "assign scale-up scale-down minimize maximize total-time object number either constraints "
    "always sometime within at-most-once preference is-violated undefined".split()
)
_INITIAL = {"type": "t", "object": "o", "fluent": "f", "action": "a"}

COST = "action-costs"
"""The fluent that is added where actions have costs."""


class Translation:
    """A problem of unified-planning, and what it is in PDDL.

    Raises:
        UnsupportedError: if the problem has something that has no counterpart; it says what.
    """

    def __init__(self, problem: UPProblem) -> None:
        if not isinstance(problem, UPProblem):
            raise UnsupportedError(
                f"a {type(problem).__name__} is no action-based problem; only these are supported"
            )
        self.original = problem
        if problem.kind.has_bounded_types():
            problem = _without_bounds(problem)
        self.source = problem
        self._names: dict[tuple[str, Any], str] = {}
        self._used = {COST, *_TAKEN}
        self._simplify = problem.environment.simplifier.simplify
        self._refuse_what_has_no_counterpart()
        self.domain_text = "\n".join(self._domain())
        self.problem_text = "\n".join(self._problem())
        self.actions: dict[str, Any] = {
            self.name("action", action): action for action in self.original.actions
        }
        self.objects: dict[str, Any] = {
            self.name("object", it): it for it in problem.all_objects
        }
        epsilon = problem.epsilon
        self.problem: Problem = read(
            self.domain_text, self.problem_text, epsilon="0.001" if not epsilon else epsilon
        )

    # Names.

    def name(self, kind: str, thing: Any) -> str:
        """The name of something, the same each time."""
        key = (kind, thing.name if hasattr(thing, "name") else str(thing))
        if key not in self._names:
            clean = re.sub(r"[^a-z0-9_-]", "_", key[1].lower())
            if not clean[:1].isalpha():
                clean = _INITIAL[kind] + "_" + clean
            name, number = clean, 1
            while name in self._used:
                number += 1
                name = f"{clean}_{number}"
            self._used.add(name)
            self._names[key] = name
        return self._names[key]

    def _type(self, of: Any) -> str:
        if not of.is_user_type():
            raise UnsupportedError(f"a parameter of type {of}; only user types are supported")
        return self.name("type", of)

    # Refusals.

    def _refuse_what_has_no_counterpart(self) -> None:
        problem = self.source
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
            if not of.is_bool_type() and (of.lower_bound, of.upper_bound) != (None, None):
                raise UnsupportedError(f"the bounds of {fluent.name} are not supported")

    # Expressions.

    def condition(self, expression: FNode, variables: dict[str, str] | None = None) -> str:
        """A condition, or a number, in PDDL."""
        return self._walk(self._simplify(expression), variables or {})

    def _walk(self, e: FNode, scope: dict[str, str]) -> str:
        args = [self._walk(arg, scope) for arg in e.args]
        if e.is_bool_constant():
            return "(and)" if e.is_true() else "(or)"
        if e.is_int_constant() or e.is_real_constant():
            return str(Fraction(e.constant_value()))
        if e.is_object_exp():
            return self.name("object", e.object())
        if e.is_parameter_exp():
            return "?" + _variable(e.parameter().name)
        if e.is_variable_exp():
            return "?" + _variable(e.variable().name)
        if e.is_fluent_exp():
            return f"({' '.join([self.name('fluent', e.fluent()), *args])})"
        if e.is_iff():
            return f"(and (imply {args[0]} {args[1]}) (imply {args[1]} {args[0]}))"
        if e.is_exists() or e.is_forall():
            bound = " ".join(f"?{_variable(v.name)} - {self._type(v.type)}" for v in e.variables())
            return f"({'exists' if e.is_exists() else 'forall'} ({bound}) {args[0]})"
        if e.is_equals() and any(arg.type.is_bool_type() for arg in e.args):
            raise UnsupportedError(f"an equality of truth values: {e}")
        operator = _OPERATORS.get(e.node_type)
        if operator is None:
            raise UnsupportedError(f"the expression {e} is not supported")
        if operator in ("+", "*"):
            folded = args[0]
            for arg in args[1:]:
                folded = f"({operator} {folded} {arg})"
            return folded
        return f"({operator} {' '.join(args)})"

    def effect(self, effect: Any) -> str:
        """An effect, with its condition and its forall."""
        target = self._walk(effect.fluent, {})
        made: list[str]
        if effect.is_increase() or effect.is_decrease():
            word = "increase" if effect.is_increase() else "decrease"
            made = [f"({word} {target} {self.condition(effect.value)})"]
        elif not effect.is_assignment():
            raise UnsupportedError(f"the effect {effect} is not supported")
        elif effect.fluent.type.is_bool_type():
            value = self._simplify(effect.value)
            if value.is_bool_constant():
                made = [target if value.is_true() else f"(not {target})"]
            else:
                truth = self._walk(value, {})
                made = [f"(when {truth} {target})", f"(when (not {truth}) (not {target}))"]
        else:
            made = [f"(assign {target} {self.condition(effect.value)})"]
        condition = self._simplify(effect.condition)
        if not condition.is_true():
            guard = self._walk(condition, {})
            made = [_when(guard, it) for it in made]
        if effect.forall:
            bound = " ".join(f"?{_variable(v.name)} - {self._type(v.type)}" for v in effect.forall)
            made = [f"(forall ({bound}) {it})" for it in made]
        return " ".join(made)

    # The domain.

    def _domain(self) -> Iterator[str]:
        problem = self.source
        yield "(define (domain d)"
        yield (
            "  (:requirements :typing :adl :negative-preconditions :fluents :durative-actions "
            ":duration-inequalities :timed-initial-literals :conditional-effects)"
        )
        types = [
            f"{self.name('type', it)} - {self.name('type', it.father) if it.father else 'object'}"
            for it in problem.user_types
        ]
        yield f"  (:types {' '.join(types)})"
        constants = [
            f"{self.name('object', it)} - {self._type(it.type)}" for it in problem.all_objects
        ]
        yield f"  (:constants {' '.join(constants)})"
        is_fact = [fluent for fluent in problem.fluents if fluent.type.is_bool_type()]
        predicates = [self._signature(fluent) for fluent in is_fact]
        yield f"  (:predicates {' '.join(predicates)})"
        functions = [self._signature(fluent) for fluent in problem.fluents if fluent not in is_fact]
        if self._costs() is not None:
            functions.append(f"({COST})")
        yield f"  (:functions {' '.join(functions)})"
        for action in problem.actions:
            yield from self._action(action)
        yield ")"

    def _signature(self, fluent: Any) -> str:
        parameters = [f"?{_variable(it.name)} - {self._type(it.type)}" for it in fluent.signature]
        return f"({' '.join([self.name('fluent', fluent), *parameters])})"

    def _action(self, action: Any) -> Iterator[str]:
        name = self.name("action", action)
        parameters = " ".join(
            f"?{_variable(it.name)} - {self._type(it.type)}" for it in action.parameters
        )
        if getattr(action, "simulated_effect", None) or getattr(action, "simulated_effects", None):
            raise UnsupportedError(f"the simulated effect of {action.name} is not supported")
        cost = self._cost(action)
        if isinstance(action, InstantaneousAction):
            conditions = " ".join(self.condition(it) for it in action.preconditions)
            effects = " ".join([*(self.effect(it) for it in action.effects), *cost])
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
                f"({when} {self.condition(it)})"
                for interval, found in action.conditions.items()
                for when in _whens(interval, action)
                for it in found
            )
            yield f"    :condition (and {conditions})"
            effects = " ".join(
                f"({_when_of(timing, action)} {part})"
                for timing, found in action.effects.items()
                for it in found
                for part in _split(self.effect(it))
            )
            at_end = " ".join(f"(at end {it})" for it in cost)
            yield f"    :effect (and {effects} {at_end}))"
        else:
            raise UnsupportedError(f"the {type(action).__name__} {action.name} is not supported")

    def _duration(self, duration: Any) -> str:
        lower, upper = self.condition(duration.lower), self.condition(duration.upper)
        is_open = duration.is_left_open(), duration.is_right_open()
        if lower == upper and not any(is_open):
            return f"(= ?duration {lower})"
        at_least, at_most = (">" if is_open[0] else ">="), ("<" if is_open[1] else "<=")
        return f"(and ({at_least} ?duration {lower}) ({at_most} ?duration {upper}))"

    def _costs(self) -> dict[Any, FNode] | None:
        """What each action costs, if that is the metric."""
        metrics = self.source.quality_metrics
        if len(metrics) != 1:
            return None
        metric = metrics[0]
        if metric.is_minimize_action_costs():
            return {action: metric.get_action_cost(action) for action in self.source.actions}
        if metric.is_minimize_sequential_plan_length():
            one = self.source.environment.expression_manager.Int(1)
            return dict.fromkeys(self.source.actions, one)
        return None

    def _cost(self, action: Any) -> list[str]:
        cost = (self._costs() or {}).get(action)
        if cost is None or (cost.is_constant() and cost.constant_value() == 0):
            return []
        return [f"(increase ({COST}) {self.condition(cost)})"]

    # The problem.

    def _problem(self) -> Iterator[str]:
        problem = self.source
        yield "(define (problem p) (:domain d)"
        yield "  (:init"
        for fluent, value in problem.initial_values.items():
            if value is None:
                continue
            target = self._walk(fluent, {})
            if fluent.type.is_bool_type():
                if value.is_true():
                    yield f"    {target}"
            else:
                yield f"    (= {target} {self.condition(value)})"
        if self._costs() is not None:
            yield f"    (= ({COST}) 0)"
        for timing, effects in problem.timed_effects.items():
            time = _absolute(timing)
            for effect in effects:
                yield f"    {self._timed(time, effect)}"
        yield "  )"
        goals = [self.condition(goal) for goal in problem.goals]
        yield f"  (:goal (and {' '.join(goals)}))"
        metric = self._metric()
        if metric is not None:
            yield f"  (:metric {metric})"
        yield ")"

    def _timed(self, time: Fraction, effect: Any) -> str:
        if not effect.is_assignment() or effect.forall or not effect.condition.is_true():
            raise UnsupportedError(
                f"the timed effect {effect} is not supported; only plain assignments are"
            )
        target, value = self._walk(effect.fluent, {}), self._simplify(effect.value)
        if not value.is_constant():
            raise UnsupportedError(f"the timed effect {effect} does not assign a constant")
        if not value.is_bool_constant():
            return f"(at {time} (= {target} {self._walk(value, {})}))"
        return f"(at {time} {target if value.is_true() else f'(not {target})'})"

    def _metric(self) -> str | None:
        metrics = self.source.quality_metrics
        if len(metrics) != 1:
            return None
        metric = metrics[0]
        if self._costs() is not None:
            return f"minimize ({COST})"
        if metric.is_minimize_makespan():
            return "minimize (total-time)"
        if metric.is_minimize_expression_on_final_state():
            return f"minimize {self.condition(metric.expression)}"
        if metric.is_maximize_expression_on_final_state():
            return f"maximize {self.condition(metric.expression)}"
        # The others say which plan is best, not which is one.
        return None

    # Plans.

    def steps(self, plan: Any) -> list[tuple[Fraction, str, Fraction | None]]:
        """A plan of unified-planning as (start, action, duration).

        Raises:
            UnsupportedError: if it is no sequential or time-triggered plan.
        """
        if isinstance(plan, SequentialPlan):
            # One after the other, further apart than any ε.
            gap = max(Fraction(1), 2 * Fraction(self.original.epsilon or 0))
            return [(gap * (i + 1), self._instance(it), None) for i, it in enumerate(plan.actions)]
        if isinstance(plan, TimeTriggeredPlan):
            return [
                (Fraction(start), self._instance(it), None if d is None else Fraction(d))
                for start, it, d in plan.timed_actions
            ]
        if isinstance(plan, STNPlan):
            converted = plan.convert_to(PlanKind.TIME_TRIGGERED_PLAN, self.original)
            return self.steps(converted)
        raise UnsupportedError(
            f"a {type(plan).__name__} is not supported; give a sequential or time-triggered plan"
        )

    def _instance(self, instance: ActionInstance) -> str:
        words = [self.name("action", instance.action)]
        words += [self._walk(it, {}) for it in instance.actual_parameters]
        return f"({' '.join(words)})"

    def instance(self, action: str) -> ActionInstance:
        """An action of ours as one of the original problem."""
        name, *arguments = action.strip("()").split()
        manager = self.original.environment.expression_manager
        objects = [manager.ObjectExp(self.objects[it]) for it in arguments]
        return ActionInstance(self.actions[name], tuple(objects))

    def plan_back(self, steps: Iterable[Any]) -> Any:
        """Our plan as a sequential plan, if the problem has no time, or a time-triggered one."""
        made = [(s.start, self.instance(s.action), s.duration) for s in steps]
        environment = self.original.environment
        if self.original.kind.has_continuous_time() or self.original.kind.has_discrete_time():
            return TimeTriggeredPlan(made, environment)
        ordered = sorted(made, key=lambda it: it[0])
        return SequentialPlan([it for _, it, _ in ordered], environment)


def _when(guard: str, change: str) -> str:
    """A change under one more condition."""
    inner = re.fullmatch(r"\(when (.*)\)", change)
    if inner is None:
        return f"(when {guard} {change})"
    # `(when A x)` under B: A is the first expression.
    first, rest = _first(inner.group(1))
    return f"(when (and {guard} {first}) {rest})"


def _first(text: str) -> tuple[str, str]:
    """The first expression of a text, and the rest."""
    depth = 0
    for index, letter in enumerate(text):
        depth += {"(": 1, ")": -1}.get(letter, 0)
        if depth == 0 and letter in ") ":
            return text[: index + 1].strip(), text[index + 1 :].strip()
    return text, ""


def _split(text: str) -> Iterator[str]:
    """The expressions of a text, one by one."""
    while text:
        first, text = _first(text)
        yield first


def _without_bounds(problem: UPProblem) -> UPProblem:
    """The problem with conditions instead of bounds of its numbers."""
    kind = CompilationKind.BOUNDED_TYPES_REMOVING
    try:
        return BoundedTypesRemover().compile(problem, kind).problem
    except Exception as error:
        raise UnsupportedError(
            f"bounds of numbers are not supported where unified-planning cannot take them away: {error}"
        ) from error


_OPERATORS = {
    OperatorKind.AND: "and",
    OperatorKind.OR: "or",
    OperatorKind.NOT: "not",
    OperatorKind.IMPLIES: "imply",
    OperatorKind.PLUS: "+",
    OperatorKind.MINUS: "-",
    OperatorKind.TIMES: "*",
    OperatorKind.DIV: "/",
    OperatorKind.LE: "<=",
    OperatorKind.LT: "<",
    OperatorKind.EQUALS: "=",
}


def _variable(name: str) -> str:
    return re.sub(r"[^a-zA-Z0-9_-]", "_", name) if name[:1].isalpha() else f"v_{name}"


def _point(timing: Timing, action: Any) -> str:
    if timing.delay != 0:
        raise UnsupportedError(
            f"{action.name} has something at {timing}; only its start and its end are supported"
        )
    if timing.is_from_start() and not timing.is_global():
        return "start"
    if timing.is_from_end() and not timing.is_global():
        return "end"
    raise UnsupportedError(f"{action.name} refers to {timing}, which is not its own time")


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


def _absolute(timing: Timing) -> Fraction:
    if not timing.is_from_start():
        raise UnsupportedError(f"a timed effect at {timing}, counted from the end")
    return Fraction(timing.delay)
