//! The region of a plan: all values for which it works, as inequalities.

mod boxes;
mod measure;
mod picture;
mod sampling;

use std::fmt::Write as _;

use elbowroom_envelope::explain::Explainer;
use elbowroom_envelope::linear_form::LinearForm;
use elbowroom_envelope::obligations::{Refusal, Requirement};
use elbowroom_envelope::{ExactError, RegionRow, RegionSource, exact as exact_region};
use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, ParameterKind, ParametrizedPlan, Side};
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::envelope::{self, Inequalities, Quantity, Timeline, quantities};
use super::{EnvelopeRequest, Exact, Observer, RequestError, Version, ViolationAnswer, exact};
use crate::pipeline::PipelineError;

pub use boxes::{BoxAnswer, IntervalAnswer};
pub use measure::{Measure, Share};
pub use picture::{Others, PictureError, Plane, picture};

/// Largest number of positions that are distinguished for a moment inside an action.
const MAX_POSITIONS: usize = 256;

/// The answer as a document (`docs/reference/formats/region-json.md`), with the plan and the region.
#[derive(Clone, Debug)]
pub struct RegionOutcome {
    /// The answer.
    pub answer: RegionAnswer,
    /// The plan with its open quantities; `None` if the validator rejects it.
    pub plan: Option<ParametrizedPlan>,
    /// The region; `None` if the answer has none.
    pub region: Option<elbowroom_envelope::Region>,
}

/// All values of its parameters for which a plan works: `docs/reference/formats/region-json.md`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RegionAnswer {
    /// Format of the document.
    pub format: RegionFormat,
    /// Version of the document.
    pub version: Version,
    /// The domain's name.
    pub domain: String,
    /// The problem's name.
    pub problem: String,
    /// The name of the plan, as the request gives it.
    pub plan: String,
    /// The least separation of interfering happenings (ε).
    #[serde(with = "exact")]
    pub epsilon: Rational,
    /// The answer itself.
    #[serde(flatten)]
    pub finding: RegionFinding,
}

/// Format of a document.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum RegionFormat {
    /// The name `elbowroom-region`.
    #[default]
    #[serde(rename = "elbowroom-region")]
    Region,
}

/// The result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "answer", rename_all = "lowercase")]
pub enum RegionFinding {
    /// The plan works exactly for the values in the pieces, among all values that keep the nominal
    /// order of happenings.
    Region {
        /// The parameters.
        parameters: Vec<Quantity>,
        /// The pieces, which are disjoint. Empty if the plan works for no values.
        pieces: Vec<PieceAnswer>,
        /// The reason why this is only a part of the region: a limit, or lack of time. `None` if it
        /// is the whole region.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        missing: Option<String>,
        /// Boxes inside the region, if requested.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        boxes: Vec<BoxAnswer>,
        /// The volume, if requested and positive.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        measure: Option<Measure>,
        /// The times of the plan, as planned and for all values in the ranges of the parameters.
        /// `None` in documents of earlier versions of this program.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        timeline: Option<Timeline>,
        /// The inequalities that every schedule satisfies; `None` if there are too many.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        inequalities: Option<Inequalities>,
    },
    /// The validator rejects the plan as it is.
    Invalid {
        /// The reason.
        violation: ViolationAnswer,
    },
    /// The plan has no schedule at its nominal values, and the order of happenings is not known.
    Unscheduled,
    /// The region is not known.
    None {
        /// The reason: a limit, or lack of time.
        reason: String,
    },
}

/// The values that satisfy some inequalities, without redundant ones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PieceAnswer {
    /// The inequalities.
    pub rows: Vec<RowAnswer>,
}

/// `Σ factor · parameter <= bound`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RowAnswer {
    /// The inequality for users: `dur_0 + dur_3 <= 4893/100`.
    pub text: String,
    /// The nonzero factors of parameters, by name.
    pub factors: IndexMap<String, Exact>,
    /// The upper bound of the sum.
    #[serde(with = "exact")]
    pub bound: Rational,
    /// `true` if the sum has to be below the bound.
    pub strict: bool,
    /// The bounds of the plan and the conditions that imply it, in words. Empty for the range of a
    /// parameter, and for mere orderings.
    pub because: Vec<String>,
}

/// Optional parts of an answer about a region.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RegionSettings {
    /// `true` if the answer has boxes: IRR's and the best ones.
    pub with_boxes: bool,
    /// `true` if the answer has the volume, and each box's share of it.
    pub with_volume: bool,
    /// Random seed for sampled volumes, used for more than a few connected parameters.
    pub seed: u64,
}

