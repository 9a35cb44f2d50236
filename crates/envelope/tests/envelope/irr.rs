//! The search compared with the algorithm as published: one check of one box after the other.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_envelope::{
    Growth, Guarantee, Limit, Objection, Oracle, Settings, StopReason, irr, limits,
};
use elbowroom_model::Task;
use elbowroom_num::{End, Rational};
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParameterId, ParametrizedPlan, Side};

use crate::given::Given;

/// Pseudorandom number generator.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        let drawn = (self.0 >> 33) % bound as u64;
        usize::try_from(drawn).expect("below the bound")
    }
}

const DOMAIN: &str = "
    (:durative-action run :parameters () :duration (>= ?duration 0) :condition () :effect (and))
    (:durative-action burn :parameters () :duration (>= ?duration 0)
      :condition (at end (>= (x) ?duration)) :effect (at end (decrease (x) ?duration)))";

/// Returns a plan of sequential or parallel actions, some of which consume a resource, with bounds
/// between their starts and ends and ranges of their durations.
fn plan_text(dice: &mut Random) -> String {
    let count = 2 + dice.below(4);
    let mut text = String::new();
    for action in 0..count {
        let range = [
            "lb 0 ub inf",
            "lb 0 ub 6",
            "lb 1 ub inf",
            "lb -inf ub inf",
            "lb 2 ub 2",
        ][dice.below(5)];
        let name = ["run", "burn"][usize::from(dice.below(4) == 0)];
        let _ = write!(
            text,
            "parameter p{action} default 2 {range}; durative-action instance a{action} : ({name}); \
             c: a{action}.end - a{action}.start in [p{action}, p{action}]; "
        );
        if action > 0 && dice.below(3) > 0 {
            let before = dice.below(action);
            let _ = write!(text, "c: a{action}.start - a{before}.end in [1/4, inf]; ");
        }
    }
    for _ in 0..dice.below(6) {
        let point = |dice: &mut Random| {
            let side = ["start", "end"][dice.below(2)];
            format!("a{}.{side}", dice.below(count))
        };
        let (from, to) = (point(dice), point(dice));
        if from == to {
            continue;
        }
        let least = dice.below(3);
        let bound = match dice.below(3) {
            0 => format!("[{least}, inf]"),
            1 => format!("[-inf, {}]", 2 + dice.below(30)),
            _ => format!("[{least}, {}]", least + dice.below(20)),
        };
        let _ = write!(text, "c: {to} - {from} in {bound}; ");
    }
    text
}

/// Returns a plan of sequential actions, many with a window, so that conflicts span several
/// windows.
fn plan_in_windows(dice: &mut Random, count: usize) -> String {
    let mut text = String::new();
    for action in 0..count {
        let range = ["lb 0 ub inf", "lb 0 ub 6", "lb 1 ub 9"][dice.below(3)];
        let _ = write!(
            text,
            "parameter p{action} default 2 {range}; durative-action instance a{action} : (run); \
             c: a{action}.end - a{action}.start in [p{action}, p{action}]; "
        );
        if action > 0 {
            let _ = write!(
                text,
                "c: a{action}.start - a{}.end in [1/4, inf]; ",
                action - 1
            );
        }
        let start = 3 * action + 2;
        if dice.below(3) > 0 {
            let open = start - dice.below(3);
            let _ = write!(text, "c: a{action}.start - .zero in [{open}, inf]; ");
        }
        if dice.below(3) > 0 {
            let close = start + 2 + dice.below(5);
            let _ = write!(text, "c: a{action}.end - .zero in [-inf, {close}]; ");
        }
    }
    text
}

/// Result of a search: the steps, each with the resulting box and the number of checks so far, and
/// the reason for the end.
#[derive(Debug, PartialEq)]
struct SearchLog {
    steps: Vec<Option<(DecoupledEnvelope, BoxEnd, usize)>>,
    envelope: Option<DecoupledEnvelope>,
    checks: usize,
    stop: StopReason,
}

struct Progress {
    step: Rational,
    is_open: [bool; 2],
    is_done: [bool; 2],
    has_halved: bool,
}

