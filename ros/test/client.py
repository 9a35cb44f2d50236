"""Client of an executive node, for the scenarios: its topics, services and actions, in a thread of its own."""

import threading

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from elbowroom_msgs.action import AchieveGoal
from elbowroom_msgs.msg import Decision, Event, ExecutiveState, Guarantee
from elbowroom_msgs.srv import CancelGoal, GetState, ReportAction, SetFact, SetNumber, SubmitGoal
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

SERVICES = {
    "pause": Trigger, "resume": Trigger, "stop": Trigger, "get_state": GetState, "submit_goal": SubmitGoal,
    "cancel_goal": CancelGoal, "set_fact": SetFact, "set_number": SetNumber, "report_action": ReportAction,
}  # fmt: skip
TOPICS = {"state": ExecutiveState, "guarantee": Guarantee, "decision": Decision}


class Goal:
    """A goal of the action `achieve_goal`."""

    def __init__(self):
        self.feedback, self.handle, self.result, self.status = [], None, None, None


class Client:
    """The node. `patience` is the time limit of each call in seconds."""

    def __init__(self, domain_id, patience, name="/executive"):
        self._patience = patience
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain_id)
        self.node = rclpy.create_node("client", context=self._context)
        self.latest, self.promises, self.reasons, self.levels, self.raw = {}, [], [], {}, []
        latched = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for topic, kind in TOPICS.items():
            self.node.create_subscription(kind, f"{name}/{topic}", lambda it, topic=topic: self._take(topic, it), latched)
        for topic in ("header", "events"):
            full = f"{name}/{topic}"
            take = lambda it, full=full: self.raw.append((full, it))  # noqa: E731
            self.node.create_subscription(Event, full, take, latched, raw=True)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._diagnose, 10)
        self._clients = {it: self.node.create_client(kind, f"{name}/{it}") for it, kind in SERVICES.items()}
        self._goals = ActionClient(self.node, AchieveGoal, f"{name}/achieve_goal")
        self.clock = self.node.create_publisher(Clock, "/clock", 10)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def close(self):
        self._executor.shutdown()
        rclpy.try_shutdown(context=self._context)
        self._thread.join(timeout=10)

    def _take(self, topic, message):
        self.latest[topic] = message
        if topic == "guarantee":
            self.promises.append(message)
        if topic == "decision":
            self.reasons.append(message.reason)

    def _diagnose(self, array):
        for it in array.status:
            self.levels[it.name] = (it.level[0], it.message)

    def activity(self):
        return self.latest["state"].activity if "state" in self.latest else None

    def call(self, service, **members):
        """Calls a service."""
        client = self._clients[service]
        assert client.wait_for_service(self._patience), f"there is no service {service}"
        done = threading.Event()
        future = client.call_async(SERVICES[service].Request(**members))
        future.add_done_callback(lambda _: done.set())
        assert done.wait(self._patience), f"the service {service} has not answered"
        return future.result()

    def send(self, **members):
        """Sends a goal of the action, and returns it when it is accepted."""
        assert self._goals.wait_for_server(self._patience), "there is no action server"
        goal, accepted = Goal(), threading.Event()

        def answered(future):
            goal.handle = future.result()
            goal.handle.get_result_async().add_done_callback(finished)
            accepted.set()

        def finished(future):
            goal.status, goal.result = future.result().status, future.result().result

        sent = self._goals.send_goal_async(AchieveGoal.Goal(**members), lambda it: goal.feedback.append(it.feedback))
        sent.add_done_callback(answered)
        assert accepted.wait(self._patience), "the goal has not been answered"
        return goal
