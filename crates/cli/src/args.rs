//! Command line of `elbowroom`, as clap structures.

mod calendar;
mod compare;
mod envelope;
mod export;
mod init;
mod layout;
mod learn;
mod network;
mod number;
mod odds;
mod plan;
mod run;
mod serve;
mod term;
mod world_check;

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::{Args, FromArgMatches as _, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use elbowroom::num::Rational;

pub(crate) use calendar::CalendarArgs;
pub(crate) use compare::CompareArgs;
pub(crate) use envelope::{EnvelopeArgs, Growth, Order, controllable};
pub(crate) use export::{Bound, ExportArgs, ExportFormat};
pub(crate) use init::{InitArgs, Template};
pub(crate) use layout::command;
pub(crate) use learn::LearnArgs;
pub(crate) use network::{DispatchChoice, DurationsChoice, NetworkArgs};
pub(crate) use number::FaultCount;
use number::{positive, positive_or_zero};
pub(crate) use odds::OddsArgs;
pub(crate) use plan::{EMBEDDED, PlanArgs};
pub(crate) use run::{FirstPlanChoice, RunArgs, RunningChoice};
pub(crate) use serve::{CtlArgs, CtlCommand, GoalTerms, ServeArgs};
pub(crate) use world_check::WorldCheckArgs;

use crate::terminal;

/// Wider help is hard to read.
const MAX_HELP_WIDTH: usize = 100;

/// Robustness envelopes, execution and replanning for temporal plans (PDDL 2.1)
#[derive(Debug, Parser)]
#[command(
    name = "elbowroom",
    version,
    propagate_version = true,
    max_term_width = MAX_HELP_WIDTH
)]
#[command(
    long_about = "Robustness envelopes, execution and replanning for temporal plans (PDDL 2.1)\n\n\
    Elbowroom reads PDDL 2.1 problems with durative actions. It finds plans, itself or with another \
    planner (`plan`), validates them (`check`), relaxes them to simple temporal networks (`stn`), \
    computes how far each duration, rate or deadline may deviate while the plan is still guaranteed \
    to work (`envelope`), and executes plans with dispatching and replanning (`run`). It compares \
    executors in simulated worlds (`compare`), and decides the controllability of temporal networks \
    (`network`)."
)]
#[command(after_help = "\
In place of an input file, `-` means standard input.

Exit codes: 0 the answer is yes, or done; 1 the answer is no; 2 the input or the command line is \
wrong; 3 a limit was reached without a result; 70 a bug.

Example:
  elbowroom init hospital --template ward")]
pub(crate) struct CommandLine {
    /// When to use colours: on a terminal unless `NO_COLOR` is set, always, or never
    #[arg(long, global = true, value_enum, value_name = "WHEN", default_value_t = Colour::Auto)]
    #[arg(hide_possible_values = true)]
    pub(crate) color: Colour,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Use of colour in the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Colour {
    /// On a terminal, unless `NO_COLOR` is set
    Auto,
    /// Always
    Always,
    /// Never
    Never,
}

impl From<Colour> for anstream::ColorChoice {
    fn from(colour: Colour) -> Self {
        match colour {
            Colour::Auto => Self::Auto,
            Colour::Always => Self::Always,
            Colour::Never => Self::Never,
        }
    }
}

/// Reads the command line. Where that cannot be done, or help is asked for, this ends the process.
pub(crate) fn read(line: Vec<OsString>) -> CommandLine {
    let mut command = command();
    if let Some(columns) = terminal::columns() {
        command = command.term_width(columns.min(MAX_HELP_WIDTH));
    }
    let matches = command.try_get_matches_from_mut(with_val_name(line));
    let matches = matches.unwrap_or_else(|error| error.exit());
    let read = CommandLine::from_arg_matches(&matches);
    read.unwrap_or_else(|error| error.format(&mut command).exit())
}

/// The command line. A program that is called as VAL is has VAL's arguments, and its default
/// tolerance, which a later `-t` overrides.
fn with_val_name(mut line: Vec<OsString>) -> Vec<OsString> {
    let program = line.first().map(Path::new).and_then(Path::file_stem);
    if program.is_some_and(|name| name.eq_ignore_ascii_case("validate")) {
        line.splice(1..1, ["val", "-t", VAL_TOLERANCE].map(OsString::from));
    }
    line
}

/// VAL's own default for `-t`.
const VAL_TOLERANCE: &str = "0.01";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Create a project to start from: domain, problem, plan, world, robot program and experiment
    Init(InitArgs),
    /// Validate a plan, and report its errors
    Check(CheckArgs),
    /// Find a plan, with the embedded planner or another one
    Plan(PlanArgs),
    /// Relax a plan with fixed times to a simple temporal network (an STN plan)
    Stn(StnArgs),
    /// Compute how far each duration, rate or deadline may deviate
    Envelope(Box<EnvelopeArgs>),
    /// Execute a plan, monitor it, and replan when it no longer works
    Run(Box<RunArgs>),
    /// Run an executive that accepts goals, facts and queries during execution
    Serve(Box<ServeArgs>),
    /// Send a query or a command to an executive
    Ctl(CtlArgs),
    /// Check that a world program follows the protocol
    WorldCheck(WorldCheckArgs),
    /// Compare executors over many simulated runs
    Compare(CompareArgs),
    /// Learn from logs how long actions take and how often they fail
    Learn(LearnArgs),
    /// Compute a plan's success probability, the causes of failure, and possible improvements
    Odds(Box<OddsArgs>),
    /// Decide consistency and controllability of a temporal network
    Network(NetworkArgs),
    /// Write a plan's network, or its envelope, for other programs to check
    Export(Box<ExportArgs>),
    /// Verify an answer without search: that its box is inside the envelope and is the largest one,
    /// or that no plan exists
    Verify(VerifyArgs),
    /// Validate plans with the output of VAL, for editors and scripts that expect VAL
    Val(ValArgs),
    /// Write an answer, a run or an experiment as an HTML page
    Report(ReportArgs),
    /// Answer questions of assistants over the Model Context Protocol, on standard input and output
    #[command(after_help = "docs/reference/mcp.md describes the tools.")]
    Mcp,
    /// Print a script that completes commands and options in a shell
    Completions(CompletionsArgs),
    /// Print the manual page, or write one for each command
    Man(ManArgs),
    /// Print the version
    #[command(hide = true)]
    Version,
}

