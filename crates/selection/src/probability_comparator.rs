//! Plans with a great success probability in a world with known distributions.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom_execution::{
    PlanAnswer, PlanComparator, Planner, PlannerAnswer, RemainingPlan, SuccessRates,
};
use elbowroom_model::ground::{Action, Expression};
use elbowroom_model::problem::{Comparison, SchemaId};
use elbowroom_model::validate::{self, validate_from};
use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_plan::deorder::deorder;
use elbowroom_plan::{Bound, Constraint, InstanceId, StnPlan, Valuation};
use elbowroom_sim::draw::keyed;
use elbowroom_sim::{Purpose, WorldModel};
use elbowroom_stn::ConsistentNetwork;

use crate::planners::Embedded;
use crate::rewrite::set_durations;

/// Number of sampled worlds per plan.
const SAMPLES: u64 = 200;

/// Quantiles of durations to plan for, in percent.
const QUANTILES: [u64; 2] = [80, 95];

/// Number of samples for a quantile.
const QUANTILE_SAMPLES: u64 = 100;

/// First seed of the samples, far from seeds that users choose.
const SEED: u64 = 0x6f64_6473_0000_0000;

/// Chooses among several plans the one with the greatest success probability.
///
/// The planner makes plans for the problem as it is, and for variants with long durations, none
/// shorter than planned. The probability is the share of sampled worlds where no action fails and
/// the plan's network is consistent with the durations drawn from the world's distributions. It is
/// thus the probability that the plan can be scheduled if all durations are known in advance; an
/// executor that observes them during execution may have a smaller one. Amounts are those of the
/// domain.
///
/// The samples are the same for all plans, and depend only on the actions' names.
pub struct MostProbablePlanner<'a> {
    /// The model of the world.
    pub model: WorldModel,
    /// The planner.
    pub planner: Embedded<'a>,
    /// The planning time in the world's seconds.
    pub planning_time: Rational,
    quantiles: BTreeMap<(String, Rational, u64), Rational>,
}

impl Planner for MostProbablePlanner<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let begun = self.planner.clock.map(|clock| clock());
        let answer = match self.best(task, situation) {
            Ok((plan, _)) => PlanAnswer::Plan(plan),
            Err(answer) => answer,
        };
        let seconds = self
            .planner
            .clock
            .map(|clock| clock() - begun.unwrap_or_default());
        PlannerAnswer {
            seconds,
            ..PlannerAnswer::from(answer)
        }
    }
}

impl PlanComparator for MostProbablePlanner<'_> {
    fn compare(&mut self, rest: &RemainingPlan<'_>) -> Option<SuccessRates> {
        let mission = rest.prepared_plan;
        let plan = mission.plan.plan.at(&mission.plan.nominal());
        let now = rest.now - &mission.origin;
        let present = self.probability(&plan, &rest.happened, &now, 0);
        if present == Rational::ONE {
            return None;
        }
        let mut state = rest.belief.clone();
        let time = rest.now + &self.planning_time + rest.belief.task().epsilon();
        let _ = state.advance(&time);
        let situation = Situation {
            state: state.state(),
            time,
            running: Vec::new(),
        };
        // Planning must not add facts to the task's own table.
        let task = rest.belief.task().with_own_table();
        let (_, other) = self.best(&task, &situation).ok()?;
        Some(SuccessRates {
            remaining_plan: present,
            other_plan: other,
        })
    }
}

