//! A run: a plan is executed in a world, watched, and replaced when it no longer works.
//!
//! [`Run::go`] is the whole loop. What happens when reports are wrong is defined here, so that no
//! executor needs to know:
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
//! | a report that cannot be understood, or names what the problem does not have | nothing; the record has it |
//! | answers without end while the clock stands still, or creeps | the world is broken ([`Verdict::WorldFailed`]) |
//! | no report at all | when the action should have ended [`Patience`] ago, and the plan does not allow it to run any longer, it is given up: it is cancelled and counts as failed |
//! | a fact or value other than believed | believed; the executor is told, and plays the rest of its plan through |
//!
//! However a run ends, nothing is left running: what has not ended is cancelled, and has
//! [`FAREWELL`] to stop. Only a world that has failed is told nothing more.
//!
//! The goal is not taken as reached while anything is under way or in doubt, and not before the
//! world has had a chance to look ([`World::look`]).

mod account;
mod dead_end;
mod farewell;
mod handover;
mod intake;
mod progress;
mod settings;

use std::sync::Arc;

use elbowroom_model::{Footprint, Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

pub use account::{Account, ExecutedStep};
pub use farewell::FAREWELL;
pub use settings::{Patience, PlanningTime, Report, RunSettings, RunningRule, Verdict};

use crate::event::{Command, Ticket};
use crate::executor::{Decided, Decision, Executor, Mission, Moment, News, Order, StepId};
use crate::planning::Planner;
use crate::preparation::{Need, Preparer};
use crate::progression::Progression;
use crate::reason::{Cause, Reason};
use crate::record::{Entry, Recorder};
use crate::world::{Passage, World, WorldError};
use dead_end::Happened;
use progress::Progress;

/// What a run needs.
pub struct Ports<'a> {
    /// Where it happens.
    pub world: &'a mut dyn World,
    /// Where plans come from.
    pub planner: &'a mut dyn Planner,
    /// What makes them ready.
    pub preparer: &'a mut dyn Preparer,
    /// Who decides.
    pub executor: &'a mut dyn Executor,
    /// What the executor needs to know of a plan.
    pub need: Need,
    /// Who takes the record.
    pub recorder: &'a mut dyn Recorder,
}

/// A plan being executed.
pub struct Run<'a> {
    task: Arc<Task>,
    ports: Ports<'a>,
    settings: &'a RunSettings,
    now: Rational,
    progress: Progress,
    belief: Progression,
    /// What was started, and what became of it.
    account: Account,
    /// How many steps the present plan has.
    steps: usize,
    news: Vec<News>,
    replans: usize,
    reasons: Vec<Reason>,
    /// How long making a plan is expected to take.
    allowance: Rational,
    /// What was observed and believed, in order.
    history: Vec<Happened>,
    /// Asked whether to end.
    is_to_end: Option<&'a dyn Fn() -> bool>,
    is_explaining: bool,
}

/// Why the loop is left.
enum Stop {
    Over(Verdict),
    World(WorldError),
}

impl From<WorldError> for Stop {
    fn from(error: WorldError) -> Self {
        Self::World(error)
    }
}

/// Executes a plan, or, without one, first makes one.
///
/// Always returns if the ports do: the run has an end ([`RunSettings::time_limit`]), and a world
/// whose clock does not come forward to it is broken ([`Verdict::WorldFailed`]).
pub fn run<'a>(
    task: Arc<Task>,
    first: Option<&TimeTriggeredPlan>,
    settings: &'a RunSettings,
    ports: Ports<'a>,
) -> Report {
    Run::new(task, settings, ports).go(first)
}

impl<'a> Run<'a> {
    /// A run that has not begun.
    pub fn new(task: Arc<Task>, settings: &'a RunSettings, ports: Ports<'a>) -> Self {
        let allowance = match &settings.planning_time {
            PlanningTime::Seconds(seconds) => seconds.clone(),
            PlanningTime::Measured => Rational::ZERO,
        };
        Self {
            belief: Progression::new(Arc::clone(&task)),
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
            history: Vec::new(),
            is_to_end: None,
            is_explaining: false,
        }
    }

    /// The same run, which ends in order as soon as `is_to_end` says so: what runs is cancelled, and
    /// there is a whole report. It is asked before each decision, and after each answer of the world
    /// and of the planner.
    #[must_use]
    pub fn ending_when(mut self, is_to_end: &'a dyn Fn() -> bool) -> Self {
        self.is_to_end = Some(is_to_end);
        self
    }

