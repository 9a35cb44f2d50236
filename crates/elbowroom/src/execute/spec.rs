//! Specification of a run as data: [`RunSpec`].

mod assembly;
mod beliefs;
mod error;
mod text_form;

use std::sync::Arc;

use elbowroom_envelope::{Guarantee, Objective};
use elbowroom_execution::executors::ExecutorSpec;
use elbowroom_execution::run::{PlanningTime, RunSettings, RunningRule, TimeoutRule};
use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_plan::parametrize::VarySpec;
use elbowroom_probability::{Likelihoods, likelihoods};
use elbowroom_text::Source;
use serde::{Deserialize, Serialize};

use super::{Embedded, FirstPlan, PLANNING_BUDGET};
use crate::answers::envelope::Search;
use crate::pipeline;
pub(crate) use text_form::{as_text, listed};
use text_form::{positive, required};

pub use assembly::{RunInputs, WorldNames};
pub use error::{AdversaryError, FirstPlanError, SpecError};

/// Name for a run without a planner.
pub const NO_PLANNER: &str = "none";

/// Name of the embedded planner in specifications and answers.
pub const EMBEDDED: &str = "embedded";

/// All data that a run depends on, except its initial plan and the events of the world.
///
/// The arguments of `elbowroom run`, the header of a trace (`docs/reference/formats/trace.md`) and the input
/// of a replay are all of this type, so that they have the same meaning. A member that is unknown
/// or missing is an error; optional members are [marked as such](RunSpec::planner_time).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a member of its own in the header of a trace"
)]
pub struct RunSpec {
    /// The domain, in PDDL.
    pub domain: NamedText,
    /// The problem, in PDDL.
    pub problem: NamedText,
    /// The world file (`docs/reference/formats/world.md`) of a simulation; without one, everything goes as
    /// planned.
    #[serde(deserialize_with = "required")]
    pub world: Option<String>,
    /// The command line of the process that simulates or controls the world.
    #[serde(deserialize_with = "required")]
    pub world_process: Option<String>,
    /// The world file that the executor believes (`docs/reference/formats/world.md`): distributions of durations, failures and
    /// changes of facts. Omitted if it believes the file of the simulation, or knows nothing of its process.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub believed: Option<String>,
    /// `true` if plans, envelopes and deadlines use the mean durations of [`Self::believed`] in place of the durations
    /// that the domain fixes ([`RunSpec::usual_durations`]). Omitted if `false`.
    #[serde(
        default,
        rename = "believed_durations",
        skip_serializing_if = "std::ops::Not::not"
    )]
    pub plans_believed_durations: bool,
    /// `true` if the world is an object in the process of the run, and `world_process` its description. Omitted if
    /// `false`.
    #[serde(
        default,
        rename = "embedded_world",
        skip_serializing_if = "std::ops::Not::not"
    )]
    pub is_world_embedded: bool,
    /// A world that ends each action at the worst time; left out if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spoiler: Option<AdversarySettings>,
    /// The planner: [`EMBEDDED`], [`NO_PLANNER`], or the name or command line of another one.
    pub planner: String,
    /// Time limit of another planner for better plans than its first, in seconds; left out if the
    /// first plan is used.
    #[serde(default, with = "positive::option")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planner_time: Option<Rational>,
    /// A likelihood file (`docs/reference/formats/likelihoods.md`); without one, everything is certain.
    #[serde(deserialize_with = "required")]
    pub likelihoods: Option<NamedText>,
    /// `true` if there is an initial plan; in a trace, it is the first entry.
    pub has_plan: bool,
    /// `true` if the run is persistent: it continues after reaching its goal, and accepts further
    /// goals (`elbowroom serve`). Left out if `false`.
    #[serde(
        default,
        rename = "lasting",
        skip_serializing_if = "std::ops::Not::not"
    )]
    pub is_persistent: bool,
    /// `true` if the run accepts pauses and the abandonment of its goal (`elbowroom run --token`).
    /// Left out if `false`.
    #[serde(
        default,
        rename = "attended",
        skip_serializing_if = "std::ops::Not::not"
    )]
    pub is_interactive: bool,
    /// The executor.
    #[serde(with = "as_text")]
    pub executor: ExecutorSpec,
    /// Random seed of the simulated world.
    pub seed: u64,
    /// Criterion for the first plan, if none is given; left out if it is `shortest`.
    #[serde(default, skip_serializing_if = "FirstPlan::is_shortest")]
    pub first_plan: FirstPlan,
    /// Maximum number of states of the embedded planner for one plan.
    pub planner_states: u64,
    /// Maximum number of these states for a better plan than the first.
    pub improve_states: u64,
    /// Work limit for each choice of the first plan and each new plan, in seconds of one processor
    /// ([`elbowroom_num::work`]); left out if there is no limit.
    #[serde(default, with = "positive::option")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planning_budget: Option<Rational>,
    /// `true` if a ground action may overlap itself in plans of the embedded planner; left out if
    /// `false`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub self_overlap: bool,
    /// Number of threads of the embedded planner. It affects only the planning time, so it is not
    /// part of a trace.
    #[serde(skip, default = "one")]
    pub threads: usize,
    /// Quantities to leave open; if empty, all durations that the domain fixes.
    #[serde(with = "listed")]
    pub vary: Vec<VarySpec>,
    /// The guarantee inside envelopes.
    pub guarantee: Guarantee,
    /// Precision of the ends of an envelope; left out if it is a hundredth of each nominal value.
    #[serde(default, with = "positive::option")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub precision: Option<Rational>,
    /// Objective of envelopes; left out if they are IRR's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub objective: Option<Objective>,
    /// The treatment of running actions in replanning.
    #[serde(with = "as_text")]
    pub running: RunningRule,
    /// The planning time in the world's seconds.
    #[serde(with = "as_text")]
    pub planning_time: PlanningTime,
    /// `true` if plans are made in the background of the run ([`RunSettings::plans_in_background`]); left
    /// out if `false`.
    #[serde(
        default,
        rename = "plans_aside",
        skip_serializing_if = "std::ops::Not::not"
    )]
    pub plans_in_background: bool,
    /// `true` if plans are also prepared in the background ([`RunSettings::prepares_in_background`]); left
    /// out if `false`.
    #[serde(
        default,
        rename = "readies_aside",
        skip_serializing_if = "std::ops::Not::not"
    )]
    pub prepares_in_background: bool,
    /// Speed of the world's clock relative to the wall clock; without one, the run does not wait
    /// for the wall clock.
    #[serde(with = "positive::nullable")]
    pub realtime: Option<Rational>,
    /// The rule that sets the time-out of each action. The default is `10x,600`: 10 times the
    /// planned duration, at least 600 seconds.
    #[serde(default, with = "as_text")]
    pub timeout: TimeoutRule,
    /// Maximum number of new plans until an action is completed ([`RunSettings::max_replans`]).
    pub max_replans: usize,
    /// Time limit of the run, in the world's seconds.
    #[serde(with = "positive")]
    pub time_limit: Rational,
    /// The least separation of interfering happenings (ε).
    #[serde(with = "positive")]
    pub epsilon: Rational,
}

