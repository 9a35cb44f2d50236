//! Known and open continuous changes, with linear programs of few happenings and of all: the same
//! answers.

use std::fmt::Write;
use std::ops::ControlFlow;

use elbowroom_model::{Situation, Task};
use elbowroom_planner::embedded::{Technique, Tuning};
use elbowroom_planner::{Answer, Settings, Stopped, plan};
use proptest::prelude::*;

use crate::embedded::world::{describe, task};

/// An action that changes one of two levels continuously.
#[derive(Clone, Debug)]
struct DraftAction {
    duration: u8,
    /// The possible additional duration.
    margin: Option<u8>,
    level: u8,
    rate: i8,
    /// A fact that must hold at the start, and one that must hold over all.
    needs: [Option<u8>; 2],
    /// Thresholds of the level: at start, over all, at end.
    tests: [Option<(bool, i8)>; 3],
    /// A fact that is deleted at the start and added at the end.
    takes: Option<u8>,
    gives: u8,
    /// A jump of the level at the end.
    jump: i8,
}

#[derive(Clone, Debug)]
struct Draft {
    actions: Vec<DraftAction>,
    initial: u8,
    levels: [i8; 2],
    goal: Vec<u8>,
    least: Option<(u8, i8)>,
    /// A bit for each action that needs the idle machine of its level, and occupies it while it
    /// runs.
    machines: u8,
}

fn drafts() -> impl Strategy<Value = Draft> {
    let test = |weight| prop::option::weighted(weight, (any::<bool>(), 0..12_i8));
    let action = (
        (1..6_u8, prop::option::weighted(0.25, 1..5_u8)),
        (0..2_u8, -2..4_i8),
        (
            prop::option::weighted(0.4, 0..3_u8),
            prop::option::weighted(0.2, 0..3_u8),
        ),
        (test(0.2), test(0.6), test(0.2)),
        prop::option::weighted(0.3, 0..3_u8),
        prop_oneof![3 => Just(0_i8), 1 => -3..4_i8],
    );
    let action =
        action.prop_map(
            |(duration, (level, rate), needs, tests, takes, jump)| DraftAction {
                duration: duration.0,
                margin: duration.1,
                level,
                rate,
                needs: needs.into(),
                tests: tests.into(),
                takes,
                gives: 0,
                jump,
            },
        );
    (
        prop::collection::vec(action, 3..5),
        prop::sample::select(vec![0_u8, 1, 2, 4, 7]),
        [0..12_i8, 0..12_i8],
        prop::collection::vec(0..3_u8, 1..4),
        (
            prop::option::weighted(0.4, (0..2_u8, 0..15_i8)),
            prop_oneof![3 => Just(u8::MAX), 1 => any::<u8>(), 2 => Just(0)],
        ),
    )
        .prop_map(|(mut actions, initial, levels, goal, (least, machines))| {
            for (number, action) in (0..).zip(&mut actions) {
                action.gives = number % 3;
            }
            Draft {
                actions,
                initial,
                levels,
                goal,
                least,
                machines,
            }
        })
}

