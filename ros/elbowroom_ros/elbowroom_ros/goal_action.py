"""Action `achieve_goal` of the executive node."""

from elbowroom_msgs.action import AchieveGoal
from rclpy.action import ActionServer, CancelResponse

from .messages import CLOSED, WITHOUT_PLAN, goal_message, number, text
from .services import goal_body, goal_path, outcome


class GoalAction:
    """Each goal of the action is one of the executive, until the executive closes it."""

    def __init__(self, node):
        self._node = node
        ActionServer(
            node, AchieveGoal, "~/achieve_goal", self._execute, cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=node.requests,
        )  # fmt: skip

    async def _execute(self, handle):
        node = self._node
        earlier, now = set(node.document.get("goals", {})), number(node.document.get("now"), 0.0)
        status, answer = await node.ask("POST", "/v1/goals", goal_body(handle.request, node))
        is_accepted, why = outcome(status, answer)
        if not is_accepted:
            handle.abort()
            return AchieveGoal.Result(name=handle.request.name, state="rejected", reason=why)
        name, is_withdrawn, last = answer["name"], False, None
        while True:
            if not node.has_ended:
                await node.next_document()
            if handle.is_cancel_requested and not is_withdrawn:
                is_withdrawn = True
                await node.ask("DELETE", goal_path(name))
            goal = self._find(name, earlier, now)
            if goal is not None and goal["state"] in WITHOUT_PLAN and not is_withdrawn:
                # An aborted goal is not pursued any longer.
                await node.ask("DELETE", goal_path(name))
                return self._finish(handle, goal)
            if goal is not None and goal["state"] in CLOSED:
                return self._finish(handle, goal)
            if node.has_ended:
                return self._finish(handle, {"name": name, "state": "failed", "why": "the executive has ended"})
            if goal is not None and (feedback := self._feedback(goal)) != last:
                last = feedback
                handle.publish_feedback(feedback)

    def _find(self, name, earlier, since):
        """Returns the goal with this name that was given last, after the request."""
        for key, goal in self._node.document.get("goals", {}).items():
            if goal["name"] == name and key not in earlier and goal.get("given", since) >= since:
                return goal
        return None

    def _feedback(self, goal):
        document = self._node.document
        return AchieveGoal.Feedback(
            goal=goal_message(goal),
            activity=document.get("activity", ""),
            running=[it["action"] for it in document.get("running", {}).values()],
            decision=text(document.get("next", {}).get("why")),
        )

    def _finish(self, handle, goal):
        state = goal["state"]
        if state == "achieved":
            handle.succeed()
        elif state == "cancelled" and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        time = number(goal.get("since"), number(self._node.document.get("now"), 0.0))
        reason = text(goal.get("why")) or text(self._node.document.get("why") if state in WITHOUT_PLAN else None)
        return AchieveGoal.Result(name=goal["name"], state=state, reason=reason, time=time)
