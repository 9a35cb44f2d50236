"""Ends of runs: every cause, with worlds that misbehave, in each kind of world."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from conftest import DELIVERY

import elbowroom
from elbowroom import _lifecycle

HANG = 30
"""Seconds after which a run counts as hung. It should end within 6 s; the machine may be busy."""

PLAN = (DELIVERY / "plan.plan").read_text()
"""Two actions start at once. The worlds here finish neither."""


@pytest.fixture(autouse=True)
def interrupts() -> Iterator[None]:
    """SIGINT interrupts, even if the tests run in the background of a shell, where it is ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def shorten(monkeypatch: pytest.MonkeyPatch) -> None:
    """Worlds from which nothing more is expected have less time than others."""
    monkeypatch.setattr(_lifecycle, "GRACE", 0.4)
    monkeypatch.setattr(_lifecycle, "STOP_TIME", 0.4)
    monkeypatch.setattr(_lifecycle, "PATIENCE", 0.2)


class Fault:
    """Part of the worlds that misbehaves, with a record of the calls."""

    def __init__(self, kind: str, method: str = "wait") -> None:
        self.kind, self.method = kind, method
        self.ready_at = "wait" if method in ("cancel", "stop") else method
        self.calls: list[tuple[str, str]] = []
        self.is_ready = threading.Event()
        self.release = threading.Event()

    def called(self, method: str, action: elbowroom.Action | None = None) -> None:
        self.calls.append((method, "" if action is None else action.name))
        if method == self.ready_at:
            self.is_ready.set()

    def names(self, method: str) -> list[str]:
        return sorted(name for called, name in self.calls if called == method)

    def raises(self, method: str) -> bool:
        return self.kind == "raises" and method == self.method

    def blocks(self, method: str) -> bool:
        return self.kind == "blocks" and method == self.method


class Threaded(elbowroom.World):
    """World on the real clock."""

    def __init__(self, fault: Fault) -> None:
        self.fault = fault
        self.begun = time.monotonic()
        self.reports: deque[elbowroom.Observation] = deque()

    def now(self) -> float:
        return time.monotonic() - self.begun

    def _misbehave(self, method: str) -> None:
        if self.fault.raises(method):
            raise LookupError("no such robot")
        if self.fault.blocks(method):
            self.fault.release.wait(HANG)

    def start(self, action):
        self.fault.called("start", action)
        self.reports.append(elbowroom.started(action, self.now()))
        self._misbehave("start")

    def cancel(self, action):
        self.fault.called("cancel", action)
        self._misbehave("cancel")
        if self.fault.kind != "ignores":
            self.reports.append(elbowroom.ended(action, self.now(), "cancelled"))

    def wait(self, until):
        if not self.reports:
            self.fault.called("wait")
            self._misbehave("wait")
        while self.now() < until and not self.reports:
            time.sleep(0.01)
        return self.now(), self.take()

    def take(self) -> list[elbowroom.Observation]:
        return [self.reports.popleft() for _ in range(len(self.reports))]

    def stop(self):
        self.fault.called("stop")
        self._misbehave("stop")


class Coroutines(elbowroom.AsyncWorld):
    """The same world with coroutines."""

    def __init__(self, fault: Fault) -> None:
        self.fault, self.inner = fault, Threaded(Fault("well"))

    async def _misbehave(self, method: str) -> None:
        if self.fault.raises(method):
            raise LookupError("no such robot")
        while self.fault.blocks(method):
            await asyncio.sleep(HANG)

    async def start(self, action):
        self.fault.called("start", action)
        self.inner.start(action)
        await self._misbehave("start")

    async def cancel(self, action):
        self.fault.called("cancel", action)
        await self._misbehave("cancel")
        if self.fault.kind != "ignores":
            self.inner.cancel(action)

    async def wait(self, until):
        if not self.inner.reports:
            self.fault.called("wait")
            await self._misbehave("wait")
        while self.inner.now() < until and not self.inner.reports:
            await asyncio.sleep(0.01)
        return self.inner.now(), self.inner.take()

    async def stop(self):
        self.fault.called("stop")
        await self._misbehave("stop")


