"""Plans of different shapes and of any length, for measurements: 20 robots that limit each other in one way.

Each shape is a function of the number of actions. It returns the domain, the problem and the steps of a plan: start in
milliseconds, action, seconds.
"""

ROBOTS = [f"r{i}" for i in range(20)]
IDLE, BUSY, FREE = "(at start (idle ?r))", "(at start (not (idle ?r)))", "(at end (idle ?r))"


def action(name, conditions, effects, seconds=5):
    """A durative action of a robot."""
    return (
        f"\n (:durative-action {name} :parameters (?r - robot) :duration (= ?duration {seconds})"
        f"\n  :condition (and {conditions})\n  :effect (and {effects} (at end (done ?r))))"
    )


def texts(actions, facts, predicates="", functions="", goal=None):
    """A domain and a problem with a task for each robot."""
    each = [f"(idle {robot})" for robot in ROBOTS]
    domain = (
        "(define (domain shape) (:requirements :typing :durative-actions :numeric-fluents :continuous-effects"
        " :timed-initial-literals)\n (:types robot)"
        f"\n (:predicates (idle ?r - robot) (done ?r - robot) {predicates})"
        + (f"\n (:functions {functions})" if functions else "")
        + "".join(actions)
        + ")\n"
    )
    goal = goal or f"(and {' '.join(f'(done {robot})' for robot in ROBOTS)})"
    problem = (
        f"(define (problem shape) (:domain shape) (:objects {' '.join(ROBOTS)} - robot)"
        f"\n (:init {' '.join([*each, *facts])})\n (:goal {goal}))\n"
    )
    return domain, problem


def in_turns(count, name, turn=5001):
    """All robots concurrently, turn after turn; `name` is the action of a robot in a turn."""
    turns = [divmod(number, len(ROBOTS)) for number in range(count)]
    return [(number * turn + 1, f"({name(number)} {ROBOTS[robot]})", 5) for number, robot in turns]


def lock(count):
    """One resource that all robots use sequentially."""
    use = action("use", "(at start (free))", "(at start (not (free))) (at end (free))")
    steps = [(i * 5001 + 1, f"(use {ROBOTS[i % len(ROBOTS)]})", 5) for i in range(count)]
    return *texts([use], ["(free)"], predicates="(free)"), steps


def counter(count):
    """A number that all robots increase, and that is the goal."""
    work = action("work", IDLE, f"{BUSY} {FREE} (at end (increase (count) 1))")
    domain, problem = texts([work], ["(= (count) 0)"], functions="(count)", goal=f"(>= (count) {count})")
    return domain, problem, in_turns(count, lambda _: "work")


def pool(count):
    """A number that all robots decrease and restore; half of them can work at a time."""
    half = len(ROBOTS) // 2
    effects = f"{BUSY} {FREE} (at start (decrease (tools) 1)) (at end (increase (tools) 1))"
    work = action("work", f"{IDLE} (at start (>= (tools) 1))", effects)
    steps = []
    for number in range(count):
        turn, place = divmod(number, half)
        start = turn * (5000 + 4 * half) + 4 * place + 3
        steps.append((start, f"(work {ROBOTS[number % len(ROBOTS)]})", 5))
    return *texts([work], [f"(= (tools) {half})"], functions="(tools)"), steps


def stock(count):
    """A number that half of the robots increase and the others decrease."""
    make = action("make", IDLE, f"{BUSY} {FREE} (at end (increase (parts) 1))")
    use = action("use", f"{IDLE} (at start (>= (parts) 1))", f"{BUSY} {FREE} (at start (decrease (parts) 1))")
    steps = []
    for number in range(count):
        turn, robot = divmod(number, len(ROBOTS))
        start = turn * 5201 + 4 * robot + 1
        makes = robot < len(ROBOTS) // 2
        name = "make" if makes else "use"
        steps.append((start if makes else start + 5302, f"({name} {ROBOTS[robot]})", 5))
    return *texts([make, use], ["(= (parts) 0)"], functions="(parts)"), steps


