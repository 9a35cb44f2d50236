//! Arguments of `elbowroom plan`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use elbowroom::answers::plan::PlanObjective;
use elbowroom::num::Rational;

use super::ProblemArgs;
use super::number::{count, positive};

#[derive(Args, Debug)]
#[command(after_long_help = PLANNER_HELP)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is an option of the command line"
)]
pub(crate) struct PlanArgs {
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    /// The planner: `embedded`, a planner known by name, `up:ENGINE`, or a command line that
    /// contains `{domain}` and `{problem}`
    #[arg(long, value_name = "NAME|\"CMD\"", default_value = EMBEDDED)]
    pub(crate) planner: String,
    /// Time limit in seconds, including the time for reading the files. Until then, the planner
    /// searches for better plans by the problem's metric, or by makespan without one, and reports
    /// each on standard error. Without it, the first plan is returned
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) time_limit: Option<Rational>,
    /// Return the first plan, even with a time limit
    #[arg(long)]
    pub(crate) first: bool,
    /// Compare plans by this in place of metric and makespan: `slack`, the deviation that all durations
    /// may have at the same time, in relation to their nominal values (docs/reference/chosen-plans.md), or
    /// `probability`, the share of successful samples of --world. Without a time limit, a fixed
    /// number of plans is compared
    #[arg(long, value_parser = plan_objective(), conflicts_with = "first")]
    pub(crate) objective: Option<PlanObjective>,
    /// The world file (docs/reference/formats/world.md) for --objective probability
    // As in `RunArgs::spoil`: conflicts of the objective are conflicts of its world also.
    #[arg(long, value_name = "WORLD.toml", requires = "objective", conflicts_with_all = ["first", "jobs"])]
    pub(crate) world: Option<PathBuf>,
    /// Let a ground action overlap itself in the plan: start again before it has ended. Without it, no plan of
    /// the embedded planner does
    #[arg(long)]
    pub(crate) self_overlap: bool,
    /// Memory limit of planning in MB; by default, 2048 for the states of the embedded planner
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..=1 << 40))]
    #[arg(allow_negative_numbers = true)]
    pub(crate) memory: Option<u64>,
    /// Number of threads of the embedded planner; 0, the default, for one per processor. It affects
    /// only the speed
    #[arg(long, value_name = "N", value_parser = count, conflicts_with = "objective")]
    #[arg(allow_negative_numbers = true)]
    pub(crate) jobs: Option<usize>,
    /// Write the plan to this file instead of standard output
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Write all numbers exactly, as fractions where they have no finite decimal; without it, as
    /// decimals that other tools read
    #[arg(long)]
    pub(crate) exact: bool,
    /// Minimum time between interfering happenings (epsilon)
    #[arg(long, value_name = "E", default_value = "0.001", value_parser = positive)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) epsilon: Rational,
    /// Print the answer as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}

fn plan_objective() -> impl TypedValueParser<Value = PlanObjective> {
    let values = PlanObjective::TERMS
        .iter()
        .map(|(objective, name, meaning)| {
            let value = PossibleValue::new(*name).help(*meaning);
            match objective {
                PlanObjective::Slack => value.alias("room"),
                PlanObjective::Probability => value,
            }
        });
    PossibleValuesParser::new(values).try_map(|name| name.parse::<PlanObjective>())
}

/// The planner that is always there.
pub(crate) const EMBEDDED: &str = elbowroom::answers::plan::EMBEDDED;

const PLANNER_HELP: &str = "\
Planners:
  embedded          the planner that is part of this program
  popf              POPF; found in PATH or through ELBOWROOM_POPF
  optic             OPTIC; ELBOWROOM_OPTIC
  tfd               Temporal Fast Downward; ELBOWROOM_TFD
  lpg-td            LPG-td; ELBOWROOM_LPG
  up:ENGINE         an engine of unified-planning, such as up:aries;
                    ELBOWROOM_PYTHON names the Python that has it
  \"CMD …\"           any program that prints a plan or writes it to {plan};
                    {domain} and {problem} are its files, {time} and {memory}
                    the limits in seconds and MB

Every plan is validated before it is printed, whichever planner made it. At the time limit and on \
Ctrl-C the best plan so far is printed. docs/reference/planners.md explains how to install each planner and \
what each outcome means.";
