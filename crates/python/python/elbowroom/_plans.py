"""Plans as they are found."""

from __future__ import annotations

from collections.abc import Iterator

from . import _native
from ._answers import NoPlan, Plan
from ._numbers import document


class Plans(Iterator[Plan]):
    """Plans as they are found, each better than the one before: by the problem's metric or, without one, by makespan.

    The search goes on between them, until the time limit or until nothing is left to search.
    """

    def __init__(self, native: _native.Plans) -> None:
        self._native = native
        self.answer: Plan | NoPlan | None = None
        """Once there are no more: the last plan again, with why the search ended (:attr:`Plan.stop`), or why
        there is none."""
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
        """Ends the search. It ends by itself when nothing refers to this any more."""
        self._native.stop()


def _late(last: Plan | None) -> Plan | NoPlan:
    if last is not None:
        return Plan(str(last), last.steps, {**last.document, "stop": "time limit"})
    reason = "no plan found: stopped at the time limit; this does not prove that none exists"
    return NoPlan({"answer": "none", "reason": reason, "stop": "time limit"})
