//! Arguments of `elbowroom serve` and `elbowroom ctl`.

use std::path::PathBuf;

use clap::builder::Resettable;
use clap::{Args, Subcommand};
use elbowroom::num::Rational;

use super::CalendarArgs;
use super::run::RunArgs;
use elbowroom_executive::http::Address;
use elbowroom_executive::http::Target;

/// The port of an executive where none is chosen.
const PORT: &str = "7316";

#[derive(Args, Debug)]
#[command(after_help = "\
Without PROBLEM, the executive waits for one (`elbowroom ctl problem`). docs/reference/serve.md describes \
its requests.")]
#[command(mut_arg("time_limit", |it| it
    .default_value("1000000000")
    .help("Time limit of the executive, in seconds of the world; by default 30 years")))]
#[command(mut_arg("max_replans", |it| it
    .help("Number of new plans that may be made until an action is completed; then the executive waits for a change")))]
#[command(mut_arg("realtime", |it| it
    .help("Run a simulated world FACTOR times as fast as the wall clock (0.000001 to 1000000000); \
           by default 1. A world process has a clock of its own")))]
#[command(mut_arg("serve", |it| it.hide(true)))]
#[command(mut_arg("token", |it| it
    .requires(Resettable::Reset)
    .help("Clients with the token in this file may change something: give goals and facts, pause, \
           stop. Without it, the executive is read-only")))]
#[command(mut_arg("replay", |it| it.hide(true)))]
pub(crate) struct ServeArgs {
    #[command(flatten)]
    pub(crate) run: RunArgs,
    /// Address for HTTP: a port, or HOST:PORT; port 0 is a free one. Only for this machine unless
    /// HOST says otherwise
    #[arg(long, value_name = "ADDRESS", value_parser = Address::read, default_value = PORT)]
    pub(crate) http: Address,
    /// Also listen at this Unix socket, which is created; only its owner can reach it
    #[arg(long, value_name = "PATH")]
    pub(crate) socket: Option<PathBuf>,
    /// Rotate the journal once it has this size and the executive adopts a plan, or is idle: in
    /// bytes, or with K, M or G; 10M by default. `--resume` then continues from the new segment
    #[arg(long, value_name = "SIZE", value_parser = size)]
    pub(crate) journal_size: Option<u64>,
    /// Number of earlier segments of the journal to keep, as FILE.1 (the latest), FILE.2, …; 1 by
    /// default
    #[arg(long, value_name = "COUNT")]
    pub(crate) journal_segments: Option<usize>,
}

impl ServeArgs {
    /// The calendar, and the speed of time.
    pub(crate) fn calendar(&self) -> (&CalendarArgs, Option<Rational>) {
        let factor = self.run.realtime.clone().unwrap_or(Rational::ONE);
        (&self.run.calendar, Some(factor))
    }
}

/// Reads a length in bytes.
fn size(text: &str) -> Result<u64, String> {
    let (digits, unit) = match text.char_indices().last() {
        Some((at, 'k' | 'K')) => (&text[..at], 1_000),
        Some((at, 'M')) => (&text[..at], 1_000_000),
        Some((at, 'G')) => (&text[..at], 1_000_000_000),
        _ => (text, 1),
    };
    let number = digits.parse::<u64>().ok();
    let size = number.and_then(|number| number.checked_mul(unit));
    size.filter(|size| *size > 0)
        .ok_or_else(|| "write a number of bytes, such as 500K, 10M or 1G".to_owned())
}

#[derive(Args, Debug)]
#[command(after_help = "\
docs/reference/serve.md describes requests and answers. Exit codes: 0 done; 2 rejected, or no answer.")]
pub(crate) struct CtlArgs {
    /// Address of the executive: a port, HOST:PORT, or the path of its socket
    #[arg(long, value_name = "ADDRESS", value_parser = Target::read, default_value = PORT)]
    #[arg(global = true)]
    pub(crate) to: Target,
    /// The file with the token, for requests that change something
    #[arg(long, value_name = "FILE", global = true)]
    pub(crate) token: Option<PathBuf>,
    /// Print the answer as one JSON document
    #[arg(long, global = true)]
    pub(crate) json: bool,
    #[command(subcommand)]
    pub(crate) what: CtlCommand,
}

