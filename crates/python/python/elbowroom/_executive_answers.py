"""Answers of an executive: its status, its goals and its plan."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any, NamedTuple


class Goal(NamedTuple):
    """A goal of an executive; true in conditions if it was achieved, or is kept."""

    name: str
    """Its name; that of the problem's own goal is ``problem``."""
    goal: str
    """The goal, in PDDL."""
    value: Fraction
    """Its value, a positive number."""
    deadline: Fraction | None
    """Its deadline on the world's clock, if there is one."""
    release: Fraction | None
    """Its release time on the world's clock, if there is one."""
    keep: bool
    """``True`` for a goal to keep, which is closed only when it is cancelled."""
    by: str | None
    """Name of the client that has given it, if it is known."""
    state: str
    """``"queued"`` until its release time; ``"kept"`` while a goal to keep holds, and ``"queued"`` while it does not and
    other goals are pursued; ``"pursued"``; ``"set-aside"`` while others are pursued; ``"impossible"`` if no plan exists, or ``"unplanned"`` if
    none was found, when the executive is idle; ``"achieved"``; ``"cancelled"``; or ``"failed"`` if it was not achieved by
    its deadline."""
    given: Fraction | None
    """The time at which it was given, on the world's clock; ``None`` if an earlier segment of the journal contains it."""
    since: Fraction
    """The time of the change to this state."""
    why: str | None
    """The reason for a state other than ``"pursued"`` and ``"achieved"``, if it is known."""

    def __bool__(self) -> bool:
        return self.state in ("achieved", "kept")

    @property
    def is_open(self) -> bool:
        """``True`` if the executive still pursues the goal, or may do so again."""
        return self.state not in ("achieved", "cancelled", "failed")

    @property
    def is_undecided(self) -> bool:
        """``True`` while the executive pursues the goal, or other goals first, or until its release time."""
        return self.state in ("queued", "pursued", "set-aside")


class RunningAction(NamedTuple):
    """An action that is running."""

    ticket: int
    """The number of its start."""
    action: str
    """The action."""
    since: Fraction
    """The start time."""
    planned: Fraction | None
    """The planned duration."""
    needed: Fraction | None
    """The time at which a new plan is needed if the action has not ended; given only shortly before."""
    times_out: Fraction | None
    """The time at which the action times out and is cancelled; given only shortly before."""
    completion: Fraction | None
    """The completed part, from 0 to 1, if the world has reported it."""
    note: str | None
    """The world's last note about it."""


class Doubt(NamedTuple):
    """A fact or a number that is in doubt."""

    name: str
    """The fact or the number."""
    since: Fraction
    """The start of the doubt."""
    why: str
    """The reason, and the observations that settle the doubt."""


class PlannedAction(NamedTuple):
    """An action of the plan that is executed."""

    action: str
    """The action."""
    start: Fraction
    """The start time, or the planned one."""
    duration: Fraction | None
    """Its planned duration; ``None`` for an instantaneous action."""
    state: str
    """``"to-come"``, ``"running"``, ``"succeeded"``, ``"failed"`` or ``"cancelled"``."""
    ticket: int | None
    """The number of its start, once it is started."""


class Status(NamedTuple):
    """The state of an executive."""

    now: Fraction
    """The time by the world's clock."""
    activity: str
    """``"beginning"``, ``"planning"``, ``"executing"``, ``"paused"``, ``"resting"`` or ``"over"``."""
    why: str | None
    """The reason for the activity, for example for the idle state, if there is one."""
    unanswered: int | None
    """The time for which the world has not answered, in seconds, if that is more than one second."""
    running: list[RunningAction]
    """The running actions."""
    plans: int
    """The number of plans that were adopted so far."""
    facts: frozenset[str]
    """The facts that are believed to be true."""
    numbers: Mapping[str, Fraction]
    """The believed values of numeric fluents."""
    in_doubt: list[Doubt]
    """Facts and numbers that are in doubt. Such a fact counts as false."""


class WhatIf(NamedTuple):
    """The predicted outcome of a goal that is not given."""

    verdict: str
    """``"achieved"``, ``"failed"``, ``"impossible"``, ``"unplanned"``, ``"set-aside"`` or ``"undecided"``."""
    done: Fraction | None
    """The time at which it would be achieved."""
    why: str | None
    """The reason for another verdict, if it is known."""
    slack_now: Fraction | None
    """The least slack of the present plan: the part of an interval that is left, from 0 to 1."""
    slack_then: Fraction | None
    """The same of the first plan for the goal."""
    missed: list[str]
    """The goals that are pursued now, and would be set aside or missed."""


def what_if(document: dict[str, Any]) -> WhatIf:
    """The answer in a document."""
    return WhatIf(*(document[field] for field in WhatIf._fields))


def goals(document: dict[str, Any]) -> list[Goal]:
    """The goals in a document: first those that were closed, then the open ones, each in their order."""
    return [Goal(*(it[field] for field in Goal._fields)) for it in document["goals"]]


def planned(document: dict[str, Any]) -> list[PlannedAction]:
    """The actions of the plan in a document."""
    fields = PlannedAction._fields
    return [PlannedAction(*(it[field] for field in fields)) for it in document["steps"]]


def status(document: dict[str, Any]) -> Status:
    """The state in a document."""
    running = document["running"]
    fields = RunningAction._fields
    return Status(
        now=document["now"],
        activity=document["activity"],
        why=document["why"],
        unanswered=document["unanswered"],
        running=[RunningAction(*(it[field] for field in fields)) for it in running],
        plans=document["plans"],
        facts=frozenset(document["facts"]),
        numbers={it["fluent"]: it["value"] for it in document["numbers"]},
        in_doubt=[Doubt(it["name"], it["since"], it["why"]) for it in document["in_doubt"]],
    )
