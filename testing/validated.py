"""Validation of every execution of the experiments.

    python3 testing/validated.py target/release/elbowroom [--trials 20] [--seconds 120] [EXPERIMENT.toml ...]

runs `elbowroom compare` with each experiment on a clock (all of `experiments/`, unless some are named), with at
most `--trials` trials of each problem and `--seconds` seconds each, and prints the number of executions and of those
that the validator rejects. Exit code 0: none was rejected. Standard library only.
"""

import argparse
import json
import pathlib
import signal
import subprocess
import sys
import tempfile


def executions(command, experiment, trials, seconds):
    """Returns the number of executions of an experiment, and their errors."""
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [command, "compare", experiment, "--trials", str(trials), "--jobs", "1", "-o", folder],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            _, errors = process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            # An interrupted `compare` writes the results of the finished trials.
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate()
        results = pathlib.Path(folder) / "results.json"
        if not results.exists():
            return 0, [f"no results: {errors.strip()}"]
        results = json.loads(results.read_text())
    if results["format"] != "elbowroom-results":
        return None, []
    cells = [cell for row in results["cells"] for cell in row]
    invalid = [cell["invalid"] for cell in cells if "invalid" in cell]
    return sum(cell["runs"] for cell in cells), invalid


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("command")
    parser.add_argument("experiments", nargs="*")
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=120)
    arguments = parser.parse_args()
    folder = pathlib.Path(__file__).parent.parent / "experiments"
    experiments = arguments.experiments or sorted(str(path) for path in folder.glob("*.toml"))
    total, rejected = 0, 0
    for experiment in experiments:
        runs, invalid = executions(arguments.command, experiment, arguments.trials, arguments.seconds)
        name = pathlib.Path(experiment).name
        if runs is None:
            print(f"{name}: a world without time, nothing to validate", flush=True)
            continue
        total += runs
        rejected += sum(it["runs"] if isinstance(it, dict) else 1 for it in invalid)
        print(f"{name}: {runs} executions, {invalid or 'all valid'}", flush=True)
    print(f"{total} executions, {rejected} rejected")
    return 1 if rejected else 0


if __name__ == "__main__":
    sys.exit(main())
