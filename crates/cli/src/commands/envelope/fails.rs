//! Plans that fail even as planned.

use elbowroom::envelope::{Objection, Oracle};
use elbowroom::model::Task;
use elbowroom::model::validate::Violation;
use elbowroom::plan::DecoupledEnvelope;
use elbowroom::{Explanation, Shortfall};

use super::contains::example;
use super::{Subject, document};
use crate::args::EnvelopeArgs;
use crate::exit::{Answer, Exit};
use crate::limits::push_wrapped;
use crate::look::{BAD, Look, styled};
use crate::{number, output};

/// The judge rejects the plan as it stands, so there is nothing to deviate from.
pub(super) fn judged_invalid(
    arguments: &EnvelopeArgs,
    task: &Task,
    violation: &Violation,
) -> Answer {
    if arguments.json {
        output::print_json(&document::judged_invalid(arguments, task, violation))?;
    } else {
        let mut text = headline(arguments, FAILS);
        push_wrapped(
            &mut text,
            &violation.to_string(),
            2,
            Look::of_stdout().width,
        );
        output::print(&text)?;
    }
    Ok(Exit::No)
}

const FAILS: &str = "fails even if everything goes as planned";
const CAN_FAIL: &str = "can fail even if everything goes as planned";

fn headline(arguments: &EnvelopeArgs, fails: &str) -> String {
    let file = arguments.plan.display();
    format!("{}: {file} {fails}\n", styled(BAD, "no elbow room"))
}

/// The plan contradicts itself: there is no schedule.
pub(super) fn without_schedule(subject: &Subject<'_>) -> Answer {
    let nominal = subject.plan.nominal();
    print(subject, &subject.explainer.no_schedule(&nominal))
}

/// Some schedule breaks the plan, although everything is as planned.
pub(super) fn at_nominal(subject: &Subject<'_>, oracle: &Oracle, objection: &Objection) -> Answer {
    let point = DecoupledEnvelope::point(&subject.plan.nominal());
    print(
        subject,
        &subject.explainer.objection(oracle, &point, objection),
    )
}

fn print(subject: &Subject<'_>, explanation: &Explanation) -> Answer {
    if subject.arguments.json {
        output::print_json(&document::fails(subject, explanation))?;
    } else {
        let look = Look::of_stdout();
        let is_possible = explanation.schedule.is_some();
        let fails = if is_possible { CAN_FAIL } else { FAILS };
        let mut text = headline(subject.arguments, fails);
        push_wrapped(&mut text, &what(explanation), 2, look.width);
        if is_possible {
            text.push_str(&example(subject, explanation, look));
        }
        output::print(&text)?;
    }
    Ok(Exit::No)
}

/// The reason, and by how much.
pub(super) fn what(explanation: &Explanation) -> String {
    let reason = &explanation.reason;
    match &explanation.shortfall {
        Some(Shortfall::Time(late)) => {
            format!("{reason}: too late by {}", number::nearest(late))
        }
        Some(Shortfall::Amount(short)) => {
            format!("{reason}: short by {}", number::nearest(short))
        }
        Some(Shortfall::Boundless) => {
            format!("{reason}, but nothing in the plan sees to it")
        }
        None => reason.clone(),
    }
}
