//! Whole plans, compared with a reference implementation without pieces, groups or polynomials: it
//! computes the state at any moment from all earlier happenings, and checks a dense grid of
//! moments.

use std::fmt::Write as _;

use elbowroom_num::{Interval, Rational};
use proptest::prelude::*;

use super::world::World;
use crate::plan::TimeTriggeredPlan;
use crate::situation::{RunningAction, Situation};
use crate::state::State;
use crate::task::Task;
use crate::validate::{Verdict, validate, validate_from};

/// Returns a world where `p` and `q` hold and `x` is 5 initially; `q` ends at 9/2 and returns at
/// 11/2.
fn world() -> World {
    World::new("(p) (q) (= x 5)")
        .durative(
            "lock",
            &[
                ("start", "(p)"),
                ("over all", "(or (q) (> x 5))"),
                ("start effect", "(not (p))"),
                ("end effect", "(p)"),
            ],
        )
        .durative("drain", &[("over all", "(>= x 2)"), ("rate", "x -1")])
        .durative(
            "fill",
            &[
                ("over all", "(< x 9)"),
                ("rate", "x 2"),
                ("end", "(>= x 3)"),
            ],
        )
        .instant("raise", "(not (q))", "(q)")
        .instant("lower", "", "(not (q))")
        .instant("spend", "(> x 1)", "(decrease x 1)")
        .timed("9/2", "(not (q))")
        .timed("11/2", "(q)")
        .goal("(p) (<= x 6)")
}

const ACTIONS: [&str; 6] = ["lock", "drain", "fill", "raise", "lower", "spend"];

/// A step: its action, start and end.
#[derive(Clone, Debug)]
struct Step {
    action: &'static str,
    start: Rational,
    end: Rational,
}

#[derive(Debug)]
struct ReferenceState {
    p: bool,
    q: bool,
    x: Rational,
}

/// Returns the state at a moment. Happenings at that moment count only if `after`.
fn seen(steps: &[Step], now: &Rational, after: bool) -> ReferenceState {
    let is_past = |time: &Rational| time < now || (after && time == now);
    // All changes of facts by time, beginning with the initial state; the last one counts.
    let mut changes = vec![
        (Rational::from(-1), 'p', true),
        (Rational::from(-1), 'q', true),
    ];
    changes.push((Rational::new(9, 2), 'q', false));
    changes.push((Rational::new(11, 2), 'q', true));
    let mut x = Rational::from(5);
    for step in steps {
        let ran_until = now.clone().min(step.end.clone());
        let ran = (ran_until - &step.start).max(Rational::ZERO);
        match step.action {
            "lock" => {
                changes.push((step.start.clone(), 'p', false));
                changes.push((step.end.clone(), 'p', true));
            }
            "drain" => x -= ran,
            "fill" => x += ran * Rational::from(2),
            "raise" => changes.push((step.start.clone(), 'q', true)),
            "lower" => changes.push((step.start.clone(), 'q', false)),
            _ if is_past(&step.start) => x -= Rational::ONE,
            _ => {}
        }
    }
    let last = |fact: char| {
        let past = changes
            .iter()
            .filter(|change| change.1 == fact && is_past(&change.0));
        past.max_by(|a, b| a.0.cmp(&b.0))
            .is_some_and(|change| change.2)
    };
    ReferenceState {
        p: last('p'),
        q: last('q'),
        x,
    }
}

/// Returns `true` if one of two simultaneous happenings writes a fact or number that the other one
/// reads or writes, unless both only shift x, or write the same truth value.
fn has_interference(steps: &[Step]) -> bool {
    /// Returns the accesses to facts and `x`: `r`ead, made `t`rue, made `f`alse, `s`hifted.
    fn uses(action: &str, at_end: bool) -> &'static [(char, char)] {
        match (action, at_end) {
            ("lock", false) => &[('p', 'r'), ('p', 'f')],
            ("lock", true) => &[('p', 't')],
            ("fill", true) => &[('x', 's'), ('x', 'r')],
            ("drain" | "fill", _) => &[('x', 's')],
            ("raise", _) => &[('q', 'r'), ('q', 't')],
            ("lower" | "off", _) => &[('q', 'f')],
            ("on", _) => &[('q', 't')],
            _ => &[('x', 'r'), ('x', 's')],
        }
    }
    let mut all = vec![
        (Rational::new(9, 2), "off", false),
        (Rational::new(11, 2), "on", false),
    ];
    for step in steps {
        all.push((step.start.clone(), step.action, false));
        if step.start != step.end {
            all.push((step.end.clone(), step.action, true));
        }
    }
    let clash = |a: (char, char), b: (char, char)| a.0 == b.0 && a.1 != b.1;
    (0..all.len()).any(|i| {
        (0..i).any(|j| {
            all[i].0 == all[j].0
                && uses(all[i].1, all[i].2)
                    .iter()
                    .any(|a| uses(all[j].1, all[j].2).iter().any(|b| clash(*a, *b)))
        })
    })
}

