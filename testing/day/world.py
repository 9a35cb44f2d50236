"""The robots of the demonstration "a day", as a world process.

The executive starts this program. The day's folder contains its conditions (`conditions.json`); `truth.jsonl` records
the actual events.
"""

import heapq
import json
import os
import pathlib
import random
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "clients" / "python"))

import depot
from elbowroom_world import World


class Day(World):
    """World whose clock can be stepped: by `offset` seconds of the world."""

    offset = 0.0

    def now(self):
        return max(0.0, super().now() + self.offset)


class Robots:
    """Runs actions with hidden durations, and causes the planned troubles."""

    def __init__(self, folder):
        self.folder = folder
        self.conditions = json.loads((folder / "conditions.json").read_text())
        given = self.conditions
        self.world = Day("day", speed=given["speed"], ledger=folder / "ledger")
        self.truth = depot.Truth(given["seed"], given["robots"], given["common"])
        self.facts = depot.initial_facts(given["robots"])
        self.ends, self.silent, self.stuck, self.trouble = [], {}, {}, set()
        self.lock = threading.Condition()
        self.log = open(folder / "truth.jsonl", "a+", encoding="utf-8")
        self.planned = {}
        self.read_log()
        self.world.starter("*", resumes=True)(self.start)
        self.world.canceller(self.cancel)
        self.world.look(lambda words: f"({' '.join(words)})" in self.facts if words[0] != "distance" else None)

    def read_log(self):
        """Restores the state after a crash of this program or of the executive."""
        self.log.seek(0)
        for line in self.log:
            try:
                entry = json.loads(line)
            except ValueError:
                continue
            if "start" in entry:
                self.truth.starts[entry["start"]] = self.truth.starts.get(entry["start"], 0) + 1
                self.planned[entry["ticket"]] = entry
                self.apply(entry["start"], "start")
            elif "end" in entry and entry["outcome"] != "succeeded":
                self.revert(self.planned.pop(entry["ticket"])["start"])
            elif "end" in entry:
                self.apply(entry["end"], "end")
                self.planned.pop(entry["ticket"])
            elif "undone" in entry:
                self.facts -= set(entry["undone"])
                self.trouble.add(entry["key"])
            elif "trouble" in entry:
                self.trouble.add(entry["key"])
                self.world.offset += entry.get("step", 0.0)

    def write(self, **entry):
        self.log.write(json.dumps(entry) + "\n")
        self.log.flush()

    def apply(self, text, moment):
        name, robot, *rest = text.strip("()").split()
        if name == "drive":
            a, b = rest
            changes = {"start": [f"(at {robot} {a})"], "end": [f"(at {robot} {b})"]}
        elif name == "load":
            t, p = rest
            changes = {"start": [f"(stored {t} {p})", f"(empty {robot})"], "end": [f"(holds {robot} {t})"]}
        elif name == "unload":
            t, p = rest
            changes = {"start": [], "end": [f"(stored {t} {p})", f"(empty {robot})"]}
            if moment == "end":
                self.facts.discard(f"(holds {robot} {t})")
        else:
            changes = {"start": [], "end": [f"(checked {rest[0]})"]}
        if moment == "start":
            self.facts -= {*changes["start"], f"(ready {robot})"}
        else:
            self.facts |= {*changes["end"], f"(ready {robot})"}

    def revert(self, text):
        """Undoes the effects of the start of an action that has failed or was cancelled; returns the facts that hold
        again."""
        name, robot, *rest = text.strip("()").split()
        again = {f"(ready {robot})"}
        if name == "drive":
            again.add(f"(at {robot} {rest[0]})")
        elif name == "load":
            again |= {f"(stored {rest[0]} {rest[1]})", f"(empty {robot})"}
        self.facts |= again
        return sorted(again)

    def start(self, action):
        with self.lock:
            if action.is_resumed:
                entry = self.planned.get(action.ticket)
                if entry is None:
                    # The program was killed between writing the ledger and the log: the action never began.
                    action.failed("the robot was never commanded")
                    return
            else:
                seconds, succeeds = self.truth.draw(action.text)
                kind = self.next_trouble()
                now = self.world.now()
                entry = {"start": action.text, "ticket": action.ticket, "at": now, "until": now + seconds,
                         "succeeds": succeeds, "kind": kind}  # fmt: skip
                self.planned[action.ticket] = entry
                self.write(**entry)
                self.apply(action.text, "start")
            if entry["kind"] == "silent":
                return
            if not action.is_resumed:
                action.started()
            until = float("inf") if entry["kind"] == "stuck" else entry["until"]
            heapq.heappush(self.ends, (until, action.ticket, action))
            self.lock.notify()

    def next_trouble(self):
        """Returns `silent` or `stuck` if such an action is due, otherwise `None`."""
        for trouble in self.conditions["troubles"]:
            due = trouble["at"] <= self.world.now() and trouble["key"] not in self.trouble
            if due and trouble["kind"] in ("silent", "stuck"):
                self.trouble.add(trouble["key"])
                self.write(trouble=trouble["kind"], key=trouble["key"], at=self.world.now())
                return trouble["kind"]
        return None

    def cancel(self, action):
        with self.lock:
            entry = self.planned.pop(action.ticket, None)
            if entry is None:
                return
            self.ends = [it for it in self.ends if it[1] != action.ticket]
            heapq.heapify(self.ends)
            self.end(entry, action, "cancelled")

    def end(self, entry, action, outcome):
        text = entry["start"]
        self.write(end=text, ticket=entry["ticket"], at=self.world.now(), outcome=outcome)
        if outcome == "succeeded":
            self.apply(text, "end")
            action.succeeded()
            return
        again = self.revert(text)
        if outcome == "failed":
            action.failed("it slipped")
        else:
            action.was_cancelled()
        for fact in again:
            self.world.fact(fact, True)

    def run_clock(self):
        """Ends actions and causes troubles when they are due."""
        while True:
            with self.lock:
                now = self.world.now()
                while self.ends and self.ends[0][0] <= now:
                    _, ticket, action = heapq.heappop(self.ends)
                    entry = self.planned.pop(ticket)
                    self.end(entry, action, "succeeded" if entry["succeeds"] else "failed")
                for _, _, action in self.ends:
                    if self.planned[action.ticket]["kind"] == "stuck":
                        action.feedback(0.5, "it does not move")
                if self.world._zero is not None:
                    self.cause(now)
            time.sleep(0.01)

    def cause(self, now):
        for task in self.conditions["undone"]:
            if task["at"] <= now and task["key"] not in self.trouble:
                self.trouble.add(task["key"])
                self.facts -= set(task["undone"])
                self.write(undone=task["undone"], key=task["key"], at=now)
                for fact in task["undone"]:
                    self.world.fact(fact, False)
        for trouble in self.conditions["troubles"]:
            if trouble["at"] > now or trouble["key"] in self.trouble:
                continue
            if trouble["kind"] == "crash":
                self.write(trouble="crash", key=trouble["key"], at=now)
                os._exit(9)
            elif trouble["kind"] == "step":
                self.trouble.add(trouble["key"])
                self.write(trouble="step", key=trouble["key"], at=now, step=trouble["step"])
                self.world.offset += trouble["step"]


def main():
    robots = Robots(pathlib.Path(sys.argv[1]))
    threading.Thread(target=robots.run_clock, daemon=True).start()
    robots.world.run()


if __name__ == "__main__":
    main()
