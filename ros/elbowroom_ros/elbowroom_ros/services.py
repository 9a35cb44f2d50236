"""Services of the executive node."""

from urllib.parse import quote

from elbowroom_msgs.srv import CancelGoal, GetState, ReportAction, SetFact, SetNumber, SubmitGoal
from std_srvs.srv import Trigger

from .messages import decision_message, guarantee_message, state_message


class Services:
    """Services that change the executive or return its state."""

    def __init__(self, node):
        self._node = node
        served = {
            "pause": (Trigger, self._trigger("/v1/pause")),
            "resume": (Trigger, self._trigger("/v1/resume")),
            "stop": (Trigger, self._trigger("/v1/stop")),
            "get_state": (GetState, self._get_state),
            "submit_goal": (SubmitGoal, self._submit_goal),
            "cancel_goal": (CancelGoal, self._cancel_goal),
            "set_fact": (SetFact, self._set_fact),
            "set_number": (SetNumber, self._set_number),
            "report_action": (ReportAction, self._report_action),
        }
        for name, (kind, serve) in served.items():
            node.create_service(kind, f"~/{name}", serve, callback_group=node.requests)

    async def _change(self, response, method, path, body=None):
        status, answer = await self._node.ask(method, path, body)
        response.success, response.message = outcome(status, answer)
        return response

    def _trigger(self, path):
        async def serve(_, response):
            return await self._change(response, "POST", path)

        return serve

    def _get_state(self, _, response):
        document, stamp = self._node.document, self._node.stamp()
        response.state = state_message(document, stamp)
        response.guarantee = guarantee_message(document, stamp)
        response.decision = decision_message(document, stamp)
        return response

    async def _submit_goal(self, request, response):
        status, answer = await self._node.ask("POST", "/v1/goals", goal_body(request, self._node))
        response.success, response.message = outcome(status, answer)
        response.name = answer.get("name", "")
        return response

    async def _cancel_goal(self, request, response):
        return await self._change(response, "DELETE", goal_path(request.name))

    async def _set_fact(self, request, response):
        return await self._change(response, "POST", "/v1/facts", {"fact": request.fact, "becomes": request.becomes})

    async def _set_number(self, request, response):
        return await self._change(response, "POST", "/v1/numbers", {"fluent": request.fluent, "value": request.value})

    async def _report_action(self, request, response):
        body = {"ticket": request.ticket, "becomes": request.becomes}
        return await self._change(response, "POST", "/v1/actions", body)


def outcome(status, answer):
    """Returns whether a request is accepted, and the message for the client."""
    if status in (200, 202):
        return True, f"pending until {answer['until']}" if answer.get("until") else ""
    return False, ": ".join(it for it in (answer.get("error"), answer.get("help")) if it) or f"status {status}"


def goal_path(name):
    return f"/v1/goals/{quote(name, safe='')}"


def goal_body(request, node):
    """Returns the body of `POST /v1/goals` for a request with the members of AchieveGoal."""
    body = {"goal": request.goal, "by": node.get_fully_qualified_name().strip("/")}
    body.update({"name": request.name} if request.name else {})
    for member in ("value", "within", "after"):
        # Values that are not numbers are refused by the executive.
        value = getattr(request, member)
        body.update({member: value if value == value and abs(value) != float("inf") else str(value)} if value else {})
    body.update({"keep": True} if request.keep else {})
    return body
