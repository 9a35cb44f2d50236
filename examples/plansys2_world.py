#!/usr/bin/env python3
"""A world for `elbowroom run … --world-process "python3 plansys2_world.py"`: the action performers of PlanSys2.

Put `clients/python/elbowroom_world.py` beside this file, and start it where ROS 2 and your `plansys2_msgs` are set up.
PlanSys2's own executor must be off, because two executors would both answer. A second world of Elbowroom does not start
unless `--shared` is given. docs/reference/plansys2.md has the details.

`Hub` implements the protocol on PlanSys2's topic `actions_hub` without ROS, so that it can be tested anywhere. `main`
connects it with rclpy.
"""

import os
import socket
import sys
import threading
import time
import uuid

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "clients", "python"))
from elbowroom_world import World  # noqa: E402

# plansys2_msgs/msg/ActionExecution
REQUEST, RESPONSE, CONFIRM, REJECT, FEEDBACK, FINISH, CANCEL = range(1, 8)
# plansys2_msgs/msg/ActionPerformerStatus
NOT_READY, READY, RUNNING, FAILURE = 0, 1, 2, 4

REQUEST_INTERVAL = 1.0
"""Interval at which unanswered requests are repeated, in seconds. Requests may be lost while nodes discover each
other."""
GIVE_UP_ASKING = 30.0
LOST_AFTER = 5.0
"""Time without a status message after which a performer counts as lost, in seconds. Each performer sends one per
second."""
IDLE_AFTER = 3.0
"""Time for which a performer reports that it is idle before its action counts as failed, in seconds. Such a performer
has not received the order to begin, or its last message was lost."""


class Assignment:
    """An action and the performer that executes it."""

    def __init__(self, action, now):
        self.action, self.key = action, (action.name, tuple(action.arguments))
        self.asked = None
        self.since = now
        self.performer = None
        self.idle = None
        self.cancelled = None


class Hub:
    """The executor's side of `actions_hub`. `send(type, node, action, arguments)` publishes."""

    def __init__(self, send, clock=time.monotonic):
        self._send, self._clock = send, clock
        self._assignments = {}
        self._performers = {}
        self._lock = threading.RLock()

    def begin(self, action):
        """Searches for a performer. Messages do not identify the execution, so the same action cannot be
        executed twice at the same time: the second execution fails."""
        with self._lock:
            assignment = Assignment(action, self._clock())
            there = self._assignments.get(assignment.key)
            if there is None:
                self._assignments[assignment.key] = assignment
                self.tick()
            elif there.cancelled is None:
                action.failed(f"{there.performer or 'a performer'} is still busy with the same action")
            else:
                action.failed(f"{there.performer} has not confirmed that it has stopped the same action")

    def cancel(self, action):
        """Sends a cancellation to the performer. PlanSys2 has no answer to it: the action counts as stopped when the
        performer's status is no longer RUNNING."""
        with self._lock:
            assignment = self._assignments.get((action.name, tuple(action.arguments)))
            if assignment is None or assignment.action is not action or assignment.cancelled is not None:
                return
            if assignment.performer is None:
                del self._assignments[assignment.key]
                action.was_cancelled()
                return
            assignment.cancelled = self._clock()
            self._tell(CANCEL, assignment, assignment.performer)

    def message(self, message):
        """Processes a message on `actions_hub`. The hub also receives its own messages."""
        arguments = tuple(it.lower() for it in message.arguments)
        name = message.action.lower()
        if arguments == (name,):
            arguments = ()  # PlanSys2 2.0 sends an action without arguments as its own argument
        with self._lock:
            assignment, node = self._assignments.get((name, arguments)), message.node_id
            if message.type == RESPONSE:
                if assignment is None or assignment.performer not in (None, node):
                    # Every response needs a confirmation or a rejection, also for abandoned
                    # actions.
                    self._send(REJECT, node, message.action, list(message.arguments))
                elif assignment.performer is None:
                    assignment.performer, assignment.since = node, self._clock()
                    self._tell(CONFIRM, assignment, node)
                    if assignment.action.duration is not None:
                        assignment.action.started()
            elif assignment is None or node != assignment.performer:
                return
            elif message.type == FEEDBACK:
                assignment.since, assignment.idle = self._clock(), None
                if assignment.cancelled is None:
                    assignment.action.feedback(message.completion, message.status)
            elif message.type == FINISH:
                del self._assignments[assignment.key]
                if not message.success:
                    assignment.action.failed(message.status or f"{node} gave no reason")
                elif assignment.action.duration is None:
                    assignment.action.started()
                else:
                    assignment.action.succeeded()

    def status(self, status):
        """Processes a message on `performers_status`."""
        with self._lock:
            now = self._clock()
            self._performers[status.node_name] = now, getattr(status, "action", "")
            for assignment in list(self._assignments.values()):
                if assignment.performer != status.node_name:
                    continue
                if assignment.cancelled is not None:
                    if status.state != RUNNING:
                        del self._assignments[assignment.key]
                        assignment.action.was_cancelled()
                elif status.state == FAILURE:
                    self._lose(assignment, f"{assignment.performer} reports a failure")
                elif status.state == RUNNING:
                    assignment.idle = None
                else:
                    assignment.idle = now if assignment.idle is None else assignment.idle
                    if now - assignment.idle >= IDLE_AFTER:
                        self._lose(assignment, f"{assignment.performer} is idle, and has not reported the outcome")

    def performers(self):
        """Returns the performers that have sent a status recently, each with its action: `robot1 (move)`."""
        with self._lock:
            now = self._clock()
            lately = sorted((name, action) for name, (at, action) in self._performers.items() if now - at <= LOST_AFTER)
            return [f"{name} ({action})" if action else name for name, action in lately]

    def tick(self):
        """Repeats unanswered requests and detects lost performers. Call it a few times per second."""
        with self._lock:
            now = self._clock()
            for assignment in list(self._assignments.values()):
                if assignment.performer is None:
                    if now - assignment.since > GIVE_UP_ASKING:
                        others = ", ".join(self.performers()) or "none"
                        why = f"no performer answered within {GIVE_UP_ASKING:g} s; discovered performers: {others}"
                        self._lose(assignment, why)
                    elif assignment.asked is None or now - assignment.asked >= REQUEST_INTERVAL:
                        assignment.asked = now
                        self._tell(REQUEST, assignment, "elbowroom")
                    continue
                heard, _ = self._performers.get(assignment.performer, (None, ""))
                if heard is not None and now - max(heard, assignment.since) > LOST_AFTER:
                    self._lose(assignment, f"{assignment.performer} is lost: no message from it for {LOST_AFTER:g} s")

    def _lose(self, assignment, why):
        del self._assignments[assignment.key]
        if assignment.performer is not None:
            # The performer may still be running.
            self._tell(CANCEL, assignment, assignment.performer)
        assignment.action.failed(why)

    def _tell(self, kind, assignment, node):
        self._send(kind, node, assignment.action.name, list(assignment.action.arguments))


