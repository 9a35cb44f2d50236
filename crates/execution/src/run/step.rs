//! Interface to the driver: the requests of a run, and the answers.

use elbowroom_num::{Rational, work};

use super::agenda::Next;
use super::settings::{Report, Verdict};
use super::{Run, Stop};
use crate::event::Observation;
use crate::reason::{Cause, Reason, Subject};
use crate::record::Entry;
use crate::request::Workers;
use crate::world::{TimeAdvance, World, WorldError};

/// Work units of each decision.
const DECISION_WORK: u64 = 5_000;

/// Number of ended starts that an executive keeps, for late reports and for its report.
const MAX_STARTS: usize = 2000;

/// Error: the answer was not requested. [`Run::observe`] answers [`Next::Wait`], and [`Run::observe_requested`]
/// answers [`Next::Look`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the run has not requested {what}; call `Run::next` first")]
pub struct UnexpectedAnswer {
    what: &'static str,
}

impl Run<'_> {
    /// Executes the whole run in a blocking world, with workers that plan and prepare.
    pub fn run_to_end(mut self, world: &mut dyn World, workers: &mut dyn Workers) -> Report {
        loop {
            let answered = match self.next() {
                Next::Command(command) => world.command(&self.now, &command),
                Next::Wait { until } => {
                    let passage = workers.wait(world, &until);
                    for answer in workers.answers() {
                        self.answer(answer);
                    }
                    passage.map(|passage| self.process_time_advance(passage))
                }
                Next::Look { facts, fluents } => {
                    let seen = world.look(&facts, &fluents);
                    seen.map(|seen| self.process_look(seen))
                }
                Next::Over(report) => {
                    if !self.reopen() {
                        return report;
                    }
                    Ok(())
                }
                request => {
                    self.delegate(request, workers);
                    Ok(())
                }
            };
            if let Err(error) = answered {
                self.fail(error);
            }
        }
    }

    /// Lets the workers answer a request for a plan or a prepared plan, or abandon it. Requests to
    /// the world are ignored.
    pub fn delegate(&mut self, request: Next, workers: &mut dyn Workers) {
        match request {
            Next::Plan(request) => {
                if let Some(planned) = workers.plan(&request) {
                    self.planned(request.id, planned);
                }
            }
            Next::Prepare(request) => {
                if let Some(prepared) = workers.prepare(&request) {
                    self.prepared(request.id, prepared);
                }
            }
            Next::Abandon(id) => workers.abandon(id),
            Next::Command(_) | Next::Wait { .. } | Next::Look { .. } | Next::Over(_) => {}
        }
    }

    /// Returns the next request to the driver. A question that the run waits for is repeated until
    /// it is answered.
    #[expect(
        clippy::should_implement_trait,
        reason = "a run is no iterator: the next request depends on the answers"
    )]
    pub fn next(&mut self) -> Next {
        loop {
            if let Some(request) = self.agenda.pop_request() {
                return request;
            }
            if let Some(report) = self.closing.report() {
                return Next::Over(report.clone());
            }
            if let Some(question) = self.agenda.question().cloned() {
                if matches!(question, Next::Plan(_) | Next::Prepare(_))
                    && let Err(stop) = self.check_stop_request()
                {
                    self.begin_shutdown(stop);
                    continue;
                }
                return question;
            }
            work::spend(DECISION_WORK);
            let next = self.agenda.pop();
            match self.perform(next) {
                Ok(Some(command)) => return Next::Command(command),
                Ok(None) => {}
                Err(stop) => self.begin_shutdown(stop),
            }
        }
    }

    /// Takes the answer to [`Next::Wait`].
    ///
    /// # Errors
    /// If the run has not requested it. It is ignored then.
    pub fn observe(&mut self, passage: TimeAdvance) -> Result<(), UnexpectedAnswer> {
        if !self.agenda.is_waiting() {
            let what = "time to pass";
            return Err(UnexpectedAnswer { what });
        }
        self.process_time_advance(passage);
        Ok(())
    }

    /// Takes the observations that [`Next::Look`] has requested; none if the world cannot look.
    ///
    /// # Errors
    /// If the run has not requested them. They are ignored then.
    pub fn observe_requested(
        &mut self,
        observations: Vec<Observation>,
    ) -> Result<(), UnexpectedAnswer> {
        if !matches!(self.agenda.question(), Some(Next::Look { .. })) {
            let what = "a look";
            return Err(UnexpectedAnswer { what });
        }
        self.process_look(observations);
        Ok(())
    }

    /// Records that the world has failed. The run does not ask it anything more.
    pub fn fail(&mut self, error: WorldError) {
        self.agenda.close_question();
        if self.closing.report().is_none() {
            self.begin_shutdown(Stop::WorldFailed(error));
        }
    }

    /// Returns the present time, on the world's clock.
    pub fn now(&self) -> &Rational {
        &self.now
    }

    /// Processes the world's answer to [`Next::Wait`].
    fn process_time_advance(&mut self, mut passage: TimeAdvance) {
        let Some(Next::Wait { until }) = self.agenda.take_question() else {
            return;
        };
        if is_equal_up_to_rounding(&passage.now, &until) {
            passage.now.clone_from(&until);
        }
        passage
            .observations
            .extend(self.background.arrived_answers(&passage.now));
        self.ports.recorder.record(&Entry::Passed {
            until: &until,
            now: &passage.now,
            observations: &passage.observations,
        });
        self.now = passage.now.max(self.now.clone());
        self.process_reports(passage.observations);
        self.prune_history();
        if let Err(stop) = self.finish_time_advance() {
            self.begin_shutdown(stop);
        }
    }

    /// Forgets the distant past of an executive, so that its memory does not grow with the length
    /// of the run.
    fn prune_history(&mut self) {
        if self.goals.is_executive() {
            let log = &self.action_log;
            self.history.prune(&self.belief, log, &self.now);
            self.replans.prune();
            self.action_log.forget_earliest(MAX_STARTS);
        }
    }

    /// Processes the passage of time, apart from the observations.
    fn finish_time_advance(&mut self) -> Result<(), Stop> {
        if self.closing.is_shutting_down() {
            self.continue_shutdown();
            return Ok(());
        }
        self.check_stop_request()?;
        if self.now >= self.settings.time_limit {
            return Err(Stop::Ended(Verdict::TimeLimit));
        }
        let moves_on = self.clock_watchdog.count_answer(&self.now, self.steps);
        moves_on.map_err(|why| Stop::WorldFailed(WorldError::new(why)))
    }

    /// Processes the world's answer to [`Next::Look`].
    fn process_look(&mut self, observations: Vec<Observation>) {
        self.agenda.take_question();
        self.ports.recorder.record(&Entry::Looked {
            now: &self.now,
            observations: &observations,
        });
        self.process_reports(observations);
        if let Err(stop) = self.finish_look() {
            self.begin_shutdown(stop);
        }
    }

    fn finish_look(&mut self) -> Result<(), Stop> {
        self.check_stop_request()?;
        if self.search_results.end_inquiry() {
            return Ok(());
        }
        if self.goals.is_change_pending() {
            return Ok(());
        }
        if self.is_goal_certain() {
            return Err(Stop::Ended(Verdict::GoalReached));
        }
        self.plan_events.clear();
        self.replan(&Reason::new(Cause::Surprise).about(Subject::GoalObservation))
    }
}

/// Returns `true` if a time is less than another one, but equal up to the rounding of a world that
/// computes with doubles. If it counted as less, such a world could be asked for the same time
/// forever.
fn is_equal_up_to_rounding(time: &Rational, exact: &Rational) -> bool {
    let least_distinct = exact * &Rational::new(1, 1 << 50);
    time < exact && exact - time <= least_distinct
}
