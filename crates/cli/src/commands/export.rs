//! `elbowroom export`: input for other programs.

mod prism;

use std::path::Path;
use std::sync::Arc;

use elbowroom::RoundingRule;
use elbowroom::answers::{EnvelopeAnswer, EnvelopeRequest};
use elbowroom::envelope::Guarantee;
use elbowroom::model::Task;
use elbowroom::network::{NetworkFile, write_graphml, write_json, write_plain};
use elbowroom::parse_box;
use elbowroom::pipeline::PipelineError;
use elbowroom::plan::{DecoupledEnvelope, ParametrizedPlan};
use elbowroom_export::{self as export, ExportError};

use crate::args::{self, ExportArgs, ExportFormat};
use crate::commands::envelope::specifications;
use crate::exit::{Answer, Exit, Failure};
use crate::output::Output;
use crate::terminal::{ERROR, HINT, TextLayout, styled};
use crate::{input, output};
use elbowroom::report::console::push_wrapped;

/// Writes a network, a box check or a region.
pub(crate) fn run(arguments: &ExportArgs, output: &mut Output) -> Answer {
    if arguments.format == ExportFormat::Prism {
        let text = prism::text(arguments, output)?;
        write(arguments, &text)?;
        return Ok(Exit::Yes);
    }
    reject_process_options(arguments)?;
    if arguments.format == ExportFormat::Pddl {
        return timed_problem(arguments, output);
    }
    if arguments.format == ExportFormat::Stnu {
        reject_options_without_networks(arguments)?;
    }
    let Some(file) = &arguments.plan else {
        return Err(Failure::new(
            "PLAN is missing",
            "give the plan file after the problem file",
        ));
    };
    let task = Arc::new(input::task(&arguments.problem, &arguments.epsilon, output)?);
    let plan = input::any_plan(&task, file, &RoundingRule::default(), output)?;
    let mut vary = specifications(&arguments.vary)?;
    vary.extend(specifications(&args::controllable(
        &arguments.controllable,
    ))?);
    let request = EnvelopeRequest {
        vary,
        enforce: arguments.enforce,
        ..EnvelopeRequest::new(&task, plan)
    };
    let plan = match export::parametrized_plan(&request) {
        Ok(plan) => plan,
        Err(PipelineError::Invalid(violation)) => {
            let file = file.display();
            let mut text = format!("{}: {file} does not work\n", styled(ERROR, "invalid"));
            push_wrapped(
                &mut text,
                &violation.to_string(),
                2,
                TextLayout::PLAIN.width,
            );
            output::print_to_stderr(text.trim_end());
            input::advise_repair();
            return Ok(Exit::No);
        }
        Err(error) => return Err(Failure::new(error, "")),
    };
    let asked = requested_box(arguments, &plan, &task)?;
    let written = match (arguments.format, asked) {
        (ExportFormat::Stnu, Some((envelope, _))) => {
            let file = export::stnu(&task, &plan, &envelope);
            Ok(network(
                arguments.output.as_deref(),
                &file.map_err(failure)?,
            )?)
        }
        (ExportFormat::Stnu, None) => {
            return Err(Failure::new(
                "a network with uncertainty needs a box: the values that the world may choose",
                "give one with --contains BOX, or --envelope ANSWER.json",
            ));
        }
        (_, Some((envelope, guarantee))) => export::box_check(&task, &plan, &envelope, guarantee),
        (_, None) => export::region(&task, &plan),
    };
    let text = match written {
        // A box that is not inside is a valid answer.
        Err(error @ ExportError::NoSchedule) => {
            output::print_to_stderr(&format!("{}: {error}", styled(ERROR, "outside")));
            return Ok(Exit::No);
        }
        written => written.map_err(failure)?,
    };
    write(arguments, &text)?;
    Ok(Exit::Yes)
}

/// Writes the problem with the timed initials of its calendar.
fn timed_problem(arguments: &ExportArgs, output: &mut Output) -> Answer {
    if arguments.problem.calendar.calendar.is_none() {
        return Err(Failure::new(
            "a calendar is missing; without one, the output would be the unchanged problem",
            "give one with --calendar (docs/reference/calendars.md)",
        ));
    }
    prism::reject_plan_options(
        arguments,
        "applies to plans, but `export pddl` writes a problem",
    )?;
    let (read, warnings) = input::read(&arguments.problem, &arguments.epsilon)?;
    output.warn_about(&warnings);
    write(arguments, read.problem.text())?;
    Ok(Exit::Yes)
}

