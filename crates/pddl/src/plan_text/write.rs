//! From a plan to text.

use std::fmt::Write;

use elbowroom_model::{Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

/// How many digits behind the point are written at least, as planners do.
const FEWEST_DIGITS: usize = 3;
/// The number of digits tried before a number is written as a fraction.
const MOST_DIGITS: u32 = 300;

/// The plan as text that [`read_plan`](crate::read_plan) and other tools read: one
/// `0.000: (action argument …) [10.000]` on each line, by start time.
///
/// Numbers are written exactly; one without a finite decimal is written as `p/q`, which other
/// tools may refuse.
pub fn write_plan(task: &Task, plan: &TimeTriggeredPlan) -> String {
    let mut text = String::new();
    for step in Step::by_start(&plan.steps) {
        let action = &step.action;
        text.push_str(&decimal(&step.start));
        text.push_str(": ");
        if task.problem().controls.contains_key(&action.schema) {
            // The numbers that the plan chooses stand in the name only.
            text.push_str(&action.name);
        } else {
            text.push_str(&task.action_name(action.schema, &action.arguments));
        }
        if let Some(duration) = &step.duration {
            // Writing to a string cannot fail.
            let _ = write!(text, " [{}]", decimal(duration));
        }
        text.push('\n');
    }
    text
}

/// The number, exactly: in decimals with at least three digits behind the point, or as `p/q`.
pub(super) fn decimal(value: &Rational) -> String {
    let is_exact = |text: &String| text.parse().is_ok_and(|read: Rational| read == *value);
    let Some(mut text) = [18, MOST_DIGITS]
        .map(|digits| value.to_decimal(digits))
        .into_iter()
        .find(is_exact)
    else {
        return value.to_string();
    };
    let digits = if let Some(point) = text.find('.') {
        text.len() - point - 1
    } else {
        text.push('.');
        0
    };
    text.extend(std::iter::repeat_n(
        '0',
        FEWEST_DIGITS.saturating_sub(digits),
    ));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_exactly() {
        assert_eq!(decimal(&Rational::from(2)), "2.000");
        assert_eq!(decimal(&Rational::new(1, 2)), "0.500");
        assert_eq!(decimal(&Rational::new(1, 10_000)), "0.0001");
        assert_eq!(decimal(&Rational::new(1, 3)), "1/3");
        let tiny = format!("0.{}1", "0".repeat(40));
        assert_eq!(decimal(&tiny.parse().expect("a number")), tiny);
    }
}
