//! The gain of knowing values in advance.

use std::ops::ControlFlow;

use elbowroom_envelope::obligations::Refusal;
use elbowroom_envelope::{Guarantee, Objection, Oracle, StopReason, irr};
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParameterId, ParametrizedPlan, Side};
use serde::{Deserialize, Serialize};

use super::Subject;
use super::search::continue_or_stop;
use crate::answers::{Exact, Observer, RequestError};
use crate::pipeline::PipelineError;

/// Number of times that the step is doubled to find the limit of an end.
const STEP_DOUBLINGS: usize = 3;
/// In sums of widths, ends count up to this multiple of the nominal value.
const LARGEST_RELATIVE_END: i64 = 10;

/// The gain of knowing values in advance: the weak envelope compared with the dynamic one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ValueOfInformation {
    /// Names of the quantities that an executor would have to know in advance.
    pub unknown: Vec<String>,
    /// The sum of the widths of all intervals, ends counted up to ten times the nominal value.
    pub width: Exact,
    /// The same of the weak envelope.
    pub weak_width: Exact,
}

/// Computes the gain of foresight, if the lack of it limits an end of the box.
pub(super) fn value_of_information(
    subject: &Subject<'_>,
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
    watcher: &mut dyn Observer,
) -> Result<Option<ValueOfInformation>, RequestError> {
    let request = subject.request;
    if request.guarantee != Guarantee::Dynamic {
        return Ok(None);
    }
    let unknown = unobservable_quantities(
        oracle,
        envelope,
        &request.search.settings().precisions(subject.plan),
        watcher,
    )?;
    if unknown.is_empty() || continue_or_stop(watcher).is_break() {
        return Ok(None);
    }
    let weak = Oracle::new(&request.task, subject.plan, Guarantee::Weak);
    let settings = request.search.settings();
    let run =
        weak.and_then(|mut weak| irr(&mut weak, &settings, &mut |_| continue_or_stop(watcher)));
    let run = Refusal::unless_interrupted(run).map_err(PipelineError::Refused)?;
    let Some((StopReason::Converged, Ok(weak))) = run.map(|run| (run.stop, run.envelope)) else {
        return Ok(None);
    };
    let (width, weak_width) = (
        total_width(subject.plan, envelope),
        total_width(subject.plan, &weak),
    );
    if weak_width <= width {
        return Ok(None);
    }
    let name = |id: ParameterId| subject.plan.parameter(id).name.clone();
    Ok(Some(ValueOfInformation {
        unknown: unknown.into_iter().map(name).collect(),
        width: Exact(width),
        weak_width: Exact(weak_width),
    }))
}

/// Returns the quantities that an executor would have to know in advance for some end to move
/// further.
fn unobservable_quantities(
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
    steps: &[Rational],
    watcher: &mut dyn Observer,
) -> Result<Vec<ParameterId>, RequestError> {
    let mut unknown = Vec::new();
    for (index, step) in steps.iter().enumerate() {
        for side in Side::BOTH {
            if let ControlFlow::Break(()) = continue_or_stop(watcher) {
                return Ok(unknown);
            }
            let end = BoxEnd {
                parameter: ParameterId::from(index),
                side,
            };
            let Some(reach) = end.reach(envelope) else {
                continue;
            };
            // The end is at the limit of the parameter's range.
            let border = side.reach(&oracle.plan().parameters[index].range);
            if border.is_some_and(|border| reach >= border) {
                continue;
            }
            // An end that can move by one step may still be stopped by a larger step.
            let mut distance = step.clone();
            for _ in 0..=STEP_DOUBLINGS {
                let farther = oracle.objection_to_widening(envelope, end, Some(&reach + &distance));
                let farther = Refusal::unless_interrupted(farther);
                let Some(farther) = farther.map_err(PipelineError::Refused)? else {
                    break;
                };
                match farther {
                    None => distance = &distance + &distance,
                    Some(Objection::Uncontrollable(conflict)) => {
                        unknown.extend(conflict.ends().iter().map(|end| end.parameter));
                        break;
                    }
                    Some(_) => break,
                }
            }
        }
    }
    unknown.sort_unstable();
    unknown.dedup();
    Ok(unknown)
}

/// Returns the sum of the widths of all intervals.
fn total_width(plan: &ParametrizedPlan, envelope: &DecoupledEnvelope) -> Rational {
    let cap = Rational::from(LARGEST_RELATIVE_END);
    let widths = plan.parameters.iter().zip(envelope.intervals());
    let widths = widths.map(|(parameter, interval)| {
        let most = parameter.nominal.abs() * &cap;
        let upper = interval
            .upper
            .value()
            .map_or(&most, |upper| upper.min(&most));
        let lower = interval.lower.value().cloned().unwrap_or_else(|| -&most);
        (upper - lower).max(Rational::ZERO)
    });
    widths.fold(Rational::ZERO, |sum, width| sum + width)
}
