//! Who makes the plans of a run.

use std::time::Duration;

use elbowroom::execute::{Embedded, External};
use elbowroom::execution::run::Report;
use elbowroom::execution::{NoPlanner, Planner};
use elbowroom::num::Rational;
use elbowroom::planner::{embedded, external};

use super::Texts;
use crate::args::{EMBEDDED, NOBODY, RunArgs};
use crate::clock::Clock;
use crate::exit::Failure;
use crate::interrupt::Interrupt;

/// How long another planner has for its first plan.
const PATIENCE: Duration = Duration::from_mins(1);

/// Who makes the plans of a run.
pub(super) enum Who {
    Embedded,
    Nobody,
    Another(Box<external::Planner>),
}

impl Who {
    /// Whom `--planner` names.
    pub(super) fn named(arguments: &RunArgs) -> Result<Self, Failure> {
        let name = &arguments.planner;
        if name.eq_ignore_ascii_case(EMBEDDED) {
            return Ok(Self::Embedded);
        }
        if name.eq_ignore_ascii_case(NOBODY) {
            return Ok(Self::Nobody);
        }
        let found = external::Planner::named(name);
        let planner = found.map_err(|error| {
            Failure::new(
                error,
                "`elbowroom plan --help` says more; `embedded` is always there, and `none` plans \
                 nothing",
            )
        })?;
        Ok(Self::Another(Box::new(planner)))
    }

    /// Makes a run with the planner.
    pub(super) fn with(
        &self,
        arguments: &RunArgs,
        texts: &Texts,
        epsilon: &Rational,
        run: &mut dyn FnMut(&mut dyn Planner) -> Report,
    ) -> Report {
        match self {
            Self::Nobody => run(&mut NoPlanner),
            Self::Embedded => {
                let clock = Clock::start();
                let seconds = || clock.seconds();
                run(&mut Embedded {
                    settings: embedded::Settings {
                        epsilon: epsilon.clone(),
                        ..embedded::Settings::default()
                    },
                    most_states: arguments.planner_states,
                    improve_states: arguments.improve_states,
                    clock: Some(&seconds),
                })
            }
            Self::Another(planner) => {
                // The first Ctrl-C ends the planner with all that belongs to it.
                let interrupt = Interrupt::listen();
                let given = arguments.planner_time.as_ref();
                let limit = given.map(|time| Duration::from_secs_f64(time.to_f64().min(1e9)));
                run(&mut External {
                    planner: (**planner).clone(),
                    domain: texts.domain.clone(),
                    problem: texts.problem.clone(),
                    settings: external::Settings {
                        epsilon: epsilon.clone(),
                        time_limit: Some(limit.unwrap_or(PATIENCE)),
                        ..external::Settings::default()
                    },
                    takes_first: limit.is_none(),
                    goes_on: &|| !interrupt.is_requested(),
                })
            }
        }
    }
}
