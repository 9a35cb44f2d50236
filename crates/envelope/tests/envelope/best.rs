//! The best box, compared with all boxes on a grid.

use std::fmt::Write as _;
use std::ops::ControlFlow;

use elbowroom_envelope::{
    BestRun, BestSettings, Guarantee, Objective, Oracle, Settings, best, irr, max_uniform_slack,
};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{DecoupledEnvelope, ParameterId, ParametrizedPlan};

use crate::given::Given;

/// The nominal value of all durations, and the greatest one on the grid.
const NOMINAL: i64 = 2;
const MOST: i64 = 6;

/// Returns a problem with three actions, the first two of which consume a resource, and bounds
/// between their starts and ends.
fn problem(bounds: &str) -> String {
    format!(
        "parameter a default {NOMINAL} lb 0 ub {MOST}; parameter b default {NOMINAL} lb 0 ub {MOST};
         parameter c default {NOMINAL} lb 0 ub {MOST};
         durative-action instance one : (burn); durative-action instance two : (burn);
         durative-action instance three : (run);
         c: one.end - one.start in [a, a]; c: two.end - two.start in [b, b];
         c: three.end - three.start in [c, c]; c: two.start - one.end in [1/2, inf]; {bounds}"
    )
}

const DOMAIN: &str = "
    (:durative-action run :parameters () :duration (>= ?duration 0) :condition () :effect (and))
    (:durative-action burn :parameters () :duration (>= ?duration 0)
      :condition (at end (>= (x) ?duration)) :effect (at end (decrease (x) ?duration)))";

/// Pseudorandom number generator.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 33) % bound
    }

    fn one_of<'a>(&mut self, words: &[&'a str]) -> &'a str {
        let index = usize::try_from(self.below(words.len() as u64));
        words[index.expect("below the number of words")]
    }

    /// Generates a few bounds between starts and ends, most of them satisfied at the nominal
    /// values.
    fn bounds(&mut self) -> String {
        let points = [
            "one.start",
            "one.end",
            "two.start",
            "two.end",
            "three.start",
            "three.end",
        ];
        let mut bounds = String::new();
        for _ in 0..=self.below(4) {
            let from = self.one_of(&points);
            let to = self.one_of(&points);
            if from == to {
                continue;
            }
            let bound = match self.below(3) {
                0 => format!("[{}, inf]", self.below(3)),
                1 => format!("[-inf, {}]", self.below(7)),
                _ => {
                    let least = self.below(3);
                    format!("[{least}, {}]", least + self.below(6))
                }
            };
            let _ = write!(bounds, "c: {to} - {from} in {bound}; ");
        }
        bounds
    }
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
                        let id = ParameterId::from(index);
                        envelope.clone().with_interval(id, interval)
                    })
                })
            })
            .collect();
    }
    boxes
}

/// Returns the sum of widths.
fn widths(envelope: &DecoupledEnvelope) -> Rational {
    let widths = envelope.intervals().iter();
    widths.filter_map(Interval::width).sum()
}

/// Returns the distances of the ends from the nominal values, in ascending order.
fn slacks(envelope: &DecoupledEnvelope) -> Vec<Rational> {
    let nominal = Rational::from(NOMINAL);
    let ends = envelope.intervals().iter().flat_map(|interval| {
        [&interval.lower, &interval.upper]
            .map(|end| (end.value().expect("a finite end") - &nominal).abs())
    });
    let mut slacks: Vec<Rational> = ends.collect();
    slacks.sort_unstable();
    slacks
}

/// Returns the logarithm of the product of widths, relative to the nominal values, each a millionth
/// wider.
fn volume(envelope: &DecoupledEnvelope) -> f64 {
    let widths = envelope.intervals().iter().filter_map(Interval::width);
    let nominal = Rational::from(NOMINAL).to_f64();
    widths
        .map(|width| (width.to_f64() / nominal + 1e-6).ln())
        .sum()
}

fn is_symmetric(envelope: &DecoupledEnvelope) -> bool {
    let twice = Rational::from(2 * NOMINAL);
    envelope.intervals().iter().all(|own| {
        let ends = own.lower.value().zip(own.upper.value());
        ends.is_some_and(|(lower, upper)| lower + upper == twice)
    })
}

fn found(
    oracle: &mut Oracle,
    objective: Objective,
    symmetric: bool,
) -> Option<(BestRun, DecoupledEnvelope)> {
    let settings = BestSettings {
        objective,
        symmetric,
        ..BestSettings::default()
    };
    let run = best(oracle, &settings, None, &mut |_| ControlFlow::Continue(()));
    let run = run.expect("a plan that can be analysed");
    let envelope = run.envelope.clone().ok()?;
    Some((run, envelope))
}

