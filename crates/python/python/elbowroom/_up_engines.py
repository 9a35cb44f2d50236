"""The engines for unified-planning: :mod:`elbowroom.up` registers them."""

from __future__ import annotations

import difflib
import math
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import IO, Any

from unified_planning.engines import (
    Credits,
    Engine,
    LogLevel,
    LogMessage,
    PlanGenerationResult,
    PlanGenerationResultStatus,
    ValidationResult,
    ValidationResultStatus,
)
from unified_planning.engines.mixins import (
    AnytimePlannerMixin,
    OneshotPlannerMixin,
    PlanValidatorMixin,
    ReplannerMixin,
)
from unified_planning.engines.mixins.oneshot_planner import OptimalityGuarantee
from unified_planning.engines.results import FailedValidationReason
from unified_planning.exceptions import UPUsageError
from unified_planning.model import AbstractProblem, ProblemKind
from unified_planning.plans import PlanKind, STNPlan

from ._answers import NoPlan, Plan, Step
from ._errors import ReadError, UnsupportedError
from ._up_apart import apart
from ._up_stn import stn_plan, stn_text
from ._up_translate import Translation

CREDITS = Credits(
    "Elbowroom",
    "the authors of Elbowroom",
    "https://github.com/elbowroom/elbowroom",
    "https://github.com/elbowroom/elbowroom",
    "MIT OR Apache-2.0",
    "Temporal planning, exact validation, robustness envelopes",
    "Finds and judges temporal and numeric plans exactly, computes how far durations, rates and "
    "deadlines may deviate, and executes plans.",
)


_LONGEST = 1e9
"""Largest time limit in seconds, longer than any search. Larger limits, including infinite ones, are replaced by it."""


def _common_kind() -> ProblemKind:
    kind = ProblemKind(version=2)
    kind.set_problem_class("ACTION_BASED")
    for feature in ("SIMPLE_NUMERIC_PLANNING", "GENERAL_NUMERIC_PLANNING"):
        kind.set_problem_type(feature)
    for feature in ("CONTINUOUS_TIME", "TIMED_EFFECTS", "DURATION_INEQUALITIES", "SELF_OVERLAPPING"):
        kind.set_time(feature)
    for feature in ("STATIC_FLUENTS_IN_DURATIONS", "FLUENTS_IN_DURATIONS", "INT_TYPE_DURATIONS",
                    "REAL_TYPE_DURATIONS"):  # fmt: skip
        kind.set_expression_duration(feature)
    for feature in ("NEGATIVE_CONDITIONS", "DISJUNCTIVE_CONDITIONS", "EQUALITIES",
                    "EXISTENTIAL_CONDITIONS", "UNIVERSAL_CONDITIONS"):  # fmt: skip
        kind.set_conditions_kind(feature)
    for feature in ("CONDITIONAL_EFFECTS", "INCREASE_EFFECTS", "DECREASE_EFFECTS", "FORALL_EFFECTS",
                    "STATIC_FLUENTS_IN_BOOLEAN_ASSIGNMENTS", "FLUENTS_IN_BOOLEAN_ASSIGNMENTS",
                    "STATIC_FLUENTS_IN_NUMERIC_ASSIGNMENTS",
                    "FLUENTS_IN_NUMERIC_ASSIGNMENTS"):  # fmt: skip
        kind.set_effects_kind(feature)
    for feature in ("FLAT_TYPING", "HIERARCHICAL_TYPING"):
        kind.set_typing(feature)
    for feature in ("INT_FLUENTS", "REAL_FLUENTS"):
        kind.set_fluents_type(feature)
    kind.set_numbers("BOUNDED_TYPES")
    kind.set_initial_state("UNDEFINED_INITIAL_NUMERIC")
    for feature in ("ACTIONS_COST", "FINAL_VALUE", "MAKESPAN", "PLAN_LENGTH"):
        kind.set_quality_metrics(feature)
    for feature in ("STATIC_FLUENTS_IN_ACTIONS_COST", "FLUENTS_IN_ACTIONS_COST",
                    "INT_NUMBERS_IN_ACTIONS_COST", "REAL_NUMBERS_IN_ACTIONS_COST"):  # fmt: skip
        kind.set_actions_cost_kind(feature)
    return kind


