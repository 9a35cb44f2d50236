//! `elbowroom verify` of an answer about failures.

use elbowroom::text::Source;
use elbowroom::verify::{FaultsError, verify_faults};
use serde_json::{Value, json};

use crate::args::VerifyArgs;
use crate::exit::{Answer, Exit, Failure};
use crate::output::{self, Output};
use crate::terminal::{ERROR, SUCCESS, stdout_layout, styled};
use elbowroom::report::console::push_wrapped;

/// Returns `true` if the text is an answer of `elbowroom envelope --faults`.
pub(super) fn is_faults_answer(text: &str) -> bool {
    let document: Result<Value, _> = serde_json::from_str(text);
    document.is_ok_and(|document| document["format"] == "elbowroom-faults")
}

/// Checks the answer and prints the proved claim.
pub(super) fn run(arguments: &VerifyArgs, source: &Source, output: &mut Output) -> Answer {
    if arguments.domain.is_some() {
        return Err(Failure::new(
            "the network of an answer about failures cannot be derived from files yet",
            "give the answer only",
        ));
    }
    let verdict = verify_faults(source.text());
    if let Err(unreadable @ FaultsError::Unreadable(_)) = verdict {
        return Err(Failure::new(
            unreadable,
            "`elbowroom envelope DOMAIN PROBLEM PLAN --faults K --json` prints one",
        ));
    }
    if arguments.json {
        let mut document = json!({
            "format": "elbowroom-verified",
            "version": 1,
            "proved": verdict.is_ok(),
            "derived": false,
        });
        match &verdict {
            Ok(verified) => {
                document["faults"] = verified.faults.into();
                document["affordable"] = verified.is_affordable.into();
            }
            Err(wrong) => document["reason"] = wrong.to_string().into(),
        }
        output.json(&document)?;
    } else {
        let name = source.name();
        let (title, claim) = match &verdict {
            Ok(verified) => {
                let faults = verified.faults;
                let claim = if verified.is_affordable {
                    format!(
                        "One strategy works for all durations in the box and up to {faults} \
                         failures."
                    )
                } else {
                    format!("No strategy works for all durations and up to {faults} failures.")
                };
                let claim = format!("{claim} The network in the answer is assumed.");
                (styled(SUCCESS, "proved"), claim)
            }
            Err(wrong) => (styled(ERROR, "not proved"), format!("{wrong}.")),
        };
        let mut text = format!("{title}: {name}\n");
        push_wrapped(&mut text, &claim, 2, stdout_layout().width);
        output::print(&text)?;
    }
    Ok(match verdict {
        Ok(_) => Exit::Yes,
        Err(FaultsError::NoProof) => Exit::Limit,
        Err(_) => Exit::No,
    })
}
