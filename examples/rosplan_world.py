#!/usr/bin/env python3
"""A world for `elbowroom run … --world-process "python3 rosplan_world.py domain.pddl"`: the action interfaces of
ROSPlan (ROS 1), in place of its plan dispatcher, which must be off.

Put `clients/python/elbowroom_world.py` beside this file, and start it where ROS and `rosplan_dispatch_msgs` are set up. The
domain says what the parameters of each action are called: ROSPlan wants their names. Its action interfaces have no agreed
way to be cancelled, so this world does not claim to cancel anything.

`Dispatcher` is the conversation without ROS, so that it can be tested anywhere; `main` connects it with rospy.
"""

import os
import re
import sys

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "clients", "python"))
from elbowroom_world import World  # noqa: E402

TOPICS = "/rosplan_plan_dispatcher/action_dispatch", "/rosplan_plan_dispatcher/action_feedback"


def parameters(domain):
    """The names of each action's parameters: `{"move": ["r", "from", "to"]}`."""
    text = re.sub(r";[^\n]*", "", domain).lower()
    found = re.findall(r"\(\s*:(?:durative-)?action\s+([^\s()]+)\s+:parameters\s*\(([^()]*)\)", text)
    return {name: re.findall(r"\?([^\s()]+)", listed) for name, listed in found}


def kind(status, constants):
    """What a status means. Older versions have texts, newer ones numbers with names."""
    word = constants.get(status, str(status)).lower().replace("_", " ")
    if "enabled" in word:
        return "started"
    if "achieved" in word or "succeeded to goal" in word:
        return "succeeded"
    if "failed" in word or "preempted" in word:
        return "failed"
    return None


class Dispatcher:
    """Dispatches actions, and takes the feedback. `publish(id, name, pairs, duration)` dispatches."""

    def __init__(self, publish, names, constants=None):
        self._publish, self._names, self._constants = publish, names, constants or {}
        self._actions = {}

    def begin(self, action):
        names = self._names.get(action.name.lower())
        if names is None or len(names) != len(action.arguments):
            action.failed(f"the domain has no action {action.name} with {len(action.arguments)} parameters")
            return
        self._actions[action.ticket] = action
        self._publish(action.ticket, action.name, list(zip(names, action.arguments)), action.duration or 0.0)

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
            action.failed(said or "the action interface has not said why")
        elif action.duration is None:
            action.started()
        else:
            action.succeeded()


def main():
    import rospy
    from diagnostic_msgs.msg import KeyValue
    from rosplan_dispatch_msgs.msg import ActionDispatch, ActionFeedback

    with open(sys.argv[1], encoding="utf-8") as file:
        names = parameters(file.read())
    rospy.init_node("elbowroom", disable_signals=True)
    publisher = rospy.Publisher(TOPICS[0], ActionDispatch, queue_size=1000)

    def publish(number, name, pairs, duration):
        listed = [KeyValue(key=key, value=value) for key, value in pairs]
        now = rospy.get_time()
        publisher.publish(ActionDispatch(
            action_id=number, name=name, parameters=listed, duration=duration, dispatch_time=now,
        ))  # fmt: skip

    constants = {
        value: word
        for word, value in vars(ActionFeedback).items()
        if word.isupper() and isinstance(value, int)
    }
    dispatcher = Dispatcher(publish, names, constants)
    rospy.Subscriber(TOPICS[1], ActionFeedback, dispatcher.feedback)
    begun = rospy.get_time()
    while publisher.get_num_connections() == 0 and rospy.get_time() - begun < 10:
        rospy.sleep(0.1)
    world = World("rosplan", speed=float(os.environ.get("ELBOWROOM_SPEED", "1")))
    world.capabilities = ("facts",)
    world.starter("*")(dispatcher.begin)
    world.run()


if __name__ == "__main__":
    main()