class ElbowroomPlanner(
    Engine, OneshotPlannerMixin, AnytimePlannerMixin, ReplannerMixin  # type: ignore[misc, unused-ignore]
):
    """Elbowroom's embedded planner.

    Plans of temporal problems are returned as time-triggered plans or, with ``params={"plan": "stn"}``, as
    STN plans. As a replanner it keeps its last plan as long as the plan is valid.

    Parameters: ``jobs``, the number of threads (0: one for each processor); ``memory``, the approximate memory limit in
    bytes; ``time_limit``, in seconds, which also applies to calls without a ``timeout``; ``seed``, which has no effect,
    because the search draws no random numbers; ``plan``, the kind of plan.
    """

    def __init__(
        self,
        problem: Any = None,
        error_on_failed_checks: bool = True,
        *,
        plan: str = "time-triggered",
        jobs: int | None = None,
        memory: int | None = None,
        seed: int | None = None,
        time_limit: float | None = None,
        **unknown: Any,
    ) -> None:
        if not isinstance(problem, (AbstractProblem, type(None))):
            # Only replanners are created for a problem.
            unknown = {"problem": problem, **unknown}
        _refuse_unknown(unknown, "elbowroom", ("plan", "jobs", "memory", "seed", "time_limit"))
        Engine.__init__(self)
        OneshotPlannerMixin.__init__(self)
        AnytimePlannerMixin.__init__(self)
        if plan not in ("time-triggered", "stn"):
            raise UPUsageError(f"unknown kind of plans {plan!r}; expected time-triggered or stn")
        self._plan_kind = plan
        self._last: Any = None
        _whole("seed", seed, None)
        self._options: dict[str, Any] = {
            "jobs": _whole("jobs", jobs, range(1 << 16)),
            "memory": _whole("memory", memory, range(1 << 20, 1 << 63)),
        }
        self._time_limit = _positive("time_limit", time_limit)
        if problem is not None:
            ReplannerMixin.__init__(self, problem, error_on_failed_checks)

    @property
    def name(self) -> str:
        return "elbowroom"

    @staticmethod
    def supported_kind() -> ProblemKind:
        return _common_kind()

    @staticmethod
    def supports(problem_kind: ProblemKind) -> bool:
        return bool(problem_kind <= ElbowroomPlanner.supported_kind())

    @staticmethod
    def satisfies(optimality_guarantee: OptimalityGuarantee) -> bool:
        return bool(optimality_guarantee == OptimalityGuarantee.SATISFICING)

    @staticmethod
    def ensures(anytime_guarantee: Any) -> bool:
        return False

    @staticmethod
    def get_credits(**kwargs: Any) -> Credits:
        return CREDITS

    def _solve(
        self,
        problem: Any,
        heuristic: Callable[[Any], float | None] | None = None,
        timeout: float | None = None,
        output_stream: IO[str] | None = None,
    ) -> PlanGenerationResult:
        if heuristic is not None:
            warnings.warn("elbowroom uses its own heuristic; the given one is ignored", stacklevel=3)
        # Without a limit the search stops at the first plan; with one, it uses the whole time.
        timeout = self._limit(timeout)
        return self._result(problem, timeout, first=timeout is None)

    def _get_solutions(
        self, problem: Any, timeout: float | None = None, output_stream: IO[str] | None = None
    ) -> Iterator[PlanGenerationResult]:
        """Yields each better plan as soon as it is found and, at the end, the best one again, within the time limit."""
        begun = time.monotonic()
        try:
            translated = Translation(problem)
            plans = translated.problem.plans(
                time_limit=_left(self._limit(timeout), begun),
                self_overlap=bool(problem.self_overlapping),
                **self._options,
            )
        except (UnsupportedError, ReadError) as error:
            yield self._unsupported(error)
            return
        last: PlanGenerationResult | None = None
        try:
            for found in plans:
                result = self._with_plan(translated, found)
                if result.plan is not None:
                    yield PlanGenerationResult(
                        PlanGenerationResultStatus.INTERMEDIATE, result.plan, self.name, result.metrics
                    )
                if last is None or result.plan is not None:
                    last = result
        except UnsupportedError as error:
            yield self._unsupported(error)
            return
        finally:
            # Runs even if the caller stops the iteration.
            plans.close()
        if last is not None:
            yield last
        elif isinstance(plans.answer, NoPlan):
            yield self._without_plan(translated, plans.answer)

    def _limit(self, timeout: float | None) -> float | None:
        """Returns the shorter of the two time limits."""
        return min((it for it in (timeout, self._time_limit) if it is not None), default=None)

    def _result(self, problem: Any, timeout: float | None, first: bool) -> PlanGenerationResult:
        begun = time.monotonic()
        try:
            translated = Translation(problem)
            found = translated.problem.plan(
                time_limit=_left(self._limit(timeout), begun),
                first=first,
                self_overlap=bool(problem.self_overlapping),
                **self._options,
            )
        except (UnsupportedError, ReadError) as error:
            return self._unsupported(error)
        if isinstance(found, NoPlan):
            return self._without_plan(translated, found)
        return self._with_plan(translated, found)

    def _unsupported(self, error: Exception) -> PlanGenerationResult:
        message = LogMessage(LogLevel.ERROR, str(error))
        return PlanGenerationResult(
            PlanGenerationResultStatus.UNSUPPORTED_PROBLEM, None, self.name, log_messages=[message]
        )

    def _with_plan(self, translated: Translation, found: Plan) -> PlanGenerationResult:
        """Returns the result for a plan, if the plan satisfies unified-planning's rules."""
        status = PlanGenerationResultStatus
        steps = apart(translated, [_on_time(translated, step) for step in found.steps])
        if steps is None:
            text = (
                "no plan found: the plan that was found has steps that write the same fact at "
                "the same time, which unified-planning does not allow, and they cannot be "
                "separated"
            )
            message = LogMessage(LogLevel.INFO, text)
            return PlanGenerationResult(
                status.UNSOLVABLE_INCOMPLETELY, None, self.name, log_messages=[message]
            )
        ends = (s.start + (s.duration or 0) for s in steps if s.action not in translated.timed_actions)
        metrics = {"makespan": str(max(ends, default=0))}
        plan: Any = translated.plan_back(steps)
        if self._plan_kind == "stn" and plan.kind == PlanKind.TIME_TRIGGERED_PLAN:
            plan = stn_plan(translated, translated.steps(plan))
        return PlanGenerationResult(status.SOLVED_SATISFICING, plan, self.name, metrics)

    def _without_plan(self, translated: Translation, found: NoPlan) -> PlanGenerationResult:
        """Returns the result without a plan. It is proved only by a certificate that holds under unified-planning's rules."""
        status = PlanGenerationResultStatus
        outcome = {"time limit": status.TIMEOUT, "memory limit": status.MEMOUT}.get(
            found.document["stop"], status.UNSOLVABLE_INCOMPLETELY
        )
        reason = found.reason
        if found.is_proved and translated.is_refuted_by(found.document["certificate"]):
            outcome = status.UNSOLVABLE_PROVEN
        elif found.is_proved:
            outcome = status.UNSOLVABLE_INCOMPLETELY
            reason = (
                "no plan found: none exists with interfering actions at least 0.001 apart, but "
                "the problem has no epsilon, so a plan with smaller separations may exist"
            )
        message = LogMessage(LogLevel.INFO, reason)
        return PlanGenerationResult(outcome, None, self.name, log_messages=[message])

    # Interface of replanners: the problem is a copy that changes.

    def _resolve(
        self, timeout: float | None = None, output_stream: IO[str] | None = None
    ) -> PlanGenerationResult:
        if self._last is not None and self._still_works(self._last.plan):
            return self._last
        found = self._result(self._problem, timeout, first=True)
        self._last = found if found.plan is not None else None
        return found

    def _still_works(self, plan: Any) -> bool:
        """Returns ``True`` if an earlier plan solves the changed problem."""
        known = {action.name: action for action in self._problem.actions}
        used = getattr(plan, "timed_actions", None)
        if used is not None:
            used = [instance for _, instance, _ in used]
        elif hasattr(plan, "actions"):
            used = plan.actions
        else:
            # All schedules of an STN plan would have to be validated; a new search is faster.
            return False
        if any(known.get(it.action.name) != it.action for it in used):
            return False
        try:
            translated = Translation(self._problem)
            return bool(translated.check(translated.steps(plan)))
        except UnsupportedError:
            return False

    def _update_initial_value(self, fluent: Any, value: Any) -> None:
        self._problem.set_initial_value(fluent, value)

    def _add_goal(self, goal: Any) -> None:
        self._problem.add_goal(goal)

    def _remove_goal(self, goal: Any) -> None:
        (goal,) = self._problem.environment.expression_manager.auto_promote(goal)
        goals = self._problem.goals
        self._complain_unless(goal in goals, f"unknown goal {goal}; expected one of {goals}")
        self._problem.clear_goals()
        for other in goals:
            if other != goal:
                self._problem.add_goal(other)

    def _add_action(self, action: Any) -> None:
        self._problem.add_action(action)

    def _remove_action(self, name: str) -> None:
        actions = self._problem.actions
        names = [action.name for action in actions]
        self._complain_unless(name in names, f"unknown action {name}; expected one of {names}")
        self._problem.clear_actions()
        for action in actions:
            if action.name != name:
                self._problem.add_action(action)

    def _complain_unless(self, is_there: bool, message: str) -> None:
        if is_there or self.skip_checks:
            return
        if self.error_on_failed_checks:
            raise UPUsageError(message)
        warnings.warn(message, stacklevel=4)


