//! Proofs that a box is inside the envelope.

mod strategy;

use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, Schedule};

use super::Oracle;
use crate::guarantee::{Control, Controllability};
use crate::proof::{ConditionProof, ControlProof};
use crate::reduction::Reduction;
use crate::soundness::Soundness;

impl Oracle {
    /// Returns the proof that there are times for all nodes, for all values in the box; `None` if
    /// there are not, or if the proof takes too much work.
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

    /// Returns the proofs that no condition of the plan can fail in any schedule for values in the
    /// box. The box must be inside the envelope and contain the nominal values. `None` if the
    /// proofs cannot be computed.
    pub fn condition_proofs(&self, envelope: &DecoupledEnvelope) -> Option<Vec<ConditionProof>> {
        let (task, plan) = (&self.task, &self.plan);
        let nominal = plan.nominal();
        let soundness = Soundness::for_values(task, plan, &nominal).ok()??;
        soundness.export_proofs(task, plan, envelope)
    }
}

/// Returns times that work for all values.
fn fixed_times(plan: &ParametrizedPlan, envelope: &DecoupledEnvelope) -> Option<Schedule> {
    let network = plan.uncertain_network(envelope).ok()?;
    let times = network.network.strong().ok()?.into_times();
    let zero = times.first()?.clone();
    Some(times.iter().map(|time| time - &zero).collect())
}
