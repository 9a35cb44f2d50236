//! Improvement of the best plan by replacing parts of it (large neighbourhood search; Shaw, CP
//! 1998).
//!
//! Three methods are used in turn, at random but with the same sequence in each run:
//!
//! - `scheduling`: the same actions in another order, by a search that ends when there is no better
//!   one.
//! - `schedule`: the same actions in another order. The order of choices determines the waiting
//!   times between actions, and so the end of the plan.
//! - `removal` and `repair`: actions are removed, and a search around the remaining plan inserts
//!   others.
//!
//! A plan is kept if it is no worse than the one before. From time to time, a plan is kept that is
//! a little worse than the best one (record-to-record travel; Dueck, Journal of Computational
//! Physics 104, 1993); after a while, the search returns to the best one. The validator checks each
//! plan that is better than all before.

mod incumbent;
mod random;
mod removal;
mod repair;
mod schedule;
mod scheduling;
mod sequence;

use super::apply::{Step, Stepper};
use super::bound::MetricBound;
use super::compile::{Compiled, Compressibility, Metric, NONE};
use super::relaxed::Relaxed;
use super::search::is_goal;
use super::state::State;
use super::step_costs::StepCosts;
use super::time::{NEVER, Ticks};
use super::tuning::Technique;
use incumbent::{Incumbent, PlanCost};
use random::Random;
use repair::Repair;
use schedule::Schedule;
use scheduling::Scheduling;
use sequence::{Item, Kind, SequenceState, items_of};

/// Counter of work that regularly asks whether to continue.
pub(crate) struct WorkMeter<'a> {
    /// Work units of one estimate.
    pub(crate) weight: u64,
    /// Work done so far.
    pub(crate) work: u64,
    /// Number of states estimated.
    pub(crate) evaluated: u64,
    /// Called with the work done so far, and the number of states.
    pub(crate) should_continue: &'a mut dyn FnMut(u64, u64) -> bool,
    /// `true` once `may_continue` has returned `false`.
    pub(crate) is_stopped: bool,
}

/// One turn in this many may continue from a plan that is a little worse than the best one.
const LENIENT_ONCE_IN: usize = 4;

/// Work units of a step, relative to those of an operator in an estimate.
const STEP_WORK: u64 = 200;

impl WorkMeter<'_> {
    fn evaluated(&mut self) -> bool {
        self.evaluated += 1;
        self.work += self.weight;
        self.poll()
    }

    fn count_step(&mut self) {
        self.work += STEP_WORK;
    }

    fn count_trial(&mut self) {
        self.work += STEP_WORK / 8;
    }

    fn poll(&mut self) -> bool {
        self.is_stopped = self.is_stopped || !(self.should_continue)(self.work, self.evaluated);
        !self.is_stopped
    }
}

/// Plan improver by large neighbourhood search.
pub(crate) struct Refiner<'a> {
    compiled: &'a Compiled,
    stepper: Stepper<'a>,
    relaxed: Relaxed<'a>,
    random: Random,
    compresses: Option<Compressibility>,
    /// The current plan, which may temporarily be a little worse than the best one.
    incumbent: Option<Incumbent>,
    /// The best plan's worth and items.
    best: Option<(PlanCost, Vec<Item>)>,
    /// The search for better orders of the best plan's actions, and whether it has been created.
    scheduling: Option<Scheduling<'a>>,
    is_scheduled: bool,
    /// Work of that search since its beginning or its last improvement, and the limit on it.
    scheduled_for: u64,
    scheduling_patience: u64,
    /// Number of turns since the best plan was found, or was returned to.
    idle: u64,
    /// Number of turns since the best plan was found.
    turns_since_best: u64,
    /// The costs of the actions, as integers.
    base_costs: Vec<u32>,
    /// The durations of the actions, scaled to a mean of four.
    durations: Vec<u32>,
    /// Work spent so far, by method.
    work: Spent,
    /// Memory limit for a repair, in bytes.
    most_memory: usize,
}

/// Work by method.
#[derive(Clone, Copy, Debug, Default)]
struct Spent {
    scheduling: u64,
    rescheduling: u64,
    repair: u64,
}

