//! Comparison of the alternatives of an executor in samples of the world: [`Rehearse`].

mod stage;

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom_execution::executors::{ExecutorSpec, Means, Orders};
use elbowroom_execution::run::PlanningTime;
use elbowroom_execution::run::here::{Guess, rest_of, situation_at};
use elbowroom_execution::{
    Ending, Executor, Mission, News, PlanAnswer, Planner, PlannerAnswer, Rehearsal, Rehearsed,
    Rehearsing, Scene, Tells, Wanted,
};
use elbowroom_model::ground::{Condition, FactId};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::{Rational, work};
use elbowroom_sim::{ExogenousChange, Rule};

use super::first_plan::renumbered;
use super::race::{Rules, Tally, is_behind, race};
use super::rollouts::Rollouts;
use crate::flow;

use super::{Analyst, Candidates, Embedded, Limits, RememberingPreparer, WholeRegion};
use stage::Stage;

/// Executors that may adopt a new plan instead of `live`.
const OF_BEGINNINGS: [&str; 3] = ["adaptable", "esterel", "guarded"];

/// Executors that may adopt the remaining plan. Others need its envelope, which takes long to
/// compute.
const OF_RESTS: [&str; 2] = ["adaptable", "esterel"];

/// Executors for new plans.
const OF_NEW_PLANS: [&str; 2] = ["live", "adaptable"];

/// Number of samples at the end of each round.
const ROUNDS: [u64; 4] = [25, 50, 100, 200];

/// Number of samples at the end of each round, for executors of a new plan.
const ROUNDS_OF_NEW: [u64; 6] = [50, 100, 200, 400, 800, 1600];

/// Number of samples of the executor's own decision. If enough of them succeed, no alternatives are
/// sampled.
const FIRST_LOOK: u64 = 25;

/// Number of these samples that may fail without a comparison of alternatives: if no action has
/// failed, and if one has failed but the plan is not to be abandoned.
const FEW: usize = 2;
const FEWER: usize = 1;

/// First sample of the confirmation of the best alternative.
const AGAIN: u64 = 1_000_000;

/// Maximum number of other plans, and of states for all of them but the first.
const MOST_PLANS: usize = 4;
const PLAN_STATES: u64 = 2_000;

/// Maximum number of variants of the problem to plan for.
const MOST_SEARCHES: usize = 6;

/// Maximum number of states for all new plans in the samples of one scene.
const SAMPLE_STATES: u64 = 4_000;

/// The lead that another executor needs to adopt a new plan instead of `live`: one sample in
/// `MARGIN`.
const MARGIN: u64 = 200;

/// Size of the preparers' caches.
const MEMORY: usize = 2_000;

/// First seed of the samples, far from seeds that users choose.
const SEED: u64 = 0x7265_6865_0000_0000;

/// Evaluates the alternatives of an executor in samples of the world file, conditioned on the
/// observations. The alternatives are to continue, to hand the remaining plan over to another
/// executor (which retries failed actions, or skips unnecessary ones), to replan, and to wait.
///
/// All alternatives have the same samples (common random numbers), and those that are significantly
/// behind get no further samples. The effort is limited by counts, so results do not depend on a
/// clock. When the planner's work limit is spent, the samples taken until then decide.
pub struct Rehearse {
    rollouts: Rollouts,
    planner: Embedded<'static>,
    planning_time: Rational,
    /// Preparer of adopted plans.
    preparer: RememberingPreparer<Analyst>,
    /// Preparer of plans in samples, with a quickly computed envelope.
    hasty: RememberingPreparer<Analyst>,
    /// The best plan for a situation, until the planner is called for it.
    chosen: Option<(Situation, TimeTriggeredPlan)>,
    /// Results for the beginnings of runs, by plan.
    beginnings: Vec<(TimeTriggeredPlan, Choice)>,
    /// The goal of the cached results.
    goal: Option<Condition>,
}

