"""A client of PlanSys2's planner and executor on real ROS 2, like its terminal and its Python clients.

`client.py DOMAIN PROBLEM [CANCEL_AFTER]` requests a plan and its execution, and prints the answers as a JSON document.
If there is a problem expert, its facts and numbers are requested as soon as the plan has ended.
"""

import json
import sys
import time

import rclpy
from action_msgs.msg import GoalStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from plansys2_msgs.action import ExecutePlan
from plansys2_msgs.msg import ActionExecutionInfo, Plan
from plansys2_msgs.srv import GetOrderedSubGoals, GetPlan, GetStates, ValidateDomain
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile

# Time limit of each wait, in seconds. Only a hanging process reaches it.
PATIENCE = 120
SERVICES = {
    "planner/get_plan": GetPlan,
    "planner/validate_domain": ValidateDomain,
    "planner/get_state": GetState,
    "planner/change_state": ChangeState,
    "executor/get_plan": GetPlan,
    "executor/get_remaining_plan": GetPlan,
    "executor/get_ordered_sub_goals": GetOrderedSubGoals,
    "executor/get_state": GetState,
    "executor/change_state": ChangeState,
}
BEGUN = time.monotonic()
STATUSES = {GoalStatus.STATUS_SUCCEEDED: "succeeded", GoalStatus.STATUS_CANCELED: "canceled",
            GoalStatus.STATUS_ABORTED: "aborted"}  # fmt: skip


def note(what):
    """Logs a completed step with its time, to locate delays."""
    print(f"{time.monotonic() - BEGUN:6.2f} s: {what}", file=sys.stderr, flush=True)


class Client:
    def __init__(self):
        rclpy.init()
        self.node = rclpy.create_node("client")
        # Created at the beginning, as in PlanSys2's terminal. The first request of an undiscovered
        # client takes three seconds.
        self.clients = {name: self.node.create_client(kind, name) for name, kind in SERVICES.items()}
        self.states = [self.node.create_client(GetStates, f"problem_expert/get_problem_{it}")
                       for it in ("predicates", "functions")]  # fmt: skip
        self.executing = ActionClient(self.node, ExecutePlan, "execute_plan")
        self.infos, self.plans = [], []
        self.node.create_subscription(ActionExecutionInfo, "action_execution_info", self.infos.append, 100)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(Plan, "executing_plan", self.plans.append, latched)

    def spin(self, future):
        rclpy.spin_until_future_complete(self.node, future, timeout_sec=PATIENCE)
        assert future.done(), "no answer"
        return future.result()

    def call(self, name, **request):
        client = self.clients[name]
        assert client.wait_for_service(timeout_sec=PATIENCE), f"{name} is not there"
        answer = self.spin(client.call_async(SERVICES[name].Request(**request)))
        note(f"{name} has answered")
        return answer

    def state(self, node):
        return self.call(f"{node}/get_state").current_state.label

    def change(self, node, transition):
        return self.call(f"{node}/change_state", transition=Transition(id=transition)).success

    def executed(self):
        """Returns the executed plan and the remaining plan, or the reason why there is none."""
        answers = [self.call(f"executor/{it}", domain="", problem="") for it in ("get_plan", "get_remaining_plan")]
        return [[it.action for it in told.plan.items] if told.success else told.error_info for told in answers]

    def sub_goals(self):
        """Returns the subgoals in their order, or the reason why there are none."""
        told = self.call("executor/get_ordered_sub_goals")
        return [text(it.nodes, 0) for it in told.sub_goals] if told.success else told.error_info

    def known(self):
        """Returns the facts and numbers of the problem expert, if there is one."""
        if not all(it.service_is_ready() for it in self.states):
            return None
        facts, numbers = (self.spin(it.call_async(GetStates.Request())).states for it in self.states)
        return [sorted(named(it) for it in facts), {named(it): it.value for it in numbers}]

    def execute(self, plan, cancel_after=None):
        """Executes a plan; returns the result and the number of feedback messages."""
        client = self.executing
        assert client.wait_for_server(timeout_sec=PATIENCE), "execute_plan is not there"
        feedback, asked = [], None
        goal = self.spin(client.send_goal_async(
            ExecutePlan.Goal(plan=plan), lambda it: feedback.append(it.feedback.action_execution_status)
        ))  # fmt: skip
        note(f"execute_plan: {'accepted' if goal.accepted else 'rejected'}")
        if not goal.accepted:
            return {"outcome": "rejected"}
        result = goal.get_result_async()
        if cancel_after is not None:
            until = time.monotonic() + cancel_after
            while time.monotonic() < until:
                rclpy.spin_once(self.node, timeout_sec=0.1)
            asked = [*self.executed(), self.sub_goals()]
            assert len(self.spin(goal.cancel_goal_async()).goals_canceling) == 1
        answer = self.spin(result)
        note(f"execute_plan: {STATUSES[answer.status]}")
        infos = answer.result.action_execution_status
        return {
            "outcome": STATUSES[answer.status],
            "success": answer.result.success,
            "feedback": len(feedback),
            "asked": asked,
            "was_executing": any(it.status == it.EXECUTING for told in feedback for it in told),
            "actions": {it.action_full_name: [it.status, it.message_status] for it in infos},
        }


def named(node):
    return " ".join([node.name, *(it.name for it in node.parameters)])


def text(nodes, place):
    """Formats a tree as PDDL."""
    node = nodes[place]
    assert node.node_id == place
    heads = {node.AND: "and", node.OR: "or", node.NOT: "not"}
    if node.node_type not in heads:
        assert node.node_type == node.PREDICATE, node
        return f"({named(node)})"
    return "(" + " ".join([heads[node.node_type], *(text(nodes, it) for it in node.children)]) + ")"


def main():
    client = Client()
    domain, problem = (open(it, encoding="utf-8").read() for it in sys.argv[1:3])
    said = {"before": [client.state("planner"), client.state("executor"), client.execute(Plan())["outcome"]]}
    said["made ready"] = [
        client.change(node, it)
        for node in ("planner", "executor")
        for it in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE)
    ]
    said["then"] = [client.state("planner"), client.state("executor")]
    broken = client.call("planner/get_plan", domain="(define (domain", problem=problem)
    said["broken"] = [broken.success, broken.error_info]
    validated = [client.call("planner/validate_domain", domain=it) for it in (domain, domain[:-9])]
    said["validated"] = [[it.success, it.error_info] for it in validated]
    answer = client.call("planner/get_plan", domain=domain, problem=problem)
    said["planned"] = [answer.success, [it.action for it in answer.plan.items]]
    said["idle"] = [*client.executed(), client.sub_goals()]
    said["executed"] = client.execute(answer.plan, float(sys.argv[3]) if len(sys.argv) > 3 else None)
    said["known"] = client.known()
    said["followed"] = [client.plans == [answer.plan], sorted({it.action_full_name for it in client.infos})]
    there = client.node.get_publishers_info_by_topic("ros_discovery_info", no_mangle=True)
    said["nodes"] = [len(there), client.node.get_node_names()]
    print(json.dumps(said), flush=True)


if __name__ == "__main__":
    main()