    /// The same run, which says, where no plan reaches the goal any more, what can never become true
    /// again and since when ([`Report::dead_end`]). That takes some grounding by reachability, each
    /// about as long as the embedded planner's.
    #[must_use]
    pub fn explaining(mut self) -> Self {
        self.is_explaining = true;
        self
    }

    /// The whole loop: take up a plan, decide, wait, take in what was observed; replan when the
    /// executor gives the plan up.
    pub fn go(mut self, first: Option<&TimeTriggeredPlan>) -> Report {
        let begun = match first {
            Some(plan) => self.take_up(plan, &Situation::initial(&self.task), &[]),
            None => self.replan(&Reason::new(Cause::NewPlan)),
        };
        let mut outcome = begun;
        while outcome.is_ok() {
            outcome = self.step();
        }
        let verdict = match outcome {
            Err(Stop::Over(verdict)) => verdict,
            Err(Stop::World(error)) => Verdict::WorldFailed { why: error.message },
            Ok(()) => unreachable!("the loop ends with an error"),
        };
        let dead_end = match verdict {
            Verdict::Unsolvable if self.is_explaining => self.dead_end(),
            _ => Vec::new(),
        };
        if !matches!(verdict, Verdict::WorldFailed { .. }) {
            self.leave_nothing_running();
        }
        let report = Report {
            verdict,
            time: self.now.clone(),
            replans: self.replans,
            reasons: std::mem::take(&mut self.reasons),
            dead_end,
            starts: self.account.started(),
            executed: self.account.executed(&self.now),
        };
        self.ports.recorder.record(&Entry::Over(&report));
        report
    }

    /// One decision, and what follows from it.
    fn step(&mut self) -> Result<(), Stop> {
        self.heed()?;
        let decided = self.decide();
        match decided.decision {
            Decision::Start(orders) => self.start(orders),
            Decision::Cancel(steps) => {
                let tickets: Vec<_> = steps
                    .iter()
                    .filter_map(|step| self.account.ticket(*step))
                    .collect();
                tickets
                    .into_iter()
                    .try_for_each(|ticket| self.cancel(ticket))
            }
            Decision::Wait { until } => self.wait(until),
            Decision::Replan => self.replan(&decided.reason),
            Decision::GoalReached => self.goal_reached(),
        }
    }

    fn decide(&mut self) -> Decided {
        let news = std::mem::take(&mut self.news);
        let decided = self.ports.executor.decide(&Moment {
            now: &self.now,
            news: &news,
            belief: &self.belief,
        });
        self.ports.recorder.record(&Entry::Decided {
            now: &self.now,
            decided: &decided,
        });
        decided
    }

    fn start(&mut self, orders: Vec<Order>) -> Result<(), Stop> {
        for order in orders {
            let ticket = self.account.open(&order, &self.now);
            let command = Command::Start {
                ticket,
                action: order.action,
                duration: order.duration,
            };
            self.ports.recorder.record(&Entry::Command {
                now: &self.now,
                command: &command,
                planned: &order.planned,
            });
            self.ports.world.command(&self.now, &command)?;
        }
        // What starts at once is told at once, and must be known before anything else is decided.
        let now = self.now.clone();
        self.pass(&now)
    }

    fn cancel(&mut self, ticket: Ticket) -> Result<(), Stop> {
        let command = Command::Cancel { ticket };
        self.ports.recorder.record(&Entry::Command {
            now: &self.now,
            command: &command,
            planned: &crate::executor::Planned::default(),
        });
        self.account.note_cancel(ticket, &self.now);
        self.ports.world.command(&self.now, &command)?;
        Ok(())
    }

    /// Waits until the executor wants to be asked again, or somebody's patience ends.
    fn wait(&mut self, until: Option<Rational>) -> Result<(), Stop> {
        let silence = self.next_silence();
        // More of what happens now may still come in; if not, some condition has failed.
        let breaking =
            (!self.belief.breaking().is_empty()).then(|| &self.now + &self.settings.epsilon);
        let until = until.into_iter().chain(silence).chain(breaking).min();
        let Some(until) = until.map(|until| until.max(self.now.clone())) else {
            // Nothing is running, nothing is due, and the plan is not done.
            return self.replan(&Reason::new(Cause::Late).about("the plan waits for nothing"));
        };
        self.pass(&until)?;
        self.give_up_the_silent()
    }

    /// Lets time pass and takes in what is observed.
    fn pass(&mut self, until: &Rational) -> Result<(), Stop> {
        let until = until.min(&self.settings.time_limit);
        let until = until.clone();
        let passage = self.ports.world.wait(&until)?;
        self.take_up_passage(&until, passage);
        self.heed()?;
        if self.now >= self.settings.time_limit {
            return Err(Stop::Over(Verdict::TimeLimit));
        }
        let moves_on = self.progress.note(&self.now, self.steps);
        moves_on.map_err(|why| Stop::World(WorldError::new(why)))
    }

