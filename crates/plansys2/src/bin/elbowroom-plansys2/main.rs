//! Elbowroom on standard input and output, the action performers of `PlanSys2` over DDS.

mod options;
mod session;
mod topics;

use std::io::{self, BufRead as _, Write as _};
use std::process::ExitCode;
use std::sync::mpsc::{self, Sender};
use std::thread;

use clap::Parser as _;
use elbowroom_plansys2::message::{ActionExecution, ActionPerformerStatus};

/// What comes in, from either side.
pub(crate) enum Input {
    /// A line of Elbowroom.
    Line(String),
    /// Elbowroom is gone.
    Closed,
    /// A message on `actions_hub`.
    Hub(ActionExecution),
    /// A message on `performers_status`.
    Status(ActionPerformerStatus),
    /// Something for people to know.
    Trouble(String),
}

fn main() -> ExitCode {
    let outcome = options::Options::parse().settings().and_then(|settings| {
        let (inputs, received) = mpsc::channel();
        let topics = topics::Topics::join(&settings, inputs.clone())?;
        thread::spawn(move || read(&inputs));
        session::Session::new(&settings, topics, received).run()
    });
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            remark(&format!("error: {why}"));
            ExitCode::from(2)
        }
    }
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

/// Says something to people: what goes to standard error is shown as it is.
pub(crate) fn remark(text: &str) {
    // Where nobody reads there is nobody to tell.
    let _ = writeln!(io::stderr(), "elbowroom-plansys2: {text}");
}
