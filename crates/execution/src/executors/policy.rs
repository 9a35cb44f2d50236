//! `policy`, on a clock: follows the plan while its guarantee costs no success probability, then
//! makes the most likely move.

mod moves;
mod rehearsed;

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::ground::FactId;
use elbowroom_num::Rational;

use super::{Registered, live};
use crate::dispatch::replan;
use crate::executor::Need;
use crate::executor::{Decided, Decision, Executor, Mission, Moment, News, Order, Planned, StepId};
use crate::outlook::Outlook;
use crate::progression::Outlook as Prospect;
use crate::reason::{About, Cause, Reason};

use moves::{begins, wait};
use rehearsed::Rehearsed;

pub(super) const REGISTERED: Registered = Registered {
    name: "policy",
    argument: None,
    is_optional: false,
    summary: "Follows the plan as `live` does while that costs next to no probability of reaching the \
              goal in time, and from then on makes the move of which the goal is most likely: an action, \
              letting one go, or waiting, whether or not it is in the plan. What moves are worth comes from \
              what is known of the world's distributions of durations, failures and events, not from what \
              will happen. Where the world is too large for that, it tries out in samples of the world, whenever \
              something happens, what comes of going on, of handing what is left of the plan to `adaptable` \
              or `esterel`, of another plan, and of waiting.",
    paper: "the policy of a semi-Markov decision process (Howard, 1971); without it, the rollout algorithm \
            (Bertsekas, Tsitsiklis & Wu, 1997); goes beyond both papers",
    need: Need::OpenNetwork,
    make: |_, mut means| {
        if means.outlook.is_none()
            && let Some(rehearsal) = means.rehearsal.take()
        {
            let keeper = (live::REGISTERED.make)(None, means);
            return Box::new(Rehearsed::new(rehearsal, keeper));
        }
        let outlook = means.outlook.clone();
        // An executor that evaluates moves does not need to compare plans.
        let compares = means.odds.is_some() && outlook.is_none();
        let advantage = compares.then(|| Rational::from(5));
        Box::new(Policy {
            outlook,
            plan: (live::REGISTERED.make)(advantage, means),
            follows: false,
            forgone: 0.0,
            steps: BTreeMap::new(),
            changed: Vec::new(),
            last: None,
            waited: None,
            ordered: None,
            next_step: 0,
            lost: None,
        })
    },
};

/// Total loss of success probability that is accepted for following a plan with a guarantee.
const MOST_FORGONE: f64 = 0.005;

/// Number of decisions to start or cancel actions at one time, after which the next period is
/// awaited.
const MOST_AT_ONCE: u32 = 50;

/// See [`REGISTERED`].
struct Policy {
    outlook: Option<Arc<dyn Outlook>>,
    /// Executor of the plan.
    plan: Box<dyn Executor>,
    /// `true` while the plan is followed.
    follows: bool,
    /// Loss of success probability by following the plan, in total.
    forgone: f64,
    /// Commanded actions that have not ended.
    steps: BTreeMap<StepId, Ordered>,
    /// Spontaneous changes of facts.
    changed: Vec<(FactId, bool)>,
    /// The time of the last happening.
    last: Option<Rational>,
    /// The last period at whose beginning the decision was to wait.
    waited: Option<usize>,
    /// The time of the last command, and the number of decisions with commands at that time.
    ordered: Option<(Rational, u32)>,
    /// The number of the next order.
    next_step: u32,
    /// Reason for which the plan is no longer followed.
    lost: Option<Reason>,
}

#[derive(Clone, Debug)]
struct Ordered {
    name: String,
    is_of_plan: bool,
    has_started: bool,
    /// `true` if it was cancelled.
    is_let_go: bool,
}

/// Time of the next evaluation of moves.
enum Turn {
    /// Now, in this period.
    Now(usize),
    /// At the beginning of this period.
    At(usize),
}

impl Executor for Policy {
    fn need(&self) -> Need {
        REGISTERED.need
    }

