//! Writer of plans.

use std::fmt::Write;

use elbowroom_model::{Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

/// Minimum number of digits after the decimal point, as planners print.
const MIN_DIGITS: usize = 3;
/// Number of digits tried before a number is written as a fraction.
const MAX_DIGITS: u32 = 300;

/// Returns the plan as text that [`read_plan`](crate::read_plan) reads: one
/// `0.000: (action argument …) [10.000]` on each line, by start time.
///
/// Numbers are written exactly; one without a finite decimal is written as `p/q`, which other tools
/// may refuse.
pub fn write_plan(task: &Task, plan: &TimeTriggeredPlan) -> String {
    written(task, plan, &|step| {
        let duration = step.duration.as_ref().map(decimal);
        (decimal(&step.start), duration)
    })
}

/// Returns the plan as [`write_plan`] does, with all times rounded to `digits` digits after the
/// point.
///
/// A duration is the difference of the rounded end and the rounded start. So happenings keep their
/// order, simultaneous happenings stay simultaneous, and a distance with at most `digits` digits
/// does not shrink.
pub fn write_rounded_plan(task: &Task, plan: &TimeTriggeredPlan, digits: u32) -> String {
    let rounded = |value: &Rational| -> Rational {
        let nearest = value.to_decimal(digits).parse();
        nearest.unwrap_or_else(|_| value.clone())
    };
    written(task, plan, &|step| {
        let start = rounded(&step.start);
        let duration = step
            .duration
            .as_ref()
            .map(|_| rounded(&step.end()) - &start);
        (decimal(&start), duration.as_ref().map(decimal))
    })
}

/// Returns the lines of a plan; `numbers` gives the start and the duration of each step.
fn written(
    task: &Task,
    plan: &TimeTriggeredPlan,
    numbers: &dyn Fn(&Step) -> (String, Option<String>),
) -> String {
    let mut text = String::new();
    for step in Step::by_start(&plan.steps) {
        let action = &step.action;
        let (start, duration) = numbers(step);
        text.push_str(&start);
        text.push_str(": ");
        if task.problem().controls.contains_key(&action.schema) {
            // The numbers that the plan chooses appear only in the name.
            text.push_str(&action.name);
        } else {
            text.push_str(&task.action_name(action.schema, &action.arguments));
        }
        if let Some(duration) = duration {
            // Writing to a string cannot fail.
            let _ = write!(text, " [{duration}]");
        }
        text.push('\n');
    }
    text
}

/// Returns the exact number: in decimals with at least three digits after the point, or as `p/q`.
pub(super) fn decimal(value: &Rational) -> String {
    let is_exact = |text: &String| text.parse().is_ok_and(|read: Rational| read == *value);
    let Some(mut text) = [18, MAX_DIGITS]
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
    text.extend(std::iter::repeat_n('0', MIN_DIGITS.saturating_sub(digits)));
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
