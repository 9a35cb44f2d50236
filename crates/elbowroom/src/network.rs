//! Temporal networks from files in the formats of the field: controllability checks and simulated
//! dispatch.
//!
//! [`read()`] reads a file in any known format. [`analyze`] answers a [`Request`] about it with an
//! [`Answer`], which can be serialized as JSON (`docs/reference/formats/network.md`).
//!
//! ```
//! use elbowroom::network::{Request, Verdict, analyze, read};
//!
//! let text = "# KIND OF NETWORK\nSTNU\n# Time-Point Names\nbrewed drunk cooled\n# \
//!             Ordinary Edges\ndrunk 0 cooled\n# Contingent Links\nbrewed 5 9 cooled\n";
//! let file = read("tea.plainstnu", text.as_bytes())?;
//! let answer = analyze(&file, &Request::default())?;
//! assert_eq!(answer.dynamic.map(|promise| promise.verdict), Some(Verdict::Yes));
//! assert_eq!(answer.strong.map(|promise| promise.verdict), Some(Verdict::Yes));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod allotment;
mod answer;
mod best_box;
mod dispatch;
mod draws;
mod law;
mod reasons;
mod simulate;

use std::sync::Arc;

use dispatch::Executor;

pub use answer::{
    Answer, ControllabilityCheck, ControllableBox, LinkDuration, LinkInterval, Number, Reason,
    Simulated, Step, Time, Verdict, ViolatedRequirement,
};
pub use elbowroom_network::*;
pub use simulate::{Durations, Simulation, SimulationError};

/// Default limit on branches in the check of weak controllability.
pub const MAX_BRANCHES: usize = 1 << 12;

/// A request for an analysis of a temporal network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// Limit on branches in the check of weak controllability.
    pub most_branches: usize,
    /// Searches for the most probable controllable box if the network is not controllable.
    pub is_box_requested: bool,
    /// Distribution of durations, for the box and for simulated runs.
    pub durations: Durations,
    /// Simulated runs, if any. They follow the box, if there is one.
    pub simulation: Option<Simulation>,
}

impl Default for Request {
    fn default() -> Self {
        Self {
            most_branches: MAX_BRANCHES,
            is_box_requested: false,
            durations: Durations::Given,
            simulation: None,
        }
    }
}

/// Checks the controllability of a network, explains failures, and simulates dispatch.
///
/// # Errors
/// When the network cannot be simulated as requested.
pub fn analyze(file: &NetworkFile, request: &Request) -> Result<Answer, SimulationError> {
    let consistent = reasons::consistent(file);
    // Most networks have many more bounds in their dispatchable form. Only simulation needs it.
    let form = request
        .simulation
        .is_some()
        .then(|| file.network.dispatchable());
    let (mut weak, mut dynamic, mut strong) = (None, None, None);
    if !file.is_certain() {
        let is_controllable = match &form {
            Some(form) => form.as_ref().map(|_| ()).map_err(Clone::clone),
            None => file.network.check_controllability(),
        };
        weak = Some(match &is_controllable {
            Ok(()) => ControllabilityCheck::yes(),
            Err(_) => reasons::weak(file, request.most_branches),
        });
        dynamic = Some(match &is_controllable {
            Ok(()) => ControllabilityCheck::yes(),
            Err(conflict) => reasons::dynamic(file, conflict),
        });
        strong = Some(reasons::strong(file));
    }
    let is_executable = dynamic.as_ref().unwrap_or(&consistent).verdict == Verdict::Yes;
    let best = (request.is_box_requested && !is_executable)
        .then(|| best_box::find(file, request.durations))
        .flatten();
    let simulation = match &request.simulation {
        Some(simulation) => {
            let form = form.and_then(Result::ok).map(Arc::new);
            let in_box = || Some(Executor::BestBox(Arc::new(best.as_ref()?.dispatchable()?)));
            let executor = form.map(Executor::Dispatchable).or_else(in_box);
            Some(simulate::run(
                file,
                executor,
                simulation,
                request.durations,
            )?)
        }
        None => None,
    };
    Ok(Answer {
        format: answer::FORMAT.to_owned(),
        version: answer::VERSION,
        name: file.name.clone(),
        read_as: file.format.name().to_owned(),
        points: file.points.len(),
        requirements: file.network.requirements().constraints().len(),
        links: file.network.links().len(),
        remarks: file.remarks.clone(),
        consistent,
        weak,
        dynamic,
        strong,
        best: best.map(|best| best.describe(file)),
        simulation,
    })
}
