"""An executive over a long time: 20 simulated robots, with goals that are added and cancelled.

    python3 testing/soak.py target/release/elbowroom [--seconds 3600] [--seed 1] [--robots 20]

starts `elbowroom serve` on a clock ten times as fast as the wall clock, with durations that deviate, actions that fail
and jobs that become undone by themselves. Goals are given, some of them are cancelled, and there are pauses. Each minute
the memory of the executive, the response times and the delays of starts are printed. The trace is checked: a goal reported
as reached holds in the world's own answer at that time (a job may become undone before the next request), no robot has two
jobs at the same time, nothing is started twice, and the replay makes the same decisions. Exit code 0: no errors. Standard
library only; memory is read from /proc.
"""

import argparse
import http.client
import json
import pathlib
import random
import subprocess
import sys
import tempfile
import threading
import time

PACE = 10
TOKEN = "a-token-of-some-length"
DOMAIN = """(define (domain jobs)
  (:requirements :typing :durative-actions)
  (:types robot job)
  (:predicates (idle ?r - robot) (done ?j - job))
  (:durative-action work
    :parameters (?r - robot ?j - job)
    :duration (= ?duration 20)
    :condition (at start (idle ?r))
    :effect (and (at start (not (idle ?r))) (at end (idle ?r)) (at end (done ?j)))))
"""
WORLD = """format = "elbowroom-world"
version = 1
[[duration]]
action = "work"
normal = { mean = 20, deviation = 4, minimum = 8 }
[[failure]]
action = "work"
probability = 0.02
when = "end"
undone = true
[[hazard]]
fact = "(done _)"
becomes_false_per_second = 0.005
"""


def problem(robots, jobs):
    """All robots idle, no job done, and nothing to do: `start` is a job that is done from the beginning."""
    robots = [f"r{i}" for i in range(robots)]
    jobs = [f"j{i}" for i in range(jobs)]
    initial = [f"(idle {r})" for r in robots] + ["(done start)"]
    objects = f"{' '.join(robots)} - robot {' '.join(jobs)} start - job"
    return (
        f"(define (problem soak) (:domain jobs) (:objects {objects})"
        f" (:init {' '.join(initial)}) (:goal (done start)))"
    )


