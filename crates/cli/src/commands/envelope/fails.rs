//! Plans that fail even as planned.

use elbowroom::Explanation;
use elbowroom::envelope::{Objection, Oracle};
use elbowroom::plan::DecoupledEnvelope;

use super::contains::example;
use super::{Subject, document};
use crate::exit::{Answer, Exit};
use crate::limits::push_wrapped;
use crate::look::{BAD, Look, styled};
use crate::{number, output};

/// The plan contradicts itself: there is no schedule.
pub(super) fn without_schedule(subject: &Subject<'_>) -> Answer {
    let nominal = subject.plan.nominal();
    print(subject, &subject.explainer.no_schedule(&nominal))
}

/// Some schedule breaks the plan, although everything is as planned.
pub(super) fn at_nominal(
    subject: &Subject<'_>,
    oracle: &Oracle<'_>,
    objection: &Objection,
) -> Answer {
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
        let mut text = format!(
            "{}: {} fails even if everything goes as planned\n",
            styled(BAD, "no elbow room"),
            subject.file()
        );
        push_wrapped(&mut text, &what(explanation), 2, look.width);
        if explanation.schedule.is_some() {
            text.push_str(&example(subject, explanation, look));
        }
        output::print(&text)?;
    }
    Ok(Exit::No)
}

/// The reason, and by how much.
pub(super) fn what(explanation: &Explanation) -> String {
    match &explanation.shortfall {
        Some(shortfall) if !shortfall.is_zero() && explanation.schedule.is_none() => {
            format!(
                "{}: too late by {}",
                explanation.reason,
                number::nearest(shortfall)
            )
        }
        Some(shortfall) if !shortfall.is_zero() => {
            format!(
                "{}: short by {}",
                explanation.reason,
                number::nearest(shortfall)
            )
        }
        _ => explanation.reason.clone(),
    }
}
