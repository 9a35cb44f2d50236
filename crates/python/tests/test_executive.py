"""Executives in this process: goals, ends, crashes, and worlds that misbehave."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from conftest import DELIVERY, ROOT
from test_lifecycle import HANG, STARTED, WORLDS, Fault, interrupts, shorten

import elbowroom
from elbowroom import Executive


CASE = (DELIVERY / "domain.pddl", DELIVERY / "problem.pddl")

HOME = "(at rover depot)"


class Depot(elbowroom.SteppedWorld):
    """A robot whose actions take as long as planned."""

    speed = 50.0

    def __init__(self) -> None:
        super().__init__()
        self.left: dict[elbowroom.Action, float] = {}
        self.begun: list[str] = []
        self.stops = 0

    def begin(self, action):
        self.begun.append(action.name)
        self.left[action] = float(action.duration)

    def step(self, dt):
        for action in [*self.left]:
            self.left[action] -= dt
            if self.left[action] < dt / 2:
                del self.left[action]
                self.succeeded(action)

    def cancel(self, action):
        del self.left[action]

    def stop(self):
        self.stops += 1


@contextlib.contextmanager
def ended(executive: Executive) -> Iterator[Executive]:
    """Ends an executive that may have failed."""
    try:
        yield executive
    finally:
        executive.request_stop()
        with contextlib.suppress(elbowroom.ElbowroomError):
            executive.join(HANG)
        assert executive.is_over


def until_started(fault: Fault) -> None:
    """Waits until both actions of the first plan are started, and the world is asked for their ends."""
    while fault.names("start") != STARTED or fault.calls[-1][0] != "wait":
        time.sleep(0.01)


def test_goals_are_reached_and_listed() -> None:
    world = Depot()
    with Executive(*CASE, world=world) as executive:
        assert executive.wait("problem", HANG)
        what = executive.what_if(HOME, within=1000)
        assert what.verdict == "achieved" and what.done is not None and what.missed == []
        with pytest.raises(elbowroom.RequestError):
            executive.what_if("(at rover nowhere)")
        home = executive.submit(HOME, value=2)
        found = executive.wait(home, HANG)
        assert found and (found.name, found.goal, found.value) == (home, HOME, 2)
        assert [goal.state for goal in executive.goals()] == ["achieved", "achieved"]
        status = executive.status()
        assert status.facts >= {HOME, "(lies parcel office)"} and status.running == []
        assert status.numbers["(drive-time depot shelf)"] == 10
        assert not executive.is_over and "resting" in repr(executive)
    assert executive.is_over and world.stops == 1
    run = executive.stop()
    assert run.verdict == "interrupted" and run.trace()[-1]["event"] == "over"
    assert world.begun[-1].startswith("(drive rover office")
    with pytest.raises(elbowroom.ExecutiveError, match="has ended"):
        executive.submit(HOME)


def test_deadline_that_passes_fails_the_goal() -> None:
    with Executive(*CASE, world=Depot()) as executive:
        executive.wait("problem", HANG)
        late = executive.wait(executive.submit(HOME, within=1), HANG)
        assert not late and late.deadline is not None
        now = executive.status().now
        assert executive.wait(executive.submit(HOME, deadline=now + 1000), HANG)


def test_goal_is_not_achieved_before_its_release_time() -> None:
    with Executive(*CASE, world=Depot()) as executive:
        executive.wait("problem", HANG)
        goal = executive.wait(executive.submit(HOME, after=5, by="night shift"), HANG)
        assert goal and goal.release is not None and goal.since >= goal.release
        assert goal.by == "night shift"


@pytest.mark.parametrize(
    ("goal", "options", "words"),
    [
        ("(at rover nowhere)", {}, "nowhere"),
        ("at rover depot", {}, "at"),
        ("", {}, "goal"),
        ("(and)", {}, "empty"),
        (HOME, {"value": 0}, "must be positive"),
        (HOME, {"name": "a/b"}, "invalid name"),
        (HOME, {"within": -1}, "must be positive"),
        (HOME, {"deadline": 0}, "has passed"),
        (HOME, {"deadline": 900, "within": 5}, "leave out one"),
        (HOME, {"after": 0}, "must be positive"),
        (HOME, {"release": 900, "within": 5}, "give both"),
        (HOME, {"by": ""}, "invalid name of a client"),
    ],
)
def test_wrong_goals_are_refused(goal: str, options: dict[str, Any], words: str) -> None:
    with Executive(*CASE) as executive:
        with pytest.raises(elbowroom.RequestError, match=words):
            executive.submit(goal, **options)
        assert [it.name for it in executive.goals()] == ["problem"]


def test_unknown_names_are_refused() -> None:
    with Executive(*CASE, realtime=50) as executive:
        for call in (
            lambda: executive.wait("nothing", HANG),
            lambda: executive.goal("nothing"),
            lambda: executive.cancel("nothing"),
            lambda: executive.fact("(at rover nowhere)"),
            lambda: executive.number("(charge rover)", 1),
            lambda: executive.action(77, "done"),
            lambda: executive.action(0, "over"),
        ):
            with pytest.raises(elbowroom.RequestError):
                call()
        with pytest.raises(ValueError, match="after"):
            executive.events(-1)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"executor": "live:5"}, "needs a model of the world"),
        ({"learn": "experience"}, "the run has no journal"),
        ({"executor": "nobody"}, "nobody"),
        ({"planner": lambda domain, problem: None}, "planner"),
        ({"planning_time": 1}, "planning"),
        ({"journal": "no such folder/run.journal"}, "journal"),
        ({"journal_size": -1}, "journal_size"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_wrong_options_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(elbowroom.ElbowroomError, match=words):
        Executive(*CASE, **options)


def test_paused_executive_starts_nothing() -> None:
    world = Depot()
    with Executive(*CASE, world=world) as executive:
        executive.wait("problem", HANG)
        executive.pause()
        begun = len(world.begun)
        home = executive.submit(HOME)
        with pytest.raises(TimeoutError):
            executive.wait(home, 0.5)
        assert executive.status().activity == "paused" and len(world.begun) == begun
        executive.unpause()
        assert executive.wait(home, HANG)


def test_goal_is_cancelled_and_fact_is_believed() -> None:
    with Executive(*CASE, world=Depot()) as executive:
        executive.wait("problem", HANG)
        executive.pause()
        executive.submit(HOME, name="home")
        executive.cancel("home")
        assert executive.wait("home", HANG).state == "cancelled"
        executive.fact("(unlocked depot)")
        assert "(unlocked depot)" in executive.status().facts
        executive.number("(drive-time depot office)", "1/3")
        lines = executive.events(0)
        seen = next(line for line in lines if "'value'" in str(line.get("observations")))
        assert seen["observations"][0]["value"] == Fraction(1, 3)


@pytest.mark.filterwarnings("ignore::elbowroom.InterruptedWarning")
def test_operator_reports_outcomes() -> None:
    fault = Fault("well")
    with Executive(*CASE, world=WORLDS["World"](fault)) as executive:
        until_started(fault)
        tickets = {it.action: it.ticket for it in executive.status().running}
        assert sorted(tickets) == STARTED
        executive.action(tickets["(unlock office)"], "done")
        assert "(unlocked office)" in executive.status().facts
        executive.action(tickets["(drive rover depot shelf)"], "cancelled")
        for event in executive.events(0):
            if "cancelled" in str(event.get("observations")):
                break
        assert fault.names("cancel") == ["(drive rover depot shelf)"]
        assert {it.state for it in executive.plan()} <= {"to-come", "running", "succeeded", "cancelled"}


def test_events_come_until_the_end() -> None:
    with Executive(*CASE, world=Depot()) as executive:
        all_lines = executive.events(0)
        assert next(all_lines)["event"] == "header"
        news = executive.events()
        executive.wait("problem", HANG)
        executive.request_stop()
        kinds = [it["event"] for it in news]
    assert "header" not in kinds and kinds[-1] == "over"
    assert [it["event"] for it in all_lines][-len(kinds) :] == kinds


def test_requests_come_from_all_threads() -> None:
    """Also from methods of the world, which the run waits for."""
    answers: list[Any] = []
    ready, is_asked = threading.Event(), threading.Event()

    class Asking(Depot):
        def begin(self, action):
            super().begin(action)
            if len(self.begun) == 1:
                ready.wait(HANG)
                answers.append(executive.submit(HOME, name="first"))
                with pytest.raises(RuntimeError, match="request_stop"):
                    executive.stop()
                with pytest.raises(RuntimeError, match="request_stop"):
                    executive.wait("first")
                is_asked.set()

    with Executive(*CASE, world=Asking()) as executive:
        ready.set()
        threads = [
            threading.Thread(target=lambda n=n: answers.append(executive.submit(HOME, name=f"t{n}")))
            for n in range(8)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        is_asked.wait(HANG)
        for name in ["first", *(f"t{n}" for n in range(8))]:
            assert executive.wait(name, HANG)
    assert len(answers) == 9


def test_two_executives_run_at_once(tmp_path: Path) -> None:
    with (
        Executive(*CASE, world=Depot(), journal=tmp_path / "a") as one,
        Executive(*CASE, world=Depot(), journal=tmp_path / "b") as two,
    ):
        for executive in (one, two):
            assert executive.wait("problem", HANG)
            assert executive.wait(executive.submit(HOME), HANG)


def test_second_run_of_a_world_is_refused() -> None:
    world = Depot()
    with Executive(*CASE, world=world) as first:
        assert first.wait("problem", HANG)
        with pytest.raises(elbowroom.RequestError, match="another run uses this world"):
            elbowroom.read(*CASE).run(world=world)
        with pytest.raises(elbowroom.RequestError, match="another run uses this world"):
            Executive(*CASE, world=world)
        assert world.stops == 0, "the world is left to the first one"
        assert first.wait(first.submit(HOME), HANG)
    assert world.stops == 1
    assert elbowroom.read(*CASE).run(world=Depot()).verdict == "goal-reached"


@pytest.mark.parametrize("kind", ["well", "blocks", "ignores"])
@pytest.mark.parametrize("name", ["World", "SteppedWorld"])
@pytest.mark.filterwarnings("ignore::elbowroom.InterruptedWarning")
def test_stop_is_in_order(monkeypatch, name: str, kind: str) -> None:
    shorten(monkeypatch)
    fault = Fault(kind)
    # A world that blocks does so in its first wait, while the plan is made.
    executive = Executive(*CASE, world=WORLDS[name](fault))
    fault.is_ready.wait(HANG) if kind == "blocks" else until_started(fault)
    run = executive.stop()
    fault.release.set()
    assert run.verdict == "interrupted"
    actions = [] if kind == "blocks" else STARTED
    assert fault.names("start") == actions and fault.names("cancel") == actions
    assert fault.names("stop") == [""]


@pytest.mark.parametrize("method", ["start", "wait", "cancel", "stop"])
@pytest.mark.parametrize("name", ["World", "SteppedWorld"])
def test_world_that_raises_ends_the_executive(monkeypatch, name: str, method: str) -> None:
    shorten(monkeypatch)
    fault = Fault("raises", method)
    executive = Executive(*CASE, world=WORLDS[name](fault))
    if method == "cancel":
        until_started(fault)
    if method in ("start", "wait"):
        with pytest.raises(elbowroom.WorldError, match="no such robot"):
            executive.wait("problem", HANG)
    with pytest.raises(elbowroom.WorldError, match="no such robot") as caught:
        executive.stop()
    assert isinstance(caught.value.__cause__, LookupError)
    assert caught.value.run.verdict == ("world-failed" if method in ("start", "wait") else "interrupted")
    assert fault.names("stop") == [""]


def test_exception_in_the_block_counts() -> None:
    world = Depot()
    with pytest.raises(ZeroDivisionError), Executive(*CASE, world=world):
        _ = 1 / 0
    assert world.stops == 1


def test_ctrl_c_stops_in_order() -> None:
    fault = Fault("well")
    main = threading.main_thread().ident
    assert main is not None

    def interrupt() -> None:
        until_started(fault)
        signal.pthread_kill(main, signal.SIGINT)

    threading.Thread(target=interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        with Executive(*CASE, world=WORLDS["World"](fault)) as executive:
            executive.wait("problem", HANG)
    assert executive.is_over and fault.names("cancel") == STARTED
    assert fault.names("stop") == [""]


def test_third_ctrl_c_abandons_a_world_that_blocks() -> None:
    fault = Fault("blocks")
    main = threading.main_thread().ident
    assert main is not None

    def interrupt() -> None:
        fault.is_ready.wait(HANG)
        while not fault.release.is_set():
            signal.pthread_kill(main, signal.SIGINT)
            time.sleep(0.3)

    thread = threading.Thread(target=interrupt)
    executive = Executive(*CASE, world=WORLDS["World"](fault))
    with ended(executive):
        try:
            with pytest.raises(KeyboardInterrupt), executive:
                thread.start()
                executive.wait("problem", HANG)
        finally:
            fault.release.set()
            with contextlib.suppress(KeyboardInterrupt):
                thread.join()
        executive._over.wait(HANG)


def test_search_is_stopped(tmp_path: Path) -> None:
    program = tmp_path / "slow.py"
    program.write_text("import time\ntime.sleep(600)\n")
    world = Depot()
    with Executive(*CASE, world=world, planner=f"{sys.executable} {program} {{domain}} {{problem}}") as executive:
        while executive.status().activity != "planning":
            time.sleep(0.01)
        assert executive.stop().verdict == "interrupted"
    assert world.begun == [] and world.stops == 1


def test_coroutines_are_called_in_the_event_loop() -> None:
    fault = Fault("well")

    async def main() -> None:
        async with Executive(*CASE, world=WORLDS["AsyncWorld"](fault)) as executive:
            while fault.names("start") != STARTED:
                await asyncio.sleep(0.01)
            executive.submit("(at rover office)", name="home")
            with pytest.raises(RuntimeError, match="to_thread"):
                executive.wait("home")
            with pytest.raises(TimeoutError):
                await asyncio.to_thread(executive.wait, "home", 0.5)
        assert executive.is_over

    asyncio.run(main())
    assert fault.names("cancel") == STARTED and fault.names("stop") == [""]
    with pytest.raises(TypeError, match="coroutine"):
        Executive(*CASE, world=WORLDS["AsyncWorld"](fault))


def python(program: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Runs a program that has these tests at hand."""
    path = os.pathsep.join([str(Path(elbowroom.__file__).parents[1]), str(Path(__file__).parent)])
    command = [sys.executable, "-c", program, *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": path}
    return subprocess.run(command, env=environment, timeout=2 * HANG, capture_output=True, text=True)


def test_end_of_the_main_thread_stops() -> None:
    program = """
from test_executive import *
world = Depot()
world.stop = lambda: print("stopped")
executive = Executive(*CASE, world=world)
executive.wait("problem", HANG)
"""
    done = python(program)
    assert (done.returncode, done.stdout) == (0, "stopped\n"), done.stderr


def test_model_is_learnt_from_the_journal_and_believed(tmp_path: Path) -> None:
    class Slow(Depot):
        def begin(self, action):
            super().begin(action)
            self.left[action] *= 1.5

    experience = tmp_path / "experience"
    with Executive(*CASE, world=Slow(), journal=tmp_path / "first.journal", learn=experience) as executive:
        executive.wait("problem", HANG)
    model = experience / "world.toml"
    assert 'action = "drive"' in model.read_text()
    believing = {"executor": "live:5", "believed": model}
    with Executive(*CASE, world=Slow(), **believing) as executive:
        assert executive.wait("problem", HANG)
