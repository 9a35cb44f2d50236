//! `--contains`: is this box inside the envelope?

use std::fmt::Write as _;

use elbowroom::Explanation;
use elbowroom::envelope::Oracle;
use elbowroom::parse_box;
use elbowroom::pddl;

use super::fails::what;
use super::{Subject, document, refused};
use crate::exit::{Answer, Exit, Failure};
use crate::limits::push_wrapped;
use crate::look::{BAD, GOOD, Look, STRONG, styled};
use crate::{number, output};

/// Answers yes, or no with a counterexample.
pub(super) fn run(subject: &Subject<'_>, mut oracle: Oracle, text: &str) -> Answer {
    let envelope = parse_box(text, subject.plan)
        .map_err(|error| Failure::new(format!("--contains: {error}"), ""))?;
    let objection = oracle.objection(&envelope).map_err(|r| refused(&r))?;
    let why_not =
        objection.map(|objection| subject.explainer.objection(&oracle, &envelope, &objection));
    if subject.arguments.json {
        output::print_json(&document::contains(subject, &envelope, why_not.as_ref()))?;
    } else {
        output::print(&answer(subject, why_not.as_ref(), Look::of_stdout()))?;
    }
    Ok(match why_not {
        None => Exit::Yes,
        Some(_) => Exit::No,
    })
}

fn answer(subject: &Subject<'_>, why_not: Option<&Explanation>, look: Look) -> String {
    let Some(explanation) = why_not else {
        return format!(
            "{}: {} works everywhere in this box\n",
            styled(GOOD, "inside"),
            subject.file()
        );
    };
    let mut text = format!(
        "{}: {} does not work everywhere in this box\n",
        styled(BAD, "outside"),
        subject.file()
    );
    push_wrapped(&mut text, &what(explanation), 2, look.width);
    text.push_str(&example(subject, explanation, look));
    text
}

/// Values and a schedule at which it goes wrong.
pub(super) fn example(subject: &Subject<'_>, explanation: &Explanation, look: Look) -> String {
    let mut text = String::new();
    let parameters = subject.plan.parameters.iter();
    let values: Vec<String> = parameters
        .zip(&explanation.valuation)
        .map(|(parameter, value)| format!("{} = {}", parameter.name, number::nearest(value)))
        .collect();
    if !values.is_empty() {
        let _ = write!(text, "\n{}\n", styled(STRONG, "For example with"));
        push_wrapped(&mut text, &values.join(", "), 2, look.width);
    }
    let Some(schedule) = &explanation.schedule else {
        return text;
    };
    let plan = subject
        .plan
        .plan
        .at(&explanation.valuation)
        .scheduled(schedule);
    let _ = write!(text, "\n{}\n", styled(STRONG, "executed as"));
    for line in pddl::write_plan(subject.task, &plan).lines() {
        let _ = writeln!(text, "  {line}");
    }
    if let Some(verdict) = &explanation.verdict {
        let _ = write!(text, "\n{}\n", styled(STRONG, "this happens"));
        push_wrapped(&mut text, verdict, 2, look.width);
    }
    text
}
