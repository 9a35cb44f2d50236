//! Grounding by reachability: the ground actions that can occur in a plan when deletions are
//! ignored.
//!
//! In: a [`Task`]. Out: a [`Grounding`], with every action that some valid plan contains, and
//! usually few others.
//!
//! An instantaneous action is reached when its condition is possible; a durative action starts
//! when its condition at start and its duration are, and is reached when the conditions over all
//! and at end are possible too, which may take what its own start or other actions bring about.
//! The condition over all need not be possible if the duration may be 0.
//! A condition is possible when each fact that it reads has the truth value asked for at some
//! time, by the initial state, timed initials or reached actions; comparisons of numbers that
//! nothing reached changes are evaluated, others count as possible. An action that can start but
//! never end occurs in no valid plan, so what its start brought about is taken back, and all is
//! done again without it.
//!
//! Instances are found by joining the atoms of conditions with the facts reached so far, as a
//! Datalog engine does (Helmert, "Concise finite-domain representations for PDDL planning tasks",
//! AIJ 173, 2009, section 6), one reached fact after the other; what cannot be joined, such as
//! negations, universal quantifiers and numbers, is tested for each binding.

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
mod waiting;
mod writes;

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use crate::derivation::GroundRule;
use crate::domains::Domains;
use crate::ground::{Action, Condition, FactId};
use crate::grounder::Grounder;
use crate::problem::{self, ObjectId, Problem, SchemaId, TimedChange};
use crate::task::Task;

use constants::{Memory, Unwritten};
use event::Symbol;
use fixpoint::{Arguments, Reachable, fixpoint};
use relaxation::Relaxation;

/// The number of steps that lie between two questions whether to go on.
const STEPS_PER_QUESTION: u64 = 8192;

/// The number of actions made between two such questions.
const ACTIONS_PER_QUESTION: usize = 32;

/// Limits of grounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// The most ground actions.
    pub action_limit: usize,
    /// The most matches of an atom with a fact, tries of an effect and the like: bounds the time
    /// where few of many combinations are possible. Some ten million take a second.
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
    /// All that can be reached was found.
    Complete(Grounding),
    /// One of the [`Settings`]' limits was reached, or [`ground_while`] was told to stop.
    LimitReached,
}

/// The reachable ground actions and facts.
#[derive(Clone, Debug, PartialEq)]
pub struct Grounding {
    /// The actions, by schema and arguments, without conditions that hold at all times and without
    /// conditional effects that never happen.
    pub actions: Vec<Action>,
    /// The facts that are true at some time, derived ones included.
    pub facts: BTreeSet<FactId>,
    /// The rules of the derived facts among them, simplified like the actions.
    pub rules: Vec<GroundRule>,
    /// The goal, simplified like the actions.
    pub goal: Condition,
    /// The conjuncts of the goal, as written, that no plan can make true.
    pub unreachable_goals: Vec<Condition>,
    /// How many steps it took; see [`Settings::step_limit`].
    pub steps: u64,
}

impl Grounding {
    /// The schema and the arguments of each action, schema by schema in the domain's order, and in
    /// the order of the objects.
    pub fn instances(&self) -> Vec<(SchemaId, Vec<ObjectId>)> {
        let actions = self.actions.iter();
        let mut instances: Vec<_> = actions
            .map(|action| (action.schema, action.arguments.clone()))
            .collect();
        instances.sort();
        instances
    }
}

/// Finds all ground actions that can be reached, and enters the facts and fluents that they
/// mention into the task's table.
pub fn ground(task: &Task, settings: &Settings) -> Answer {
    ground_while(task, settings, &mut || true)
}

/// The same as [`ground`], as long as `goes_on` says so: it is asked every few thousand steps,
/// which is about every millisecond, and not again once it has said no.
pub fn ground_while(task: &Task, settings: &Settings, goes_on: &mut dyn FnMut() -> bool) -> Answer {
    let (problem, domains) = (task.with_autonomous_changes(), task.domains.clone());
    let mut steps = 0;
    let mut count = || {
        steps += 1;
        if steps > settings.step_limit || steps % STEPS_PER_QUESTION == 0 && !goes_on() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let Some(reachable) = reach(&problem, &domains, settings, &mut count) else {
        return Answer::LimitReached;
    };
    let facts = enter_facts(task, &reachable.relaxation);
    let mut memory = Memory::default();
    let Some(actions) = actions(task, &reachable, &mut memory, goes_on) else {
        return Answer::LimitReached;
    };
    let all_rules = task.rules();
    let table = task.table();
    let mut constants = Unwritten {
        table: &table,
        relaxation: &reachable.relaxation,
        memory: &mut memory,
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

/// The fixpoint in which all that starts can also end.
fn reach<'a>(
    problem: &'a Problem,
    domains: &'a Domains,
    settings: &Settings,
    count: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Reachable<'a>> {
    let read = writes::read(problem);
    let mut banned: Vec<BTreeSet<Arguments>> = vec![BTreeSet::new(); problem.schemas.len()];
    loop {
        let mut relaxation = Relaxation::initially(problem, domains);
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

/// The reached instances as actions, by schema and arguments; `None` if told to stop.
fn actions(
    task: &Task,
    reachable: &Reachable,
    memory: &mut Memory,
    goes_on: &mut dyn FnMut() -> bool,
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
                action.simplified(&mut Unwritten {
                    table: grounder.table,
                    relaxation,
                    memory,
                })
            });
            if !action.is_contradiction() {
                actions.push(action);
            }
            count += 1;
            if count.is_multiple_of(ACTIONS_PER_QUESTION) && !goes_on() {
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
