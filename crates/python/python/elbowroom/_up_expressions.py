"""Names and expressions of unified-planning's problems in PDDL, exactly."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fractions import Fraction
from typing import Any

from unified_planning.model import FNode, OperatorKind, Problem as UPProblem
from unified_planning.model.walkers.identitydag import IdentityDagWalker

from ._errors import UnsupportedError

# Reserved words.
_TAKEN = frozenset(
    "define domain problem requirements types constants predicates functions action process event "
    "durative-action derived parameters precondition condition effect duration vars init goal "
    "metric objects and or not imply exists forall when at over start end all increase decrease "
    "assign scale-up scale-down minimize maximize total-time object number either constraints "
    "always sometime within at-most-once preference is-violated undefined".split()
)
_INITIAL = {"type": "t", "object": "o", "fluent": "f", "action": "a", "timed": "t"}


class Expressions:
    """Converter of a problem's names, conditions, numbers and effects to PDDL."""

    def __init__(self, problem: UPProblem, taken: Iterable[str]) -> None:
        self._names: dict[tuple[str, Any], str] = {}
        self._used = {*_TAKEN, *taken}
        self._variables: dict[tuple[type, str, Any], str] = {}
        self._problem = problem
        self._without_empty = _WithoutEmptyTypes(self)
        self._simplify = problem.environment.simplifier.simplify

    def simplify(self, expression: FNode) -> FNode:
        """Returns the expression without its static parts."""
        # The simplifier removes quantified variables that do not occur, which is wrong for types without objects.
        return self._simplify(self._without_empty.walk(expression))

    def ranges_over_nothing(self, variables: Iterable[Any]) -> bool:
        """Returns ``True`` if the problem has no object for one of the variables. It need not declare the type of that one."""
        return any(
            it.type.is_user_type() and next(iter(self._problem.objects(it.type)), None) is None
            for it in variables
        )

    def name(self, kind: str, thing: Any) -> str:
        """Returns the PDDL name of an item, the same in each call."""
        key = (kind, thing.name if hasattr(thing, "name") else str(thing))
        if key not in self._names:
            clean = re.sub(r"[^a-z0-9_-]", "_", key[1].lower())
            if not clean[:1].isalpha():
                clean = _INITIAL[kind] + "_" + clean
            name, number = clean, 1
            while name in self._used:
                number += 1
                name = f"{clean}_{number}"
            self._used.add(name)
            self._names[key] = name
        return self._names[key]

    def variable(self, of: Any) -> str:
        """Returns the name of a parameter or a variable, with its question mark: unique, and the same in each call."""
        key = (type(of), of.name, of.type)
        if key not in self._variables:
            clean = re.sub(r"[^a-z0-9_-]", "_", of.name.lower())
            if not clean[:1].isalpha():
                clean = "v_" + clean
            name, number = clean, 1
            while name in self._variables.values():
                number += 1
                name = f"{clean}_{number}"
            self._variables[key] = name
        return "?" + self._variables[key]

    def declared(self, variables: Iterable[Any]) -> str:
        """Returns the PDDL declaration of parameters or variables with their types."""
        return " ".join(f"{self.variable(it)} - {self.type_name(it.type)}" for it in variables)

    def target(self, e: FNode) -> str:
        """Converts a fluent that is the target of an effect."""
        args = [self.walk(arg) for arg in e.args]
        return f"({' '.join([self.name('fluent', e.fluent()), *args])})"

    def type_name(self, of: Any) -> str:
        """Returns the name of a user type."""
        if not of.is_user_type():
            raise UnsupportedError(f"a parameter of type {of}; only user types are supported")
        return self.name("type", of)

    def condition(self, expression: FNode) -> str:
        """Converts a condition or a number to PDDL."""
        return self.walk(self.simplify(expression))

    def walk(self, e: FNode) -> str:
        """Converts an expression to PDDL without simplification."""
        args = [self.walk(arg) for arg in e.args]
        if e.is_bool_constant():
            return "(and)" if e.is_true() else "(or)"
        if e.is_int_constant() or e.is_real_constant():
            return str(Fraction(e.constant_value()))
        if e.is_object_exp():
            return self.name("object", e.object())
        if e.is_parameter_exp():
            return self.variable(e.parameter())
        if e.is_variable_exp():
            return self.variable(e.variable())
        if e.is_fluent_exp():
            return self.target(e)
        is_truth = e.is_equals() and any(arg.type.is_bool_type() for arg in e.args)
        if e.is_iff() or is_truth:
            return f"(and (imply {args[0]} {args[1]}) (imply {args[1]} {args[0]}))"
        if e.is_exists() or e.is_forall():
            bound = self.declared(e.variables())
            return f"({'exists' if e.is_exists() else 'forall'} ({bound}) {args[0]})"
        operator = _OPERATORS.get(e.node_type)
        if operator is None:
            raise UnsupportedError(f"the expression {e} is not supported")
        if operator in ("+", "*"):
            folded = args[0]
            for arg in args[1:]:
                folded = f"({operator} {folded} {arg})"
            return folded
        return f"({operator} {' '.join(args)})"

    def effect(self, effect: Any) -> str:
        """Converts an effect, with its condition and its forall. Returns an empty text for an effect without consequences."""
        if self.ranges_over_nothing(effect.forall):
            return ""
        target = self.target(effect.fluent)
        made: list[str]
        if effect.is_increase() or effect.is_decrease():
            word = "increase" if effect.is_increase() else "decrease"
            made = [f"({word} {target} {self.condition(effect.value)})"]
        elif not effect.is_assignment():
            raise UnsupportedError(f"the effect {effect} is not supported")
        elif effect.fluent.type.is_bool_type():
            value = self.simplify(effect.value)
            if value.is_bool_constant():
                made = [target if value.is_true() else f"(not {target})"]
            else:
                truth = self.walk(value)
                made = [f"(when {truth} {target})", f"(when (not {truth}) (not {target}))"]
        else:
            value = self.condition(effect.value)
            made = [f"(assign {target} {value})"]
        condition, forall = effect.condition, effect.forall
        if forall and self._assigns_one_number(effect):
            # In PDDL the same number several times is a conflict.
            condition, forall = effect.environment.expression_manager.Exists(condition, *forall), ()
        condition = self.simplify(condition)
        if not condition.is_true():
            guard = self.walk(condition)
            made = [_when(guard, it) for it in made]
        if forall:
            bound = self.declared(forall)
            made = [f"(forall ({bound}) {it})" for it in made]
        return " ".join(made)


    def _assigns_one_number(self, effect: Any) -> bool:
        """Returns ``True`` if an effect for all objects assigns the same number to the same fluent for each object."""
        if not effect.is_assignment() or effect.fluent.type.is_bool_type():
            return False
        free = effect.environment.free_vars_oracle.get_free_variables
        return not (free(effect.fluent) | free(effect.value)) & set(effect.forall)


