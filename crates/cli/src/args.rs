//! What can be said on the command line.

mod network;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use elbowroom::num::Rational;

pub(crate) use network::{DurationsChoice, NetworkArgs};

/// How much elbow room does a temporal plan have?
#[derive(Debug, Parser)]
#[command(
    name = "elbowroom",
    version,
    propagate_version = true,
    max_term_width = 100
)]
#[command(long_about = "How much elbow room does a temporal plan have?\n\n\
    Elbowroom reads PDDL 2.1 problems with durative actions. It finds a plan for them, or has \
    another planner find one (`plan`); says whether a plan is valid (`check`), which of its orderings and times matter (`stn`), and how far each \
    duration, rate or deadline may deviate while the plan is still guaranteed to work (`envelope`).")]
#[command(after_help = "\
Wherever a file is asked for, `-` means standard input.

Exit codes: 0 the answer is yes, or done; 1 the answer is no; 2 the input or the command line is \
wrong; 3 a limit was reached with nothing to show; 70 a bug.")]
pub(crate) struct CommandLine {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Say whether a plan is valid, and if not, what is wrong with it
    Check(CheckArgs),
    /// Find a plan, or have another planner find one
    Plan(PlanArgs),
    /// Turn a plan with fixed times into a network that leaves room (an STN plan)
    Stn(StnArgs),
    /// Find out how far each duration, rate or deadline may deviate
    Envelope(Box<EnvelopeArgs>),
    /// Execute a plan in a world, watch it, and replan when it no longer works
    Run(Box<RunArgs>),
    /// Compare executors in many runs of an experiment
    Compare(CompareArgs),
    /// Say what can be promised about a temporal network in a format of the field
    Network(NetworkArgs),
}

/// The problem that every command is about.
#[derive(Args, Debug)]
pub(crate) struct ProblemArgs {
    /// The domain, in PDDL
    #[arg(value_name = "DOMAIN")]
    pub(crate) domain: PathBuf,
    /// The problem, in PDDL
    #[arg(value_name = "PROBLEM")]
    pub(crate) problem: PathBuf,
}

#[derive(Args, Debug)]
pub(crate) struct CheckArgs {
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    /// The plan, one `start: (action arguments) [duration]` a line; without it, only domain and
    /// problem are checked
    #[arg(value_name = "PLAN")]
    pub(crate) plan: Option<PathBuf>,
    /// Judge like VAL with `-t T`: times closer than that count as equal, and interfering actions
    /// only must not happen at the same time
    #[arg(long, value_name = "T", value_parser = positive_or_zero)]
    pub(crate) tolerance: Option<Rational>,
    /// How far apart interfering happenings must be
    #[arg(long, value_name = "E", default_value = "0.001", value_parser = positive)]
    #[arg(conflicts_with = "tolerance")]
    pub(crate) epsilon: Rational,
    /// Print the answer as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
#[command(after_long_help = PLANNER_HELP)]
pub(crate) struct PlanArgs {
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    /// Who plans: `embedded`, a planner known by name, `up:ENGINE`, or a command line with
    /// `{domain}` and `{problem}` in it
    #[arg(long, value_name = "NAME|\"CMD\"", default_value = EMBEDDED)]
    pub(crate) planner: String,
    /// Go on to better plans until so many seconds have passed; without it, the first plan is
    /// taken. Better is what the problem's metric says, or else what ends earlier
    #[arg(long, value_name = "S", value_parser = positive)]
    pub(crate) time_limit: Option<Rational>,
    /// Stop at the first plan, also with a time limit
    #[arg(long)]
    pub(crate) first: bool,
    /// Use no more than so many MB of memory
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..=1 << 40))]
    pub(crate) memory: Option<u64>,
    /// Write the plan there instead of to standard output
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// How far apart interfering happenings must be
    #[arg(long, value_name = "E", default_value = "0.001", value_parser = positive)]
    pub(crate) epsilon: Rational,
    /// Print the answer as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}

/// Nobody plans.
pub(crate) const NOBODY: &str = "none";

/// The planner that is always there.
pub(crate) const EMBEDDED: &str = elbowroom::answers::plan::EMBEDDED;

const PLANNER_HELP: &str = "\
Planners:
  embedded          the one that is part of this program
  popf              POPF; found in PATH, or where ELBOWROOM_POPF says
  optic             OPTIC; ELBOWROOM_OPTIC
  tfd               Temporal Fast Downward; ELBOWROOM_TFD
  lpg-td            LPG-td; ELBOWROOM_LPG
  up:ENGINE         an engine of unified-planning, such as up:aries; ELBOWROOM_PYTHON names the
                    Python that has it
  \"CMD …\"           any program that prints a plan or writes it to {plan}. {domain} and {problem}
                    are its files, {time} and {memory} the limits in seconds and MB

