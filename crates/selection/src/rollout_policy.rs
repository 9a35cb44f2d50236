//! Comparison of the alternatives of an executor in samples of the world: [`RolloutPolicy`].

mod sample_set;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom_execution::executors::{self, ExecutorServices, ExecutorSpec, OrderCache, Role};
use elbowroom_execution::run::PlanningTime;
use elbowroom_execution::run::situation::{OverrunEstimate, remaining_plan_of, situation_at};
use elbowroom_execution::{
    DecisionPoint, Ending, Executor, Informativeness, PlanAnswer, PlanEvent, Planner,
    PlannerAnswer, PreparationRequest, PreparedPlan, RolloutChoice, RolloutEvaluator,
    RolloutResult,
};
use elbowroom_model::ground::{Condition, FactId};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::{Rational, work};
use elbowroom_sim::{ExogenousChange, Rule};

use crate::box_search::EnvelopeSettings;
use crate::cache::CachingPreparer;
use crate::candidates::{Candidates, Limits};
use crate::execution::RunRollouts;
use crate::plan_preparer::{ExactRegion, PlanPreparer};
use crate::planners::Embedded;
use crate::race::{Rules, Tally, is_behind, race};
use crate::renumbering::renumbered;
use crate::rollouts::Rollouts;
use sample_set::SampleSet;

/// Number of samples at the end of each round.
const ROUNDS: [u64; 4] = [25, 50, 100, 200];

/// Number of samples at the end of each round, for executors of a new plan.
const NEW_PLAN_ROUNDS: [u64; 6] = [50, 100, 200, 400, 800, 1600];

/// Number of samples of the executor's own decision. If enough of them succeed, no alternatives are
/// sampled.
const FIRST_SAMPLES: u64 = 25;

/// Number of these samples that may fail before alternatives are compared. The first number applies
/// if no action has failed, the second one if an action has failed and the executor does not
/// abandon the plan.
const TOLERATED_WITHOUT_DEVIATION: usize = 2;
const TOLERATED_AFTER_FAILURE: usize = 1;

/// First sample of the confirmation of the best alternative.
const FIRST_CONFIRMATION_SAMPLE: u64 = 1_000_000;

/// Maximum number of other plans, and of states for all of them but the first.
const MAX_PLANS: usize = 4;
const PLAN_STATES: u64 = 2_000;

/// Maximum number of variants of the problem to plan for.
const MAX_SEARCHES: usize = 6;

/// Maximum number of states for all new plans in the samples of one scene.
const SAMPLE_STATES: u64 = 4_000;

/// The lead that another executor needs to adopt a new plan instead of the present one: one sample
/// in `MARGIN`.
const MARGIN: u64 = 200;

/// Size of the preparers' caches.
const CACHE_SIZE: usize = 2_000;

/// First seed of the samples, far from seeds that users choose.
const SEED: u64 = 0x7265_6865_0000_0000;

/// Evaluates the alternatives of an executor in samples of the world file, conditioned on the
/// observations. The alternatives are to continue, to hand the remaining plan over to another
/// executor (which retries failed actions, or skips unnecessary ones), to replan, and to wait.
///
/// All alternatives have the same samples (common random numbers), and those that are significantly
/// behind get no further samples. The effort is limited by counts, so results do not depend on a
/// clock. When the planner's work limit is spent, the samples taken until then decide.
pub struct RolloutPolicy {
    rollouts: Rollouts,
    planner: Embedded<'static>,
    planning_time: Rational,
    /// Preparer of adopted plans.
    preparer: CachingPreparer<PlanPreparer<'static>>,
    /// Preparer of plans in samples, with a quickly computed envelope.
    sample_preparer: CachingPreparer<PlanPreparer<'static>>,
    /// The best plan for a situation, kept until the planner port is called for this situation.
    chosen: Option<(Situation, TimeTriggeredPlan)>,
    /// Results for the beginnings of runs, by plan.
    initial_results: Vec<(TimeTriggeredPlan, Choice)>,
    /// The goal of the cached results.
    goal: Option<Condition>,
}

