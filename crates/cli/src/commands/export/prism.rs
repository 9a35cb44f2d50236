//! `elbowroom export prism`: optimal success probability as a decision process, for Storm and
//! PRISM.

use std::sync::Arc;

use elbowroom::mdp;
use elbowroom::probability::{likelihoods, optimum};
use elbowroom_export::prism::{self, PrismError};

use crate::args::{Bound, ExportArgs};
use crate::exit::Failure;
use crate::input;
use crate::output::Output;

/// Default number of cells: that of the first grid of the optimum.
const CELLS: usize = 32;

/// Returns the text of the requested process.
pub(super) fn text(arguments: &ExportArgs, output: &mut Output) -> Result<String, Failure> {
    reject_plan_options(
        arguments,
        "applies to plans, but a process contains all applicable actions",
    )?;
    let process = &arguments.process;
    match (&process.likelihoods, &process.world) {
        (Some(_), _) => {
            reject_first_given(
                &[
                    ("--cells", process.cells.is_some()),
                    ("--bound", process.bound.is_some()),
                ],
                "applies only to processes on a clock, but --likelihoods selects one without time",
            )?;
        }
        (None, Some(_)) => {
            reject_first_given(
                &[
                    ("--dead-ends", process.dead_ends.is_some()),
                    ("--most-running", process.most_running.is_some()),
                    ("--keep-over-all", process.keep_over_all),
                ],
                "applies only to processes without time, but --world selects one on a clock",
            )?;
        }
        (None, None) => {
            return Err(Failure::new(
                "a process needs probabilities",
                "give --likelihoods FILE for a process without time, or --world WORLD.toml for \
                 one on a clock",
            ));
        }
    }
    let task = Arc::new(input::task(&arguments.problem, &arguments.epsilon, output)?);
    let written = if let Some(path) = &process.likelihoods {
        let text = input::source(path, "likelihoods")?;
        let likelihoods = likelihoods::read(text, &task).map_err(|wrong| {
            Failure::from(wrong).with_default_advice(
                "docs/reference/formats/likelihoods.md describes likelihood files",
            )
        })?;
        let lost = optimum::Settings::default();
        let settings = optimum::Settings {
            dead_ends: process.dead_ends.map_or(lost.dead_ends, |rule| rule.0),
            most_running: process.most_running.unwrap_or(lost.most_running),
            enforces_over_all: process.keep_over_all,
            ..lost
        };
        prism::untimed(&task, &likelihoods, &settings)
    } else if let Some(path) = &process.world {
        let world = input::world(path, &task)?;
        let bound = match process.bound {
            None | Some(Bound::Upper) => prism::Bound::Upper,
            Some(Bound::Lower) => prism::Bound::Lower,
        };
        let grid = (process.cells.unwrap_or(CELLS), bound);
        prism::timed(&task, &world, &mdp::Settings::default(), grid)
    } else {
        unreachable!("one of the two was asked for above")
    };
    written.map_err(|error| {
        let advice = match error {
            PrismError::NotTabulated(_) | PrismError::Unsupported(_) | PrismError::NotSmall(_) => {
                "docs/reference/second-witness.md lists the problems that can be written as processes"
            }
            _ => "",
        };
        Failure::new(error, advice)
    })
}

/// Rejects the first option that only applies to output about a plan.
pub(super) fn reject_plan_options(arguments: &ExportArgs, why: &str) -> Result<(), Failure> {
    let is_default = arguments.epsilon == elbowroom::num::Rational::new(1, 1000);
    reject_first_given(
        &[
            ("PLAN", arguments.plan.is_some()),
            ("--contains", arguments.contains.is_some()),
            ("--envelope", arguments.envelope.is_some()),
            ("--vary", !arguments.vary.is_empty()),
            ("--guarantee", arguments.guarantee.is_some()),
            ("--enforce", arguments.enforce),
            ("--controllable", !arguments.controllable.is_empty()),
            ("--epsilon", !is_default),
        ],
        why,
    )
}

/// Rejects the first of these options that is given.
pub(super) fn reject_first_given(given: &[(&str, bool)], why: &str) -> Result<(), Failure> {
    match given.iter().find(|(_, is_given)| *is_given) {
        Some((name, _)) => Err(Failure::new(format!("{name} {why}"), "leave it out")),
        None => Ok(()),
    }
}
