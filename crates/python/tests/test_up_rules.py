"""unified-planning: what the engines claim, accept and return, by unified-planning's own rules."""

from __future__ import annotations

import itertools
import random
import warnings
from fractions import Fraction
from typing import Any

import pytest

up = pytest.importorskip("unified_planning")
warnings.filterwarnings("ignore")

import elbowroom.up  # noqa: E402
from unified_planning.engines import PlanGenerationResultStatus as Status  # noqa: E402
from unified_planning.engines import SequentialPlanValidator  # noqa: E402
from unified_planning.exceptions import UPUsageError  # noqa: E402
from unified_planning.plans import ActionInstance, PlanKind, SequentialPlan, TimeTriggeredPlan  # noqa: E402
from unified_planning.shortcuts import (  # noqa: E402
    GE,
    And,
    DurativeAction,
    EndTiming,
    Equals,
    Exists,
    Forall,
    GlobalStartTiming,
    InstantaneousAction,
    LeftOpenTimeInterval,
    Not,
    Object,
    OneshotPlanner,
    Or,
    PlanValidator,
    Problem,
    RealType,
    StartTiming,
    TimeInterval,
    UserType,
    Variable,
)

up.shortcuts.get_environment().credits_stream = None


def solved(problem: Any, **params: Any) -> Any:
    assert elbowroom.up.ElbowroomPlanner.supports(problem.kind)
    with OneshotPlanner(name="elbowroom", params=params) as planner:
        return planner.solve(problem)


def verdicts(problem: Any, plan: Any) -> tuple[bool, bool]:
    """Returns the verdicts of the engine's validator and of unified-planning's own."""
    with PlanValidator(name="elbowroom-val") as own, PlanValidator(name="up_time_triggered_validator") as their:
        return bool(own.validate(problem, plan)), bool(their.validate(problem, plan))


def window(until: str) -> Any:
    """Two actions of 5, one after the other, before a window closes."""
    problem = Problem("window")
    is_open, first, done = (problem.add_fluent(name, default_initial_value=False) for name in ("w", "f", "d"))
    problem.set_initial_value(is_open, True)
    x, y = DurativeAction("x"), DurativeAction("y")
    for action in (x, y):
        action.set_fixed_duration(5)
        problem.add_action(action)
    x.add_effect(EndTiming(), first, True)
    y.add_condition(StartTiming(), first)
    y.add_condition(TimeInterval(StartTiming(), EndTiming()), is_open)
    y.add_effect(EndTiming(), done, True)
    problem.add_timed_effect(GlobalStartTiming(Fraction(until)), is_open, False)
    problem.add_goal(done)
    problem.x, problem.y = x, y
    return problem


def test_refutation_by_the_default_epsilon_is_not_proved_for_a_problem_without_one() -> None:
    problem = window("10.0005")
    steps = [(Fraction(0), ActionInstance(problem.x), Fraction(5)),
             (Fraction("5.0002"), ActionInstance(problem.y), Fraction(5))]  # fmt: skip
    assert verdicts(problem, TimeTriggeredPlan(steps)) == (True, True)
    assert solved(problem).status == Status.UNSOLVABLE_INCOMPLETELY
    # With an ε, there is no plan. Without one, there is none either, because the times alone do not
    # fit.
    problem.epsilon = Fraction(1, 1000)
    assert solved(problem).status == Status.UNSOLVABLE_PROVEN
    assert solved(window("9.9")).status == Status.UNSOLVABLE_PROVEN
    assert solved(window("11")).status == Status.SOLVED_SATISFICING


def test_actions_that_undo_each_other_at_one_time_are_not_refuted() -> None:
    problem = Problem("swap")
    p, q, x, y = (problem.add_fluent(name, default_initial_value=name in "pq") for name in "pqxy")
    steps = []
    for name, needs, spoils, makes in (("a", p, q, x), ("b", q, p, y)):
        action = DurativeAction(name)
        action.set_fixed_duration(1)
        action.add_condition(StartTiming(), needs)
        action.add_effect(StartTiming(), spoils, False)
        action.add_effect(EndTiming(), makes, True)
        problem.add_action(action)
        steps.append((Fraction(0), ActionInstance(action), Fraction(1)))
    problem.add_goal(x)
    problem.add_goal(y)
    # Simultaneous happenings read the state before; the planner keeps happenings apart.
    assert verdicts(problem, TimeTriggeredPlan(steps)) == (True, True)
    assert solved(problem).status != Status.UNSOLVABLE_PROVEN


