//! Arguments of `elbowroom run`.

use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};
use elbowroom::answers::envelope::objective_of;
use elbowroom::envelope::{Guarantee, Method, Objective};
use elbowroom::execution::executors::DEFAULT_EXECUTOR;
use elbowroom::execution::run::TimeoutRule;
use elbowroom::num::Rational;

use super::CalendarArgs;
use super::envelope::{BoxMethod, controllable};
use super::number::{count, factor, integer, positive, positive_or_zero, timeout};
use super::plan::EMBEDDED;
use super::term::term;
use crate::exit::Failure;
use elbowroom_executive::http::Address;

#[derive(Args, Debug)]
#[command(after_long_help = executors_help())]
#[command(group(ArgGroup::new("programs").args(["world_process", "resume"])))]
#[command(group(ArgGroup::new("journals").args(["journal", "resume"]).multiple(true)))]
#[command(group(ArgGroup::new("clocks").args(["realtime", "world_process", "resume"]).multiple(true)))]
pub(crate) struct RunArgs {
    /// The domain, in PDDL
    #[arg(value_name = "DOMAIN", required_unless_present_any = ["replay", "resume"])]
    pub(crate) domain: Option<PathBuf>,
    /// The problem, in PDDL
    #[arg(value_name = "PROBLEM")]
    pub(crate) problem: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) calendar: CalendarArgs,
    /// The plan to begin with; without it, the planner makes one
    #[arg(value_name = "PLAN", conflicts_with = "plan")]
    pub(crate) first_plan: Option<PathBuf>,
    /// The same as PLAN
    #[arg(long, value_name = "FILE")]
    pub(crate) plan: Option<PathBuf>,
    /// The planner: `embedded`, another one as in `elbowroom plan`, or `none`: the run ends when
    /// the plan no longer works
    #[arg(long, value_name = "NAME|CMD", default_value = EMBEDDED)]
    pub(crate) planner: String,
    /// Planning time in seconds for a planner other than the embedded one; without it, its first
    /// plan within a minute is used
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) planner_time: Option<Rational>,
    /// Choice of the first plan, where the embedded planner makes it: the shortest, or the
    /// likeliest of several. The likeliest is the one with which the executor succeeds most often
    /// in samples of --world, or, without a world file, the one whose actions are likeliest to
    /// succeed by --likelihoods. By default the likeliest if one of these two is given, and the
    /// shortest otherwise
    #[arg(long = "first-plan", value_enum)]
    pub(crate) first_plan_by: Option<FirstPlanChoice>,
    /// Work limit for each choice of the first plan and each new plan, in seconds of one processor. The
    /// work is counted, so that it is the same on every machine. As long as there is no plan at all, a
    /// search may take four times as much
    #[arg(long, value_name = "S", value_parser = positive, default_value = "2")]
    #[arg(allow_negative_numbers = true)]
    pub(crate) planning_budget: Rational,
    /// Number of states that the embedded planner may evaluate for a plan; without it, only
    /// --planning-budget limits them
    #[arg(long, value_name = "N", value_parser = integer)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) planner_states: Option<u64>,
    /// Number of states after the first plan, in search of a better one
    #[arg(long, value_name = "N", default_value_t = 2_000, value_parser = integer)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) improve_states: u64,
    /// Let a ground action overlap itself in plans of the embedded planner: start again before it
    /// has ended. Without it, no generated plan does; a given plan may, with a warning
    #[arg(long, conflicts_with_all = ["replay", "resume"])]
    pub(crate) self_overlap: bool,
    /// Number of threads of the embedded planner; 0 for one per processor; 1 by default, because
    /// the other processors of a robot are in use. It affects only the speed
    #[arg(long, value_name = "N", value_parser = count, conflicts_with = "replay")]
    #[arg(allow_negative_numbers = true)]
    pub(crate) jobs: Option<usize>,
    /// The simulated world (docs/reference/formats/world.md), or `spoiler`, an adversary that ends each
    /// action at the worst time; without it, everything goes as planned
    #[arg(long, value_name = "WORLD.toml|spoiler")]
    pub(crate) world: Option<PathBuf>,
    /// The world file that the executor assumes, for example the output of `elbowroom learn`:
    /// durations, failures and changes of facts, for the executors, first plans and envelopes that
    /// use them; or the folder of --learn. By default that of --world; none with --world-process
    #[arg(long, value_name = "WORLD.toml|FOLDER")]
    pub(crate) believed: Option<PathBuf>,
    /// The box from which the spoiler chooses durations, as in `envelope --contains`; by default
    /// the plan's envelope
    // clap does not require an argument that conflicts with a given one, so each conflict is
    // repeated here.
    #[arg(
        long,
        value_name = "BOX",
        requires = "world",
        conflicts_with = "world_process"
    )]
    pub(crate) spoil: Option<String>,
    /// A program that is the world and speaks JSON Lines (docs/reference/formats/world-protocol.md)
    #[arg(long, value_name = "COMMAND", conflicts_with = "world")]
    pub(crate) world_process: Option<String>,
    /// Time limit in seconds for each answer of that program
    #[arg(long, value_name = "S", default_value = "3600", value_parser = positive)]
    #[arg(allow_negative_numbers = true)]
    #[arg(requires = "programs")]
    pub(crate) answer_within: Rational,
    /// Number of restarts of the program of --world-process after it has ended or failed. It reports the actions that
    /// were running; those that it does not know count as failed
    #[arg(long, value_name = "N", default_value = "0", requires = "programs")]
    #[arg(allow_negative_numbers = true)]
    pub(crate) restart_world: u32,
    /// End the run at the first message of that program that is malformed or names something that
    /// the problem does not have; otherwise such messages are recorded and ignored
    #[arg(long, requires = "programs")]
    pub(crate) strict_world: bool,
    /// The executor
    #[arg(long, value_name = "NAME", default_value = DEFAULT_EXECUTOR)]
    pub(crate) executor: String,
    /// Probabilities of success and of spontaneous change (docs/reference/formats/likelihoods.md), for the
    /// executors that use them (`adaptable`, `lookahead`) and the choice of the first plan; without
    /// it, everything is certain
    #[arg(long, value_name = "FILE")]
    pub(crate) likelihoods: Option<PathBuf>,
    /// Seed of the world's random numbers
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        value_parser = integer,
        allow_negative_numbers = true,
        conflicts_with = "world_process"
    )]
    pub(crate) seed: u64,
    /// A quantity that may deviate, see `elbowroom help envelope`; by default all durations
    #[arg(long, value_name = "SPEC")]
    pub(crate) vary: Vec<String>,
    /// An action whose duration the executor chooses, see `elbowroom help envelope`
    #[arg(long, value_name = "ACTION")]
    pub(crate) controllable: Vec<String>,
    /// The guarantee that holds inside the envelopes
    #[arg(long, value_parser = term(Guarantee::TERMS), default_value_t = Guarantee::Dynamic)]
    pub(crate) guarantee: Guarantee,
    /// The algorithm for envelopes, see `elbowroom help envelope`; by default `best`, and `irr` with
    /// --precision
    #[arg(long, value_enum)]
    pub(crate) method: Option<BoxMethod>,
    /// IRR: step size at which the search for an envelope ends, in the unit of the plan; by default
    /// a hundredth of each nominal value
    #[arg(long, value_name = "B", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) precision: Option<Rational>,
    /// The objective of the envelopes, see `elbowroom help envelope`; by default `least-slack`
    #[arg(long, value_parser = term(Objective::TERMS))]
    pub(crate) objective: Option<Objective>,
    /// Treatment of running actions when a new plan is made
    #[arg(long, value_enum, default_value_t = RunningChoice::Keep)]
    pub(crate) running: RunningChoice,
    /// Time that planning takes in the world: `measured`, or a number of seconds; by default 0,
    /// with --realtime and --world-process `measured`. If it is measured, plans are made in the
    /// background while the run continues (docs/reference/serve.md)
    #[arg(long, value_name = "measured|S", allow_negative_numbers = true)]
    pub(crate) planning_time: Option<String>,
    /// Memory limit in MB of a planner in the background
    #[arg(long, value_name = "MB", default_value = "1000", value_parser = clap::value_parser!(u64).range(1..1_000_000))]
    pub(crate) planner_memory: Option<u64>,
    /// Time-out of each action, from its start or its last progress: `none`, a number of seconds, or
    /// `10x,600`, the default: 10 times the planned duration, at least 600; with exceptions for some
    /// actions: `10x,600; drive=40; (pick a)=3x,5`. `learn` prints the time-outs that follow from logs.
    /// An action that reaches its time-out is cancelled, after a warning
    #[arg(long, value_name = "RULE", value_parser = timeout, default_value_t)]
    #[arg(hide_default_value = true, allow_negative_numbers = true)]
    pub(crate) timeout: TimeoutRule,
    /// Number of new plans that may be made until an action is completed; a run makes at most ten
    /// times as many
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = count)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) max_replans: usize,
    /// Time limit of the run, in seconds of the world
    #[arg(long, value_name = "S", default_value = "1000000", value_parser = positive)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) time_limit: Rational,
    /// Run on a wall clock, FACTOR times as fast (0.000001 to 1000000000); measured planning times
    /// are multiplied by FACTOR. A world process has a clock of its own
    #[arg(long, value_name = "FACTOR", value_parser = factor)]
    #[arg(allow_negative_numbers = true, conflicts_with = "world_process")]
    pub(crate) realtime: Option<Rational>,
    /// Write a trace of the run to this file (docs/reference/formats/trace.md)
    #[arg(long, value_name = "FILE.jsonl")]
    pub(crate) trace: Option<PathBuf>,
    /// Write the run in the format of Perfetto (ui.perfetto.dev)
    #[arg(long, value_name = "FILE", conflicts_with = "replay")]
    pub(crate) perfetto: Option<PathBuf>,
    /// Write the run as an MCAP file, for Foxglove
    #[arg(long, value_name = "FILE.mcap", conflicts_with = "replay")]
    pub(crate) mcap: Option<PathBuf>,
    /// Write a journal of the run to this file (docs/reference/formats/journal.md): a trace that survives a
    /// crash. Each start is on disk before it is sent. A simulated world ends with the program and
    /// has no journal
    #[arg(
        long,
        value_name = "FILE",
        requires = "world_process",
        conflicts_with_all = ["trace", "world", "realtime", "seed"]
    )]
    pub(crate) journal: Option<PathBuf>,
    /// Learn from the journal whenever an executive is idle, and at the end: this folder keeps
    /// copies of its segments, and world.toml, the model learnt from all logs in it, for --believed
    #[arg(long, value_name = "FOLDER", requires = "journals")]
    pub(crate) learn: Option<PathBuf>,
    /// Serve the page of `elbowroom report` during the run, at this port or HOST:PORT of this
    /// machine; without one, at a free port. Only for this machine unless HOST says otherwise
    #[arg(long, value_name = "ADDRESS", value_parser = Address::read, num_args = 0..=1)]
    #[arg(
        default_missing_value = "0",
        require_equals = true,
        requires = "clocks"
    )]
    #[arg(conflicts_with = "replay")]
    pub(crate) serve: Option<Address>,
    /// Clients with the token in this file may pause, cancel and stop the run on that page
    #[arg(long, value_name = "FILE", alias = "control", requires = "serve")]
    pub(crate) token: Option<PathBuf>,
    /// Resume a crashed run from its journal: the world reports the state of the actions that were
    /// running; all other options are taken from the journal
    #[arg(long, value_name = "FILE", conflicts_with_all = FIXED_BY_TRACE, conflicts_with = "replay")]
    pub(crate) resume: Option<PathBuf>,
    /// Replay a stored trace and check that the decisions are the same; all other options are taken
    /// from the trace
    #[arg(long, value_name = "TRACE", conflicts_with_all = FIXED_BY_TRACE)]
    #[arg(conflicts_with_all = ["answer_within", "restart_world", "strict_world"])]
    pub(crate) replay: Option<PathBuf>,
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
}

