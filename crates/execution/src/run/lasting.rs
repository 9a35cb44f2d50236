//! Executives: runs that continue after their goal is reached, with goals, facts and pauses from
//! outside.
//!
//! Each request arrives as an observation ([`Event::Asked`]). So it is recorded with everything
//! else, and replays and resumed runs receive it again.
//!
//! | request or observation | result |
//! | --- | --- |
//! | a goal | the goal is now the conjunction of all open goals, except those that are [set aside](super::choosing). If the remaining plan, started now, reaches it, the plan is kept; otherwise a new plan is made |
//! | a goal with the name of an open one | it replaces the earlier goal; a new plan is made |
//! | a goal is abandoned | a plan is made for the others; without others, nothing more is started |
//! | a fact or value | believed; the plan continues if it is still feasible, otherwise a new one is made |
//! | an action is cancelled | the world receives the cancellation; its end is an outcome like any other |
//! | a pause | nothing is started or planned any more. Running actions continue and are monitored, and silent ones time out. Time passes, also for deadlines |
//! | the end of a pause | the plan continues if it is still feasible, otherwise a new one is made |
//!
//! Actions keep running in all of these cases: they are part of the situation from which the next
//! plan starts ([`RunningRule`](super::RunningRule)).
//!
//! Other runs end when the goals are reached, no plan reaches them, none was found, or the limit on
//! new plans is reached. An executive becomes *idle* instead ([`Entry::Resting`]): it starts
//! nothing, and records the reason. Running actions continue to their ends. A request ends the idle
//! state. While goals are open, so do news from the world and each timed initial, at most once in
//! [`BREATH`] seconds.

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan, problem};
use elbowroom_num::Rational;

use super::agenda::Todo;
use super::beginning::Course;
use super::choosing::Choosing;
use super::goals::OpenGoal;
use super::here::{Guess, rest_of};
use super::intake::Remark;
use super::pending::Otherwise;
use super::search::Lost;
use super::stand::Goals;
use super::{Run, Stop, Verdict};
use crate::event::{Request, Ticket};
use crate::executor::News;
use crate::reason::{About, Cause, Reason};
use crate::record::Entry;

/// Name of the problem's own goal.
pub const FIRST_GOAL: &str = "problem";

/// Time after an unsuccessful search during which no other one begins, whatever is reported, in
/// seconds of the world's clock.
const BREATH: i64 = 1;

/// Length of the news during a pause above which repetitions are removed.
const MANY_NEWS: usize = 1000;

/// Reads the goals that are given to a run.
///
/// The result is the condition, or the error in words.
pub trait GoalReader: Send {
    /// Reads a goal of this task.
    ///
    /// # Errors
    /// If the text is not a condition of the task, in words.
    fn read(&self, task: &Task, text: &str) -> Result<problem::Condition, String>;
}

impl<F: Fn(&Task, &str) -> Result<problem::Condition, String> + Send> GoalReader for F {
    fn read(&self, task: &Task, text: &str) -> Result<problem::Condition, String> {
        self(task, text)
    }
}

/// State of an executive, or of an attended run.
pub(super) struct Lasting<'a> {
    pub(super) reader: Box<dyn GoalReader + 'a>,
    /// The open goals.
    pub(super) goals: Vec<OpenGoal>,
    /// `true` if the goals were ever changed.
    pub(super) has_other_goals: bool,
    pub(super) is_paused: bool,
    /// The change of the goals since the present plan was made.
    pub(super) change: Option<Turn>,
    /// The selection among the goals, while it is in progress.
    pub(super) choosing: Option<Choosing>,
    /// Conjuncts of goals that exclude each other, as proved by the planner's answers during the
    /// selection.
    pub(super) conflicts: Vec<Vec<String>>,
    /// The present plan, on the world's clock.
    pub(super) plan: Option<TimeTriggeredPlan>,
    /// The names of the plan's goals.
    pub(super) planned_goals: BTreeSet<String>,
    /// Start of the idle state.
    rests_since: Option<Rational>,
    /// `true` if it is proved that no plan reaches the goals from there, including the effects of
    /// all coming timed initials.
    is_unsolvable: bool,
    at_rest: AtRest,
}

