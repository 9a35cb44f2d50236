"""Questions and answers."""

from __future__ import annotations

import math
import pickle
import sys
import threading
from fractions import Fraction
from pathlib import Path

import pytest
from conftest import CASES, DELIVERY

import elbowroom
from elbowroom import _native


def test_numbers_are_fractions_and_infinity(problem: elbowroom.Problem, plan: Path) -> None:
    envelope = problem.envelope(plan)
    assert [(r.name, r.lower, r.upper) for r in envelope.rows()] == [
        ("dur_0", Fraction(1, 1000), Fraction(14999, 750)),
        ("dur_1", 0, Fraction(33749, 625)),
        ("dur_2", Fraction(1, 1000), Fraction(14999, 3750)),
        ("dur_3", Fraction(1, 1000), Fraction(14999, 500)),
        ("dur_4", Fraction(1, 1000), Fraction(14999, 2500)),
    ]
    # The box of paper 1's algorithm.
    assert problem.envelope(plan, method="irr")["dur_4"].upper == Fraction(639, 128)
    # In steps of the quantity's own unit.
    assert problem.envelope(plan, precision=1)["dur_1"].upper == 54
    assert all(type(r.lower) is Fraction for r in envelope.rows())
    assert envelope.stop == "converged"
    assert envelope.makespans is not None
    assert envelope.makespans["nominal"] == Fraction(30003, 1000)
    assert {"dur_0": 11} in envelope
    assert {"dur_0": 21} not in envelope


def test_envelope_has_the_time_out_of_each_action(problem: elbowroom.Problem, plan: Path) -> None:
    assert problem.envelope(plan)["dur_0"].timeout == 600
    assert problem.envelope(plan, timeout="10x,1")["dur_0"].timeout == 100
    assert problem.envelope(plan, timeout=0.5).answer == "fails"
    assert problem.envelope(plan, timeout="none")["dur_0"].timeout is None
    box = {"dur_3": (14, 16)}
    assert problem.envelope(plan, timeout=16, contains=box)
    assert not problem.envelope(plan, timeout=15.5, contains=box)
    with pytest.raises(elbowroom.RequestError, match="a positive number of seconds"):
        problem.envelope(plan, timeout="soon")


def test_run_uses_the_time_out(problem: elbowroom.Problem, plan: Path) -> None:
    late = """
        format = "elbowroom-world"
        version = 1
        [[duration]]
        action = "unlock"
        constant = 50
    """
    run = problem.run(plan, world=late, timeout=40, planner="none")
    assert run.verdict == "no-plan"
    assert problem.run(plan, world=late, timeout="none", planner="none").verdict == "goal-reached"


def test_what_has_no_limit_is_infinite() -> None:
    problem = elbowroom.read(
        "(define (domain d) (:requirements :durative-actions) (:predicates (p))"
        "(:durative-action a :parameters () :duration (= ?duration 1) :effect (at end (p))))",
        "(define (problem q) (:domain d) (:init) (:goal (p)))",
    )
    room = problem.envelope("0: (a) [1]").rows()[0]
    assert room.upper == math.inf
    assert "nothing" in problem.envelope("0: (a) [1]")._repr_html_()


def test_a_box_is_inside_or_there_is_a_counterexample(
    problem: elbowroom.Problem, plan: Path
) -> None:
    assert problem.envelope(plan, contains={"dur_0": (10, 12.5)}).answer == "inside"
    outside = problem.envelope(plan, contains={"dur_0": (10, 60)})
    assert not outside
    assert outside.counterexample is not None
    assert outside.why_not


def test_plans_are_judged_in_every_form(problem: elbowroom.Problem, plan: Path) -> None:
    read = problem.read_plan(plan)
    assert problem.check(plan) and problem.check(str(plan)) and problem.check(plan.read_text())
    assert problem.check(read) and problem.check(read.steps)
    late = problem.check(DELIVERY / "late.plan")
    assert not late
    assert late.violation is not None and late.violation.message


def test_a_network_can_be_asked_for_its_envelope(problem: elbowroom.Problem, plan: Path) -> None:
    stn = problem.stn(plan)
    assert stn.dot.startswith("digraph")
    assert any(row.reason == "interference" for row in stn.constraints)
    assert problem.envelope(stn, vary="duration (drive _ _ _)").rows()


