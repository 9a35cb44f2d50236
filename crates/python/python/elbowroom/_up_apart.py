"""Adaptation of plans to the rules of unified-planning, which are stricter than PDDL 2.1 in some cases."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from ._answers import Step
from ._up_translate import Translation

_MOST_MOVES = 200
"""Largest number of moves of one step."""


def overlaps(translated: Translation, steps: Sequence[Step]) -> bool:
    """Returns ``True`` if an action overlaps itself although the problem does not allow that."""
    if translated.original.self_overlapping:
        return False
    ends: dict[str, Fraction] = {}
    for step in sorted(steps, key=lambda it: it.start):
        if step.duration is None:
            continue
        if step.action in ends and step.start < ends[step.action]:
            return True
        ends[step.action] = max(step.start + step.duration, ends.get(step.action, Fraction(0)))
    return False


def apart(translated: Translation, steps: Sequence[Step]) -> list[Step] | None:
    """Returns the steps, some of them minimally later, so that no two write the same fact at the same time.

    Returns ``None`` if this is not possible.
    """
    if not translated.is_temporal:
        return list(steps)
    epsilon = Fraction(translated.original.epsilon or 0)
    moved = list(steps)
    for count in range(1, _MOST_MOVES + 1):
        verdict = _verdict(translated, moved)
        if verdict.violation is None:
            return moved
        place = verdict.violation.step
        if place is None:
            return None
        best = None
        delay = epsilon or Fraction(count, 1_000_000)
        for other in range(len(moved)):
            if moved[other].action in translated.timed_actions or not _shares_time(moved[other], moved[place]):
                continue
            for change in _changes(moved[other], delay):
                tried = [*moved[:other], change, *moved[other + 1 :]]
                if overlaps(translated, tried):
                    continue
                found = _verdict(translated, tried).violation
                if found is None:
                    return tried
                if best is None or found.time > best[0]:
                    best = (found.time, tried)
        if best is None or best[0] <= verdict.violation.time:
            return None
        moved = best[1]
    return None


def _verdict(translated: Translation, steps: Sequence[Step]) -> Any:
    return translated.check(steps)


def _shares_time(one: Step, other: Step) -> bool:
    def times(step: Step) -> set[Fraction]:
        return {step.start, step.start + (step.duration or 0)}

    return bool(times(one) & times(other))


def _changes(step: Step, delay: Fraction) -> list[Step]:
    """Returns the step a little later or earlier, or a little longer or shorter."""
    changes = [step._replace(start=step.start + delay)]
    if step.start >= delay:
        changes.append(step._replace(start=step.start - delay))
    if step.duration is not None:
        changes.append(step._replace(duration=step.duration + delay))
        if step.duration > delay:
            changes.append(step._replace(duration=step.duration - delay))
    return changes
