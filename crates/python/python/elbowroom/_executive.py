"""Executives: runs that accept goals until they are stopped, and resume after a crash."""

from __future__ import annotations

import json
import os
import time
import warnings
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

from . import _executive_answers as answers
from . import _native
from ._background_run import BackgroundRun
from ._errors import ExecutiveError, ExecutiveWarning, RequestError
from ._executive_answers import Goal, PlannedAction, Status, WhatIf
from ._lifecycle import POLL_INTERVAL
from ._numbers import Number, document, text
from ._problem import read
from ._runs import description, run_options
from ._stepped import SteppedWorld
from ._texts import Text, checked_time_limit, named_text
from ._world import Action, AsyncWorld, World

ACCEPT_TIME = 2.0
"""Seconds to wait until the run has processed a request. If it takes longer, the run processes the request later."""

JOURNAL_SIZE = 10_000_000
"""Length from which a journal is rotated by default, in bytes."""


class Executive(BackgroundRun):
    """Run that accepts goals, facts and pauses until it is stopped. With a journal, it resumes after a crash.

    It runs in the background from its creation on. All methods can be called from any thread. Leaving a ``with`` block
    stops it in order, and so does the end of the main thread: running actions are cancelled, their ends are awaited for
    at most 5 s, and the world's ``stop`` is called.

    >>> with elbowroom.Executive(DOMAIN, PROBLEM, realtime=20) as executive:
    ...     home = executive.submit("(at rover depot)")
    ...     bool(executive.wait("problem")), bool(executive.wait(home))
    (True, True)
    >>> executive.stop().verdict
    'interrupted'
    """

    warnings: list[str]
    """Warnings about the journal and the clock of a resumed run."""

    def __init__(
        self,
        domain: Text,
        problem: Text,
        *,
        world: World | AsyncWorld | SteppedWorld | Text | None = None,
        journal: str | os.PathLike[str] | None = None,
        learn: str | os.PathLike[str] | None = None,
        executor: str = _native.DEFAULT_EXECUTOR,
        planner: str = "embedded",
        seed: int = 0,
        epsilon: Number = "0.001",
        journal_size: int = JOURNAL_SIZE,
        journal_segments: int = 1,
        planner_memory: int | None = None,
        **options: Any,
    ) -> None:
        """Starts an executive.

        Args:
            domain: the domain in PDDL: a path, or the text.
            problem: the problem. Its goal is the first one, with the name ``problem``.
            world: a world in Python, or a world file (``docs/reference/formats/world.md``) for a simulation on the real clock;
                without one, all durations and outcomes are as planned. The methods of an ``AsyncWorld`` are called in the running
                event loop.
            journal: a new file, from which :meth:`resume` continues after a crash. For worlds in Python, and for
                ``world_process="COMMAND"``.
            learn: a folder for logs and for ``world.toml``, the model learnt from the journal when the executive is idle
                and at the end
                (``docs/reference/learning.md``). ``believed=`` is the model that the executor believes.
            executor: the name of the executor; :func:`elbowroom.executors` lists them.
            planner: ``"embedded"``, another planner's name, or a command line.
            seed: the random seed of a simulated world.
            epsilon: the least separation of interfering happenings.
            journal_size: the length from which the journal is rotated, in bytes.
            journal_segments: the number of earlier segments that are kept.
            planner_memory: limit on the memory of planning, in bytes above that of the process; 1000 MB by default.
            options: further members of a run's specification, as for :meth:`elbowroom.Problem.run`:
                ``planning_budget``, ``realtime`` (simulated seconds in one real second), ``timeout``, ``max_replans``,
                ``world_process``, ``jobs``, …

        Raises:
            ReadError: if the domain, the problem or the world file cannot be read.
            RequestError: if the options contradict each other.
            ExecutiveError: if the journal exists or cannot be written.
        """
        if not isinstance(planner, str):
            raise RequestError("an executive needs the name or the command line of a planner")
        if "planning_time" in options:
            raise RequestError("an executive measures its planning time; leave out `planning_time`")
        native = read(domain, problem, epsilon=epsilon)._native
        chosen = run_options(executor, planner, seed, options)
        if isinstance(world, (str, os.PathLike)):
            chosen["world"] = named_text(world, "world")[1]
            world = None
        elif world is not None:
            chosen["world_process"] = description(world)
            chosen["embedded_world"] = True
        segments = _segments(journal_size, journal_segments)
        given = json.dumps(chosen)
        self._begin()
        self._start(
            _native.Executive(native, given, journal, learn, segments, planner_memory, self._warn),
            world,
        )

    @classmethod
    def resume(
        cls,
        journal: str | os.PathLike[str],
        world: World | AsyncWorld | SteppedWorld | None = None,
        *,
        learn: str | os.PathLike[str] | None = None,
        journal_size: int = JOURNAL_SIZE,
        journal_segments: int = 1,
        planner_memory: int | None = None,
    ) -> Executive:
        """Resumes the run of a journal whose process has died.

        Goals, facts and pauses are restored, and no action in the journal is started again. The world reports the outcomes of
        actions that were running (:meth:`elbowroom.World.resume`).

        Args:
            journal: the journal.
            world: a new world for a run in a world in Python; ``None`` for one that is a process.
            learn: the folder of a model, as at the start.

        Raises:
            ExecutiveError: if the journal cannot be read, is damaged, is written by another process, or is that of a
                finished run; or if the world is missing.
        """
        executive = cls.__new__(cls)
        executive._begin()
        segments = _segments(journal_size, journal_segments)
        native = _native.Executive.resume(journal, learn, segments, planner_memory, executive._warn)
        name = native.embedded_world()
        if name is not None and world is None:
            raise ExecutiveError(
                f"the world of this run is a Python object, `{name}`; pass such a world"
            )
        if name is None and world is not None:
            raise ExecutiveError("the world of this run is a process; leave out the world")
        executive._start(native, world)
        return executive

    def _begin(self) -> None:
        self.warnings = []
        # Times before the submissions of goals, by name: earlier goals may have had the same names.
        self._given: dict[str, Fraction] = {}

    def _warn(self, message: str) -> None:
        self.warnings.append(message)
        warnings.warn(message, ExecutiveWarning, 2)

    # Requests.

    def submit(
        self,
        goal: str,
        *,
        name: str | None = None,
        value: Number | None = None,
        deadline: Number | None = None,
        within: Number | None = None,
        release: Number | None = None,
        after: Number | None = None,
        keep: bool = False,
        by: str | None = None,
    ) -> str:
        """Submits a goal.

        With a journal, the goal is on the disk when this returns, unless the run does not process requests within 2 s, as
        when its world does not answer; then it processes the goal later. The same holds for the other requests.

        Args:
            goal: a condition in PDDL, as after ``:goal``.
            name: its name. An open goal of that name is replaced.
            value: a positive number, 1 by default. If not all goals can be reached together, those with the greatest sum
                of values are pursued.
            deadline: the latest time at which it must be achieved, on the world's clock.
            within: the same in seconds from now.
            release: the time from which it is pursued, on the world's clock; it is queued until then.
            after: the same in seconds from now.
            keep: ``True`` for a goal that is achieved again whenever it does not hold and no other goal is pursued, until it
                is cancelled.
            by: name of the client, for the records.

        Returns:
            The name of the goal.

        Raises:
            RequestError: if the goal cannot be understood, or the executive does not support it.
            ExecutiveError: if the executive has ended, or its journal cannot be written.
        """
        now = self.status().now
        name, state = self._native.submit_goal(
            goal,
            name,
            _text(value),
            _text(deadline),
            _text(within),
            _text(release),
            _text(after),
            keep,
            by,
            self._patience(),
        )
        self._given[name] = now
        self._check(state)
        return name

    def what_if(
        self,
        goal: str,
        *,
        value: Number | None = None,
        deadline: Number | None = None,
        within: Number | None = None,
        release: Number | None = None,
        after: Number | None = None,
    ) -> WhatIf:
        """Returns the outcome of a goal if it were given now, and everything went as planned.

        The run is not changed. The arguments are those of :meth:`submit`.

        Raises:
            RequestError: if the goal cannot be understood, or the run has not begun.
        """
        times = {"value": value, "deadline": deadline, "within": within, "release": release, "after": after}
        given = {name: _text(it) for name, it in times.items() if it is not None}
        return answers.what_if(document(self._native.what_if(json.dumps({"goal": goal, **given}))))

    def cancel(self, goal: str) -> None:
        """Cancels an open goal.

        Raises:
            RequestError: if there is no open goal with this name.
        """
        self._check(self._native.cancel_goal(goal, self._patience()))

    def pause(self) -> None:
        """Starts no further actions until :meth:`unpause`. Running actions continue."""
        self._check(self._native.pause(True, self._patience()))

    def unpause(self) -> None:
        """Ends a pause."""
        self._check(self._native.pause(False, self._patience()))

    def fact(self, name: str, becomes: bool = True) -> None:
        """Reports a fact: ``executive.fact("(open door)", False)``.

        Raises:
            RequestError: if the problem has no such fact.
        """
        self._check(self._native.report_fact(name, becomes, self._patience()))

    def number(self, fluent: str, value: Number) -> None:
        """Reports a number: ``executive.number("(charge rover)", 7.5)``.

        Raises:
            RequestError: if the problem has no such fluent.
        """
        self._check(self._native.report_number(fluent, text(value), self._patience()))

    def action(self, ticket: Action | int, becomes: str) -> None:
        """Reports a running action as ``"done"`` or ``"failed"``, or has the world cancel it (``"cancelled"``).

        Raises:
            RequestError: if no such action is running.
        """
        number = ticket.ticket if isinstance(ticket, Action) else ticket
        if becomes == "cancelled":
            self._check(self._native.cancel_action(number, self._patience()))
        elif becomes in ("done", "failed"):
            succeeded = becomes == "done"
            self._check(self._native.report_action(number, succeeded, self._patience()))
        else:
            raise RequestError(f"{becomes!r} is not an outcome; expected 'done', 'failed' or 'cancelled'")

    def _patience(self) -> float:
        # The run waits for the world, which must not wait for the run.
        return 0.0 if self._is_in_world() else ACCEPT_TIME

    def _check(self, state: str) -> None:
        if state == "journal-failed":
            raise ExecutiveError("the journal cannot be written; the request is lost, and the executive ends")
        if state == "run-ended":
            self._raise_ended()

    # Answers.

    def status(self) -> Status:
        """The present state: activity, running actions, believed facts and numbers."""
        return answers.status(document(self._native.state()))

    def goals(self) -> list[Goal]:
        """Returns the open goals, after the last 1000 closed ones."""
        return answers.goals(document(self._native.goals()))

    def goal(self, name: str) -> Goal:
        """A goal, or the last one of that name.

        Raises:
            RequestError: if there is no such goal.
        """
        found = self._find(name)
        if found is None:
            raise self._unknown(name)
        return found

    def plan(self) -> list[PlannedAction]:
        """The actions of the plan that is executed, by planned start."""
        return answers.planned(document(self._native.plan()))

    def wait(self, goal: str, timeout: float | None = None) -> Goal:
        """Waits until a goal is achieved or kept, cancelled, failed, impossible, or unplanned. Returns the goal.

        Raises:
            TimeoutError: after ``timeout`` seconds.
            RequestError: if there is no such goal.
            WorldError: if the world fails.
            ExecutiveError: if the executive ends.
        """
        self._refuse_in_world("wait")
        limit = checked_time_limit(timeout)
        deadline = None if limit is None else time.monotonic() + limit
        line = 0
        while True:
            is_over, is_idle = self._over.is_set(), self._native.is_idle()
            is_past = self._native.is_replayed()
            found = self._find(goal)
            if found is not None and not (is_past or found.is_undecided):
                return found
            if is_over:
                self._raise_ended()
            if found is None and is_idle and not is_past:
                raise self._unknown(goal)
            left = POLL_INTERVAL if deadline is None else deadline - time.monotonic()
            if left <= 0:
                raise TimeoutError(f"the goal {goal} is not decided within {limit} s")
            line, is_ending = self._native.last_line(line, min(left, POLL_INTERVAL))
            if is_ending:
                self._over.wait(min(left, POLL_INTERVAL))

    def events(self, after: int | None = None) -> Iterator[dict[str, Any]]:
        """Iterates over the entries of the trace as they are written (``docs/reference/formats/trace.md``), until the executive ends.

        Args:
            after: the number of the last line that is known already: 0 for all lines that are kept, the last 2 to 4 MB;
                ``None`` for new lines only.

        Returns:
            An iterator. Lines that are no longer kept are counted by an entry with the event ``missed`` and ``lines``.
        """
        if after is not None and after < 0:
            raise ValueError(f"`after` is {after}; expected a line number, or 0")
        sent = self._native.last_line(0, 0)[0] if after is None else after
        return self._entries(sent)

    def _entries(self, sent: int) -> Iterator[dict[str, Any]]:
        while True:
            lines, missed, sent, is_over = self._native.lines_after(sent, POLL_INTERVAL)
            if missed:
                yield {"event": "missed", "lines": missed}
            for line in lines:
                yield document(line)
            if is_over:
                return

    def __repr__(self) -> str:
        return f"<Executive: {self.status().activity}>"

    # Helpers.

    def _find(self, name: str) -> Goal | None:
        since = self._given.get(name)
        for goal in reversed(self.goals()):
            is_later = since is None or (goal.given is not None and goal.given >= since)
            if goal.name == name and is_later:
                return goal
        return None

    def _unknown(self, name: str) -> RequestError:
        known = ", ".join(goal.name for goal in self.goals() if goal.is_open) or "none"
        return RequestError(f"unknown goal {name!r}; open goals: {known}")

def _text(number: Number | None) -> str | None:
    return None if number is None else text(number)


def _segments(size: int, kept: int) -> tuple[int, int]:
    for name, number in (("journal_size", size), ("journal_segments", kept)):
        if number < 0:
            raise RequestError(f"`{name}` is {number}; expected a number of at least 0")
    return size, kept