impl Draft {
    fn task(&self) -> Task {
        let mut domain = "(:requirements :durative-actions :numeric-fluents :continuous-effects
             :duration-inequalities :adl)
            (:predicates (f0) (f1) (f2) (idle0) (idle1)) (:functions (l0) (l1))"
            .to_owned();
        for (number, action) in self.actions.iter().enumerate() {
            let (level, rate) = (action.level, action.rate);
            let mut needs = String::new();
            for (when, fact) in ["at start", "over all"].iter().zip(action.needs) {
                if let Some(fact) = fact {
                    write!(needs, " ({when} (f{fact}))").unwrap();
                }
            }
            for (when, test) in ["at start", "over all", "at end"].iter().zip(action.tests) {
                if let Some((is_least, bound)) = test {
                    // A falling level has a lower bound, and a rising one an upper bound.
                    let compare = if is_least == (rate <= 1) { ">=" } else { "<=" };
                    write!(needs, " ({when} ({compare} (l{level}) {bound}))").unwrap();
                }
            }
            let mut changes = format!(" (at end (f{}))", action.gives);
            if let Some(fact) = action.takes.filter(|&fact| fact != action.gives) {
                write!(changes, " (at start (not (f{fact}))) (at end (f{fact}))").unwrap();
            }
            if self.machines >> number & 1 == 1 {
                write!(needs, " (at start (idle{level}))").unwrap();
                write!(
                    changes,
                    " (at start (not (idle{level}))) (at end (idle{level}))"
                )
                .unwrap();
            }
            if rate != 0 {
                let (verb, size) = if rate < 0 {
                    ("increase", -rate)
                } else {
                    ("decrease", rate)
                };
                write!(changes, " ({verb} (l{level}) (* #t {size}))").unwrap();
            }
            if action.jump != 0 {
                write!(changes, " (at end (increase (l{level}) {}))", action.jump).unwrap();
            }
            let duration = match action.margin {
                None => format!("(= ?duration {})", action.duration),
                Some(room) => format!(
                    "(and (>= ?duration {}) (<= ?duration {}))",
                    action.duration,
                    action.duration + room
                ),
            };
            write!(
                domain,
                "(:durative-action a{number} :parameters () :duration {duration}
                  :condition (and{needs}) :effect (and{changes}))"
            )
            .unwrap();
        }
        let mut initial = " (idle0) (idle1)".to_owned();
        for fact in (0..3).filter(|fact| self.initial >> fact & 1 == 1) {
            write!(initial, " (f{fact})").unwrap();
        }
        for (level, value) in self.levels.iter().enumerate() {
            write!(initial, " (= (l{level}) {value})").unwrap();
        }
        let mut goal: String = self.goal.iter().map(|fact| format!("(f{fact})")).collect();
        if let Some((level, least)) = self.least {
            write!(goal, " (>= (l{level}) {least})").unwrap();
        }
        task(&domain, &format!("(:init {initial}) (:goal (and {goal}))"))
    }
}

/// Returns the planner's answer within a number of reports. Its plans have been validated.
fn answer(task: &Task, without: &[Technique]) -> Answer {
    let mut tuning = Tuning::default();
    tuning.without.push(Technique::Cleanup);
    tuning.without.extend(without);
    let settings = Settings {
        first_plan_only: true,
        max_memory: 64 << 20,
        tuning,
        ..Settings::default()
    };
    let situation = Situation::initial(task);
    plan(task, &situation, &settings, &mut |progress| {
        if progress.counts.evaluated > 100 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, max_shrink_iters: 100, ..ProptestConfig::default() })]

    #[test]
    fn problem_is_solvable_with_few_happenings_exactly_when_it_is_with_all(draft in drafts()) {
        let task = draft.task();
        let answers = [&[][..], &[Technique::Projection]].map(|without| answer(&task, without));
        // If one search was interrupted, there is nothing to compare.
        if !answers.iter().any(is_interrupted) {
            prop_assert_eq!(describe(&answers[0]), describe(&answers[1]));
        }
    }

    #[test]
    fn treating_drains_as_end_changes_keeps_solvability(draft in drafts()) {
        let task = draft.task();
        let answers =
            [&[][..], &[Technique::ContinuousDrains]].map(|without| answer(&task, without));
        if !answers.iter().any(is_interrupted) {
            let are_found = answers.each_ref().map(|answer| answer.found().is_some());
            prop_assert_eq!(are_found[0], are_found[1]);
        }
    }
}

/// Returns `true` if the turns were used up.
fn is_interrupted(answer: &Answer) -> bool {
    matches!(
        answer,
        Answer::NoneFound {
            stopped: Stopped::Interrupted,
            ..
        }
    )
}