/// A shared [`RolloutPolicy`] that implements both ports.
#[derive(Clone)]
pub struct SharedRolloutPolicy(Arc<Mutex<RolloutPolicy>>);

impl SharedRolloutPolicy {
    /// Creates a shared handle.
    pub fn new(rehearse: RolloutPolicy) -> Self {
        Self(Arc::new(Mutex::new(rehearse)))
    }

    fn get(&self) -> MutexGuard<'_, RolloutPolicy> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl RunRollouts for SharedRolloutPolicy {
    fn evaluator(&self) -> Box<dyn RolloutEvaluator> {
        Box::new(self.clone())
    }

    fn wrap_planner<'a>(&self, planner: Box<dyn Planner + 'a>) -> Box<dyn Planner + 'a> {
        Box::new(PreselectingPlanner {
            rehearse: self.clone(),
            planner,
        })
    }
}

impl RolloutEvaluator for SharedRolloutPolicy {
    fn watched_facts(&self, task: &Task) -> Vec<FactId> {
        self.get().watched_facts(task)
    }

    fn informativeness(&self, action: &str) -> Informativeness {
        self.get().informativeness(action)
    }

    fn is_time_informative(&self) -> bool {
        self.get().is_time_informative()
    }

    fn evaluate(&mut self, scene: &DecisionPoint<'_>) -> RolloutResult {
        self.get().evaluate(scene)
    }
}

/// Returns the preparer of adopted plans, and that of plans in samples.
fn preparers(
    flow: &EnvelopeSettings,
) -> (
    CachingPreparer<PlanPreparer<'static>>,
    CachingPreparer<PlanPreparer<'static>>,
) {
    let analyst = PlanPreparer::new(flow.clone());
    let hasty = analyst.clone().stopped_unless(|| false);
    let remembering = |analyst| CachingPreparer::new(analyst, CACHE_SIZE);
    (remembering(analyst), remembering(hasty))
}

/// Planner that answers with the best plan found.
struct PreselectingPlanner<'a> {
    rehearse: SharedRolloutPolicy,
    planner: Box<dyn Planner + 'a>,
}

impl Planner for PreselectingPlanner<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let chosen = self.rehearse.get().chosen_for(task, situation);
        match chosen.filter(|_| !self.planner.is_recorded()) {
            Some(plan) => PlannerAnswer::from(PlanAnswer::Plan(plan)),
            None => self.planner.plan(task, situation),
        }
    }

    fn expect(&mut self, task: &Task, situation: &Situation) {
        self.planner.expect(task, situation);
    }
}

/// An alternative.
#[derive(Clone)]
enum Alternative {
    /// The executor's own decision; the executor continues.
    Unchanged,
    /// This executor adopts the remaining plan.
    AdoptRemaining(ExecutorSpec, Box<PreparedPlan>),
    /// This executor adopts another plan, made for this situation.
    Replan(ExecutorSpec, Option<(Situation, TimeTriggeredPlan)>),
    /// No action is started before this time.
    WaitUntil(Rational),
}

/// The best alternative, with its success rate and that of the executor's decision.
#[derive(Clone)]
struct Choice {
    alternative: usize,
    value: Rational,
    current: Rational,
    is_fine: bool,
}

impl RolloutEvaluator for RolloutPolicy {
    fn watched_facts(&self, task: &Task) -> Vec<FactId> {
        let events = self.rollouts.world.exogenous.iter();
        let facts = events.filter_map(|event| match &event.change {
            ExogenousChange::Fact(name, _) => task.fact_named(name),
            ExogenousChange::Value(..) => None,
        });
        let mut facts: Vec<FactId> = facts.collect();
        facts.sort_unstable();
        facts.dedup();
        facts
    }

