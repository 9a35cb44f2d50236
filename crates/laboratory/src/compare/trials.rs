//! Trials of one problem.

use std::sync::Arc;
use std::time::Duration;

use elbowroom_execution::executors::ExecutorSpec;
use elbowroom_execution::run::{Report, Verdict};
use elbowroom_execution::{NoRecord, PlanAnswer, Planner, Recorder};
use elbowroom_external as external;
use elbowroom_model::{Situation, Task, TimeTriggeredPlan, validate};
use elbowroom_num::Rational;
use elbowroom_pddl::Source;
use elbowroom_planner::embedded;
use elbowroom_report::trace::TraceWriter;
use elbowroom_sim::WorldModel;

use super::scenario::Scenario;
use super::{
    Column, Experiment, ExperimentError, Monitor, Part, Planning, TimedCounts, TrialId,
    clairvoyant, initial_plans,
};
use elbowroom::answers::envelope::Search;
use elbowroom::execute::{
    CachingPlanner, Embedded, Execution, NamedText, RunSpec, SpecError, Validated, planning_work,
};
use elbowroom::{RoundingRule, pipeline};

use crate::record::TrialRecord;

/// Number of plans cached for one problem: some megabytes.
pub(super) const PLAN_CACHE_SIZE: usize = 20_000;

/// Number of prepared plans cached for one problem and column: some megabytes.
pub(super) const PREPARED_CACHE_SIZE: usize = 500;

/// One problem, and some of its trials.
pub(crate) struct Setting<'a> {
    pub(super) experiment: &'a Experiment,
    pub(super) problem: usize,
    pub(super) filling: Vec<(String, String)>,
    /// Trials of the part: every `pieces`-th, from this one on.
    pub(super) piece: usize,
    pub(super) pieces: usize,
    /// Number of threads of the embedded planner.
    pub(super) threads: usize,
}

/// Data shared by all trials of a problem.
struct SharedSetup<'a> {
    task: Arc<Task>,
    planner: CachingPlanner<Box<dyn Planner + 'a>>,
    columns: Vec<Scenario<'a>>,
}