class Executive:
    """The program and its requests."""

    def __init__(self, program, folder, robots, jobs):
        texts = {"domain.pddl": DOMAIN, "problem.pddl": problem(robots, jobs), "world.toml": WORLD}
        texts["token"] = TOKEN
        for name, text in texts.items():
            (folder / name).write_text(text)
        (folder / "token").chmod(0o600)
        file = {name: str(folder / name) for name in [*texts, "trace.jsonl"]}
        line = [program, "serve", file["domain.pddl"], file["problem.pddl"], "--world", file["world.toml"]]
        line += ["--realtime", str(PACE), "--http", "0", "--token", file["token"]]
        line += ["--trace", file["trace.jsonl"], "--max-replans", "1000000"]
        self.trace = file["trace.jsonl"]
        self.process = subprocess.Popen(
            line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        said = ""
        for said in self.process.stderr:
            if "127.0.0.1:" in said:
                break
        self.port = int(said.split("127.0.0.1:")[1].split("/")[0])
        # Drain standard error, so that the pipe does not fill up.
        threading.Thread(target=self.process.stderr.read, daemon=True).start()
        self.latencies = []

    def ask(self, verb, path, body=None):
        """Sends a request; returns status and answer, and records the response time."""
        begin = time.monotonic()
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        headers = {"Authorization": f"Bearer {TOKEN}"}
        connection.request(verb, path, json.dumps(body) if body is not None else "", headers)
        response = connection.getresponse()
        answer = json.loads(response.read())
        connection.close()
        self.latencies.append(time.monotonic() - begin)
        return response.status, answer

    def memory(self):
        """Memory of the process, in megabytes."""
        text = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        (line,) = [line for line in text.splitlines() if line.startswith("VmRSS")]
        return int(line.split()[1]) / 1024


def milliseconds(times):
    """Median, 99th percentile and worst."""
    times = sorted(times) or [0.0]
    at = [times[(len(times) - 1) * share // 100] * 1000 for share in (50, 99, 100)]
    return " / ".join(f"{time:.1f}" for time in at)


def decimal(number):
    return number["decimal"] if isinstance(number, dict) else number


class Trace:
    """The lines of the trace so far, and their errors."""

    def __init__(self, path):
        self.file = open(path, encoding="utf-8")
        self.part = ""
        self.started = {}
        self.busy = {}
        self.goals = {}
        self.looked = (None, set())
        self.reached = set()
        self.starts = 0
        self.late = []
        self.wrong = []

    def read_on(self):
        self.part += self.file.read()
        *lines, self.part = self.part.split("\n")
        for line in lines:
            self.take(json.loads(line))

    def take(self, line):
        if line["event"] == "command" and line["command"].get("type") == "start":
            command = line["command"]
            ticket, robot = command["ticket"], command["action"].strip("()").split()[1]
            if ticket in self.started:
                self.wrong.append(f"ticket {ticket} was started twice")
            if robot in self.busy.values():
                self.wrong.append(f"{robot} has two jobs at {line['now']}")
            self.started[ticket] = robot
            self.busy[ticket] = robot
            self.starts += 1
            earliest = (line.get("planned") or {}).get("earliest")
            if earliest:
                self.late.append((decimal(line["now"]) - decimal(earliest)) / PACE)
        elif line["event"] == "observed":
            what = line.get("observation", line)
            if what.get("type") == "ended":
                self.busy.pop(what["ticket"], None)
            elif what.get("type") == "goal":
                self.goals[what["name"]] = what["goal"]
        elif line["event"] == "looked":
            facts = {it["fact"] for it in line["observations"] if it["type"] == "fact" and it["becomes"]}
            self.looked = (decimal(line["now"]), facts)
        elif line["event"] == "goal" and line["becomes"] == "achieved":
            self.reached.add(line["name"])
        elif line["event"] == "resting" and line["verdict"] == "goal-reached":
            at, facts = self.looked
            for name in line["goals"]:
                wanted = self.goals.get(name, "(done start)")
                if at != decimal(line["now"]) or wanted not in facts:
                    self.wrong.append(f"{name} is reported as reached at {line['now']}, but not {wanted}")
                self.reached.add(name)


def facts_of(state):
    return set(state["facts"])


def step(own, dice, jobs, tally):
    """Sends a random request to the executive, and checks the answer."""
    status, state = own.ask("GET", "/v1/state")
    if status != 200:
        tally["wrong"].append(f"state: {status}")
    facts = facts_of(state)
    goals = {goal["name"]: goal for goal in state["goals"]}
    for name in list(tally["open"]):
        if name in goals:
            tally["taken"].add(name)
        elif name in tally["taken"] or state["activity"] == "resting":
            # The goal was reached: goals cancelled here are no longer in this list.
            del tally["open"][name]
            tally["reached"].add(name)
    # Goals come in bursts with pauses in between.
    if not tally["open"]:
        tally["burst"] = dice.randrange(8, 24)
    busy = {*tally["open"].values(), *facts}
    free = [j for j in range(jobs) if f"(done j{j})" not in busy]
    what = dice.random()
    if what < 0.75:
        if tally["burst"] == 0 or not free:
            return
        tally["burst"] -= 1
        job = dice.choice(free)
        tally["given"] += 1
        name = f"g{tally['given']}"
        status, answer = own.ask("POST", "/v1/goals", {"goal": f"(done j{job})", "name": name})
        if status in (200, 202):
            tally["open"][name] = f"(done j{job})"
        else:
            tally["wrong"].append(f"goal {name}: {status} {answer}")
    elif what < 0.78 and tally["open"]:
        name = dice.choice(sorted(tally["open"]))
        del tally["open"][name]
        status, answer = own.ask("DELETE", f"/v1/goals/{name}")
        tally["cancelled"] += 1
        # The goal may have been reached in the meantime.
        if status not in (200, 202, 404):
            tally["wrong"].append(f"cancel {name}: {status} {answer}")
    elif what < 0.80:
        own.ask("POST", "/v1/pause")
        time.sleep(0.2)
        own.ask("POST", "/v1/resume")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--seconds", type=float, default=3600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--robots", type=int, default=20)
    chosen = parser.parse_args()
    jobs = 2 * chosen.robots
    dice = random.Random(chosen.seed)
    tally = {"open": {}, "given": 0, "reached": set(), "cancelled": 0, "burst": 0, "taken": set(), "wrong": []}
    with tempfile.TemporaryDirectory() as folder:
        own = Executive(chosen.program, pathlib.Path(folder), chosen.robots, jobs)
        trace = Trace(own.trace)
        print("| minutes | memory | starts | goals reached | requests, ms | starts late, ms |", flush=True)
        print("|---:|---:|---:|---:|---:|---:|", flush=True)
        begin = time.monotonic()
        shown = 0
        while time.monotonic() - begin < chosen.seconds:
            step(own, dice, jobs, tally)
            time.sleep(dice.uniform(0.02, 0.15))
            if time.monotonic() - begin >= (shown + 1) * 60:
                shown += 1
                trace.read_on()
                print(
                    f"| {shown} | {own.memory():.1f} MB | {trace.starts} | {len(tally['reached'])} |"
                    f" {milliseconds(own.latencies)} | {milliseconds(trace.late)} |",
                    flush=True,
                )
                own.latencies.clear()
                trace.late.clear()
        own.ask("POST", "/v1/stop")
        code = own.process.wait(timeout=120)
        trace.read_on()
        wrong = tally["wrong"] + trace.wrong
        if code != 0:
            wrong.append(f"the executive ended with exit code {code}")
        if missing := sorted(tally["reached"] - trace.reached):
            wrong.append(f"{missing} are no longer open, but the trace does not report them as reached")
        if trace.starts == 0 or not tally["reached"]:
            wrong.append("no action was executed")
        replay = subprocess.run([chosen.program, "run", "--replay", own.trace], capture_output=True)
        if replay.returncode != 0:
            wrong.append(f"the replay of the trace failed: {replay.stdout[-500:]}")
        size = pathlib.Path(own.trace).stat().st_size / 1e6
        print(
            f"{trace.starts} starts, {tally['given']} goals given, {len(tally['reached'])} reached,"
            f" {tally['cancelled']} cancelled; trace of {size:.1f} MB, replayed; {len(wrong)} errors"
        )
        for what in wrong[:20]:
            print(what)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