/// Behaviour when another run would be over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum AtRest {
    /// It waits for the next request.
    Waits,
    /// It is also over. It accepts only pauses and the abandonment of its goal.
    Ends,
    /// Its goal was abandoned: it is over as soon as no action is running.
    GivenUp,
}

/// A change of the goals.
pub(super) struct Turn {
    pub(super) reason: Reason,
    /// `true` if goals were only added, so that the plan may also reach these.
    pub(super) may_keep: bool,
}

impl<'a> Run<'a> {
    /// Turns the run into an executive, which does not end when its goal is reached or unreachable.
    /// It waits for other goals ([`Event::Asked`](crate::Event::Asked)), which `reader` reads. It
    /// ends at the time limit, when the world fails, or when its end is requested.
    #[must_use]
    pub fn lasting(mut self, reader: impl GoalReader + 'a) -> Self {
        let goals = if self.task.problem().goal.is_trivial() {
            Vec::new()
        } else {
            vec![OpenGoal::of_the_problem(&self.task)]
        };
        self.lasting = Some(Lasting {
            reader: Box::new(reader),
            goals,
            has_other_goals: false,
            is_paused: false,
            change: None,
            choosing: None,
            conflicts: Vec::new(),
            plan: None,
            planned_goals: BTreeSet::new(),
            rests_since: None,
            is_unsolvable: false,
            at_rest: AtRest::Waits,
        });
        self
    }

    /// Makes the run accept pauses and the abandonment of its goal, but no other goals. When the
    /// goal is abandoned, nothing more is started, and the run is over ([`Verdict::Interrupted`])
    /// when the running actions have ended.
    #[must_use]
    pub fn attended(self) -> Self {
        let reads_none = |_: &Task, _: &str| Err("this run has one goal".to_owned());
        let mut run = self.lasting(reads_none);
        if let Some(lasting) = &mut run.lasting {
            lasting.at_rest = AtRest::Ends;
        }
        run
    }

    /// Processes a request.
    pub(super) fn asked_for(&mut self, request: &Request) -> Remark {
        let Some(lasting) = &mut self.lasting else {
            return Some("this run takes no requests; nothing was made of it");
        };
        match request {
            Request::Pursue { .. } if lasting.at_rest != AtRest::Waits => {
                Some("this run takes no other goals; nothing was made of it")
            }
            Request::Pursue { terms, .. } if !terms.value.is_positive() => {
                Some("the value of a goal is not positive; nothing was made of it")
            }
            Request::Pursue { name, goal, terms } => {
                let Ok(condition) = lasting.reader.read(&self.task, goal) else {
                    return Some("it is no goal of this problem; nothing was made of it");
                };
                let text = Some(goal.clone());
                let mut given = OpenGoal::new(&self.task, name.clone(), text, condition);
                given.terms.clone_from(terms);
                let known = lasting.goals.iter_mut().find(|known| known.name == *name);
                let is_new = known.is_none();
                match known {
                    Some(known) => *known = given,
                    None => lasting.goals.push(given),
                }
                if is_new {
                    self.add_to_choice();
                } else {
                    self.pursue_all();
                }
                self.turn(format!("`{name}` is to be reached"), is_new);
                None
            }
            Request::Abandon { name } => {
                let before = lasting.goals.len();
                lasting.goals.retain(|known| known.name != *name);
                if lasting.goals.len() == before {
                    return Some("no goal of that name is open");
                }
                self.pursue_all();
                self.turn(format!("`{name}` is abandoned"), false);
                None
            }
            Request::CancelAction { ticket } => self.cancel_on_request(*ticket),
            Request::Pause if lasting.is_paused => Some("it is paused already"),
            Request::Resume if !lasting.is_paused => Some("it is not paused"),
            Request::Pause | Request::Resume => {
                lasting.is_paused = *request == Request::Pause;
                None
            }
        }
    }

    fn cancel_on_request(&mut self, ticket: Ticket) -> Remark {
        if !self.account.open_tickets().any(|open| open == ticket) {
            return Some("no action with that ticket is running");
        }
        self.cancel(vec![ticket]);
        None
    }

