//! Guarantees inside a box, and the part of the box check that depends on them.

use std::fmt;
use std::sync::{Arc, OnceLock};

use elbowroom_num::{Rational, terms};
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParametrizedPlan};
use elbowroom_stn::corner_search::TooManyBranches;

use serde::{Deserialize, Serialize};

use crate::control::{ControlConflict, DynamicControl, strong_conflict};
use crate::cut_generation::{CheckOutcome, fixed_time_cuts, schedule_cut, strategy_cuts};
use crate::feasibility::{Feasibility, Infeasible, MAX_BRANCHES};
use crate::objection::Objection;
use crate::obligations::{Refusal, ensure_not_stopped};
use crate::reduction::Reduction;

/// Number of parameters above which data about a box is not kept for the next one: the memory would
/// cost more than the time saved.
const MAX_CACHED_PARAMETERS: usize = 10_000;

terms! {
    /// Guarantee that holds inside an envelope.
    ///
    /// With each of them, every schedule that the plan's network allows is valid. They differ in what
    /// the executor has to know about the parameters to find such a schedule. The papers compute the weak one.
    #[derive(
        Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
    )]
    #[serde(rename_all = "lowercase")]
    #[non_exhaustive]
    pub enum Guarantee {
        Weak = "weak":
            "Weak controllability: a schedule exists for all values, if they are known in advance",
        #[default]
        Dynamic = "dynamic":
            "Dynamic controllability: an executor that observes each value only when it occurs succeeds",
        Strong = "strong": "Strong controllability: one fixed schedule works for all values",
    }
}

impl Guarantee {
    /// All guarantees, the weakest first.
    pub const ALL: [Self; 3] = [Self::Weak, Self::Dynamic, Self::Strong];
}

impl fmt::Display for Guarantee {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Decides whether a plan can be scheduled for the values in a box, by a guarantee.
///
/// One variant for each guarantee. All of them keep their result for the last box accepted, so that
/// moving one end of it costs little. The [`Oracle`](crate::Oracle) keeps track of that box, and
/// ensures that nothing else has moved.
#[derive(Clone, Debug)]
pub(crate) enum Controllability {
    Weak(Feasibility),
    Dynamic(Control, DynamicControl),
    Strong(Control),
}

/// The data shared by the dynamic and the strong guarantee.
#[derive(Clone, Debug)]
pub(crate) struct Control {
    pub(crate) plan: Arc<ParametrizedPlan>,
    /// Feasibility check, computed on first use. Values without any schedule are a better
    /// explanation of a rejection than a conflict. For many plans it is never needed.
    feasibility: OnceLock<Feasibility>,
    /// The box that `feasibility` found feasible last, if objections to wider boxes were computed.
    feasible: Option<DecoupledEnvelope>,
}

impl Control {
    fn feasibility(&self) -> &Feasibility {
        let make = || Feasibility::new(&self.plan, &Reduction::new(&self.plan));
        self.feasibility.get_or_init(make)
    }

    /// Returns values in the box without a schedule, if there are any and few enough cases.
    ///
    /// If `widened` is given, the box is that one, which is controllable, with the end moved out.
    fn infeasible(
        &mut self,
        envelope: &DecoupledEnvelope,
        widened: Option<(&DecoupledEnvelope, BoxEnd)>,
    ) -> Option<Infeasible> {
        self.feasibility();
        let feasibility = self.feasibility.get_mut()?;
        let Some((base, end)) = widened else {
            return feasibility.clone().infeasible(envelope, None).ok()?;
        };
        if self.feasible.as_ref() != Some(base) {
            self.feasible = None;
            if let Some(found) = feasibility.infeasible(base, None).ok()? {
                return Some(found);
            }
            self.feasible = Some(base.clone());
        }
        feasibility.infeasible_if_moved(envelope, end).ok()?
    }
}

/// Reason why a plan cannot be scheduled as required; [`Controllability::objection`] computes the
/// values.
#[derive(Clone, Debug)]
pub(crate) enum Uncontrollable {
    Weak(Infeasible),
    Conflict(ControlConflict),
}

impl Controllability {
    /// Creates the check for this plan, whose reduced network may be known already.
    pub(crate) fn new(
        guarantee: Guarantee,
        plan: &Arc<ParametrizedPlan>,
        reduction: Option<&Reduction>,
    ) -> Self {
        let feasibility = reduction.map(|reduction| Feasibility::new(plan, reduction));
        let control = |feasibility: Option<Feasibility>| Control {
            plan: Arc::clone(plan),
            feasibility: feasibility.map(OnceLock::from).unwrap_or_default(),
            feasible: None,
        };
        match guarantee {
            Guarantee::Weak => Self::Weak(
                feasibility.unwrap_or_else(|| Feasibility::new(plan, &Reduction::new(plan))),
            ),
            Guarantee::Dynamic => Self::Dynamic(control(feasibility), DynamicControl::default()),
            Guarantee::Strong => Self::Strong(control(feasibility)),
        }
    }

