//! In place of `PlanSys2`'s planner and executor: plans for who asks, and executes one plan at a time.

mod order;
mod planning;

use std::io::Write as _;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use elbowroom_plansys2::interface::{
    Feedback, GoalId, GoalRequest, GoalResponse, Plan, PlanRequest, PlanResponse, StateResponse,
    Success, ValidateResponse,
};
use elbowroom_plansys2::message::Stamp;
use elbowroom_plansys2::{
    Command, Effect, Goals, Hub, Lifecycle, Progress, Ticket, World, plan_text,
};

use super::command::{Planned, Running};
use super::expert::Expert;
use super::network::Asker;
use super::options::{ServeSettings, Settings};
use super::services::{Asked, EXECUTOR, NODES, Part, Services};
use super::session::now;
use super::topics::Topics;
use super::{Input, remark};
use order::Order;

/// How often the hub looks whether somebody is lost.
const TICK: Duration = Duration::from_millis(200);
/// How often it is told how a plan stands, at least.
const TELL_EVERY: Duration = Duration::from_secs(1);
/// How long a run may take to end when it was asked to.
const FAREWELL: Duration = Duration::from_secs(8);
/// How long the result of a run waits until the problem expert knows what the run has changed last.
const TOLD_WITHIN: Duration = Duration::from_secs(2);
/// Tickets of one run differ from those of another in these bits: the hub may still wait for what an earlier run has
/// cancelled.
const RUN_BITS: u32 = 32;

/// A plan that is being executed.
struct Execution {
    goal: GoalId,
    run: Running,
    number: u64,
    world: World,
    /// As the client has given it.
    plan: Plan,
    progress: Progress,
    answers: Option<UnixStream>,
    told: Option<Instant>,
    order: Order,
    /// Whether it has said all that it will say.
    is_silent: bool,
    /// Since when it is over, and with which exit code.
    ended: Option<(Instant, Option<i32>)>,
}

/// With whom it speaks.
pub(super) struct Sides {
    pub(super) topics: Topics,
    pub(super) services: Services,
    pub(super) expert: Option<Expert>,
}

/// The server.
pub(super) struct Serving {
    settings: ServeSettings,
    speed: f64,
    topics: Topics,
    services: Services,
    expert: Option<Expert>,
    inputs: Sender<Input>,
    hub: Hub,
    nodes: [Lifecycle; NODES.len()],
    goals: Goals<Asker>,
    /// What was last planned for.
    texts: Option<PlanRequest>,
    planned: Option<Planned>,
    execution: Option<Execution>,
    runs: u64,
    /// How many plans are being made.
    planning: usize,
    is_over: Arc<AtomicBool>,
    zero: Instant,
}

impl Serving {
    pub(super) fn new(
        settings: &Settings,
        serving: ServeSettings,
        sides: Sides,
        inputs: Sender<Input>,
    ) -> Self {
        let Sides {
            topics,
            services,
            expert,
        } = sides;
        Self {
            settings: serving,
            speed: settings.speed,
            topics,
            services,
            expert,
            inputs,
            hub: Hub::new("elbowroom"),
            nodes: [Lifecycle::default(); NODES.len()],
            goals: Goals::default(),
            texts: None,
            planned: None,
            execution: None,
            runs: 0,
            planning: 0,
            is_over: Arc::default(),
            zero: now(),
        }
    }

    /// Until the user asks it to end.
    pub(super) fn run(mut self, received: &Receiver<Input>) {
        remark("serves planner/get_plan and execute_plan");
        let mut leaves: Option<Duration> = None;
        loop {
            let due = self
                .execution
                .as_ref()
                .and_then(|it| it.world.due_in(self.now()));
            // The sender is kept, so that only time can run out.
            if let Ok(input) = received.recv_timeout(due.map_or(TICK, |it| it.min(TICK))) {
                if matches!(input, Input::End) {
                    leaves.get_or_insert(self.now());
                    self.interrupt();
                } else {
                    self.take(input);
                }
            }
            self.hub.tick(self.now());
            told(self.services.flush());
            self.settle();
            let patience = leaves.map(|at| self.now().saturating_sub(at) >= FAREWELL);
            if patience.is_some_and(|is_over| is_over || self.execution.is_none()) {
                // What was told to stop is to hear of it, planners too.
                self.is_over.store(true, Ordering::Relaxed);
                thread::sleep(TICK);
                return;
            }
        }
    }

