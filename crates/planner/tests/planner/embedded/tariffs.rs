//! Effects that read fluents that only timed initials change.

use std::fmt::Write;
use std::ops::ControlFlow;

use elbowroom_model::validate::{Settings as Strictness, Verdict};
use elbowroom_model::{Situation, Task, validate_from};
use elbowroom_num::Rational;
use elbowroom_planner::{Answer, Settings, Stopped, Technique, plan};
use proptest::prelude::*;

use crate::embedded::world::{answer_from, describe, task};

/// Machines wash while the price of electricity is low; each load costs the price at its end.
const LAUNDRY: &str = "
    (:requirements :typing :durative-actions :numeric-fluents :timed-initial-literals)
    (:types machine load)
    (:predicates (idle ?m - machine) (dirty ?l - load) (clean ?l - load))
    (:functions (price) (cost))
    (:durative-action wash :parameters (?m - machine ?l - load) :duration (= ?duration 10)
      :condition (and (at start (idle ?m)) (at start (dirty ?l)) (over all (<= (price) 3)))
      :effect (and (at start (not (idle ?m))) (at start (not (dirty ?l)))
        (at end (idle ?m)) (at end (clean ?l)) (at end (increase (cost) (price)))))";

/// Returns eight loads for two machines. In turn, the price is 2 and 3 for 12 time units of 40, and 5 otherwise.
fn laundry(goal: &str) -> Task {
    let loads: Vec<String> = (0..8).map(|load| format!("l{load}")).collect();
    let of_all = |fact: &str| -> String {
        loads
            .iter()
            .map(|load| format!(" ({fact} {load})"))
            .collect()
    };
    let tariff = |round: usize| {
        let low = 20 + 40 * round;
        let (rise, price) = (low + 12, 2 + round % 2);
        format!(" (at {low} (= (price) {price})) (at {rise} (= (price) 5))")
    };
    let tariffs: String = (0..8).map(tariff).collect();
    let problem = format!(
        "(:objects a b - machine {} - load)
         (:init (idle a) (idle b) (= (price) 5) (= (cost) 0){}{tariffs})
         (:goal (and{} {goal})) (:metric minimize (cost))",
        loads.join(" "),
        of_all("dirty"),
        of_all("clean"),
    );
    task(LAUNDRY, &problem)
}

#[test]
fn metric_of_a_timed_fluent_does_not_delay_the_first_plan() {
    let task = laundry("");
    let states_before_first_plan = |first_plan_only: bool| {
        let settings = Settings {
            first_plan_only,
            ..Settings::default()
        };
        let mut states = None;
        let situation = Situation::initial(&task);
        let answer = plan(&task, &situation, &settings, &mut |progress| {
            if progress.best.is_some() && states.is_none() {
                states = Some(progress.counts.evaluated);
            }
            match progress.counts.evaluated {
                0..3000 => ControlFlow::Continue(()),
                _ => ControlFlow::Break(()),
            }
        });
        (
            states,
            answer.found().and_then(|found| found.metric.clone()),
        )
    };
    let (alone, _) = states_before_first_plan(true);
    let (states, best_cost) = states_before_first_plan(false);
    assert!(alone.is_some());
    assert_eq!(states, alone);
    // All loads are washed while the price is 2.
    assert_eq!(best_cost, Some(Rational::from(16)));
}

#[test]
fn goal_limits_the_cost_by_a_tariff() {
    let found = |budget: u8| {
        let task = laundry(&format!("(<= (cost) {budget})"));
        answer_from(&task, &Situation::initial(&task), 400)
    };
    let answer = found(16);
    assert!(answer.found().is_some(), "{}", describe(&answer));
    let answer = found(15);
    assert!(answer.found().is_none(), "{}", describe(&answer));
}

/// Actions with a duration, the fluents that the effects at the start and the end read, and a price limit.
type DraftAction = (u8, [Option<u8>; 2], Option<u8>);

#[derive(Clone, Debug)]
struct Draft {
    actions: Vec<DraftAction>,
    /// For each price, its first value, and its values from some times on.
    prices: Vec<(u8, Vec<(u8, u8)>)>,
    weight_of_time: u8,
    has_budget: bool,
}

