//! `policy` without a table: the possible choices are compared by rollouts.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::Step;
use elbowroom_model::ground::FactId;
use elbowroom_num::Rational;

use crate::dispatch::replan;
use crate::event::{Ending, Ticket};
use crate::executor::Need;
use crate::executor::{Decided, Decision, Executor, Mission, Moment, News, Order, Planned, StepId};
use crate::progression::Progression;
use crate::reason::{About, Cause, Reason};
use crate::rehearsal::{Rehearsal, Rehearsing, Scene, SeenChange};

use super::moves::wait;

/// Maximum number of hand-overs of an abandoned plan without a successful action in between. Beyond
/// it, a new plan is requested, and the number of new plans is limited.
const MOST_HAND_OVERS: usize = 10;

/// Number of rehearsals within the duration of a plan if nothing happens.
const LOOKS: i64 = 8;

/// Executor that follows plans as `live` does, or hands them over to an executor that does better.
/// It abandons a plan if another one is more likely to succeed. Success probabilities are the
/// shares of samples of the world in which the goal is reached.
///
/// The step numbers of `live` are those of the run; those of other executors are translated.
pub(super) struct Rehearsed {
    rehearsal: Box<dyn Rehearsal>,
    /// `live`, which adopts each new plan.
    keeper: Box<dyn Executor>,
    /// The executor that has taken over the plan.
    other: Option<Box<dyn Executor>>,
    /// Steps that have not ended, by the run's number: commanded ones, and those that were running
    /// when the plan was adopted.
    steps: BTreeMap<StepId, Commanded>,
    /// The next step number of the run.
    next_step: u32,
    /// The steps of the plan that have not begun, on the world's clock.
    left: Vec<Step>,
    /// The number of hand-overs of an abandoned plan since an action last succeeded.
    hand_overs: usize,
    /// The watched facts with their last truth.
    watched: Option<BTreeMap<FactId, bool>>,
    seen: Vec<SeenChange>,
    /// Number of plans adopted.
    plans: usize,
    /// News that the present executor has not received, because the decision was to wait.
    untold: Vec<News>,
    /// `true` if the plan is new.
    is_new: bool,
    /// `true` if a rehearsal is due that had to be postponed.
    is_owed: bool,
    /// `true` if a rehearsal would have the same result as the last one: that one took place while
    /// no action was running, or found no need for alternatives, and nothing has been learnt about
    /// the world since.
    is_settled: bool,
    /// The time of the last rehearsal, and the time between rehearsals.
    looked: Option<Rational>,
    period: Rational,
}

/// A step that has not ended.
#[derive(Clone, Debug)]
struct Commanded {
    /// The step number of the present executor; `None` if that executor does not know the step.
    inner: Option<StepId>,
    name: String,
    /// The ticket, if it is known.
    ticket: Option<Ticket>,
    /// The plan's step, which is repeated if it fails; `None` if it was running when the plan was
    /// adopted.
    step: Option<Step>,
    /// The time of its start.
    started: Option<Rational>,
    is_let_go: bool,
}

impl Rehearsed {
    pub(super) fn new(rehearsal: Box<dyn Rehearsal>, keeper: Box<dyn Executor>) -> Self {
        Self {
            rehearsal,
            keeper,
            other: None,
            steps: BTreeMap::new(),
            next_step: 0,
            left: Vec::new(),
            hand_overs: 0,
            watched: None,
            seen: Vec::new(),
            plans: 0,
            untold: Vec::new(),
            is_new: false,
            is_owed: false,
            is_settled: false,
            looked: None,
            period: Rational::ONE,
        }
    }

    fn present(&mut self) -> &mut dyn Executor {
        match &mut self.other {
            Some(other) => other.as_mut(),
            None => self.keeper.as_mut(),
        }
    }

