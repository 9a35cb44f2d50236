//! Predictions whether the next run stays inside the plan's envelope, by split conformal
//! prediction.

use std::sync::Arc;

use elbowroom_envelope::explain::Explainer;
use elbowroom_envelope::{Guarantee, Oracle};
use elbowroom_learning::conformal::{Band, allotment, factor, min_samples};
use elbowroom_learning::learn::Learnt;
use elbowroom_learning::survival::Sample;
use elbowroom_model::Task;
use elbowroom_num::{End, Interval, Rational};
use elbowroom_plan::{DecoupledEnvelope, ParameterKind, ParametrizedPlan, Side};
use serde::{Deserialize, Serialize};

use crate::AnyPlan;
use crate::answers::envelope::{EnvelopeRequest, envelope};
use crate::answers::{Observer, RequestError, exact};
use crate::pipeline::PipelineError;

/// Requests intervals that contain all durations of the next execution of a plan at once, with a
/// probability of at least `probability`, and compares them with the plan's envelope.
#[derive(Clone, Debug)]
pub struct ConformalRequest {
    /// The problem.
    pub task: Arc<Task>,
    /// The plan.
    pub plan: AnyPlan,
    /// The guarantee that the plan must keep.
    pub guarantee: Guarantee,
    /// The probability, greater than 0 and less than 1.
    pub probability: f64,
}

/// The intervals, and a verdict on the plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConformalBox {
    /// The requested probability.
    pub probability: f64,
    /// Verdict on the plan for durations in the intervals.
    pub verdict: Verdict,
    /// The reason why the plan fails somewhere in the intervals, or why this is undecided.
    #[serde(default)]
    pub reason: Option<String>,
    /// The intervals, in the order of the plan's parameters.
    pub intervals: Vec<ConformalInterval>,
}

/// Verdict on a plan for durations in the intervals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// All durations of the next run lie in the intervals with the requested probability, and the
    /// plan works for all durations in them.
    Inside,
    /// All durations lie in the intervals with the requested probability, but the plan fails for
    /// some durations in them.
    Outside,
    /// All durations lie in the intervals with the requested probability. There, processes and
    /// events may take another course, and it is not known whether the plan works with it.
    Undecided,
    /// There are too few samples for some action.
    TooFew,
    /// The plan fails as planned.
    NoEnvelope,
}

/// The interval of one duration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConformalInterval {
    /// The name of the parameter.
    pub parameter: String,
    /// The action whose duration it is.
    pub action: String,
    /// The planned duration.
    #[serde(with = "exact")]
    pub nominal: Rational,
    /// The lower end.
    #[serde(with = "exact::lower")]
    pub lower: End,
    /// The upper end.
    #[serde(with = "exact::upper")]
    pub upper: End,
    /// Probability that the duration lies outside the interval.
    pub miss: f64,
    /// Factor of the stretching of the envelope's interval around the planned duration. Up to 1,
    /// the interval lies inside the envelope. `None` if no factor is sufficient.
    pub factor: Option<f64>,
    /// Number of samples used.
    pub samples: usize,
    /// Number of samples needed, if there are too few.
    pub needed: Option<usize>,
}

/// A duration of the plan, its interval in the envelope, and its samples in two halves.
struct DurationSamples<'a> {
    index: usize,
    action: &'a str,
    band: Band,
    training: Vec<Sample>,
    calibration: Vec<Sample>,
}

