//! Valid plan, parsed and deordered.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use elbowroom::model::{Step, Task, TimeTriggeredPlan};
use elbowroom::pddl::{self, read_problem};
use elbowroom::pipeline;
use elbowroom::plan::deorder::Deordered;
use elbowroom::plan::format;
use elbowroom::plan::{NodeId, Valuation, network_node};
use elbowroom::{PlanKind, RoundingRule, stn};

use super::planning;
use super::sources::{Origin, Source};

/// Problem with a valid plan.
pub(crate) struct Subject {
    pub(crate) family: String,
    pub(crate) name: String,
    pub(crate) task: Arc<Task>,
    pub(crate) plan: TimeTriggeredPlan,
    pub(crate) freed: Deordered,
}

/// Settings of the planner.
#[derive(Clone, Debug)]
pub(crate) struct Planning {
    /// Folder of stored plans.
    pub(crate) cache: Option<PathBuf>,
    /// Maximum number of states in the search.
    pub(crate) states: u64,
    /// Time limit for missing plans; `None` to compute none.
    pub(crate) time: Option<Duration>,
}

impl Subject {
    /// Reads a problem and a plan from texts.
    ///
    /// # Errors
    /// The plan does not count; the text says why.
    pub(crate) fn of_texts(
        [family, name]: [&str; 2],
        [domain, problem, plan]: [&str; 3],
    ) -> Result<Self, String> {
        let text = |what: &str, text: &str| pddl::Source::new(what, text);
        let read = read_problem(&text("domain", domain), &text("problem", problem));
        let (problem, _) = read.map_err(|_| "rejected by the reader of problems".to_owned())?;
        let task = Task::new(problem);
        Self::of_bytes([family, name], task, plan.as_bytes())
    }

    /// Reads a problem, and reads or computes its plan.
    ///
    /// # Errors
    /// It does not count; the text says why.
    pub(crate) fn of_source(source: &Source, how: &Planning) -> Result<Self, String> {
        let task = task(&source.domain, &source.problem)?;
        let bytes = match &source.origin {
            Origin::File(path) => read(path)?,
            Origin::Planned => planning::plan(source, &task, how)?.into_bytes(),
        };
        Self::of_bytes([&source.family, &source.name], task, &bytes)
    }

    fn of_bytes([family, name]: [&str; 2], task: Task, bytes: &[u8]) -> Result<Self, String> {
        let plan = match PlanKind::of_text(&String::from_utf8_lossy(bytes)) {
            PlanKind::TimeTriggered => {
                let text = pddl::Source::from_bytes("plan", bytes);
                let read = RoundingRule::default().read_plan(&text, &task);
                read.map_err(|_| "rejected by the reader of plans")?.0
            }
            PlanKind::Stn => scheduled(bytes, &task)?,
        };
        if plan.steps.is_empty() {
            return Err("an empty plan".to_owned());
        }
        let freed = pipeline::free(&task, &plan).map_err(|error| match error {
            pipeline::PipelineError::Invalid(_) => "the validator rejects the plan".to_owned(),
            _ => "the plan cannot be relaxed".to_owned(),
        })?;
        Ok(Self {
            family: family.to_owned(),
            name: name.to_owned(),
            task: Arc::new(task),
            plan,
            freed,
        })
    }

    /// Returns the same plan, parsed from a text with the opposite order of lines with equal start
    /// times. `None` if there are no such lines, or if its times cannot be written exactly.
    pub(crate) fn turned_round(&self) -> Option<Result<Self, String>> {
        let mut plan = self.plan.clone();
        plan.steps.reverse();
        Step::sort_by_start(&mut plan.steps);
        if plan == self.plan {
            return None;
        }
        let text = pddl::write_plan(&self.task, &plan);
        let task = Task::clone(&self.task);
        let (read, _) = pddl::read_plan(&pddl::Source::new("plan", &text), &task).ok()?;
        if read.makespan() != self.plan.makespan() {
            return None;
        }
        Some(match pipeline::free(&task, &read) {
            Ok(freed) => Ok(Self {
                family: self.family.clone(),
                name: self.name.clone(),
                task: Arc::new(task),
                plan: read,
                freed,
            }),
            Err(error) => Err(error.to_string()),
        })
    }
}

/// Returns the earliest schedule of an STN plan file at its nominal values.
fn scheduled(bytes: &[u8], task: &Task) -> Result<TimeTriggeredPlan, String> {
    let plan = format::read(bytes, task).map_err(|_| "rejected by the reader of STN plans")?;
    let plan = plan.plan.at(&plan.nominal());
    let network = stn::ConsistentNetwork::try_from(plan.network(&Valuation::default()));
    let network = network.map_err(|_| "an STN plan without a schedule")?;
    let schedule = network.earliest_schedule(network_node(NodeId::ZERO));
    Ok(plan.scheduled(&schedule.into()))
}

/// Reads the task of two files.
pub(crate) fn task(domain: &Path, problem: &Path) -> Result<Task, String> {
    let source = |path: &Path| {
        let bytes = read(path)?;
        Ok::<_, String>(pddl::Source::from_bytes(path.display().to_string(), &bytes))
    };
    let read = read_problem(&source(domain)?, &source(problem)?);
    let (problem, _) = read.map_err(|_| "rejected by the reader of problems".to_owned())?;
    Ok(Task::new(problem))
}

fn read(path: &Path) -> Result<Vec<u8>, String> {
    fs::read(path).map_err(|_| "a missing file".to_owned())
}