    /// Processes the news. Returns them with the step numbers of the present executor.
    fn learn(&mut self, moment: &Moment<'_>) -> Vec<News> {
        self.watch(moment);
        if moment.news.iter().any(|news| self.tells(news)) {
            self.is_settled = false;
        }
        let mut told = Vec::with_capacity(moment.news.len());
        for news in moment.news {
            match news {
                News::Started { step, .. } | News::Ended { step, .. } => {
                    let inner = match self.steps.get(step) {
                        Some(commanded) => commanded.inner,
                        // A step of an earlier plan. `live` receives it unchanged.
                        None => self.other.is_none().then_some(*step),
                    };
                    if let Some(inner) = inner {
                        told.push(renamed(news, inner));
                    }
                    self.note(*step, news);
                }
                _ => told.push(news.clone()),
            }
        }
        told
    }

    /// Returns `true` if the news item carries information about the world.
    fn tells(&self, news: &News) -> bool {
        let of = |step| {
            let step: Option<&Commanded> = self.steps.get(step);
            step.map(|step| self.rehearsal.tells(&step.name))
        };
        match news {
            // If the time of the end is random, so is the time of the start.
            News::Started { step, .. } => of(step).is_none_or(|tells| tells.by_lasting),
            News::Ended { step, ending, .. } => {
                *ending != Ending::Succeeded || of(step).is_none_or(|tells| tells.by_ending)
            }
            News::Fact(_) | News::Value(_) | News::Contradiction { .. } | News::Silence { .. } => {
                true
            }
        }
    }

    /// Returns `true` if the passage of time carries information about the world.
    fn is_telling(&self) -> bool {
        let mut under_way = self.steps.values();
        self.rehearsal.tells_by_itself()
            || under_way.any(|step| self.rehearsal.tells(&step.name).by_lasting)
    }

    fn note(&mut self, step: StepId, news: &News) {
        match news {
            News::Started { time, .. } => {
                if let Some(commanded) = self.steps.get_mut(&step) {
                    commanded.started = Some(time.clone());
                    let is_over = |step: &Step| step.duration.is_none();
                    if commanded.step.as_ref().is_some_and(is_over) {
                        self.steps.remove(&step);
                    }
                }
            }
            News::Ended { ending, .. } => {
                if *ending == Ending::Succeeded {
                    self.hand_overs = 0;
                }
                if let Some(commanded) = self.steps.remove(&step)
                    && *ending != Ending::Succeeded
                {
                    self.left.extend(commanded.step);
                }
            }
            _ => {}
        }
    }

    /// Records changes of the watched facts.
    fn watch(&mut self, moment: &Moment<'_>) {
        let task = moment.belief.task();
        let rehearsal = &self.rehearsal;
        let watched = self.watched.get_or_insert_with(|| {
            let initially = |fact: &FactId| task.initial().facts.contains(fact);
            let facts = rehearsal.watched(task).into_iter();
            facts.map(|fact| (fact, initially(&fact))).collect()
        });
        for (fact, known) in watched.iter_mut() {
            let truth = moment.belief.fact(*fact);
            if truth != *known {
                *known = truth;
                self.seen.push(SeenChange {
                    time: moment.now.clone(),
                    fact: *fact,
                    truth,
                    is_by_itself: moment.news.contains(&News::Fact(*fact)),
                });
            }
        }
    }

    /// Returns `true` if a rehearsal is to be made now. `kept` is the decision of the present
    /// executor.
    fn is_occasion(&mut self, moment: &Moment<'_>, kept: &Decided) -> bool {
        let may_matter = |news: &News| !matches!(news, News::Started { .. });
        let is_due = |looked: &Rational| *moment.now >= looked + &self.period;
        let is_due = self.looked.as_ref().is_none_or(is_due);
        // A rehearsal with the same samples of an unchanged world has the same result.
        let may_differ = !self.is_settled || is_due && self.is_telling();
        let is_occasion = self.is_owed
            || self.is_new
            || kept.decision == Decision::Replan
            || may_differ && (moment.news.iter().any(may_matter) || is_due);
        let mut steps = self.steps.values();
        let is_busy = steps.any(|step| step.started.is_none() || step.is_let_go);
        let is_over = matches!(kept.decision, Decision::GoalReached | Decision::Cancel(_));
        self.is_owed = is_occasion && is_busy;
        is_occasion && !is_busy && !is_over
    }

