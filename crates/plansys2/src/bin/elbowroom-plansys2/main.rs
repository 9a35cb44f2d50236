//! Bridge between Elbowroom on standard input and output and the action performers of `PlanSys2` on
//! DDS.

mod clock;
mod command;
mod expert;
mod network;
mod options;
mod serve;
mod services;
mod session;
mod topics;

use std::io::{self, BufRead as _, Write as _};
use std::os::unix::net::UnixStream;
use std::process::ExitCode;
use std::sync::mpsc::{self, Sender};
use std::thread;

use clap::Parser as _;
use elbowroom_plansys2::interface::PlanRequest;
use elbowroom_plansys2::knowledge::Tree;
use elbowroom_plansys2::message::{ActionExecution, ActionPerformerStatus};

use command::Planned;
use expert::{Expert, ExpertMessage};
use network::{Network, RequestId};
use options::{Mode, Options, ProblemExpert, ServeOptions};
use services::{ServiceRequest, Services};
use topics::Topics;

/// Event of the main loop.
pub(crate) enum Input {
    /// A line of Elbowroom.
    Line(String),
    /// Elbowroom has closed the connection.
    Closed,
    /// A message on `actions_hub`.
    Hub(ActionExecution),
    /// A message on `performers_status`.
    Status(ActionPerformerStatus),
    /// The claim of an executor.
    Claim(String),
    /// A warning for the user.
    Warning(String),
    /// A client calls a service.
    ServiceRequest(Box<ServiceRequest>),
    /// A planner has ended: the client, its request and the result.
    Planned(RequestId, PlanRequest, Result<Planned, String>),
    /// A domain was checked: the client, and the messages if the domain is invalid.
    Validated(RequestId, Result<(), String>),
    /// The order of the subgoals in the plan of that run, or why it could not be computed.
    Ordered(u64, Result<Vec<Tree>, String>),
    /// A message of the problem expert.
    Expert(ExpertMessage),
    /// A run has connected. Answers to it are written to this stream.
    Connected(UnixStream),
    /// A run has ended, with that exit code.
    RunEnded(Option<i32>),
    /// The user asks the program to end.
    Stop,
}

fn main() -> ExitCode {
    let mut options = Options::parse();
    let outcome = match options.command.take() {
        Some(Mode::Relay { socket }) => command::relay(&socket),
        Some(Mode::Serve(serving)) => serve(options, serving),
        None => world(options),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            warn(&format!("error: {why}"));
            ExitCode::from(2)
        }
    }
}

fn world(options: Options) -> Result<(), String> {
    let settings = options.settings()?;
    let (inputs, received) = mpsc::channel();
    let mut network = Network::join(&settings)?;
    let topics = Topics::join(&mut network, settings.is_shared)?;
    let follows = settings.problem_expert == Some(ProblemExpert::Follow);
    let expert = follows.then(|| Expert::join(&mut network)).transpose()?;
    network.listen(inputs.clone())?;
    thread::spawn(move || read(&inputs));
    session::Session::new(&settings, topics, expert, received).run()
}

fn serve(options: Options, serving: ServeOptions) -> Result<(), String> {
    let serving = serving.checked()?;
    let settings = options.settings()?;
    let (inputs, received) = mpsc::channel();
    let mut network = Network::join(&settings)?;
    let topics = Topics::join(&mut network, settings.is_shared)?;
    let services = Services::offer(&mut network)?;
    let follows = settings.problem_expert != Some(ProblemExpert::Ignore);
    let expert = follows.then(|| Expert::join(&mut network)).transpose()?;
    network.listen(inputs.clone())?;
    let ends = inputs.clone();
    let ended = ctrlc::set_handler(move || {
        let _ = ends.send(Input::Stop);
    });
    ended.map_err(|e| format!("cannot receive signals: {e}"))?;
    let sides = serve::Connections {
        topics,
        services,
        expert,
    };
    serve::Server::new(&settings, serving, sides, inputs).run(&received)
}

fn read(inputs: &Sender<Input>) {
    for line in io::stdin().lock().lines() {
        let Ok(line) = line else { break };
        if inputs.send(Input::Line(line)).is_err() {
            return;
        }
    }
    let _ = inputs.send(Input::Closed);
}

/// Writes a message for the user to standard error.
pub(crate) fn warn(text: &str) {
    // A failure is ignored, because there is nowhere left to report it.
    let _ = writeln!(io::stderr(), "elbowroom-plansys2: {text}");
}
