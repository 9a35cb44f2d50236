"""The lifecycle of a world: calls during a run, and the orderly end of the run.

Whatever ends a run, the running actions are cancelled, late outcomes are recorded, and the world's ``stop`` is
called. A world that raises, blocks or ignores *cancel* cannot delay the end beyond :data:`GRACE` and
:data:`STOP_TIME`.
"""

from __future__ import annotations

import asyncio
import json
import queue
import signal
import threading
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from fractions import Fraction
from typing import Any

from ._calls import WorldLoop, WorldThread
from ._clock import ClockCheck, Overdue
from ._errors import ClockWarning
from ._world import Action, Observation, ended, passage, wire

GRACE = 5.0
"""Seconds on the real clock for late outcomes after a request to end the run."""

STOP_TIME = 1.0
"""Further seconds for the world's ``stop``."""

PATIENCE = 0.5
"""Seconds for a pending call to return before ``cancel`` is called concurrently."""

BRIEF = 0.05
"""Least time limit of a call, in seconds."""


POLL_INTERVAL = 0.1
"""Longest time until a signal is noticed, in seconds."""


class Blocked(Exception):
    """The world has not answered within the grace period."""


class Lifecycle:
    """Passes commands and waits of a run to a world, and ends the run on request.

    The native module calls ``recall``, ``start``, ``cancel``, ``wait``, ``look`` and ``begin_end``, all in one thread.
    :meth:`request_end` and :meth:`interrupt` may be called from any thread and from signal handlers.
    """

    def __init__(
        self,
        world: Any,
        submit: WorldThread | WorldLoop,
        request_stop: Callable[[], None],
        time_limit: float | None = None,
    ) -> None:
        self._world = world
        self._submit = submit
        self._request_stop = request_stop
        self._time_limit = None if time_limit is None else time.monotonic() + time_limit
        self._actions: dict[int, Action] = {}
        self._open: dict[int, Action] = {}
        self._cancelled: set[int] = set()
        self._unstarted: list[Observation] = []
        self._now = "0"
        self._inbox: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._pending_wait: Future[Any] | None = None
        self._unfinished: list[Future[Any]] = []
        # Real time of the first request to end, or of the first failure.
        self._ends_since: float | None = None
        # The run has cancelled its actions, or does so next; waits are for late outcomes only.
        self._is_closing = False
        self._is_abandoned = False
        # The clock of a resumed world restarts at its next answer.
        self._is_clock_new = False
        # The first failure after the request to end.
        self._failure: Exception | None = None
        self._interrupts = 0
        self._callables = 0
        self.clock = ClockCheck()
        self.is_begun = False
        self._is_released = False
        self.is_ended_early = False

    # Requests from outside.

    def request_end(self) -> None:
        """Ends the run in order."""
        if self._ends_since is None:
            self._ends_since = time.monotonic()
        self._request_stop()
        self._inbox.put(None)

    def interrupt(self) -> None:
        """Ends the run in order at the first call, and without further waits at the third."""
        self._interrupts += 1
        if self._interrupts >= 3:
            self._is_abandoned = True
        self.request_end()

    @property
    def interrupts(self) -> int:
        """The number of calls of :meth:`interrupt`."""
        return self._interrupts

    @property
    def is_interrupted(self) -> bool:
        """``True`` after :meth:`interrupt`."""
        return self._interrupts > 0

    @property
    def is_ending(self) -> bool:
        """``True`` once the run is to end."""
        return self._ends_since is not None

    @property
    def is_abandoned(self) -> bool:
        """``True`` after the third :meth:`interrupt`."""
        return self._is_abandoned

    def foreign(self, function: Callable[..., Any] | None) -> Callable[..., Any] | None:
        """Returns a callback of the run in which Ctrl-C raises :class:`KeyboardInterrupt`."""
        if function is None:
            return None
        callback = function

        def call(*arguments: Any) -> Any:
            self._callables += 1
            try:
                return callback(*arguments)
            finally:
                self._callables -= 1

        return call

    @property
    def is_in_callback(self) -> bool:
        """``True`` during calls of :meth:`foreign` callbacks."""
        return self._callables > 0

    def abandon(self) -> None:
        """Ends the run without further waits."""
        self._is_abandoned = True
        self.request_end()

    @property
    def is_in_world(self) -> bool:
        """``True`` in the thread in which methods of the world are called: nothing may wait for the run there."""
        return self._submit.is_current

    # Calls from the native module.

    def recall(self, now: str, running: list[tuple[int, str, str | None, str]]) -> str | None:
        self._now = now
        self._is_clock_new = True
        resume = getattr(self._world, "resume", None)
        if resume is None:
            return None
        actions = [
            Action(ticket, name, None if duration is None else Fraction(duration), Fraction(ordered))
            for ticket, name, duration, ordered in running
        ]
        # If the world raises, they are cancelled.
        known = {action.ticket: action for action in actions}
        self._actions.update(known)
        self._open.update(known)
        answer = self._call(resume, Fraction(now), actions)
        if answer is None:
            for ticket in known:
                del self._actions[ticket], self._open[ticket]
            return None
        try:
            passed = passage(answer, "resume")
        except Exception:
            self.begin_end()
            raise
        self._now = passed["now"]
        self.clock.begin(Fraction(self._now))
        self._is_clock_new = False
        reported = {fields.get("ticket") for fields in passed["observations"]}
        for ticket in known.keys() - reported:
            # The start has failed.
            del self._open[ticket]
        self._note(passed["observations"])
        return json.dumps(passed)

    def start(self, now: str, ticket: int, name: str, duration: str | None) -> None:
        lasts = None if duration is None else Fraction(duration)
        action = Action(ticket, name, lasts, Fraction(now))
        self._now = now
        # A start that raises or blocks may have begun the action.
        self._actions[ticket] = self._open[ticket] = action
        self._call(self._world.start, action)

    def cancel(self, now: str, ticket: int) -> None:
        self._now = now
        action = self._actions.get(ticket)
        if action is None:
            # The world did not receive this start.
            why = "the world failed before it was started"
            self._unstarted.append(ended(ticket, Fraction(now), "cancelled", why))
        elif ticket not in self._cancelled:
            self._cancelled.add(ticket)
            self._call(self._world.cancel, action)

    def wait(self, until: str) -> str:
        if self._unstarted:
            unstarted, self._unstarted = self._unstarted, []
            return json.dumps(passage((Fraction(self._now), unstarted)))
        if self._ends_since is not None and not self._is_closing:
            self._is_closing = True
            return self._nothing()
        future, self._pending_wait = self._pending_wait, None
        if future is None:
            future = self._begin(self._world.wait, Fraction(until))
        overdue = self.clock.expect(Fraction(until))
        if not self._await(future, self._is_closing, overdue=overdue):
            if self._is_closing:
                raise Blocked("the world did not answer in time")
            self._pending_wait, self._is_closing = future, True
            return self._nothing()
        try:
            answer = self._outcome(future)
            if self._is_interrupted_call(future):
                self._is_closing = True
                return self._nothing()
            passed = passage(answer)
            self._check_clock(Fraction(until), Fraction(passed["now"]), not passed["observations"])
        except Exception:
            self.begin_end()
            raise
        self._now = passed["now"]
        self._note(passed["observations"])
        return json.dumps(passed)

    def look(self, facts: list[str], fluents: list[str]) -> str:
        look = getattr(self._world, "look", None)
        seen: Sequence[Observation] = ()
        if look is not None and not self._is_closing:
            seen = self._call(look, facts, fluents) or ()
        try:
            return json.dumps(wire(seen))
        except Exception:
            self.begin_end()
            raise

    def begin_end(self) -> None:
        """Begins the grace period after a failure of the world."""
        if self._ends_since is None:
            self._ends_since = time.monotonic()
        self._is_closing = True

    # The end.

    def finish(self) -> Exception | None:
        """Cancels the remaining actions, and calls ``stop`` of the world. Returns the first exception since the
        run was to end."""
        since = self._ends_since
        self.is_ended_early = since is not None
        begun = time.monotonic()
        self._is_closing = True
        self._ends_since = begun if since is None else since
        try:
            return self._stop_world(since, begun)
        finally:
            self._submit.close()
            self.release()

    def release(self) -> None:
        """Lets another run use the world."""
        self._is_released = True

    @property
    def is_released(self) -> bool:
        """``True`` after :meth:`finish` or :meth:`release`."""
        return self._is_released

    def _stop_world(self, since: float | None, begun: float) -> Exception | None:
        for ticket in [*self._open]:
            self.cancel(self._now, ticket)
        stop = getattr(self._world, "stop", None)
        if stop is not None:
            future = self._begin(stop)
            last = (begun if since is None else since) + GRACE + STOP_TIME
            if self._await(future, True, max(last, begun + BRIEF)):
                error = None if future.cancelled() else future.exception()
                if isinstance(error, Exception):
                    self._failure = self._failure or error
        for future in self._unfinished:
            future.cancel()
        return self._failure

    @property
    def running(self) -> list[str]:
        """The actions that were started and have not ended."""
        return [action.name for action in self._open.values()]

    # Helpers.

    def _begin(self, method: Callable[..., Any], *arguments: Any) -> Future[Any]:
        self.is_begun = True
        future = self._submit(method, *arguments)
        future.add_done_callback(lambda _: self._inbox.put(None))
        self._unfinished = [it for it in self._unfinished if not it.done()]
        self._unfinished.append(future)
        return future

    def _call(self, method: Callable[..., Any], *arguments: Any) -> Any:
        """Returns the answer of a method, or ``None`` if the run is to end and the method still runs."""
        was_ending = self.is_ending
        future = self._begin(method, *arguments)
        if not self._await(future, False):
            return None
        try:
            return self._outcome(future)
        except Exception as error:
            if was_ending:
                # Raised after the run, once the other actions are cancelled as well.
                self._failure = self._failure or error
                return None
            self.begin_end()
            raise

    def _outcome(self, future: Future[Any]) -> Any:
        if future.cancelled():
            # The event loop ends.
            self.request_end()
            return None
        if isinstance(future.exception(), KeyboardInterrupt):
            self.interrupt()
            return None
        return future.result()

    def _is_interrupted_call(self, future: Future[Any]) -> bool:
        return future.cancelled() or isinstance(future.exception(), KeyboardInterrupt)

    def _await(
        self,
        future: Future[Any],
        is_late: bool,
        last: float | None = None,
        overdue: Overdue | None = None,
    ) -> bool:
        """Returns ``True`` once a call has returned, and ``False`` if it runs out of time.

        Calls have no time limit before the run is to end. After that, ``is_late`` calls have until ``last``, by default
        the end of the grace period.
        """
        begun = time.monotonic()
        while not future.done():
            now = time.monotonic()
            limit = self._time_limit
            if self._ends_since is not None:
                limit = max(self._ends_since + PATIENCE, begun + BRIEF)
                if is_late:
                    limit = self._ends_since + GRACE if last is None else last
                if self._is_abandoned:
                    limit = begun + BRIEF
            if limit is not None and now >= limit:
                if self._ends_since is not None:
                    return False
                self.request_end()
                continue
            if overdue is not None and now - begun > overdue.after and not self.is_ending:
                self.clock.messages.append(overdue.message)
                warnings.warn(overdue.message, ClockWarning, 2)
                overdue = None
            try:
                # A signal that arrives just before the wait does not end it.
                left = POLL_INTERVAL if limit is None else limit - now
                self._inbox.get(timeout=min(left, POLL_INTERVAL))
            except queue.Empty:
                pass
            except KeyboardInterrupt:
                self.interrupt()
        return True

    def _nothing(self) -> str:
        return json.dumps(passage((Fraction(self._now), ())))

    def _check_clock(self, until: Fraction, now: Fraction, is_silent: bool) -> None:
        if self._is_clock_new:
            self._is_clock_new = False
            self.clock.begin(now)
        # A wait that is cut short at the end of the run continues beyond its time.
        elif not self._is_closing:
            message = self.clock.note(until, now, is_silent)
            if message is not None:
                warnings.warn(message, ClockWarning, 2)

    def _note(self, observations: Sequence[dict[str, Any]]) -> None:
        for fields in observations:
            action = self._open.get(fields.get("ticket", -1))
            if action is None:
                continue
            is_instantaneous = action.duration is None and fields.get("type") == "started"
            if is_instantaneous or fields.get("type") == "ended":
                del self._open[action.ticket]


