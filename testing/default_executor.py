"""Comparison of the default executor with the baselines, in worlds of many kinds.

    python3 testing/default_executor.py PROGRAM FOLDER [--trials 100] [--seconds S] [--only TEXT] [--jobs N]
                                        [--data ../shared/data] [--executors live,esterel,stn]

The first executor is compared with the others. Each world is a domain, a problem and, for most, a plan with which every
executor begins. Durations vary by 1, 10 and 30 percent, with and without failures of one start in ten. All executors use
the same random seeds. Each world is one experiment of `elbowroom compare`. Its results are kept in FOLDER, and a second
call continues where the first ended. At the end a table is printed and written to FOLDER/table.md. For each world, it has
the number of runs that reached the goal, and the paired difference to each baseline with its standard error.

Exit code 1: the first executor is below a baseline by three standard errors, in some world or over all worlds. Standard
library only. Without the folder `--data`, its worlds are omitted.
"""

import argparse
import csv
import json
import math
import pathlib
import random
import signal
import subprocess
import sys
import time

import executor_worlds

DEVIATIONS = (1, 10, 30)


# Local domains: (name, domain, problem, plan or None).


def within(jobs, length, job, name, one_hand=True):
    """`jobs` actions that must lie within another running action, such as a torch or a pump."""
    hand = "(at start (hand)) " if one_hand else ""
    takes = "(at start (not (hand))) (at end (hand)) " if one_hand else ""
    domain = f"""(define (domain {name}) (:requirements :typing :durative-actions)
  (:types job) (:predicates (on) (fresh) (hand) (done ?j - job))
  (:durative-action burn :parameters () :duration (= ?duration {length}) :condition (at start (fresh))
    :effect (and (at start (not (fresh))) (at start (on)) (at end (not (on)))))
  (:durative-action work :parameters (?j - job) :duration (= ?duration {job})
    :condition (and {hand}(over all (on))) :effect (and {takes}(at end (done ?j)))))
"""
    names = [f"j{it}" for it in range(jobs)]
    problem = f"""(define (problem p) (:domain {name}) (:objects {" ".join(names)} - job)
  (:init (fresh) (hand)) (:goal (and {" ".join(f"(done {it})" for it in names)})))
"""
    step = job + 0.002 if one_hand else 0
    lines = [f"0.000: (burn) [{length}]"]
    lines += [f"{0.002 + step * place:.3f}: (work {it}) [{job}]" for place, it in enumerate(names)]
    return domain, problem, "\n".join(lines) + "\n"


def window(jobs, job, opens, closes, name):
    """Actions that must lie within the opening times of a place."""
    domain = f"""(define (domain {name}) (:requirements :typing :durative-actions :timed-initial-literals)
  (:types job) (:predicates (open) (hand) (done ?j - job))
  (:durative-action work :parameters (?j - job) :duration (= ?duration {job})
    :condition (and (at start (hand)) (over all (open)))
    :effect (and (at start (not (hand))) (at end (hand)) (at end (done ?j)))))
"""
    names = [f"j{it}" for it in range(jobs)]
    problem = f"""(define (problem p) (:domain {name}) (:objects {" ".join(names)} - job)
  (:init (hand) (at {opens} (open)) (at {closes} (not (open))))
  (:goal (and {" ".join(f"(done {it})" for it in names)})))
"""
    lines = [f"{opens + 0.001 + (job + 0.001) * place:.3f}: (work {it}) [{job}]" for place, it in enumerate(names)]
    return domain, problem, "\n".join(lines) + "\n"


def recharge(needed, planned, least, most, deadline, name):
    """A recharge of open duration before a drive that needs the charge, with a deadline for both."""
    domain = f"""(define (domain {name})
  (:requirements :durative-actions :numeric-fluents :duration-inequalities :timed-initial-literals)
  (:predicates (free) (there) (in-time) (home)) (:functions (charge))
  (:durative-action recharge :parameters () :duration (and (>= ?duration {least}) (<= ?duration {most}))
    :condition (and (at start (free)) (over all (home)))
    :effect (and (at start (not (free))) (at end (free)) (at end (increase (charge) ?duration))))
  (:durative-action drive :parameters () :duration (= ?duration 20)
    :condition (and (at start (free)) (at start (home)) (at start (>= (charge) {needed})) (at end (in-time)))
    :effect (and (at start (not (free))) (at start (not (home))) (at end (free)) (at end (there)))))
"""
    problem = f"""(define (problem p) (:domain {name})
  (:init (free) (home) (in-time) (= (charge) 0) (at {deadline} (not (in-time))))
  (:goal (there)))
"""
    return domain, problem, f"0.000: (recharge) [{planned}]\n{planned + 0.001:.3f}: (drive) [20]\n"