fn is_valid(steps: &[Step]) -> bool {
    let two = Rational::from(2);
    let conditions_hold = steps.iter().all(|step| {
        let first = seen(steps, &step.start, false);
        let last = seen(steps, &step.end, false);
        match step.action {
            "lock" => first.p,
            "fill" => last.x >= Rational::from(3),
            "raise" => !first.q,
            "spend" => first.x > Rational::ONE,
            _ => true,
        }
    });
    let over_all_hold = steps.iter().all(|step| {
        // All slopes are between -3 and 6, all times are multiples of 1/2. So values cross integers
        // only at multiples of 1/120, and nothing changes between two of these.
        let mut moment = &step.start + Rational::new(1, 240);
        while moment < step.end {
            let here = seen(steps, &moment, true);
            let holds = match step.action {
                "lock" => here.q || here.x > Rational::from(5),
                "drain" => here.x >= two,
                "fill" => here.x < Rational::from(9),
                _ => true,
            };
            if !holds {
                return false;
            }
            moment += Rational::new(1, 240);
        }
        true
    });
    let end = steps
        .iter()
        .map(|step| &step.end)
        .max()
        .cloned()
        .unwrap_or_default();
    let last = seen(steps, &end, true);
    conditions_hold
        && over_all_hold
        && !has_interference(steps)
        && last.p
        && last.x <= Rational::from(6)
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let step = (0..ACTIONS.len(), 0..16_i64, 1..8_i64).prop_map(|(action, start, length)| {
        let length = if action < 3 { length } else { 0 };
        Step {
            action: ACTIONS[action],
            start: Rational::new(start, 2),
            end: Rational::new(start + length, 2),
        }
    });
    // At most three fills and three drains, to limit the slopes.
    prop::collection::vec(step, 0..4)
}

fn text(steps: &[Step]) -> String {
    let mut text = String::new();
    for step in steps {
        let duration = &step.end - &step.start;
        let _ = writeln!(text, "{}: {}", step.start, step.action);
        if !duration.is_zero() {
            text.truncate(text.len() - 1);
            let _ = writeln!(text, " [{duration}]");
        }
    }
    text
}

/// Returns the situation at a moment without happenings, and the plan from there.
fn cut(
    task: &Task,
    plan: &TimeTriggeredPlan,
    steps: &[Step],
    now: &Rational,
) -> (Situation, TimeTriggeredPlan) {
    let here = seen(steps, now, true);
    let fact = |name| {
        let predicate = task.problem().predicate(name).expect("declared");
        task.find_fact(predicate, &[]).expect("mentioned")
    };
    let function = task.problem().function("x").expect("declared");
    let x = task.find_fluent(function, &[]).expect("mentioned");
    let facts = [("p", here.p), ("q", here.q)];
    let (running, later): (Vec<_>, Vec<_>) = plan
        .steps
        .iter()
        .filter(|step| step.end() > *now)
        .cloned()
        .partition(|step| step.start < *now);
    let situation = Situation {
        time: now.clone(),
        state: State {
            facts: facts
                .into_iter()
                .filter(|(_, holds)| *holds)
                .map(|(name, _)| fact(name))
                .collect(),
            values: [(x, here.x)].into(),
        },
        running: running
            .iter()
            .map(|step| RunningAction {
                action: step.action.clone(),
                start: step.start.clone(),
                duration: Interval::at_least(Rational::ZERO),
            })
            .collect(),
    };
    let steps = running.into_iter().chain(later).collect();
    (situation, TimeTriggeredPlan { steps })
}

proptest! {
    #[test]
    fn validator_agrees_with_reference_implementation(steps in steps()) {
        let said = world().judge(&text(&steps));
        prop_assert_eq!(is_valid(&steps), said == "valid", "{}", said);
    }

    #[test]
    fn remaining_plan_gets_same_verdict_as_whole_plan(steps in steps(), half in 0..12_i64) {
        let now = Rational::new(2 * half + 1, 4);
        let world = world();
        let (task, plan) = world.task_and_plan(&text(&steps));
        let whole = validate(&task, &plan, &world.settings);
        let (situation, rest) = cut(&task, &plan, &steps, &now);
        // If the plan is over at the cut, it reaches its goal before the remaining task does.
        if rest.steps.is_empty() {
            return Ok(());
        }
        let rest = validate_from(&task, &situation, &rest, &world.settings);
        match &whole {
            Verdict::Invalid(violation) if violation.time < now => {}
            _ => prop_assert_eq!(whole.is_valid(), rest.is_valid(), "{:?} {:?}", whole, rest),
        }
    }
}

#[test]
fn plan_in_mid_execution_continues_running_actions() {
    let world = world();
    let steps = [Step {
        action: "drain",
        start: Rational::ZERO,
        end: Rational::from(3),
    }];
    let (task, plan) = world.task_and_plan(&text(&steps));
    let (mut situation, rest) = cut(&task, &plan, &steps, &Rational::ONE);
    let said = |situation: &Situation, plan: &TimeTriggeredPlan| match validate_from(
        &task,
        situation,
        plan,
        &world.settings,
    ) {
        Verdict::Invalid(violation) => violation.to_string(),
        other => format!("{:?}", other.is_valid()),
    };
    assert_eq!(said(&situation, &rest), "true");
    let abandoned = said(&situation, &TimeTriggeredPlan::default());
    assert!(abandoned.contains("continuing (drain)"), "{abandoned}");
    // Drained below 2 at 3, when x must be at least 2 all the time.
    let mut long = rest.clone();
    long.steps[0].duration = Some(Rational::from(4));
    assert!(
        said(&situation, &long).contains("(>= (x) 2)"),
        "{}",
        said(&situation, &long)
    );
    let mut over = rest.clone();
    over.steps[0].duration = Some(Rational::new(1, 2));
    assert!(
        said(&situation, &over).contains("is running at time 1"),
        "{}",
        said(&situation, &over)
    );
    situation.running[0].duration = Interval::closed(Rational::ONE, Rational::from(2));
    assert!(
        said(&situation, &rest).contains("can only have a duration in [1, 2]"),
        "{}",
        said(&situation, &rest)
    );
    situation.running.clear();
    assert!(
        said(&situation, &rest).contains("starts before time 1"),
        "{}",
        said(&situation, &rest)
    );
}
