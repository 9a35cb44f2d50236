"""Check of a world's clock."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

MOST_STILL = 100
"""Answers in a row without observations and without time passing, before the clock counts as stopped."""

TOLERANCE = Fraction(1)
"""Largest delay of an answer in seconds."""

MOST_MESSAGES = 10
"""Messages of each kind."""


PATIENCE = 60.0
"""Seconds on the real clock that each wait may take, in addition to ten times what was requested."""


class Overdue(NamedTuple):
    """Message about a wait that has not returned."""

    after: float
    """Seconds on the real clock."""
    message: str


class ClockCheck:
    """Finds a clock that does not advance, is set back, or jumps further than the wait that was requested."""

    def __init__(self) -> None:
        self.messages: list[str] = []
        # The last time that the world has reported.
        self._last = Fraction(0)
        self._still = 0
        self._jumps = 0
        self._steps_back = 0

    def begin(self, now: Fraction) -> None:
        """Sets the time from which the clock of a resumed run advances."""
        self._last = now

    def expect(self, until: Fraction) -> Overdue:
        """Returns the message for a wait until ``until`` that takes too long."""
        before = self._last
        after = PATIENCE + 10 * max(0.0, float(until - before))
        return Overdue(
            after,
            f"the world has not returned from a wait from {_s(before)} until {_s(until)} "
            f"for {after:.0f} s on the real clock; its clock may not advance",
        )

    def note(self, until: Fraction, now: Fraction, is_silent: bool) -> str | None:
        """Checks an answer to a wait until ``until``. Returns a new message."""
        message = None
        before, self._last = self._last, now
        if now < before:
            self._steps_back += 1
            if self._steps_back <= MOST_MESSAGES:
                message = f"the world's clock went back from {_s(before)} to {_s(now)}"
        elif now - until > until - before + TOLERANCE:
            self._jumps += 1
            if self._jumps <= MOST_MESSAGES:
                message = (
                    f"the world's clock jumped from {_s(before)} to {_s(now)}; "
                    f"the wait was until {_s(until)}"
                )
        is_still = is_silent and now <= before < until
        self._still = self._still + 1 if is_still else 0
        if self._still == MOST_STILL:
            message = (
                f"the world's clock does not advance from {_s(now)}: {MOST_STILL} waits have returned "
                "without an observation, before their ends"
            )
        if message is not None:
            self.messages.append(message)
        return message


def _s(time: Fraction) -> str:
    return f"{float(time):.3f} s"