class ElbowroomValidator(Engine, PlanValidatorMixin):  # type: ignore[misc, unused-ignore]
    """Elbowroom's validator, with the rules of unified-planning.

    If the problem has no ε, simultaneous happenings read the state before them, and no separation is required. If it has
    one, interfering happenings are at least ε apart. In both cases no two actions write the same fact at the same time.
    Like unified-planning's own validator, it does not check whether actions overlap themselves
    (``problem.self_overlapping``). The goal must hold after all timed effects.
    """

    def __init__(self, **unknown: Any) -> None:
        _refuse_unknown(unknown, "elbowroom-val", ())
        Engine.__init__(self)
        PlanValidatorMixin.__init__(self)

    @property
    def name(self) -> str:
        return "elbowroom-val"

    @staticmethod
    def supported_kind() -> ProblemKind:
        kind = _common_kind()
        # Metrics rank plans and do not affect their validity.
        for feature in ("OVERSUBSCRIPTION", "TEMPORAL_OVERSUBSCRIPTION"):
            kind.set_quality_metrics(feature)
        for feature in ("INT_NUMBERS_IN_OVERSUBSCRIPTION", "REAL_NUMBERS_IN_OVERSUBSCRIPTION"):
            kind.set_oversubscription_kind(feature)
        return kind

    @staticmethod
    def supports(problem_kind: ProblemKind) -> bool:
        return bool(problem_kind <= ElbowroomValidator.supported_kind())

    @staticmethod
    def supports_plan(plan_kind: PlanKind) -> bool:
        return plan_kind in (
            PlanKind.SEQUENTIAL_PLAN, PlanKind.TIME_TRIGGERED_PLAN, PlanKind.STN_PLAN
        )  # fmt: skip

    @staticmethod
    def get_credits(**kwargs: Any) -> Credits:
        return CREDITS

    def _validate(self, problem: Any, plan: Any) -> ValidationResult:
        try:
            translated = Translation(problem)
            if isinstance(plan, STNPlan):
                return self._validate_network(translated, plan)
            steps = translated.steps(plan)
        except UnsupportedError as error:
            message = LogMessage(LogLevel.ERROR, str(error))
            return ValidationResult(ValidationResultStatus.UNKNOWN, self.name, [message])
        verdict = translated.check(steps)
        if verdict:
            return ValidationResult(ValidationResultStatus.VALID, self.name, [])
        violation = verdict.violation
        if violation is None:
            message = LogMessage(LogLevel.INFO, str(verdict))
            return ValidationResult(ValidationResultStatus.UNKNOWN, self.name, [message])
        is_goal = violation.action is None
        reason = FailedValidationReason
        message = LogMessage(LogLevel.INFO, violation.message)
        instance = None
        if not is_goal and violation.action not in translated.timed_actions:
            instance = translated.instance(str(violation.action))
        return ValidationResult(
            ValidationResultStatus.INVALID,
            self.name,
            [message],
            reason=reason.UNSATISFIED_GOALS if is_goal else reason.INAPPLICABLE_ACTION,
            inapplicable_action=instance,
        )

    def _validate_network(self, translated: Translation, plan: STNPlan) -> ValidationResult:
        """Returns ``True`` if the network has schedules, and each of them is a valid plan, with ε."""
        found = translated.problem.envelope(stn_text(translated, plan), most_checks=1)
        if found:
            return ValidationResult(ValidationResultStatus.VALID, self.name, [])
        message = LogMessage(LogLevel.INFO, found.why_not or found.answer)
        return ValidationResult(ValidationResultStatus.INVALID, self.name, [message])


