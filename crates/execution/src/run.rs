//! A run: a plan is executed in a world, watched, and replaced when it no longer works.
//!
//! A [`Run`] is a state machine. [`Run::next`] returns its next request to the driver. Requests to the world are
//! commands, waits and looks: [`Run::observe`] and [`Run::see`] take the answers. Other requests are for plans, and for
//! plans prepared for the executor: [`Run::planned`] and [`Run::prepared`] take these answers, at once or while the run
//! continues. The driver implements waiting and planning, as an event loop or otherwise. [`Run::go`] is the loop for a
//! [`World`] that blocks, with [`Workers`] that plan and prepare.
//!
//! What happens when reports are wrong is defined here, so that no executor needs to know:
//!
//! | report | what is made of it |
//! | --- | --- |
//! | a second `Started` or an equal second `Ended` | nothing |
//! | `Ended` without `Started` | the action is taken to have started when it was told to |
//! | `Ended` after another, different `Ended` | a contradiction: what the action's end writes counts as unknown until it is seen, and the plan is given up |
//! | a report on a ticket that was never given out | nothing |
//! | a report on an action of an earlier plan | the state follows it; the present plan is told what it changed |
//! | a success after a cancel | the success counts: the action was faster |
//! | a report with a time in the future, or before the action's start | its time is taken as the nearest possible one |
//! | a report that comes late | it counts from its own time on for durations, from its arrival on for the state |
//! | a refusal, again and again, and nothing else | plans beside the run are asked for later and later ([`Refusals`]) |
//! | feedback | if more is done than before, the time-out counts from then on |
//! | a report that cannot be understood, or names what the problem does not have | nothing; the record has it |
//! | answers without end while the clock stands still, or creeps | the world is broken ([`Verdict::WorldFailed`]) |
//! | no report at all | a warning ([`Entry::Warning`]), and at its time-out ([`TimeoutRule`]) the action is cancelled and counts as failed. Where the slack of running actions is watched ([`RunSettings::watches_room`]), so is an action that no plan tolerates any longer |
//! | a fact or value other than believed | believed; the executor is told, and plays the rest of its plan through |
//!
//! A run may also outlast its goal ([`Run::lasting`]): goals are given and abandoned while it goes
//! on, and it can be paused.
//!
//! Where plans are made beside the run ([`RunSettings::plans_aside`]), it goes on meanwhile:
//!
//! | a plan is needed because | until it is there |
//! | --- | --- |
//! | goals were given or abandoned | the present plan goes on. The new one is made for where this will have led when planning is expected to be over; what is begun until then is committed |
//! | the present plan works no more, or there is none | nothing is started; what is under way goes on, and is followed |
//!
//! A new plan takes over when what was committed has begun, at the latest when planning was expected
//! to be over: with what has been done meanwhile left out, as much later as it is late, if the judge
//! finds that this works from there. If not, it is *outdated*, and another one is made: during the
//! second search in a row the present plan goes on only until that is expected to be over, and during
//! further ones nothing is started. Each outdated plan counts as a new plan
//! ([`RunSettings::most_replans`]). Goals that are given during a search wait for its end; one that is
//! abandoned ends it at once, three times in a row. The next search is let go on for a while, which
//! becomes longer each time that it is over before there is a plan: neither a search without end nor
//! somebody who keeps changing goals keeps the run from acting.
//!
//! Where the present plan leads is reckoned with its network: what is late takes a quarter longer than
//! it has taken, what waits for that is as late, and what could not be started then is not expected.
//! When a plan will be needed because something is late ([`RunSettings::watches_room`]), the planner is
//! told so ahead, from where everything else has started and ended as planned; and anew where things
//! come otherwise.
//!
//! Plans can also be made ready beside the run ([`RunSettings::readies_aside`]). Then a new plan is
//! made to fit as soon as it is there, with what was committed and has not begun in it, and is made
//! ready from there. It takes over as soon as it is ready, and its executor is told what has begun and
//! ended since:
//!
//! | until it is ready | |
//! | --- | --- |
//! | the present plan begins something that the new one has, too, after nothing that disturbs it | it is part of the new plan |
//! | it would begin anything else | nothing is started any more |
//! | something unexpected is reported: a failure, silence, another fact or value, an amount | the plan is made to fit again from there, twice at most, and nothing is started any more; after that the executor is told, and finds whether the plan can bear it |
//!
//! The rest of the running plan for goals that were added is made ready in the same way.
//!
//! However a run ends, nothing is left running: what has not ended is cancelled, and has
//! [`FAREWELL`] to stop. Only a world that can no longer be reached receives no commands.
//!
//! The goal is not taken as reached while anything is under way or in doubt, not before the last
//! timed initial that changes what it reads, and not before the world has had a chance to look
//! ([`World::look`]).

