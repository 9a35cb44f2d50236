//! Costs of steps as small integers. They guide the search, but decide nothing.

use elbowroom_num::Rational;

use super::compile::{Action, Compiled, Metric, NONE, Snap};
use super::formula::{Linear, Numeric};
use super::state::State;

/// Costs of the starts and ends of actions.
#[derive(Clone, Debug)]
pub(crate) struct StepCosts {
    /// For each action, the costs of its start and its end.
    counts: Vec<(u32, u32)>,
    /// Amount of the metric that counts as much as one step.
    unit: f64,
    /// The initial cost, without time.
    initial: f64,
}

impl StepCosts {
    pub(crate) fn of(compiled: &Compiled, metric: &Metric) -> Self {
        let weight_of_time = metric.time.to_f64().max(0.0);
        let costs: Vec<(f64, f64)> = compiled
            .actions
            .iter()
            .map(|action| {
                let duration = least_duration(compiled, action);
                let snap = |number: u32| match number {
                    NONE => 0.0,
                    _ => cost(compiled, metric, compiled.snap(number), &duration),
                };
                let time = weight_of_time * duration.to_f64();
                (snap(action.start) + time, snap(action.end))
            })
            .collect();
        let positive = || {
            let parts = costs.iter().flat_map(|&(start, end)| [start, end]);
            parts.filter(|&cost| cost > 0.0)
        };
        let total: f64 = positive().sum();
        #[allow(clippy::cast_precision_loss, reason = "far fewer than 2^52 actions")]
        let mean = total / positive().count().max(1) as f64;
        let unit = if mean > 0.0 {
            mean / f64::from(compiled.tuning.mean_step_cost.max(1))
        } else {
            1.0
        };
        let most = f64::from(compiled.tuning.most_step_cost);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to a small positive range"
        )]
        let count = |cost: f64| 1 + (cost / unit).round().clamp(0.0, most) as u32;
        let counts = costs.iter().map(|&(start, end)| (count(start), count(end)));
        Self {
            counts: counts.collect(),
            unit,
            initial: initial(compiled, metric),
        }
    }

    /// Returns the cost of the start of an action, or of the instantaneous action.
    pub(crate) fn start(&self, action: u32) -> u32 {
        self.counts[action as usize].0
    }

    /// Returns the cost of the end of an action.
    pub(crate) fn end(&self, action: u32) -> u32 {
        self.counts[action as usize].1
    }

    /// Returns the cost of a state since the beginning, in the same units.
    pub(crate) fn spent(&self, compiled: &Compiled, state: &State) -> i64 {
        let Some(metric) = &compiled.metric else {
            return 0;
        };
        let time = compiled.scale.units(state.earliest_end() - compiled.now);
        let time = metric.time.to_f64() * time.to_f64();
        let all = spent(metric, state) - self.initial + time;
        #[allow(clippy::cast_possible_truncation, reason = "the cast saturates")]
        let units = (all / self.unit).round().clamp(-1e12, 1e12) as i64;
        units
    }
}

/// Returns the cost of a state, as far as it is known before times are chosen.
fn spent(metric: &Metric, state: &State) -> f64 {
    let spent = state.spent(metric);
    spent.map_or_else(|| state.cost.to_f64(), |spent| spent.to_f64())
}

/// Returns the cost before the first choice.
fn initial(compiled: &Compiled, metric: &Metric) -> f64 {
    let beginning = &compiled.initial;
    let read = metric.values.value(&beginning.values, None);
    let cost = beginning.cost.to_f64();
    read.map_or(cost, |read| read.to_f64() + cost)
}

fn least_duration(compiled: &Compiled, action: &Action) -> Rational {
    let values = &compiled.initial.values;
    let bounds = action.duration.bounds.iter();
    let known = bounds.filter_map(|bound| bound.value.value(values, None));
    known.fold(action.duration.least.clone(), Rational::max)
}

/// Returns the cost of a happening, given the initial values of the numbers that it reads.
fn cost(compiled: &Compiled, metric: &Metric, snap: &Snap, duration: &Rational) -> f64 {
    let values = &compiled.initial.values;
    let own = snap.cost.as_ref();
    let own = own.and_then(|cost| cost.value(values, Some(duration)));
    let amounts = snap.updates.iter().filter_map(|update| {
        let amount: Linear = metric.amount_of(update)?;
        Numeric::Linear(amount).value(values, Some(duration))
    });
    amounts.fold(own.map_or(0.0, |own| own.to_f64()), |sum, amount| {
        sum + amount.to_f64()
    })
}
