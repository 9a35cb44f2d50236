//! What happens in the order of time: starts, ends and instants, with the literals that they read and
//! make true.
//!
//! All that follows rests on one lemma. In a valid plan, what happens at one time does not interfere, so
//! that it can be put into any order, one after the other: each condition holds in the state just before,
//! and the state after all is the same. An over-all literal of an action that lasts holds in each of these
//! states, from the one after its start to the one before its end, if only two things are seen to: the
//! start comes after what makes the literal true at that time, and the end before what makes it false.
//! Such an order exists unless starts wait for each other in a circle, or ends do. Literals in which a
//! circle is possible are left out of [`Process::over_all`] ([`leave_out_circles`]), and so are all of an
//! action that may take no time.
//!
//! Numbers and disjunctions of over-all conditions are left out, too.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body, Change, Condition, DurativeBody, FactId, SnapAction};
use elbowroom_model::problem::{ObjectId, SchemaId};
use elbowroom_num::Rational;

use super::beginning::lasting;
use super::instances::Instances;
use super::{Fact, Reached};

/// A fact, and whether it is true.
pub(super) type Literal = (FactId, bool);

/// An action that plans may have, or one under way at the beginning.
#[derive(Clone, Debug)]
pub(super) struct Process {
    /// `(name object …)`.
    pub(super) name: String,
    pub(super) schema: SchemaId,
    pub(super) arguments: Vec<ObjectId>,
    /// `None` if it is under way at the beginning.
    pub(super) start: Option<Snap>,
    /// `None` if it takes no time.
    pub(super) end: Option<Snap>,
    pub(super) body: Body,
    /// Its durations are within these bounds.
    pub(super) least: Rational,
    pub(super) most: Option<Rational>,
    /// The literals that hold whenever it is under way.
    pub(super) over_all: Vec<Literal>,
    /// When it started, if it is under way at the beginning.
    pub(super) begun: Option<Rational>,
}

/// What a happening reads and makes true.
#[derive(Clone, Debug, Default)]
pub(super) struct Snap {
    /// The literals among the conjuncts of its condition.
    pub(super) reads: Vec<Literal>,
    /// What it may make true.
    pub(super) makes: Vec<Literal>,
    /// What is surely true after it by its effects.
    pub(super) leaves: Vec<Literal>,
    /// Whether it changes numbers.
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

    /// Of changes, and whether each of them is sure. An addition wins over a deletion.
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
            snap.makes.push((*fact, true));
            if *is_sure {
                snap.leaves.push((*fact, true));
            }
        }
        for (fact, is_sure) in &deletes {
            let added = adds.get(fact);
            if added != Some(&true) {
                snap.makes.push((*fact, false));
            }
            if *is_sure && added.is_none() {
                snap.leaves.push((*fact, false));
            }
        }
        snap
    }

    /// Whether the literal is surely false after it.
    pub(super) fn ends(&self, literal: Literal) -> bool {
        self.leaves.contains(&(literal.0, !literal.1))
    }
}

/// The literals among the conjuncts.
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
    /// Returns all processes: by schema and arguments those that may start, then those that run at the beginning, in
    /// the order of the situation.
    pub(super) fn processes(&self, reached: &Reached) -> Vec<Process> {
        let moments = self.moments(reached);
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
                begun: None,
            })
        };
        let mut processes: Vec<Process> = self.actions.iter().filter_map(of).collect();
        // States list actions in this order, which must not depend on the rounds that found the instances.
        processes.sort_by(|one, other| {
            (one.schema, &one.arguments).cmp(&(other.schema, &other.arguments))
        });
        let truth = &self.task.initial().facts;
        for running in &self.beginning.running {
            let Some(body) = running.action.durative() else {
                continue;
            };
            let (least, most) = lasting(running, &self.beginning.now);
            let mut over_all = literals(&body.over_all);
            // What does not hold now may be made good at once.
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
                begun: Some(running.start.clone()),
            });
        }
        for process in &mut processes {
            process.over_all.retain(|own| !self.task.is_derived(own.0));
        }
        leave_out_circles(&mut processes);
        processes
    }

    /// Whether only timed initials make the fact true, so that it is known when it may hold.
    pub(super) fn is_timed_only(&self, fact: FactId) -> bool {
        let fact: Fact = self.task.atom(fact);
        self.lasting.spans(&fact).is_some()
    }
}

