"""Executions that are driven step by step, by an event loop of one's own."""

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
    """The world is to start an action now."""

    action: Action


class Cancel(NamedTuple):
    """The world is to stop an action."""

    action: Action


class Wait(NamedTuple):
    """Time is to pass until something is observed, but not beyond ``until``; then
    :meth:`Stepped.observe`."""

    until: Fraction


class Look(NamedTuple):
    """The run asks for these facts, to be answered by :meth:`Stepped.see`; empty if unknown."""

    facts: list[str]
    fluents: list[str]


class Over(NamedTuple):
    """The run is over."""

    run: Run


Next = Start | Cancel | Wait | Look | Over
"""What an execution needs next."""


class Stepped:
    """An execution that is asked what it needs next, and told what was observed.

    It looks at no clock: time is what it is told. Made by :meth:`elbowroom.Problem.execution`.

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
        """What time it is, by the world's clock."""
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
        """Time has passed, as :class:`Wait` has asked, and this was observed meanwhile.

        Raises:
            RequestError: if nothing of that kind was asked for, or it cannot be understood.
        """
        self._native.observe(json.dumps(passage((now, observations))))

    def see(self, observations: Sequence[Observation] = ()) -> None:
        """What was seen of that which :class:`Look` has asked for.

        Raises:
            RequestError: if nothing of that kind was asked for, or it cannot be understood.
        """
        self._native.see(json.dumps(wire(observations)))

    def stop(self) -> None:
        """Ends the run in order: the running actions are cancelled, and their ends are awaited.

        To be followed by :meth:`next_command`, until :class:`Over`.
        """
        self._native.stop()

    def fail(self, why: str) -> None:
        """The world has failed; the run ends with the verdict ``"world-failed"``."""
        self._native.fail(why)