class CtrlC:
    """Context manager that passes Ctrl-C to a lifecycle, in the main thread.

    With ``takes_over``, it also replaces another handler, such as that of :func:`asyncio.run`. The other handler
    receives the signal at the end, if there was one.
    """

    def __init__(self, lifecycle: Lifecycle, takes_over: bool = False) -> None:
        self._lifecycle = lifecycle
        self._takes_over = takes_over
        self._previous: Any = None
        self._is_received = False

    def __enter__(self) -> None:
        is_main = threading.current_thread() is threading.main_thread()
        previous = signal.getsignal(signal.SIGINT)
        if is_main and callable(previous):
            if self._takes_over or previous is signal.default_int_handler:
                signal.signal(signal.SIGINT, self._receive)
                self._previous = previous

    def __exit__(self, *_: object) -> None:
        if self._previous is None:
            return
        signal.signal(signal.SIGINT, self._previous)
        if self._takes_over and self._is_received:
            try:
                asyncio.get_running_loop().call_soon(signal.raise_signal, signal.SIGINT)
            except RuntimeError:
                pass  # the event loop is closed

    def _receive(self, _number: int, _frame: object) -> None:
        self._is_received = True
        self._lifecycle.interrupt()
        if not self._takes_over and self._lifecycle.is_in_callback:
            raise KeyboardInterrupt
