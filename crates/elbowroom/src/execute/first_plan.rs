//! Which plan a run begins with.

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
    Circumstances, Likelihoods, Model, OrderSearch, SearchSettings, Semantics,
};
use serde::{Deserialize, Serialize};

use super::as_timed;
use super::candidates::{Candidate, Candidates, Limits};
use super::planners::{CERTIFICATE_WORK, PATIENCE, without_plan};
use super::race::{Rules, race};
use super::rollouts::{Rollouts, Tryout};

/// How many plans are compared at most.
const MOST_PLANS: usize = 12;

/// How many variants of the problem are planned for at most.
const MOST_SEARCHES: usize = 20;

/// How many samples the first plan is tried out in before others are made.
const FIRST_LOOK: u64 = 100;

/// How many actions the plans have at most that are tried out, over all samples: what bounds the
/// time that a choice takes among plans of hundreds of actions.
const MOST_ACTIONS: u64 = 50_000;

/// How many states may be looked at for all other plans than the first, in any case.
const LEAST_OTHER_STATES: u64 = 10_000;

/// How many partial orders are looked at for the likeliest order of a plan.
const MOST_SEQUENCES: usize = 5_000;

/// By what the first plan of a run is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FirstPlan {
    /// It is the planner's: the shortest that it finds, or the best by the problem's metric.
    #[default]
    Shortest,
    /// It is the plan, of several that the embedded planner makes, with which the executor reaches
    /// the goal most often in samples of the world, or, where nothing but likelihoods is known,
    /// whose actions are likeliest to succeed.
    Likeliest,
}

/// A name that is none of [`FirstPlan`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a first plan is `shortest` or `likeliest`, not `{0}`")]
pub struct UnknownFirstPlan(String);

impl FirstPlan {
    /// Whether it is the planner's.
    pub fn is_shortest(&self) -> bool {
        *self == Self::Shortest
    }

    /// By which it is mentioned.
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

/// How likely a plan is to succeed, as far as that was found out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// It was tried out.
    Sampled {
        /// How often it succeeded.
        successes: u64,
        /// In how many samples.
        samples: u64,
    },
    /// The probability that all its actions succeed and the goal holds after them.
    Exact(f64),
}

impl Value {
    /// As a number; 0 if nothing was found out.
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

/// The plan that was chosen, and among what.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The plan.
    pub plan: TimeTriggeredPlan,
    /// What it was made for, in words; empty if it is the shortest.
    pub made_for: String,
    /// How likely it is to succeed.
    pub value: Value,
    /// How likely the shortest plan is to.
    pub shortest: Value,
    /// How many plans were compared.
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
                "chosen among {plans} plans: {value}{samples}, beside {shortest} of the shortest; \
                 made {made_for}"
            ),
        }
    }
}

/// How to choose.
pub struct Chooser<'a> {
    /// How the embedded planner plans.
    pub settings: embedded::Settings,
    /// How far it looks. As many states as for the first plan, at most, and 10,000 in any case, may be
    /// looked at for all others together.
    pub most_states: u64,
    /// See [`Embedded::improve_states`](super::Embedded::improve_states).
    pub improve_states: u64,
    /// Work limit of the choice, in units of [`elbowroom_num::work`]. If it is spent, the plan is the best so far; to
    /// find a first plan may take [`PATIENCE`](super::Embedded::patience) times as much.
    pub work: u64,
    /// What is known.
    pub known: Known,
    /// Asked often whether to go on. When it says no, the plan is the best so far.
    pub goes_on: &'a (dyn Fn() -> bool + Sync),
}

/// What is known of the world.
#[derive(Clone)]
pub enum Known {
    /// Its distributions: plans are tried out.
    World(Rollouts),
    /// How likely actions and facts are to do what they should, whatever the time.
    Likelihoods {
        /// That.
        likelihoods: Arc<Likelihoods>,
        /// Whether the executor chooses the likeliest order of a plan's actions.
        reorders: bool,
    },
}

