//! Plans together with the precision of their printed numbers.

use std::ops::Range;

use elbowroom_model::{Step, TimeTriggeredPlan};
use elbowroom_num::Rational;

use crate::plan_text::line::Word;
use crate::plan_text::timing::{Start, TimedStep};

/// Number of significant digits that count. The floating-point numbers of many planners are no more
/// precise.
const SIGNIFICANT_DIGITS: i32 = 15;

/// A plan with the numbers of its text and their precision.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PrintedPlan {
    /// The plan with the numbers of the text.
    pub plan: TimeTriggeredPlan,
    /// The position and precision of each step of the plan.
    pub steps: Vec<PrintedStep>,
}

/// Position and precision of one step of a printed plan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PrintedStep {
    /// The range of the action in the text, in bytes.
    pub place: Range<usize>,
    /// One unit of the last printed digit of the start time. 0 for a number that the text gives
    /// exactly (a fraction), or omits.
    pub start_unit: Rational,
    /// As [`start_unit`](Self::start_unit), for the duration.
    pub duration_unit: Rational,
}

impl PrintedPlan {
    /// Sorts the steps into the [order](Step::order) of plans.
    pub(super) fn new(mut steps: Vec<(Step, PrintedStep)>) -> Self {
        steps.sort_by(|(one, _), (other, _)| one.order(other));
        let (plan, steps) = steps.into_iter().unzip();
        Self {
            plan: TimeTriggeredPlan { steps: plan },
            steps,
        }
    }
}

/// Converts a plan without a text: all numbers are exact.
impl From<TimeTriggeredPlan> for PrintedPlan {
    fn from(plan: TimeTriggeredPlan) -> Self {
        let steps = vec![PrintedStep::default(); plan.steps.len()];
        Self { plan, steps }
    }
}

impl PrintedStep {
    pub(super) fn of(step: &TimedStep<'_>) -> Self {
        let raw = &step.raw;
        let unit = |word: &Option<Word<'_>>| word.as_ref().and_then(|word| unit(word.text));
        // If the text gives both ends, the less exact one decides.
        let duration_unit = match &step.end {
            Some(end) => unit(&raw.time).max(unit(&Some(end.clone()))),
            None => unit(&raw.duration),
        };
        let start_unit = match step.start {
            Start::At(_) => unit(&raw.time),
            Start::Next => None,
        };
        Self {
            place: raw.range(),
            start_unit: start_unit.unwrap_or_default(),
            duration_unit: duration_unit.unwrap_or_default(),
        }
    }
}

/// Returns one unit of the last digit of a decimal, but at least of the fifteenth significant one.
/// Returns `None` for a fraction.
fn unit(text: &str) -> Option<Rational> {
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (whole, part) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits = [whole.trim_start_matches(['+', '-']), part].concat();
    if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let significant = i32::try_from(digits.trim_start_matches('0').len()).ok()?;
    let surplus = (significant - SIGNIFICANT_DIGITS).max(0);
    let power = exponent - i32::try_from(part.len()).ok()? + surplus;
    format!("1e{power}").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::unit;

    #[test]
    fn unit_of_last_printed_digit_is_counted_up_to_fifteen_digits() {
        let shown = |text| unit(text).map(|unit| unit.to_string());
        for (text, expected) in [
            ("5", "1"),
            ("5.0", "1/10"),
            ("005.001", "1/1000"),
            ("0.0001", "1/10000"),
            ("5e-3", "1/1000"),
            ("5.00E+1", "1/10"),
            // Digits beyond the precision of floating-point numbers do not count.
            ("3.3333333333333335", "1/100000000000000"),
            ("0.3333333333333333", "1/1000000000000000"),
        ] {
            assert_eq!(shown(text).as_deref(), Some(expected), "{text}");
        }
        assert_eq!(shown("10/3"), None);
        assert_eq!(shown("."), None);
    }
}
