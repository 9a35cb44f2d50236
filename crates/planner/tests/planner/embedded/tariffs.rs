//! Effects that read fluents that only timed initials change.

use std::fmt::Write;
use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::ground::{Change, Expression};
use elbowroom_model::validate::{Settings as Strictness, Verdict};
use elbowroom_model::{RunningAction, Situation, Task, validate_from};
use elbowroom_num::{Interval, Rational};
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
fn known_tariff_at_the_end_of_a_running_action_gives_cheaper_plans() {
    let task = laundry("");
    let schema = task.problem().schema("wash").unwrap();
    let object = |name| task.problem().object(name).unwrap();
    let wash = task
        .instantiate(schema, &[object("a"), object("l0")])
        .unwrap();
    let state_after = |time: i64, duration: Interval| {
        let mut situation = Situation::initial(&task);
        situation.time = Rational::from(time);
        for effect in &wash.durative().unwrap().start.effects {
            if let Change::Delete(fact) = effect.change {
                situation.state.facts.remove(&fact);
            }
        }
        let price = task.fluent_named("(price)").unwrap();
        situation.state.values.insert(price, Rational::from(2));
        situation.running.push(RunningAction {
            action: Arc::new(wash.clone()),
            start: Rational::from(20),
            duration,
        });
        situation
    };
    let cost_after = |situation: &Situation| {
        let answer = plan(
            &task,
            situation,
            &Settings::default(),
            &mut |progress| match progress.counts.evaluated {
                0..3000 => ControlFlow::Continue(()),
                _ => ControlFlow::Break(()),
            },
        );
        answer.found().and_then(|found| found.metric.clone())
    };
    // The price changes at 32, where an action of at most 20 may still be running.
    let [known, unknown] = [10, 20].map(|most| {
        let duration = Interval::closed(Rational::from(10), Rational::from(most));
        cost_after(&state_after(22, duration)).expect("a plan")
    });
    assert!(known < unknown, "{known} {unknown}");
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

/// Returns the situation at 2 with the first action of some length running since 1, for its duration or up to `more` longer.
fn with_running_action(draft: &Draft, task: &Task, more: u8) -> Situation {
    let mut situation = Situation::initial(task);
    situation.time = Rational::from(2);
    for timed in task
        .timed()
        .iter()
        .filter(|timed| timed.time <= situation.time)
    {
        for change in &timed.changes {
            if let Change::Update {
                fluent,
                value: Expression::Constant(value),
                ..
            } = change
            {
                situation.state.values.insert(*fluent, value.clone());
            }
        }
    }
    let number = draft.actions.iter().position(|action| action.0 > 0);
    let Some(number) = number else {
        return situation;
    };
    let schema = task.problem().schema(&format!("a{number}")).unwrap();
    let action = task.instantiate(schema, &[]).unwrap();
    for effect in &action.durative().unwrap().start.effects {
        if let Change::Delete(fact) = effect.change {
            situation.state.facts.remove(&fact);
        }
    }
    let duration = Rational::from(i64::from(draft.actions[number].0));
    let most = &duration + Rational::from(i64::from(more));
    situation.running.push(RunningAction {
        action: Arc::new(action),
        start: Rational::ONE,
        duration: Interval::closed(duration, most),
    });
    situation
}

/// Returns the answer with tariffs as calendars, or as choices of the search.
fn answer_with(task: &Task, situation: &Situation, as_calendars: bool) -> Answer {
    let mut settings = Settings::default();
    if !as_calendars {
        settings.tuning.without.push(Technique::Calendars);
    }
    let mut turns = 0;
    plan(task, situation, &settings, &mut |_| {
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
        check_best_cost(&task, &Situation::initial(&task))?;
    }

    #[test]
    fn best_cost_beside_a_running_action_is_the_best_one_with_choices(draft in drafts(), more in 0..3_u8) {
        let task = draft.task();
        check_best_cost(&task, &with_running_action(&draft, &task, more))?;
    }
}

fn check_best_cost(task: &Task, situation: &Situation) -> Result<(), TestCaseError> {
    let answers = [true, false].map(|as_calendars| answer_with(task, situation, as_calendars));
    for found in answers.iter().filter_map(Answer::found) {
        let verdict = validate_from(task, situation, &found.plan, &Strictness::default());
        prop_assert!(matches!(verdict, Verdict::Valid(_)), "{verdict:?}");
    }
    let best = answers.each_ref().map(|answer| match answer {
        Answer::Plan {
            found,
            stopped: Stopped::Exhausted,
            ..
        } => Some(Some(found.value.clone())),
        Answer::Unsolvable { .. } => Some(None),
        _ => None,
    });
    if let [Some(with), Some(without)] = &best {
        prop_assert_eq!(
            with,
            without,
            "{}\n{}",
            describe(&answers[0]),
            describe(&answers[1])
        );
    }
    Ok(())
}
