//! What keeps each end of a box where it is, in words.

use elbowroom_envelope::{Limit, Method, Oracle, limits};
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope};

use super::Subject;
use super::search::flow;
use crate::answers::Watcher;
use crate::explain::Seen;

/// By what part of the precision a sharpened end is moved to see what it touches.
const SHARP: i64 = 1_000_000_000;
/// How often the step is doubled to see what stops an end: the search has tried no end further.
const FARTHER: usize = 1;
/// Reasons further out than this share of the nominal value do not limit an end.
const NEAR: (i64, i64) = (1, 4);

/// For each parameter, what keeps the lower and the upper end of its interval; `None` if nothing
/// does, or if there is no time left to ask.
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
            // A sharpened end has no room at all, so the smallest step tells what it touches.
            *distance = &*distance * &Rational::new(1, SHARP);
        } else if how.relative.is_none() && !nominal.is_zero() {
            // Of an end that was tried in large steps only it is not known what stops it first.
            let near = &nominal * &Rational::new(NEAR.0, NEAR.1);
            *distance = near.min(distance.clone());
        }
    }
    let mut words = vec![[None, None]; subject.plan.parameters.len()];
    let mut seen = Seen::default();
    for _ in 0..=FARTHER {
        // An end that has room for this step may still be stopped by the next larger one.
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
