"""The package elbowroom_ros on real ROS 2, with the action servers of `fleet.py`.

`scenarios.py ELBOWROOM [SCENARIO...]` needs a shell in which the package is set up; `.ci/ros2` makes one. For scenarios
named on the command line, all output is shown.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import bags
from action_msgs.msg import GoalStatus
from plansys2_msgs.msg import ActionExecutionInfo as Info
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from stage import DOMAIN, ELBOWROOM, INTERFACES, MAPPING, PATIENCE, PROBLEM, Stage, end, executable, play_all, processes

SUCCEEDED, CANCELED, ABORTED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED
FLEET = {"r1": {"lasts": 1}, "r2": {"lasts": 1}}
FEW_PLANS = "['--max-replans', '1']"
# Two robots change places: at least three drives.
SWAP = "(and (at r1 dock2) (at r2 dock1))"


def goals_are_achieved(stage):
    """Two goals at a time, each with its pose, feedback and result."""
    stage.robots(FLEET)
    stage.executive()
    client = stage.client()
    goals = [client.send(goal="(at r1 lab)", name="first"), client.send(goal="(at r2 ward)", within=600.0)]
    for goal in goals:
        status, result = stage.result(goal)
        assert (status, result.state) == (SUCCEEDED, "achieved") and result.time > 0, result
    assert goals[0].result.name == "first" and goals[1].result.name
    feedback = [it for goal in goals for it in goal.feedback]
    assert {it.goal.state for it in feedback} >= {"pursued"}
    assert {name for it in feedback for name in it.running} == {"(move r1 dock1 lab)", "(move r2 dock2 ward)"}
    received = {it["robot"]: it for it in stage.log() if it["event"] == "received"}
    assert received["r1"]["to"] == [4.5, 1.0] and received["r2"]["to"] == [-2.0, 7.5]
    assert received["r1"]["frame"] == "map" and abs(received["r1"]["turn"] - 0.7068) < 0.001
    stage.until("an idle executive", lambda: client.activity() == "resting")
    state = client.call("get_state").state
    assert {it.name: it.state for it in state.goals}.items() >= {"first": "achieved"}.items()
    assert [it for it in client.promises if it.promise and it.quantities[0].nominal == 3.0], client.promises
    assert any("nothing is due before end of (move" in it for it in client.reasons), client.reasons
    assert client.levels["executive: executive"][0] == 0 and client.levels["executive: world"] == (0, "answers")


def a_pause_and_its_end(stage):
    stage.robots(FLEET)
    stage.executive()
    client = stage.client()
    goal = client.send(goal=SWAP)
    stage.until("a drive", lambda: stage.count("begins"))
    assert client.call("pause").success
    stage.until("a pause", lambda: client.activity() == "paused")
    stage.until("the ends", lambda: stage.count("begins") == stage.count("ends"))
    begun = stage.count("begins")
    stage.until("a warning", lambda: client.levels.get("executive: executive", (0, ""))[0] == 1)
    time.sleep(2)
    assert stage.count("begins") == begun, "nothing is started"
    assert client.call("resume").success
    assert stage.result(goal)[1].state == "achieved" and stage.count("begins") >= 3


def a_stop_cancels(stage):
    stage.robots({"r1": {"lasts": 600}, "r2": {}})
    node = stage.executive()
    client = stage.client()
    goal = client.send(goal="(at r1 lab)")
    stage.until("a drive", lambda: stage.count("begins"))
    assert client.call("stop").success
    stage.until("the end of the node", lambda: node.poll() is not None)
    assert node.returncode == 0
    assert stage.events().count("cancelled") == 1
    assert stage.result(goal)[0] == ABORTED
    # An interrupt has the same effect.
    node = stage.executive()
    client.latest.clear()
    stage.client().send(goal="(at r1 lab)")
    stage.until("another drive", lambda: stage.count("begins") == 2)
    node.send_signal(signal.SIGINT)
    stage.until("the end of the node", lambda: node.poll() is not None)
    assert node.returncode == 0 and stage.events().count("cancelled") == 2


def a_server_that_rejects_cancellations(stage):
    """Elbowroom waits for the action for five seconds, and ends."""
    stage.robots({"r1": {"lasts": 600, "stubborn": True}, "r2": {}})
    node = stage.executive()
    client = stage.client()
    client.send(goal="(at r1 lab)")
    stage.until("a drive", lambda: stage.count("begins"))
    client.call("stop")
    stage.until("the end of the node", lambda: node.poll() is not None)
    assert stage.count("cancel") > 1, "the cancellation is repeated"
    assert "/r1/navigate_to_pose does not accept the cancellation" in stage.said()


def a_goal_is_cancelled(stage):
    stage.robots({"r1": {"lasts": 3}, "r2": {}})
    stage.executive()
    client = stage.client()
    goal = client.send(goal=SWAP)
    stage.until("a drive", lambda: stage.count("begins"))
    goal.handle.cancel_goal_async()
    status, result = stage.result(goal)
    assert (status, result.state) == (CANCELED, "cancelled"), result
    # A goal that another client cancels is aborted.
    goal = client.send(goal=SWAP, name="swap")
    stage.until("its pursuit", lambda: any(it.goal.state == "pursued" for it in goal.feedback))
    assert client.call("cancel_goal", name="swap").success
    status, result = stage.result(goal)
    assert (status, result.state) == (ABORTED, "cancelled"), result
    answer = client.call("cancel_goal", name="swap")
    assert not answer.success and "there is no open goal with this name" in answer.message, answer


def goals_that_are_none(stage):
    """Reasons are in the result."""
    stage.robots(FLEET)
    stage.executive()
    client = stage.client()
    status, result = stage.result(client.send(goal="(at r1 moon)"))
    assert (status, result.state) == (ABORTED, "rejected") and "moon" in result.reason, result
    status, result = stage.result(client.send(goal="(and (at r1 lab) (at r1 ward))"))
    assert status == ABORTED and result.state in ("impossible", "unplanned"), result
    assert "no plan" in result.reason, result
    stage.until("its withdrawal", lambda: not [
        it for it in client.call("get_state").state.goals if it.state in ("pursued", "unplanned", "impossible")
    ])  # fmt: skip
    answer = client.call("submit_goal", goal="(at r1 lab)", name="errand", value=2.0)
    assert answer.success and answer.name == "errand"
    stage.until("its end", lambda: "achieved" in [
        it.state for it in client.call("get_state").state.goals if it.name == "errand" and it.value == 2.0
    ])  # fmt: skip
    answer = client.call("submit_goal", goal="(at r1 lab)", value=float("nan"))
    assert not answer.success and answer.message


def a_condition_is_kept(stage):
    stage.robots(FLEET)
    stage.executive()
    client = stage.client()
    goal = client.send(goal="(at r1 lab)", keep=True)
    stage.until("the goal to be kept", lambda: any(it.goal.state == "kept" for it in goal.feedback))
    assert stage.result(client.send(goal="(at r1 ward)"))[1].state == "achieved"
    stage.until("another drive to the lab", lambda: stage.count("ends") == 3)
    goal.handle.cancel_goal_async()
    assert stage.result(goal)[0] == CANCELED


def an_operator_reports(stage):
    """Facts, and the outcome of an action."""
    stage.robots({"r1": {"lasts": 600}, "r2": {}})
    stage.executive()
    client = stage.client()
    goal = client.send(goal="(at r1 lab)")
    running = stage.until("an action", lambda: client.call("get_state").state.running)
    assert running[0].action == "(move r1 dock1 lab)" and running[0].planned == 3.0
    assert client.call("report_action", ticket=running[0].ticket, becomes="done").success
    assert stage.result(goal)[1].state == "achieved"
    assert client.call("set_fact", fact="(at r2 ward)", becomes=True).success
    assert not client.call("set_fact", fact="(at r2 moon)", becomes=True).success
    assert not client.call("set_number", fluent="(height r2)", value=1.0).success


def drives_that_fail(stage):
    """Each failure has its reason."""
    stage.robots({"r1": {"fails": "a chair is in the way"}, "r2": {"error": 7}})
    mapping = stage.file("mapping.yaml")
    with open(MAPPING, encoding="utf-8") as file:
        text = file.read().replace("    feedback:", "    success: {error_code: 0}\n    feedback:")
    with open(mapping, "w", encoding="utf-8") as file:
        file.write(text)
    stage.executive(mapping=mapping, arguments=FEW_PLANS)
    client = stage.client()
    for robot, why in (("r1", "error_code 101, error_msg a chair is in the way"), ("r2", "error_code is 7, expected 0")):
        status, result = stage.result(client.send(goal=f"(at {robot} lab)"))
        assert status == ABORTED, result
        stage.until(why, lambda why=why: any(why in line for line in stage.trace(client)))


def servers_that_are_not_there(stage):
    stage.robots({"r1": {"rejects": True}})
    mapping = stage.file("mapping.yaml")
    with open(MAPPING, encoding="utf-8") as file:
        text = file.read()
    with open(mapping, "w", encoding="utf-8") as file:
        file.write(text + "wait_for: {servers: [/r1/navigate_to_pose], seconds: 2}\n")
    stage.executive(mapping=mapping, arguments=FEW_PLANS)
    client = stage.client()
    for robot, why in (("r1", "has rejected the goal"), ("r2", "no action server /r2/navigate_to_pose of type")):
        assert stage.result(client.send(goal=f"(at {robot} lab)"))[0] == ABORTED
        stage.until(why, lambda why=why: any(why in line for line in stage.trace(client)))
    with open(mapping, "w", encoding="utf-8") as file:
        file.write(text + "wait_for: {servers: [/r2/navigate_to_pose], seconds: 2}\n")
    node = stage.executive("-r", "__ns:=/other", mapping=mapping, restarts=0)
    stage.until("the end of the node", lambda: node.poll() is not None)
    assert node.returncode == 1 and "no action server /r2/navigate_to_pose within 2 s" in stage.said()


def mistakes_in_a_mapping(stage):
    """They are named before anything is started."""
    cases = [
        ("type: nav2_msgs/action/NavigateToPose", "type: nav2_msgs/action/Fly", "nav2_msgs/action/Fly"),
        ("frame_id: map", "frame: map", "Header has no field frame"),
        ('"{places[to]}"', '"{rooms[to]}"', "there is no table rooms"),
        ("remaining: distance_remaining", "remaining: distance_left", "there is no field distance_left"),
    ]
    with open(MAPPING, encoding="utf-8") as file:
        text = file.read()
    for right, wrong, why in cases:
        mapping = stage.file("mapping.yaml")
        with open(mapping, "w", encoding="utf-8") as file:
            file.write(text.replace(right, wrong))
        run = stage.start([executable("action_world"), mapping], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        stage.hear(run)
        assert stage.code == 1 and why in stage.errors, stage.errors


def a_server_disappears(stage):
    """Its goal has failed; once it is there again, the robot drives again."""
    robots = stage.robots({"r1": {"lasts": 600}})
    stage.executive()
    client = stage.client()
    goal = client.send(goal="(at r1 lab)")
    stage.until("a drive", lambda: stage.count("begins"))
    robots.send_signal(signal.SIGINT)
    robots.wait(PATIENCE)
    stage.robots(FLEET)
    assert stage.result(goal)[1].state == "achieved"
    assert stage.count("begins", "r1") == 2
    stage.until("its reason", lambda: any("/r1/navigate_to_pose has disappeared" in it for it in stage.trace(client)))


def a_server_is_killed_and_restarted(stage):
    """The new server does not know the goal, and the old one has the same name."""
    robots = stage.robots({"r1": {"lasts": 600}})
    stage.executive()
    client = stage.client()
    goal = client.send(goal="(at r1 lab)")
    stage.until("a drive", lambda: stage.count("begins"))
    robots.kill()
    robots.wait(PATIENCE)
    stage.robots(FLEET)
    assert stage.result(goal)[1].state == "achieved"
    stage.until("its reason", lambda: any("/r1/navigate_to_pose has disappeared" in it for it in stage.trace(client)))


def the_time_of_a_simulation(stage):
    """The world's time is that of /clock, which can stand still."""
    simulated = ("--ros-args", "-p", "use_sim_time:=true")
    stage.robots({"r1": {"lasts": 20}, "r2": {}}, *simulated)
    node = stage.executive(use_sim_time="true")
    client = stage.client(is_idle=False)
    clock = {"now": 1000.0}

    def advance(seconds):
        # A step of the simulation is 0.1 s; it is ten times as fast as the wall clock.
        clock["now"] += seconds
        stamp = Clock()
        stamp.clock.sec, stamp.clock.nanosec = int(clock["now"]), int(clock["now"] % 1 * 1e9)
        client.clock.publish(stamp)
        time.sleep(0.01)
        return False

    stage.until("an idle executive", lambda: advance(0.1) or client.activity() == "resting")
    zero = clock["now"] - client.latest["state"].time
    goal = client.send(goal="(at r1 lab)")
    stage.until("a drive", lambda: advance(0.1) or stage.count("begins"))
    begun = clock["now"]
    time.sleep(3)
    assert client.latest["state"].time < clock["now"] - zero + 1, "the time stands still"
    assert stage.count("ends") == 0
    stage.until("a result", lambda: advance(0.1) or goal.result is not None)
    assert goal.result.state == "achieved"
    assert begun + 20 - zero - 1 < goal.result.time < clock["now"] - zero + 1, (begun, zero, goal.result.time)
    # Even when the time stands still, a running action can be cancelled.
    client.send(goal="(at r1 ward)")
    stage.until("another drive", lambda: advance(0.1) or stage.count("begins") == 2)
    silence = stage.until("a silent world", lambda: client.levels["executive: world"][0] and client.levels["executive: world"])
    assert silence[0] == 2 and silence[1].startswith("no answer for"), silence
    assert client.call("stop").success
    stage.until("the cancellation", lambda: stage.count("cancelled"))
    stage.until("the end of the node", lambda: node.poll() is not None)


