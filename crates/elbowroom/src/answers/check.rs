//! Validation of plans.

mod goals;

use std::collections::BTreeSet;

use elbowroom_model::ground::FluentId;
use elbowroom_model::problem::PreferenceId;
use elbowroom_model::validate::{self, Margin, Preferences, Report, Settings, Verdict};
use elbowroom_model::{Footprint, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use serde::{Deserialize, Serialize};

pub use goals::GoalReached;

use super::{Exact, RequestError, Version, ViolationAnswer, exact};

/// Requests the validation of a plan, or, without a plan, a summary of a problem.
#[derive(Clone, Debug)]
pub struct CheckRequest<'a> {
    /// The problem.
    pub task: &'a Task,
    /// The plan.
    pub plan: Option<&'a TimeTriggeredPlan>,
    /// The name of the plan in the answer, such as its file.
    pub name: String,
    /// The validator's settings.
    pub settings: Settings,
}

/// The result of a validation: `docs/reference/formats/check-json.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum CheckAnswer {
    /// The answer about a plan.
    Plan(ValidationReport),
    /// The answer about a problem.
    Problem(ProblemSummary),
}

/// Format of a document.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum CheckFormat {
    /// The name `elbowroom-check`.
    #[default]
    #[serde(rename = "elbowroom-check")]
    Check,
}

/// The validator's report on a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ValidationReport {
    /// Format of the document.
    pub format: CheckFormat,
    /// Version of the document.
    pub version: Version,
    /// The name of the plan, as the request gives it.
    pub plan: String,
    /// The domain's name.
    pub domain: String,
    /// The problem's name.
    pub problem: String,
    /// The answer itself.
    #[serde(flatten)]
    pub finding: CheckFinding,
}

/// The verdict on a plan, with the evidence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "answer", rename_all = "lowercase")]
pub enum CheckFinding {
    /// The plan is valid.
    Valid {
        /// The time of the last happening of the plan's actions.
        #[serde(with = "exact")]
        makespan: Rational,
        /// The value of the problem's metric, if it has one that can be evaluated.
        #[serde(
            with = "exact::option",
            default,
            skip_serializing_if = "Option::is_none"
        )]
        metric: Option<Rational>,
        /// The value of each numeric fluent at the end.
        values: Vec<FluentValue>,
        /// Margins of the comparisons.
        margins: Vec<MarginAnswer>,
        /// The parts of the goal, by the time at which the plan reaches them.
        #[serde(default)]
        goals: Vec<GoalReached>,
        /// The preferences that are violated, or may be.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        preferences: Vec<PreferenceAnswer>,
    },
    /// The plan is not valid.
    Invalid {
        /// The violation.
        violation: ViolationAnswer,
    },
}

/// A preference that a plan violates, or may violate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PreferenceAnswer {
    /// Its name.
    pub name: String,
    /// Number of its instances that are violated; `None` if that cannot be decided.
    pub violations: Option<usize>,
    /// The violations, or the reasons why they are unknown.
    pub why: Vec<String>,
}

/// A numeric fluent at the end of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FluentValue {
    /// Its name: `(energy rover)`.
    pub fluent: String,
    /// Its value.
    pub value: Exact,
    /// `true` if an action of the plan changes it. Not in the document.
    #[serde(skip)]
    pub is_changed: bool,
}

/// Margin of a comparison that holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MarginAnswer {
    /// The comparison.
    pub condition: String,
    /// `at start`, `over all`, `at end`, `precondition` or `goal`.
    pub when: String,
    /// The action that needs it; `None` for the goal.
    pub action: Option<String>,
    /// Difference of the two sides at the tightest time.
    #[serde(with = "exact")]
    pub margin: Rational,
    /// The time at which the margin is smallest.
    #[serde(with = "exact")]
    pub time: Rational,
    /// `true` if a margin of 0 would be a violation.
    #[serde(rename = "strict")]
    pub is_strict: bool,
}