    /// Returns the reason why the box is rejected, if it is.
    ///
    /// If `moved` is given, the box differs from the last accepted one only in that end, which is
    /// further out.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub(crate) fn refuses(
        &mut self,
        envelope: &DecoupledEnvelope,
        moved: Option<BoxEnd>,
    ) -> Result<Option<Uncontrollable>, Refusal> {
        ensure_not_stopped()?;
        match self {
            Self::Weak(feasibility) => {
                let found = feasibility.infeasible(envelope, moved);
                let found = found.map_err(too_many)?;
                Ok(found.map(Uncontrollable::Weak))
            }
            Self::Dynamic(control, dynamic) => {
                let conflict = dynamic.conflict(&control.plan, envelope);
                Ok(conflict.map(Uncontrollable::Conflict))
            }
            Self::Strong(control) => {
                let conflict = strong_conflict(&control.plan, envelope);
                Ok(conflict.map(Uncontrollable::Conflict))
            }
        }
    }

    /// Returns `true` if the data kept are about this box, which was accepted last.
    pub(crate) fn is_about(&self, envelope: &DecoupledEnvelope) -> bool {
        match self {
            Self::Dynamic(_, dynamic) => dynamic.is_about(envelope),
            Self::Weak(_) | Self::Strong(_) => true,
        }
    }

    /// Returns the reason why the box is rejected, if it is. It differs from the last accepted box
    /// in the end `moved` only, and the data about that one stay as they are.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub(crate) fn refuses_if_moved(
        &mut self,
        envelope: &DecoupledEnvelope,
        moved: BoxEnd,
    ) -> Result<Option<Uncontrollable>, Refusal> {
        let conflict = match self {
            Self::Weak(feasibility) => {
                let found = feasibility.infeasible_if_moved(envelope, moved);
                return Ok(found.map_err(too_many)?.map(Uncontrollable::Weak));
            }
            Self::Dynamic(control, dynamic) => {
                dynamic.conflict_if_moved(&control.plan, envelope, moved.parameter)
            }
            Self::Strong(control) => strong_conflict(&control.plan, envelope),
        };
        Ok(conflict.map(Uncontrollable::Conflict))
    }

    /// Returns `true` if every box with this end at that reach contains values without a schedule,
    /// judging by the end alone; `None` is infinitely far.
    pub(crate) fn is_too_far(&self, end: BoxEnd, reach: Option<&Rational>) -> bool {
        self.feasibility().is_too_far(end, reach)
    }

    fn feasibility(&self) -> &Feasibility {
        match self {
            Self::Weak(feasibility) => feasibility,
            Self::Dynamic(control, _) | Self::Strong(control) => control.feasibility(),
        }
    }

    /// Returns at most `most` cuts that reject the box, and possibly others.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub(crate) fn generate_cuts(
        &mut self,
        plan: &ParametrizedPlan,
        envelope: &DecoupledEnvelope,
        most: usize,
    ) -> Result<CheckOutcome, Refusal> {
        ensure_not_stopped()?;
        match self {
            Self::Weak(feasibility) => {
                let found = feasibility.infeasible(envelope, None).map_err(too_many)?;
                Ok(found.map_or(CheckOutcome::Accepted, |found| {
                    let values = feasibility.values(envelope, found);
                    schedule_cut(plan, &values, envelope)
                }))
            }
            Self::Dynamic(_, dynamic) => {
                if plan.parameters.len() > MAX_CACHED_PARAMETERS {
                    *dynamic = DynamicControl::default();
                }
                Ok(strategy_cuts(plan, envelope, most))
            }
            Self::Strong(_) => Ok(fixed_time_cuts(plan, envelope)),
        }
    }

    /// Returns the objection, with values that show it.
    ///
    /// If `widened` is given, the box is that one, which is accepted, with the end moved out.
    pub(crate) fn objection(
        &mut self,
        envelope: &DecoupledEnvelope,
        found: Uncontrollable,
        widened: Option<(&DecoupledEnvelope, BoxEnd)>,
    ) -> Objection {
        let found = match (found, &mut *self) {
            (Uncontrollable::Weak(found), _) => Ok(found),
            (
                Uncontrollable::Conflict(conflict),
                Self::Dynamic(control, _) | Self::Strong(control),
            ) => control.infeasible(envelope, widened).ok_or(conflict),
            (Uncontrollable::Conflict(conflict), Self::Weak(_)) => Err(conflict),
        };
        match found {
            Ok(found) => Objection::NoSchedule(self.feasibility().values(envelope, found)),
            Err(conflict) => Objection::Uncontrollable(conflict),
        }
    }
}

fn too_many(TooManyBranches: TooManyBranches) -> Refusal {
    Refusal::TooManyCases {
        place: "parameters on constraints in both directions".to_owned(),
        limit: MAX_BRANCHES,
    }
}
