"""Runs of Elbowroom with performers on real ROS 2 (`performers.py`), through the program `elbowroom-plansys2` and
through `examples/plansys2_world.py`.

`scenarios.py ELBOWROOM ELBOWROOM_PLANSYS2 [SCENARIO...]` needs a shell in which rclpy and plansys2_msgs can be imported;
`.ci/ros2` makes one. For scenarios named on the command line, all output is shown.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.join(HERE, "..", "..", "..", "..")
sys.path.insert(0, os.path.join(ROOT, "testing"))
import ros2_stage  # noqa: E402
from ros2_stage import PATIENCE, end, play_all  # noqa: E402

ELBOWROOM, PROGRAM = (os.path.abspath(it) for it in sys.argv[1:3])
PYTHON_WORLD = f"{sys.executable} {os.path.join(ROOT, 'examples', 'plansys2_world.py')}"
YARD = [os.path.join(HERE, "yard", it) for it in ("domain.pddl", "problem.pddl", "plan.plan")]
MATCH = [os.path.join(ROOT, "cases", "match", it) for it in ("domain.pddl", "problem.pddl", "plan.plan")]
# Exit codes of a run without a plan: with a certificate that none exists, or without one.
NO_PLAN = (1, 3)
DRIVERS = {
    "driver1": {"action": "move", "lasts": 2, "only": "r1"},
    "driver2": {"action": "move", "lasts": 2, "only": "r2"},
    "signaller": {"action": "signal", "lasts": 1},
}


class Stage(ros2_stage.Stage):
    """Environment of one scenario: a world, and performers."""

    def __init__(self, world, domain_id, folder):
        super().__init__(domain_id, folder)
        self.world = world
        self.trace_file = os.path.join(folder, "run.jsonl")

    def play(self, performers, files, *options, speed=1, interrupt_after=None, command="run"):
        """Runs Elbowroom with these performers until it ends, or interrupts it after the event `interrupt_after`."""
        self.environment["ELBOWROOM_SPEED"] = str(speed)
        script = os.path.join(HERE, "performers.py")
        there = self.start([sys.executable, script, json.dumps(performers), self.log_file])
        run = None
        try:
            # The nodes of a robot start before its plan.
            self.wait_for("the performers", lambda: os.path.exists(self.log_file), there)
            time.sleep(1)
            line = [ELBOWROOM, command, *files, *options]
            if command == "run":
                line += ["--world-process", self.world, "--trace", self.trace_file]
            else:
                line.insert(2, self.world)
            run = self.start(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            if interrupt_after:
                happened = f"{interrupt_after} in the log of the performers"
                self.wait_for(happened, lambda: interrupt_after in self.events(), run, there)
                time.sleep(0.3)
                run.send_signal(signal.SIGINT)
            self.hear(run)
            self.settle()
        finally:
            end(run, there)
        return self

    def settle(self):
        """Waits until the performers log no more messages."""
        known = None
        while known != (known := self.log()):
            time.sleep(0.5)

    def when(self, event, action):
        """Returns the time of an event that must have happened exactly once."""
        (at,) = [it["at"] for it in self.log() if (it["event"], it["action"]) == (event, action)]
        return at

    def trace(self):
        with open(self.trace_file, encoding="utf-8") as file:
            return file.read()


def two_robots_at_a_time(stage):
    stage.play(DRIVERS, YARD)
    assert stage.code == 0 and "goal reached" in stage.out
    first, second = "(move r1 shed gate)", "(move r2 barn gate)"
    assert stage.when("begins", second) < stage.when("ends", first)
    assert stage.when("begins", first) < stage.when("ends", second)
    assert stage.when("begins", "(signal r2 gate)") > stage.when("ends", second)
    # A second driver may be discovered after the run has begun, which needs only one.
    performers = next(line for line in stage.errors.splitlines() if "performers: " in line)
    assert "(move)" in performers and "signaller (signal)" in performers


def required_concurrency(stage):
    """The match cellar: actions that need light must lie within the burning match."""
    crew = {"flare": {"action": "burn", "lasts": 3.0}, "diver": {"action": "inspect", "lasts": 0.9}}
    stage.play(crew, MATCH, "--executor", "live", speed=10)
    assert stage.code == 0 and "goal reached" in stage.out
    burning = [stage.when(it, "(burn torch)") for it in ("begins", "ends")]
    for weld in ("hull", "keel"):
        begins, ends = (stage.when(it, f"(inspect {weld})") for it in ("begins", "ends"))
        assert burning[0] < begins < ends < burning[1]


def a_performer_finishes_three_times(stage):
    crew = {name: dict(spec, repeats=3) for name, spec in DRIVERS.items()}
    stage.play(crew, YARD, "--strict-world")
    assert stage.code == 0 and "goal reached" in stage.out
    assert len([it for it in stage.events() if it == "begins"]) == 3


def two_performers_of_the_same_action(stage):
    crew = {name: {"action": "move", "lasts": 1} for name in ("driver1", "driver2")}
    stage.play({**crew, "signaller": DRIVERS["signaller"]}, YARD)
    assert stage.code == 0 and "goal reached" in stage.out
    events = stage.events()
    assert events.count("begins") == 3 and "rejected" in events


def a_failure_has_its_reason(stage):
    crew = {**DRIVERS, "driver2": dict(DRIVERS["driver2"], lasts=1, fails="the wheels slip")}
    stage.play(crew, YARD)
    assert stage.code == 1 and "the wheels slip" in stage.trace()


def a_performer_is_lost(stage):
    crew = {**DRIVERS, "driver1": dict(DRIVERS["driver1"], dies=0.5)}
    stage.play(crew, YARD)
    assert stage.code == 1 and "driver1 is lost: no message from it for 5 s" in stage.trace()


def a_performer_never_says_that_it_has_ended(stage):
    """An overdue action is cancelled when no plan tolerates it any longer, and stops."""
    crew = {"flare": {"action": "burn", "lasts": 3.0}, "diver": {"action": "inspect", "lasts": 0.9, "mute": True}}
    stage.play(crew, MATCH, speed=10)
    assert stage.code in NO_PLAN and "told to cancel" in stage.events()
    assert '"cancelled"' in stage.trace()


def what_is_late_has_its_reason(stage):
    """A deviation is detected when the interval of the envelope is left, and reported with that interval."""
    crew = {"flare": {"action": "burn", "lasts": 3.0}, "diver": {"action": "inspect", "lasts": 2.2}}
    stage.play(crew, MATCH, speed=10)
    assert stage.code in NO_PLAN and "inspect hull" in stage.out and "allowed" in stage.trace()


def a_run_is_interrupted(stage):
    crew = {**DRIVERS, "driver1": dict(DRIVERS["driver1"], lasts=30), "driver2": dict(DRIVERS["driver2"], lasts=30)}
    stage.play(crew, YARD, interrupt_after="begins")
    told = {it["action"] for it in stage.log() if it["event"] == "told to cancel"}
    assert told == {"(move r1 shed gate)", "(move r2 barn gate)"}
    assert "terminate called" not in stage.errors


def a_second_executor_refuses(stage):
    """The first run holds the performers until it ends, then the next one may use them."""
    crew = {name: dict(it, lasts=5 * it["lasts"]) for name, it in DRIVERS.items()}
    others = [PROGRAM, PYTHON_WORLD]
    refused = []

    def run_others():
        stage.wait_for("the first start", lambda: "begins" in stage.events())
        for world in others:
            line = [ELBOWROOM, "run", *YARD, "--world-process", world]
            refused.append(stage.start(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE))

    beside = threading.Thread(target=run_others)
    beside.start()
    stage.play(crew, YARD, speed=0.2)
    beside.join()
    assert stage.code == 0, "the first run is not disturbed"
    for run in refused:
        out, errors = run.communicate(timeout=PATIENCE)
        assert run.returncode == 2 and "another executor, process" in errors, f"{run.returncode} {out} {errors}"
    begun = [it["action"] for it in stage.log() if it["event"] == "begins"]
    assert len(begun) == len(set(begun)), "no action was started twice"
    os.remove(stage.log_file)
    stage.play(DRIVERS, YARD)
    assert stage.code == 0, "the performers are free again"


def the_protocol_is_kept(stage):
    crew = {"driver": {"action": "move", "lasts": 1.5}, "driver2": {"action": "move", "lasts": 1.5}}
    stage.play(crew, YARD, command="world-check")
    assert stage.code == 0


def a_missing_performer_is_named(stage):
    stage.world += " --needs move,signal --within 8"
    stage.play({"driver": {"action": "move", "lasts": 1}}, YARD)
    assert stage.code == 2 and "no performer of signal was discovered within 8 s; discovered: driver (move)" in stage.errors
    assert stage.log() == []


def begin_expert(stage, script="expert.py", **more):
    """A problem expert with the content of the yard problem, except for one number."""
    spec = {"facts": ["at r1 shed", "at r2 barn"], "numbers": {"trips r1": 0}, **more}
    stage.expert_file = os.path.join(stage.folder, "expert.jsonl")
    expert = stage.start([sys.executable, os.path.join(HERE, script), json.dumps(spec), stage.expert_file])
    stage.wait_for("the problem expert", lambda: os.path.exists(stage.expert_file), expert)
    return expert


def changes(stage):
    """Returns the changes that the problem expert received, their senders, and its final state."""
    with open(stage.expert_file, encoding="utf-8") as file:
        lines = [json.loads(line) for line in file]
    return [(it["who"], it["told"]) for it in lines], [lines[-1]["facts"], lines[-1]["numbers"]]


def serve(stage, crew, *options, meanwhile=None, expert=None):
    """The program replaces PlanSys2's planner and executor; returns the answers to a client."""
    script = os.path.join(HERE, "performers.py")
    there = [stage.start([sys.executable, script, json.dumps(crew), stage.log_file])]
    program = [*stage.world.split(), "serve", "--elbowroom", ELBOWROOM]
    said = open(os.path.join(stage.folder, "program"), "w+", encoding="utf-8")
    there.append(stage.start(program, stdout=subprocess.DEVNULL, stderr=said))
    there += [expert] if expert else []
    try:
        client = stage.start([sys.executable, os.path.join(HERE, "client.py"), *YARD[:2], *options],
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE)  # fmt: skip
        there.append(client)
        if meanwhile:
            # An error here is reported before its consequences.
            meanwhile(client)
        stage.hear(client)
        assert stage.code == 0
        there[1].send_signal(signal.SIGINT)
        assert there[1].wait(timeout=PATIENCE) == 0, "it ends in order"
        stage.settle()
    finally:
        end(*there)
        said.seek(0)
        stage.program = said.read()
        said.close()
        print(stage.program, file=sys.stderr, end="", flush=True)
    return json.loads(stage.out)


