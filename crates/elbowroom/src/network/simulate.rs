//! Simulation of dispatch: its success rate.

use std::collections::BTreeMap;

use elbowroom_network::NetworkFile;
use elbowroom_num::Rational;
use elbowroom_report::statistics::Proportion;
use elbowroom_stn::{ConsistentNetwork, ConstraintId};
use serde::{Deserialize, Serialize};

use super::answer::{Simulated, ViolatedRequirement};
use super::dispatch::{self, Executor};
use super::draws::Draws;

/// Maximum number of reported violated requirements.
const MAX_VIOLATIONS: usize = 3;

/// Settings of simulated runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Simulation {
    /// The number of runs.
    pub runs: u64,
    /// The random seed.
    pub seed: u64,
}

/// The distribution of the durations of links.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Durations {
    /// The distribution in the file, or uniform between the bounds if it has none.
    Given,
    /// Uniform between the bounds.
    Uniform,
}

/// A link has no upper bound, so its durations cannot be drawn uniformly.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the link from `{activation}` to `{end}` has no upper bound, so its durations cannot be drawn \
     uniformly; {}",
    if *is_given {
        "draw them from the distributions of the file"
    } else {
        "give it an upper bound or a distribution"
    }
)]
pub struct SimulationError {
    /// The activation point of the link.
    pub activation: String,
    /// The end point of the link.
    pub end: String,
    /// `true` if the file has a distribution for its duration.
    pub is_given: bool,
}

/// Makes the runs. Without an executor, points happen as early as the windows allow.
pub(super) fn run(
    file: &NetworkFile,
    executor: Option<Executor>,
    simulation: &Simulation,
    durations: Durations,
) -> Result<Simulated, SimulationError> {
    let draws = Draws::new(file, simulation.seed, durations)?;
    let executor = executor.or_else(|| {
        let kind = ConsistentNetwork::try_from(file.kind_network()).ok()?;
        Some(Executor::EarlyFirst(kind.minimal()))
    });
    let name = match &executor {
        Some(Executor::Dispatchable(_)) => "dispatchable",
        Some(Executor::BestBox(_)) => "best-box",
        _ => "early-first",
    };
    let mut proportion = Proportion::default();
    let mut outside = 0;
    let mut broken: BTreeMap<ConstraintId, u64> = BTreeMap::new();
    for number in 0..simulation.runs {
        let lengths = draws.run(number);
        outside += u64::from(is_outside(file, &lengths));
        // Without a schedule there is nothing to execute.
        let schedule = executor
            .as_ref()
            .and_then(|executor| dispatch::run(&file.network, executor, &lengths));
        let requirements = file.network.requirements();
        let mut is_kept = schedule.is_some();
        for id in requirements.constraint_ids() {
            let constraint = requirements.constraint(id);
            if schedule
                .as_ref()
                .is_some_and(|times| !constraint.holds_in(times))
            {
                is_kept = false;
                *broken.entry(id).or_default() += 1;
            }
        }
        proportion.add(is_kept);
    }
    let mut broken: Vec<(ConstraintId, u64)> = broken.into_iter().collect();
    broken.sort_by_key(|&(id, runs)| (std::cmp::Reverse(runs), id));
    let broken = broken
        .into_iter()
        .take(MAX_VIOLATIONS)
        .map(|(id, runs)| ViolatedRequirement {
            requirement: file.requirement_in_words(id),
            runs,
        });
    let (lowest, highest) = proportion.wilson().unwrap_or((0.0, 1.0));
    Ok(Simulated {
        runs: simulation.runs,
        successes: proportion.successes,
        share: proportion.share().unwrap_or_default(),
        interval: [lowest, highest],
        seed: simulation.seed,
        durations: if file.durations.iter().all(Option::is_none) {
            Durations::Uniform
        } else {
            durations
        },
        executor: name.to_owned(),
        outside,
        broken: broken.collect(),
    })
}

fn is_outside(file: &NetworkFile, durations: &[Rational]) -> bool {
    let links = file.network.links().iter().zip(durations);
    let mut outside = links.map(|(link, duration)| {
        *duration < link.lower || link.upper.as_ref().is_some_and(|upper| duration > upper)
    });
    outside.any(|is_outside| is_outside)
}