@pytest.mark.parametrize(
    "interval", ["set_open_duration_interval", "set_left_open_duration_interval",
                 "set_right_open_duration_interval"]
)  # fmt: skip
def test_open_duration_interval_excludes_its_ends(interval: str) -> None:
    problem = Problem("open")
    done = problem.add_fluent("done", default_initial_value=False)
    action = DurativeAction("wait")
    getattr(action, interval)(3, 5)
    action.add_effect(EndTiming(), done, True)
    problem.add_action(action)
    problem.add_goal(done)
    result = solved(problem)
    assert result.status == Status.SOLVED_SATISFICING, result.log_messages
    assert verdicts(problem, result.plan) == (True, True)
    for duration in (Fraction(3), Fraction(4), Fraction(5)):
        plan = TimeTriggeredPlan([(Fraction(0), ActionInstance(action), duration)])
        own, their = verdicts(problem, plan)
        assert own == their, duration


def test_parameters_that_differ_in_case_or_blanks_stay_apart() -> None:
    problem = Problem("names")
    place = UserType("place")
    at = problem.add_fluent("at", default_initial_value=False, p=place, P=place)
    ready = problem.add_fluent("ready", default_initial_value=True, place_of=place)
    here, there = (problem.add_object(Object(name, place)) for name in ("here", "there"))
    for number, names in enumerate([("x", "X"), ("a b", "a_b"), ("1", "v_1"), ("ä", "ö")]):
        action = InstantaneousAction(f"put{number}", **{name: place for name in names})
        first, second = action.parameters
        # A variable shadows a parameter with the same name.
        bound = Variable(names[0], place)
        action.add_precondition(Exists(And(ready(bound), Not(Equals(bound, first))), bound))
        action.add_precondition(Forall(Or(ready(bound), Equals(bound, second)), bound))
        action.add_effect(at(first, second), True)
        problem.clear_actions()
        problem.add_action(action)
        problem.clear_goals()
        problem.add_goal(And(at(here, there), Not(at(there, here))))
        result = solved(problem)
        assert result.status == Status.SOLVED_SATISFICING, result.log_messages
        with PlanValidator(name="sequential_plan_validator") as validator:
            assert validator.validate(problem, result.plan)


def tank(rate: int) -> Any:
    """A tank that is filled by 4 at 2 and, with a loss, by 1 at 5; an action takes some of it at once."""
    problem = Problem("tank")
    level = problem.add_fluent("level", RealType(), default_initial_value=1)
    done = problem.add_fluent("done", default_initial_value=False)
    use = DurativeAction("use")
    use.set_fixed_duration(1)
    use.add_condition(StartTiming(), GE(level, rate))
    use.add_decrease_effect(StartTiming(), level, rate)
    use.add_effect(EndTiming(), done, True)
    problem.add_action(use)
    problem.add_increase_effect(GlobalStartTiming(2), level, 4)
    problem.add_increase_effect(GlobalStartTiming(5), level, 2)
    problem.add_decrease_effect(GlobalStartTiming(5), level, 1)
    problem.add_goal(done)
    problem.add_goal(GE(level, 6 - rate))
    return problem


@pytest.mark.parametrize(("rate", "earliest"), [(1, 0), (5, 2), (6, 5)])
def test_timed_increases_add_up(rate: int, earliest: int) -> None:
    problem = tank(rate)
    result = solved(problem)
    assert result.status == Status.SOLVED_SATISFICING, result.log_messages
    assert result.plan.timed_actions[0][0] >= earliest
    assert verdicts(problem, result.plan) == (True, True)
    assert solved(tank(7)).plan is None


def switches() -> Any:
    """Two actions that switch the same light off when they start."""
    problem = Problem("switches")
    lit = problem.add_fluent("lit", default_initial_value=True)
    actions = []
    for name in "ab":
        done = problem.add_fluent(f"done_{name}", default_initial_value=False)
        action = DurativeAction(name)
        action.set_closed_duration_interval(1, 2)
        action.add_effect(StartTiming(), lit, False)
        action.add_effect(EndTiming(), done, True)
        problem.add_action(action)
        problem.add_goal(done)
        actions.append(action)
    return problem, actions


@pytest.mark.parametrize("epsilon", [None, Fraction(1, 100)])
def test_equal_writes_at_one_time_are_refused_as_by_unified_planning(epsilon: Fraction | None) -> None:
    problem, (a, b) = switches()
    problem.epsilon = epsilon
    plan = TimeTriggeredPlan([(Fraction(0), ActionInstance(a), Fraction(1)),
                              (Fraction(0), ActionInstance(b), Fraction(2))])  # fmt: skip
    assert verdicts(problem, plan) == (False, False)
    result = solved(problem)
    assert result.status == Status.SOLVED_SATISFICING
    assert verdicts(problem, result.plan) == (True, True)


def oven(overlapping: bool) -> Any:
    problem = Problem("oven")
    count = problem.add_fluent("count", RealType(), default_initial_value=0)
    bake = DurativeAction("bake")
    bake.set_fixed_duration(3)
    bake.add_increase_effect(EndTiming(), count, 1)
    problem.add_action(bake)
    problem.add_goal(GE(count, 3))
    problem.self_overlapping = overlapping
    return problem