/// A summary of a problem.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProblemSummary {
    /// Format of the document.
    pub format: CheckFormat,
    /// Version of the document.
    pub version: Version,
    /// The result.
    pub answer: ProblemFinding,
    /// The domain's name.
    pub domain: String,
    /// The problem's name.
    pub problem: String,
}

/// The result for a problem without a plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ProblemFinding {
    /// The problem is readable.
    #[default]
    Readable,
}

/// Validates a plan.
///
/// # Errors
/// When the validator cannot decide whether the plan is valid.
pub fn check(request: &CheckRequest<'_>) -> Result<CheckAnswer, RequestError> {
    let task = request.task;
    let (domain, problem) = (task.problem().domain.clone(), task.problem().name.clone());
    let Some(plan) = request.plan else {
        return Ok(CheckAnswer::Problem(ProblemSummary {
            format: CheckFormat::Check,
            version: Version,
            answer: ProblemFinding::Readable,
            domain,
            problem,
        }));
    };
    let finding = match validate::validate(task, plan, &request.settings) {
        Verdict::Valid(report) => valid_finding(task, plan, &report),
        Verdict::Invalid(violation) => CheckFinding::Invalid {
            violation: (&violation).into(),
        },
        Verdict::Undecided(why) => return Err(RequestError::Undecided(why.to_string())),
    };
    Ok(CheckAnswer::Plan(ValidationReport {
        format: CheckFormat::Check,
        version: Version,
        plan: request.name.clone(),
        domain,
        problem,
        finding,
    }))
}

fn valid_finding(task: &Task, plan: &TimeTriggeredPlan, report: &Report) -> CheckFinding {
    let changed = changed_fluents(task, plan);
    let values = report.state.values.iter();
    CheckFinding::Valid {
        makespan: report.makespan.clone(),
        metric: report.metric(task),
        values: values
            .map(|(fluent, value)| FluentValue {
                fluent: task.fluent_name(*fluent),
                value: Exact(value.clone()),
                is_changed: changed.contains(fluent),
            })
            .collect(),
        margins: report.margins.iter().map(margin).collect(),
        goals: goals::goal_times(task, plan),
        preferences: preferences(task, &report.preferences),
    }
}

fn preferences(task: &Task, found: &Preferences) -> Vec<PreferenceAnswer> {
    let names = task.problem().preferences.iter().enumerate();
    let answers = names.map(|(position, name)| {
        let id = PreferenceId::from(position);
        let violated = found.violated.iter().filter(|one| one.preference == id);
        let violated = violated.map(|one| match &one.action {
            Some(action) => format!("{action} at {}: {}", format_time(&one.time), one.why),
            None => format!("at {}: {}", format_time(&one.time), one.why),
        });
        let undecided = found.undecided.iter().filter(|(other, _)| *other == id);
        let undecided = undecided.map(|(_, why)| format!("cannot tell: {why}"));
        PreferenceAnswer {
            name: name.clone(),
            violations: found.violations(id),
            why: violated.chain(undecided).collect(),
        }
    });
    answers
        .filter(|answer| answer.violations != Some(0))
        .collect()
}

/// Formats a time.
fn format_time(time: &Rational) -> String {
    time.to_decimal(3)
}

fn margin(margin: &Margin) -> MarginAnswer {
    MarginAnswer {
        condition: margin.condition.clone(),
        when: margin.when.to_string(),
        action: margin.action.as_ref().map(|action| action.name.clone()),
        margin: margin.margin.clone(),
        time: margin.time.clone(),
        is_strict: margin.is_strict,
    }
}

/// Returns the fluents that the plan's actions change.
fn changed_fluents(task: &Task, plan: &TimeTriggeredPlan) -> BTreeSet<FluentId> {
    let steps = plan.steps.iter();
    steps
        .flat_map(|step| {
            let start = Footprint::of_start(task, &step.action);
            [start, Footprint::of_end(task, &step.action)]
        })
        .flat_map(|footprint| footprint.shifts.into_iter().chain(footprint.assigns))
        .collect()
}
