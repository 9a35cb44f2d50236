"""Success probability of a plan: the result of :meth:`elbowroom.Problem.odds`."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _plots
from ._tables import Table, html_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Loss(NamedTuple):
    """Share of all worlds that is lost at one place. All losses and the probability add up to 1."""

    at: str
    """The happening, in words; ``"the beginning"`` before the first."""
    reason: str
    """``"start"`` (the attempt fails), ``"condition"``, ``"throughout"`` or ``"goal"``."""
    condition: str | None
    """The condition that does not hold; ``None`` for a start that fails."""
    since: str | None
    """The happening that last had an effect on it; ``None``: the initial state."""
    action: str | None
    """With ``"throughout"``: the running action that needs the condition."""
    mass: float
    """The share."""


class Happening(NamedTuple):
    """A start or an end of an action, an instantaneous action, or a timed initial."""

    kind: str
    """``"start"``, ``"end"``, ``"instant"`` or ``"timed"``."""
    action: str | None
    """The action; ``None`` for a timed initial."""
    what: str
    """The description in words."""
    earliest: Fraction | None
    """The earliest time; ``None`` where there is no time for the order."""
    latest: Fraction | None
    """The latest time; ``None`` where there is no bound, or no time for the order."""
    probability_so_far: float
    """The probability that everything up to here succeeds."""


class ActionShare(NamedTuple):
    """Contribution of an action to an order."""

    action: str
    """Its name."""
    happening: int
    """The position of its start in the order, from 0."""
    if_certain: float
    """The probability if it never failed."""
    if_retried: float | None
    """The probability if failed attempts to start it were repeated; ``None`` if the computation would take too long."""
    if_done_again: float | None
    """The probability if it were started again at once whenever its end fails; ``None`` if its end does not
    fail, if a failure has several possible outcomes, or if the computation would take too long."""


class FactShare(NamedTuple):
    """Contribution of a fact that may change spontaneously."""

    fact: str
    """Its name."""
    if_steady: float
    """The probability if it never changed spontaneously."""


class Sampled(NamedTuple):
    """Results of executing the plan in samples of a world."""

    executor: str
    """The executor."""
    replans: bool
    """``True`` if new plans were allowed."""
    samples: int
    """The number of samples."""
    reached: int
    """The number of samples that reached the goal."""
    interval: tuple[float, float] | None
    """Wilson's 95 % interval of the probability."""


class Odds(Table):
    """Success probability of a plan; true in conditions if it is positive.

    Its rows are the losses: the places and reasons of the lost probability.
    """

    def __init__(self, document: dict[str, Any], lattice_svg: str | None) -> None:
        self.document: dict[str, Any] = document
        """The answer as the document that the command prints (``docs/reference/formats/odds-json.md``)."""
        self.lattice_svg: str | None = lattice_svg
        """The picture of all orders, if it was requested and there are not too many."""

    @property
    def answer(self) -> str:
        """``"odds"``, ``"no order"``, ``"no plan"``, ``"none"`` or ``"invalid"``."""
        return str(self.document["answer"])

    @property
    def why_not(self) -> str | None:
        """The reason for a missing probability."""
        if "violation" in self.document:
            return str(self.document["violation"]["message"])
        reason: str | None = self.document.get("reason")
        return reason

    @property
    def _order(self) -> dict[str, Any]:
        order: dict[str, Any] = self.document.get("order", {})
        return order

    @property
    def probability(self) -> float:
        """P(A and G): all actions succeed, and the goal holds after them; 0 without an order."""
        return float(self._order.get("probability", 0.0))

    @property
    def actions_probability(self) -> float:
        """P(A): all actions succeed; 0 without an order."""
        return float(self._order.get("actions_probability", 0.0))

    @property
    def is_best(self) -> bool:
        """``True`` if the answer is about the likeliest order found, ``False`` if about the order of the plan's times."""
        return bool(self._order.get("is_best"))

    @property
    def is_proven(self) -> bool | None:
        """``True`` if no order of the plan is likelier; ``None`` if this was not requested."""
        proven: bool | None = self._order.get("is_proven")
        return proven

    @property
    def happenings(self) -> list[Happening]:
        """The happenings, in the order in which they are executed."""
        return [
            Happening(*(it.get(field) for field in Happening._fields))
            for it in self._order.get("happenings", [])
        ]

    @property
    def actions(self) -> list[ActionShare]:
        """The contribution of each action, in order of their starts."""
        return [ActionShare(**it) for it in self._order.get("actions", [])]

    @property
    def facts(self) -> list[FactShare]:
        """The facts whose spontaneous changes reduce the probability, the largest reduction first."""
        return [FactShare(**it) for it in self._order.get("facts", [])]

    @property
    def gains(self) -> dict[str, float | None]:
        """The probability with another order, with another plan, or with actions chosen by the observed state.

        ``None`` if it cannot be computed, or only within bounds; ``.document["gains"]`` has the reason or the bounds.
        """
        found: dict[str, dict[str, Any] | None] = self.document.get("gains", {})
        return {name: (it or {}).get("probability") for name, it in found.items()}

    @property
    def executed(self) -> list[Sampled]:
        """Results of executing the plan in samples of the world, if one was given."""
        return [
            Sampled(
                it["executor"],
                it["replans"],
                it["samples"],
                it["reached"],
                tuple(it["interval"]) if it["interval"] else None,
            )
            for it in self.document.get("executed", [])
        ]

    def rows(self) -> list[Loss]:
        """The losses."""
        return [
            Loss(*(it.get(field) for field in Loss._fields)) for it in self._order.get("losses", [])
        ]

    def _fields(self) -> Sequence[str]:
        return Loss._fields

    def __bool__(self) -> bool:
        return self.probability > 0

    def __repr__(self) -> str:
        if self.answer != "odds":
            return f"<Odds: {self.answer}{': ' + self.why_not if self.why_not else ''}>"
        return f"<Odds: {self.probability:.4f}, all actions succeed {self.actions_probability:.4f}>"

    def _repr_html_(self) -> str:
        if self.answer != "odds":
            return html_table((self.answer,), [(self.why_not or "",)], "no odds")
        rows = [
            (f"{loss.mass:.4f}", loss.at, loss.condition or "its start fails", loss.since or "")
            for loss in sorted(self.rows(), key=lambda loss: -loss.mass)
        ]
        caption = f"the plan succeeds with probability {self.probability:.4f}; where the rest goes"
        return html_table(("share", "at", "what does not hold", "since"), rows, caption)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draws the decrease of the probability, happening by happening.

        Raises:
            ImportError: if matplotlib is not installed.
        """
        return _plots.success_lanes(self, ax)
