//! Source of different plans for one problem.
//!
//! A planner optimizes one criterion, such as the makespan. The best plan by another criterion,
//! such as a success probability or a box, is found by comparing many plans. This source makes
//! them, each for a [`Variant`] of the problem:
//!
//! 1. the problem as it is, with all plans on the way to the shortest one;
//! 2. long durations and early events: with a world, the durations are quantiles (not exceeded in
//!    80 of 100 cases, for example); without one, the planned durations are multiplied by a factor;
//!    no duration is shorter than planned;
//! 3. larger consumption and smaller production than planned, with a world whose amounts vary;
//! 4. actions that rarely fail, with a world;
//! 5. the problem without an action of a plan found before, recursively.
//!
//! The validator has accepted each plan for the original problem, whatever variant it was made for.
//! No two plans have the same actions in the same order. The source uses no clock and no random
//! seed: the same problem, world and limits give the same plans.

mod scarcity;
mod variant;

use std::cmp::Reverse;
use std::collections::{BTreeSet, VecDeque};
use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_model::validate::{self, validate_from};
use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::work;
use elbowroom_plan::deorder::deorder;
use elbowroom_planner::{Counts, embedded};
use elbowroom_sim::WorldModel;
use elbowroom_stn::{ConsistentNetwork, NodeId};

use crate::renumbering::renumbered;
use crate::rewrite::fixed_duration;
use scarcity::scarcities;

pub use variant::Pace;
use variant::{Variant, to_millionths};

/// Refinements that are disabled in searches for plans to choose from.
const DISABLED_REFINEMENTS: [embedded::Technique; 2] = [
    embedded::Technique::Rescheduling,
    embedded::Technique::Repair,
];

/// Maximum number of states for a plan of a variant, as a multiple of the number for the first
/// plan.
const VARIANT_STATES_FACTOR: u64 = 8;

/// Minimum number of states for a plan of a variant.
const LEAST_STATES: u64 = 1_000;

/// A search in a variant with small amounts gets the remaining states divided by this number. If
/// there is no plan, such a search often has to exhaust the state space.
const SCARCE_STATES_DIVISOR: u64 = 2;

/// Limits on the search for candidate plans.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Maximum number of states for the plan of the problem as it is.
    pub most_states: u64,
    /// Maximum number of these states for a better plan than the first.
    pub improve_states: u64,
    /// Maximum number of states for all other plans together.
    pub other_states: u64,
    /// Maximum number of variants.
    pub searches: usize,
    /// Work limit for all plans together, and for their samples, in units of
    /// [`elbowroom_num::work`].
    pub work: u64,
    /// The plan for the unchanged problem may take this multiple of `work`.
    pub first_plan_factor: u64,
}

/// A plan, with the variant that it was made for.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The plan, on the task's clock. The validator has accepted it.
    pub plan: TimeTriggeredPlan,
    /// The variant that it was made for, in words; empty for the best plan of the problem as it is.
    pub made_for: String,
}

/// A source of different plans.
pub struct Candidates<'a> {
    task: &'a Task,
    situation: &'a Situation,
    world: Option<&'a WorldModel>,
    settings: embedded::Settings,
    limits: Limits,
    queue: VecDeque<Variant>,
    requested: BTreeSet<Variant>,
    /// Plans found, but not returned yet.
    ready: VecDeque<Candidate>,
    known_orders: BTreeSet<Vec<String>>,
    /// All plans found.
    plans: Vec<TimeTriggeredPlan>,
    states: u64,
    budget: work::Budget,
    first_states: Option<u64>,
    answer: Option<embedded::Answer>,
}

impl<'a> Candidates<'a> {
    /// Creates a source of plans for a task from a situation without running actions.
    pub fn new(
        task: &'a Task,
        situation: &'a Situation,
        world: Option<&'a WorldModel>,
        settings: embedded::Settings,
        limits: Limits,
    ) -> Self {
        let paces: &[Pace] = match world {
            // No durations or events are random.
            Some(world) if is_deterministic(world) => &[],
            Some(_) => &[
                Pace::Quantile(80),
                Pace::Quantile(50),
                Pace::Quantile(95),
                Pace::Quantile(99),
            ],
            None => &[
                Pace::Slower(125),
                Pace::Slower(110),
                Pace::Slower(150),
                Pace::Slower(200),
                Pace::Slower(300),
                Pace::Slower(105),
            ],
        };
        let fails = world.is_some_and(|world| !world.failures.is_empty());
        let mut queue = VecDeque::from([Variant::default()]);
        for pace in paces {
            queue.push_back(Variant::at(*pace));
        }
        let scarce = world.map(scarcities).unwrap_or_default();
        for (place, scarcity) in scarce.into_iter().enumerate() {
            // Alternate with variants of long durations.
            let place = (2 * place + 1).min(queue.len());
            queue.insert(place, Variant::with(scarcity));
        }
        if fails {
            let kinds = [Pace::Planned, Pace::Quantile(80)];
            for (place, pace) in kinds.into_iter().enumerate() {
                let place = (2 + place).min(queue.len());
                queue.insert(place, Variant::at(pace).reliable());
            }
        }
        Self {
            task,
            situation,
            world,
            settings,
            budget: work::Budget::new(limits.work),
            limits,
            requested: queue.iter().cloned().collect(),
            queue,
            ready: VecDeque::new(),
            known_orders: BTreeSet::new(),
            plans: Vec::new(),
            states: 0,
            first_states: None,
            answer: None,
        }
    }