mod account;
mod agenda;
mod amid;
mod beginning;
mod better;
mod carrying_on;
mod choosing;
mod dead_end;
mod doubts;
mod drive;
mod expectation;
mod farewell;
mod foresight;
mod goals;
mod handover;
pub mod here;
mod intake;
mod lasting;
mod oblivion;
mod pending;
mod progress;
mod refusals;
mod room;
mod search;
mod selection;
mod settings;
mod shortfall;
mod stand;
mod timeout;
mod waits;

use std::collections::VecDeque;
use std::sync::Arc;

use elbowroom_model::{Footprint, Situation, Task, TimeTriggeredPlan};
use elbowroom_num::{Rational, work};

pub use account::{Account, ExecutedStep, KnownStart};
pub use amid::{Amid, Beginning};
pub use drive::{Next, NotAsked};
pub use farewell::FAREWELL;
pub use intake::is_correction;
pub use lasting::{FIRST_GOAL, GoalReader};
pub use refusals::Refusals;
pub use settings::{
    MissingPlan, PlanningTime, Report, RunSettings, RunningRule, UnknownSetting, Verdict,
};
pub use stand::{Doing, GivenGoal, Goals, Stand, TakesUp};
pub use timeout::TimeoutRule;

use crate::event::{Command, Ticket};
use crate::executor::{Decided, Decision, Executor, Moment, News, Order, Planned};
use crate::progression::{Outlook, Progression};
use crate::reason::{About, Cause, Reason};
use crate::record::{Entry, Recorder};
use crate::request::Workers;
use crate::world::{World, WorldError};
use agenda::Todo;
use dead_end::Happened;
use farewell::Closing;
use foresight::Foreseen;
use lasting::Lasting;
use pending::Pending;
use progress::Progress;
use search::{Lost, Search};

/// Work that is counted for a decision, and for each step of the plan in it, in units of [`elbowroom_num::work`].
const DECISION_WORK: u64 = 10_000;
const STEP_WORK: u64 = 250;

/// The components that a run calls itself.
pub struct Ports<'a> {
    /// The executor.
    pub executor: Box<dyn Executor + 'a>,
    /// The recorder.
    pub recorder: Box<dyn Recorder + 'a>,
}

