//! Why a box is inside the envelope.

mod strategy;

use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, Schedule};

use super::Oracle;
use crate::guarantee::{Control, Controllability};
use crate::proved::{ConditionProof, ControlProof};
use crate::reduction::Reduction;
use crate::soundness::Soundness;

impl Oracle {
    /// Why there are times for all nodes, whatever the values in the box are; `None` if there are
    /// not, or if that takes too much to tell.
    pub fn control_proof(&self, envelope: &DecoupledEnvelope) -> Option<ControlProof> {
        match &self.controllability {
            Controllability::Weak(feasibility) => {
                let reduction = Reduction::new(&self.plan);
                let cases = feasibility.rules(&reduction, envelope)?;
                Some(ControlProof::Schedules(cases))
            }
            Controllability::Dynamic(Control { plan, .. }, _) => {
                strategy::strategy(plan, envelope).map(ControlProof::Strategy)
            }
            Controllability::Strong(Control { plan, .. }) => {
                fixed_times(plan, envelope).map(ControlProof::Times)
            }
        }
    }

    /// Why no condition of the plan can fail in any schedule for values in the box, which is inside the
    /// envelope and holds the nominal values; `None` if that cannot be told.
    pub fn condition_proofs(&self, envelope: &DecoupledEnvelope) -> Option<Vec<ConditionProof>> {
        let (task, plan) = (&self.task, &self.plan);
        let nominal = plan.nominal();
        let soundness = Soundness::around(task, plan, &nominal).ok()??;
        soundness.told(task, plan, envelope)
    }
}

/// Times that do for all values.
fn fixed_times(plan: &ParametrizedPlan, envelope: &DecoupledEnvelope) -> Option<Schedule> {
    let network = plan.uncertain_network(envelope).ok()?;
    let times = network.network.strong().ok()?.into_times();
    let zero = times.first()?.clone();
    Some(times.iter().map(|time| time - &zero).collect())
}
