"""Prints the table of docs/reference/python.md: unified-planning's own test cases, for several engines.

    python crates/python/tests/conformance.py [SECONDS]

It needs unified-planning; Aries is beside it where `up-aries` is installed, and the cases of `up_test_cases`
where that can be imported (it is in unified-planning's source package, `pip download --no-binary`). A planner has SECONDS (20) for
each case, and its plans are judged by unified-planning's own validators, by the rule "one that supports the
problem and the plan".
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
import sys
import warnings
from collections import Counter, defaultdict
from typing import Any

warnings.filterwarnings("ignore")

import unified_planning as up  # noqa: E402
from unified_planning.engines import PlanGenerationResultStatus as Status  # noqa: E402
from unified_planning.engines import ValidationResultStatus as Judged  # noqa: E402
from unified_planning.shortcuts import OneshotPlanner, PlanValidator, get_environment  # noqa: E402
from unified_planning.test.examples import get_example_problems  # noqa: E402

import elbowroom.up  # noqa: E402, F401

JUDGES = ["elbowroom-val", "sequential_plan_validator", "up_time_triggered_validator", "aries-val"]
OWN = ["sequential_plan_validator", "up_time_triggered_validator"]
PLANNERS = ["elbowroom", "aries"]
SOLVED = (Status.SOLVED_SATISFICING, Status.SOLVED_OPTIMALLY)


def more_cases() -> dict[str, Any]:
    """Those of `up_test_cases`, some of which read files that the source package lacks."""
    found: dict[str, Any] = {}
    there = importlib.util.find_spec("up_test_cases")
    if there is None:
        return found
    # Its modules are next to the script.
    sys.path.extend(there.submodule_search_locations or [])
    package = importlib.import_module("builtin")
    for module in pkgutil.walk_packages(package.__path__, "builtin.", onerror=lambda _: None):
        try:
            cases = importlib.import_module(module.name).get_test_cases()
        except AttributeError:
            continue
        except Exception as error:
            print(f"{module.name} cannot be read: {type(error).__name__}", file=sys.stderr)
            continue
        for name, case in cases.items():
            found.setdefault(f"{module.name.rpartition('.')[2]}:{name}", case)
    return found


def engine_class(name: str) -> Any:
    factory = get_environment().factory
    return factory.engine(name) if name in factory.engines else None


def unsupported(name: str, problem: Any) -> str | None:
    """Why an engine refuses a problem, in a few words."""
    if type(problem).__name__ != "Problem":
        return f"a {type(problem).__name__}"
    supported = engine_class(name).supported_kind().features
    missing = sorted(problem.kind.features - supported)
    return ", ".join(missing) if missing else None


def judge(name: str, problem: Any, plan: Any) -> str:
    """``valid``, ``invalid``, ``refused``, or what it raised."""
    of = engine_class(name)
    if unsupported(name, problem) or not of.supports_plan(plan.kind):
        return "refused"
    try:
        with PlanValidator(name=name) as validator:
            status = validator.validate(problem, plan).status
    except Exception as error:
        return f"raised {type(error).__name__}"
    return {Judged.VALID: "valid", Judged.INVALID: "invalid"}.get(status, "undecided")


def by_own(problem: Any, plan: Any) -> str:
    found = {judge(name, problem, plan) for name in OWN} & {"valid", "invalid"}
    return found.pop() if len(found) == 1 else "-"


def main(seconds: float) -> None:
    get_environment().credits_stream = None
    cases = {**get_example_problems(), **more_cases()}
    plans = [
        (name, case.problem, plan, expected)
        for name, case in cases.items()
        for expected, found in (("valid", case.valid_plans), ("invalid", case.invalid_plans))
        for plan in found or []
    ]
    print(f"unified-planning {up.__version__}: {len(cases)} cases, {len(plans)} plans\n")
    print("| validator | judged | as the case says | otherwise | refused |")
    print("|---|---:|---:|---|---:|")
    for name in JUDGES:
        if engine_class(name) is None:
            print(f"| `{name}` | not installed | | | |")
            continue
        found = Counter()
        odd: list[str] = []
        for case, problem, plan, expected in plans:
            verdict = judge(name, problem, plan)
            found["refused" if verdict == "refused" else "judged"] += 1
            if verdict == expected:
                found["agree"] += 1
            elif verdict != "refused":
                odd.append(f"{case} ({verdict}; unified-planning: {by_own(problem, plan)})")
        print(
            f"| `{name}` | {found['judged']} | {found['agree']} | {'; '.join(odd)} | {found['refused']} |"
        )
    print()
    print("| planner | supported | solved | of these judged valid by unified-planning | said to have no plan, rightly | otherwise |")
    print("|---|---:|---:|---:|---:|---|")
    why: dict[str, list[str]] = defaultdict(list)
    for name in PLANNERS:
        if engine_class(name) is None:
            print(f"| `{name}` | not installed | | | | |")
            continue
        found = Counter()
        odd = []
        for case, it in cases.items():
            missing = unsupported(name, it.problem)
            if missing:
                if name == "elbowroom":
                    why[missing].append(case)
                continue
            found["supported"] += 1
            try:
                with OneshotPlanner(name=name) as planner:
                    result = planner.solve(it.problem, timeout=seconds)
            except Exception as error:
                odd.append(f"{case} (raised {type(error).__name__})")
                continue
            if result.status in SOLVED and it.solvable:
                found["solved"] += 1
                verdict = by_own(it.problem, result.plan)
                found[verdict] += 1
                if verdict != "valid":
                    odd.append(f"{case} (its plan: {verdict})")
            elif result.status not in SOLVED and not it.solvable:
                found["refuted"] += 1
            else:
                odd.append(f"{case} ({result.status.name.lower()})")
        print(
            f"| `{name}` | {found['supported']} | {found['solved']} | {found['valid']} | "
            f"{found['refuted']} | {'; '.join(odd)} |"
        )
    print("\n| refused by `elbowroom` because of | cases |\n|---|---:|")
    for missing, found_cases in sorted(why.items(), key=lambda it: (-len(it[1]), it[0])):
        print(f"| {missing} | {len(found_cases)} |")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 20)
