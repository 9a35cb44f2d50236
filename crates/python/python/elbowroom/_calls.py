"""Calls of a world's methods, in a thread of the world or in an event loop."""

from __future__ import annotations

import asyncio
import contextvars
import inspect
import queue
import threading
import weakref
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

Submit = Callable[..., "Future[Any]"]
"""Begins the call of a method, and returns its outcome."""

_Job = tuple["Future[Any]", Callable[..., Any], tuple[Any, ...]]


class WorldThread:
    """Calls methods in one thread.

    While a call blocks, the next one gets another thread. The lifecycle makes such calls only when a run ends.
    The threads are daemons: a blocked one does not keep the interpreter from exiting.
    """

    def __init__(self) -> None:
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._last: Future[Any] | None = None
        self._has_thread = False
        self._threads: weakref.WeakSet[threading.Thread] = weakref.WeakSet()

    @property
    def is_current(self) -> bool:
        """``True`` in a thread of this world."""
        return threading.current_thread() in self._threads

    def __call__(self, method: Callable[..., Any], *arguments: Any) -> Future[Any]:
        is_blocked = self._last is not None and not self._last.done()
        if is_blocked or not self._has_thread:
            self.close()
            self._jobs = queue.SimpleQueue()
            context = contextvars.copy_context()
            thread = threading.Thread(
                target=context.run, args=(_work, self._jobs), name="elbowroom-world", daemon=True
            )
            thread.start()
            self._threads.add(thread)
            self._has_thread = True
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        self._last = future
        self._jobs.put((future, method, arguments))
        return future

    def close(self) -> None:
        """Ends the thread after its present call."""
        self._jobs.put(None)
        self._has_thread = False


def _work(jobs: queue.SimpleQueue[_Job | None]) -> None:
    while (job := jobs.get()) is not None:
        future, method, arguments = job
        try:
            answer = method(*arguments)
        except BaseException as error:
            future.set_exception(error)
        else:
            future.set_result(answer)
        del job, future, method, arguments


class WorldLoop:
    """Calls methods, which may be coroutines, in an event loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop

    @property
    def is_current(self) -> bool:
        """``True`` in the thread of the event loop while it runs."""
        try:
            return asyncio.get_running_loop() is self._loop
        except RuntimeError:
            return False

    def __call__(self, method: Callable[..., Any], *arguments: Any) -> Future[Any]:
        async def call() -> Any:
            made = method(*arguments)
            return await made if inspect.isawaitable(made) else made

        return asyncio.run_coroutine_threadsafe(call(), self._loop)

    def close(self) -> None:
        """Does nothing: the event loop belongs to the caller."""


def has_coroutines(world: object) -> bool:
    """Returns ``True`` if methods of a world are coroutines."""
    methods = (getattr(world, name, None) for name in ("start", "cancel", "wait", "look", "resume", "stop"))
    return any(inspect.iscoroutinefunction(method) for method in methods)