Every plan is judged before it is printed, whoever made it. The best plan so far is printed when the
time is up, and at Ctrl-C. docs/planners.md says how to get each planner, and what each outcome
means.";

#[derive(Args, Debug)]
pub(crate) struct StnArgs {
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    /// The plan: `start: (action arguments) [duration]` lines, or an STN plan file
    #[arg(value_name = "PLAN")]
    pub(crate) plan: PathBuf,
    /// Write the STN plan there instead of to standard output
    #[arg(short, long, value_name = "FILE.stn")]
    pub(crate) output: Option<PathBuf>,
    /// Also write the network as a graph for Graphviz
    #[arg(long, value_name = "FILE")]
    pub(crate) dot: Option<PathBuf>,
    /// How far apart interfering happenings must be
    #[arg(long, value_name = "E", default_value = "0.001", value_parser = positive)]
    pub(crate) epsilon: Rational,
    /// Print the network as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
#[command(after_long_help = VARY_HELP)]
pub(crate) struct EnvelopeArgs {
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    /// The plan: `start: (action arguments) [duration]` lines, or an STN plan file
    #[arg(value_name = "PLAN|FILE.stn")]
    pub(crate) plan: PathBuf,
    /// What to leave open; repeat for more. By default all durations, or what the STN plan file or
    /// the domain (`:synth-parameters`) leaves open
    #[arg(long, value_name = "SPEC")]
    pub(crate) vary: Vec<String>,
    /// How to search
    #[arg(long, value_enum, default_value_t = Method::Irr, hide_possible_values = true)]
    pub(crate) method: Method,
    /// How close to its limit each end should come
    #[arg(long, value_name = "B", default_value = "1", value_parser = positive)]
    pub(crate) precision: Rational,
    /// Whether steps double while they succeed, or stay as they are
    #[arg(long, value_enum, default_value_t = Growth::Doubling)]
    pub(crate) growth: Growth,
    /// Finally move each end exactly onto its limit
    #[arg(long)]
    pub(crate) sharpen: bool,
    /// What is guaranteed inside the envelope
    #[arg(long, value_enum, default_value_t = Guarantee::Dynamic)]
    pub(crate) guarantee: Guarantee,
    /// Have the dispatcher keep to every obligation that is a bound on the difference of two times,
    /// so that schedules which break one do not count
    #[arg(long)]
    pub(crate) enforce: bool,
    /// Actions whose durations the executor chooses, so that they are not left open: a name, a
    /// label or `(name argument …)`, `_` for any argument; may be repeated
    #[arg(long, value_name = "ACTION")]
    pub(crate) controllable: Vec<String>,
    /// How far apart interfering happenings must be
    #[arg(long, value_name = "E", default_value = "0.001", value_parser = positive)]
    pub(crate) epsilon: Rational,
    /// Stop after so many seconds with the best envelope so far
    #[arg(long, value_name = "S", value_parser = positive)]
    pub(crate) time_limit: Option<Rational>,
    /// Only say whether this box is inside: `"dur_0=[7/4,12] dur_7=[0,inf]"`; parameters left out
    /// keep their nominal value
    #[arg(long, value_name = "BOX")]
    pub(crate) contains: Option<String>,
    /// Print the answer as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
#[command(after_long_help = executors_help())]
pub(crate) struct RunArgs {
    /// The domain, in PDDL
    #[arg(value_name = "DOMAIN", required_unless_present = "replay")]
    pub(crate) domain: Option<PathBuf>,
    /// The problem, in PDDL
    #[arg(value_name = "PROBLEM", required_unless_present = "replay")]
    pub(crate) problem: Option<PathBuf>,
    /// The plan to begin with; without it, a plan is made
    #[arg(long, value_name = "FILE")]
    pub(crate) plan: Option<PathBuf>,
    /// Who makes plans: `embedded`, another planner as in `elbowroom plan`, or `none`: when the plan
    /// no longer works, the run is over
    #[arg(long, value_name = "NAME|CMD", default_value = EMBEDDED)]
    pub(crate) planner: String,
    /// Let another planner go on to better plans for so many seconds; otherwise its first plan is
    /// taken, and it has a minute for that
    #[arg(long, value_name = "S", value_parser = positive)]
    pub(crate) planner_time: Option<Rational>,
    /// How many states the embedded planner may look at for one plan
    #[arg(long, value_name = "N", default_value_t = 20_000)]
    pub(crate) planner_states: u64,
    /// How many of them for a better plan than the first
    #[arg(long, value_name = "N", default_value_t = 2_000)]
    pub(crate) improve_states: u64,
    /// The world to execute in (docs/formats/world.md), or `spoiler`: one that lets each action of
    /// the plan end when that is worst; without it, everything goes as planned
    #[arg(long, value_name = "WORLD.toml|spoiler")]
    pub(crate) world: Option<PathBuf>,
    /// The box inside which the spoiler chooses durations: `"dur_0=[8,14]"`; by default the plan's
    /// envelope
    #[arg(long, value_name = "BOX", requires = "world")]
    pub(crate) spoil: Option<String>,
    /// A program that is the world, and talks JSON Lines (docs/formats/world-protocol.md)
    #[arg(long, value_name = "COMMAND", conflicts_with = "world")]
    pub(crate) world_process: Option<String>,
    /// How long that program may take over each answer, in seconds
    #[arg(long, value_name = "S", default_value = "3600", value_parser = positive)]
    #[arg(requires = "world_process")]
    pub(crate) answer_within: Rational,
    /// End the run when that program says something that cannot be understood, or names what the
    /// problem does not have; otherwise the trace has it, and the run goes on
    #[arg(long, requires = "world_process")]
    pub(crate) strict_world: bool,
    /// Who decides
    #[arg(long, value_name = "NAME", default_value = "guarded")]
    pub(crate) executor: String,
    /// How likely actions and effects are to succeed, and facts to change by themselves, for
    /// executors that go by that; without it, everything is certain
    #[arg(long, value_name = "FILE")]
    pub(crate) likelihoods: Option<PathBuf>,
    /// Which of the possible trajectories of the world to take
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        conflicts_with = "world_process"
    )]
    pub(crate) seed: u64,
    /// What to leave open, see `elbowroom help envelope`; by default all durations
    #[arg(long, value_name = "SPEC")]
    pub(crate) vary: Vec<String>,
    /// Actions whose durations the executor chooses, see `elbowroom help envelope`
    #[arg(long, value_name = "ACTION")]
    pub(crate) controllable: Vec<String>,
    /// What is guaranteed inside the envelopes that executors go by
    #[arg(long, value_enum, default_value_t = Guarantee::Dynamic)]
    pub(crate) guarantee: Guarantee,
    /// How close to its limit each end of the envelope should come
    #[arg(long, value_name = "B", default_value = "1", value_parser = positive)]
    pub(crate) precision: Rational,
    /// What becomes of running actions when a new plan is made
    #[arg(long, value_enum, default_value_t = RunningChoice::Keep)]
    pub(crate) running: RunningChoice,
    /// How long making a plan takes in the world: `measured`, or always so many seconds; by default
    /// 0, and with --realtime `measured`
    #[arg(long, value_name = "measured|S")]
    pub(crate) planning_time: Option<String>,
    /// How often a new plan may be made
    #[arg(long, value_name = "N", default_value_t = 10)]
    pub(crate) max_replans: usize,
    /// When the run ends in any case, in the world's seconds
    #[arg(long, value_name = "S", default_value = "1000000", value_parser = positive)]
    pub(crate) time_limit: Rational,
    /// Let so many seconds of the world pass in one second (0.000001 to 1000000000); measured
    /// planning times are multiplied by that. A process is its own clock
    #[arg(long, value_name = "FACTOR", value_parser = factor, conflicts_with = "world_process")]
    pub(crate) realtime: Option<Rational>,
    /// Write the record of the run there (docs/formats/trace.md)
    #[arg(long, value_name = "FILE.jsonl")]
    pub(crate) trace: Option<PathBuf>,
    /// Play a stored trace back, and say whether it comes to the same decisions
    /// (everything else is in the trace)
    #[arg(long, value_name = "TRACE", conflicts_with_all = IN_THE_TRACE)]
    pub(crate) replay: Option<PathBuf>,
    /// How far apart interfering happenings must be
    #[arg(long, value_name = "E", default_value = "0.001", value_parser = positive)]
    pub(crate) epsilon: Rational,
    /// Print the outcome as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}

impl RunArgs {
    /// Whether the world is the spoiler.
    pub(crate) fn is_spoiled(&self) -> bool {
        self.world.as_deref() == Some(std::path::Path::new("spoiler"))
    }