def test_action_does_not_overlap_with_itself_unless_the_problem_allows_it() -> None:
    for overlapping in (False, True):
        result = solved(oven(overlapping))
        assert result.status == Status.SOLVED_SATISFICING, result.log_messages
        times = sorted((start, start + length) for start, _, length in result.plan.timed_actions)
        if not overlapping:
            assert all(one[1] <= other[0] for one, other in itertools.pairwise(times))
        assert verdicts(oven(overlapping), result.plan) == (True, True)
    # Neither validator enforces this rule.
    problem = oven(False)
    bakes = [(Fraction(0), ActionInstance(problem.action("bake")), Fraction(3)) for _ in range(3)]
    assert verdicts(problem, TimeTriggeredPlan(bakes)) == (True, True)


def test_unknown_parameter_is_an_error() -> None:
    for wrong, advice in (("job", "did you mean 'jobs'"), ("time_limt", "'time_limit'"), ("x", "it has plan")):
        with pytest.raises(UPUsageError, match=advice):
            OneshotPlanner(name="elbowroom", params={wrong: 1})
    with pytest.raises(UPUsageError, match="elbowroom-val has no parameter 'jobs'"):
        PlanValidator(name="elbowroom-val", params={"jobs": 1})
    for name, value in (("jobs", -1), ("memory", 100), ("seed", "x"), ("time_limit", 0), ("jobs", 1.5)):
        with pytest.raises(UPUsageError, match=name):
            OneshotPlanner(name="elbowroom", params={name: value})


def test_parameters_reach_the_search() -> None:
    problem, _ = switches()
    plans = {str(solved(problem, jobs=jobs, seed=seed, memory=64 << 20).plan)
             for jobs, seed in ((1, 1), (2, "7"))}  # fmt: skip
    assert len(plans) == 1
    # A time limit that ends before the search begins.
    with OneshotPlanner(name="elbowroom", params={"time_limit": 1e-9}) as planner:
        assert planner.solve(hard()).status == Status.TIMEOUT
    with OneshotPlanner(name="elbowroom", params={"memory": 1 << 20, "jobs": 1}) as planner:
        assert planner.solve(hard(), timeout=60).status == Status.MEMOUT


