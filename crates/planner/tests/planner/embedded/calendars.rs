//! Calendars as windows of the temporal network, compared with calendars as choices of the search:
//! the same answers, and the same best makespans.

use std::fmt::Write;
use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::validate::{Settings as Strictness, Verdict};
use elbowroom_model::{RunningAction, Situation, Task, validate_from};
use elbowroom_num::{Interval, Rational};
use elbowroom_planner::embedded::{Technique, Tuning};
use elbowroom_planner::{Answer, Settings, Stopped, plan};
use proptest::prelude::*;

use crate::embedded::world::{answer, describe, makespan, task};

/// Facts `f0` … `f2`, which actions change, and calendars `c0` … `c2`, each by number and truth.
type Literal = (u8, bool);

#[derive(Clone, Debug)]
struct DraftAction {
    /// 0 for an instantaneous action.
    duration: u8,
    /// At start, over all, at end.
    needs: [Option<Literal>; 3],
    dates: [Vec<Literal>; 3],
    start: Vec<Literal>,
    end: Vec<Literal>,
}

#[derive(Clone, Debug)]
struct Draft {
    actions: Vec<DraftAction>,
    initial: u8,
    goal: Vec<Literal>,
    /// For each calendar, its first truth, and the times at which it changes or is repeated.
    calendars: Vec<(bool, Vec<(u8, bool)>)>,
    /// A timed initial of a fact that actions change.
    timed: Option<(u8, Literal)>,
    /// `true` if the goal reads a calendar.
    goal_is_dated: bool,
}

fn drafts() -> impl Strategy<Value = Draft> {
    let fact = || (0..3_u8, prop::bool::weighted(0.8));
    let dates = || prop::collection::vec((0..3_u8, prop::bool::weighted(0.7)), 0..2);
    let few = |most| prop::collection::vec(fact(), 0..most);
    let action = (
        0..6_u8,
        (
            prop::option::weighted(0.6, fact()),
            prop::option::weighted(0.3, fact()),
            prop::option::weighted(0.2, fact()),
        ),
        (dates(), dates(), dates()),
        few(2),
        few(3),
    );
    let action = action.prop_map(|(duration, needs, dates, start, end)| DraftAction {
        duration,
        needs: needs.into(),
        dates: dates.into(),
        start,
        end,
    });
    let calendar = (
        any::<bool>(),
        prop::collection::vec((1..5_u8, prop::bool::weighted(0.1)), 0..6),
    );
    let calendar = calendar.prop_map(|(first, gaps)| {
        let (mut time, mut truth) = (0, first);
        let changes = gaps.into_iter().map(|(gap, is_said_again)| {
            time += gap;
            truth ^= !is_said_again;
            (time, truth)
        });
        (first, changes.collect())
    });
    (
        prop::collection::vec(action, 3..6),
        prop::sample::select(vec![0_u8, 0, 0, 1, 4]),
        prop::collection::vec((0..3_u8, prop::bool::weighted(0.9)), 2..5),
        prop::collection::vec(calendar, 3),
        prop::option::weighted(0.2, (1..9_u8, fact())),
        prop::bool::weighted(0.1),
    )
        .prop_map(
            |(mut actions, initial, goal, calendars, timed, goal_is_dated)| {
                for (number, action) in (0..).zip(&mut actions) {
                    action.end.insert(0, (number % 3, true));
                }
                Draft {
                    actions,
                    initial,
                    goal,
                    calendars,
                    timed,
                    goal_is_dated,
                }
            },
        )
}

fn literal(name: &str, (number, truth): Literal) -> String {
    if truth {
        format!("({name}{number})")
    } else {
        format!("(not ({name}{number}))")
    }
}

fn effects(literals: &[Literal], when: &str) -> String {
    let mut seen = Vec::new();
    let mut text = String::new();
    for &effect in literals {
        if !seen.contains(&effect.0) {
            seen.push(effect.0);
            write!(text, " ({when} {})", literal("f", effect)).unwrap();
        }
    }
    text
}