impl Command {
    /// Returns `true` if the command prints its answer as one JSON document.
    pub(crate) fn is_json(&self) -> bool {
        match self {
            Self::Check(arguments) => arguments.json,
            Self::Plan(arguments) => arguments.json,
            Self::Stn(arguments) => arguments.json,
            Self::Envelope(arguments) => arguments.json,
            Self::Run(arguments) => arguments.json,
            Self::Serve(arguments) => arguments.run.json,
            Self::Ctl(arguments) => arguments.json,
            Self::WorldCheck(arguments) => arguments.json,
            Self::Compare(arguments) => arguments.json,
            Self::Learn(arguments) => arguments.json,
            Self::Odds(arguments) => arguments.json,
            Self::Network(arguments) => arguments.json,
            Self::Verify(arguments) => arguments.json,
            Self::Init(_)
            | Self::Export(_)
            | Self::Val(_)
            | Self::Report(_)
            | Self::Completions(_)
            | Self::Man(_)
            | Self::Mcp
            | Self::Version => false,
        }
    }
}

#[derive(Args, Debug)]
#[command(after_help = "\
The program behaves like `elbowroom val` if it is called as `Validate` or `validate`, for example by a link \
of that name.")]
pub(crate) struct ValArgs {
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    /// The plans
    #[arg(value_name = "PLAN", required = true)]
    pub(crate) plans: Vec<PathBuf>,
    /// Also print the plan and the times at which something happens
    #[arg(short, long)]
    pub(crate) verbose: bool,
    /// Tolerance of the bounds of durations; times at most a tenth of it apart count as equal.
    /// If the program is called as `Validate`, the default is that of VAL, 0.01
    #[arg(short, long, value_name = "T", default_value = "0.001", value_parser = positive_or_zero)]
    #[arg(allow_negative_numbers = true, overrides_with = "tolerance")]
    pub(crate) tolerance: Rational,
}

#[derive(Args, Debug)]
#[command(after_help = "\
The page is one HTML file that needs no network. It shows the plan with its envelope, the run \
next to its plan, or the rates of the experiment; docs/reference/pages.md describes it.")]
pub(crate) struct ReportArgs {
    /// The trace of a run (`run --trace`), an answer (`envelope --json`, `plan --json`, `run
    /// --json`), the results of an experiment (`results.json`), or the folder that contains them
    /// (`compare -o DIR`)
    #[arg(value_name = "FILE")]
    pub(crate) input: PathBuf,
    /// Write the page to this file instead of standard output
    #[arg(short, long, value_name = "FILE.html")]
    pub(crate) output: Option<PathBuf>,
    /// Write the run to this file in the format of Perfetto (ui.perfetto.dev); without `--output`,
    /// no page is written
    #[arg(long, value_name = "FILE.pftrace")]
    pub(crate) perfetto: Option<PathBuf>,
    /// Write the run to this MCAP file, for Foxglove and others; without `--output`, no page is
    /// written
    #[arg(long, value_name = "FILE.mcap")]
    pub(crate) mcap: Option<PathBuf>,
}

