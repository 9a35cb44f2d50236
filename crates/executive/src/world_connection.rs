//! Connection of a run to its world: a child process, or an object in this process.

use std::sync::Arc;

use elbowroom::execute::RunSpec;
use elbowroom::execution::{Command, Observation, TimeAdvance, World, WorldError};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::num::work::Stop;

use crate::belief_updates::BeliefUpdates;
use crate::embedded_world::EmbeddedWorld;
use crate::error::{Error, WarningSink};
use crate::process_world::{ProcessLimits, ProcessWorld};
use crate::request_queue::RequestQueue;
use crate::running_actions::RunningActions;

/// Arguments for a connection to the world.
pub(crate) struct Launch<'a> {
    pub(crate) source: WorldSource<'a>,
    pub(crate) task: &'a Arc<Task>,
    pub(crate) limits: ProcessLimits,
    pub(crate) stop: Stop,
    pub(crate) warnings: WarningSink,
    /// Queue that reports restarts of the world to operators.
    pub(crate) queue: Option<RequestQueue>,
}

/// Source of a world.
pub(crate) enum WorldSource<'a> {
    /// Command line of a program.
    Program(String),
    /// World in this process, until it is connected.
    Embedded(Option<&'a mut dyn EmbeddedWorld>),
}

impl<'a> WorldSource<'a> {
    /// Returns the source of a specification whose world is a process or in this process.
    ///
    /// # Errors
    /// When `embedded` is missing, or given for a world of another kind.
    pub(crate) fn of(
        spec: &RunSpec,
        embedded: Option<&'a mut dyn EmbeddedWorld>,
    ) -> Result<Self, Error> {
        let name = spec.world_process.as_deref().unwrap_or_default();
        match (embedded, spec.is_world_embedded) {
            (Some(world), true) => Ok(Self::Embedded(Some(world))),
            (None, false) => Ok(Self::Program(name.to_owned())),
            (None, true) => Err(Error::new(
                format!("the world of this run, `{name}`, is an object in the executive's process"),
                "resume the run with the program that has started it, and pass the world",
            )),
            (Some(_), false) => Err(Error::new(
                "the world of this run is not an object in the executive's process",
                "leave out the world",
            )),
        }
    }
}

/// World that receives commands.
pub(crate) enum WorldConnection<'a> {
    /// Child process.
    Process(Box<ProcessWorld>),
    /// World in this process.
    Embedded(&'a mut dyn EmbeddedWorld),
}

impl<'a> WorldConnection<'a> {
    /// Connects a new run to its world. A program is started.
    pub(crate) fn start(launch: &mut Launch<'a>, beliefs: &BeliefUpdates) -> Result<Self, Error> {
        Self::connect(launch, beliefs, |launch, command| {
            let limits = launch.limits.clone();
            ProcessWorld::start(command, launch.task, limits, launch.stop.clone())
        })
    }

    /// Connects a resumed run to its world. A program is started, and receives the actions that are `running`.
    pub(crate) fn resume(
        launch: &mut Launch<'a>,
        beliefs: &BeliefUpdates,
        running: &RunningActions,
        now: &Rational,
    ) -> Result<Self, Error> {
        Self::connect(launch, beliefs, |launch, command| {
            let limits = launch.limits.clone();
            let resumed = (&running.message(now), running.next_ticket());
            ProcessWorld::resume(command, launch.task, limits, launch.stop.clone(), resumed)
        })
    }

    fn connect(
        launch: &mut Launch<'a>,
        beliefs: &BeliefUpdates,
        start: impl FnOnce(&Launch<'_>, &str) -> Result<ProcessWorld, Error>,
    ) -> Result<Self, Error> {
        match &mut launch.source {
            WorldSource::Embedded(world) => {
                let gone = || Error::new("the world has failed", "");
                world.take().map(Self::Embedded).ok_or_else(gone)
            }
            WorldSource::Program(command) => {
                let command = command.clone();
                let world = start(launch, &command)?.with_beliefs(beliefs.clone());
                Ok(Self::Process(Box::new(world)))
            }
        }
    }

    /// Requests the outcome of actions that were running at `now`, before the world was connected. Returns the answer,
    /// and `true` if the world resumes runs.
    pub(crate) fn recall(
        &mut self,
        running: &RunningActions,
        now: &Rational,
    ) -> Result<(TimeAdvance, bool), WorldError> {
        match self {
            Self::Process(world) => world.recall(&running.tickets()),
            Self::Embedded(world) => match world.recall(now, &running.actions())? {
                Some(passage) => Ok((passage, true)),
                // A wait that ends at once returns the time of the new clock.
                None => Ok((world.wait(&Rational::ZERO)?, false)),
            },
        }
    }

    /// Returns `true` for a child process.
    pub(crate) fn is_program(&self) -> bool {
        matches!(self, Self::Process(_))
    }

    /// Stops a program. A world in this process is stopped by its owner.
    pub(crate) fn stop(self) {
        match self {
            Self::Process(world) => world.stop(),
            Self::Embedded(_) => {}
        }
    }
}

impl World for WorldConnection<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        match self {
            Self::Process(world) => world.command(now, command),
            Self::Embedded(world) => world.command(now, command),
        }
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        match self {
            Self::Process(world) => world.wait(until),
            Self::Embedded(world) => world.wait(until),
        }
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        match self {
            Self::Process(world) => world.look(facts, fluents),
            Self::Embedded(world) => world.look(facts, fluents),
        }
    }
}
