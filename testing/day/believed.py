"""Value on time of a simulated depot with and without the true mean durations as beliefs.

    python3 testing/day/believed.py target/release/elbowroom [--seeds 3] [--hours 1] [--tasks 45]

The depot, its tasks and its durations are those of `day.py`, without faults. The world is a simulation, and each plan
takes 5 s of its time, so the result does not depend on the speed of the machine. Standard library only.
"""

import argparse
import json
import pathlib
import subprocess
import tempfile
import time
import urllib.request

import depot

SHIFT = 300
OPTIONS = ["--planning-time", "5", "--max-replans", "1000000", "--timeout", "6x,300", "--planning-budget", "0.1"]


def durations():
    """Sections of a world file with the distributions of `depot.Truth`."""
    sections = []
    for (a, b), seconds in depot.roads().items():
        mean = seconds * (2.6 if "lift" in (a, b) else 1.05)
        sections.append(f'[[duration]]\naction = "(drive _ {a} {b})"\nlognormal = {{ mean = {mean}, deviation = {0.19 * mean} }}')
    for name, seconds in depot.DURATIONS.items():
        mean = 1.1 * seconds
        sections.append(f'[[duration]]\naction = "{name}"\nlognormal = {{ mean = {mean}, deviation = {0.19 * mean} }}')
    return 'format = "elbowroom-world"\nversion = 1\n' + "\n".join(sections) + "\n"


def run(chosen, folder, seed, believed):
    """Runs the tasks; returns the value on time and the possible value."""
    tasks = depot.tasks(seed, round(chosen.tasks * chosen.hours), chosen.hours * 3600)
    truth = durations()
    for task in tasks:
        for fact in task.undone:
            truth += f'[[event]]\nfact = "{fact}"\nbecomes = false\nconstant = {SHIFT + task.release - 1:.3f}\n'
    for name, text in [("domain", depot.DOMAIN), ("problem", depot.problem(depot.ROBOTS))]:
        (folder / f"{name}.pddl").write_text(text)
    (folder / "truth.toml").write_text(truth)
    (folder / "believed.toml").write_text(durations())
    (folder / "token").write_text("a-token-of-some-length")
    (folder / "token").chmod(0o600)
    line = [chosen.program, "serve", folder / "domain.pddl", folder / "problem.pddl", "--world", folder / "truth.toml", *OPTIONS]
    line += ["--realtime", "100", "--seed", str(seed), "--http", "0", "--token", folder / "token"]
    line += ["--believed", folder / "believed.toml"] if believed else []
    process = subprocess.Popen([str(it) for it in line], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    address = process.stderr.readline().split("http://")[1].split("/")[0]

    def ask(verb, path, body=None):
        data = json.dumps(body).encode() if body else None
        asked = urllib.request.Request(f"http://{address}{path}", data, method=verb)
        asked.add_header("Authorization", "Bearer a-token-of-some-length")
        return json.load(urllib.request.urlopen(asked, timeout=60))

    for task in tasks:
        body = {"goal": task.goal, "name": task.name, "value": task.value}
        ask("POST", "/v1/goals", {**body, "release": SHIFT + task.release, "deadline": SHIFT + task.deadline})
    last = SHIFT + max(task.deadline for task in tasks) + 10
    while ask("GET", "/v1/state")["now"]["decimal"] < last:
        time.sleep(0.2)
    achieved = {it["name"] for it in ask("GET", "/v1/goals")["goals"] if it["state"] == "achieved"}
    ask("POST", "/v1/stop", {})
    process.communicate()
    possible = [task for task in tasks if task.kind in ("carry", "check")]
    return sum(task.value for task in tasks if task.name in achieved), sum(task.value for task in possible)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--hours", type=float, default=1)
    parser.add_argument("--tasks", type=float, default=45, help="an hour")
    chosen = parser.parse_args()
    totals = {False: 0, True: 0}
    for seed in range(chosen.seeds):
        for believed in totals:
            with tempfile.TemporaryDirectory() as folder:
                value, possible = run(chosen, pathlib.Path(folder), seed, believed)
            totals[believed] += value
            print(f"seed {seed}, {'believed' if believed else 'domain'} durations: {value} of {possible}", flush=True)
    print(f"in all: {totals[False]} with durations of the domain, {totals[True]} with believed ones")


if __name__ == "__main__":
    main()
