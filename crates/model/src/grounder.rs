//! Grounding: replaces variables by objects and expands quantifiers.

mod autonomous;
mod constraints;

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_num::Rational;

use crate::domains::Domains;
use crate::ground::{self, FactId, FluentId};
pub(crate) use constraints::SoftCondition;

use crate::problem::{
    self, Atom, Body, Condition, Expression, Fluent, FunctionId, ObjectId, PredicateId, Problem,
    SchemaId, TimedChange, UpdateOperator, Variable,
};
use crate::state::TimedHappening;
use crate::table::Table;
use crate::terms::{resolve, with_arguments};

/// Knowledge of static conditions, so that quantifiers need not be expanded in full.
pub(crate) trait StaticKnowledge {
    /// Returns the truth value of a condition if it is the same in every state, else `None`.
    fn truth(&self, condition: &Condition, binding: &[ObjectId]) -> Option<bool>;
}

/// No knowledge.
pub(crate) struct NoKnowledge;

impl StaticKnowledge for NoKnowledge {
    fn truth(&self, _: &Condition, _: &[ObjectId]) -> Option<bool> {
        None
    }
}

/// Grounds conditions, effects and actions, and enters their facts and fluents into a task's table.
pub(crate) struct Grounder<'a> {
    problem: &'a Problem,
    domains: &'a Domains,
    rules_of_predicate: &'a [Vec<usize>],
    pub(crate) table: &'a mut Table,
    /// Derived facts whose rules are not in the table yet.
    waiting: Vec<FactId>,
    is_grounding_rules: bool,
}

impl<'a> Grounder<'a> {
    /// Creates a grounder. `rules_of_predicate` holds, for each predicate, the positions of its
    /// rules in the problem.
    pub(crate) fn new(
        problem: &'a Problem,
        domains: &'a Domains,
        rules_of_predicate: &'a [Vec<usize>],
        table: &'a mut Table,
    ) -> Self {
        Self {
            problem,
            domains,
            rules_of_predicate,
            table,
            waiting: Vec::new(),
            is_grounding_rules: false,
        }
    }

    /// Returns the number of a fact. The rules of a new derived fact enter the table.
    pub(crate) fn fact(&mut self, predicate: PredicateId, arguments: &[ObjectId]) -> FactId {
        let (fact, is_new) = self.table.fact(predicate, arguments);
        if is_new && self.problem.predicates[predicate.index()].is_derived {
            self.waiting.push(fact);
            self.ground_waiting_rules();
        }
        fact
    }

    /// Returns the number of a fluent.
    pub(crate) fn fluent(&mut self, function: FunctionId, arguments: &[ObjectId]) -> FluentId {
        self.table.fluent(function, arguments)
    }

    /// Grounds the rules of waiting derived facts. Rules may mention further derived facts; these
    /// are queued, so that a long chain of rules causes no deep recursion.
    fn ground_waiting_rules(&mut self) {
        if std::mem::replace(&mut self.is_grounding_rules, true) {
            return;
        }
        while let Some(fact) = self.waiting.pop() {
            self.ground_rules(fact);
        }
        self.is_grounding_rules = false;
    }

    /// Returns the ground action of a schema with these arguments, which must fit. Quantified
    /// conditions and effects are expanded only where `known` does not decide them.
    pub(crate) fn action(
        &mut self,
        schema: SchemaId,
        arguments: &[ObjectId],
        known: &dyn StaticKnowledge,
    ) -> ground::Action {
        let problem = self.problem;
        let mut binding = arguments.to_vec();
        let binding = &mut binding;
        let lifted = &problem.schemas[schema.index()];
        let name = problem.apply_name(&lifted.name, arguments);
        let body = match &lifted.body {
            Body::Instantaneous { condition, effects } => {
                ground::Body::Instantaneous(self.ground_snap(condition, effects, binding, known))
            }
            Body::Durative {
                duration,
                at_start,
                over_all,
                at_end,
                start_effects,
                end_effects,
                continuous,
            } => ground::Body::Durative(ground::DurativeBody {
                duration: duration
                    .iter()
                    .map(|constraint| ground::DurationConstraint {
                        comparison: constraint.comparison,
                        bound: self.ground_expression(&constraint.bound, binding),
                        at_end: constraint.at_end,
                    })
                    .collect(),
                start: Arc::new(self.ground_snap(at_start, start_effects, binding, known)),
                over_all: self.expand(over_all, binding, known),
                end: Arc::new(self.ground_snap(at_end, end_effects, binding, known)),
                continuous: self.ground_continuous(continuous, binding, known),
                is_running: false,
            }),
        };
        let rule = problem.expected_durations.rule(schema, lifted, &name);
        let mut action = ground::Action {
            schema,
            arguments: arguments.to_vec(),
            name,
            body,
        };
        if let Some(expected) = rule {
            expected.apply(&mut action);
        }
        action
    }

