//! The search for an envelope, from the nominal values to the limits of each end.

use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom_envelope::obligations::Refusal;
use elbowroom_envelope::{Oracle, StopReason, Widening, sharpen};
use elbowroom_plan::DecoupledEnvelope;
use elbowroom_selection::box_search::{Step, grow};

use super::answer::{EnvelopeFinding, Makespans, Stop, WideningStep};
use super::best::best;
use super::binding_constraints::limits_of_ends;
use super::conditions::Conditions;
use super::timeline::Timeline;
use super::uniform_slack::uniform_slack;
use super::value_of_information::value_of_information;
use super::{EnvelopeOutcome, Inequalities, Subject};
use crate::answers::{EnvelopeProgress, Event, Observer, RequestError, StopRequest};
use crate::pipeline::PipelineError;

/// Searches for a box, moves its ends onto their limits if requested, and computes these limits.
pub(super) fn search(
    subject: &Subject<'_>,
    mut oracle: Oracle,
    watcher: &mut dyn Observer,
) -> Result<EnvelopeOutcome, RequestError> {
    let how = &subject.request.search;
    let begun = watcher.elapsed();
    let mut widenings = Vec::new();
    let mut history = History {
        subject,
        watcher,
        started: begun,
        envelope: DecoupledEnvelope::point(&subject.plan.nominal()),
        widenings: &mut widenings,
        steps: 0,
        best_steps: 0,
        checks: 0,
        stop_request: None,
    };
    let world = subject.request.world.as_ref();
    let grown = grow(
        &mut oracle,
        (how, subject.request.method()),
        world,
        &mut |step| history.step(step),
    )?;
    let mut stop = match (grown.stop, history.stop_request) {
        (_, Some(halt)) => Stop::from(halt),
        (StopReason::CheckLimit, None) => Stop::CheckLimit,
        (StopReason::Undecided, None) => Stop::Undecided,
        (StopReason::Converged | StopReason::Cancelled, None) => Stop::Converged,
    };
    let best = grown
        .best
        .map(|(settings, run)| best(subject, &mut oracle, &settings, run));
    let mut envelope = match grown.envelope {
        Ok(envelope) => envelope,
        Err(objection) => {
            let point = DecoupledEnvelope::point(&subject.plan.nominal());
            let why_not = subject.explainer.objection(&oracle, &point, &objection);
            subject.reject_unproved_objection("the nominal plan", &why_not)?;
            return Ok(subject.failure_outcome(why_not));
        }
    };
    if how.sharpen && best.is_none() && stop == Stop::Converged {
        let sharp = sharpen(&mut oracle, &envelope, &mut || continue_or_stop(watcher));
        let sharp = Refusal::unless_interrupted(sharp).map_err(PipelineError::Refused)?;
        if let Some(sharp) = sharp.flatten() {
            envelope = sharp;
        }
        if let ControlFlow::Break(halt) = watcher.flow() {
            stop = halt.into();
        }
    }
    let seconds = watcher.elapsed().saturating_sub(begun).as_secs_f64();
    let checks = oracle.checks();
    let balance = uniform_slack(oracle.clone(), watcher);
    let conditions = Conditions::new(oracle.conditions(), subject.enforced);
    let limits = limits_of_ends(subject, &mut oracle, &envelope, watcher);
    let foresight = match stop {
        Stop::Converged => value_of_information(subject, &mut oracle, &envelope, watcher)?,
        _ => None,
    };
    let mut outcome = subject.outcome(EnvelopeFinding::Envelope {
        parameters: subject.limited_ranges(&envelope, limits),
        chosen: subject.chosen(),
        stop,
        checks,
        seconds,
        widenings,
        balance,
        best,
        conditions,
        foresight,
        timeline: Timeline::of(&subject.request.task, subject.plan, &envelope),
        inequalities: Inequalities::of(&subject.explainer),
        makespans: Makespans::of(subject.plan, &envelope),
    });
    outcome.envelope = Some(envelope);
    Ok(outcome)
}

/// Returns the watcher's decision to continue or stop, without the reason.
pub(super) fn continue_or_stop(watcher: &mut dyn Observer) -> ControlFlow<()> {
    match watcher.flow() {
        ControlFlow::Continue(()) => ControlFlow::Continue(()),
        ControlFlow::Break(_) => ControlFlow::Break(()),
    }
}

/// Records the widenings, and notifies the watcher.
struct History<'a> {
    subject: &'a Subject<'a>,
    watcher: &'a mut dyn Observer,
    started: Duration,
    /// The box so far.
    envelope: DecoupledEnvelope,
    widenings: &'a mut Vec<WideningStep>,
    /// The number of steps that IRR has tried.
    steps: usize,
    /// The number of steps of the search for the best box.
    best_steps: usize,
    /// The number of boxes checked when the box grew last.
    checks: usize,
    /// The watcher's reason to stop.
    stop_request: Option<StopRequest>,
}

impl History<'_> {
    fn step(&mut self, step: &Step<'_>) -> ControlFlow<()> {
        match step {
            Step::Irr(widening) => self.record_widening(*widening),
            Step::Best(step) => {
                self.best_steps += 1;
                self.watcher.notice(&Event::Envelope(EnvelopeProgress {
                    plan: self.subject.plan,
                    envelope: step.envelope,
                    widenings: self.best_steps,
                    checks: step.checks,
                    steps: self.best_steps,
                }));
            }
        }
        match self.watcher.flow() {
            ControlFlow::Continue(()) => ControlFlow::Continue(()),
            ControlFlow::Break(halt) => {
                self.stop_request = Some(halt);
                ControlFlow::Break(())
            }
        }
    }

    fn record_widening(&mut self, widening: Option<&Widening<'_>>) {
        self.steps += 1;
        if let Some(widening) = widening {
            let seconds = self.watcher.elapsed().saturating_sub(self.started);
            let plan = self.subject.plan;
            self.widenings
                .push(WideningStep::of(plan, widening, seconds.as_secs_f64()));
            self.envelope.clone_from(widening.envelope);
            self.checks = widening.checks;
        }
        self.watcher.notice(&Event::Envelope(EnvelopeProgress {
            plan: self.subject.plan,
            envelope: &self.envelope,
            widenings: self.widenings.len(),
            checks: self.checks,
            steps: self.steps,
        }));
    }
}
