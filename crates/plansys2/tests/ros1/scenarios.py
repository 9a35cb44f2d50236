"""Runs of Elbowroom with action interfaces on real ROS 1 (`interface.py`), through `examples/rosplan_world.py`.

`scenarios.py ELBOWROOM [SCENARIO...]` needs a Python with rospy, genpy and diagnostic_msgs; `.ci/ros1` finds one. ROSPlan's
messages are defined in the folders `texts` and `numbers`, for its older and newer versions. Each scenario is run with both,
each with a `roscore` of its own. For scenarios named on the command line, all output is shown. There are no limits on
speed.
"""

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import genpy.generate_initpy
import genpy.generator

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.join(HERE, "..", "..", "..", "..")
ELBOWROOM = os.path.abspath(sys.argv[1])
YARD = [os.path.join(HERE, "..", "ros2", "yard", it) for it in ("domain.pddl", "problem.pddl", "plan.plan")]
MATCH = [os.path.join(ROOT, "cases", "match", it) for it in ("domain.pddl", "problem.pddl", "plan.plan")]
SHARE = "/usr/share/diagnostic_msgs/msg"
# Time limit of each wait, in seconds. Only a hanging process reaches it.
PATIENCE = 300
AT_A_TIME = 4
# Exit codes of a run without a plan: with a certificate that none exists, or without one.
NO_PLAN = (1, 3)
DRIVERS = {
    "driver1": {"action": "move", "lasts": 2, "only": "r1"},
    "driver2": {"action": "move", "lasts": 2, "only": "r2"},
    "signaller": {"action": "signal", "lasts": 1},
}


def compiled(version, folder):
    """Generates the messages of a version as Python modules in a folder."""
    package = "rosplan_dispatch_msgs"
    files = [os.path.join(HERE, version, it) for it in sorted(os.listdir(os.path.join(HERE, version)))]
    target = os.path.join(folder, version, package, "msg")
    search = {package: [os.path.join(HERE, version)], "diagnostic_msgs": [SHARE]}
    genpy.generator.MsgGenerator().generate_messages(package, files, target, search)
    genpy.generate_initpy.write_modules(target)
    genpy.generate_initpy.write_modules(os.path.dirname(target))
    return os.path.join(folder, version)


