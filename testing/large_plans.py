"""Time and memory until a plan is started, by the number of its time points.

    python3 testing/large_plans.py target/release/elbowroom [--executor stn] [--numbers | --shape NAME] [TIME POINTS…]

*Begun* is the time of the first command in the trace. It includes reading, validating and relaxing the plan, and preparing
the network. *Run* is the whole process. With --numbers, conditions read numbers; with --shape, robots limit each other as
in one of the shapes of `shapes.py`. With --files, nothing is measured: domain, problem and plan are written to that folder,
and a world in which each duration is up to a tenth longer or shorter than planned. Standard library only; memory is read
from /proc.
"""

import argparse
import os
import pathlib
import subprocess
import tempfile
import time

import rounds
import shapes

ROBOTS, DOCKS = 20, 4


COMMAND = b'"event":"command"'


class Trace:
    """Incremental reader of a trace; each byte is read once."""

    def __init__(self, path):
        self.path, self.read, self.end = path, 0, b""

    def has_command(self):
        """Returns `True` if a command is among the lines since the last call."""
        if not self.path.exists():
            return False
        with self.path.open("rb") as file:
            file.seek(self.read)
            new = file.read()
        self.read += len(new)
        text = self.end + new
        self.end = text[-len(COMMAND) :]
        return COMMAND in text


def peak(process):
    """Peak memory of the process in megabytes; `None` after its end."""
    try:
        text = pathlib.Path(f"/proc/{process.pid}/status").read_text()
        (line,) = [line for line in text.splitlines() if line.startswith("VmHWM")]
        return int(line.split()[1]) / 1024
    except (OSError, ValueError):
        return None


def processor(process):
    """Processor time so far, user and system, in seconds."""
    words = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


WORLD = """format = "elbowroom-world"
version = 1
[[duration]]
action = "*"
uniform = { from = 0.9, to = 1.1 }
relative = true
"""


def write(folder, points, has_numbers, shape=None):
    """Writes domain, problem and plan."""
    if shape:
        domain, problem, plan = shapes.files(shape, points // 2)
    else:
        domain, problem = rounds.domain(has_numbers), rounds.problem(ROBOTS, DOCKS, has_numbers)
        plan = rounds.plan(ROBOTS, DOCKS, points // 2)
    for name, text in {"d.pddl": domain, "p.pddl": problem, "plan": plan}.items():
        (folder / name).write_text(text)


def row(program, executor, points, patience, has_numbers, shape=None):
    """Measures one plan."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        write(folder, points, has_numbers, shape)
        line = [pathlib.Path(program).resolve(), "run", "d.pddl", "p.pddl", "plan", "--executor", executor]
        line += ["--planner", "none", "--trace", "trace.jsonl"]
        begin = time.monotonic()
        process = subprocess.Popen(line, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        memory = at_first = None
        trace = Trace(folder / "trace.jsonl")
        while process.poll() is None and memory is None:
            time.sleep(0.002)
            if trace.has_command():
                memory, at_first = peak(process), processor(process)
            if time.monotonic() - begin > patience:
                process.kill()
                process.wait()
                print(f"| {points:,} | `{executor}` | more than {patience:.0f} s | | | |", flush=True)
                return
        _, _, usage = os.wait4(process.pid, 0) if process.returncode is None else (0, 0, None)
        whole = f"{usage.ru_utime:.2f} s | {usage.ru_maxrss / 1024:.0f} MB" if usage else "|"
        first = f"{at_first:.2f} s | {memory:.0f} MB" if memory else "|"
        print(f"| {points:,} | `{executor}` | {first} | {whole} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program", help="the program to measure; - with --files")
    parser.add_argument("points", nargs="*", type=int, default=[1_000, 10_000, 40_000, 100_000])
    parser.add_argument("--executor", default="stn")
    parser.add_argument("--patience", type=float, default=300)
    parser.add_argument("--numbers", action="store_true", help="driving uses charge")
    parser.add_argument("--shape", choices=shapes.SHAPES, help="kind of constraints between robots")
    parser.add_argument("--files", type=pathlib.Path, help="write files for the first number of time points")
    chosen = parser.parse_intermixed_args()
    if chosen.files:
        chosen.files.mkdir(parents=True, exist_ok=True)
        write(chosen.files, chosen.points[0], chosen.numbers, chosen.shape)
        (chosen.files / "world.toml").write_text(WORLD)
        return
    print("| time points | executor | begun | memory | run | memory |")
    print("|---:|---|---:|---:|---:|---:|", flush=True)
    for points in chosen.points:
        row(chosen.program, chosen.executor, points, chosen.patience, chosen.numbers, chosen.shape)


if __name__ == "__main__":
    main()
