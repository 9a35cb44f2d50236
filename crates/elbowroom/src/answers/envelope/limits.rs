//! The limits of the ends of a box, in words.

use elbowroom_envelope::{Limit, Method, Oracle, limits};
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope};

use super::Subject;
use super::search::flow;
use crate::answers::Watcher;
use crate::explain::Seen;

/// A sharpened end is moved by the precision divided by this number to find its limit.
const SHARP: i64 = 1_000_000_000;
/// Number of times that the step is doubled to find the limit of an end. The search itself has not
/// tried larger steps.
const FARTHER: usize = 1;
/// Reasons further out than this share of the nominal value are not reported as limits.
const NEAR: (i64, i64) = (1, 4);

/// Returns the limits of the lower and the upper end of each parameter's interval; `None` if there
/// is none, or if time ran out.
pub(super) fn what_limits(
    subject: &Subject<'_>,
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
    watcher: &mut dyn Watcher,
) -> Vec<[Option<String>; 2]> {
    let how = &subject.request.search;
    let mut distances = how.settings().precisions(subject.plan);
    for (distance, parameter) in distances.iter_mut().zip(&subject.plan.parameters) {
        let nominal = parameter.nominal.abs();
        if how.sharpen || subject.request.method() == Method::Best {
            // A sharpened end touches its limit, so the smallest step finds it.
            *distance = &*distance * &Rational::new(1, SHARP);
        } else if how.relative.is_none() && !nominal.is_zero() {
            // The search may have tried this end in large steps only; a smaller step finds the
            // nearest limit.
            let near = &nominal * &Rational::new(NEAR.0, NEAR.1);
            *distance = near.min(distance.clone());
        }
    }
    let mut words = vec![[None, None]; subject.plan.parameters.len()];
    let mut seen = Seen::default();
    for _ in 0..=FARTHER {
        // An end that can move by this step may still be stopped by a larger step.
        let is_open = |end: &BoxEnd| words[end.parameter.index()][end.side.index()].is_none();
        let open: Vec<BoxEnd> = BoxEnd::all(words.len()).filter(is_open).collect();
        let mut tell = |end: BoxEnd, limit: &Limit| {
            let own = (end.parameter, end.side);
            let reason = subject.explainer.limit_beside(own, limit, &mut seen);
            words[end.parameter.index()][end.side.index()] = reason;
        };
        let which = (&open[..], &distances[..]);
        limits(oracle, envelope, which, &mut || flow(watcher), &mut tell);
        if flow(watcher).is_break() {
            break;
        }
        for distance in &mut distances {
            *distance = &*distance + &*distance;
        }
    }
    words
}