impl Process {
    /// Its name in certificates: one that may start is told from one that was under way at the beginning.
    pub(super) fn title(&self) -> String {
        titled(self.begun.is_some(), &self.name)
    }

    /// The same with other objects.
    pub(super) fn title_with(&self, task: &Task, arguments: &[ObjectId]) -> String {
        titled(
            self.begun.is_some(),
            &task.action_name(self.schema, arguments),
        )
    }

    /// The condition of an instant.
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

    /// Whether two of it that end together began together, and leave what one of them does.
    fn counts_once(&self) -> bool {
        let is_fixed = self.most.as_ref() == Some(&self.least);
        let snaps = self.start.iter().chain(&self.end);
        let flows = self
            .durative()
            .is_some_and(|body| !body.continuous.is_empty());
        is_fixed && self.begun.is_none() && !flows && snaps.into_iter().all(|s| !s.changes_numbers)
    }
}

fn titled(is_begun: bool, name: &str) -> String {
    if is_begun {
        format!("begun {name}")
    } else {
        format!("doing {name}")
    }
}

/// Leaves out over-all literals for which starts of one time, or ends, might wait for each other in a
/// circle: see the module.
fn leave_out_circles(processes: &mut [Process]) {
    // Starts: it waits for those whose start makes true what its own does not see to.
    let loose = |process: &Process| -> Vec<Literal> {
        let Some(start) = &process.start else {
            return Vec::new();
        };
        let own = process.over_all.iter().copied();
        own.filter(|own| !start.reads.contains(own) && !start.leaves.contains(own))
            .collect()
    };
    let waits: Vec<Vec<Literal>> = processes.iter().map(loose).collect();
    let gives = |process: &Process| {
        process
            .start
            .as_ref()
            .map_or_else(Vec::new, |s| s.makes.clone())
    };
    let gives: Vec<Vec<Literal>> = processes.iter().map(gives).collect();
    let is_safe = without_circles(&waits, &gives, &|_| false);
    for ((process, waits), is_safe) in processes.iter_mut().zip(&waits).zip(is_safe) {
        if !is_safe {
            process.over_all.retain(|own| !waits.contains(own));
        }
    }
    // Ends: it has to come before those whose end makes false what it needs throughout.
    let needs: Vec<Vec<Literal>> = processes.iter().map(|own| own.over_all.clone()).collect();
    let breaks = |process: &Process| -> Vec<Literal> {
        let makes = process.end.as_ref().map(|end| &end.makes);
        makes
            .into_iter()
            .flatten()
            .map(|own| (own.0, !own.1))
            .collect()
    };
    let breaks: Vec<Vec<Literal>> = processes.iter().map(breaks).collect();
    let once: Vec<bool> = processes.iter().map(Process::counts_once).collect();
    // Of actions under way each is itself, and there is no other.
    let is_alone = |number: usize| once[number] || processes[number].begun.is_some();
    let is_safe = without_circles(&needs, &breaks, &is_alone);
    let broken: BTreeSet<Literal> = breaks.iter().flatten().copied().collect();
    for (process, is_safe) in processes.iter_mut().zip(is_safe) {
        if !is_safe {
            process.over_all.retain(|own| !broken.contains(own));
        }
    }
}

/// Those that are on no circle, and lead to none: each waits for all others that give what it waits
/// for, and for itself unless that does not count (Kahn 1962).
fn without_circles(
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
