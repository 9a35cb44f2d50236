"""Figures of a number of days, and the table of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

WIDTH = 80


@dataclass
class Series:
    """Figures of days with the same plan."""

    title: str
    """Two lines, separated by a line break."""
    successes: list[bool]
    loaded_at: list[float]
    deadline: float
    promises: list[str]
    predicted: float
    """Probability of success by the model in use."""
    predictions: dict[str, dict[str, Any]]
    """For each action, the predicted and the observed durations and failures."""
    predicted_learnt: float = 0.0
    """Probability of success by the learnt model."""

    @property
    def observed(self) -> float:
        """Share of days with success."""
        return sum(self.successes) / len(self.successes)

    @property
    def lateness(self) -> list[float]:
        """Seconds after the deadline, for the days on which it was missed."""
        return [at - self.deadline for at, in_time in zip(self.loaded_at, self.successes) if not in_time]

    def wilson(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the probability of success."""
        n, p, z = len(self.successes), self.observed, 1.959964
        middle = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * (p * (1 - p) / n + z * z / (4 * n * n)) ** 0.5
        return max(0.0, middle - half), min(1.0, middle + half)

    def brier(self) -> float:
        """Mean squared error of the predicted probability; 0 is best."""
        return sum((self.predicted - success) ** 2 for success in self.successes) / len(self.successes)

    def within(self) -> str:
        """Share of durations within the central 90 % of the predictions."""
        durations = sum(it["durations"] for it in self.predictions.values())
        within = sum(it["within"] for it in self.predictions.values())
        return percent(within / durations) if durations else "-"

    def mean_error(self) -> str:
        """Mean of |predicted mean - observed mean| per action, weighted by the number of durations."""
        used = [it for it in self.predictions.values() if it["durations"]]
        total = sum(it["durations"] for it in used)
        error = sum(it["durations"] * abs(it["predicted_mean"] - it["observed_mean"]) for it in used)
        return f"{error / total:.1f} s" if total else "-"

    def failures(self) -> str:
        """Failures of actions, predicted and observed."""
        predicted = sum(it["predicted_failures"] for it in self.predictions.values())
        observed = sum(it["failures"] for it in self.predictions.values())
        return f"{predicted:.1f} / {observed}"


def percent(share: float) -> str:
    """A share as a percentage."""
    return f"{100 * share:.0f} %"


def mean(values: Iterable[float]) -> str:
    """Mean of times in seconds."""
    known = list(values)
    return f"{sum(known) / len(known):.1f} s" if known else "-"


def rows(series: list[Series]) -> list[tuple[str, list[str]]]:
    """The rows of the table."""

    def row(name: str, cell: Any) -> tuple[str, list[str]]:
        return name, [cell(it) for it in series]

    return [
        row("days", lambda it: str(len(it.successes))),
        row("all crates on the truck", lambda it: f"{sum(it.successes)} ({percent(it.observed)})"),
        row("  predicted by its model", lambda it: percent(it.predicted)),
        row("  predicted by learnt model", lambda it: percent(it.predicted_learnt)),
        row("  95 % interval", lambda it: "{:.0f}-{:.0f} %".format(*(100 * end for end in it.wilson()))),
        row("  Brier score", lambda it: f"{it.brier():.3f}"),
        row("last crate loaded, mean", lambda it: mean(it.loaded_at)),
        row("  mean lateness if late", lambda it: mean(it.lateness)),
        row("  greatest lateness", lambda it: f"{max(it.lateness):.1f} s" if it.lateness else "-"),
        row("durations in central 90 %", Series.within),
        row("  mean error of the means", Series.mean_error),
        row("failures, predicted / seen", Series.failures),
        row("days inside the envelope", lambda it: str(sum(p != "outside" for p in it.promises))),
        row("  promise broken on", lambda it: str(it.promises.count("broken"))),
    ]


def table(series: list[Series]) -> str:
    """The figures as a table of at most 80 columns."""
    first = 28
    width = (WIDTH - first) // len(series)
    titles = [it.title.split("\n") for it in series]
    lines = [" " * first + "".join(f"{title[i]:>{width}}" for title in titles) for i in range(2)]
    lines += ["-" * (first + width * len(series))]
    lines += [f"{name:<{first}}" + "".join(f"{cell:>{width}}" for cell in cells) for name, cells in rows(series)]
    return "\n".join(lines)
