//! Arguments of `elbowroom export`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use elbowroom::envelope::Guarantee;
use elbowroom::num::Rational;
use elbowroom::probability::optimum::DeadEnds;

use super::ProblemArgs;
use super::number::positive;
use super::term::term;

#[derive(Args, Debug)]
#[command(after_help = "\
A network is written as GraphML, which the CSTNU Tool reads; to a file that ends in .txt, as plain STNU \
text, and to one that ends in .json, as Elbowroom JSON, exactly. The other formats use integers; \
a change of the unit of time is reported.\n\n\
docs/reference/second-witness.md describes the formats and how to check them with other programs.")]
pub(crate) struct ExportArgs {
    /// The output: the network as an STNU, the box or region as SMT-LIB 2, the optimum
    /// over all executors as a decision process for PRISM, or the problem with its calendar as PDDL
    #[arg(value_name = "FORMAT", value_enum)]
    pub(crate) format: ExportFormat,
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    /// The plan: `start: (action arguments) [duration]` lines, or an STN plan file; not for `prism`
    /// and `pddl`, which do not depend on a plan
    #[arg(value_name = "PLAN|FILE.stn")]
    pub(crate) plan: Option<PathBuf>,
    /// The box: `"dur_0=[7/4,12] (drive a b)=12 all=±10%"`; parameters that are not named keep
    /// their nominal value. Without a box, `smt2` writes the whole region
    #[arg(long, value_name = "BOX")]
    pub(crate) contains: Option<String>,
    /// Take the box from this output of `elbowroom envelope --json`
    #[arg(long, value_name = "ANSWER.json", conflicts_with = "contains")]
    pub(crate) envelope: Option<PathBuf>,
    /// A quantity that may deviate, as for `elbowroom envelope`; may be repeated
    #[arg(long, value_name = "SPEC")]
    pub(crate) vary: Vec<String>,
    /// The guarantee that `smt2` checks; by default that of the answer, dynamic for a box, weak for
    /// the region
    #[arg(long, value_parser = term(Guarantee::TERMS))]
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
    #[command(flatten)]
    pub(crate) process: ProcessArgs,
    /// Write to this file instead of standard output
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

/// Options of PRISM models.
#[derive(Args, Debug)]
#[command(next_help_heading = "Processes (prism)")]
pub(crate) struct ProcessArgs {
    /// Without time: facts change step by step, with these likelihoods
    #[arg(long, value_name = "FILE", conflicts_with = "world")]
    pub(crate) likelihoods: Option<PathBuf>,
    /// On a clock: the world's durations, failures and events
    #[arg(long, value_name = "WORLD.toml")]
    pub(crate) world: Option<PathBuf>,
    /// Meaning of states without a plan: `lost`, `harmless`, or the number of such steps until the
    /// run is lost (without time; lost by default)
    #[arg(long, value_name = "RULE")]
    pub(crate) dead_ends: Option<DeadEndRule>,
    /// Largest number of actions that run at the same time (without time; no limit by default)
    #[arg(long, value_name = "N")]
    pub(crate) most_running: Option<usize>,
    /// An action fails as soon as its over-all condition is violated (without time)
    #[arg(long)]
    pub(crate) keep_over_all: bool,
    /// Number of cells of the time axis (on a clock; 32 by default)
    #[arg(long, value_name = "N")]
    pub(crate) cells: Option<usize>,
    /// Bound of the optimum (on a clock; upper by default)
    #[arg(long, value_enum)]
    pub(crate) bound: Option<Bound>,
}

/// The bounds of the timed optimum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Bound {
    /// The events of a cell happen in the worst order: a game, `smg`
    Lower,
    /// The policy knows the events of a cell and chooses their order: `mdp`
    Upper,
}

/// Rule for runs in a dead end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct DeadEndRule(pub(crate) DeadEnds);

impl FromStr for DeadEndRule {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "lost" => Ok(Self(DeadEnds::Lost)),
            "harmless" => Ok(Self(DeadEnds::Harmless)),
            number => match number.parse() {
                Ok(steps @ 1..=1000) => Ok(Self(DeadEnds::Patience(steps))),
                _ => Err("write `lost`, `harmless`, or a number from 1 to 1000".to_owned()),
            },
        }
    }
}

/// A format that others read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExportFormat {
    /// The plan's network, in which the world decides durations and deadlines within the box
    Stnu,
    /// The guarantee of the plan in the box, or the region, as a formula
    Smt2,
    /// The optimum over all executors, as a Markov decision process
    Prism,
    /// The problem with the timed initials of its calendar file, as PDDL
    Pddl,
}