class Stepped(elbowroom.SteppedWorld):
    """A simulator of the same actions. It never finishes them; a fault in ``wait`` is one in ``step``."""

    speed = 1.0

    def __init__(self, fault: Fault) -> None:
        super().__init__()
        self.fault = fault

    def _misbehave(self, method: str) -> None:
        if self.fault.raises(method):
            raise LookupError("no such robot")
        if self.fault.blocks(method):
            self.fault.release.wait(HANG)

    def begin(self, action):
        self.fault.called("start", action)
        self._misbehave("start")

    def step(self, dt):
        self.fault.called("wait")
        self._misbehave("wait")
        return dt

    def cancel(self, action):
        self.fault.called("cancel", action)
        self._misbehave("cancel")
        if self.fault.kind == "ignores":
            self._running.discard(action.ticket)

    def stop(self):
        self.fault.called("stop")
        self._misbehave("stop")


WORLDS: dict[str, Callable[[Fault], Any]] = {
    "World": Threaded,
    "AsyncWorld": Coroutines,
    "SteppedWorld": Stepped,
}
STARTED = ["(drive rover depot shelf)", "(unlock office)"]


def within(seconds: float, function: Callable[[], Any]) -> Any:
    """The answer of a function, in a thread; a failed test if it hangs."""
    pool = ThreadPoolExecutor(1)
    try:
        return pool.submit(function).result(seconds)
    finally:
        pool.shutdown(wait=False)


def end_with_handle(problem: elbowroom.Problem, world: Any, fault: Fault) -> elbowroom.Run:
    handle = elbowroom.Stop()

    def stop() -> None:
        fault.is_ready.wait(HANG)
        handle.stop()

    threading.Thread(target=stop, daemon=True).start()
    if isinstance(world, elbowroom.AsyncWorld):
        run = asyncio.run(problem.run_async(PLAN, world=world, stop=handle))
    else:
        run = problem.run(PLAN, world=world, stop=handle)
    assert handle.run is run
    return run


def end_with_signal(problem: elbowroom.Problem, world: Any, fault: Fault) -> elbowroom.Run:
    main = threading.main_thread().ident
    assert main is not None

    def interrupt() -> None:
        fault.is_ready.wait(HANG)
        signal.pthread_kill(main, signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    if not isinstance(world, elbowroom.AsyncWorld):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            run = problem.run(PLAN, world=world)
        (warning,) = caught
        assert warning.category is elbowroom.InterruptedWarning and "Ctrl-C" in str(warning.message)
        return run
    handle = elbowroom.Stop()
    with pytest.raises(KeyboardInterrupt):
        asyncio.run(problem.run_async(PLAN, world=world, stop=handle))
    return handle.run


def end_with_task(problem: elbowroom.Problem, world: Any, fault: Fault) -> elbowroom.Run:
    async def main() -> elbowroom.Run:
        handle = elbowroom.Stop()
        task = asyncio.create_task(problem.run_async(PLAN, world=world, stop=handle))
        while not fault.is_ready.is_set():
            await asyncio.sleep(0.01)
        task.cancel()
        with pytest.raises(asyncio.CancelledError) as caught:
            await task
        # Before Python 3.11, a task that is awaited raises another exception than its own.
        assert sys.version_info < (3, 11) or caught.value.run is handle.run
        return handle.run

    return asyncio.run(main())


def end_with_wait_for(problem: elbowroom.Problem, world: Any, fault: Fault) -> elbowroom.Run:
    async def main() -> elbowroom.Run:
        handle = elbowroom.Stop()
        running = problem.run_async(PLAN, world=world, stop=handle)
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(running, 1)
        return handle.run

    return asyncio.run(main())


ENDS = {
    "stop handle": end_with_handle,
    "Ctrl-C": end_with_signal,
    "task.cancel": end_with_task,
    "wait_for": end_with_wait_for,
}


def replays(run: elbowroom.Run) -> bool:
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder) / "trace.jsonl"
        trace.write_text(run.trace_text)
        command = [sys.executable, "-m", "elbowroom", "run", "--replay", str(trace)]
        return subprocess.run(command, timeout=10 * HANG).returncode == 0


