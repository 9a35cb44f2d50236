"""unified-planning: its own test cases as a conformance suite."""

from __future__ import annotations

import itertools
import warnings
from fractions import Fraction
from typing import Any

import pytest

up = pytest.importorskip("unified_planning")
warnings.filterwarnings("ignore")

import elbowroom  # noqa: E402
import elbowroom.up  # noqa: E402
from unified_planning.engines import PlanGenerationResultStatus as Status  # noqa: E402
from unified_planning.engines import ValidationResultStatus  # noqa: E402
from unified_planning.model import Problem  # noqa: E402
from unified_planning.plans import PlanKind  # noqa: E402
from unified_planning.shortcuts import (  # noqa: E402
    AnytimePlanner,
    OneshotPlanner,
    PlanValidator,
    Replanner,
)
from unified_planning.test.examples import get_example_problems  # noqa: E402

up.shortcuts.get_environment().credits_stream = None
CASES: dict[str, Any] = get_example_problems()


def supported(engine: Any, case: Any) -> bool:
    return isinstance(case.problem, Problem) and engine.supports(case.problem.kind)


JUDGED = [
    (name, case, plan, expected)
    for name, case in CASES.items()
    if supported(elbowroom.up.ElbowroomValidator, case)
    for expected, plans in ((True, case.valid_plans), (False, case.invalid_plans))
    for plan in plans
    if elbowroom.up.ElbowroomValidator.supports_plan(plan.kind)
]
# Cases with a plan that is declared valid, but misses the goal. unified-planning's validator gives the
# expected verdict.
MISTAKEN = {"basic_undef_numeric"}
SOLVED = [name for name, case in CASES.items() if supported(elbowroom.up.ElbowroomPlanner, case)]


def test_there_are_cases() -> None:
    assert (len(CASES), len(JUDGED), len(SOLVED)) >= (66, 51, 36)


@pytest.mark.parametrize(
    ("name", "case", "plan", "expected"), JUDGED, ids=[f"{it[0]}-{i}" for i, it in enumerate(JUDGED)]
)
def test_plans_are_judged_as_the_case_says(name: str, case: Any, plan: Any, expected: bool) -> None:
    with PlanValidator(name="elbowroom-val") as validator:
        result = validator.validate(case.problem, plan)
    found = result.status == ValidationResultStatus.VALID
    if name in MISTAKEN:
        with PlanValidator(name="sequential_plan_validator") as validator:
            expected = bool(validator.validate(case.problem, plan))
    assert found == expected, result.log_messages


@pytest.mark.parametrize("name", SOLVED)
def test_a_case_is_solved_and_the_plan_is_valid(name: str) -> None:
    case = CASES[name]
    with OneshotPlanner(name="elbowroom") as planner:
        result = planner.solve(case.problem)
    if not case.solvable:
        assert result.status in (Status.UNSOLVABLE_PROVEN, Status.UNSOLVABLE_INCOMPLETELY)
        return
    assert result.status == Status.SOLVED_SATISFICING, result.log_messages
    with PlanValidator(name="elbowroom-val") as validator:
        assert validator.validate(case.problem, result.plan)


@pytest.mark.parametrize("name", sorted(set(CASES) - set(SOLVED)))
def test_what_is_not_supported_is_refused_by_name(name: str) -> None:
    problem = CASES[name].problem
    features = problem.kind.features - elbowroom.up.ElbowroomPlanner.supported_kind().features
    assert features
    # Preferences among plans do not affect the translation.
    if not any("OVERSUBSCRIPTION" in feature for feature in features):
        with pytest.raises(elbowroom.UnsupportedError, match="support"):
            elbowroom.up.Translation(problem)


def test_the_engines_are_there() -> None:
    engines = up.shortcuts.get_environment().factory.engines
    assert {"elbowroom", "elbowroom-val", "replanner[elbowroom]"} <= set(engines) | {
        f"replanner[{name}]" for name in engines
    }


def temporal() -> Any:
    return CASES["matchcellar"]


def test_an_envelope_of_a_problem_and_a_plan() -> None:
    case = temporal()
    envelope = elbowroom.envelope(case.problem, case.valid_plans[0])
    assert envelope.answer == "envelope" and envelope.rows()


def test_a_network_has_the_plan_among_its_schedules() -> None:
    case = temporal()
    stn = elbowroom.up.to_stn(case.problem, case.valid_plans[0])
    assert stn.kind == PlanKind.STN_PLAN and stn.is_consistent
    again = stn.convert_to(PlanKind.TIME_TRIGGERED_PLAN, case.problem)
    with PlanValidator(name="elbowroom-val") as validator:
        assert validator.validate(case.problem, again)


