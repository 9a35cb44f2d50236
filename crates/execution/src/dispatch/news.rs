//! Observations: fixes executed time points in the network and detects violations.

use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, network_node};
use elbowroom_stn::WindowEnd;

use super::projection;
use super::{Dispatch, explain};
use crate::event::Ending;
use crate::executor::{Moment, News, StepId};
use crate::horizon::{Horizon, Missed};
use crate::reason::{About, Behind, Cause, Reason};

impl Dispatch {
    /// Processes the news. Returns the first one that makes the plan infeasible, if any.
    pub(crate) fn take(&mut self, moment: &Moment<'_>) -> Option<Box<Reason>> {
        let mut trouble = None;
        let mut is_surprised = None;
        for news in moment.news {
            let new = match news {
                News::Started { step, time, .. } => self.started(step.instance(), time),
                News::Ended {
                    step, time, ending, ..
                } => self.ended(step.instance(), time, ending),
                News::Fact(fact) => {
                    is_surprised = Some(moment.belief.task().fact_name(*fact));
                    None
                }
                News::Value(fluent) => {
                    is_surprised = Some(moment.belief.task().fluent_name(*fluent));
                    None
                }
                News::Contradiction { action } => {
                    Some(Reason::new(Cause::Contradiction).of(action))
                }
                News::Silence { action, since } => {
                    Some(Reason::new(Cause::Silence).of(action).since(since.clone()))
                }
            };
            trouble = trouble.or(new);
        }
        let surprise = is_surprised.filter(|_| trouble.is_none());
        trouble
            .or_else(|| surprise.and_then(|what| self.surprise(moment, &what)))
            .map(Box::new)
    }

    /// Returns the reason if the remaining plan fails in the current belief state when it is
    /// executed nominally. `what` is the unexpected fact or value.
    pub(crate) fn surprise(&self, moment: &Moment<'_>, what: &str) -> Option<Reason> {
        let failure = projection::failure(self, moment)?;
        let mut reason = Reason::new(Cause::Surprise).about(About::Seen(what.to_owned()));
        reason.action = failure.action;
        reason.behind = vec![Behind::Condition(failure.condition)];
        reason.since = Some(moment.now.clone());
        Some(reason)
    }

    fn started(&mut self, id: InstanceId, time: &Rational) -> Option<Reason> {
        let [start, end] = self.ends[id.index()];
        let local = self.local(time);
        let fixed = self.horizon.fix(network_node(start), &local);
        self.progress.happen(&self.plan, start, &local);
        self.progress.ready.remove(&start);
        self.retries.remove(&start);
        self.told.remove(&id);
        if start == end {
            self.finish(id);
        } else if self.happened(end).is_none() {
            // Includes actions that began before the plan was adopted.
            self.progress.running.insert(id);
        }
        let missed = fixed.err()?;
        self.strain.missed(start, &missed);
        let name = self.action(id).name.clone();
        let mut reason = Reason::new(Cause::Unreachable).about(About::Start(name.clone()));
        reason.action = Some(name);
        reason.observed = Some(time.clone());
        reason.behind = self.behind(start, missed.end);
        reason.since = Some(time.clone());
        reason.by = Some(missed.by);
        Some(reason)
    }

    fn ended(&mut self, id: InstanceId, time: &Rational, ending: &Ending) -> Option<Reason> {
        let [start, end] = self.ends[id.index()];
        let name = self.action(id).name.clone();
        let local = self.local(time);
        if let Some(separation) = &mut self.separation {
            let succeeded = *ending == Ending::Succeeded;
            separation.end(StepId::from(id).0, succeeded, &local);
        }
        match ending {
            Ending::Succeeded => {}
            Ending::Failed { why } => {
                self.finish(id);
                let reason = Reason::new(Cause::Failed)
                    .of(&name)
                    .about(About::Said(why.clone()));
                return Some(reason.since(time.clone()));
            }
            Ending::Cancelled => {
                self.finish(id);
                let reason = Reason::new(Cause::Failed).of(&name).about(About::Cancelled);
                return Some(reason.since(time.clone()));
            }
        }
        if let Some(told) = self.told.remove(&id)
            && let Horizon::Dispatchable(_) = self.horizon
        {
            // Its start was not reported, so the time of the command is used.
            if let Err(missed) = self.horizon.fix(network_node(start), &told) {
                self.strain.missed(start, &missed);
            }
            self.progress.happen(&self.plan, start, &told);
        }
        let is_own = |end| self.is_limited_by_duration(id, end);
        let (is_own_lower, is_own_upper) = (is_own(WindowEnd::Earliest), is_own(WindowEnd::Latest));
        let fixed = self.horizon.fix(network_node(end), &local);
        self.progress.happen(&self.plan, end, &local);
        self.finish(id);
        let missed = fixed.err()?;
        self.strain.missed(end, &missed);
        let duration = self.happened(start).map(|start| &local - start);
        let is_own = match missed.end {
            WindowEnd::Earliest => is_own_lower,
            WindowEnd::Latest => is_own_upper,
        };
        Some(self.missed_end(id, time, duration, is_own, missed))
    }

    fn missed_end(
        &self,
        id: InstanceId,
        time: &Rational,
        duration: Option<Rational>,
        is_own: bool,
        missed: Missed,
    ) -> Reason {
        let name = self.action(id).name.clone();
        let mut reason = if is_own {
            let about = self.duration_of(id);
            let mut reason = Reason::new(Cause::OutsideInterval).about(about);
            reason.observed = duration;
            reason.allowed = Some(explain::interval(&self.durations[id.index()]));
            reason
        } else {
            let mut reason = Reason::new(Cause::Unreachable).about(About::End(name.clone()));
            reason.observed = Some(time.clone());
            reason
        };
        reason.action = Some(name);
        reason.behind = self.behind(self.ends[id.index()][1], missed.end);
        reason.since = Some(match missed.end {
            WindowEnd::Earliest => time.clone(),
            WindowEnd::Latest => time - &missed.by,
        });
        reason.by = Some(missed.by);
        reason
    }

    /// Records the start of an action, whether in time or not.
    pub(crate) fn note_start(&mut self, id: InstanceId, time: &Rational) {
        let _ = self.started(id, time);
    }

    /// Records the successful end of an action, whether in time or not.
    pub(crate) fn note_end(&mut self, id: InstanceId, time: &Rational) {
        let _ = self.ended(id, time, &Ending::Succeeded);
    }

    fn finish(&mut self, id: InstanceId) {
        self.progress.running.remove(&id);
        self.progress.left = self.progress.left.saturating_sub(1);
    }
}
