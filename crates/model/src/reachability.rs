//! Grounding by reachability: the ground actions that can occur in a plan when deletions are
//! ignored.
//!
//! Input: a [`Task`]. Output: a [`Grounding`] with every action that some valid plan contains, and
//! usually few others.
//!
//! An instantaneous action is reached when its condition is possible. A durative action starts when
//! its condition at start and its duration are possible. It is reached when the conditions over all
//! and at end are possible as well; its own start effects or other actions may make them so. The
//! over-all condition need not be possible if the duration may be 0. A condition is possible when
//! each fact that it reads has the required truth value at some time, by the initial state, timed
//! initials or reached actions. Comparisons of numbers that no reached action changes are
//! evaluated; others count as possible. An action that can start but never end occurs in no valid
//! plan. Its start effects are removed, and the computation is repeated without it.
//!
//! Instances are found by joining the atoms of conditions with the facts reached so far, as in a
//! Datalog engine (Helmert, "Concise finite-domain representations for PDDL planning tasks", AIJ
//! 173, 2009, section 6), one reached fact after the other. Conditions that cannot be joined, such
//! as negations, universal quantifiers and comparisons of numbers, are tested for each binding.

mod constants;
mod effects;
mod event;
mod fixpoint;
mod join;
mod reached;
mod relaxation;
mod rule;
#[cfg(test)]
mod tests;
mod value;
mod variables;
mod watch_lists;
mod writes;

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use crate::derivation::GroundRule;
use crate::domains::Domains;
use crate::ground::{Action, Condition, FactId};
use crate::grounder::Grounder;
use crate::problem::{self, ObjectId, Problem, SchemaId, TimedChange};
use crate::task::Task;

use constants::{ResultCache, UnwrittenSymbols};
use event::Symbol;
use fixpoint::{Arguments, Reachable, fixpoint};
use relaxation::Relaxation;

/// Number of steps between two calls of the caller's `may_continue`.
const STEPS_PER_QUESTION: u64 = 8192;

/// Number of created actions between two such calls.
const ACTIONS_PER_QUESTION: usize = 32;

/// Limits of grounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Largest number of ground actions.
    pub action_limit: usize,
    /// Largest number of steps: matches of an atom with a fact, tries of an effect and the like. It
    /// limits the time when few of many combinations are possible. About ten million steps take a
    /// second.
    pub step_limit: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            action_limit: 1_000_000,
            step_limit: 500_000_000,
        }
    }
}

/// The result of grounding.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// The complete result.
    Complete(Grounding),
    /// One of the limits of [`Settings`] was reached, or the caller of [`ground_while`] stopped it.
    LimitReached,
}

/// The reachable ground actions and facts.
#[derive(Clone, Debug, PartialEq)]
pub struct Grounding {
    /// Actions, by schema and arguments, without conditions that always hold and without
    /// conditional effects that never take place.
    pub actions: Vec<Action>,
    /// The facts that are true at some time, derived ones included.
    pub facts: BTreeSet<FactId>,
    /// The rules of the derived facts among them, simplified like the actions.
    pub rules: Vec<GroundRule>,
    /// The goal, simplified like the actions.
    pub goal: Condition,
    /// The conjuncts of the goal, as written, that no plan can make true.
    pub unreachable_goals: Vec<Condition>,
    /// Number of steps; see [`Settings::step_limit`].
    pub steps: u64,
}

impl Grounding {
    /// Returns the schema and the arguments of each action, schema by schema in the domain's order,
    /// and in the order of the objects.
    pub fn instances(&self) -> Vec<(SchemaId, Vec<ObjectId>)> {
        let actions = self.actions.iter();
        let mut instances: Vec<_> = actions
            .map(|action| (action.schema, action.arguments.clone()))
            .collect();
        instances.sort();
        instances
    }
}

/// Finds all reachable ground actions, and enters the facts and fluents that they mention into the
/// task's table.
pub fn ground(task: &Task, settings: &Settings) -> Answer {
    ground_while(task, settings, &mut || true)
}