impl Draft {
    fn task(&self) -> Task {
        let mut domain = "(:requirements :durative-actions :adl :timed-initial-literals)
            (:predicates (f0) (f1) (f2) (c0) (c1) (c2))"
            .to_owned();
        for (number, action) in self.actions.iter().enumerate() {
            let mut needs = String::new();
            let whens = if action.duration > 0 {
                ["at start", "over all", "at end"]
            } else {
                ["and", "and", "and"]
            };
            for (when, (need, dates)) in whens.iter().zip(action.needs.iter().zip(&action.dates)) {
                let facts = need.iter().map(|&need| literal("f", need));
                for text in facts.chain(dates.iter().map(|&date| literal("c", date))) {
                    write!(needs, " ({when} {text})").unwrap();
                }
            }
            if action.duration > 0 {
                let changes = effects(&action.start, "at start") + &effects(&action.end, "at end");
                write!(
                    domain,
                    "(:durative-action a{number} :parameters () :duration (= ?duration {})
                      :condition (and{needs}) :effect (and{changes}))",
                    action.duration
                )
                .unwrap();
            } else {
                let changes = effects(&action.end, "and");
                write!(
                    domain,
                    "(:action a{number} :parameters () :precondition (and{needs})
                      :effect (and{changes}))"
                )
                .unwrap();
            }
        }
        let mut initial = String::new();
        for fact in (0..3).filter(|fact| self.initial >> fact & 1 == 1) {
            write!(initial, " (f{fact})").unwrap();
        }
        for (number, (first, changes)) in (0..).zip(&self.calendars) {
            if *first {
                write!(initial, " (c{number})").unwrap();
            }
            for &(time, truth) in changes {
                write!(initial, " (at {time} {})", literal("c", (number, truth))).unwrap();
            }
        }
        if let Some((time, change)) = self.timed {
            write!(initial, " (at {time} {})", literal("f", change)).unwrap();
        }
        let mut goal: String = self.goal.iter().map(|&l| literal("f", l)).collect();
        if self.goal_is_dated {
            goal += "(c0)";
        }
        task(&domain, &format!("(:init {initial}) (:goal (and {goal}))"))
    }
}

/// Returns the planner's answer within a limited number of reports, with calendars as windows or as
/// choices.
fn answer_with(task: &Task, situation: &Situation, is_first: bool, as_windows: bool) -> Answer {
    let mut tuning = Tuning::default();
    if !as_windows {
        tuning.without.push(Technique::Calendars);
    }
    answer_by(task, situation, is_first, tuning)
}

/// Returns the planner's answer within a limited number of reports, with a detour before anything
/// else, or without detours.
fn answer_by_detour(task: &Task, situation: &Situation, is_first: bool, detours: bool) -> Answer {
    let mut tuning = Tuning::default();
    tuning.detour_after = 0;
    if !detours {
        tuning.without.push(Technique::Detours);
    }
    answer_by(task, situation, is_first, tuning)
}

fn answer_by(task: &Task, situation: &Situation, is_first: bool, tuning: Tuning) -> Answer {
    let settings = Settings {
        first_plan_only: is_first,
        max_memory: 64 << 20,
        tuning,
        ..Settings::default()
    };
    let mut turns = 0;
    plan(task, situation, &settings, &mut |_| {
        turns += 1;
        if turns > 150 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })
}

/// Returns a situation at some time between 2 and 6 in which the first durative action has been
/// running since 1, and may last 2 time units longer than planned.
fn situation_of(draft: &Draft, task: &Task, time: &Rational) -> Situation {
    let mut situation = Situation::initial(task);
    situation.time = time.clone();
    let mut changes: Vec<(Rational, String, bool)> = Vec::new();
    for (number, (_, own)) in draft.calendars.iter().enumerate() {
        let own = own.iter();
        changes.extend(own.map(|&(at, truth)| (i64::from(at).into(), format!("c{number}"), truth)));
    }
    if let Some((at, (number, truth))) = draft.timed {
        changes.push((i64::from(at).into(), format!("f{number}"), truth));
    }
    let fact_of = |name: &str| {
        let predicate = task.problem().predicate(name).unwrap();
        task.find_fact(predicate, &[])
    };
    // In each calendar, changes are in order of time.
    for (_, name, truth) in changes.into_iter().filter(|change| change.0 <= *time) {
        let Some(fact) = fact_of(&name) else { continue };
        if truth {
            situation.state.facts.insert(fact);
        } else {
            situation.state.facts.remove(&fact);
        }
    }
    let running = draft.actions.iter().position(|action| action.duration > 0);
    if let Some(number) = running {
        let schema = task.problem().schema(&format!("a{number}")).unwrap();
        let duration = Rational::from(i64::from(draft.actions[number].duration));
        let most = &duration + Rational::from(2);
        situation.running.push(RunningAction {
            action: Arc::new(task.instantiate(schema, &[]).unwrap()),
            start: Rational::ONE,
            duration: Interval::closed(duration, most),
        });
    }
    situation
}

fn check_valid(task: &Task, situation: &Situation, answer: &Answer) {
    if let Some(found) = answer.found() {
        let verdict = validate_from(task, situation, &found.plan, &Strictness::default());
        assert!(matches!(verdict, Verdict::Valid(_)), "{}", describe(answer));
    }
}

