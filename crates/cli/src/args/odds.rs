//! Arguments of `elbowroom odds`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use elbowroom::answers::odds::OddsSemantics;
use elbowroom::execution::executors;
use elbowroom::num::Rational;

use super::ProblemArgs;
use super::number::{count, integer, positive};

#[derive(Args, Debug)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is an option of the command line"
)]
pub(crate) struct OddsArgs {
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    /// The plan; without it, the embedded planner makes one, and its best order is used
    #[arg(value_name = "PLAN")]
    pub(crate) plan: Option<PathBuf>,
    /// Probabilities of success and of spontaneous change (docs/reference/formats/likelihoods.md)
    #[arg(long, value_name = "FILE")]
    pub(crate) likelihoods: PathBuf,
    /// Use the order of the plan's actions that is most likely to succeed instead of that of its
    /// times
    #[arg(long)]
    pub(crate) best: bool,
    /// Let a ground action overlap itself in plans that the embedded planner makes
    #[arg(long)]
    pub(crate) self_overlap: bool,
    /// State of an effect that fails
    #[arg(long, value_enum, default_value_t = SemanticsChoice::Paper)]
    pub(crate) semantics: SemanticsChoice,
    /// Also list, for each happening, the facts that it and the following ones need
    #[arg(long)]
    pub(crate) layers: bool,
    /// A world on a clock (docs/reference/formats/world.md): execute the plan in samples of it
    #[arg(long, value_name = "WORLD.toml")]
    pub(crate) world: Option<PathBuf>,
    #[arg(long, value_name = "NAME", requires = "world", help = executor_help())]
    pub(crate) executor: Vec<String>,
    /// Number of samples
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = integer)]
    #[arg(allow_negative_numbers = true)]
    #[arg(requires = "world")]
    pub(crate) samples: u64,
    /// The seed of the first sample; the others follow
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = integer)]
    #[arg(allow_negative_numbers = true)]
    #[arg(requires = "world")]
    pub(crate) seed: u64,
    /// Write a picture of all orders of the plan's actions; of short plans only
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) lattice: Option<PathBuf>,
    /// Largest number of prefixes of orders in the search for the best order
    #[arg(long, value_name = "N", default_value_t = 50_000, value_parser = count)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) most_sequences: usize,
    /// Minimum time between interfering happenings (epsilon)
    #[arg(long, value_name = "E", default_value = "0.001", value_parser = positive)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) epsilon: Rational,
    /// Print the answer as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}

/// The state after an effect that fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SemanticsChoice {
    /// The opposite of the intended value, as in paper 2
    Paper,
    /// The previous value
    World,
}

impl From<SemanticsChoice> for OddsSemantics {
    fn from(choice: SemanticsChoice) -> Self {
        match choice {
            SemanticsChoice::Paper => Self::Paper,
            SemanticsChoice::World => Self::World,
        }
    }
}

fn executor_help() -> String {
    let usual = executors::with_role(executors::Role::Evaluation);
    let usual: Vec<String> = usual.map(|executor| format!("`{executor}`")).collect();
    format!(
        "Executor of the samples, without and with new plans; {} by default",
        usual.join(" and ")
    )
}
