//! Time-outs in an envelope's answer. An action is not cancelled if its duration is inside the box
//! *and* below its time-out.

use elbowroom_num::{End, Rational};
use elbowroom_plan::{DecoupledEnvelope, ParameterId};
use elbowroom_selection::timeouts::{PlannedTimeout, timeouts};

use super::Subject;
use super::answer::Counterexample;
use crate::answers::Exact;

impl Subject<'_> {
    /// Returns a counterexample if an action of the plan times out even as planned.
    pub(super) fn planned_timeout(&self) -> Option<Counterexample> {
        let found = PlannedTimeout::find(self.plan, &self.request.timeout)?;
        let shortfall = Some(&found.planned - &found.timeout);
        let values = self.plan.nominal().iter().cloned().collect();
        Some(self.timeout_counterexample(found.message(), shortfall, values))
    }

    /// Returns a counterexample if an action can time out inside the box.
    pub(super) fn possible_timeout(&self, envelope: &DecoupledEnvelope) -> Option<Counterexample> {
        let rule = &self.request.timeout;
        let plan = self.plan;
        let all = timeouts(plan, rule).into_iter().enumerate();
        let (id, timeout) = all
            .filter_map(|(index, timeout)| Some((ParameterId::from(index), timeout?)))
            .find(|(id, timeout)| match &envelope.interval(*id).upper {
                End::Closed(upper) | End::Open(upper) => upper > timeout,
                End::Infinite => true,
            })?;
        let interval = envelope.interval(id);
        let upper = interval.upper.value();
        let may_take = match upper {
            Some(upper) => format!("up to {}", upper.to_decimal(3)),
            None => "arbitrarily long".to_owned(),
        };
        let message = format!(
            "{} may be {may_take} in this box, but the action times out after {}; give a smaller \
             box, a longer --timeout, or `none`",
            self.explainer.quantity(id),
            timeout.to_decimal(3),
        );
        let lower = interval.lower.value().cloned().unwrap_or_default();
        let beyond = match upper {
            Some(upper) => (&timeout + upper) / Rational::from(2),
            None => timeout.clone() + Rational::ONE,
        };
        let mut values: Vec<Rational> = plan.nominal().iter().cloned().collect();
        values[id.index()] = beyond.max(lower);
        let shortfall = upper.map(|upper| upper - &timeout);
        Some(self.timeout_counterexample(message, shortfall, values))
    }

    fn timeout_counterexample(
        &self,
        message: String,
        shortfall: Option<Rational>,
        values: Vec<Rational>,
    ) -> Counterexample {
        let names = self.plan.parameters.iter().map(|own| own.name.clone());
        Counterexample {
            message,
            shortfall,
            verdict: None,
            values: names.zip(values.into_iter().map(Exact)).collect(),
            schedule: Vec::new(),
            plays: Vec::new(),
        }
    }
}