def errand_is_achieved(client):
    goals = client.latest["state"].goals if "state" in client.latest else []
    return any((it.name, it.state) == ("errand", "achieved") for it in goals)


def a_killed_node_resumes(stage):
    """Goals, facts and goals of action servers continue. Nothing is started twice."""
    stage.robots({"r1": {"lasts": 12}, "r2": {"lasts": 4}})
    journal = stage.file("journal")
    node = stage.executive(journal=journal)
    client = stage.client()
    assert stage.result(client.send(goal="(at r2 ward)"))[1].state == "achieved"
    assert client.call("submit_goal", goal="(at r1 lab)", name="errand").success
    stage.until("a drive", lambda: stage.count("begins", "r1"))
    node.kill()
    node.wait(PATIENCE)
    client.latest.clear()
    stage.executive(journal=journal)
    stage.until("the goal", lambda: errand_is_achieved(client))
    assert stage.count("begins") == 2 and stage.count("ends") == 2 and stage.count("cancel") == 0


def a_killed_node_without_a_journal_cancels(stage):
    stage.robots({"r1": {"lasts": 600}, "r2": {}})
    node = stage.executive()
    stage.client().send(goal="(at r1 lab)")
    stage.until("a drive", lambda: stage.count("begins"))
    node.kill()
    node.wait(PATIENCE)
    stage.until("the cancellation", lambda: stage.count("cancelled"))


