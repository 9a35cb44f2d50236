//! The world that the executor believes, and its effects on plans.

use std::sync::Arc;

use elbowroom_model::{Problem, Task};
use elbowroom_sim::WorldModel;
use elbowroom_text::{Diagnostic, Diagnostics, Source};

use super::{EMBEDDED, FirstPlan, RunSpec, SpecError};

impl RunSpec {
    /// Returns the world file that the executor believes: [`Self::believed`], or that of the simulation.
    pub fn believed_world(&self) -> Option<&str> {
        let simulated = self.world.as_ref().filter(|_| self.world_process.is_none());
        self.believed.as_ref().or(simulated).map(String::as_str)
    }

    /// Returns the model of the world that the executor believes: that of [`Self::believed_world`],
    /// or, in a simulation without one, a model where everything goes as planned. `None` if the
    /// world is a process without a believed world.
    ///
    /// # Errors
    /// When the world file cannot be read.
    pub(super) fn beliefs(
        &self,
        problem: &Problem,
        name: &str,
    ) -> Result<Option<WorldModel>, Diagnostics> {
        match self.believed_world() {
            Some(text) => read_world(name, text, problem).map(Some),
            None if self.world_process.is_some() => Ok(None),
            None => Ok(Some(WorldModel::without_deviations())),
        }
    }

    /// Returns the model of the simulated world; `None` if the world is a process.
    ///
    /// # Errors
    /// When the world file cannot be read.
    pub(super) fn simulation(
        &self,
        problem: &Problem,
        name: &str,
    ) -> Result<Option<WorldModel>, Diagnostics> {
        match &self.world {
            _ if self.world_process.is_some() => Ok(None),
            Some(text) => read_world(name, text, problem).map(Some),
            None => Ok(Some(WorldModel::without_deviations())),
        }
    }

    /// Returns the default criterion for a first plan: its probability, if the embedded planner
    /// makes it and there is a model of the world or of likelihoods; otherwise, its makespan or
    /// metric.
    pub fn usual_first_plan(&self) -> FirstPlan {
        let is_known = self.believed_world().is_some() || self.likelihoods.is_some();
        let is_embedded = self.planner.eq_ignore_ascii_case(EMBEDDED);
        if is_known && is_embedded && !self.has_plan && !self.is_persistent {
            FirstPlan::Likeliest
        } else {
            FirstPlan::Shortest
        }
    }

    /// Returns the usual value of [`Self::plans_believed_durations`]: `true` if a world is believed that was not taken
    /// from the simulation, and the embedded planner makes all plans. A given plan, and the plans of other planners,
    /// have the durations of the domain.
    pub fn usual_durations(&self) -> bool {
        self.believed.is_some() && !self.has_plan && self.planner.eq_ignore_ascii_case(EMBEDDED)
    }

    /// Reads the problem, with the durations of the domain. Returns it with the warnings.
    ///
    /// # Errors
    /// When the problem cannot be read.
    pub fn read_task(&self) -> Result<(Task, Vec<Diagnostic>), Diagnostics> {
        let read = elbowroom_pddl::read_problem(&self.domain.source(), &self.problem.source());
        let (problem, warnings) = read?;
        Ok((
            Task::new(problem).with_epsilon(self.epsilon.clone()),
            warnings,
        ))
    }

    /// Returns the task with the durations of plans, and the believed world for plans with these durations. They are
    /// those of the domain, or with [`Self::plans_believed_durations`] the means of the believed world. All parts of a
    /// run use this task; only commands to the world, and the validator, use the durations of the domain.
    pub(super) fn with_durations(
        &self,
        task: Arc<Task>,
        beliefs: Option<WorldModel>,
    ) -> (Arc<Task>, Option<WorldModel>) {
        match beliefs {
            Some(world) if self.plans_believed_durations => (
                Arc::new(task.with_expected_durations(world.expected_durations(task.epsilon()))),
                Some(world.around_expected_durations()),
            ),
            beliefs => (task, beliefs),
        }
    }

    /// Checks that believed durations can be used.
    pub(super) fn check_durations(&self) -> Result<(), SpecError> {
        if self.plans_believed_durations && !self.usual_durations() {
            return Err(SpecError::BelievedDurations);
        }
        Ok(())
    }
}

fn read_world(name: &str, text: &str, problem: &Problem) -> Result<WorldModel, Diagnostics> {
    WorldModel::read(Source::new(name, text), problem)
}