def a_plan_is_asked_for_and_executed(stage):
    said = serve(stage, DRIVERS)
    assert said["before"] == ["unconfigured", "unconfigured", "rejected"]
    assert said["made ready"] == 4 * [True] and said["then"] == ["active", "active"]
    is_planned, why = said["broken"]
    assert not is_planned and "domain.pddl:1:9" in why
    assert said["validated"][0] == [True, ""]
    is_valid, why = said["validated"][1]
    assert not is_valid and "domain.pddl:" in why
    is_planned, actions = said["planned"]
    assert is_planned and len(actions) == 3
    executed = said["executed"]
    assert executed["outcome"] == "succeeded" and executed["success"] and executed["was_executing"]
    assert set(executed["actions"]) == {"(move r1 shed gate):0", "(move r2 barn gate):0", "(signal r1 gate):2000"}
    assert all(status == 4 for status, _ in executed["actions"].values())
    assert said["idle"] == 3 * ["no plan is being executed"]
    assert said["known"] is None and stage.program.count("there is no problem expert") == 1
    assert said["followed"] == [True, sorted(executed["actions"])], "tools can follow"
    # The performers' process and the client. The program does not publish node information, on
    # which nodes of another distribution abort.
    publishers, nodes = said["nodes"]
    assert publishers == 2 and set(nodes) == {"client", *DRIVERS}
    assert stage.events().count("ends") == 3


