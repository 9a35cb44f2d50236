"""Node `executive`: starts `elbowroom serve`, or connects to one, and offers it in ROS 2. docs/reference/ros2.md has the interfaces."""

import os
import queue
import signal
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from elbowroom_msgs.msg import Decision, Event, ExecutiveState, Guarantee
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from .client import Client, Unreachable
from .goal_action import GoalAction
from .messages import decision_message, diagnostics, guarantee_message, state_message
from .server_process import ServerProcess
from .services import Services
from .subscription import Subscription

PARAMETERS = {
    "domain": "", "problem": "", "plan": "", "mapping": "", "world": "", "executor": "live", "journal": "",
    "shared": False, "elbowroom": "elbowroom", "http": "127.0.0.1:0", "restarts": 5, "address": "", "token": "",
}  # fmt: skip
STOP_WITHIN = 9.0
"""Time for `elbowroom serve` to end, in seconds: it cancels running actions, and waits 5 s for them."""
LAST_ANSWERS = 0.5
"""Time for the last answers to clients, in seconds."""
EVENTS_KEPT = 1000
"""Number of lines of the trace for late subscribers."""


class ConfigurationError(Exception):
    """The parameters are not valid."""


class Executive(Node):
    """All callbacks are in the thread of the executor; other threads put functions into a queue."""

    def __init__(self):
        super().__init__("executive")
        for name, value in PARAMETERS.items():
            self.declare_parameter(name, value)
        self.declare_parameter("arguments", Parameter.Type.STRING_ARRAY)
        self.document = {}
        self.exit_code = None
        self._restarts, self._ended_at, self.has_ended = 0, None, False
        self._queue, self._pool = queue.SimpleQueue(), ThreadPoolExecutor(8)
        self._watchers = []
        self._wake = self.create_guard_condition(self._work)
        self._server = None
        # Only the owner can read this folder.
        self._folder = tempfile.TemporaryDirectory(prefix="elbowroom-")
        if not self.option("address"):
            self._server = ServerProcess(self._server_options(), self._folder.name)
            if self._server.is_resumable():
                self.get_logger().info("the run of the journal is resumed, with the options with which it began")
            self._server.start()
            self.client = Client(self._server.socket, self._server.token)
        else:
            self.client = Client(self.option("address"), read_token(self.option("token")))
        self._create_publishers()
        # A callback that waits for the executive delays no other one.
        self.requests = ReentrantCallbackGroup()
        Services(self)
        GoalAction(self)
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(0.2, self._watch_server, clock=clock)
        self.create_timer(1.0, self._beat, clock=clock)
        # Without a document, nothing is published about the executive.
        self._subscription = Subscription(
            self.client,
            lambda document: self.post(lambda: self._take(document)),
            lambda number, line: self.post(lambda: self._publish_line(number, line)),
        )

    def option(self, name):
        return self.get_parameter(name).value

    def _server_options(self):
        options = {name: self.option(name) for name in PARAMETERS}
        options["arguments"] = list(self.get_parameter_or("arguments").value or [])
        if not options["domain"]:
            raise ConfigurationError("the parameter domain is missing; or give the address of a running executive")
        if bool(options["mapping"]) == bool(options["world"]):
            raise ConfigurationError("give one of the parameters mapping and world")
        if options["mapping"]:
            words = [sys.executable, "-m", "elbowroom_ros.action_world", os.path.abspath(options["mapping"])]
            # Goals continue over a restart of the world, and with a journal over one of this node.
            is_kept = bool(options["journal"])
            ledger = os.path.abspath(f"{options['journal']}.goals") if is_kept else os.path.join(self._folder.name, "goals")
            words += ["--ledger", ledger, *([] if is_kept else ["--cancel-at-end"])]
            words += ["--shared"] if options["shared"] else []
            simulated = str(self.option("use_sim_time")).lower()
            words += ["--ros-args", "-p", f"use_sim_time:={simulated}", "-r", f"__ns:={self.get_namespace()}"]
            options["world"] = command_line(words)
        return options

    def _create_publishers(self):
        latched = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        events = QoSProfile(depth=EVENTS_KEPT, reliability=ReliabilityPolicy.RELIABLE,
                            durability=DurabilityPolicy.TRANSIENT_LOCAL)  # fmt: skip
        self._state = self.create_publisher(ExecutiveState, "~/state", latched)
        self._guarantee = self.create_publisher(Guarantee, "~/guarantee", latched)
        self._decision = self.create_publisher(Decision, "~/decision", latched)
        self._header = self.create_publisher(Event, "~/header", latched)
        self._events = self.create_publisher(Event, "~/events", events)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)

    def post(self, function):
        """Has a function called in the thread of the executor; for other threads."""
        self._queue.put(function)
        self._wake.trigger()

    def _work(self):
        while not self._queue.empty():
            self._queue.get()()

    async def ask(self, method, path, body=None):
        """Sends a request to the executive. Returns the status and the document of the answer."""
        future = Future(executor=self.executor)

        def finish(done):
            self.post(lambda: future.set_result(done))

        def send():
            try:
                finish(self.client.request(method, path, body))
            except Unreachable as error:
                finish((503, {"error": str(error)}))

        self._pool.submit(send)
        return await future

    async def next_document(self):
        """Waits for the next state of the executive, or the loss of the connection."""
        future = Future(executor=self.executor)
        self._watchers.append(future)
        await future

    def stamp(self):
        return self.get_clock().now().to_msg()

    def _take(self, document):
        before, self.document = self.document, document or {}
        stamp = self.stamp()
        if {**before, "now": 0} != {**self.document, "now": 0}:
            self._state.publish(state_message(self.document, stamp))
        if before.get("guarantee") != self.document.get("guarantee"):
            self._guarantee.publish(guarantee_message(self.document, stamp))
        if before.get("next") != self.document.get("next"):
            self._decision.publish(decision_message(self.document, stamp))
        self._release_watchers()

    def _release_watchers(self):
        watchers, self._watchers = self._watchers, []
        for watcher in watchers:
            watcher.set_result(None)

    def _publish_line(self, number, line):
        message = Event(number=number, line=line)
        if number == 1:
            self._header.publish(message)
        self._events.publish(message)

    def _beat(self):
        stamp = self.stamp()
        self._state.publish(state_message(self.document, stamp))
        array = DiagnosticArray(status=diagnostics(self.document, self.get_fully_qualified_name().strip("/")))
        array.header.stamp = stamp
        self._diagnostics.publish(array)

    def _watch_server(self):
        if self._server is None or self.has_ended or (code := self._server.exit_code()) is None:
            return
        if code == 0 or not self._server.is_resumable() or self._restarts >= self.option("restarts"):
            self.get_logger().log(f"elbowroom serve has ended with exit code {code}", severity_of(code))
            self.exit_code = 0 if code == 0 else 1
            return
        if self._ended_at is None:
            self._ended_at = time.monotonic()
            self.get_logger().error(f"elbowroom serve has ended with exit code {code}; it is resumed from its journal")
        if time.monotonic() - self._ended_at < 2**self._restarts / 2:
            return
        self._restarts, self._ended_at = self._restarts + 1, None
        self._subscription.restart()
        self._server.start()

    def close(self):
        """Ends the executive in order, if this node has started it. Goals of clients are aborted."""
        if self._server is not None:
            self._server.stop(STOP_WITHIN)
        self._subscription.close()
        self.has_ended = True
        self._release_watchers()
        until = time.monotonic() + LAST_ANSWERS
        while time.monotonic() < until:
            self.executor.spin_once(timeout_sec=0.05)
        self._pool.shutdown(wait=False)
        self._folder.cleanup()


def severity_of(code):
    return rclpy.logging.LoggingSeverity.INFO if code == 0 else rclpy.logging.LoggingSeverity.ERROR


def read_token(path):
    if not path:
        return None
    try:
        with open(path, encoding="utf-8") as file:
            return file.read().strip()
    except OSError as error:
        raise ConfigurationError(f"the parameter token: {error}") from None


def command_line(words):
    """Returns a command line for `--world-process`, which is split at spaces."""
    for it in words:
        if len(it.split()) != 1:
            raise ConfigurationError(f"the path {it!r} must not contain spaces")
    return " ".join(words)


def main():
    """Entry point of the command."""
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    is_interrupted = []
    for it in (signal.SIGINT, signal.SIGTERM):
        signal.signal(it, lambda *_: is_interrupted.append(True))
    try:
        node = Executive()
    except (ConfigurationError, OSError) as error:
        sys.exit(f"error: {error}")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while node.exit_code is None and not is_interrupted:
            executor.spin_once(timeout_sec=0.2)
    finally:
        node.close()
        executor.shutdown()
        rclpy.try_shutdown()
    sys.exit(node.exit_code or 0)


if __name__ == "__main__":
    main()
