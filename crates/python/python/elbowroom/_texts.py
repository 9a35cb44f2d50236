"""Texts and values that callers pass, as the native module reads them."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable
from typing import Any, TypeAlias

from ._answers import NoPlan, Plan, Stn
from ._errors import InterruptedWarning, RequestError
from ._numbers import Number, text

Text: TypeAlias = "str | os.PathLike[str]"
"""A path, or a text. A ``str`` with a parenthesis or a line feed is a text."""

AnyPlan: TypeAlias = "Plan | Stn | Text | Iterable[tuple[Any, ...]]"
"""A plan: the result of :meth:`Problem.plan` or :meth:`Problem.stn`, a path, a text, or steps
(start, action, duration)."""

PlannerCallable: TypeAlias = Callable[[str, str], "str | Plan | None"]
"""A planner in Python: a function of the texts of a domain and a problem that returns a plan, or ``None``."""

_LARGEST_FILE = 256 << 20


def named_text(given: Text, what: str) -> tuple[str, str]:
    """Returns a text and its name for messages."""
    if isinstance(given, str) and ("\n" in given or "(" in given or not given.strip()):
        return what, given
    if not isinstance(given, (str, os.PathLike)):
        raise TypeError(f"the {what} must be a path or a text, not {type(given).__name__}")
    path = os.fspath(given)
    if os.path.getsize(path) > _LARGEST_FILE:
        raise RequestError(f"the {what} {path} has more than 256 MB; give a text file")
    with open(path, encoding="utf-8-sig", errors="replace") as file:
        return path, file.read()


def native_planner(planner: str | PlannerCallable) -> Callable[[str, str], str | None] | None:
    """Returns the planner for the native module, if the planner is in Python."""
    if isinstance(planner, str):
        return None
    callable_ = planner

    def ask(domain: str, problem: str) -> str | None:
        found = callable_(domain, problem)
        if found is None or isinstance(found, NoPlan):
            return None
        return str(found)

    return ask


def line(step: tuple[Any, ...]) -> str:
    """Formats a step of a plan as a line of text."""
    start, action, *rest = step
    duration = rest[0] if rest else None
    lasts = "" if duration is None else f" [{text(duration)}]"
    return f"{text(start)}: {action}{lasts}\n"


def box(contains: str | dict[str, tuple[Number, Number]] | None) -> str | None:
    """Formats a box as the native module reads it."""
    if contains is None or isinstance(contains, str):
        return contains
    ends = {name: (text(lower), text(upper)) for name, (lower, upper) in contains.items()}
    return " ".join(f"{name}=[{lower},{upper}]" for name, (lower, upper) in ends.items())


def checked_time_limit(limit: float | None) -> float | None:
    """Checks a time limit."""
    if limit is None:
        return None
    given = float(limit)
    if not given >= 0:
        raise ValueError(f"the time limit is {limit} seconds; expected a number of at least 0")
    return given


def warn(is_interrupted: bool, has_result: bool) -> None:
    """Warns of Ctrl-C, or raises it if there is no result."""
    if not is_interrupted:
        return
    if not has_result:
        raise KeyboardInterrupt
    warnings.warn("interrupted by Ctrl-C; this is the best answer so far", InterruptedWarning, 3)
