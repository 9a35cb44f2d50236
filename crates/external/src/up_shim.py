"""Between Elbowroom and the engines of unified-planning: PDDL files in, plans in IPC format out.

    up_shim.py ENGINE DOMAIN PROBLEM SECONDS

Plans go to standard output, each with a line `; Plan found` before and an empty line after it; the
last is the best. Times are exact, as `21/10`. How it ended without one is said in a line that
begins with `elbowroom: unsolvable`, `elbowroom: gave up`, `elbowroom: unsupported` or
`elbowroom: missing`.

ENGINE is the name of an engine that unified-planning lists, or MODULE:CLASS for one that it does not.

PDDL's numbers are reals. For an engine that only knows integers they are read as integers; where a
number is none, the problem is unsupported.
"""

import sys
import warnings
from fractions import Fraction

UNSUPPORTED, MISSING = 4, 5


def unsupported(reason):
    first = str(reason).strip().splitlines()[:1] or [type(reason).__name__]
    print(f"elbowroom: unsupported: {first[0]}", flush=True)
    sys.exit(UNSUPPORTED)


try:
    import unified_planning as up
    from unified_planning.engines import PlanGenerationResultStatus as Status
    from unified_planning.io import PDDLReader
    from unified_planning.plans import PlanKind
    from unified_planning.shortcuts import AnytimePlanner, OneshotPlanner
except ImportError as error:
    print(f"elbowroom: missing: {error} ({sys.executable})", flush=True)
    sys.exit(MISSING)


def read(domain, problem, integers):
    """The problem; its numbers as integers, if asked."""
    types = up.environment.get_environment().type_manager
    if integers:
        types.RealType = lambda lower_bound=None, upper_bound=None: types.IntType()
    try:
        return PDDLReader().parse_problem(domain, problem)
    finally:
        if integers:
            del types.RealType


def has_fractions(task):
    """Whether a duration or an initial value is no integer."""
    values = task.explicit_initial_values.values()
    return "REAL_TYPE_DURATIONS" in task.kind.features or any(v.is_real_constant() for v in values)


def line(start, action, duration):
    arguments = " ".join([action.action.name, *map(str, action.actual_parameters)])
    length = "" if duration is None else f" [{Fraction(duration)}]"
    when = "" if start is None else f"{Fraction(start)}: "
    return f"{when}({arguments}){length}"


def show(plan, problem):
    if plan.kind == PlanKind.TIME_TRIGGERED_PLAN:
        lines = [line(*step) for step in plan.timed_actions]
    else:
        if plan.kind != PlanKind.SEQUENTIAL_PLAN:
            plan = plan.convert_to(PlanKind.SEQUENTIAL_PLAN, problem)
        lines = [line(None, action, None) for action in plan.actions]
    print("; Plan found", *lines, "", sep="\n", flush=True)


def results(engine, problem, seconds):
    """What the engine finds, one after the other."""
    factory = up.environment.get_environment().factory
    if factory.engine(engine).is_anytime_planner():
        with AnytimePlanner(name=engine) as planner:
            planner.skip_checks = True
            yield from planner.get_solutions(problem, timeout=seconds)
    else:
        with OneshotPlanner(name=engine) as planner:
            planner.skip_checks = True
            yield planner.solve(problem, timeout=seconds)


def main():
    engine, domain, problem, seconds = sys.argv[1:]
    warnings.simplefilter("ignore")
    environment = up.environment.get_environment()
    environment.credits_stream = None
    # In PDDL an object may have the name of its type.
    environment.error_used_name = False
    if ":" in engine:
        module, _, name = engine.partition(":")
        try:
            environment.factory.add_engine(engine, module, name)
        except (ImportError, AttributeError) as error:
            print(f"elbowroom: missing: {error} ({sys.executable})", flush=True)
            sys.exit(MISSING)
    elif engine not in environment.factory.engines:
        known = ", ".join(sorted(environment.factory.engines))
        print(f"elbowroom: missing: unknown engine `{engine}`; known are {known}", flush=True)
        sys.exit(MISSING)
    knows_reals = "REAL_FLUENTS" in environment.factory.engine(engine).supported_kind().features
    try:
        task = read(domain, problem, integers=not knows_reals)
        if not knows_reals and has_fractions(task):
            unsupported(f"{engine} supports only integers, and this problem has other numbers")
    except SystemExit:
        raise
    except Exception as error:
        unsupported(error)

    status, shown = None, False
    try:
        for result in results(engine, task, float(seconds)):
            status = result.status
            if result.plan is not None:
                show(result.plan, task)
                shown = True
            for message in result.log_messages or []:
                print(message.message, file=sys.stderr, flush=True)
    except Exception as error:
        if not shown:
            unsupported(error)
        print(f"{engine} stopped: {error}", file=sys.stderr, flush=True)
    if shown:
        return 0
    if status == Status.UNSOLVABLE_PROVEN:
        print(f"elbowroom: unsolvable: {engine} has proved it", flush=True)
    elif status == Status.UNSUPPORTED_PROBLEM:
        unsupported(f"{engine} does not support this problem")
    elif status == Status.MEMOUT:
        print("out of memory", file=sys.stderr, flush=True)
        return 1
    elif status in (Status.TIMEOUT, Status.UNSOLVABLE_INCOMPLETELY, None):
        reason = status.name if status else "no answer"
        print(f"elbowroom: gave up: {engine} ended with {reason}", flush=True)
    else:
        print(f"{engine} ended with {status.name}", file=sys.stderr, flush=True)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