class _WithoutEmptyTypes(IdentityDagWalker):  # type: ignore[misc, unused-ignore]
    """Replaces quantifiers over types without objects by their constant values."""

    def __init__(self, say: Expressions) -> None:
        IdentityDagWalker.__init__(self, say._problem.environment)
        self._say = say

    def walk_exists(self, expression: FNode, args: list[FNode], **kwargs: Any) -> FNode:
        if self._say.ranges_over_nothing(expression.variables()):
            return self.manager.FALSE()
        return IdentityDagWalker.walk_exists(self, expression, args, **kwargs)

    def walk_forall(self, expression: FNode, args: list[FNode], **kwargs: Any) -> FNode:
        if self._say.ranges_over_nothing(expression.variables()):
            return self.manager.TRUE()
        return IdentityDagWalker.walk_forall(self, expression, args, **kwargs)


def _when(guard: str, change: str) -> str:
    """Adds a condition to a change."""
    inner = re.fullmatch(r"\(when (.*)\)", change)
    if inner is None:
        return f"(when {guard} {change})"
    # `(when A x)` under B: A is the first expression.
    first, rest = first_of(inner.group(1))
    return f"(when (and {guard} {first}) {rest})"


def first_of(text: str) -> tuple[str, str]:
    """Returns the first expression of a text, and the remaining text."""
    depth = 0
    for index, letter in enumerate(text):
        depth += {"(": 1, ")": -1}.get(letter, 0)
        if depth == 0 and letter in ") ":
            return text[: index + 1].strip(), text[index + 1 :].strip()
    return text, ""


_OPERATORS = {
    OperatorKind.AND: "and",
    OperatorKind.OR: "or",
    OperatorKind.NOT: "not",
    OperatorKind.IMPLIES: "imply",
    OperatorKind.PLUS: "+",
    OperatorKind.MINUS: "-",
    OperatorKind.TIMES: "*",
    OperatorKind.DIV: "/",
    OperatorKind.LE: "<=",
    OperatorKind.LT: "<",
    OperatorKind.EQUALS: "=",
}