def check(run: elbowroom.Run, fault: Fault) -> None:
    begun = time.monotonic()
    # Calls of a world that blocks are in threads of their own.
    while fault.names("stop") == [] and time.monotonic() - begun < HANG:
        time.sleep(0.01)
    assert fault.names("start") == STARTED
    assert fault.names("cancel") == STARTED
    assert fault.names("stop") == [""]
    events = [line["event"] for line in run.trace()]
    assert events[0] == "header" and events[-1] == "over"
    cancels = [line for line in run.trace() if line.get("command", {}).get("type") == "cancel"]
    assert len(cancels) == 2


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("kind", ["well", "blocks", "ignores"])
@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.filterwarnings("ignore::elbowroom.InterruptedWarning")
def test_run_ends_in_order(problem, monkeypatch, world: str, kind: str, end: str) -> None:
    if kind != "well":
        shorten(monkeypatch)
    fault = Fault(kind)
    begun = time.monotonic()
    run = ENDS[end](problem, WORLDS[world](fault), fault)
    fault.release.set()
    assert time.monotonic() - begun < HANG
    assert run.verdict == "interrupted"
    check(run, fault)
    assert end != "stop handle" or replays(run)
    outcomes = {row.outcome for row in run.rows()}
    if kind == "well":
        assert outcomes == {"cancelled"}
    elif kind == "ignores":
        assert outcomes == {None}


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("method", ["cancel", "stop"])
@pytest.mark.parametrize("kind", ["raises", "blocks"])
@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.filterwarnings("ignore::elbowroom.InterruptedWarning")
def test_faults_while_the_run_ends(
    problem, monkeypatch, world: str, kind: str, method: str, end: str
) -> None:
    shorten(monkeypatch)
    fault = Fault(kind, method)
    try:
        run = ENDS[end](problem, WORLDS[world](fault), fault)
    except elbowroom.WorldError as error:
        assert kind == "raises" and isinstance(error.__cause__, LookupError)
        run = error.run
    finally:
        fault.release.set()
    assert run.verdict == "interrupted"
    check(run, fault)


@pytest.mark.parametrize("method", ["start", "wait"])
@pytest.mark.parametrize(
    ("world", "is_async"),
    [*((name, True) for name in WORLDS), ("World", False), ("SteppedWorld", False)],
)
def test_raising_world_is_cancelled(problem, world: str, method: str, is_async: bool) -> None:
    fault = Fault("raises", method)

    def run() -> None:
        made = WORLDS[world](fault)
        if is_async:
            asyncio.run(problem.run_async(PLAN, world=made))
        else:
            problem.run(PLAN, world=made)

    with pytest.raises(elbowroom.WorldError, match="no such robot") as caught:
        within(HANG, run)
    assert isinstance(caught.value.__cause__, LookupError)
    failed = caught.value.run
    assert failed.verdict == "world-failed"
    started = fault.names("start")
    assert started == (STARTED if method == "wait" else started[:1])
    assert fault.names("cancel") == started and fault.names("stop") == [""]
    events = [line["event"] for line in failed.trace()]
    assert "world-failed" in events and events[-1] == "over"
    assert replays(failed)


def test_third_signal_ends_the_grace_period(problem, monkeypatch) -> None:
    monkeypatch.setattr(_lifecycle, "GRACE", 1000.0)
    fault = Fault("ignores")
    main = threading.main_thread().ident
    assert main is not None

    def interrupt() -> None:
        fault.is_ready.wait(HANG)
        for _ in range(3):
            signal.pthread_kill(main, signal.SIGINT)
            time.sleep(0.05)

    threading.Thread(target=interrupt, daemon=True).start()
    with pytest.warns(elbowroom.InterruptedWarning, match="have not ended"):
        run = problem.run(PLAN, world=Threaded(fault))
    check(run, fault)


