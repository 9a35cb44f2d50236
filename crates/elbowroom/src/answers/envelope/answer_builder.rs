//! Conversion of the results of the search and the explainer into the parts of an answer.

use elbowroom_envelope::Widening;
use elbowroom_envelope::explain::{Explainer, Explanation, Shortfall};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::makespan::earliest_end;
use elbowroom_plan::{
    DecoupledEnvelope, Node, NodeId, ParameterId, ParameterKind, ParametrizedPlan, Schedule, Side,
    Valuation,
};
use elbowroom_selection::timeouts::timeouts;

use super::Subject;
use super::answer::{
    ActionTimes, ChosenDuration, Counterexample, LimitedRange, Makespans, MovedEnd, Quantity,
    QuantityKind, Range, Stop, WideningStep,
};
use crate::answers::{Exact, StopRequest};

impl From<StopRequest> for Stop {
    fn from(halt: StopRequest) -> Self {
        match halt {
            StopRequest::TimeLimit => Self::TimeLimit,
            // Only searches for plans have a memory limit.
            StopRequest::MemoryLimit | StopRequest::Cancelled => Self::Cancelled,
        }
    }
}

impl From<ParameterKind> for QuantityKind {
    fn from(kind: ParameterKind) -> Self {
        match kind {
            ParameterKind::Duration(_) => Self::Duration,
            ParameterKind::Constant(_) => Self::Constant,
            ParameterKind::Domain => Self::Domain,
            ParameterKind::Initial(_) => Self::Initial,
            ParameterKind::Timed(_) => Self::Timed,
            ParameterKind::Bound => Self::Bound,
        }
    }
}

impl Range {
    /// Returns the interval.
    pub fn interval(&self) -> Interval {
        Interval {
            lower: self.lower.clone(),
            upper: self.upper.clone(),
        }
    }
}

impl WideningStep {
    pub(super) fn of(plan: &ParametrizedPlan, widening: &Widening<'_>, seconds: f64) -> Self {
        let end = widening.end;
        let moved = end
            .side
            .of(widening.envelope.interval(end.parameter))
            .clone();
        Self {
            seconds,
            checks: widening.checks,
            parameter: plan.parameter(end.parameter).name.clone(),
            end: match end.side {
                Side::Lower => MovedEnd::Lower(moved),
                Side::Upper => MovedEnd::Upper(moved),
            },
        }
    }
}

impl Makespans {
    pub(super) fn of(plan: &ParametrizedPlan, envelope: &DecoupledEnvelope) -> Option<Self> {
        let at = |side: Side| {
            let ends = envelope.intervals().iter();
            let values: Option<Valuation> = ends.map(|i| side.of(i).value().cloned()).collect();
            earliest_end(plan, &values?)
        };
        Some(Self {
            nominal: earliest_end(plan, &plan.nominal())?,
            at_lower: at(Side::Lower),
            at_upper: at(Side::Upper),
        })
    }
}

/// Returns the parameters of a plan.
pub(crate) fn quantities(explainer: &Explainer<'_>) -> Vec<Quantity> {
    let parameters = explainer.plan.parameters.iter().enumerate();
    parameters
        .map(|(index, parameter)| Quantity {
            name: parameter.name.clone(),
            quantity: explainer.quantity(ParameterId::from(index)),
            kind: parameter.kind.into(),
            action: match parameter.kind {
                ParameterKind::Duration(of) | ParameterKind::Constant(of) => {
                    Some(explainer.plan.plan.instance(of).action.name.clone())
                }
                _ => None,
            },
            nominal: parameter.nominal.clone(),
            weight: parameter.weight.clone(),
        })
        .collect()
}

impl Subject<'_> {
    /// Returns the parameters.
    pub(super) fn quantities(&self) -> Vec<Quantity> {
        quantities(&self.explainer)
    }

    /// Returns the parameters, each with its interval in a box.
    pub(super) fn ranges(&self, envelope: &DecoupledEnvelope) -> Vec<Range> {
        let quantities = self.quantities().into_iter().zip(envelope.intervals());
        let timeouts = timeouts(self.plan, &self.request.timeout);
        quantities
            .zip(timeouts)
            .map(|((quantity, interval), timeout)| Range {
                quantity,
                lower: interval.lower.clone(),
                upper: interval.upper.clone(),
                timeout,
            })
            .collect()
    }

    /// Returns the durations that the executor chooses.
    pub(super) fn chosen(&self) -> Vec<ChosenDuration> {
        let told = self.plan.commanded_durations.iter();
        told.map(|(id, duration)| {
            let instance = self.plan.plan.instance(*id);
            let timeout = self.request.timeout.of(&instance.action.name, duration);
            ChosenDuration {
                instance: instance.label.clone(),
                action: instance.action.name.clone(),
                duration: Exact(duration.clone()),
                timeout: timeout.map(Exact),
            }
        })
        .collect()
    }

    /// The parameters, each with its interval and its limits.
    pub(super) fn limited_ranges(
        &self,
        envelope: &DecoupledEnvelope,
        limits: Vec<[Option<String>; 2]>,
    ) -> Vec<LimitedRange> {
        let ranges = self.ranges(envelope).into_iter().zip(limits);
        ranges
            .map(|(range, [lower_limit, upper_limit])| LimitedRange {
                range,
                lower_limit,
                upper_limit,
            })
            .collect()
    }

    /// The counterexample of an explanation.
    pub(super) fn counterexample(&self, explanation: &Explanation) -> Counterexample {
        let names = self.plan.parameters.iter().map(|p| p.name.clone());
        let values = explanation.valuation.iter().cloned().map(Exact);
        let shortfall = explanation.shortfall.as_ref();
        let times = explanation.schedule.as_ref();
        Counterexample {
            message: explanation.reason.clone(),
            shortfall: shortfall.and_then(Shortfall::value).cloned(),
            verdict: explanation.verdict.clone(),
            values: names.zip(values).collect(),
            schedule: times.map_or_else(Vec::new, |times| self.action_times(times)),
            plays: explanation.strategies.clone(),
        }
    }

    fn action_times(&self, times: &Schedule) -> Vec<ActionTimes> {
        let plan = &self.plan.plan;
        let at = |node: NodeId| Exact(times[node].clone());
        let mut happenings: Vec<ActionTimes> = plan
            .instances
            .iter()
            .map(|instance| ActionTimes {
                instance: instance.label.clone(),
                action: instance.action.name.clone(),
                start: Exact(Rational::ZERO),
                end: None,
            })
            .collect();
        for (node, what) in plan.nodes() {
            match what {
                Node::Start(of) | Node::Instant(of) => happenings[of.index()].start = at(node),
                Node::End(of) => happenings[of.index()].end = Some(at(node)),
                _ => {}
            }
        }
        happenings
    }
}
