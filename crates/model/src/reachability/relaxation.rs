//! Delete relaxation: possible truth values of conditions, by the events reached so far.
//!
//! "Possible" is optimistic: each fact read may be true or false independently of all others, if it
//! has that truth value at some time; a fluent that something changes may have any value. So a
//! condition that is impossible here is impossible in every plan of the actions reached so far, and
//! a possible condition remains possible as more events are reached.

use elbowroom_num::Rational;

use crate::domains::Domains;
use crate::grounder::StaticKnowledge;
use crate::problem::{
    Atom, Comparison, Condition, DurationConstraint, Expression, Fluent, FunctionId, ObjectId,
    Problem, Variable,
};
use crate::terms::{resolve, with_arguments};

use super::event::{Event, EventKey, Symbol, Symbols};
use super::reached::Reached;
use super::value::Value;
use super::writes;
use crate::hash::Map;

/// The events reached so far, and constant parts of the problem.
pub(super) struct Relaxation<'a> {
    pub(super) problem: &'a Problem,
    pub(super) domains: &'a Domains,
    pub(super) reached: Reached,
    /// Kinds of events that may be reached after time 0.
    written: Symbols,
    /// Initial values, by the event that would change them.
    values: Map<Event, Rational>,
}

impl<'a> Relaxation<'a> {
    /// Creates the relaxation at time 0.
    pub(super) fn at_time_zero(problem: &'a Problem, domains: &'a Domains) -> Self {
        let facts = problem.initial_facts.iter();
        let values = problem.initial_values.iter();
        Self {
            problem,
            domains,
            reached: Reached::at_time_zero(
                problem.predicates.len(),
                facts.map(|(predicate, arguments)| (*predicate, arguments.as_slice())),
            ),
            written: writes::written(problem),
            values: values
                .map(|(function, arguments, value)| {
                    let event = Event {
                        symbol: Symbol::Changed(*function),
                        arguments: arguments.as_slice().into(),
                    };
                    (event, value.clone())
                })
                .collect(),
        }
    }

    /// Returns `true` if such an event may be reached after time 0.
    pub(super) fn is_written(&self, symbol: Symbol) -> bool {
        self.written.contains(symbol)
    }

    /// Returns `true` if no event after time 0 can make the condition (`wanted`), or its negation
    /// (not `wanted`), possible.
    pub(super) fn is_static(&self, condition: &Condition, wanted: bool) -> bool {
        let mut is_static = true;
        writes::visit_condition(condition, wanted, &mut |symbol| {
            is_static &= !self.is_written(symbol);
        });
        is_static
    }

    /// Returns `true` if nothing changes the bounds of the duration.
    pub(super) fn is_static_duration(&self, constraints: &[DurationConstraint]) -> bool {
        let mut is_static = true;
        for constraint in constraints {
            writes::visit_expression(&constraint.bound, &mut |symbol| {
                is_static &= !self.is_written(symbol);
            });
        }
        is_static
    }

    /// Returns `true` if the condition (`wanted`) or its negation (not `wanted`) is possible.
    ///
    /// Otherwise, `blockers` receives events such that it stays impossible until at least one of
    /// them is reached. Without blockers, it stays impossible forever.
    pub(super) fn is_possible(
        &self,
        condition: &Condition,
        wanted: bool,
        binding: &mut Vec<ObjectId>,
        blockers: &mut Vec<Event>,
    ) -> bool {
        match condition {
            Condition::Atom(atom) => self.is_atom_possible(atom, wanted, binding, blockers),
            Condition::Equal(left, right) => {
                (resolve(*left, binding) == resolve(*right, binding)) == wanted
            }
            Condition::Compare(comparison, left, right) => {
                self.is_comparison_possible(*comparison, [left, right], wanted, binding) || {
                    self.block_on_fluents(left, binding, blockers);
                    self.block_on_fluents(right, binding, blockers);
                    false
                }
            }
            Condition::Not(part) => self.is_possible(part, !wanted, binding, blockers),
            Condition::And(parts) if wanted => parts
                .iter()
                .all(|part| self.is_possible(part, wanted, binding, blockers)),
            Condition::Or(parts) if !wanted => parts
                .iter()
                .all(|part| self.is_possible(part, wanted, binding, blockers)),
            Condition::And(parts) | Condition::Or(parts) => {
                let known = blockers.len();
                let is_possible = parts
                    .iter()
                    .any(|part| self.is_possible(part, wanted, binding, blockers));
                if is_possible {
                    blockers.truncate(known);
                }
                is_possible
            }
            Condition::Forall(variables, part) => {
                self.is_quantified_possible(variables, part, [wanted, wanted], binding, blockers)
            }
            Condition::Exists(variables, part) => {
                self.is_quantified_possible(variables, part, [wanted, !wanted], binding, blockers)
            }
        }
    }

