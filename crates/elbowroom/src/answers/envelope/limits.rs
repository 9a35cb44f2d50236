//! What keeps each end of a box where it is, in words.

use elbowroom_envelope::{Limit, Oracle, limits};
use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, ParameterId, Side};

use super::Subject;
use super::search::flow;
use crate::answers::Watcher;

/// By what part of the precision a sharpened end is moved to see what it touches.
const SHARP: i64 = 1_000_000_000;
/// How often the step is doubled to see what stops an end.
pub(super) const FARTHER: usize = 3;

/// For each parameter, what keeps the lower and the upper end of its interval; `None` if nothing
/// does, or if there is no time left to ask.
pub(super) fn what_limits(
    subject: &Subject<'_>,
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
    watcher: &mut dyn Watcher,
) -> Vec<[Option<String>; 2]> {
    let how = &subject.request.search;
    if flow(watcher).is_break() {
        return vec![[None, None]; subject.plan.parameters.len()];
    }
    // A sharpened end has no room at all, so the smallest step tells what it touches.
    let mut distance = if how.sharpen {
        &how.precision * &Rational::new(1, SHARP)
    } else {
        how.precision.clone()
    };
    let mut words = at_distance(subject, oracle, envelope, &distance);
    for _ in 0..FARTHER {
        // An end that has room for this step may still be stopped by the next larger one.
        if flow(watcher).is_break() || words.iter().flatten().all(Option::is_some) {
            break;
        }
        distance = &distance + &distance;
        let farther = at_distance(subject, oracle, envelope, &distance);
        for (known, found) in words
            .iter_mut()
            .flatten()
            .zip(farther.into_iter().flatten())
        {
            if known.is_none() {
                *known = found;
            }
        }
    }
    words
}

/// What refuses each end that far out.
fn at_distance(
    subject: &Subject<'_>,
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
    distance: &Rational,
) -> Vec<[Option<String>; 2]> {
    let limits = limits(oracle, envelope, distance);
    let words = |id, side, limit: &Option<Limit>| {
        let limit = limit.as_ref()?;
        subject.explainer.limit(id, side, limit)
    };
    limits
        .iter()
        .enumerate()
        .map(|(index, limits)| {
            let id = ParameterId::from(index);
            Side::BOTH.map(|side| words(id, side, &limits[side.index()]))
        })
        .collect()
}
