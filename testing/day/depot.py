"""The depot of the demonstration "a day": domain, problem, tasks and hidden conditions, all drawn from one seed.

Three robots carry totes between six stations and check stations. A lift is short in the plan and slow in truth; a ramp
is longer and as fast as planned. There is no road to the vault.
"""

import random
from dataclasses import dataclass, field

ROBOTS = ["r1", "r2", "r3"]
WEST, EAST = ["dock", "store", "wash"], ["ward", "lab", "icu"]
STATIONS = WEST + EAST
WAYS = {"lift": 40, "ramp": 70}
HOP = 40
DURATIONS = {"load": 20, "unload": 20, "check": 60}
TOTES = 12

DOMAIN = """(define (domain depot)
  (:requirements :typing :durative-actions :numeric-fluents)
  (:types robot place tote)
  (:predicates (road ?a ?b - place) (at ?r - robot ?p - place) (ready ?r - robot) (empty ?r - robot)
    (holds ?r - robot ?t - tote) (stored ?t - tote ?p - place) (checked ?p - place))
  (:functions (distance ?a ?b - place))
  (:durative-action drive
    :parameters (?r - robot ?a ?b - place)
    :duration (= ?duration (distance ?a ?b))
    :condition (and (at start (ready ?r)) (at start (at ?r ?a)) (over all (road ?a ?b)))
    :effect (and (at start (not (ready ?r))) (at start (not (at ?r ?a))) (at end (at ?r ?b)) (at end (ready ?r))))
  (:durative-action load
    :parameters (?r - robot ?t - tote ?p - place)
    :duration (= ?duration 20)
    :condition (and (at start (ready ?r)) (over all (at ?r ?p)) (at start (empty ?r)) (at start (stored ?t ?p)))
    :effect (and (at start (not (ready ?r))) (at start (not (stored ?t ?p))) (at start (not (empty ?r)))
      (at end (holds ?r ?t)) (at end (ready ?r))))
  (:durative-action unload
    :parameters (?r - robot ?t - tote ?p - place)
    :duration (= ?duration 20)
    :condition (and (at start (ready ?r)) (over all (at ?r ?p)) (at start (holds ?r ?t)))
    :effect (and (at start (not (ready ?r))) (at end (not (holds ?r ?t))) (at end (stored ?t ?p))
      (at end (empty ?r)) (at end (ready ?r))))
  (:durative-action check
    :parameters (?r - robot ?p - place)
    :duration (= ?duration 60)
    :condition (and (at start (ready ?r)) (over all (at ?r ?p)))
    :effect (and (at start (not (ready ?r))) (at end (checked ?p)) (at end (ready ?r)))))
"""


def roads():
    """Each road with its planned driving time."""
    found = {}
    for side in (WEST, EAST):
        for a in side:
            for b in side:
                if a != b:
                    found[a, b] = HOP
            for way, seconds in WAYS.items():
                found[a, way] = found[way, a] = seconds
    return found


def initial_facts(robots):
    """Facts at the beginning of the day. All stations have been checked."""
    facts = {f"(at {robot} {place})" for robot, place in zip(robots, ["dock", "ward", "wash"])}
    facts |= {f"({word} {robot})" for robot in robots for word in ("ready", "empty")}
    facts |= {f"(stored t{number} {STATIONS[number % 6]})" for number in range(TOTES)}
    return facts | {f"(checked {place})" for place in STATIONS}


def problem(robots):
    """A problem whose goal holds from the beginning."""
    facts = sorted(initial_facts(robots)) + [f"(road {a} {b})" for a, b in roads()]
    facts += [f"(= (distance {a} {b}) {seconds})" for (a, b), seconds in roads().items()]
    totes = " ".join(f"t{number}" for number in range(TOTES))
    places = " ".join([*STATIONS, *WAYS, "vault"])
    return (
        f"(define (problem day) (:domain depot) (:objects {' '.join(robots)} - robot {totes} - tote {places} - place)"
        f" (:init {' '.join(facts)}) (:goal (checked dock)))"
    )


@dataclass
class Task:
    """A task with its release time and deadline, in seconds of the world."""

    name: str
    goal: str
    release: float
    deadline: float
    value: float
    kind: str
    target: str
    tote: int | None = None
    undone: list = field(default_factory=list)
    """Facts that become false when the task is released."""


def tasks(seed, count, seconds):
    """Draws the tasks of a day. Nine of ten can be done, most of them in time."""
    dice = random.Random(f"tasks {seed}")
    times = sorted(dice.uniform(60, seconds * 0.94) for _ in range(count))
    odd = set(dice.sample(range(count), count // 10))
    target = {number: STATIONS[number % 6] for number in range(TOTES)}
    busy_until = {}
    made = []
    for number, release in enumerate(times):
        kind = dice.choice(["vault", "torn", "tight"]) if number in odd else dice.choice(["carry", "carry", "check"])
        allowed = {"carry": dice.uniform(420, 900), "check": dice.uniform(300, 700)}.get(kind, dice.uniform(300, 600))
        value = dice.choice([1, 1, 2, 3, 5])
        task = Task(f"task{number}", "", release, release + allowed, value, kind, "")
        free = sorted(target, key=lambda tote: busy_until.get(tote, 0))[:4]
        tote = dice.choice(free)
        if kind == "check":
            stations = sorted(STATIONS, key=lambda place: busy_until.get(place, 0))[:3]
            task.target = dice.choice(stations)
            task.goal, task.undone = f"(checked {task.target})", [f"(checked {task.target})"]
            busy_until[task.target] = task.deadline
        elif kind == "vault":
            task.goal, task.target = f"(stored t{tote} vault)", "vault"
        else:
            other = [place for place in STATIONS if place != target[tote]]
            first, second = dice.sample(other, 2)
            task.tote, task.target = tote, first
            busy_until[tote] = task.deadline
            if kind == "torn":
                task.goal = f"(and (stored t{tote} {first}) (stored t{tote} {second}))"
            else:
                task.goal = f"(stored t{tote} {first})"
                target[tote] = first
            if kind == "tight":
                task.deadline = release + 15
        made.append(task)
    return made


class Truth:
    """Hidden durations and slips. The n-th start of an action has the same outcome in each run of a seed."""

    def __init__(self, seed, robots, common=True):
        self.seed, self.starts = seed, {}
        dice = random.Random(f"day {seed}")
        self.factor = {robot: dice.lognormvariate(0, 0.12) if common else 1.0 for robot in robots}

    def mean(self, name, arguments):
        """Mean duration of an action on an average day."""
        if name != "drive":
            return DURATIONS[name] * 1.1
        a, b = arguments[1:]
        return roads()[a, b] * (2.6 if "lift" in (a, b) else 1.05)

    def draw(self, text):
        """Returns duration and success of the next start of an action."""
        name, *arguments = text.strip("()").split()
        number = self.starts[text] = self.starts.get(text, 0) + 1
        dice = random.Random(f"{self.seed} {text} {number}")
        seconds = self.mean(name, arguments) * self.factor[arguments[0]] * dice.lognormvariate(0, 0.15)
        return seconds, dice.random() >= {"load": 0.04, "unload": 0.02}.get(name, 0.0)
