"""Timed effects of unified-planning's problems in PDDL.

Timed initials of PDDL assign constants, after time 0. All other timed effects of one time become an action
that is applicable at exactly this time, and that each plan needs.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import Any, NamedTuple

from unified_planning.model import Problem as UPProblem

from ._errors import UnsupportedError
from ._up_bounds import Bounds
from ._up_expressions import Expressions


DEFAULT_EPSILON = Fraction(1, 1000)
"""Default of the least separation of interfering happenings, if the problem has none and its timed effects allow it."""


class TimedAction(NamedTuple):
    """An action without parameters that has the timed effects of one time."""

    time: Fraction
    effects: list[Any]


class TimedEffects:
    """The timed effects of a problem, as timed initials and as actions.

    Raises:
        UnsupportedError: if the time of an effect is not relative to the start of the plan, or an action is closer
            to other effects than the ε of the problem, which would make it impossible.
    """

    def __init__(self, problem: UPProblem, say: Expressions, bounds: Bounds) -> None:
        self._say = say
        self._bounds = bounds
        self.actions: list[TimedAction] = []
        self._initials: list[str] = []
        by_time = _by_time(problem)
        for time, effects in by_time:
            possible = [it for it in effects if not say.simplify(it.condition).is_false()]
            if time > 0 and self._are_assignments(possible):
                self._initials += [f"(at {time} {say.effect(it)})" for it in possible]
            elif possible:
                self.actions.append(TimedAction(time, possible))
        times = {time for time, _ in by_time}
        self.epsilon = Fraction(problem.epsilon or min([DEFAULT_EPSILON, *self._gaps({Fraction(0), *times})]))
        """Returns the least separation of interfering happenings: that of the problem, if it has one."""
        if min(self._gaps(times), default=self.epsilon) < self.epsilon:
            raise UnsupportedError(f"timed effects closer than the epsilon {problem.epsilon} are not supported")

    def _gaps(self, times: set[Fraction]) -> list[Fraction]:
        """Returns the distances of the actions to other times."""
        return [abs(action.time - it) for action in self.actions for it in times if it != action.time]

    def _are_assignments(self, effects: list[Any]) -> bool:
        """Returns ``True`` if the effects assign constants, each to a different fluent."""
        targets = {effect.fluent for effect in effects}
        return len(targets) == len(effects) and all(
            effect.is_assignment()
            and self._say.simplify(effect.condition).is_true()
            and self._say.simplify(effect.value).is_constant()
            and not self._bounds.limit(effect.fluent.fluent())
            for effect in effects
        )

    # PDDL.

    def predicates(self) -> Iterator[str]:
        """Yields the declarations of the facts that the actions read and write."""
        for action in self.actions:
            yield self._possible(action)
            yield self._done(action)

    def domain(self) -> Iterator[str]:
        """Yields the declarations of the actions."""
        for action in self.actions:
            possible = self._possible(action)
            conditions = " ".join(self._bounds.before(action.effects))
            effects = " ".join(self._say.effect(it) for it in action.effects)
            yield f"  (:action {self.name_of(action)} :parameters ()"
            yield f"    :precondition (and {possible} {conditions})"
            yield f"    :effect (and (not {possible}) {self._done(action)} {effects}))"

    def initials(self) -> Iterator[str]:
        """Returns the elements of the initial state and the timed initials."""
        yield from self._initials
        for action in self.actions:
            possible = self._possible(action)
            begin = action.time - self.epsilon
            yield f"(at {begin} {possible})" if begin > 0 else possible
            yield f"(at {action.time + self.epsilon} (not {possible}))"

    def goals(self) -> Iterator[str]:
        """Returns the goal that each action has been executed."""
        for action in self.actions:
            yield self._done(action)

    def _possible(self, action: TimedAction) -> str:
        """Returns the fact that is true only around the action's time."""
        return f"({self._say.name('timed', f'time of effects at {action.time}')})"

    def _done(self, action: TimedAction) -> str:
        """Returns the fact which states that the action has been executed."""
        return f"({self._say.name('timed', f'done effects at {action.time}')})"

    # Plans.

    def name_of(self, action: TimedAction) -> str:
        """Returns the PDDL name of an action."""
        return self._say.name("timed", f"effects at {action.time}")

    def times(self) -> dict[str, Fraction]:
        """Returns the time of each action, by its name in plans."""
        return {f"({self.name_of(action)})": action.time for action in self.actions}


def _by_time(problem: UPProblem) -> Iterable[tuple[Fraction, list[Any]]]:
    """Returns the timed effects by time; effects for all objects are expanded."""
    found: dict[Fraction, list[Any]] = {}
    for timing, effects in problem.timed_effects.items():
        if not timing.is_from_start():
            raise UnsupportedError(f"a timed effect at {timing}, counted from the end")
        at_once = found.setdefault(Fraction(timing.delay), [])
        for effect in effects:
            at_once += effect.expand_effect(problem)
    return sorted(found.items(), key=lambda it: it[0])