fn one() -> usize {
    1
}

/// A file: its name, for messages, and its content.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedText {
    /// The name.
    pub name: String,
    /// The text.
    pub text: String,
}

/// A world that ends each action at the worst time.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdversarySettings {
    /// The box of durations: `dur_0=[8,14]`; without one, the plan's envelope.
    #[serde(rename = "box", deserialize_with = "required")]
    pub inside: Option<String>,
}

impl From<&Source> for NamedText {
    fn from(source: &Source) -> Self {
        Self {
            name: source.name().to_owned(),
            text: source.text().to_owned(),
        }
    }
}

impl NamedText {
    /// Returns it as a source for readers.
    pub fn source(&self) -> Source {
        Source::new(self.name.as_str(), self.text.as_str())
    }
}

/// Default limit on the states that the embedded planner examines for one plan: more than any planning budget allows.
pub const MAX_STATES: u64 = 1_000_000_000;

impl RunSpec {
    /// Creates a run of this problem with the defaults of the command.
    pub fn new(domain: NamedText, problem: NamedText) -> Self {
        let settings = RunSettings::default();
        let planner = Embedded::default();
        let flow = pipeline::Settings::default();
        Self {
            domain,
            problem,
            world: None,
            world_process: None,
            believed: None,
            plans_believed_durations: false,
            is_world_embedded: false,
            spoiler: None,
            planner: EMBEDDED.to_owned(),
            planner_time: None,
            likelihoods: None,
            has_plan: false,
            is_persistent: false,
            is_interactive: false,
            executor: ExecutorSpec::default(),
            seed: 0,
            first_plan: FirstPlan::default(),
            planner_states: MAX_STATES,
            improve_states: planner.improve_states,
            planning_budget: Some(Rational::from(PLANNING_BUDGET)),
            self_overlap: planner.settings.self_overlap,
            threads: planner.settings.threads,
            vary: flow.vary,
            guarantee: flow.guarantee,
            precision: None,
            objective: Some(Objective::default()),
            running: settings.running,
            planning_time: PlanningTime::Seconds(Rational::ZERO),
            plans_in_background: false,
            prepares_in_background: false,
            realtime: None,
            timeout: settings.timeout,
            max_replans: settings.max_replans,
            time_limit: settings.time_limit,
            epsilon: Task::default_epsilon(),
        }
    }

