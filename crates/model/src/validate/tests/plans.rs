//! Whole plans against a twin that knows no pieces, groups or polynomials: it computes the state
//! at any moment afresh from all that happened before, and looks at very many moments.

use std::fmt::Write as _;

use elbowroom_num::Rational;
use proptest::prelude::*;

use super::world::World;

/// Facts `p` and `q` hold, and `x` is 5, at the beginning; `q` ends at 9/2 and returns at 11/2.
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

/// One step: which action, and when it starts and ends.
#[derive(Clone, Debug)]
struct Step {
    action: &'static str,
    start: Rational,
    end: Rational,
}

#[derive(Debug)]
struct Seen {
    p: bool,
    q: bool,
    x: Rational,
}

/// The state at a moment; what happens at that very moment counts only if `after`.
fn seen(steps: &[Step], now: &Rational, after: bool) -> Seen {
    let is_past = |time: &Rational| time < now || (after && time == now);
    // Each change of a fact, by time; the last one counts, and the beginning counts as first.
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
    Seen {
        p: last('p'),
        q: last('q'),
        x,
    }
}

/// Two happenings at one time must not, in some order, be one that writes and one that reads or
/// writes the same, unless both only shift x, or write the same truth.
fn has_interference(steps: &[Step]) -> bool {
    /// Facts and `x`, with what is done: `r`ead, made `t`rue, made `f`alse, `s`hifted.
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
        // All slopes are between -3 and 6, all times multiples of 1/2: nothing crosses a whole
        // number off the multiples of 1/120, and between two of these nothing crosses at all.
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
    // At most three fills and three drains, for the bound on slopes.
    prop::collection::vec(step, 0..4)
}

proptest! {
    #[test]
    fn the_judge_agrees_with_its_slow_twin(steps in steps()) {
        let mut text = String::new();
        for step in &steps {
            let duration = &step.end - &step.start;
            let _ = writeln!(text, "{}: {}", step.start, step.action);
            if !duration.is_zero() {
                text.truncate(text.len() - 1);
                let _ = writeln!(text, " [{duration}]");
            }
        }
        let said = world().judge(&text);
        prop_assert_eq!(is_valid(&steps), said == "valid", "{}", said);
    }
}
