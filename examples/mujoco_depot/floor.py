"""Map of the depot, and the conditions of one day: wet floor, people, heavy crates, a cold battery."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

PLACES = {"base": (2.0, 2.0), "rack": (12.0, 2.0), "corner": (20.0, 8.0), "gate": (12.0, 14.0)}
VIA = {("rack", "gate"): ["corner"], ("gate", "rack"): ["corner"]}
"""Points that a road leads through."""

AISLE = ("rack", "gate")
BAY = (12.0, 16.0)

# The cold store, whose floor may be wet: from y to y in the aisle.
WET = (4.0, 12.0)
AISLE_HALF_WIDTH = 1.4
LANE_OFFSET = 0.5

DRY_FRICTION = 0.7
ROLLING_RESISTANCE = 0.015
GRAVITY = 9.81


@dataclass(frozen=True)
class Person:
    """A person who works in the aisle, walks across it, and stays at some places for a while."""

    y: float
    speed: float
    stops: tuple[tuple[float, float], ...]
    """Places across the aisle at which the person stays, and the durations."""

    def position(self, now: float) -> tuple[float, float]:
        """Returns the place of the person at a time in seconds."""
        x, left = self.stops[0][0], now
        for stop, pause in self.stops:
            walk = abs(stop - x) / self.speed
            if left < walk:
                x += math.copysign(left * self.speed, stop - x)
                break
            x, left = stop, left - walk - pause
            if left < 0:
                break
        return PLACES["rack"][0] + x, self.y


@dataclass(frozen=True)
class Day:
    """Conditions of one day. The planner does not know them, but they affect the robots."""

    number: int
    seed: int
    aisle_friction: float
    people: tuple[Person, ...]
    crate_masses: dict[str, float]
    battery: float
    charge_rate: float

    def random(self, *about: object) -> random.Random:
        """Random numbers for one purpose on this day, independent of all other events."""
        return random.Random(f"depot {self.seed} {self.number} {about}")

    def friction(self, x: float, y: float) -> float:
        """Coefficient of friction between a wheel and the floor."""
        in_aisle = abs(x - PLACES["rack"][0]) < AISLE_HALF_WIDTH + 0.2
        return self.aisle_friction if in_aisle and WET[0] < y < WET[1] else DRY_FRICTION


def draw_day(seed: int, number: int, crates: list[str]) -> Day:
    """Draws the conditions of a day from its number and the seed."""
    rng = random.Random(f"depot {seed} {number}")
    # Every second day the floor is dry; otherwise damp, or nearly ice.
    aisle_friction = rng.choice([0.6, 0.6, 0.25, rng.uniform(0.03, 0.1)])
    people = tuple(
        Person(
            y=rng.uniform(4.5, 11.5),
            speed=rng.uniform(0.7, 1.2),
            stops=tuple(
                (rng.uniform(-AISLE_HALF_WIDTH, AISLE_HALF_WIDTH), rng.expovariate(1 / 4)) for _ in range(80)
            ),
        )
        for _ in range(rng.choice([0, 1, 2, 3]))
    )
    masses = {crate: rng.uniform(8.0, 26.0) for crate in crates}
    return Day(number, seed, aisle_friction, people, masses, rng.uniform(0.1, 0.4), rng.uniform(0.03, 0.06))


def distance(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Distance between two points, in metres."""
    return math.hypot(a[0] - b[0], a[1] - b[1])
