"""Executions that are driven step by step, by an event loop of one's own."""

from __future__ import annotations

import asyncio
import inspect
import json
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from . import _native
from ._answers import Run
from ._errors import RequestError, WorldError
from ._numbers import Number, document, text, timeout_text
from ._world import Action, AsyncWorld, Observation, World, passage, wire


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
    """What is true of these is to be said, by :meth:`Stepped.see`; nothing if that is unknown."""

    facts: list[str]
    fluents: list[str]


class Over(NamedTuple):
    """The run is over."""

    run: Run


Next = Start | Cancel | Wait | Look | Over
"""What an execution needs next."""

_TEXTS = ("precision", "planning_time", "realtime", "time_limit", "planner_time", "epsilon")


def run_options(
    executor: str, planner: object, seed: int, options: dict[str, Any]
) -> dict[str, Any]:
    """The specification of a run, as the native module reads it."""
    chosen: dict[str, Any] = {"executor": executor, "seed": seed}
    chosen["planner"] = planner if isinstance(planner, str) else "embedded"
    if not isinstance(planner, str) and options.get("jobs") is not None:
        raise RequestError("`jobs` says how many threads the embedded planner uses")
    if not isinstance(planner, str) and options.get("self_overlap"):
        raise RequestError("`self_overlap` is about plans of the embedded planner")
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
            from ._problem import named_text

            file, likelihoods = named_text(value, "likelihoods")
            value = {"name": file, "text": likelihoods}
        chosen[name] = value
    return chosen


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
        """What is needed next. Making a plan, which can take long, happens in here."""
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
        self._native.observe(passage((now, observations)))

    def see(self, observations: Sequence[Observation] = ()) -> None:
        """What was seen of that which :class:`Look` has asked for.

        Raises:
            RequestError: if nothing of that kind was asked for, or it cannot be understood.
        """
        self._native.see(json.dumps(wire(observations)))

    def fail(self, why: str) -> None:
        """The world has failed; the run ends with the verdict ``"world-failed"``."""
        self._native.fail(why)


async def drive(execution: Stepped, world: AsyncWorld | World) -> Run:
    """Drives an execution in a world, whose methods may be coroutines."""

    async def call(made: Any) -> Any:
        return await made if inspect.isawaitable(made) else made

    while True:
        # Plans are made in there; the loop goes on meanwhile.
        step = await asyncio.to_thread(execution.next_command)
        if isinstance(step, Over):
            return step.run
        try:
            if isinstance(step, Start):
                await call(world.start(step.action))
            elif isinstance(step, Cancel):
                await call(world.cancel(step.action))
            elif isinstance(step, Wait):
                now, observations = await call(world.wait(step.until))
                execution.observe(now, observations)
            else:
                execution.see(await call(world.look(step.facts, step.fluents)))
        except Exception as error:
            execution.fail(f"{type(error).__name__}: {error}")
            over = await asyncio.to_thread(execution.next_command)
            run = over.run if isinstance(over, Over) else None
            raise WorldError(f"{type(error).__name__}: {error}", run) from error
