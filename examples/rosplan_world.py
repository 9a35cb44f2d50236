#!/usr/bin/env python3
"""A world for `elbowroom run … --world-process "python3 rosplan_world.py domain.pddl"`: the action interfaces of
ROSPlan (ROS 1), in place of its plan dispatcher, which must be off.

Put `clients/python/elbowroom_world.py` beside this file, and start it where ROS and `rosplan_dispatch_msgs` are set
up. The domain file gives the names of each action's parameters, which ROSPlan's messages contain. ROSPlan has no
standard way to cancel actions, so this world declares that it cannot cancel.

`Dispatcher` implements the protocol without ROS, so that it can be tested anywhere. `main` connects it with rospy.
"""

import os
import re
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "clients", "python"))
from elbowroom_world import World  # noqa: E402

TOPICS = "/rosplan_plan_dispatcher/action_dispatch", "/rosplan_plan_dispatcher/action_feedback"
MEANINGS = {
    "started": ("enabled", "dispatched to goal"),
    "succeeded": ("achieved", "succeeded to goal"),
    "failed": ("failed", "preempted", "precondition false"),
}


def parameters(domain):
    """Returns the names of each action's parameters: `{"move": ["r", "from", "to"]}`."""
    text = re.sub(r";[^\n]*", "", domain).lower()
    found = re.findall(r"\(\s*:(?:durative-)?action\s+([^\s()]+)\s+:parameters\s*\(([^()]*)\)", text)
    return {name: re.findall(r"\?([^\s()]+)", listed) for name, listed in found}


def kind(status, constants):
    """Returns the meaning of a status, or None if it is unknown. Older versions of ROSPlan have texts, newer ones
    numbers. Some numbers have several names."""
    names = [name for name, number in constants.items() if number == status] or [str(status)]
    words = " ".join(names).lower().replace("_", " ")
    for meaning, signs in MEANINGS.items():
        if any(sign in words for sign in signs):
            return meaning
    return None


class Dispatcher:
    """Dispatches actions and processes their feedback. `publish(id, name, pairs, duration)` sends a dispatch message.

    Action interfaces repeat their last message to later subscribers, even if it is about an earlier run. So the action
    numbers of each run begin with a different number, `first`.
    """

    def __init__(self, publish, names, constants=None, first=0):
        self._publish, self._names, self._constants, self._first = publish, names, constants or {}, first
        self._actions = {}

    def begin(self, action):
        names = self._names.get(action.name.lower())
        if names is None or len(names) != len(action.arguments):
            action.failed(f"the domain has no action {action.name} with {len(action.arguments)} parameters")
            return
        number = self._first + action.ticket
        self._actions[number] = action
        self._publish(number, action.name, list(zip(names, action.arguments)), action.duration or 0.0)

    def feedback(self, message):
        action = self._actions.get(message.action_id)
        what = kind(message.status, self._constants)
        if action is None or what is None:
            return
        if what == "started":
            if action.duration is not None:
                action.started()
            return
        del self._actions[message.action_id]
        if what == "failed":
            said = ", ".join(f"{it.key}: {it.value}" for it in message.information)
            action.failed(said or "the action interface gave no reason")
        elif action.duration is None:
            action.started()
        else:
            action.succeeded()


def wait_for_interfaces(connected):
    """Waits until action interfaces are connected and no new one has appeared for a second. No action is dispatched
    twice, so all running interfaces must be connected before the first dispatch."""
    begun = changed = time.monotonic()
    within = float(os.environ.get("ELBOWROOM_PERFORMERS_WITHIN", "10"))
    known = connected()
    while time.monotonic() - begun < within and not (all(known) and time.monotonic() - changed >= 1):
        time.sleep(0.05)
        if known != (known := connected()):
            changed = time.monotonic()
    if not all(known):
        print(f"rosplan: no action interface was found within {within:g} s", file=sys.stderr)


def running_node(name):
    """Returns the process ID of the running node of this name, or None. The master also lists nodes that have crashed."""
    from xmlrpc.client import ServerProxy

    import rosgraph

    try:
        address = rosgraph.Master(name).lookupNode(name)
        return ServerProxy(address).getPid(name)[2]
    except (rosgraph.MasterException, OSError):
        return None


def main():
    import rospy
    from diagnostic_msgs.msg import KeyValue
    from rosplan_dispatch_msgs.msg import ActionDispatch, ActionFeedback

    with open(sys.argv[1], encoding="utf-8") as file:
        names = parameters(file.read())
    # ROS 1 ends a node when another one registers its name.
    process = running_node("/elbowroom")
    if process is not None:
        sys.exit(f"error: another executor, process {process}, uses these action interfaces: stop it first")
    rospy.init_node("elbowroom", disable_signals=True)
    publisher = rospy.Publisher(TOPICS[0], ActionDispatch, queue_size=1000)

    def publish(number, name, pairs, duration):
        listed = [KeyValue(key=key, value=value) for key, value in pairs]
        now = rospy.get_time()
        publisher.publish(ActionDispatch(
            action_id=number, name=name, parameters=listed, duration=duration, dispatch_time=now,
        ))  # fmt: skip

    constants = {
        word: value
        for word, value in vars(ActionFeedback).items()
        if word.isupper() and isinstance(value, int)
    }
    # Each second has its own range of 1000 numbers. A run that starts fewer than 1000 actions per second on average never
    # uses numbers of a later run.
    dispatcher = Dispatcher(publish, names, constants, first=int(time.time()) % 1_000_000 * 1000)
    subscriber = rospy.Subscriber(TOPICS[1], ActionFeedback, dispatcher.feedback)
    wait_for_interfaces(lambda: (publisher.get_num_connections(), subscriber.get_num_connections()))
    world = World("rosplan", speed=float(os.environ.get("ELBOWROOM_SPEED", "1")))
    world.capabilities = ("facts",)
    world.starter("*")(dispatcher.begin)
    world.run()


if __name__ == "__main__":
    main()