    /// Returns `true` if the goals are not, or no longer, those of the problem.
    pub(super) fn has_other_goals(&self) -> bool {
        let lasting = self.lasting.as_ref();
        lasting.is_some_and(|lasting| lasting.has_other_goals)
    }

    /// Returns `true` if nothing is to be started or planned for now.
    pub(super) fn is_paused(&self) -> bool {
        let lasting = self.lasting.as_ref();
        lasting.is_some_and(|lasting| lasting.is_paused)
    }

    /// Returns `true` if the goals have changed since a plan was requested.
    pub(super) fn is_to_turn(&self) -> bool {
        let lasting = self.lasting.as_ref();
        lasting.is_some_and(|lasting| lasting.change.is_some())
    }

    /// Handles pauses, changed goals and the idle state. Returns `true` if the executor is not to
    /// be asked.
    pub(super) fn attend(&mut self) -> Result<bool, Stop> {
        let Some(lasting) = &mut self.lasting else {
            return Ok(false);
        };
        if lasting.is_paused {
            forget_repetitions(&mut self.news);
            self.stay();
            return Ok(true);
        }
        if lasting.at_rest == AtRest::GivenUp {
            if self.account.open_tickets().next().is_none() {
                return Err(Stop::Over(Verdict::Interrupted));
            }
            self.news.clear();
            self.stay();
            return Ok(true);
        }
        if self.search.is_none()
            && let Some(turn) = lasting.change.take()
        {
            lasting.rests_since = None;
            self.lost.in_vain = None;
            self.replans = 0;
            self.turn_to(turn)?;
            return Ok(true);
        }
        if lasting.rests_since.is_none() {
            return Ok(false);
        }
        if lasting.goals.is_empty() {
            self.news.clear();
        }
        if self.is_rested() {
            self.wake();
            let reason = Reason::new(Cause::Surprise).about(About::AnyObservation);
            self.replan(&reason)?;
        } else {
            self.begin_anew_at_rest();
            self.stay();
        }
        Ok(true)
    }

    /// Returns `true` if the run is idle although goals are open, and a timed initial may make them
    /// reachable.
    fn awaits_timed_initials(&self) -> bool {
        let lasting = self.lasting.as_ref();
        lasting
            .is_some_and(|it| it.rests_since.is_some() && !it.goals.is_empty() && !it.is_unsolvable)
    }

    /// Records the timed initials after the first `before` of them as news, if they may make open goals reachable.
    pub(super) fn note_timed_at_rest(&mut self, before: usize) {
        if !self.awaits_timed_initials() {
            return;
        }
        let past = self.task.timed().get(before..self.belief.timed_past());
        let changes = past.unwrap_or_default().iter().flat_map(|it| &it.changes);
        self.news.extend(changes.map(News::of_change));
    }

    /// Returns the start of the idle state, if the run is idle, and `true` if no plan reaches the
    /// open goals from there.
    pub(super) fn rests_since(&self) -> Option<(&Rational, bool)> {
        let lasting = self.lasting.as_ref()?;
        Some((lasting.rests_since.as_ref()?, lasting.is_unsolvable))
    }

    /// Sets the start of the idle state. `is_unsolvable` is `true` if no plan reaches the open
    /// goals from there.
    pub(super) fn rest_since(&mut self, since: Rational, is_unsolvable: bool) {
        if let Some(lasting) = &mut self.lasting {
            lasting.rests_since = Some(since);
            lasting.is_unsolvable = is_unsolvable;
        }
    }

    fn wake(&mut self) {
        if let Some(lasting) = &mut self.lasting {
            lasting.rests_since = None;
        }
        self.pursue_all();
    }

