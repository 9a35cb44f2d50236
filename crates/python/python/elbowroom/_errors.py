"""Exceptions. The message of each exception contains advice."""

from __future__ import annotations

import json
from typing import Any, NamedTuple


class Diagnostic(NamedTuple):
    """One finding about a text: a domain, a problem, a plan, a world file."""

    severity: str
    """``"error"``, or ``"warning"`` where the text is used nevertheless."""
    message: str
    """The error, in lower case."""
    advice: str | None
    """The expected input, or a remedy."""
    file: str
    """The name of the text: its path, or its kind."""
    line: int
    """The line, from 1."""
    column: int
    """The column, from 1, in characters."""
    length: int
    """Number of characters of the place on its line; 0 if something is missing there."""

    def __str__(self) -> str:
        advice = f"; {self.advice}" if self.advice else ""
        place = f"{self.file}:{self.line}:{self.column}"
        return f"{place}: {self.severity}: {self.message}{advice}"


def diagnostics(records: str) -> list[Diagnostic]:
    """Reads the native module's findings about a text."""
    read: list[dict[str, Any]] = json.loads(records)
    fields = Diagnostic._fields
    return [Diagnostic(*(record[field] for field in fields)) for record in read]


class ElbowroomError(Exception):
    """The base of all exceptions of this package."""


class ReadError(ElbowroomError, ValueError):
    """A text cannot be read: a domain, a problem, a plan, a world, an experiment.

    >>> import elbowroom
    >>> try:
    ...     elbowroom.read("(define (domain d) (:predicats (p)))", "(define (problem q))")
    ... except elbowroom.ReadError as error:
    ...     print(error.diagnostics[0].line, error.diagnostics[0].advice)
    1 did you mean `:predicates`?
    """

    diagnostics: list[Diagnostic]
    """All errors and warnings, in the order of the text."""

    def __init__(self, message: str, records: str = "[]") -> None:
        super().__init__(message)
        self.diagnostics = diagnostics(records)


class RequestError(ElbowroomError, ValueError):
    """The request is invalid, or its answer is beyond exact analysis. The message gives the reason."""


class UnsupportedError(ElbowroomError):
    """The problem needs something that the planner, or the translation, does not support."""


class UndecidedError(ElbowroomError):
    """The validator cannot decide whether the plan is valid."""


class PlannerError(ElbowroomError):
    """A planner is not known, could not be started, or has failed."""


class WorldError(ElbowroomError):
    """A world in Python has raised an exception, which is the ``__cause__``, or broke its contract.

    ``run`` is the run until then.
    """

    run: Any

    def __init__(self, message: str, run: Any = None) -> None:
        super().__init__(message)
        self.run = run


class ExecutiveError(ElbowroomError):
    """An executive cannot be started or resumed, its journal cannot be written, or it has ended.

    ``run`` is the run until then, if there was one.
    """

    run: Any

    def __init__(self, message: str, run: Any = None) -> None:
        super().__init__(message)
        self.run = run


class CampaignError(ElbowroomError):
    """Parts of a campaign are missing, or could not be computed. The message names them."""


class BugError(ElbowroomError, RuntimeError):
    """A bug in Elbowroom itself."""

    def __init__(self, said: str) -> None:
        super().__init__(
            f"this is a bug in Elbowroom: {said}. Please report it, with the domain, the problem "
            "and the call that led here; no input should cause this error"
        )


class InterruptedWarning(UserWarning):
    """Ctrl-C has ended a search or a run early; the answer is the best one until then."""


class ClockWarning(UserWarning):
    """The clock of a world in Python does not advance, jumps, or is set back; see :attr:`Run.warnings`."""


class ExecutiveWarning(UserWarning):
    """A problem with the journal or the clock of an executive, which continues; see :attr:`Executive.warnings`."""


class DamagedWarning(UserWarning):
    """A stored part of a campaign has changed on disk; it is computed again."""
