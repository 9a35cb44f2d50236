//! What drives a run: its questions to the world, and the answers.

use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_num::Rational;

use super::agenda::Todo;
use super::{Report, Run, Stop, Verdict};
use crate::event::{Command, Observation};
use crate::reason::{About, Cause, Reason};
use crate::record::Entry;
use crate::world::{Passage, World, WorldError};

/// The next request of a run to its driver.
#[derive(Clone, Debug, PartialEq)]
pub enum Next {
    /// To be given this command; then [`Run::next`] again.
    Command(Command),
    /// Time, until something is observed, but not beyond `until`; then [`Run::observe`].
    Wait {
        /// By the world's clock.
        until: Rational,
    },
    /// The world is to look at these, if it can; then [`Run::see`].
    Look {
        /// Facts.
        facts: Vec<FactId>,
        /// Fluents.
        fluents: Vec<FluentId>,
    },
    /// Nothing: the run is over.
    Over(Report),
}

/// The run has not asked for that: [`Run::observe`] answers [`Next::Wait`], and [`Run::see`]
/// answers [`Next::Look`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the run has not asked for {what}; ask `Run::next` what it needs first")]
pub struct NotAsked {
    what: &'static str,
}

impl Run<'_> {
    /// The whole run in a world that blocks.
    pub fn go(mut self, world: &mut dyn World) -> Report {
        loop {
            let answered = match self.next() {
                Next::Command(command) => world.command(&self.now, &command),
                Next::Wait { until } => {
                    let passage = world.wait(&until);
                    passage.map(|passage| self.take_passage(passage))
                }
                Next::Look { facts, fluents } => {
                    let seen = world.look(&facts, &fluents);
                    seen.map(|seen| self.take_look(seen))
                }
                Next::Over(report) => {
                    if !self.reopen() {
                        return report;
                    }
                    Ok(())
                }
            };
            if let Err(error) = answered {
                self.fail(error);
            }
        }
    }

    /// What the run needs of the world next. As long as a question is open, it is asked again.
    ///
    /// Plans are made and made ready in here, so that this can take as long as the planner, but for those
    /// that are made beside the run ([`RunSettings::plans_aside`](super::RunSettings::plans_aside)).
    #[expect(
        clippy::should_implement_trait,
        reason = "a run is no iterator: what comes next depends on the answers"
    )]
    pub fn next(&mut self) -> Next {
        loop {
            if let Some(report) = &self.report {
                return Next::Over(report.clone());
            }
            if let Some(asked) = &self.asked {
                return asked.clone();
            }
            let todo = self.agenda.pop().unwrap_or(Todo::Decide);
            match self.perform(todo) {
                Ok(Some(command)) => return Next::Command(command),
                Ok(None) => {}
                Err(stop) => self.stop(stop),
            }
        }
    }

    /// Time has passed, as [`Next::Wait`] has asked: until something was observed, or to its end.
    ///
    /// # Errors
    /// When the run has not asked for it; then nothing is made of it.
    pub fn observe(&mut self, passage: Passage) -> Result<(), NotAsked> {
        if !matches!(self.asked, Some(Next::Wait { .. })) {
            let what = "time to pass";
            return Err(NotAsked { what });
        }
        self.take_passage(passage);
        Ok(())
    }

    /// What was seen of that which [`Next::Look`] has asked for; nothing, if the world cannot look.
    ///
    /// # Errors
    /// When the run has not asked for it; then nothing is made of it.
    pub fn see(&mut self, observations: Vec<Observation>) -> Result<(), NotAsked> {
        if !matches!(self.asked, Some(Next::Look { .. })) {
            let what = "a look";
            return Err(NotAsked { what });
        }
        self.take_look(observations);
        Ok(())
    }

    /// The world has failed, and is asked nothing more.
    pub fn fail(&mut self, error: WorldError) {
        self.asked = None;
        if self.report.is_none() {
            self.stop(Stop::World(error));
        }
    }

    /// The present time, by the world's clock.
    pub fn now(&self) -> &Rational {
        &self.now
    }

    /// Takes in an answer of the world to [`Next::Wait`].
    fn take_passage(&mut self, passage: Passage) {
        let Some(Next::Wait { until }) = self.asked.take() else {
            return;
        };
        self.ports.recorder.record(&Entry::Passed {
            until: &until,
            now: &passage.now,
            observations: &passage.observations,
        });
        self.now = passage.now.max(self.now.clone());
        self.take_in(passage.observations);
        self.forget_the_past();
        if let Err(stop) = self.after_passage() {
            self.stop(stop);
        }
    }

    /// The consequences of time having passed, whatever was observed.
    fn after_passage(&mut self) -> Result<(), Stop> {
        if self.closing.is_some() {
            self.go_on_closing();
            return Ok(());
        }
        self.heed()?;
        if self.now >= self.settings.time_limit {
            return Err(Stop::Over(Verdict::TimeLimit));
        }
        let moves_on = self.progress.note(&self.now, self.steps);
        moves_on.map_err(|why| Stop::World(WorldError::new(why)))
    }

    /// Takes in an answer of the world to [`Next::Look`].
    fn take_look(&mut self, observations: Vec<Observation>) {
        self.asked = None;
        self.ports.recorder.record(&Entry::Looked {
            now: &self.now,
            observations: &observations,
        });
        self.take_in(observations);
        if let Err(stop) = self.after_look() {
            self.stop(stop);
        }
    }

    fn after_look(&mut self) -> Result<(), Stop> {
        self.heed()?;
        if self.is_to_turn() {
            return Ok(());
        }
        if self.is_goal_certain() {
            return Err(Stop::Over(Verdict::GoalReached));
        }
        self.news.clear();
        self.replan(&Reason::new(Cause::Surprise).about(About::SeenAtTheEnd))
    }
}