#[test]
fn best_box_beats_all_grid_boxes() {
    let mut dice = Random(11);
    let (mut proved, mut unproved, mut torn) = (0, 0, 0);
    for _ in 0..60 {
        let bounds = dice.bounds();
        let given = Given {
            domain: DOMAIN,
            plan: &problem(&bounds),
            ..Given::default()
        };
        let (task, plan) = given.task_and_plan();
        for guarantee in Guarantee::ALL {
            let Ok(mut oracle) = Oracle::new(&task, &plan, guarantee) else {
                continue;
            };
            for symmetric in [false, true] {
                let Some((wide, widest)) = found(&mut oracle, Objective::Widths, symmetric) else {
                    continue;
                };
                let (fair, fairest) = found(&mut oracle, Objective::LeastSlack, symmetric).unwrap();
                for (run, envelope) in [(&wide, &widest), (&fair, &fairest)] {
                    assert_eq!(oracle.objection(envelope), Ok(None), "{guarantee} {bounds}");
                    assert!(run.bound >= run.value, "{guarantee} {bounds}");
                    if run.is_proved {
                        proved += 1;
                    } else {
                        unproved += 1;
                    }
                    torn += usize::from(run.proof.cuts.iter().any(|cut| cut.rows.len() > 1));
                }
                assert_eq!(widths(&widest), wide.value);
                let least = slacks(&fairest);
                for other in boxes(&plan) {
                    if symmetric && !is_symmetric(&other) {
                        continue;
                    }
                    let is_wider = widths(&other) > wide.value;
                    let is_fairer = slacks(&other) > least;
                    if !is_wider && !is_fairer {
                        continue;
                    }
                    let is_inside = oracle.objection(&other).unwrap().is_none();
                    assert!(
                        !is_inside || !is_wider || widths(&other) <= wide.bound,
                        "{guarantee} {bounds} {other:?} {wide:?}"
                    );
                    if wide.is_proved {
                        assert!(
                            !is_inside || !is_wider,
                            "{guarantee} {bounds} {other:?} {wide:?}"
                        );
                    }
                    if fair.is_proved {
                        assert!(
                            !is_inside || !is_fairer,
                            "{guarantee} {bounds} {other:?} {fair:?}"
                        );
                    }
                }
            }
        }
    }
    assert!(proved > 200 && torn > 10, "{proved} {unproved} {torn}");
    assert!(unproved * 10 < proved, "{proved} {unproved}");
}

/// Returns a plan of two sequential actions with a deadline after ten units; the unit is a
/// parameter of the test.
fn relay(unit: &Rational) -> String {
    let limit = &Rational::from(10) * unit;
    format!(
        "parameter a default {unit} lb 0; parameter b default {unit} lb 0;
         durative-action instance first : (run); durative-action instance second : (run);
         c: first.end - first.start in [a, a]; c: second.end - second.start in [b, b];
         c: second.start - first.end in [0, 0]; c: second.end - .zero in [0, {limit}];"
    )
}

#[test]
fn best_volume_beats_all_grid_boxes() {
    let mut dice = Random(23);
    let (mut proved, mut unproved, mut torn, mut flat, mut others) = (0, 0, 0, 0, 0);
    for _ in 0..40 {
        let bounds = dice.bounds();
        let given = Given {
            domain: DOMAIN,
            plan: &problem(&bounds),
            ..Given::default()
        };
        let (task, plan) = given.task_and_plan();
        for guarantee in Guarantee::ALL {
            let Ok(mut oracle) = Oracle::new(&task, &plan, guarantee) else {
                continue;
            };
            for symmetric in [false, true] {
                let Some((run, best)) = found(&mut oracle, Objective::Volume, symmetric) else {
                    continue;
                };
                let what = format!("{guarantee} {symmetric} {bounds} {run:?}");
                assert_eq!(oracle.objection(&best), Ok(None), "{what}");
                let (value, bound) = (run.value.to_f64(), run.bound.to_f64());
                assert!((volume(&best) - value).abs() < 1e-8, "{what}");
                assert!(value <= bound, "{what}");
                assert_eq!(run.is_proved, bound <= value + 1e-6, "{what}");
                proved += usize::from(run.is_proved);
                unproved += usize::from(!run.is_proved);
                torn += usize::from(run.proof.cuts.iter().any(|cut| cut.rows.len() > 1));
                flat += usize::from(value < -10.0);
                for other in boxes(&plan) {
                    if volume(&other) > bound + 1e-9 && (!symmetric || is_symmetric(&other)) {
                        assert!(
                            oracle.objection(&other).unwrap().is_some(),
                            "{other:?} {what}"
                        );
                        others += 1;
                    }
                }
            }
        }
    }
    assert!(
        proved > 100 && torn > 5 && flat > 5 && others > 1000,
        "{proved} {torn} {flat} {others}"
    );
    assert!(unproved * 10 < proved, "{proved} {unproved}");
}

