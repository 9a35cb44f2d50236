"""Delays of action starts on a wall clock: 100 robots, 10,000 actions.

    python3 testing/jitter.py target/release/elbowroom [--load N] [--pace 10] [--journal] [EXECUTOR…]

Each robot drives from place to place a hundred times, and every tenth time waits for a dock that is shared with other
robots. Durations deviate. The world is a process that runs this file, with a clock that is PACE times as fast as the wall
clock. Meanwhile N other processes use the processor. The delay of a start is the wall-clock time from its earliest
possible time, according to the trace, to the time at which the world has read the command. With --journal, each start is
on disk before its command. Standard library only.

    python3 testing/jitter.py target/release/elbowroom --replan [--load N] [--robots 100] [EXECUTOR…]

The same with an executive that receives two goals while the robots are working: one that the rest of the running plan
reaches, if it can be kept, and one that needs a new plan. The delays of starts and answers are printed separately for five
phases: before the first goal, until its plan is adopted, after the second goal until the planner has answered, until its
plan is adopted, and afterwards.
"""

import argparse
import heapq
import http.client
import json
import multiprocessing
import pathlib
import random
import shlex
import subprocess
import sys
import tempfile
import threading
import time

import rounds

DOCKS = 20


def world(pace, log):
    """The world: durations are close to the planned ones. Arrival times of commands are written to a file."""
    dice = random.Random(1)
    begin = None
    running, news, arrivals = [], [], []

    def now():
        return (time.monotonic() - begin) * pace

    for text in sys.stdin:
        message = json.loads(text)
        if begin is None and message["type"] != "hello":
            # Nothing is late before the plan is ready.
            begin = time.monotonic()
        arrival = now() if begin else 0
        if message["type"] == "start":
            ticket, planned = message["ticket"], message["duration"]["decimal"]
            arrivals.append((ticket, arrival))
            news.append({"type": "started", "ticket": ticket, "time": arrival})
            heapq.heappush(running, (arrival + planned * max(0.5, dice.gauss(1, 0.2)), ticket))
        elif message["type"] in ("wait", "look"):
            if message["type"] == "wait" and not news:
                until = message["until"]["decimal"]
                due = min(until, running[0][0]) if running else until
                time.sleep(max(0.0, (due - now()) / pace))
            time_is = now()
            while running and running[0][0] <= time_is:
                end, ticket = heapq.heappop(running)
                news.append({"type": "ended", "ticket": ticket, "time": end, "outcome": "succeeded"})
            news.append({"type": "time", "now": time_is})
            print("\n".join(map(json.dumps, news)), flush=True)
            news.clear()
        elif message["type"] == "stop":
            break
    pathlib.Path(log).write_text(json.dumps(arrivals))


def calculate():
    """Load: a program that only computes."""
    number = 0
    while True:
        number = (number * 1103515245 + 12345) % 2**31


def lateness(trace, log, pace):
    """Delay of each start in the trace, in milliseconds of the wall clock."""
    arrivals = dict(json.loads(log.read_text()))
    late = []
    for text in trace.read_text().splitlines():
        # A record of a journal begins with a checksum.
        line = json.loads(text[text.index("{") :])
        earliest = (line.get("planned") or {}).get("earliest")
        if line["event"] == "command" and earliest:
            arrival = arrivals[line["command"]["ticket"]]
            late.append((arrival - earliest["decimal"]) * 1000 / pace)
    return sorted(late)


TOKEN = "of-one-measurement-only"


class Executive:
    """The program as an executive, with a client that sends requests continuously."""

    def __init__(self, line, folder):
        (folder / "token").write_text(TOKEN)
        (folder / "token").chmod(0o600)
        line = [*map(str, line), "--http", "0", "--token", "token", "--max-replans", "100"]
        self.process = subprocess.Popen(
            line, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        said = ""
        for said in self.process.stderr:
            if "127.0.0.1:" in said:
                break
        if "127.0.0.1:" not in said:
            raise SystemExit(said)
        self.port = int(said.split("127.0.0.1:")[1].split("/")[0])
        threading.Thread(target=self.process.stderr.read, daemon=True).start()
        self.answers, self.phase, self.is_over = {}, "before", False
        self.client = threading.Thread(target=self.ask_on, daemon=True)

    def ask(self, verb, path, body=None):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=600)
        headers = {"Authorization": f"Bearer {TOKEN}"}
        connection.request(verb, path, json.dumps(body) if body is not None else "", headers)
        answer = json.loads(connection.getresponse().read())
        connection.close()
        return answer

    def ask_on(self):
        """Reports a fact that is already believed; the answer follows when the run has processed it."""
        while not self.is_over:
            begin, phase = time.monotonic(), self.phase
            taken = self.ask("POST", "/v1/facts", {"fact": "(road p0 p1)", "becomes": True})
            while taken.get("taken") is False:
                # This answer comes after two seconds. Once the next report is accepted, this one is
                # as well.
                taken = self.ask("POST", "/v1/facts", {"fact": "(road p0 p1)", "becomes": True})
            self.answers.setdefault(phase, []).append((time.monotonic() - begin) * 1000)
            time.sleep(0.03)

    def plans(self):
        return self.ask("GET", "/v1/state")["plans"]

    def until(self, condition):
        while not condition():
            time.sleep(0.02)

    def give(self, name, goal, phases):
        """Gives a goal, and waits until a plan for it is adopted."""
        plans = self.plans()
        print(f"{name}: {goal}", file=sys.stderr)
        self.phase = phases[0]
        self.ask("POST", "/v1/goals", {"goal": goal, "name": name})
        if len(phases) > 1:
            # Wait for the preparation of the new plan.
            self.until(lambda: self.ask("GET", "/v1/state")["activity"] == "planning")
            activity = lambda: self.ask("GET", "/v1/state")["activity"]  # noqa: E731
            self.until(lambda: activity() != "planning" or self.plans() > plans)
            self.phase = phases[1]
        self.until(lambda: self.plans() > plans)


