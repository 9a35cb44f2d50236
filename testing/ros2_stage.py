"""Scenarios with processes on ROS 2. Each scenario has a DDS domain of its own, so that several can run concurrently. There
are no limits on speed: on a slow machine the scenarios take longer, but do not fail."""

import json
import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor

# Time limit of each wait, in seconds. Only a hanging process reaches it.
PATIENCE = 300
AT_A_TIME = 4


class Stage:
    """Environment of one scenario."""

    def __init__(self, domain_id, folder):
        self.folder = folder
        self.environment = dict(os.environ, ROS_DOMAIN_ID=str(domain_id))
        self.log_file = os.path.join(folder, "log.jsonl")
        self.code = self.out = self.errors = None

    def start(self, command, **more):
        return subprocess.Popen(command, env=self.environment, text=True, **more)

    def wait_for(self, what, holds, *while_there):
        """Waits for a condition while the processes that should cause it are running."""
        until = time.monotonic() + PATIENCE
        while not (found := holds()):
            for process in while_there:
                if process.poll() is not None and not holds():
                    if process.stdout is not None:
                        self.hear(process)
                    raise AssertionError(f"waited for {what}, but {process.args[:2]} ended with {process.returncode}")
            assert time.monotonic() < until, f"waited {PATIENCE} s in vain for {what}"
            time.sleep(0.05)
        return found

    def hear(self, process):
        """Reads the output of a process until its end."""
        try:
            self.out, self.errors = process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            self.out, self.errors = process.communicate()
            raise AssertionError(f"{process.args[:2]} has not ended within {PATIENCE} s") from None
        finally:
            self.code = process.returncode

    def log(self):
        """Returns the log that the processes write, as documents."""
        if not os.path.exists(self.log_file):
            return []
        with open(self.log_file, encoding="utf-8") as file:
            # The last line may be incomplete.
            return [json.loads(line) for line in file if line.endswith("\n")]

    def events(self):
        return [it["event"] for it in self.log()]

    def close(self):
        """Ends what is still running."""

    def __str__(self):
        log = open(self.log_file, encoding="utf-8").read() if os.path.exists(self.log_file) else ""
        return f"exit code {self.code}\n{self.out}\n{self.errors}\n{log}"


def end(*processes):
    """Ends processes in order, or kills them."""
    for it in processes:
        if it is not None and it.poll() is None:
            it.terminate()
    for it in processes:
        if it is not None:
            try:
                # Occasionally rclpy does not end after the signal.
                it.wait(timeout=30)
            except subprocess.TimeoutExpired:
                it.kill()


def play(scenario, name, stage_for, domain_id, is_verbose):
    """Plays a scenario; returns whether it passed."""
    with tempfile.TemporaryDirectory() as folder:
        stage = stage_for(domain_id, folder)
        begun = time.monotonic()
        try:
            scenario(stage)
            went_well, said = True, "ok"
        except Exception as error:  # each failure is reported with the messages of the scenario
            went_well = False
            said = f"WRONG: {type(error).__name__}: {error} at line {error.__traceback__.tb_next.tb_lineno}\n{stage}"
        finally:
            stage.close()
        if went_well and is_verbose:
            said += f"\n{stage}"
        print(f"{scenario.__name__}{name}: {said} ({time.monotonic() - begun:.0f} s)", flush=True)
        return went_well


def play_all(plays, only):
    """Plays scenarios, each with a suffix of its name and a function that makes its stage; `only` names some of them, with
    their output. Ends the program."""
    plays = [it for it in plays if not only or it[0].__name__ in only]
    with ThreadPoolExecutor(AT_A_TIME) as pool:
        went_well = list(pool.map(lambda it: play(*it[1], it[0] + 1, bool(only)), enumerate(plays)))
    print(f"{sum(went_well)} of {len(went_well)} scenarios passed")
    sys.exit(0 if all(went_well) else 1)
