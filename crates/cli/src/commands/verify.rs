//! `elbowroom verify`: check of a certificate that a box is inside the envelope and the largest one
//! there, or that no plan exists.

mod faults;
mod no_plan;

use std::fmt::Write as _;
use std::path::Path;

use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::sim::WorldModel;
use elbowroom::verify::{
    AnswerError, Distributions, InsideCheck, Plan, Verified, epsilon_of, verify_answer,
    verify_answer_in_world,
};
use elbowroom::{AnyPlan, RoundingRule, duration_distribution, given_plan};
use serde_json::{Value, json};

use crate::args::{ProblemArgs, VerifyArgs};
use crate::exit::{Answer, Exit, Failure};
use crate::output::{self, Output};
use crate::terminal::{ERROR, SUCCESS, TextLayout, stdout_layout, styled};
use crate::{input, number};
use elbowroom::report::console::push_wrapped;

/// Checks an answer and prints the proved claims.
pub(crate) fn run(arguments: &VerifyArgs, output: &mut Output) -> Answer {
    let source = input::source(&arguments.answer, "answer")?;
    let name = source.name();
    if faults::is_faults_answer(source.text()) {
        return faults::run(arguments, &source, output);
    }
    if no_plan::is_plan_answer(source.text()) {
        return no_plan::run(arguments, &source, output);
    }
    let (verdict, is_derived) = match files(arguments)? {
        None => (verify_answer(source.text()), false),
        Some((files, plan)) => {
            let epsilon = epsilon_of(source.text()).ok().flatten();
            let epsilon = epsilon.filter(Rational::is_positive);
            let task = input::task(
                &files,
                &epsilon.unwrap_or_else(Task::default_epsilon),
                output,
            )?;
            let plan = input::any_plan(&task, plan, &RoundingRule::default(), output)?;
            let world = arguments.world.as_deref();
            let world = world.map(|path| input::world(path, &task)).transpose()?;
            (
                verify_against_files(source.text(), &task, &plan, world.as_ref()),
                true,
            )
        }
    };
    match verdict {
        Ok(verified) => {
            if arguments.json {
                output.json(&document(Ok(&verified), is_derived))?;
            } else {
                output::print(&proof_text(name, &verified, is_derived, stdout_layout()))?;
            }
            Ok(Exit::Yes)
        }
        Err(unsuitable @ AnswerError::Unreadable(_)) => Err(Failure::new(
            unsuitable,
            "`elbowroom envelope DOMAIN PROBLEM PLAN --method best --json` prints one",
        )),
        Err(wrong) => {
            if arguments.json {
                output.json(&document(Err(&wrong), is_derived))?;
            } else {
                let mut text = format!("{}: {name}\n", styled(ERROR, "not proved"));
                push_wrapped(&mut text, &format!("{wrong}."), 2, stdout_layout().width);
                output::print(&text)?;
            }
            Ok(if wrong.is_limit() {
                Exit::Limit
            } else {
                Exit::No
            })
        }
    }
}

