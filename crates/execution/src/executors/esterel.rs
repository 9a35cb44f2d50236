//! `esterel`: paper 2's baseline.

use elbowroom_num::Rational;
use elbowroom_plan::uncertain::ConstraintRole;
use elbowroom_plan::{Bound, Constraint, Node, NodeId};

use super::{ExecutorEntry, Needs, Role};
use crate::dispatch::{Bounds, Dispatch, PropagationReach, replan};
use crate::event::Ending;
use crate::executor::PlanForm;
use crate::executor::{
    Decided, DecisionContext, Executor, PlanEvent, Planned, PreparedPlan, StepId,
};
use crate::reason::{Cause, Reason, Subject};

pub(super) const REGISTERED: ExecutorEntry = ExecutorEntry {
    name: "esterel",
    argument: None,
    is_optional: false,
    summary: "Executes actions as soon as the plan's orderings allow, regardless of \
              likelihoods. It retries a failed start without limit, doubling the wait each \
              time, and replans when a condition does not hold, when an action is aborted, \
              or when the plan is over without reaching the goal. It ignores deadlines and \
              durations.",
    paper: "the Esterel Dispatcher of ROSPlan, the baseline in Ribeiro et al. (2021), section 3",
    needs: Needs::plan(PlanForm::Network),
    roles: &[Role::FirstPlan, Role::RemainingPlan],
    make: |_, _| Box::new(Esterel { dispatch: None }),
};

/// See [`REGISTERED`]. The variant for worlds without time is `untimed::Esterel` in
/// `elbowroom-laboratory`.
#[derive(Clone, Debug)]
struct Esterel {
    dispatch: Option<Dispatch>,
}

impl Executor for Esterel {
    fn need(&self) -> PlanForm {
        REGISTERED.needs.plan
    }

    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>> {
        let plan = &mission.plan.plan;
        let bounds = |constraint: &Constraint| -> Bounds {
            if plan.duration_of(constraint).is_some() {
                // Ends are awaited without bounds.
                return (None, None);
            }
            orderings(constraint)
        };
        // The orderings hold for planned durations; real durations may bring an end close to a
        // start.
        let dispatch = Dispatch::new(mission, PropagationReach::WholeNetwork, &bounds)?
            .with_separation(&Rational::ZERO);
        self.dispatch = Some(dispatch);
        Ok(())
    }

    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        let Some(dispatch) = &mut self.dispatch else {
            return super::without_plan();
        };
        let mut trouble = None;
        for news in moment.plan_events {
            let new = learn(dispatch, news);
            trouble = trouble.or(new);
        }
        match trouble {
            Some(reason) => replan(reason),
            None => dispatch.decide_without_checks(moment),
        }
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        self.dispatch.as_ref()?.planned(step, is_end)
    }

    fn fork(&self) -> Option<Box<dyn Executor>> {
        Some(Box::new(self.clone()))
    }
}

/// Continues with a plan by its orderings alone. Returns `None` if they contradict each other after
/// the events so far.
pub(super) fn continue_by_orderings(
    mut dispatch: Dispatch,
    now: &Rational,
) -> Option<Box<dyn Executor>> {
    let local = dispatch.to_plan_time(now);
    let plan = dispatch.plan().clone();
    let is_timed = |node: NodeId| matches!(plan.nodes[node.index()], Node::Timed(_));
    let reading = |constraint: &Constraint| {
        let (lower, upper) = orderings(constraint);
        // An ordering before a timed initial is a deadline.
        ConstraintRole::Requirement {
            lower: lower.filter(|_| !is_timed(constraint.to)),
            upper: upper.filter(|_| !is_timed(constraint.from)),
        }
    };
    dispatch.with_bounds(&local, &reading).ok()?;
    Some(Box::new(Esterel {
        dispatch: Some(dispatch.with_separation(&local)),
    }))
}

/// Processes a news item. Returns the reason if the plan has to be abandoned.
fn learn(dispatch: &mut Dispatch, news: &PlanEvent) -> Option<Reason> {
    match news {
        PlanEvent::Started { step, time, .. } => {
            dispatch.note_start(step.instance(), time);
            None
        }
        PlanEvent::Ended {
            step, time, ending, ..
        } => {
            let id = step.instance();
            let [start, _] = dispatch.start_and_end_nodes(id);
            let name = &dispatch.action(id).name;
            let why = match ending {
                Ending::Succeeded => {
                    dispatch.note_end(id, time);
                    return None;
                }
                Ending::Failed { .. } if dispatch.execution_time(start).is_none() => {
                    dispatch.schedule_retry(id, time);
                    return None;
                }
                Ending::Failed { why } => Subject::ExternalMessage(why.clone()),
                Ending::Cancelled => Subject::Cancelled,
            };
            let reason = Reason::new(Cause::Failed).for_action(name).about(why);
            Some(reason.since(time.clone()))
        }
        // Conditions are only checked when an action is started.
        PlanEvent::Fact(_) | PlanEvent::Value(_) => None,
        PlanEvent::Contradiction { action } => {
            Some(Reason::new(Cause::Contradiction).for_action(action))
        }
        PlanEvent::TimedOut { action, since } => Some(
            Reason::new(Cause::Silence)
                .for_action(action)
                .since(since.clone()),
        ),
    }
}

/// Returns the bounds by which a constraint orders its time points. They contain the minimum
/// distance, but not the maximum distance.
fn orderings(constraint: &Constraint) -> Bounds {
    let value = |bound: &Bound| match bound {
        Bound::Finite(value) => Some(value.clone()),
        Bound::Infinite | Bound::Parameter(_) => None,
    };
    let lower = value(&constraint.lower).filter(|lower| !lower.is_negative());
    let upper = value(&constraint.upper).filter(|upper| *upper <= Rational::ZERO);
    (lower, upper)
}

#[cfg(test)]
mod tests {
    use elbowroom_num::Rational;
    use elbowroom_plan::{Bound, Constraint, NodeId, Reason};

    use super::orderings;

    #[test]
    fn constraint_contributes_only_its_ordering() {
        let between = |lower: i64, upper: i64| Constraint {
            from: NodeId(1),
            to: NodeId(2),
            lower: Bound::Finite(Rational::from(lower)),
            upper: Bound::Finite(Rational::from(upper)),
            reason: Reason::Given,
        };
        let number = |value: i64| Some(Rational::from(value));
        assert_eq!(orderings(&between(2, 5)), (number(2), None));
        assert_eq!(orderings(&between(-3, 5)), (None, None));
        assert_eq!(orderings(&between(-5, -2)), (None, number(-2)));
    }
}