/// A shared [`Rehearse`] that implements both ports.
#[derive(Clone)]
pub struct SharedRehearse(Arc<Mutex<Rehearse>>);

impl SharedRehearse {
    /// Creates a shared handle.
    pub fn new(rehearse: Rehearse) -> Self {
        Self(Arc::new(Mutex::new(rehearse)))
    }

    /// Returns a planner that answers with the best plan, if one was found for the situation, and
    /// otherwise calls `planner`.
    pub(super) fn before<'a>(&self, planner: Box<dyn Planner + 'a>) -> Box<dyn Planner + 'a> {
        Box::new(Chosen {
            rehearse: self.clone(),
            planner,
        })
    }

    fn get(&self) -> MutexGuard<'_, Rehearse> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Rehearsal for SharedRehearse {
    fn watched(&self, task: &Task) -> Vec<FactId> {
        self.get().watched(task)
    }

    fn tells(&self, action: &str) -> Tells {
        self.get().tells(action)
    }

    fn tells_by_itself(&self) -> bool {
        self.get().tells_by_itself()
    }

    fn rehearse(&mut self, scene: &Scene<'_>) -> Rehearsed {
        self.get().rehearse(scene)
    }
}

/// Returns the preparer of adopted plans, and that of plans in samples.
fn preparers(
    flow: &flow::Settings,
) -> (RememberingPreparer<Analyst>, RememberingPreparer<Analyst>) {
    let analyst = Analyst::new(flow.clone());
    let hasty = analyst.clone().until(|| ControlFlow::Break(()));
    let remembering = |analyst| RememberingPreparer::new(analyst, MEMORY);
    (remembering(analyst), remembering(hasty))
}

/// Planner that answers with the best plan found.
struct Chosen<'a> {
    rehearse: SharedRehearse,
    planner: Box<dyn Planner + 'a>,
}

impl Planner for Chosen<'_> {
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
enum Way {
    /// The executor's own decision; the executor continues.
    AsDecided,
    /// This executor adopts the remaining plan.
    TakesUp(ExecutorSpec, Box<Mission>),
    /// This executor adopts another plan, made for this situation.
    Replans(ExecutorSpec, Option<(Situation, TimeTriggeredPlan)>),
    /// No action is started before this time.
    WaitsUntil(Rational),
}

/// The best alternative, with its success rate and that of the executor's decision.
#[derive(Clone)]
struct Choice {
    way: usize,
    value: Rational,
    present: Rational,
    is_fine: bool,
}