    /// Takes in an answer of the world.
    fn take_up_passage(&mut self, until: &Rational, passage: Passage) {
        self.know_what_the_world_mentions();
        self.ports.recorder.record(&Entry::Passed {
            until,
            now: &passage.now,
            observations: &passage.observations,
        });
        self.now = passage.now.max(self.now.clone());
        self.take_in(passage.observations);
    }

    /// A fact that no plan has mentioned may still matter to the next one.
    fn know_what_the_world_mentions(&mut self) {
        if let Some(task) = self.ports.world.grown() {
            self.know(task);
        }
    }

    /// The table of facts and fluents has grown.
    fn know(&mut self, task: Arc<Task>) {
        self.task = task;
        self.belief.know(Arc::clone(&self.task));
        self.ports.recorder.know(&self.task);
    }

    /// The executor takes the goal for reached. The world may look; then it is, or it is not.
    fn goal_reached(&mut self) -> Result<(), Stop> {
        let now = self.now.clone();
        let mut footprint = Footprint::of_condition(&self.task, self.task.goal());
        let facts: Vec<_> = std::mem::take(&mut footprint.reads).into_iter().collect();
        let fluents: Vec<_> = footprint.reads_fluents.into_iter().collect();
        let observations = self.ports.world.look(&facts, &fluents)?;
        self.know_what_the_world_mentions();
        self.ports.recorder.record(&Entry::Looked {
            now: &now,
            observations: &observations,
        });
        self.take_in(observations);
        self.heed()?;
        if self.is_goal_certain() {
            return Err(Stop::Over(Verdict::GoalReached));
        }
        self.news.clear();
        self.replan(&Reason::new(Cause::Surprise).about("what the world looks like at the end"))
    }

    fn is_goal_certain(&self) -> bool {
        self.belief.is_goal() == Ok(true) && self.account.open_tickets().next().is_none()
    }

    /// Plans from here; see [`RunningRule`] for what becomes of what is running.
    fn replan(&mut self, reason: &Reason) -> Result<(), Stop> {
        // What deviated may have been the last thing to do.
        if self.is_goal_certain() {
            self.news.clear();
            return self.goal_reached();
        }
        if reason.cause != Cause::NewPlan {
            self.reasons.push(reason.clone());
            self.replans += 1;
            if self.replans > self.settings.most_replans {
                self.replans -= 1;
                return Err(Stop::Over(Verdict::ReplanLimit));
            }
        }
        self.settle()?;
        self.plan_from_here(reason)
    }

    /// Makes a plan ready and begins with it. `running` are the tickets of what the situation has
    /// running.
    fn take_up(
        &mut self,
        plan: &TimeTriggeredPlan,
        situation: &Situation,
        running: &[Ticket],
    ) -> Result<(), Stop> {
        let prepared = self.prepare(plan, situation, running);
        let mission = match prepared {
            Ok(mission) => mission,
            Err(why) => return Err(Stop::Over(Verdict::NoPlan { why })),
        };
        self.account.begin_plan(&mission.running);
        self.steps = mission.time_triggered.steps.len();
        self.progress.begin_plan();
        self.news.clear();
        self.ports.recorder.record(&Entry::Mission(&mission));
        if let Err(reason) = self.ports.executor.adopt(&mission) {
            return self.replan(&reason);
        }
        // What has ended while the plan was made, the plan still waits for.
        for (step, ticket) in &mission.running {
            let ended = self
                .account
                .get(*ticket)
                .and_then(|entry| entry.ended.clone());
            if let Some((time, ending)) = ended {
                self.news.push(News::Ended {
                    step: *step,
                    time,
                    ending,
                    measured: Vec::new(),
                });
            }
        }
        Ok(())
    }

    fn prepare(
        &mut self,
        plan: &TimeTriggeredPlan,
        situation: &Situation,
        running: &[Ticket],
    ) -> Result<Mission, String> {
        let task = Arc::new(situation.rest_of_task(&self.task));
        let plan = situation.rest_of_plan(plan);
        let prepared = self.ports.preparer.prepare(&task, &plan, self.ports.need)?;
        Ok(Mission {
            task,
            origin: situation.time.clone(),
            now: self.now.clone(),
            time_triggered: plan,
            plan: prepared.plan,
            nominal: prepared.nominal,
            envelope: prepared.envelope,
            running: (0..).map(StepId).zip(running.iter().copied()).collect(),
            epsilon: self.settings.epsilon.clone(),
        })
    }
}
