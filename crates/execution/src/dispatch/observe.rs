//! Observations: fixes executed time points in the network and detects violations.

use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, network_node};
use elbowroom_stn::WindowEnd;

use super::projection;
use super::{Dispatch, explain};
use crate::event::Ending;
use crate::executor::{DecisionContext, PlanEvent, StepId};
use crate::reason::{Cause, Evidence, Reason, Subject};
use crate::window_propagation::{Missed, WindowPropagation};

impl Dispatch {
    /// Processes the news. Returns the first one that makes the plan infeasible, if any.
    pub(crate) fn process_news(&mut self, moment: &DecisionContext<'_>) -> Option<Box<Reason>> {
        let mut trouble = None;
        let mut is_surprised = None;
        for news in moment.plan_events {
            let new = match news {
                PlanEvent::Started { step, time, .. } => self.process_start(step.instance(), time),
                PlanEvent::Ended {
                    step, time, ending, ..
                } => self.process_end(step.instance(), time, ending),
                PlanEvent::Fact(fact) => {
                    is_surprised = Some(moment.belief.task().fact_name(*fact));
                    None
                }
                PlanEvent::Value(fluent) => {
                    is_surprised = Some(moment.belief.task().fluent_name(*fluent));
                    None
                }
                PlanEvent::Contradiction { action } => {
                    Some(Reason::new(Cause::Contradiction).for_action(action))
                }
                PlanEvent::TimedOut { action, since } => Some(
                    Reason::new(Cause::Silence)
                        .for_action(action)
                        .since(since.clone()),
                ),
            };
            trouble = trouble.or(new);
        }
        let surprise = is_surprised.filter(|_| trouble.is_none());
        trouble
            .or_else(|| surprise.and_then(|what| self.unexpected_failure(moment, &what)))
            .map(Box::new)
    }

    /// Returns the reason if the remaining plan fails in the current belief state when it is
    /// executed nominally. `what` is the unexpected fact or value.
    pub(crate) fn unexpected_failure(
        &self,
        moment: &DecisionContext<'_>,
        what: &str,
    ) -> Option<Reason> {
        let failure = projection::simulate_remaining_plan(self, moment)?;
        let mut reason =
            Reason::new(Cause::Surprise).about(Subject::ObservedValue(what.to_owned()));
        reason.action = failure.action;
        reason.evidence = vec![Evidence::Condition(failure.condition)];
        reason.since = Some(moment.now.clone());
        Some(reason)
    }

    fn process_start(&mut self, id: InstanceId, time: &Rational) -> Option<Reason> {
        let [start, end] = self.ends[id.index()];
        let local = self.to_plan_time(time);
        let fixed = self.horizon.fix(network_node(start), &local);
        self.progress.record_execution(&self.plan, start, &local);
        self.progress.ready.remove(&start);
        self.retries.remove(&start);
        self.commanded_unstarted.remove(&id);
        if start == end {
            self.finish(id);
        } else if self.execution_time(end).is_none() {
            // Includes actions that began before the plan was adopted.
            self.progress.running.insert(id);
        }
        let missed = fixed.err()?;
        self.bound_violations.record_violation(start, &missed);
        let name = self.action(id).name.clone();
        let mut reason = Reason::new(Cause::Unreachable).about(Subject::Start(name.clone()));
        reason.action = Some(name);
        reason.observed = Some(time.clone());
        reason.evidence = self.window_evidence(start, missed.end);
        reason.since = Some(time.clone());
        reason.by = Some(missed.by);
        Some(reason)
    }

    fn process_end(&mut self, id: InstanceId, time: &Rational, ending: &Ending) -> Option<Reason> {
        let [start, end] = self.ends[id.index()];
        let name = self.action(id).name.clone();
        let local = self.to_plan_time(time);
        if let Some(separation) = &mut self.separation {
            let succeeded = *ending == Ending::Succeeded;
            separation.end(StepId::from(id).0, succeeded, &local);
        }
        match ending {
            Ending::Succeeded => {}
            Ending::Failed { why } => {
                self.finish(id);
                let reason = Reason::new(Cause::Failed)
                    .for_action(&name)
                    .about(Subject::ExternalMessage(why.clone()));
                return Some(reason.since(time.clone()));
            }
            Ending::Cancelled => {
                self.finish(id);
                let reason = Reason::new(Cause::Failed)
                    .for_action(&name)
                    .about(Subject::Cancelled);
                return Some(reason.since(time.clone()));
            }
        }
        if let Some(told) = self.commanded_unstarted.remove(&id)
            && let WindowPropagation::Dispatchable(_) = self.horizon
        {
            // Its start was not reported, so the time of the command is used.
            if let Err(missed) = self.horizon.fix(network_node(start), &told) {
                self.bound_violations.record_violation(start, &missed);
            }
            self.progress.record_execution(&self.plan, start, &told);
        }
        let is_own = |end| self.is_limited_by_duration(id, end);
        let (is_own_lower, is_own_upper) = (is_own(WindowEnd::Earliest), is_own(WindowEnd::Latest));
        let fixed = self.horizon.fix(network_node(end), &local);
        self.progress.record_execution(&self.plan, end, &local);
        self.finish(id);
        let missed = fixed.err()?;
        self.bound_violations.record_violation(end, &missed);
        let duration = self.execution_time(start).map(|start| &local - start);
        let is_own = match missed.end {
            WindowEnd::Earliest => is_own_lower,
            WindowEnd::Latest => is_own_upper,
        };
        Some(self.missed_end_reason(id, time, duration, is_own, missed))
    }

    fn missed_end_reason(
        &self,
        id: InstanceId,
        time: &Rational,
        duration: Option<Rational>,
        is_own: bool,
        missed: Missed,
    ) -> Reason {
        let name = self.action(id).name.clone();
        let mut reason = if is_own {
            let about = self.duration_subject(id);
            let mut reason = Reason::new(Cause::OutsideInterval).about(about);
            reason.observed = duration;
            reason.allowed = Some(explain::interval(&self.durations[id.index()]));
            reason
        } else {
            let mut reason = Reason::new(Cause::Unreachable).about(Subject::End(name.clone()));
            reason.observed = Some(time.clone());
            reason
        };
        reason.action = Some(name);
        reason.evidence = self.window_evidence(self.ends[id.index()][1], missed.end);
        reason.since = Some(match missed.end {
            WindowEnd::Earliest => time.clone(),
            WindowEnd::Latest => time - &missed.by,
        });
        reason.by = Some(missed.by);
        reason
    }

    /// Records the start of an action, whether in time or not.
    pub(crate) fn note_start(&mut self, id: InstanceId, time: &Rational) {
        let _ = self.process_start(id, time);
    }

    /// Records the successful end of an action, whether in time or not.
    pub(crate) fn note_end(&mut self, id: InstanceId, time: &Rational) {
        let _ = self.process_end(id, time, &Ending::Succeeded);
    }

    fn finish(&mut self, id: InstanceId) {
        self.progress.running.remove(&id);
        self.progress.remaining = self.progress.remaining.saturating_sub(1);
    }
}