    fn adopt(&mut self, mission: &Mission) -> Result<(), Box<Reason>> {
        let adopted = self.plan.adopt(mission);
        let instances = &mission.plan.plan.instances;
        self.steps = mission
            .running
            .keys()
            .filter_map(|step| {
                let instance = instances.get(step.instance().index())?;
                let ordered = Ordered {
                    name: instance.action.name.clone(),
                    is_of_plan: true,
                    has_started: true,
                    is_let_go: false,
                };
                Some((*step, ordered))
            })
            .collect();
        self.next_step = u32::try_from(instances.len()).unwrap_or(u32::MAX);
        self.follows = adopted.is_ok();
        self.lost = adopted.as_ref().err().map(|reason| (**reason).clone());
        if self.outlook.is_some() {
            return Ok(());
        }
        adopted
    }

    fn decide(&mut self, moment: &Moment<'_>) -> Decided {
        let (own, doubt) = self.learn(moment);
        if let Some(doubt) = doubt.filter(|_| !self.follows) {
            return replan(doubt);
        }
        let kept = self.follows.then(|| {
            self.plan.decide(&Moment {
                news: &own,
                ..*moment
            })
        });
        let outlook = self.outlook.clone();
        let decided = match (kept, outlook) {
            (Some(kept), None) => kept,
            (kept, Some(outlook)) => self.weigh(moment, kept, outlook.as_ref()),
            (None, None) => super::without_plan(),
        };
        self.note(&decided, moment.now);
        decided
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        let is_of_plan = self.steps.get(&step).is_some_and(|it| it.is_of_plan);
        (self.follows && is_of_plan)
            .then(|| self.plan.window(step, is_end))
            .flatten()
    }
}

impl Policy {
    /// Processes the news. Returns the news that concern the plan, and the reason if the state has
    /// become uncertain.
    fn learn(&mut self, moment: &Moment<'_>) -> (Vec<News>, Option<Reason>) {
        let (mut own, mut doubt) = (Vec::new(), None);
        for news in moment.news {
            let is_own = match news {
                News::Started { step, time, .. } => {
                    self.last = self.last.take().max(Some(time.clone()));
                    match self.steps.get_mut(step) {
                        Some(ordered) => {
                            ordered.has_started = true;
                            ordered.is_of_plan
                        }
                        None => true,
                    }
                }
                News::Ended { step, time, .. } => {
                    self.last = self.last.take().max(Some(time.clone()));
                    self.steps.remove(step).is_none_or(|it| it.is_of_plan)
                }
                News::Fact(fact) => {
                    self.last = self.last.take().max(Some(moment.now.clone()));
                    self.changed.push((*fact, moment.belief.fact(*fact)));
                    true
                }
                News::Value(_) | News::Contradiction { .. } | News::Silence { .. } => true,
            };
            if is_own {
                own.push(news.clone());
            }
            match news {
                News::Contradiction { action } => {
                    doubt = Some(Reason::new(Cause::Contradiction).of(action));
                }
                News::Silence { action, since } => {
                    doubt = Some(Reason::new(Cause::Silence).of(action).since(since.clone()));
                }
                _ => {}
            }
        }
        // An instantaneous action is over when it has started.
        let running = moment.belief.running();
        self.steps.retain(|_, ordered| {
            let is_under_way = running.values().any(|it| it.action.name == ordered.name);
            !ordered.has_started || is_under_way
        });
        (own, doubt)
    }

    /// Records the commanded and cancelled actions.
    fn note(&mut self, decided: &Decided, now: &Rational) {
        let orders: &[Order] = match &decided.decision {
            Decision::Start(orders) => orders,
            Decision::Cancel(steps) => {
                for step in steps {
                    if let Some(ordered) = self.steps.get_mut(step) {
                        ordered.is_let_go = true;
                    }
                }
                &[]
            }
            _ => return,
        };
        for order in orders {
            self.steps.entry(order.step).or_insert_with(|| Ordered {
                name: order.action.name.clone(),
                is_of_plan: true,
                has_started: false,
                is_let_go: false,
            });
        }
        self.ordered = Some(match self.ordered.take() {
            Some((time, count)) if time == *now => (time, count.saturating_add(1)),
            _ => (now.clone(), 1),
        });
    }

