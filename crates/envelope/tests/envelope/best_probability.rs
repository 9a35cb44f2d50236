//! The box that durations most likely stay in, compared with all boxes on a grid.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use elbowroom_envelope::{BestRun, BestSettings, Guarantee, LOG_OF_ZERO, Objective, Oracle, best};
use elbowroom_num::log_concave::{Density, LogConcaveDistribution};
use elbowroom_num::{Interval, Rational, enclosures};
use elbowroom_plan::{DecoupledEnvelope, ParameterId, ParametrizedPlan};

use crate::given::Given;

/// The nominal value of all durations, and the greatest one on the grid.
const NOMINAL: i64 = 2;
const MOST: i64 = 6;

const DOMAIN: &str = "
    (:durative-action run :parameters () :duration (>= ?duration 0) :condition () :effect (and))";

/// Returns a problem with three actions, and bounds between their starts and ends.
fn problem(bounds: &str) -> String {
    format!(
        "parameter a default {NOMINAL} lb 0 ub {MOST}; parameter b default {NOMINAL} lb 0 ub {MOST};
         parameter c default {NOMINAL} lb 0 ub {MOST};
         durative-action instance one : (run); durative-action instance two : (run);
         durative-action instance three : (run);
         c: one.end - one.start in [a, a]; c: two.end - two.start in [b, b];
         c: three.end - three.start in [c, c]; c: two.start - one.end in [1/2, inf]; {bounds}"
    )
}

/// Bounds of several kinds: deadlines that two durations share, with later starts that wait or are
/// fixed, and actions that have to end in each other.
const BOUNDS: [&str; 6] = [
    "c: two.end - .zero in [0, 7];",
    "c: two.end - .zero in [0, 6]; c: three.end - two.start in [-inf, 3];",
    "c: two.start - .zero in [3, 3]; c: two.end - .zero in [0, 8];",
    "c: three.end - one.end in [0, 2]; c: three.start - one.start in [-1, 1];",
    "c: two.end - three.end in [0, inf]; c: two.end - .zero in [0, 9]; c: three.start - .zero in [0, 2];",
    "c: two.start - one.end in [0, 3]; c: three.end - two.end in [-2, 4];",
];

fn number(tenths: i64) -> Rational {
    Rational::new(tenths, 10)
}

fn dense(density: Density, cuts: [Option<i64>; 2]) -> LogConcaveDistribution {
    let [minimum, maximum] = cuts.map(|cut| cut.map(number));
    LogConcaveDistribution::dense(density, minimum, maximum, &Rational::new(1, 1000))
        .expect("a density")
}

fn values(tenths: &[i64]) -> LogConcaveDistribution {
    LogConcaveDistribution::values(tenths.iter().copied().map(number).collect()).expect("values")
}

/// Distributions of all kinds for three durations; `None` for a duration that is as planned.
fn families() -> Vec<[Option<LogConcaveDistribution>; 3]> {
    let normal = |mean, deviation, cuts| {
        let (mean, deviation) = (number(mean), number(deviation));
        Some(dense(Density::Normal { mean, deviation }, cuts))
    };
    let uniform = |from, to| {
        let (from, to) = (number(from), number(to));
        Some(dense(Density::Uniform { from, to }, [None, None]))
    };
    let triangular = |from, mode, to| {
        let [from, mode, to] = [from, mode, to].map(number);
        Some(dense(Density::Triangular { from, mode, to }, [None, None]))
    };
    let exponential = |from, mean| {
        let (from, mean) = (number(from), number(mean));
        Some(dense(Density::Exponential { from, mean }, [None, None]))
    };
    let lognormal = |location, spread| {
        let (location, spread) = (number(location), number(spread));
        Some(dense(Density::Lognormal { location, spread }, [None, None]))
    };
    vec![
        [
            normal(20, 6, [None, None]),
            normal(22, 9, [Some(10), None]),
            normal(20, 3, [None, None]),
        ],
        [uniform(10, 40), uniform(15, 25), triangular(0, 20, 50)],
        [
            exponential(15, 10),
            normal(25, 10, [Some(12), Some(35)]),
            None,
        ],
        [
            lognormal(7, 1),
            uniform(25, 45),
            Some(values(&[10, 20, 20, 30, 45])),
        ],
        [
            Some(values(&[5, 10, 15, 20, 25, 30, 40])),
            Some(values(&[20, 22, 26, 34])),
            Some(values(&[20])),
        ],
        [
            Some(values(&[30])),
            normal(20, 5, [None, Some(21)]),
            triangular(20, 20, 40),
        ],
    ]
}

