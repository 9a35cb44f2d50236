//! A trial as a document: `docs/formats/course.md`.

use elbowroom_model::Task;
use elbowroom_model::ground::FactId;
use serde::{Deserialize, Serialize};

use super::{PerturbedError, Setting, WorldKind};
use crate::untimed::{Course, Entry, ExecutorName, StepKind};

const FORMAT: &str = "elbowroom-course";

/// What happened in a trial in a world without time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredCourse {
    format: String,
    version: u64,
    /// The title of the experiment.
    pub title: String,
    /// The case.
    pub case: String,
    /// The world.
    pub world: WorldKind,
    /// The executor.
    pub executor: ExecutorName,
    /// The number of the trial, from 0.
    pub trial: u64,
    /// Its seed.
    pub seed: u64,
    /// How it ended: `goal-reached`, or why not.
    pub ended: String,
    /// The plans, one of each round.
    pub plans: Vec<StoredPlan>,
}

/// A round.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredPlan {
    /// The plan's actions, by start.
    pub actions: Vec<String>,
    /// What was done.
    pub steps: Vec<StoredStep>,
}

/// An attempt to start an action, or its end.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredStep {
    /// `started`, `not-started` or `ended`.
    pub step: String,
    /// The action.
    pub action: String,
    /// The facts that have become true.
    pub became_true: Vec<String>,
    /// The facts that have become false.
    pub became_false: Vec<String>,
    /// Whether the goal cannot be reached any more; absent where nobody knows.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_dead_end: bool,
}

impl StoredCourse {
    pub(super) fn new(
        setting: &Setting<'_>,
        (world, executor): (WorldKind, ExecutorName),
        trial: u64,
        course: &Course,
    ) -> Self {
        let mut plans: Vec<StoredPlan> = Vec::new();
        for entry in &course.entries {
            match (entry, plans.last_mut()) {
                (Entry::Plan(actions), _) => plans.push(StoredPlan {
                    actions: actions.clone(),
                    steps: Vec::new(),
                }),
                (entry, Some(plan)) => plan.steps.extend(step(&setting.task, entry)),
                // Nothing is done without a plan.
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

    /// As JSON on one line.
    pub fn text(&self) -> String {
        let mut text = serde_json::to_string(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// Reads such a document.
    ///
    /// # Errors
    /// When it is none.
    pub fn read(text: &str) -> Result<Self, PerturbedError> {
        let course: Self = serde_json::from_str(text)
            .map_err(|error| PerturbedError::other(format!("no course of a trial: {error}")))?;
        if course.format == FORMAT && course.version == 1 {
            Ok(course)
        } else {
            let reads = format!("this program reads {FORMAT}, version 1");
            Err(PerturbedError::other(reads))
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
