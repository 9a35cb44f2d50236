//! `elbowroom verify` of an answer that no plan exists.

use std::path::PathBuf;

use elbowroom::model::Task;
use elbowroom::text::Source;
use elbowroom::verify::no_plan::{Kind, NoPlan, NoPlanAnswerError, certificate_of, verify_no_plan};
use serde_json::{Value, json};

use crate::args::{ProblemArgs, VerifyArgs};
use crate::exit::{Answer, Exit, Failure};
use crate::input;
use crate::number::nearest;
use crate::output::{self, Output};
use crate::terminal::{ERROR, SUCCESS, stdout_layout, styled};
use elbowroom::report::console::push_wrapped;
use elbowroom_executive::messages::count_with_noun;

/// Returns `true` if the text is an answer of `elbowroom plan`.
pub(super) fn is_plan_answer(text: &str) -> bool {
    let document: Result<Value, _> = serde_json::from_str(text);
    document.is_ok_and(|document| document["format"] == "elbowroom-plan")
}

/// Checks the answer against its problem and prints the proved claims.
pub(super) fn run(arguments: &VerifyArgs, source: &Source, output: &mut Output) -> Answer {
    let certificate = certificate_of(source.text()).map_err(|error| {
        let advice = match error {
            NoPlanAnswerError::NotDenied => {
                "this answer does not claim that no plan exists; `elbowroom check` validates a plan"
            }
            NoPlanAnswerError::Uncertified(_) => {
                "docs/reference/formats/no-plan.md lists the proofs with certificates"
            }
            _ => "`elbowroom plan DOMAIN PROBLEM --json` prints one",
        };
        Failure::new(error, advice)
    })?;
    if arguments.plan.is_some() {
        return Err(Failure::new(
            "PLAN applies to answers about a box, but this answer is that no plan exists",
            "leave it out",
        ));
    }
    let files = files(arguments, &certificate)?;
    let epsilon = certificate
        .epsilon
        .as_ref()
        .map(|epsilon| epsilon.0.clone());
    let epsilon = epsilon.unwrap_or_else(Task::default_epsilon);
    let task: Task = input::task(&files, &epsilon, output)?;
    let verdict = verify_no_plan(&task, &certificate);
    let problem = files.problem.display().to_string();
    if arguments.json {
        let mut document = json!({
            "format": "elbowroom-verified",
            "version": 1,
            "proved": verdict.is_ok(),
            "domain": files.domain.display().to_string(),
            "problem": problem,
        });
        match &verdict {
            Ok(()) => {
                document["proves"] = json!(certificate.proves);
                if let Some(epsilon) = &certificate.epsilon {
                    document["epsilon"] = json!(epsilon);
                }
            }
            Err(flaw) => document["reason"] = json!(flaw.to_string()),
        }
        output.json(&document)?;
    } else {
        let (style, word) = match verdict {
            Ok(()) => (SUCCESS, "proved"),
            Err(_) => (ERROR, "not proved"),
        };
        let mut text = format!("{}: {}\n", styled(style, word), source.name());
        let sentence = match &verdict {
            Ok(()) => {
                let apart = if epsilon == Task::default_epsilon() {
                    String::new()
                } else {
                    let apart = nearest(&epsilon);
                    format!(" with interfering happenings at least {apart} apart")
                };
                format!(
                    "{problem} has no plan{apart}: {}",
                    reason_text(&certificate)
                )
            }
            Err(flaw) => format!("{flaw}."),
        };
        push_wrapped(&mut text, &sentence, 2, stdout_layout().width);
        output::print(&text)?;
    }
    Ok(if verdict.is_ok() { Exit::Yes } else { Exit::No })
}

/// Describes why there is no plan, based on an accepted certificate.
fn reason_text(certificate: &NoPlan) -> String {
    match certificate.kind() {
        Kind::Apart => {
            let groups = certificate.apart.iter();
            let pairs = groups
                .map(|own| own.together.len() + own.started.len() + own.meanwhile.len())
                .sum::<usize>();
            format!(
                "facts that its goal needs are never true together, which follows from {}.",
                count_with_noun(pairs, "bound")
            )
        }
        Kind::Closed => {
            let closed = certificate.closed.as_ref();
            let states = closed.map_or(0, |closed| closed.states.len());
            format!(
                "every execution stays within {}, and its goal holds in none of them.",
                count_with_noun(states, "state")
            )
        }
        Kind::Reached => {
            let facts: usize = certificate.reached.iter().map(|own| own.facts.len()).sum();
            format!(
                "even if no fact ever became false, only {facts} facts could become true, and the \
                 goal does not hold with these."
            )
        }
    }
}

/// Returns the files of the problem: the given ones, or those named in the answer.
fn files(arguments: &VerifyArgs, certificate: &NoPlan) -> Result<ProblemArgs, Failure> {
    if let (Some(domain), Some(problem)) = (&arguments.domain, &arguments.problem) {
        return Ok(ProblemArgs::new(domain.clone(), problem.clone()));
    }
    let [domain, problem] = &certificate.files[..] else {
        return Err(Failure::new(
            "the answer does not name the files of its problem",
            "give them: `elbowroom verify ANSWER.json DOMAIN PROBLEM`",
        ));
    };
    let (domain, problem) = (PathBuf::from(domain), PathBuf::from(problem));
    Ok(ProblemArgs::new(domain, problem))
}
