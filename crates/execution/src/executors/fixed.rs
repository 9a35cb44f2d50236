//! `fixed:X`: paper 1's baseline BLEX(X).

use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{Bound, Constraint, Node, NodeId, Schedule, StnPlan};

use super::{ExecutorEntry, Needs};
use crate::dispatch::{Bounds, Dispatch, PropagationReach, constant_bounds, replan};
use crate::executor::PlanForm;
use crate::executor::{Decided, DecisionContext, Executor, Planned, PreparedPlan, StepId};
use crate::measured_amounts::amounts;
use crate::reason::{Cause, Reason, Subject};

pub(super) const REGISTERED: ExecutorEntry = ExecutorEntry {
    name: "fixed",
    argument: Some("percentage of the planned value"),
    is_optional: false,
    summary: "Dispatches the plan and replans when a duration or an amount leaves the planned \
              value by more than X %. It checks only the constraints of the next time point, so \
              that it notices a missed deadline late.",
    paper: "BLEX(X) in Cashmore et al. (2020), section 5",
    needs: Needs::plan(PlanForm::Orderings),
    roles: &[],
    make: |argument, _| Box::new(Fixed::new(&argument.unwrap_or_default())),
};

/// See [`REGISTERED`].
#[derive(Debug)]
struct Fixed {
    /// X / 100.
    share: Rational,
    state: Option<(Dispatch, PreparedPlan)>,
}

impl Fixed {
    fn new(percentage: &Rational) -> Self {
        Self {
            share: percentage / Rational::from(100),
            state: None,
        }
    }

    /// Returns the tolerated values around a nominal one.
    fn tolerance_around(&self, nominal: &Rational) -> Interval {
        let room = nominal.abs() * &self.share;
        Interval::closed(nominal - &room, nominal + &room)
    }
}

/// Replaces constraints relative to timed initials by constraints relative to time 0, which is one
/// hop away. The times of timed initials are known from the beginning.
fn anchor_timed_initials(plan: &mut StnPlan, nominal: &Schedule) {
    let is_timed = |node: NodeId| matches!(plan.nodes[node.index()], Node::Timed(_));
    let shifted = |bound: &Bound, by: &Rational| match bound {
        Bound::Finite(value) => Some(Bound::Finite(value + by)),
        Bound::Infinite => Some(Bound::Infinite),
        Bound::Parameter(_) => None,
    };
    let negated = |bound: &Bound| match bound {
        Bound::Finite(value) => Bound::Finite(-value),
        other => other.clone(),
    };
    let placed = plan.constraints.iter().map(|constraint| {
        let (from, to) = (constraint.from, constraint.to);
        // In both directions: bounds on the untimed node, counted from the timed one.
        let (timed, other, lower, upper) = match (is_timed(from), is_timed(to)) {
            (true, false) => (from, to, constraint.lower.clone(), constraint.upper.clone()),
            (false, true) => (
                to,
                from,
                negated(&constraint.upper),
                negated(&constraint.lower),
            ),
            _ => return constraint.clone(),
        };
        let time = &nominal[timed];
        match (shifted(&lower, time), shifted(&upper, time)) {
            (Some(lower), Some(upper)) if other != NodeId::ZERO => Constraint {
                from: NodeId::ZERO,
                to: other,
                lower,
                upper,
                reason: constraint.reason.clone(),
            },
            _ => constraint.clone(),
        }
    });
    plan.constraints = placed.collect();
}

impl Executor for Fixed {
    fn need(&self) -> PlanForm {
        REGISTERED.needs.plan
    }

    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>> {
        let mut mission = mission.clone();
        anchor_timed_initials(&mut mission.plan.plan, &mission.nominal);
        let mission = &mission;
        let plan = &mission.plan.plan;
        let bounds = |constraint: &Constraint| -> Bounds {
            let Some(instance) = plan.duration_of(constraint) else {
                return constant_bounds(constraint);
            };
            let time = |node: elbowroom_plan::NodeId| &mission.nominal[node];
            let room = self.tolerance_around(&(time(constraint.to) - time(constraint.from)));
            // The remaining duration of a running action is an estimate; the action may end sooner.
            let is_rest = mission.running.contains_key(&StepId::from(instance));
            let lower = if is_rest {
                Some(Rational::ZERO)
            } else {
                room.lower.value().cloned()
            };
            (lower, room.upper.value().cloned())
        };
        // The orderings are those of facts alone, so numbers could be written and read at the same
        // time.
        let dispatch = Dispatch::new(mission, PropagationReach::OneHop, &bounds)?
            .with_separation(&Rational::ZERO);
        self.state = Some((dispatch, mission.clone()));
        Ok(())
    }

    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        let share = self.share.clone();
        let Some((dispatch, mission)) = &mut self.state else {
            return super::without_plan();
        };
        if let Some(reason) = dispatch.process_news(moment) {
            return replan(*reason);
        }
        for deviation in amounts(&mission.plan, moment).deviations {
            let room = deviation.expected.abs() * &share;
            let distance = (&deviation.observed - &deviation.expected).abs();
            if distance > room {
                let about = Subject::Change(deviation.fluent);
                let mut reason = Reason::new(Cause::OutsideInterval).about(about);
                reason.action = Some(deviation.action);
                reason.observed = Some(deviation.observed);
                reason.allowed = Some(Interval::closed(
                    &deviation.expected - &room,
                    &deviation.expected + &room,
                ));
                reason.by = Some(distance - room);
                return replan(reason.since(moment.now.clone()));
            }
        }
        dispatch.next(moment)
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        self.state.as_ref()?.0.planned(step, is_end)
    }
}
