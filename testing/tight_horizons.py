"""First plans for generated problems with temporal windows and a tight horizon.

    python3 testing/tight_horizons.py PROGRAM [--kinds turnaround,shifts,lunch,passes] [--sizes 8,12,16,20,24]
                                      [--seeds 2] [--limit 10] [--keep FOLDER]

Each problem has a plan by construction: a greedy schedule, 15 percent of whose length is added to give the horizon (in
`turnaround`, the departure slots are long enough for such a schedule). Prints a row for each size: how many problems are
solved within the limit, and the seconds to the first plans. Standard library only.
"""

import argparse
import pathlib
import random
import re
import subprocess
import tempfile

SLACK = 1.15
# Separation of actions that need the same thing.
GAP = 0.01

REQUIREMENTS = "(:requirements :typing :durative-actions :numeric-fluents :timed-initial-literals :negative-preconditions)"


def action(name, parameters, duration, conditions, effects):
    """A durative action; conditions and effects are written as `start (…)`, `end (…)` or `all (…)`."""
    times = {"start": "at start", "end": "at end", "all": "over all"}

    def conjunction(parts):
        return "(and " + " ".join(f"({times[part.split()[0]]} {part.split(' ', 1)[1]})" for part in parts) + ")"

    return (f"(:durative-action {name} :parameters ({parameters}) :duration (= ?duration {duration})\n"
            f"  :condition {conjunction(conditions)}\n  :effect {conjunction(effects)})\n")


def during(what):
    """Conditions and effects of an action that occupies something: false from its start to its end."""
    return f"start {what}", [f"start (not {what})", f"end {what}"]


def problem(name, objects, init, goal):
    lists = " ".join(" ".join(names) + f" - {kind}" for kind, names in objects.items())
    return (f"(define (problem p) (:domain {name}) (:objects {lists})\n(:init {' '.join(init)})\n"
            f"(:goal (and {' '.join(goal)})) (:metric minimize (total-time)))\n")


def numbered(letter, count):
    return [f"{letter}{number}" for number in range(count)]


def windows_of(fact, intervals, horizon):
    """A fact that is true in these intervals, as far as they begin before the horizon."""
    init = []
    for begin, end in intervals:
        if begin > horizon:
            break
        init.append(fact if begin == 0 else f"(at {begin} {fact})")
        init.append(f"(at {end} (not {fact}))")
    return init


def fit(intervals, earliest, duration):
    """The earliest start of an action within one of the intervals."""
    return next(max(earliest, begin) for begin, end in intervals if max(earliest, begin) + duration <= end - GAP)


def closing(end):
    return ["(open)", f"(at {end * SLACK:.2f} (not (open)))"]


