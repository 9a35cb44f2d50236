//! The trials of one problem.

use std::sync::Arc;
use std::time::Duration;

use elbowroom_execution::executors::{ExecutorSpec, Foresight};
use elbowroom_execution::run::{PlanningTime, Report, Verdict};
use elbowroom_execution::{Outlook, PlanAnswer, Planner, Preparer};
use elbowroom_external as external;
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_pddl::Source;
use elbowroom_planner::embedded;
use elbowroom_probability::{Likelihoods, likelihoods};
use elbowroom_report::trace::TraceWriter;
use elbowroom_sim::WorldModel;

use super::{Column, Experiment, ExperimentError, Part, Planning, Results, TrialId, clairvoyant};
use elbowroom::execute::{
    Analyst, Chooser, Embedded, Execution, Known, Likeliest, NamedText, RememberingPlanner,
    RememberingPreparer, Replanning, Rollouts, RunSpec, SharedLikeliest,
};
use elbowroom::flow;
use elbowroom::timed::{Policy, Settings};

use crate::record::{TrialRecord, TrialRecords};

/// The number of plans remembered for one problem: some megabytes.
const PLANS: usize = 20_000;

/// How many plans made ready are remembered for one problem and column: some megabytes.
const PREPARED: usize = 500;

/// One problem, and some of its trials.
pub(super) struct Setting<'a> {
    pub(super) experiment: &'a Experiment,
    pub(super) problem: usize,
    pub(super) filling: &'a [(String, String)],
    /// Which of the part's trials: every `pieces`-th, from this one on.
    pub(super) piece: usize,
    pub(super) pieces: usize,
}

/// The data shared by all trials of a problem.
struct Common<'a> {
    task: Arc<Task>,
    planner: RememberingPlanner<Box<dyn Planner + 'a>>,
    columns: Vec<Place>,
}

/// A column for one problem.
struct Place {
    world: WorldModel,
    likelihoods: Arc<Likelihoods>,
    foresight: Foresight,
    preparer: RememberingPreparer<Analyst>,
    /// For executors that look for likelier plans: who makes them, and the same with a memory.
    odds: SharedLikeliest,
    likeliest: RememberingPlanner<SharedLikeliest>,
    /// For executors that weigh each move.
    outlook: Option<Arc<dyn Outlook>>,
    /// The plan that each executor begins with.
    firsts: Vec<TimeTriggeredPlan>,
}