    /// Returns the settings of the run.
    pub fn settings(&self) -> RunSettings {
        RunSettings {
            running: self.running,
            planning_time: self.planning_time.clone(),
            max_replans: self.max_replans,
            timeout: self.timeout.clone(),
            time_limit: self.time_limit.clone(),
            // A simulation without a clock has no user to warn.
            plans_in_background: self.plans_in_background,
            prepares_in_background: self.prepares_in_background,
            monitors_slack: self.world_process.is_some() || self.realtime.is_some(),
        }
    }

    /// Returns the expected planning time in the world; 0 if it is measured, because it is not
    /// known in advance.
    fn expected_planning_time(&self) -> Rational {
        match &self.planning_time {
            PlanningTime::Seconds(seconds) => seconds.clone(),
            PlanningTime::Measured => Rational::ZERO,
        }
    }

    /// Returns `true` if plans can be made in the background: there is a clock that measures
    /// planning times, and the planner keeps no state between plans.
    pub fn can_plan_in_background(&self) -> bool {
        let has_clock = self.world_process.is_some() || self.realtime.is_some();
        has_clock
            && self.planning_time == PlanningTime::Measured
            && self.planner != NO_PLANNER
            && !self.executor.uses_world_model()
    }

    /// Returns the quantities to vary, and the settings of the search for envelopes.
    pub fn envelopes(&self) -> pipeline::Settings {
        let mut flow = pipeline::Settings {
            vary: self.vary.clone(),
            guarantee: self.guarantee,
            timeout: self.timeout.clone(),
            search: self.objective.map_or_else(Search::irr, Search::best),
            ..pipeline::Settings::default()
        };
        if let Some(precision) = &self.precision {
            flow.search = flow.search.with_precision(precision.clone());
        }
        flow
    }

    /// Returns the likelihoods for the executor.
    ///
    /// # Errors
    /// When the likelihood file cannot be read.
    fn likelihoods(&self, task: &Task) -> Result<Arc<Likelihoods>, SpecError> {
        let Some(file) = &self.likelihoods else {
            return Ok(Arc::new(Likelihoods::certain()));
        };
        let read = likelihoods::read(file.source(), task);
        read.map(Arc::new).map_err(SpecError::Likelihoods)
    }
}
