"""Executions: in simulated worlds, in worlds in Python, and step by step."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest
from conftest import DELIVERY

import elbowroom
from elbowroom import _clock


class AsPlanned(elbowroom.World):
    """Each action takes as long as planned, times a factor."""

    def __init__(self, factor: Fraction = Fraction(1)) -> None:
        self.factor = factor
        self.now = Fraction(0)
        self.coming: list[elbowroom.Observation] = []
        self.begun: list[str] = []

    def start(self, action: elbowroom.Action) -> None:
        self.begun.append(action.words[0])
        self.coming.append(elbowroom.started(action, action.now))
        if action.duration is not None:
            lasts = action.duration * self.factor
            self.coming.append(elbowroom.ended(action, action.now + lasts))

    def cancel(self, action: elbowroom.Action) -> None:
        self.coming.append(elbowroom.ended(action, self.now, "cancelled"))

    def wait(self, until):
        self.now = now = min([until, *(it.time for it in self.coming)])
        due = [it for it in self.coming if it.time <= now]
        self.coming = [it for it in self.coming if it.time > now]
        return now, due


def test_a_world_in_python_is_told_and_heard(problem: elbowroom.Problem, plan: Path) -> None:
    world = AsPlanned()
    run = problem.run(plan, world=world)
    assert run.verdict == "goal-reached" and run.time == Fraction(30003, 1000)
    assert sorted(world.begun) == ["drive", "drive", "drop", "pick", "unlock"]
    assert [row.outcome for row in run.rows()] == ["succeeded"] * 5
    assert run.trace()[0]["event"] == "header"


def test_a_world_that_raises_is_the_cause(problem: elbowroom.Problem, plan: Path) -> None:
    class Broken(AsPlanned):
        def wait(self, until):
            raise LookupError("no such robot")

    with pytest.raises(elbowroom.WorldError, match="no such robot") as caught:
        problem.run(plan, world=Broken())
    assert isinstance(caught.value.__cause__, LookupError)
    assert caught.value.run.verdict == "world-failed"


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (None, "must return the time"),
        ((0, [elbowroom.fact("(flies pig)", True, 0)]), "flies pig"),
        ((0, [elbowroom.ended(0, 0, "somehow")]), "somehow"),
    ],
)
def test_a_world_that_talks_nonsense_is_told_so(problem, plan, answer, words) -> None:
    class Babbling(AsPlanned):
        def wait(self, until):
            return answer

    with pytest.raises(elbowroom.WorldError, match=words):
        problem.run(plan, world=Babbling())


def test_ctrl_c_in_a_world_ends_the_run_in_order(problem: elbowroom.Problem, plan: Path) -> None:
    class Interrupted(AsPlanned):
        is_told = False

        def wait(self, until):
            if not self.is_told:
                self.is_told = True
                raise KeyboardInterrupt
            return super().wait(until)

    world = Interrupted()
    with pytest.warns(elbowroom.InterruptedWarning):
        run = problem.run(plan, world=world)
    assert run.verdict == "interrupted"


def test_simulated_worlds_go_by_their_seed(problem: elbowroom.Problem, plan: Path) -> None:
    world = DELIVERY / "world.toml"
    runs = [problem.run(plan, world=world, seed=seed).document for seed in (1, 1, 2)]
    assert runs[0] == runs[1]
    assert runs[0]["executed"] != runs[2]["executed"]


def test_a_world_of_coroutines_is_awaited(problem: elbowroom.Problem, plan: Path) -> None:
    class Slow(elbowroom.AsyncWorld):
        def __init__(self) -> None:
            self.inner = AsPlanned()

        async def start(self, action):
            self.inner.start(action)

        async def cancel(self, action):
            self.inner.cancel(action)

        async def wait(self, until):
            await asyncio.sleep(0)
            return self.inner.wait(until)

    run = asyncio.run(problem.run_async(plan, world=Slow()))
    assert run.verdict == "goal-reached"
    with pytest.raises(TypeError, match="run_async"):
        problem.run(plan, world=Slow())


def test_an_execution_refuses_what_it_has_not_asked_for(
    problem: elbowroom.Problem, plan: Path
) -> None:
    execution = problem.execution(plan)
    assert isinstance(execution.next_command(), elbowroom.Start)
    with pytest.raises(elbowroom.RequestError, match="has not requested"):
        execution.observe(1)
    execution.fail("the robot is gone")
    over = execution.next_command()
    assert isinstance(over, elbowroom.Over) and over.run.verdict == "world-failed"


class BadClock(AsPlanned):
    """A world whose clock is wrong at the second wait."""

    def __init__(self, wrong: Callable[[Fraction, Fraction], Fraction | None]) -> None:
        super().__init__()
        self.wrong, self.waits, self.last = wrong, 0, Fraction(0)

    def wait(self, until):
        self.waits += 1
        now = self.wrong(self.last, until) if self.waits >= 2 else None
        if now is not None:
            return now, []
        self.last, observations = super().wait(until)
        return self.last, observations


@pytest.mark.filterwarnings("ignore::elbowroom.ClockWarning")
@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda last, until: until + 3600, "jumped from 0.000 s to"),
        (lambda last, until: last - 3600, "went back from 0.000 s to -3600.000 s"),
        (lambda last, until: last, "does not advance from 0.000 s"),
    ],
)
def test_irregular_clock_is_a_warning(problem, plan, wrong, words) -> None:
    with pytest.warns(elbowroom.ClockWarning, match=words):
        try:
            run = problem.run(plan, world=BadClock(wrong))
        except elbowroom.WorldError as error:
            run = error.run
    assert any(words in warning for warning in run.warnings)


def test_overdue_wait_is_a_warning(problem, plan, monkeypatch) -> None:
    monkeypatch.setattr(_clock, "PATIENCE", -1000.0)

    class Slow(AsPlanned):
        def wait(self, until):
            time.sleep(0.3)
            return super().wait(until)

    with pytest.warns(elbowroom.ClockWarning, match="has not returned from a wait"):
        run = problem.run(plan, world=Slow())
    assert run.verdict == "goal-reached" and run.warnings


def test_threads_change_no_run(problem: elbowroom.Problem) -> None:
    runs = [problem.run(world=AsPlanned(Fraction(3, 2)), jobs=jobs) for jobs in (None, 0, 1, 2)]
    assert all(run.verdict == "goal-reached" for run in runs)
    assert all(run.trace() == runs[0].trace() for run in runs)
    assert isinstance(problem.execution(jobs=2).next_command(), elbowroom.Start)


def test_a_function_is_the_planner(problem: elbowroom.Problem, plan: Path) -> None:
    asked: list[str] = []

    def planner(domain: str, text: str) -> object:
        asked.append(text)
        return elbowroom.read(domain, text).plan()

    run = problem.run(planner=planner, world=AsPlanned())
    assert run.verdict == "goal-reached" and len(asked) == 1
    # A drive of thrice the time leaves the envelope, and a new plan is made in mid-execution.
    late = problem.run(plan, planner=planner, world=AsPlanned(Fraction(21, 10)))
    assert late.replans >= 1 and len(asked) >= 2


def test_a_planner_that_raises_is_the_cause(problem: elbowroom.Problem) -> None:
    def planner(domain: str, text: str) -> str:
        raise LookupError("out of ideas")

    with pytest.raises(elbowroom.WorldError, match="out of ideas"):
        problem.run(planner=planner, world=AsPlanned())
    assert problem.run(planner=lambda d, p: None, world=AsPlanned()).verdict == "no-plan"
    bad = problem.run(planner=lambda d, p: "0: (unlock office) [6]", world=AsPlanned())
    assert bad.verdict == "no-plan" and "does not work" in str(bad.why)


ROADS = """(define (domain roads) (:requirements :durative-actions :timed-initial-literals)
  (:predicates (home) (there) (open) (delivered))
  (:durative-action short :parameters () :duration (= ?duration 2) :condition (at start (home))
    :effect (and (at start (not (home))) (at end (there))))
  (:durative-action long :parameters () :duration (= ?duration 5) :condition (at start (home))
    :effect (and (at start (not (home))) (at end (there))))
  (:durative-action deliver :parameters () :duration (= ?duration 1)
    :condition (and (over all (there)) (at start (open))) :effect (at end (delivered))))"""
CLOSING = """(define (problem closing) (:domain roads) (:init (home) (open) (at 10 (not (open))))
  (:goal (delivered)))"""


def test_an_executor_believes_a_model_of_a_world_in_python() -> None:
    class Roads(AsPlanned):
        def start(self, action: elbowroom.Action) -> None:
            self.factor = Fraction(6 if action.words[0] == "short" else 1)
            super().start(action)

    model = 'format = "elbowroom-world"\nversion = 1\n[[duration]]\naction = "short"\nconstant = 12\n'
    problem = elbowroom.read(ROADS, CLOSING)
    world = Roads()
    assert problem.run(world=world, executor="policy", believed=model).verdict == "goal-reached"
    assert world.begun == ["long", "deliver"]
    assert problem.run(world=Roads(), executor="policy").verdict != "goal-reached"
