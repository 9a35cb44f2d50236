"""Mobile robots in a simulated depot: a model is learnt from days of work, and used on as many further days.

python3 examples/mujoco_depot/depot.py --days 50
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER))

import elbowroom  # noqa: E402
from figures import Series, table  # noqa: E402
from floor import draw_day  # noqa: E402
from physics import MujocoEngine, PlainEngine, mujoco_version  # noqa: E402
from picture import draw  # noqa: E402
from promise import promise  # noqa: E402
from world import Depot, NewEngine  # noqa: E402

ROBOTS = ["alba", "bruno"]
CRATES = ["red", "green", "blue"]
DEADLINE = 120
"""Departure time of the truck in seconds, as in problem.pddl."""
AS_PLANNED = "as planned"


@dataclass
class Outcome:
    """One day."""

    run: elbowroom.Run
    loaded_at: float
    """Time at which the last crate was on the truck or, after its departure, ready for a courier."""
    promise: str
    paths: dict[str, list[tuple[float, float]]]


class Week:
    """Days of work in one depot."""

    def __init__(self, new_engine: NewEngine, seed: int) -> None:
        self.domain, self.text = ((FOLDER / f"{name}.pddl").read_text() for name in ("domain", "problem"))
        self.problem = elbowroom.read(FOLDER / "domain.pddl", FOLDER / "problem.pddl")
        self._new_engine, self._seed = new_engine, seed
        initial = self.text.split("(:init")[1].split("(:goal")[0]
        initial = re.sub(r"\(= \([^)]*\) \d+\)|\(at \d.*", "", initial)
        self._facts = set(re.findall(r"\([a-z-]+(?: [a-z]+)+\)", initial))

    def day(self, number: int, plan: elbowroom.Plan, believed: Path) -> Outcome:
        """Executes a plan on one day. If the truck leaves without a crate, the work continues for a courier."""
        world = Depot(draw_day(self._seed, number, CRATES), self._new_engine, ROBOTS, self._facts)
        run = self.problem.run(plan, world=world, believed=believed, planning_time=0)
        loaded_at = world.seconds
        if not run:
            loaded_at = self._finish(world)
        paths = {name: robot.path for name, robot in world.robots.items()}
        return Outcome(run, loaded_at, promise(run.trace()), paths)

    def _finish(self, world: Depot) -> float:
        """Continues without a deadline. Returns when everything is loaded."""
        world.settle()
        init = self.text.index("(:init")
        functions = re.findall(r"\(= \([^)]*\) \d+\)", self.text)
        goal = self.text[self.text.index("(:goal") :]
        facts = " ".join(sorted(world.facts | {"(truck-at gate)"}))
        rest = elbowroom.read(self.domain, f"{self.text[:init]}(:init {facts} {' '.join(functions)}) {goal}")
        plan = rest.plan()
        run = rest.run(plan, world=world, planning_time=0) if isinstance(plan, elbowroom.Plan) else plan
        if not run:
            raise RuntimeError(f"the crates could not be loaded without a deadline: {run}")
        return world.seconds


def command(*line: object) -> str:
    """Output of the command ``elbowroom``."""
    done = subprocess.run(
        [sys.executable, "-m", "elbowroom", *map(str, line)], stdout=subprocess.PIPE, text=True, check=True
    )
    return done.stdout


def write_traces(outcomes: list[Outcome], folder: Path) -> list[Path]:
    """Writes the traces of days as files."""
    files = [folder / f"day-{number:04}.jsonl" for number in range(len(outcomes))]
    for file, outcome in zip(files, outcomes):
        file.write_text(outcome.run.trace_text or "")
    return files


def learn(outcomes: list[Outcome], model: Path) -> Path:
    """Learns a model of the world from the traces of days."""
    command("learn", *write_traces(outcomes, model.parent), "-o", model)
    return model


def shortest_plan(week: Week) -> elbowroom.Plan:
    """Returns the last and shortest of the planner's plans. With one thread, it finds the same plans in each run."""
    *_, plan = week.problem.plans(jobs=1)
    return plan


def likeliest_plan(week: Week, model: Path, budget: int) -> elbowroom.Plan:
    """Returns the first plan of an executor that believes a model: the likeliest of several.

    Each morning has the same problem, so that the choice is made once, in a simulated run.
    """
    run = week.problem.run(
        world=model.read_text(), first_plan="likeliest", planning_budget=budget, planning_time=0
    )
    first = next(entry for entry in run.trace() if entry["event"] == "plan")
    return week.problem.read_plan([elbowroom.Step(**step) for step in first["steps"]])


def predicted(week: Week, plan: elbowroom.Plan, model: Path, samples: int) -> float:
    """Returns the success probability by a model: the share of simulated runs that reach the goal."""
    text = model.read_text()
    runs = (week.problem.run(plan, world=text, seed=k, planning_time=0, trace=False) for k in range(samples))
    return sum(map(bool, runs)) / samples


def predictions(outcomes: list[Outcome], model: Path, folder: Path) -> dict[str, dict[str, Any]]:
    """Predicted and observed durations and failures by action, as ``elbowroom learn --world`` compares them."""
    answer = json.loads(command("learn", *write_traces(outcomes, folder), "--world", model, "--json"))
    return {it["action"]: it["prediction"] for it in answer["actions"] if it.get("prediction")}


