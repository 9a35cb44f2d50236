"""The run of an executive: in a separate thread, until its orderly end."""

from __future__ import annotations

import asyncio
import contextvars
import threading
import time
import warnings
import weakref
from types import TracebackType
from typing import Any, NoReturn, TypeVar

from . import _native
from ._answers import Run
from ._calls import has_coroutines
from ._errors import ExecutiveError, InterruptedWarning
from ._lifecycle import POLL_INTERVAL, CtrlC, Lifecycle
from ._numbers import document
from ._runs import concluded, world_lifecycle
from ._texts import checked_time_limit
from ._world import AsyncWorld

ENDING_TIME = 2.0
"""Seconds for the failure of an ending run to be known."""

ABANDON_TIME = 1.0
"""Seconds for the run to end after the third Ctrl-C."""


Self = TypeVar("Self", bound="BackgroundRun")


class BackgroundRun:
    """Run of an executive in the background, and its end."""

    def _start(self, native: _native.Executive, world: Any) -> None:
        self._native = native
        self._lifecycle: Lifecycle | None = None
        if world is not None:
            self._lifecycle = world_lifecycle(world, native.request_stop, loop=_loop(world))
        self._over = threading.Event()
        self._run: Run | None = None
        self._failure: BaseException | None = None
        self._late: list[str] = []
        context = contextvars.copy_context()
        # No daemon: native code must not run while the interpreter is finalized.
        self._thread = threading.Thread(
            target=context.run, args=(self._work,), name="elbowroom-executive"
        )
        self._thread.start()
        _stop_after_main(self)

    def _work(self) -> None:
        try:
            self._execute()
        except BaseException as error:
            self._failure = error
        finally:
            if self._lifecycle is not None:
                self._lifecycle.release()
            self._over.set()

    def _execute(self) -> None:
        lifecycle = self._lifecycle
        try:
            answer, record, lost, raised = self._native.run(lifecycle)
        except BaseException:
            if lifecycle is not None and lifecycle.is_begun:
                lifecycle.finish()
            raise
        failure = None if lifecycle is None else lifecycle.finish()
        self._run = Run(document(answer), record)
        self._late = concluded(self._run, raised, failure, lifecycle)
        if lost is not None:
            raise ExecutiveError(
                f"the journal cannot be written: {lost}; free some disk space, and resume the run from it",
                self._run,
            )

    @property
    def is_over(self) -> bool:
        """``True`` once the executive has ended."""
        return self._over.is_set()

    def request_stop(self) -> None:
        """Requests an orderly end, and returns at once. For signal handlers, and for methods of the world."""
        if self._lifecycle is None:
            self._native.request_stop()
        else:
            self._lifecycle.request_end()

    def stop(self) -> Run:
        """Stops the executive in order, within 6 s, and returns the run.

        A first and a second Ctrl-C meanwhile are raised afterwards; a third ends the run at once.

        Raises:
            WorldError: if the world has failed.
            ExecutiveError: if the journal cannot be written.
        """
        self._refuse_in_world("stop")
        self.request_stop()
        lifecycle = self._lifecycle
        if lifecycle is not None:
            before = lifecycle.interrupts
            with CtrlC(lifecycle):
                self._await_end(lifecycle)
            if lifecycle.interrupts > before:
                raise KeyboardInterrupt
        run = self.join()
        assert run is not None
        return run

    def join(self, timeout: float | None = None) -> Run | None:
        """Waits until the executive has ended. Returns the run, or ``None`` after ``timeout`` seconds.

        Raises:
            WorldError: if the world has failed.
            ExecutiveError: if the journal cannot be written.
        """
        self._refuse_in_world("join")
        limit = checked_time_limit(timeout)
        if not self._over.wait(None if limit is None else min(limit, threading.TIMEOUT_MAX)):
            return None
        if self._failure is not None:
            raise self._failure
        late, self._late = self._late, []
        for message in late:
            warnings.warn(message, InterruptedWarning, 3)
        return self._run

    def _await_end(self, lifecycle: Lifecycle) -> None:
        abandoned: float | None = None
        while not self._over.wait(POLL_INTERVAL):
            if lifecycle.is_abandoned:
                abandoned = abandoned or time.monotonic()
                if time.monotonic() - abandoned > ABANDON_TIME:
                    return

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if isinstance(error, KeyboardInterrupt) and self._lifecycle is not None:
            self._lifecycle.interrupt()
        try:
            self.stop()
        except BaseException:
            # The first exception is raised.
            if error is None:
                raise

    async def __aenter__(self: Self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # The event loop continues, for the coroutines of the world.
        await asyncio.to_thread(self.__exit__, kind, error, trace)

    def _is_in_world(self) -> bool:
        return self._lifecycle is not None and self._lifecycle.is_in_world

    def _refuse_in_world(self, method: str) -> None:
        if self._is_in_world():
            raise RuntimeError(
                f"{method}() waits for the world and cannot be called in the world's thread or "
                f"event loop; call request_stop(), or `await "
                f"asyncio.to_thread(executive.{method}, …)`"
            )

    def _raise_ended(self) -> NoReturn:
        self._over.wait(ENDING_TIME)
        if self._failure is not None:
            raise self._failure
        raise ExecutiveError("the executive has ended", self._run)


def _loop(world: object) -> asyncio.AbstractEventLoop | None:
    """The running event loop, for a world whose methods are coroutines."""
    if not (isinstance(world, AsyncWorld) or has_coroutines(world)):
        return None
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        raise TypeError("this world has coroutines; create the executive in a coroutine") from None


_running: weakref.WeakSet[BackgroundRun] = weakref.WeakSet()
_watcher: threading.Thread | None = None
_lock = threading.Lock()


def _stop_after_main(executive: BackgroundRun) -> None:
    """Stops an executive when the main thread has ended, so that the process can exit."""
    global _watcher
    with _lock:
        _running.add(executive)
        if _watcher is None or not _watcher.is_alive():
            _watcher = threading.Thread(target=_stop_all, name="elbowroom-exit")
            _watcher.start()


def _stop_all() -> None:
    threading.main_thread().join()
    with _lock:
        executives = list(_running)
    for executive in executives:
        executive.request_stop()
