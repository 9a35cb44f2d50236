"""Engines for unified-planning; importing this module registers them.

    import elbowroom.up
    from unified_planning.shortcuts import OneshotPlanner, PlanValidator

    with OneshotPlanner(name="elbowroom") as planner: ...
    with PlanValidator(name="elbowroom-val") as validator: ...

``elbowroom`` plans (once, or anytime, and so also as ``replanner[elbowroom]``), ``elbowroom-val``
judges sequential and time-triggered plans exactly. What unified-planning has no mode for are
functions here: :func:`envelope`, :func:`to_stn`, :func:`execute`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from fractions import Fraction
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
)
from unified_planning.engines.mixins.oneshot_planner import OptimalityGuarantee
from unified_planning.engines.results import FailedValidationReason
from unified_planning.model import Problem as UPProblem
from unified_planning.environment import get_environment
from unified_planning.model import ProblemKind, TimepointKind
from unified_planning.plans import PlanKind, STNPlan
from unified_planning.plans.stn_plan import STNPlanNode

from ._answers import Envelope, NoPlan, Run
from ._errors import UnsupportedError
from ._numbers import exact
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


def _common_kind() -> ProblemKind:
    kind = ProblemKind(version=2)
    kind.set_problem_class("ACTION_BASED")
    for feature in ("SIMPLE_NUMERIC_PLANNING", "GENERAL_NUMERIC_PLANNING"):
        kind.set_problem_type(feature)
    for feature in ("CONTINUOUS_TIME", "DISCRETE_TIME", "TIMED_EFFECTS", "DURATION_INEQUALITIES",
                    "SELF_OVERLAPPING"):  # fmt: skip
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


class ElbowroomPlanner(Engine, OneshotPlannerMixin, AnytimePlannerMixin):  # type: ignore[misc, unused-ignore]
    """Elbowroom's embedded planner."""

    def __init__(self, **options: Any) -> None:
        Engine.__init__(self)
        OneshotPlannerMixin.__init__(self)
        AnytimePlannerMixin.__init__(self)
        self.options = options

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
            warnings.warn("elbowroom has its own heuristic; the one given is not used", stacklevel=3)
        return self._result(problem, timeout, first=True)

    def _get_solutions(
        self, problem: Any, timeout: float | None = None, output_stream: IO[str] | None = None
    ) -> Iterator[PlanGenerationResult]:
        """The first plan; then, if there is time, the best until the time limit."""
        first = self._result(problem, timeout, first=True)
        is_solved = first.status in (
            PlanGenerationResultStatus.SOLVED_SATISFICING,
            PlanGenerationResultStatus.SOLVED_OPTIMALLY,
        )
        if not is_solved or timeout is None:
            yield first
            return
        yield PlanGenerationResult(
            PlanGenerationResultStatus.INTERMEDIATE, first.plan, self.name, first.metrics
        )
        yield self._result(problem, timeout, first=False)

    def _result(self, problem: Any, timeout: float | None, first: bool) -> PlanGenerationResult:
        status = PlanGenerationResultStatus
        try:
            translated = Translation(problem)
            found = translated.problem.plan(time_limit=timeout, first=first)
        except UnsupportedError as error:
            message = LogMessage(LogLevel.ERROR, str(error))
            return PlanGenerationResult(
                status.UNSUPPORTED_PROBLEM, None, self.name, log_messages=[message]
            )
        if isinstance(found, NoPlan):
            stop = found.document["stop"]
            outcome = {"time limit": status.TIMEOUT, "memory limit": status.MEMOUT}.get(
                stop, status.UNSOLVABLE_INCOMPLETELY
            )
            if found.is_proved:
                outcome = status.UNSOLVABLE_PROVEN
            message = LogMessage(LogLevel.INFO, found.reason)
            return PlanGenerationResult(outcome, None, self.name, log_messages=[message])
        metrics = {"makespan": str(found.makespan)}
        plan = translated.plan_back(found.steps)
        return PlanGenerationResult(status.SOLVED_SATISFICING, plan, self.name, metrics)