def a_second_executor_of_a_server_refuses(stage):
    """A server holds the performers until it ends, also between its runs."""
    crew = {name: dict(it, lasts=5 * it["lasts"]) for name, it in DRIVERS.items()}
    server = [*stage.world.split(), "serve", "--elbowroom", ELBOWROOM]

    def run_others(client):
        stage.wait_for("the first start", lambda: "begins" in stage.events(), client)
        for line in (server, [ELBOWROOM, "run", *YARD, "--world-process", stage.world]):
            other = stage.start(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            out, errors = other.communicate(timeout=PATIENCE)
            assert other.returncode == 2 and "another executor, process" in errors, f"{other.returncode} {out} {errors}"

    said = serve(stage, crew, meanwhile=run_others)
    assert said["executed"]["outcome"] == "succeeded", "the first server is not disturbed"
    assert stage.events().count("begins") == 3, "no action was started twice"
    os.remove(stage.log_file)
    assert serve(stage, DRIVERS)["executed"]["outcome"] == "succeeded", "the performers are free again"


def an_executed_plan_is_cancelled(stage):
    crew = {name: dict(spec, lasts=30) for name, spec in DRIVERS.items()}
    said = serve(stage, crew, "2")
    executed = said["executed"]
    # No action has ended.
    goals = ["(and (at r1 gate))", "(and (at r2 gate))", "(and (signalled gate))"]
    assert executed["asked"] == [*2 * [said["planned"][1]], goals]
    assert executed["outcome"] == "canceled" and not executed["success"]
    assert sorted(status for status, _ in executed["actions"].values()) == [1, 5, 5]
    assert stage.events().count("told to cancel") == 2


def a_run_dies_while_a_plan_is_executed(stage):
    """Actions left running are cancelled, and the client is notified."""
    crew = {name: dict(spec, lasts=30) for name, spec in DRIVERS.items()}

    def kill(client):
        stage.wait_for("two actions to begin", lambda: stage.events().count("begins") == 2, client)
        killed = 0
        for process in os.listdir("/proc"):
            try:
                with open(f"/proc/{process}/cmdline", "rb") as file:
                    words = file.read().split(b"\0")
                with open(f"/proc/{process}/environ", "rb") as file:
                    is_ours = f"ROS_DOMAIN_ID={stage.environment['ROS_DOMAIN_ID']}".encode() in file.read().split(b"\0")
            except OSError:
                continue
            if words[:2] == [ELBOWROOM.encode(), b"run"] and is_ours:
                os.kill(int(process), signal.SIGKILL)
                killed += 1
        assert killed == 1, f"{killed} runs were under way"

    executed = serve(stage, crew, meanwhile=kill)["executed"]
    assert executed["outcome"] == "aborted" and not executed["success"]
    assert stage.events().count("told to cancel") == 2


def an_executed_plan_fails_with_its_reason(stage):
    crew = {**DRIVERS, "driver1": dict(DRIVERS["driver1"], lasts=0.5, fails="the wheels slip")}
    executed = serve(stage, crew)["executed"]
    assert executed["outcome"] == "aborted" and not executed["success"]
    assert executed["actions"]["(move r1 shed gate):0"] == [3, "the wheels slip"]


AT_THE_GATE = [["at r1 gate", "at r2 gate", "signalled gate"], {"trips r1": 1.0, "trips r2": 1.0}]


def what_is_done_is_told_to_the_problem_expert(stage):
    """Each effect is reported once, when it happens; the client's result follows all of them."""
    said = serve(stage, DRIVERS, expert=begin_expert(stage))
    assert said["executed"]["outcome"] == "succeeded" and len(said["executed"]["actions"]) == 3
    told, known = changes(stage)
    assert known == AT_THE_GATE and said["known"] == AT_THE_GATE
    assert {who for who, _ in told} == {"the run"}
    told = [it for _, it in told]
    # The undefined fluent is defined, the other one updated.
    first, last = {"remove at r1 shed", "remove at r2 barn"}, "add signalled gate"
    between = {"add at r1 gate", "add at r2 gate", "update trips r1 1", "add trips r2 1"}
    assert len(told) == 7 and set(told[:2]) == first and set(told[2:6]) == between and told[6] == last
    assert stage.program.count("problem expert") == 0, "there is nothing to remark"


def what_others_tell_the_problem_expert_is_heeded(stage):
    """The robot at the gate is moved back to the barn, and drives to the gate again."""
    then = [{"when": "add at r2 gate", "then": ["remove at r2 gate", "add at r2 barn", "update trips r1 7"]}]
    said = serve(stage, DRIVERS, expert=begin_expert(stage, then=then))
    assert said["executed"]["outcome"] == "succeeded"
    moves = [it["at"] for it in stage.log() if (it["event"], it["action"]) == ("begins", "(move r2 barn gate)")]
    assert len(moves) == 2
    told, (facts, numbers) = changes(stage)
    assert facts == AT_THE_GATE[0] and numbers["trips r2"] == 2.0
    # The other robot arrives at about that time. Its trip is counted before the change, from 0, or
    # after it, from 7.
    assert numbers["trips r1"] in (7.0, 1.0, 8.0)
    assert [it for who, it in told if who == "somebody else"] == then[0]["then"]


def what_the_problem_expert_refuses_is_said_and_the_run_goes_on(stage):
    said = serve(stage, DRIVERS, expert=begin_expert(stage, refuses="at r1 gate"))
    assert said["executed"]["outcome"] == "succeeded" and len(said["executed"]["actions"]) == 3
    assert "the problem expert rejects (at r1 gate): it is not valid" in stage.program
    assert said["known"][0] == ["at r2 gate", "signalled gate"]


def a_problem_expert_that_does_not_answer_delays_nothing(stage):
    crew = {**DRIVERS, "driver1": dict(DRIVERS["driver1"], lasts=6), "driver2": dict(DRIVERS["driver2"], lasts=6)}
    expert = begin_expert(stage, mute=True)

    def leave(client):
        # The client would ask the problem expert as well, and wait. The problem expert ends before
        # that.
        stage.wait_for("it to be said", lambda: "has not answered" in read(stage), client)
        end(expert)

    def read(stage):
        with open(os.path.join(stage.folder, "program"), encoding="utf-8") as file:
            return file.read()

    said = serve(stage, crew, expert=expert, meanwhile=leave)
    assert said["executed"]["outcome"] == "succeeded" and len(said["executed"]["actions"]) == 3
    assert stage.program.count("the problem expert has not answered for 5 s") == 1


def a_run_tells_the_problem_expert_if_it_is_asked_to(stage):
    stage.world += " --problem-expert follow"
    expert = begin_expert(stage)
    try:
        stage.play(DRIVERS, YARD)
    finally:
        end(expert)
    assert stage.code == 0 and "goal reached" in stage.out and "with 0 new plans" in stage.out
    assert changes(stage)[1] == AT_THE_GATE


def use_cyclone(stage):
    stage.environment["CYCLONEDDS_URI"] = (
        "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo' multicast='true'/></Interfaces></General>"
        "</Domain></CycloneDDS>"
    )


def a_problem_expert_on_cyclone_dds_is_told_and_heard(stage):
    use_cyclone(stage)
    stage.world += " --problem-expert follow"
    then = [{"when": "add at r2 gate", "then": ["remove at r2 gate", "add at r2 barn"]}]
    expert = begin_expert(stage, "cyclone_expert.py", then=then)
    try:
        stage.play(DRIVERS, YARD)
    finally:
        end(expert)
    assert stage.code == 0 and "goal reached" in stage.out
    facts, numbers = changes(stage)[1]
    assert facts == AT_THE_GATE[0] and numbers == {"trips r1": 1.0, "trips r2": 2.0}


def clients_on_cyclone_dds_are_answered_beside_others(stage):
    use_cyclone(stage)
    told = []

    def ask(client):
        script = os.path.join(HERE, "cyclone.py")
        other = stage.start([sys.executable, script, *YARD[:2]], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        out, errors = other.communicate(timeout=PATIENCE)
        assert other.returncode == 0, errors
        told.append(json.loads(out))

    said = serve(stage, DRIVERS, meanwhile=ask)
    assert said["executed"]["outcome"] == "succeeded"
    (told,) = told
    assert told["state"] in ("unconfigured", "inactive", "active")
    assert told["planned"] == [True, [[0.0, "(move r1 shed gate)", 2.0], [0.0, "(move r2 barn gate)", 2.0],
                                      [2.0, "(signal r1 gate)", 1.0]]]  # fmt: skip
    assert not told["broken"][0] and "domain.pddl:1:9" in told["broken"][1]
    assert "not understood" not in stage.program


PROGRAM_ONLY = [
    a_problem_expert_on_cyclone_dds_is_told_and_heard,
    clients_on_cyclone_dds_are_answered_beside_others,
    what_is_done_is_told_to_the_problem_expert,
    what_others_tell_the_problem_expert_is_heeded,
    what_the_problem_expert_refuses_is_said_and_the_run_goes_on,
    a_problem_expert_that_does_not_answer_delays_nothing,
    a_run_tells_the_problem_expert_if_it_is_asked_to,
    a_missing_performer_is_named,
    a_plan_is_asked_for_and_executed,
    a_second_executor_of_a_server_refuses,
    an_executed_plan_is_cancelled,
    an_executed_plan_fails_with_its_reason,
    a_run_dies_while_a_plan_is_executed,
]
BOTH = [
    two_robots_at_a_time,
    required_concurrency,
    a_performer_finishes_three_times,
    two_performers_of_the_same_action,
    a_failure_has_its_reason,
    a_performer_is_lost,
    a_performer_never_says_that_it_has_ended,
    what_is_late_has_its_reason,
    a_run_is_interrupted,
    a_second_executor_refuses,
    the_protocol_is_kept,
]


def main():
    worlds = [(", program", PROGRAM), (", Python", PYTHON_WORLD)]
    plays = [(it, name, partial(Stage, world)) for it in BOTH for name, world in worlds]
    plays += [(it, ", program", partial(Stage, PROGRAM)) for it in PROGRAM_ONLY]
    play_all(plays, sys.argv[3:])


if __name__ == "__main__":
    main()
