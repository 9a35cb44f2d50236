"""Worlds in Python: objects that start actions and report their outcomes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from ._numbers import Number, exact, text


class Action(NamedTuple):
    """A command to a world to start an action."""

    ticket: int
    """The number of the start; reports refer to it."""
    name: str
    """The ground action: ``(drive rover depot shelf)``."""
    duration: Fraction | None
    """The planned duration; ``None`` for an instantaneous action."""
    now: Fraction
    """The time of the command, on the world's clock."""

    @property
    def words(self) -> list[str]:
        """The action and its arguments: ``["drive", "rover", "depot", "shelf"]``."""
        return self.name.strip("()").split()


class Observation(NamedTuple):
    """A report of a world. Created by :func:`started`, :func:`ended`, :func:`fact`, :func:`value`."""

    time: Number
    fields: Mapping[str, Any]


def _ticket(action: Action | int) -> int:
    return action.ticket if isinstance(action, Action) else action


def _measured(amounts: Mapping[str, Number] | None) -> dict[str, Any]:
    if not amounts:
        return {}
    return {"measured": {fluent: text(amount) for fluent, amount in amounts.items()}}


def started(
    action: Action | int, time: Number, measured: Mapping[str, Number] | None = None
) -> Observation:
    """Reports that an action has started. ``measured``: the measured changes of fluents by its start."""
    fields = {"type": "started", "ticket": _ticket(action), **_measured(measured)}
    return Observation(time, fields)


def ended(
    action: Action | int,
    time: Number,
    outcome: str = "succeeded",
    why: str = "",
    measured: Mapping[str, Number] | None = None,
) -> Observation:
    """Reports that an action has ended: ``"succeeded"``, ``"failed"`` (with a reason) or ``"cancelled"``."""
    fields = {"type": "ended", "ticket": _ticket(action), "outcome": outcome, "why": why}
    return Observation(time, {**fields, **_measured(measured)})


def fact(name: str, becomes: bool, time: Number) -> Observation:
    """Reports that a fact is observed to be true or false: ``fact("(at rover depot)", True, now)``."""
    return Observation(time, {"type": "fact", "fact": name, "becomes": becomes})


def value(fluent: str, amount: Number, time: Number) -> Observation:
    """Reports the observed value of a fluent: ``value("(battery rover)", 80, now)``."""
    return Observation(time, {"type": "value", "fluent": fluent, "value": text(amount)})


def wire(observations: Iterable[Observation]) -> list[dict[str, Any]]:
    """Converts observations to the form that the native module reads."""
    return [{**fields, "time": text(time)} for time, fields in observations]


class World:
    """Base class of worlds that start actions and report observations.

    The world answers each start by :func:`started` and, if the action takes time, later by one
    :func:`ended`. It answers each cancellation of a running action by an :func:`ended`. Time never
    decreases. ``docs/reference/formats/world-protocol.md`` has the whole contract, and defines the handling of
    worlds that violate it; a run never hangs because of such a world.

    >>> import elbowroom
    >>> class AsPlanned(elbowroom.World):
    ...     def __init__(self):
    ...         self.coming = []
    ...     def start(self, action):
    ...         self.coming.append(elbowroom.started(action, action.now))
    ...         if action.duration is not None:
    ...             self.coming.append(elbowroom.ended(action, action.now + action.duration))
    ...     def cancel(self, action):
    ...         pass
    ...     def wait(self, until):
    ...         now = min([until, *(it.time for it in self.coming)])
    ...         due = [it for it in self.coming if it.time <= now]
    ...         self.coming = [it for it in self.coming if it.time > now]
    ...         return now, due
    """

    def start(self, action: Action) -> None:
        """Starts an action. Returns at once; :meth:`wait` reports its outcome."""
        raise NotImplementedError("a world needs a method start(action)")

    def cancel(self, action: Action) -> None:
        """Stops a running action. Its end must be reported as cancelled."""
        raise NotImplementedError("a world needs a method cancel(action)")

    def wait(self, until: Fraction) -> tuple[Number, Sequence[Observation]]:
        """Lets time pass until the next observation, at most until ``until``.

        Returns the time then, and the observations.
        """
        raise NotImplementedError("a world needs a method wait(until)")

    def look(self, facts: Sequence[str], fluents: Sequence[str]) -> Sequence[Observation]:
        """Returns the current values of these facts; empty if the world cannot observe them."""
        return ()

    def resume(
        self, now: Fraction, actions: Sequence[Action]
    ) -> tuple[Number, Sequence[Observation]] | None:
        """Reports the outcome of actions that another process has started.

        Called once, before anything else, when :meth:`elbowroom.Executive.resume` resumes a run. ``now`` is the time of
        the last record in the journal, ``actions`` are those that had not ended.

        Returns the present time, and :func:`started` or :func:`ended` for each action whose outcome is known. The others
        have failed, and are cancelled. ``None`` means that none of the actions is running: all of them have failed, and
        the clock of this world restarts.
        """
        return None

    def stop(self) -> None:
        """Stops all activity. Called once at the end of each run, whatever the reason for its end."""


class AsyncWorld:
    """A world whose methods are coroutines, for :meth:`elbowroom.Problem.run_async` and :class:`elbowroom.Executive`."""

    async def start(self, action: Action) -> None:
        """As :meth:`World.start`."""
        raise NotImplementedError("a world needs a coroutine start(action)")

    async def cancel(self, action: Action) -> None:
        """As :meth:`World.cancel`."""
        raise NotImplementedError("a world needs a coroutine cancel(action)")

    async def wait(self, until: Fraction) -> tuple[Number, Sequence[Observation]]:
        """As :meth:`World.wait`."""
        raise NotImplementedError("a world needs a coroutine wait(until)")

    async def look(self, facts: Sequence[str], fluents: Sequence[str]) -> Sequence[Observation]:
        """As :meth:`World.look`."""
        return ()

    async def resume(
        self, now: Fraction, actions: Sequence[Action]
    ) -> tuple[Number, Sequence[Observation]] | None:
        """As :meth:`World.resume`."""
        return None

    async def stop(self) -> None:
        """As :meth:`World.stop`."""


def passage(
    answer: tuple[Number, Sequence[Observation]], method: str = "wait"
) -> dict[str, Any]:
    """Converts the answer to a wait to the JSON that the native module reads."""
    try:
        now, observations = answer
    except (TypeError, ValueError):
        raise TypeError(
            f"{method}() must return the time and a list of observations, not {answer!r}"
        ) from None
    return {"now": text(now), "observations": wire(observations)}


__all__ = [
    "Action", "AsyncWorld", "Observation", "World", "ended", "exact", "fact", "started", "value",
]  # fmt: skip
