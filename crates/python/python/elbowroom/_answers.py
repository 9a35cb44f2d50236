"""Answers: the results of the methods of a :class:`~elbowroom.Problem`.

Each holds the document that the command prints with ``--json`` (``.document``, described in
``docs/reference/formats``), with its exact numbers as fractions, and has properties for the most important parts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _plots
from ._numbers import Exact, exact, format_inwards, format_number
from ._tables import Table, html_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Step(NamedTuple):
    """An action of a plan."""

    start: Fraction
    """The start time."""
    action: str
    """Its name: ``(drive rover depot shelf)``."""
    duration: Fraction | None
    """The duration; ``None`` for an instantaneous action."""


class Plan(Table):
    """A plan with fixed times.

    Its text (``str(plan)``) is what planners print and validators read.
    """

    def __init__(self, text: str, steps: Sequence[Step], document: dict[str, Any]) -> None:
        self._text = text
        self.steps: list[Step] = list(steps)
        """The actions, by start time."""
        self.document: dict[str, Any] = document
        """The answer of the planner; empty for a plan that no planner returned."""

    @classmethod
    def of(cls, document: dict[str, Any]) -> Plan:
        """The plan in the answer of a planner."""
        steps = [Step(it["start"], it["action"], it["duration"]) for it in document["steps"]]
        return cls(document["plan"], steps, document)

    @property
    def makespan(self) -> Fraction:
        """The end time of the last action."""
        return max((s.start + (s.duration or 0) for s in self.steps), default=Fraction(0))

    @property
    def metric(self) -> Fraction | None:
        """The value of the problem's metric, if it has one and a planner made the plan."""
        metric: Fraction | None = self.document.get("metric")
        return metric

    @property
    def stop(self) -> str | None:
        """The reason for the end of the search: ``"first plan"``, ``"time limit"``, ``"cancelled"``, …"""
        stop: str | None = self.document.get("stop")
        return stop

    def rows(self) -> list[Step]:
        """The actions, by start time."""
        return self.steps

    def _fields(self) -> Sequence[str]:
        return Step._fields

    def __iter__(self) -> Iterator[Step]:
        return iter(self.steps)

    def __len__(self) -> int:
        return len(self.steps)

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return f"<Plan: {len(self.steps)} steps, makespan {format_number(self.makespan)}>"

    def _repr_html_(self) -> str:
        rows = [(format_number(s.start), s.action, format_number(s.duration)) for s in self.steps]
        caption = f"plan, makespan {format_number(self.makespan)}"
        return html_table(("start", "action", "duration"), rows, caption)

    def plot(self, envelope: Envelope | None = None, ax: Axes | None = None) -> Axes:
        """Draws a Gantt chart. With an envelope, each bar has a band: the possible times of its end.

        Raises:
            ImportError: if matplotlib is not installed.
        """
        return _plots.gantt(self, envelope, ax)


class NoPlan:
    """Answer without a plan: none exists, or none was found. It is false in conditions."""

    def __init__(self, document: dict[str, Any]) -> None:
        self.document: dict[str, Any] = document
        """The answer of the planner."""

    @property
    def is_proved(self) -> bool:
        """``True`` if a certificate (``document["certificate"]``) proves that no plan exists; ``False`` if none was found."""
        return bool(self.document["answer"] == "no plan")

    @property
    def reason(self) -> str:
        """The reason why no plan exists, or why none was found."""
        return str(self.document["reason"])

    def __bool__(self) -> bool:
        return False

    def __repr__(self) -> str:
        return f"<NoPlan: {self.reason}>"


class Violation(NamedTuple):
    """The first violation in a plan."""

    time: Fraction
    """The time of the violation."""
    action: str | None
    """The action; ``None`` if the goal does not hold."""
    step: int | None
    """The position of that action in the plan, from 0."""
    message: str
    """The whole description, in words."""


