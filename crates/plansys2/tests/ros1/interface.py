"""An action interface on real ROS 1, like those of ROSPlan: receives dispatched actions and reports their status.

`interface.py NAME '{"action": "move", "lasts": 2}' LOG` runs until it is stopped. LOG gets a line of JSON with the time
for each received message and each step of an action. Optional members:

    lasts      seconds of work
    only       the value of its first parameter; actions with other values are ignored
    fails      the action fails, with this text as the reason
    refuses    reports a false precondition and does not start (only newer messages have a status for this)
    repeats    number of reports of the end
"""

import json
import sys
import threading
import time

import rospy
from diagnostic_msgs.msg import KeyValue
from rosplan_dispatch_msgs.msg import ActionDispatch, ActionFeedback

TEXTS = {"enabled": "action enabled", "achieved": "action achieved", "failed": "action failed"}
NUMBERS = {"enabled": "ACTION_ENABLED", "achieved": "ACTION_SUCCEEDED_TO_GOAL_STATE", "failed": "ACTION_FAILED",
           "refused": "ACTION_PRECONDITION_FALSE"}  # fmt: skip


class Interface:
    def __init__(self, name, spec, log):
        self.name, self.spec, self.log = name, spec, log
        rospy.init_node(name)
        # Late subscribers receive the last message, as from ROSPlan's own interfaces.
        topics = "/rosplan_plan_dispatcher/action_dispatch", "/rosplan_plan_dispatcher/action_feedback"
        self.says = rospy.Publisher(topics[1], ActionFeedback, queue_size=10, latch=True)
        rospy.Subscriber(topics[0], ActionDispatch, self.hear, queue_size=1000)

    def hear(self, message):
        values = [it.value for it in message.parameters]
        if message.name != self.spec["action"] or self.spec.get("only", values[0]) != values[0]:
            return
        threading.Thread(target=self.work, args=(message,), daemon=True).start()

    def work(self, message):
        if "refuses" in self.spec:
            self.note("refuses", message)
            return self.say(message, "refused", why=self.spec["refuses"])
        self.note("begins", message)
        self.say(message, "enabled")
        time.sleep(self.spec["lasts"])
        self.note("ends", message)
        for _ in range(self.spec.get("repeats", 1)):
            if "fails" in self.spec:
                self.say(message, "failed", why=self.spec["fails"])
            else:
                self.say(message, "achieved")

    def say(self, message, word, **why):
        status = getattr(ActionFeedback, NUMBERS[word]) if hasattr(ActionFeedback, "ACTION_FAILED") else TEXTS[word]
        listed = [KeyValue(key=key, value=value) for key, value in why.items()]
        self.says.publish(ActionFeedback(action_id=message.action_id, status=status, information=listed))

    def note(self, event, message):
        action = "(" + " ".join([message.name, *(it.value for it in message.parameters)]) + ")"
        keys = [it.key for it in message.parameters]
        line = {"interface": self.name, "event": event, "action": action, "keys": keys,
                "duration": message.duration, "id": message.action_id, "at": time.monotonic()}  # fmt: skip
        self.log.write(json.dumps(line) + "\n")
        self.log.flush()


def main():
    with open(sys.argv[3], "a", encoding="utf-8") as log:
        interface = Interface(sys.argv[1], json.loads(sys.argv[2]), log)
        rospy.spin()
    del interface


if __name__ == "__main__":
    main()
