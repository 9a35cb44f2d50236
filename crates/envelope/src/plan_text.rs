//! Plans as text for other tools, in decimals.

use elbowroom_model::validate::{Settings, validate};
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_pddl::{PrintedPlan, Source, read_printed_plan, write_plan, write_rounded_plan};

use crate::rounding::{MAX_PROGRAMS, RoundingRule};

/// A plan whose numbers have no more digits after the point than this is written exactly.
const MAX_EXACT_DIGITS: u32 = 9;
/// Limits on the number of digits after the point of other plans.
const FEWEST_DIGITS: u32 = 3;
const MAX_DIGITS: u32 = 18;
/// Limit on the linear programs for one number of digits, while more digits may need fewer.
const FEW_PROGRAMS: usize = 4;

/// Returns the plan as text for other tools: all numbers are decimals.
///
/// If no number has more than nine digits after the point, all are exact. Otherwise all times are
/// rounded to few digits, at least three, that keep the plan valid: [`RoundingRule`] accepts the text,
/// and so does the validator with VAL's tolerance of 0.001. If no number of digits satisfies
/// VAL's rules, those of [`RoundingRule`] suffice. A plan that is not valid, or not valid after
/// rounding to 18 digits, is written exactly ([`write_plan`]), with fractions where there is no finite
/// decimal.
pub fn plan_text(task: &Task, plan: &TimeTriggeredPlan) -> String {
    let has_decimal = |value: &Rational| {
        let decimal: Result<Rational, _> = value.to_decimal(MAX_EXACT_DIGITS).parse();
        decimal.is_ok_and(|decimal| decimal == *value)
    };
    let mut numbers = plan
        .steps
        .iter()
        .flat_map(|step| std::iter::once(&step.start).chain(&step.duration));
    if numbers.all(has_decimal) || !validate(task, plan, &Settings::default()).is_valid() {
        return write_plan(task, plan);
    }
    let like_val = Settings::like_val(Rational::new(1, 1000));
    let mut first = None;
    let limits = [FEW_PROGRAMS, MAX_PROGRAMS];
    let attempts = limits.iter().flat_map(|&programs| {
        let digits = FEWEST_DIGITS..=MAX_DIGITS;
        digits.map(move |digits| (digits, programs))
    });
    for (digits, programs) in attempts {
        let text = write_rounded_plan(task, plan, digits);
        let Some(printed) = reparse(task, &text) else {
            break;
        };
        if !RoundingRule::default().is_valid(task, &printed, programs) {
            continue;
        }
        if validate(task, &printed.plan, &like_val).is_valid() {
            return text;
        }
        first.get_or_insert(text);
    }
    first.unwrap_or_else(|| write_plan(task, plan))
}

fn reparse(task: &Task, text: &str) -> Option<PrintedPlan> {
    let read = read_printed_plan(&Source::new("plan", text), task);
    read.ok().map(|(printed, _)| printed)
}