#[derive(Args, Debug)]
#[command(after_help = "\
Scope of the check: docs/reference/largest-box.md; certificates: docs/reference/formats/certificate.md; proofs that \
no plan exists: docs/reference/formats/no-plan.md.")]
pub(crate) struct VerifyArgs {
    /// Output of `elbowroom envelope --method best --json`, or of `elbowroom plan --json` if no
    /// plan exists
    #[arg(value_name = "ANSWER.json")]
    pub(crate) answer: PathBuf,
    /// The domain file. For a box: network and conditions are derived from domain, problem and plan
    /// instead of assumed. For an answer that no plan exists: replaces the path in the answer
    #[arg(value_name = "DOMAIN", requires = "problem")]
    pub(crate) domain: Option<PathBuf>,
    /// The problem file
    #[arg(value_name = "PROBLEM")]
    pub(crate) problem: Option<PathBuf>,
    /// The plan file, for a box
    #[arg(value_name = "PLAN")]
    pub(crate) plan: Option<PathBuf>,
    /// For a box of --objective probability: the world file that it was computed with, to check its
    /// probability (docs/reference/formats/world.md)
    #[arg(long, value_name = "WORLD.toml", requires = "plan")]
    pub(crate) world: Option<PathBuf>,
    /// Print the verdict as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct CompletionsArgs {
    /// The shell
    #[arg(value_name = "SHELL", value_enum)]
    pub(crate) shell: Shell,
}

#[derive(Args, Debug)]
pub(crate) struct ManArgs {
    /// The folder for the pages of all commands; without it, the page of `elbowroom` is printed
    #[arg(value_name = "DIR")]
    pub(crate) folder: Option<PathBuf>,
}

/// The problem that every command is about.
#[derive(Args, Clone, Debug)]
pub(crate) struct ProblemArgs {
    /// The domain, in PDDL
    #[arg(value_name = "DOMAIN")]
    pub(crate) domain: PathBuf,
    /// The problem, in PDDL
    #[arg(value_name = "PROBLEM")]
    pub(crate) problem: PathBuf,
    #[command(flatten)]
    pub(crate) calendar: CalendarArgs,
}

impl ProblemArgs {
    /// The files without a calendar.
    pub(crate) fn new(domain: PathBuf, problem: PathBuf) -> Self {
        Self {
            domain,
            problem,
            calendar: CalendarArgs::default(),
        }
    }
}

#[derive(Args, Debug)]
pub(crate) struct CheckArgs {
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    /// The plan, one `start: (action arguments) [duration]` a line; without it, only domain and
    /// problem are checked
    #[arg(value_name = "PLAN")]
    pub(crate) plan: Option<PathBuf>,
    /// Largest difference between a printed time or duration and that of a valid plan (T) that counts
    /// as rounding; 0 takes the plan as printed. By default one unit of the last printed digit, at
    /// most 0.001
    #[arg(long, value_name = "T", value_parser = positive_or_zero, allow_negative_numbers = true)]
    pub(crate) tolerance: Option<Rational>,
    /// Minimum time between interfering happenings (epsilon)
    #[arg(long, value_name = "E", default_value = "0.001", value_parser = positive)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) epsilon: Rational,
    /// Print the answer as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
    /// Output of errors in input files: `text`, with an excerpt, or `lines`, which also prints one
    /// `FILE: line: N: Error: message` per error on standard output
    #[arg(long, value_name = "FORM", value_enum, default_value_t = DiagnosticsForm::Text)]
    #[arg(hide_possible_values = true, conflicts_with = "json")]
    pub(crate) diagnostics: DiagnosticsForm,
    /// Not supported; VAL has such an option
    #[arg(short, long, hide = true)]
    pub(crate) verbose: bool,
}

/// Output format of errors in input texts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DiagnosticsForm {
    /// With an excerpt, on standard error
    Text,
    /// Also one line for each mistake, on standard output
    Lines,
}

#[derive(Args, Debug)]
pub(crate) struct StnArgs {
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    /// The plan: `start: (action arguments) [duration]` lines, or an STN plan file
    #[arg(value_name = "PLAN")]
    pub(crate) plan: PathBuf,
    /// Write the STN plan to this file instead of standard output
    #[arg(short, long, value_name = "FILE.stn")]
    pub(crate) output: Option<PathBuf>,
    /// Also write the network as a graph for Graphviz
    #[arg(long, value_name = "FILE")]
    pub(crate) dot: Option<PathBuf>,
    /// Largest difference between a printed time or duration and that of a valid plan (T) that counts
    /// as rounding; 0 takes the plan as printed. By default one unit of the last printed digit, at
    /// most 0.001
    #[arg(long, value_name = "T", value_parser = positive_or_zero, allow_negative_numbers = true)]
    pub(crate) tolerance: Option<Rational>,
    /// Minimum time between interfering happenings (epsilon)
    #[arg(long, value_name = "E", default_value = "0.001", value_parser = positive)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) epsilon: Rational,
    /// Print the network as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}

#[cfg(test)]
mod tests {
    use super::CommandLine;
    use clap::Parser;

    #[test]
    fn numbers_are_exact_and_validated() {
        let parse = |precision| {
            let line = [
                "elbowroom",
                "envelope",
                "d",
                "p",
                "x",
                "--precision",
                precision,
            ];
            CommandLine::try_parse_from(line).map(|_| ())
        };
        assert!(parse("1/3").is_ok());
        assert!(parse("0.125").is_ok());
        assert!(parse("0").is_err());
        assert!(parse("-1").is_err());
        assert!(parse("much").is_err());
    }
}