    fn ground_snap(
        &mut self,
        condition: &Condition,
        effects: &[problem::Effect],
        binding: &mut Vec<ObjectId>,
        known: &dyn StaticKnowledge,
    ) -> ground::SnapAction {
        let condition = self.expand(condition, binding, known);
        let mut ground_effects = Vec::with_capacity(effects.len());
        for effect in effects {
            self.for_all(&effect.variables, binding, &mut |grounder, binding| {
                if is_known_to_fail(&effect.guard, binding, known) {
                    return;
                }
                let guard = grounder.ground_guard(&effect.guard, binding, known);
                let change = grounder.ground_change(&effect.change, binding);
                ground_effects.push(ground::Effect { guard, change });
            });
        }
        ground::SnapAction {
            condition,
            effects: ground_effects,
        }
    }

    fn ground_continuous(
        &mut self,
        effects: &[problem::ContinuousEffect],
        binding: &mut Vec<ObjectId>,
        known: &dyn StaticKnowledge,
    ) -> Vec<ground::ContinuousEffect> {
        let mut ground_effects = Vec::with_capacity(effects.len());
        for effect in effects {
            self.for_all(&effect.variables, binding, &mut |grounder, binding| {
                if is_known_to_fail(&effect.guard, binding, known) {
                    return;
                }
                ground_effects.push(ground::ContinuousEffect {
                    guard: grounder.ground_guard(&effect.guard, binding, known),
                    fluent: grounder.ground_fluent(&effect.fluent, binding),
                    rate: grounder.ground_expression(&effect.rate, binding),
                });
            });
        }
        ground_effects
    }

    fn ground_guard(
        &mut self,
        guard: &problem::Guard,
        binding: &mut Vec<ObjectId>,
        known: &dyn StaticKnowledge,
    ) -> ground::Guard {
        ground::Guard {
            at_start: self.expand(&guard.at_start, binding, known),
            over_all: self.expand(&guard.over_all, binding, known),
            now: self.expand(&guard.now, binding, known),
        }
    }

    fn ground_change(&mut self, change: &problem::Change, binding: &[ObjectId]) -> ground::Change {
        match change {
            problem::Change::Add(atom) => ground::Change::Add(self.ground_atom(atom, binding)),
            problem::Change::Delete(atom) => {
                ground::Change::Delete(self.ground_atom(atom, binding))
            }
            problem::Change::Update {
                operator,
                fluent,
                value,
            } => ground::Change::Update {
                operator: *operator,
                fluent: self.ground_fluent(fluent, binding),
                value: self.ground_expression(value, binding),
            },
        }
    }

    /// Returns the ground form of a condition, with variables bound to `binding` by position.
    pub(crate) fn ground_condition(
        &mut self,
        condition: &Condition,
        binding: &mut Vec<ObjectId>,
    ) -> ground::Condition {
        self.expand(condition, binding, &NoKnowledge)
    }

    /// Like [`Self::ground_condition`], with `known` as for [`Self::action`].
    fn expand(
        &mut self,
        condition: &Condition,
        binding: &mut Vec<ObjectId>,
        known: &dyn StaticKnowledge,
    ) -> ground::Condition {
        match condition {
            Condition::Atom(atom) => ground::Condition::Fact(self.ground_atom(atom, binding)),
            Condition::Equal(left, right) => {
                let are_equal = resolve(*left, binding) == resolve(*right, binding);
                ground::Condition::always(are_equal)
            }
            Condition::Compare(comparison, left, right) => ground::Condition::Compare(
                *comparison,
                self.ground_expression(left, binding),
                self.ground_expression(right, binding),
            ),
            Condition::Not(part) => {
                ground::Condition::Not(Box::new(self.expand(part, binding, known)))
            }
            Condition::And(parts) => ground::Condition::And(
                parts
                    .iter()
                    .map(|part| self.expand(part, binding, known))
                    .collect(),
            ),
            Condition::Or(parts) => ground::Condition::Or(
                parts
                    .iter()
                    .map(|part| self.expand(part, binding, known))
                    .collect(),
            ),
            Condition::Forall(variables, part) => {
                ground::Condition::And(self.expand_each(variables, part, binding, known))
            }
            Condition::Exists(variables, part) => {
                ground::Condition::Or(self.expand_each(variables, part, binding, known))
            }
        }
    }

