//! `esterel`: paper 2's baseline.

use elbowroom_num::Rational;
use elbowroom_plan::uncertain::Reading;
use elbowroom_plan::{Bound, Constraint, Node, NodeId};

use super::Registered;
use crate::dispatch::{Bounds, Dispatch, Sight, replan};
use crate::event::Ending;
use crate::executor::Need;
use crate::executor::{Decided, Executor, Mission, Moment, News, Planned, StepId};
use crate::reason::{About, Cause, Reason};

pub(super) const REGISTERED: Registered = Registered {
    name: "esterel",
    argument: None,
    is_optional: false,
    summary: "Executes actions as soon as the plan's orderings allow, regardless of \
              likelihoods. It retries a failed start without limit, doubling the wait each \
              time, and replans when a condition does not hold, when an action is aborted, \
              or when the plan is over without reaching the goal. It ignores deadlines and \
              durations.",
    paper: "the Esterel Dispatcher of ROSPlan, the baseline in Ribeiro et al. (2021), section 3",
    need: Need::Network,
    make: |_, _| Box::new(Esterel { dispatch: None }),
};

/// See [`REGISTERED`]. The variant for worlds without time is `untimed::Esterel` in
/// `elbowroom-laboratory`.
#[derive(Clone, Debug)]
struct Esterel {
    dispatch: Option<Dispatch>,
}

impl Executor for Esterel {
    fn need(&self) -> Need {
        REGISTERED.need
    }

    fn adopt(&mut self, mission: &Mission) -> Result<(), Box<Reason>> {
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
        let dispatch =
            Dispatch::new(mission, Sight::Whole, &bounds)?.keeping_apart(&Rational::ZERO);
        self.dispatch = Some(dispatch);
        Ok(())
    }

    fn decide(&mut self, moment: &Moment<'_>) -> Decided {
        let Some(dispatch) = &mut self.dispatch else {
            return super::without_plan();
        };
        let mut trouble = None;
        for news in moment.news {
            let new = learn(dispatch, news);
            trouble = trouble.or(new);
        }
        match trouble {
            Some(reason) => replan(reason),
            None => dispatch.go_on(moment),
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
pub(super) fn carry_on(mut dispatch: Dispatch, now: &Rational) -> Option<Box<dyn Executor>> {
    let local = dispatch.local(now);
    let plan = dispatch.plan().clone();
    let is_timed = |node: NodeId| matches!(plan.nodes[node.index()], Node::Timed(_));
    let reading = |constraint: &Constraint| {
        let (lower, upper) = orderings(constraint);
        // An ordering before a timed initial is a deadline.
        Reading::Requirement {
            lower: lower.filter(|_| !is_timed(constraint.to)),
            upper: upper.filter(|_| !is_timed(constraint.from)),
        }
    };
    dispatch.rebound(&local, &reading).ok()?;
    Some(Box::new(Esterel {
        dispatch: Some(dispatch.keeping_apart(&local)),
    }))
}

/// Processes a news item. Returns the reason if the plan has to be abandoned.
fn learn(dispatch: &mut Dispatch, news: &News) -> Option<Reason> {
    match news {
        News::Started { step, time, .. } => {
            dispatch.note_start(step.instance(), time);
            None
        }
        News::Ended {
            step, time, ending, ..
        } => {
            let id = step.instance();
            let [start, _] = dispatch.nodes_of(id);
            let name = &dispatch.action(id).name;
            let why = match ending {
                Ending::Succeeded => {
                    dispatch.note_end(id, time);
                    return None;
                }
                Ending::Failed { .. } if dispatch.happened(start).is_none() => {
                    dispatch.try_again(id, time);
                    return None;
                }
                Ending::Failed { why } => About::Said(why.clone()),
                Ending::Cancelled => About::Cancelled,
            };
            let reason = Reason::new(Cause::Failed).of(name).about(why);
            Some(reason.since(time.clone()))
        }
        // Conditions are only checked when an action is started.
        News::Fact(_) | News::Value(_) => None,
        News::Contradiction { action } => Some(Reason::new(Cause::Contradiction).of(action)),
        News::Silence { action, since } => {
            Some(Reason::new(Cause::Silence).of(action).since(since.clone()))
        }
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
    fn only_what_comes_first_is_taken_from_a_constraint() {
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