    fn is_atom_possible(
        &self,
        atom: &Atom,
        wanted: bool,
        binding: &[ObjectId],
        blockers: &mut Vec<Event>,
    ) -> bool {
        let predicate = atom.predicate;
        // The falsehood of derived facts is not tracked. It always counts as possible, which is
        // safe.
        if !wanted && self.problem.predicates[predicate.index()].is_derived {
            return true;
        }
        with_arguments(&atom.arguments, binding, |arguments| {
            let (symbol, is_possible) = if wanted {
                let is_true = self.reached.is_ever_true(predicate, arguments);
                (Symbol::True(predicate), is_true)
            } else {
                let is_false = self.reached.is_ever_false(predicate, arguments);
                (Symbol::False(predicate), is_false)
            };
            if !is_possible && self.is_written(symbol) {
                blockers.push(EventKey { symbol, arguments }.to_event());
            }
            is_possible
        })
    }

    /// Evaluates a quantifier. `all` of its instances are needed, or only one.
    fn is_quantified_possible(
        &self,
        variables: &[Variable],
        part: &Condition,
        [wanted, needs_all]: [bool; 2],
        binding: &mut Vec<ObjectId>,
        blockers: &mut Vec<Event>,
    ) -> bool {
        let Some((first, rest)) = variables.split_first() else {
            return self.is_possible(part, wanted, binding, blockers);
        };
        let known = blockers.len();
        for &object in &*self.domains.objects(&first.types) {
            binding.push(object);
            let is_possible =
                self.is_quantified_possible(rest, part, [wanted, needs_all], binding, blockers);
            binding.pop();
            if is_possible != needs_all {
                if is_possible {
                    blockers.truncate(known);
                }
                return is_possible;
            }
        }
        needs_all
    }

    fn is_comparison_possible(
        &self,
        comparison: Comparison,
        [left, right]: [&Expression; 2],
        wanted: bool,
        binding: &[ObjectId],
    ) -> bool {
        match (self.value(left, binding), self.value(right, binding)) {
            (Value::Number(left), Value::Number(right)) => {
                comparison.holds(&left, &right) == wanted
            }
            // Reading an undefined value is an error, whatever the context.
            (Value::Undefined, _) | (_, Value::Undefined) => false,
            _ => true,
        }
    }

    /// Returns `true` if the bounds may allow a duration `>= 0`. Bounds that are read at the end
    /// count only if `with_end`. Blockers as in [`Self::is_possible`].
    pub(super) fn is_duration_possible(
        &self,
        constraints: &[DurationConstraint],
        with_end: bool,
        binding: &[ObjectId],
        blockers: &mut Vec<Event>,
    ) -> bool {
        let mut lower = Rational::ZERO;
        let mut upper: Option<Rational> = None;
        let mut is_defined = true;
        let considered = || constraints.iter().filter(|c| with_end || !c.at_end);
        for constraint in considered() {
            let bound = match self.value(&constraint.bound, binding) {
                Value::Number(bound) => bound,
                Value::Varies => continue,
                Value::Undefined => {
                    is_defined = false;
                    continue;
                }
            };
            let comparison = constraint.comparison;
            if !matches!(comparison, Comparison::Less | Comparison::AtMost) && bound > lower {
                lower = bound.clone();
            }
            if !matches!(comparison, Comparison::Greater | Comparison::AtLeast)
                && upper.as_ref().is_none_or(|upper| bound < *upper)
            {
                upper = Some(bound);
            }
        }
        let is_possible = is_defined && upper.is_none_or(|upper| lower <= upper);
        if !is_possible {
            for constraint in considered() {
                self.block_on_fluents(&constraint.bound, binding, blockers);
            }
        }
        is_possible
    }

    /// Returns `true` if the constraints may allow a duration of 0. Blockers as in
    /// [`Self::is_possible`].
    pub(super) fn may_take_no_time(
        &self,
        constraints: &[DurationConstraint],
        binding: &[ObjectId],
        blockers: &mut Vec<Event>,
    ) -> bool {
        let is_possible =
            constraints
                .iter()
                .all(|constraint| match self.value(&constraint.bound, binding) {
                    Value::Number(bound) => constraint.comparison.holds(&Rational::ZERO, &bound),
                    Value::Varies => true,
                    Value::Undefined => false,
                });
        if !is_possible {
            for constraint in constraints {
                self.block_on_fluents(&constraint.bound, binding, blockers);
            }
        }
        is_possible
    }