def test_a_planner_returns_a_network_if_asked() -> None:
    case = temporal()
    with OneshotPlanner(name="elbowroom", params={"plan": "stn"}) as planner:
        plan = planner.solve(case.problem).plan
    assert plan.kind == PlanKind.STN_PLAN and plan.is_consistent
    again = plan.convert_to(PlanKind.TIME_TRIGGERED_PLAN, case.problem)
    with PlanValidator(name="elbowroom-val") as validator:
        assert validator.validate(case.problem, again)
    # The resulting plan supports further requests, which use its bounds and not one of its
    # schedules.
    envelope = elbowroom.envelope(case.problem, plan)
    assert envelope.answer == "envelope"
    assert elbowroom.up.execute(case.problem, plan).verdict == "goal-reached"
    with pytest.raises(up.exceptions.UPUsageError, match="time-triggered or stn"):
        OneshotPlanner(name="elbowroom", params={"plan": "tree"})


def test_a_network_is_valid_if_all_its_schedules_are() -> None:
    case = temporal()
    network = elbowroom.up.to_stn(case.problem, case.valid_plans[0])
    with PlanValidator(name="elbowroom-val", plan_kind=PlanKind.STN_PLAN) as validator:
        assert validator.validate(case.problem, network)
        loose = up.plans.STNPlan(
            [
                (first, lower, upper, second)
                for first, found in network.get_constraints().items()
                for lower, upper, second in found
                if first.action_instance == second.action_instance
            ]
        )
        result = validator.validate(case.problem, loose)
    assert result.status == ValidationResultStatus.INVALID and result.log_messages


def boxes() -> Any:
    problem = up.shortcuts.Problem("boxes")
    done = [problem.add_fluent(f"done{i}", default_initial_value=False) for i in range(2)]
    for i in range(2):
        action = up.shortcuts.DurativeAction(f"do{i}")
        action.set_closed_duration_interval(2, 5)
        action.add_effect(up.shortcuts.EndTiming(), done[i], True)
        problem.add_action(action)
    problem.add_goal(done[0])
    return problem, done


def test_a_replanner_plans_for_what_the_problem_has_become() -> None:
    problem, done = boxes()

    def names(found: Any) -> set[str]:
        return {it.action.name for _, it, _ in found.plan.timed_actions}

    with Replanner(problem, name="elbowroom") as replanner:
        first = replanner.resolve()
        assert names(first) == {"do0"}
        # The plan is kept as long as it works.
        replanner.update_initial_value(done[1], True)
        assert replanner.resolve() is first
        replanner.update_initial_value(done[1], False)
        replanner.add_goal(done[1])
        assert names(replanner.resolve()) == {"do0", "do1"}
        replanner.remove_goal(done[0])
        # It still works, although it does more than necessary.
        assert names(replanner.resolve()) == {"do0", "do1"}
        replanner.remove_action("do0")
        assert names(replanner.resolve()) == {"do1"}
        replanner.remove_action("do1")
        assert replanner.resolve().status == Status.UNSOLVABLE_PROVEN
        replanner.add_action(problem.action("do1"))
        assert names(replanner.resolve()) == {"do1"}
        # unified-planning expects warnings from an engine requested by name.
        with pytest.warns(UserWarning, match="do7; expected one of"):
            replanner.remove_action("do7")
        with pytest.warns(UserWarning, match="unknown goal"):
            replanner.remove_goal(done[0])
    strict = elbowroom.up.ElbowroomPlanner(problem, True)
    with pytest.raises(up.exceptions.UPUsageError, match="do7; expected one of"):
        strict.remove_action("do7")
    # The caller's problem has not changed.
    assert len(problem.actions) == 2 and len(problem.goals) == 1


def test_a_plan_is_executed() -> None:
    case = temporal()
    assert elbowroom.up.execute(case.problem, case.valid_plans[0]).verdict == "goal-reached"


def test_a_third_is_a_third() -> None:
    problem = up.shortcuts.Problem("thirds")
    done = problem.add_fluent("done", default_initial_value=False)
    wait = up.shortcuts.DurativeAction("wait")
    wait.set_fixed_duration(Fraction(1, 3))
    wait.add_effect(up.shortcuts.EndTiming(), done, True)
    problem.add_action(wait)
    problem.add_goal(done)
    with OneshotPlanner(name="elbowroom") as planner:
        result = planner.solve(problem)
    assert result.plan.timed_actions[0][2] == Fraction(1, 3)


