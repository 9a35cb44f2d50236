//! Background planning: execution during a search, and the switch to the new plan.

mod fit;
mod ready;
mod takeover;

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::agenda::Todo;
use super::carrying_on::Abandoned;
use super::dead_end::is_goal_unreachable;
use super::doubts::Inquiry;
use super::expectation::{Expected, Prospect};
use super::foresight::Ahead;
use super::handover::NextAttempt;
use super::here::Guess;
use super::intake::Remark;
use super::lasting::Turn;
use super::stand::Goals;
use super::{Outlook, Run, Stop, Verdict};
use crate::event::Ticket;
use crate::executor::CAN_HAVE_A_CLOCK;
use crate::executor::Need;
use crate::executor::StepId;
use crate::planning::{PlanAnswer, Planned};
use crate::progression::Progression;
use crate::reason::{About, Cause, Reason};
use crate::record::Entry;
use crate::request::{RequestId, Urgency};
use ready::Readying;

/// Number of searches in a row that end at once when goals are abandoned. The next one continues
/// for a limited time ([`Run::end_of_patience`]), so that frequent changes of goals do not block
/// the run.
const MOST_ENDED: usize = 3;

/// Minimum time for which a search may continue although its goals were abandoned, in seconds of
/// the world's clock. The time is at least twice the expected planning time. It doubles each time
/// that it passes before there is a plan.
const PATIENCE: i64 = 5;

/// Maximum number of doublings of that time.
const MOST_DOUBLINGS: u32 = 20;

/// Maximum time for which a finished plan waits for the reports that commanded actions have
/// started, in seconds of the world's clock.
const WORD: i64 = 1;

/// Background search for a plan, until the plan takes over.
pub(super) struct Search {
    /// The request for the plan.
    request: RequestId,
    /// The answer, until it is processed.
    answer: Option<Planned>,
    pub(super) reason: Reason,
    guess: Guess,
    /// The task, with the goals of the plan.
    task: Arc<Task>,
    /// These goals, as they were given.
    goals: Goals,
    /// The initial situation of the plan.
    situation: Situation,
    /// The actions running there. Tickets that were not issued when the search began are those of
    /// expected starts of the present plan.
    running: Vec<Ticket>,
    /// The expected starts of the present plan until then.
    expected: Vec<Expected>,
    begun: Rational,
    /// The time of the forecast of its situation, which is before the start of the search if the
    /// situation was foreseen.
    since: Rational,
    /// `true` if the situation was foreseen, and the real one differed slightly when the search
    /// began.
    is_guess: bool,
    course: Goes,
    /// Number of timed initials after which the goal was last not known to be unreachable.
    timed: usize,
    is_made: bool,
    /// `true` if an unexpected event has happened since.
    is_overtaken: bool,
    /// The finished plan, and the time at which it was finished.
    plan: Option<(TimeTriggeredPlan, Rational)>,
    /// The preparation of the plan.
    readying: Option<Readying>,
    /// Number of preparations so far.
    tries: usize,
    /// The started steps of the earlier plan, once that plan was abandoned.
    left_behind: BTreeMap<StepId, Ticket>,
    /// The change of the goals for which the plan is kept, if no other plan is searched for.
    kept_for: Option<Turn>,
}

impl Search {
    /// Takes the answer to the request for the plan. If the run waits in the world, the answer is
    /// recorded at the end of the wait.
    pub(super) fn take_answer(&mut self, id: RequestId, planned: Planned, is_waiting: bool) {
        if id == self.request && self.answer.is_none() && !self.is_made {
            self.answer = Some(planned);
            self.is_made = !is_waiting;
        }
    }

    /// Returns `true` if the present plan continues unless the new one is better.
    pub(super) fn is_optional(&self) -> bool {
        self.reason.cause == Cause::MoreSlack
    }

    /// Returns `true` for each answer that has arrived and is not recorded yet: a plan, and a
    /// prepared plan.
    pub(super) fn arrived(&self) -> (bool, bool) {
        let is_made = self.answer.is_some() && !self.is_made;
        (
            is_made,
            self.readying.as_ref().is_some_and(Readying::has_arrived),
        )
    }