/// Computes all values for which a plan works.
///
/// The request's guarantee, box and search do not matter, because the values are fixed: either
/// there is a schedule for them or not.
///
/// # Errors
/// When the request names quantities that the plan does not have, or the plan is beyond exact analysis.
pub fn region(
    request: &EnvelopeRequest,
    settings: &RegionSettings,
    watcher: &mut dyn Observer,
) -> Result<RegionOutcome, RequestError> {
    let task = &request.task;
    let outcome = |finding, plan, region| outcome(request, finding, plan, region);
    let plan = match envelope::parametrized_plan(request) {
        Ok((plan, _)) => plan,
        Err(PipelineError::Invalid(violation)) => {
            let violation = (&*violation).into();
            return Ok(outcome(RegionFinding::Invalid { violation }, None, None));
        }
        Err(error) => return Err(error.into()),
    };
    let ranges = DecoupledEnvelope::ranges(&plan);
    let form = match LinearForm::new(task, &plan, &ranges, &plan.nominal(), MAX_POSITIONS) {
        Ok(form) => form,
        Err(Refusal::NoNominalSchedule) => {
            return Ok(outcome(RegionFinding::Unscheduled, Some(plan), None));
        }
        Err(refusal) => return Err(PipelineError::Refused(refusal).into()),
    };
    let network = form.network.iter().map(|bound| bound.inequality.clone());
    let network: Vec<_> = network.collect();
    let found = exact_region(&plan, &network, &form.obligations, &mut || {
        watcher.flow().map_break(|_| ())
    });
    let explainer = Explainer::new(task, &plan);
    let finding = match &found {
        Ok(found) => {
            let row = |row: &RegionRow| row_answer(&explainer, &form, row);
            let pieces = found.pieces.iter().map(|piece| PieceAnswer {
                rows: piece.rows.iter().map(row).collect(),
            });
            let mut boxes = if settings.with_boxes {
                boxes::boxes(request, watcher)?
            } else {
                Vec::new()
            };
            let measure = if settings.with_volume {
                let most = &request.search.best.max_deviation;
                let flow = &mut || watcher.flow().map_break(|_| ());
                measure::measure(&plan, found, &mut boxes, most, settings.seed, flow)
            } else {
                None
            };
            RegionFinding::Region {
                parameters: quantities(&explainer),
                pieces: pieces.collect(),
                missing: found.missing.as_ref().map(ToString::to_string),
                boxes,
                measure,
                timeline: Timeline::of(task, &plan, &ranges),
                inequalities: Inequalities::of(&explainer),
            }
        }
        Err(ExactError::NotLinear {
            requirement: Some(requirement),
        }) => RegionFinding::None {
            reason: format!(
                "\"{}\" multiplies open quantities, so the region is not polyhedral: vary fewer \
                 quantities (--vary)",
                form.obligations[*requirement]
                    .requirement
                    .describe(task, &plan.plan)
            ),
        },
        Err(limit) => RegionFinding::None {
            reason: limit.to_string(),
        },
    };
    Ok(outcome(finding, Some(plan), found.ok()))
}

/// Builds the answer of an interrupted computation, which has no partial result.
pub fn partial_result(request: &EnvelopeRequest) -> RegionOutcome {
    let reason = ExactError::Stopped.to_string();
    outcome(request, RegionFinding::None { reason }, None, None)
}

fn outcome(
    request: &EnvelopeRequest,
    finding: RegionFinding,
    plan: Option<ParametrizedPlan>,
    region: Option<elbowroom_envelope::Region>,
) -> RegionOutcome {
    let task = &request.task;
    let answer = RegionAnswer {
        format: RegionFormat::Region,
        version: Version,
        domain: task.problem().domain.clone(),
        problem: task.problem().name.clone(),
        plan: request.name.clone(),
        epsilon: task.epsilon().clone(),
        finding,
    };
    RegionOutcome {
        answer,
        plan,
        region,
    }
}

fn row_answer(explainer: &Explainer<'_>, form: &LinearForm, row: &RegionRow) -> RowAnswer {
    let (task, plan) = (explainer.task, explainer.plan);
    let name = |id| plan.parameter(id).name.clone();
    let mut because: Vec<String> = Vec::new();
    let mut bounds = Vec::new();
    for source in &row.sources {
        match *source {
            RegionSource::Range(_) => {}
            RegionSource::Network(index) => bounds.extend(form.network[index].source),
            RegionSource::Requirement(index) => match &form.obligations[index].requirement {
                // The network rows already describe separations.
                Requirement::Separation { .. } => {}
                other => because.push(other.describe(task, &plan.plan)),
            },
        }
    }
    if because.is_empty() {
        because.extend(describe_duration_row(explainer, row, &bounds));
    }
    let factors = row.factors.iter();
    RowAnswer {
        text: format_row(plan, row),
        factors: factors
            .map(|(id, factor)| (name(*id), Exact(factor.clone())))
            .collect(),
        bound: row.bound.clone(),
        strict: row.is_strict,
        because,
    }
}

/// Describes a row about durations: which actions have to fit into which others.
fn describe_duration_row(
    explainer: &Explainer<'_>,
    row: &RegionRow,
    bounds: &[(usize, Side)],
) -> Option<String> {
    let (mut takes, mut gives) = (Vec::new(), Vec::new());
    for (id, factor) in &row.factors {
        let ParameterKind::Duration(instance) = explainer.plan.parameter(*id).kind else {
            return None;
        };
        let action = explainer.action_name(instance).to_owned();
        if factor.is_negative() {
            gives.push(action);
        } else {
            takes.push(action);
        }
    }
    explainer.describe_sum(takes, gives, bounds)
}

/// Formats a row with positive factors on both sides: `dur_0 + dur_3 <= 4893/100`.
fn format_row(plan: &ParametrizedPlan, row: &RegionRow) -> String {
    let (mut left, mut right) = (String::new(), String::new());
    for (id, factor) in &row.factors {
        let side = if factor.is_negative() {
            &mut right
        } else {
            &mut left
        };
        if !side.is_empty() {
            side.push_str(" + ");
        }
        let factor = factor.abs();
        if factor != Rational::ONE {
            // Writing to a string cannot fail.
            let _ = write!(side, "{factor} ");
        }
        side.push_str(&plan.parameter(*id).name);
    }
    let equal = if row.is_strict { "" } else { "=" };
    if left.is_empty() {
        return format!("{right} >{equal} {}", -&row.bound);
    }
    let bound = &row.bound;
    if right.is_empty() {
        format!("{left} <{equal} {bound}")
    } else if bound.is_zero() {
        format!("{left} <{equal} {right}")
    } else if bound.is_negative() {
        format!("{left} <{equal} {right} - {}", bound.abs())
    } else {
        format!("{left} <{equal} {right} + {bound}")
    }
}