    /// What to leave open, and what not.
    pub(crate) fn specifications(&self) -> Vec<String> {
        let controllable = controllable(&self.controllable);
        self.vary.iter().cloned().chain(controllable).collect()
    }
}

/// What says that the executor chooses the durations of these actions.
pub(crate) fn controllable(actions: &[String]) -> Vec<String> {
    actions
        .iter()
        .map(|action| format!("controllable {action}"))
        .collect()
}

/// What a stored trace says, and the command line cannot change.
const IN_THE_TRACE: &[&str] = &[
    "domain",
    "problem",
    "plan",
    "planner",
    "planner_time",
    "planner_states",
    "improve_states",
    "world",
    "spoil",
    "world_process",
    "answer_within",
    "strict_world",
    "executor",
    "likelihoods",
    "seed",
    "vary",
    "controllable",
    "guarantee",
    "precision",
    "running",
    "planning_time",
    "max_replans",
    "time_limit",
    "realtime",
    "trace",
    "epsilon",
];

#[derive(Args, Debug)]
pub(crate) struct CompareArgs {
    /// The experiment (docs/formats/experiment.md)
    #[arg(value_name = "EXPERIMENT.toml")]
    pub(crate) experiment: PathBuf,
    /// How many trials of each problem; by default as many as the experiment says
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) trials: Option<u64>,
    /// How many threads; 0 is as many as there are processors
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) jobs: usize,
    /// Make only the part `I` of `N`, counted from 0
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub(crate) shard: Option<(u64, u64)>,
    /// Make no trials, but put the results of parts together
    #[arg(long, value_name = "RESULTS.json", num_args = 1.., conflicts_with_all = ["shard", "trials"])]
    pub(crate) merge: Vec<PathBuf>,
    /// Write results.json, table.md, table.csv and, where there are plots, these there
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Print the results as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}

