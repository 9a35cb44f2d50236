"""Worlds on simulators that advance in steps."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction

from ._numbers import Number, text
from ._world import Action, Observation, World, ended, fact, started, value


class SteppedWorld:
    """Base class of worlds on simulators that advance in steps.

    Override :meth:`begin`, :meth:`step` and :meth:`cancel`. They report with :meth:`succeeded`, :meth:`failed`,
    :meth:`fact` and :meth:`value`. Starts and cancellations are reported automatically.

    All methods are called in one thread, which is not the caller's. Exception: if a method blocks when the run is to
    end, :meth:`cancel` and :meth:`stop` are called in another thread after 0.5 s. Reports may be made in any thread;
    the run receives them after the present step.

    >>> class Depot(elbowroom.SteppedWorld):
    ...     dt = "0.1"
    ...     def __init__(self):
    ...         super().__init__()
    ...         self.left = {}
    ...     def begin(self, action):
    ...         self.left[action] = float(action.duration)
    ...     def step(self, dt):
    ...         for action in [*self.left]:
    ...             self.left[action] -= dt
    ...             if self.left[action] < dt / 2:
    ...                 del self.left[action]
    ...                 self.succeeded(action)
    ...     def cancel(self, action):
    ...         del self.left[action]
    >>> problem.run(PLAN, world=Depot()).verdict
    'goal-reached'
    """

    dt: Number = "0.1"
    """Longest step, in seconds of the simulation."""

    speed: float | None = None
    """Simulated seconds in one real second; ``None``: as fast as possible."""

    def __init__(self) -> None:
        self._time = Fraction(0)
        self._running: set[int] = set()
        self._reports: deque[Observation] = deque()

    @property
    def now(self) -> Fraction:
        """The time of the simulation at the end of the step."""
        return self._time

    def begin(self, action: Action) -> None:
        """Begins an action. An instantaneous action (``duration`` is ``None``) happens here."""
        raise NotImplementedError("a stepped world needs a method begin(action)")

    def step(self, dt: float) -> Number | None:
        """Advances the simulation by ``dt`` seconds, at most :attr:`dt`.

        A simulator with a fixed step returns the time that has passed.
        """
        raise NotImplementedError("a stepped world needs a method step(dt)")

    def cancel(self, action: Action) -> None:
        """Stops a running action at once. An action that stops later reports its end itself."""
        raise NotImplementedError("a stepped world needs a method cancel(action)")

    def look(self, facts: Sequence[str], fluents: Sequence[str]) -> Sequence[Observation]:
        """As :meth:`elbowroom.World.look`."""
        return ()

    def resume(
        self, now: Fraction, actions: Sequence[Action]
    ) -> tuple[Number, Sequence[Observation]] | None:
        """As :meth:`elbowroom.World.resume`. Actions that are reported as started, and not as ended, are running."""
        return None

    def stop(self) -> None:
        """As :meth:`elbowroom.World.stop`."""

    def succeeded(self, action: Action, measured: Mapping[str, Number] | None = None) -> None:
        """Reports that an action has succeeded."""
        self._end(action, "succeeded", "", measured)

    def failed(self, action: Action, why: str) -> None:
        """Reports that an action has failed, or cannot begin."""
        self._end(action, "failed", why)

    def fact(self, name: str, becomes: bool) -> None:
        """Reports that a fact is true or false: ``self.fact("(at rover depot)", True)``."""
        self._reports.append(fact(name, becomes, self._time))

    def value(self, fluent: str, amount: Number) -> None:
        """Reports the value of a fluent: ``self.value("(battery rover)", 80)``."""
        self._reports.append(value(fluent, amount, self._time))

    def _end(
        self,
        action: Action,
        outcome: str,
        why: str = "",
        measured: Mapping[str, Number] | None = None,
    ) -> None:
        self._running.discard(action.ticket)
        self._reports.append(ended(action, self._time, outcome, why, measured))


class SteppedAdapter(World):
    """Adapter of a stepped world to one that waits. A wait ends when ``is_to_end`` returns true."""

    def __init__(self, world: SteppedWorld, is_to_end: Callable[[], bool]) -> None:
        self._world = world
        self._is_to_end = is_to_end
        self._has_yielded = False
        world._time, world._running, world._reports = Fraction(0), set(), deque()
        # The time of the simulation at `_begun` on the real clock.
        self._origin = Fraction(0)
        self._begun = time.monotonic()

    def start(self, action: Action) -> None:
        world = self._world
        world._running.add(action.ticket)
        world.begin(action)
        if action.ticket in world._running:
            world._reports.append(started(action, world._time))
        if action.duration is None:
            world._running.discard(action.ticket)

    def cancel(self, action: Action) -> None:
        self._world.cancel(action)
        if action.ticket in self._world._running:
            self._world._end(action, "cancelled")

    def wait(self, until: Fraction) -> tuple[Number, Sequence[Observation]]:
        world = self._world
        longest = Fraction(text(world.dt))
        while not world._reports and world._time < until:
            dt = min(longest, until - world._time)
            before = world._time
            # Reports during a step have the time of its end.
            world._time = before + dt
            passed = world.step(float(dt))
            if passed is not None:
                world._time = before + Fraction(text(passed))
            if world._time <= before:
                # The run notices a clock that does not advance.
                break
            self._keep_pace()
            if self._is_to_end() and not self._has_yielded:
                self._has_yielded = True
                break
        # Other threads may report meanwhile.
        reports = [world._reports.popleft() for _ in range(len(world._reports))]
        return world._time, reports

    def look(self, facts: Sequence[str], fluents: Sequence[str]) -> Sequence[Observation]:
        return self._world.look(facts, fluents)

    def resume(
        self, now: Fraction, actions: Sequence[Action]
    ) -> tuple[Number, Sequence[Observation]] | None:
        answer = self._world.resume(now, actions)
        if answer is not None:
            time_now, observations = answer
            self._world._time = Fraction(text(time_now))
            self._origin = self._world._time
            for fields in (it.fields for it in observations):
                if fields["type"] == "started":
                    self._world._running.add(fields["ticket"])
                elif fields["type"] == "ended":
                    self._world._running.discard(fields["ticket"])
        return answer

    def stop(self) -> None:
        self._world.stop()

    def _keep_pace(self) -> None:
        if self._world.speed is not None:
            due = self._begun + float(self._world._time - self._origin) / self._world.speed
            time.sleep(max(0.0, due - time.monotonic()))