    /// Returns the decision by the values of the moves. `kept` is the decision of the plan's
    /// executor.
    fn weigh(
        &mut self,
        moment: &Moment<'_>,
        kept: Option<Decided>,
        outlook: &dyn Outlook,
    ) -> Decided {
        let kept = self.still_kept(kept);
        // The goal holds, so the remaining steps of the plan are not needed.
        if moment.belief.outlook() == Prospect::Reached {
            self.follows = false;
            return self.finish();
        }
        let starts = kept.as_ref().is_some_and(|kept| {
            matches!(
                kept.decision,
                Decision::Start(_) | Decision::Cancel(_) | Decision::GoalReached
            )
        });
        let mut steps = self.steps.values();
        let pending = steps.find(|ordered| !ordered.has_started || ordered.is_let_go);
        if let Some(ordered) = pending
            && !starts
        {
            let about = if ordered.is_let_go {
                About::EndOfCancelled
            } else {
                About::StartOfOrdered
            };
            return kept.unwrap_or_else(|| wait(None, about));
        }
        let turn = self.turn(moment.now, outlook.period());
        let period = match turn {
            Turn::Now(period) | Turn::At(period) => period,
        };
        let Some(weighed) = outlook.weigh(&self.standing(moment.belief, period, outlook, None))
        else {
            return match (kept, turn) {
                (Some(kept), _) => kept,
                (None, Turn::Now(_)) => self.hopeless(moment.now),
                // Until it begins, an event may still help.
                (None, Turn::At(period)) => {
                    let until = begins(period, outlook.period());
                    wait(Some(until), About::NextDecision(0.0))
                }
            };
        };
        if let Some(kept) = kept {
            let worth = self.worth(&kept, &weighed, moment.belief, period, outlook);
            let forgone = (weighed.best() - worth).max(0.0);
            let is_free = matches!(turn, Turn::At(_)) && !starts;
            if is_free || self.forgone + forgone <= MOST_FORGONE {
                if !is_free {
                    self.forgone += forgone;
                }
                return self.until_next(kept, moment.now, &turn, outlook.period());
            }
            self.follows = false;
            self.lost = Some(Reason::new(Cause::Likelier));
        }
        match turn {
            Turn::At(period) => {
                let until = begins(period, outlook.period());
                wait(Some(until), About::NextDecision(weighed.best()))
            }
            Turn::Now(period) => self.best(moment, period, &weighed, outlook.period()),
        }
    }

    /// Ends the run when the goal holds. Running actions are cancelled first, because the goal does
    /// not count as reached while an action is running.
    fn finish(&self) -> Decided {
        let open = self.steps.iter();
        let open: Vec<StepId> = open
            .filter(|(_, ordered)| !ordered.is_let_go)
            .map(|(step, _)| *step)
            .collect();
        if open.is_empty() && !self.steps.is_empty() {
            return wait(None, About::EndOfCancelled);
        }
        let decision = if open.is_empty() {
            Decision::GoalReached
        } else {
            Decision::Cancel(open)
        };
        Decided {
            decision,
            reason: Reason::new(Cause::GoalReached),
        }
    }

    /// Returns the decision of the plan's executor, or `None` if it requests a new plan.
    fn still_kept(&mut self, kept: Option<Decided>) -> Option<Decided> {
        let kept = kept?;
        if kept.decision == Decision::Replan {
            self.follows = false;
            self.lost = Some(kept.reason);
            return None;
        }
        Some(kept)
    }

    /// Requests a new plan, because no move is known to lead to the goal.
    fn hopeless(&self, now: &Rational) -> Decided {
        let reason = self.lost.clone();
        replan(reason.unwrap_or_else(|| Reason::new(Cause::NoOrder).since(now.clone())))
    }
}