impl RunArgs {
    /// The plan to begin with, if one is given.
    pub(crate) fn plan(&self) -> Option<&PathBuf> {
        self.first_plan.as_ref().or(self.plan.as_ref())
    }

    /// Returns `true` if the world is the spoiler.
    pub(crate) fn has_adversary(&self) -> bool {
        self.world.as_deref() == Some(std::path::Path::new("spoiler"))
    }

    /// Returns the objective of the envelopes; `None` if they are those of IRR.
    ///
    /// # Errors
    /// When IRR is asked for something that only the largest box has.
    pub(crate) fn objective(&self) -> Result<Option<Objective>, Failure> {
        let method = self.method.map(|method| match method {
            BoxMethod::Irr => Method::Irr,
            BoxMethod::Best => Method::Best,
        });
        objective_of(method, self.objective, self.precision.is_some()).map_err(|_| {
            Failure::new(
                "--objective applies to the largest box, which --method irr does not compute",
                "leave out --method irr, or --objective",
            )
        })
    }

    /// The `--vary` specifications of the arguments.
    pub(crate) fn specifications(&self) -> Vec<String> {
        let controllable = controllable(&self.controllable);
        self.vary.iter().cloned().chain(controllable).collect()
    }
}

/// By what the first plan is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FirstPlanChoice {
    /// The planner's own plan, the best by length or by the problem's metric
    Shortest,
    /// The plan with the greatest success probability
    Likeliest,
}

/// Options that a stored trace fixes, so that the command line cannot change them.
const FIXED_BY_TRACE: &[&str] = &[
    "domain",
    "problem",
    "calendar",
    "begin",
    "first_plan",
    "plan",
    "planner",
    "planner_time",
    "first_plan_by",
    "planning_budget",
    "planner_states",
    "improve_states",
    "world",
    "believed",
    "spoil",
    "world_process",
    "executor",
    "likelihoods",
    "seed",
    "vary",
    "controllable",
    "guarantee",
    "method",
    "precision",
    "objective",
    "running",
    "planning_time",
    "timeout",
    "max_replans",
    "time_limit",
    "realtime",
    "trace",
    "journal",
    "epsilon",
    "tolerance",
];

/// The treatment of running actions when a new plan is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RunningChoice {
    /// Cancel them
    Cancel,
    /// Wait until they end
    Await,
    /// Let them run, as part of the new plan
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
