//! Choice of the first plan of a run.

use std::fmt;
use std::ops::ControlFlow;
use std::str::FromStr;
use std::sync::Arc;

use elbowroom_execution::{PlanAnswer, Planner, PlannerAnswer, Shortfall};
use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::{Rational, work};
use elbowroom_plan::partial_order::partial_order;
use elbowroom_planner::embedded;
use elbowroom_probability::{
    Likelihoods, Model, OrderSearch, SearchSettings, SearchState, Semantics,
};
use serde::{Deserialize, Serialize};

use crate::candidates::{Candidate, Candidates, Limits};
use crate::planners::{CERTIFICATE_WORK, FIRST_PLAN_FACTOR, without_plan};
use crate::propositional::with_fixed_durations;
use crate::race::{Rules, race};
use crate::renumbering::renumbered;
use crate::rollouts::{RolloutSession, Rollouts};

/// Maximum number of compared plans.
const MAX_PLANS: usize = 12;

/// Maximum number of variants of the problem to plan for.
const MAX_SEARCHES: usize = 20;

/// Number of samples of the first plan before other plans are made.
const FIRST_SAMPLES: u64 = 100;

/// Maximum number of actions in sampled plans, summed over all samples. It limits the time of the
/// choice among plans of hundreds of actions.
const MAX_ACTIONS: u64 = 50_000;

/// Minimum number of states for all plans but the first.
const LEAST_OTHER_STATES: u64 = 10_000;

/// Maximum number of partial orders in the search for the likeliest order of a plan.
const MAX_SEQUENCES: usize = 5_000;

/// Criterion for the first plan of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FirstPlan {
    /// The planner's plan: the shortest that it finds, or the best by the problem's metric.
    #[default]
    Shortest,
    /// The likeliest of several plans of the embedded planner: with a world, the plan whose samples
    /// reach the goal most often; with likelihoods only, the plan whose actions are likeliest to
    /// succeed.
    Likeliest,
}

/// The name of an unknown [`FirstPlan`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a first plan is `shortest` or `likeliest`, not `{0}`")]
pub struct UnknownFirstPlan(String);

impl FirstPlan {
    /// Returns `true` if it is the planner's plan.
    pub fn is_shortest(&self) -> bool {
        *self == Self::Shortest
    }

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shortest => "shortest",
            Self::Likeliest => "likeliest",
        }
    }
}

impl fmt::Display for FirstPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for FirstPlan {
    type Err = UnknownFirstPlan;

    fn from_str(name: &str) -> Result<Self, UnknownFirstPlan> {
        let all = [Self::Shortest, Self::Likeliest];
        let known = all.into_iter().find(|known| known.name() == name);
        known.ok_or_else(|| UnknownFirstPlan(name.to_owned()))
    }
}

/// Success probability of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// An estimate from samples.
    Sampled {
        /// Number of successful samples.
        successes: u64,
        /// Number of samples.
        samples: u64,
    },
    /// The exact probability that all its actions succeed and the goal holds after them.
    Exact(f64),
}

impl Value {
    /// Returns the probability; 0 without samples.
    #[expect(clippy::cast_precision_loss, reason = "some hundred samples")]
    pub fn probability(self) -> f64 {
        match self {
            Self::Exact(probability) => probability,
            Self::Sampled { samples: 0, .. } => 0.0,
            Self::Sampled { successes, samples } => successes as f64 / samples as f64,
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.0} %", self.probability() * 100.0)
    }
}

/// The chosen plan, and the comparison behind the choice.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The plan.
    pub plan: TimeTriggeredPlan,
    /// The variant of the problem that it was made for, in words; empty if it is the shortest plan.
    pub made_for: String,
    /// Success probability of the plan.
    pub value: Value,
    /// Success probability of the shortest plan.
    pub shortest: Value,
    /// Number of compared plans.
    pub plans: usize,
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            made_for,
            value,
            shortest,
            plans,
            ..
        } = self;
        let samples = match value {
            Value::Sampled { samples, .. } => format!(" of {samples} samples of the world"),
            Value::Exact(_) => String::new(),
        };
        match (*plans, made_for.is_empty()) {
            (0 | 1, _) => write!(f, "the shortest plan was kept: {value}{samples}"),
            (_, true) => write!(
                f,
                "the shortest of {plans} plans is the likeliest: {value}{samples}"
            ),
            (_, false) => write!(
                f,
                "chosen among {plans} plans: {value}{samples}, against {shortest} of the \
                 shortest; made {made_for}"
            ),
        }
    }
}

