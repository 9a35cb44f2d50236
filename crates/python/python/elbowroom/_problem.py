"""Problems, and the methods that answer questions about them."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from . import _native
from ._answers import Envelope, NoPlan, Plan, Step, Stn, Verdict
from ._errors import Diagnostic, RequestError, diagnostics
from ._executable import Executable
from ._numbers import Number, document, text, timeout_text
from ._odds import Odds
from ._plans import Plans
from ._tables import ProgressCallback, listener
from ._texts import AnyPlan, Text, box, checked_time_limit, line, named_text, warn


def read(domain: Text, problem: Text, *, epsilon: Number = "0.001") -> Problem:
    """Reads a domain and a problem, in PDDL: paths, or the texts themselves.

    Args:
        domain: the domain.
        problem: the problem.
        epsilon: the least separation of interfering happenings, in the problem's unit of time.

    Raises:
        ReadError: if they cannot be read. It contains all errors, with line, column and advice.
        OSError: if there is no such file.

    >>> import elbowroom
    >>> problem = elbowroom.read(DOMAIN, PROBLEM)
    >>> problem.name
    'one-parcel'
    """
    native, found = _native.read(
        named_text(domain, "domain"), named_text(problem, "problem"), text(epsilon)
    )
    return Problem(native, diagnostics(found), text(epsilon))


class Problem(Executable):
    """An immutable planning problem, returned by :func:`read`."""

    def __init__(
        self, native: _native.Task, found: Sequence[Diagnostic] = (), epsilon: str = "1/1000"
    ) -> None:
        self._native = native
        self._epsilon = epsilon
        self.warnings: list[Diagnostic] = list(found)
        """Warnings from reading the files."""

    @property
    def domain_name(self) -> str:
        """The name of the domain."""
        return self._native.names()[0]

    @property
    def name(self) -> str:
        """The name of the problem."""
        return self._native.names()[1]

    @property
    def domain_text(self) -> str:
        """The domain, in PDDL."""
        return self._native.texts()[0][1]

    @property
    def problem_text(self) -> str:
        """The problem, in PDDL."""
        return self._native.texts()[1][1]

    def __repr__(self) -> str:
        return f"<Problem {self.name} of domain {self.domain_name}>"

    def __reduce__(self) -> tuple[Any, ...]:
        # Problems are pickled as their texts.
        domain, problem = self._native.texts()
        return _read_again, (domain, problem, self._epsilon)

    def _plan_text(self, plan: AnyPlan) -> tuple[str, str]:
        if isinstance(plan, Plan):
            return "plan", str(plan)
        if isinstance(plan, Stn):
            return "plan.stn", plan.text
        if isinstance(plan, (str, os.PathLike)):
            return named_text(plan, "plan")
        return "plan", "".join(line(step) for step in plan)

    def read_plan(self, plan: AnyPlan) -> Plan:
        """Reads a plan with fixed times, as planners print it.

        Raises:
            ReadError: if it cannot be read, or contains names that the problem does not have.
            RequestError: if it is an STN plan.

        >>> problem.read_plan("0: (unlock office) [6]").steps
        [Step(start=Fraction(0, 1), action='(unlock office)', duration=Fraction(6, 1))]
        """
        name, given = self._plan_text(plan)
        steps = self._native.steps((name, given))
        if steps is None:
            raise RequestError(f"{name} is an STN plan, which has no fixed times")
        made = [Step(Fraction(s), a, None if d is None else Fraction(d)) for s, a, d in steps]
        return Plan(given, sorted(made, key=lambda step: step.start), {})

    def check(
        self, plan: AnyPlan, *, tolerance: Number | None = None, rules: str = "pddl"
    ) -> Verdict:
        """Validates a plan by the semantics of PDDL 2.1.

        Args:
            plan: a plan with fixed times.
            tolerance: the greatest difference of each printed number from that of a valid plan; by default
                one unit of its last digit, at most 0.001. With 0, all numbers are exact. Steps
                always have exact numbers.
            rules: ``"pddl"``, where the goal holds after all timed initials;
                ``"pddl-goal-after-actions"``, where it holds after the plan's last action; or
                ``"unified-planning"``, where happenings need no separation, simultaneous happenings read the
                state before them, and no two actions write the same fact at the same time; or
                ``"unified-planning-with-epsilon"``, where only the last of these is added to
                ``"pddl"``.

        Raises:
            ReadError: if the plan cannot be read.
            UndecidedError: if the validator cannot decide whether the plan is valid.

        >>> bool(problem.check(PLAN))
        True
        >>> problem.check("0: (drop rover parcel office) [3]").violation.action
        '(drop rover parcel office)'
        """
        options = {"rules": rules}
        if tolerance is not None:
            options["tolerance"] = text(tolerance)
        answer = self._native.check(self._plan_text(plan), json.dumps(options))
        return Verdict(document(answer))

    def plan(
        self,
        *,
        planner: str = "embedded",
        time_limit: float | None = None,
        first: bool | None = None,
        memory: int | None = None,
        jobs: int | None = None,
        self_overlap: bool = False,
        progress: ProgressCallback | bool | None = None,
    ) -> Plan | NoPlan:
        """Searches for a plan.

        Args:
            planner: ``"embedded"``, the name of another planner, or a command line.
            time_limit: limit in seconds; the search for better plans continues until then.
            first: ``True`` to stop at the first plan; by default ``True`` without a time limit.
            memory: approximate limit on the memory of the search, in bytes.
            jobs: the number of threads of the embedded planner; by default, and with 0, one for
                each processor. It does not change the plan, but more threads find it sooner.
            self_overlap: ``True`` to allow a ground action to overlap itself: to start again before it has ended.
                Affects only plans of the embedded planner.
            progress: receives the progress; ``True`` shows a bar.

        Returns:
            A plan, or a :class:`NoPlan`, which is false and has the reason. After Ctrl-C, the best plan so far.

        Raises:
            UnsupportedError: if the problem has a feature that the embedded planner does not support.
            PlannerError: if another planner is not known, or fails.

        >>> plan = problem.plan()
        >>> plan.makespan
        Fraction(30003, 1000)
        """
        if first is None:
            first = time_limit is None
        limit = checked_time_limit(time_limit)
        answer, is_interrupted = self._native.plan(
            planner, limit, first, memory, jobs, self_overlap, listener(progress)
        )
        found = document(answer)
        warn(is_interrupted, found["answer"] == "plan")
        if found["answer"] != "plan":
            return NoPlan(found)
        return Plan.of(found)

    def plans(
        self,
        *,
        time_limit: float | None = None,
        memory: int | None = None,
        jobs: int | None = None,
        self_overlap: bool = False,
    ) -> Plans:
        """Searches for plans with the embedded planner, and yields each better one as soon as it is found.

        The search continues in a separate thread between the plans. It ends at the time limit, when it is exhausted, or when
        the last reference to the iterator is dropped, as after ``break``. With one thread, each call yields the same
        plans; only their number within the limit may differ.

        Args:
            time_limit: limit in seconds, counted from this call; it includes the time that the caller uses between the plans.
            memory: approximate limit on the memory of the search, in bytes.
            jobs: the number of threads of the planner; by default, and with 0, one for each processor.
            self_overlap: ``True`` to allow a ground action to overlap itself.

        Raises:
            UnsupportedError: from the loop, if the problem has a feature that the embedded planner does not support.

        >>> plans = problem.plans(time_limit=10)
        >>> for plan in plans:
        ...     print(plan.makespan)
        30003/1000
        >>> plans.answer.stop
        'exhausted'
        """
        limit = checked_time_limit(time_limit)
        native = _native.Plans(self._native, limit, memory, jobs, self_overlap)
        return Plans(native)

    def stn(self, plan: AnyPlan) -> Stn:
        """Relaxes a plan to a simple temporal network with only the necessary orders and bounds.

        Raises:
            RequestError: if the plan does not work.

        >>> len(problem.stn(PLAN).nodes)
        12
        """
        answer, written, dot = self._native.stn(self._plan_text(plan))
        found = document(answer)
        if written is None or dot is None:
            raise RequestError(
                f"the plan does not work, so it has no envelope: {found['violation']['message']}"
            )
        return Stn(found, written, dot)

    def envelope(
        self,
        plan: AnyPlan,
        *,
        vary: str | Sequence[str] = (),
        controllable: str | Sequence[str] = (),
        guarantee: str = "dynamic",
        method: str | None = None,
        precision: Number | None = None,
        growth: str = "doubling",
        sharpen: bool = False,
        enforce: bool = False,
        contains: str | dict[str, tuple[Number, Number]] | None = None,
        timeout: Number | str | None = None,
        most_checks: int | None = None,
        time_limit: float | None = None,
        progress: ProgressCallback | bool | None = None,
    ) -> Envelope:
        """Computes how far each quantity of a plan may deviate while the plan still works.

        Args:
            plan: a plan with fixed times, or an STN plan.
            vary: the quantities to leave open, in the syntax of ``elbowroom envelope --vary``; by
                default all durations.
            controllable: actions whose durations the executor chooses.
            guarantee: ``"weak"``, ``"dynamic"`` or ``"strong"``.
            method: ``"best"``: the box whose least deviation is greatest; or ``"irr"``. By default
                ``"best"``, but ``"irr"`` where ``precision``, ``growth`` or ``sharpen`` is given,
                and for problems with processes or events.
            precision: the maximum distance of each end from its limit, in the unit of the quantity; by
                default a hundredth of the planned value.
            growth: ``"doubling"`` or ``"constant"`` steps.
            sharpen: ``True`` to move each end onto its limit after the search.
            enforce: ``True`` if the dispatcher enforces obligations that are bounds on differences of times.
            contains: a box to check instead of a search: ``{"dur_0": (8, 12)}``.
            timeout: the time-out of each action: a number of seconds, ``"none"``, or
                ``"10x,600"``, as by default: 10 times the planned duration, at least 600. The
                plan works as long as each quantity stays inside its interval and each action
                ends before its time-out; a box beyond it is not inside.
            most_checks: the maximum number of box checks.
            time_limit: limit in seconds; the box found until then is sound.
            progress: receives the progress; ``True`` shows a bar.

        Returns:
            An :class:`Envelope`. If the plan fails, it contains the reason. After Ctrl-C, it has
            the box found so far, which is sound.

        Raises:
            ReadError: if the plan cannot be read.
            RequestError: if a specification matches nothing in the plan, or the plan is
                beyond exact analysis.

        >>> envelope = problem.envelope(PLAN, sharpen=True)
        >>> [str(room.upper) for room in envelope.rows()][:2]
        ['320061/16000', '880093/16000']
        >>> bool(problem.envelope(PLAN, contains={"dur_0": (10, 12)}))
        True
        """
        wanted = [vary] if isinstance(vary, str) else list(vary)
        chosen = [controllable] if isinstance(controllable, str) else list(controllable)
        wanted += [f"controllable {action}" for action in chosen]
        options: dict[str, Any] = {
            "vary": wanted,
            "guarantee": guarantee,
            "method": method,
            "precision": None if precision is None else text(precision),
            "growth": growth,
            "sharpen": sharpen,
            "enforce": enforce,
            "contains": box(contains),
            "timeout": None if timeout is None else timeout_text(timeout),
        }
        if most_checks is not None:
            options["most_checks"] = most_checks
        answer, makespans, is_interrupted = self._native.envelope(
            self._plan_text(plan), json.dumps(options), checked_time_limit(time_limit), listener(progress)
        )
        found = document(answer)
        warn(is_interrupted, found["answer"] != "none")
        return Envelope(found, None if makespans is None else document(makespans))

    def odds(
        self,
        plan: AnyPlan | None = None,
        *,
        likelihoods: Text,
        world: Text | None = None,
        best: bool = False,
        semantics: str = "paper",
        executors: Sequence[str] | None = None,
        samples: int = 1000,
        seed: int = 0,
        most_sequences: int = 50_000,
        lattice: bool = False,
        self_overlap: bool = False,
        time_limit: float | None = None,
        progress: ProgressCallback | bool | None = None,
    ) -> Odds:
        """Computes the success probability of a plan, where it is lost, and possible improvements.

        Args:
            plan: a plan with fixed times; by default, the planner makes one, and its likeliest order is used.
            likelihoods: the likelihoods of facts and actions: a path or a text
                (``docs/reference/formats/likelihoods.md``).
            world: a world file, for executing the plan in samples of it.
            best: ``True`` for the likeliest order instead of that of the plan's times.
            semantics: the result of a failed effect: the opposite value (``"paper"``), or the unchanged
                fact (``"world"``).
            executors: the executors that execute the plan in the samples; by default those that
                ``elbowroom odds --help`` names.
            samples: the number of samples.
            seed: the random seed of the first sample; the others follow.
            most_sequences: the maximum number of partial orders in the search for the likeliest order.
            lattice: ``True`` to list and draw all orders.
            self_overlap: ``True`` to allow a ground action to overlap itself in new plans.
            time_limit: limit in seconds; the answer contains the results until then.
            progress: receives the progress; ``True`` shows a bar.

        Returns:
            The :class:`Odds`. If the plan fails or has no order, they contain the reason.

        Raises:
            ReadError: if a text cannot be read.
            UnsupportedError: if the likelihoods have no entry for something in the plan, or a condition
                couples too many facts.

        >>> likely = '''format = "elbowroom-likelihoods"
        ... version = 1
        ... defaults = { becomes_true = 0, becomes_false = 0, start = 0.9, effect = 1 }
        ... '''
        >>> odds = problem.odds(PLAN, likelihoods=likely)
        >>> round(odds.probability, 4), odds.rows()[0].reason
        (0.5905, 'start')
        """
        options: dict[str, Any] = {
            "semantics": semantics,
            "best": best,
            "most_sequences": most_sequences,
            "lattice": lattice,
            "self_overlap": self_overlap,
            "executors": None if executors is None else list(executors),
            "samples": samples,
            "seed": seed,
        }
        answer, svg, is_interrupted = _native.odds(
            self._native,
            None if plan is None else self._plan_text(plan),
            named_text(likelihoods, "likelihoods"),
            None if world is None else named_text(world, "world"),
            json.dumps(options),
            checked_time_limit(time_limit),
            listener(progress),
        )
        found = document(answer)
        warn(is_interrupted, found["answer"] != "none")
        return Odds(found, svg)


def _read_again(domain: tuple[str, str], problem: tuple[str, str], epsilon: str) -> Problem:
    native, found = _native.read(domain, problem, epsilon)
    return Problem(native, diagnostics(found), epsilon)