impl Setting<'_> {
    /// Runs the trials of a part.
    pub(super) fn run(
        &self,
        part: Part,
        monitor: &Monitor<'_>,
    ) -> Result<TimedCounts, ExperimentError> {
        let experiment = self.experiment;
        let mut counts = TimedCounts::empty(experiment);
        if !monitor.may_continue() {
            return Ok(counts);
        }
        let may_continue = || monitor.may_continue();
        let mut common = self.common(&may_continue)?;
        // After an interruption, a table or a chosen plan may be missing.
        if !monitor.may_continue() {
            return Ok(counts);
        }
        for place in &common.columns {
            initial_plans::merge(&mut counts.beginnings, &place.first_plan_notes);
        }
        for trial in part.numbers().skip(self.piece).step_by(self.pieces) {
            for column in 0..experiment.columns.len() {
                self.trial((trial, column), &mut common, &mut counts, monitor);
                if !monitor.count_trial() {
                    return Ok(counts);
                }
            }
        }
        Ok(counts)
    }

    /// Reads the problem, computes the first plan, and prepares it for all executors.
    fn common<'a>(
        &self,
        may_continue: &'a (dyn Fn() -> bool + Sync),
    ) -> Result<SharedSetup<'a>, ExperimentError> {
        let (domain, problem) = self.texts()?;
        let task = Self::task(&domain, &problem)?;
        // Checked for all planners, because a plan of another planner could not be executed.
        if let Some(feature) = task.validator_only_feature() {
            return Err(self.error(&SpecError::UnsupportedFeature(feature).to_string()));
        }
        let mut planner = self.planner(domain, problem, may_continue)?;
        let first = match &self.experiment.plan {
            Some(text) => self.read_given_plan(&task, text)?,
            None => match planner.plan(&task, &Situation::initial(&task)).answer {
                PlanAnswer::Plan(plan) => plan,
                PlanAnswer::Unsolvable => {
                    return Err(self.error("no plan exists, so there is nothing to execute"));
                }
                other => return Err(self.error(&reason_with_file_options(&other))),
            },
        };
        let task = Arc::new(task);
        let columns = 0..self.experiment.columns.len();
        let columns =
            columns.map(|column| self.prepare_scenario(column, &task, &first, may_continue));
        Ok(SharedSetup {
            columns: columns.collect::<Result<_, _>>()?,
            planner: CachingPlanner::new(planner, PLAN_CACHE_SIZE),
            task,
        })
    }

    /// Reads the plan that the experiment names.
    fn read_given_plan(
        &self,
        task: &Task,
        text: &str,
    ) -> Result<TimeTriggeredPlan, ExperimentError> {
        let (plan, _) = RoundingRule::default()
            .read_plan(&Source::new("plan", text), task)
            .map_err(ExperimentError::Text)?;
        let verdict = validate::validate(task, &plan, &validate::Settings::default());
        if verdict.is_valid() {
            Ok(plan)
        } else {
            Err(self.error("`plan` is not valid for it; `elbowroom check` explains why"))
        }
    }

    /// Runs every executor in the same world. An interrupted trial does not count.
    fn trial(
        &self,
        (trial, column): (u64, usize),
        common: &mut SharedSetup<'_>,
        counts: &mut TimedCounts,
        monitor: &Monitor<'_>,
    ) {
        let seed = self.seed(trial);
        let executors = &self.experiment.executors;
        let mut reports = Vec::with_capacity(executors.len());
        for (row, spec) in executors.iter().enumerate() {
            // Each trial has its own fact table, so that it does not depend on other trials and
            // threads.
            let task = Arc::new(common.task.with_own_table());
            reports.push(self.execute(&task, seed, (row, spec), column, common, None));
            if !monitor.may_continue() {
                return;
            }
        }
        let mut reached = Vec::with_capacity(executors.len() + 1);
        for (row, (report, invalid)) in reports.into_iter().enumerate() {
            reached.push(report.verdict == Verdict::GoalReached);
            let id = TrialId {
                problem: self.problem,
                trial,
            };
            counts.cells[row][column].count(&report, id);
            counts.cells[row][column].invalid.count(&invalid, id);
            monitor.record(|| self.record((trial, seed), column, row, &report));
        }
        if self.experiment.clairvoyant {
            let world = &common.columns[column].world;
            // A goal that an executor has reached is also reachable with knowledge of the future.
            let is_possible = reached.contains(&true)
                || clairvoyant::can_reach(&common.task, world, seed, &mut self.embedded());
            let cell = &mut counts.cells[reached.len()][column];
            cell.runs += 1;
            cell.successes += u64::from(is_possible);
            reached.push(is_possible);
        }
        for (row, this) in reached.iter().enumerate() {
            let pair = &mut counts.pairs[row][column];
            pair.only_first += u64::from(reached[0] && !this);
            pair.only_this += u64::from(*this && !reached[0]);
        }
    }

    /// Returns the seed of a trial. It is the same in all columns, so their worlds differ only
    /// where the columns differ.
    fn seed(&self, trial: u64) -> u64 {
        self.experiment
            .seed
            .wrapping_mul(1_000_003)
            .wrapping_add(self.problem as u64)
            .wrapping_mul(1_000_003)
            .wrapping_add(trial)
    }

    /// Returns the trace of one trial of the first executor in the first column.
    pub(super) fn trace(&self, trial: u64) -> Result<String, ExperimentError> {
        let (row, column) = (0, 0);
        if self.experiment.columns[column].believed.is_some() {
            return Err(self.error(
                "a trace contains only one world, but the executors of the first \
                                   column believe in another",
            ));
        }
        let mut common = self.common(&|| true)?;
        let seed = self.seed(trial);
        let executor = &self.experiment.executors[row];
        let mut lines = String::new();
        let mut sink = |line: &str| lines.push_str(line);
        // The trace names facts that only the world mentions, so it shares the table of the trial.
        let task = Arc::new(common.task.with_own_table());
        let mut writer = TraceWriter::new(Arc::clone(&task), &mut sink);
        let written = writer.header(&self.spec(column, executor, seed)?);
        written.map_err(|error| self.error(&error.to_string()))?;
        self.execute(
            &task,
            seed,
            (row, executor),
            column,
            &mut common,
            Some(writer),
        );
        Ok(lines)
    }

    /// Returns the specification of a trial, for its trace.
    fn spec(
        &self,
        column: usize,
        executor: &ExecutorSpec,
        seed: u64,
    ) -> Result<RunSpec, ExperimentError> {
        let experiment = self.experiment;
        let column = &experiment.columns[column];
        let (domain, problem) = self.texts()?;
        let (planner, planner_time) = match &experiment.planner {
            Planning::Embedded => None,
            Planning::External { name, seconds } => Some((name.clone(), seconds.clone())),
        }
        .unzip();
        let mut spec = RunSpec::new((&domain).into(), (&problem).into());
        if let Some(planner) = planner {
            spec.planner = planner;
        }
        let likelihoods = column.likelihoods.as_ref().map(|text| NamedText {
            name: format!("likelihoods of {}", column.name),
            text: text.clone(),
        });
        let settings = &experiment.settings;
        Ok(RunSpec {
            world: Some(column.world.clone()),
            planner_time: planner_time.flatten(),
            likelihoods,
            has_plan: true,
            executor: executor.clone(),
            seed,
            planner_states: experiment.planner_states,
            planning_budget: Some(experiment.planning_budget.clone()),
            improve_states: experiment.improve_states,
            vary: column.vary.clone(),
            precision: Some(experiment.precision.clone()),
            objective: experiment.objective,
            running: settings.running,
            planning_time: settings.planning_time.clone(),
            max_replans: settings.max_replans,
            time_limit: settings.time_limit.clone(),
            ..spec
        })
    }

    fn record(
        &self,
        (trial, seed): (u64, u64),
        column: usize,
        row: usize,
        report: &Report,
    ) -> TrialRecord {
        TrialRecord {
            place: (self.problem, column),
            trial,
            row,
            seed,
            case: self.describe_blanks(),
            column: self.experiment.columns[column].name.clone(),
            executor: self.experiment.executors[row].to_string(),
            verdict: report.verdict.name().to_owned(),
            time: Some(report.time.to_decimal(6)),
            replans: report.replans,
        }
    }

    /// Lists the values of the blanks.
    fn describe_blanks(&self) -> String {
        let filling = self.filling.iter();
        let filling: Vec<_> = filling
            .map(|(name, value)| format!("{name} = {value}"))
            .collect();
        filling.join(", ")
    }

    fn execute(
        &self,
        task: &Arc<Task>,
        seed: u64,
        (row, spec): (usize, &ExecutorSpec),
        column: usize,
        common: &mut SharedSetup<'_>,
        writer: Option<TraceWriter<'_>>,
    ) -> (Report, Vec<String>) {
        let settings = &self.experiment.settings;
        let Scenario {
            world,
            likelihoods,
            policy_tables,
            preparer,
            plan_comparator: odds,
            comparing_planner: likeliest,
            action_values,
            rollouts: rehearse,
            first_plans: firsts,
            first_plan_notes: _,
        } = &mut common.columns[column];
        let planner: &mut dyn Planner = if spec.needs_odds() {
            likeliest
        } else {
            &mut common.planner
        };
        let execution = Execution::of(task)
            .beginning_with(firsts[row].clone())
            .by(spec.clone())
            .with_settings(settings.clone())
            .with_likelihoods(Arc::clone(likelihoods))
            .with_policy_tables(policy_tables.clone())
            .with_plan_comparator(Some(Box::new(odds.clone())))
            .with_action_values(action_values.clone())
            .with_rollouts(rehearse.clone())
            .with_planner(planner)
            .with_preparer(preparer);
        // Explanations of missing plans are only read for single runs.
        let (execution, recorder): (_, Box<dyn Recorder>) = match writer {
            Some(writer) => (execution.with_explanations(), Box::new(writer)),
            None => (execution, Box::new(NoRecord)),
        };
        let (recorder, validation) = Validated::new(recorder, task, None);
        let report = execution
            .recorded_by(recorder)
            .run_in(&mut *world.world(task, seed));
        let invalid = validation.findings();
        (report, invalid.iter().map(ToString::to_string).collect())
    }

    fn planner<'a>(
        &self,
        domain: Source,
        problem: Source,
        may_continue: &'a (dyn Fn() -> bool + Sync),
    ) -> Result<Box<dyn Planner + 'a>, ExperimentError> {
        match &self.experiment.planner {
            Planning::Embedded => Ok(Box::new(Embedded {
                may_continue: Some(may_continue),
                ..self.embedded()
            })),
            Planning::External { name, seconds } => {
                external_planner(name, seconds.as_ref(), domain, problem, may_continue)
            }
        }
    }

    pub(super) fn embedded(&self) -> Embedded<'static> {
        Embedded {
            settings: embedded::Settings {
                threads: self.threads,
                ..embedded::Settings::default()
            },
            most_states: self.experiment.planner_states,
            improve_states: self.experiment.improve_states,
            work: planning_work(&self.experiment.planning_budget),
            ..Embedded::default()
        }
    }

    pub(super) fn flow(&self, column: &Column, world: &WorldModel) -> pipeline::Settings {
        pipeline::Settings {
            vary: column.vary.clone(),
            search: match self.experiment.objective {
                Some(objective) => Search::best(objective),
                None => Search::irr(),
            }
            .with_precision(self.experiment.precision.clone()),
            world: Some(Arc::new(world.clone())),
            ..pipeline::Settings::default()
        }
    }

    fn task(domain: &Source, problem: &Source) -> Result<Task, ExperimentError> {
        let read = elbowroom_pddl::read_problem(domain, problem);
        let (problem, _) = read.map_err(ExperimentError::Text)?;
        Ok(Task::new(problem))
    }

    /// Returns the problem, and the world of a column for it.
    pub(super) fn problem_and_world(
        &self,
        column: &Column,
    ) -> Result<(Task, WorldModel), ExperimentError> {
        let (domain, problem) = self.texts()?;
        let task = Self::task(&domain, &problem)?;
        let world = world(column, &task)?;
        Ok((task, world))
    }

    /// Returns the domain, and the problem with its blanks filled in.
    fn texts(&self) -> Result<(Source, Source), ExperimentError> {
        let mut text = self.experiment.problem.clone();
        for (name, value) in &self.filling {
            let blank = format!("{{{name}}}");
            if !text.contains(&blank) {
                return Err(self.error(&format!("the problem has no blank {blank}")));
            }
            text = text.replace(&blank, value);
        }
        let domain = Source::new("domain", self.experiment.domain.as_str());
        Ok((domain, Source::new("problem", text.as_str())))
    }

    pub(super) fn error(&self, message: &str) -> ExperimentError {
        if self.filling.is_empty() {
            return ExperimentError::other(format!("the problem: {message}"));
        }
        ExperimentError::other(format!(
            "the problem with {}: {message}",
            self.describe_blanks()
        ))
    }
}