impl Setting<'_> {
    /// Makes the trials of a part. `tell` is called after each, and says whether to go on;
    /// `goes_on` says so in between.
    pub(super) fn run(
        &self,
        part: Part,
        records: Option<&TrialRecords>,
        tell: &(dyn Fn() -> bool + Sync),
        goes_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Results, ExperimentError> {
        let experiment = self.experiment;
        let mut results = Results::empty(experiment, part);
        if !goes_on() {
            return Ok(results);
        }
        let mut common = self.common(goes_on)?;
        for trial in part.numbers().skip(self.piece).step_by(self.pieces) {
            for column in 0..experiment.columns.len() {
                self.trial((trial, column), records, &mut common, &mut results);
                if !tell() {
                    return Ok(results);
                }
            }
        }
        Ok(results)
    }

    /// Reads the problem, makes the first plan, and makes it ready for all executors.
    fn common<'a>(
        &self,
        goes_on: &'a (dyn Fn() -> bool + Sync),
    ) -> Result<Common<'a>, ExperimentError> {
        let (domain, problem) = self.texts()?;
        let task = Self::task(&domain, &problem)?;
        let situation = Situation::initial(&task);
        let mut planner = self.planner(domain, problem, goes_on)?;
        let first = match planner.plan(&task, &situation).answer {
            PlanAnswer::Plan(plan) => plan,
            PlanAnswer::Unsolvable => {
                return Err(self.wrong("no plan exists, so there is nothing to execute"));
            }
            PlanAnswer::NotFound { why } => return Err(self.wrong(&why)),
        };
        let task = Arc::new(task);
        let columns = self.experiment.columns.iter();
        let columns = columns.map(|column| self.place(column, &task, &first, goes_on));
        Ok(Common {
            columns: columns.collect::<Result<_, _>>()?,
            planner: RememberingPlanner::new(planner, PLANS),
            task,
        })
    }

    fn place(
        &self,
        column: &Column,
        task: &Arc<Task>,
        first: &TimeTriggeredPlan,
        goes_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Place, ExperimentError> {
        let world = world(column, task)?;
        let likelihoods = Arc::new(match &column.likelihoods {
            None => Likelihoods::certain(),
            Some(text) => {
                let name = format!("likelihoods of {}", column.name);
                likelihoods::read(Source::new(name, text.as_str()), task)
                    .map_err(ExperimentError::Text)?
            }
        });
        let flow = self.flow(column, &world);
        let mut preparer = RememberingPreparer::new(Analyst::new(flow), PREPARED);
        for spec in &self.experiment.executors {
            preparer
                .prepare(task, first, spec.registered.need)
                .map_err(|error| self.wrong(&error.to_string()))?;
        }
        let planning_time = match &self.experiment.settings.planning_time {
            PlanningTime::Seconds(seconds) => seconds.clone(),
            PlanningTime::Measured => Rational::ZERO,
        };
        let asks_outlook = self
            .experiment
            .executors
            .iter()
            .any(ExecutorSpec::asks_outlook);
        let outlook = asks_outlook.then(|| {
            let policy = Policy::new(task, &world, &Settings::default(), goes_on);
            Some(Arc::new(policy.ok()??) as Arc<dyn Outlook>)
        });
        let odds = Likeliest::new(world.clone(), self.embedded(), planning_time);
        let odds = SharedLikeliest::new(odds);
        let mut likeliest = RememberingPlanner::new(odds.clone(), PLANS);
        let mut firsts = Vec::with_capacity(self.experiment.executors.len());
        for spec in &self.experiment.executors {
            let chosen = self.chosen(spec, column, (task, &world, &likelihoods), goes_on);
            let likely = (chosen.is_none() && spec.asks_outlook()).then(|| {
                let answer = likeliest.plan(task, &Situation::initial(task)).answer;
                match answer {
                    PlanAnswer::Plan(plan) => Some(plan),
                    _ => None,
                }
            });
            let plan = chosen.or(likely.flatten());
            firsts.push(plan.unwrap_or_else(|| first.clone()));
        }
        Ok(Place {
            outlook: outlook.flatten(),
            firsts,
            world,
            likelihoods,
            foresight: Foresight::default(),
            preparer,
            likeliest,
            odds,
        })
    }

    /// The first plan that an executor begins with, if it is not the planner's; nor is it where
    /// choosing was interrupted.
    fn chosen(
        &self,
        spec: &ExecutorSpec,
        column: &Column,
        (task, world, likelihoods): (&Task, &WorldModel, &Arc<Likelihoods>),
        goes_on: &(dyn Fn() -> bool + Sync),
    ) -> Option<TimeTriggeredPlan> {
        let experiment = self.experiment;
        if experiment.first_plan.is_shortest() || experiment.planner != Planning::Embedded {
            return None;
        }
        let embedded = self.embedded();
        let chooser = Chooser {
            most_states: embedded.most_states,
            improve_states: embedded.improve_states,
            known: Known::World(Rollouts {
                world: Arc::new(world.clone()),
                executor: spec.clone(),
                settings: experiment.settings.clone(),
                flow: self.flow(column, world),
                likelihoods: Arc::clone(likelihoods),
                replanning: Some(Replanning::within(&embedded)),
                is_ready: true,
            }),
            settings: embedded.settings,
            goes_on,
        };
        let choice = chooser.choose(task, &Situation::initial(task)).ok()?;
        Some(choice.plan)
    }

    /// Every executor in the same world.
    fn trial(
        &self,
        (trial, column): (u64, usize),
        records: Option<&TrialRecords>,
        common: &mut Common<'_>,
        results: &mut Results,
    ) {
        let seed = self.seed(trial);
        let executors = &self.experiment.executors;
        let mut reached = Vec::with_capacity(executors.len() + 1);
        for (row, spec) in executors.iter().enumerate() {
            let report = self.execute(seed, (row, spec), column, common, None);
            reached.push(report.verdict == Verdict::GoalReached);
            let id = TrialId {
                problem: self.problem,
                trial,
            };
            results.cells[row][column].count(&report, id);
            if let Some(records) = records {
                records.add(self.record((trial, seed), column, row, &report));
            }
        }
        if self.experiment.clairvoyant {
            let world = &common.columns[column].world;
            // What somebody reached without knowing can be reached knowing.
            let is_possible = reached.contains(&true)
                || clairvoyant::can_reach(&common.task, world, seed, &mut self.embedded());
            let cell = &mut results.cells[reached.len()][column];
            cell.runs += 1;
            cell.successes += u64::from(is_possible);
            reached.push(is_possible);
        }
        for (row, this) in reached.iter().enumerate() {
            let pair = &mut results.pairs[row][column];
            pair.only_first += u64::from(reached[0] && !this);
            pair.only_this += u64::from(*this && !reached[0]);
        }
    }

    /// The same in all columns: their worlds differ only where the columns do.
    fn seed(&self, trial: u64) -> u64 {
        self.experiment
            .seed
            .wrapping_mul(1_000_003)
            .wrapping_add(self.problem as u64)
            .wrapping_mul(1_000_003)
            .wrapping_add(trial)
    }

    /// The trace of one trial of the first executor in the first column.
    pub(super) fn trace(&self, trial: u64) -> Result<String, ExperimentError> {
        let (row, column) = (0, 0);
        let mut common = self.common(&|| true)?;
        let seed = self.seed(trial);
        let executor = &self.experiment.executors[row];
        let mut lines = String::new();
        let mut sink = |line: &str| lines.push_str(line);
        let mut writer = TraceWriter::new(Arc::clone(&common.task), &mut sink);
        let written = writer.header(&self.spec(column, executor, seed)?);
        written.map_err(|error| self.wrong(&error.to_string()))?;
        self.execute(seed, (row, executor), column, &mut common, Some(writer));
        Ok(lines)
    }

    /// The specification of a trial, for its trace.
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
            Planning::Another { name, seconds } => Some((name.clone(), seconds.clone())),
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
            improve_states: experiment.improve_states,
            vary: column.vary.clone(),
            precision: Some(experiment.precision.clone()),
            objective: experiment.objective,
            running: settings.running,
            planning_time: settings.planning_time.clone(),
            max_replans: settings.most_replans,
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
            case: self.words(),
            column: self.experiment.columns[column].name.clone(),
            executor: self.experiment.executors[row].to_string(),
            verdict: report.verdict.name().to_owned(),
            time: Some(report.time.to_decimal(6)),
            replans: report.replans,
        }
    }

    /// The values that were filled in.
    fn words(&self) -> String {
        let filling = self.filling.iter();
        let filling: Vec<_> = filling
            .map(|(name, value)| format!("{name} = {value}"))
            .collect();
        filling.join(", ")
    }

    fn execute(
        &self,
        seed: u64,
        (row, spec): (usize, &ExecutorSpec),
        column: usize,
        common: &mut Common<'_>,
        writer: Option<TraceWriter<'_>>,
    ) -> Report {
        let settings = &self.experiment.settings;
        // Trials are shared out among threads, and each is the same whichever came before.
        let task = Arc::new(common.task.with_own_table());
        let Place {
            world,
            likelihoods,
            foresight,
            preparer,
            odds,
            likeliest,
            outlook,
            firsts,
        } = &mut common.columns[column];
        let asks_odds = spec.asks_odds();
        let odds = asks_odds.then(|| Box::new(odds.clone()) as _);
        let planner: &mut dyn Planner = if asks_odds {
            likeliest
        } else {
            &mut common.planner
        };
        let execution = Execution::of(&task)
            .beginning_with(firsts[row].clone())
            .by(spec.clone())
            .with_settings(settings.clone())
            .with_likelihoods(Arc::clone(likelihoods))
            .with_foresight(foresight.clone())
            .with_odds(odds)
            .with_outlook(outlook.clone().filter(|_| spec.asks_outlook()))
            .planned_by(planner)
            .prepared_by(preparer);
        // Nobody reads why there is no way on but those who look at a single run.
        let execution = match writer {
            Some(writer) => execution.recorded_by(writer).explaining(),
            None => execution,
        };
        execution.run_in(&mut *world.world(&task, seed))
    }

    fn planner<'a>(
        &self,
        domain: Source,
        problem: Source,
        goes_on: &'a (dyn Fn() -> bool + Sync),
    ) -> Result<Box<dyn Planner + 'a>, ExperimentError> {
        match &self.experiment.planner {
            Planning::Embedded => Ok(Box::new(self.embedded())),
            Planning::Another { name, seconds } => {
                another(name, seconds.as_ref(), domain, problem, goes_on)
            }
        }
    }

    fn embedded(&self) -> Embedded<'static> {
        Embedded {
            settings: embedded::Settings::default(),
            most_states: self.experiment.planner_states,
            improve_states: self.experiment.improve_states,
            clock: None,
            goes_on: None,
        }
    }

    fn flow(&self, column: &Column, world: &WorldModel) -> flow::Settings {
        let mut flow = flow::Settings {
            vary: column.vary.clone(),
            objective: self.experiment.objective,
            world: Some(Arc::new(world.clone())),
            ..flow::Settings::default()
        };
        flow.search.precision = self.experiment.precision.clone();
        flow.search.relative = None;
        flow
    }

    fn task(domain: &Source, problem: &Source) -> Result<Task, ExperimentError> {
        let read = elbowroom_pddl::read_problem(domain, problem);
        let (problem, _) = read.map_err(ExperimentError::Text)?;
        Ok(Task::new(problem))
    }

    /// The problem, and the world of a column for it.
    pub(super) fn scene(&self, column: &Column) -> Result<(Task, WorldModel), ExperimentError> {
        let (domain, problem) = self.texts()?;
        let task = Self::task(&domain, &problem)?;
        let world = world(column, &task)?;
        Ok((task, world))
    }

    /// The domain, and the problem with its blanks filled in.
    fn texts(&self) -> Result<(Source, Source), ExperimentError> {
        let mut text = self.experiment.problem.clone();
        for (name, value) in self.filling {
            let blank = format!("{{{name}}}");
            if !text.contains(&blank) {
                return Err(self.wrong(&format!("the problem has no blank {blank}")));
            }
            text = text.replace(&blank, value);
        }
        let domain = Source::new("domain", self.experiment.domain.as_str());
        Ok((domain, Source::new("problem", text.as_str())))
    }

    fn wrong(&self, message: &str) -> ExperimentError {
        if self.filling.is_empty() {
            return ExperimentError::other(format!("the problem: {message}"));
        }
        ExperimentError::other(format!("the problem with {}: {message}", self.words()))
    }
}

fn world(column: &Column, task: &Task) -> Result<WorldModel, ExperimentError> {
    let world = Source::new(format!("world of {}", column.name), column.world.as_str());
    WorldModel::read(&world, task.problem()).map_err(ExperimentError::Text)
}

/// Another program.
fn another<'a>(
    name: &str,
    seconds: Option<&Rational>,
    domain: Source,
    problem: Source,
    goes_on: &'a (dyn Fn() -> bool + Sync),
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
        takes_first: seconds.is_none(),
        goes_on,
    }))
}
