//! `elbowroom stn`: relaxation of a plan to an STN.

use elbowroom::RoundingRule;
use elbowroom::answers::stn::{StnFinding, StnOutcome, StnRequest, stn};
use elbowroom::dot;
use elbowroom::model::Task;
use elbowroom::plan::{ParametrizedPlan, format};

use crate::args::StnArgs;
use crate::exit::{Answer, Exit, Failure};
use crate::output::Output;
use crate::terminal::{ERROR, TextLayout, styled};
use crate::{input, output};
use elbowroom::report::console::push_wrapped;

/// Writes the STN plan and the other requested output.
pub(crate) fn run(arguments: &StnArgs, output: &mut Output) -> Answer {
    let task = input::task(&arguments.problem, &arguments.epsilon, output)?;
    let rule = RoundingRule::with_tolerance(arguments.tolerance.clone());
    let plan = input::any_plan(&task, &arguments.plan, &rule, output)?;
    let request = StnRequest { task: &task, plan };
    let outcome = stn(&request).map_err(|error| Failure::new(error, ""))?;
    match &outcome.plan {
        Some(plan) => network(arguments, &task, plan, &outcome, output),
        None => invalid(arguments, &outcome, output),
    }
}

fn network(
    arguments: &StnArgs,
    task: &Task,
    plan: &ParametrizedPlan,
    outcome: &StnOutcome,
    output: &mut Output,
) -> Answer {
    if let Some(path) = &arguments.dot {
        output::write_file(path, &dot::to_dot(task, plan))?;
    }
    let is_dot_on_stdout = arguments
        .dot
        .as_ref()
        .is_some_and(|path| path.as_os_str() == "-");
    if let Some(path) = &arguments.output {
        output::write_file(path, &stn_text(task, plan)?)?;
    }
    if arguments.json {
        output.document(&outcome.answer)?;
    } else if arguments.output.is_none() && !is_dot_on_stdout {
        output::print(&stn_text(task, plan)?)?;
    }
    Ok(Exit::Yes)
}

/// Reports that the plan is invalid and has no network. Standard output is reserved for the
/// network.
fn invalid(arguments: &StnArgs, outcome: &StnOutcome, output: &mut Output) -> Answer {
    let file = arguments.plan.display();
    if arguments.json {
        output.document(&outcome.answer)?;
    } else if let StnFinding::Invalid { violation } = &outcome.answer.finding {
        let mut text = format!("{}: {file} does not work\n", styled(ERROR, "invalid"));
        push_wrapped(&mut text, &violation.message, 2, TextLayout::PLAIN.width);
        output::print_to_stderr(text.trim_end());
        input::advise_repair();
    }
    Ok(Exit::No)
}

fn stn_text(task: &Task, plan: &ParametrizedPlan) -> Result<String, Failure> {
    format::write(task, plan).map_err(|error| Failure::new(error, ""))
}