def test_rules_of_judgement_can_be_chosen() -> None:
    domain = "(define (domain d) (:predicates (p)) (:action a :parameters () :effect (p)))"
    problem = elbowroom.read(
        domain, "(define (problem q) (:domain d) (:init (at 9 (not (p)))) (:goal (p)))"
    )
    assert not problem.check("1: (a)")
    assert problem.check("1: (a)", rules="pddl-goal-after-actions")
    assert problem.check("10: (a)", rules="unified-planning")
    with pytest.raises(elbowroom.RequestError, match="unknown variant `mine`"):
        problem.check("1: (a)", rules="mine")


@pytest.mark.parametrize("case", sorted(path.name for path in CASES.iterdir() if path.is_dir()))
def test_a_plan_is_found_for_each_case_and_is_valid(case: str) -> None:
    problem = elbowroom.read(CASES / case / "domain.pddl", CASES / case / "problem.pddl")
    if case == "kettle":
        with pytest.raises(elbowroom.UnsupportedError, match="does not handle processes and events"):
            problem.plan(time_limit=20, first=True)
        return
    plan = problem.plan(time_limit=20, first=True)
    assert isinstance(plan, elbowroom.Plan)
    assert problem.check(plan).makespan == plan.makespan


def test_threads_change_no_plan(problem: elbowroom.Problem) -> None:
    plans = [str(problem.plan(jobs=jobs)) for jobs in (None, 0, 1, 2, 7)]
    assert len(set(plans)) == 1


def test_that_there_is_no_plan_is_an_answer() -> None:
    problem = elbowroom.read(
        "(define (domain d) (:predicates (p)))",
        "(define (problem q) (:domain d) (:init) (:goal (p)))",
    )
    found = problem.plan()
    assert isinstance(found, elbowroom.NoPlan) and not found and found.is_proved


def test_mistakes_have_a_place_and_advice() -> None:
    with pytest.raises(elbowroom.ReadError) as caught:
        elbowroom.read("(define (domain d)\n (:predicats (p)))", "(define (problem q))")
    found = caught.value.diagnostics[0]
    assert (found.line, found.severity) == (2, "error")
    assert found.advice == "did you mean `:predicates`?"


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda p, q: p.envelope(q, vary="nonsense"), elbowroom.RequestError, "nonsense"),
        (lambda p, q: p.envelope(q, guarantee="firm"), elbowroom.RequestError, "dynamic"),
        (lambda p, q: p.envelope(q, precision=0), elbowroom.RequestError, "greater than 0"),
        (lambda p, q: p.envelope(q, contains={"dur_9": (0, 1)}), elbowroom.RequestError, "dur_9"),
        (lambda p, q: p.envelope("0: (fly) [1]"), elbowroom.ReadError, "fly"),
        (lambda p, q: p.check(3), TypeError, "not iterable"),
        (lambda p, q: p.check("no-such.plan"), FileNotFoundError, "no-such.plan"),
        (lambda p, q: p.stn(DELIVERY / "late.plan"), elbowroom.RequestError, "does not work"),
        (lambda p, q: p.check(DELIVERY / "plan.stn"), elbowroom.RequestError, "STN plan"),
        (lambda p, q: p.plan(planner="nobody-knows"), elbowroom.PlannerError, "nobody-knows"),
        (lambda p, q: p.plan(time_limit=-1), ValueError, "-1"),
        (lambda p, q: p.plan(planner="lpg-td", jobs=2), elbowroom.RequestError, "`jobs`"),
        (lambda p, q: p.run(q, planner="none", jobs=2), elbowroom.RequestError, "`jobs`"),
        (lambda p, q: p.run(q, planner=print, jobs=2), elbowroom.RequestError, "`jobs`"),
        (lambda p, q: p.run(q, jobs="many"), elbowroom.RequestError, "jobs"),
        (lambda p, q: p.run(q, executor="guardd"), elbowroom.RequestError, "guarded"),
        (lambda p, q: p.run(q, max_replan=3), elbowroom.RequestError, "max_replans"),
        (lambda p, q: p.run(q, world="no-such.toml"), FileNotFoundError, "no-such"),
        (lambda p, q: p.run(q, world="x = (1"), elbowroom.ReadError, "world"),
        (lambda p, q: elbowroom.read("", ""), elbowroom.ReadError, "domain"),
        (lambda p, q: elbowroom.read(1, 2), TypeError, "path or a text"),
    ],
)
def test_bad_input_says_what_to_do(problem, plan, call, error, words) -> None:
    with pytest.raises(error) as caught:
        call(problem, plan)
    assert words in str(caught.value)


def test_a_panic_says_that_it_is_a_bug() -> None:
    with pytest.raises(elbowroom.BugError, match="bug in Elbowroom.*see a panic"):
        _native._panic_for_test()