def errands(robots, stops, deadline, name, of_two=True):
    """Robots that visit places in turn, with one deadline for all; two of them meet at the end, or one meets itself."""
    differ = "(at start (not (= ?a ?b))) " if of_two else ""
    domain = f"""(define (domain {name})
  (:requirements :typing :equality :negative-preconditions :durative-actions :timed-initial-literals)
  (:types robot place) (:predicates (at ?r - robot ?p - place) (next ?p ?q - place) (open) (met))
  (:durative-action go :parameters (?r - robot ?p ?q - place) :duration (= ?duration 5)
    :condition (and (at start (at ?r ?p)) (over all (next ?p ?q)) (over all (open)))
    :effect (and (at start (not (at ?r ?p))) (at end (at ?r ?q))))
  (:durative-action meet :parameters (?a ?b - robot ?p - place) :duration (= ?duration 2)
    :condition (and {differ}(over all (at ?a ?p)) (over all (at ?b ?p)) (over all (open)))
    :effect (at end (met))))
"""
    robot_names = [f"r{it}" for it in range(robots)]
    places = [f"p{it}" for it in range(stops + 1)]
    nexts = " ".join(f"(next {a} {b})" for a, b in zip(places, places[1:]))
    starts = " ".join(f"(at {it} p0)" for it in robot_names)
    problem = f"""(define (problem p) (:domain {name})
  (:objects {" ".join(robot_names)} - robot {" ".join(places)} - place)
  (:init {starts} {nexts} (open) (at {deadline} (not (open))))
  (:goal (and (met) {" ".join(f"(at {it} p{stops})" for it in robot_names)})))
"""
    lines = [
        f"{0.001 + 5.001 * place:.3f}: (go {it} p{place} p{place + 1}) [5]" for it in robot_names for place in range(stops)
    ]
    lines.append(f"{0.002 + 5.001 * stops:.3f}: (meet r0 r1 p{stops}) [2]")
    return domain, problem, "\n".join(lines) + "\n"


def handover(deadline, name):
    """A door that one robot holds open while another passes with a load."""
    domain = f"""(define (domain {name}) (:requirements :durative-actions :timed-initial-literals)
  (:predicates (open) (held) (outside) (inside) (waiting) (delivered) (day))
  (:durative-action hold :parameters () :duration (= ?duration 12) :condition (at start (waiting))
    :effect (and (at start (not (waiting))) (at start (open)) (at end (not (open))) (at end (waiting))))
  (:durative-action pass :parameters () :duration (= ?duration 8)
    :condition (and (at start (outside)) (over all (open)))
    :effect (and (at start (not (outside))) (at end (inside))))
  (:durative-action deliver :parameters () :duration (= ?duration 6)
    :condition (and (at start (inside)) (over all (day))) :effect (at end (delivered))))
"""
    problem = f"""(define (problem p) (:domain {name})
  (:init (waiting) (outside) (day) (at {deadline} (not (day)))) (:goal (delivered)))
"""
    return domain, problem, "0.000: (hold) [12]\n2.000: (pass) [8]\n10.001: (deliver) [6]\n"