def hard() -> Any:
    """A sliding-tile puzzle of 15 tiles, two of them exchanged: no plan, after a very long search."""
    problem = Problem("tiles")
    tile, place = UserType("tile"), UserType("place")
    at = problem.add_fluent("at", default_initial_value=False, t=tile, p=place)
    empty = problem.add_fluent("empty", default_initial_value=False, p=place)
    beside = problem.add_fluent("beside", default_initial_value=False, p=place, q=place)
    places = [problem.add_object(f"p{i}", place) for i in range(16)]
    tiles = [problem.add_object(f"t{i}", tile) for i in range(15)]
    for i, j in itertools.product(range(16), repeat=2):
        if abs(i // 4 - j // 4) + abs(i % 4 - j % 4) == 1:
            problem.set_initial_value(beside(places[i], places[j]), True)
    for i, it in enumerate(tiles):
        problem.set_initial_value(at(it, places[i]), True)
        problem.add_goal(at(it, places[{0: 1, 1: 0}.get(i, i)]))
    problem.set_initial_value(empty(places[15]), True)
    slide = InstantaneousAction("slide", t=tile, p=place, q=place)
    t, p, q = slide.parameters
    for needed in (at(t, p), empty(q), beside(p, q)):
        slide.add_precondition(needed)
    slide.add_effect(at(t, p), False)
    slide.add_effect(empty(q), False)
    slide.add_effect(at(t, q), True)
    slide.add_effect(empty(p), True)
    problem.add_action(slide)
    return problem


def drawn(number: random.Random) -> Any:
    """A small random temporal problem."""
    problem = Problem("drawn")
    facts = [problem.add_fluent(f"f{i}", default_initial_value=number.random() < 0.4) for i in range(4)]
    for i in range(number.randint(1, 3)):
        action = DurativeAction(f"a{i}")
        least = number.randint(0, 2)
        action.set_closed_duration_interval(least, least + number.randint(0, 2))
        for interval in (StartTiming(), EndTiming(), TimeInterval(StartTiming(), EndTiming()),
                         LeftOpenTimeInterval(StartTiming(), EndTiming())):  # fmt: skip
            if number.random() < 0.3:
                fact = number.choice(facts)
                action.add_condition(interval, fact if number.random() < 0.7 else Not(fact))
        for timing in (StartTiming(), EndTiming()):
            for fact in number.sample(facts, number.randint(0, 2)):
                action.add_effect(timing, fact, number.random() < 0.6)
        problem.add_action(action)
    for time in number.sample(range(1, 5), number.randint(0, 2)):
        problem.add_timed_effect(GlobalStartTiming(time), number.choice(facts), number.random() < 0.5)
    for fact in number.sample(facts, number.randint(1, 2)):
        problem.add_goal(fact if number.random() < 0.7 else Not(fact))
    problem.self_overlapping = number.random() < 0.5
    return problem


def test_random_problems_are_answered_by_unified_plannings_rules() -> None:
    number = random.Random(39)
    found = {status: 0 for status in Status}
    for _ in range(150):
        problem = drawn(number)
        result = solved(problem)
        found[result.status] += 1
        if result.plan is not None:
            assert all(verdicts(problem, result.plan)), (problem, result.plan)
            continue
        if result.status != Status.UNSOLVABLE_PROVEN:
            continue
        # No plan that is tried is valid by either validator.
        for _ in range(40):
            steps = []
            for _ in range(number.randint(1, 4)):
                action = number.choice(problem.actions)
                lower, upper = (int(it.constant_value()) for it in (action.duration.lower, action.duration.upper))
                start = Fraction(number.choice(["0", "0.0001", "1", "1.0001", "2", "3"]))
                steps.append((start, ActionInstance(action), Fraction(number.randint(lower, upper))))
            own, _ = verdicts(problem, TimeTriggeredPlan(steps))
            assert not own, (problem, steps)
    assert found[Status.SOLVED_SATISFICING] > 40 and found[Status.UNSOLVABLE_PROVEN] > 10, found


def judged_in_order(problem: Any, actions: list[Any]) -> tuple[bool, bool]:
    """Returns the verdicts of both validators on a plan without times."""
    plan = SequentialPlan([ActionInstance(action) for action in actions])
    with PlanValidator(name="elbowroom-val") as own, SequentialPlanValidator() as their:
        return bool(own.validate(problem, plan)), bool(their.validate(problem, plan))


@pytest.mark.parametrize("is_known", [True, False])
def test_type_without_objects_has_nothing_to_quantify_over(is_known: bool) -> None:
    problem = Problem("nobody")
    kind = UserType("nobody")
    done = problem.add_fluent("done", default_initial_value=False)
    if is_known:
        problem.add_fluent("seen", default_initial_value=False, who=kind)
    who = Variable("who", kind)
    go = InstantaneousAction("go")
    # The variable does not occur in them.
    go.add_precondition(Forall(Equals(1, 2), who))
    go.add_precondition(Not(Exists(Equals(1, 1), who)))
    go.add_effect(done, True)
    spoil = InstantaneousAction("spoil")
    spoil.add_effect(done, True)
    spoil.add_effect(done, False, forall=(who,))
    problem.add_actions([go, spoil])
    problem.add_goal(And(done, Forall(Not(done), who)))
    for action in (go, spoil):
        assert judged_in_order(problem, [action]) == (True, True)
    assert solved(problem).status == Status.SOLVED_SATISFICING


def test_number_assigned_for_each_object_is_no_conflict() -> None:
    problem = Problem("count")
    kind = UserType("item")
    problem.add_objects([Object(name, kind) for name in ("a", "b")])
    ready = problem.add_fluent("ready", default_initial_value=True, it=kind)
    number = problem.add_fluent("number", RealType(), default_initial_value=0)
    item = Variable("item", kind)
    go = InstantaneousAction("go")
    go.add_effect(number, 2, ready(item), (item,))
    problem.add_action(go)
    problem.add_goal(Equals(number, 2))
    assert judged_in_order(problem, [go]) == (True, True)
    assert solved(problem).status == Status.SOLVED_SATISFICING


@pytest.mark.parametrize("goals", [1, 2])
def test_stn_plan_has_actions_without_constraints(goals: int) -> None:
    problem = Problem("free")
    for number in range(2):
        done = problem.add_fluent(f"done{number}", default_initial_value=False)
        go = InstantaneousAction(f"go{number}")
        go.add_effect(done, True)
        problem.add_action(go)
        if number < goals:
            problem.add_goal(done)
    # Plans of the problem have times.
    rest = DurativeAction("rest")
    rest.set_fixed_duration(1)
    problem.add_action(rest)
    result = solved(problem, plan="stn")
    instances = {node.action_instance for node in result.plan.get_constraints()} | {
        node.action_instance for found in result.plan.get_constraints().values() for _, _, node in found
    }
    assert len(instances - {None}) == goals, result.plan
    with PlanValidator(name="elbowroom-val") as own:
        assert own.validate(problem, result.plan)
    assert all(verdicts(problem, result.plan.convert_to(PlanKind.TIME_TRIGGERED_PLAN, problem)))