def node_and_robots_are_killed(stage):
    """Goals that no server knows any more have failed."""
    robots = stage.robots({"r1": {"lasts": 600}})
    journal = stage.file("journal")
    node = stage.executive(journal=journal)
    assert stage.client().call("submit_goal", goal="(at r1 lab)", name="errand").success
    stage.until("a drive", lambda: stage.count("begins", "r1"))
    for it in (node, robots):
        it.kill()
        it.wait(PATIENCE)
    client = stage.client(is_idle=False)
    client.latest.clear()
    stage.robots(FLEET)
    stage.executive(journal=journal)
    stage.until("the goal", lambda: errand_is_achieved(client))
    assert stage.count("begins") == 2 and stage.count("ends") == 1


def a_killed_world_is_restarted(stage):
    """The same for the world's process alone."""
    stage.robots({"r1": {"lasts": 12}, "r2": {}})
    stage.executive()
    client = stage.client()
    goal = client.send(goal="(at r1 lab)")
    stage.until("a drive", lambda: stage.count("begins"))
    (world,) = processes("elbowroom_ros.action_world", stage.domain_id)
    os.kill(world, signal.SIGKILL)
    assert stage.result(goal)[1].state == "achieved"
    assert stage.count("begins") == 1 and stage.count("ends") == 1


