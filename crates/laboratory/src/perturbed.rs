//! Comparison of executors in perturbed worlds: the experiments of paper 2.
//!
//! A [`PerturbedExperiment`] is a file: a problem, likelihoods for each case, worlds and executors.
//! [`run`] runs every trial with every executor; executors have the same seeds. The random numbers
//! of a trial depend only on the experiment's seed, the case and the trial's number, so results do
//! not depend on the number of threads.

mod experiment;
mod planner;
mod results;
mod stored_trial;
mod table;

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::{Arc, OnceLock};

use crate::untimed::{
    ActionName, ExecutorName, ExecutorServices, Limits, LookaheadPolicy, NotTabulated, Plans,
    Shortest, StepRecord, Trial, TrialSetup, UntimedExecutor, UntimedWorld, all_actions_under,
    trial,
};
use crate::worlds::{EventProbabilities, PerturbedFacts, PublishedWorld, SoundWorld};
use elbowroom_model::ground::Action;
use elbowroom_model::{State, Task};
use elbowroom_num::work;
use elbowroom_pddl::{Source, read_problem};
use elbowroom_probability::Likelihoods;
use elbowroom_probability::optimum::{self, DeadEnds};
use serde_json::Value;

pub use experiment::{Case, OptimumRules, PerturbedExperiment, PlannerKind, Published, WorldKind};
pub use results::{Row, UntimedCounts, Work};
pub use stored_trial::{StoredPlan, StoredStep, StoredTrial};

use crate::error::ExperimentError;
use crate::record::TrialRecord;
use crate::results::Results;
use crate::trials::{Monitor, Part, Trials};
use planner::EmbeddedPlans;

/// Case, prepared for its trials.
pub(crate) struct Setting<'e> {
    experiment: &'e PerturbedExperiment,
    case: &'e Case,
    /// Number of the case, which is part of the seeds.
    number: u64,
    task: Arc<Task>,
    actions: Vec<Action>,
    likelihoods: Arc<Likelihoods>,
    chances: EventProbabilities,
    perturbed: Option<PerturbedFacts>,
    foresight: OnceLock<Result<LookaheadPolicy, NotTabulated>>,
    other_optima: OnceLock<Result<BTreeMap<OptimumRules, f64>, ExperimentError>>,
    has_first_plan: OnceLock<bool>,
}

/// Runs the trials of each case, in each world, with each executor. `observe` receives the number
/// of finished trials, and returns `false` to stop. The results of finished trials are kept.
///
/// # Errors
/// The problem or the likelihoods cannot be read, or are of an unsupported kind.
pub fn run(
    experiment: &PerturbedExperiment,
    part: Part,
    observe: &(dyn Fn(u64) -> bool + Sync),
) -> Result<Results<UntimedCounts>, ExperimentError> {
    crate::trials::run(experiment, part, &Monitor::new(observe, None))
}

impl Trials for PerturbedExperiment {
    type Counts = UntimedCounts;
    type Piece<'e> = (Arc<Setting<'e>>, (WorldKind, ExecutorName));
    type Made = Row;

    fn title(&self) -> &str {
        &self.title
    }

    fn identity(&self) -> Value {
        self.identity()
    }

    fn empty_counts(&self) -> UntimedCounts {
        let rows = rows(self)
            .map(|(case, world, executor)| Row::new(&self.cases[case], world, executor, None));
        UntimedCounts {
            rows: rows.collect(),
        }
    }

    fn setting_count(&self) -> usize {
        rows(self).count()
    }

    fn pieces(&self, _: Part, _: usize) -> Result<Vec<Self::Piece<'_>>, ExperimentError> {
        let settings = (0..self.cases.len())
            .map(|number| Setting::new(self, number).map(Arc::new))
            .collect::<Result<Vec<_>, _>>()?;
        let rows = rows(self)
            .map(|(case, world, executor)| (Arc::clone(&settings[case]), (world, executor)));
        Ok(rows.collect())
    }

    fn run_piece(
        &self,
        (setting, row): &Self::Piece<'_>,
        part: Part,
        monitor: &Monitor<'_>,
    ) -> Result<Row, ExperimentError> {
        setting.row(*row, part.numbers(), monitor, None)
    }

    fn combine(
        &self,
        rows: Vec<Result<Row, ExperimentError>>,
        _: bool,
    ) -> Result<UntimedCounts, ExperimentError> {
        let rows = rows.into_iter().collect::<Result<_, _>>()?;
        Ok(UntimedCounts { rows })
    }
}

/// Returns the rows of the results, in order: case, world and executor.
fn rows(
    experiment: &PerturbedExperiment,
) -> impl Iterator<Item = (usize, WorldKind, ExecutorName)> + '_ {
    let cases = 0..experiment.cases.len();
    cases.flat_map(move |case| {
        experiment.worlds.iter().flat_map(move |world| {
            let executors = experiment.executors.iter();
            executors.map(move |executor| (case, *world, *executor))
        })
    })
}

