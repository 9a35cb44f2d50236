//! Construction of a run from its specification.

use std::sync::Arc;
use std::time::Duration;

use elbowroom_envelope::Objective;
use elbowroom_execution::run::PlanningTime;
use elbowroom_execution::{
    ActionValues, NoPlanner, PlanComparator, PlanForm, Planner, Preparer, World,
};
use elbowroom_external as external;
use elbowroom_mdp::Settings;
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::{Rational, work};
use elbowroom_planner::embedded;
use elbowroom_probability::Likelihoods;
use elbowroom_selection::timeouts::unknown_action;
use elbowroom_selection::{CERTIFICATE_WORK, action_values, certificate_work};
use elbowroom_sim::{ControlledWorld, SimWorld, WorldModel};
use elbowroom_text::Diagnostic;

use super::{AdversaryError, EMBEDDED, FirstPlanError, NO_PLANNER, RunSpec, SpecError};
use crate::execute::{
    AdversarialWorld, Embedded, Execution, External, MostProbablePlanner, PlanPreparer,
    PlanSelector, Replanning, RolloutPolicy, Rollouts, SelectingPlanner, SharedRolloutPolicy,
    WorldKnowledge, planning_work,
};
use crate::{DistributionError, parse_box, pipeline};

/// The time limit of another planner for its first plan.
const FIRST_PLAN_TIME_LIMIT: Duration = Duration::from_secs(60);

/// The inputs of a run: its specification, with the problem, worlds and likelihoods read from its texts, each once. The
/// problem has the durations of plans: those of the domain, or the means of the believed world
/// ([`RunSpec::plans_believed_durations`]).
#[derive(Clone, Debug)]
pub struct RunInputs {
    spec: RunSpec,
    task: Arc<Task>,
    /// The simulated world; `None` if the world is a process.
    simulation: Option<WorldModel>,
    /// The world that the executor believes, if any, around the durations of plans.
    beliefs: Option<WorldModel>,
    likelihoods: Arc<Likelihoods>,
}

/// Names of world files in messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WorldNames {
    /// The name of the simulated world.
    pub world: String,
    /// The name of the believed world.
    pub believed: String,
}

impl Default for WorldNames {
    /// The texts of specifications have no names.
    fn default() -> Self {
        let name = || "world".to_owned();
        Self {
            world: name(),
            believed: name(),
        }
    }
}

impl RunInputs {
    /// Reads the problem and the other texts of a specification. Returns the inputs with the warnings.
    ///
    /// # Errors
    /// When a text cannot be read.
    pub fn read(spec: RunSpec) -> Result<(Self, Vec<Diagnostic>), SpecError> {
        let (task, warnings) = spec.read_task().map_err(SpecError::Problem)?;
        Ok((
            Self::of(spec, Arc::new(task), &WorldNames::default())?,
            warnings,
        ))
    }

    /// Reads the likelihoods and the worlds of a specification, whose problem was read already, with the durations of
    /// the domain. `names` are those of the world files, for messages.
    ///
    /// # Errors
    /// When a text cannot be read.
    pub fn of(spec: RunSpec, task: Arc<Task>, names: &WorldNames) -> Result<Self, SpecError> {
        let problem = task.problem();
        let likelihoods = spec.likelihoods(&task)?;
        let simulation = spec.simulation(problem, &names.world);
        let simulation = simulation.map_err(SpecError::World)?;
        let beliefs = match (&spec.believed, &simulation) {
            (None, Some(simulation)) => Some(simulation.clone()),
            _ => spec
                .beliefs(problem, &names.believed)
                .map_err(SpecError::World)?,
        };
        let (task, beliefs) = spec.with_durations(task, beliefs);
        Ok(Self {
            spec,
            task,
            simulation,
            beliefs,
            likelihoods,
        })
    }

    /// Returns the inputs for a simulation of the same run, in which planning takes no time. `task` is its problem, for
    /// example with another goal or table of facts.
    #[must_use]
    pub fn without_planning_time(&self, task: Arc<Task>) -> Self {
        let spec = RunSpec {
            planning_time: PlanningTime::Seconds(Rational::ZERO),
            plans_in_background: false,
            prepares_in_background: false,
            ..self.spec.clone()
        };
        Self {
            spec,
            task,
            ..self.clone()
        }
    }

    /// Returns the specification.
    pub fn spec(&self) -> &RunSpec {
        &self.spec
    }

    /// Returns the problem, with the ε of the specification and the durations of plans.
    pub fn task(&self) -> &Arc<Task> {
        &self.task
    }

    /// Returns the model of the simulated world; `None` if the world is a process.
    pub fn simulation(&self) -> Option<&WorldModel> {
        self.simulation.as_ref()
    }