def a_second_executive_refuses(stage):
    stage.robots({"r1": {"lasts": 8}, "r2": {}})
    stage.executive()
    client = stage.client()
    goal = client.send(goal="(at r1 lab)")
    stage.until("a drive", lambda: stage.count("begins"))
    second = stage.executive(name="second", restarts=0)
    stage.until("its refusal", lambda: second.poll() is not None)
    assert second.returncode == 1 and "another executor, process" in stage.said()
    assert stage.result(goal)[1].state == "achieved" and stage.count("begins") == 1


def a_running_executive_is_offered(stage):
    """The node connects to `elbowroom serve`, which continues without it."""
    stage.robots(FLEET)
    socket, token = stage.file("socket"), stage.file("token")
    with open(os.open(token, os.O_CREAT | os.O_WRONLY, 0o600), "w", encoding="utf-8") as file:
        file.write("0123456789abcdef")
    line = [ELBOWROOM, "serve", DOMAIN, PROBLEM, "--http", "127.0.0.1:0", "--socket", socket, "--token", token]
    server = stage._begin([*line, "--world-process", f"{executable('action_world')} {MAPPING}"])
    stage.until("the socket", lambda: os.path.exists(socket))
    options = {"domain": "''", "mapping": "''", "address": socket}
    node = stage.executive(**options, token=token)
    client = stage.client()
    assert stage.result(client.send(goal="(at r1 lab)"))[1].state == "achieved"
    end(node)
    assert server.poll() is None
    client.latest.clear()
    stage.executive(**options)
    assert not stage.client().call("pause").success, "there is no token"


