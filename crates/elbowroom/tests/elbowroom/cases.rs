//! Cases that are solved by hand in their problem files. The program must have the same results.
//!
//! Each case gives the region as inequalities, and the interval of each duration with the others at
//! their nominal values. The region is compared at many points, the intervals exactly.

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use elbowroom::envelope::{self, Guarantee, Oracle, irr, sharpen};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::{Interval, Rational};
use elbowroom::pddl::{self, Source};
use elbowroom::plan::parametrize::VarySpec;
use elbowroom::plan::{DecoupledEnvelope, ParametrizedPlan, Valuation};
use elbowroom::{pipeline, plan};

fn folder(case: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../cases")
        .join(case)
}

fn source(path: &Path) -> Source {
    let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    Source::new(path.display().to_string(), text)
}

fn read(case: &str) -> (Task, TimeTriggeredPlan) {
    let folder = folder(case);
    let (domain, problem) = (
        source(&folder.join("domain.pddl")),
        source(&folder.join("problem.pddl")),
    );
    let (problem, warnings) =
        pddl::read_problem(&domain, &problem).expect("a case without mistakes");
    assert!(warnings.is_empty(), "{warnings:?}");
    let task = Task::new(problem);
    let plan = source(&folder.join("plan.plan"));
    let (plan, _) = pddl::read_plan(&plan, &task).expect("a plan without mistakes");
    (task, plan)
}

fn epsilon() -> Rational {
    Rational::new(1, 1000)
}

/// Returns the plan with these parameters; by default all durations.
fn opened(task: &Task, plan: &TimeTriggeredPlan, vary: &[&str]) -> ParametrizedPlan {
    let specs: Vec<VarySpec> = vary
        .iter()
        .map(|text| text.parse().expect("a specification"))
        .collect();
    let freed = pipeline::free(task, plan).expect("a valid plan");
    pipeline::open(task, freed, &specs).expect("quantities of this plan")
}

fn number(text: &str) -> Rational {
    text.parse().expect("a number")
}

/// Returns the interval of an instance's duration with everything else as planned.
fn alone(task: &Arc<Task>, time_triggered: &TimeTriggeredPlan, instance: usize) -> Interval {
    let vary = format!("duration n{instance}");
    let plan = Arc::new(opened(task, time_triggered, &[&vary]));
    let mut oracle = Oracle::new(task, &plan, Guarantee::Weak).expect("within exact reasoning");
    let go_on = ControlFlow::Continue(());
    let run = irr(&mut oracle, &envelope::Settings::default(), &mut |_| go_on).expect("few cases");
    let found = run.envelope.expect("the plan works as planned");
    let sharp = sharpen(&mut oracle, &found, &mut || go_on)
        .expect("few cases")
        .expect("what was found is inside");
    assert!(sharp.includes(&found));
    sharp.intervals()[0].clone()
}

/// Compares a case with the results by hand: the interval of each duration with the others nominal,
/// in the order of the plan's actions by start; and the region.
fn agrees(case: &str, intervals: &[&str], region: impl Fn(&[Rational]) -> bool) {
    let (task, plan) = read(case);
    let task = Arc::new(task);
    for (instance, expected) in intervals.iter().enumerate() {
        let found = alone(&task, &plan, instance).to_string();
        assert_eq!(found, *expected, "{case}: duration n{instance}");
    }
    // All durations, including those that the domain leaves to the executor.
    let opened = Arc::new(opened(&task, &plan, &["durations"]));
    let nominal: Vec<Rational> = opened.nominal().into_iter().collect();
    assert!(region(&nominal), "{case}: the nominal point");
    let mut oracle = Oracle::new(&task, &opened, Guarantee::Weak).expect("within exact reasoning");
    // All points whose coordinates are these multiples of the nominal values, and just above zero.
    let shares = ["0", "1/3", "3/4", "1", "7/6", "3/2", "2"].map(number);
    let mut inside = 0;
    let mut outside = 0;
    for code in 0..shares
        .len()
        .pow(u32::try_from(nominal.len()).expect("few parameters"))
    {
        let mut rest = code;
        let point: Vec<Rational> = nominal
            .iter()
            .map(|value| {
                let share = &shares[rest % shares.len()];
                rest /= shares.len();
                value * share
            })
            .collect();
        let expected = region(&point);
        let found = oracle
            .objection(&DecoupledEnvelope::point(&Valuation::new(point.clone())))
            .expect("few cases");
        assert_eq!(found.is_none(), expected, "{case} at {point:?}: {found:?}");
        if expected {
            inside += 1;
        } else {
            outside += 1;
        }
    }
    assert!(
        inside > 0 && outside > 0,
        "{case}: {inside} inside, {outside} outside"
    );
}

#[test]
fn delivery_matches_hand_computation() {
    let thousandth = epsilon();
    // In the plan's order: first drive, unlocking, pick, second drive, drop.
    agrees(
        "delivery",
        &[
            "[1/1000, 9999/250]",
            "[0, 28499/500]",
            "[1/1000, 7999/250]",
            "[1/1000, 11249/250]",
            "[1/1000, 8249/250]",
        ],
        |point| {
            let [first, unlock, pick, second, drop] = point else {
                panic!("five durations")
            };
            let robot = [first, pick, second, drop];
            robot.into_iter().sum::<Rational>() <= number("59.996")
                && unlock + drop <= number("59.998")
                && robot.iter().all(|&taken| *taken >= thousandth)
                && !unlock.is_negative()
        },
    );
}

