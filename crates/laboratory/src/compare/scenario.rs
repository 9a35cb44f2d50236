//! Data shared by all trials of one problem in one column: [`Scenario`].

use std::sync::Arc;

use elbowroom_execution::executors::{ExecutorSpec, PolicyTableCache};
use elbowroom_execution::run::PlanningTime;
use elbowroom_execution::{ActionValues, PlanAnswer, Planner, Preparer};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_pddl::Source;
use elbowroom_probability::{Likelihoods, likelihoods};
use elbowroom_sim::WorldModel;

use super::initial_plans::FirstPlanNote;
use super::trials::{PLAN_CACHE_SIZE, PREPARED_CACHE_SIZE, Setting, believed_world, world};
use super::{Column, ExperimentError, Planning};
use elbowroom::execute::{
    CachingPlanner, CachingPreparer, Choice, MostProbablePlanner, PlanPreparer, PlanSelector,
    Replanning, RolloutPolicy, Rollouts, SharedMostProbablePlanner, SharedRolloutPolicy,
    WorldKnowledge, action_values,
};
use elbowroom::mdp::Settings;

/// Column for one problem.
pub(super) struct Scenario<'a> {
    /// The world of the runs.
    pub(super) world: WorldModel,
    pub(super) likelihoods: Arc<Likelihoods>,
    pub(super) policy_tables: PolicyTableCache,
    pub(super) preparer: CachingPreparer<PlanPreparer<'a>>,
    /// Search for likelier plans, for executors that use it, and the same with a cache.
    pub(super) plan_comparator: SharedMostProbablePlanner,
    pub(super) comparing_planner: CachingPlanner<SharedMostProbablePlanner>,
    /// Table of the world, for executors that evaluate each move, or rollouts if there is no table.
    pub(super) action_values: Option<Arc<dyn ActionValues>>,
    pub(super) rollouts: Option<SharedRolloutPolicy>,
    /// First plan of each executor.
    pub(super) first_plans: Vec<TimeTriggeredPlan>,
    /// First plans that were chosen by their probability.
    pub(super) first_plan_notes: Vec<FirstPlanNote>,
}