def the_protocol_is_kept(stage):
    """Checked by Elbowroom, with restarts and cancellations."""
    stage.robots({"r1": {"lasts": 2}, "r2": {"lasts": 2}})
    plan = stage.file("plan")
    with open(plan, "w", encoding="utf-8") as file:
        file.write("0: (move r1 dock1 lab) [3]\n0: (move r2 dock2 ward) [3]\n")
    world = f"{executable('action_world')} {MAPPING} --ledger {stage.file('ledger')}"
    command = [ELBOWROOM, "world-check", world, DOMAIN, PROBLEM, plan, "--answer-within", str(PATIENCE)]
    stage.hear(stage.start(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE))
    assert stage.code == 0, stage.out


def convert(stage, bag):
    """Converts a recording. Returns the path of the only log."""
    logs = f"{bag}-logs"
    run = stage.start([executable("bag_to_trace"), bag, "-o", logs], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    stage.hear(run)
    assert stage.code == 0, stage.errors
    (log,) = os.listdir(logs)
    return os.path.join(logs, log)


def learn(stage, log):
    """Returns the model of the only action in a log."""
    command = [ELBOWROOM, "learn", log, "--json"]
    stage.hear(stage.start(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE))
    assert stage.code == 0, stage.errors
    (move,) = json.loads(stage.out)["actions"]
    assert move["action"] == "move", move
    return move


def recordings_of_plansys2_are_learnt_from(stage):
    """Those of its executor, on the topic action_execution_info."""
    with open(os.path.join(INTERFACES, "ActionExecutionInfo.msg"), encoding="utf-8") as file:
        definition = file.read()
    raw = []
    for number, (lasts, outcome) in enumerate(((4, Info.SUCCEEDED), (6, Info.SUCCEEDED), (2, Info.FAILED))):
        name = f"(move r{number} dock lab):0"
        arguments = [f"r{number}", "dock", "lab"]
        for status, seconds in ((Info.NOT_EXECUTED, 0), (Info.EXECUTING, 1), (outcome, lasts)):
            info = Info(action_full_name=name, action="move", arguments=arguments, status=status)
            info.start_stamp.sec, info.status_stamp.sec, info.duration.sec = 1700000000, 1700000000 + seconds, 5
            raw.append(("/action_execution_info", serialize_message(info)))
    bag = stage.file("plansys2")
    bags.write(bag, "mcap", raw, "plansys2_msgs/msg/ActionExecutionInfo", definition)
    move = learn(stage, convert(stage, bag))
    assert (move["attempts"], move["durations"]["observed"], move["durations"]["censored"]) == (3, 2, 1), move
    assert move["durations"]["mean"] > 0.9, "multiples of the planned duration"


def recordings_are_learnt_from(stage):
    """Bags of both kinds, complete or from the middle of a run, become logs."""
    stage.robots({"r1": {"lasts": 1}, "r2": {"lasts": 2}})
    stage.executive()
    client = stage.client()
    for goal in ("(at r1 lab)", "(at r2 ward)", "(at r1 dock1)"):
        assert stage.result(client.send(goal=goal))[1].state == "achieved"
    stage.until("the trace", lambda: sum('"outcome":"succeeded"' in it for it in stage.trace(client)) >= 3)
    events = [it for it in client.raw if it[0].endswith("events")]
    # Without the header and the first action, this is no trace.
    first = next(index for index, it in enumerate(bags.events(events)) if '"outcome":"succeeded"' in it["line"])
    for name, kept, actions in (("sqlite3", client.raw, 3), ("mcap", client.raw, 3), ("late", events[first + 1 :], 2)):
        bag = stage.file(name)
        bags.write(bag, "sqlite3" if name == "sqlite3" else "mcap", kept)
        log = convert(stage, bag)
        assert log.endswith(".csv" if name == "late" else ".jsonl"), log
        assert learn(stage, log)["attempts"] == actions
    shutil.rmtree(stage.file("late"))
    run = stage.start([executable("bag_to_trace"), stage.file("late")], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    stage.hear(run)
    assert stage.code == 1 and "there is no such file" in stage.errors


SCENARIOS = [
    goals_are_achieved,
    a_pause_and_its_end,
    a_stop_cancels,
    a_server_that_rejects_cancellations,
    a_goal_is_cancelled,
    goals_that_are_none,
    a_condition_is_kept,
    an_operator_reports,
    drives_that_fail,
    servers_that_are_not_there,
    mistakes_in_a_mapping,
    a_server_disappears,
    a_server_is_killed_and_restarted,
    the_time_of_a_simulation,
    a_killed_node_resumes,
    a_killed_node_without_a_journal_cancels,
    node_and_robots_are_killed,
    a_killed_world_is_restarted,
    a_second_executive_refuses,
    the_protocol_is_kept,
    a_running_executive_is_offered,
    recordings_are_learnt_from,
    recordings_of_plansys2_are_learnt_from,
]


if __name__ == "__main__":
    play_all([(it, "", Stage) for it in SCENARIOS], sys.argv[2:])
