//! Arguments of `elbowroom network`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::number::{count, integer};

#[derive(Args, Debug)]
#[command(after_long_help = FORMATS_HELP)]
pub(crate) struct NetworkArgs {
    /// The network, in any of the formats below
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// Write the minimal network, with the tightest implied bound between each two time points;
    /// only for consistent networks without contingent links
    #[arg(long, value_name = "OUT")]
    pub(crate) minimal: Option<PathBuf>,
    /// Write the dispatchable network, including its waits, if there is one
    #[arg(long, value_name = "OUT")]
    pub(crate) dispatchable: Option<PathBuf>,
    /// Simulate N executions with random durations
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    #[arg(allow_negative_numbers = true)]
    pub(crate) simulate: Option<u64>,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = integer)]
    #[arg(allow_negative_numbers = true, requires = "simulate")]
    pub(crate) seed: u64,
    /// Dispatch of a network that is not dynamically controllable; without --simulate, prints the
    /// box of `best` (default with --simulate: best)
    #[arg(long, value_enum)]
    pub(crate) dispatch: Option<DispatchChoice>,
    /// Distribution of the durations, for --simulate and --dispatch
    #[arg(long, value_enum, default_value_t = DurationsChoice::Given)]
    pub(crate) durations: DurationsChoice,
    /// Number of branches after which weak controllability, which can be hard, is left undecided
    #[arg(long, value_name = "N", default_value_t = elbowroom::network::MAX_BRANCHES, value_parser = count)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) branches: usize,
    /// Print the answer as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}

/// Dispatch of a network that is not dynamically controllable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DispatchChoice {
    /// By the most probable box of durations that makes the network dynamically controllable
    Best,
    /// As early as the windows allow, without a guarantee
    Early,
}

/// The distribution of the durations of contingent links.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DurationsChoice {
    /// As in the file; uniform between the bounds of links without a distribution
    Given,
    /// Uniform between the bounds
    Uniform,
}

const FORMATS_HELP: &str = "\
Formats, detected from the content:
  HEATlab JSON        `nodes` and `constraints`, of the types stc, stcu, pstc
  PSTN-lib JSON       `timepoints` and `constraints`, with correlations
  CSTNU Tool GraphML  .stn and .stnu; conditional networks are refused
  plain STNU text     begins with `# KIND OF NETWORK`
  DIMACS text         `p sp NODES ARCS`, `a U V W`
  inequalities        JSON: lists of `[u, v, w]`, keyed by the number of nodes
  Elbowroom JSON      the output of --minimal and --dispatchable

The output of --minimal and --dispatchable is GraphML if the name ends in .stn, .stnu, .graphml or \
.xml, and otherwise Elbowroom JSON, in which nothing is lost. docs/reference/networks.md explains the \
answers, docs/reference/formats/network.md describes the formats.";
