//! `elbowroom envelope`: tolerated deviations of quantities.

mod exact;
mod faults;
mod monitor;
mod repair;
mod text;

use std::sync::Arc;

use elbowroom::answers::RequestError;
use elbowroom::answers::envelope::{EnvelopeFinding, EnvelopeOutcome, EnvelopeRequest, Search};
use elbowroom::envelope as library;
use elbowroom::plan::parametrize::VarySpec;

use crate::args::{self, EnvelopeArgs};
use crate::exit::{Answer, Exit, Failure};
use crate::output::Output;
use crate::terminal::stdout_layout;
use crate::{input, output};
use monitor::EnvelopeMonitor;

/// Computes an envelope, or checks if a box is inside.
pub(crate) fn run(arguments: &EnvelopeArgs, output: &mut Output) -> Answer {
    if arguments.repair {
        return repair::run(arguments, output);
    }
    if let Some(count) = arguments.faults {
        return faults::run(arguments, count, output);
    }
    if arguments.is_exact()? {
        return exact::run(arguments, output);
    }
    let watch = EnvelopeMonitor::start(arguments);
    let request = Arc::new(request(arguments, output)?);
    // The progress line is removed before the answer is printed.
    let outcome = watch.answer(&request).map_err(failure)?;
    if arguments.json {
        output.document(&outcome.answer)?;
    } else {
        output::print(&text::text(
            &request,
            &outcome,
            arguments.order.unwrap_or(args::Order::Plan),
            stdout_layout(),
        ))?;
        if matches!(outcome.answer.finding, EnvelopeFinding::Fails(_)) {
            input::advise_repair();
        }
    }
    Ok(exit(&outcome))
}

/// Reads the files and options of a request.
fn request(arguments: &EnvelopeArgs, output: &mut Output) -> Result<EnvelopeRequest, Failure> {
    let (method, best) = arguments.method()?;
    let task = input::task(&arguments.problem, &arguments.epsilon, output)?;
    let mut vary = specifications(&arguments.vary)?;
    vary.extend(specifications(&args::controllable(
        &arguments.controllable,
    ))?);
    let plan = input::any_plan(&task, &arguments.plan, &arguments.rounding(), output)?;
    let world = arguments.world.as_deref();
    let world = world.map(|path| input::world(path, &task)).transpose()?;
    let search = Search::default();
    Ok(EnvelopeRequest {
        name: arguments.plan.display().to_string(),
        vary,
        guarantee: arguments.guarantee.unwrap_or_default(),
        enforce: arguments.enforce,
        timeout: arguments.timeout.clone().unwrap_or_default(),
        contains: arguments.contains.clone(),
        search: Search {
            precision: arguments.precision.clone().unwrap_or(search.precision),
            relative: match arguments.precision {
                Some(_) => None,
                None => search.relative,
            },
            growth: match arguments.growth {
                Some(args::Growth::Doubling) | None => library::Growth::Doubling,
                Some(args::Growth::Constant) => library::Growth::Constant,
            },
            sharpen: arguments.sharpen,
            method,
            most_checks: search.most_checks,
            best,
        },
        world: world.map(Arc::new),
        ..EnvelopeRequest::new(&Arc::new(task), plan)
    })
}

fn exit(outcome: &EnvelopeOutcome) -> Exit {
    match &outcome.answer.finding {
        EnvelopeFinding::Envelope { .. } | EnvelopeFinding::Inside { .. } => Exit::Yes,
        EnvelopeFinding::Fails(_) | EnvelopeFinding::Outside { .. } => Exit::No,
        EnvelopeFinding::None { .. } => Exit::Limit,
    }
}

pub(crate) fn specifications(texts: &[String]) -> Result<Vec<VarySpec>, Failure> {
    let specs = texts.iter().map(|text| text.parse::<VarySpec>());
    let specs: Result<_, _> = specs.collect();
    specs.map_err(|error| Failure::new(error, ""))
}

fn failure(error: RequestError) -> Failure {
    match error {
        RequestError::Box(error) => Failure::new(format!("--contains: {error}"), ""),
        error => Failure::new(error, ""),
    }
}