/// Checks that both plans are valid, and that no plan exists if one answer proves so.
fn check_agreement(task: &Task, situation: &Situation, answers: &[Answer; 2]) {
    for answer in answers {
        check_valid(task, situation, answer);
    }
    let is_claimed = answers
        .iter()
        .any(|answer| matches!(answer, Answer::Unsolvable { .. }));
    let is_found = answers.iter().any(|answer| answer.found().is_some());
    assert!(
        !(is_claimed && is_found),
        "with windows: {}\nwith choices: {}",
        describe(&answers[0]),
        describe(&answers[1])
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn problem_is_solvable_with_windows_exactly_when_it_is_with_choices(draft in drafts()) {
        let task = draft.task();
        let situation = Situation::initial(&task);
        let answers = [true, false].map(|as_windows| {
            answer_with(&task, &situation, true, as_windows)
        });
        check_agreement(&task, &situation, &answers);
    }

    #[test]
    fn situation_is_solvable_with_windows_exactly_when_it_is_with_choices(
        draft in drafts(),
        tenths in 20..60_i64,
        is_on_grid in any::<bool>(),
    ) {
        let task = draft.task();
        let mut time = Rational::new(tenths, 10);
        if !is_on_grid {
            time += Rational::from_f64_as_written(0.022_737_979_888_916_016).unwrap();
        }
        let situation = situation_of(&draft, &task, &time);
        let answers = [true, false].map(|as_windows| {
            answer_with(&task, &situation, true, as_windows)
        });
        check_agreement(&task, &situation, &answers);
    }

    #[test]
    fn detours_find_plans_of_the_problem(draft in drafts(), tenths in 20..60_i64) {
        let task = draft.task();
        let beginning = Situation::initial(&task);
        let later = situation_of(&draft, &task, &Rational::new(tenths, 10));
        for situation in [beginning, later] {
            let answers = [true, false].map(|detours| {
                answer_by_detour(&task, &situation, true, detours)
            });
            check_agreement(&task, &situation, &answers);
            let best = [true, false].map(|detours| {
                answer_by_detour(&task, &situation, false, detours)
            });
            check_agreement(&task, &situation, &best);
            let ends = best.each_ref().map(|answer| match answer {
                Answer::Plan { found, stopped: Stopped::Exhausted, .. } => {
                    Some(found.makespan.clone())
                }
                _ => None,
            });
            if let [Some(with), Some(without)] = &ends {
                prop_assert_eq!(with, without, "{}\n{}", describe(&best[0]), describe(&best[1]));
            }
        }
    }

    #[test]
    fn best_makespan_with_windows_is_the_best_one_with_choices(draft in drafts()) {
        let task = draft.task();
        let situation = Situation::initial(&task);
        let answers = [true, false].map(|as_windows| {
            answer_with(&task, &situation, false, as_windows)
        });
        for answer in &answers {
            check_valid(&task, &situation, answer);
        }
        let ends = answers.each_ref().map(|answer| match answer {
            Answer::Plan { found, stopped: Stopped::Exhausted, .. } => Some(found.makespan.clone()),
            _ => None,
        });
        if let [Some(with), Some(without)] = &ends {
            prop_assert_eq!(with, without, "{}\n{}", describe(&answers[0]), describe(&answers[1]));
        }
    }
}

const SHOP: &str = "(:requirements :typing :durative-actions :timed-initial-literals)
    (:predicates (open) (dry) (bought) (sown))
    (:durative-action buy :parameters () :duration (= ?duration 5)
      :condition (and (at start (open)) (at end (open))) :effect (at end (bought)))
    (:durative-action sow :parameters () :duration (= ?duration 8)
      :condition (and (over all (open)) (over all (dry))) :effect (at end (sown)))";

#[test]
fn action_waits_for_a_window_that_is_long_enough() {
    let init = "(:init (at 1 (open)) (at 5 (not (open))) (at 10 (open)) (at 20 (not (open)))
        (dry) (at 17 (not (dry))) (at 30 (open)) (at 31 (dry)))";
    assert_eq!(
        makespan(&answer(SHOP, &format!("{init} (:goal (bought))"))),
        "15001/1000"
    );
    assert_eq!(
        makespan(&answer(SHOP, &format!("{init} (:goal (sown))"))),
        "39"
    );
}

#[test]
fn no_window_is_long_enough() {
    let init = "(:init (dry) (open) (at 7 (not (open))) (at 10 (open)) (at 17.9 (not (open))))";
    let answer = answer(SHOP, &format!("{init} (:goal (sown))"));
    assert!(
        matches!(answer, Answer::Unsolvable { .. }),
        "{}",
        describe(&answer)
    );
}