def _on_time(translated: Translation, step: Step) -> Step:
    """Returns a step; a step that represents timed effects gets their time."""
    return step._replace(start=translated.timed_actions.get(step.action, step.start))


def _left(timeout: float | None, begun: float) -> float | None:
    """Returns the remaining time limit after the translation, whose time is included."""
    return None if timeout is None else min(max(timeout - (time.monotonic() - begun), 0.001), _LONGEST)


def _refuse_unknown(unknown: dict[str, Any], engine: str, known: Sequence[str]) -> None:
    """Raises an error for the first parameter that the engine does not have."""
    for name in unknown:
        close = difflib.get_close_matches(name, known, 1)
        advice = f"did you mean {close[0]!r}?" if close else f"it has {', '.join(known) or 'none'}"
        raise UPUsageError(f"{engine} has no parameter {name!r}; {advice}")


def _whole(name: str, value: Any, allowed: range | None) -> int | None:
    """Reads a parameter that is a whole number, possibly as text."""
    if value is None:
        return None
    number = None
    try:
        if not isinstance(value, bool) and (isinstance(value, str) or int(value) == value):
            number = int(value)
    except (TypeError, ValueError, OverflowError):
        pass
    if number is None:
        raise UPUsageError(f"{name} must be a whole number, not {value!r}")
    if allowed is not None and number not in allowed:
        unit = " bytes" if name == "memory" else ""
        raise UPUsageError(
            f"{name} must be between {allowed.start} and {allowed.stop - 1}{unit}, not {value!r}"
        )
    return number


def _positive(name: str, value: Any) -> float | None:
    """Reads a parameter that is a positive number, possibly as text."""
    if value is None:
        return None
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if isinstance(value, bool) or not 0 < number < math.inf:
        raise UPUsageError(f"{name} must be a positive number of seconds, not {value!r}")
    return number
