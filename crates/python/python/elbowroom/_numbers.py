"""Exact numbers: fractions, and infinity for missing limits."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction
from typing import Any, TypeAlias

Number: TypeAlias = int | float | str | Fraction | Decimal
"""Accepted numbers. A float means its decimal notation: 0.1 is one tenth."""

Exact: TypeAlias = Fraction | float
"""A fraction, or ``math.inf`` or ``-math.inf``. Floats are used for infinity only."""


def exact(number: Number) -> Exact:
    """Converts a number to an exact one.

    >>> exact(0.1), exact("1/3"), exact(2), exact(float("inf"))
    (Fraction(1, 10), Fraction(1, 3), Fraction(2, 1), inf)
    """
    if isinstance(number, bool):
        raise TypeError(f"{number} is not a number; expected an int, a Fraction, a str or a float")
    if isinstance(number, float):
        if math.isnan(number):
            raise ValueError("expected a number, found nan")
        return number if math.isinf(number) else Fraction(repr(number))
    if isinstance(number, str):
        text = number.strip().lower()
        if text in ("inf", "+inf", "-inf"):
            return float(text)
        return Fraction(text)
    if isinstance(number, (int, Fraction, Decimal)):
        return Fraction(number)
    # unified-planning, numpy and others have their own number types.
    return Fraction(str(number))


def text(number: Number) -> str:
    """Formats a number as Elbowroom reads it.

    >>> text(0.1), text(5), text(float("-inf"))
    ('1/10', '5', '-inf')
    """
    return str(exact(number))


def timeout_text(timeout: Number | str) -> str:
    """Formats a time-out as Elbowroom reads it: a number of seconds, or a rule.

    >>> timeout_text(60), timeout_text("10x,600")
    ('60', '10x,600')
    """
    return timeout if isinstance(timeout, str) else text(timeout)


def _pair(fields: dict[str, Any]) -> Any:
    if "exact" in fields and len(fields) == 2 and "decimal" in fields:
        return exact(fields["exact"])
    return fields


def document(text: str) -> Any:
    """Reads an answer; its exact numbers become fractions."""
    import json

    return json.loads(text, object_hook=_pair)


def format_number(number: Exact | None, digits: int = 3) -> str:
    """Formats a number for display, rounded to ``digits`` decimals.

    >>> from fractions import Fraction
    >>> format_number(Fraction(1, 3)), format_number(Fraction(5, 2)), format_number(float("inf"))
    ('0.333', '2.5', 'inf')
    """
    if number is None:
        return ""
    if isinstance(number, float):
        return str(number)
    if number.denominator == 1:
        return str(number.numerator)
    return f"{float(number):.{digits}f}".rstrip("0").rstrip(".")


def format_inwards(number: Exact, is_lower: bool, digits: int = 3) -> str:
    """Formats an end of an interval, rounded into the interval, so that the guarantee covers the printed interval.

    >>> from fractions import Fraction
    >>> format_inwards(Fraction(2, 3), True), format_inwards(Fraction(2, 3), False)
    ('0.667', '0.666')
    """
    if isinstance(number, float) or number.denominator == 1:
        return format_number(number)
    scale = 10**digits
    scaled = number * scale
    whole = math.ceil(scaled) if is_lower else math.floor(scaled)
    return format_number(Fraction(whole, scale), digits)