impl Progress {
    fn close(&mut self) {
        if (0..2).all(|side| !self.is_open[side] || self.is_done[side]) {
            self.step = &self.step * &Rational::new(1, 2);
            self.is_open = [true; 2];
            self.has_halved = true;
        }
    }
}

/// Runs algorithm 1, box by box. It ends after `most` steps.
fn one_by_one(
    oracle: &mut Oracle,
    plan: &ParametrizedPlan,
    settings: &Settings,
    most: usize,
) -> SearchLog {
    let mut told = SearchLog {
        steps: Vec::new(),
        envelope: None,
        checks: 1,
        stop: StopReason::Converged,
    };
    let mut envelope = DecoupledEnvelope::point(&plan.nominal());
    if oracle.start(&envelope).expect("few cases").is_some() {
        return told;
    }
    let precision = &settings.precision;
    let mut all: Vec<Progress> = plan
        .parameters
        .iter()
        .map(|own| Progress {
            step: own.nominal.abs().max(Rational::ONE).max(precision.clone()),
            is_open: [true; 2],
            is_done: [false; 2],
            has_halved: false,
        })
        .collect();
    let mut next = 0;
    loop {
        let is_left = |it: &Progress| it.is_done != [true; 2] && it.step >= *precision;
        let order = (0..all.len()).map(|offset| (next + offset) % all.len());
        let open = order.flat_map(|index| [(index, 1), (index, 0)]);
        let mut open = open.filter(|(index, side)| {
            let it = &all[*index];
            &it.step + &it.step >= *precision && it.is_open[*side] && !it.is_done[*side]
        });
        let chosen = all.iter().any(is_left).then(|| open.next()).flatten();
        let Some((index, side)) = chosen else {
            break;
        };
        next = index + 1;
        if settings.most_checks.is_some_and(|most| told.checks >= most) {
            told.stop = StopReason::CheckLimit;
            break;
        }
        let end = BoxEnd {
            parameter: ParameterId::from(index),
            side: Side::BOTH[side],
        };
        let range = &plan.parameters[index].range;
        let reach = end.reach(&envelope).expect("an end that can move") + &all[index].step;
        let value = if side == 0 { -&reach } else { reach.clone() };
        let mut try_reach = |reach| {
            told.checks += 1;
            oracle.try_reach(end, reach).expect("few cases")
        };
        if range.contains(&value) && try_reach(Some(reach.clone())) {
            let is_endless = matches!(end.side.of(range), End::Infinite) && try_reach(None);
            let it = &mut all[index];
            if settings.growth == Growth::Doubling && !it.has_halved {
                it.step = &it.step + &it.step;
            }
            let farthest = &Rational::from(1_000_000_000)
                * &plan.parameters[index].nominal.abs().max(Rational::ONE);
            if is_endless || reach > farthest {
                it.is_done[side] = true;
                it.close();
            }
            envelope = end.with_reach(&envelope, (!is_endless).then_some(reach));
            told.steps.push(Some((envelope.clone(), end, told.checks)));
        } else {
            all[index].is_open[side] = false;
            all[index].close();
            told.steps.push(None);
        }
        if told.steps.len() == most {
            told.stop = StopReason::Cancelled;
            break;
        }
    }
    told.envelope = Some(envelope);
    told
}

