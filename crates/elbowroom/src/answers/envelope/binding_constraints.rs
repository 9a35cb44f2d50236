//! The limits of the ends of a box, in words.

use elbowroom_envelope::explain::KnownConflicts;
use elbowroom_envelope::{Limit, Method, Oracle, limits};
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope};

use super::Subject;
use super::search::continue_or_stop;
use crate::answers::Observer;

/// A sharpened end is moved by the precision divided by this number to find its limit.
const SHARPENING_DIVISOR: i64 = 1_000_000_000;
/// Number of times that the step is doubled to find the limit of an end. The search itself has not
/// tried larger steps.
const STEP_DOUBLINGS: usize = 1;
/// Reasons further out than this share of the nominal value are not reported as limits.
const MAX_REPORTED_DISTANCE: (i64, i64) = (1, 4);

/// Returns the limits of the lower and the upper end of each parameter's interval; `None` if there
/// is none, or if time ran out.
pub(super) fn limits_of_ends(
    subject: &Subject<'_>,
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
    watcher: &mut dyn Observer,
) -> Vec<[Option<String>; 2]> {
    let how = &subject.request.search;
    let mut distances = how.settings().precisions(subject.plan);
    for (distance, parameter) in distances.iter_mut().zip(&subject.plan.parameters) {
        let nominal = parameter.nominal.abs();
        if how.sharpen || subject.request.method() == Method::Best {
            // A sharpened end touches its limit, so the smallest step finds it.
            *distance = &*distance * &Rational::new(1, SHARPENING_DIVISOR);
        } else if how.relative.is_none() && !nominal.is_zero() {
            // The search may have tried this end in large steps only; a smaller step finds the
            // nearest limit.
            let near = &nominal * &Rational::new(MAX_REPORTED_DISTANCE.0, MAX_REPORTED_DISTANCE.1);
            *distance = near.min(distance.clone());
        }
    }
    let mut words = vec![[None, None]; subject.plan.parameters.len()];
    let mut seen = KnownConflicts::default();
    for _ in 0..=STEP_DOUBLINGS {
        // An end that can move by this step may still be stopped by a larger step.
        let is_open = |end: &BoxEnd| words[end.parameter.index()][end.side.index()].is_none();
        let open: Vec<BoxEnd> = BoxEnd::all(words.len()).filter(is_open).collect();
        let mut on_limit = |end: BoxEnd, limit: &Limit| {
            let own = (end.parameter, end.side);
            let reason = subject
                .explainer
                .limit_with_known_conflicts(own, limit, &mut seen);
            words[end.parameter.index()][end.side.index()] = reason;
        };
        let which = (&open[..], &distances[..]);
        limits(
            oracle,
            envelope,
            which,
            &mut || continue_or_stop(watcher),
            &mut on_limit,
        );
        if continue_or_stop(watcher).is_break() {
            break;
        }
        for distance in &mut distances {
            *distance = &*distance + &*distance;
        }
    }
    words
}
