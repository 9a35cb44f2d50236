//! `elbowroom learn`: estimation of a world model from logs.

use std::sync::Arc;

use elbowroom::RoundingRule;
use elbowroom::answers::NoObserver;
use elbowroom::answers::learn::{
    ConformalRequest, LearnRequest, Log, LogError, Settings, Verdict, learn,
};
use elbowroom::num::Rational;

use crate::args::{LearnArgs, ProblemArgs};
use crate::exit::{Answer, Exit, Failure};
use crate::input;
use crate::output::{self, Output};
use crate::terminal::stdout_layout;

/// Reads the logs and prints the learnt model.
pub(crate) fn run(arguments: &LearnArgs, output: &mut Output) -> Answer {
    let is_on_stdout = arguments
        .output
        .as_ref()
        .is_some_and(|path| path.as_os_str() == "-");
    if is_on_stdout && arguments.json {
        return Err(Failure::new(
            "only one of --json and --output can go to standard output",
            "name a file for the world",
        ));
    }
    let inside = conformal_request(arguments, output)?;
    let mut logs = Vec::new();
    for path in &arguments.logs {
        let source = input::record(path, "log")?;
        let log = Log::read(&source).map_err(|error| match error {
            LogError::Table(mistakes) => Failure::from(mistakes),
            error => Failure::new(
                error,
                "traces are what `elbowroom run --trace` writes; docs/reference/formats/log-csv.md describes tables",
            ),
        })?;
        if log.records.is_empty() {
            output::warn(&format!("{}: the log contains no started action", log.name));
        }
        logs.push(log);
    }
    let request = LearnRequest {
        logs,
        settings: Settings {
            resolution: arguments.resolution.to_f64(),
            drift_limit: arguments.drift.to_f64(),
            seed: arguments.seed,
        },
        conformal_box: inside,
        expected: match &arguments.world {
            Some(path) => Some(input::source(path, "world")?),
            None => None,
        },
    };
    let answer = learn(&request, &mut NoObserver).map_err(|error| Failure::new(error, ""))?;
    if let Some(path) = &arguments.output {
        output::write_file(path, &answer.world)?;
    }
    if arguments.json {
        output.document(&answer)?;
    } else if !is_on_stdout {
        output::print(&answer.text(&request, stdout_layout()))?;
    }
    Ok(match &answer.inside {
        Some(found) if found.verdict != Verdict::Inside => Exit::No,
        _ => Exit::Yes,
    })
}

fn conformal_request(
    arguments: &LearnArgs,
    output: &mut Output,
) -> Result<Option<ConformalRequest>, Failure> {
    let (Some(probability), Some(domain), Some(problem), Some(plan)) = (
        &arguments.inside,
        &arguments.domain,
        &arguments.problem,
        &arguments.plan,
    ) else {
        return Ok(None);
    };
    if !probability.is_positive() || *probability >= Rational::ONE {
        return Err(Failure::new(
            format!("--inside takes a probability between 0 and 1, not {probability}"),
            "write --inside 0.95, for instance",
        ));
    }
    let problem = ProblemArgs::new(domain.clone(), problem.clone());
    let task = Arc::new(input::task(&problem, &arguments.epsilon, output)?);
    let plan = input::any_plan(&task, plan, &RoundingRule::default(), output)?;
    Ok(Some(ConformalRequest {
        task,
        plan,
        guarantee: arguments.guarantee,
        probability: probability.to_f64(),
    }))
}
