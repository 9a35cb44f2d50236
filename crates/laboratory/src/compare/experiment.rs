//! Experiment files: `docs/reference/formats/experiment.md`.

mod file;

use elbowroom::answers::envelope::objective_of;
use elbowroom::envelope::Objective;
use elbowroom::execute::{FirstPlan, MAX_STATES, PLANNING_BUDGET};
use elbowroom::mdp::Settings;
use elbowroom_execution::executors::ExecutorSpec;
use elbowroom_execution::run::{RunSettings, TimeoutRule};
use elbowroom_num::Rational;
use elbowroom_plan::parametrize::VarySpec;
use elbowroom_text::{Source, Span};
use indexmap::IndexMap;
use serde::Deserialize;
use serde_json::{Value, json};
use toml::Spanned;

use crate::error::ExperimentError;
use file::{File, exact, text_of};

/// Experiment, with the texts of all files that it names.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// The title; that of a file without a title is the file's name without its extension.
    pub title: String,
    /// The domain, in PDDL.
    pub domain: String,
    /// The problem, in PDDL, with blanks: `{name}`.
    pub problem: String,
    /// Blanks and their values. All combinations are used.
    pub blanks: IndexMap<String, Vec<String>>,
    /// Groups of blanks that are filled in together, row by row.
    pub linked: Vec<LinkedParameters>,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows.
    pub executors: Vec<ExecutorSpec>,
    /// `true` to add a row for plans with knowledge of the future.
    pub clairvoyant: bool,
    /// `true` to add a row for the optimal policy.
    pub optimum: bool,
    /// Number of trials of each problem in each column.
    pub trials: u64,
    /// Random seed.
    pub seed: u64,
    /// Settings of the runs.
    pub settings: RunSettings,
    /// Precision of each end of an envelope.
    pub precision: Rational,
    /// Objective of envelopes; `None` for those of IRR.
    pub objective: Option<Objective>,
    /// Text of the first plan of every executor; `None` to compute it with the planner.
    pub plan: Option<String>,
    /// Rule that chooses the first plan, if the planner is the embedded one.
    pub first_plan: FirstPlan,
    /// The planner.
    pub planner: Planning,
    /// Maximum number of states in the search for a plan.
    pub planner_states: u64,
    /// Number of these states for a better plan than the first one.
    pub improve_states: u64,
    /// Work limit for each plan, in seconds of one processor ([`elbowroom_num::work`]).
    pub planning_budget: Rational,
    /// Maximum number of states in the table of `policy`, which files cannot set. With 0 there is
    /// no table, and moves are evaluated by rollouts.
    pub table_states: usize,
    /// Published figures for the table.
    pub published: Vec<Published>,
}

/// Planner of an experiment.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Planning {
    /// The embedded planner.
    #[default]
    Embedded,
    /// An external planner, as in `elbowroom plan --planner`. Its answers may depend on the speed
    /// of the machine.
    External {
        /// Its name, or its command line.
        name: String,
        /// Time to improve plans; `None` to use its first plan.
        seconds: Option<Rational>,
    },
}

/// Column of the table.
#[derive(Clone, Debug)]
pub struct Column {
    /// Its heading.
    pub name: String,
    /// The world file.
    pub world: String,
    /// World file that executors believe in, such as a learnt one; `None` for the world itself.
    pub believed: Option<String>,
    /// Likelihood file, for executors that use likelihoods; `None` if everything is certain.
    pub likelihoods: Option<String>,
    /// Quantities that may vary.
    pub vary: Vec<VarySpec>,
}

/// Blanks that are filled in together.
#[derive(Clone, Debug)]
pub struct LinkedParameters {
    /// Their names.
    pub names: Vec<String>,
    /// A value for each, row by row.
    pub rows: Vec<Vec<String>>,
}

/// Figures of a paper, one for each column.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// Executor of the row.
    pub executor: String,
    /// Percentages.
    pub coverage: Vec<f64>,
    /// Mean number of new plans in successful runs; NaN if there were none.
    #[serde(default)]
    pub replans: Vec<f64>,
}

/// Returns the name of a file without its folder and extension.
fn file_stem(name: &str) -> String {
    let stem = std::path::Path::new(name).file_stem();
    stem.map_or_else(
        || name.to_owned(),
        |stem| stem.to_string_lossy().into_owned(),
    )
}

