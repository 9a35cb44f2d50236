"""Action servers of Nav2's interface NavigateToPose: robots that only wait.

`fleet.py '{"r1": {"lasts": 2}}' LOG` runs until it is stopped. LOG gets a line of JSON for each goal that a robot receives,
begins, ends, or is asked to cancel. Optional members of a robot:

    lasts      seconds of each drive (1), of the node's clock
    fails      the drive is aborted at its end with this text
    error      the drive succeeds with this error code
    rejects    goals are rejected
    stubborn   cancellations are rejected
"""

import json
import sys
import threading
import time

import rclpy
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor


class Robot:
    def __init__(self, node, name, spec, log):
        self.node, self.name, self.spec, self.log = node, name, spec, log
        ActionServer(
            node, NavigateToPose, f"/{name}/navigate_to_pose", self.drive, goal_callback=self.accept,
            cancel_callback=self.cancel, callback_group=ReentrantCallbackGroup(),
        )  # fmt: skip

    def accept(self, goal):
        at = goal.pose.pose.position
        self.log(self.name, "received", frame=goal.pose.header.frame_id, to=[at.x, at.y], turn=goal.pose.pose.orientation.z)
        return GoalResponse.REJECT if self.spec.get("rejects") else GoalResponse.ACCEPT

    def cancel(self, _):
        self.log(self.name, "cancel")
        return CancelResponse.REJECT if self.spec.get("stubborn") else CancelResponse.ACCEPT

    def now(self):
        return self.node.get_clock().now().nanoseconds / 1e9

    def drive(self, handle):
        self.log(self.name, "begins")
        begun, lasts = self.now(), self.spec.get("lasts", 1)
        while (passed := self.now() - begun) < lasts:
            handle.publish_feedback(NavigateToPose.Feedback(distance_remaining=10.0 * (1 - passed / lasts)))
            time.sleep(0.05)
            if handle.is_cancel_requested:
                handle.canceled()
                self.log(self.name, "cancelled")
                return NavigateToPose.Result()
        self.log(self.name, "ends")
        if "fails" in self.spec:
            handle.abort()
            return NavigateToPose.Result(error_code=101, error_msg=self.spec["fails"])
        handle.succeed()
        return NavigateToPose.Result(error_code=self.spec.get("error", 0))


def main():
    rclpy.init(args=sys.argv)
    node = rclpy.create_node("fleet")
    with open(sys.argv[2], "a", encoding="utf-8") as file:
        lock = threading.Lock()

        def log(robot, event, **more):
            with lock:
                print(json.dumps({"robot": robot, "event": event, "at": time.time(), **more}), file=file, flush=True)

        # The node does not keep its action servers alive.
        robots = [Robot(node, name, spec, log) for name, spec in json.loads(sys.argv[1]).items()]
        executor = MultiThreadedExecutor(4 + 2 * len(robots))
        executor.add_node(node)
        try:
            executor.spin()
        except (KeyboardInterrupt, ExternalShutdownException):
            pass


if __name__ == "__main__":
    main()
