"""Bounds of the numbers of unified-planning's problems, as conditions.

A number must never leave its bounds. It is compared with them before each effect that changes it, and at
the end.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import Any

from unified_planning.model import InstantaneousAction, Problem as UPProblem

from ._errors import UnsupportedError
from ._up_expressions import Expressions


class Bounds:
    """Bounds of a problem's fluents that some effect might violate.

    Raises:
        UnsupportedError: if such a fluent has no initial value.
    """

    def __init__(self, problem: UPProblem, say: Expressions) -> None:
        self._say = say
        self._limits: dict[Any, tuple[Any, Any]] = {}
        for effect in effects_of(problem):
            of = effect.fluent.type
            limits = (None, None) if of.is_bool_type() or of.is_user_type() else (of.lower_bound, of.upper_bound)
            value = say.simplify(effect.value)
            if limits != (None, None) and not (effect.is_assignment() and _is_between(value, limits)):
                self._limits[effect.fluent.fluent()] = limits
        for target, value in problem.initial_values.items():
            if value is None and target.fluent() in self._limits:
                raise UnsupportedError(
                    f"the bounds of {target.fluent().name} are not supported, because it has no initial value"
                )

    def limit(self, fluent: Any) -> tuple[Any, Any] | None:
        """Returns the least and the greatest value (or ``None``) of a fluent that might leave these bounds."""
        return self._limits.get(fluent)

    def before(self, effects: Iterable[Any]) -> list[str]:
        """Returns the conditions of simultaneous effects."""
        found: dict[str, None] = {}
        for effect in effects:
            if self._say.ranges_over_nothing(effect.forall):
                continue
            for condition in self._within(effect.fluent.fluent(), self._say.target(effect.fluent)):
                bound = self._say.declared(effect.forall)
                found[f"(forall ({bound}) {condition})" if effect.forall else condition] = None
        return list(found)

    def goals(self) -> Iterator[str]:
        """Returns the conditions at the end."""
        for fluent in self._limits:
            variables = " ".join(self._say.variable(it) for it in fluent.signature)
            target = f"({self._say.name('fluent', fluent)} {variables})"
            for condition in self._within(fluent, target):
                yield f"(forall ({self._say.declared(fluent.signature)}) {condition})"

    def _within(self, fluent: Any, target: str) -> Iterator[str]:
        lower, upper = self._limits.get(fluent, (None, None))
        if lower is not None:
            yield f"(>= {target} {lower})"
        if upper is not None:
            yield f"(<= {target} {upper})"


def effects_of(problem: UPProblem) -> Iterator[Any]:
    """Returns the effects of actions, and those at fixed times."""
    for action in problem.actions:
        if isinstance(action, InstantaneousAction):
            yield from action.effects
        else:
            yield from itertools.chain.from_iterable(action.effects.values())
    yield from itertools.chain.from_iterable(problem.timed_effects.values())


def _is_between(value: Any, limits: tuple[Any, Any]) -> bool:
    if not value.is_constant():
        return False
    number, (lower, upper) = value.constant_value(), limits
    return (lower is None or lower <= number) and (upper is None or number <= upper)
