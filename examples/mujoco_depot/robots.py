"""Control of the robots: commands to wheels and gripper during an action."""

from __future__ import annotations

import math
from collections.abc import Iterator

from floor import BAY, GRAVITY, LANE_OFFSET, PLACES, VIA, Day, distance
from physics import MOTOR_FORCE, ROBOT_MASS, Engine, Vector

RATED_SPEED = 1.2
STOPPING_DISTANCE = 0.2
"""Distance within which a robot must be able to stop, in metres: the range of its bumper's sensors."""

LIFT_POWER = 100.0
LIFT_HEIGHT = 0.6
DOCK_TOLERANCE = 0.04
BACK_OFF_STEPS = 25
"""Control steps for which a robot makes way."""
SIDES = (0.7, -0.7)
"""Offsets of the robots from a place, in metres."""

Drive = Iterator[tuple[Vector, float]]
"""Target and speed limit of each control step of an action."""


class Failure(Exception):
    """An action has failed."""


class Robot:
    """One robot: its body in the engine, its payload, and the conditions of the day."""

    def __init__(self, name: str, index: int, engine: Engine, day: Day) -> None:
        self.name, self._engine, self._day = name, engine, day
        self._side = SIDES[index % 2]
        # Different robots have different patience, so that one makes way and the other drives on.
        self._patience = 20 + 20 * index
        self._stuck = self._steps_back = 0
        self.payload = 0.0
        self.attempts = 0
        self.battery = day.battery
        self.path: list[Vector] = []

    @property
    def position(self) -> Vector:
        return self._engine.position(self.name)

    def slot(self, place: str) -> Vector:
        """Returns the position of the robot at a place, next to the other one."""
        return standing_place(place, self._side)

    def load(self, mass: float) -> None:
        """Sets the mass of the load in the gripper."""
        self.payload = mass
        self._engine.set_payload(self.name, mass)

    def force(self, target: Vector, limit: float, others: list[Vector], people: list[Vector]) -> Vector:
        """Force of the wheels towards a target, as far as motor and floor permit."""
        at, velocity = self.position, self._engine.velocity(self.name)
        left = distance(at, target)
        ahead = ((target[0] - at[0]) / left, (target[1] - at[1]) / left) if left > 0.001 else (0.0, 0.0)
        grip = self._day.friction(*at) * GRAVITY
        speed = min(limit, RATED_SPEED, math.sqrt(grip * STOPPING_DISTANCE), math.sqrt(0.6 * left))
        if any(_blocks(at, ahead, person, 1.2, 0.55) for person in people):
            speed = 0.0
        if any(_blocks(at, ahead, other, 1.6, 1.1) for other in others):
            speed = min(speed, 0.4)
        if any(_blocks(at, ahead, other, 0.9, 0.55) for other in others):
            ahead = (0.6 * ahead[0] + 0.8 * ahead[1], 0.6 * ahead[1] - 0.8 * ahead[0])
        if self._backs_off(math.hypot(*velocity), speed):
            nearest = min(others, key=lambda other: distance(at, other))
            apart = distance(at, nearest)
            ahead = ((at[0] - nearest[0]) / apart, (at[1] - nearest[1]) / apart)
        mass = ROBOT_MASS + self.payload
        wanted = [mass * (speed * ahead[axis] - velocity[axis]) / 0.3 for axis in (0, 1)]
        size, most = math.hypot(*wanted), min(MOTOR_FORCE, grip * mass)
        scale = most / size if size > most else 1.0
        return wanted[0] * scale, wanted[1] * scale

    def _backs_off(self, speed: float, wanted: float) -> bool:
        """Returns ``True`` if the robot has pushed against another one for too long, and makes way for a while."""
        if self._steps_back > 0:
            self._steps_back -= 1
            return True
        self._stuck = self._stuck + 1 if speed < 0.05 and wanted > 0.1 else 0
        if self._stuck > self._patience:
            self._steps_back = BACK_OFF_STEPS
        return False

    def drive(self, name: str, start: str, end: str) -> Drive:
        """Drives along the right-hand lane from a place to another one, on a road or through the aisle."""
        between = VIA.get((start, end), []) if name == "drive" else []
        stops = [PLACES[it] for it in (start, *between, end)]
        for a, b in zip(stops, stops[1:]):
            length = distance(a, b)
            along = ((b[0] - a[0]) / length, (b[1] - a[1]) / length)
            for part in (1.2, length - 1.2):
                x = a[0] + part * along[0] + along[1] * LANE_OFFSET
                y = a[1] + part * along[1] - along[0] * LANE_OFFSET
                while _progress(a, along, self.position) < part - 0.3:
                    self.path.append(self.position)
                    # A target beyond the point keeps the robot from braking for it.
                    beyond = 3.0 if part > 2 else 1.0
                    yield (x + beyond * along[0], y + beyond * along[1]), RATED_SPEED
        yield from self._go(self.slot(end), 0.08)

    def charge(self) -> Drive:
        """Charges until nine tenths; the current falls when the battery gets full."""
        while self.battery < 0.9:
            self.battery += 0.1 * self._day.charge_rate * min(1.0, (1.0 - self.battery) / 0.4)
            yield self.position, 0.0

    def pick(self, place: str, crate: str) -> Drive:
        """Drives up to a crate, closes the gripper and lifts.

        Raises:
            Failure: if the crate slips out of the gripper.
        """
        self.attempts += 1
        x, y = self.slot(place)
        yield from self._go((x, y - 0.4), 0.05, 0.4)
        mass = self._day.crate_masses[crate]
        yield from self._wait(1.5 + (mass + 10) * GRAVITY * LIFT_HEIGHT / LIFT_POWER)
        rng = self._day.random("grip", self.name, self.attempts)
        if not self._engine.holds(mass, rng.lognormvariate(math.log(0.48), 0.3)):
            raise Failure(f"{crate} slips out of the gripper")
        self.load(mass)
        yield from self._go((x, y), 0.08, 0.6)

    def dock(self) -> Drive:
        """Drives into the bay, and again until the robot stands straight before the truck."""
        while True:
            self.attempts += 1
            yield from self._go(BAY, 0.05, 0.6)
            error = self._day.random("dock", self.name, self.attempts).gauss(0.0, 0.025 + self.payload / 2000)
            if abs(error) <= DOCK_TOLERANCE:
                return
            yield from self._go((BAY[0], BAY[1] - 0.5), 0.05, 0.6)

    def place(self, place: str) -> Drive:
        """Puts a crate onto the truck, and leaves the bay."""
        yield from self._wait(1.0 + (self.payload + 10) * GRAVITY * LIFT_HEIGHT / LIFT_POWER)
        self.load(0.0)
        yield from self._go(self.slot(place), 0.08)

    def _go(self, target: Vector, tolerance: float, limit: float = RATED_SPEED) -> Drive:
        while distance(self.position, target) > tolerance:
            self.path.append(self.position)
            yield target, limit

    def _wait(self, seconds: float) -> Drive:
        for _ in range(round(seconds * 10)):
            yield self.position, 0.0


def standing_place(place: str, side: float) -> Vector:
    """Point next to a place, outside the lanes."""
    x, y = PLACES[place]
    return (x + side, y - 0.5) if place != "gate" else (x + side, y)


def _progress(start: Vector, along: Vector, at: Vector) -> float:
    """Distance along a lane, in metres."""
    return (at[0] - start[0]) * along[0] + (at[1] - start[1]) * along[1]


def _blocks(at: Vector, ahead: Vector, other: Vector, reach: float, width: float) -> bool:
    x, y = other[0] - at[0], other[1] - at[1]
    along, aside = x * ahead[0] + y * ahead[1], abs(x * ahead[1] - y * ahead[0])
    return 0 < along < reach and aside < width
