"""Action performers on real ROS 2, like those of PlanSys2: they answer requests while idle, work after a confirmation, and
publish their status every second.

`performers.py '{"driver": {"action": "move", "lasts": 2}}' LOG` runs until it is stopped. LOG gets a line of JSON with the
time for each message that a performer receives and each of its steps. Optional members of a performer:

    lasts      seconds of work
    only       the first argument that it accepts; requests with other arguments are ignored
    fails      the action ends with this text instead of success
    repeats    number of FINISH messages
    dies       it sends no messages from this number of seconds after its start on
    deaf       it ignores cancellations
    mute       it never sends FINISH
"""

import json
import sys
import time

import rclpy
from plansys2_msgs.msg import ActionExecution as Message
from plansys2_msgs.msg import ActionPerformerStatus as Status
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy


class Performer:
    def __init__(self, name, spec, log):
        self.name, self.spec, self.log = name, spec, log
        self.node = rclpy.create_node(name)
        qos = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
        self.hub = self.node.create_publisher(Message, "actions_hub", qos)
        self.node.create_subscription(Message, "actions_hub", self.heard, qos)
        self.status = self.node.create_publisher(Status, "performers_status", qos)
        self.node.create_timer(1.0, self.beat)
        self.node.create_timer(0.1, self.work)
        self.is_dead = False
        self.promised = None  # an action for which it waits for a word
        self.doing = None
        self.begun = 0.0

    def beat(self):
        if self.is_dead:
            return
        status = Status(node_name=self.name, action=self.spec["action"])
        status.status_stamp = self.node.get_clock().now().to_msg()
        status.state = Status.READY if self.doing is None else Status.RUNNING
        self.status.publish(status)

    def heard(self, message):
        what = (message.action, tuple(message.arguments))
        if self.is_dead:
            return
        if message.type == Message.REQUEST:
            only = self.spec.get("only")
            fits = message.action == self.spec["action"] and only in (None, message.arguments[0])
            if fits and self.doing is None and self.promised is None:
                self.promised = what
                self.say(Message.RESPONSE, what)
        elif message.node_id != self.name:
            return
        elif message.type == Message.CONFIRM and self.promised == what:
            self.promised, self.doing, self.begun = None, what, time.monotonic()
            self.note("begins", what)
            self.beat()
        elif message.type == Message.REJECT:
            self.promised = None
            self.note("rejected", what)
        elif message.type == Message.CANCEL:
            self.note("told to cancel", what)
            if not self.spec.get("deaf"):
                self.promised = self.doing = None

    def work(self):
        if self.doing is None or self.is_dead:
            return
        for_so_long, what = time.monotonic() - self.begun, self.doing
        if for_so_long >= self.spec.get("dies", 1e9):
            self.is_dead = True
            self.note("dies", what)
        elif for_so_long >= self.spec["lasts"] and not self.spec.get("mute"):
            self.doing = None
            self.note("ends", what)
            for _ in range(self.spec.get("repeats", 1)):
                self.say(Message.FINISH, what, success="fails" not in self.spec, completion=1.0,
                         status=self.spec.get("fails", ""))  # fmt: skip
        else:
            self.say(Message.FEEDBACK, what, completion=min(1.0, for_so_long / self.spec["lasts"]), status="at it")

    def say(self, kind, what, **more):
        self.hub.publish(Message(type=kind, node_id=self.name, action=what[0], arguments=list(what[1]), **more))

    def note(self, event, what):
        action = "(" + " ".join([what[0], *what[1]]) + ")"
        line = {"performer": self.name, "event": event, "action": action, "at": time.monotonic()}
        self.log.write(json.dumps(line) + "\n")
        self.log.flush()


def main():
    rclpy.init()
    executor = SingleThreadedExecutor()
    with open(sys.argv[2], "w", encoding="utf-8") as log:
        for name, spec in json.loads(sys.argv[1]).items():
            executor.add_node(Performer(name, spec, log).node)
        try:
            executor.spin()
        except (KeyboardInterrupt, ExternalShutdownException):
            pass


if __name__ == "__main__":
    main()