    /// Returns `true` unless the constraints exclude a duration of 0 for all objects.
    pub(super) fn can_any_take_no_time(&self, constraints: &[DurationConstraint]) -> bool {
        !constraints.iter().any(|constraint| {
            let bound = &constraint.bound;
            match constraint.comparison {
                Comparison::Less | Comparison::AtMost => false,
                Comparison::Equal | Comparison::AtLeast => self.is_positive(bound),
                Comparison::Greater => {
                    let is_zero = matches!(bound, Expression::Constant(bound) if bound.is_zero());
                    is_zero || self.is_positive(bound)
                }
            }
        })
    }

    /// Returns `true` if the expression is known to be positive for all objects and at all times.
    fn is_positive(&self, expression: &Expression) -> bool {
        match expression {
            Expression::Constant(value) => value.is_positive(),
            Expression::Fluent(fluent) => {
                let symbol = Symbol::Changed(fluent.function);
                let mut values = self
                    .values
                    .iter()
                    .filter(|(event, _)| event.symbol == symbol);
                !self.is_written(symbol) && values.all(|(_, value)| value.is_positive())
            }
            Expression::Add(parts) | Expression::Multiply(parts) => {
                parts.iter().all(|part| self.is_positive(part))
            }
            Expression::Divide(left, right) => self.is_positive(left) && self.is_positive(right),
            _ => false,
        }
    }

    /// Returns the value, if no reached event changes it.
    pub(super) fn value(&self, expression: &Expression, binding: &[ObjectId]) -> Value {
        Value::of(expression, &mut |fluent| self.fluent_value(fluent, binding))
    }

    fn fluent_value(&self, fluent: &Fluent, binding: &[ObjectId]) -> Value {
        with_arguments(&fluent.arguments, binding, |arguments| {
            self.constant(fluent.function, arguments)
        })
    }

    /// Returns the value of a fluent, if no reached event changes it.
    pub(super) fn constant(&self, function: FunctionId, arguments: &[ObjectId]) -> Value {
        if self.reached.is_changed(function, arguments) {
            return Value::Varies;
        }
        let symbol = Symbol::Changed(function);
        match self.values.get(&EventKey { symbol, arguments }) {
            Some(value) => Value::Number(value.clone()),
            None => Value::Undefined,
        }
    }

    fn block_on_fluents(
        &self,
        expression: &Expression,
        binding: &[ObjectId],
        blockers: &mut Vec<Event>,
    ) {
        expression.visit_fluents(&mut |fluent| {
            let symbol = Symbol::Changed(fluent.function);
            with_arguments(&fluent.arguments, binding, |arguments| {
                let is_open = !self.reached.is_changed(fluent.function, arguments);
                if is_open && self.is_written(symbol) {
                    blockers.push(EventKey { symbol, arguments }.to_event());
                }
            });
        });
    }
}

impl StaticKnowledge for Relaxation<'_> {
    /// Decides by basic facts and fluents that no reached event writes. Quantifiers are undecided;
    /// their instances are queried one by one.
    fn truth(&self, condition: &Condition, binding: &[ObjectId]) -> Option<bool> {
        match condition {
            Condition::Atom(atom) if self.problem.predicates[atom.predicate.index()].is_derived => {
                None
            }
            Condition::Atom(atom) => with_arguments(&atom.arguments, binding, |arguments| {
                self.reached.constant(atom.predicate, arguments)
            }),
            Condition::Equal(left, right) => {
                Some(resolve(*left, binding) == resolve(*right, binding))
            }
            Condition::Compare(comparison, left, right) => {
                match (self.value(left, binding), self.value(right, binding)) {
                    (Value::Number(left), Value::Number(right)) => {
                        Some(comparison.holds(&left, &right))
                    }
                    _ => None,
                }
            }
            Condition::Not(part) => self.truth(part, binding).map(|truth| !truth),
            Condition::And(parts) => self.joint_truth(parts, true, binding),
            Condition::Or(parts) => self.joint_truth(parts, false, binding),
            Condition::Forall(..) | Condition::Exists(..) => None,
        }
    }
}

impl Relaxation<'_> {
    /// Returns the truth value of a conjunction or disjunction; `neutral` is its neutral element.
    fn joint_truth(
        &self,
        parts: &[Condition],
        neutral: bool,
        binding: &[ObjectId],
    ) -> Option<bool> {
        let mut is_known = true;
        for part in parts {
            match self.truth(part, binding) {
                Some(truth) if truth != neutral => return Some(truth),
                truth => is_known &= truth.is_some(),
            }
        }
        is_known.then_some(neutral)
    }
}