def kettles(kettles, shift, pause, gas, name):
    """Kettles that are heated at any time, for as long as they need, and boiled and emptied in shifts. Burnt ones are lost."""
    domain = f"""(define (domain {name})
  (:requirements :typing :durative-actions :numeric-fluents :continuous-effects :duration-inequalities
    :timed-initial-literals)
  (:types kettle) (:predicates (free ?k - kettle) (ready) (shift) (boiled ?k - kettle) (bottled ?k - kettle))
  (:functions (temperature ?k - kettle) (gas))
  (:durative-action heat :parameters (?k - kettle) :duration (and (>= ?duration 2) (<= ?duration 40))
    :condition (and (at start (free ?k)) (over all (>= (gas) 0)) (over all (<= (temperature ?k) 100)))
    :effect (and (at start (not (free ?k))) (at end (free ?k)) (increase (temperature ?k) (* #t 4))
      (decrease (gas) (* #t 1))))
  (:durative-action boil :parameters (?k - kettle) :duration (= ?duration 7)
    :condition (and (at start (free ?k)) (at start (>= (temperature ?k) 90)) (over all (shift)))
    :effect (and (at start (not (free ?k))) (at end (free ?k)) (at end (boiled ?k))
      (decrease (temperature ?k) (* #t 2))))
  (:durative-action bottle :parameters (?k - kettle) :duration (= ?duration 5)
    :condition (and (at start (free ?k)) (at start (ready)) (at start (boiled ?k)) (over all (shift)))
    :effect (and (at start (not (ready))) (at end (ready)) (at start (not (free ?k))) (at end (bottled ?k)))))
"""
    names = [f"k{it}" for it in range(kettles)]
    warm = " ".join(f"(= (temperature {it}) {20 + 20 * (place % 3)})" for place, it in enumerate(names))
    opens = [10 + (shift + pause) * it for it in range(4)]
    shifts = " ".join(f"(at {it} (shift)) (at {it + shift} (not (shift)))" for it in opens)
    problem = f"""(define (problem p) (:domain {name}) (:objects {" ".join(names)} - kettle)
  (:init (ready) (= (gas) {gas}) {" ".join(f"(free {it})" for it in names)} {warm} {shifts})
  (:goal (and {" ".join(f"(bottled {it})" for it in names)})))
"""
    return domain, problem, None


def own_worlds():
    worlds = {}
    torches = ((1, 10, 6), (2, 10, 4), (2, 9, 4), (2, 30, 10), (3, 10, 3), (3, 12, 3), (3, 40, 12), (4, 30, 5), (5, 18, 3))
    for jobs, length, job in (*torches, (6, 20, 3), (8, 60, 6), (10, 12, 1)):
        worlds[f"torch-{jobs}x{job}-in-{length}"] = within(jobs, length, job, "torch")
    for jobs, length, job in ((2, 10, 8), (3, 8, 7), (1, 20, 19), (4, 12, 10), (5, 100, 60)):
        worlds[f"pump-{jobs}x{job}-in-{length}"] = within(jobs, length, job, "pump", one_hand=False)
    windows = ((1, 8, 5, 15), (3, 5, 2, 20), (5, 4, 10, 33), (2, 10, 0.5, 26), (1, 30, 0.5, 31), (2, 3, 50, 57), (6, 2, 4, 18))
    for jobs, job, opens, closes in (*windows, (10, 1, 3, 16)):
        worlds[f"window-{jobs}x{job}-{opens}-{closes}"] = window(jobs, job, opens, closes, "window")
    recharges = ((25, 40, 1, 100, 90), (25, 26, 1, 100, 60), (50, 60, 10, 80, 95), (10, 10, 5, 20, 40), (70, 75, 30, 90, 98))
    for needed, planned, least, most, deadline in recharges:
        values = (needed, planned, least, most, deadline)
        worlds[f"recharge-{needed}-of-{planned}-by-{deadline}"] = recharge(*values, "recharge")
    for robots, stops, deadline in ((2, 1, 9), (2, 2, 14), (2, 3, 40), (2, 4, 26), (3, 1, 8), (3, 3, 22), (4, 5, 33)):
        worlds[f"errands-{robots}x{stops}-by-{deadline}"] = errands(robots, stops, deadline, "errands")
    # The given plan lets two robots meet. Another plan need not wait for the second one.
    for robots, stops, deadline in ((2, 2, 14), (3, 3, 19), (3, 3, 22), (4, 3, 22)):
        files = errands(robots, stops, deadline, "errands", of_two=False)
        worlds[f"meeting-{robots}x{stops}-by-{deadline}"] = files
    for deadline in (17, 18, 22, 40):
        worlds[f"handover-by-{deadline}"] = handover(deadline, "handover")
    for number, shift, pause, gas in ((2, 20, 10, 80), (3, 20, 10, 120), (3, 30, 20, 70), (2, 15, 30, 45)):
        worlds[f"kettles-{number}-{shift}-{pause}-{gas}"] = kettles(number, shift, pause, gas, "kettles")
    return worlds