/// A shared [`MostProbablePlanner`] that implements both ports.
#[derive(Clone)]
pub struct SharedMostProbablePlanner(Arc<Mutex<MostProbablePlanner<'static>>>);

impl SharedMostProbablePlanner {
    /// Creates a shared handle.
    pub fn new(likeliest: MostProbablePlanner<'static>) -> Self {
        Self(Arc::new(Mutex::new(likeliest)))
    }

    /// Results do not depend on earlier calls, so a poisoned lock is ignored.
    fn get(&self) -> MutexGuard<'_, MostProbablePlanner<'static>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Planner for SharedMostProbablePlanner {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        self.get().plan(task, situation)
    }
}

impl PlanComparator for SharedMostProbablePlanner {
    fn compare(&mut self, rest: &RemainingPlan<'_>) -> Option<SuccessRates> {
        self.get().compare(rest)
    }
}

impl<'a> MostProbablePlanner<'a> {
    /// Creates a planner for such a world.
    pub fn new(model: WorldModel, planner: Embedded<'a>, planning_time: Rational) -> Self {
        Self {
            model,
            planner,
            planning_time,
            quantiles: BTreeMap::new(),
        }
    }

    /// Returns the likeliest plan and its probability, or the planner's answer if there is no plan.
    fn best(
        &mut self,
        task: &Task,
        situation: &Situation,
    ) -> Result<(TimeTriggeredPlan, Rational), PlanAnswer> {
        let answer = self.planner.plan(task, situation).answer;
        // Longer durations do not make it easier to find a plan.
        let PlanAnswer::Plan(plan) = answer else {
            return Err(answer);
        };
        let share = self.probability_of(task, situation, &plan);
        let mut best = (plan, share);
        // The times of running actions can no longer be chosen.
        if situation.running.is_empty() {
            for quantile in QUANTILES {
                let Some(plan) = self.slow_plan(task, situation, quantile) else {
                    continue;
                };
                let share = self.probability_of(task, situation, &plan);
                if share > best.1 {
                    best = (plan, share);
                }
            }
        }
        Ok(best)
    }

    /// Returns a plan for a world with long durations, as a plan of the task.
    fn slow_plan(
        &mut self,
        task: &Task,
        situation: &Situation,
        quantile: u64,
    ) -> Option<TimeTriggeredPlan> {
        let mut problem = task.starting_from(situation).problem().clone();
        for schema in (0..problem.schemas.len()).map(SchemaId::from) {
            let values = RefCell::new(&mut *self);
            set_durations(task, schema, &mut problem, &|name, planned| {
                // A plan with shorter durations than planned is not a plan of the task.
                let slow = values.borrow_mut().quantile(name, planned, quantile);
                slow.max(planned.clone())
            });
        }
        let slow = Task::new(problem).with_epsilon(task.epsilon().clone());
        let there = Situation {
            time: situation.time.clone(),
            state: slow.initial().clone(),
            running: Vec::new(),
        };
        let PlanAnswer::Plan(plan) = self.planner.plan(&slow, &there).answer else {
            return None;
        };
        let mut steps = Vec::with_capacity(plan.steps.len());
        for step in &plan.steps {
            let arguments = &step.action.arguments;
            let action = task.instantiate(step.action.schema, arguments).ok()?;
            let planned = fixed_duration(&action).or_else(|| step.duration.clone());
            steps.push(Step {
                start: step.start.clone(),
                duration: step.duration.as_ref().and(planned),
                action: Arc::new(action),
            });
        }
        let plan = TimeTriggeredPlan { steps };
        let settings = validate::Settings::default();
        let verdict = validate_from(task, situation, &plan, &settings);
        verdict.is_valid().then_some(plan)
    }

    /// Returns the quantile of a duration, in percent.
    fn quantile(&mut self, name: &str, planned: &Rational, quantile: u64) -> Rational {
        let key = (name.to_owned(), planned.clone(), quantile);
        if let Some(known) = self.quantiles.get(&key) {
            return known.clone();
        }
        let mut draws: Vec<Rational> = (0..QUANTILE_SAMPLES)
            .map(|sample| self.duration(sample, name, planned, 0))
            .collect();
        draws.sort();
        let index = usize::try_from(quantile * (QUANTILE_SAMPLES - 1) / 100).unwrap_or(0);
        let value = draws.swap_remove(index);
        self.quantiles.insert(key, value.clone());
        value
    }

    /// Returns the time from the command to the end, in one of the sampled worlds.
    fn duration(&self, sample: u64, name: &str, planned: &Rational, occurrence: u64) -> Rational {
        let rng = |purpose| keyed(SEED + sample, name, occurrence, purpose);
        let delay = self.model.delay(name, &mut rng(Purpose::Delay));
        delay
            + self
                .model
                .duration(name, planned, &mut rng(Purpose::Duration))
    }

    /// Returns the success probability of a plan from a situation.
    fn probability_of(
        &self,
        task: &Task,
        situation: &Situation,
        plan: &TimeTriggeredPlan,
    ) -> Rational {
        let rest = situation.remaining_task(task);
        let freed = deorder(&rest, &situation.remaining_plan(plan));
        let Ok(freed) = freed else {
            return Rational::ZERO;
        };
        let mut happened = vec![None; freed.plan.nodes.len()];
        happened[0] = Some(Rational::ZERO);
        let running = situation.running.len();
        self.probability(&freed.plan, &happened, &Rational::ZERO, running)
    }

    /// Returns the share of sampled worlds where the remaining plan works. Running actions come
    /// first in the plan, and take as long as planned.
    fn probability(
        &self,
        plan: &StnPlan,
        happened: &[Option<Rational>],
        now: &Rational,
        running: usize,
    ) -> Rational {
        let rest = RemainingNetwork::of(plan, happened, now, running);
        let works = |sample: &u64| rest.succeeds_in_sample(self, *sample);
        let successes = (0..SAMPLES).filter(works).count();
        let count = |number: usize| Rational::from(i64::try_from(number).unwrap_or(i64::MAX));
        count(successes) / Rational::from(i64::try_from(SAMPLES).unwrap_or(i64::MAX))
    }
}

/// The remaining plan.
struct RemainingNetwork {
    /// The plan with past times fixed, and no future time before now.
    plan: StnPlan,
    /// The duration constraints of future actions: the position of the constraint, the name of the
    /// action, its planned duration (the least, if the plan has a choice), and the number of
    /// earlier actions of that name.
    future_durations: Vec<(usize, String, Rational, u64)>,
}

impl RemainingNetwork {
    fn of(plan: &StnPlan, happened: &[Option<Rational>], now: &Rational, running: usize) -> Self {
        let mut plan = plan.clone();
        // Other constraints, such as ε-separation, may also relate start and end: the duration is
        // the greatest lower bound.
        let mut durations: BTreeMap<InstanceId, (usize, Rational)> = BTreeMap::new();
        for (index, constraint) in plan.constraints.iter().enumerate() {
            let Some(instance) = plan.duration_of(constraint) else {
                continue;
            };
            let has_started = happened[constraint.from.index()].is_some();
            let Bound::Finite(least) = &constraint.lower else {
                continue;
            };
            if has_started || instance.index() < running {
                continue;
            }
            let known = durations.get(&instance);
            if known.is_none_or(|(_, known)| known < least) {
                durations.insert(instance, (index, least.clone()));
            }
        }
        let mut counts: BTreeMap<&str, u64> = BTreeMap::new();
        let mut to_come = Vec::with_capacity(durations.len());
        for (instance, (index, planned)) in durations {
            let name = plan.instance(instance).action.name.as_str();
            let count = counts.entry(name).or_default();
            to_come.push((index, name.to_owned(), planned, *count));
            *count += 1;
        }
        // An observed duration follows from the times of its two ends.
        let is_over = |constraint: &Constraint| {
            happened[constraint.from.index()].is_some() && happened[constraint.to.index()].is_some()
        };
        for index in 0..plan.constraints.len() {
            if is_over(&plan.constraints[index]) {
                plan.constraints[index].lower = Bound::Infinite;
                plan.constraints[index].upper = Bound::Infinite;
            }
        }
        let plan = plan.remainder(now, |node| happened[node.index()].as_ref(), |_| true);
        Self {
            plan,
            future_durations: to_come,
        }
    }

    /// Returns `true` if the plan works in one of the sampled worlds.
    fn succeeds_in_sample(&self, odds: &MostProbablePlanner<'_>, sample: u64) -> bool {
        let mut plan = self.plan.clone();
        for (index, name, planned, occurrence) in &self.future_durations {
            let mut rng = keyed(SEED + sample, name, *occurrence, Purpose::Failure);
            if odds.model.fails(name, &mut rng) {
                return false;
            }
            let duration = odds.duration(sample, name, planned, *occurrence);
            plan.constraints[*index].lower = Bound::Finite(duration.clone());
            plan.constraints[*index].upper = Bound::Finite(duration);
        }
        ConsistentNetwork::try_from(plan.network(&Valuation::default())).is_ok()
    }
}

/// Returns the duration if the domain fixes it to a number.
fn fixed_duration(action: &Action) -> Option<Rational> {
    let [only] = action.durative()?.duration.as_slice() else {
        return None;
    };
    match (&only.comparison, &only.bound) {
        (Comparison::Equal, Expression::Constant(value)) => Some(value.clone()),
        _ => None,
    }
}
