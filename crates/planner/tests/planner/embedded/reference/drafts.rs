//! Small random problems.

use std::fmt::Write;

use elbowroom_model::Task;
use elbowroom_model::ground::Action;
use proptest::prelude::*;

use crate::embedded::world::task;

/// Facts f0 … f3, an action for each entry, and timed initials.
#[derive(Clone, Debug)]
pub(crate) struct Draft {
    pub(crate) actions: Vec<DraftAction>,
    initial: u8,
    goal: u8,
    timed: Vec<(u8, u8, bool)>,
}

#[derive(Clone, Debug)]
pub(crate) struct DraftAction {
    /// 0 for an instantaneous action.
    duration: u8,
    at_start: Option<(u8, bool)>,
    over_all: Option<u8>,
    start: Vec<(u8, bool)>,
    end: Vec<(u8, bool)>,
    /// Amount taken from the store at the start, which must contain it.
    cost: u8,
    /// Amount added to the store at the end.
    gain: i8,
    /// `true` if the store must not run out while the action runs.
    pub(crate) keeps_store_nonempty: bool,
}

pub(crate) fn drafts() -> impl Strategy<Value = Draft> {
    let literal = || (0..4_u8, any::<bool>());
    let effects = || prop::collection::vec(literal(), 0..3);
    let action = (
        0..4_u8,
        prop::option::of(literal()),
        prop::option::of(0..4_u8),
        effects(),
        effects(),
        0..2_u8,
        (-2..2_i8, any::<bool>()),
    );
    let action = action.prop_map(
        |(duration, at_start, over_all, start, end, cost, (gain, minds))| DraftAction {
            duration,
            at_start,
            over_all,
            start,
            end,
            cost,
            gain,
            keeps_store_nonempty: minds,
        },
    );
    (
        prop::collection::vec(action, 1..4),
        0..16_u8,
        1..16_u8,
        prop::collection::vec((1..5_u8, 0..4_u8, any::<bool>()), 0..3),
    )
        .prop_map(|(actions, initial, goal, timed)| Draft {
            actions,
            initial,
            goal,
            timed,
        })
}

/// Drafts with finite plans: the store is never replenished. Several happenings of one time that
/// change it, which the planner does not support, do not affect any condition.
pub(crate) fn thrifty_drafts() -> impl Strategy<Value = Draft> {
    drafts().prop_map(|mut draft| {
        for action in &mut draft.actions {
            action.keeps_store_nonempty = false;
            action.gain = action.gain.min(0);
        }
        draft
    })
}

fn written(literals: &[(u8, bool)], when: &str) -> String {
    let mut text = String::new();
    // Simultaneous addition and deletion of a fact is not the subject of this test.
    let mut seen = Vec::new();
    for (fact, truth) in literals {
        if seen.contains(fact) {
            continue;
        }
        seen.push(*fact);
        let literal = if *truth {
            format!("(f{fact})")
        } else {
            format!("(not (f{fact}))")
        };
        if when.is_empty() {
            write!(text, " {literal}").expect("as written above");
        } else {
            write!(text, " (at {when} {literal})").expect("as written above");
        }
    }
    text
}

/// Cost of an action: at its start, at its end, and for each unit of its duration.
pub(crate) type Price = (u8, u8, u8);

/// Metrics of the random problems.
pub(crate) const METRICS: &[&str] = &[
    "minimize (cost)",
    "minimize (+ (cost) (total-time))",
    "minimize (+ (* 3 (cost)) (* 0.5 (total-time)))",
    "minimize (- (cost) (store))",
    "minimize (total-time)",
];

impl Draft {
    pub(crate) fn task(&self) -> Task {
        self.task_with(&[], "")
    }

    /// Returns the task with costs of actions.
    pub(crate) fn task_with(&self, prices: &[Price], metric: &str) -> Task {
        let mut domain = "(:requirements :durative-actions :numeric-fluents :adl
            :timed-initial-literals) (:predicates (f0) (f1) (f2) (f3)) (:functions (store) (cost))"
            .to_owned();
        for (number, action) in self.actions.iter().enumerate() {
            let (at_start, at_end, rate) = prices.get(number).copied().unwrap_or_default();
            let needs = action.at_start.iter().copied().collect::<Vec<_>>();
            if action.duration == 0 {
                let mut needs = written(&needs, "");
                let mut effects = written(&action.start, "");
                if action.cost > 0 {
                    write!(needs, " (>= (store) {})", action.cost).expect("strings take all");
                    write!(effects, " (decrease (store) {})", action.cost)
                        .expect("strings take all");
                }
                if at_start > 0 {
                    write!(effects, " (increase (cost) {at_start})").expect("strings take all");
                }
                write!(
                    domain,
                    "(:action a{number} :parameters () :precondition (and{needs})
                      :effect (and{effects}))",
                )
                .expect("as written above");
                continue;
            }
            let mut needs = written(&needs, "start");
            let mut effects = written(&action.start, "start");
            effects += &written(&action.end, "end");
            if let Some(fact) = action.over_all {
                write!(needs, " (over all (f{fact}))").expect("strings take all");
            }
            if action.keeps_store_nonempty {
                needs += " (over all (>= (store) 0))";
            }
            if action.gain != 0 {
                write!(effects, " (at end (increase (store) {}))", action.gain)
                    .expect("strings take all");
            }
            if action.cost > 0 {
                write!(needs, " (at start (>= (store) {}))", action.cost)
                    .expect("strings take all");
                write!(effects, " (at start (decrease (store) {}))", action.cost)
                    .expect("strings take all");
            }
            if at_start > 0 {
                write!(effects, " (at start (increase (cost) {at_start}))")
                    .expect("strings take all");
            }
            if at_end + rate > 0 {
                write!(
                    effects,
                    " (at end (increase (cost) (+ {at_end} (* {rate} ?duration))))"
                )
                .expect("strings take all");
            }
            write!(
                domain,
                "(:durative-action a{number} :parameters () :duration (= ?duration {})
                  :condition (and{needs}) :effect (and{effects}))",
                action.duration
            )
            .expect("as written above");
        }
        let facts = |bits: u8| {
            let facts = (0..4).filter(|bit| bits >> bit & 1 == 1);
            facts
                .map(|bit| format!("(f{bit})"))
                .collect::<Vec<_>>()
                .concat()
        };
        let mut initial = facts(self.initial) + "(= (store) 2) (= (cost) 0)";
        // Happenings of one time have no order, so no fact may become both true and false.
        let mut said = std::collections::BTreeSet::new();
        for (time, fact, truth) in &self.timed {
            if !said.insert((time, fact)) {
                continue;
            }
            let literal = written(&[(*fact, *truth)], "");
            write!(initial, " (at {time}{literal})").expect("as written above");
        }
        let goal = facts(self.goal);
        let metric = match metric {
            "" => String::new(),
            metric => format!("(:metric {metric})"),
        };
        task(
            &domain,
            &format!("(:init {initial}) (:goal (and {goal})) {metric}"),
        )
    }
}

impl Draft {
    pub(crate) fn ground(&self, task: &Task) -> Vec<Action> {
        let numbers = 0..self.actions.len();
        let ground = |number: usize| {
            let schema = task.problem().schema(&format!("a{number}"));
            let schema = schema.expect("as written above");
            task.instantiate(schema, &[]).expect("as written above")
        };
        numbers.map(ground).collect()
    }
}
