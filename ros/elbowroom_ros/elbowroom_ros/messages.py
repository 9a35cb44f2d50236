"""Messages of the executive, made from its documents (docs/reference/serve.md)."""

import math

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from elbowroom_msgs.msg import Decision, ExecutiveState, Goal, Guarantee, Quantity, RunningAction

MOST_CLOSED_GOALS = 20
"""Number of closed goals in the state."""
CLOSED = ("achieved", "cancelled", "failed")
WITHOUT_PLAN = ("impossible", "unplanned")
SILENCE = 2.0
"""Time without an answer of the world after which it counts as unresponsive, in seconds."""


def state_message(document, stamp):
    """Returns the state. Without a document, the executive is disconnected."""
    goals = without_oldest_closed(goals_by_age(document))
    return ExecutiveState(
        stamp=stamp,
        time=number(document.get("now"), 0.0),
        activity=document.get("activity", "disconnected"),
        reason=text(document.get("why")),
        world=world_problem(document),
        plans=document.get("plans", 0),
        goals=[goal_message(it) for it in goals],
        running=[running_message(it) for it in document.get("running", {}).values()],
        in_doubt=sorted(document.get("in_doubt", {})),
    )


def without_oldest_closed(goals):
    """Returns the goals, with the latest ones of those that are closed."""
    closed = [index for index, it in enumerate(goals) if it["state"] in CLOSED]
    dropped = set(closed[: max(0, len(closed) - MOST_CLOSED_GOALS)])
    return [it for index, it in enumerate(goals) if index not in dropped]


def goals_by_age(document):
    """Returns the goals, the first given one first. Those that are queued come last."""
    return sorted(document.get("goals", {}).values(), key=lambda it: it.get("given", math.inf))


def goal_message(goal):
    return Goal(
        name=goal["name"],
        goal=goal["goal"],
        value=number(goal.get("value"), 1.0),
        deadline=number(goal.get("deadline")),
        release=number(goal.get("release")),
        keep=goal.get("keep", False),
        given_by=text(goal.get("by")),
        state=goal["state"],
        reason=text(goal.get("why")),
        since=number(goal.get("since")),
    )


def running_message(action):
    return RunningAction(
        ticket=action["ticket"],
        action=action["action"],
        since=number(action.get("since")),
        planned=number(action.get("planned")),
        completion=number(action.get("completion")),
        note=text(action.get("note")),
    )


def guarantee_message(document, stamp):
    guarantee = document.get("guarantee", {})
    quantities = guarantee.get("parameters", {}).values()
    return Guarantee(
        stamp=stamp,
        promise=text(guarantee.get("promise")),
        since=number(guarantee.get("since")),
        deviation=text(guarantee.get("deviation")),
        quantities=[
            Quantity(
                name=it["name"],
                meaning=it["meaning"],
                nominal=number(it.get("nominal")),
                least=number(it.get("least"), -math.inf),
                most=number(it.get("most"), math.inf),
                timeout=number(it.get("timeout")),
            )
            for it in quantities
        ],
    )


def decision_message(document, stamp):
    decision = document.get("next", {})
    step = decision.get("step", {})
    return Decision(
        stamp=stamp,
        decision=text(decision.get("decision")),
        reason=text(decision.get("why")),
        time=number(decision.get("decided")),
        until=number(decision.get("until")),
        next_action=step.get("action", ""),
        next_start=number(step.get("start")),
    )


def world_problem(document):
    """Returns the reason why the world does not answer, or an empty text."""
    if document.get("restarting"):
        return f"restarting: {document['restarting']}"
    silence = number(document.get("unanswered"), 0.0)
    return f"no answer for {silence:.0f} s" if silence >= SILENCE else ""


def diagnostics(document, name):
    """Returns the diagnostics of the executive, its world and its guarantee."""
    return [executive_status(document, name), world_status(document, name), guarantee_status(document, name)]


def executive_status(document, name):
    goals = goals_by_age(document)
    open_goals = [it for it in goals if it["state"] not in CLOSED]
    without_plan = [it for it in goals if it["state"] in WITHOUT_PLAN]
    activity, why = document.get("activity", "disconnected"), text(document.get("why"))
    level, message = DiagnosticStatus.OK, ": ".join(it for it in (activity, why) if it)
    if activity in ("disconnected", "over"):
        level = DiagnosticStatus.ERROR
    elif activity == "paused" or without_plan:
        level = DiagnosticStatus.WARN
    if without_plan:
        message += "; no plan for " + ", ".join(it["name"] for it in without_plan)
    values = {
        "time": f"{number(document.get('now'), 0.0):.3f}",
        "plans": document.get("plans", 0),
        "running": ", ".join(it["action"] for it in document.get("running", {}).values()),
        "open goals": ", ".join(f"{it['name']} ({it['state']})" for it in open_goals),
        "last decision": text(document.get("next", {}).get("why")),
    }
    return status(f"{name}: executive", level, message, values)


def world_status(document, name):
    if "activity" not in document:
        return status(f"{name}: world", DiagnosticStatus.STALE, "unknown", {})
    problem = world_problem(document)
    in_doubt = sorted(document.get("in_doubt", {}))
    level = DiagnosticStatus.ERROR if problem else DiagnosticStatus.WARN if in_doubt else DiagnosticStatus.OK
    message = problem or ("in doubt: " + ", ".join(in_doubt) if in_doubt else "answers")
    return status(f"{name}: world", level, message, {})


def guarantee_status(document, name):
    guarantee = document.get("guarantee", {})
    promise = text(guarantee.get("promise"))
    level = DiagnosticStatus.WARN if promise in ("planned", "luck") else DiagnosticStatus.OK
    values = {"deviation": text(guarantee.get("deviation"))}
    for it in guarantee.get("parameters", {}).values():
        values[it["meaning"]] = f"[{number(it.get('least'), -math.inf):.3f}, {number(it.get('most'), math.inf):.3f}]"
    return status(f"{name}: guarantee", level, promise or "no plan is executed", values)


def status(name, level, message, values):
    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return DiagnosticStatus(level=level, name=name, message=message, hardware_id="", values=pairs)


def number(value, missing=math.nan):
    """Returns a number of a document: without a value `missing`. Very large ones are texts."""
    return missing if value is None else float(value)


def text(value):
    return "" if value is None else str(value)