def turnaround(rng, size):
    """Aircraft are unloaded, cleaned and boarded by crews, and depart in one of two slots."""
    aircraft, crews = numbered("a", size), numbered("c", max(2, size // 2))
    needs, busy = during("(free ?c)")
    domain = f"""(define (domain turnaround) {REQUIREMENTS}
(:types aircraft crew)
(:predicates (free ?c - crew) (slot ?a - aircraft) (ready ?a - aircraft) (unloaded ?a - aircraft)
  (cleaned ?a - aircraft) (boarded ?a - aircraft) (gone ?a - aircraft))
"""
    steps = [("unload", 10, "ready", "unloaded"), ("clean", 12, "unloaded", "cleaned"), ("board", 15, "cleaned", "boarded")]
    for name, duration, before, after in steps:
        domain += action(name, "?a - aircraft ?c - crew", duration, [needs, f"start ({before} ?a)"],
                         [*busy, f"end ({after} ?a)"])
    domain += action("depart", "?a - aircraft", 5, ["start (boarded ?a)", "start (slot ?a)"], ["end (gone ?a)"]) + ")"
    init = [f"(free {crew})" for crew in crews]
    for name in aircraft:
        opens = rng.randint(80, 120)
        init += [f"(ready {name})", *windows_of(f"(slot {name})", [(opens, opens + 40), (opens + 90, opens + 150)], 1000)]
    goal = [f"(gone {name})" for name in aircraft]
    return domain, problem("turnaround", {"aircraft": aircraft, "crew": crews}, init, goal)


def shifts(rng, size):
    """Jobs need a machine and a worker with the skill, during one of the worker's shifts."""
    workers, machines = numbered("w", max(2, size // 4)), numbered("m", max(2, size // 4))
    jobs = [(rng.randint(2, 9), rng.choice(machines)) for _ in range(size)]
    shift = {name: [(24 * day + 4 * (number % 3), 24 * day + 4 * (number % 3) + 10) for day in range(20)]
             for number, name in enumerate(workers)}
    skills = {name: set(rng.sample(machines, max(1, len(machines) // 2))) for name in workers}
    for machine in machines:
        if not any(machine in known for known in skills.values()):
            skills[rng.choice(workers)].add(machine)
    free = dict.fromkeys([*workers, *machines], 0)
    end = 0
    for duration, machine in sorted(jobs, reverse=True):
        able = [name for name in workers if machine in skills[name]]
        done, worker = min((fit(shift[name], max(free[name], free[machine]), duration) + duration, name) for name in able)
        free[worker] = free[machine] = done + GAP
        end = max(end, done)
    needs, busy = zip(during("(free ?w)"), during("(idle ?m)"))
    domain = f"""(define (domain shifts) {REQUIREMENTS}
(:types worker machine job)
(:predicates (on-shift ?w - worker) (free ?w - worker) (idle ?m - machine) (skilled ?w - worker ?m - machine)
  (for ?j - job ?m - machine) (to-do ?j - job) (done ?j - job) (open))
(:functions (length ?j - job))
""" + action("work", "?w - worker ?m - machine ?j - job", "(length ?j)",
             [*needs, "start (skilled ?w ?m)", "start (for ?j ?m)", "start (to-do ?j)", "all (on-shift ?w)", "end (open)"],
             [*busy[0], *busy[1], "start (not (to-do ?j))", "end (done ?j)"]) + ")"
    init = [f"(free {name})" for name in workers] + [f"(idle {name})" for name in machines] + closing(end)
    init += [f"(skilled {name} {machine})" for name in workers for machine in sorted(skills[name])]
    for number, (duration, machine) in enumerate(jobs):
        init += [f"(for j{number} {machine})", f"(to-do j{number})", f"(= (length j{number}) {duration})"]
    for name in workers:
        init += windows_of(f"(on-shift {name})", shift[name], end * SLACK)
    names = numbered("j", size)
    objects = {"worker": workers, "machine": machines, "job": names}
    return domain, problem("shifts", objects, init, [f"(done {name})" for name in names])


def lunch(rng, size):
    """Parts visit three of four machines, carried by carts; nobody is at the machines at noon and at night."""
    machines, carts, parts = numbered("m", 4), numbered("c", max(2, size // 3)), numbered("p", size)
    routes = [[(machine, rng.randint(2, 8)) for machine in rng.sample(machines, 3)] for _ in parts]
    staffed = [(60 * day + half, 60 * day + half + 24) for day in range(20) for half in (0, 30)]
    free = dict.fromkeys(machines, 0)
    cart_free = [0] * len(carts)
    end = 0
    for route in routes:
        time = 0
        for machine, duration in route:
            cart = cart_free.index(min(cart_free))
            time = max(time, cart_free[cart]) + 2 + GAP
            cart_free[cart] = time + 2
            time = fit(staffed, max(time, free[machine]), duration) + duration + GAP
            free[machine] = time
        end = max(end, time)
    domain = f"""(define (domain lunch) {REQUIREMENTS}
(:types part machine cart)
(:predicates (staffed ?m - machine) (idle ?m - machine) (free ?c - cart) (stored ?p - part) (at ?p - part ?m - machine)
  (first ?p - part ?m - machine) (second ?p - part ?m ?n - machine) (third ?p - part ?m ?n - machine)
  (done1 ?p - part) (done2 ?p - part) (done3 ?p - part) (open))
(:functions (length ?p - part ?m - machine))
"""
    cart_needs, cart_busy = during("(free ?c)")
    domain += action("fetch", "?c - cart ?p - part ?m - machine", 2, [cart_needs, "start (stored ?p)", "start (first ?p ?m)"],
                     [*cart_busy, "start (not (stored ?p))", "end (at ?p ?m)"])
    needs, busy = during("(idle ?m)")
    domain += action("work1", "?p - part ?m - machine", "(length ?p ?m)",
                     [needs, "all (at ?p ?m)", "start (first ?p ?m)", "all (staffed ?m)"], [*busy, "end (done1 ?p)"])
    needs, busy = during("(idle ?n)")
    for number, order, more in ((2, "second", []), (3, "third", ["end (open)"])):
        leg = f"start ({order} ?p ?m ?n)"
        domain += action(f"carry{number}", "?c - cart ?p - part ?m ?n - machine", 2,
                         [cart_needs, "start (at ?p ?m)", f"start (done{number - 1} ?p)", leg],
                         [*cart_busy, "start (not (at ?p ?m))", "end (at ?p ?n)"])
        domain += action(f"work{number}", "?p - part ?m ?n - machine", "(length ?p ?n)",
                         [needs, "all (at ?p ?n)", f"start (done{number - 1} ?p)", leg, "all (staffed ?n)", *more],
                         [*busy, f"end (done{number} ?p)"])
    domain += ")"
    init = [f"(idle {name})" for name in machines] + [f"(free {name})" for name in carts] + closing(end)
    for part, route in zip(parts, routes):
        (one, _), (two, _), (three, _) = route
        init += [f"(stored {part})", f"(first {part} {one})", f"(second {part} {one} {two})", f"(third {part} {two} {three})"]
        init += [f"(= (length {part} {machine}) {duration})" for machine, duration in route]
    for name in machines:
        init += windows_of(f"(staffed {name})", staffed, end * SLACK)
    return domain, problem("lunch", {"part": parts, "machine": machines, "cart": carts}, init,
                           [f"(done3 {part})" for part in parts])


def passes(rng, size):
    """Satellites turn, take an image, and send it during a pass over a station before they take another one."""
    satellites, stations, targets = numbered("s", max(2, size // 4)), numbered("g", 2), numbered("t", 8)
    wanted = [rng.choice(targets) for _ in range(size)]
    turn = {(one, other): rng.randint(2, 6) for one in targets for other in targets if one != other}
    visible = {}
    for satellite in satellites:
        for station in stations:
            begin, length = rng.uniform(5, 25), rng.uniform(7, 10)
            visible[satellite, station] = [(round(begin + 30 * lap, 1), round(begin + 30 * lap + length, 1)) for lap in range(40)]
    free, pointing = dict.fromkeys([*satellites, *stations], 0.0), dict.fromkeys(satellites, "t0")
    end = 0
    for target in wanted:
        options = []
        for (satellite, station), laps in visible.items():
            time = free[satellite] + turn.get((pointing[satellite], target), 0) + 3 + 4 * GAP
            options.append((fit(laps, max(time, free[station]), 4) + 4, satellite, station))
        done, satellite, station = min(options)
        free[satellite] = free[station] = done + 2 * GAP
        pointing[satellite] = target
        end = max(end, done)
    needs, busy = during("(idle ?s)")
    domain = f"""(define (domain passes) {REQUIREMENTS}
(:types sat target station image)
(:predicates (pointing ?s - sat ?t - target) (idle ?s - sat) (of ?i - image ?t - target) (holds ?s - sat ?i - image)
  (empty ?s - sat) (visible ?s - sat ?g - station) (antenna ?g - station) (sent ?i - image) (open))
(:functions (angle ?a ?b - target))
"""
    domain += action("turn", "?s - sat ?a ?b - target", "(angle ?a ?b)", [needs, "start (pointing ?s ?a)"],
                     [*busy, "start (not (pointing ?s ?a))", "end (pointing ?s ?b)"])
    domain += action("take", "?s - sat ?i - image ?t - target", 3,
                     [needs, "all (pointing ?s ?t)", "start (of ?i ?t)", "start (empty ?s)"],
                     [*busy, "start (not (empty ?s))", "end (holds ?s ?i)"])
    needs, busy = during("(antenna ?g)")
    domain += action("send", "?s - sat ?i - image ?g - station", 4,
                     [needs, "start (holds ?s ?i)", "all (visible ?s ?g)", "end (open)"],
                     [*busy, "start (not (holds ?s ?i))", "end (empty ?s)", "end (sent ?i)"]) + ")"
    init = [f"({fact} {name})" for name in satellites for fact in ("idle", "empty")] + closing(end)
    init += [f"(pointing {name} t0)" for name in satellites] + [f"(antenna {name})" for name in stations]
    init += [f"(of i{number} {target})" for number, target in enumerate(wanted)]
    init += [f"(= (angle {one} {other}) {angle})" for (one, other), angle in turn.items()]
    for (satellite, station), laps in visible.items():
        init += windows_of(f"(visible {satellite} {station})", laps, end * SLACK)
    images = numbered("i", size)
    objects = {"sat": satellites, "target": targets, "station": stations, "image": images}
    return domain, problem("passes", objects, init, [f"(sent {name})" for name in images])


KINDS = {"turnaround": turnaround, "shifts": shifts, "lunch": lunch, "passes": passes}


def first_plan(program, folder, limit):
    """Seconds to the first plan, or None."""
    files = [str(folder / name) for name in ("domain.pddl", "problem.pddl")]
    run = subprocess.run([program, "plan", *files, "--time-limit", str(limit), "--jobs", "1", "-o", str(folder / "plan.plan")],
                         capture_output=True, text=True, check=False)
    found = re.search(r"^plan 1 after ([\d.]+) s", run.stderr, re.MULTILINE)
    if found:
        checked = subprocess.run([program, "check", *files, str(folder / "plan.plan")], capture_output=True, check=False)
        if checked.returncode != 0:
            raise SystemExit(f"{folder}: the plan is not valid")
    elif run.returncode != 3:
        raise SystemExit(f"{folder}: {run.stderr}")
    return float(found.group(1)) if found else None


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("program")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--sizes", default="8,12,16,20,24")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--limit", type=int, default=10)
    parser.add_argument("--keep", type=pathlib.Path)
    arguments = parser.parse_args()
    base = arguments.keep or pathlib.Path(tempfile.mkdtemp())
    print("| kind | size | solved | seconds to the first plan |\n|---|--:|--:|---|")
    for kind in arguments.kinds.split(","):
        for size in map(int, arguments.sizes.split(",")):
            times = []
            for seed in range(1, arguments.seeds + 1):
                folder = base / f"{kind}-{size}-{seed}"
                folder.mkdir(parents=True, exist_ok=True)
                texts = KINDS[kind](random.Random(f"{kind} {size} {seed}"), size)
                for name, text in zip(("domain.pddl", "problem.pddl"), texts):
                    (folder / name).write_text(text)
                times.append(first_plan(arguments.program, folder, arguments.limit))
            solved = [time for time in times if time is not None]
            words = ", ".join("–" if time is None else f"{time:.2f}" for time in times)
            print(f"| {kind} | {size} | {len(solved)} of {len(times)} | {words} |", flush=True)


if __name__ == "__main__":
    main()