impl Experiment {
    /// Returns all data on which the results depend, in a fixed order.
    pub(super) fn identity(&self) -> Value {
        // A new member must be listed here, as part of the identity or not.
        let Self {
            title: _,
            published: _,
            // The caller sets the number of trials.
            trials: _,
            domain,
            problem,
            blanks,
            linked: together,
            columns,
            executors,
            clairvoyant,
            optimum,
            seed,
            settings,
            precision,
            objective,
            plan,
            first_plan,
            planner,
            planner_states,
            improve_states,
            planning_budget,
            table_states,
        } = self;
        let RunSettings {
            running,
            planning_time,
            max_replans: most_replans,
            timeout,
            // Worlds of experiments have no clock.
            monitors_slack: _,
            plans_in_background: _,
            prepares_in_background: _,
            time_limit,
        } = settings;
        let texts = |texts: &mut dyn Iterator<Item = String>| texts.collect::<Vec<_>>();
        let columns = columns.iter().map(|column| {
            let Column {
                name,
                world,
                believed,
                likelihoods,
                vary,
            } = column;
            let vary = texts(&mut vary.iter().map(ToString::to_string));
            json!([name, world, believed, likelihoods, vary])
        });
        let together = together.iter().map(|it| json!([it.names, it.rows]));
        let planner = match planner {
            Planning::Embedded => json!([]),
            Planning::External { name, seconds } => {
                json!([name, seconds.as_ref().map(ToString::to_string)])
            }
        };
        let timeout = match timeout {
            TimeoutRule::Off => json!(["none"]),
            TimeoutRule::After { factor, at_least } => {
                json!([factor.to_string(), at_least.to_string()])
            }
            rule @ TimeoutRule::ByAction { .. } => json!([rule.to_string()]),
        };
        let identity = json!([
            domain,
            problem,
            blanks.iter().collect::<Vec<_>>(),
            together.collect::<Vec<_>>(),
            columns.collect::<Vec<_>>(),
            texts(&mut executors.iter().map(ToString::to_string)),
            clairvoyant,
            seed,
            running.to_string(),
            planning_time.to_string(),
            most_replans,
            timeout,
            time_limit.to_string(),
            precision.to_string(),
            planner,
            planner_states,
            improve_states,
        ]);
        // These members are omitted at their defaults, so that the identity of older results does
        // not change.
        let identity = with_member(identity, "objective", objective.map(|it| json!(it.name())));
        let identity = with_member(identity, "plan", plan.as_ref().map(|it| json!(it)));
        let is_usual = first_plan.is_shortest();
        let chosen = (!is_usual).then(|| json!(first_plan.name()));
        let identity = with_member(identity, "first plan", chosen);
        let is_usual = *planning_budget == Rational::from(PLANNING_BUDGET);
        let budget = (!is_usual).then(|| json!(planning_budget.to_string()));
        let identity = with_member(identity, "planning budget", budget);
        let is_usual = *table_states == Settings::default().most_states;
        let identity = with_member(identity, "table", (!is_usual).then(|| json!(table_states)));
        if *optimum {
            json!([identity, "optimum"])
        } else {
            identity
        }
    }