/// Like [`ground`], but stops when `may_continue` returns `false`. It is called every few thousand
/// steps, about once per millisecond, and not again after it has returned `false`.
pub fn ground_while(
    task: &Task,
    settings: &Settings,
    may_continue: &mut dyn FnMut() -> bool,
) -> Answer {
    let (problem, domains) = (task.with_autonomous_changes(), task.domains.clone());
    let mut steps = 0;
    let mut count = || {
        steps += 1;
        if steps > settings.step_limit || steps % STEPS_PER_QUESTION == 0 && !may_continue() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let Some(reachable) = reach(&problem, &domains, settings, &mut count) else {
        return Answer::LimitReached;
    };
    let facts = enter_facts(task, &reachable.relaxation);
    let mut memory = ResultCache::default();
    let Some(actions) = actions(task, &reachable, &mut memory, may_continue) else {
        return Answer::LimitReached;
    };
    let all_rules = task.rules();
    let table = task.table();
    let mut constants = UnwrittenSymbols {
        table: &table,
        relaxation: &reachable.relaxation,
        cache: &mut memory,
    };
    let rules = all_rules.iter().filter(|rule| facts.contains(&rule.head));
    let rules = rules.map(|rule| GroundRule {
        head: rule.head,
        body: rule.body.clone().simplified(&mut constants),
    });
    let rules = rules.filter(|rule| !rule.body.is_contradiction()).collect();
    let goal = task.goal.clone().simplified(&mut constants);
    drop(table);
    let mut unreachable_goals = Vec::new();
    task.grounding(|grounder| {
        find_unreachable(
            grounder,
            &reachable.relaxation,
            &problem.goal,
            &mut Vec::new(),
            &mut unreachable_goals,
        );
    });
    Answer::Complete(Grounding {
        actions,
        facts,
        rules,
        goal,
        unreachable_goals,
        steps,
    })
}

/// Returns the fixpoint without instances that can start but not end.
fn reach<'a>(
    problem: &'a Problem,
    domains: &'a Domains,
    settings: &Settings,
    count: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Reachable<'a>> {
    let read = writes::read(problem);
    let mut banned: Vec<BTreeSet<Arguments>> = vec![BTreeSet::new(); problem.schemas.len()];
    loop {
        let mut relaxation = Relaxation::at_time_zero(problem, domains);
        let rules = rule::rules_of(&relaxation, |schema| writes::is_start_silent(schema, &read));
        add_timed(&mut relaxation);
        let reachable = fixpoint(relaxation, &rules, &banned, settings, count)?;
        let mut can_all_end = true;
        for (index, instances) in reachable.instances.iter().enumerate() {
            for (arguments, &can_end) in instances.iter().zip(&reachable.can_end[index]) {
                if !can_end {
                    banned[index].insert(arguments.clone());
                    can_all_end = false;
                }
            }
        }
        if can_all_end {
            return Some(reachable);
        }
    }
}

fn add_timed(relaxation: &mut Relaxation) {
    for timed in &relaxation.problem.timed {
        let (symbol, arguments) = match &timed.change {
            TimedChange::Add(predicate, arguments) => (Symbol::True(*predicate), arguments),
            TimedChange::Delete(predicate, arguments) => (Symbol::False(*predicate), arguments),
            TimedChange::Assign(function, arguments, _) => (Symbol::Changed(*function), arguments),
        };
        relaxation.reached.insert(symbol, arguments);
    }
}

fn enter_facts(task: &Task, relaxation: &Relaxation) -> BTreeSet<FactId> {
    let facts = relaxation.reached.facts();
    task.grounding(|grounder| {
        facts
            .map(|(predicate, arguments)| grounder.fact(predicate, arguments))
            .collect()
    })
}

/// Returns the reached instances as actions, by schema and arguments; `None` if the caller stopped
/// it.
fn actions(
    task: &Task,
    reachable: &Reachable,
    memory: &mut ResultCache,
    may_continue: &mut dyn FnMut() -> bool,
) -> Option<Vec<Action>> {
    let mut actions = Vec::new();
    let mut count = 0_usize;
    for (index, instances) in reachable.instances.iter().enumerate() {
        let mut instances: Vec<&[ObjectId]> = instances.iter().map(|a| &**a).collect();
        instances.sort_unstable();
        for arguments in instances {
            let schema = SchemaId::from(index);
            let relaxation = &reachable.relaxation;
            let action = task.grounding(|grounder| {
                let action = grounder.action(schema, arguments, relaxation);
                action.simplified(&mut UnwrittenSymbols {
                    table: grounder.table,
                    relaxation,
                    cache: memory,
                })
            });
            if !action.is_contradiction() {
                actions.push(action);
            }
            count += 1;
            if count.is_multiple_of(ACTIONS_PER_QUESTION) && !may_continue() {
                return None;
            }
        }
    }
    Some(actions)
}

/// Collects the conjuncts of the condition that are not possible.
fn find_unreachable(
    grounder: &mut Grounder<'_>,
    relaxation: &Relaxation,
    condition: &problem::Condition,
    binding: &mut Vec<ObjectId>,
    found: &mut Vec<Condition>,
) {
    if relaxation.is_possible(condition, true, binding, &mut Vec::new()) {
        return;
    }
    match condition {
        problem::Condition::And(parts) => {
            for part in parts {
                find_unreachable(grounder, relaxation, part, binding, found);
            }
        }
        problem::Condition::Forall(variables, part) => {
            grounder.for_all(variables, binding, &mut |grounder, binding| {
                find_unreachable(grounder, relaxation, part, binding, found);
            });
        }
        other => found.push(grounder.ground_condition(other, binding)),
    }
}