impl Chooser<'_> {
    /// The likeliest plan of a task from a situation in which nothing is under way.
    ///
    /// The same task, situation and knowledge give the same plan, whatever the run's seed.
    ///
    /// # Errors
    /// What the planner answers where it has no plan.
    pub fn choose(&self, task: &Task, situation: &Situation) -> Result<Choice, PlanAnswer> {
        let budget = work::Budget::new(self.work);
        // What is only thought of gets no numbers.
        let thought = task.with_own_table();
        let world = match &self.known {
            Known::World(rollouts) => Some(&*rollouts.world),
            Known::Likelihoods { .. } => None,
        };
        let limits = Limits {
            most_states: self.most_states,
            improve_states: self.improve_states,
            other_states: self.most_states.max(LEAST_OTHER_STATES),
            searches: MOST_SEARCHES,
            work: self.work,
            patience: PATIENCE,
        };
        let settings = self.settings.clone();
        let mut source = Candidates::new(&thought, situation, world, settings, limits);
        let goes_on = &mut |_| (self.goes_on)();
        let Some(first) = source.next(goes_on) else {
            return Err(self.no_plan(task, situation, source.answer()));
        };
        let mut plans = vec![first];
        let (values, best) = match &self.known {
            Known::World(rollouts) => {
                self.sampled((&thought, budget), rollouts, &mut source, &mut plans)
            }
            Known::Likelihoods {
                likelihoods,
                reorders,
            } => {
                plans.extend(std::iter::from_fn(|| source.next(goes_on)).take(MOST_PLANS - 1));
                let odds = |plan: &Candidate| {
                    let odds = order_odds(&thought, &plan.plan, likelihoods, *reorders);
                    Value::Exact(odds.unwrap_or_default())
                };
                let values: Vec<Value> = plans.iter().map(odds).collect();
                let best = first_of_most(&values);
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

    /// Values of plans by trying them out. Others than the first are made only if that can fail.
    fn sampled(
        &self,
        (task, budget): (&Task, work::Budget),
        rollouts: &Rollouts,
        source: &mut Candidates<'_>,
        plans: &mut Vec<Candidate>,
    ) -> (Vec<Value>, usize) {
        let mut tryout = Tryout::new(task, rollouts.clone(), budget.left(), self.goes_on);
        let mut first = Vec::new();
        let mut left = MOST_ACTIONS;
        let mut afford = |plan: &Candidate, floor: u64| {
            left = left.saturating_sub(plan.plan.steps.len() as u64);
            left > floor && !budget.is_spent() && (self.goes_on)()
        };
        for sample in 0..FIRST_LOOK {
            if !afford(&plans[0], MOST_ACTIONS / 2) {
                break;
            }
            first.push(tryout.succeeds(&plans[0].plan, sample));
        }
        let successes = first.iter().filter(|success| **success).count() as u64;
        if successes < first.len() as u64 && !budget.is_spent() && (self.goes_on)() {
            let goes_on = &mut |_| (self.goes_on)();
            plans.extend(std::iter::from_fn(|| source.next(goes_on)).take(MOST_PLANS - 1));
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
            Some(answer) => without_plan(answer, (task, situation), limits, self.goes_on),
            None => PlanAnswer::NotFound {
                why: "planning was interrupted".to_owned(),
            },
        }
    }
}

fn first_of_most(values: &[Value]) -> usize {
    let mut best = 0;
    for (place, value) in values.iter().enumerate() {
        // What differs by rounding is the same.
        if value.probability() > values[best].probability() + 1e-12 {
            best = place;
        }
    }
    best
}

/// P(A ∩ G) of a plan's own order, or of its best one; `None` if it has none, or that is beyond
/// what can be computed.
fn order_odds(
    task: &Task,
    plan: &TimeTriggeredPlan,
    likelihoods: &Likelihoods,
    reorders: bool,
) -> Option<f64> {
    let task = &Arc::new(task.clone());
    let ordered = partial_order(task, &as_timed(plan));
    let by_step = ordered.instance_of_step.iter().zip(&plan.steps);
    let mut steps: Vec<_> = by_step.collect();
    steps.sort_by_key(|(id, _)| **id);
    let steps: Vec<Step> = steps.into_iter().map(|(_, step)| step.clone()).collect();
    let model = Model::new(Arc::clone(task), ordered, likelihoods, Semantics::Paper).ok()?;
    let search = OrderSearch::new(model, SearchSettings::default());
    let as_planned = search.as_timed(&steps);
    let initial = Circumstances::believed(task, likelihoods);
    let own = search.order_of(&initial, &as_planned).ok();
    let own = own.map(|order| order.probability);
    if !reorders {
        return own;
    }
    let mut search = search.beginning_with(as_planned);
    let found = search.best_order(&initial, &mut |progress| {
        if progress.sequences >= MOST_SEQUENCES {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    let best = found.ok()?.order.map(|order| order.probability);
    [own, best].into_iter().flatten().reduce(f64::max)
}

/// The same plan with the facts of this task.
pub(crate) fn renumbered(task: &Task, plan: &TimeTriggeredPlan) -> Option<TimeTriggeredPlan> {
    let steps = plan.steps.iter().map(|step| {
        let action = task.instantiate(step.action.schema, &step.action.arguments);
        Some(Step {
            action: Arc::new(action.ok()?),
            start: step.start.clone(),
            duration: step.duration.clone(),
        })
    });
    let steps = steps.collect::<Option<Vec<_>>>()?;
    Some(TimeTriggeredPlan { steps })
}

/// A planner whose first plan is [chosen](Chooser).
pub struct Choosing<'a> {
    /// Makes all later plans.
    pub inner: Box<dyn Planner + 'a>,
    /// Chooses the first one; `None` when that is done.
    pub chooser: Option<Chooser<'a>>,
    /// When the run begins at the latest. What is asked later goes to the other planner.
    pub latest: Rational,
    /// The clock by which planning time is measured.
    pub clock: &'a (dyn Fn() -> Rational + Sync),
}

impl Planner for Choosing<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let is_beginning = situation.running.is_empty() && situation.time <= self.latest;
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
