"""Robots on rounds: a domain, a problem and a plan of any length, for measurements.

Each robot drives from place to place, and every tenth time it is served at a dock that is shared with other robots. With
numbers, driving uses charge, and the robot is recharged where it is served.
"""

PLACES = 10
DOMAIN = """(define (domain rounds)
  (:requirements :typing :durative-actions)
  (:types robot place dock)
  (:predicates (at ?r - robot ?p - place) (road ?a ?b - place) (free ?d - dock) (served ?r - robot))
  (:durative-action drive
    :parameters (?r - robot ?a ?b - place)
    :duration (= ?duration 5)
    :condition (and (at start (at ?r ?a)) (over all (road ?a ?b)))
    :effect (and (at start (not (at ?r ?a))) (at end (at ?r ?b))))
  (:durative-action serve
    :parameters (?r - robot ?a - place ?d - dock)
    :duration (= ?duration 2)
    :condition (and (over all (at ?r ?a)) (at start (free ?d)))
    :effect (and (at start (not (free ?d))) (at end (free ?d)) (at end (served ?r)))))
"""

NUMBERS = (
    ("(:predicates", "(:functions (charge ?r - robot))\n  (:predicates"),
    (":durative-actions)", ":durative-actions :numeric-fluents)"),
    ("(over all (road ?a ?b))", "(at start (>= (charge ?r) 3)) (over all (>= (charge ?r) 0)) (over all (road ?a ?b))"),
    ("(at end (at ?r ?b))", "(at end (at ?r ?b)) (at end (decrease (charge ?r) 3))"),
    ("(at end (served ?r))", "(at end (served ?r)) (at end (assign (charge ?r) 60))"),
)


def domain(has_numbers=False):
    """The domain."""
    text = DOMAIN
    for old, new in NUMBERS if has_numbers else ():
        assert old in text
        text = text.replace(old, new)
    return text


def problem(robots, docks, has_numbers=False):
    """Robots at places that lie on a ring."""
    names = [f"r{i}" for i in range(robots)]
    objects = f"{' '.join(names)} - robot {' '.join(f'p{i}' for i in range(PLACES))} - place"
    objects += f" {' '.join(f'd{i}' for i in range(docks))} - dock"
    facts = [f"(at r{i} p{i % PLACES})" for i in range(robots)]
    facts += [f"(road p{i} p{(i + 1) % PLACES})" for i in range(PLACES)]
    facts += [f"(free d{i})" for i in range(docks)]
    facts += [f"(= (charge {robot}) 60)" for robot in names if has_numbers]
    goal = " ".join(f"(served {robot})" for robot in names)
    return (
        f"(define (problem all) (:domain rounds) (:objects {objects})"
        f" (:init {' '.join(facts)}) (:goal (and {goal})))"
    )


def plan(robots, docks, actions):
    """A plan with this number of actions, each as early as possible; times are whole milliseconds."""
    free_at, place, dock_at = [0] * robots, [i % PLACES for i in range(robots)], [0] * docks
    steps = []
    for number in range(actions):
        robot, turn = number % robots, number // robots + 1
        if turn % 10 == 0 or number >= actions - robots:
            dock = (robot + turn // 10) % docks
            start = max(free_at[robot], dock_at[dock]) + 1
            steps.append((start, f"(serve r{robot} p{place[robot]} d{dock})", 2))
            free_at[robot] = dock_at[dock] = start + 2000
        else:
            start, after = free_at[robot] + 1, (place[robot] + 1) % PLACES
            steps.append((start, f"(drive r{robot} p{place[robot]} p{after})", 5))
            free_at[robot], place[robot] = start + 5000, after
    return "".join(f"{start / 1000:.3f}: {action} [{length}.0]\n" for start, action, length in sorted(steps))