/// Repeats trials, each given by its row in the results and its number, and records their steps:
/// `docs/reference/formats/course.md`.
///
/// # Errors
/// There is no such row, or as for [`run`].
pub fn repeat_trials(
    experiment: &PerturbedExperiment,
    trials: &[(usize, u64)],
) -> Result<Vec<String>, ExperimentError> {
    let rows: Vec<_> = rows(experiment).collect();
    let monitor = Monitor::new(&|_| true, None);
    // Trials of one case share a table, which takes long to compute.
    let mut settings: BTreeMap<usize, Setting<'_>> = BTreeMap::new();
    let mut texts = Vec::with_capacity(trials.len());
    for &(row, trial) in trials {
        let &(case, world, executor) = rows
            .get(row)
            .ok_or_else(|| ExperimentError::other("unknown row"))?;
        let setting = match settings.entry(case) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => entry.insert(Setting::new(experiment, case)?),
        };
        let mut course = StepRecord::default();
        let own = (world, executor);
        setting.row(own, trial..=trial, &monitor, Some(&mut course))?;
        texts.push(StoredTrial::new(setting, own, trial, &course).text());
    }
    Ok(texts)
}

impl<'e> Setting<'e> {
    fn new(experiment: &'e PerturbedExperiment, number: usize) -> Result<Self, ExperimentError> {
        let case = &experiment.cases[number];
        let domain = Source::new("domain", case.domain.as_str());
        let problem = Source::new("problem", case.problem.as_str());
        let (problem, _) = read_problem(&domain, &problem).map_err(ExperimentError::Text)?;
        let task = Task::new(problem);
        let wrong = |error: &dyn std::fmt::Display| {
            ExperimentError::other(format!("{}: {error}", case.name))
        };
        let likelihoods = elbowroom_probability::likelihoods::read(
            Source::new(
                format!("likelihoods of {}", case.name),
                case.likelihoods.as_str(),
            ),
            &task,
        )
        .map_err(ExperimentError::Text)?;
        if likelihoods.has_rates() {
            return Err(wrong(
                &"the likelihoods have rates per second, but a perturbed world has only steps: use \
                  `becomes_true` and `becomes_false` instead, and `end` instead of \
                  `during_per_second`",
            ));
        }
        let is_published = experiment.worlds.contains(&WorldKind::AsPublished);
        if is_published && likelihoods.has_failing_ends() {
            return Err(wrong(
                &"the likelihoods have actions whose ends fail, which the world `as-published` \
                  does not support: use the world `sound`",
            ));
        }
        let actions = all_actions_under(&task, &likelihoods).map_err(|error| wrong(&error))?;
        let chances = EventProbabilities::new(&task, &actions, &likelihoods)
            .map_err(|error| wrong(&error))?;
        let perturbed = match &experiment.perturbation {
            Some(names) => Some(names.find(&task)?.facts(&task, &chances)),
            None => None,
        };
        Ok(Self {
            experiment,
            case,
            number: number as u64,
            task: Arc::new(task),
            actions,
            likelihoods: Arc::new(likelihoods),
            chances,
            perturbed,
            foresight: OnceLock::new(),
            other_optima: OnceLock::new(),
            has_first_plan: OnceLock::new(),
        })
    }

    /// Returns the table of the sound world, computed at its first use.
    fn table(&self) -> &Result<LookaheadPolicy, NotTabulated> {
        self.foresight.get_or_init(|| {
            let settings = optimum::Settings {
                most_running: self.case.most_running,
                dead_ends: self.dead_end_rule(),
                ..optimum::Settings::default()
            };
            let actions = self.actions.clone();
            LookaheadPolicy::new(&self.task, actions, &self.likelihoods, settings)
        })
    }

    /// Returns the optima by the other rules that the experiment requests.
    fn other_optima(&self) -> &Result<BTreeMap<OptimumRules, f64>, ExperimentError> {
        self.other_optima.get_or_init(|| {
            let rules = self.case.also.iter().map(|&rules| {
                let settings = optimum::Settings {
                    most_running: self.case.most_running,
                    dead_ends: if rules.loses_dead_ends() {
                        DeadEnds::Lost
                    } else {
                        self.dead_end_rule()
                    },
                    enforces_over_all: rules.keeps_over_all(),
                    ..optimum::Settings::default()
                };
                let actions = self.actions.clone();
                let found = LookaheadPolicy::new(&self.task, actions, &self.likelihoods, settings);
                let found = found.map_err(|error| self.missing_table_error(&error))?;
                Ok((rules, results::rounded(self.optimum_of(&found))))
            });
            rules.collect()
        })
    }

    /// Returns the value of a table at the beginning of a trial. A trial whose planner finds no
    /// first plan is lost, so its optimum is 0.
    fn optimum_of(&self, foresight: &LookaheadPolicy) -> f64 {
        let find = || self.plans()(self.task.initial()).is_some();
        if *self.has_first_plan.get_or_init(find) {
            foresight.value()
        } else {
            0.0
        }
    }

    fn dead_end_rule(&self) -> DeadEnds {
        // The first plan takes a round, and each step that ends in a dead end takes another.
        DeadEnds::Patience(self.experiment.rounds.saturating_sub(1).max(1))
    }