fn as_built(oracle: &mut Oracle, settings: &Settings, most: usize) -> SearchLog {
    let mut steps = Vec::new();
    let run = irr(oracle, settings, &mut |widening| {
        steps.push(widening.map(|it| (it.envelope.clone(), it.end, it.checks)));
        if steps.len() == most {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })
    .expect("few cases");
    let widened = steps.iter().flatten().count();
    assert_eq!(run.widenings, widened);
    SearchLog {
        steps,
        envelope: run.envelope.ok(),
        checks: run.checks,
        stop: run.stop,
    }
}

/// Compares the stored objections to boxes with one end further out with those of a fresh oracle.
/// Returns the number of objections.
fn objections(
    own: &mut Oracle,
    fresh: &mut Oracle,
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
) -> usize {
    let mut count = 0;
    for end in BoxEnd::all(plan.parameters.len()) {
        for distance in [Rational::new(1, 100), Rational::ONE, Rational::from(20)] {
            let Some(reach) = end.reach(envelope) else {
                continue;
            };
            let reach = reach + distance;
            let farther = end.with_reach(envelope, Some(reach.clone()));
            let found = own.objection_to_widening(envelope, end, Some(reach));
            let found = found.expect("few cases");
            let expected = fresh.objection(&farther).expect("few cases");
            assert_eq!(found.is_some(), expected.is_some(), "{end:?} {envelope:?}");
            let Some(objection) = found else {
                continue;
            };
            count += 1;
            match objection {
                Objection::NoSchedule(values) => {
                    assert!(farther.contains(&values), "{end:?} {envelope:?}");
                    let (network, _) = plan.plan.network_with_origins(&values);
                    assert!(network.consistency().is_err(), "{end:?} {envelope:?}");
                }
                Objection::Broken(broken) => {
                    let shown = fresh.counterexample(&farther, &broken);
                    assert!(shown.is_some(), "{broken:?} {end:?} {envelope:?}");
                }
                _ => {}
            }
        }
    }
    count
}

/// Compares the limits of all ends with the checks of a fresh oracle. Returns the number of ends
/// that can move.
fn movable_ends(
    own: &mut Oracle,
    fresh: &mut Oracle,
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
) -> usize {
    let mut count = 0;
    let ends: Vec<BoxEnd> = BoxEnd::all(plan.parameters.len()).collect();
    for distance in [Rational::new(1, 100), Rational::ONE] {
        let steps = vec![distance.clone(); plan.parameters.len()];
        let mut limited = Vec::new();
        let mut record = |end, limit: &Limit| limited.push((end, limit.clone()));
        let mut flow = || ControlFlow::Continue(());
        limits(own, envelope, (&ends, &steps), &mut flow, &mut record);
        for &end in &ends {
            let limit = limited.iter().find(|(own, _)| *own == end);
            let Some(reach) = end.reach(envelope) else {
                assert!(matches!(limit, Some((_, Limit::Unbounded))));
                continue;
            };
            let border = end.side.reach(&plan.parameter(end.parameter).range);
            if border.as_ref() == Some(&reach) {
                assert!(matches!(limit, Some((_, Limit::Range))));
                continue;
            }
            let target = reach + &distance;
            let target = border.map_or(target.clone(), |border| border.min(target));
            let farther = end.with_reach(envelope, Some(target));
            let expected = fresh.objection(&farther).expect("few cases");
            let is_limited = matches!(limit, Some((_, Limit::Objection(_))));
            assert_eq!(is_limited, expected.is_some(), "{end:?} {envelope:?}");
            count += usize::from(expected.is_none());
        }
    }
    count
}

fn task_and_plan(text: &str) -> (Arc<Task>, Arc<ParametrizedPlan>) {
    let given = Given {
        domain: DOMAIN,
        init: "",
        plan: text,
        ..Given::default()
    };
    given.task_and_plan()
}

#[test]
fn speculative_search_takes_same_steps_as_sequential() {
    let mut dice = Random(3);
    let (mut long, mut limited, mut cancelled, mut without, mut objected) = (0, 0, 0, 0, 0);
    for round in 0..800 {
        let text = if round < 600 {
            plan_text(&mut dice)
        } else {
            let count = 4 + dice.below(8);
            plan_in_windows(&mut dice, count)
        };
        let (task, plan) = task_and_plan(&text);
        for guarantee in Guarantee::ALL {
            let Ok(oracle) = Oracle::new(&task, &plan, guarantee) else {
                without += 1;
                continue;
            };
            let settings = Settings {
                precision: Rational::new(1, [1, 4, 16][dice.below(3)]),
                growth: [Growth::Doubling, Growth::Constant][usize::from(dice.below(4) == 0)],
                most_checks: (dice.below(3) == 0).then(|| 1 + dice.below(40)),
                ..Settings::default()
            };
            let most = [1_000, 1 + dice.below(30)][dice.below(2)];
            let expected = one_by_one(&mut oracle.clone(), &plan, &settings, most);
            let mut own = oracle.clone();
            let found = as_built(&mut own, &settings, most);
            assert_eq!(found, expected, "{guarantee} {settings:?} {most} {text}");
            if let Some(envelope) = &found.envelope {
                // The reported box is the oracle's accepted one, and it is inside.
                assert_eq!(own.accepted(), Some(envelope), "{guarantee} {text}");
                assert_eq!(own.checks(), found.checks);
                assert_eq!(oracle.clone().objection(envelope), Ok(None));
                objected += objections(&mut own, &mut oracle.clone(), &plan, envelope);
            }
            long += usize::from(found.steps.len() > 60);
            limited += usize::from(found.stop == StopReason::CheckLimit);
            cancelled += usize::from(found.stop == StopReason::Cancelled);
        }
    }
    assert!(
        objected > 1_000 && long > 60 && limited > 60 && cancelled > 60 && without < 600,
        "{long} {limited} {cancelled} {without} {objected}"
    );
}

#[test]
fn limits_agree_with_fresh_checks() {
    let mut dice = Random(4);
    let (mut movable, mut boxes) = (0, 0);
    for round in 0..300 {
        let text = if round < 200 {
            plan_text(&mut dice)
        } else {
            plan_in_windows(&mut dice, 3 + round % 5)
        };
        let (task, plan) = task_and_plan(&text);
        for guarantee in Guarantee::ALL {
            let Ok(oracle) = Oracle::new(&task, &plan, guarantee) else {
                continue;
            };
            let settings = Settings {
                precision: Rational::new(1, [1, 4, 16][dice.below(3)]),
                ..Settings::default()
            };
            let mut own = oracle.clone();
            // A search cut short leaves ends that can move.
            let most = [1_000, 1 + dice.below(30)][dice.below(2)];
            let found = as_built(&mut own, &settings, most);
            if let Some(envelope) = &found.envelope {
                boxes += 1;
                movable += movable_ends(&mut own, &mut oracle.clone(), &plan, envelope);
            }
        }
    }
    assert!(boxes > 200 && movable > 500, "{boxes} {movable}");
}

/// Returns the sum of the distances of ends from the nominal values, without ends that have no
/// limit.
fn total_slack(plan: &ParametrizedPlan, envelope: &DecoupledEnvelope) -> Rational {
    let point = DecoupledEnvelope::point(&plan.nominal());
    BoxEnd::all(plan.parameters.len())
        .filter_map(|end| Some(&end.reach(envelope)? - &end.reach(&point)?))
        .filter(|room| *room < Rational::from(1_000))
        .sum()
}

#[test]
fn conflict_split_keeps_box_inside_and_almost_as_large() {
    let mut dice = Random(5);
    let (mut divided, mut rooms) = ([0; 2], [Rational::ZERO, Rational::ZERO]);
    for round in 0..60 {
        let mut text = plan_in_windows(&mut dice, 60);
        if round >= 40 {
            // Keeps deadlines only.
            let opens =
                |constraint: &&str| constraint.contains(".zero") && constraint.ends_with("inf]");
            let left = text.split("; ").filter(|constraint| !opens(constraint));
            text = left.collect::<Vec<_>>().join("; ");
        }
        let (task, plan) = task_and_plan(&text);
        for guarantee in Guarantee::ALL {
            let oracle = Oracle::new(&task, &plan, guarantee).expect("few cases");
            let settings = Settings {
                precision: Rational::new(1, 16),
                ..Settings::default()
            };
            let dividing = Settings {
                divide_after: Some(0),
                ..settings.clone()
            };
            let found = [settings, dividing].map(|settings| {
                let found = as_built(&mut oracle.clone(), &settings, usize::MAX);
                assert_eq!(found.stop, StopReason::Converged);
                found.envelope
            });
            let [Some(whole), Some(other)] = &found else {
                assert_eq!(found, [None, None], "{guarantee} {text}");
                continue;
            };
            assert_eq!(
                oracle.clone().objection(other),
                Ok(None),
                "{guarantee} {text}"
            );
            divided[usize::from(round >= 40)] += usize::from(whole != other);
            rooms[0] += total_slack(&plan, whole);
            rooms[1] += total_slack(&plan, other);
        }
    }
    let share = (&rooms[1] / &rooms[0]).to_f64();
    assert!(
        divided.iter().all(|count| *count > 20) && share > 0.98,
        "{divided:?} {share}"
    );
}