    /// Keeps the remaining plan, or makes another one.
    fn turn_to(&mut self, turn: Turn) -> Result<(), Stop> {
        let has_goals = self.lasting.as_ref().is_some_and(|it| !it.goals.is_empty());
        if !has_goals {
            self.drop_plan();
            match &mut self.lasting {
                Some(lasting) if lasting.at_rest != AtRest::Waits => {
                    lasting.at_rest = AtRest::GivenUp;
                }
                _ => self.rest_because(None, &[]),
            }
            return Ok(());
        }
        let rest = if turn.may_keep { self.kept() } else { None };
        if let Some(rest) = rest {
            if self.plans_aside() && self.settings.readies_aside {
                self.make_rest_ready(turn, rest);
                return Ok(());
            }
            let (plan, situation, running) = rest;
            let course = Course::of(&plan, &situation, &running);
            let (task, goals) = (Arc::clone(&self.task), self.goals());
            self.await_preparation(&task, &goals, course, Otherwise::PlanForOthers(turn));
            return Ok(());
        }
        self.plan_for_others(&turn)
    }

    /// Makes another plan, because the goals have changed.
    pub(super) fn plan_for_others(&mut self, turn: &Turn) -> Result<(), Stop> {
        if self.search_while_the_plan_goes_on(&turn.reason)? {
            return Ok(());
        }
        self.replan(&turn.reason)
    }

    /// Repeats a change of the goals, merged with later changes.
    pub(super) fn turn_back(&mut self, turn: Turn) {
        let Some(lasting) = &mut self.lasting else {
            return;
        };
        lasting.change = Some(match lasting.change.take() {
            None => turn,
            Some(later) => Turn {
                may_keep: later.may_keep && turn.may_keep,
                ..later
            },
        });
    }

    /// Records that a plan for these goals begins.
    pub(super) fn note_plan(&mut self, plan: &TimeTriggeredPlan, goals: &Goals) {
        if let Some(lasting) = &mut self.lasting {
            lasting.plan = Some(plan.clone());
            lasting.rests_since = None;
            let pursued = goals.open.iter().filter(|it| it.aside.is_none());
            lasting.planned_goals = pursued.map(|it| it.name.clone()).collect();
            let planned = &lasting.planned_goals;
            let goals = lasting.goals.iter_mut();
            for goal in goals.filter(|goal| planned.contains(&goal.name)) {
                goal.late = None;
            }
            self.choose_after_success();
        }
    }

    /// Drops the plan. Running actions are no longer part of a plan.
    pub(super) fn drop_plan(&mut self) {
        self.account.begin_plan(&std::collections::BTreeMap::new());
        if let Some(lasting) = &mut self.lasting {
            lasting.plan = None;
            lasting.planned_goals.clear();
        }
    }

    /// Returns `true` if goals were abandoned or replaced, `false` if they were only added, and
    /// `None` if they have not changed.
    pub(super) fn has_given_up_goals(&self) -> Option<bool> {
        let turn = self.lasting.as_ref()?.change.as_ref()?;
        Some(!turn.may_keep)
    }

    /// Returns `true` if the goal of an attended run was abandoned.
    pub(super) fn is_given_up(&self) -> bool {
        let lasting = self.lasting.as_ref();
        lasting.is_some_and(|lasting| lasting.at_rest == AtRest::GivenUp)
    }

    /// Returns the present plan, on the world's clock, if there is one.
    pub(super) fn present_plan(&self) -> Option<&TimeTriggeredPlan> {
        self.lasting.as_ref()?.plan.as_ref()
    }

    /// Returns the remaining plan, started as soon as possible, if it reaches the goal. Running
    /// actions end as expected, and the remaining steps keep their planned distances.
    fn kept(&self) -> Option<(TimeTriggeredPlan, Situation, Vec<Ticket>)> {
        let plan = self.lasting.as_ref()?.plan.as_ref()?;
        if self.settings.readies_aside && self.lost.plan {
            return None;
        }
        let is_told = |ticket: &Ticket| self.belief.running().contains_key(ticket);
        if !self.account.open_tickets().all(|ticket| is_told(&ticket)) {
            return None;
        }
        let mut left: Vec<Step> = plan.steps.clone();
        for (_, started) in self.account.of_plan() {
            let name = &started.action.name;
            let same = left
                .iter()
                .enumerate()
                .filter(|(_, it)| it.action.name == *name);
            let first = same.min_by(|(_, one), (_, other)| one.start.cmp(&other.start));
            let index = first.map(|(index, _)| index)?;
            left.remove(index);
        }
        let (situation, running) = self.situation(&Rational::ZERO, Guess::AQuarterLonger);
        let rest = rest_of(&self.task, &situation, left)?;
        Some((rest, situation, running))
    }