    fn expand_each(
        &mut self,
        variables: &[Variable],
        part: &Condition,
        binding: &mut Vec<ObjectId>,
        known: &dyn StaticKnowledge,
    ) -> Vec<ground::Condition> {
        let mut parts = Vec::new();
        self.for_all(variables, binding, &mut |grounder, binding| {
            parts.push(match known.truth(part, binding) {
                Some(truth) => ground::Condition::always(truth),
                None => grounder.expand(part, binding, known),
            });
        });
        parts
    }

    pub(crate) fn ground_expression(
        &mut self,
        expression: &Expression,
        binding: &[ObjectId],
    ) -> ground::Expression {
        expression.map_fluents(&mut |fluent| self.ground_fluent(fluent, binding))
    }

    fn ground_atom(&mut self, atom: &Atom, binding: &[ObjectId]) -> FactId {
        with_arguments(&atom.arguments, binding, |arguments| {
            self.fact(atom.predicate, arguments)
        })
    }

    fn ground_fluent(&mut self, fluent: &Fluent, binding: &[ObjectId]) -> FluentId {
        with_arguments(&fluent.arguments, binding, |arguments| {
            self.fluent(fluent.function, arguments)
        })
    }

    /// Calls `action` once for each extension of the binding by objects for `variables`.
    pub(crate) fn for_all(
        &mut self,
        variables: &[Variable],
        binding: &mut Vec<ObjectId>,
        action: &mut dyn FnMut(&mut Self, &mut Vec<ObjectId>),
    ) {
        let Some((first, rest)) = variables.split_first() else {
            action(self, binding);
            return;
        };
        let domains = self.domains;
        for &object in &*domains.objects(&first.types) {
            binding.push(object);
            self.for_all(rest, binding, action);
            binding.pop();
        }
    }

    /// Adds the rules whose head is `fact`, and all rules that they depend on.
    fn ground_rules(&mut self, fact: FactId) {
        let (predicate, arguments) = self.table.atom(fact).clone();
        let problem = self.problem;
        let mut bodies = Vec::new();
        for &position in &self.rules_of_predicate[predicate.index()] {
            let rule = &problem.rules[position];
            let fits = rule
                .parameters
                .iter()
                .zip(&arguments)
                .all(|(variable, &object)| problem.has_type(object, &variable.types));
            if fits {
                bodies.push(self.ground_condition(&rule.body, &mut arguments.clone()));
            }
        }
        self.table.rules_mut().add(fact, bodies);
    }

    /// Returns the timed initials by time. Those of one time form a group, in the order of the
    /// file.
    pub(crate) fn ground_timed(&mut self) -> Vec<TimedHappening> {
        let problem = self.problem;
        let mut by_time: BTreeMap<Rational, Vec<ground::Change>> = BTreeMap::new();
        for timed in &problem.timed {
            let change = match &timed.change {
                TimedChange::Add(predicate, arguments) => {
                    ground::Change::Add(self.fact(*predicate, arguments))
                }
                TimedChange::Delete(predicate, arguments) => {
                    ground::Change::Delete(self.fact(*predicate, arguments))
                }
                TimedChange::Assign(function, arguments, value) => ground::Change::Update {
                    operator: UpdateOperator::Assign,
                    fluent: self.fluent(*function, arguments),
                    value: ground::Expression::Constant(value.clone()),
                },
            };
            by_time.entry(timed.time.clone()).or_default().push(change);
        }
        by_time
            .into_iter()
            .map(|(time, changes)| TimedHappening { time, changes })
            .collect()
    }
}

fn is_known_to_fail(
    guard: &problem::Guard,
    binding: &[ObjectId],
    known: &dyn StaticKnowledge,
) -> bool {
    [&guard.at_start, &guard.over_all, &guard.now]
        .into_iter()
        .any(|part| known.truth(part, binding) == Some(false))
}
