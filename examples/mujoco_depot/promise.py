"""The promise of an envelope, checked in the trace of a run.

A plan works as long as each duration stays inside its interval of the envelope, and no action fails.
"""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

OUTSIDE, KEPT, BROKEN = "outside", "kept", "broken"


def promise(trace: list[dict[str, Any]]) -> str:
    """Compares the durations of a run with the envelope of its first plan.

    Returns ``OUTSIDE`` if a duration left its interval or an action failed: nothing was promised then. Otherwise the
    promise is ``KEPT`` if the first plan reached the goal, and ``BROKEN`` if not.
    """
    plans = [entry for entry in trace if entry["event"] == "plan"]
    over = trace[-1]
    if not plans:
        return BROKEN
    replaced = plans[1]["now"] if len(plans) > 1 else math.inf
    intervals = _intervals(plans[0])
    for executed in over["executed"]:
        if executed["start"] < replaced and not _is_inside(executed, intervals[executed["action"]], over["time"]):
            return OUTSIDE
    return KEPT if len(plans) == 1 and over["verdict"] == "goal-reached" else BROKEN


def _intervals(plan: dict[str, Any]) -> dict[str, list[tuple[Any, Any]]]:
    """Intervals of an action's durations, in the order of its starts."""
    found = defaultdict(list)
    by_name = {it["name"]: it["envelope"] for it in plan["parameters"]}
    for number, step in enumerate(plan["steps"]):
        found[step["action"]].append(by_name[f"dur_{number}"])
    return found


def _is_inside(executed: dict[str, Any], intervals: list[tuple[Any, Any]], end: Any) -> bool:
    if not intervals:
        return True  # a repeated action of another plan; the failure before it counts
    lower, upper = intervals.pop(0)
    upper = math.inf if upper is None else upper
    if executed["outcome"] == "succeeded":
        return bool(lower <= executed["duration"] <= upper)
    if executed["outcome"] == "failed":
        return False
    # Cancelled or still running: it took at least as long as until now.
    elapsed = executed["duration"] if executed["duration"] is not None else end - executed["start"]
    return bool(elapsed <= upper)