    /// Waits without asking the executor.
    pub(super) fn stay(&mut self) {
        let timeout = self.next_timeout();
        let soon = self.lasting.as_ref().and_then(|lasting| {
            let since = lasting.rests_since.as_ref()?;
            let is_waiting = !lasting.is_paused && !self.news.is_empty();
            is_waiting.then(|| since + Rational::from(BREATH))
        });
        let timed = self.belief.next_timed().cloned();
        let timed = timed.filter(|_| self.awaits_timed_initials());
        let until = timeout.into_iter().chain(soon).chain(timed).min();
        let until = until.unwrap_or_else(|| self.settings.time_limit.clone());
        self.agenda.push(Todo::CheckTimeouts);
        self.agenda.push(Todo::Pass(until.max(self.now.clone())));
    }

    /// Returns `true` if it is time to search for a plan again.
    fn is_rested(&self) -> bool {
        let since = self.lasting.as_ref().and_then(|it| it.rests_since.as_ref());
        since.is_some_and(|since| {
            !self.news.is_empty() && self.now >= since + Rational::from(BREATH)
        })
    }

    /// Returns `true` if the run becomes idle with this verdict, and is not over.
    pub(super) fn goes_on_after(&self, verdict: &Verdict) -> bool {
        self.lasting
            .as_ref()
            .is_some_and(|lasting| lasting.at_rest == AtRest::Waits)
            && match verdict {
                Verdict::GoalReached
                | Verdict::Unsolvable
                | Verdict::NoPlan { .. }
                | Verdict::PlannerFailed { .. }
                | Verdict::ReplanLimit => true,
                Verdict::TimeLimit | Verdict::Interrupted | Verdict::WorldFailed { .. } => false,
            }
    }

    /// Makes the run idle after the goals were reached, or because they cannot be reached.
    pub(super) fn rest(&mut self, verdict: &Verdict) {
        if self.choose_after(verdict) {
            return;
        }
        self.announce_goals();
        let mut reasons = self.missed_deadlines();
        let is_explained = reasons.len() == self.pursued_goals();
        if *verdict == Verdict::Unsolvable && self.is_explaining && !is_explained {
            reasons.extend(self.dead_end());
        }
        self.drop_plan();
        self.rest_because(Some(verdict), &reasons);
    }

    fn rest_because(&mut self, verdict: Option<&Verdict>, dead_end: &[Reason]) {
        let Some(lasting) = &mut self.lasting else {
            return;
        };
        lasting.rests_since = Some(self.now.clone());
        lasting.is_unsolvable = verdict == Some(&Verdict::Unsolvable);
        let goals: Vec<String> = lasting.goals.iter().map(|it| it.name.clone()).collect();
        let is_reached = verdict == Some(&Verdict::GoalReached);
        if is_reached {
            lasting.goals.clear();
        }
        // Without goals, there is no verdict.
        let verdict = verdict.filter(|_| !goals.is_empty());
        self.ports.recorder.record(&Entry::Resting {
            now: &self.now,
            verdict,
            goals: &goals,
            dead_end,
        });
        if is_reached {
            self.set_goal();
            // The earlier history is not needed for explanations any more.
            self.history.clear();
            self.beginning = self.belief.clone();
        }
        self.news.clear();
        self.reasons.clear();
        self.replans = 0;
        self.lost = Lost::default();
        self.refusals.forget();
        self.progress.begin_plan();
    }
}

/// Removes repeated news of the same fact or value, which accumulate in a long pause.
fn forget_repetitions(news: &mut Vec<News>) {
    if news.len() < MANY_NEWS {
        return;
    }
    let (mut facts, mut values) = Default::default();
    let mut is_first = |it: &News| match it {
        News::Fact(fact) => std::collections::BTreeSet::insert(&mut facts, *fact),
        News::Value(fluent) => std::collections::BTreeSet::insert(&mut values, *fluent),
        _ => true,
    };
    news.retain(|it| is_first(it));
}