class Margin(NamedTuple):
    """Margin of a comparison of numbers: how close it came to failing."""

    condition: str
    when: str
    action: str | None
    margin: Fraction
    time: Fraction
    strict: bool


class Verdict(Table):
    """Verdict on a plan; true in conditions if the plan is valid."""

    def __init__(self, document: dict[str, Any]) -> None:
        self.document: dict[str, Any] = document
        """The answer as the document that the command prints."""

    @property
    def is_valid(self) -> bool:
        """``True`` if the plan is valid."""
        return bool(self.document["answer"] == "valid")

    @property
    def makespan(self) -> Fraction | None:
        """The end time of the last action, if the plan is valid."""
        makespan: Fraction | None = self.document.get("makespan")
        return makespan

    @property
    def metric(self) -> Fraction | None:
        """The value of the problem's metric, if it has one that can be evaluated."""
        metric: Fraction | None = self.document.get("metric")
        return metric

    @property
    def violation(self) -> Violation | None:
        """The violation, if there is one."""
        found = self.document.get("violation")
        return Violation(**found) if found else None

    @property
    def values(self) -> dict[str, Fraction]:
        """The value of each numeric fluent at the end, if the plan is valid."""
        return {it["fluent"]: it["value"] for it in self.document.get("values", [])}

    def rows(self) -> list[Margin]:
        """The margins of all comparisons."""
        return [Margin(**it) for it in self.document.get("margins", [])]

    def _fields(self) -> Sequence[str]:
        return Margin._fields

    def __bool__(self) -> bool:
        return self.is_valid

    def __repr__(self) -> str:
        if self.violation is None:
            return f"<Verdict: valid, makespan {format_number(self.makespan)}>"
        return f"<Verdict: invalid: {self.violation.message}>"

    def _repr_html_(self) -> str:
        if self.violation is not None:
            violation = self.violation
            row = (format_number(violation.time), violation.action or "", violation.message)
            return html_table(("time", "action", "what is wrong"), [row], "the plan does not work")
        rows = [
            (format_number(m.margin), m.condition, m.when, m.action or "", format_number(m.time))
            for m in sorted(self.rows(), key=lambda m: m.margin)
        ]
        caption = f"the plan works, makespan {format_number(self.makespan)}"
        return html_table(("margin", "condition", "when", "action", "time"), rows, caption)


class Constraint(NamedTuple):
    """``lower <= to - from_ <= upper``."""

    from_: str
    to: str
    lower: Exact | str
    """A fraction, ``-math.inf``, or the name of a parameter."""
    upper: Exact | str
    """A fraction, ``math.inf``, or the name of a parameter."""
    reason: str


class Stn(Table):
    """A plan as a simple temporal network with only the necessary orders and bounds."""

    def __init__(self, document: dict[str, Any], text: str, dot: str) -> None:
        self.document: dict[str, Any] = document
        """The answer as the document that the command prints."""
        self.text: str = text
        """The text as an STN plan file."""
        self.dot: str = dot
        """The text as a graph for Graphviz."""

    @property
    def nodes(self) -> dict[str, str]:
        """The time points: name, and the happening in words."""
        return {node["name"]: node["what"] for node in self.document["nodes"]}

    @property
    def constraints(self) -> list[Constraint]:
        """Bounds on the differences of time points."""

        def bound(value: Any) -> Exact | str:
            if isinstance(value, dict):
                return str(value["parameter"])
            return exact(value)

        return [
            Constraint(c["from"], c["to"], bound(c["lower"]), bound(c["upper"]), c["reason"])
            for c in self.document["constraints"]
        ]

    def rows(self) -> list[Constraint]:
        """The constraints."""
        return self.constraints

    def _fields(self) -> Sequence[str]:
        return Constraint._fields

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        counts = f"{len(self.nodes)} time points, {len(self.constraints)} constraints"
        return f"<Stn: {counts}>"

    def _repr_html_(self) -> str:
        def text(bound: Exact | str) -> str:
            return bound if isinstance(bound, str) else format_number(bound)

        rows = [(text(c.lower), c.to, c.from_, text(c.upper), c.reason) for c in self.constraints]
        return html_table(("at least", "to", "from", "at most", "reason"), rows, "network")