/// Checks an answer against a problem, a plan, and a world if there is one.
fn verify_against_files(
    answer: &str,
    task: &Task,
    plan: &AnyPlan,
    world: Option<&WorldModel>,
) -> Result<Verified, AnswerError> {
    let of_world = world.map(|world| {
        |action: &str, planned: &Rational| {
            duration_distribution(action, planned, world).map_err(|wrong| wrong.to_string())
        }
    });
    let world = of_world.as_ref().map(|own| own as Distributions<'_>);
    match plan {
        AnyPlan::TimeTriggered(plan) => {
            verify_answer_in_world(answer, task, Plan::Times(plan), world)
        }
        AnyPlan::Stn(plan) => {
            let given = given_plan(plan);
            verify_answer_in_world(answer, task, Plan::Network(&given), world)
        }
    }
}

/// Returns the domain, problem and plan files, if they are given. Network and conditions are derived
/// from them.
fn files(arguments: &VerifyArgs) -> Result<Option<(ProblemArgs, &Path)>, Failure> {
    match (&arguments.domain, &arguments.problem, &arguments.plan) {
        (None, ..) => Ok(None),
        (Some(domain), Some(problem), Some(plan)) => {
            let files = ProblemArgs::new(domain.clone(), problem.clone());
            Ok(Some((files, plan)))
        }
        _ => Err(Failure::new(
            "PLAN is missing: the answer is about a box",
            "give all three files, `elbowroom verify ANSWER.json DOMAIN PROBLEM PLAN`, or none",
        )),
    }
}

/// Converts the verdict to a document.
fn document(verdict: Result<&Verified, &AnswerError>, is_derived: bool) -> Value {
    let exact = |value: &elbowroom::num::Rational| json!({ "exact": value.to_string(), "decimal": value.to_f64() });
    let mut document = json!({ "format": "elbowroom-verified", "version": 1 });
    let members = match verdict {
        Ok(verified) => json!({
            "assumes": verified.assumes,
            "proved": true,
            "derived": is_derived,
            "value": exact(&verified.value),
            "bound": exact(&verified.bound),
            "proofs": verified.proofs,
            "assumed": verified.assumed,
            "from_conditions": verified.from_conditions,
            "inside": verified.inside.map(|inside| json!({
                "proved": inside.is_proved(),
                "controllable": inside.is_controllable,
                "conditions": inside.conditions,
                "assumed": inside.assumed,
            })),
            "proves": verified.proves,
        }),
        Err(wrong) => json!({
            "proved": false,
            "derivable": !wrong.is_limit(),
            "reason": wrong.to_string(),
        }),
    };
    if let (Value::Object(document), Value::Object(members)) = (&mut document, members) {
        document.extend(members);
    }
    document
}

fn proof_text(name: &str, verified: &Verified, is_derived: bool, look: TextLayout) -> String {
    let mut text = String::new();
    if !verified.assumes.is_empty() {
        let without = if is_derived {
            "Assumed, because no world file is given:"
        } else {
            "Assumed, because the files are not given (`elbowroom verify ANSWER.json DOMAIN PROBLEM \
             PLAN` derives it from them):"
        };
        push_wrapped(&mut text, without, 0, look.width);
        for assumed in &verified.assumes {
            push_wrapped(&mut text, &format!("- {assumed}"), 2, look.width);
        }
        text.push('\n');
    }
    let _ = writeln!(text, "{}: {name}", styled(SUCCESS, "proved"));
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
    let assumed = match (verified.assumed, verified.from_conditions) {
        (0, 0) => String::new(),
        (0, derived) => format!(", except for {derived} implied by conditions on numbers"),
        (assumed, _) => format!(
            ", except for {assumed} about conditions on numbers, which the certificate states \
             without proof"
        ),
    };
    let how = match verified.proofs {
        0 => "Each bound is at the cap of its deviation.".to_owned(),
        1 => format!(
            "This follows from 1 inequality, a sum of bounds of the plan's network{assumed}."
        ),
        proofs => format!(
            "This follows from {proofs} inequalities, each a sum of bounds of the plan's \
             network{assumed}."
        ),
    };
    push_wrapped(&mut text, &how, 2, look.width);
    if is_derived {
        let rest = if verified.assumes.is_empty() {
            "; nothing is assumed."
        } else {
            ". The probability was not checked; give its world file with `--world WORLD.toml`."
        };
        let derived = format!(
            "The box is inside the envelope: for all its values the plan can be scheduled, and every \
             schedule is a valid plan. Network and conditions were derived from domain, problem and \
             plan{rest}"
        );
        push_wrapped(&mut text, &derived, 2, look.width);
    } else {
        push_wrapped(&mut text, &containment_text(verified.inside), 2, look.width);
    }
    text
}

/// Describes the proof that the box is inside the envelope.
fn containment_text(inside: Option<InsideCheck>) -> String {
    let Some(inside) = inside else {
        return "The certificate does not prove that the box is inside the envelope; check it with \
                `elbowroom envelope ... --contains`."
            .to_owned();
    };
    let conditions = match inside.conditions {
        Some(0) => "the plan has no conditions besides those of the network".to_owned(),
        Some(1) => "its condition cannot fail".to_owned(),
        Some(count) => format!("none of its {count} conditions can fail"),
        None => String::new(),
    };
    if inside.is_proved() {
        return format!(
            "The box is inside the envelope: for all its values the plan can be scheduled, and \
             {conditions}."
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
        "The certificate states without proof {}; check the box with `elbowroom envelope ... \
         --contains`.",
        stated.join(", and ")
    )
}