/// A plan being executed.
pub struct Run<'a> {
    task: Arc<Task>,
    ports: Ports<'a>,
    settings: RunSettings,
    now: Rational,
    progress: Progress,
    belief: Progression,
    /// The actions that were started, and how they ended.
    account: Account,
    /// How many steps the present plan has.
    steps: usize,
    news: Vec<News>,
    replans: usize,
    reasons: Vec<Reason>,
    /// The expected planning time.
    allowance: Rational,
    /// The task with its goals, the situation and the guess of the last request that was answered by a plan while the
    /// run waited.
    planned_for: Option<(Arc<Task>, Situation, here::Guess)>,
    /// All that was observed and believed, in order.
    history: Vec<Happened>,
    /// Asked whether to end.
    is_to_end: Box<dyn Fn() -> bool + Send + 'a>,
    is_explaining: bool,
    /// Where a plan will be needed if what is late does not end, as the planner was told.
    foreseen: Option<Foreseen>,
    /// What was believed before the first event of the history.
    beginning: Progression,
    /// Told what is believed, whenever something was taken in.
    listener: Box<dyn FnMut(&Progression) + Send + 'a>,
    /// What a run needs that goes on when its goal is reached.
    lasting: Option<Lasting<'a>>,
    /// The tasks before the executor is asked again; the next one is last.
    agenda: Vec<Todo>,
    /// The question that has not been answered.
    asked: Option<Next>,
    /// Requests for the driver without an awaited answer.
    outbox: VecDeque<Next>,
    /// Number of requests for plans and prepared plans so far.
    requests: u64,
    /// Continuation at the answer for which the run waits.
    pending: Option<Pending>,
    /// The plan that is made beside the run.
    search: Option<Search>,
    /// The task with the goals that the present plan is for, while plans are made beside the run.
    plan_task: Option<Arc<Task>>,
    /// What became of earlier searches, while plans are made beside the run.
    lost: Lost,
    /// What the world has refused since anything else has happened.
    refusals: Refusals,
    /// How the run ends, while what is running is told to stop.
    closing: Option<Closing>,
    /// The report, once the run is over.
    report: Option<Report>,
    /// How often it goes on after it was over.
    reopenings: usize,
}

/// Why the plan is not gone on with.
enum Stop {
    Over(Verdict),
    World(WorldError),
}

/// Executes a plan in a world, or, without a plan, first makes one.
///
/// Always returns if the ports do: the run has an end ([`RunSettings::time_limit`]), and a world
/// whose clock does not come forward to it is broken ([`Verdict::WorldFailed`]).
pub fn run(
    task: Arc<Task>,
    first: Option<&TimeTriggeredPlan>,
    settings: &RunSettings,
    ports: Ports<'_>,
    workers: &mut dyn Workers,
    world: &mut dyn World,
) -> Report {
    Run::new(task, first.cloned(), settings.clone(), ports).go(world, workers)
}

impl<'a> Run<'a> {
    /// A run that has not begun, of this plan; without one, a plan is made first.
    pub fn new(
        task: Arc<Task>,
        first: Option<TimeTriggeredPlan>,
        settings: RunSettings,
        ports: Ports<'a>,
    ) -> Self {
        let allowance = match &settings.planning_time {
            PlanningTime::Seconds(seconds) => seconds.clone(),
            PlanningTime::Measured => Rational::ZERO,
        };
        let belief = Progression::new(Arc::clone(&task));
        Self {
            beginning: belief.clone(),
            listener: Box::new(|_| {}),
            lasting: None,
            foreseen: None,
            belief,
            account: Account::default(),
            steps: 0,
            task,
            ports,
            settings,
            now: Rational::ZERO,
            progress: Progress::default(),
            news: Vec::new(),
            replans: 0,
            reasons: Vec::new(),
            allowance,
            planned_for: None,
            history: Vec::new(),
            is_to_end: Box::new(|| false),
            is_explaining: false,
            agenda: vec![Todo::Begin(first)],
            asked: None,
            outbox: VecDeque::new(),
            requests: 0,
            pending: None,
            search: None,
            plan_task: None,
            lost: Lost::default(),
            refusals: Refusals::default(),
            closing: None,
            report: None,
            reopenings: 0,
        }
    }

    /// The same run, which ends in order as soon as `is_to_end` says so: what runs is cancelled,
    /// and there is a whole report. It is asked before each decision, and after each answer of the
    /// world and of the planner.
    #[must_use]
    pub fn ending_when(mut self, is_to_end: impl Fn() -> bool + Send + 'a) -> Self {
        self.is_to_end = Box::new(is_to_end);
        self
    }

    /// The same run, which says, where no plan reaches the goal any more, what can never become
    /// true again and since when ([`Report::dead_end`]). That takes some grounding by reachability,
    /// each about as long as the embedded planner's.
    #[must_use]
    pub fn explaining(mut self) -> Self {
        self.is_explaining = true;
        self
    }

    /// The same run, which tells `listener` what it believes, at its beginning and whenever it has
    /// taken in what the world reported. Decisions wait for that.
    #[must_use]
    pub fn told_to(mut self, mut listener: impl FnMut(&Progression) + Send + 'a) -> Self {
        listener(&self.belief);
        self.listener = Box::new(listener);
        self
    }

