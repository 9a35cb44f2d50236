//! Arguments of `elbowroom world-check`.

use std::path::PathBuf;

use clap::Args;
use elbowroom::num::Rational;

use super::number::positive;

#[derive(Args, Debug)]
#[command(after_help = "\
The world is told to start the first actions of the plan that take time: one to its end, one that is \
cancelled at once, two at a time. A robot moves. Without a plan, the world is told to `(wait-a-second)`. \
A program that claims `resume` is killed while it does something, and started again.

Exit codes: 0 nothing is wrong; 1 something is; 2 the world cannot be started.")]
pub(crate) struct WorldCheckArgs {
    /// The program that is the world, with its arguments (docs/formats/world-protocol.md)
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
    /// Time limit in seconds for each answer of the program; waits that are requested of it take at
    /// most a second of its own time, or a tenth of an action's
    #[arg(long, value_name = "S", default_value = "10", value_parser = positive)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) answer_within: Rational,
    /// Print the answer as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}