    /// Returns the request that has no answer yet.
    fn open_request(&self) -> Option<RequestId> {
        match &self.readying {
            Some(readying) => readying.open_request(),
            None => (!self.is_made && self.answer.is_none()).then_some(self.request),
        }
    }
}

/// Execution during a search.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Goes {
    /// The present plan continues, until then if there is a limit.
    Plan { until: Option<Rational> },
    /// Only the running actions continue.
    UnderWay,
}

/// Results of earlier searches, and state of the present plan, since a plan was last adopted.
#[derive(Clone, Debug, Default)]
pub(super) struct Lost {
    /// `true` if the present plan is infeasible.
    pub(super) plan: bool,
    /// The last question to the world about doubts.
    pub(super) inquiry: Inquiry,
    /// The plan that the executor abandoned, until another one is adopted.
    pub(super) abandoned: Option<Abandoned>,
    /// The time at which no plan was found and the executor carried on, and the verdict otherwise;
    /// `None` after the next event.
    pub(super) in_vain: Option<(Rational, Verdict)>,
    /// `true` if a search for a better plan has used up its budget. No other one begins until there is a new plan.
    pub(super) sought_in_vain: bool,
    /// `true` if goals were closed during the last search.
    pub(super) has_closed_goals: bool,
    /// Number of plans in a row that were outdated when they were finished.
    outdated: usize,
    /// Number of searches in a row that ended because goals were abandoned.
    ended: usize,
    /// Number of these that had continued for a limited time.
    ended_late: u32,
    /// Number of times in a row that the plan was to be kept for other goals, and was outdated when
    /// it was prepared.
    kept: usize,
}