    fn decide(&mut self) -> Decided {
        work::spend(DECISION_WORK + STEP_WORK.saturating_mul(self.steps as u64));
        let news = std::mem::take(&mut self.news);
        let as_planned = self.belief_of_the_plan();
        let decided = self.ports.executor.decide(&Moment {
            now: &self.now,
            news: &news,
            belief: as_planned.as_ref().unwrap_or(&self.belief),
        });
        self.ports.recorder.record(&Entry::Decided {
            now: &self.now,
            decided: &decided,
        });
        decided
    }

    /// One decision; what follows from it goes onto the agenda.
    fn decide_and_follow(&mut self) -> Result<(), Stop> {
        self.heed()?;
        self.close_momentary_goals();
        self.close_achieved_goals();
        if self.tend_search()? || self.attend()? {
            return Ok(());
        }
        let decided = self.decide();
        let is_hindered = match &decided.decision {
            Decision::Start(orders) => !self.may_start(orders),
            decision => *decision == Decision::GoalReached,
        };
        if is_hindered {
            self.give_up_optional_search();
        }
        match decided.decision {
            // What is begun now, the plan that is being made ready could not go on with.
            Decision::Start(orders) if !self.may_start(&orders) => self.let_go_of_plan(),
            Decision::Start(orders) => {
                // What starts at once is told at once, and must be known before anything else is
                // decided.
                self.agenda.push(Todo::Pass(self.now.clone()));
                self.start(orders);
            }
            Decision::Cancel(steps) => {
                let tickets = steps.iter();
                let tickets = tickets.filter_map(|step| self.account.ticket(*step));
                self.cancel(tickets.collect());
            }
            Decision::Wait { .. } if self.seek_better_plan() => {}
            Decision::Wait { until } => self.wait(until)?,
            Decision::Replan => {
                self.give_up_search();
                self.note_abandoned(&decided.reason);
                self.replan(&decided.reason)?;
            }
            // The plan has done what it was made for, and another one is in the making.
            Decision::GoalReached if self.search.is_some() => self.let_go_of_plan(),
            Decision::GoalReached => match self.belief.outlook() {
                Outlook::Awaited(time) => self.wait(Some(self.moment_until(time)))?,
                Outlook::Reached | Outlook::Unmet => self.goal_reached(),
            },
        }
        Ok(())
    }

    /// Records that actions start; the world is told before anything else is done.
    fn start(&mut self, orders: Vec<Order>) {
        let mut commands = Vec::with_capacity(orders.len());
        for order in orders {
            let ticket = self.account.open(&order, &self.now);
            let planned = order.duration.clone().unwrap_or_default();
            let timeout = self.settings.timeout.of(&order.action.name, &planned);
            let command = Command::Start {
                ticket,
                action: order.action,
                duration: order.duration,
            };
            self.ports.recorder.record(&Entry::Command {
                now: &self.now,
                command: &command,
                planned: &order.planned,
                timeout: timeout.as_ref(),
            });
            commands.push(command);
        }
        self.send(commands);
    }

    /// The same for actions that are cancelled.
    pub(crate) fn cancel(&mut self, tickets: Vec<Ticket>) {
        let mut commands = Vec::with_capacity(tickets.len());
        for ticket in tickets {
            let command = Command::Cancel { ticket };
            self.ports.recorder.record(&Entry::Command {
                now: &self.now,
                command: &command,
                planned: &Planned::default(),
                timeout: None,
            });
            self.account.note_cancel(ticket, &self.now);
            commands.push(command);
        }
        self.send(commands);
    }

    /// Has the world told these, which are on record.
    fn send(&mut self, commands: Vec<Command>) {
        self.ports.recorder.commit();
        self.agenda
            .extend(commands.into_iter().rev().map(Todo::Send));
    }