def data_worlds(data):
    """Problems and plans under the folder of the data, as files."""
    worlds = {}
    listed = data / "pddl" / "plans.csv"
    if listed.exists():
        of_domain = {}
        for row in csv.DictReader(listed.open(encoding="utf-8")):
            if row["val_t1e-3"] == "valid":
                of_domain.setdefault(row["domain"], []).append(row)
        for domain, rows in sorted(of_domain.items()):
            for row in rows:
                name = f"{domain}-{row['instance']}-{row['origin']}".replace("/", "-")
                files = [data / "pddl" / row[it] for it in ("domain_file", "problem_file", "plan_file")]
                worlds[name] = tuple(files)
    for domain in sorted((data / "strangers").glob("*/domain.pddl")):
        for problem in sorted(domain.parent.glob("*.pddl")):
            if "domain" not in problem.name:
                worlds[f"stranger-{domain.parent.name}-{problem.stem}"] = (domain, problem, None)
    manifest = data / "required-concurrency" / "manifest.csv"
    if manifest.exists():
        seen = {}
        for row in csv.DictReader(manifest.open(encoding="utf-8")):
            seen[row["domain"]] = seen.get(row["domain"], 0) + 1
            # Two of each domain, without a plan: the planner makes one.
            if seen[row["domain"]] <= 2:
                files = [manifest.parent / row[it] for it in ("domain_file", "problem_file")]
                worlds[f"concurrent-{row['domain']}-{row['instance']}"] = (*files, None)
    return worlds


def write_world(folder, deviation, fails):
    low, high = 1 - deviation / 100, 1 + deviation / 100
    text = 'format = "elbowroom-world"\nversion = 1\n'
    text += f'[[duration]]\naction = "*"\nuniform = {{ from = {low:g}, to = {high:g} }}\nrelative = true\n'
    if fails:
        text += '[[failure]]\naction = "*"\nprobability = 0.1\n'
    path = folder / f"{deviation}{'-failing' if fails else ''}.toml"
    path.write_text(text, encoding="utf-8")
    return path.name


def write_experiment(folder, world, executors, trials):
    """Writes the files of one world; returns the experiment file."""
    folder.mkdir(parents=True, exist_ok=True)
    names = {}
    for key, name, content in zip(("domain", "problem", "plan"), ("domain.pddl", "problem.pddl", "begin.plan"), world):
        if content is not None:
            text = content if isinstance(content, str) else content.read_text(encoding="utf-8", errors="replace")
            (folder / name).write_text(text, encoding="utf-8")
            names[key] = name
    lines = ['format = "elbowroom-experiment"', "version = 1", f'title = "{folder.name}"']
    lines += [f'{key} = "{name}"' for key, name in names.items()]
    lines += [f"trials = {trials}", "seed = 1", f"executors = {json.dumps(executors)}"]
    if "plan" not in names:
        lines.append('first_plan = "shortest"')
    for fails in (False, True):
        for deviation in DEVIATIONS:
            name = f"±{deviation} %" + (", failures" if fails else "")
            lines += ["[[column]]", f'name = "{name}"', f'world = "{write_world(folder, deviation, fails)}"']
    path = folder / "experiment.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def run(program, experiment, jobs, seconds):
    """Runs one experiment; returns the reason for missing results, or None."""
    folder = experiment.parent / "results"
    command = [program, "compare", str(experiment), "--jobs", str(jobs), "--each-trial", "-o", str(folder)]
    begun = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    try:
        _, errors = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        # An interrupted `compare` writes the results of the finished trials.
        process.send_signal(signal.SIGINT)
        try:
            _, errors = process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            process.kill()
            _, errors = process.communicate()
            errors = "killed: it ignored the interrupt for 60 s"
    (experiment.parent / "seconds").write_text(f"{time.monotonic() - begun:.1f}\n", encoding="utf-8")
    if (folder / "trials.csv").exists():
        return None
    return " ".join(errors.split())[:300] or "no results"