PHASES = ["before", "first goal", "second goal: planning", "second goal: made ready", "after"]


def phases_of(trace):
    """Returns the phases on the world's clock, and the starts: ticket and earliest time."""
    bounds, goals, starts = {}, 0, []
    for text in trace.read_text().splitlines():
        line = json.loads(text)
        now = line["now"]["decimal"] if isinstance(line.get("now"), dict) else None
        event = line["event"]
        if event == "observed" and line["observation"]["type"] == "goal":
            goals += 1
            bounds[PHASES[goals]] = [line["observation"]["time"]["decimal"], None]
        elif event == "planned" and goals == 2 and bounds[PHASES[2]][1] is None:
            bounds[PHASES[2]][1] = now
            bounds[PHASES[3]] = [now, None]
        elif event == "plan" and goals:
            for bound in bounds.values():
                bound[1] = bound[1] or now
        earliest = (line.get("planned") or {}).get("earliest")
        if event == "command" and earliest:
            starts.append((line["command"]["ticket"], earliest["decimal"]))
    first = min(bound[0] for bound in bounds.values())
    last = max(bound[1] or bound[0] for bound in bounds.values())
    return {PHASES[0]: [0, first], **bounds, PHASES[4]: [last, float("inf")]}, starts


def replanned(line, folder, pace):
    """Measures an executive that receives goals during the run: a row for each phase."""
    executive = Executive(line, folder)
    executive.until(lambda: executive.plans() > 0)
    executive.client.start()
    time.sleep(8)
    executive.give("kept", "(served r5)", PHASES[1:2])
    executive.phase = PHASES[4]
    time.sleep(4)
    executive.give("other", "(and (served r7) (at r7 p3) (at r8 p4))", PHASES[2:4])
    executive.phase = PHASES[4]
    time.sleep(4)
    executive.is_over = True
    executive.client.join()
    executive.ask("POST", "/v1/stop")
    executive.process.wait()
    arrivals = dict(json.loads((folder / "arrivals").read_text()))
    bounds, starts = phases_of(folder / "trace.jsonl")
    for phase, (begin, end) in bounds.items():
        own = [it for it in starts if begin <= it[1] < (end or begin) and it[0] in arrivals]
        late = sorted((arrivals[ticket] - earliest) * 1000 / pace for ticket, earliest in own)
        answers = sorted(executive.answers.get(phase, []))
        length = f"{((end or begin) - begin) / pace:.1f} s" if end != float("inf") else ""
        yield f"{phase} | {length} | {len(late)} | {shares(late)} | {len(answers)} | {shares(answers)}"


def shares(times):
    """Median, 99th percentile and worst."""
    if not times:
        return "– | – | –"
    return " | ".join(f"{times[(len(times) - 1) * share // 100]:.1f} ms" for share in (50, 99, 100))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("executors", nargs="*", default=["stn", "guarded", "live"])
    parser.add_argument("--load", type=int, default=0)
    parser.add_argument("--pace", type=int)
    parser.add_argument("--actions", type=int, default=10_000)
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument("--replan", action="store_true")
    parser.add_argument("--journal", action="store_true")
    chosen = parser.parse_intermixed_args()
    # While a plan is made, an executive does not let simulated time run ahead of real time.
    chosen.pace = chosen.pace or (1 if chosen.replan else 10)
    if chosen.program == "world":
        return world(chosen.pace, chosen.executors[0])
    load = [multiprocessing.Process(target=calculate, daemon=True) for _ in range(chosen.load)]
    for process in load:
        process.start()
    if chosen.replan:
        print("| executor | phase | length | starts | p50 | p99 | most | answers | p50 | p99 | most |")
        print("|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|", flush=True)
    else:
        print("| executor | other processes | starts | p50 | p99 | most |", flush=True)
        print("|---|---:|---:|---:|---:|---:|", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        texts = {"d.pddl": rounds.DOMAIN, "p.pddl": rounds.problem(chosen.robots, DOCKS)}
        texts["plan"] = rounds.plan(chosen.robots, DOCKS, chosen.actions)
        for name, text in texts.items():
            (folder / name).write_text(text)
        for executor in chosen.executors:
            what = "serve" if chosen.replan else "run"
            line = [pathlib.Path(chosen.program).resolve(), what, "d.pddl", "p.pddl", "plan"]
            place = pathlib.Path(__file__).resolve()
            own = [sys.executable, place, "world", "--pace", chosen.pace, folder / "arrivals"]
            line += ["--executor", executor, "--world-process", shlex.join(map(str, own))]
            record = "journal" if chosen.journal else "trace.jsonl"
            (folder / record).unlink(missing_ok=True)
            line += ["--journal" if chosen.journal else "--trace", record]
            if chosen.replan:
                for row in replanned(line, folder, chosen.pace):
                    print(f"| `{executor}` | {row} |", flush=True)
                continue
            line += ["--planner", "none"]
            done = subprocess.run(line, cwd=folder, capture_output=True)
            if done.returncode not in (0, 1):
                raise SystemExit(f"{executor}: {done.stderr.decode()}")
            late = lateness(folder / record, folder / "arrivals", chosen.pace)
            if not late:
                raise SystemExit(f"{executor}: nothing was started: {done.stdout.decode()}")
            at = [f"{late[(len(late) - 1) * share // 100]:.2f} ms" for share in (50, 99, 100)]
            print(
                f"| `{executor}` | {chosen.load} | {len(late)} | {' | '.join(at)} |",
                flush=True,
            )
    for process in load:
        process.terminate()


if __name__ == "__main__":
    main()
