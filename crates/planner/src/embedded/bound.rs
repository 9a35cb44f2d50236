//! Bound on the metric, and the states that cannot lead to a better plan.

use elbowroom_num::Rational;

use super::compile::Metric;
use super::state::State;
use super::time::{NEVER, Scale, Ticks};

/// Upper bound on the metric of a plan.
#[derive(Clone, Debug)]
pub(crate) struct MetricBound {
    /// The metric of the best plan.
    pub(crate) value: Rational,
    /// `true` if a plan may have the same value.
    pub(crate) may_equal: bool,
}

impl MetricBound {
    /// Returns `true` if the metric does not depend on times.
    pub(crate) fn is_timeless(metric: &Metric) -> bool {
        metric.time.is_zero()
    }

    /// Returns the latest time at which a plan with this beginning can end within the limit, or
    /// `None` if there is no such plan.
    ///
    /// A metric that only grows is at least the state's cost plus the weighted time.
    pub(crate) fn latest_end(&self, metric: &Metric, scale: Scale, state: &State) -> Option<Ticks> {
        if !metric.only_grows {
            return Some(NEVER);
        }
        let Some(spent) = state.spent(metric) else {
            return Some(NEVER);
        };
        let left = &self.value - &spent;
        if metric.time.is_zero() {
            let is_within = left.is_positive() || self.may_equal && left.is_zero();
            return is_within.then_some(NEVER);
        }
        let (latest, is_exact) = scale.floor(&left.checked_div(&metric.time)?);
        let is_too_late = is_exact && !self.may_equal;
        Some(if is_too_late { latest - 1 } else { latest })
    }
}

#[cfg(test)]
mod tests {
    use super::{Metric, MetricBound, NEVER, Scale, State};
    use crate::embedded::formula::{Linear, Numeric};
    use elbowroom_num::Rational;

    fn latest(time: i64, may_equal: bool, cost: i64) -> Option<i64> {
        let metric = Metric {
            values: Numeric::Linear(Linear::constant(Rational::from(3))),
            time: Rational::from(time),
            only_grows: true,
        };
        let value = Rational::from(10);
        let state = State {
            cost: Rational::from(cost),
            ..State::default()
        };
        let scale = Scale::of([Rational::ONE].iter());
        MetricBound { value, may_equal }.latest_end(&metric, scale, &state)
    }

    #[test]
    fn unspent_metric_is_available_for_time() {
        assert_eq!(latest(2, false, 1), Some(2));
        assert_eq!(latest(2, true, 1), Some(3));
        assert_eq!(latest(2, false, 2), Some(2));
    }

    #[test]
    fn timeless_limit_can_be_inclusive_or_exclusive() {
        assert_eq!(latest(0, false, 6), Some(NEVER));
        assert_eq!(latest(0, false, 7), None);
        assert_eq!(latest(0, true, 7), Some(NEVER));
        assert_eq!(latest(0, true, 8), None);
    }
}
