"""The depot as a world of Elbowroom: actions move robots, and the physics determines their ends."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import elbowroom
from floor import Day
from physics import STEP, Engine, Vector
from robots import SIDES, Drive, Failure, Robot, standing_place

NewEngine = Callable[[Day, dict[str, Vector]], Engine]
CONTROL_STEPS = 10
"""Steps of the physics in one control step."""


class Depot(elbowroom.SteppedWorld):
    """Robots in a depot on one day."""

    dt = "0.1"

    def __init__(self, day: Day, new_engine: NewEngine, robots: list[str], facts: set[str]) -> None:
        super().__init__()
        starts = {name: standing_place("base", SIDES[i % 2]) for i, name in enumerate(robots)}
        self._day, self._engine = day, new_engine(day, starts)
        self.robots = {name: Robot(name, i, self._engine, day) for i, name in enumerate(robots)}
        self.facts = set(facts)
        self.clock = 0
        """Steps of the physics since the morning."""
        self._tasks: dict[str, tuple[elbowroom.Action | None, list[str], Drive]] = {}

    @property
    def seconds(self) -> float:
        """Time since the morning."""
        return self.clock * STEP

    def begin(self, action: elbowroom.Action) -> None:
        name, robot, *rest = action.words
        self._change(_start_effects(action.words), report=False)
        self._tasks[robot] = (action, action.words, self._drive(name, self.robots[robot], rest))

    def step(self, dt: float) -> str:
        """Advances all bodies by a control step, or by a shorter time if the run requests it."""
        steps = min(CONTROL_STEPS, math.ceil(round(dt / STEP, 6)))
        self._advance(steps)
        return f"{steps * STEP:.2f}"

    def cancel(self, action: elbowroom.Action) -> None:
        """Stops picking and charging. A robot that is moving ends its movement: it must not block the way."""
        name, robot, *_ = action.words
        _, words, drive = self._tasks.pop(robot)
        if name in ("pick", "charge"):
            self._change(_undone(words), report=True)
        else:
            self._tasks[robot] = (None, words, drive)

    def settle(self) -> None:
        """Continues movements of cancelled actions until they end."""
        while self._tasks:
            self._advance(CONTROL_STEPS)

    def _drive(self, name: str, robot: Robot, rest: list[str]) -> Drive:
        if name in ("drive", "cross"):
            return robot.drive(name, *rest)
        if name == "charge":
            return robot.charge()
        if name == "pick":
            crate, place = rest
            return robot.pick(place, crate)
        if name == "dock":
            return robot.dock()
        if name == "place":
            return robot.place(rest[1])
        raise ValueError(f"the depot has no action {name}")

    def _advance(self, steps: int) -> None:
        people = [person.position(self.seconds) for person in self._day.people]
        forces: dict[str, Vector] = {}
        for name, robot in self.robots.items():
            target, limit = self._next(name, robot)
            others = [it.position for other, it in self.robots.items() if other != name]
            forces[name] = robot.force(target, limit, others, people)
        self._engine.advance(forces, steps, people)
        self.clock += steps

    def _next(self, name: str, robot: Robot) -> tuple[Vector, float]:
        """The next target of a robot. Reports the end of its action."""
        if name in self._tasks:
            action, words, drive = self._tasks[name]
            try:
                return next(drive)
            except StopIteration:
                del self._tasks[name]
                self._change(_end_effects(words), report=action is None)
                if action is not None:
                    self.succeeded(action)
            except Failure as why:
                del self._tasks[name]
                if action is not None:
                    self.failed(action, str(why))
                self._change(_undone(words), report=True)
        return robot.position, 0.0

    def _change(self, changes: Iterator[tuple[str, bool]], report: bool) -> None:
        for fact, becomes in changes:
            (self.facts.add if becomes else self.facts.discard)(fact)
            if report:
                self.fact(fact, becomes)


def _start_effects(words: list[str]) -> Iterator[tuple[str, bool]]:
    name, robot, *rest = words
    if name in ("drive", "cross"):
        yield f"(at {robot} {rest[0]})", False
    elif name == "charge":
        yield f"(charger-free {rest[0]})", False
    elif name == "pick":
        yield f"(empty {robot})", False
        yield f"(stored {rest[0]} {rest[1]})", False
    elif name == "dock":
        yield f"(bay-free {rest[0]})", False
        yield f"(at {robot} {rest[0]})", False
    elif name == "place":
        yield f"(docked {robot} {rest[1]})", False


def _undone(words: list[str]) -> Iterator[tuple[str, bool]]:
    """Returns the facts that a failed or cancelled action changed, with their values before it."""
    return ((fact, not becomes) for fact, becomes in _start_effects(words))


def _end_effects(words: list[str]) -> Iterator[tuple[str, bool]]:
    name, robot, *rest = words
    if name in ("drive", "cross"):
        yield f"(at {robot} {rest[1]})", True
    elif name == "charge":
        yield f"(charger-free {rest[0]})", True
        yield f"(charged {robot})", True
    elif name == "pick":
        yield f"(holding {robot} {rest[0]})", True
    elif name == "dock":
        yield f"(docked {robot} {rest[0]})", True
    elif name == "place":
        yield f"(bay-free {rest[1]})", True
        yield f"(at {robot} {rest[1]})", True
        yield f"(holding {robot} {rest[0]})", False
        yield f"(empty {robot})", True
        yield f"(loaded {rest[0]})", True