    fn informativeness(&self, action: &str) -> Informativeness {
        let world = &self.rollouts.world;
        let varies = |rule: Option<&Rule>| rule.is_some_and(|rule| !rule.is_certain());
        let by_lasting = !world.reports.is_perfect()
            || varies(world.duration_rule(action))
            || varies(world.delay_rule(action))
            || world.failure_rule(action).is_some();
        let mut amounts = world.amounts.iter();
        Informativeness {
            while_running: by_lasting,
            on_end: by_lasting || amounts.any(|amount| amount.action.matches(action)),
        }
    }

    fn is_time_informative(&self) -> bool {
        let world = &self.rollouts.world;
        !world.exogenous.is_empty() || !world.hazards.is_empty()
    }

    fn evaluate(&mut self, scene: &DecisionPoint<'_>) -> RolloutResult {
        self.chosen = None;
        self.set_goal(scene.belief.task().goal());
        let is_beginning = scene.is_plan_new && scene.belief.time().is_zero();
        let steps = scene.remaining_steps.to_vec();
        let plan = TimeTriggeredPlan { steps };
        let known = self
            .initial_results
            .iter()
            .find(|(known, _)| *known == plan);
        if let Some((_, choice)) = known.filter(|_| is_beginning) {
            let choice = choice.clone();
            let ways = if choice.alternative == 0 {
                vec![Alternative::Unchanged]
            } else {
                self.alternatives_with_current_plan(scene)
            };
            return self.result_of(ways, &choice);
        }
        let (ways, choice) = self.choose(scene);
        if is_beginning {
            self.initial_results.push((plan, choice.clone()));
        }
        self.result_of(ways, &choice)
    }
}

impl RolloutPolicy {
    /// Creates it for runs like those of `rollouts`, with `planner` for new plans.
    pub fn new(rollouts: Rollouts, planner: Embedded<'static>) -> Self {
        let mut rollouts = rollouts;
        let planning_time = match &rollouts.settings.planning_time {
            PlanningTime::Seconds(seconds) => seconds.clone(),
            PlanningTime::Measured => Rational::ZERO,
        };
        rollouts.settings.planning_time = PlanningTime::Seconds(planning_time.clone());
        rollouts.settings.monitors_slack = false;
        rollouts.settings.plans_in_background = false;
        rollouts.settings.prepares_in_background = false;
        if let Some(replanning) = &mut rollouts.replanning {
            replanning.improve_states = 0;
            replanning.all_states = SAMPLE_STATES;
        }
        let (preparer, hasty) = preparers(&rollouts.flow);
        Self {
            planner,
            preparer,
            sample_preparer: hasty,
            planning_time,
            rollouts,
            chosen: None,
            initial_results: Vec::new(),
            goal: None,
        }
    }

    /// Discards results for another goal.
    fn set_goal(&mut self, goal: &Condition) {
        if self
            .goal
            .replace(goal.clone())
            .is_some_and(|known| known != *goal)
        {
            (self.preparer, self.sample_preparer) = preparers(&self.rollouts.flow);
            self.initial_results.clear();
        }
    }

    /// Takes the best plan for a situation, if it is known.
    fn chosen_for(&mut self, task: &Task, situation: &Situation) -> Option<TimeTriggeredPlan> {
        let (known, plan) = self.chosen.take()?;
        let mut plan = renumbered(task, &plan).filter(|_| known == *situation)?;
        // Plans contain running actions as the situation defines them.
        for (step, running) in plan.steps.iter_mut().zip(&situation.running) {
            step.action = running.action.clone();
        }
        Some(plan)
    }

    fn result_of(&mut self, mut ways: Vec<Alternative>, choice: &Choice) -> RolloutResult {
        let way = ways.swap_remove(choice.alternative.min(ways.len().saturating_sub(1)));
        let choice_of = match way {
            Alternative::Unchanged => RolloutChoice::FollowExecutor,
            Alternative::WaitUntil(until) => RolloutChoice::WaitUntil(until),
            Alternative::AdoptRemaining(executor, mission) => {
                RolloutChoice::HandOver(self.build_executor(&executor, None), mission)
            }
            Alternative::Replan(_, plan) => {
                self.chosen = plan;
                RolloutChoice::Replan
            }
        };
        RolloutResult {
            choice: choice_of,
            value: choice.value.clone(),
            executor_value: choice.current.clone(),
            are_alternatives_skipped: choice.is_fine,
        }
    }