    fn take(&mut self, input: Input) {
        let now = self.now();
        match input {
            Input::Hub(message) => self.hub.message(&message, now),
            Input::Status(status) => self.hub.status(&status, now),
            Input::Trouble(text) => remark(&text),
            Input::Line(line) => self.hear(&line, now),
            Input::Talks(stream) => {
                if let Some(execution) = &mut self.execution {
                    execution.answers = Some(stream);
                }
            }
            Input::Asked(asked) => self.answer(*asked),
            Input::Planned(who, texts, planned) => self.has_planned(who, texts, planned),
            Input::Validated(who, outcome) => {
                self.planning -= 1;
                let (success, error_info) = (outcome.is_ok(), outcome.err().unwrap_or_default());
                told(self.services.validate.answer(
                    who,
                    ValidateResponse {
                        success,
                        error_info,
                    },
                ));
            }
            Input::Over(code) => self.over(code),
            Input::Ordered(number, order) => self.ordered(number, order),
            Input::Expert(heard) => {
                if let Some(expert) = &mut self.expert {
                    expert.hear(heard);
                }
            }
            Input::Closed => {
                if let Some(execution) = &mut self.execution {
                    execution.is_silent = true;
                }
            }
            Input::End => {}
        }
    }

    /// A line of the run.
    fn hear(&mut self, line: &str, now: Duration) {
        let Some(execution) = &mut self.execution else {
            return;
        };
        let mut said = Vec::new();
        let command = execution.world.hear(line, now, &mut said);
        say(execution, &said);
        match command {
            Ok(Some(Command::Begin(mut action))) => {
                execution.progress.begin(&action);
                action.ticket |= execution.number << RUN_BITS;
                self.hub.begin(action, now);
            }
            Ok(Some(Command::Cancel(ticket))) => {
                self.hub.cancel(ticket | (execution.number << RUN_BITS));
            }
            Ok(Some(Command::Believe { facts, values })) => {
                if let Some(expert) = &mut self.expert {
                    expert.believe(&facts, &values);
                }
            }
            Ok(Some(Command::Stop) | None) => {}
            Err(error) => remark(&format!("not understood: {line}: {error}")),
        }
    }

    fn answer(&mut self, asked: Asked) {
        let sent = match asked {
            Asked::Plan(who, texts) => return self.plan(who, texts),
            Asked::Executed(part, who) => {
                let response = self.executed(part);
                match part {
                    Part::Whole => self.services.executed.answer(who, response),
                    Part::Rest => self.services.rest.answer(who, response),
                }
            }
            Asked::Order(who) => return self.tell_order(who),
            Asked::Validate(who, request) => return self.validate(who, request.domain),
            Asked::Goal(who, request) => {
                let stamp = stamp();
                let accepted = match self.begin(&request, stamp) {
                    Ok(()) => true,
                    Err(why) => {
                        remark(&format!("a plan is not executed: {why}"));
                        false
                    }
                };
                let sent = self
                    .services
                    .goal
                    .answer(who, GoalResponse { accepted, stamp });
                sent.and_then(|()| self.services.statuses.say(self.goals.statuses()))
            }
            Asked::Cancel(who, request) => {
                let (is_given_up, response) = self.goals.cancel(&request);
                if is_given_up {
                    self.interrupt();
                }
                let sent = self.services.cancel.answer(who, response);
                sent.and_then(|()| self.services.statuses.say(self.goals.statuses()))
            }
            Asked::Result(who, request) => match self.goals.ask(request.goal_id, who) {
                Some((who, result)) => self.services.result.answer(who, result),
                None => Ok(()),
            },
            Asked::State(node, who) => {
                let current_state = self.nodes[node].state();
                self.services.state[node].answer(who, StateResponse { current_state })
            }
            Asked::Change(node, who, request) => {
                let success = self.nodes[node].change(&request.transition);
                if !self.nodes[EXECUTOR].serves() {
                    self.interrupt();
                }
                self.services.change[node].answer(who, Success { success })
            }
        };
        told(sent);
    }

    /// The plan that is being executed, or what is left of it.
    fn executed(&self, part: Part) -> PlanResponse {
        let Some(execution) = &self.execution else {
            return PlanResponse {
                success: false,
                plan: Plan::default(),
                error_info: "no plan is being executed".to_owned(),
            };
        };
        PlanResponse {
            success: true,
            plan: match part {
                Part::Whole => execution.plan.clone(),
                Part::Rest => execution.progress.rest_of(&execution.plan),
            },
            error_info: String::new(),
        }
    }