impl<'a> Refiner<'a> {
    /// Creates a refiner; `seed` is the random seed.
    pub(crate) fn new(
        compiled: &'a Compiled,
        compresses: Option<Compressibility>,
        seed: u64,
    ) -> Self {
        let mut relaxed = Relaxed::new(compiled, compresses);
        relaxed.serves_repairs = true;
        relaxed.lists_actions = true;
        if let Some(metric) = &compiled.metric {
            relaxed.set_step_costs(&StepCosts::of(compiled, metric));
        }
        let numbers = || 0..u32::try_from(compiled.actions.len()).unwrap_or(u32::MAX);
        let base_costs: Vec<u32> = numbers().map(|action| relaxed.cost_of(action)).collect();
        let least = |action: u32| compiled.action(action).duration.least.to_f64().max(0.0);
        let total: f64 = numbers().map(least).sum();
        #[allow(clippy::cast_precision_loss, reason = "far fewer than 2^52 actions")]
        let mean = (total / compiled.actions.len().max(1) as f64).max(1e-9);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to a small positive range"
        )]
        let durations = numbers().map(|action| (4.0 * least(action) / mean).min(32.0) as u32);
        Self {
            work: Spent::default(),
            most_memory: usize::MAX,
            durations: durations.collect(),
            compiled,
            stepper: Stepper::new(compiled),
            relaxed,
            random: Random::new(seed),
            compresses,
            incumbent: None,
            best: None,
            scheduling: None,
            is_scheduled: false,
            scheduled_for: 0,
            scheduling_patience: 0,
            idle: 0,
            turns_since_best: 0,
            base_costs,
        }
    }

    /// Limits the memory of the nodes of each later repair, in bytes.
    pub(crate) fn limit_memory(&mut self, most: usize) {
        self.most_memory = most;
    }

    /// Returns the work units of one estimate.
    pub(crate) fn weight(&self) -> u64 {
        self.relaxed.weight()
    }

    /// Continues from the plan of these choices, if it is better than the refiner's best plan or
    /// there is none.
    pub(crate) fn adopt(&mut self, steps: &[Step], ticker: &mut WorkMeter<'_>) {
        let Some(items) = items_of(self.compiled, steps) else {
            return;
        };
        let Some(incumbent) = Incumbent::of(self.compiled, &items) else {
            return;
        };
        let best = self.best.as_ref();
        if best.is_none_or(|(worth, _)| incumbent.cost < *worth) {
            self.incumbent = Some(incumbent);
            self.eliminate_redundant(ticker);
            self.keep_best();
        }
    }

    /// Returns `true` if there is a plan to improve.
    pub(crate) fn has_plan(&self) -> bool {
        self.incumbent.is_some() && self.best.is_some()
    }

    /// Discards the plan because the validator has rejected it.
    pub(crate) fn discard_plan(&mut self) {
        self.incumbent = None;
        self.best = None;
    }

    /// Records the current plan as the best one.
    fn keep_best(&mut self) {
        let own = self.incumbent.as_ref();
        self.best = own.map(|own| (own.cost.clone(), own.items.clone()));
        (self.idle, self.turns_since_best) = (0, 0);
        self.schedule_from_best();
    }

    /// Returns the share of time for refinement, relative to another search.
    pub(crate) fn share(&self) -> u64 {
        let tuning = &self.compiled.tuning;
        let spent = self.work.rescheduling.saturating_add(self.work.repair);
        if spent >= tuning.refining_share_after && self.turns_since_best < tuning.refining_patience
        {
            tuning.refining_share
        } else {
            tuning.refining_share_later
        }
    }

    /// Tries one change. Returns the choices of the new plan if it is better than all before.
    pub(crate) fn try_change(&mut self, ticker: &mut WorkMeter<'_>) -> Option<Vec<Step>> {
        let (best, items) = self.best.as_ref()?;
        let done_before = ticker.work;
        if self.is_turn_to_schedule() {
            // This search does not use the random numbers and counters of the other methods, so
            // that these find the same plans where it finds nothing.
            let bound = best.clone();
            let items = self.schedule(ticker);
            let done = ticker.work - done_before;
            self.work.scheduling += done;
            self.scheduled_for += done;
            return self.accept(items, &bound, ticker);
        }
        let tuning = &self.compiled.tuning;
        let mut bound = self.incumbent.as_ref()?.cost.clone();
        self.idle += 1;
        self.turns_since_best += 1;
        if self.idle > tuning.return_after {
            self.idle = 0;
            if bound > *best {
                self.incumbent = Incumbent::of(self.compiled, items);
                bound = best.clone();
            }
        }
        if tuning.uses(Technique::Leniency) && self.random.once_in(LENIENT_ONCE_IN) {
            bound = bound.max(best.worse_by(tuning.leniency, self.compiled.now));
        }
        let (items, spent) = if self.is_turn_to_reschedule() {
            (self.reschedule(&bound, ticker), &mut self.work.rescheduling)
        } else {
            (self.repair(&bound, ticker), &mut self.work.repair)
        };
        *spent += ticker.work - done_before;
        self.accept(items, &bound, ticker)
    }

    /// Continues from this plan if it is valid and within the bound. Returns its choices if it is
    /// better than all before.
    fn accept(
        &mut self,
        items: Option<Vec<Item>>,
        bound: &PlanCost,
        ticker: &mut WorkMeter<'_>,
    ) -> Option<Vec<Step>> {
        if !ticker.poll() {
            return None;
        }
        let items = items?;
        ticker.work += 4 * STEP_WORK * items.len() as u64;
        let candidate = Incumbent::of(self.compiled, &items)?;
        if candidate.cost > *bound {
            return None;
        }
        let (best, _) = self.best.as_ref()?;
        let is_better = (&candidate.cost.metric, candidate.cost.end) < (&best.metric, best.end);
        self.incumbent = Some(candidate);
        if !is_better {
            return None;
        }
        self.eliminate_redundant(ticker);
        self.keep_best();
        self.incumbent.as_ref().map(|own| own.steps.clone())
    }

    /// Returns `true` if other orders are tried next. They take much less time than repairs, and
    /// seldom change the cost of the same actions.
    fn is_turn_to_reschedule(&self) -> bool {
        let tuning = &self.compiled.tuning;
        if !tuning.uses(Technique::Repair) {
            return true;
        }
        let is_timed = |metric: &Metric| !metric.time.is_zero();
        let matters = self.compiled.metric.as_ref().is_none_or(is_timed);
        let share = tuning.repair_share * if matters { 1 } else { 4 };
        tuning.uses(Technique::Rescheduling)
            && self.work.rescheduling.saturating_mul(share) <= self.work.repair
    }

    fn reschedule(&mut self, bound: &PlanCost, ticker: &mut WorkMeter<'_>) -> Option<Vec<Item>> {
        let incumbent = self.incumbent.as_ref()?;
        self.stepper.horizon = bound.end.max(incumbent.cost.end);
        let mut schedule = Schedule {
            compiled: self.compiled,
            stepper: &mut self.stepper,
            random: &mut self.random,
            incumbent,
        };
        schedule.next(ticker)
    }

    fn repair(&mut self, bound: &PlanCost, ticker: &mut WorkMeter<'_>) -> Option<Vec<Item>> {
        let Self {
            compiled,
            stepper,
            relaxed,
            random,
            incumbent,
            ..
        } = self;
        let incumbent = incumbent.as_ref()?;
        let removed = removal::removed(compiled, incumbent, compiled.tuning.most_removed, random);
        let is_removed = |item: &Item| removed.contains(&item.block);
        let first = incumbent.items.iter().position(is_removed)?;
        let first = first - random.below(first + 1).min(random.below(first + 1));
        stepper.horizon = NEVER;
        let begin = sequence_state_at(compiled, stepper, &incumbent.items[..first], ticker)?;
        let rest = &incumbent.items[first..];
        let rest: Vec<Item> = rest.iter().copied().filter(|i| !is_removed(i)).collect();
        let counts_time = compiled.metric.is_none() && random.once_in(2);
        let costs: Vec<u32> = self
            .base_costs
            .iter()
            .zip(&self.durations)
            .map(|(base, duration)| {
                let own = if counts_time { 2 + duration } else { 4 * base };
                #[allow(clippy::cast_possible_truncation, reason = "a small number")]
                let noise = random.below(4) as u32;
                own + noise
            })
            .collect();
        relaxed.set_costs((0..).zip(costs.iter().copied()));
        let may_equal = random.once_in(2);
        let latest_end = |state: &State| latest_end(compiled, bound, may_equal, state);
        let next_block = incumbent
            .blocks
            .keys()
            .next_back()
            .map_or(0, |last| last + 1);
        let tuning = &compiled.tuning;
        let mut repair = Repair {
            compiled,
            stepper,
            relaxed,
            random,
            remaining: &rest,
            costs: &costs,
            next_block,
            compresses: self.compresses,
            most_states: tuning.repair_states
                + tuning.repair_states_per_action * removed.len() as u64,
            most_memory: self.most_memory,
            latest_end: &latest_end,
        };
        let tail = repair.run(&begin, ticker)?;
        let mut items = incumbent.items[..first].to_vec();
        items.extend(tail);
        Some(items)
    }

    /// Removes actions that the plan does not need, and the actions that depend on them (action
    /// elimination; Nakhost & Müller, ICAPS 2010).
    fn eliminate_redundant(&mut self, ticker: &mut WorkMeter<'_>) {
        let Some(incumbent) = self.incumbent.take() else {
            return;
        };
        let compiled = self.compiled;
        let of_these = |scheduling: &Scheduling<'_>| scheduling.is_of(&incumbent.items);
        if self.scheduling.as_ref().is_some_and(of_these) {
            self.incumbent = Some(incumbent);
            return;
        }
        self.stepper.horizon = NEVER;
        let mut items = incumbent.items.clone();
        let mut scene = SequenceState::initial(compiled);
        let mut place = 0;
        while place < items.len() {
            let item = items[place];
            if item.kind != Kind::End && item.block != NONE {
                let mut rest = scene.clone();
                let mut kept: Vec<Item> = items[..place].to_vec();
                let mut is_possible = true;
                for &other in items[place..].iter().filter(|o| o.block != item.block) {
                    ticker.count_step();
                    match rest.after(&mut self.stepper, other) {
                        Some(next) => {
                            rest = next;
                            kept.push(other);
                        }
                        None if other.kind == Kind::Timed || rest.open.contains(&other.block) => {
                            is_possible = false;
                            break;
                        }
                        None => {}
                    }
                }
                if !ticker.poll() {
                    break;
                }
                if is_possible && is_goal(compiled, &rest.state) {
                    items = kept;
                    continue;
                }
            }
            match scene.after(&mut self.stepper, item) {
                Some(next) => scene = next,
                None => break,
            }
            place += 1;
        }
        let fewer = (items.len() < incumbent.items.len())
            .then(|| Incumbent::of(compiled, &items))
            .flatten()
            .filter(|fewer| fewer.cost <= incumbent.cost);
        self.incumbent = Some(fewer.unwrap_or(incumbent));
    }
}

/// Returns the scene after these items.
fn sequence_state_at(
    compiled: &Compiled,
    stepper: &mut Stepper<'_>,
    items: &[Item],
    ticker: &mut WorkMeter<'_>,
) -> Option<SequenceState> {
    let mut scene = SequenceState::initial(compiled);
    for &item in items {
        ticker.count_step();
        scene = scene.after(stepper, item)?;
    }
    Some(scene)
}

/// Returns the latest time at which a plan with this beginning may end if it must be better than
/// `worth`, or equally good.
fn latest_end(
    compiled: &Compiled,
    worth: &PlanCost,
    may_equal: bool,
    state: &State,
) -> Option<Ticks> {
    let Some(metric) = &compiled.metric else {
        return Some(worth.end - i64::from(!may_equal));
    };
    let bound = MetricBound {
        value: worth.metric.clone(),
        may_equal,
    };
    bound.latest_end(metric, compiled.scale, state)
}
