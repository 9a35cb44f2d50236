"""unified-planning: timed effects and bounds of numbers, by unified-planning's own rules."""

from __future__ import annotations

import random
import warnings
from fractions import Fraction
from typing import Any

import pytest

up = pytest.importorskip("unified_planning")
warnings.filterwarnings("ignore")

import elbowroom  # noqa: E402
import elbowroom.up  # noqa: E402
from test_up_rules import solved, tank, verdicts  # noqa: E402
from unified_planning.engines import PlanGenerationResultStatus as Status  # noqa: E402
from unified_planning.engines import ValidationResultStatus  # noqa: E402
from unified_planning.plans import ActionInstance, PlanKind, SequentialPlan, TimeTriggeredPlan  # noqa: E402
from unified_planning.shortcuts import (  # noqa: E402
    GE,
    LE,
    ClosedTimeInterval,
    DurativeAction,
    EndTiming,
    Equals,
    GlobalStartTiming,
    InstantaneousAction,
    IntType,
    Not,
    Plus,
    Problem,
    RealType,
    StartTiming,
    Times,
)


def valve() -> Any:
    """An action that opens a valve, and a tank that is filled at 3 if the valve is open."""
    problem = Problem("valve")
    is_open = problem.add_fluent("open", default_initial_value=False)
    level = problem.add_fluent("level", RealType(), default_initial_value=1)
    turn = DurativeAction("turn")
    turn.set_closed_duration_interval(1, 2)
    turn.add_effect(EndTiming(), is_open, True)
    problem.add_action(turn)
    return problem, is_open, level


def turning(problem: Any, start: str, duration: str) -> TimeTriggeredPlan:
    turn = ActionInstance(problem.action("turn"))
    return TimeTriggeredPlan([(Fraction(start), turn, Fraction(duration))])


def test_timed_effect_has_a_condition_and_a_value_that_change() -> None:
    problem, is_open, level = valve()
    problem.add_timed_effect(GlobalStartTiming(3), level, Plus(level, Times(level, 2)), is_open)
    problem.add_goal(Equals(level, 3))
    result = solved(problem)
    assert result.status == Status.SOLVED_SATISFICING, result.log_messages
    # The effect reads the state before its time.
    for start, duration, expected in (("0", "1", True), ("2", "1", False), ("2.5", "1", False)):
        found = verdicts(problem, turning(problem, start, duration))
        assert found == (expected, expected), (start, duration)
    problem.clear_goals()
    problem.add_goal(Equals(level, 2))
    assert solved(problem).plan is None


def test_timed_effect_at_the_beginning_comes_after_what_is_read_there() -> None:
    problem, is_open, level = valve()
    power = problem.add_fluent("power", default_initial_value=False)
    problem.action("turn").add_condition(StartTiming(), power)
    problem.add_timed_effect(GlobalStartTiming(0), power, True)
    problem.add_goal(is_open)
    result = solved(problem)
    assert result.plan.timed_actions[0][0] > 0
    assert verdicts(problem, result.plan) == (True, True)
    assert verdicts(problem, turning(problem, "0", "1")) == (False, False)


def test_timed_effects_of_one_time_are_combined_as_by_unified_planning() -> None:
    problem, is_open, level = valve()
    # `True` takes precedence, and increases add up.
    for value in (True, False):
        problem.add_timed_effect(GlobalStartTiming(5), is_open, value)
    problem.add_increase_effect(GlobalStartTiming(5), level, 2)
    problem.add_decrease_effect(GlobalStartTiming(5), level, 1)
    problem.add_goal(is_open)
    problem.add_goal(Equals(level, 2))
    assert verdicts(problem, TimeTriggeredPlan([])) == (True, True)
    assert verdicts(problem, turning(problem, "4", "1")) == (False, False)
    assert solved(problem).status == Status.SOLVED_SATISFICING


def test_timed_effects_may_be_close_to_each_other() -> None:
    problem, is_open, level = valve()
    for time in ("0", "0.0001", "0.0002", "5"):
        problem.add_timed_effect(GlobalStartTiming(Fraction(time)), level, Plus(level, 1))
    problem.add_goal(Equals(level, 5))
    result = solved(problem)
    assert result.status == Status.SOLVED_SATISFICING, result.log_messages
    assert verdicts(problem, result.plan) == (True, True)
    # They cannot respect the problem's ε, which applies to actions.
    problem.epsilon = Fraction(1, 100)
    assert solved(problem).status == Status.UNSUPPORTED_PROBLEM
    problem.epsilon = Fraction(1, 10_000)
    assert solved(problem).status == Status.SOLVED_SATISFICING