    /// Returns the planner's answer for the problem as it is, after that search.
    pub fn answer(&self) -> Option<&embedded::Answer> {
        self.answer.as_ref()
    }

    /// Returns the statistics: the number of evaluated states of all searches, the other counts of
    /// the first search.
    pub fn counts(&self) -> Counts {
        let counts = match &self.answer {
            Some(
                embedded::Answer::Plan { counts, .. }
                | embedded::Answer::Unsolvable { counts, .. }
                | embedded::Answer::NoneFound { counts, .. },
            ) => *counts,
            _ => Counts::default(),
        };
        Counts {
            evaluated: self.states,
            ..counts
        }
    }

    /// Returns the next plan; `None` if there are no more plans within the limits. `may_continue` is
    /// called often, with the number of evaluated states so far; if it returns `false`, there are
    /// no more plans.
    pub fn next(&mut self, may_continue: &mut dyn FnMut(u64) -> bool) -> Option<Candidate> {
        loop {
            if let Some(candidate) = self.ready.pop_front() {
                return Some(candidate);
            }
            if self.requested.len() - self.queue.len() >= self.limits.searches.max(1) {
                return None;
            }
            let is_first = self.answer.is_none();
            if !may_continue(self.states) || self.budget.is_spent() && !is_first {
                return None;
            }
            let variant = self.queue.pop_front()?;
            self.search(&variant, may_continue);
            if self.answer.as_ref().is_none_or(|a| a.found().is_none()) {
                // Variants without an action have no plan if the problem has none.
                return None;
            }
        }
    }

    /// Returns the limits on states for a plan of a variant, and for a better plan than the first.
    fn most_states(&self, variant: &Variant) -> (u64, u64) {
        if variant.is_problem() {
            (self.limits.most_states, self.limits.improve_states)
        } else {
            let first = self.first_states.unwrap_or_default();
            let left = (self.limits.other_states + first).saturating_sub(self.states);
            let most = LEAST_STATES
                .max(VARIANT_STATES_FACTOR.saturating_mul(first))
                .min(left);
            if variant.scarcity.is_some() {
                // The first plan may compensate for small amounts with many additional actions. A
                // shorter one may follow, so all of these states are also available for a better
                // plan.
                (left / SCARCE_STATES_DIVISOR, left / SCARCE_STATES_DIVISOR)
            } else {
                (most, most.min(self.limits.improve_states))
            }
        }
    }