def trials_of(folder):
    """Returns {column: {seed: {executor: True if the goal was reached}}}."""
    columns = {}
    with (folder / "results" / "trials.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            by_seed = columns.setdefault(row["column"], {})
            trial = by_seed.setdefault((row["case"], row["trial"], row["seed"]), {})
            trial[row["executor"]] = row["verdict"] in ("goal-reached", "reached", "success")
    return columns


def paired(trials, first, other):
    """Returns the mean difference of two executors on the same trials, and its standard error."""
    both = [it for it in trials if first in it and other in it]
    if not both:
        return 0.0, 0.0, 0
    differences = [it[first] - it[other] for it in both]
    mean = sum(differences) / len(both)
    variance = sum((it - mean) ** 2 for it in differences) / max(1, len(both) - 1)
    return mean, math.sqrt(variance / len(both)), len(both)


def summarize(folders, executors):
    """Returns the table, and the worlds in which the first executor is behind."""
    first, others = executors[0], executors[1:]
    lines = [f"| world | durations | trials | {' | '.join(executors)} | {' | '.join(f'{first} − {it}' for it in others)} |"]
    lines.append("|---|---|--:|" + "--:|" * (len(executors) + len(others)))
    behind, everything = [], []
    for folder in folders:
        for column, by_seed in trials_of(folder).items():
            trials = list(by_seed.values())
            everything += trials
            shares = [sum(it.get(name, False) for it in trials) for name in executors]
            cells = []
            for other in others:
                mean, error, _ = paired(trials, first, other)
                cells.append(f"{100 * mean:+.0f} ± {100 * error:.0f}")
                # If all differences are equal, the standard error is 0 and uninformative.
                if mean < 0 and mean + 3 * max(error, 1 / max(1, len(trials))) < 0:
                    behind.append(f"{folder.name}, {column}: {100 * mean:+.1f} points to {other}")
            lines.append(f"| {folder.name} | {column} | {len(trials)} | {' | '.join(map(str, shares))} | {' | '.join(cells)} |")
    for other in others:
        mean, error, number = paired(everything, first, other)
        lines.append(f"\nOver all worlds, {first} − {other}: {100 * mean:+.2f} ± {100 * error:.2f} points, {number} trials.")
        if mean < 0:
            behind.append(f"over all worlds: {100 * mean:+.2f} points to {other}")
    return lines, behind


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--trials", type=int, default=100, help="seeds in each world, with each deviation")
    parser.add_argument("--seconds", type=float, default=None, help="time limit for all worlds, in seconds")
    parser.add_argument("--each", type=float, default=600, help="time limit for each world, in seconds")
    parser.add_argument("--only", default="", help="worlds with this text in their names")
    parser.add_argument("--jobs", type=int, default=1)
    root = pathlib.Path(__file__).resolve().parent.parent
    parser.add_argument("--data", type=pathlib.Path, default=root / ".." / "shared" / "data")
    parser.add_argument("--executors", default="live,esterel,stn")
    arguments = parser.parse_args()
    executors = arguments.executors.split(",")
    worlds = {**own_worlds(), **executor_worlds.worlds(), **data_worlds(arguments.data)}
    names = [it for it in worlds if arguments.only in it]
    # Random order, so that all kinds are tested if the time does not suffice for all.
    random.Random(1).shuffle(names)
    until = time.monotonic() + arguments.seconds if arguments.seconds else math.inf
    failed = []
    for name in names:
        folder = arguments.folder / name
        if (folder / "results" / "trials.csv").exists():
            continue
        left = until - time.monotonic()
        if left <= 1:
            break
        experiment = write_experiment(folder, worlds[name], executors, arguments.trials)
        trouble = run(arguments.program, experiment, arguments.jobs, min(left, arguments.each))
        if trouble:
            failed.append(f"{name}: {trouble}")
        print(f"{name}: {trouble or 'done'}", file=sys.stderr, flush=True)
    done = [arguments.folder / it for it in sorted(names) if (arguments.folder / it / "results" / "trials.csv").exists()]
    lines, behind = summarize(done, executors)
    (arguments.folder / "table.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))
    for text in failed:
        print(f"no results: {text}")
    for text in behind:
        print(f"behind: {text}")
    print(f"{len(done)} of {len(names)} worlds, {len(failed)} without results, behind in {len(behind)} cases")
    return 1 if behind else 0


if __name__ == "__main__":
    sys.exit(main())
