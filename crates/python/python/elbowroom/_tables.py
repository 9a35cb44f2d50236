"""Tables: named tuples, data frames, HTML."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import pandas
    import polars


class Progress(NamedTuple):
    """Progress of a long call: the argument of a ``progress`` callback."""

    stage: str
    """``"plan"``, ``"envelope"``, ``"run"`` or ``"trials"``."""
    done: int
    """The number of states, steps, plans or trials so far."""
    total: int | None
    """The total number, if it is known."""
    detail: str
    """A further description in words; may be empty."""


ProgressCallback = Callable[[Progress], object]


def listener(progress: ProgressCallback | bool | None) -> Callable[..., object] | None:
    """Returns the callback for the native module. ``True`` shows a bar of ``tqdm``."""
    if progress is None or progress is False:
        return None
    if progress is True:
        try:
            from tqdm.auto import tqdm  # type: ignore[import-untyped, unused-ignore]
        except ImportError as error:
            raise ImportError(
                "progress=True needs tqdm: `pip install tqdm`, or give a function"
            ) from error
        bar = tqdm()

        def show(stage: str, done: int, total: int | None, detail: str) -> None:
            bar.set_description(stage)
            bar.set_postfix_str(detail, refresh=False)
            bar.total = total
            bar.update(done - bar.n)

        return show
    callback = progress
    return lambda *told: callback(Progress(*told))


def cell(value: Any) -> Any:
    """Converts a value for data frames: fractions become floats."""
    return float(value) if isinstance(value, Fraction) else value


def columns(rows: Sequence[tuple[Any, ...]], fields: Sequence[str]) -> dict[str, list[Any]]:
    """Converts rows to columns."""
    return {field: [cell(row[i]) for row in rows] for i, field in enumerate(fields)}


def to_pandas(rows: Sequence[tuple[Any, ...]], fields: Sequence[str]) -> pandas.DataFrame:
    """Converts rows to a data frame of pandas; fractions become floats."""
    try:
        import pandas
    except ImportError as error:
        raise ImportError("to_pandas() needs pandas: `pip install pandas`") from error
    return pandas.DataFrame(columns(rows, fields), columns=list(fields))


def to_polars(rows: Sequence[tuple[Any, ...]], fields: Sequence[str]) -> polars.DataFrame:
    """Converts rows to a data frame of polars; fractions become floats."""
    try:
        import polars
    except ImportError as error:
        raise ImportError("to_polars() needs polars: `pip install polars`") from error
    return polars.DataFrame(columns(rows, fields), strict=False)


def html_table(heads: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "") -> str:
    """Returns an HTML table; all texts are escaped."""
    head = "".join(f"<th>{html.escape(text)}</th>" for text in heads)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(text)}</td>" for text in row) + "</tr>" for row in rows
    )
    title = f"<caption>{html.escape(caption)}</caption>" if caption else ""
    return f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


class Table:
    """Base class of answers with a table: a list of named tuples, and data frames."""

    def rows(self) -> list[Any]:
        """The rows, as named tuples with exact fractions."""
        raise NotImplementedError

    def _fields(self) -> Sequence[str]:
        raise NotImplementedError

    def to_pandas(self) -> pandas.DataFrame:
        """The rows as a data frame of pandas; fractions become floats.

        Raises:
            ImportError: if pandas is not installed.
        """
        return to_pandas(self.rows(), self._fields())

    def to_polars(self) -> polars.DataFrame:
        """The rows as a data frame of polars; fractions become floats.

        Raises:
            ImportError: if polars is not installed.
        """
        return to_polars(self.rows(), self._fields())