    /// Returns the tickets of the running steps, by the step numbers of the present executor.
    fn running(&mut self, belief: &Progression) -> BTreeMap<StepId, Ticket> {
        for commanded in self.steps.values_mut() {
            let mut running = belief.running().iter();
            let own = running.find(|(_, it)| {
                it.action.name == commanded.name && Some(&it.start) == commanded.started.as_ref()
            });
            commanded.ticket = commanded.ticket.or(own.map(|(ticket, _)| *ticket));
        }
        let steps = self.steps.values();
        let known = steps.filter_map(|it| Some((it.inner?, it.ticket?)));
        known
            .filter(|(_, ticket)| belief.running().contains_key(ticket))
            .collect()
    }

    /// Returns the decision that does best in a rehearsal. `before` is the present executor before
    /// it decided `kept`.
    fn rehearse(
        &mut self,
        moment: &Moment<'_>,
        news: &[News],
        before: Box<dyn Executor>,
        kept: Decided,
    ) -> Decided {
        self.looked = Some(moment.now.clone());
        let running = self.running(moment.belief);
        let is_new = std::mem::take(&mut self.is_new);
        let rehearsed = self.rehearsal.rehearse(&Scene {
            belief: moment.belief,
            seen: &self.seen,
            present: before.as_ref(),
            news,
            running: &running,
            is_given_up: kept.decision == Decision::Replan,
            is_new,
            left: &self.left,
            replans: self.plans.saturating_sub(1),
        });
        self.is_settled = rehearsed.is_fine || running.is_empty();
        match rehearsed.choice {
            Rehearsing::AsDecided => self.outward(kept, moment.now),
            Rehearsing::Replans => {
                let about = About::Odds {
                    present: rehearsed.present,
                    other: rehearsed.value,
                };
                let reason = Reason::new(Cause::Likelier).about(about);
                replan(reason.since(moment.now.clone()))
            }
            Rehearsing::WaitsUntil(until) => {
                self.is_settled = false;
                *self.present_box() = before;
                self.untold = news.to_vec();
                self.looked = None;
                let value = rehearsed.value.to_f64();
                wait(Some(until), About::NextDecision(value))
            }
            Rehearsing::HandsOver(..)
                if kept.decision == Decision::Replan && self.hand_overs >= MOST_HAND_OVERS =>
            {
                self.outward(kept, moment.now)
            }
            Rehearsing::HandsOver(executor, mission) => {
                if kept.decision == Decision::Replan {
                    self.hand_overs += 1;
                }
                match self.hand_over(moment, executor, &mission) {
                    Some(decided) => decided,
                    None => self.outward(kept, moment.now),
                }
            }
        }
    }

    fn present_box(&mut self) -> &mut Box<dyn Executor> {
        match &mut self.other {
            Some(other) => other,
            None => &mut self.keeper,
        }
    }

    /// Hands the remaining plan over to another executor. Returns its decision, or `None` if it
    /// cannot adopt the plan.
    fn hand_over(
        &mut self,
        moment: &Moment<'_>,
        mut executor: Box<dyn Executor>,
        mission: &Mission,
    ) -> Option<Decided> {
        executor.adopt(mission).ok()?;
        for commanded in self.steps.values_mut() {
            let mut running = mission.running.iter();
            let own = running.find(|(_, ticket)| commanded.ticket == Some(**ticket));
            commanded.inner = own.map(|(step, _)| *step);
        }
        let decided = executor.decide(&Moment {
            news: &[],
            ..*moment
        });
        self.other = Some(executor);
        Some(self.outward(decided, moment.now))
    }