/// Returns all boxes with whole ends around the nominal values.
fn boxes(plan: &ParametrizedPlan) -> Vec<DecoupledEnvelope> {
    let mut boxes = vec![DecoupledEnvelope::point(&plan.nominal())];
    for index in 0..plan.parameters.len() {
        boxes = boxes
            .iter()
            .flat_map(|envelope| {
                (0..=NOMINAL).flat_map(move |lower| {
                    (NOMINAL..=MOST).map(move |upper| {
                        let interval = Interval::closed(lower.into(), upper.into());
                        envelope
                            .clone()
                            .with_interval(ParameterId::from(index), interval)
                    })
                })
            })
            .collect();
    }
    boxes
}

/// The logarithm of the probability of each interval, by parameter; `None` if that is 0.
type Known = BTreeMap<(usize, Rational, Rational), Option<f64>>;

/// Returns the logarithm of the probability that all durations are inside; `None` if that is 0.
fn logarithm(
    envelope: &DecoupledEnvelope,
    chances: &[Option<LogConcaveDistribution>],
    known: &mut Known,
) -> Option<f64> {
    let nominal = Rational::from(NOMINAL);
    let mut sum = 0.0;
    for (index, (interval, chance)) in envelope.intervals().iter().zip(chances).enumerate() {
        let Some(chance) = chance else { continue };
        let (lower, upper) = (interval.lower.value()?, interval.upper.value()?);
        let key = (index, lower.clone(), upper.clone());
        let own = known.entry(key).or_insert_with(|| {
            let [mass, _] =
                chance.probability_bounds(&nominal, &[&nominal - lower, upper - &nominal]);
            enclosures::ln(&mass).map(|[below, _]| below.to_f64())
        });
        sum += (*own)?;
    }
    Some(sum)
}

fn found(
    oracle: &mut Oracle,
    chances: &[Option<LogConcaveDistribution>],
    symmetric: bool,
) -> Option<(BestRun, DecoupledEnvelope)> {
    let settings = BestSettings {
        objective: Objective::Probability,
        symmetric,
        distributions: chances.to_vec(),
        ..BestSettings::default()
    };
    let run = best(oracle, &settings, None, &mut |_| ControlFlow::Continue(()));
    let run = run.expect("a plan that can be analysed");
    let envelope = run.envelope.clone().ok()?;
    Some((run, envelope))
}

#[test]
fn best_probability_beats_all_grid_boxes() {
    let (mut proved, mut unproved, mut split, mut never, mut others) = (0, 0, 0, 0, 0);
    for bounds in BOUNDS {
        let given = Given {
            domain: DOMAIN,
            plan: &problem(bounds),
            ..Given::default()
        };
        let (task, plan) = given.task_and_plan();
        let all = boxes(&plan);
        for guarantee in Guarantee::ALL {
            let Ok(mut oracle) = Oracle::new(&task, &plan, guarantee) else {
                continue;
            };
            for chances in families() {
                let mut known = Known::new();
                for symmetric in [false, true] {
                    let Some((run, best)) = found(&mut oracle, &chances, symmetric) else {
                        continue;
                    };
                    let what = format!("{guarantee} {symmetric} {bounds} {chances:?} {run:?}");
                    assert_eq!(oracle.objection(&best), Ok(None), "{what}");
                    let (value, bound) = (run.value.to_f64(), run.bound.to_f64());
                    match logarithm(&best, &chances, &mut known) {
                        Some(own) => assert!((own - value).abs() < 1e-8, "{own} {what}"),
                        None => assert_eq!(run.value, Rational::from(LOG_OF_ZERO), "{what}"),
                    }
                    never += usize::from(run.value == Rational::from(LOG_OF_ZERO));
                    assert!(value <= bound && bound <= 1e-6, "{what}");
                    assert_eq!(run.is_proved, bound <= value + 1e-6, "{what}");
                    proved += usize::from(run.is_proved);
                    unproved += usize::from(!run.is_proved);
                    split += usize::from(format!("{:?}", run.proof.reasons).contains("Split"));
                    for other in &all {
                        let own = logarithm(other, &chances, &mut known);
                        if own.is_none_or(|own| own <= bound + 1e-9) {
                            continue;
                        }
                        let is_symmetric = other.intervals().iter().all(|own| {
                            let ends = own.lower.value().zip(own.upper.value());
                            ends.is_some_and(|(lower, upper)| {
                                lower + upper == Rational::from(2 * NOMINAL)
                            })
                        });
                        if !symmetric || is_symmetric {
                            assert!(
                                oracle.objection(other).unwrap().is_some(),
                                "{other:?} {own:?} {what}"
                            );
                            others += 1;
                        }
                    }
                }
            }
        }
    }
    println!("{proved} proved, {unproved} not, {split} split, {never} never, {others} others");
    assert!(
        proved > 100 && split > 10 && never > 5 && others > 1000,
        "{proved} {unproved} {split} {never} {others}"
    );
    assert!(unproved * 10 < proved, "{proved} {unproved}");
}
