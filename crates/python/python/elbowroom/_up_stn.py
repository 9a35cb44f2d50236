"""Conversion between networks and STN plans of unified-planning."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from unified_planning.model import TimepointKind
from unified_planning.plans import STNPlan
from unified_planning.plans.stn_plan import STNPlanNode

from ._errors import UnsupportedError
from ._numbers import exact, text
from ._up_translate import Translation


def stn_plan(translated: Translation, plan: Any) -> STNPlan:
    """Converts a plan, in any form that :class:`~elbowroom.Problem` reads, to an STN plan of unified-planning.

    Raises:
        RequestError: if the plan does not work.
    """
    stn = translated.problem.stn(plan)
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
        if whats[label] in translated.timed_actions:
            fixed[name] = translated.timed_actions[whats[label]]
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
        # Absolute times are expressed relative to the start of the plan.
        if source in fixed and target in kept:
            lower, upper = lower + fixed[source], upper + fixed[source]
        elif target in fixed and source in kept:
            source, target = target, source
            lower, upper = fixed[source] - upper, fixed[source] - lower
        elif source not in kept or target not in kept:
            continue
        first = kept.get(source, start)
        constraints.append((first, _finite(lower), _finite(upper), kept[target]))
    # An STN plan contains only the nodes of its constraints.
    mentioned = {node for first, _, _, second in constraints for node in (first, second)}
    for node in kept.values():
        if node not in mentioned:
            constraints.append((start, Fraction(0), None, node))
    return STNPlan(constraints, translated.original.environment)


def stn_text(translated: Translation, plan: STNPlan) -> str:
    """Converts an STN plan of unified-planning to an STN plan file.

    Raises:
        UnsupportedError: if it constrains the end of the plan, which has no counterpart.
    """
    labels: dict[Any, str] = {}
    lines: list[str] = []
    bounds: list[str] = []

    def node(of: STNPlanNode) -> str:
        if of.kind == TimepointKind.GLOBAL_START:
            return ".zero"
        instance = of.action_instance
        if instance is None:
            raise UnsupportedError("an STN plan with bounds on the plan's end is not supported")
        is_durative = hasattr(instance.action, "duration")
        if instance not in labels:
            labels[instance] = f"n{len(labels)}"
            kind = "durative-action" if is_durative else "action"
            lines.append(f"{kind} instance {labels[instance]} : {translated.name_of(instance)};")
            bounds.append(f"c: {labels[instance]}{'.start' if is_durative else ''} - .zero in [0, inf];")
        if not is_durative:
            return labels[instance]
        end = "start" if of.kind == TimepointKind.START else "end"
        return f"{labels[instance]}.{end}"

    for first, found in plan.get_constraints().items():
        for lower, upper, second in found:
            if lower is None and upper is None:
                # This is unified-planning's way to mention nodes.
                if second.kind != TimepointKind.GLOBAL_END:
                    node(second)
                continue
            if second.kind == TimepointKind.GLOBAL_END and not lower and upper is None:
                # Everything comes before the end.
                continue
            least = "-inf" if lower is None else text(lower)
            most = "inf" if upper is None else text(upper)
            bounds.append(f"c: {node(second)} - {node(first)} in [{least}, {most}];")
    for number, (action, time) in enumerate(translated.timed_actions.items()):
        lines.append(f"action instance t{number} : {action};")
        bounds.append(f"c: t{number} - .zero in [{text(time)}, {text(time)}];")
    return "\n".join([*lines, *bounds, ""])


def _finite(bound: Any) -> Fraction | None:
    number = exact(bound)
    return number if isinstance(number, Fraction) else None


def _instances(text: str) -> dict[str, str]:
    """Returns the action of each label of an STN plan file."""
    found = {}
    for line in text.splitlines():
        head, _, action = line.partition(":")
        words = head.split()
        if len(words) == 3 and words[1] == "instance":
            found[words[2]] = action.strip().rstrip(";").strip()
    return found