    fn lookahead_policy(&self) -> Result<&LookaheadPolicy, ExperimentError> {
        self.table()
            .as_ref()
            .map_err(|error| self.missing_table_error(error))
    }

    fn missing_table_error(&self, error: &NotTabulated) -> ExperimentError {
        ExperimentError::other(format!("{}: {error}", self.case.name))
    }

    fn executor(&self, name: ExecutorName) -> Result<Box<dyn UntimedExecutor>, ExperimentError> {
        let foresight = || self.table().clone();
        let executor = name.build(&ExecutorServices {
            task: Arc::clone(&self.task),
            likelihoods: Arc::clone(&self.likelihoods),
            foresight: &foresight,
        });
        executor.map_err(|error| self.missing_table_error(&error))
    }

    fn plans(&self) -> Box<Plans<'static>> {
        let task = Arc::clone(&self.task);
        match self.experiment.planner {
            PlannerKind::Shortest => {
                let mut planner = Shortest::new(task, self.actions.clone());
                Box::new(move |state| planner.plan(state))
            }
            PlannerKind::Embedded => {
                let mut planner = EmbeddedPlans::new(task);
                Box::new(move |state| planner.plan(state))
            }
        }
    }

    /// Returns the seed of a trial.
    fn seed(&self, trial: u64) -> u64 {
        (self.experiment.seed.wrapping_mul(1_000_003))
            .wrapping_add(self.number.wrapping_mul(1_000_000_007))
            .wrapping_add(trial)
    }

    fn record(
        &self,
        world: WorldKind,
        executor: ExecutorName,
        (trial, seed): (u64, u64),
        made: &Trial,
    ) -> TrialRecord {
        let place = |of: Option<usize>| of.unwrap_or_default();
        let mut worlds = self.experiment.worlds.iter();
        let mut executors = self.experiment.executors.iter();
        let verdict = if made.is_success() {
            "goal-reached"
        } else {
            "failed"
        };
        TrialRecord {
            place: (
                usize::try_from(self.number).unwrap_or(usize::MAX),
                place(worlds.position(|it| *it == world)),
            ),
            trial,
            row: place(executors.position(|it| *it == executor)),
            seed,
            case: self.case.name.clone(),
            column: world.name().to_owned(),
            executor: executor.name().to_owned(),
            verdict: verdict.to_owned(),
            time: None,
            replans: made.replans,
        }
    }

    /// Returns the name of an action.
    fn name(&self, (schema, arguments): &ActionName) -> String {
        let mut actions = self.actions.iter();
        let own = actions.find(|it| it.schema == *schema && it.arguments == *arguments);
        own.map(|action| action.name.clone()).unwrap_or_default()
    }

    /// Runs the trials of these numbers. The steps of the last one are recorded in `course`, if
    /// given.
    fn row(
        &self,
        (world, kind): (WorldKind, ExecutorName),
        numbers: impl Iterator<Item = u64>,
        monitor: &Monitor<'_>,
        course: Option<&mut StepRecord>,
    ) -> Result<Row, ExperimentError> {
        if !monitor.may_continue() {
            return Ok(Row::new(self.case, world, kind, None));
        }
        let is_for_reading = course.is_some();
        let mut executor = self.executor(kind)?;
        // The table is that of the sound world, and has no meaning elsewhere.
        let foresight = match world {
            WorldKind::Sound => Some(self.lookahead_policy()?),
            WorldKind::AsPublished => None,
        };
        let is_dead_end = foresight.map(|foresight| {
            move |state: &State, running: &[ActionName]| foresight.is_dead_end(state, running)
        });
        let kind_of_world = world;
        let mut plans = self.plans();
        let mut game = TrialSetup {
            task: &self.task,
            plans: &mut *plans,
            dead_ends: is_dead_end.as_ref().map(|watch| watch as _),
            limits: Limits {
                rounds: self.experiment.rounds,
                ..Limits::default()
            },
            record: course,
        };
        let optimum = foresight.map(|foresight| self.optimum_of(foresight));
        let mut row = Row::new(self.case, world, kind, optimum);
        if world == WorldKind::Sound && !is_for_reading {
            row.other_optima = self.other_optima().clone()?;
        }
        for number in numbers {
            if !monitor.may_continue() {
                break;
            }
            let seed = self.seed(number);
            let mut sound;
            let mut published;
            let world: &mut dyn UntimedWorld =
                if let (WorldKind::AsPublished, Some(perturbed)) = (world, &self.perturbed) {
                    published = PublishedWorld::new(&self.chances, perturbed, seed);
                    &mut published
                } else {
                    sound = SoundWorld::new(&self.chances, self.task.initial(), seed);
                    &mut sound
                };
            let made = trial(&mut game, world, &mut *executor);
            // An interrupted trial does not count.
            if work::is_stopped() {
                break;
            }
            monitor.record(|| self.record(kind_of_world, kind, (number, seed), &made));
            row.add(number, &made, &|action| self.name(action));
            monitor.count_trial();
        }
        Ok(row)
    }
}