class QuantityInterval(NamedTuple):
    """A quantity with its interval."""

    name: str
    """The name, as in STN plan files."""
    quantity: str
    """The description: ``duration of (drive rover depot shelf)``."""
    kind: str
    """``"duration"``, ``"constant"``, ``"domain"``, ``"initial"``, ``"timed"`` or ``"bound"``."""
    nominal: Fraction
    """The value in the plan."""
    lower: Exact
    """The lower end; exact."""
    upper: Exact
    """The upper end; ``math.inf`` if there is no limit."""
    lower_limit: str | None
    """The constraint that limits the lower end, in words."""
    upper_limit: str | None
    """The constraint that limits the upper end, in words."""
    timeout: Fraction | None
    """The time-out of the action whose duration it is: the plan works as long as the action also
    ends before it. ``None`` if the quantity is not a duration, or if time-outs are off."""


class Envelope(Table):
    """Envelope of a plan: an interval for each quantity, such that the plan works inside them.

    True in conditions if there is an envelope, or if the given box is inside it.
    """

    def __init__(self, document: dict[str, Any], makespans: dict[str, Any] | None) -> None:
        self.document: dict[str, Any] = document
        """The answer as the document that the command prints."""
        self.makespans: dict[str, Exact | None] | None = makespans
        """The end time of the plan with all quantities ``nominal``, ``at_lower`` or ``at_upper``."""

    @property
    def answer(self) -> str:
        """``"envelope"``, ``"fails"``, ``"inside"``, ``"outside"`` or ``"none"``."""
        return str(self.document["answer"])

    @property
    def stop(self) -> str | None:
        """The reason for the end of the search: ``"converged"``, ``"time limit"``, ``"cancelled"``, …"""
        stop: str | None = self.document.get("stop")
        return stop

    @property
    def guarantee(self) -> str:
        """The guarantee inside the envelope: ``"weak"``, ``"dynamic"`` or ``"strong"``."""
        return str(self.document["settings"]["guarantee"])

    @property
    def why_not(self) -> str | None:
        """The reason why the plan fails as planned, or in the given box."""
        if "violation" in self.document:
            return str(self.document["violation"]["message"])
        if "counterexample" in self.document:
            return str(self.document["counterexample"]["message"])
        return None

    @property
    def counterexample(self) -> dict[str, Any] | None:
        """Possible failures, with values and a schedule; ``docs/reference/formats/envelope-json.md``."""
        found: dict[str, Any] | None = self.document.get("counterexample")
        return found

    def rows(self) -> list[QuantityInterval]:
        """Each quantity and its interval."""
        if self.answer not in ("envelope", "inside", "outside"):
            return []
        fields = QuantityInterval._fields
        return [
            QuantityInterval(*(it.get(field) for field in fields))
            for it in self.document["parameters"]
        ]

    def _fields(self) -> Sequence[str]:
        return QuantityInterval._fields

    def __getitem__(self, name: str) -> QuantityInterval:
        for room in self.rows():
            if room.name == name or room.quantity == name:
                return room
        known = ", ".join(room.name for room in self.rows())
        raise KeyError(f"unknown quantity {name!r}; known are {known}")

    def __contains__(self, values: object) -> bool:
        """Returns ``True`` if all values, given by name, lie in their intervals."""
        if not isinstance(values, dict):
            return False
        return all(self[name].lower <= value <= self[name].upper for name, value in values.items())

    def __bool__(self) -> bool:
        return self.answer in ("envelope", "inside")

    def __repr__(self) -> str:
        rooms = ", ".join(
            f"{r.name} in [{format_inwards(r.lower, True)}, {format_inwards(r.upper, False)}]"
            for r in self.rows()
        )
        why = f": {self.why_not}" if self.why_not else ""
        return f"<Envelope: {self.answer}{why}{': ' + rooms if rooms else ''}>"

    def _repr_html_(self) -> str:
        rows = [
            (
                room.name,
                room.quantity,
                format_number(room.nominal),
                format_inwards(room.lower, True),
                format_inwards(room.upper, False),
                room.lower_limit or "",
                room.upper_limit or ("nothing" if room.upper == math.inf else ""),
                "" if room.timeout is None else format_number(room.timeout),
            )
            for room in self.rows()
        ]
        heads = ("name", "quantity", "planned", "from", "to", "lower limit", "upper limit", "time-out")
        why = f": {self.why_not}" if self.why_not else ""
        return html_table(heads, rows, f"{self.answer}, guarantee {self.guarantee}{why}")

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draws each interval as a bar, with the planned value marked.

        Raises:
            ImportError: if matplotlib is not installed.
        """
        return _plots.intervals(self, ax)


class Execution(NamedTuple):
    """An action that was started in a run."""

    start: Fraction
    action: str
    duration: Fraction | None
    """``None`` for an instantaneous action, or one that had not ended."""
    ticket: int
    """The number of the start."""
    outcome: str | None
    """``"succeeded"``, ``"failed"``, ``"cancelled"``, or ``None`` if it had not ended."""


class Run(Table):
    """Result of the execution of a plan; true in conditions if the goal was reached."""

    def __init__(self, document: dict[str, Any], trace: str | None) -> None:
        self.document: dict[str, Any] = document
        """The answer as the document that the command prints."""
        self.trace_text: str | None = trace
        """The trace as JSON Lines, which ``elbowroom run --replay`` replays."""
        self.warnings: list[str] = []
        """Warnings about the clock of a world in Python: it does not advance, jumps, or is set back."""

    @property
    def verdict(self) -> str:
        """``"goal-reached"``, ``"no-plan"``, ``"planner-failed"``, ``"unsolvable-from-here"``, ``"time-limit"``, …"""
        return str(self.document["verdict"])

    @property
    def why(self) -> str | None:
        """A further explanation of the verdict."""
        why: str | None = self.document["why"]
        return why

    @property
    def time(self) -> Fraction:
        """The end time of the run, on the world's clock."""
        time: Fraction = self.document["time"]
        return time

    @property
    def replans(self) -> int:
        """The number of new plans that were made or requested."""
        return int(self.document["replans"])

    @property
    def reasons(self) -> list[str]:
        """The reason for each new plan, in words."""
        return [str(reason["words"]) for reason in self.document["reasons"]]

    def trace(self) -> list[dict[str, Any]]:
        """Returns the entries of the run's record (``docs/reference/formats/trace.md``).

        Raises:
            ValueError: if none was kept (``trace=False``).
        """
        from ._numbers import document

        if self.trace_text is None:
            raise ValueError("the run has no trace; run with trace=True")
        return [document(line) for line in self.trace_text.splitlines()]

    def rows(self) -> list[Execution]:
        """Executed actions."""
        return [
            Execution(*(it.get(field) for field in Execution._fields))
            for it in self.document["executed"]
        ]

    def _fields(self) -> Sequence[str]:
        return Execution._fields

    def __bool__(self) -> bool:
        return self.verdict == "goal-reached"

    def __repr__(self) -> str:
        return f"<Run: {self.verdict} at {format_number(self.time)}, {self.replans} new plans>"

    def _repr_html_(self) -> str:
        rows = [
            (format_number(e.start), e.action, format_number(e.duration), e.outcome or "")
            for e in self.rows()
        ]
        why = f" ({self.why})" if self.why else ""
        caption = f"{self.verdict}{why} at {format_number(self.time)}, {self.replans} new plans"
        return html_table(("start", "action", "took", "outcome"), rows, caption)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draws a Gantt chart of the executed actions.

        Raises:
            ImportError: if matplotlib is not installed.
        """
        return _plots.executed(self, ax)