    /// Translates a decision of the present executor to the run's step numbers. A wait ends at the
    /// latest when the next rehearsal is due.
    fn outward(&mut self, mut decided: Decided, now: &Rational) -> Decided {
        match &mut decided.decision {
            Decision::Start(orders) => {
                for order in orders {
                    self.order(order, now);
                }
            }
            Decision::Cancel(steps) => {
                for step in steps {
                    let mut own = self.steps.iter_mut();
                    if let Some((outer, commanded)) =
                        own.find(|(_, commanded)| commanded.inner == Some(*step))
                    {
                        commanded.is_let_go = true;
                        *step = *outer;
                    }
                }
            }
            Decision::Wait { until } => {
                let next = self.looked.as_ref().map(|looked| looked + &self.period);
                let next = next.filter(|next| next > now && !self.steps.is_empty());
                *until = until.take().into_iter().chain(next).min();
            }
            Decision::Replan | Decision::GoalReached => {}
        }
        decided
    }

    fn order(&mut self, order: &mut Order, now: &Rational) {
        let inner = order.step;
        if self.other.is_some() {
            order.step = StepId(self.next_step);
            self.next_step = self.next_step.saturating_add(1);
        }
        let name = &order.action.name;
        let mut left = self.left.iter().enumerate();
        let place = left.find(|(_, step)| step.action.name == *name);
        let step = match place.map(|(place, _)| place) {
            Some(place) => self.left.remove(place),
            None => Step {
                start: now.clone(),
                action: Arc::clone(&order.action),
                duration: order.duration.clone(),
            },
        };
        let commanded = Commanded {
            inner: Some(inner),
            name: name.clone(),
            ticket: None,
            step: Some(step),
            started: None,
            is_let_go: false,
        };
        self.steps.insert(order.step, commanded);
    }
}

fn renamed(news: &News, inner: StepId) -> News {
    let mut news = news.clone();
    if let News::Started { step, .. } | News::Ended { step, .. } = &mut news {
        *step = inner;
    }
    news
}

impl Executor for Rehearsed {
    fn need(&self) -> Need {
        self.keeper.need()
    }

    fn adopt(&mut self, mission: &Mission) -> Result<(), Box<Reason>> {
        self.other = None;
        self.untold.clear();
        let under_way = mission.time_triggered.steps.iter().zip(&mission.instances);
        let own = |step: &Step| Step {
            start: &step.start + &mission.origin,
            ..step.clone()
        };
        self.steps = under_way
            .filter_map(|(step, instance)| {
                let number = StepId::from(*instance);
                let commanded = Commanded {
                    inner: Some(number),
                    name: step.action.name.clone(),
                    ticket: Some(*mission.running.get(&number)?),
                    step: None,
                    started: Some(mission.now.clone()),
                    is_let_go: false,
                };
                Some((number, commanded))
            })
            .collect();
        let steps = mission.time_triggered.steps.iter();
        self.left = steps.skip(mission.running.len()).map(own).collect();
        self.next_step = u32::try_from(mission.plan.plan.instances.len()).unwrap_or(u32::MAX);
        self.plans += 1;
        self.is_new = true;
        self.hand_overs = 0;
        self.is_settled = false;
        let ends = mission.time_triggered.steps.iter().map(Step::end);
        let length = ends.max().unwrap_or_default();
        self.period = (length / Rational::from(LOOKS)).max(Rational::ONE);
        self.keeper.adopt(mission)
    }

    fn decide(&mut self, moment: &Moment<'_>) -> Decided {
        let mut news = std::mem::take(&mut self.untold);
        news.extend(self.learn(moment));
        let before = self.present().fork();
        let kept = self.present().decide(&Moment {
            news: &news,
            ..*moment
        });
        match before {
            Some(before) if self.is_occasion(moment, &kept) => {
                self.rehearse(moment, &news, before, kept)
            }
            _ => self.outward(kept, moment.now),
        }
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        let inner = self.steps.get(&step)?.inner?;
        match &self.other {
            Some(other) => other.window(inner, is_end),
            None => self.keeper.window(inner, is_end),
        }
    }
}
