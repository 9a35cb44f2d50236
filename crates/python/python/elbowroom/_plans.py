"""Plans as they are found."""

from __future__ import annotations

from collections.abc import Iterator

from . import _native
from ._answers import NoPlan, Plan
from ._numbers import document


class Plans(Iterator[Plan]):
    """Iterator of plans as they are found, each better than the previous one by the problem's metric, or by makespan without one.

    The search continues between the plans, until the time limit or until it is exhausted.
    """

    def __init__(self, native: _native.Plans) -> None:
        self._native = native
        self.answer: Plan | NoPlan | None = None
        """After the last plan: the last plan again, with the reason for the end of the search (:attr:`Plan.stop`), or the
        answer without a plan."""
        self._last: Plan | None = None

    def __next__(self) -> Plan:
        if self.answer is not None:
            raise StopIteration
        news = self._native.next()
        if news is None:
            # The search has not answered in time. Its last plan is known.
            self.answer = _late(self._last)
            raise StopIteration
        text, is_last = news
        found = document(text)
        if found["answer"] != "plan":
            self.answer = NoPlan(found)
            raise StopIteration
        plan = Plan.of(found)
        if is_last:
            self.answer = plan
            raise StopIteration
        self._last = plan
        return plan

    def close(self) -> None:
        """Ends the search. It also ends when the last reference to this object is dropped."""
        self._native.stop()


def _late(last: Plan | None) -> Plan | NoPlan:
    if last is not None:
        return Plan(str(last), last.steps, {**last.document, "stop": "time limit"})
    reason = "no plan found: stopped at the time limit; this does not prove that none exists"
    return NoPlan({"answer": "none", "reason": reason, "stop": "time limit"})
