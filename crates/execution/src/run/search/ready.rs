//! Background preparation of plans: execution meanwhile, and the switch to the new plan.
//!
//! A plan is prepared for a moment, with the actions running then. It takes over as if it had been
//! adopted at that moment, and its executor is notified at once of all starts and ends since. So
//! the executor's own checks of times and amounts decide whether the plan is still feasible.

use std::sync::Arc;

use elbowroom_model::ground::{Action, Body};
use elbowroom_model::{Footprint, Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::super::beginning::{Course, no_plan};
use super::super::lasting::Turn;
use super::super::{Run, Stop};
use super::fit::Begun;
use super::{Goes, Search, WORD};
use crate::event::{Measured, Ticket};
use crate::executor::{Mission, Need, News, Order};
use crate::preparation::PrepareError;
use crate::record::Entry;
use crate::request::RequestId;
use crate::run::intake::Remark;

/// Number of times that a plan is fitted and prepared again because of unexpected reports. After
/// that, its executor is notified of them, so that a run with frequent unexpected events does not
/// wait forever.
const MOST_TRIES: usize = 2;

/// Background preparation of a plan.
pub(super) struct Readying {
    request: RequestId,
    /// The prepared plan, until it is processed.
    answer: Option<Result<Mission, PrepareError>>,
    plan: TimeTriggeredPlan,
    /// The situation from which it starts.
    situation: Situation,
    /// The actions running there.
    running: Vec<Ticket>,
    /// Number of actions started until then. Later ones belong to the plan.
    started: usize,
    /// The time at which it was ready, if it is.
    since: Option<Rational>,
    /// `true` if an unexpected event has happened since.
    disagrees: bool,
    /// `true` if the plan was fitted to the present situation.
    is_fitted: bool,
}

impl Readying {
    /// Returns `true` if the prepared plan has arrived, and is not recorded yet.
    pub(super) fn has_arrived(&self) -> bool {
        self.answer.is_some() && self.since.is_none()
    }

    /// Returns the request if it has no answer yet.
    pub(super) fn open_request(&self) -> Option<RequestId> {
        (self.answer.is_none() && self.since.is_none()).then_some(self.request)
    }
}

impl Search {
    /// Takes the answer to the request for a prepared plan. If the run waits in the world (`now` is `None`), the end
    /// of the wait notes it.
    pub(in crate::run) fn take_prepared(
        &mut self,
        id: RequestId,
        prepared: Result<Mission, PrepareError>,
        now: Option<Rational>,
    ) {
        if let Some(readying) = &mut self.readying
            && readying.open_request() == Some(id)
        {
            readying.answer = Some(prepared);
            readying.since = now;
        }
    }
}

impl Run<'_> {
    /// Begins to prepare a fitted plan.
    pub(super) fn make_ready(&mut self, mut search: Search, fit: Begun, is_fitted: bool) {
        let (plan, situation, running) = fit;
        let request = self.request_preparation(&search.task, &plan, &situation, &running);
        search.tries += 1;
        search.readying = Some(Readying {
            request,
            answer: None,
            plan,
            situation,
            running,
            started: self.account.started(),
            since: None,
            disagrees: false,
            is_fitted,
        });
        self.search = Some(search);
    }

    /// Records that the plan is prepared.
    pub(in crate::run) fn note_plan_ready(&mut self) -> Remark {
        let search = self.search.as_mut();
        match search.and_then(|search| search.readying.as_mut()) {
            Some(readying) if readying.since.is_none() && readying.answer.is_some() => {
                readying.since = Some(self.now.clone());
                None
            }
            _ => Some("no plan was being made ready"),
        }
    }

    /// Records an event that the plan being prepared does not account for.
    pub(in crate::run) fn note_disagreement(&mut self) {
        self.note_unforeseen();
        let search = self.search.as_mut();
        if let Some(readying) = search.and_then(|search| search.readying.as_mut()) {
            readying.disagrees = true;
        }
    }

    /// Records that amounts were measured. The executor of the next plan does not receive them,
    /// only the resulting values.
    pub(in crate::run) fn note_measured(&mut self, measured: &[Measured]) {
        if !measured.is_empty() {
            self.note_disagreement();
        }
    }

    /// Returns the time of the next decision about the preparation if no event comes before.
    pub(super) fn next_of_readying(&self, readying: &Readying) -> Rational {
        match &readying.since {
            Some(since) => (since + Rational::from(WORD)).max(&self.now + self.task.epsilon()),
            None if self.now < readying.situation.time => readying.situation.time.clone(),
            // The preparer reports when it is finished.
            None => self.settings.time_limit.clone(),
        }
    }

    /// Returns `true` if these actions can be started while a plan is being prepared: the plan also
    /// has them, and no earlier step of it interferes with them.
    pub(in crate::run) fn may_start(&self, orders: &[Order]) -> bool {
        let readying = self.search.as_ref().and_then(|it| it.readying.as_ref());
        let Some(readying) = readying else {
            return true;
        };
        let mut left = Step::by_start(readying.plan.new_steps(&readying.situation));
        let begun = begun_since(readying, self.account.started());
        let begun = begun.filter_map(|it| self.account.get(it));
        let mut take = |name: &str| {
            let index = left.iter().position(|it| it.action.name == name)?;
            Some(left.remove(index))
        };
        if !begun.map(|it| take(&it.action.name)).all(|it| it.is_some()) {
            return false;
        }
        let starts: Option<Vec<&Step>> = orders.iter().map(|it| take(&it.action.name)).collect();
        starts.is_some_and(|starts| {
            starts.iter().all(|step| {
                let mut earlier = left.iter().filter(|it| it.start < step.start);
                !earlier.any(|it| touch(&self.task, &it.action, &step.action))
            })
        })
    }

    /// Continues a preparation. Returns `true` if the executor is not to be asked.
    pub(super) fn tend_readying(&mut self) -> Result<bool, Stop> {
        let Some(search) = &self.search else {
            return Ok(false);
        };
        let Some(readying) = &search.readying else {
            return Ok(false);
        };
        let Some(since) = &readying.since else {
            let goes_on = search.course != Goes::UnderWay;
            // No step of the plan begins before its start time.
            if goes_on && self.now >= readying.situation.time {
                return Ok(false);
            }
            self.wait_for_search();
            return Ok(true);
        };
        if self.is_silent(readying) && self.now < since + Rational::from(WORD) {
            if search.is_optional() {
                self.give_up_search();
                return Ok(false);
            }
            self.let_go_of_plan();
            self.wait_for_search();
            return Ok(true);
        }
        self.take_over_ready()?;
        Ok(true)
    }

    /// Returns `true` if an action was started meanwhile and its start has not been reported.
    fn is_silent(&self, readying: &Readying) -> bool {
        let has_ended = |it: Ticket| self.account.get(it).is_none_or(|it| it.ended.is_some());
        let mut begun = begun_since(readying, self.account.started());
        begun.any(|it| !has_ended(it) && !self.belief.running().contains_key(&it))
    }

    /// Switches to a prepared plan if the events meanwhile were as expected.
    fn take_over_ready(&mut self) -> Result<(), Stop> {
        let Some(mut search) = self.search.take() else {
            return Ok(());
        };
        let Some(mut readying) = search.readying.take() else {
            return Ok(());
        };
        let Some(mission) = readying.answer.take() else {
            return Ok(());
        };
        self.heed()?;
        let begun: Vec<Ticket> = begun_since(&readying, self.account.started()).collect();
        let mut mission = match mission {
            Ok(mission) => mission,
            Err(error) => {
                if let Some(turn) = search.kept_for.take() {
                    return self.plan_for_others(&turn);
                }
                if search.is_optional() {
                    return Ok(());
                }
                if search.course != Goes::UnderWay || !begun.is_empty() {
                    return self.search_again(&search.reason);
                }
                if !readying.is_fitted {
                    return Err(no_plan(&error));
                }
                let plan = search.plan.as_ref().map(|(plan, _)| plan.clone());
                return match plan {
                    Some(plan) => self.take_over_from_nothing(search, &plan, false),
                    None => Err(no_plan(&error)),
                };
            }
        };
        let steps = self.steps_of(&mission, &begun);
        let agrees = !readying.disagrees && !self.is_silent(&readying) && steps.is_some();
        if search.is_optional() {
            if !agrees || !self.takes_over(&mission, &search.reason)? {
                return Ok(());
            }
        } else if !agrees && (search.tries <= MOST_TRIES || !begun.is_empty()) {
            search = match self.fit_again(search)? {
                // Its executor is notified instead.
                Some(search) if begun.is_empty() => search,
                Some(search) => return self.search_again(&search.reason),
                None => return Ok(()),
            };
        }
        if let Some(turn) = &search.kept_for {
            self.ports.recorder.record(&Entry::Kept {
                now: &self.now,
                reason: &turn.reason,
            });
        } else {
            let took = &self.now - &search.begun;
            self.allowance = std::mem::take(&mut self.allowance).max(took);
        }
        self.tell_what_happened();
        self.plan_task = Some(Arc::clone(&search.task));
        mission.begun = steps.unwrap_or_default();
        mission.now.clone_from(&self.now);
        let course = Course {
            plan: &readying.plan,
            situation: &readying.situation,
            running: &readying.running,
            begun: &begun,
        };
        self.begin_with(course, &search.goals, &mission)
    }

    /// Fits the plan again after unexpected events during its preparation, or requests another one.
    /// Returns the search if the executor of the plan is to be notified instead.
    fn fit_again(&mut self, mut search: Search) -> Result<Option<Search>, Stop> {
        if let Some(turn) = search.kept_for.take() {
            self.keep_again(turn)?;
            return Ok(None);
        }
        let went_on = search.course != Goes::UnderWay;
        self.search = Some(search);
        if went_on {
            self.let_go_of_plan();
        }
        let Some(search) = self.search.take() else {
            return Ok(None);
        };
        let plan = search.plan.as_ref().map(|(plan, _)| plan);
        if let Some(fit) = plan.and_then(|plan| self.fitted(&search, plan)) {
            self.news.clear();
            self.make_ready(search, fit, true);
            return Ok(None);
        }
        if went_on || !search.expected.is_empty() {
            self.search_again(&search.reason)?;
            return Ok(None);
        }
        Ok(Some(search))
    }

    /// Prepares the remaining plan for other goals.
    pub(in crate::run) fn make_rest_ready(&mut self, turn: Turn, rest: Begun) {
        let may_go_on = !self.lost.plan
            && self.settings.running == super::super::RunningRule::Keep
            && self.ports.executor.need() != Need::PartialOrder;
        let search = Search {
            request: self.next_request(),
            answer: None,
            reason: turn.reason.clone(),
            guess: super::Guess::AQuarterLonger,
            task: Arc::clone(&self.task),
            goals: self.goals(),
            situation: rest.1.clone(),
            running: rest.2.clone(),
            expected: Vec::new(),
            begun: self.now.clone(),
            timed: self.belief.timed_past(),
            since: self.now.clone(),
            is_guess: false,
            course: Goes::Plan { until: None },
            is_made: true,
            is_overtaken: false,
            plan: None,
            readying: None,
            tries: 0,
            left_behind: std::collections::BTreeMap::new(),
            kept_for: Some(turn),
        };
        self.make_ready(search, rest, true);
        if !may_go_on {
            self.let_go_of_plan();
        }
    }

    /// Fits the remaining plan again because it is outdated, or makes another plan.
    fn keep_again(&mut self, turn: Turn) -> Result<(), Stop> {
        self.lost.kept += 1;
        if self.lost.kept > MOST_TRIES {
            return self.plan_for_others(&turn);
        }
        self.turn_back(turn);
        Ok(())
    }

    /// Detaches the started actions from the steps of the present plan. Their effects are reported
    /// as news.
    pub(in crate::run) fn forget_steps(&mut self) {
        for it in std::mem::take(&mut self.news) {
            let (step, is_end) = match &it {
                News::Started { step, .. } => (*step, false),
                News::Ended { step, ending, .. } => {
                    if *ending != crate::event::Ending::Succeeded {
                        continue;
                    }
                    (*step, true)
                }
                _ => {
                    self.news.push(it);
                    continue;
                }
            };
            if let Some(ticket) = self.account.ticket(step) {
                self.tell_effects(ticket, is_end);
            }
        }
        self.account.begin_plan(&std::collections::BTreeMap::new());
    }
}

/// Returns the starts since the preparation began.
fn begun_since(readying: &Readying, started: usize) -> impl Iterator<Item = Ticket> + use<> {
    (readying.started..started).map(|number| Ticket(number as u64))
}

/// Returns `true` if the order of two actions may matter.
fn touch(task: &Task, one: &Action, other: &Action) -> bool {
    let prints = |action: &Action| {
        let mut all = vec![
            Footprint::of_start(task, action),
            Footprint::of_end(task, action),
        ];
        if let Body::Durative(body) = &action.body {
            all.push(Footprint::of_condition(task, &body.over_all));
        }
        all
    };
    let others = prints(other);
    let touches = |it: &Footprint| others.iter().any(|other| it.interferes_with(other));
    prints(one).iter().any(touches)
}