pub(super) fn answer(
    request: &ConformalRequest,
    learnt: &[Learnt],
    watcher: &mut dyn Observer,
) -> Result<ConformalBox, RequestError> {
    let envelope_request = EnvelopeRequest {
        guarantee: request.guarantee,
        ..EnvelopeRequest::new(&request.task, request.plan.clone())
    };
    let outcome = envelope(&envelope_request, watcher)?;
    let (Some(plan), Some(room)) = (outcome.plan, outcome.envelope) else {
        return Ok(ConformalBox {
            probability: request.probability,
            verdict: Verdict::NoEnvelope,
            reason: None,
            intervals: Vec::new(),
        });
    };
    let durations = durations(&plan, &room, learnt);
    let halves: Vec<(Band, Vec<Sample>)> = durations
        .iter()
        .map(|duration| (duration.band, duration.training.clone()))
        .collect();
    let shares = allotment(&halves, 1.0 - request.probability);
    let mut intervals = Vec::new();
    let mut boxed = DecoupledEnvelope::point(&plan.nominal());
    let mut verdict = Verdict::Inside;
    for (duration, miss) in durations.iter().zip(shares) {
        let parameter = &plan.parameters[duration.index];
        let stretching = factor(duration.band, &duration.calibration, miss);
        let needed = min_samples(miss);
        let is_too_few = duration.calibration.len() < needed;
        let interval = interval(
            &parameter.nominal,
            &room.intervals()[duration.index],
            stretching,
        );
        if is_too_few {
            verdict = Verdict::TooFew;
        }
        intervals.push(ConformalInterval {
            parameter: parameter.name.clone(),
            action: duration.action.to_owned(),
            nominal: parameter.nominal.clone(),
            lower: interval.lower.clone(),
            upper: interval.upper.clone(),
            miss,
            factor: stretching.is_finite().then_some(stretching),
            samples: duration.training.len() + duration.calibration.len(),
            // The other half needs the same number.
            needed: is_too_few.then(|| needed.saturating_mul(2)),
        });
        boxed = boxed.with_interval(duration.index.into(), interval);
    }
    let mut reason = None;
    if verdict == Verdict::Inside {
        let mut oracle =
            Oracle::new(&request.task, &plan, request.guarantee).map_err(PipelineError::from)?;
        let objection = oracle.objection(&boxed).map_err(PipelineError::from)?;
        if let Some(objection) = objection {
            let explainer = Explainer::new(&request.task, &plan);
            let why_not = explainer.objection(&oracle, &boxed, &objection);
            (verdict, reason) = if !why_not.may_be_harmless(&request.task) {
                (Verdict::Outside, Some(why_not.reason))
            } else if let Some(violation) = violation_at_interval_ends(&explainer, &boxed) {
                (Verdict::Outside, Some(violation))
            } else {
                (Verdict::Undecided, Some(why_not.reason))
            };
        }
    }
    Ok(ConformalBox {
        probability: request.probability,
        verdict,
        reason,
        intervals,
    })
}

/// Returns the validator's objection to the plan with all durations at their lower ends, or with
/// all at their upper ends.
fn violation_at_interval_ends(
    explainer: &Explainer<'_>,
    boxed: &DecoupledEnvelope,
) -> Option<String> {
    Side::BOTH.into_iter().find_map(|side| {
        let mut valuation = explainer.plan.nominal();
        for (index, interval) in boxed.intervals().iter().enumerate() {
            if let Some(value) = side.of(interval).value() {
                valuation[index.into()] = value.clone();
            }
        }
        explainer.verdict_at(valuation)
    })
}

/// Returns the open durations with their samples; every second sample is for training.
fn durations<'a>(
    plan: &'a ParametrizedPlan,
    room: &DecoupledEnvelope,
    learnt: &[Learnt],
) -> Vec<DurationSamples<'a>> {
    let mut durations = Vec::new();
    for (index, parameter) in plan.parameters.iter().enumerate() {
        let ParameterKind::Duration(instance) = parameter.kind else {
            continue;
        };
        let action = plan.plan.instance(instance).action.name.as_str();
        let nominal = parameter.nominal.to_f64();
        let interval = &room.intervals()[index];
        let end = |side: Side, infinite: f64| {
            side.of(interval).value().map_or(infinite, Rational::to_f64)
        };
        let band = Band {
            nominal,
            lower: end(Side::Lower, f64::NEG_INFINITY),
            upper: end(Side::Upper, f64::INFINITY),
        };
        let name = action.trim_matches(['(', ')']).split_whitespace().next();
        let samples: Vec<Sample> = learnt
            .iter()
            .find(|learnt| Some(learnt.name.as_str()) == name)
            .and_then(|learnt| learnt.durations.of(action, nominal))
            .map(|(group, unit)| {
                let samples = group.samples.iter();
                samples.map(|sample| sample.over(1.0 / unit)).collect()
            })
            .unwrap_or_default();
        let half = |parity: usize| {
            let numbered = samples.iter().enumerate();
            numbered
                .filter(|(number, _)| number % 2 == parity)
                .map(|(_, sample)| *sample)
                .collect()
        };
        durations.push(DurationSamples {
            index,
            action,
            band,
            training: half(0),
            calibration: half(1),
        });
    }
    durations
}

/// Returns the envelope's interval, stretched around the nominal value and rounded outwards to
/// exact numbers.
fn interval(nominal: &Rational, room: &Interval, stretching: f64) -> Interval {
    if stretching <= 0.0 {
        return Interval::point(nominal.clone());
    }
    let Some(stretching) = Rational::from_f64_exactly(stretching) else {
        return Interval::at_least(Rational::ZERO);
    };
    let stretched = |end: &End| match end.value() {
        None => End::Infinite,
        Some(value) => End::Closed(nominal + (value - nominal) * &stretching),
    };
    let lower = match stretched(&room.lower) {
        End::Closed(value) if value < Rational::ZERO => End::Closed(Rational::ZERO),
        end => end,
    };
    Interval {
        lower,
        upper: stretched(&room.upper),
    }
}
