//! `drill`: follows plans as `adaptable` does, and names its services in its reasons. It is not part of the program:
//! `drill.py` adds it to a copy of the sources.

use elbowroom_num::Rational;

use super::{ExecutorEntry, Needs, Role, adaptable};
use crate::executor::{
    Decided, DecisionContext, Executor, PlanForm, Planned, PreparedPlan, StepId,
};
use crate::reason::{Reason, Subject};

pub(super) const REGISTERED: ExecutorEntry = ExecutorEntry {
    name: "drill",
    argument: None,
    is_optional: false,
    summary: "Tests the registry: it names the services that it received.",
    paper: "CONTRIBUTING.md",
    needs: Needs {
        action_values: true,
        rollouts: true,
        ..Needs::plan(PlanForm::PartialOrder)
    },
    roles: &[Role::FirstPlan, Role::RemainingPlan, Role::Evaluation],
    make: |_, services| {
        let received = match (&services.action_values, &services.rollout) {
            (Some(_), _) => "drill with action values",
            (None, Some(_)) => "drill with rollouts",
            (None, None) => "drill alone",
        };
        let inner = (adaptable::REGISTERED.make)(None, services);
        Box::new(Drill { received, inner })
    },
};

/// See [`REGISTERED`].
struct Drill {
    received: &'static str,
    inner: Box<dyn Executor>,
}

impl Executor for Drill {
    fn need(&self) -> PlanForm {
        REGISTERED.needs.plan
    }

    fn adopt(&mut self, plan: &PreparedPlan) -> Result<(), Box<Reason>> {
        self.inner.adopt(plan)
    }

    fn decide(&mut self, context: &DecisionContext<'_>) -> Decided {
        let decided = self.inner.decide(context);
        let about = Subject::ExternalMessage(self.received.to_owned());
        Decided {
            reason: decided.reason.about(about),
            ..decided
        }
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        self.inner.window(step, is_end)
    }

    fn latest_tolerated_end(&self, step: StepId, now: &Rational) -> Option<Rational> {
        self.inner.latest_tolerated_end(step, now)
    }

    fn fork(&self) -> Option<Box<dyn Executor>> {
        let inner = self.inner.fork()?;
        let received = self.received;
        Some(Box::new(Self { received, inner }))
    }
}