    fn build_executor(
        &self,
        executor: &ExecutorSpec,
        orders: Option<OrderCache>,
    ) -> Box<dyn Executor> {
        executor.build(ExecutorServices {
            order_cache: orders,
            likelihoods: Arc::clone(&self.rollouts.likelihoods),
            ..ExecutorServices::from(Box::new(ExactRegion))
        })
    }

    /// Returns the alternatives with the present plan, beginning with the executor's decision.
    fn alternatives_with_current_plan(&mut self, scene: &DecisionPoint<'_>) -> Vec<Alternative> {
        let mut ways = vec![Alternative::Unchanged];
        let task = scene.belief.task();
        let now = scene.belief.time();
        let begins = now.is_zero() && scene.belief.running().is_empty();
        let (situation, running) = if begins {
            (Situation::initial(task), Vec::new())
        } else {
            situation_at(
                scene.belief,
                now + task.epsilon(),
                OverrunEstimate::QuarterLonger,
            )
        };
        let Some(rest) = remaining_plan_of(task, &situation, scene.remaining_steps.to_vec()) else {
            return ways;
        };
        let role = if scene.is_plan_new {
            Role::FirstPlan
        } else {
            Role::RemainingPlan
        };
        // The registry begins with the baselines. Of equally good executors, the last one is used.
        for executor in executors::with_role(role).rev() {
            let wanted = PreparationRequest {
                task,
                plan: &rest,
                situation: &situation,
                running: &running,
                now,
                need: executor.needs().plan,
            };
            if let Ok(mission) = wanted.prepare_now(&mut self.preparer) {
                ways.push(Alternative::AdoptRemaining(executor, Box::new(mission)));
            }
        }
        ways
    }

    /// Adds the alternatives of replanning and waiting.
    fn add_replanning_and_waiting(
        &mut self,
        scene: &DecisionPoint<'_>,
        ways: &mut Vec<Alternative>,
    ) {
        if scene.is_plan_new {
            return;
        }
        let task = scene.belief.task();
        let time = scene.belief.time() + &self.planning_time + task.epsilon();
        let (situation, _) = situation_at(scene.belief, time, OverrunEstimate::QuarterLonger);
        for plan in self.plans(&task.with_own_table(), &situation) {
            for executor in executors::with_role(Role::Evaluation) {
                let plan = Some((situation.clone(), plan.clone()));
                ways.push(Alternative::Replan(executor, plan));
            }
        }
        if let Some(until) = scene.belief.next_timed() {
            ways.push(Alternative::WaitUntil(until + task.epsilon()));
        }
    }

    /// Returns the planner's plan; without running actions, also other plans.
    fn plans(&self, task: &Task, situation: &Situation) -> Vec<TimeTriggeredPlan> {
        if !situation.running.is_empty() {
            return match self.planner.plan_with_state_count(task, situation).0 {
                PlanAnswer::Plan(plan) => vec![plan],
                _ => Vec::new(),
            };
        }
        let limits = Limits {
            most_states: self.planner.most_states,
            improve_states: self.planner.improve_states,
            other_states: PLAN_STATES,
            searches: MAX_SEARCHES,
            work: self.planner.work,
            first_plan_factor: self.planner.first_plan_factor,
        };
        let (world, settings) = (&*self.rollouts.world, self.planner.settings.clone());
        let mut source = Candidates::new(task, situation, Some(world), settings, limits);
        let plans = std::iter::from_fn(|| source.next(&mut |_| true));
        plans.take(MAX_PLANS).map(|it| it.plan).collect()
    }

