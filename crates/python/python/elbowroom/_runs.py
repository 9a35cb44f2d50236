"""Runs: from the arguments of a caller to the result, in the caller's thread or in a thread next to an event loop."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import threading
import time
import warnings
from collections.abc import Callable
from typing import Any

from . import _native
from ._answers import Run
from ._calls import WorldLoop, WorldThread, has_coroutines
from ._errors import InterruptedWarning, RequestError, WorldError
from ._lifecycle import GRACE, POLL_INTERVAL, STOP_TIME, Blocked, CtrlC, Lifecycle
from ._numbers import document, text, timeout_text
from ._stepped import SteppedAdapter, SteppedWorld
from ._stop import Stop
from ._texts import PlannerCallable, checked_time_limit, named_text, native_planner
from ._world import AsyncWorld

_TEXTS = (
    "precision", "planning_budget", "planning_time", "realtime", "time_limit", "planner_time", "epsilon",
)  # fmt: skip

_MARGIN = 1.0
"""Further seconds after which a cancelled task no longer waits for a planner that blocks."""


def run_options(
    executor: str, planner: object, seed: int, options: dict[str, Any]
) -> dict[str, Any]:
    """Returns the specification of a run, as the native module reads it."""
    chosen: dict[str, Any] = {"executor": executor, "seed": seed}
    chosen["planner"] = planner if isinstance(planner, str) else "embedded"
    if not isinstance(planner, str) and options.get("jobs") is not None:
        raise RequestError("`jobs` is the number of threads of the embedded planner")
    if not isinstance(planner, str) and options.get("self_overlap"):
        raise RequestError("`self_overlap` applies only to the embedded planner")
    for name, value in options.items():
        if name in _TEXTS and value is not None and value != "measured":
            value = text(value)
        if name == "timeout":
            if value is None:
                continue
            value = timeout_text(value)
        if name == "vary" and isinstance(value, str):
            value = [value]
        if name == "likelihoods" and isinstance(value, str):
            file, likelihoods = named_text(value, "likelihoods")
            value = {"name": file, "text": likelihoods}
        if name == "believed" and isinstance(value, (str, os.PathLike)):
            value = named_text(value, "world")[1]
        chosen[name] = value
    return chosen


_worlds_in_use: list[tuple[object, Lifecycle]] = []
"""The worlds of runs that have not ended."""

_worlds_lock = threading.Lock()


def world_lifecycle(
    world: Any,
    request_stop: Callable[[], None],
    limit: float | None = None,
    loop: asyncio.AbstractEventLoop | None = None,
) -> Lifecycle:
    """The lifecycle of a world in Python. With ``loop``, its methods may be coroutines of that event loop.

    Raises:
        RequestError: if another run uses the world.
    """
    is_in_loop = isinstance(world, AsyncWorld) or has_coroutines(world)
    submit = WorldLoop(loop) if loop is not None and is_in_loop else WorldThread()
    lifecycle: Lifecycle | None = None
    owner = world
    with _worlds_lock:
        _worlds_in_use[:] = [it for it in _worlds_in_use if not it[1].is_released]
        if any(it is owner for it, _ in _worlds_in_use):
            raise RequestError(
                "another run uses this world: the two would take each other's observations; "
                "give each run a separate world, or wait for the end of the other run"
            )
        if isinstance(world, SteppedWorld):
            world = SteppedAdapter(world, lambda: lifecycle is not None and lifecycle.is_ending)
        lifecycle = Lifecycle(world, submit, request_stop, limit)
        _worlds_in_use.append((owner, lifecycle))
    return lifecycle


def description(world: object) -> str:
    """The description of a world in Python in a specification. Its behaviour is unknown."""
    return f"python {type(world).__qualname__}"


def concluded(
    run: Run,
    raised: BaseException | None,
    failure: Exception | None,
    lifecycle: Lifecycle | None,
) -> list[str]:
    """Warnings about the end of a run. ``raised`` is the exception of the world, ``failure`` one after its end.

    Raises:
        WorldError: if the world has failed.
    """
    if lifecycle is not None:
        run.warnings += lifecycle.clock.messages
    raised = failure if raised is None or isinstance(raised, Blocked) else raised
    if raised is not None:
        raise WorldError(f"{type(raised).__name__}: {raised}", run) from raised
    if run.verdict == "world-failed":
        raise WorldError(f"the world violated its contract: {run.why}", run)
    if lifecycle is None or not (lifecycle.is_ended_early and lifecycle.running):
        return []
    running = ", ".join(lifecycle.running)
    return [f"these actions were cancelled, and have not ended: {running}"]


class RunRequest:
    """A run that has not begun. With ``loop``, methods of the world are coroutines of that event loop."""

    def __init__(
        self,
        problem: _native.Task,
        plan: tuple[str, str] | None,
        *,
        world: Any = None,
        executor: str = _native.DEFAULT_EXECUTOR,
        planner: str | PlannerCallable = "embedded",
        seed: int = 0,
        trace: bool = True,
        wall_time_limit: float | None = None,
        progress: Callable[..., object] | None = None,
        stop: Stop | None = None,
        loop: asyncio.AbstractEventLoop | None = None,
        **options: Any,
    ) -> None:
        self._problem, self._plan, self._trace = problem, plan, trace
        self._chosen = run_options(executor, planner, seed, options)
        self._limit = checked_time_limit(wall_time_limit)
        self._planner, self._progress, self._handle = native_planner(planner), progress, stop
        self._stop = _native.Stop()
        self._lifecycle: Lifecycle | None = None
        if isinstance(world, (str, os.PathLike)):
            self._chosen["world"] = named_text(world, "world")[1]
        elif isinstance(world, AsyncWorld) and loop is None:
            raise TypeError("this world has coroutines; `await problem.run_async(…)`")
        elif world is not None:
            self._chosen["world_process"] = description(world)
            self._lifecycle = world_lifecycle(world, self._stop.request, self._limit, loop)

    def execute(self) -> tuple[Run, str | None]:
        """Executes the run. Returns it, and a warning.

        Raises:
            WorldError: if the world fails.
        """
        handle, lifecycle = self._handle, self._lifecycle
        end = self._stop.request if lifecycle is None else lifecycle.request_end
        if handle is not None:
            handle._connect(end)
        try:
            if lifecycle is None:
                return self._result(self._answer(), None)
            with CtrlC(lifecycle):
                try:
                    answer = self._answer()
                except BaseException:
                    if lifecycle.is_begun:
                        lifecycle.finish()
                    raise
                failure = lifecycle.finish()
            return self._result(answer, failure)
        finally:
            if lifecycle is not None:
                lifecycle.release()
            if handle is not None:
                handle._disconnect(end)

    async def execute_async(self) -> Run:
        """Executes the run in a thread next to the event loop. If the task is cancelled, the run ends in order."""
        loop = asyncio.get_running_loop()
        over: asyncio.Future[tuple[Run, str | None]] = loop.create_future()

        def finish(result: tuple[Run, str | None] | BaseException) -> None:
            if over.done():
                return
            if isinstance(result, BaseException):
                over.set_exception(result)
            else:
                over.set_result(result)

        def work() -> None:
            try:
                result: tuple[Run, str | None] | BaseException = self.execute()
            except BaseException as error:
                result = error
            try:
                loop.call_soon_threadsafe(finish, result)
            except RuntimeError:
                pass  # the event loop was closed meanwhile

        # No daemon: native code must not run while the interpreter is finalized.
        threading.Thread(target=work, name="elbowroom-run").start()
        try:
            cancelled = await self._ended(over)
        finally:
            if not over.done():
                self._abandon()
        if cancelled is None:
            run, warning = over.result()
            if warning is not None:
                warnings.warn(warning, InterruptedWarning, 3)
            return run
        failure = over.exception() if over.done() else None
        run_so_far = getattr(failure, "run", None)
        if over.done() and failure is None:
            run_so_far, _ = over.result()
        cancelled.run = run_so_far  # type: ignore[attr-defined]
        raise cancelled from failure

    async def _ended(self, over: asyncio.Future[Any]) -> asyncio.CancelledError | None:
        """Waits for the end of the run. Returns the first cancellation of the task."""
        lifecycle = self._lifecycle
        assert lifecycle is not None
        cancelled: asyncio.CancelledError | None = None
        deadline: float | None = None
        with contextlib.ExitStack() as handlers:
            while not over.done():
                left = None if deadline is None else deadline - time.monotonic()
                if left is not None and left <= 0:
                    break
                try:
                    # A signal that arrives just before the wait does not end it.
                    timeout = POLL_INTERVAL if left is None else min(left, POLL_INTERVAL)
                    await asyncio.wait({over}, timeout=timeout)
                except asyncio.CancelledError as error:
                    now = time.monotonic()
                    lifecycle.interrupt()
                    if cancelled is None:
                        cancelled, deadline = error, now + GRACE + STOP_TIME + _MARGIN
                        handlers.enter_context(CtrlC(lifecycle, takes_over=True))
                    elif lifecycle.is_abandoned:
                        deadline = min(deadline or now, now) + _MARGIN
        return cancelled

    def _abandon(self) -> None:
        if self._lifecycle is not None:
            self._lifecycle.abandon()

    def _answer(self) -> tuple[str, str | None, bool, BaseException | None]:
        lifecycle, planner, progress = self._lifecycle, self._planner, self._progress
        if lifecycle is not None:
            planner, progress = lifecycle.foreign(planner), lifecycle.foreign(progress)
        return _native.run(
            self._problem,
            self._plan,
            json.dumps(self._chosen),
            lifecycle,
            planner,
            self._trace,
            self._limit,
            progress,
            self._stop,
        )

    def _result(
        self, answered: tuple[str, str | None, bool, BaseException | None], failure: Exception | None
    ) -> tuple[Run, str | None]:
        answer, record, is_interrupted, raised = answered
        run, lifecycle = Run(document(answer), record), self._lifecycle
        if self._handle is not None:
            self._handle.run = run
        said = concluded(run, raised, failure, lifecycle)
        if lifecycle is not None:
            is_interrupted = lifecycle.is_interrupted
        elif self._handle is not None and self._handle.is_requested:
            is_interrupted = False
        if is_interrupted:
            said.insert(0, "interrupted by Ctrl-C; this is the best answer so far")
        return run, "; ".join(said) or None