/// Requests to an executive.
#[derive(Debug, Subcommand)]
pub(crate) enum CtlCommand {
    /// Print the state: the current decision and its reason, goals, running actions, facts and
    /// numbers
    State,
    /// Print the goals: those that are pursued or set aside, and the last ones that were closed
    Goals,
    /// Print the plan with the states of its actions
    Plan,
    /// Print the remaining guarantee, and how far each quantity may deviate
    Guarantee,
    /// Print the next action and its reason
    Next,
    /// Print the closed goals and the ended actions, the latest first, also from earlier segments of the journal
    History {
        /// Only those before this time of the world's clock
        #[arg(long, value_name = "T", allow_negative_numbers = true)]
        before: Option<Rational>,
        /// Number of entries, at most 1000
        #[arg(long, value_name = "N", default_value_t = 100)]
        limit: usize,
    },
    /// Print each line of the trace when it is written, until the executive ends
    Events {
        /// Start after line N of the trace instead of with the next line
        #[arg(long, value_name = "N")]
        after: Option<usize>,
    },
    /// Add a goal, such as '(at rover base)'
    Goal {
        /// The goal, in PDDL, as after `:goal`
        #[arg(value_name = "GOAL")]
        goal: String,
        /// Its name; the goal of the same name is replaced
        #[arg(long, value_name = "NAME")]
        name: Option<String>,
        #[command(flatten)]
        terms: GoalTerms,
        /// Keep the goal: achieve it again whenever it does not hold and no other goal is pursued,
        /// until it is cancelled
        #[arg(long, conflicts_with_all = ["deadline", "within"])]
        keep: bool,
        /// Name of the client that gives the goal, for the records
        #[arg(long, value_name = "NAME")]
        by: Option<String>,
        /// Wait until the goal is closed, or the executive is idle because it is impossible: exit
        /// code 0 if it is achieved, 1 if it is cancelled, failed or impossible, 3 if the executive
        /// is idle because no plan was found
        #[arg(long)]
        wait: bool,
    },
    /// Print the outcome of a goal if it were given now and everything went as planned
    ///
    /// The time at which it would be done, the least slack, and the goals that would be missed. The run does not change.
    /// Exit code 0: it would be achieved; 1: it would not; 3: undecided
    WhatIf {
        /// The goal, in PDDL, as after `:goal`
        #[arg(value_name = "GOAL")]
        goal: String,
        #[command(flatten)]
        terms: GoalTerms,
    },
    /// Abandon a goal
    Cancel {
        /// Its name; that of the problem's own goal is `problem`
        #[arg(value_name = "NAME")]
        name: String,
    },
    /// Report that a running action is done or has failed, or cancel it
    Action {
        /// The number of its start; `ctl state` lists the running actions with their numbers
        #[arg(value_name = "TICKET")]
        ticket: u64,
        /// Its outcome; `cancelled` asks the world to cancel it
        #[arg(value_name = "OUTCOME", value_parser = ["done", "failed", "cancelled"])]
        becomes: String,
    },
    /// Report that a fact is true or false
    Fact {
        /// The fact, such as '(open door)'
        #[arg(value_name = "FACT")]
        fact: String,
        /// The new value of the fact
        #[arg(value_name = "true|false", default_value = "true", action = clap::ArgAction::Set)]
        becomes: bool,
    },
    /// Report the value of a number
    Number {
        /// The fluent, such as '(charge rover)'
        #[arg(value_name = "FLUENT")]
        fluent: String,
        /// Its value
        #[arg(value_name = "VALUE", allow_negative_numbers = true)]
        value: Rational,
    },
    /// Give the problem to an executive that has none, or that has no running action
    Problem {
        /// The problem file
        #[arg(value_name = "PROBLEM")]
        file: PathBuf,
    },
    /// Stop dispatching; running actions continue
    Pause,
    /// Resume after a pause
    Resume,
    /// End the executive; running actions are cancelled
    Stop,
    /// Print the `OpenAPI` description of the interface, for client generators
    Openapi,
}

/// Value and times of a goal.
#[derive(Debug, Args)]
pub(crate) struct GoalTerms {
    /// Its value, a positive number [default: 1]; if not all goals can be reached together, those with the greatest sum of
    /// values are pursued
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub(crate) value: Option<Rational>,
    /// Deadline on the world's clock; a goal that is not achieved by then is closed as failed
    #[arg(
        long,
        value_name = "T",
        conflicts_with = "within",
        allow_negative_numbers = true
    )]
    pub(crate) deadline: Option<Rational>,
    /// The deadline in seconds from now
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) within: Option<Rational>,
    /// Release time on the world's clock: the goal is queued until then, and not planned for
    #[arg(
        long,
        value_name = "T",
        conflicts_with = "after",
        allow_negative_numbers = true
    )]
    pub(crate) release: Option<Rational>,
    /// The release time in seconds from now
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) after: Option<Rational>,
}
