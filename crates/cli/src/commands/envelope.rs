//! `elbowroom envelope`: how far may each quantity deviate?

mod contains;
mod document;
mod fails;
mod search;
mod text;
mod watch;

use std::sync::Arc;

use elbowroom::Explainer;
use elbowroom::envelope::Oracle;
use elbowroom::envelope::obligations::Refusal;
use elbowroom::flow::{self, FlowError};
use elbowroom::plan::ParametrizedPlan;
use elbowroom::plan::parametrize::VarySpec;

use crate::args::{EnvelopeArgs, Method};
use crate::exit::{Answer, Failure};
use crate::input::{self, AnyPlan};
use watch::Watch;

/// Computes an envelope, or says whether a box is inside.
pub(crate) fn run(arguments: &EnvelopeArgs) -> Answer {
    refuse_what_is_not_there_yet(arguments)?;
    let watch = Watch::start(arguments.time_limit.as_ref());
    let mut task = input::task(&arguments.problem)?;
    let specs = specifications(&arguments.vary)?;
    let epsilon = &arguments.epsilon;
    let plan = match input::any_plan(&mut task, &arguments.plan)? {
        AnyPlan::Stn(plan) => flow::open_more(&task, plan, &specs).map_err(failure)?,
        AnyPlan::TimeTriggered(plan) => match flow::free(&task, &plan, epsilon) {
            Ok(freed) => {
                input::tell_repair(&arguments.plan, &freed);
                flow::open(&task, freed, &specs, epsilon).map_err(failure)?
            }
            Err(FlowError::Invalid(violation)) => {
                return fails::judged_invalid(arguments, &task, &violation);
            }
            Err(error) => return Err(failure(error)),
        },
    };
    let (task, plan) = (Arc::new(task), Arc::new(plan));
    let subject = Subject {
        arguments,
        plan: &plan,
        explainer: Explainer::new(&task, &plan, &arguments.epsilon),
        task: &task,
    };
    let oracle = match Oracle::new(&task, &plan, &arguments.epsilon, arguments.guarantee.into()) {
        Ok(oracle) => oracle,
        Err(Refusal::NoNominalSchedule) => return fails::without_schedule(&subject),
        Err(refusal) => return Err(refused(&refusal)),
    };
    match &arguments.contains {
        Some(text) => contains::run(&subject, oracle, text),
        None => search::run(&subject, oracle, &watch),
    }
}

/// What an answer is about.
#[derive(Clone, Copy)]
struct Subject<'a> {
    arguments: &'a EnvelopeArgs,
    task: &'a elbowroom::model::Task,
    plan: &'a ParametrizedPlan,
    explainer: Explainer<'a>,
}

impl Subject<'_> {
    /// The plan's file, as given.
    fn file(&self) -> String {
        self.arguments.plan.display().to_string()
    }
}

fn specifications(texts: &[String]) -> Result<Vec<VarySpec>, Failure> {
    let specs = texts.iter().map(|text| text.parse::<VarySpec>());
    specs.collect::<Result<_, _>>().map_err(failure)
}

fn failure(error: impl std::fmt::Display) -> Failure {
    Failure::new(error, "")
}

fn refused(refusal: &Refusal) -> Failure {
    Failure::new(
        format!("this plan is beyond what can be analysed exactly: {refusal}"),
        "",
    )
}

fn refuse_what_is_not_there_yet(arguments: &EnvelopeArgs) -> Result<(), Failure> {
    let method = match arguments.method {
        Method::Irr => None,
        Method::Best => Some("best"),
        Method::Exact => Some("exact"),
    };
    if let Some(method) = method {
        return Err(Failure::new(
            format!("--method {method} is not available in this version"),
            "use --method irr, which widens one end at a time",
        ));
    }
    Ok(())
}
