//! Makes plans ready: deordering, parameters, envelopes.

use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_envelope::{Guarantee, Oracle, irr};
use elbowroom_execution::{Need, Prepared, Preparer, Region};
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_plan::deorder;
use elbowroom_plan::parametrize::{ParametrizeError, VarySpec, parametrize};
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan};

use super::facts_only::{facts_only, sorted};
use super::vary::is_about_an_absent_action;
use crate::flow;

/// Makes plans ready with [`flow`].
#[derive(Clone, Debug)]
pub struct Analyst {
    settings: flow::Settings,
}

impl Analyst {
    /// `settings.vary` says what to leave open of each plan; what a plan does not have, it cannot
    /// leave open.
    pub fn new(settings: flow::Settings) -> Self {
        Self { settings }
    }

    /// The specifications that fit something in the plan.
    fn specs(&self, task: &Task, freed: &flow::Freed) -> Result<Vec<VarySpec>, String> {
        let mut fitting = Vec::new();
        for spec in &self.settings.vary {
            let plan = freed.deordered.plan.clone();
            let one = std::slice::from_ref(spec);
            match parametrize(task, plan, &freed.deordered.nominal, one) {
                // Numbers that the domain leaves open may be given by another specification.
                Ok(_) | Err(ParametrizeError::NoNominal { .. }) => fitting.push(spec.clone()),
                Err(ParametrizeError::NothingMatches { .. }) => {}
                Err(error) if is_about_an_absent_action(task, spec, &error) => {}
                Err(error) => return Err(error.to_string()),
            }
        }
        Ok(fitting)
    }

    fn open(&self, task: &Task, freed: flow::Freed) -> Result<ParametrizedPlan, String> {
        let epsilon = &self.settings.epsilon;
        let specs = self.specs(task, &freed)?;
        if specs.is_empty() && !self.settings.vary.is_empty() {
            return Ok(flow::closed(task, freed, epsilon));
        }
        flow::open(task, freed, &specs, epsilon).map_err(|error| error.to_string())
    }

    /// What facts alone order: see [`Need::Orderings`].
    fn orderings(&self, task: &Task, plan: &TimeTriggeredPlan) -> Result<Prepared, String> {
        let settings = deorder::Settings {
            epsilon: self.settings.epsilon.clone(),
        };
        let deordered = deorder::deorder(task, &facts_only(plan), &settings);
        let mut deordered = deordered.map_err(|error| error.to_string())?;
        for (instance, step) in deordered.plan.instances.iter_mut().zip(sorted(plan)) {
            instance.action = step.action;
        }
        Ok(Prepared {
            plan: ParametrizedPlan::closed(task, deordered.plan),
            nominal: deordered.nominal,
            envelope: None,
        })
    }

    fn envelope(
        &self,
        task: &Arc<Task>,
        plan: &Arc<ParametrizedPlan>,
    ) -> Result<DecoupledEnvelope, String> {
        let (epsilon, guarantee) = (&self.settings.epsilon, self.settings.guarantee);
        let mut oracle =
            Oracle::new(task, plan, epsilon, guarantee).map_err(|error| error.to_string())?;
        let search = &self.settings.search;
        let run = irr(&mut oracle, search, &mut |_| ControlFlow::Continue(()));
        let run = run.map_err(|error| error.to_string())?;
        run.envelope
            .map_err(|_| "the plan is not guaranteed to work even if nothing deviates".to_owned())
    }
}

impl Preparer for Analyst {
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: Need,
    ) -> Result<Prepared, String> {
        let epsilon = &self.settings.epsilon;
        if need == Need::Orderings && flow::judge(task, plan, epsilon).is_valid() {
            return self.orderings(task, plan);
        }
        let freed = flow::free(task, plan, epsilon).map_err(|error| error.to_string())?;
        if need == Need::Orderings {
            return self.orderings(task, plan);
        }
        let nominal = freed.deordered.nominal.clone();
        let plan = Arc::new(match need {
            Need::Orderings | Need::Network => flow::closed(task, freed, epsilon),
            Need::OpenNetwork | Need::Envelope => self.open(task, freed)?,
        });
        let envelope = match need {
            Need::Envelope => Some(self.envelope(task, &plan)?),
            Need::OpenNetwork => self.envelope(task, &plan).ok(),
            Need::Orderings | Need::Network => None,
        };
        Ok(Prepared {
            plan: Arc::unwrap_or_clone(plan),
            nominal,
            envelope,
        })
    }
}

/// The exact envelope, asked point by point.
#[derive(Clone, Debug)]
pub struct WholeRegion {
    /// The least separation of interfering happenings (ε).
    pub epsilon: Rational,
}

impl Region for WholeRegion {
    fn objection(
        &mut self,
        task: &Arc<Task>,
        plan: &ParametrizedPlan,
        values: &[Rational],
    ) -> Option<String> {
        if !plan.reads_numbers(task) {
            // What facts need is in the network, whatever the durations; the executor has it.
            return None;
        }
        let mut plan = plan.clone();
        for (parameter, value) in plan.parameters.iter_mut().zip(values) {
            parameter.nominal = value.clone();
        }
        let plan = Arc::new(plan);
        let mut oracle = match Oracle::new(task, &plan, &self.epsilon, Guarantee::Weak) {
            Ok(oracle) => oracle,
            Err(refusal) => return Some(refusal.to_string()),
        };
        let objection = match oracle.objection(&DecoupledEnvelope::point(values)) {
            Ok(objection) => objection?,
            Err(refusal) => return Some(refusal.to_string()),
        };
        let explainer = crate::Explainer::new(task, &plan, &self.epsilon);
        let envelope = DecoupledEnvelope::point(values);
        Some(explainer.objection(&oracle, &envelope, &objection).reason)
    }
}
