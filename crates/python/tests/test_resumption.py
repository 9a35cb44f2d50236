"""Executives in this process that are killed, or lose their world, and are resumed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT
from test_executive import CASE, HOME, Depot, ended, python
from test_lifecycle import HANG, WORLDS, Fault

import elbowroom
from elbowroom import Executive


class Lasting(Depot):
    """A robot that has finished its actions while there was no executive, and may have forgotten some."""

    forgets = False

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[elbowroom.Action] = []
        self.cancelled: list[str] = []

    def resume(self, now, actions):
        self.asked += actions
        return now, [] if self.forgets else [elbowroom.ended(action, now) for action in actions]

    def cancel(self, action):
        self.cancelled.append(action.name)


CRASH = """
from test_resumption import *
executive = Executive(*CASE, world=Lasting(), journal=sys.argv[1])
executive.wait("problem", HANG)
# Before the goals, so that no action for them has started.
if sys.argv[2] == "paused":
    executive.pause()
executive.submit(HOME)
executive.submit("(at rover shelf)", name="shelf")
if sys.argv[2] == "running":
    while not executive.status().running:
        time.sleep(0.001)
os.kill(os.getpid(), signal.SIGKILL)
"""


def crash(tmp_path: Path, moment: str) -> Path:
    """The journal of a process that is killed."""
    journal = tmp_path / "robot.journal"
    done = python(CRASH, journal, moment)
    assert done.returncode == -signal.SIGKILL, done.stderr
    return journal


@pytest.mark.filterwarnings("ignore::elbowroom.ExecutiveWarning")
def test_killed_executive_is_resumed(tmp_path: Path) -> None:
    journal = crash(tmp_path, "running")
    world = Lasting()
    with Executive.resume(journal, world) as executive:
        assert executive.wait("goal-1", HANG) and executive.wait("shelf", HANG)
        (asked,) = world.asked
        assert asked.name.startswith("(drive rover office") and asked.duration in (15, 20)
        # The action has ended, and is not started again.
        assert asked.name not in world.begun and world.cancelled == []
        assert executive.submit(HOME) == "goal-2"
    with pytest.raises(elbowroom.ExecutiveError, match="is over"):
        Executive.resume(journal, Lasting())


@pytest.mark.filterwarnings("ignore::elbowroom.ExecutiveWarning")
@pytest.mark.parametrize("world", [Depot, Lasting])
def test_action_that_the_new_world_does_not_know_has_failed(tmp_path: Path, world: Any) -> None:
    journal = crash(tmp_path, "running")
    robot = world()
    robot.forgets = True
    with Executive.resume(journal, robot) as executive:
        executive.pause()
        executive.fact("(at rover office)")
        executive.fact("(idle rover)")
        executive.unpause()
        assert executive.wait(executive.submit(HOME, name="again"), HANG)
    why = "the world does not know this action" if world is Lasting else "the world does not know its outcome"
    assert sum(why in line for line in executive.stop().trace_text.splitlines()) > 0
    # A world that knows of the earlier process receives a cancellation. A new one has nothing to cancel.
    cancelled = getattr(robot, "cancelled", None)
    assert cancelled is None or cancelled[0].startswith("(drive rover office")


@pytest.mark.filterwarnings("ignore::elbowroom.ExecutiveWarning")
def test_pause_and_goals_are_resumed(tmp_path: Path) -> None:
    journal = crash(tmp_path, "paused")
    world = Depot()
    with Executive.resume(journal, world) as executive:
        with pytest.raises(TimeoutError):
            executive.wait("goal-1", 1)
        assert executive.status().activity == "paused"
        executive.unpause()
        assert executive.wait("goal-1", HANG) and executive.wait("shelf", HANG)


@pytest.mark.filterwarnings("ignore::elbowroom.ExecutiveWarning")
def test_world_that_raises_can_be_replaced(tmp_path: Path) -> None:
    journal = tmp_path / "robot.journal"
    fault = Fault("raises", "wait")
    executive = Executive(*CASE, world=WORLDS["World"](fault), journal=journal)
    with pytest.raises(elbowroom.WorldError):
        executive.wait("problem", HANG)
    with pytest.raises(elbowroom.WorldError):
        executive.stop()
    with Executive.resume(journal, Lasting()) as executive:
        assert executive.wait("problem", HANG)


def test_exception_in_resume_is_raised(tmp_path: Path) -> None:
    class Broken(Lasting):
        def resume(self, now, actions):
            raise LookupError("no such robot")

    journal = crash(tmp_path, "running")
    with ended(Executive.resume(journal, Broken())) as executive:
        with pytest.raises(elbowroom.WorldError, match="no such robot"):
            executive.wait("goal-1", HANG)


def test_journals_are_checked(tmp_path: Path) -> None:
    journal = tmp_path / "robot.journal"
    with Executive(*CASE, world=Depot(), journal=journal):
        for make in (
            lambda: Executive(*CASE, world=Depot(), journal=journal),
            lambda: Executive.resume(journal, Depot()),
        ):
            with pytest.raises(elbowroom.ExecutiveError, match="has not ended"):
                make()
        done = python("from test_resumption import *\nExecutive.resume(sys.argv[1], Depot())", journal)
        assert "ExecutiveError" in done.stderr and "has not ended" in done.stderr
    with pytest.raises(elbowroom.ExecutiveError, match="already exists"):
        Executive(*CASE, world=Depot(), journal=journal)
    with pytest.raises(elbowroom.ExecutiveError, match="cannot read"):
        Executive.resume(tmp_path / "none", Depot())
    text = tmp_path / "text"
    text.write_text("no journal\n")
    with pytest.raises(elbowroom.ExecutiveError, match="not the journal of a run"):
        Executive.resume(text, Depot())


def test_world_of_a_journal_is_given_again(tmp_path: Path) -> None:
    journal = crash(tmp_path, "running")
    with pytest.raises(elbowroom.ExecutiveError, match="python Lasting"):
        Executive.resume(journal)
    command = [sys.executable, "-m", "elbowroom", "run", "--resume", str(journal)]
    environment = {**os.environ, "PYTHONPATH": str(Path(elbowroom.__file__).parents[1])}
    done = subprocess.run(command, env=environment, timeout=HANG, capture_output=True, text=True)
    assert done.returncode == 2 and "python Lasting" in done.stderr


@pytest.mark.filterwarnings("ignore::elbowroom.ExecutiveWarning")
def test_world_that_is_a_process_is_resumed(tmp_path: Path) -> None:
    journal = tmp_path / "robot.journal"
    program = """
