//! What is possible when deletions are ignored: conditions judged by the events reached so far.
//!
//! "Possible" is optimistic: each fact read may be true or false independently of all others, as
//! long as it has that truth value at some time; a fluent that something changes may have any
//! value. So a condition that is impossible here is impossible in every plan made of the actions
//! reached so far, and what is possible stays so as more events are reached.

use elbowroom_num::Rational;

use crate::domains::Domains;
use crate::grounder::Foreknowledge;
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

/// The events reached so far, and what never changes.
pub(super) struct Relaxation<'a> {
    pub(super) problem: &'a Problem,
    pub(super) domains: &'a Domains,
    pub(super) reached: Reached,
    /// The kinds of events that may be reached after time 0.
    written: Symbols,
    /// The initial values, by the event that would change them.
    values: Map<Event, Rational>,
}

impl<'a> Relaxation<'a> {
    /// At time 0.
    pub(super) fn initially(problem: &'a Problem, domains: &'a Domains) -> Self {
        let facts = problem.initial_facts.iter();
        let values = problem.initial_values.iter();
        Self {
            problem,
            domains,
            reached: Reached::initially(
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

    /// Whether such an event may be reached after time 0.
    pub(super) fn is_written(&self, symbol: Symbol) -> bool {
        self.written.contains(symbol)
    }

    /// Whether no event can make the condition possible that is not possible at time 0 (`wanted`),
    /// or its negation (not `wanted`).
    pub(super) fn is_static(&self, condition: &Condition, wanted: bool) -> bool {
        let mut is_static = true;
        writes::visit_condition(condition, wanted, &mut |symbol| {
            is_static &= !self.is_written(symbol);
        });
        is_static
    }

    /// Whether nothing changes the bounds of the duration.
    pub(super) fn is_static_duration(&self, constraints: &[DurationConstraint]) -> bool {
        let mut is_static = true;
        for constraint in constraints {
            writes::visit_expression(&constraint.bound, &mut |symbol| {
                is_static &= !self.is_written(symbol);
            });
        }
        is_static
    }

    /// Whether the condition is possible (`wanted`), or its negation (not `wanted`).
    ///
    /// If not, `blockers` receives events such that it stays impossible until at least one of
    /// them is reached; if none, it stays so for ever.
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
        // When a derived fact can be false is not traced: always, to be on the safe side.
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

    /// `wanted` and whether all (rather than one) of the instances are needed.
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
            // To read what has no value is a mistake, whatever is made of the answer.
            (Value::Undefined, _) | (_, Value::Undefined) => false,
            _ => true,
        }
    }

    /// Whether the bounds (if not `with_end`, those read at the start) may leave room for a
    /// duration `>= 0`. Blockers as in [`Self::is_possible`].
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
    pub(super) fn may_some_take_no_time(&self, constraints: &[DurationConstraint]) -> bool {
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

    /// Returns `true` if the expression is positive for all objects and at all times. `false` if that is
    /// not known.
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

    /// The value if nothing reached so far changes it.
    pub(super) fn value(&self, expression: &Expression, binding: &[ObjectId]) -> Value {
        Value::of(expression, &mut |fluent| self.fluent_value(fluent, binding))
    }

    fn fluent_value(&self, fluent: &Fluent, binding: &[ObjectId]) -> Value {
        with_arguments(&fluent.arguments, binding, |arguments| {
            self.constant(fluent.function, arguments)
        })
    }

    /// The value of a fluent if nothing reached so far changes it.
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

impl Foreknowledge for Relaxation<'_> {
    /// Decided by the basic facts and the fluents that nothing reached so far writes. Quantifiers
    /// are left alone: what they range over will be asked for one by one.
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
    /// Of a conjunction, or a disjunction: `neutral` is what no part changes.
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