    /// Searches for plans of a variant.
    fn search(&mut self, variant: &Variant, may_continue: &mut dyn FnMut(u64) -> bool) {
        let own = variant.is_problem();
        let (most, improve) = self.most_states(variant);
        if most == 0 {
            return;
        }
        let work = self.budget.remaining();
        let most_work = if own {
            work.saturating_mul(self.limits.first_plan_factor)
        } else {
            work
        };
        // The aim is different plans, not the best one, so the states are used for search instead
        // of refinement.
        let mut tuning = self.settings.tuning.clone();
        tuning.without.extend(DISABLED_REFINEMENTS);
        let settings = embedded::Settings {
            without: variant.without.clone(),
            first_plan_only: false,
            tuning,
            objective: if variant.is_reliable {
                embedded::Objective::Metric
            } else {
                self.settings.objective
            },
            ..self.settings.clone()
        };
        let other;
        let rewritten;
        let (task, there) = if variant.needs_no_conversion() {
            (self.task, self.situation)
        } else {
            let Some(problem) = variant.problem(self.task, self.situation, self.world) else {
                return;
            };
            rewritten = Task::new(problem).with_epsilon(self.task.epsilon().clone());
            other = Situation {
                time: self.situation.time.clone(),
                state: rewritten.initial().clone(),
                running: Vec::new(),
            };
            if variant.scarcity.is_some() && self.has_plan_for(&rewritten, &other) {
                return;
            }
            (&rewritten, &other)
        };
        let mut plans: Vec<TimeTriggeredPlan> = Vec::new();
        let (before, mut states) = (self.states, 0);
        let answer = embedded::plan(task, there, &settings, &mut |progress| {
            if let Some(found) = &progress.plan {
                plans.push(found.plan.clone());
            }
            states = progress.counts.evaluated;
            let (limit, work) = match progress.best {
                Some(_) => (improve.min(most), work),
                None => (most, most_work),
            };
            let is_over = states >= limit || progress.counts.work >= work;
            if is_over || !may_continue(before + states) {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        self.states += states;
        if answer.found().is_none() {
            self.queue.retain(|next| !next.is_scarcer_than(variant));
        }
        if let Some(found) = answer.found()
            && plans.last() != Some(&found.plan)
        {
            plans.push(found.plan.clone());
        }
        if own {
            self.first_states = Some(states);
            self.answer = Some(answer);
        }
        // The best plan first: it is the planner's answer.
        plans.reverse();
        for (place, plan) in plans.into_iter().enumerate() {
            let Some(plan) = self.to_task_plan(variant, &plan) else {
                continue;
            };
            if place == 0 {
                self.queue_variants_without(variant, &plan);
            }
            if self.known_orders.insert(order_key(&plan)) {
                self.plans.push(plan.clone());
                let made_for = match (own, place) {
                    (true, 0) => String::new(),
                    (true, _) => "during the search for the shortest".to_owned(),
                    (false, _) => variant.describe(self.world),
                };
                self.ready.push_back(Candidate { plan, made_for });
            }
        }
    }

    /// Returns `true` if a known plan is valid for `task` from situation `there`.
    fn has_plan_for(&self, task: &Task, there: &Situation) -> bool {
        let works = |plan: &TimeTriggeredPlan| {
            let settings = validate::Settings::default();
            renumbered(task, plan)
                .is_some_and(|plan| validate_from(task, there, &plan, &settings).is_valid())
        };
        self.plans.iter().any(works)
    }

    /// Converts a plan of a variant to the task: with the domain's durations, and as early as
    /// possible. `None` if the validator rejects it.
    fn to_task_plan(
        &self,
        variant: &Variant,
        plan: &TimeTriggeredPlan,
    ) -> Option<TimeTriggeredPlan> {
        if variant.needs_no_conversion() {
            return Some(plan.clone());
        }
        let mut steps = Vec::with_capacity(plan.steps.len());
        for step in &plan.steps {
            let arguments = &step.action.arguments;
            let action = self.task.instantiate(step.action.schema, arguments).ok()?;
            let planned = fixed_duration(&action).or_else(|| step.duration.clone());
            steps.push(Step {
                start: step.start.clone(),
                duration: step.duration.as_ref().and(planned),
                action: Arc::new(action),
            });
        }
        let plan = TimeTriggeredPlan { steps };
        let is_valid = |plan: &TimeTriggeredPlan| {
            let settings = validate::Settings::default();
            validate_from(self.task, self.situation, plan, &settings).is_valid()
        };
        let early = tightened(self.task, self.situation, &plan).filter(&is_valid);
        early.or_else(|| is_valid(&plan).then_some(plan))
    }

    /// Queues variants without one more action of the plan, beginning with those that fail most
    /// often.
    fn queue_variants_without(&mut self, variant: &Variant, plan: &TimeTriggeredPlan) {
        let mut names: Vec<&str> = Vec::with_capacity(plan.steps.len());
        for step in &plan.steps {
            if !names.contains(&step.action.name.as_str()) {
                names.push(&step.action.name);
            }
        }
        let odds = |name: &&str| {
            let failing = self.world.and_then(|world| world.failure_rule(name));
            Reverse(failing.map_or(0, |failing| to_millionths(failing.probability)))
        };
        names.sort_by_key(odds);
        for name in names {
            let next = variant.without(name);
            if self.requested.insert(next.clone()) {
                self.queue.push_back(next);
            }
        }
    }
}

/// Returns `true` if durations are as planned, and no events occur.
fn is_deterministic(world: &WorldModel) -> bool {
    world.durations.is_empty() && world.delays.is_empty() && world.exogenous.is_empty()
}

/// Returns the key of a plan: its actions by start time.
fn order_key(plan: &TimeTriggeredPlan) -> Vec<String> {
    let mut steps: Vec<_> = plan.steps.iter().collect();
    steps.sort_by(|a, b| (&a.start, &a.action.name).cmp(&(&b.start, &b.action.name)));
    steps
        .into_iter()
        .map(|step| step.action.name.clone())
        .collect()
}

/// Returns the plan in the same order with the earliest times; `None` if the plan has no order.
pub(crate) fn tightened(
    task: &Task,
    situation: &Situation,
    plan: &TimeTriggeredPlan,
) -> Option<TimeTriggeredPlan> {
    let rest = situation.remaining_task(task);
    let freed = deorder(&rest, &situation.remaining_plan(plan)).ok()?;
    let network = freed.plan.network(&elbowroom_plan::Valuation::default());
    let network = ConsistentNetwork::try_from(network).ok()?;
    let schedule = network.earliest_schedule(NodeId(0));
    let mut early = freed.plan.scheduled(&schedule.into());
    for step in &mut early.steps {
        step.start = &step.start + &situation.time;
    }
    Some(early)
}