from test_resumption import *
command = f"{sys.executable} {ROOT / 'examples/world.py'}"
executive = Executive(*CASE, world_process=command, journal=sys.argv[1])
executive.wait("problem", HANG)
executive.pause()
executive.submit(HOME, name="home")
os.kill(os.getpid(), signal.SIGKILL)
"""
    done = python(program, journal)
    assert done.returncode == -signal.SIGKILL, done.stderr
    with pytest.raises(elbowroom.ExecutiveError, match="process"):
        Executive.resume(journal, Depot())
    with Executive.resume(journal) as executive:
        executive.unpause()
        assert executive.wait("home", HANG)


def test_example_resumes(tmp_path: Path) -> None:
    example = ROOT / "crates/python/examples/restart.py"
    assert len(example.read_text().splitlines()) <= 40
    path = str(Path(elbowroom.__file__).parents[1])
    command = [sys.executable, str(example), str(tmp_path / "robot.journal")]
    environment = {**os.environ, "PYTHONPATH": path}
    done = subprocess.run(
        command, cwd=ROOT, env=environment, timeout=2 * HANG, capture_output=True, text=True
    )
    assert done.returncode == 0 and "state='achieved'" in done.stdout, done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is full")
def test_journal_that_cannot_be_written_ends_the_executive() -> None:
    world = Depot()
    with ended(Executive(*CASE, world=world, journal="/dev/full")) as executive:
        for call in (executive.stop, lambda: executive.wait("problem"), lambda: executive.submit(HOME)):
            with pytest.raises(elbowroom.ExecutiveError, match="cannot write the journal"):
                call()
    assert world.begun == []