fn write(arguments: &ExportArgs, text: &str) -> Result<(), Failure> {
    match &arguments.output {
        Some(path) => output::write_file(path, text),
        None => output::print(text),
    }
}

fn reject_process_options(arguments: &ExportArgs) -> Result<(), Failure> {
    let process = &arguments.process;
    prism::reject_first_given(
        &[
            ("--likelihoods", process.likelihoods.is_some()),
            ("--world", process.world.is_some()),
            ("--dead-ends", process.dead_ends.is_some()),
            ("--most-running", process.most_running.is_some()),
            ("--keep-over-all", process.keep_over_all),
            ("--cells", process.cells.is_some()),
            ("--bound", process.bound.is_some()),
        ],
        "applies only to `export prism`",
    )
}

fn reject_options_without_networks(arguments: &ExportArgs) -> Result<(), Failure> {
    match arguments.guarantee {
        None => Ok(()),
        Some(_) => Err(Failure::new(
            "--guarantee applies only to smt2; the network is the same for each guarantee",
            "leave it out",
        )),
    }
}

/// Returns the requested box and guarantee; `None` for the region.
fn requested_box(
    arguments: &ExportArgs,
    plan: &ParametrizedPlan,
    task: &Task,
) -> Result<Option<(DecoupledEnvelope, Guarantee)>, Failure> {
    let guarantee: Option<Guarantee> = arguments.guarantee;
    if let Some(text) = &arguments.contains {
        let envelope = parse_box(text, plan);
        let envelope =
            envelope.map_err(|error| Failure::new(format!("--contains: {error}"), ""))?;
        return Ok(Some((envelope, guarantee.unwrap_or_default())));
    }
    let Some(path) = &arguments.envelope else {
        return match guarantee {
            None | Some(Guarantee::Weak) => Ok(None),
            Some(_) => Err(Failure::new(
                "the region exists only for the weak guarantee; the other guarantees need a box",
                "give a box with --contains BOX or --envelope ANSWER.json, or leave out --guarantee",
            )),
        };
    };
    let source = input::source(path, "answer")?;
    let answer: EnvelopeAnswer = serde_json::from_str(source.text()).map_err(|error| {
        Failure::new(
            format!("this is not an answer of `elbowroom envelope --json`: {error}"),
            "`elbowroom envelope DOMAIN PROBLEM PLAN --json` prints one",
        )
    })?;
    if answer.settings.epsilon != *task.epsilon() {
        return Err(Failure::new(
            format!(
                "the answer was computed with epsilon {}, not {}",
                answer.settings.epsilon,
                task.epsilon()
            ),
            format!("give --epsilon {}", answer.settings.epsilon),
        ));
    }
    let envelope = export::box_of(&answer, plan).map_err(failure)?;
    Ok(Some((
        envelope,
        guarantee.unwrap_or(answer.settings.guarantee),
    )))
}

/// Writes the network in the format of the file's extension.
fn network(path: Option<&Path>, file: &NetworkFile) -> Result<String, Failure> {
    let ending = path.and_then(Path::extension);
    let has_ending = |wanted: &str| ending.is_some_and(|own| own.eq_ignore_ascii_case(wanted));
    if has_ending("json") {
        return Ok(write_json(file));
    }
    let to_json = "write to a file that ends in .json, which can express every network";
    let Some((whole, factor)) = file.in_whole_numbers() else {
        return Err(Failure::new(
            "the numbers of this network become too large when they are scaled to integers",
            to_json,
        ));
    };
    if let Some(link) = whole
        .network
        .links()
        .iter()
        .find(|link| link.upper.is_none())
    {
        return Err(Failure::new(
            format!(
                "{} may occur at any time after {}, which this format cannot express",
                whole.point(link.end),
                whole.point(link.activation)
            ),
            format!("give the interval an upper bound, or {to_json}"),
        ));
    }
    if factor != 1.into() {
        output::print_to_stderr(&format!(
            "{}: numbers are scaled to integers; the unit of time is 1/{factor} of the plan's",
            styled(HINT, "note")
        ));
    }
    let text = if has_ending("txt") {
        write_plain(&whole)
    } else {
        write_graphml(&whole)
    };
    text.ok_or_else(|| Failure::new("this format cannot express this network", to_json))
}

fn failure(error: ExportError) -> Failure {
    Failure::new(error, "")
}
