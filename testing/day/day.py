"""A day with robots: an executive with three simulated robots, 200 tasks, and everything that goes wrong in a day.

    python3 testing/day/day.py target/release/elbowroom [--hours 8] [--speed 50] [--seed 1] [--short]

docs/research/day.md describes the day and its figures. Exit code 1: a promise of the executive was broken; the reasons are
printed. Standard library only.
"""

import argparse
import json
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import depot
import missions
from clairvoyant import clairvoyant_value
from executive import HERE, Executive
from findings import Findings, examine

OPTIONS = ["--max-replans", "1000000", "--timeout", "6x,300", "--planning-budget", "0.1"]


def troubles(dice, hours, kinds):
    """One trouble of each kind an hour, at random times; the clock is stepped forwards and backwards in turn."""
    made = []
    for hour in range(max(1, round(hours))):
        for kind in kinds:
            at = 3600 * hour + dice.uniform(0.15, 0.9) * min(3600, 3600 * hours)
            made.append({"kind": kind, "key": f"{kind} {hour}", "at": at, "step": 90 if hour % 2 == 0 else -60})
    return sorted(made, key=lambda trouble: trouble["at"])


class Shift:
    """One run of the executive, for some hours."""

    def __init__(self, chosen, folder, seed, hours, count, options):
        self.chosen, self.folder, self.hours = chosen, folder, hours
        folder.mkdir(parents=True)
        self.robots = depot.ROBOTS[: chosen.robots]
        self.tasks = depot.tasks(seed, count, hours * 3600)
        dice = random.Random(f"troubles {seed}")
        self.troubles = troubles(dice, hours, chosen.troubles)
        undone = [
            {"key": task.name, "at": max(0, task.release - 5), "undone": task.undone} for task in self.tasks if task.undone
        ]
        conditions = {"seed": chosen.seed, "speed": chosen.speed, "robots": self.robots, "common": chosen.common}
        conditions.update(troubles=[it for it in self.troubles if it["kind"] != "kill"], undone=undone)
        (folder / "conditions.json").write_text(json.dumps(conditions))
        (folder / "domain.pddl").write_text(depot.DOMAIN)
        (folder / "problem.pddl").write_text(depot.problem(self.robots))
        self.executive = Executive(chosen.program, folder, [*OPTIONS, *options])
        self.seen = (time.monotonic(), 0.0)
        self.findings = Findings()
        self.starved = 0.0

    def now(self):
        """Estimate of the world's time, from the last answer."""
        at, time_then = self.seen
        return time_then + (time.monotonic() - at) * self.chosen.speed

    def look(self):
        status, state = self.executive.ask("GET", "/v1/state", timeout=5)
        if status == 200:
            self.seen = (time.monotonic(), state["now"]["decimal"])
        return status, state

    def run(self):
        """Runs the shift to its end."""
        if not self.executive.await_answer():
            self.findings.broken(f"the executive does not begin: {self.last_words()}")
            return
        hostile = subprocess.Popen(
            [sys.executable, HERE / "hostile.py", str(self.executive.port), str(self.chosen.readers)]
        )
        try:
            self.work()
            self.end()
            if hostile.poll() is not None:
                self.findings.broken("the hostile readers have ended")
        finally:
            hostile.kill()
            if self.executive.process.poll() is None:
                self.executive.kill()

    def work(self):
        to_give = list(self.tasks)
        kills = [it["at"] for it in self.troubles if it["kind"] == "kill"]
        last = max(task.deadline for task in self.tasks) + 60
        give_up = time.monotonic() + 3 * last / self.chosen.speed + 60
        while self.now() < last or to_give:
            before = time.monotonic()
            time.sleep(0.1)
            self.starved = max(self.starved, time.monotonic() - before - 0.1)
            if self.executive.process.poll() is not None:
                self.findings.broken(f"the executive ended by itself: {self.last_words()}")
                return
            if time.monotonic() > give_up:
                self.findings.broken("the day does not end")
                return
            self.look()
            if kills and self.now() >= kills[0]:
                kills.pop(0)
                self.executive.kill()
                self.findings.kills += 1
                self.executive.resume()
                if not self.executive.await_answer():
                    self.findings.broken(f"the executive does not resume: {self.last_words()}")
                    return
                self.look()
            while to_give and to_give[0].release - 30 <= self.now():
                if not self.give(to_give[0]):
                    break
                to_give.pop(0)

    def give(self, task):
        body = {"goal": task.goal, "name": task.name, "value": task.value, "by": "day"}
        body.update(release=task.release, deadline=task.deadline)
        status, answer = self.executive.ask("POST", "/v1/goals", body)
        if status in (200, 202):
            return True
        if "passed" in json.dumps(answer) or status == 422:
            self.findings.broken(f"{task.name} was refused: {status} {answer}")
            return True
        return False

    def end(self):
        """Reads the goals, and stops the executive."""
        status, goals = self.executive.ask("GET", "/v1/goals")
        if status != 200:
            self.findings.broken(f"the goals cannot be read: {status} {goals}")
            return
        (self.folder / "goals.json").write_text(json.dumps(goals))
        begin = time.monotonic()
        self.executive.ask("POST", "/v1/stop")
        try:
            code = self.executive.process.wait(timeout=60)
        except subprocess.TimeoutExpired:
            self.findings.broken("the executive does not stop")
            return
        self.findings.stops.append(time.monotonic() - begin)
        if code != 0:
            self.findings.broken(f"the executive ended with exit code {code}: {self.last_words()}")

    def stop_at(self, seconds):
        """Gives all tasks at once, and stops after some seconds; returns the time until the end, and the longest delay
        of this program meanwhile."""
        if not self.executive.await_answer():
            self.findings.broken(f"the executive does not begin: {self.last_words()}")
            return None
        for task in self.tasks:
            task.release, task.deadline = 1.0, task.deadline + 10_000
            self.give(task)
        time.sleep(seconds)
        begin, delay = time.monotonic(), 0.0
        status, answer = self.executive.ask("POST", "/v1/stop")
        if status not in (200, 202):
            self.findings.broken(f"stop was answered with {status} {answer}")
        while self.executive.process.poll() is None and time.monotonic() - begin < 30:
            before = time.monotonic()
            time.sleep(0.01)
            delay = max(delay, time.monotonic() - before - 0.01)
        took = time.monotonic() - begin
        if self.executive.process.poll() is None:
            self.executive.kill()
        return took, delay

    def last_words(self):
        return (self.folder / "stderr.txt").read_text()[-500:]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--hours", type=float, default=8)
    parser.add_argument("--speed", type=float, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tasks", type=int, help="25 an hour by default")
    parser.add_argument("--robots", type=int, default=3)
    parser.add_argument("--readers", type=int, default=64)
    parser.add_argument("--executor", default="live")
    parser.add_argument("--troubles", nargs="*", default=["silent", "stuck", "crash", "step", "kill"])
    parser.add_argument("--short", action="store_true", help="one hour at 60 times the speed, 2 stops, no predictions")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for the files of the day")
    chosen = parser.parse_args()
    chosen.program = str(pathlib.Path(chosen.program).resolve())
    chosen.common = True
    if chosen.short:
        chosen.hours, chosen.speed = 1, 60
    return chosen


def sample_stops(chosen, folder, count):
    """Stops the executive at random moments of short and troubled runs. Returns the broken promises."""
    dice, took, broken = random.Random(f"stops {chosen.seed}"), [], []
    for number in range(count):
        shift = Shift(chosen, folder / f"stop{number}", 100 * chosen.seed + number, 0.1, 6, ["--executor", chosen.executor])
        stopped = shift.stop_at(dice.uniform(0.2, 6))
        broken += shift.findings.problems
        if stopped is None:
            continue
        took.append(stopped[0])
        if stopped[0] > 1 + 2 * stopped[1]:
            broken.append(f"stop {number} took {stopped[0]:.2f} s; this program was delayed by {stopped[1]:.2f} s at most")
    print(f"{count} stops at random moments: {max(took, default=0):.2f} s at most, mean {sum(took) / max(1, len(took)):.2f} s")
    return broken


def compare_predictions(chosen, folder):
    """Compares predicted with observed success. Returns the broken promises."""
    broken = []
    for name, common in (("independent durations", False), ("a common factor each day", True)):
        predicted, observed, error = missions.compare(chosen.program, folder / name.replace(" ", "-"), chosen.seed, 200, common)
        difference = 100 * (predicted - observed)
        print(
            f"{name}: predicted {100 * predicted:.1f} %, observed {100 * observed:.1f} %, difference {difference:+.1f} points"
            f" (standard error {100 * error:.1f})"
        )
        if not common and abs(difference) > 3 + 200 * error:
            broken.append(f"the predicted success differs by {difference:+.1f} points from the observed one")
    return broken


def main():
    # So that the processes of this program end with it.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    chosen = arguments()
    folder = chosen.keep or pathlib.Path(tempfile.mkdtemp(prefix="day-"))
    if chosen.keep:
        shutil.rmtree(folder, ignore_errors=True)
    folder = folder.resolve()
    parts = [1] if chosen.short else [1, 2]
    hours = chosen.hours / len(parts)
    count = (chosen.tasks or round(25 * chosen.hours)) // len(parts)
    experience = folder / "experience"
    options = ["--executor", chosen.executor]
    broken = []
    for number in parts:
        begin = time.monotonic()
        learn = [*options, "--learn", experience]
        if number == 2:
            learn += ["--believed", experience]
        shift = Shift(chosen, folder / f"half{number}", 2 * chosen.seed + number, hours, count, learn)
        shift.run()
        examine(shift)
        print(f"half {number}, {time.monotonic() - begin:.0f} s of wall clock")
        for line in shift.findings.lines():
            print(f"  {line}")
        truth = depot.Truth(chosen.seed, shift.robots, chosen.common)
        best = clairvoyant_value(shift.tasks, truth, shift.robots, chosen.seed)
        print(f"  value of a clairvoyant schedule: {best:.0f}")
        broken += shift.findings.problems
    broken += sample_stops(chosen, folder, 2 if chosen.short else 20)
    if not chosen.short:
        broken += compare_predictions(chosen, folder)
    for problem in broken:
        print(f"BROKEN: {problem}")
    if not chosen.keep:
        shutil.rmtree(folder, ignore_errors=True)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
