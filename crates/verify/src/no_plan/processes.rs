//! Starts, ends and instantaneous actions in the order of time, with the literals that they read
//! and make true.
//!
//! The proofs rely on one lemma. In a valid plan, happenings at one time do not interfere. So they
//! can be put into any order, one after the other: each condition holds in the state just before,
//! and the final state is the same. An over-all literal of an action with a positive duration holds
//! in each of these states, from the one after its start to the one before its end, if two
//! conditions are satisfied: the start comes after the happenings at that time that make the
//! literal true, and the end before those that make it false. Such an order exists unless starts,
//! or ends, wait for each other in a cycle. Literals for which a cycle is possible are left out of
//! [`Process::over_all`] ([`leave_out_circles`]), and so are all literals of an action that may
//! have duration 0.
//!
//! Numbers and disjunctions of over-all conditions are left out as well.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body, Change, Condition, DurativeBody, FactId, SnapAction};
use elbowroom_model::problem::{ObjectId, SchemaId};
use elbowroom_num::Rational;

use super::initial_state::lasting;
use super::instances::Instances;
use super::{Fact, ReachedFacts};

/// A fact and its truth value.
pub(super) type Literal = (FactId, bool);

/// An action that plans may contain, or one that is running initially.
#[derive(Clone, Debug)]
pub(super) struct Process {
    /// `(name object …)`.
    pub(super) name: String,
    pub(super) schema: SchemaId,
    pub(super) arguments: Vec<ObjectId>,
    /// `None` if it is running initially.
    pub(super) start: Option<Snap>,
    /// `None` if it is instantaneous.
    pub(super) end: Option<Snap>,
    pub(super) body: Body,
    /// Bounds of its durations.
    pub(super) least: Rational,
    pub(super) most: Option<Rational>,
    /// Literals that hold while it is running.
    pub(super) over_all: Vec<Literal>,
    /// Start time, if it is running initially.
    pub(super) initial_start: Option<Rational>,
}

/// Literals that a happening reads and makes true.
#[derive(Clone, Debug, Default)]
pub(super) struct Snap {
    /// Literals among the conjuncts of its condition.
    pub(super) reads: Vec<Literal>,
    /// Literals that it may make true.
    pub(super) may_make_true: Vec<Literal>,
    /// Literals that its effects certainly make true.
    pub(super) surely_makes_true: Vec<Literal>,
    /// `true` if it changes numbers.
    changes_numbers: bool,
}

impl Snap {
    fn of(snap: &SnapAction) -> Self {
        let effects: Vec<(&Change, bool)> = snap
            .effects
            .iter()
            .map(|effect| (&effect.change, effect.guard.is_trivial()))
            .collect();
        Self {
            reads: literals(&snap.condition),
            ..Self::changing(&effects)
        }
    }

    /// Returns the literals of changes; `true` marks those that are certain. An addition wins over
    /// a deletion.
    pub(super) fn changing(changes: &[(&Change, bool)]) -> Self {
        let mut snap = Self::default();
        let (mut adds, mut deletes) = (BTreeMap::new(), BTreeMap::new());
        for (change, is_sure) in changes {
            let known = match change {
                Change::Add(fact) => adds.entry(*fact).or_insert(false),
                Change::Delete(fact) => deletes.entry(*fact).or_insert(false),
                Change::Update { .. } => {
                    snap.changes_numbers = true;
                    continue;
                }
            };
            *known |= is_sure;
        }
        for (fact, is_sure) in &adds {
            snap.may_make_true.push((*fact, true));
            if *is_sure {
                snap.surely_makes_true.push((*fact, true));
            }
        }
        for (fact, is_sure) in &deletes {
            let added = adds.get(fact);
            if added != Some(&true) {
                snap.may_make_true.push((*fact, false));
            }
            if *is_sure && added.is_none() {
                snap.surely_makes_true.push((*fact, false));
            }
        }
        snap
    }

    /// Returns `true` if the literal is certainly false after it.
    pub(super) fn ends(&self, literal: Literal) -> bool {
        self.surely_makes_true.contains(&(literal.0, !literal.1))
    }
}

