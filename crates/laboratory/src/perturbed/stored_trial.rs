//! Course of a trial as a document: `docs/reference/formats/course.md`.

use elbowroom_model::Task;
use elbowroom_model::ground::FactId;
use serde::{Deserialize, Serialize};

use super::{ExperimentError, Setting, WorldKind};
use crate::untimed::{Entry, ExecutorName, StepKind, StepRecord};

const FORMAT: &str = "elbowroom-course";

/// Course of a trial in a world without time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredTrial {
    format: String,
    version: u64,
    /// Title of the experiment.
    pub title: String,
    /// The case.
    pub case: String,
    /// The world.
    pub world: WorldKind,
    /// The executor.
    pub executor: ExecutorName,
    /// Number of the trial, from 0.
    pub trial: u64,
    /// Its seed.
    pub seed: u64,
    /// Ending: `goal-reached`, or the kind of failure.
    pub ended: String,
    /// Plans, one for each round.
    pub plans: Vec<StoredPlan>,
}

/// Round.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredPlan {
    /// Actions of the plan, by start.
    pub actions: Vec<String>,
    /// Executed steps.
    pub steps: Vec<StoredStep>,
}

/// Attempt to start an action, or its end.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredStep {
    /// `started`, `not-started`, `ended` or `failed`.
    pub step: String,
    /// The action.
    pub action: String,
    /// Facts that it made true.
    pub became_true: Vec<String>,
    /// Facts that it made false.
    pub became_false: Vec<String>,
    /// `true` if the goal cannot be reached any more; absent if dead ends are not detected.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_dead_end: bool,
}

impl StoredTrial {
    pub(super) fn new(
        setting: &Setting<'_>,
        (world, executor): (WorldKind, ExecutorName),
        trial: u64,
        course: &StepRecord,
    ) -> Self {
        let mut plans: Vec<StoredPlan> = Vec::new();
        for entry in &course.entries {
            match (entry, plans.last_mut()) {
                (Entry::Plan(actions), _) => plans.push(StoredPlan {
                    actions: actions.clone(),
                    steps: Vec::new(),
                }),
                (entry, Some(plan)) => plan.steps.extend(step(&setting.task, entry)),
                // There are no steps without a plan.
                (_, None) => {}
            }
        }
        let ended = course.ending.map_or("goal-reached", |ending| ending.name());
        Self {
            format: FORMAT.to_owned(),
            version: 1,
            title: setting.experiment.title.clone(),
            case: setting.case.name.clone(),
            world,
            executor,
            trial,
            seed: setting.seed(trial),
            ended: ended.to_owned(),
            plans,
        }
    }

    /// Returns the document as JSON on one line.
    pub fn text(&self) -> String {
        let mut text = serde_json::to_string(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// Reads a document.
    ///
    /// # Errors
    /// The text does not hold the course of a trial.
    pub fn read(text: &str) -> Result<Self, ExperimentError> {
        let course: Self = serde_json::from_str(text)
            .map_err(|error| ExperimentError::other(format!("not a stored trial: {error}")))?;
        if course.format == FORMAT && course.version == 1 {
            Ok(course)
        } else {
            let reads = format!("this program reads {FORMAT}, version 1");
            Err(ExperimentError::other(reads))
        }
    }
}

fn step(task: &Task, entry: &Entry) -> Option<StoredStep> {
    let Entry::Step {
        kind,
        action,
        became_true,
        became_false,
        is_dead_end,
    } = entry
    else {
        return None;
    };
    let names = |facts: &[FactId]| {
        let names = facts.iter().map(|fact| task.fact_name(*fact));
        names.collect()
    };
    let kind = match kind {
        StepKind::Started => "started",
        StepKind::NotStarted => "not-started",
        StepKind::Ended => "ended",
        StepKind::Failed => "failed",
    };
    Some(StoredStep {
        step: kind.to_owned(),
        action: action.clone(),
        became_true: names(became_true),
        became_false: names(became_false),
        is_dead_end: *is_dead_end,
    })
}