def test_late_outcomes_are_recorded(problem) -> None:
    class Late(Threaded):
        def cancel(self, action):
            self.fault.called("cancel", action)
            later = elbowroom.ended(action, self.now(), "succeeded")
            threading.Timer(0.3, lambda: self.reports.append(later)).start()

    fault = Fault("well")
    run = end_with_handle(problem, Late(fault), fault)
    assert {row.outcome for row in run.rows()} == {"succeeded"}


def test_stop_is_called_after_a_normal_run(problem, plan: Path) -> None:
    fault = Fault("well")

    class Quick(Stepped):
        speed = None

        def step(self, dt):
            for action in [*self.ends]:
                if self.now >= self.ends[action]:
                    del self.ends[action]
                    self.succeeded(action)

        def begin(self, action):
            self.ends = getattr(self, "ends", {})
            self.ends[action] = self.now + action.duration

    assert problem.run(plan, world=Quick(fault)).verdict == "goal-reached"
    assert fault.calls == [("stop", "")]


def test_wall_time_limit_ends_a_blocking_world(problem, monkeypatch) -> None:
    shorten(monkeypatch)
    fault = Fault("blocks")
    with pytest.warns(elbowroom.InterruptedWarning, match="have not ended"):
        run = problem.run(PLAN, world=Threaded(fault), wall_time_limit=0.2)
    fault.release.set()
    assert run.verdict == "interrupted"
    check(run, fault)


def test_execution_is_stopped_in_order(problem, plan: Path) -> None:
    execution = problem.execution(plan)
    begun, cancelled = [], []
    execution_stopped = False
    while not isinstance(step := execution.next_command(), elbowroom.Over):
        if isinstance(step, elbowroom.Start):
            begun.append(step.action)
        elif isinstance(step, elbowroom.Cancel):
            cancelled.append(step.action)
        elif isinstance(step, elbowroom.Wait):
            if not execution_stopped:
                execution.stop()
                execution_stopped = True
            execution.observe(step.until, [elbowroom.ended(it, step.until, "cancelled") for it in cancelled])
    assert step.run.verdict == "interrupted" and cancelled == begun


CHILD = """
import asyncio, sys, threading
from test_lifecycle import *

signal.signal(signal.SIGINT, signal.default_int_handler)
problem = elbowroom.read(DELIVERY / "domain.pddl", DELIVERY / "problem.pddl")
fault, handle = Fault("ignores"), elbowroom.Stop()
world = WORLDS[sys.argv[1]](fault)
threading.Thread(target=lambda: (fault.is_ready.wait(), print("ready", flush=True)), daemon=True).start()
try:
    if isinstance(world, elbowroom.AsyncWorld):
        asyncio.run(problem.run_async(PLAN, world=world, stop=handle))
    else:
        problem.run(PLAN, world=world, stop=handle)
except KeyboardInterrupt:
    pass
signal.signal(signal.SIGINT, signal.SIG_IGN)
print(handle.run.verdict, fault.names("cancel") == STARTED, fault.names("stop") == [""])
"""


@pytest.mark.parametrize("signals", [2, 3])
@pytest.mark.parametrize("world", WORLDS)
def test_signals_to_a_process_end_its_run(world: str, signals: int) -> None:
    command = [sys.executable, "-c", CHILD, world]
    folder, package = Path(__file__).parent, Path(elbowroom.__file__).parents[1]
    environment = {**os.environ, "PYTHONPATH": str(package)}
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        for _ in range(signals):
            child.send_signal(signal.SIGINT)
            time.sleep(0.2)
        rest, _ = child.communicate(timeout=HANG)
    assert rest == "interrupted True True\n" and child.returncode == 0
