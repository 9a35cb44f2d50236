"""Executions that an event loop of the caller drives step by step."""

from __future__ import annotations

import json
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from . import _native
from ._answers import Run
from ._numbers import Number, document
from ._world import Action, Observation, passage, wire


class Start(NamedTuple):
    """Request to the world to start an action now."""

    action: Action


class Cancel(NamedTuple):
    """Request to the world to stop an action."""

    action: Action


class Wait(NamedTuple):
    """Request to let time pass until the next observation, at most until ``until``. The answer is
    :meth:`Stepped.observe`."""

    until: Fraction


class Look(NamedTuple):
    """Request to observe these facts. The answer is :meth:`Stepped.see`; empty if unknown."""

    facts: list[str]
    fluents: list[str]


class Over(NamedTuple):
    """The run is over."""

    run: Run


Next = Start | Cancel | Wait | Look | Over
"""The next request of an execution."""


class Stepped:
    """An execution whose caller performs its requests and reports observations.

    It reads no clock: the caller reports the time. Created by :meth:`elbowroom.Problem.execution`.

    >>> execution = problem.execution(PLAN)
    >>> coming = []
    >>> while not isinstance(step := execution.next_command(), elbowroom.Over):
    ...     if isinstance(step, elbowroom.Start):
    ...         action = step.action
    ...         coming.append(elbowroom.started(action, action.now))
    ...         coming.append(elbowroom.ended(action, action.now + action.duration))
    ...     elif isinstance(step, elbowroom.Wait):
    ...         now = min([step.until, *(it.time for it in coming)])
    ...         execution.observe(now, [it for it in coming if it.time <= now])
    ...         coming = [it for it in coming if it.time > now]
    ...     elif isinstance(step, elbowroom.Look):
    ...         execution.see([])
    >>> step.run.verdict
    'goal-reached'
    """

    def __init__(self, native: _native.Stepper) -> None:
        self._native = native
        self._actions: dict[int, Action] = {}

    @property
    def now(self) -> Fraction:
        """The present time on the world's clock."""
        return Fraction(self._native.now())

    def next_command(self) -> Next:
        """The next request of the run. Planning, which can take long, happens in this call."""
        kind, *rest = self._native.next()
        if kind == "start":
            now, ticket, name, duration = rest
            lasts = None if duration is None else Fraction(duration)
            action = Action(ticket, name, lasts, Fraction(now))
            self._actions[ticket] = action
            return Start(action)
        if kind == "cancel":
            return Cancel(self._actions[rest[1]])
        if kind == "wait":
            return Wait(Fraction(rest[0]))
        if kind == "look":
            return Look(*rest)
        return Over(Run(document(rest[0]), rest[1]))

    def observe(self, now: Number, observations: Sequence[Observation] = ()) -> None:
        """Answers :class:`Wait`: reports the present time and the observations since the last one.

        Raises:
            RequestError: if there is no such request, or the answer is invalid.
        """
        self._native.observe(json.dumps(passage((now, observations))))

    def see(self, observations: Sequence[Observation] = ()) -> None:
        """Answers :class:`Look`: reports the observed facts and values.

        Raises:
            RequestError: if there is no such request, or the answer is invalid.
        """
        self._native.see(json.dumps(wire(observations)))

    def stop(self) -> None:
        """Ends the run in order: the running actions are cancelled, and their ends are awaited.

        Call :meth:`next_command` afterwards, until it returns :class:`Over`.
        """
        self._native.stop()

    def fail(self, why: str) -> None:
        """Reports that the world has failed. The run ends with the verdict ``"world-failed"``."""
        self._native.fail(why)
