"""A world for `elbowroom run|serve … --world-process "action_world MAPPING.yaml"`: the actions of the plan are goals of ROS 2
action servers. docs/reference/ros2.md has the format of the mapping."""

import argparse
import os
import signal
import sys
import threading
import time
import traceback

import rclpy
from elbowroom_world import World
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from std_msgs.msg import String

from .action_goals import ActionGoals
from .mapping import Mapping, MappingError
from .plansys2_world import Claim

DISCOVERY = 1.2
"""Time until other executors are discovered, in seconds."""
GRACE = 5.0
"""Time for cancelled goals to end, in seconds."""


class SimulationClock:
    """The clock of the node, for `use_sim_time`. It continues where it was when the simulation is set back."""

    def __init__(self, node):
        self._node, self._lock = node, threading.Lock()
        self._offset, self._last = 0.0, None

    def __call__(self):
        with self._lock:
            now = self._node.get_clock().now().nanoseconds / 1e9 + self._offset
            if self._last is not None and now < self._last:
                print(f"the simulation was set back by {self._last - now:.3f} s", file=sys.stderr, flush=True)
                self._offset += self._last - now
                now = self._last
            self._last = now
            return now

    def wait(self):
        """Waits for the first message on /clock."""
        begun = time.monotonic()
        while self._node.get_clock().now().nanoseconds == 0:
            if time.monotonic() - begun > 5:
                print("use_sim_time is true: waiting for /clock", file=sys.stderr, flush=True)
                begun = time.monotonic()
            time.sleep(0.02)


def claim_servers(node, is_shared):
    """Returns the claim of this executive to the action servers of its namespace, unless executives may share them."""
    claim_qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    if is_shared:
        return None
    publisher = node.create_publisher(String, "elbowroom/claims", claim_qos)
    claim = Claim(lambda text: publisher.publish(String(data=text)))
    node.create_subscription(String, "elbowroom/claims", lambda it: claim.check(it.data), claim_qos)
    # The time of a simulation may stand still.
    node.create_timer(0.2, claim.tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
    return claim


def make_world(node, options):
    """Returns the world, and the clock of the simulation, if there is one."""
    clock = SimulationClock(node) if node.get_parameter("use_sim_time").value else None
    return World("ros-actions", ledger=options.ledger, clock=clock), clock


def prepare(goals, claim):
    """Waits for the discovery of other executives and of the required servers. Returns the reason why the world cannot
    begin, or `None`."""
    begun = time.monotonic()
    time.sleep(DISCOVERY)
    while (missing := goals.missing_servers()) and time.monotonic() - begun < goals.server_wait:
        time.sleep(0.05)
    if missing:
        return f"no action server {', '.join(missing)} within {goals.server_wait:g} s"
    if claim is not None and claim.refusal is not None:
        return claim.refusal
    if claim is not None:
        claim.hold()
    return None


def main():
    """Entry point of the command."""
    parser = argparse.ArgumentParser(prog="action_world", description=__doc__)
    parser.add_argument("mapping", help="the mapping, a YAML file")
    parser.add_argument("--ledger", help="file of started and ended actions: goals continue after a restart of this program")
    parser.add_argument("--cancel-at-end", action="store_true", help="cancel running goals once Elbowroom has ended")
    parser.add_argument("--shared", action="store_true", help="allow other executives to use the same action servers")
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("elbowroom_world")
    world, clock = make_world(node, options)
    try:
        goals = ActionGoals(node, Mapping.read(options.mapping), world.fact)
    except MappingError as error:
        sys.exit(f"error: {error}")
    world.starter(*goals.actions, resumes=options.ledger is not None)(goals.begin)
    world.canceller(goals.cancel)
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def spin():
        try:
            executor.spin()
        except Exception:
            # Without this thread no goal can be cancelled, so the executive has to know.
            traceback.print_exc()
            os._exit(1)

    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    spinning = threading.Thread(target=spin, daemon=True)
    spinning.start()
    refusal, claim = None, claim_servers(node, options.shared)
    try:
        refusal = prepare(goals, claim)
        if refusal is None:
            if clock is not None:
                clock.wait()
            world.run()
            if options.cancel_at_end:
                goals.cancel_all()
    except SystemExit:
        goals.cancel_all()
        raise
    finally:
        if claim is not None:
            claim.release()
        goals.wait_for_cancelled(GRACE)
        executor.shutdown()
        rclpy.try_shutdown()
        spinning.join(timeout=5)
        # Other nodes are notified of the end.
        node.destroy_node()
    if refusal is not None:
        print(f"error: {refusal}", file=sys.stderr)
    # Elbowroom waits a second for the end of this program, and unloading all libraries takes much of it.
    sys.stderr.flush()
    os._exit(0 if refusal is None else 1)


if __name__ == "__main__":
    main()
