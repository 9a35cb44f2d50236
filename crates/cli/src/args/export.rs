//! What can be said to `elbowroom export`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use elbowroom::num::Rational;

use super::ProblemArgs;
use super::envelope::Guarantee;
use super::number::positive;

#[derive(Args, Debug)]
#[command(after_help = "\
A network is written as GraphML, which the CSTNU Tool reads; to a file that ends in .txt, as plain STNU \
text, and to one that ends in .json, as Elbowroom JSON, exactly. The others are in whole numbers: where \
that takes another unit of time, it is told.\n\n\
docs/second-witness.md says what each text means and how to ask others about it.")]
pub(crate) struct ExportArgs {
    /// What to write: the network as an STNU, or the box or region as SMT-LIB 2
    #[arg(value_name = "FORMAT", value_enum)]
    pub(crate) format: ExportFormat,
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    /// The plan: `start: (action arguments) [duration]` lines, or an STN plan file
    #[arg(value_name = "PLAN|FILE.stn")]
    pub(crate) plan: PathBuf,
    /// The box: `"dur_0=[7/4,12] (drive a b)=12 all=±10%"`; parameters that are not named keep
    /// their nominal value. Without a box, `smt2` writes the whole region
    #[arg(long, value_name = "BOX")]
    pub(crate) contains: Option<String>,
    /// Take the box from there, what `elbowroom envelope --json` has printed
    #[arg(long, value_name = "ANSWER.json", conflicts_with = "contains")]
    pub(crate) envelope: Option<PathBuf>,
    /// A quantity that may deviate, as for `elbowroom envelope`; may be repeated
    #[arg(long, value_name = "SPEC")]
    pub(crate) vary: Vec<String>,
    /// The guarantee that `smt2` asks about; by default that of the answer, dynamic for a box, weak
    /// for the region
    #[arg(long, value_enum)]
    pub(crate) guarantee: Option<Guarantee>,
    /// Add the plan's conditions to the network where they bound the difference of two times, as
    /// for `elbowroom envelope`
    #[arg(long)]
    pub(crate) enforce: bool,
    /// An action whose duration the executor chooses, as for `elbowroom envelope`; may be repeated
    #[arg(long, value_name = "ACTION")]
    pub(crate) controllable: Vec<String>,
    /// Minimum time between interfering happenings (epsilon)
    #[arg(long, value_name = "E", default_value = "0.001", value_parser = positive)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) epsilon: Rational,
    /// Write there instead of to standard output
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

/// A format that others read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExportFormat {
    /// The plan's network, durations and deadlines in the box left to the world
    Stnu,
    /// Whether the plan is guaranteed to work in the box; or the region
    Smt2,
}
