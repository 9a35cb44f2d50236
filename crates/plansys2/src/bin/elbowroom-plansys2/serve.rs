//! Replacement of `PlanSys2`'s planner and executor. It answers planning requests, and executes one
//! plan at a time.

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
    ActionHandle, Command, Effect, Goals, Hub, Lifecycle, Progress, World, plan_text,
};

use super::clock::now;
use super::command::{Planned, Running};
use super::expert::Expert;
use super::network::RequestId;
use super::options::{ServeSettings, Settings};
use super::services::{EXECUTOR, NODES, Part, ServiceRequest, Services};
use super::topics::Topics;
use super::{Input, warn};
use order::Order;

/// Interval at which the hub checks for lost performers.
const TICK: Duration = Duration::from_millis(200);
/// Time within which another executor is discovered.
const DISCOVERY_TIME: Duration = Duration::from_secs(2);
/// Maximum interval between two reports of the progress of a plan.
const REPORT_INTERVAL: Duration = Duration::from_secs(1);
/// Time limit of a run for its shutdown.
const SHUTDOWN_TIMEOUT: Duration = Duration::from_secs(8);
/// Maximum delay of the result of a run until the problem expert has its last changes.
const FLUSH_TIMEOUT: Duration = Duration::from_secs(2);
/// Number of low bits of a ticket that count within a run; the bits above hold the number of the
/// run. The hub may still wait for a cancelled action of an earlier run.
const RUN_BITS: u32 = 32;

/// Plan that is being executed.
struct Execution {
    goal: GoalId,
    run: Running,
    number: u64,
    world: World,
    /// The plan as the client has sent it.
    plan: Plan,
    progress: Progress,
    answers: Option<UnixStream>,
    last_report: Option<Instant>,
    order: Order,
    /// `true` if the run has closed its connection.
    is_silent: bool,
    /// End time of the process, and its exit code.
    ended: Option<(Instant, Option<i32>)>,
}

/// Connections of the server.
pub(super) struct Connections {
    pub(super) topics: Topics,
    pub(super) services: Services,
    pub(super) expert: Option<Expert>,
}

/// Server of planning and execution requests.
pub(super) struct Server {
    settings: ServeSettings,
    speed: f64,
    topics: Topics,
    services: Services,
    expert: Option<Expert>,
    inputs: Sender<Input>,
    hub: Hub,
    nodes: [Lifecycle; NODES.len()],
    goals: Goals<RequestId>,
    /// Domain and problem of the last plan.
    texts: Option<PlanRequest>,
    planned: Option<Planned>,
    execution: Option<Execution>,
    runs: u64,
    /// Number of running planners.
    planning: usize,
    is_over: Arc<AtomicBool>,
    zero: Instant,
}

