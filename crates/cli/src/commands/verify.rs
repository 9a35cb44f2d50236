//! `elbowroom verify`: is that box really inside the envelope, and the largest there? Is there really
//! no plan?

mod no_plan;

use elbowroom::verify::{AnswerError, Inside, Verified, verify_answer};
use serde_json::{Value, json};

use crate::args::VerifyArgs;
use crate::exit::{Answer, Exit, Failure};
use crate::limits::push_wrapped;
use crate::look::{BAD, GOOD, Look, styled};
use crate::output::{self, Output};
use crate::{input, number};

/// Checks an answer, and says what that proves.
pub(crate) fn run(arguments: &VerifyArgs, output: &mut Output) -> Answer {
    let source = input::source(&arguments.answer, "answer")?;
    let name = source.name();
    if no_plan::is_meant(source.text()) {
        return no_plan::run(arguments, &source, output);
    }
    if arguments.domain.is_some() {
        return Err(Failure::new(
            "DOMAIN and PROBLEM are for answers of `elbowroom plan`, and this is none",
            "leave them out: the certificate of a box has its network in it",
        ));
    }
    match verify_answer(source.text()) {
        Ok(verified) => {
            if arguments.json {
                output.json(&document(Ok(&verified)))?;
            } else {
                output::print(&proven(name, &verified, Look::of_stdout()))?;
            }
            Ok(Exit::Yes)
        }
        Err(unsuitable @ (AnswerError::Unreadable(_) | AnswerError::NoBox)) => Err(Failure::new(
            unsuitable,
            "`elbowroom envelope DOMAIN PROBLEM PLAN --method best --json` makes one",
        )),
        Err(wrong) => {
            if arguments.json {
                output.json(&document(Err(&wrong)))?;
            } else {
                let mut text = format!("{}: {name}\n", styled(BAD, "not proved"));
                push_wrapped(&mut text, &format!("{wrong}."), 2, Look::of_stdout().width);
                output::print(&text)?;
            }
            Ok(Exit::No)
        }
    }
}

/// The verdict as a document.
fn document(verdict: Result<&Verified, &AnswerError>) -> Value {
    let exact = |value: &elbowroom::num::Rational| json!({ "exact": value.to_string(), "decimal": value.to_f64() });
    let mut document = json!({ "format": "elbowroom-verified", "version": 1 });
    let members = match verdict {
        Ok(verified) => json!({
            "proved": true,
            "value": exact(&verified.value),
            "bound": exact(&verified.bound),
            "proofs": verified.proofs,
            "assumed": verified.assumed,
            "inside": verified.inside.map(|inside| json!({
                "proved": inside.is_proved(),
                "controllable": inside.is_controllable,
                "conditions": inside.conditions,
                "assumed": inside.assumed,
            })),
            "proves": verified.proves,
            "assumes": verified.assumes,
        }),
        Err(wrong) => json!({ "proved": false, "reason": wrong.to_string() }),
    };
    if let (Value::Object(document), Value::Object(members)) = (&mut document, members) {
        document.extend(members);
    }
    document
}

fn proven(name: &str, verified: &Verified, look: Look) -> String {
    let mut text = format!("{}: {name}\n", styled(GOOD, "proved"));
    let value = number::nearest(&verified.value);
    let bound = number::nearest(&verified.bound);
    let claim = if verified.value == verified.bound {
        format!("No box inside the envelope is better than this one ({value}).")
    } else if verified.bound <= &verified.value + &verified.tolerance {
        format!(
            "No box inside the envelope is better than this one ({value}) by more than a millionth."
        )
    } else {
        format!("No box inside the envelope has more than {bound}; this one has {value}.")
    };
    push_wrapped(&mut text, &claim, 2, look.width);
    let assumed = match verified.assumed {
        0 => String::new(),
        assumed => format!(
            ", but for {assumed} about conditions on numbers, which the certificate only states"
        ),
    };
    let how = match verified.proofs {
        0 => "Each end is as far out as counts.".to_owned(),
        1 => format!(
            "It follows from 1 inequality, added up from bounds of the plan's network{assumed}."
        ),
        proofs => format!(
            "It follows from {proofs} inequalities, each added up from bounds of the plan's \
             network{assumed}."
        ),
    };
    push_wrapped(&mut text, &how, 2, look.width);
    push_wrapped(&mut text, &inside(verified.inside), 2, look.width);
    text
}

/// What is proved of the box being inside the envelope.
fn inside(inside: Option<Inside>) -> String {
    let Some(inside) = inside else {
        return "That the network is that of the plan, and that the box is inside, is not part of the \
                certificate: `elbowroom envelope ... --contains` checks the box."
            .to_owned();
    };
    let conditions = match inside.conditions {
        Some(0) => "the plan has no conditions beside the network's".to_owned(),
        Some(1) => "its condition cannot fail".to_owned(),
        Some(count) => format!("none of its {count} conditions can fail"),
        None => String::new(),
    };
    if inside.is_proved() {
        return format!(
            "The box is inside the envelope: for all its values the plan can be scheduled, and \
             {conditions}. That the network and the conditions are those of the plan is not part of \
             the certificate."
        );
    }
    let mut stated = Vec::new();
    if !inside.is_controllable {
        stated.push("that the plan can be scheduled for all its values".to_owned());
    }
    match (inside.conditions, inside.assumed) {
        (None, _) => stated.push("that no condition of the plan can fail".to_owned()),
        (Some(_), 0) => {}
        (Some(count), assumed) => {
            stated.push(format!("that {assumed} of {count} conditions cannot fail"));
        }
    }
    format!(
        "Of the box being inside the envelope, the certificate only states {}: `elbowroom envelope \
         ... --contains` checks the box.",
        stated.join(", and ")
    )
}