fn drafts() -> impl Strategy<Value = Draft> {
    let read = || prop::option::weighted(0.6, 0..2_u8);
    let limit = prop::option::weighted(0.3, 2..6_u8);
    let action = (0..6_u8, [read(), read()], limit);
    let changes = prop::collection::vec((1..5_u8, 1..6_u8), 1..6);
    let price = (1..6_u8, changes).prop_map(|(first, gaps)| {
        let mut time = 0;
        let changes = gaps.into_iter().map(|(gap, value)| {
            time += gap;
            (time, value)
        });
        (first, changes.collect())
    });
    let actions = prop::collection::vec(action, 2..4);
    (
        actions,
        prop::collection::vec(price, 2),
        0..2_u8,
        prop::bool::weighted(0.2),
    )
        .prop_map(|(actions, prices, weight_of_time, has_budget)| Draft {
            actions,
            prices,
            weight_of_time,
            has_budget,
        })
}

impl Draft {
    /// Returns the task: all actions are to be done one after the other in any order.
    fn task(&self) -> Task {
        let mut domain =
            "(:requirements :durative-actions :numeric-fluents :timed-initial-literals)
            (:predicates (idle) (done0) (done1) (done2)) (:functions (p0) (p1) (cost))"
                .to_owned();
        let (mut initial, mut goal) = ("(idle) (= (cost) 1)".to_owned(), String::new());
        for (number, (duration, reads, limit)) in self.actions.iter().enumerate() {
            write!(goal, "(done{number})").unwrap();
            let cost = |read: Option<u8>| {
                read.map_or(String::new(), |read| {
                    format!("(increase (cost) (* 2 (p{read})))")
                })
            };
            let limit = limit.map_or(String::new(), |limit| format!("(<= (p0) {limit})"));
            let [start, end] = reads.map(cost);
            if *duration == 0 {
                write!(
                    domain,
                    "(:action a{number} :parameters () :precondition (and (idle) {limit})
                      :effect (and (done{number}) {start}))"
                )
                .unwrap();
                continue;
            }
            let when = |when: &str, part: &str| match part {
                "" => String::new(),
                part => format!("({when} {part})"),
            };
            let (limit, start) = (when("over all", &limit), when("at start", &start));
            let end = when("at end", &end);
            write!(
                domain,
                "(:durative-action a{number} :parameters () :duration (= ?duration {duration})
                  :condition (and (at start (idle)) {limit})
                  :effect (and (at start (not (idle))) {start} (at end (idle))
                    (at end (done{number})) {end}))"
            )
            .unwrap();
        }
        for (number, (first, changes)) in self.prices.iter().enumerate() {
            write!(initial, " (= (p{number}) {first})").unwrap();
            for (time, value) in changes {
                write!(initial, " (at {time} (= (p{number}) {value}))").unwrap();
            }
        }
        if self.has_budget {
            goal += "(<= (cost) 17)";
        }
        let weight = self.weight_of_time;
        let metric = format!("(:metric minimize (+ (cost) (* {weight} (total-time))))");
        task(
            &domain,
            &format!("(:init {initial}) (:goal (and {goal})) {metric}"),
        )
    }
}

/// Returns the answer with tariffs as calendars, or as choices of the search.
fn answer_with(task: &Task, as_calendars: bool) -> Answer {
    let mut settings = Settings::default();
    if !as_calendars {
        settings.tuning.without.push(Technique::Calendars);
    }
    let mut turns = 0;
    plan(task, &Situation::initial(task), &settings, &mut |_| {
        turns += 1;
        if turns > 300 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, ..ProptestConfig::default() })]

    #[test]
    fn best_cost_with_calendars_is_the_best_one_with_choices(draft in drafts()) {
        let task = draft.task();
        let answers = [true, false].map(|as_calendars| answer_with(&task, as_calendars));
        for found in answers.iter().filter_map(Answer::found) {
            let situation = Situation::initial(&task);
            let verdict = validate_from(&task, &situation, &found.plan, &Strictness::default());
            prop_assert!(matches!(verdict, Verdict::Valid(_)), "{verdict:?}");
        }
        let best = answers.each_ref().map(|answer| match answer {
            Answer::Plan { found, stopped: Stopped::Exhausted, .. } => Some(Some(found.value.clone())),
            Answer::Unsolvable { .. } => Some(None),
            _ => None,
        });
        if let [Some(with), Some(without)] = &best {
            prop_assert_eq!(with, without, "{}\n{}", describe(&answers[0]), describe(&answers[1]));
        }
    }
}
