//! Known reasons for which there is no plan.

use elbowroom_execution::{Lateness, Shortfall};
use serde::{Deserialize, Serialize};

use crate::exact::Exact;

/// Known reasons for which the goals have no plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShortfallLine {
    /// The deadlines that are missed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub late: Vec<LatenessLine>,
    /// Conjuncts of the goal that exclude each other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub conflict: Vec<String>,
}

/// A deadline that is missed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LatenessLine {
    /// The position of its goal among the pursued goals with deadlines.
    pub place: usize,
    /// The time at which the earliest plan found without deadlines reaches the goal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reached: Option<Exact>,
    /// A time before which no plan reaches the goal, as a certificate proves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least: Option<Exact>,
}

impl ShortfallLine {
    pub(crate) fn of(shortfall: &Shortfall) -> Option<Self> {
        let late = shortfall.missed_deadlines.iter().map(|it| LatenessLine {
            place: it.deadline_index,
            reached: it.achieved_at.clone().map(Exact),
            least: it.proven_lower_bound.clone().map(Exact),
        });
        (*shortfall != Shortfall::default()).then(|| Self {
            late: late.collect(),
            conflict: shortfall.conflict.clone(),
        })
    }

    pub(crate) fn read(self) -> Shortfall {
        let late = self.late.into_iter().map(|it| Lateness {
            deadline_index: it.place,
            achieved_at: it.reached.map(|it| it.0),
            proven_lower_bound: it.least.map(|it| it.0),
        });
        Shortfall {
            missed_deadlines: late.collect(),
            conflict: self.conflict,
        }
    }
}