/// A search for the least slack that is cancelled returns at least its initial box.
#[test]
fn stopped_search_is_no_worse_than_start() {
    let mut dice = Random(11);
    let (mut ended, mut kept) = (0, 0);
    while ended < 60 {
        let given = Given {
            domain: DOMAIN,
            plan: &problem(&dice.bounds()),
            ..Given::default()
        };
        let (task, plan) = given.task_and_plan();
        let mut oracle = Oracle::new(&task, &plan, Guarantee::Dynamic).expect("three actions");
        let settings = Settings::default();
        let run = irr(&mut oracle, &settings, &mut |_| ControlFlow::Continue(()));
        let run = run.expect("three actions");
        let Ok(start) = run.envelope else { continue };
        let mut left = dice.below(4);
        let run = best(
            &mut oracle,
            &BestSettings::default(),
            Some(&start),
            &mut |_| {
                let flow = match left {
                    0 => ControlFlow::Break(()),
                    _ => ControlFlow::Continue(()),
                };
                left = left.saturating_sub(1);
                flow
            },
        );
        let run = run.expect("three actions");
        if !run.is_cancelled {
            continue;
        }
        ended += 1;
        let envelope = run.envelope.expect("the plan works");
        kept += usize::from(envelope == start);
        assert!(
            slacks(&envelope)[0] >= slacks(&start)[0],
            "{envelope:?}, {start:?}"
        );
        assert!(run.bound >= run.value && !run.is_proved);
        assert!(matches!(oracle.objection(&envelope), Ok(None)));
    }
    assert!(kept > 0, "no search kept the box with which it began");
}

#[test]
fn uniform_deviation_equals_available_slack() {
    for unit in [Rational::ONE, Rational::new(1, 3600)] {
        let given = Given {
            domain: DOMAIN,
            plan: &relay(&unit),
            ..Given::default()
        };
        let (task, plan) = given.task_and_plan();
        for guarantee in Guarantee::ALL {
            let mut oracle = Oracle::new(&task, &plan, guarantee).unwrap();
            let shares = max_uniform_slack(&mut oracle, &mut || ControlFlow::Continue(()));
            let shares = shares.unwrap().unwrap();
            if guarantee == Guarantee::Strong {
                // The second start follows the first end at once, which requires an observation.
                for share in [shares.increase, shares.decrease, shares.both_directions] {
                    assert_eq!(share.lower_bound, Rational::ZERO);
                    assert_eq!(share.upper_bound, Some(Rational::ZERO));
                }
                continue;
            }
            // With both of them five times as long, the makespan is ten units.
            let four = Rational::from(4);
            for share in [&shares.increase, &shares.both_directions] {
                assert_eq!(share.lower_bound, four, "{guarantee}");
                assert_eq!(share.upper_bound.as_ref(), Some(&four), "{guarantee}");
            }
            assert!(shares.decrease.lower_bound >= Rational::ONE, "{guarantee}");
        }
    }
}

#[test]
fn relative_steps_are_unit_independent() {
    let settings = Settings {
        relative: Some(Rational::new(1, 100)),
        ..Settings::default()
    };
    let found = [Rational::ONE, Rational::new(1, 3600)].map(|unit| {
        let given = Given {
            domain: DOMAIN,
            plan: &relay(&unit),
            ..Given::default()
        };
        let (task, plan) = given.task_and_plan();
        let mut oracle = Oracle::new(&task, &plan, Guarantee::Dynamic).unwrap();
        let run = irr(&mut oracle, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        let envelope = run.envelope.unwrap();
        let ends = envelope.intervals().iter().flat_map(|interval| {
            [&interval.lower, &interval.upper].map(|end| end.value().unwrap() / &unit)
        });
        ends.collect::<Vec<Rational>>()
    });
    assert_eq!(found[0], found[1]);
}