class ElbowroomValidator(Engine, PlanValidatorMixin):  # type: ignore[misc, unused-ignore]
    """Elbowroom's judge, with the rules of unified-planning.

    Without an ε in the problem, what happens at one time reads the state before, and nothing needs
    to be apart; with one, interfering happenings keep it. The goal holds after all timed effects.
    """

    def __init__(self, **options: Any) -> None:
        Engine.__init__(self)
        PlanValidatorMixin.__init__(self)
        self.options = options

    @property
    def name(self) -> str:
        return "elbowroom-val"

    @staticmethod
    def supported_kind() -> ProblemKind:
        kind = _common_kind()
        # Metrics say which plan is best, not which is valid.
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
        return plan_kind in (PlanKind.SEQUENTIAL_PLAN, PlanKind.TIME_TRIGGERED_PLAN)

    @staticmethod
    def get_credits(**kwargs: Any) -> Credits:
        return CREDITS

    def _validate(self, problem: Any, plan: Any) -> ValidationResult:
        translated = Translation(problem)
        rules = "pddl" if problem.epsilon else "unified-planning"
        verdict = translated.problem.check(translated.steps(plan), rules=rules)
        if verdict.violation is None:
            return ValidationResult(ValidationResultStatus.VALID, self.name, [])
        violation = verdict.violation
        is_goal = violation.action is None
        reason = FailedValidationReason
        message = LogMessage(LogLevel.INFO, violation.message)
        instance = None if is_goal else translated.instance(str(violation.action))
        return ValidationResult(
            ValidationResultStatus.INVALID,
            self.name,
            [message],
            reason=reason.UNSATISFIED_GOALS if is_goal else reason.INAPPLICABLE_ACTION,
            inapplicable_action=instance,
        )


def envelope(problem: UPProblem, plan: Any, **options: Any) -> Envelope:
    """How far each quantity of a plan may deviate while the plan still works.

    Options are those of :meth:`elbowroom.Problem.envelope`; actions in them have their names in PDDL,
    which are those of the problem in lower case.

    Raises:
        UnsupportedError: if the problem or the plan has what has no counterpart; it says what.
    """
    translated = Translation(problem)
    return translated.problem.envelope(translated.steps(plan), **options)


def to_stn(problem: UPProblem, plan: Any) -> STNPlan:
    """A plan with only the orders and bounds that it needs; durations have the domain's intervals.

    Unlike a conversion inside unified-planning, it does not freeze durations. An STN plan has no
    absolute times: what is fixed by timed effects counts from the plan's start.

    Raises:
        UnsupportedError: if the problem or the plan has what has no counterpart; it says what.
        RequestError: if the plan does not work.
    """
    translated = Translation(problem)
    stn = translated.problem.stn(translated.steps(plan))
    whats = _instances(stn.text)
    start = STNPlanNode(TimepointKind.GLOBAL_START)
    fixed: dict[str, Fraction] = {".zero": Fraction(0)}
    for node in stn.document["nodes"]:
        if node["time"] is not None:
            fixed[node["name"]] = node["time"]
    kept: dict[str, STNPlanNode] = {}
    made: dict[str, Any] = {}
    for name in stn.nodes:
        label, _, end = name.partition(".")
        if name in fixed or label not in whats:
            continue
        if label not in made:
            made[label] = translated.instance(whats[label])
        kind = {"start": TimepointKind.START, "end": TimepointKind.END}
        kept[name] = STNPlanNode(
            kind.get(end, TimepointKind.START), made[label]
        )
    constraints: list[Any] = []
    for row in stn.constraints:
        lower, upper = row.lower, row.upper
        if isinstance(lower, str) or isinstance(upper, str):
            continue
        source, target = row.from_, row.to
        # Absolute times are folded onto the plan's start.
        if source in fixed and target in kept:
            lower, upper = lower + fixed[source], upper + fixed[source]
        elif target in fixed and source in kept:
            source, target = target, source
            lower, upper = fixed[source] - upper, fixed[source] - lower
        elif source not in kept or target not in kept:
            continue
        first = kept.get(source, start)
        constraints.append((first, _finite(lower), _finite(upper), kept[target]))
    return STNPlan(constraints, problem.environment)


def _finite(bound: Any) -> Fraction | None:
    number = exact(bound)
    return number if isinstance(number, Fraction) else None


def _instances(text: str) -> dict[str, str]:
    """The action of each label of an STN plan file."""
    found = {}
    for line in text.splitlines():
        head, _, action = line.partition(":")
        words = head.split()
        if len(words) == 3 and words[1] == "instance":
            found[words[2]] = action.strip().rstrip(";").strip()
    return found


def execute(problem: UPProblem, plan: Any, **options: Any) -> Run:
    """Executes a plan; options are those of :meth:`elbowroom.Problem.run`.

    Raises:
        UnsupportedError: if the problem or the plan has what has no counterpart; it says what.
    """
    translated = Translation(problem)
    return translated.problem.run(translated.steps(plan), **options)


def register(environment: Any = None) -> None:
    """Adds the engines to an environment; done for the global one when this module is imported."""
    factory = (environment or get_environment()).factory
    for name, of in (("elbowroom", "ElbowroomPlanner"), ("elbowroom-val", "ElbowroomValidator")):
        if name not in factory.engines:
            factory.add_engine(name, __name__, of)


__all__ = ["ElbowroomPlanner", "ElbowroomValidator", "Translation", "envelope", "execute",
           "register", "to_stn"]  # fmt: skip
register()