/// Returns the reason why there is no plan. The options of `run` in it are replaced by members of
/// experiment files.
fn reason_with_file_options(answer: &PlanAnswer) -> String {
    let why = answer.failure_reason().unwrap_or_default();
    why.replace("--planning-budget", "planning_budget")
        .replace("--planner-states", "planner_states")
}

pub(super) fn world(column: &Column, task: &Task) -> Result<WorldModel, ExperimentError> {
    let world = Source::new(format!("world of {}", column.name), column.world.as_str());
    WorldModel::read(&world, task.problem()).map_err(ExperimentError::Text)
}

/// Returns the world that executors believe in, if it is not the column's own.
pub(super) fn believed_world(
    column: &Column,
    task: &Task,
) -> Result<Option<WorldModel>, ExperimentError> {
    let Some(text) = &column.believed else {
        return Ok(None);
    };
    let source = Source::new(format!("believed world of {}", column.name), text.as_str());
    let world = WorldModel::read(&source, task.problem());
    world.map(Some).map_err(ExperimentError::Text)
}

/// Returns an external planner.
fn external_planner<'a>(
    name: &str,
    seconds: Option<&Rational>,
    domain: Source,
    problem: Source,
    may_continue: &'a (dyn Fn() -> bool + Sync),
) -> Result<Box<dyn Planner + 'a>, ExperimentError> {
    let planner = external::Planner::named(name);
    let seconds = seconds.map(|seconds| Duration::from_secs_f64(seconds.to_f64().min(1e9)));
    Ok(Box::new(elbowroom::execute::External {
        planner: planner.map_err(|error| ExperimentError::other(error.to_string()))?,
        domain,
        problem,
        settings: external::Settings {
            time_limit: Some(seconds.unwrap_or(Duration::from_secs(60))),
            ..external::Settings::default()
        },
        stops_at_first_plan: seconds.is_none(),
        may_continue,
    }))
}