def test_names_that_pddl_does_not_know_come_back() -> None:
    problem = up.shortcuts.Problem("names")
    of = up.shortcuts.UserType("object")
    problem.add_object("Täg 1", of)
    problem.add_object("täg 1", of)
    and_ = problem.add_fluent("and", default_initial_value=False, x=of)
    action = up.shortcuts.InstantaneousAction("at", when=of)
    action.add_effect(and_(action.when), True)
    problem.add_action(action)
    problem.add_goal(and_(problem.object("täg 1")))
    with OneshotPlanner(name="elbowroom") as planner:
        plan = planner.solve(problem).plan
    assert str(plan.actions[0]) == "at(täg 1)"


def test_the_goal_is_protected_until_after_all_timed_effects() -> None:
    case = CASES["basic_tils"] if "basic_tils" in CASES else None
    problem = up.shortcuts.Problem("thrown_out")
    kept = problem.add_fluent("kept", default_initial_value=False)
    put = up.shortcuts.DurativeAction("put")
    put.set_closed_duration_interval(1, 20)
    put.add_effect(up.shortcuts.EndTiming(), kept, True)
    problem.add_action(put)
    problem.add_timed_effect(up.shortcuts.GlobalStartTiming(10), kept, False)
    problem.add_goal(kept)
    with OneshotPlanner(name="elbowroom") as planner, PlanValidator(name="elbowroom-val") as judge:
        plan = planner.solve(problem).plan
        assert judge.validate(problem, plan)
        start, _, duration = plan.timed_actions[0]
        assert start + duration > 10
    assert case is None or case.problem.timed_effects


def shifts() -> Problem:
    """Jobs of many lengths on two machines: the first plan that is found is hardly the shortest."""
    problem = Problem("shifts")
    machine, job = up.shortcuts.UserType("machine"), up.shortcuts.UserType("job")
    is_free = problem.add_fluent("free", default_initial_value=True, m=machine)
    is_done = problem.add_fluent("done", default_initial_value=False, j=job)
    length = problem.add_fluent("length", up.shortcuts.IntType(), default_initial_value=1, j=job)
    work = up.shortcuts.DurativeAction("work", m=machine, j=job)
    start, end = up.shortcuts.StartTiming(), up.shortcuts.EndTiming()
    work.set_fixed_duration(length(work.j))
    work.add_condition(start, is_free(work.m))
    work.add_effect(start, is_free(work.m), False)
    work.add_effect(end, is_free(work.m), True)
    work.add_effect(end, is_done(work.j), True)
    problem.add_action(work)
    problem.add_objects([up.shortcuts.Object(f"m{i}", machine) for i in range(2)])
    for number, minutes in enumerate((7, 3, 9, 4, 11, 5)):
        one = problem.add_object(f"j{number}", job)
        problem.set_initial_value(length(one), minutes)
        problem.add_goal(is_done(one))
    return problem


def test_anytime_planner_yields_each_better_plan_and_at_the_end_the_best_again() -> None:
    problem = shifts()
    with AnytimePlanner(name="elbowroom") as planner:
        *better, last = planner.get_solutions(problem, timeout=2)
    assert {it.status for it in better} == {Status.INTERMEDIATE}
    assert last.status == Status.SOLVED_SATISFICING
    assert last.plan == better[-1].plan
    ends = [Fraction(it.metrics["makespan"]) for it in better]
    assert all(one > other for one, other in itertools.pairwise(ends)), ends
    for result in better:
        with PlanValidator(name="elbowroom-val") as validator:
            assert validator.validate(problem, result.plan).status == ValidationResultStatus.VALID


def test_anytime_planner_can_be_left_at_any_plan() -> None:
    with AnytimePlanner(name="elbowroom") as planner:
        solutions = planner.get_solutions(shifts())
        assert next(solutions).status == Status.INTERMEDIATE
        solutions.close()


def test_anytime_planner_says_why_there_is_no_plan() -> None:
    problem = shifts()
    problem.set_initial_value(problem.fluent("free")(problem.object("m0")), False)
    problem.set_initial_value(problem.fluent("free")(problem.object("m1")), False)
    with AnytimePlanner(name="elbowroom") as planner:
        (result,) = planner.get_solutions(problem)
    assert result.status == Status.UNSOLVABLE_PROVEN