def test_actions_for_timed_effects_are_in_no_plan_that_is_returned() -> None:
    problem = tank(5)
    plan = solved(problem).plan
    assert [it.action.name for _, it, _ in plan.timed_actions] == ["use"]
    stn = elbowroom.up.to_stn(problem, plan)
    assert stn.kind == PlanKind.STN_PLAN
    assert {str(node.action_instance) for node in stn.get_constraints()} <= {"None", "use"}
    (start,) = [
        lower
        for first, found in stn.get_constraints().items()
        for lower, _, second in found
        if first.action_instance is None and second.action_instance is not None and lower
    ]
    assert start > 2
    assert elbowroom.up.execute(problem, plan).verdict == "goal-reached"


def jars(lower: int | None, upper: int | None) -> Any:
    """A jar with 1, that is filled by 2 and then drained by 2, if it keeps its bounds."""
    problem = Problem("jars")
    jar = problem.add_fluent("jar", IntType(lower, upper), default_initial_value=1)
    drained = problem.add_fluent("drained", default_initial_value=False)
    fill, drain = DurativeAction("fill"), DurativeAction("drain")
    fill.set_fixed_duration(2)
    fill.add_increase_effect(EndTiming(), jar, 2)
    drain.set_fixed_duration(2)
    drain.add_decrease_effect(StartTiming(), jar, 2)
    drain.add_effect(EndTiming(), drained, True)
    # Its condition is false, but it remains an action of the problem.
    never = InstantaneousAction("never")
    never.add_precondition(False)
    problem.add_actions([fill, drain, never])
    problem.add_goal(drained)
    return problem


def jar_plan(problem: Any, *steps: tuple[int, str]) -> TimeTriggeredPlan:
    return TimeTriggeredPlan([
        (Fraction(time), ActionInstance(problem.action(name)), None if name == "never" else Fraction(2))
        for time, name in steps
    ])  # fmt: skip


def test_planner_keeps_numbers_between_their_bounds() -> None:
    for lower, upper, expected in ((0, 3, ["fill", "drain"]), (None, 3, ["drain"]), (None, None, ["drain"])):
        problem = jars(lower, upper)
        result = solved(problem)
        assert result.status == Status.SOLVED_SATISFICING, result.log_messages
        steps = sorted(result.plan.timed_actions, key=lambda it: it[0])
        assert [it.action.name for _, it, _ in steps] == expected
        assert elbowroom.up.ElbowroomValidator().validate(problem, result.plan)
    assert solved(jars(0, 2)).plan is None


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        ([(0, "fill"), (2, "drain")], True),
        # A change and its opposite at one time.
        ([(0, "fill"), (3, "fill"), (5, "drain")], True),
        # Too little at first, too much in between and in the end.
        ([(0, "drain"), (3, "fill")], False),
        ([(0, "fill"), (3, "fill"), (6, "drain")], False),
        ([(0, "fill"), (3, "drain"), (6, "fill"), (9, "fill")], False),
        ([(0, "fill"), (3, "drain"), (5, "never")], False),
    ],
)
def test_numbers_are_judged_by_their_bounds(steps: list[tuple[int, str]], expected: bool) -> None:
    problem = jars(0, 3)
    assert bool(elbowroom.up.ElbowroomValidator().validate(problem, jar_plan(problem, *steps))) == expected


def test_what_the_kind_does_not_show_gets_a_status_and_no_exception() -> None:
    problem, is_open, _ = valve()
    problem.action("turn").add_condition(ClosedTimeInterval(GlobalStartTiming(), EndTiming()), Not(is_open))
    assert solved(problem).status == Status.UNSUPPORTED_PROBLEM
    judged = elbowroom.up.ElbowroomValidator().validate(problem, turning(problem, "0", "1"))
    assert judged.status == ValidationResultStatus.UNKNOWN and judged.log_messages


def test_discrete_time_is_not_supported() -> None:
    problem, _, _ = valve()
    problem.discrete_time = True
    assert not elbowroom.up.ElbowroomPlanner.supports(problem.kind)
    with pytest.raises(elbowroom.UnsupportedError, match="discrete time"):
        elbowroom.up.Translation(problem)