    /// Returns the world of the specification: a simulation, or an adversary of `plan`.
    ///
    /// # Errors
    /// When the world is a process, there is no plan for the adversary, or the plan does not match the box.
    pub fn world(
        &self,
        plan: Option<&TimeTriggeredPlan>,
    ) -> Result<Box<dyn World + '_>, SpecError> {
        let model = self.simulation.as_ref().ok_or(SpecError::Process)?;
        Ok(self.world_of(model, plan)?)
    }

    fn world_of<'m>(
        &self,
        model: &'m WorldModel,
        plan: Option<&TimeTriggeredPlan>,
    ) -> Result<Box<dyn World + 'm>, AdversaryError> {
        let task = &self.task;
        let Some(spoiler) = &self.spec.spoiler else {
            return Ok(model.world(task, self.spec.seed));
        };
        let plan = plan.ok_or(AdversaryError::NoPlan)?;
        let mut settings = self.spec.envelopes();
        settings.world = Some(Arc::new(model.clone()));
        let mut analyst = PlanPreparer::new(settings);
        let prepared = analyst.prepare(task, plan, PlanForm::OpenNetwork)?;
        let envelope = match (&spoiler.inside, prepared.envelope) {
            (Some(text), _) => parse_box(text, &prepared.plan)?,
            (None, Some(envelope)) => envelope,
            (None, None) => return Err(AdversaryError::NoEnvelope),
        };
        let network = prepared.plan.uncertain_network(&envelope);
        let network = network.map_err(|_| AdversaryError::Empty)?;
        let spoiling = AdversarialWorld::new(
            &prepared.plan.plan,
            &network,
            &prepared.nominal,
            &self.spec.timeout,
        );
        let sim = SimWorld::new(Arc::clone(task), model, self.spec.seed);
        Ok(Box::new(ControlledWorld::new(sim, spoiling)))
    }

    /// Returns the planner of the run, with `clock` and `may_continue` as in [`Embedded`]. The embedded planner's first plan
    /// is chosen by [`RunSpec::first_plan`]; other planners return their only plan.
    ///
    /// # Errors
    /// When the planner is unknown, or has no such limit.
    pub fn planner<'a>(
        &self,
        clock: &'a (dyn Fn() -> Rational + Sync),
        may_continue: &'a (dyn Fn() -> bool + Sync),
    ) -> Result<Box<dyn Planner + 'a>, SpecError> {
        let planner = self
            .spec
            .planner_of_new_plans(self.beliefs.as_ref(), clock, may_continue)?;
        let is_embedded = matches!(self.spec.planner_choice()?, PlannerChoice::Embedded);
        let known = self.first_plan_knowledge().filter(|_| is_embedded);
        let Some(known) = known else {
            return Ok(planner);
        };
        let chooser = PlanSelector {
            settings: self.spec.embedded().settings,
            most_states: self.spec.planner_states,
            improve_states: self.spec.improve_states,
            work: self
                .spec
                .planning_budget
                .as_ref()
                .map_or(u64::MAX, planning_work),
            knowledge: known,
            may_continue,
        };
        Ok(Box::new(SelectingPlanner {
            inner: planner,
            chooser: Some(chooser),
            latest_start: self.spec.expected_planning_time(),
            clock,
        }))
    }

    /// Returns the model of the world for the choice of the first plan. `None` if the planner's own
    /// plan is used: because it was requested, because there is no model, or because goals are
    /// given later.
    fn first_plan_knowledge(&self) -> Option<WorldKnowledge> {
        let spec = &self.spec;
        if spec.first_plan.is_shortest() || spec.has_plan || spec.is_persistent {
            return None;
        }
        if let Some(rollouts) = self.rollouts() {
            return Some(WorldKnowledge::World(rollouts));
        }
        spec.likelihoods
            .is_some()
            .then(|| WorldKnowledge::Likelihoods {
                reorders: spec.executor.needs().orders,
                likelihoods: Arc::clone(&self.likelihoods),
            })
    }

    /// Returns the settings of rollouts of this run in samples of the believed world; `None` without one.
    fn rollouts(&self) -> Option<Rollouts> {
        let spec = &self.spec;
        let world = self.beliefs.as_ref();
        let world = Arc::new(world.filter(|_| spec.believed_world().is_some())?.clone());
        let mut flow = spec.envelopes();
        flow.world = Some(Arc::clone(&world));
        Some(Rollouts {
            world,
            executor: spec.executor.clone(),
            settings: spec.settings(),
            flow,
            likelihoods: Arc::clone(&self.likelihoods),
            replanning: Some(Replanning::within(&spec.embedded())),
            is_ready: false,
        })
    }

    /// Returns the preparer of plans.
    pub fn preparer(&self) -> PlanPreparer<'static> {
        PlanPreparer::new(self.envelopes())
    }

    fn envelopes(&self) -> pipeline::Settings {
        let mut envelopes = self.spec.envelopes();
        if self.spec.believed_world().is_some() {
            envelopes.world = self.beliefs.clone().map(Arc::new);
        }
        envelopes
    }

    /// Returns the execution of the specification, which begins with the plan `first`; without one, the planner
    /// makes it. The caller adds the planner and the world. Tables and likelihoods for the executor are computed within limits that do
    /// not depend on the machine.
    ///
    /// # Errors
    /// When its files cannot be read, or its members are inconsistent.
    pub fn execution(
        &self,
        first: impl Into<Option<TimeTriggeredPlan>>,
    ) -> Result<Execution<'static>, SpecError> {
        let first = first.into();
        let (spec, task) = (&self.spec, &self.task);
        spec.check()?;
        if let Some(feature) = task.validator_only_feature() {
            return Err(SpecError::UnsupportedFeature(feature));
        }
        if let Some(mistake) = unknown_action(&spec.timeout, task.problem()) {
            return Err(SpecError::Timeout(mistake));
        }
        let model = self.beliefs.as_ref();
        let model = model.filter(|_| spec.executor.uses_world_model());
        let is_embedded = matches!(spec.planner_choice()?, PlannerChoice::Embedded);
        // A table of moves has a fixed goal.
        let has_table = spec.executor.needs().action_values && !spec.is_persistent;
        let table = model.filter(|_| has_table);
        let table = table.map(|model| self.action_values(model, is_embedded, first.as_ref()));
        let (table, no_table) = match table.transpose() {
            Ok(table) => (table, None),
            Err(why) => (None, Some(why)),
        };
        let model = model.filter(|_| is_embedded);
        let needs_rollouts = model.is_some() && spec.executor.needs().rollouts && table.is_none();
        let rollouts = needs_rollouts.then(|| self.rollouts()).flatten();
        let rollouts = rollouts.map(|rollouts| {
            SharedRolloutPolicy::new(RolloutPolicy::new(rollouts, spec.embedded()))
        });
        let odds = model.filter(|_| spec.executor.needs_odds()).map(|model| {
            let time = spec.expected_planning_time();
            Box::new(MostProbablePlanner::new(
                model.clone(),
                spec.embedded(),
                time,
            )) as Box<dyn PlanComparator>
        });
        Ok(Execution::of(task)
            .by(spec.executor.clone())
            .beginning_with(first)
            .with_settings(spec.settings())
            .persistent(spec.is_persistent)
            .interactive(spec.is_interactive)
            .with_domain_commands(task.has_expected_durations())
            .with_envelopes(self.envelopes())
            .with_likelihoods(Arc::clone(&self.likelihoods))
            .with_plan_comparator(odds)
            .with_action_values(table)
            .with_missing_table_reason(no_table)
            .with_rollouts(rollouts))
    }

    /// Computes the table of moves for the world of `model`.
    ///
    /// # Errors
    /// The reason for a missing table, for users.
    fn action_values(
        &self,
        model: &WorldModel,
        is_embedded: bool,
        first: Option<&TimeTriggeredPlan>,
    ) -> Result<Arc<dyn ActionValues>, String> {
        let embedded = self.spec.embedded();
        let budget = work::Budget::new(embedded.work);
        let may_continue = || !budget.is_spent();
        let planner = is_embedded.then_some(embedded);
        action_values(
            &self.task,
            model,
            planner,
            first,
            Settings::default(),
            &may_continue,
        )
    }
}