impl Server {
    pub(super) fn new(
        settings: &Settings,
        serving: ServeSettings,
        sides: Connections,
        inputs: Sender<Input>,
    ) -> Self {
        let Connections {
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

    /// Serves until the user asks the program to end.
    ///
    /// # Errors
    /// Another executor uses the performers.
    pub(super) fn run(mut self, received: &Receiver<Input>) -> Result<(), String> {
        warn("serves planner/get_plan and execute_plan");
        let mut leaves: Option<Duration> = None;
        let mut refusal = Ok(());
        loop {
            // Until then, it gives way to an executor that it discovers, unless it executes a plan.
            if self.execution.is_some() || self.now() >= DISCOVERY_TIME {
                self.topics.hold_claim(self.now());
            }
            self.topics.publish_claim(self.now());
            let due = self
                .execution
                .as_ref()
                .and_then(|it| it.world.due_in(self.now()));
            // The only possible error is a time-out, because the sender is kept.
            let input = received.recv_timeout(due.map_or(TICK, |it| it.min(TICK)));
            if let (Ok(Input::Claim(text)), None) = (&input, leaves) {
                refusal = self.topics.check_claim(text, self.now());
            }
            match input {
                Ok(Input::Claim(_)) if refusal.is_ok() || leaves.is_some() => {}
                Ok(Input::Claim(_) | Input::Stop) => {
                    leaves.get_or_insert(self.now());
                    self.interrupt();
                }
                Ok(input) => self.handle_input(input),
                Err(_) => {}
            }
            self.hub.tick(self.now());
            warn_on_error(self.services.flush());
            self.settle();
            let patience = leaves.map(|at| self.now().saturating_sub(at) >= SHUTDOWN_TIMEOUT);
            if patience.is_some_and(|is_over| is_over || self.execution.is_none()) {
                // Cancel messages are delivered and planners killed before the program ends.
                self.is_over.store(true, Ordering::Relaxed);
                self.topics.release_claim();
                thread::sleep(TICK);
                return refusal;
            }
        }
    }

    fn handle_input(&mut self, input: Input) {
        let now = self.now();
        match input {
            Input::Hub(message) => self.hub.message(&message, now),
            Input::Status(status) => self.hub.status(&status, now),
            Input::Warning(text) => warn(&text),
            Input::Line(line) => self.handle_line(&line, now),
            Input::Connected(stream) => {
                if let Some(execution) = &mut self.execution {
                    execution.answers = Some(stream);
                }
            }
            Input::ServiceRequest(asked) => self.answer(*asked),
            Input::Planned(who, texts, planned) => self.has_planned(who, texts, planned),
            Input::Validated(who, outcome) => {
                self.planning -= 1;
                let (success, error_info) = (outcome.is_ok(), outcome.err().unwrap_or_default());
                warn_on_error(self.services.validate.answer(
                    who,
                    ValidateResponse {
                        success,
                        error_info,
                    },
                ));
            }
            Input::RunEnded(code) => self.handle_run_end(code),
            Input::Ordered(number, order) => self.ordered(number, order),
            Input::Expert(heard) => {
                if let Some(expert) = &mut self.expert {
                    expert.handle(heard);
                }
            }
            Input::Closed => {
                if let Some(execution) = &mut self.execution {
                    execution.is_silent = true;
                }
            }
            Input::Claim(_) | Input::Stop => {}
        }
    }

    /// Takes a line of the run.
    fn handle_line(&mut self, line: &str, now: Duration) {
        let Some(execution) = &mut self.execution else {
            return;
        };
        let mut said = Vec::new();
        let command = execution.world.handle_line(line, now, &mut said);
        send_lines(execution, &said);
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
                    expert.set_beliefs(&facts, &values);
                }
            }
            Ok(Some(Command::Stop) | None) => {}
            Err(error) => warn(&format!("cannot parse: {line}: {error}")),
        }
    }

    fn answer(&mut self, asked: ServiceRequest) {
        let sent = match asked {
            ServiceRequest::Plan(who, texts) => return self.plan(who, texts),
            ServiceRequest::Executed(part, who) => {
                let response = self.executed(part);
                match part {
                    Part::Whole => self.services.executed.answer(who, response),
                    Part::Rest => self.services.rest.answer(who, response),
                }
            }
            ServiceRequest::Order(who) => return self.send_order(who),
            ServiceRequest::Validate(who, request) => return self.validate(who, request.domain),
            ServiceRequest::Goal(who, request) => {
                let stamp = stamp();
                let accepted = match self.begin(&request, stamp) {
                    Ok(()) => true,
                    Err(why) => {
                        warn(&format!("a plan is not executed: {why}"));
                        false
                    }
                };
                let sent = self
                    .services
                    .goal
                    .answer(who, GoalResponse { accepted, stamp });
                sent.and_then(|()| {
                    self.services
                        .statuses
                        .publish_message(self.goals.statuses())
                })
            }
            ServiceRequest::Cancel(who, request) => {
                let (is_given_up, response) = self.goals.cancel(&request);
                if is_given_up {
                    self.interrupt();
                }
                let sent = self.services.cancel.answer(who, response);
                sent.and_then(|()| {
                    self.services
                        .statuses
                        .publish_message(self.goals.statuses())
                })
            }
            ServiceRequest::Result(who, request) => {
                match self.goals.request_result(request.goal_id, who) {
                    Some((who, result)) => self.services.result.answer(who, result),
                    None => Ok(()),
                }
            }
            ServiceRequest::State(node, who) => {
                let current_state = self.nodes[node].state();
                self.services.state[node].answer(who, StateResponse { current_state })
            }
            ServiceRequest::Change(node, who, request) => {
                let success = self.nodes[node].change(&request.transition);
                if !self.nodes[EXECUTOR].serves() {
                    self.interrupt();
                }
                self.services.change[node].answer(who, Success { success })
            }
        };
        warn_on_error(sent);
    }

    /// Returns the plan that is being executed, or its remaining steps.
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
                Part::Rest => execution.progress.remaining_plan(&execution.plan),
            },
            error_info: String::new(),
        }
    }

    /// Starts the execution of a plan.
    fn begin(&mut self, request: &GoalRequest, stamp: Stamp) -> Result<(), String> {
        if !self.nodes[EXECUTOR].serves() {
            return Err("the executor is not active".to_owned());
        }
        if self.goals.open().is_some() {
            return Err("another plan is being executed".to_owned());
        }
        let Some(texts) = &self.texts else {
            return Err(
                "its domain and problem are unknown: request a plan from planner/get_plan first"
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
        let run = Running::start(elbowroom, executor.as_deref(), texts, &text, &self.inputs)?;
        let problem = texts.problem.clone();
        if !self.goals.accept(request.goal_id, stamp) {
            run.interrupt();
            return Err("this goal id was already used".to_owned());
        }
        warn_on_error(
            self.services
                .executing
                .publish_message(request.plan.clone()),
        );
        self.runs += 1;
        let mut world = World::new("plansys2", self.speed);
        if let Some(expert) = &mut self.expert {
            expert.begin(&problem);
            world = world.with_beliefs();
        }
        self.execution = Some(Execution {
            goal: request.goal_id,
            run,
            number: self.runs,
            world,
            plan: request.plan.clone(),
            progress: Progress::new(&request.plan),
            answers: None,
            last_report: None,
            order: Order::default(),
            is_silent: false,
            ended: None,
        });
        self.find_order(text);
        Ok(())
    }

    /// Asks the run to shut down.
    fn interrupt(&self) {
        let running = self.execution.as_ref().filter(|it| it.ended.is_none());
        if let Some(execution) = running {
            execution.run.interrupt();
        }
    }

    fn handle_run_end(&mut self, code: Option<i32>) {
        let Some(execution) = &mut self.execution else {
            return;
        };
        execution.ended = Some((super::clock::now(), code));
        // If the run has crashed, its actions are still running.
        for ticket in execution.world.running() {
            self.hub.cancel(ticket | (execution.number << RUN_BITS));
        }
    }

    /// Reports the result of a run that has ended, once the problem expert has all of its changes.
    fn finish_execution(&mut self) {
        let is_told = self.expert.as_ref().is_none_or(Expert::is_idle);
        let is_due = |it: &mut Execution| {
            it.ended.is_some_and(|(since, _)| {
                (it.is_silent && is_told)
                    || super::clock::now().saturating_duration_since(since) >= FLUSH_TIMEOUT
            })
        };
        let Some(execution) = self.execution.take_if(is_due) else {
            return;
        };
        if let Some(expert) = &mut self.expert {
            expert.end();
        }
        for who in execution.order.waiting {
            self.refuse_order(who, "the run is over");
        }
        let is_reached = execution.ended.is_some_and(|(_, code)| code == Some(0));
        let infos = execution.progress.infos().to_vec();
        for (who, result) in self.goals.end(is_reached, infos) {
            warn_on_error(self.services.result.answer(who, result));
        }
        warn_on_error(
            self.services
                .statuses
                .publish_message(self.goals.statuses()),
        );
    }

    /// Applies the effects of the hub, and answers the run if an answer is due.
    fn settle(&mut self) {
        let now = self.now();
        for effect in self.hub.effects() {
            match effect {
                Effect::Send(message) => warn_on_error(self.topics.send(message)),
                Effect::Report(ticket, what) => {
                    // Results for earlier runs are dropped.
                    let (number, ticket): (u64, ActionHandle) =
                        (ticket >> RUN_BITS, ticket & ((1 << RUN_BITS) - 1));
                    if let Some(execution) =
                        self.execution.as_mut().filter(|it| it.number == number)
                    {
                        execution.world.report(ticket, &what, now);
                        execution.progress.update(ticket, &what, stamp());
                        execution.last_report = None;
                    }
                }
                Effect::Remark(text) => warn(&text),
            }
        }
        let seen = self.expert.as_mut().map(|it| it.settle(now));
        self.finish_execution();
        let Some(execution) = &mut self.execution else {
            return;
        };
        for seen in seen.iter().flatten() {
            execution.world.report_change(seen, now);
        }
        let lines = execution.world.answer(now);
        send_lines(execution, &lines);
        let clock = super::clock::now();
        if execution
            .last_report
            .is_none_or(|at| clock.saturating_duration_since(at) >= REPORT_INTERVAL)
        {
            execution.last_report = Some(clock);
            let action_execution_status = execution.progress.infos().to_vec();
            for info in &action_execution_status {
                warn_on_error(self.services.infos.publish_message(info.clone()));
            }
            let goal_id = execution.goal;
            warn_on_error(self.services.feedback.publish_message(Feedback {
                goal_id,
                action_execution_status,
            }));
        }
    }

    fn now(&self) -> Duration {
        now().saturating_duration_since(self.zero)
    }
}

/// Writes lines to the run.
fn send_lines(execution: &mut Execution, lines: &[String]) {
    if let Some(stream) = &mut execution.answers {
        for line in lines {
            // A closed connection is reported by its own event.
            let _ = writeln!(stream, "{line}");
        }
    }
}

fn warn_on_error(sent: Result<(), String>) {
    if let Err(why) = sent {
        warn(&why);
    }
}

/// Returns the time of day, for messages of ROS.
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
