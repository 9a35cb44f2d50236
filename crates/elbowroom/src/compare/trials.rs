//! The trials of one problem in one column.

use std::sync::Arc;

use elbowroom_execution::executors::ExecutorSpec;
use elbowroom_execution::run::{self, Ports, Report, Verdict};
use elbowroom_execution::{NoRecord, PlanAnswer, Planner, World};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_pddl::Source;
use elbowroom_planner::embedded;
use elbowroom_sim::{SimWorld, Unreliable, WorldModel};

use super::{Experiment, ExperimentError, Part, Results, clairvoyant};
use crate::execute::{Analyst, Embedded, WholeRegion};
use crate::flow;

/// One problem in one column.
pub(super) struct Setting<'a> {
    pub(super) experiment: &'a Experiment,
    pub(super) column: usize,
    pub(super) problem: usize,
    pub(super) filling: &'a [(String, String)],
}

/// An executor with what it knows of the first plan.
struct Contestant<'a> {
    spec: &'a ExecutorSpec,
    analyst: Analyst,
}

impl Setting<'_> {
    /// Makes the trials of a part. `tell` is called after each, and says whether to go on.
    pub(super) fn run(
        &self,
        part: Part,
        tell: &(dyn Fn() -> bool + Sync),
    ) -> Result<Results, ExperimentError> {
        let experiment = self.experiment;
        let mut task = self.task()?;
        let column = &experiment.columns[self.column];
        let world = WorldModel::read(&column.world, task.problem()).map_err(|error| {
            ExperimentError::other(format!("the world of {}: {error}", column.name))
        })?;
        let situation = Situation::initial(&task);
        let first = match self.planner().plan(&mut task, &situation).answer {
            PlanAnswer::Plan(plan) => plan,
            PlanAnswer::Unsolvable => {
                return Err(self.wrong("no plan exists, so there is nothing to execute"));
            }
            PlanAnswer::NotFound { why } => return Err(self.wrong(&why)),
        };
        let task = Arc::new(task);
        let mut contestants = Vec::new();
        for spec in &experiment.executors {
            let mut analyst = Analyst::new(self.flow());
            analyst
                .remember(&task, &first, spec.registered.need)
                .map_err(|why| self.wrong(&why))?;
            contestants.push(Contestant { spec, analyst });
        }
        let mut results = Results::empty(experiment, part);
        for trial in part.numbers() {
            self.trial(trial, &task, &first, &world, &mut contestants, &mut results);
            if !tell() {
                break;
            }
        }
        Ok(results)
    }

    /// Every executor in the same world.
    fn trial(
        &self,
        trial: u64,
        task: &Arc<Task>,
        first: &TimeTriggeredPlan,
        world: &WorldModel,
        contestants: &mut [Contestant<'_>],
        results: &mut Results,
    ) {
        // The same seed in all columns: their worlds differ only where the columns do.
        let seed = self
            .experiment
            .seed
            .wrapping_mul(1_000_003)
            .wrapping_add(self.problem as u64)
            .wrapping_mul(1_000_003)
            .wrapping_add(trial);
        let mut reached = Vec::with_capacity(contestants.len() + 1);
        for (row, contestant) in contestants.iter_mut().enumerate() {
            let report = self.execute(seed, task, first, world, contestant);
            reached.push(report.verdict == Verdict::GoalReached);
            self.count(row, &report, results);
        }
        if self.experiment.clairvoyant {
            // What somebody reached without knowing can be reached knowing.
            let is_possible = reached.contains(&true)
                || clairvoyant::can_reach(task, world, seed, &mut self.planner());
            let cell = &mut results.cells[reached.len()][self.column];
            cell.runs += 1;
            cell.successes += u64::from(is_possible);
            reached.push(is_possible);
        }
        for (row, this) in reached.iter().enumerate() {
            let pair = &mut results.pairs[row][self.column];
            pair.only_first += u64::from(reached[0] && !this);
            pair.only_this += u64::from(*this && !reached[0]);
        }
    }

    fn execute(
        &self,
        seed: u64,
        task: &Arc<Task>,
        first: &TimeTriggeredPlan,
        model: &WorldModel,
        contestant: &mut Contestant<'_>,
    ) -> Report {
        let settings = &self.experiment.settings;
        let sim = SimWorld::new(Arc::clone(task), model, seed);
        let (mut plain, mut unreliable);
        let world: &mut dyn World = if model.reports.is_perfect() {
            plain = sim;
            &mut plain
        } else {
            let reports = model.reports.clone();
            unreliable = Unreliable::new(sim, reports, seed, model.resolution.clone());
            &mut unreliable
        };
        let mut executor = contestant.spec.build(Box::new(WholeRegion {
            epsilon: settings.epsilon.clone(),
        }));
        let ports = Ports {
            world,
            planner: &mut self.planner(),
            preparer: &mut contestant.analyst,
            executor: executor.as_mut(),
            need: contestant.spec.registered.need,
            recorder: &mut NoRecord,
        };
        run::run(Arc::clone(task), Some(first), settings, ports)
    }

    fn count(&self, row: usize, report: &Report, results: &mut Results) {
        let cell = &mut results.cells[row][self.column];
        cell.runs += 1;
        *cell
            .verdicts
            .entry(report.verdict.name().to_owned())
            .or_default() += 1;
        for reason in &report.reasons {
            *cell
                .causes
                .entry(reason.cause.name().to_owned())
                .or_default() += 1;
        }
        if report.verdict == Verdict::GoalReached {
            cell.successes += 1;
            cell.replans += report.replans as u64;
        }
    }

    fn planner(&self) -> Embedded<'static> {
        Embedded {
            settings: embedded::Settings {
                epsilon: self.experiment.settings.epsilon.clone(),
                ..embedded::Settings::default()
            },
            most_states: self.experiment.planner_states,
            improve_states: self.experiment.improve_states,
            clock: None,
        }
    }

    fn flow(&self) -> flow::Settings {
        let mut flow = flow::Settings {
            epsilon: self.experiment.settings.epsilon.clone(),
            vary: self.experiment.columns[self.column].vary.clone(),
            ..flow::Settings::default()
        };
        flow.search.precision = self.experiment.precision.clone();
        flow
    }

    /// The problem with its blanks filled in.
    fn task(&self) -> Result<Task, ExperimentError> {
        let mut text = self.experiment.problem.clone();
        for (name, value) in self.filling {
            let blank = format!("{{{name}}}");
            if !text.contains(&blank) {
                return Err(self.wrong(&format!("the problem has no blank {blank}")));
            }
            text = text.replace(&blank, value);
        }
        let domain = Source::new("domain", self.experiment.domain.as_str());
        let problem = Source::new("problem", text.as_str());
        match elbowroom_pddl::read_problem(&domain, &problem) {
            Ok((problem, _)) => Ok(Task::new(problem)),
            Err(diagnostics) => Err(ExperimentError::other(diagnostics.render(false))),
        }
    }

    fn wrong(&self, message: &str) -> ExperimentError {
        let filling = self.filling.iter();
        let filling: Vec<_> = filling
            .map(|(name, value)| format!("{name} = {value}"))
            .collect();
        ExperimentError::other(format!(
            "the problem with {}: {message}",
            filling.join(", ")
        ))
    }
}