def work_series(
    week: Week, days: range, plan: elbowroom.Plan, model: Path, samples: int, scratch: Path
) -> tuple[Series, list[Outcome]]:
    """Executes a plan on some days, and compares the results with the predictions of a model."""
    outcomes = [week.day(number, plan, model) for number in days]
    folder = scratch / f"{model.stem} {days.start}"
    folder.mkdir()
    series = Series(
        title=f"{model.stem}\ndays {days[0]}-{days[-1]}",
        successes=[bool(it.run) for it in outcomes],
        loaded_at=[it.loaded_at for it in outcomes],
        deadline=DEADLINE,
        promises=[it.promise for it in outcomes],
        predicted=predicted(week, plan, model, samples),
        predictions=predictions(outcomes, model, folder),
    )
    return series, outcomes


def way(plan: elbowroom.Plan) -> str:
    """Describes the trips of a plan from the rack to the gate."""
    aisle = sum(step.action.startswith("(cross ") for step in plan.steps)
    road = sum(step.action.startswith("(drive ") and "gate" in step.action for step in plan.steps)
    return f"aisle {aisle} times, road {road} times; planned end {float(plan.makespan):.0f} s"


def work(week: Week, options: argparse.Namespace, scratch: Path) -> None:
    """Executes days, learns a model, executes further days with it, and prints the figures."""
    n, samples = options.days, options.samples
    first, second, third = (range(k * n + 1, (k + 1) * n + 1) for k in range(3))
    model = scratch / f"{AS_PLANNED}.toml"
    model.write_text('format = "elbowroom-world"\nversion = 1\n')
    plan = shortest_plan(week)
    print(f"as planned:   {way(plan)}", flush=True)
    before, outcomes = work_series(week, first, plan, model, samples, scratch)
    control, _ = work_series(week, second, plan, model, samples, scratch)
    series, log = [before, control], list(outcomes)
    for name, days in (("learnt", second), ("learnt twice", third)):
        model = learn(log, scratch / f"{name}.toml")
        if name == "learnt":
            before.predicted_learnt = control.predicted_learnt = predicted(week, plan, model, samples)
        plan = likeliest_plan(week, model, options.planning_budget)
        print(f"{name + ':':<13} {way(plan)}", flush=True)
        figures, outcomes_then = work_series(week, days, plan, model, samples, scratch)
        figures.predicted_learnt = figures.predicted
        series.append(figures)
        log += outcomes_then
    print(f"\n{table(series)}")
    broken = sum(it.promises.count("broken") for it in series)
    inside = sum(len(it.promises) - it.promises.count("outside") for it in series)
    print(f"\nDays inside the envelope: {inside}; promise broken on {broken} of them.")
    save(options, outcomes[-1], log[-1], scratch)
    if broken:
        sys.exit(1)


def save(options: argparse.Namespace, before: Outcome, after: Outcome, scratch: Path) -> None:
    """Writes the files that the options request."""
    if options.report or options.mcap:
        trace = scratch / "last-day.jsonl"
        trace.write_text(after.run.trace_text or "")
        if options.report:
            command("report", trace, "-o", options.report)
        if options.mcap:
            command("report", trace, "--mcap", options.mcap)
    if options.picture:
        draw(options.picture, [("before learning", before.paths), ("after learning", after.paths)])


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--days", type=positive, default=50, help="days before learning, and as many after it, twice")
    parser.add_argument("--seed", type=int, default=0, help="random seed of the conditions of all days")
    parser.add_argument("--samples", type=positive, default=100, help="simulated runs for each predicted probability")
    parser.add_argument(
        "--planning-budget",
        type=positive,
        metavar="S",
        default=10,
        help="work for choosing a plan, in seconds of a processor",
    )
    parser.add_argument("--engine", choices=["mujoco", "plain"], help="physics; MuJoCo where it is installed")
    parser.add_argument("--report", type=Path, metavar="PAGE.html", help="page about the run of the last day")
    parser.add_argument("--mcap", type=Path, metavar="FILE", help="that run for Foxglove")
    parser.add_argument("--picture", type=Path, metavar="FILE.svg", help="paths before and after, as .svg or .png")
    options = parser.parse_args()
    if options.picture and options.picture.suffix not in (".svg", ".png"):
        parser.error(f"--picture: expected a file that ends with .svg or .png, found {options.picture}")
    return options


def positive(text: str) -> int:
    """A positive number."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"expected at least 1, found {text}")
    return number


def main() -> None:
    options = arguments()
    version = mujoco_version()
    engine = options.engine or ("mujoco" if version else "plain")
    if engine == "mujoco" and version is None:
        sys.exit("--engine mujoco needs the package mujoco: pip install mujoco")
    print(f"engine: {f'MuJoCo {version}' if engine == 'mujoco' else 'plain Python'}; seed {options.seed}")
    week = Week(MujocoEngine if engine == "mujoco" else PlainEngine, options.seed)
    with tempfile.TemporaryDirectory() as scratch:
        work(week, options, Path(scratch))


if __name__ == "__main__":
    main()