def test_progress_is_told_and_may_end_the_work(problem: elbowroom.Problem, plan: Path) -> None:
    heard: list[elbowroom.Progress] = []
    problem.envelope(plan, precision="1/1000", progress=heard.append)
    assert heard and heard[0].stage == "envelope"

    def refuse(_: elbowroom.Progress) -> None:
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        problem.envelope(plan, precision="1/1000", progress=refuse)


def test_what_was_found_until_ctrl_c_is_the_answer(
    problem: elbowroom.Problem, plan: Path
) -> None:
    def interrupt(_: elbowroom.Progress) -> None:
        raise KeyboardInterrupt

    with pytest.warns(elbowroom.InterruptedWarning):
        envelope = problem.envelope(plan, precision="1/1000", progress=interrupt)
    assert envelope.answer == "envelope" and envelope.stop == "cancelled"


def test_a_time_limit_gives_what_was_found(problem: elbowroom.Problem, plan: Path) -> None:
    envelope = problem.envelope(plan, precision="1/1000000", time_limit=0)
    assert envelope.stop in ("time limit", "converged")


def test_threads_ask_at_the_same_time(problem: elbowroom.Problem, plan: Path) -> None:
    text = plan.read_text()
    answers: list[str] = []

    def ask() -> None:
        for _ in range(20):
            envelope = problem.envelope(text)
            answers.append(repr(envelope))

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(answers) == 80 and len(set(answers)) == 1


def test_problems_travel_to_other_processes(problem: elbowroom.Problem, plan: Path) -> None:
    again = pickle.loads(pickle.dumps(problem))
    assert again.name == problem.name
    assert again.check(plan)


def test_html_is_escaped(problem: elbowroom.Problem, plan: Path) -> None:
    from elbowroom._tables import html_table

    assert "<b>" not in html_table(["<b>"], [["<b>&"]], "<b>")
    for answer in (
        problem.envelope(plan), problem.check(plan), problem.read_plan(plan), problem.stn(plan),
        problem.run(plan), problem.check(DELIVERY / "late.plan"),
    ):  # fmt: skip
        shown = answer._repr_html_()
        assert shown.startswith("<table>") and shown.endswith("</table>")


def test_data_frames_have_a_row_for_each_quantity(problem: elbowroom.Problem, plan: Path) -> None:
    envelope = problem.envelope(plan)
    pandas = pytest.importorskip("pandas")
    frame = envelope.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert frame["upper"][2] == pytest.approx(14999 / 3750)
    pytest.importorskip("polars")
    assert envelope.to_polars()["name"].to_list()[0] == "dur_0"


def test_missing_data_frames_are_named(
    problem: elbowroom.Problem, plan: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="pip install pandas"):
        problem.envelope(plan).to_pandas()


def test_pictures_have_a_lane_for_each_row(problem: elbowroom.Problem, plan: Path) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    envelope = problem.envelope(plan)
    assert len(envelope.plot().get_yticklabels()) == 5
    gantt = problem.read_plan(plan).plot(envelope)
    # A bar for each action, and a band behind it.
    assert len(gantt.patches) == 10
    assert len(problem.run(plan).plot().patches) == 5


def errand() -> elbowroom.Problem:
    return elbowroom.read(CASES / "errand" / "domain.pddl", CASES / "errand" / "problem.pddl")


def test_plans_come_as_they_are_found_each_better_than_the_one_before() -> None:
    problem = errand()
    plans = problem.plans(jobs=1)
    found = list(plans)
    metrics = [plan.metric for plan in found]
    assert len(found) > 1
    assert all(one > other for one, other in zip(metrics, metrics[1:], strict=False))
    assert all(problem.check(plan) for plan in found)
    assert isinstance(plans.answer, elbowroom.Plan)
    assert plans.answer.steps == found[-1].steps
    assert plans.answer.stop == "exhausted"
    assert list(plans) == []
    # The answer is that of a search without a listener.
    assert str(plans.answer) == str(problem.plan(first=False, jobs=1))


def test_search_for_plans_can_be_left() -> None:
    plans = errand().plans()
    for plan in plans:
        assert plan.steps
        break
    plans.close()


def test_search_for_plans_without_time_says_so() -> None:
    plans = errand().plans(time_limit=0)
    assert list(plans) == []
    assert not plans.answer
    assert plans.answer.document["stop"] == "time limit"
    with pytest.raises(ValueError, match="time limit is -1"):
        errand().plans(time_limit=-1)
