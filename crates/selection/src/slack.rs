//! Comparison of prepared plans by the slack of their durations.

use elbowroom_execution::PreparationResult;
use elbowroom_num::Rational;
use elbowroom_plan::{ParameterKind, Side};

/// The number of slack levels up to a planned duration, and the greatest level that counts.
const LEVELS: i64 = 32;
const MAX_LEVEL: i64 = 16;

/// Returns `true` if a prepared plan has more slack than another one for the same actions: the
/// smallest slack of a duration decides, then the next one, and so on.
pub(super) fn has_more_slack(one: &PreparationResult, other: &PreparationResult) -> bool {
    slack_levels(one) > slack_levels(other)
}

/// Returns the slack of all durations in the envelope, upwards and downwards, as a level, the
/// smallest first; `None` without an envelope.
fn slack_levels(prepared: &PreparationResult) -> Option<Vec<i64>> {
    let envelope = prepared.envelope.as_ref()?;
    let mut levels = Vec::new();
    for (parameter, interval) in prepared.plan.parameters.iter().zip(envelope.intervals()) {
        if !matches!(parameter.kind, ParameterKind::Duration(_)) {
            continue;
        }
        for side in Side::BOTH {
            let end = side.of(interval).value();
            let level = end.map(|end| level((end - &parameter.nominal).abs(), &parameter.nominal));
            levels.push(level.unwrap_or(MAX_LEVEL));
        }
    }
    levels.sort_unstable();
    Some(levels)
}

/// Returns the greatest level that the slack reaches.
fn level(slack: Rational, planned: &Rational) -> i64 {
    let share = slack * Rational::from(LEVELS);
    let mut levels = (1..=MAX_LEVEL).rev();
    let reached = levels.find(|level| share >= planned * Rational::from(*level));
    reached.unwrap_or(0)
}