#[test]
fn detour_matches_hand_computation() {
    agrees("crossing", &["[0, 8999/500]", "[0, 3999/500]"], |point| {
        let [round, hand_over] = point else {
            panic!("two durations")
        };
        round + hand_over <= number("19.998") && !round.is_negative() && !hand_over.is_negative()
    });
}

#[test]
fn battery_matches_hand_computation() {
    let thousandth = epsilon();
    agrees(
        "battery",
        &["[10, 25]", "[15/2, 15]", "[1/1000, 35]"],
        |point| {
            let [a, c, b] = point else {
                panic!("three durations")
            };
            let two = Rational::from(2);
            *a <= number("35")
                && &two * c - a <= number("10")
                && &(a + b) - &(&two * c) <= number("35")
                && [a, b, c].iter().all(|x| **x >= thousandth)
        },
    );
}

#[test]
fn flare_matches_hand_computation() {
    let thousandth = epsilon();
    agrees(
        "match",
        &[
            "[18003/1000, inf)",
            "[1/1000, 19997/1000]",
            "[1/1000, 21997/1000]",
        ],
        |point| {
            let [f, h, k] = point else {
                panic!("three durations")
            };
            &(h + k) + &number("0.003") <= *f && [h, k].iter().all(|x| **x >= thousandth)
        },
    );
}

#[test]
fn tank_matches_hand_computation() {
    let thousandth = epsilon();
    agrees("tank", &["[25/2, 20]", "[5, 35/3]"], |point| {
        let [f, d] = point else {
            panic!("two durations")
        };
        let (in_two, in_three) = (&Rational::from(2) * f, &Rational::from(3) * d);
        *f <= number("20")
            && &in_three - &in_two <= number("5")
            && &in_two - &in_three <= number("15")
            && [f, d].iter().all(|x| **x >= thousandth)
    });
}

#[test]
fn hatchery_and_lamp_match_hand_computation() {
    for case in ["hatchery", "lamp"] {
        agrees(case, &["[0, inf)", "[1/500, inf)"], |point| {
            let [first, second] = point else {
                panic!("two durations")
            };
            *second >= number("0.002") && !first.is_negative()
        });
    }
}

#[test]
fn hatchery_and_lamp_reject_further_open_quantities() {
    for case in ["hatchery", "lamp"] {
        let (task, plan) = read(case);
        let (task, plan) = (Arc::new(task.clone()), opened(&task, &plan, &[]));
        let plan = Arc::new(plan);
        let mut oracle =
            Oracle::new(&task, &plan, Guarantee::Dynamic).expect("within exact reasoning");
        for (lower, width, least, expected) in [
            ("7.501", "4.998", "5", true),
            ("7.501", "4.999", "5", false),
            ("0", "5", "5.002", true),
            ("0", "5", "5.001", false),
            ("20", "0", "0.002", true),
        ] {
            let (lower, width) = (number(lower), number(width));
            let intervals = vec![
                Interval::closed(lower.clone(), lower + width),
                Interval::at_least(number(least)),
            ];
            let envelope = DecoupledEnvelope::new(&plan, intervals).expect("two durations");
            let objection = oracle.objection(&envelope).expect("few cases");
            assert_eq!(objection.is_none(), expected, "{case}: {envelope:?}");
        }
    }
}

#[test]
fn paintshop_matches_hand_computation() {
    let (task, plan) = read("paintshop");
    let task = Arc::new(task);
    for instance in 0..3 {
        assert_eq!(alone(&task, &plan, instance).to_string(), "[0, inf)");
    }
    let opened = Arc::new(opened(&task, &plan, &[]));
    let intervals = vec![Interval::at_least(Rational::ZERO); 3];
    let everything = DecoupledEnvelope::new(&opened, intervals).expect("three durations");
    for guarantee in [Guarantee::Weak, Guarantee::Dynamic] {
        let mut oracle = Oracle::new(&task, &opened, guarantee).expect("within exact reasoning");
        assert_eq!(oracle.objection(&everything), Ok(None), "{guarantee:?}");
    }
}

#[test]
fn stn_file_of_delivery_is_equivalent_to_its_plan() {
    let (task, plan) = read("delivery");
    let text = fs::read(folder("delivery").join("plan.stn")).unwrap();
    let by_hand = plan::format::read(&text, &task).expect("an STN plan file without mistakes");
    let (task, by_hand) = (Arc::new(task), Arc::new(by_hand));
    let derived = Arc::new(opened(&task, &plan, &[]));
    let oracle = |plan| Oracle::new(&task, plan, Guarantee::Weak).unwrap();
    let (mut of_file, mut of_plan) = (oracle(&by_hand), oracle(&derived));
    // The file has the parameters first, second, handing and opening; the plan also the pick.
    for (first, second, handing, opening) in [
        (10, 15, 3, 6),
        (20, 15, 3, 6),
        (20, 30, 3, 50),
        (20, 35, 3, 6),
        (1, 2, 50, 8),
        (1, 1, 40, 25),
    ] {
        let box_of = |values: &[i64]| {
            let values: Valuation = values.iter().map(|&v| Rational::from(v)).collect();
            DecoupledEnvelope::point(&values)
        };
        let in_file = of_file
            .objection(&box_of(&[first, second, handing, opening]))
            .unwrap();
        let in_plan = of_plan
            .objection(&box_of(&[first, opening, 2, second, handing]))
            .unwrap();
        assert_eq!(
            in_file.is_none(),
            in_plan.is_none(),
            "{in_file:?} {in_plan:?}"
        );
    }
}