/// Settings of the choice.
pub struct PlanSelector<'a> {
    /// Settings of the embedded planner.
    pub settings: embedded::Settings,
    /// Maximum number of states for the first plan. All other plans together may take the same
    /// number, and at least 10,000.
    pub most_states: u64,
    /// See [`Embedded::improve_states`](super::Embedded::improve_states).
    pub improve_states: u64,
    /// Work limit of the choice, in units of [`elbowroom_num::work`]. If it is spent, the plan is
    /// the best so far. The search for a first plan may take
    /// [`first_plan_factor`](super::Embedded::first_plan_factor) times as much.
    pub work: u64,
    /// Knowledge of the world.
    pub knowledge: WorldKnowledge,
    /// Called often; if it returns `false`, the plan is the best so far.
    pub may_continue: &'a (dyn Fn() -> bool + Sync),
}

/// Knowledge of the world.
#[derive(Clone)]
pub enum WorldKnowledge {
    /// Distributions: plans are sampled.
    World(Rollouts),
    /// Likelihoods of actions and facts, independent of time.
    Likelihoods {
        /// The likelihoods.
        likelihoods: Arc<Likelihoods>,
        /// `true` if the executor chooses the likeliest order of a plan's actions.
        reorders: bool,
    },
}

impl PlanSelector<'_> {
    /// Returns the likeliest plan of a task from a situation without running actions.
    ///
    /// The result depends on the task, the situation and the knowledge only, not on the run's seed.
    ///
    /// # Errors
    /// The planner's answer, if it has no plan.
    pub fn choose(&self, task: &Task, situation: &Situation) -> Result<Choice, PlanAnswer> {
        let budget = work::Budget::new(self.work);
        // Planning must not add facts to the task's own table.
        let thought = task.with_own_table();
        let world = match &self.knowledge {
            WorldKnowledge::World(rollouts) => Some(&*rollouts.world),
            WorldKnowledge::Likelihoods { .. } => None,
        };
        let limits = Limits {
            most_states: self.most_states,
            improve_states: self.improve_states,
            other_states: self.most_states.max(LEAST_OTHER_STATES),
            searches: MAX_SEARCHES,
            work: self.work,
            first_plan_factor: FIRST_PLAN_FACTOR,
        };
        let settings = self.settings.clone();
        let mut source = Candidates::new(&thought, situation, world, settings, limits);
        let may_continue = &mut |_| (self.may_continue)();
        let Some(first) = source.next(may_continue) else {
            return Err(self.no_plan(task, situation, source.answer()));
        };
        let mut plans = vec![first];
        let (values, best) = match &self.knowledge {
            WorldKnowledge::World(rollouts) => {
                self.estimate_by_samples((&thought, budget), rollouts, &mut source, &mut plans)
            }
            WorldKnowledge::Likelihoods {
                likelihoods,
                reorders,
            } => {
                plans.extend(std::iter::from_fn(|| source.next(may_continue)).take(MAX_PLANS - 1));
                let odds = |plan: &Candidate| {
                    let odds = order_probability(&thought, &plan.plan, likelihoods, *reorders);
                    Value::Exact(odds.unwrap_or_default())
                };
                let values: Vec<Value> = plans.iter().map(odds).collect();
                let best = index_of_best(&values);
                (values, best)
            }
        };
        let count = plans.len();
        let chosen = plans.swap_remove(best);
        let plan = renumbered(task, &chosen.plan);
        Ok(Choice {
            plan: plan.unwrap_or(chosen.plan),
            made_for: chosen.made_for,
            value: values[best],
            shortest: values[0],
            plans: count,
        })
    }

    /// Estimates the values of plans by samples. Other plans than the first are made only if a
    /// sample of the first one fails.
    fn estimate_by_samples(
        &self,
        (task, budget): (&Task, work::Budget),
        rollouts: &Rollouts,
        source: &mut Candidates<'_>,
        plans: &mut Vec<Candidate>,
    ) -> (Vec<Value>, usize) {
        let mut tryout = RolloutSession::new(
            task,
            rollouts.clone(),
            budget.remaining(),
            self.may_continue,
        );
        let mut first = Vec::new();
        let mut left = MAX_ACTIONS;
        let mut afford = |plan: &Candidate, floor: u64| {
            left = left.saturating_sub(plan.plan.steps.len() as u64);
            left > floor && !budget.is_spent() && (self.may_continue)()
        };
        for sample in 0..FIRST_SAMPLES {
            if !afford(&plans[0], MAX_ACTIONS / 2) {
                break;
            }
            first.push(tryout.succeeds(&plans[0].plan, sample));
        }
        let successes = first.iter().filter(|success| **success).count() as u64;
        if successes < first.len() as u64 && !budget.is_spent() && (self.may_continue)() {
            let may_continue = &mut |_| (self.may_continue)();
            plans.extend(std::iter::from_fn(|| source.next(may_continue)).take(MAX_PLANS - 1));
        }
        if plans.len() == 1 {
            let samples = first.len() as u64;
            return (vec![Value::Sampled { successes, samples }], 0);
        }
        let (tallies, best) = race(plans.len(), &Rules::default(), &mut |place, sample| {
            let looked = usize::try_from(sample).ok().and_then(|it| first.get(it));
            if let (0, Some(known)) = (place, looked) {
                return Some(*known);
            }
            afford(&plans[place], 0).then(|| tryout.succeeds(&plans[place].plan, sample))
        });
        let values = tallies.iter().map(|tally| Value::Sampled {
            successes: tally.successes(),
            samples: tally.samples(),
        });
        (values.collect(), best)
    }

    fn no_plan(
        &self,
        task: &Task,
        situation: &Situation,
        answer: Option<&embedded::Answer>,
    ) -> PlanAnswer {
        let limits = (self.most_states, CERTIFICATE_WORK);
        match answer {
            Some(answer) => without_plan(answer, (task, situation), limits, self.may_continue),
            None => PlanAnswer::NotFound {
                why: "planning was interrupted".to_owned(),
            },
        }
    }
}

