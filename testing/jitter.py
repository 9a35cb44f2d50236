"""How late actions are started on a wall clock: 100 robots, 10,000 actions.

    python3 testing/jitter.py target/release/elbowroom [--load N] [--pace 10] [EXECUTOR…]

Each robot drives from place to place, a hundred times, and each tenth time waits for a dock that others use, too.
Durations deviate. The world is a process, this file once more, whose clock runs PACE times as fast as the one on
the wall; meanwhile N other processes do nothing but calculate. How late a start is, is the time on the wall from
the earliest moment at which it could be, as the trace has it, to the one at which the world has read that it is
to start. Standard library only.
"""

import argparse
import json
import heapq
import multiprocessing
import pathlib
import random
import shlex
import subprocess
import sys
import tempfile
import time

import rounds

ROBOTS, DOCKS = 100, 20


def world(pace, log):
    """The world: what it is told to start lasts about as long as planned. Arrivals are noted in a file."""
    dice = random.Random(1)
    begin = None
    running, news, arrivals = [], [], []

    def now():
        return (time.monotonic() - begin) * pace

    for text in sys.stdin:
        message = json.loads(text)
        if begin is None and message["type"] != "hello":
            # Until the plan is ready, nothing is late.
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
    """What another program does."""
    number = 0
    while True:
        number = (number * 1103515245 + 12345) % 2**31


def lateness(trace, log, pace):
    """Of each start in the trace, in milliseconds of the wall clock."""
    arrivals = dict(json.loads(log.read_text()))
    late = []
    for text in trace.read_text().splitlines():
        line = json.loads(text)
        earliest = (line.get("planned") or {}).get("earliest")
        if line["event"] == "command" and earliest:
            arrival = arrivals[line["command"]["ticket"]]
            late.append((arrival - earliest["decimal"]) * 1000 / pace)
    return sorted(late)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("executors", nargs="*", default=["stn", "guarded", "live"])
    parser.add_argument("--load", type=int, default=0)
    parser.add_argument("--pace", type=int, default=10)
    parser.add_argument("--actions", type=int, default=10_000)
    chosen = parser.parse_intermixed_args()
    if chosen.program == "world":
        return world(chosen.pace, chosen.executors[0])
    load = [multiprocessing.Process(target=calculate, daemon=True) for _ in range(chosen.load)]
    for process in load:
        process.start()
    print("| executor | other processes | starts | p50 | p99 | most |", flush=True)
    print("|---|---:|---:|---:|---:|---:|", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        texts = {"d.pddl": rounds.DOMAIN, "p.pddl": rounds.problem(ROBOTS, DOCKS)}
        texts["plan"] = rounds.plan(ROBOTS, DOCKS, chosen.actions)
        for name, text in texts.items():
            (folder / name).write_text(text)
        for executor in chosen.executors:
            line = [pathlib.Path(chosen.program).resolve(), "run", "d.pddl", "p.pddl", "plan"]
            place = pathlib.Path(__file__).resolve()
            own = [sys.executable, place, "world", "--pace", chosen.pace, folder / "arrivals"]
            line += ["--executor", executor, "--world-process", shlex.join(map(str, own))]
            line += ["--planner", "none", "--trace", "trace.jsonl"]
            done = subprocess.run(line, cwd=folder, capture_output=True)
            if done.returncode not in (0, 1):
                raise SystemExit(f"{executor}: {done.stderr.decode()}")
            late = lateness(folder / "trace.jsonl", folder / "arrivals", chosen.pace)
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
