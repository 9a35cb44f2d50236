//! Who makes the plans of a run.

use std::time::Duration;

use elbowroom::execute::{Embedded, External, Likeliest};
use elbowroom::execution::executors::ExecutorSpec;
use elbowroom::execution::run::{PlanningTime, Report};
use elbowroom::execution::{NoPlanner, Odds};
use elbowroom::num::Rational;
use elbowroom::planner::{embedded, external};
use elbowroom::sim::WorldModel;

use super::{Choices, Planning, Texts};
use crate::args::{EMBEDDED, NOBODY, RunArgs};
use crate::clock::Clock;
use crate::exit::Failure;
use crate::interrupt::Interrupt;

/// How long another planner has for its first plan.
const PATIENCE: Duration = Duration::from_secs(60);

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
        let is_another = !name.eq_ignore_ascii_case(EMBEDDED) && !name.eq_ignore_ascii_case(NOBODY);
        if arguments.planner_time.is_some() && !is_another {
            return Err(Failure::new(
                format!("--planner-time says nothing to `--planner {name}`"),
                "leave it out, or name another planner; the embedded one is limited by \
                 --planner-states and --improve-states",
            ));
        }
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

    /// Whether an executor can do with the planner, and with what is known of the world.
    pub(super) fn suits(
        &self,
        executor: &ExecutorSpec,
        arguments: &RunArgs,
    ) -> Result<(), Failure> {
        if !executor.asks_odds() {
            return Ok(());
        }
        if arguments.world.is_none() {
            return Err(Failure::new(
                format!("`{executor}` must know how the world behaves"),
                "give it a world file with --world, or leave out the number",
            ));
        }
        if !matches!(self, Self::Embedded) {
            return Err(Failure::new(
                format!("`{executor}` chooses among plans of the embedded planner"),
                "leave out --planner, or the number",
            ));
        }
        Ok(())
    }

    /// Makes a run with the planner; `model` is what is known of the world.
    pub(super) fn with(
        &self,
        arguments: &RunArgs,
        texts: &Texts,
        choices: &Choices,
        model: Option<&WorldModel>,
        interrupt: &Interrupt,
        run: impl FnOnce(Planning<'_>) -> Report,
    ) -> Report {
        let epsilon = &choices.settings.epsilon;
        let clock = Clock::start();
        let seconds = || clock.seconds();
        let goes_on = || !interrupt.is_requested();
        let mut embedded = Embedded {
            settings: embedded::Settings {
                epsilon: epsilon.clone(),
                ..embedded::Settings::default()
            },
            most_states: arguments.planner_states,
            improve_states: arguments.improve_states,
            clock: Some(&seconds),
            goes_on: Some(&goes_on),
        };
        match self {
            Self::Nobody => run(Planning {
                planner: &mut NoPlanner,
                odds: None,
            }),
            Self::Embedded => match model.filter(|_| choices.executor.asks_odds()) {
                None => run(Planning {
                    planner: &mut embedded,
                    odds: None,
                }),
                Some(model) => {
                    let time = expected_planning_time(choices);
                    let states = (arguments.planner_states, arguments.improve_states);
                    run(Planning {
                        planner: &mut Likeliest::new(model.clone(), embedded, time),
                        odds: Some(odds(model, states, choices)),
                    })
                }
            },
            Self::Another(planner) => {
                let given = arguments.planner_time.as_ref();
                let limit = given.map(|time| Duration::from_secs_f64(time.to_f64().min(1e9)));
                let mut planner = External {
                    planner: (**planner).clone(),
                    domain: texts.domain.clone(),
                    problem: texts.problem.clone(),
                    settings: external::Settings {
                        epsilon: epsilon.clone(),
                        time_limit: Some(limit.unwrap_or(PATIENCE)),
                        ..external::Settings::default()
                    },
                    takes_first: limit.is_none(),
                    // The first Ctrl-C ends the planner with all that belongs to it.
                    goes_on: &goes_on,
                };
                run(Planning {
                    planner: &mut planner,
                    odds: None,
                })
            }
        }
    }
}

/// What is taken for likely in a world like that, with limits that do not depend on the machine.
pub(super) fn odds(model: &WorldModel, states: (u64, u64), choices: &Choices) -> Box<dyn Odds> {
    let planner = Embedded {
        settings: embedded::Settings {
            epsilon: choices.settings.epsilon.clone(),
            ..embedded::Settings::default()
        },
        most_states: states.0,
        improve_states: states.1,
        clock: None,
        goes_on: None,
    };
    let time = expected_planning_time(choices);
    Box::new(Likeliest::new(model.clone(), planner, time))
}

/// Nobody knows beforehand how long planning takes where that is measured.
fn expected_planning_time(choices: &Choices) -> Rational {
    match &choices.settings.planning_time {
        PlanningTime::Seconds(seconds) => seconds.clone(),
        PlanningTime::Measured => Rational::ZERO,
    }
}