impl Setting<'_> {
    /// Prepares a column, with the first plan of each executor. `first` is the experiment's plan or
    /// the planner's.
    pub(super) fn prepare_scenario<'a>(
        &self,
        place: usize,
        task: &Arc<Task>,
        first: &TimeTriggeredPlan,
        may_continue: &'a (dyn Fn() -> bool + Sync),
    ) -> Result<Scenario<'a>, ExperimentError> {
        let column = &self.experiment.columns[place];
        let happens = world(column, task)?;
        // The world that executors believe in.
        let world = believed_world(column, task)?.unwrap_or_else(|| happens.clone());
        let likelihoods = Arc::new(match &column.likelihoods {
            None => Likelihoods::certain(),
            Some(text) => {
                let name = format!("likelihoods of {}", column.name);
                likelihoods::read(Source::new(name, text.as_str()), task)
                    .map_err(ExperimentError::Text)?
            }
        });
        let flow = self.flow(column, &world);
        let preparer = PlanPreparer::new(flow).stopped_unless(may_continue);
        let mut preparer = CachingPreparer::new(preparer, PREPARED_CACHE_SIZE);
        for spec in &self.experiment.executors {
            preparer
                .prepare(task, first, spec.needs().plan)
                .map_err(|error| self.error(&error.to_string()))?;
        }
        let planning_time = match &self.experiment.settings.planning_time {
            PlanningTime::Seconds(seconds) => seconds.clone(),
            PlanningTime::Measured => Rational::ZERO,
        };
        let mut executors = self.experiment.executors.iter();
        let needs_action_values = executors.clone().any(|spec| spec.needs().action_values);
        let needs_rollouts = executors.any(|spec| spec.needs().rollouts);
        let action_values = needs_action_values.then(|| {
            let most_states = self.experiment.table_states;
            let has_plans = self.experiment.planner == Planning::Embedded && most_states > 0;
            let settings = Settings {
                most_states,
                ..Settings::default()
            };
            let planner = has_plans.then(|| self.embedded());
            action_values(task, &world, planner, Some(first), settings, may_continue).ok()
        });
        let action_values = action_values.flatten();
        let rehearse = (needs_rollouts && action_values.is_none()).then(|| {
            // The executor that uses rollouts is not simulated in them.
            let rollouts = self.rollouts(&ExecutorSpec::default(), column, (&world, &likelihoods));
            SharedRolloutPolicy::new(RolloutPolicy::new(rollouts, self.embedded()))
        });
        let odds = MostProbablePlanner::new(world.clone(), self.embedded(), planning_time);
        let odds = SharedMostProbablePlanner::new(odds);
        let mut likeliest = CachingPlanner::new(odds.clone(), PLAN_CACHE_SIZE);
        let mut firsts = Vec::with_capacity(self.experiment.executors.len());
        let mut beginnings = Vec::new();
        for (row, spec) in self.experiment.executors.iter().enumerate() {
            // An executor that uses rollouts also uses them to choose its first plan.
            let tries_out = spec.needs().rollouts && rehearse.is_some();
            let is_given = self.experiment.plan.is_some();
            let chooses = !is_given && (tries_out || !self.experiment.first_plan.is_shortest());
            let known = (&**task, &world, &likelihoods);
            let chosen = chooses.then(|| self.chosen_plan(spec, column, known, may_continue));
            let chosen = chosen.flatten();
            let likely = (!is_given && chosen.is_none() && spec.needs().action_values).then(|| {
                let answer = likeliest.plan(task, &Situation::initial(task)).answer;
                match answer {
                    PlanAnswer::Plan(plan) => Some(plan),
                    _ => None,
                }
            });
            if let Some(choice) = &chosen {
                beginnings.push(FirstPlanNote::of(choice, (self.problem, row, place)));
            }
            let plan = chosen.map(|choice| choice.plan).or(likely.flatten());
            firsts.push(plan.unwrap_or_else(|| first.clone()));
        }
        Ok(Scenario {
            action_values,
            rollouts: rehearse,
            first_plans: firsts,
            first_plan_notes: beginnings,
            world: happens,
            likelihoods,
            policy_tables: PolicyTableCache::default(),
            preparer,
            comparing_planner: likeliest,
            plan_comparator: odds,
        })
    }

    /// Returns the first plan of an executor if it differs from the planner's. `None` also after an
    /// interruption.
    fn chosen_plan(
        &self,
        spec: &ExecutorSpec,
        column: &Column,
        (task, world, likelihoods): (&Task, &WorldModel, &Arc<Likelihoods>),
        may_continue: &(dyn Fn() -> bool + Sync),
    ) -> Option<Choice> {
        let experiment = self.experiment;
        if experiment.planner != Planning::Embedded {
            return None;
        }
        let embedded = self.embedded();
        let chooser = PlanSelector {
            most_states: embedded.most_states,
            improve_states: embedded.improve_states,
            work: embedded.work,
            knowledge: WorldKnowledge::World(self.rollouts(spec, column, (world, likelihoods))),
            settings: embedded.settings,
            may_continue,
        };
        chooser.choose(task, &Situation::initial(task)).ok()
    }

    /// Returns trials of an executor in samples of a column's world.
    fn rollouts(
        &self,
        spec: &ExecutorSpec,
        column: &Column,
        (world, likelihoods): (&WorldModel, &Arc<Likelihoods>),
    ) -> Rollouts {
        Rollouts {
            world: Arc::new(world.clone()),
            executor: spec.clone(),
            settings: self.experiment.settings.clone(),
            flow: self.flow(column, world),
            likelihoods: Arc::clone(likelihoods),
            replanning: Some(Replanning::within(&self.embedded())),
            is_ready: true,
        }
    }
}
