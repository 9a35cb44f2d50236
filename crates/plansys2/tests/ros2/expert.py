"""A problem expert on real ROS 2, with the part of PlanSys2's that a run needs: reads and changes of facts and numbers.

`expert.py '{"facts": ["at r1 shed"], "numbers": {"trips r1": 0}}' LOG` runs until it is stopped. LOG gets a line of JSON
for each change, with the complete state after it. Optional members:

    refuses    a fact that it rejects
    then       changes by another client as soon as `when` has happened: {"when": "add at r2 gate", "then": ["add at r2 barn"]}
    mute       it exists, but never answers
"""

import json
import sys
import time

import rclpy
from plansys2_msgs.msg import Node, Param
from plansys2_msgs.srv import AffectNode, GetStates
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import QoSProfile
from std_msgs.msg import Empty


CHANGES = ("add_problem_predicate", "remove_problem_predicate", "add_problem_function", "update_problem_function",
           "remove_problem_function")  # fmt: skip
PREDICATE, FUNCTION = 5, 6


class Knowledge:
    """State of the problem expert; `notify` publishes changes."""

    def __init__(self, spec, log, notify):
        self.spec, self.log, self.notify = spec, log, notify
        self.facts, self.numbers = set(spec["facts"]), dict(spec.get("numbers", {}))
        self.then = list(spec.get("then", []))

    def affect(self, name, node):
        """Applies a change; returns `True` if it was accepted."""
        word = " ".join([node.name, *(it.name for it in node.parameters)])
        what = name.split("_")[0]
        is_fact = name.endswith("predicate")
        is_wrong = word == self.spec.get("refuses") or (what == "update" and word not in self.numbers)
        if is_wrong or node.node_type != (PREDICATE if is_fact else FUNCTION):
            return False
        told = f"{what} {word}" if is_fact or what == "remove" else f"{what} {word} {node.value:g}"
        self.change(told, is_fact, "the run")
        if self.then and self.then[0]["when"] == told:
            for it in self.then.pop(0)["then"]:
                self.change(it, not it.startswith("update"), "somebody else")
        return True

    def change(self, told, is_fact, who):
        what, word = told.split(" ", 1)
        if is_fact:
            (self.facts.add if what == "add" else self.facts.discard)(word)
        elif what == "remove":
            self.numbers.pop(word, None)
        else:
            word, value = word.rsplit(" ", 1)
            self.numbers[word] = float(value)
        line = {"who": who, "told": told, "facts": sorted(self.facts), "numbers": self.numbers}
        self.log.write(json.dumps(line) + "\n")
        self.log.flush()
        self.notify()


class Expert:
    def __init__(self, spec, log):
        self.spec = spec
        self.node = rclpy.create_node("problem_expert")
        notify = self.node.create_publisher(Empty, "problem_expert/update_notify", QoSProfile(depth=100))
        self.knowledge = Knowledge(spec, log, lambda: notify.publish(Empty()))
        for name in ("predicates", "functions"):
            self.serve(GetStates, f"get_problem_{name}", getattr(self, name))
        for name in CHANGES:
            self.serve(AffectNode, name, lambda request, answer, name=name: self.affect(name, request, answer))

    def serve(self, kind, name, answered):
        def answer(request, response):
            while self.spec.get("mute") and rclpy.ok():
                time.sleep(1)
            return answered(request, response)

        self.node.create_service(kind, f"problem_expert/{name}", answer)

    def predicates(self, request, answer):
        answer.success, answer.states = True, [node(it, PREDICATE) for it in sorted(self.knowledge.facts)]
        return answer

    def functions(self, request, answer):
        answer.success = True
        answer.states = [node(it, FUNCTION, value) for it, value in sorted(self.knowledge.numbers.items())]
        return answer

    def affect(self, name, request, answer):
        answer.success = self.knowledge.affect(name, request.node)
        answer.error_info = "" if answer.success else "it is not valid"
        return answer


def node(words, kind, value=0.0):
    name, *parameters = words.split()
    return Node(node_type=kind, name=name, parameters=[Param(name=it) for it in parameters], value=float(value))


def main():
    rclpy.init()
    executor = SingleThreadedExecutor()
    with open(sys.argv[2], "w", encoding="utf-8") as log:
        executor.add_node(Expert(json.loads(sys.argv[1]), log).node)
        try:
            executor.spin()
        except (KeyboardInterrupt, ExternalShutdownException):
            pass


if __name__ == "__main__":
    main()