    /// Returns the alternatives, and the choice among them. Alternatives to the executor's decision
    /// are prepared only if its first samples fail.
    fn choose(&mut self, scene: &DecisionPoint<'_>) -> (Vec<Alternative>, Choice) {
        let budget = work::Budget::new(self.planner.work);
        let mut stage = SampleSet::new(scene, &self.rollouts);
        let mut first = Vec::new();
        for sample in 0..FIRST_SAMPLES {
            first.push(stage.succeeds(self, scene, &Alternative::Unchanged, sample));
            if budget.is_spent() {
                break;
            }
        }
        let failed = first.iter().filter(|success| !**success).count();
        let few = match scene {
            _ if scene.is_plan_new || scene.is_plan_abandoned => 0,
            _ if has_only_expected_events(scene) => TOLERATED_WITHOUT_DEVIATION,
            _ => TOLERATED_AFTER_FAILURE,
        };
        if failed <= few {
            let share = Rational::ONE - count(failed as u64) / count(first.len() as u64);
            let choice = Choice {
                alternative: 0,
                value: share.clone(),
                current: share,
                is_fine: true,
            };
            return (vec![Alternative::Unchanged], choice);
        }
        let mut ways = self.alternatives_with_current_plan(scene);
        self.add_replanning_and_waiting(scene, &mut ways);
        let rules = if scene.is_plan_new {
            Rules {
                rounds: &NEW_PLAN_ROUNDS,
                is_halving: false,
                margin: Some(MARGIN),
            }
        } else {
            Rules {
                rounds: &ROUNDS,
                is_halving: true,
                margin: None,
            }
        };
        let (tallies, leader) = race(ways.len(), &rules, &mut |place, sample| {
            let looked = usize::try_from(sample).ok().and_then(|it| first.get(it));
            if let (0, Some(known)) = (place, looked) {
                return Some(*known);
            }
            (!budget.is_spent()).then(|| stage.succeeds(self, scene, &ways[place], sample))
        });
        let is_ahead = if scene.is_plan_new || scene.is_plan_abandoned {
            let margin = if scene.is_plan_new { MARGIN } else { u64::MAX };
            let (best, own) = (tallies[leader].successes(), tallies[0].successes());
            best > own && (best - own).saturating_mul(margin) >= tallies[leader].samples()
        } else {
            // The best of many alternatives may be ahead by chance, so its lead is confirmed with
            // new samples.
            tallies[0].is_behind(&tallies[leader]) && {
                let mut again = |way: &Alternative| {
                    let mut samples = FIRST_CONFIRMATION_SAMPLE
                        ..FIRST_CONFIRMATION_SAMPLE + ROUNDS[ROUNDS.len() - 1];
                    samples.try_fold(Vec::new(), |mut results, sample| {
                        results.push(stage.succeeds(self, scene, way, sample));
                        (!budget.is_spent()).then_some(results)
                    })
                };
                let both = again(&ways[0]).zip(again(&ways[leader]));
                both.is_some_and(|(own, leader)| is_behind(&own, &leader))
            }
        };
        let way = if is_ahead { leader } else { 0 };
        let choice = Choice {
            alternative: way,
            value: share(&tallies[way]),
            current: share(&tallies[0]),
            is_fine: false,
        };
        (ways, choice)
    }
}

/// Returns `true` if all recent events are starts and successful ends.
fn has_only_expected_events(scene: &DecisionPoint<'_>) -> bool {
    let is_good = |news: &PlanEvent| match news {
        PlanEvent::Started { .. } => true,
        PlanEvent::Ended { ending, .. } => *ending == Ending::Succeeded,
        _ => false,
    };
    scene.plan_events.iter().all(is_good)
}

fn count(number: u64) -> Rational {
    Rational::from(i64::try_from(number).unwrap_or(i64::MAX))
}

fn share(tally: &Tally) -> Rational {
    count(tally.successes()) / count(tally.samples().max(1))
}