impl Run<'_> {
    /// Returns `true` if plans are made in the background from now on.
    pub(super) fn plans_aside(&self) -> bool {
        let has_begun = self.now.is_positive() || self.account.started() > 0;
        let is_waited_for = !has_begun && !self.goes_on_after(&Verdict::GoalReached);
        CAN_HAVE_A_CLOCK && self.settings.plans_aside && !is_waited_for
    }

    /// Records that the planner has finished.
    pub(super) fn note_plan_made(&mut self) -> Remark {
        match &mut self.search {
            Some(search) if !search.is_made && search.answer.is_some() => {
                search.is_made = true;
                None
            }
            _ => Some("no plan was being made"),
        }
    }

    /// Returns the belief with the goals of the present plan, which need not reach the goals that
    /// were given since. `None` if the goals are the same.
    pub(super) fn belief_of_the_plan(&self) -> Option<Progression> {
        let (_, task) = (self.search.as_ref()?, self.plan_task.as_ref()?);
        let mut belief = self.belief.clone();
        belief.pursue(task);
        Some(belief)
    }

    /// Records that an unexpected event has happened.
    pub(super) fn note_surprise(&mut self) {
        if let Some(search) = &mut self.search {
            search.is_overtaken = true;
        }
        self.note_disagreement();
    }

    /// Begins a search when a plan is needed and the present one cannot continue.
    pub(super) fn search_from_here(&mut self, reason: &Reason) {
        self.let_go_of_plan();
        self.news.clear();
        if !self.go_without_plan(reason) {
            self.search(reason.clone(), Guess::AQuarterLonger, Goes::UnderWay);
        }
    }

    /// Begins a search because the goals have changed, while the present plan continues. Returns
    /// `false` if the plan cannot continue.
    pub(super) fn search_while_the_plan_goes_on(&mut self, reason: &Reason) -> Result<bool, Stop> {
        let goes_on = self.plans_aside()
            && self.settings.running == super::RunningRule::Keep
            && !self.lost.plan
            && self.present_plan().is_some()
            // These executors choose their own step numbers.
            && self.ports.executor.need() != Need::PartialOrder
            && self.needs_no_plan().is_none_or(|it| it == Outlook::Unmet);
        if !goes_on {
            return Ok(false);
        }
        self.count_replan(reason)?;
        self.search(
            reason.clone(),
            Guess::AQuarterLonger,
            Goes::Plan { until: None },
        );
        Ok(true)
    }

    /// Counts a new plan. Fails if the limit is reached.
    pub(super) fn count_replan(&mut self, reason: &Reason) -> Result<(), Stop> {
        self.reasons.push(reason.clone());
        self.replans += 1;
        if self.replans > self.settings.most_replans {
            self.replans -= 1;
            return Err(Stop::Over(Verdict::ReplanLimit));
        }
        Ok(())
    }

    /// Begins a search for a plan.
    fn search(&mut self, reason: Reason, guess: Guess, course: Goes) {
        let foreseen = match &course {
            Goes::Plan { .. } => None,
            Goes::UnderWay => self.as_foreseen(guess),
        };
        let ahead = foreseen.unwrap_or_else(|| Ahead {
            prospect: match &course {
                Goes::Plan { until } => self.where_the_plan_leads(until.as_ref()),
                Goes::UnderWay => {
                    let (situation, running) = self.situation(&self.allowance, guess);
                    Prospect {
                        situation,
                        running,
                        expected: Vec::new(),
                    }
                }
            },
            since: self.now.clone(),
            left_behind: BTreeMap::new(),
            is_guess: false,
        });
        let prospect = ahead.prospect;
        self.ports.recorder.record(&Entry::Planning {
            now: &self.now,
            reason: &reason,
            situation: &prospect.situation,
        });
        let request = self.request_plan(&prospect.situation, Urgency::Background);
        self.search = Some(Search {
            request,
            answer: None,
            reason,
            guess,
            task: Arc::clone(&self.task),
            goals: self.goals(),
            situation: prospect.situation,
            running: prospect.running,
            expected: prospect.expected,
            begun: self.now.clone(),
            timed: self.belief.timed_past(),
            since: ahead.since,
            is_guess: ahead.is_guess,
            course,
            is_made: false,
            is_overtaken: false,
            plan: None,
            readying: None,
            tries: 0,
            left_behind: ahead.left_behind,
            kept_for: None,
        });
    }

    /// Searches for a better plan while the present one is executed.
    pub(super) fn search_for_a_better_plan(&mut self, reason: Reason) {
        let course = Goes::Plan { until: None };
        self.search(reason, Guess::AQuarterLonger, course);
    }

    /// Ends the search if it is optional, that is, if the present plan continues without it.
    pub(super) fn give_up_optional_search(&mut self) {
        if self.search.as_ref().is_some_and(Search::is_optional) {
            self.give_up_search();
        }
    }

    /// Ends a search whose plan is not needed any more.
    pub(super) fn give_up_search(&mut self) {
        if let Some(search) = self.search.take() {
            let open = search.open_request();
            if let Some(id) = open {
                self.abandon(id);
            }
        }
    }

    /// Abandons the present plan: none of its remaining steps is started.
    pub(super) fn let_go_of_plan(&mut self) {
        // It searched for a better plan than this one.
        self.give_up_optional_search();
        self.lost.plan = true;
        self.keep_foreseen();
        if let Some(search) = &mut self.search {
            if search.course != Goes::UnderWay {
                search.left_behind = self.account.steps().clone();
            }
            search.course = Goes::UnderWay;
        }
        self.forget_steps();
    }

    /// Returns the time of the next decision about the search if no event comes before.
    pub(super) fn next_of_search(&self) -> Option<Rational> {
        let search = self.search.as_ref().filter(|_| CAN_HAVE_A_CLOCK)?;
        let next = self.next_whatever_is_asked(search);
        if self.has_given_up_goals() == Some(true) && !self.is_paused() {
            return Some(next.min(self.end_of_patience(search)));
        }
        Some(next)
    }

    fn next_whatever_is_asked(&self, search: &Search) -> Rational {
        if let Some(readying) = &search.readying {
            return self.next_of_readying(readying);
        }
        if let Some((_, since)) = &search.plan {
            let at_least = &self.now + self.task.epsilon();
            let begins = search
                .situation
                .time
                .clone()
                .max(since + Rational::from(WORD));
            return begins.max(at_least);
        }
        match &search.course {
            Goes::Plan { until: Some(until) } => until.clone(),
            Goes::Plan { until: None } => self.settings.time_limit.clone(),
            // A deadline may pass before the planner answers.
            Goes::UnderWay => {
                let timed = self.belief.next_timed();
                let limit = &self.settings.time_limit;
                timed
                    .into_iter()
                    .chain([limit])
                    .min()
                    .unwrap_or(limit)
                    .clone()
            }
        }
    }

    /// Returns the time until which a search continues although its goals were abandoned.
    ///
    /// It is bounded because a search may never end. It grows with each such search, so that a plan
    /// can be finished even if the goals change all the time.
    fn end_of_patience(&self, search: &Search) -> Rational {
        let expected = &self.allowance * &Rational::from(2);
        let patience = expected.max(Rational::from(PATIENCE));
        let doublings = self.lost.ended_late.min(MOST_DOUBLINGS);
        &search.begun + patience * Rational::from(1_i64 << doublings)
    }

    /// Continues the search, if there is one. Returns `true` if the executor is not to be asked
    /// because of it.
    pub(super) fn tend_search(&mut self) -> Result<bool, Stop> {
        if self.is_to_turn() {
            self.give_up_optional_search();
        }
        let Some(search) = self.search.as_ref().filter(|_| CAN_HAVE_A_CLOCK) else {
            return Ok(false);
        };
        if self.is_given_up() {
            self.give_up_search();
            return Ok(false);
        }
        if self.is_paused() {
            return Ok(false);
        }
        if self.needs_no_plan() == Some(Outlook::Reached) {
            self.give_up_search();
            self.news.clear();
            self.goal_reached();
            return Ok(true);
        }
        let given_up = self.has_given_up_goals();
        let is_let_go_on = self.lost.ended >= MOST_ENDED;
        let is_to_end =
            given_up == Some(true) && (!is_let_go_on || self.now >= self.end_of_patience(search));
        if given_up.is_some() && (is_to_end || self.has_no_goals()) {
            self.lost.ended += 1;
            self.lost.ended_late += u32::from(is_let_go_on);
            self.give_up_search();
            return Ok(false);
        }
        if search.readying.is_some() {
            return self.tend_readying();
        }
        if search.plan.is_some() {
            return self.take_over_if_due();
        }
        if search.is_made {
            self.collect()?;
            return Ok(true);
        }
        if let Goes::Plan { until: Some(until) } = &search.course
            && self.now >= *until
        {
            self.let_go_of_plan();
        }
        self.restart_if_out_of_reach();
        Ok(self.waits_for_plan())
    }

    /// Restarts a search that has become futile because deadlines have passed since it began. From
    /// the present situation, that is proved at once, with a certificate.
    fn restart_if_out_of_reach(&mut self) {
        let timed = self.belief.timed_past();
        let Some(search) = self.search.as_mut().filter(|it| it.timed < timed) else {
            return;
        };
        search.timed = timed;
        if search.course == Goes::UnderWay && is_goal_unreachable(&self.belief) {
            let (reason, guess) = (search.reason.clone(), search.guess);
            self.give_up_search();
            self.search(reason, guess, Goes::UnderWay);
        }
    }

    /// Waits for the plan if only running actions continue. Returns `true` if it does.
    fn waits_for_plan(&mut self) -> bool {
        let search = self.search.as_ref();
        let waits = search.is_some_and(|search| search.course == Goes::UnderWay);
        if waits {
            self.wait_for_search();
        }
        waits
    }

    /// Waits until the next decision about the search.
    fn wait_for_search(&mut self) {
        let timeout = self.next_timeout().into_iter();
        let until = timeout.chain(self.next_of_search()).min();
        let until = until.unwrap_or_else(|| self.settings.time_limit.clone());
        self.agenda.push(Todo::CheckTimeouts);
        self.agenda.push(Todo::Pass(until.max(self.now.clone())));
    }

    /// Processes the planner's answer.
    fn collect(&mut self) -> Result<(), Stop> {
        let Some(mut search) = self.search.take() else {
            return Ok(());
        };
        let answer = search.answer.take();
        let Some(Planned {
            answer,
            remark,
            shortfall,
            ..
        }) = answer
        else {
            return Ok(());
        };
        let took = &self.now - &search.begun;
        self.expect(&took);
        self.ports.recorder.record(&Entry::Planned {
            now: &self.now,
            took: &took,
            plan: answer.plan(),
            why_not: answer.why_not(),
            is_unsolvable: answer == PlanAnswer::Unsolvable,
            has_failed: matches!(answer, PlanAnswer::Failed { .. }),
            remark: remark.as_deref(),
            shortfall: &shortfall,
        });
        self.note_shortfall(&search.goals, &shortfall);
        self.heed()?;
        match answer {
            PlanAnswer::Plan(_) if search.guess == Guess::Cancelled => {
                self.cancel_overdue(search.reason);
                Ok(())
            }
            PlanAnswer::Plan(plan) if search.course == Goes::UnderWay => {
                search.plan = Some((plan.clone(), self.now.clone()));
                self.take_over_from_nothing(search, &plan, true)
            }
            PlanAnswer::Plan(plan) => {
                search.plan = Some((plan, self.now.clone()));
                self.search = Some(search);
                Ok(())
            }
            answer if search.is_optional() => {
                self.note_no_better_plan(&answer);
                Ok(())
            }
            // Another plan is needed in any case.
            _ if self.is_to_turn() => {
                if search.course == Goes::UnderWay {
                    self.choose_after_more_goals();
                }
                Ok(())
            }
            // There was no plan from that situation, but there may be one from the present one.
            _ if search.is_overtaken => self.search_again(&search.reason),
            _ if search.course != Goes::UnderWay && self.leave_out_new_goals() => Ok(()),
            // The situation was only a forecast.
            _ if search.is_guess
                || !search.expected.is_empty()
                || search.course != Goes::UnderWay =>
            {
                self.search_from_here(&search.reason);
                Ok(())
            }
            answer => self.without_plan(&search, &answer),
        }
    }

    /// Continues if there is no plan from a situation in which nothing more is started.
    fn without_plan(&mut self, search: &Search, answer: &PlanAnswer) -> Result<(), Stop> {
        let reason = search.reason.clone();
        match self.next_attempt(search.guess) {
            NextAttempt::Guess(guess) => self.search(reason, guess, Goes::UnderWay),
            NextAttempt::CancelOverdue => self.cancel_overdue(reason),
            NextAttempt::CarryOn => {
                return self.go_on_without_plan(answer, reason);
            }
        }
        Ok(())
    }

    /// Searches for another plan because the finished one is outdated, unless the present plan
    /// continues.
    pub(super) fn search_again(&mut self, first: &Reason) -> Result<(), Stop> {
        if first.cause == Cause::MoreSlack {
            return Ok(());
        }
        let about = "events during planning".to_owned();
        let reason = Reason::new(Cause::Surprise).about(About::Said(about));
        let reason = if self.is_to_turn() { first } else { &reason };
        self.lost.outdated += 1;
        self.count_replan(reason)?;
        if self.lost.outdated > 1 || self.lost.plan {
            self.agenda.push(Todo::Plan(reason.clone()));
            self.settle();
            self.lost.plan = true;
            return Ok(());
        }
        // The search is expected to take about as long again.
        let ahead = &self.allowance * &Rational::new(3, 2);
        let until = Some(&self.now + ahead + self.task.epsilon());
        self.search(reason.clone(), Guess::AQuarterLonger, Goes::Plan { until });
        Ok(())
    }
}
