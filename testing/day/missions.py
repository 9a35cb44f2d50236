"""Predicted and observed success of single missions with a deadline.

A model is learnt from the traces of some days. Its prediction is compared with other days, on which the durations are
independent, or have a factor that is common to all actions of a day.

    python3 missions.py DAY COMMON     is the world of one mission
"""

import json
import pathlib
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "clients" / "python"))

import depot
from elbowroom_world import Failed, Simulation

PLAN = """0: (drive r1 dock store) [40]
41: (load r1 t1 store) [20]
62: (drive r1 store ramp) [70]
133: (drive r1 ramp lab) [70]
204: (unload r1 t1 lab) [20]
"""


def deadline():
    """A deadline that is met on most days."""
    truth = depot.Truth(0, ["r1"], common=False)
    steps = [line.split("(")[1].split(")")[0].split() for line in PLAN.splitlines()]
    return round(1.12 * sum(truth.mean(name, arguments) for name, *arguments in steps))


def files(folder):
    """Domain and problem of the mission: the lab is open until the deadline."""
    domain = depot.DOMAIN.replace("(:predicates", "(:predicates (open)")
    domain = domain.replace("(at start (holds ?r ?t))", "(at start (holds ?r ?t)) (at end (open))")
    problem = depot.problem(["r1"]).replace("(:init", f"(:init (open) (at {deadline()} (not (open)))")
    problem = problem.replace("(:goal (checked dock))", "(:goal (stored t1 lab))")
    (folder / "domain.pddl").write_text(domain)
    (folder / "problem.pddl").write_text(problem)
    (folder / "mission.plan").write_text(PLAN)


def work(program, folder, days, common, trace=False):
    """Works these days; returns the share of successes, and the traces."""
    successes, traces = 0, []
    for day in days:
        line = [program, "run", folder / "domain.pddl", folder / "problem.pddl", folder / "mission.plan"]
        line += ["--max-replans", "0", "--planning-time", "0"]
        line += ["--world-process", f"{sys.executable} {__file__} {day} {int(common)}"]
        if trace:
            traces.append(folder / f"{day}.jsonl")
            line += ["--trace", traces[-1]]
        done = subprocess.run([str(it) for it in line], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if done.returncode not in (0, 1, 3):
            raise RuntimeError(f"day {day} ended with exit code {done.returncode}: {done.stderr[-500:]}")
        successes += done.returncode == 0
    return successes / len(days), traces


def predict(program, folder, model, trials):
    """The predicted probability of success by a model."""
    experiment = (
        'format = "elbowroom-experiment"\nversion = 1\ntitle = "mission"\ndomain = "domain.pddl"\n'
        'problem = "problem.pddl"\nplan = "mission.plan"\nseed = 1\nexecutors = ["live"]\n'
        f'max_replans = 0\ntrials = {trials}\n[[column]]\nname = "model"\nworld = "{model}"\n'
    )
    (folder / "experiment.toml").write_text(experiment)
    line = [program, "compare", folder / "experiment.toml", "--json", "--jobs", "1"]
    done = subprocess.run([str(it) for it in line], capture_output=True, text=True, check=True)
    cell = json.loads(done.stdout)["cells"][0][0]
    return cell["successes"] / cell["runs"]


def compare(program, folder, seed, days, common):
    """Learns from days, and works three times as many other ones; returns the predicted and the observed success, and
    the standard error of their difference."""
    folder.mkdir(parents=True)
    files(folder)
    first = 1_000_000 * seed
    learnt_from, traces = work(program, folder, range(first, first + days), common, trace=True)
    line = [program, "learn", *traces, "-o", folder / "world.toml"]
    subprocess.run([str(it) for it in line], stdout=subprocess.DEVNULL, check=True)
    predicted = predict(program, folder, "world.toml", 4000)
    observed, _ = work(program, folder, range(first + days, first + 4 * days), common)
    error = (predicted * (1 - predicted) * (1 / days + 1 / (3 * days))) ** 0.5
    return predicted, observed, error


def mission(day, common):
    truth = depot.Truth(day, ["r1"], common)
    world = Simulation()

    @world.lasts("*")
    def lasts(action):
        seconds, succeeds = truth.draw(action.text)
        if not succeeds:
            raise Failed("it slipped")
        return seconds

    world.run()


if __name__ == "__main__":
    mission(int(sys.argv[1]), bool(int(sys.argv[2])))
