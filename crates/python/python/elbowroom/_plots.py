"""Pictures, with matplotlib."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ._answers import Envelope, Plan, Run
    from ._odds import Odds
    from .campaign import Comparison

_BAR = "#4878a8"
_BAND = "#b8d4ee"
_COLOURS = {"succeeded": _BAR, "failed": "#c0504d", "cancelled": "#999999", None: "#d9a441"}


def axes(ax: Axes | None, rows: int) -> Axes:
    """Returns the given axes, or new ones with ``rows`` rows."""
    if ax is not None:
        return ax
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise ImportError("plot() needs matplotlib: `pip install matplotlib`") from error
    _, made = plt.subplots(figsize=(8, 1.2 + 0.38 * rows), layout="constrained")
    return made


def _lanes(ax: Axes, labels: list[str], unit: str) -> Axes:
    ax.set_yticks(range(len(labels)), labels)
    ax.invert_yaxis()
    ax.set_xlabel(unit)
    ax.grid(axis="x", alpha=0.3)
    ax.spines[["top", "right"]].set_visible(False)
    return ax


def gantt(plan: Plan, envelope: Envelope | None, ax: Axes | None) -> Axes:
    """Draws a lane for each action. Its band contains the possible times of its end, if it starts as planned.

    A band that is longer than three times the makespan is cut there and marked.
    """
    ax = axes(ax, len(plan.steps))
    rooms: dict[str, list[Any]] = {}
    for room in envelope.rows() if envelope is not None else ():
        if room.kind == "duration":
            rooms.setdefault(room.quantity.removeprefix("duration of "), []).append(room)
    last = float(plan.makespan) or 1.0
    for lane, step in enumerate(plan.steps):
        start, duration = float(step.start), float(step.duration or 0)
        if rooms.get(step.action):
            room = rooms[step.action].pop(0)
            earliest, latest = start + float(room.lower), start + float(room.upper)
            end = min(latest, 3 * last)
            ax.barh(lane, end - earliest, left=earliest, height=0.8, color=_BAND)
            if end < latest:
                words = "no limit" if latest == math.inf else f"to {latest:g}"
                ax.annotate(words, (end, lane), ha="right", va="center", fontsize=8)
        ax.barh(lane, duration or last / 200, left=start, height=0.4, color=_BAR)
    return _lanes(ax, [step.action for step in plan.steps], "time")


def intervals(envelope: Envelope, ax: Axes | None) -> Axes:
    """Draws a lane for each quantity: its interval, and the planned value."""
    rooms = envelope.rows()
    ax = axes(ax, len(rooms))
    finite = [float(room.upper) for room in rooms if room.upper != math.inf]
    most = 1.2 * max([*finite, *(float(room.nominal) for room in rooms)], default=1.0)
    for lane, room in enumerate(rooms):
        lower, upper = float(room.lower), min(float(room.upper), most)
        ax.barh(lane, upper - lower, left=lower, height=0.5, color=_BAND)
        ax.plot([float(room.nominal)] * 2, [lane - 0.25, lane + 0.25], color=_BAR, linewidth=2)
        if room.upper == math.inf:
            ax.annotate("no limit", (most, lane), ha="right", va="center", fontsize=8)
    return _lanes(ax, [room.quantity for room in rooms], "value")


def executed(run: Run, ax: Axes | None) -> Axes:
    """Draws a lane for each start, coloured by its outcome."""
    rows = run.rows()
    ax = axes(ax, len(rows))
    last = float(run.time) or 1.0
    for lane, row in enumerate(rows):
        length = float(row.duration) if row.duration is not None else last / 200
        ax.barh(lane, length, left=float(row.start), height=0.5, color=_COLOURS.get(row.outcome))
    ax.set_title(f"{run.verdict} at {float(run.time):g}")
    return _lanes(ax, [row.action for row in rows], "time")


def success_lanes(odds: Odds, ax: Axes | None) -> Axes:
    """Draws a lane for each happening: the probability that everything has succeeded so far."""
    happenings = odds.happenings
    ax = axes(ax, len(happenings) + 1)
    lanes = range(len(happenings) + 1)
    shares = [*(it.probability_so_far for it in happenings), odds.probability]
    ax.barh(lanes, [100 * share for share in shares], 0.6, color=_BAR)
    ax.set_xlim(0, 100)
    labels = [*(it.what for it in happenings), "the goal"]
    return _lanes(ax, labels, "no failure so far, %")


def rates(comparison: Comparison, ax: Axes | None) -> Axes:
    """Draws the success rate of each executor, by column."""
    rows = comparison.rows()
    names = list(dict.fromkeys(row.row for row in rows))
    columns = list(dict.fromkeys(row.column for row in rows))
    ax = axes(ax, len(names) + len(rows) // 4)
    height = 0.8 / max(len(columns), 1)
    for index, column in enumerate(columns):
        shares = {row.row: row.successes / max(row.runs, 1) for row in rows if row.column == column}
        lanes = [lane + (index - (len(columns) - 1) / 2) * height for lane in range(len(names))]
        ax.barh(lanes, [100 * shares.get(name, 0.0) for name in names], height, label=column)
    ax.legend(fontsize=8)
    ax.set_xlim(0, 100)
    return _lanes(ax, names, "runs that reached the goal, %")