fn index_of_best(values: &[Value]) -> usize {
    let mut best = 0;
    for (place, value) in values.iter().enumerate() {
        // Differences by rounding are ignored.
        if value.probability() > values[best].probability() + 1e-12 {
            best = place;
        }
    }
    best
}

/// Returns P(A ∩ G) of a plan's own order, or of its best one; `None` if it has none, or if it
/// cannot be computed.
fn order_probability(
    task: &Task,
    plan: &TimeTriggeredPlan,
    likelihoods: &Likelihoods,
    reorders: bool,
) -> Option<f64> {
    let task = &Arc::new(task.clone());
    let ordered = partial_order(task, &with_fixed_durations(plan));
    let by_step = ordered.instance_of_step.iter().zip(&plan.steps);
    let mut steps: Vec<_> = by_step.collect();
    steps.sort_by_key(|(id, _)| **id);
    let steps: Vec<Step> = steps.into_iter().map(|(_, step)| step.clone()).collect();
    let model = Model::new(Arc::clone(task), ordered, likelihoods, Semantics::Paper).ok()?;
    let search = OrderSearch::new(model, SearchSettings::default());
    let as_planned = search.timed_sequence(&steps);
    let initial = SearchState::initial_with_beliefs(task, likelihoods);
    let own = search.order_of(&initial, &as_planned).ok();
    let own = own.map(|order| order.probability);
    if !reorders {
        return own;
    }
    let mut search = search.beginning_with(as_planned);
    let found = search.best_order(&initial, &mut |progress| {
        if progress.sequences >= MAX_SEQUENCES {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    let best = found.ok()?.order.map(|order| order.probability);
    [own, best].into_iter().flatten().reduce(f64::max)
}

/// A planner whose first plan is [chosen](PlanSelector).
pub struct SelectingPlanner<'a> {
    /// Planner of all later plans.
    pub inner: Box<dyn Planner + 'a>,
    /// Chooser of the first plan; `None` after the choice.
    pub chooser: Option<PlanSelector<'a>>,
    /// Latest start of the run. Later requests are delegated to `inner`.
    pub latest_start: Rational,
    /// Clock for the planning time, in seconds.
    pub clock: &'a (dyn Fn() -> Rational + Sync),
}

impl Planner for SelectingPlanner<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let is_beginning = situation.running.is_empty() && situation.time <= self.latest_start;
        let Some(chooser) = self.chooser.take().filter(|_| is_beginning) else {
            return self.inner.plan(task, situation);
        };
        let begun = (self.clock)();
        let (answer, remark) = match chooser.choose(task, situation) {
            Ok(choice) => {
                let remark = choice.to_string();
                (PlanAnswer::Plan(choice.plan), Some(remark))
            }
            Err(answer) => (answer, None),
        };
        PlannerAnswer {
            answer,
            seconds: Some((self.clock)() - begun),
            remark,
            shortfall: Shortfall::default(),
        }
    }

    fn expect(&mut self, task: &Task, situation: &Situation) {
        self.inner.expect(task, situation);
    }
}