class Stage:
    """Environment of one scenario: a master and action interfaces."""

    def __init__(self, messages, version, port, folder):
        self.version, self.folder = version, folder
        packages = [messages, *filter(None, [os.environ.get("PYTHONPATH")])]
        self.environment = dict(
            os.environ, PYTHONPATH=os.pathsep.join(packages), ROS_MASTER_URI=f"http://127.0.0.1:{port}",
            ROS_IP="127.0.0.1", ROS_HOME=folder, ROS_LOG_DIR=os.path.join(folder, "log"), NO_COLOR="1",
        )  # fmt: skip
        self.log_file = os.path.join(folder, "interfaces.jsonl")
        self.trace_file = os.path.join(folder, "run.jsonl")
        with open(os.path.join(folder, "ros"), "w", encoding="utf-8") as said:
            self.there = [self.start(["roscore", "-p", str(port)], stdout=said, stderr=said)]
        self.wait_for("the master", self.has_master)

    def start(self, command, **more):
        return subprocess.Popen(command, env=self.environment, text=True, **more)

    def ask(self, *command):
        return subprocess.run(command, env=self.environment, text=True, capture_output=True, timeout=PATIENCE)

    def has_master(self):
        # The log of all nodes is the last one to start.
        return "/rosout" in self.ask("rosnode", "list").stdout

    def begin(self, interfaces):
        script = os.path.join(HERE, "interface.py")
        for name, spec in interfaces.items():
            self.there.append(self.start([sys.executable, script, name, json.dumps(spec), self.log_file]))
        self.wait_for("the action interfaces", lambda: all(
            f"/{name}" in self.ask("rosnode", "list").stdout.split() for name in interfaces
        ))  # fmt: skip

    def play(self, files, *options, speed=1):
        self.environment["ELBOWROOM_SPEED"] = str(speed)
        line = [ELBOWROOM, "run", *files, *options, "--world-process", self.world(files), "--strict-world"]
        run = self.start([*line, "--trace", self.trace_file], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        try:
            self.out, self.errors = run.communicate(timeout=PATIENCE)
        finally:
            run.kill()
            self.code = run.returncode

    @staticmethod
    def world(files):
        return f"{sys.executable} {os.path.join(ROOT, 'examples', 'rosplan_world.py')} {files[0]}"

    def wait_for(self, what, holds):
        until = time.monotonic() + PATIENCE
        while not holds():
            gone = [it.args for it in self.there if it.poll() is not None]
            assert not gone, f"waited for {what}, but {gone} ended"
            assert time.monotonic() < until, f"waited {PATIENCE} s in vain for {what}"
            time.sleep(0.2)

    def log(self):
        if not os.path.exists(self.log_file):
            return []
        with open(self.log_file, encoding="utf-8") as file:
            return [json.loads(line) for line in file if line.endswith("\n")]

    def when(self, event, action):
        """Returns the time of an event that must have happened exactly once."""
        (at,) = [it["at"] for it in self.log() if (it["event"], it["action"]) == (event, action)]
        return at

    def trace(self):
        with open(self.trace_file, encoding="utf-8") as file:
            return file.read()

    def end(self):
        for it in reversed(self.there):
            it.terminate()
        for it in self.there:
            try:
                it.wait(timeout=30)
            except subprocess.TimeoutExpired:
                it.kill()

    def __str__(self):
        log = "".join(f"{it}\n" for it in self.log())
        return f"exit code {self.code}\n{self.out}\n{self.errors}\n{log}"


def two_robots_at_a_time(stage):
    stage.begin(DRIVERS)
    stage.play(YARD)
    assert stage.code == 0 and "goal reached" in stage.out
    first, second = "(move r1 shed gate)", "(move r2 barn gate)"
    assert stage.when("begins", second) < stage.when("ends", first)
    assert stage.when("begins", first) < stage.when("ends", second)
    assert stage.when("begins", "(signal r2 gate)") > stage.when("ends", second)
    moved = next(it for it in stage.log() if it["action"] == first)
    assert (moved["keys"], moved["duration"]) == (["r", "from", "to"], 2.0)


def required_concurrency(stage):
    """The match cellar: actions that need light must lie within the burning match."""
    stage.begin({"flare": {"action": "burn", "lasts": 3.0}, "diver": {"action": "inspect", "lasts": 0.9}})
    stage.play(MATCH, "--executor", "live", speed=10)
    assert stage.code == 0 and "goal reached" in stage.out
    burning = [stage.when(it, "(burn torch)") for it in ("begins", "ends")]
    for weld in ("hull", "keel"):
        begins, ends = (stage.when(it, f"(inspect {weld})") for it in ("begins", "ends"))
        assert burning[0] < begins < ends < burning[1]


def an_interface_ends_three_times_and_its_last_word_is_repeated_to_the_next_run(stage):
    stage.begin({name: dict(spec, repeats=3) for name, spec in DRIVERS.items()})
    for _ in range(2):
        stage.play(YARD)
        assert stage.code == 0 and "goal reached" in stage.out
    assert len({it["id"] for it in stage.log()}) == 6

    def at(event, interface):
        return sorted(it["at"] for it in stage.log() if (it["event"], it["interface"]) == (event, interface))

    # Reports of the first run would end the second one too early: r2 would be reported as arrived
    # before it has. (Nothing waits for r1.)
    assert len(at("ends", "driver2")) == len(at("begins", "signaller")) == 2
    assert all(arrived < signal for arrived, signal in zip(at("ends", "driver2"), at("begins", "signaller")))


def a_failure_has_its_reason(stage):
    stage.begin({**DRIVERS, "driver2": dict(DRIVERS["driver2"], lasts=1, fails="the wheels slip")})
    stage.play(YARD)
    assert stage.code == 1 and "why: the wheels slip" in stage.trace()


def what_is_late_has_its_reason(stage):
    stage.begin({"flare": {"action": "burn", "lasts": 3.0}, "diver": {"action": "inspect", "lasts": 2.2}})
    stage.play(MATCH, speed=10)
    # The remaining plan is executed without a guarantee. ROSPlan's interfaces cannot be cancelled,
    # so the last inspection may succeed after the light has gone out.
    words = " ".join(stage.out.split())
    # Milliseconds decide which of the two inspections is named, and whether its end is late or the
    # remaining time is too short.
    assert stage.code in (0, *NO_PLAN) and "too little time is left" in words and "end of (inspect " in words
    assert '"cancel"' in stage.trace()


def a_refusal_has_its_reason(stage):
    stage.begin({**DRIVERS, "driver2": dict(DRIVERS["driver2"], refuses="the brake is on")})
    stage.play(YARD)
    # Each new plan requests it again, as long as the run replans.
    assert stage.code == 3 and "why: the brake is on" in stage.out and "why: the brake is on" in stage.trace()
    assert {it["event"] for it in stage.log() if it["interface"] == "driver2"} == {"refuses"}


def a_second_executor_refuses(stage):
    stage.begin({name: dict(it, lasts=5 * it["lasts"]) for name, it in DRIVERS.items()})
    refused = []

    def run_another():
        stage.wait_for("the first start", lambda: any(it["event"] == "begins" for it in stage.log()))
        line = [ELBOWROOM, "run", *YARD, "--world-process", stage.world(YARD)]
        refused.append(stage.start(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE))

    beside = threading.Thread(target=run_another)
    beside.start()
    stage.play(YARD, speed=0.2)
    beside.join()
    assert stage.code == 0, "the first run is not disturbed"
    (run,) = refused
    out, errors = run.communicate(timeout=PATIENCE)
    assert run.returncode == 2 and "another executor, process" in errors, f"{run.returncode} {out} {errors}"


def nobody_is_there(stage):
    stage.environment["ELBOWROOM_PERFORMERS_WITHIN"] = "2"
    stage.play(YARD, "--time-limit", "5")
    assert stage.code == 3 and "no action interface was found within 2 s" in stage.errors


BOTH = [
    two_robots_at_a_time,
    required_concurrency,
    an_interface_ends_three_times_and_its_last_word_is_repeated_to_the_next_run,
    a_failure_has_its_reason,
    what_is_late_has_its_reason,
]
NUMBERS_ONLY = [a_refusal_has_its_reason, a_second_executor_refuses, nobody_is_there]


def play(number, scenario, version, messages):
    with tempfile.TemporaryDirectory() as folder:
        begun = time.monotonic()
        stage = None
        try:
            stage = Stage(messages, version, 11400 + number, folder)
            stage.code = stage.out = stage.errors = None
            scenario(stage)
            went_well, said = True, "ok"
        except Exception as error:  # each failure is reported with the messages of the scenario
            went_well = False
            line = error.__traceback__.tb_next
            said = f"WRONG: {type(error).__name__}: {error} at line {line.tb_lineno if line else '?'}\n{stage}"
        finally:
            if stage is not None:
                stage.end()
        if went_well and sys.argv[2:]:
            said += f"\n{stage}"
        print(f"{scenario.__name__}, {version}: {said} ({time.monotonic() - begun:.0f} s)", flush=True)
        return went_well


def main():
    only = sys.argv[2:]
    plays = [(it, version) for it in BOTH for version in ("texts", "numbers")]
    plays += [(it, "numbers") for it in NUMBERS_ONLY]
    plays = [it for it in plays if not only or it[0].__name__ in only]
    with tempfile.TemporaryDirectory() as folder:
        messages = {version: compiled(version, folder) for version in ("texts", "numbers")}
        with ThreadPoolExecutor(AT_A_TIME) as pool:
            numbered = enumerate(plays)
            went_well = list(pool.map(lambda it: play(it[0], *it[1], messages[it[1][1]]), numbered))
    print(f"{sum(went_well)} of {len(went_well)} scenarios passed")
    sys.exit(0 if all(went_well) else 1)


if __name__ == "__main__":
    main()