    /// Reads an experiment. `file` returns the text of a file that it names.
    ///
    /// # Errors
    /// The first mistake, with its place.
    pub fn read(
        source: impl Into<Source>,
        file: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<Self, ExperimentError> {
        let source = source.into();
        let wrong = |at: Span, message: String| {
            let message = message.trim().replace('\n', " ");
            ExperimentError::at(&source, at, message)
        };
        let read: File = elbowroom_text::toml::read(&source)
            .map_err(|found| ExperimentError::Text(found.into()))?;
        if read.format.get_ref() != "elbowroom-experiment" || *read.version.get_ref() != 1 {
            let message = "this program reads format = \"elbowroom-experiment\", version = 1";
            return Err(wrong(read.format.span(), message.to_owned()));
        }
        read.check_size()
            .map_err(|(at, message)| wrong(at, message))?;
        let named = |name: &Spanned<String>| {
            file(name.get_ref()).map_err(|error| wrong(name.span(), error))
        };
        let mut executors = Vec::new();
        for name in read.executors.get_ref() {
            let spec = name.get_ref().parse::<ExecutorSpec>();
            executors.push(spec.map_err(|error| wrong(name.span(), error.to_string()))?);
        }
        let mut columns = Vec::new();
        for column in &read.column {
            let mut vary = Vec::new();
            for spec in &column.vary {
                let read = spec.get_ref().parse::<VarySpec>();
                vary.push(read.map_err(|error| wrong(spec.span(), error.to_string()))?);
            }
            columns.push(Column {
                name: column.name.clone(),
                world: named(&column.world)?,
                believed: column.believed.as_ref().map(&named).transpose()?,
                likelihoods: column.likelihoods.as_ref().map(&named).transpose()?,
                vary,
            });
        }
        let rows = rows(&executors, read.clairvoyant);
        read.check_published(&rows)
            .map_err(|(at, message)| wrong(at, message))?;
        let wrong_at = |(at, message)| wrong(at, message);
        let together = read.linked_parameters().map_err(wrong_at)?;
        let settings = read.settings().map_err(wrong_at)?;
        let planner = read.planning().map_err(wrong_at)?;
        let first_plan = read.first_plan().map_err(wrong_at)?;
        let precision = match &read.precision {
            None => Rational::ONE,
            Some(given) => exact(*given.get_ref())
                .filter(Rational::is_positive)
                .ok_or_else(|| wrong(given.span(), "it must be positive".to_owned()))?,
        };
        let planning_budget = match &read.planning_budget {
            None => Rational::from(PLANNING_BUDGET),
            Some(given) => exact(*given.get_ref())
                .filter(Rational::is_positive)
                .ok_or_else(|| wrong(given.span(), "it must be positive".to_owned()))?,
        };
        let method = read.method.as_ref().map(|method| *method.get_ref());
        let objective = objective_of(method, read.objective, read.precision.is_some());
        let objective = objective.map_err(|error| {
            let at = read.method.as_ref().map_or(0..0, Spanned::span);
            wrong(at, format!("{error}: leave out `method`, or `objective`"))
        })?;
        Ok(Self {
            domain: named(&read.domain)?,
            problem: named(&read.problem)?,
            title: read.title.unwrap_or_else(|| file_stem(source.name())),
            blanks: read
                .blanks
                .into_iter()
                .map(|(name, values)| (name, values.get_ref().iter().map(text_of).collect()))
                .collect(),
            linked: together,
            columns,
            executors,
            clairvoyant: read.clairvoyant,
            optimum: read.optimum,
            trials: read.trials.into_inner(),
            seed: read.seed,
            settings,
            precision,
            objective,
            plan: read.plan.as_ref().map(named).transpose()?,
            first_plan,
            planner,
            planner_states: read.planner_states.unwrap_or(MAX_STATES),
            improve_states: read.improve_states.unwrap_or(20_000),
            planning_budget,
            table_states: Settings::default().most_states,
            published: read
                .published
                .into_iter()
                .map(Spanned::into_inner)
                .collect(),
        })
    }

    /// Returns all combinations of values for the blanks; the last blank changes fastest.
    pub fn fillings(&self) -> Vec<Vec<(String, String)>> {
        let mut fillings = vec![Vec::new()];
        for (name, values) in &self.blanks {
            let longer = |filling: &Vec<(String, String)>, value: &String| {
                let mut longer = filling.clone();
                longer.push((name.clone(), value.clone()));
                longer
            };
            fillings = fillings
                .iter()
                .flat_map(|filling| values.iter().map(move |value| longer(filling, value)))
                .collect();
        }
        for group in &self.linked {
            let longer = |filling: &Vec<(String, String)>, row: &Vec<String>| {
                let pairs = group.names.iter().cloned().zip(row.iter().cloned());
                filling.iter().cloned().chain(pairs).collect::<Vec<_>>()
            };
            fillings = fillings
                .iter()
                .flat_map(|filling| group.rows.iter().map(move |row| longer(filling, row)))
                .collect();
        }
        fillings
    }

    /// Returns the names of the rows.
    pub fn rows(&self) -> Vec<String> {
        rows(&self.executors, self.clairvoyant)
    }
}

fn rows(executors: &[ExecutorSpec], clairvoyant: bool) -> Vec<String> {
    let rows = executors.iter().map(ToString::to_string);
    let last = clairvoyant.then(|| CLAIRVOYANT.to_owned());
    rows.chain(last).collect()
}

/// Name of the row for plans with knowledge of the future.
pub(crate) const CLAIRVOYANT: &str = "clairvoyant";

/// Adds a member to the identity if it has a value. Without one, the identity is that of older
/// results.
fn with_member(identity: Value, label: &str, value: Option<Value>) -> Value {
    match value {
        Some(value) => json!([identity, label, value]),
        None => identity,
    }
}