    /// Begins to execute a plan.
    fn begin(&mut self, request: &GoalRequest, stamp: Stamp) -> Result<(), String> {
        if !self.nodes[EXECUTOR].serves() {
            return Err("the executor is not active".to_owned());
        }
        if self.goals.open().is_some() {
            return Err("another one is being executed".to_owned());
        }
        let Some(texts) = &self.texts else {
            return Err(
                "its domain and problem are not known: ask planner/get_plan for a plan first"
                    .to_owned(),
            );
        };
        let known = self.planned.as_ref().filter(|it| it.plan == request.plan);
        let text = known.map_or_else(|| plan_text(&request.plan), |it| it.text.clone());
        let ServeSettings {
            elbowroom,
            executor,
            ..
        } = &self.settings;
        let run = Running::start(elbowroom, executor, texts, &text, &self.inputs)?;
        let problem = texts.problem.clone();
        if !self.goals.accept(request.goal_id, stamp) {
            run.interrupt();
            return Err("there was a goal of that number".to_owned());
        }
        told(self.services.executing.say(request.plan.clone()));
        self.runs += 1;
        let mut world = World::new("plansys2", self.speed);
        if let Some(expert) = &mut self.expert {
            expert.begin(&problem);
            world = world.following();
        }
        self.execution = Some(Execution {
            goal: request.goal_id,
            run,
            number: self.runs,
            world,
            plan: request.plan.clone(),
            progress: Progress::new(&request.plan),
            answers: None,
            told: None,
            order: Order::default(),
            is_silent: false,
            ended: None,
        });
        self.find_order(text);
        Ok(())
    }

    /// The run is to end in order.
    fn interrupt(&self) {
        let running = self.execution.as_ref().filter(|it| it.ended.is_none());
        if let Some(execution) = running {
            execution.run.interrupt();
        }
    }

    fn over(&mut self, code: Option<i32>) {
        let Some(execution) = &mut self.execution else {
            return;
        };
        execution.ended = Some((super::session::now(), code));
        // What a run that has died has left running is to stop.
        for ticket in execution.world.running() {
            self.hub.cancel(ticket | (execution.number << RUN_BITS));
        }
    }

    /// Tells the result of a run that is over, once the problem expert knows what it has changed.
    fn conclude(&mut self) {
        let is_told = self.expert.as_ref().is_none_or(Expert::is_idle);
        let is_due = |it: &mut Execution| {
            it.ended.is_some_and(|(since, _)| {
                (it.is_silent && is_told)
                    || super::session::now().saturating_duration_since(since) >= TOLD_WITHIN
            })
        };
        let Some(execution) = self.execution.take_if(is_due) else {
            return;
        };
        if let Some(expert) = &mut self.expert {
            expert.end();
        }
        for who in execution.order.asked {
            self.refuse_order(who, "the run is over");
        }
        let is_reached = execution.ended.is_some_and(|(_, code)| code == Some(0));
        let infos = execution.progress.infos().to_vec();
        for (who, result) in self.goals.end(is_reached, infos) {
            told(self.services.result.answer(who, result));
        }
        told(self.services.statuses.say(self.goals.statuses()));
    }

    /// Does what the hub has decided, and answers the run if that is due.
    fn settle(&mut self) {
        let now = self.now();
        for effect in self.hub.effects() {
            match effect {
                Effect::Send(message) => told(self.topics.send(message)),
                Effect::Tell(ticket, what) => {
                    // What comes of an earlier run counts no more.
                    let (number, ticket): (u64, Ticket) =
                        (ticket >> RUN_BITS, ticket & ((1 << RUN_BITS) - 1));
                    if let Some(execution) =
                        self.execution.as_mut().filter(|it| it.number == number)
                    {
                        execution.world.tell(ticket, &what, now);
                        execution.progress.tell(ticket, &what, stamp());
                        execution.told = None;
                    }
                }
                Effect::Remark(text) => remark(&text),
            }
        }
        let seen = self.expert.as_mut().map(|it| it.settle(now));
        self.conclude();
        let Some(execution) = &mut self.execution else {
            return;
        };
        for seen in seen.iter().flatten() {
            execution.world.see(seen, now);
        }
        let lines = execution.world.answer(now);
        say(execution, &lines);
        let clock = super::session::now();
        if execution
            .told
            .is_none_or(|at| clock.saturating_duration_since(at) >= TELL_EVERY)
        {
            execution.told = Some(clock);
            let action_execution_status = execution.progress.infos().to_vec();
            for info in &action_execution_status {
                told(self.services.infos.say(info.clone()));
            }
            let goal_id = execution.goal;
            told(self.services.feedback.say(Feedback {
                goal_id,
                action_execution_status,
            }));
        }
    }

    fn now(&self) -> Duration {
        now().saturating_duration_since(self.zero)
    }
}

/// Says it to the run.
fn say(execution: &mut Execution, lines: &[String]) {
    if let Some(stream) = &mut execution.answers {
        for line in lines {
            // That it is gone is said by its end.
            let _ = writeln!(stream, "{line}");
        }
    }
}

fn told(sent: Result<(), String>) {
    if let Err(why) = sent {
        remark(&why);
    }
}

/// What time it is, for people and other nodes.
#[allow(
    clippy::disallowed_methods,
    reason = "messages of ROS carry the time of day"
)]
fn stamp() -> Stamp {
    let since = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .unwrap_or_default();
    Stamp {
        sec: i32::try_from(since.as_secs()).unwrap_or(i32::MAX),
        nanosec: since.subsec_nanos(),
    }
}
