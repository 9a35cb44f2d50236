//! Boxes inside the region, for comparison.

use std::ops::ControlFlow;

use elbowroom_envelope::{BestSettings, Guarantee, Method, Objective};
use elbowroom_num::{End, Interval};
use elbowroom_plan::DecoupledEnvelope;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::Share;
use crate::answers::envelope::{EnvelopeRequest, Search, envelope};
use crate::answers::{Observer, RequestError, exact};

/// A box inside the region.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoxAnswer {
    /// The search that found it: `irr`, or the objective of the best box: `least-slack`, `widths`.
    pub name: String,
    /// The interval of each parameter, by name.
    pub intervals: IndexMap<String, IntervalAnswer>,
    /// Its share of the region's volume; `None` if it was not requested, or is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub share: Option<Share>,
    #[serde(skip)]
    pub(super) own: Vec<Interval>,
}

/// An interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct IntervalAnswer {
    /// The lower end.
    #[serde(with = "exact::lower")]
    pub lower: End,
    /// The upper end.
    #[serde(with = "exact::upper")]
    pub upper: End,
}

/// Returns boxes of the request's plan for the weak guarantee, on which the region is based. Boxes
/// that are not found before the watcher stops the search are left out.
pub(super) fn boxes(
    request: &EnvelopeRequest,
    watcher: &mut dyn Observer,
) -> Result<Vec<BoxAnswer>, RequestError> {
    let irr = Search::irr();
    let best = |objective| Search {
        method: Some(Method::Best),
        best: BestSettings {
            objective,
            ..request.search.best.clone()
        },
        ..Search::default()
    };
    let searches = [
        ("irr", irr),
        (Objective::LeastSlack.name(), best(Objective::LeastSlack)),
        (Objective::Widths.name(), best(Objective::Widths)),
    ];
    let mut boxes = Vec::new();
    for (name, search) in searches {
        if let ControlFlow::Break(_) = watcher.flow() {
            break;
        }
        let request = EnvelopeRequest {
            guarantee: Guarantee::Weak,
            contains: None,
            search,
            ..request.clone()
        };
        let outcome = envelope(&request, watcher)?;
        if let (Some(plan), Some(envelope)) = (&outcome.plan, &outcome.envelope) {
            boxes.push(BoxAnswer::new(name, plan, envelope));
        }
    }
    Ok(boxes)
}

impl BoxAnswer {
    fn new(
        name: &str,
        plan: &elbowroom_plan::ParametrizedPlan,
        envelope: &DecoupledEnvelope,
    ) -> Self {
        let both = plan.parameters.iter().zip(envelope.intervals());
        let interval = |(parameter, interval): (&elbowroom_plan::Parameter, &Interval)| {
            let ends = IntervalAnswer {
                lower: interval.lower.clone(),
                upper: interval.upper.clone(),
            };
            (parameter.name.clone(), ends)
        };
        Self {
            name: name.to_owned(),
            intervals: both.map(interval).collect(),
            share: None,
            own: envelope.intervals().to_vec(),
        }
    }
}