def match(count):
    """Required concurrency: repairs while a match burns."""
    light = "(at start (light ?r)) (at end (not (light ?r)))"
    burn = action("burn", "(at start (dark ?r))", f"(at start (not (dark ?r))) (at end (dark ?r)) {light}", 8)
    mend = action("mend", f"{IDLE} (over all (light ?r))", f"{BUSY} {FREE}")
    steps = []
    for number in range(count // 2):
        turn, robot = divmod(number, len(ROBOTS))
        start = turn * 8002 + 1
        steps += [(start, f"(burn {ROBOTS[robot]})", 8), (start + 1001, f"(mend {ROBOTS[robot]})", 5)]
    dark = [f"(dark {robot})" for robot in ROBOTS]
    return *texts([burn, mend], dark, predicates="(dark ?r - robot) (light ?r - robot)"), steps


def deadline(count):
    """One deadline for all actions, a tenth later than planned."""
    work = action("work", f"{IDLE} (over all (open))", f"{BUSY} {FREE}")
    end = (count // len(ROBOTS) + 1) * 5.5 + 50
    facts = ["(open)", f"(at {end} (not (open)))"]
    return *texts([work], facts, predicates="(open)"), in_turns(count, lambda _: "work")


def windows(count):
    """Work in windows that open and close, and rest between them."""
    actions = [
        action("work", f"{IDLE} (over all (open))", f"{BUSY} {FREE}"),
        action("rest", IDLE, f"{BUSY} {FREE}"),
    ]
    facts = []
    for turn in range(0, count // len(ROBOTS) + 1, 2):
        facts += [f"(at {turn * 10 + 1} (open))", f"(at {turn * 10 + 9} (not (open)))"]
    steps = in_turns(count, lambda turn: "rest" if turn % 2 else "work", turn=10_000)
    return *texts(actions, facts, predicates="(open)"), [(start + 2000, *rest) for start, *rest in steps]


def due(count):
    """A deadline for each turn; the slack increases by a tenth with each."""
    work = (
        "\n (:durative-action work :parameters (?r - robot ?t - turn) :duration (= ?duration 5)"
        f"\n  :condition (and {IDLE} (over all (open ?t)))\n  :effect (and {BUSY} {FREE} (at end (done ?r))))"
    )
    turns = count // len(ROBOTS) + 1
    facts = [f"(open t{turn}) (at {turn * 5.5 + 8} (not (open t{turn})))" for turn in range(turns)]
    domain, problem = texts([work], facts, predicates="(open ?t - turn)")
    domain = domain.replace("(:types robot)", "(:types robot turn)")
    objects = " ".join(f"t{turn}" for turn in range(turns))
    problem = problem.replace(" - robot)", f" - robot {objects} - turn)")
    places = [divmod(number, len(ROBOTS)) for number in range(count)]
    return domain, problem, [(turn * 5001 + 1, f"(work {ROBOTS[robot]} t{turn})", 5) for turn, robot in places]


def battery(count):
    """Charge that falls continuously while a robot drives; each eighth time it is loaded."""
    drive = action(
        "drive", f"{IDLE} (over all (>= (charge ?r) 0))", f"{BUSY} {FREE} (decrease (charge ?r) (* #t 1))"
    )
    load = action("load", IDLE, f"{BUSY} {FREE} (at end (assign (charge ?r) 60))")
    facts = [f"(= (charge {robot}) 60)" for robot in ROBOTS]
    domain, problem = texts([drive, load], facts, functions="(charge ?r - robot)")
    return domain, problem, in_turns(count, lambda turn: "load" if turn % 8 == 7 else "drive")


SHAPES = {it.__name__: it for it in (lock, counter, pool, stock, match, deadline, due, windows, battery)}


def files(shape, count):
    """Domain, problem and plan, as text."""
    domain, problem, steps = SHAPES[shape](count)
    lines = [f"{start / 1000:.3f}: {name} [{seconds}.0]\n" for start, name, seconds in sorted(steps)]
    return domain, problem, "".join(lines)