fn shard(text: &str) -> Result<(u64, u64), String> {
    let numbers = text.split_once('/');
    let numbers = numbers.and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match numbers {
        Some((shard, shards)) if shard < shards => Ok((shard, shards)),
        _ => Err("write I/N with 0 <= I < N, as in 0/4".to_owned()),
    }
}

/// What becomes of running actions when a new plan is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RunningChoice {
    /// They are cancelled
    Cancel,
    /// They are awaited
    Await,
    /// They go on, and the plan goes on with them
    Keep,
}

fn executors_help() -> String {
    use std::fmt::Write as _;
    let mut text = String::from("Executors:\n");
    for executor in elbowroom::execution::executors::EXECUTORS {
        let _ = writeln!(text, "  {}", executor.usage());
        let _ = writeln!(text, "      {}", executor.summary);
        let _ = writeln!(text, "      ({})", executor.paper);
    }
    text
}

const VARY_HELP: &str = "\
What --vary can leave open:
  durations                              all durations (the default)
  duration ACTIONS                       the durations of these
  constant ACTIONS FUNCTION [VALUE]      a number in their effects on the function
  condition ACTIONS FUNCTION [VALUE]     a number that their conditions compare it with
  initial (FUNCTION object ...)          a value at time 0
  deadline (PREDICATE object ...)        when timed initials make the fact false
  timed (NAME object ...)                when timed initials change it in any way
  ?s=VALUE, n0.?r=VALUE                  a :synth-parameters number, nominally VALUE

ACTIONS is an action's name, a label (n0), or (NAME object _ ...), where _ is any object. After any
of these, `weight W` says how strongly to favour it, `in [LB, UB]` which values it can take at all,
and after a constant or condition `shared` makes one number of it for all instances.";

/// How to search for an envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Method {
    /// Widen one end at a time (incremental rectangular robustification)
    Irr,
    /// The box that is best by a stated objective
    Best,
    /// The whole region
    Exact,
}

/// What steps do while they succeed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Growth {
    /// They double
    Doubling,
    /// They stay
    Constant,
}

/// What is guaranteed inside an envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Guarantee {
    /// For all values there is a schedule, if they are known in advance (as in the papers)
    Weak,
    /// An executor that learns each value only as it comes about reaches the goal
    Dynamic,
    /// Start times fixed beforehand do for all values
    Strong,
}

impl From<Guarantee> for elbowroom::envelope::Guarantee {
    fn from(guarantee: Guarantee) -> Self {
        match guarantee {
            Guarantee::Weak => Self::Weak,
            Guarantee::Dynamic => Self::Dynamic,
            Guarantee::Strong => Self::Strong,
        }
    }
}

fn number(text: &str) -> Result<Rational, String> {
    text.parse::<Rational>().map_err(|error| error.to_string())
}

fn positive(text: &str) -> Result<Rational, String> {
    let value = number(text)?;
    if value.is_positive() {
        Ok(value)
    } else {
        Err("it must be greater than 0".to_owned())
    }
}

fn factor(text: &str) -> Result<Rational, String> {
    let value = number(text)?;
    // Beyond that, a world stands still for years, or there is no clock to speak of.
    if value < Rational::new(1, 1_000_000) || value > Rational::from(1_000_000_000) {
        return Err("it must lie between 0.000001 and 1000000000".to_owned());
    }
    Ok(value)
}

fn positive_or_zero(text: &str) -> Result<Rational, String> {
    let value = number(text)?;
    if value.is_negative() {
        Err("it must not be negative".to_owned())
    } else {
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::CommandLine;
    use clap::{CommandFactory, Parser};

    #[test]
    fn the_command_line_is_consistent() {
        CommandLine::command().debug_assert();
    }

    #[test]
    fn numbers_are_exact_and_must_make_sense() {
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