class Claim:
    """This executor's claim to the performers, on the topic `elbowroom/claims`. `crates/plansys2/src/claim.rs` has the
    rules."""

    STATES = ("waiting", "new", "established")
    PROBATION = 5.0

    def __init__(self, publish, clock=time.monotonic):
        self._publish, self._clock = publish, clock
        self.id = uuid.uuid4().hex
        self._name = f"process {os.getpid()} on {socket.gethostname()}"
        self._held_since, self._last, self._is_released = None, None, False
        self.refusal = None

    def hold(self):
        self._held_since = self._clock()
        self.tick()

    def release(self):
        """Gives up the claim, so that another executor can start at once."""
        self._is_released = True
        self._publish(f"released {self.id} {self._name}")

    def _state(self):
        if self._held_since is None:
            return 0
        return 1 if self._clock() - self._held_since < self.PROBATION else 2

    def tick(self):
        """Publishes the claim if its state has changed."""
        if not self._is_released and self._last != (state := self._state()):
            self._last = state
            self._publish(f"{self.STATES[state]} {self.id} {self._name}")

    def check(self, text):
        """Processes the claim of an executor. Sets `refusal` if that claim has priority."""
        state, _, rest = text.partition(" ")
        other_id, _, name = rest.partition(" ")
        own = self._state()
        if state not in self.STATES or not name or other_id == self.id or own == 2:
            return
        other = self.STATES.index(state)
        if other > own or (other == own and other_id < self.id):
            self.refusal = f"another executor, {name}, uses these performers: stop it, or allow both with --shared"


def main():
    import rclpy
    from plansys2_msgs.msg import ActionExecution, ActionPerformerStatus
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
    from std_msgs.msg import String

    rclpy.init()
    node = rclpy.create_node("elbowroom")
    qos = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
    publisher = node.create_publisher(ActionExecution, "actions_hub", qos)

    def send(kind, who, action, arguments):
        publisher.publish(ActionExecution(type=kind, node_id=who, action=action, arguments=arguments))

    hub = Hub(send)
    node.create_subscription(ActionExecution, "actions_hub", hub.message, qos)
    node.create_subscription(ActionPerformerStatus, "performers_status", hub.status, qos)
    node.create_timer(0.2, hub.tick)
    latched = QoSProfile(
        depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
    )
    claims = node.create_publisher(String, "elbowroom/claims", latched)
    claim = Claim(lambda text: claims.publish(String(data=text)))
    is_shared = "--shared" in sys.argv[1:]
    if not is_shared:
        node.create_subscription(String, "elbowroom/claims", lambda it: claim.check(it.data), latched)
        node.create_timer(0.2, claim.tick)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()

    # The world's time begins when performers are discovered, because earlier requests would be
    # lost.
    patience = float(os.environ.get("ELBOWROOM_PERFORMERS_WITHIN", "10"))
    begun = time.monotonic()
    while not hub.performers() and time.monotonic() - begun < patience:
        time.sleep(0.1)
    # Each performer publishes its status once per second.
    time.sleep(1.2)
    if claim.refusal is None:
        print(f"performers: {', '.join(hub.performers()) or 'none'}", file=sys.stderr)
        if not is_shared:
            claim.hold()
        world = World("plansys2", speed=float(os.environ.get("ELBOWROOM_SPEED", "1")))
        world.starter("*")(hub.begin)
        world.canceller(hub.cancel)
        world.run()
        claim.release()
        # Cancellations need time to reach the performers.
        time.sleep(0.2)
    # Stop the thread of ROS first: Python must not end while it is running.
    executor.shutdown()
    rclpy.try_shutdown()
    spinning.join(timeout=5)
    node.destroy_node()
    if claim.refusal is not None:
        print(f"error: {claim.refusal}", file=sys.stderr)
    # Elbowroom waits a second for the end of this program, and unloading all libraries takes much of it.
    sys.stderr.flush()
    os._exit(0 if claim.refusal is None else 1)


if __name__ == "__main__":
    main()