def drawn(number: random.Random) -> Any:
    """A small random problem with timed effects of all kinds, without goals."""
    problem = Problem("drawn")
    facts = [problem.add_fluent(f"f{i}", default_initial_value=number.random() < 0.5) for i in range(3)]
    counts = [problem.add_fluent(f"n{i}", RealType(), default_initial_value=number.randint(0, 2)) for i in range(2)]

    def condition() -> Any:
        fact, count = number.choice(facts), number.choice(counts)
        return number.choice([fact, fact, Not(fact), GE(count, 1), LE(count, 2)])

    def add(owner: Any, timing: Any, may_increase: Any) -> None:
        guard = condition() if number.random() < 0.3 else True
        count, other = number.choice(counts), number.choice(counts)
        value = number.choice([0, 1, Fraction(1, 2), other])
        try:
            if number.random() < 0.5:
                owner(timing, number.choice(facts), number.choice([True, False, condition()]), guard)
            elif number.random() < 0.5:
                owner(timing, count, value, guard)
            else:
                may_increase(timing, count, value, guard)
        except up.exceptions.UPConflictingEffectsException:
            pass

    for i in range(number.randint(1, 3)):
        action = DurativeAction(f"a{i}")
        action.set_closed_duration_interval(0, 3)
        for interval in (StartTiming(), EndTiming(), ClosedTimeInterval(StartTiming(), EndTiming())):
            if number.random() < 0.25:
                action.add_condition(interval, condition())
        for _ in range(number.randint(1, 3)):
            add(action.add_effect, number.choice([StartTiming(), EndTiming()]), action.add_increase_effect)
        problem.add_action(action)
    for _ in range(number.randint(0, 3)):
        time = GlobalStartTiming(number.choice([0, 1, 2, Fraction("1.0005")]))
        add(problem.add_timed_effect, time, problem.add_increase_effect)
    problem.self_overlapping = True
    return problem


def guessed(problem: Any, number: random.Random) -> TimeTriggeredPlan:
    return TimeTriggeredPlan([
        (Fraction(number.choice(["0", "0.0001", "1", "0.9999", "1.0001", "2"])),
         ActionInstance(number.choice(problem.actions)),
         Fraction(number.choice(["0", "0.0002", "0.9999", "1", "2"])))
        for _ in range(number.randint(0, 3))
    ])  # fmt: skip


def test_random_plans_get_the_verdict_of_unified_planning() -> None:
    number = random.Random(13)
    found = [0, 0]
    for _ in range(60):
        problem = drawn(number)
        for _ in range(8):
            plan = guessed(problem, number)
            own, their = verdicts(problem, plan)
            assert own == their, (problem, plan)
            found[own] += 1
    assert min(found) > 100, found


def test_what_a_valid_plan_reaches_is_never_refuted() -> None:
    number = random.Random(31)
    judge = up.engines.plan_validator.TimeTriggeredPlanValidator()
    solutions = 0
    for _ in range(80):
        problem = drawn(number)
        judged = judge.validate(problem, guessed(problem, number))
        if not judged:
            continue
        last = judged.trace[max(judged.trace)]
        for fluent in problem.initial_values:
            value = last.get_value(fluent)
            if fluent.type.is_bool_type():
                problem.add_goal(fluent if value.is_true() else Not(fluent))
            else:
                problem.add_goal(Equals(fluent, value))
        result = solved(problem, jobs=1, memory=8 << 20)
        assert result.status not in (Status.UNSOLVABLE_PROVEN, Status.UNSUPPORTED_PROBLEM), problem
        if result.plan is not None:
            solutions += 1
            assert verdicts(problem, result.plan) == (True, True), (problem, result.plan)
    assert solutions > 20


def test_sequential_plans_keep_bounds_as_in_unified_planning() -> None:
    problem = Problem("stock")
    stock = problem.add_fluent("stock", IntType(0, 2), default_initial_value=1)
    more, most, less = (InstantaneousAction(name) for name in ("more", "most", "less"))
    more.add_increase_effect(stock, 1)
    most.add_increase_effect(stock, 2)
    less.add_decrease_effect(stock, 1)
    problem.add_actions([more, most, less])
    number = random.Random(7)
    found = [0, 0]
    for _ in range(60):
        plan = SequentialPlan([ActionInstance(number.choice(problem.actions)) for _ in range(number.randint(0, 4))])
        with up.shortcuts.PlanValidator(name="sequential_plan_validator") as validator:
            their = bool(validator.validate(problem, plan))
        assert bool(elbowroom.up.ElbowroomValidator().validate(problem, plan)) == their, plan
        found[their] += 1
    assert min(found) > 10