impl Rehearsal for Rehearse {
    fn watched(&self, task: &Task) -> Vec<FactId> {
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

    fn tells(&self, action: &str) -> Tells {
        let world = &self.rollouts.world;
        let varies = |rule: Option<&Rule>| rule.is_some_and(|rule| !rule.is_certain());
        let by_lasting = !world.reports.is_perfect()
            || varies(world.duration_rule(action))
            || varies(world.delay_rule(action))
            || world.failing(action).is_some();
        let mut amounts = world.amounts.iter();
        Tells {
            by_lasting,
            by_ending: by_lasting || amounts.any(|amount| amount.action.matches(action)),
        }
    }

    fn tells_by_itself(&self) -> bool {
        let world = &self.rollouts.world;
        !world.exogenous.is_empty() || !world.hazards.is_empty()
    }

    fn rehearse(&mut self, scene: &Scene<'_>) -> Rehearsed {
        self.chosen = None;
        self.set_goal(scene.belief.task().goal());
        let ways = self.first_ways(scene);
        let is_beginning = scene.is_new && scene.belief.time().is_zero();
        let steps = scene.left.to_vec();
        let plan = TimeTriggeredPlan { steps };
        let known = self.beginnings.iter().find(|(known, _)| *known == plan);
        if let Some((_, choice)) = known.filter(|_| is_beginning) {
            let choice = choice.clone();
            return self.answer(ways, &choice);
        }
        let (ways, choice) = self.choose(scene, ways);
        if is_beginning {
            self.beginnings.push((plan, choice.clone()));
        }
        self.answer(ways, &choice)
    }
}

impl Rehearse {
    /// Creates it for runs like those of `rollouts`, with `planner` for new plans.
    pub fn new(rollouts: Rollouts, planner: Embedded<'static>) -> Self {
        let mut rollouts = rollouts;
        let planning_time = match &rollouts.settings.planning_time {
            PlanningTime::Seconds(seconds) => seconds.clone(),
            PlanningTime::Measured => Rational::ZERO,
        };
        rollouts.settings.planning_time = PlanningTime::Seconds(planning_time.clone());
        rollouts.settings.watches_room = false;
        rollouts.settings.plans_aside = false;
        rollouts.settings.readies_aside = false;
        if let Some(replanning) = &mut rollouts.replanning {
            replanning.improve_states = 0;
            replanning.all_states = SAMPLE_STATES;
        }
        let (preparer, hasty) = preparers(&rollouts.flow);
        Self {
            planner,
            preparer,
            hasty,
            planning_time,
            rollouts,
            chosen: None,
            beginnings: Vec::new(),
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
            (self.preparer, self.hasty) = preparers(&self.rollouts.flow);
            self.beginnings.clear();
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

    fn answer(&mut self, mut ways: Vec<Way>, choice: &Choice) -> Rehearsed {
        let way = ways.swap_remove(choice.way.min(ways.len().saturating_sub(1)));
        let choice_of = match way {
            Way::AsDecided => Rehearsing::AsDecided,
            Way::WaitsUntil(until) => Rehearsing::WaitsUntil(until),
            Way::TakesUp(executor, mission) => {
                Rehearsing::HandsOver(self.built(&executor, None), mission)
            }
            Way::Replans(_, plan) => {
                self.chosen = plan;
                Rehearsing::Replans
            }
        };
        Rehearsed {
            choice: choice_of,
            value: choice.value.clone(),
            present: choice.present.clone(),
            is_fine: choice.is_fine,
        }
    }

    fn built(&self, executor: &ExecutorSpec, orders: Option<Orders>) -> Box<dyn Executor> {
        executor.build(Means {
            orders,
            likelihoods: Arc::clone(&self.rollouts.likelihoods),
            ..Means::from(Box::new(WholeRegion))
        })
    }

    /// Returns the alternatives with the present plan, beginning with the executor's decision.
    fn first_ways(&mut self, scene: &Scene<'_>) -> Vec<Way> {
        let mut ways = vec![Way::AsDecided];
        let task = scene.belief.task();
        let now = scene.belief.time();
        let begins = now.is_zero() && scene.belief.running().is_empty();
        let (situation, running) = if begins {
            (Situation::initial(task), Vec::new())
        } else {
            situation_at(scene.belief, now + task.epsilon(), Guess::AQuarterLonger)
        };
        let Some(rest) = rest_of(task, &situation, scene.left.to_vec()) else {
            return ways;
        };
        let names: &[&str] = if scene.is_new {
            &OF_BEGINNINGS
        } else {
            &OF_RESTS
        };
        for name in names {
            let Ok(executor) = name.parse::<ExecutorSpec>() else {
                continue;
            };
            let wanted = Wanted {
                task,
                plan: &rest,
                situation: &situation,
                running: &running,
                now,
                need: executor.registered.need,
            };
            if let Ok(mission) = wanted.mission(&mut self.preparer) {
                ways.push(Way::TakesUp(executor, Box::new(mission)));
            }
        }
        ways
    }

    /// Adds the alternatives of replanning and waiting.
    fn more_ways(&mut self, scene: &Scene<'_>, ways: &mut Vec<Way>) {
        if scene.is_new {
            return;
        }
        let task = scene.belief.task();
        let time = scene.belief.time() + &self.planning_time + task.epsilon();
        let (situation, _) = situation_at(scene.belief, time, Guess::AQuarterLonger);
        for plan in self.plans(&task.with_own_table(), &situation) {
            for name in OF_NEW_PLANS {
                if let Ok(executor) = name.parse() {
                    let plan = Some((situation.clone(), plan.clone()));
                    ways.push(Way::Replans(executor, plan));
                }
            }
        }
        if let Some(until) = scene.belief.next_timed() {
            ways.push(Way::WaitsUntil(until + task.epsilon()));
        }
    }

    /// Returns the planner's plan; without running actions, also other plans.
    fn plans(&self, task: &Task, situation: &Situation) -> Vec<TimeTriggeredPlan> {
        if !situation.running.is_empty() {
            return match self.planner.counted(task, situation).0 {
                PlanAnswer::Plan(plan) => vec![plan],
                _ => Vec::new(),
            };
        }
        let limits = Limits {
            most_states: self.planner.most_states,
            improve_states: self.planner.improve_states,
            other_states: PLAN_STATES,
            searches: MOST_SEARCHES,
            work: self.planner.work,
            patience: self.planner.patience,
        };
        let (world, settings) = (&*self.rollouts.world, self.planner.settings.clone());
        let mut source = Candidates::new(task, situation, Some(world), settings, limits);
        let plans = std::iter::from_fn(|| source.next(&mut |_| true));
        plans.take(MOST_PLANS).map(|it| it.plan).collect()
    }

    fn choose(&mut self, scene: &Scene<'_>, mut ways: Vec<Way>) -> (Vec<Way>, Choice) {
        let budget = work::Budget::new(self.planner.work);
        let mut stage = Stage::new(scene, &self.rollouts);
        let mut first = Vec::new();
        for sample in 0..FIRST_LOOK {
            first.push(stage.succeeds(self, scene, &ways[0], sample));
            if budget.is_spent() {
                break;
            }
        }
        let failed = first.iter().filter(|success| !**success).count();
        let few = match scene {
            _ if scene.is_new || scene.is_given_up => 0,
            _ if is_calm(scene) => FEW,
            _ => FEWER,
        };
        if failed <= few {
            let share = Rational::ONE - count(failed as u64) / count(first.len() as u64);
            let choice = Choice {
                way: 0,
                value: share.clone(),
                present: share,
                is_fine: true,
            };
            return (ways, choice);
        }
        self.more_ways(scene, &mut ways);
        let rules = if scene.is_new {
            Rules {
                rounds: &ROUNDS_OF_NEW,
                halves: false,
                margin: Some(MARGIN),
            }
        } else {
            Rules {
                rounds: &ROUNDS,
                halves: true,
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
        let is_ahead = if scene.is_new || scene.is_given_up {
            let margin = if scene.is_new { MARGIN } else { u64::MAX };
            let (best, own) = (tallies[leader].successes(), tallies[0].successes());
            best > own && (best - own).saturating_mul(margin) >= tallies[leader].samples()
        } else {
            // The best of many alternatives may be ahead by chance, so its lead is confirmed with
            // new samples.
            tallies[0].is_behind(&tallies[leader]) && {
                let mut again = |way: &Way| {
                    let mut samples = AGAIN..AGAIN + ROUNDS[ROUNDS.len() - 1];
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
            way,
            value: share(&tallies[way]),
            present: share(&tallies[0]),
            is_fine: false,
        };
        (ways, choice)
    }
}

/// Returns `true` if all recent events are starts and successful ends.
fn is_calm(scene: &Scene<'_>) -> bool {
    let is_good = |news: &News| match news {
        News::Started { .. } => true,
        News::Ended { ending, .. } => *ending == Ending::Succeeded,
        _ => false,
    };
    scene.news.iter().all(is_good)
}

fn count(number: u64) -> Rational {
    Rational::from(i64::try_from(number).unwrap_or(i64::MAX))
}

fn share(tally: &Tally) -> Rational {
    count(tally.successes()) / count(tally.samples().max(1))
}
