//! Arguments of `elbowroom learn`.

use std::path::PathBuf;

use clap::Args;
use elbowroom::envelope::Guarantee;
use elbowroom::num::Rational;

use super::number::positive;
use super::term::term;

#[derive(Args, Debug)]
pub(crate) struct LearnArgs {
    /// Logs, oldest first: traces of `elbowroom run --trace`, or tables (docs/reference/formats/log-csv.md)
    #[arg(value_name = "LOG", required = true)]
    pub(crate) logs: Vec<PathBuf>,
    /// Write the learnt model as a world file, for `elbowroom run --world`
    #[arg(short, long, value_name = "WORLD.toml")]
    pub(crate) output: Option<PathBuf>,
    /// Compare how often facts changed by themselves with the rates of this world file
    #[arg(long, value_name = "WORLD.toml")]
    pub(crate) world: Option<PathBuf>,
    /// Times in the logs are multiples of this, in seconds
    #[arg(long, value_name = "S", default_value = "0.001", value_parser = positive)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) resolution: Rational,
    /// Report a drift if the evidence for it is N to one; in logs without drift, the probability of
    /// a report is at most 1/N for each action
    #[arg(long, value_name = "N", default_value = "100", value_parser = positive)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) drift: Rational,
    /// Seed for ordering equal values in the search for drift
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Compute intervals that hold all durations of the next execution of a plan with this
    /// probability, whatever their distributions, and check that the plan works for all values in
    /// them
    #[arg(long, value_name = "P", requires_all = ["domain", "problem", "plan"])]
    pub(crate) inside: Option<Rational>,
    /// The domain of the plan of --plan, in PDDL
    #[arg(long, value_name = "FILE", requires = "inside")]
    pub(crate) domain: Option<PathBuf>,
    /// The problem of the plan of --plan, in PDDL
    #[arg(long, value_name = "FILE", requires = "inside")]
    pub(crate) problem: Option<PathBuf>,
    /// The plan, for --inside
    #[arg(long, value_name = "FILE", requires = "inside")]
    pub(crate) plan: Option<PathBuf>,
    /// Guarantee that the plan must have in the intervals
    #[arg(long, value_parser = term(Guarantee::TERMS), default_value_t = Guarantee::Dynamic, requires = "inside")]
    pub(crate) guarantee: Guarantee,
    /// Minimum time between interfering happenings (epsilon)
    #[arg(long, value_name = "E", default_value = "0.001", value_parser = positive)]
    #[arg(allow_negative_numbers = true)]
    #[arg(requires = "inside")]
    pub(crate) epsilon: Rational,
    /// Print the answer as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}