    /// Waits until the executor's next decision time, or until a warning or a time-out is due.
    fn wait(&mut self, until: Option<Rational>) -> Result<(), Stop> {
        let timeout = self.next_timeout();
        // More of what happens now may still come in; if not, some condition has failed.
        let breaking = self.belief.is_breaking();
        let breaking = breaking.then(|| &self.now + self.task.epsilon());
        let warning = self.warn();
        let doubt = self.tend_foresight();
        let until = until.into_iter().chain(timeout).chain(breaking);
        let taking_over = self.next_of_search();
        let until = until.chain(warning).chain(doubt).chain(taking_over).min();
        let Some(until) = until.map(|until| until.max(self.now.clone())) else {
            // Nothing is running, nothing is due, and the plan is not done.
            return self.replan(&Reason::new(Cause::Late).about(About::Nothing));
        };
        self.agenda.push(Todo::CheckTimeouts);
        self.agenda.push(Todo::Pass(until));
        Ok(())
    }

    /// The executor takes the goal for reached. The world may look; then it is, or it is not.
    fn goal_reached(&mut self) {
        let task = self.belief.task();
        let mut footprint = Footprint::of_condition(task, task.goal());
        self.asked = Some(Next::Look {
            facts: std::mem::take(&mut footprint.reads).into_iter().collect(),
            fluents: footprint.reads_fluents.into_iter().collect(),
        });
    }

    fn is_goal_certain(&self) -> bool {
        self.needs_no_plan() == Some(Outlook::Reached)
    }

    /// Whether the goal is reached, or will be, without any more doing.
    fn needs_no_plan(&self) -> Option<Outlook> {
        let is_idle = self.account.open_tickets().next().is_none();
        let outlook = is_idle.then(|| self.belief.outlook());
        outlook.filter(|outlook| *outlook != Outlook::Unmet)
    }

    /// Returns the next time at which timed initials may achieve a goal, which is `time` if all goals are to stay true: one
    /// with a deadline may hold for a moment before.
    fn moment_until(&self, time: Rational) -> Rational {
        let next = self.belief.next_timed().cloned();
        let next = next.filter(|_| self.next_deadline_of_a_goal().is_some());
        next.unwrap_or(time)
    }

    /// What to do instead of planning, if no plan is needed: take the goal for reached, or wait for
    /// the timed initials that it depends on, and ask again.
    fn go_without_plan(&mut self, reason: &Reason) -> bool {
        match self.needs_no_plan() {
            None | Some(Outlook::Unmet) => return false,
            Some(Outlook::Reached) => self.goal_reached(),
            Some(Outlook::Awaited(time)) => {
                let until = self.moment_until(time);
                self.agenda.push(Todo::Replan(reason.clone()));
                self.agenda.push(Todo::Pass(until));
            }
        }
        self.news.clear();
        true
    }

    /// Plans from here; see [`RunningRule`] for what becomes of what is running.
    fn replan(&mut self, reason: &Reason) -> Result<(), Stop> {
        // What deviated may have been the last thing to do.
        if self.go_without_plan(reason) || self.has_patience(reason) {
            return Ok(());
        }
        if reason.cause != Cause::NewPlan {
            self.reasons.push(reason.clone());
            self.replans += 1;
            if self.replans > self.settings.most_replans {
                self.replans -= 1;
                let overdue = self.longer_than_planned();
                if overdue.is_empty() || self.settings.most_replans == 0 {
                    return self.carry_on_or_stop(Verdict::ReplanLimit);
                }
                // Their ends may reach the goal.
                self.reasons.pop();
                self.agenda.push(Todo::Replan(reason.clone()));
                let doubts = self.belief.doubt_count();
                self.agenda.push(Todo::Linger(overdue, doubts));
                return Ok(());
            }
        }
        self.lost.plan = true;
        self.agenda.push(Todo::Plan(reason.clone()));
        if self.replans == self.settings.most_replans {
            // The last plan is not spent on expecting overdue actions to take longer still.
            let overdue = self.longer_than_planned();
            let doubts = self.belief.doubt_count();
            self.agenda.push(Todo::Linger(overdue, doubts));
        }
        self.settle();
        Ok(())
    }
}