/// Returns the literals among the conjuncts.
pub(super) fn literals(condition: &Condition) -> Vec<Literal> {
    let mut found: Vec<Literal> = Vec::new();
    for part in condition.conjuncts() {
        match part {
            Condition::Fact(fact) => found.push((*fact, true)),
            Condition::Not(part) => {
                if let Condition::Fact(fact) = &**part {
                    found.push((*fact, false));
                }
            }
            _ => {}
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

impl Instances {
    /// Returns all processes: first those that may start, by schema and arguments, then those that
    /// are running initially, in the order of the situation.
    pub(super) fn processes(&self, reached: &ReachedFacts) -> Vec<Process> {
        let moments = self.earliest_times(reached);
        let of = |action: &Action| {
            let (start, end, bounds, over_all) = match &action.body {
                Body::Instantaneous(snap) => (snap, None, None, Vec::new()),
                Body::Durative(body) => {
                    let bounds = moments.duration(body)?;
                    let over_all = literals(&body.over_all);
                    (&*body.start, Some(&*body.end), Some(bounds), over_all)
                }
            };
            let (least, most) = bounds.unwrap_or((Rational::ZERO, Some(Rational::ZERO)));
            Some(Process {
                name: action.name.clone(),
                schema: action.schema,
                arguments: action.arguments.clone(),
                start: Some(Snap::of(start)),
                end: end.map(Snap::of),
                body: action.body.clone(),
                over_all: if least.is_positive() {
                    over_all
                } else {
                    Vec::new()
                },
                least,
                most,
                initial_start: None,
            })
        };
        let mut processes: Vec<Process> = self.actions.iter().filter_map(of).collect();
        // The order of actions in states must not depend on the rounds that found the instances.
        processes.sort_by(|one, other| {
            (one.schema, &one.arguments).cmp(&(other.schema, &other.arguments))
        });
        let truth = &self.task.initial().facts;
        for running in &self.initial.running {
            let Some(body) = running.action.durative() else {
                continue;
            };
            let (least, most) = lasting(running, &self.initial.now);
            let mut over_all = literals(&body.over_all);
            // Literals that are false initially are left out: another happening may establish them
            // at once.
            over_all.retain(|(fact, is_true)| truth.contains(fact) == *is_true);
            processes.push(Process {
                name: running.action.name.clone(),
                schema: running.action.schema,
                arguments: running.action.arguments.clone(),
                start: None,
                end: Some(Snap::of(&body.end)),
                body: running.action.body.clone(),
                least,
                most,
                over_all,
                initial_start: Some(running.start.clone()),
            });
        }
        for process in &mut processes {
            process.over_all.retain(|own| !self.task.is_derived(own.0));
        }
        drop_cyclic_literals(&mut processes);
        processes
    }

    /// Returns `true` if only timed initials make the fact true, so that its intervals are known.
    pub(super) fn is_timed_only(&self, fact: FactId) -> bool {
        let fact: Fact = self.task.atom(fact);
        self.static_facts.spans(&fact).is_some()
    }
}

impl Process {
    /// Returns its name in certificates, which distinguishes actions that may start from those
    /// running initially.
    pub(super) fn title(&self) -> String {
        titled(self.initial_start.is_some(), &self.name)
    }

    /// Returns its name with other arguments.
    pub(super) fn title_with(&self, task: &Task, arguments: &[ObjectId]) -> String {
        titled(
            self.initial_start.is_some(),
            &task.action_name(self.schema, arguments),
        )
    }

    /// Returns the condition of an instantaneous action.
    pub(super) fn instant(&self) -> &Condition {
        match &self.body {
            Body::Instantaneous(snap) => &snap.condition,
            Body::Durative(body) => &body.start.condition,
        }
    }

    pub(super) fn durative(&self) -> Option<&DurativeBody> {
        match &self.body {
            Body::Durative(body) => Some(body),
            Body::Instantaneous(_) => None,
        }
    }

    /// Returns `true` if two instances that end together also started together, and together have
    /// the effects of a single one.
    fn is_idempotent(&self) -> bool {
        let is_fixed = self.most.as_ref() == Some(&self.least);
        let snaps = self.start.iter().chain(&self.end);
        let flows = self
            .durative()
            .is_some_and(|body| !body.continuous.is_empty());
        is_fixed
            && self.initial_start.is_none()
            && !flows
            && snaps.into_iter().all(|s| !s.changes_numbers)
    }
}

fn titled(is_begun: bool, name: &str) -> String {
    if is_begun {
        format!("begun {name}")
    } else {
        format!("doing {name}")
    }
}

/// Removes over-all literals for which simultaneous starts, or ends, might wait for each other in a
/// cycle; see the module.
fn drop_cyclic_literals(processes: &mut [Process]) {
    // A start waits for the starts that make true an over-all literal that it neither reads nor
    // establishes itself.
    let loose = |process: &Process| -> Vec<Literal> {
        let Some(start) = &process.start else {
            return Vec::new();
        };
        let own = process.over_all.iter().copied();
        own.filter(|own| !start.reads.contains(own) && !start.surely_makes_true.contains(own))
            .collect()
    };
    let waits: Vec<Vec<Literal>> = processes.iter().map(loose).collect();
    let gives = |process: &Process| {
        process
            .start
            .as_ref()
            .map_or_else(Vec::new, |s| s.may_make_true.clone())
    };
    let gives: Vec<Vec<Literal>> = processes.iter().map(gives).collect();
    let is_safe = acyclic_nodes(&waits, &gives, &|_| false);
    for ((process, waits), is_safe) in processes.iter_mut().zip(&waits).zip(is_safe) {
        if !is_safe {
            process.over_all.retain(|own| !waits.contains(own));
        }
    }
    // An end comes before the ends that make an over-all literal of the action false.
    let needs: Vec<Vec<Literal>> = processes.iter().map(|own| own.over_all.clone()).collect();
    let breaks = |process: &Process| -> Vec<Literal> {
        let makes = process.end.as_ref().map(|end| &end.may_make_true);
        makes
            .into_iter()
            .flatten()
            .map(|own| (own.0, !own.1))
            .collect()
    };
    let breaks: Vec<Vec<Literal>> = processes.iter().map(breaks).collect();
    let once: Vec<bool> = processes.iter().map(Process::is_idempotent).collect();
    // There is only one instance of an action that is running initially.
    let is_alone = |number: usize| once[number] || processes[number].initial_start.is_some();
    let is_safe = acyclic_nodes(&needs, &breaks, &is_alone);
    let broken: BTreeSet<Literal> = breaks.iter().flatten().copied().collect();
    for (process, is_safe) in processes.iter_mut().zip(is_safe) {
        if !is_safe {
            process.over_all.retain(|own| !broken.contains(own));
        }
    }
}

/// Returns the nodes that are on no cycle and lead to none. Each node waits for all others that
/// give one of the literals that it waits for, and for itself unless `never_for_itself` is true
/// (Kahn 1962).
fn acyclic_nodes(
    waits: &[Vec<Literal>],
    gives: &[Vec<Literal>],
    never_for_itself: &dyn Fn(usize) -> bool,
) -> Vec<bool> {
    let mut sources: BTreeMap<Literal, BTreeSet<usize>> = BTreeMap::new();
    for (number, literals) in gives.iter().enumerate() {
        for literal in literals {
            sources.entry(*literal).or_default().insert(number);
        }
    }
    let mut is_safe = vec![false; waits.len()];
    loop {
        let mut changed = false;
        for number in 0..waits.len() {
            if is_safe[number] {
                continue;
            }
            let is_free = waits[number].iter().all(|literal| {
                sources.get(literal).is_none_or(|sources| {
                    let mut left = sources.iter();
                    left.all(|&other| other == number && never_for_itself(number))
                })
            });
            if is_free {
                is_safe[number] = true;
                changed = true;
                for literal in &gives[number] {
                    if let Some(sources) = sources.get_mut(literal) {
                        sources.remove(&number);
                    }
                }
            }
        }
        if !changed {
            return is_safe;
        }
    }
}
