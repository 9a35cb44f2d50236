//! Arguments of `elbowroom world-check`.

use std::path::PathBuf;

use clap::Args;
use elbowroom::num::Rational;

use super::number::positive;

#[derive(Args, Debug)]
#[command(after_help = "\
The check starts the first two durative actions of the plan: one runs to its end, one is \
cancelled, and two run at the same time. A real robot moves. Without a plan, the check starts \
`(wait-a-second)`. A program that claims `resume` is killed during an action and restarted.

Exit codes: 0 no violations; 1 violations; 2 the world cannot be started.")]
pub(crate) struct WorldCheckArgs {
    /// The world program, with its arguments (docs/reference/formats/world-protocol.md)
    #[arg(value_name = "COMMAND")]
    pub(crate) command: String,
    /// The domain, in PDDL
    #[arg(value_name = "DOMAIN", requires = "plan")]
    pub(crate) domain: Option<PathBuf>,
    /// The problem, in PDDL
    #[arg(value_name = "PROBLEM")]
    pub(crate) problem: Option<PathBuf>,
    /// The plan whose actions the world has to start
    #[arg(value_name = "PLAN")]
    pub(crate) plan: Option<PathBuf>,
    /// Time limit in seconds for each answer of the program; requested waits take at most a second
    /// of its clock, or a tenth of an action's duration
    #[arg(long, value_name = "S", default_value = "10", value_parser = positive)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) answer_within: Rational,
    /// Print the answer as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}