impl RunSpec {
    /// Returns the planner that [`Self::planner`] names, with the limits of the run, and with
    /// `clock` and `may_continue` as in [`Embedded`]. For executors that compare plans, it returns the likeliest plan in the
    /// world of `model`. It does not choose among plans for the first one.
    ///
    /// # Errors
    /// When the planner is unknown, or has no such limit.
    pub fn planner_of_new_plans<'a>(
        &self,
        model: Option<&WorldModel>,
        clock: &'a (dyn Fn() -> Rational + Sync),
        may_continue: &'a (dyn Fn() -> bool + Sync),
    ) -> Result<Box<dyn Planner + 'a>, SpecError> {
        let embedded = Embedded {
            clock: Some(clock),
            may_continue: Some(may_continue),
            ..self.embedded()
        };
        Ok(match self.planner_choice()? {
            PlannerChoice::Disabled => Box::new(NoPlanner),
            PlannerChoice::Embedded => match model.filter(|_| self.executor.needs_odds()) {
                None => Box::new(embedded),
                Some(model) => {
                    let time = self.expected_planning_time();
                    Box::new(MostProbablePlanner::new(model.clone(), embedded, time))
                }
            },
            PlannerChoice::External(planner) => {
                let given = self.planner_time.as_ref();
                let limit = given.map(|time| Duration::from_secs_f64(time.to_f64().min(1e9)));
                Box::new(External {
                    planner: *planner,
                    domain: self.domain.source(),
                    problem: self.problem.source(),
                    settings: external::Settings {
                        time_limit: Some(limit.unwrap_or(FIRST_PLAN_TIME_LIMIT)),
                        ..external::Settings::default()
                    },
                    stops_at_first_plan: limit.is_none(),
                    may_continue,
                })
            }
        })
    }

    /// Returns the planner that [`Self::planner`] names.
    fn planner_choice(&self) -> Result<PlannerChoice, SpecError> {
        let name = &self.planner;
        let own = match name {
            name if name.eq_ignore_ascii_case(EMBEDDED) => PlannerChoice::Embedded,
            name if name.eq_ignore_ascii_case(NO_PLANNER) => PlannerChoice::Disabled,
            name => {
                return Ok(PlannerChoice::External(Box::new(external::Planner::named(
                    name,
                )?)));
            }
        };
        match self.planner_time {
            Some(_) => Err(SpecError::NoTimeLimit(name.clone())),
            None => Ok(own),
        }
    }

    /// Checks that the planner is known, and supports its settings.
    ///
    /// # Errors
    /// When it is unknown, or does not support them.
    pub fn check_planner(&self) -> Result<(), SpecError> {
        match self.planner_choice()? {
            PlannerChoice::Disabled | PlannerChoice::External(_) if self.self_overlap => {
                Err(SpecError::SelfOverlap(self.planner.clone()))
            }
            _ => Ok(()),
        }
    }

    /// Checks the consistency of the members before files are read: the planner is known, and the
    /// executor supports the planner and the model of the world.
    ///
    /// # Errors
    /// When they are inconsistent.
    pub fn check(&self) -> Result<(), SpecError> {
        self.check_planner()?;
        self.check_durations()?;
        let whom = self.planner_choice()?;
        if !self.first_plan.is_shortest() {
            let is_known = self.believed_world().is_some() || self.likelihoods.is_some();
            let wrong = match whom {
                _ if self.has_plan => Some(FirstPlanError::Given),
                _ if self.is_persistent => Some(FirstPlanError::Persistent),
                PlannerChoice::Embedded if is_known => None,
                PlannerChoice::Embedded => Some(FirstPlanError::NoWorldKnowledge),
                PlannerChoice::Disabled | PlannerChoice::External(_) => {
                    Some(FirstPlanError::ExternalPlanner)
                }
            };
            if let Some(wrong) = wrong {
                return Err(SpecError::FirstPlan(wrong));
            }
        }
        if self.objective == Some(Objective::Probability) && self.believed_world().is_none() {
            return Err(SpecError::Distribution(DistributionError::NoWorld));
        }
        if !self.executor.requires_world_model() {
            return Ok(());
        }
        if self.believed_world().is_none() && self.spoiler.is_none() {
            return Err(SpecError::NeedsWorld(self.executor.clone()));
        }
        match whom {
            PlannerChoice::Embedded => Ok(()),
            _ => Err(SpecError::NeedsEmbedded(self.executor.clone())),
        }
    }

    /// Checks a new run: [`RunSpec::check`], and that the likelihoods are used. A recorded run that ignores them is
    /// resumed.
    ///
    /// # Errors
    /// When the members are inconsistent, or neither the executor nor the choice of the first plan uses the likelihoods.
    pub fn check_new(&self) -> Result<(), SpecError> {
        self.check()?;
        let chooses_by_likelihoods =
            !self.first_plan.is_shortest() && self.believed_world().is_none();
        if self.likelihoods.is_some() && !self.executor.needs().orders && !chooses_by_likelihoods {
            return Err(SpecError::UnusedLikelihoods(self.executor.clone()));
        }
        Ok(())
    }

    /// Returns the embedded planner, with the limits of the run and without a clock.
    pub fn embedded(&self) -> Embedded<'static> {
        Embedded {
            settings: embedded::Settings {
                self_overlap: self.self_overlap,
                threads: self.threads,
                ..embedded::Settings::default()
            },
            most_states: self.planner_states,
            improve_states: self.improve_states,
            work: self
                .planning_budget
                .as_ref()
                .map_or(u64::MAX, planning_work),
            // Requests have to wait for plans that are made in the thread of the run.
            first_plan_factor: if self.is_persistent && self.executor.needs_odds() {
                1
            } else {
                Embedded::default().first_plan_factor
            },
            certificate_work: self
                .planning_budget
                .as_ref()
                .map_or(CERTIFICATE_WORK, certificate_work),
            ..Embedded::default()
        }
    }
}

/// The planner of a run.
enum PlannerChoice {
    Embedded,
    Disabled,
    External(Box<external::Planner>),
}
