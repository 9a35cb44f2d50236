//! Arguments of `elbowroom envelope`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use elbowroom::RoundingRule;
use elbowroom::envelope::{self as library, Guarantee, Objective};
use elbowroom::execution::run::TimeoutRule;
use elbowroom::num::Rational;

use super::ProblemArgs;
use super::number::{
    FaultCount, Times, fault_count, integer, positive, positive_or_zero, retries, timeout, times,
};
use super::term::term;
use crate::exit::Failure;

#[derive(Args, Debug)]
#[command(after_long_help = VARY_HELP)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a flag of the command line"
)]
pub(crate) struct EnvelopeArgs {
    #[command(flatten)]
    pub(crate) problem: ProblemArgs,
    /// The plan: `start: (action arguments) [duration]` lines, or an STN plan file
    #[arg(value_name = "PLAN|FILE.stn")]
    pub(crate) plan: PathBuf,
    /// A quantity that may deviate; may be repeated. By default all durations,
    /// or the parameters of the STN plan file or of the domain (`:synth-parameters`)
    #[arg(long, value_name = "SPEC")]
    pub(crate) vary: Vec<String>,
    /// The algorithm: by default `best`; `irr` with --precision, --growth or --sharpen, and for
    /// problems with processes or events
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// Objective that the largest box maximises; by default the least slack
    #[arg(long, value_parser = term(Objective::TERMS))]
    objective: Option<Objective>,
    /// With --objective probability: the world file that says how long actions take
    /// (docs/reference/formats/world.md)
    #[arg(long, value_name = "FILE")]
    pub(crate) world: Option<PathBuf>,
    /// The largest box whose intervals have both bounds equally far from the nominal value
    #[arg(long)]
    symmetric: bool,
    /// The largest box where bounds count up to a deviation of N times the nominal value (by
    /// default 9), unless `in [LB, UB]` of --vary is narrower; bounds without any limit remain
    /// infinite
    #[arg(long, value_name = "N", value_parser = positive, allow_negative_numbers = true)]
    cap: Option<Rational>,
    /// IRR: step size at which the search ends, in the unit of the plan; each bound is then within
    /// twice this of its limit. By default a hundredth of each nominal value
    #[arg(long, value_name = "B", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) precision: Option<Rational>,
    /// IRR: step size after a success, doubled (default) or constant
    #[arg(long, value_enum)]
    pub(crate) growth: Option<Growth>,
    /// IRR: finally move each bound exactly to its limit
    #[arg(long)]
    pub(crate) sharpen: bool,
    /// The guarantee that holds inside the envelope; by default dynamic
    #[arg(long, value_parser = term(Guarantee::TERMS))]
    pub(crate) guarantee: Option<Guarantee>,
    /// Add the plan's conditions to the network where they bound the difference of two times: the
    /// dispatcher then enforces them, and the envelope may be wider
    #[arg(long)]
    pub(crate) enforce: bool,
    /// An action whose duration the executor chooses, so that it does not vary: a name, a label or
    /// `(name argument …)`, where `_` matches any argument; may be repeated
    #[arg(long, value_name = "ACTION")]
    pub(crate) controllable: Vec<String>,
    /// Largest difference between a printed time or duration and that of a valid plan (T) that counts
    /// as rounding; 0 takes the plan as printed. By default one unit of the last printed digit, at
    /// most 0.001
    #[arg(long, value_name = "T", value_parser = positive_or_zero, allow_negative_numbers = true)]
    pub(crate) tolerance: Option<Rational>,
    /// Minimum time between interfering happenings (epsilon)
    #[arg(long, value_name = "E", default_value = "0.001", value_parser = positive)]
    #[arg(allow_negative_numbers = true)]
    pub(crate) epsilon: Rational,
    /// Time limit in seconds; then the best envelope found is printed
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) time_limit: Option<Rational>,
    /// Time-out of each action, a condition of the guarantee: `none`, a number of seconds, or
    /// `10x,600`, the default: 10 times the planned duration, at least 600; with exceptions for
    /// some actions: `10x,600; drive=40; (pick a)=3x,5`. --contains rejects a box beyond it
    #[arg(long, value_name = "RULE", value_parser = timeout, allow_negative_numbers = true)]
    pub(crate) timeout: Option<TimeoutRule>,
    /// Test whether this box is inside the envelope: `"dur_0=[7/4,12] (drive a b)=12 drive=[8,20]
    /// all=±10%"`, where `drive` selects all durations of this action; parameters that are not
    /// named keep their nominal value
    #[arg(long, value_name = "BOX")]
    pub(crate) contains: Option<String>,
    /// Order of the rows: as in the plan (default), or by increasing slack
    #[arg(long, value_enum)]
    pub(crate) order: Option<Order>,
    /// With --method exact: the volume of the region, and the shares of it that the boxes of IRR
    /// and `best` cover; exact for up to 6 connected parameters, sampled for more
    #[arg(long)]
    pub(crate) volume: bool,
    /// Random seed of the samples of --volume
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = integer)]
    #[arg(allow_negative_numbers = true, requires = "volume")]
    pub(crate) seed: u64,
    /// With --method exact: draw two parameters, all others at their nominal values, with the boxes
    /// of IRR and `best`; named as in --contains
    #[arg(long, num_args = 2, value_names = ["X", "Y"], requires = "picture")]
    pub(crate) slice: Option<Vec<String>>,
    /// With --method exact: draw the projection onto two parameters
    #[arg(long, num_args = 2, value_names = ["X", "Y"], requires = "picture")]
    #[arg(conflicts_with = "slice")]
    pub(crate) projection: Option<Vec<String>>,
    /// File for the picture of --slice or --projection
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) picture: Option<PathBuf>,
    /// For a plan that is invalid or has no slack: the cheapest change of deadlines, durations and
    /// bounds that makes it work
    #[arg(long)]
    pub(crate) repair: bool,
    /// With --repair: a quantity that may change, named as in --vary; all others are kept. `weight
    /// W` is the cost of a change by one unit, `in [LB, UB]` limits the new value; may be repeated
    #[arg(long, value_name = "SPEC", requires = "repair")]
    pub(crate) change: Vec<String>,
    /// With --repair: a quantity that may not change; may be repeated
    #[arg(long, value_name = "SPEC", requires = "repair")]
    pub(crate) keep: Vec<String>,
    /// The number of failed attempts that the plan affords: whether K failures are affordable, or
    /// the greatest number; and how much longer durations may be then (docs/reference/failures.md)
    #[arg(long, value_name = "K|max", value_parser = fault_count, conflicts_with = "repair")]
    pub(crate) faults: Option<FaultCount>,
    /// With --faults: greatest number of failures of each action; by default only the sum is limited
    #[arg(long, value_name = "N", value_parser = retries, requires = "faults")]
    pub(crate) retries: Option<u64>,
    /// With --faults: time from a failure to the next start of the action, at least epsilon; by
    /// default 0
    #[arg(long, value_name = "LOWER..UPPER", value_parser = times, requires = "faults")]
    pub(crate) recovery: Option<Times>,
    /// Print the answer as one JSON document
    #[arg(long)]
    pub(crate) json: bool,
}

impl EnvelopeArgs {
    /// The rule about rounded plans.
    pub(crate) fn rounding(&self) -> RoundingRule {
        RoundingRule::with_tolerance(self.tolerance.clone())
    }

    /// Rejects options that do not apply to repairs.
    ///
    /// # Errors
    /// If such an option is given.
    pub(crate) fn check_repair(&self) -> Result<(), Failure> {
        let others = [
            ("--method", self.method.is_some()),
            ("--objective", self.objective.is_some()),
            ("--world", self.world.is_some()),
            ("--symmetric", self.symmetric),
            ("--cap", self.cap.is_some()),
            ("--precision", self.precision.is_some()),
            ("--growth", self.growth.is_some()),
            ("--sharpen", self.sharpen),
            ("--timeout", self.timeout.is_some()),
            ("--contains", self.contains.is_some()),
            ("--order", self.order.is_some()),
            ("--enforce", self.enforce),
            ("--volume", self.volume),
            ("--slice", self.slice.is_some()),
            ("--projection", self.projection.is_some()),
            ("--picture", self.picture.is_some()),
            ("--controllable", !self.controllable.is_empty()),
        ];
        if let Some((flag, _)) = others.iter().find(|(_, given)| *given) {
            return Err(Failure::new(
                format!("{flag} applies to envelopes, and cannot be combined with --repair"),
                format!("leave out --repair, or {flag}"),
            ));
        }
        if !self.vary.is_empty() {
            return Err(Failure::new(
                "--vary selects durations that may deviate, not parts that may be changed",
                "use --change, which is written in the same way",
            ));
        }
        Ok(())
    }

    /// Rejects options that do not apply to failures.
    ///
    /// # Errors
    /// If such an option is given.
    pub(crate) fn check_faults(&self) -> Result<(), Failure> {
        let others = [
            ("--method exact", self.method == Some(Method::Exact)),
            ("--contains", self.contains.is_some()),
            ("--order", self.order.is_some()),
            ("--volume", self.volume),
            ("--slice", self.slice.is_some()),
            ("--projection", self.projection.is_some()),
            ("--picture", self.picture.is_some()),
        ];
        match others.iter().find(|(_, given)| *given) {
            None => Ok(()),
            Some((flag, _)) => Err(Failure::new(
                format!("{flag} cannot be combined with --faults"),
                format!("leave out --faults, or {flag}"),
            )),
        }
    }

    /// Returns `true` if the exact region is requested instead of a box.
    ///
    /// # Errors
    /// If an option does not apply to the requested kind of envelope, or contradicts another
    /// option.
    pub(crate) fn is_exact(&self) -> Result<bool, Failure> {
        if self.method != Some(Method::Exact) {
            let only_regions = [
                ("--volume", self.volume),
                ("--slice", self.slice.is_some()),
                ("--projection", self.projection.is_some()),
                ("--picture", self.picture.is_some()),
            ];
            return match only_regions.iter().find(|(_, given)| *given) {
                None => Ok(false),
                Some((flag, _)) => Err(Failure::new(
                    format!("{flag} needs the whole region"),
                    format!("add --method exact, or leave out {flag}"),
                )),
            };
        }
        if self.picture.as_deref() == Some("-".as_ref()) {
            return Err(Failure::new(
                "the picture and the answer cannot both go to standard output",
                "give --picture a file",
            ));
        }
        if self.picture.is_some() && self.slice.is_none() && self.projection.is_none() {
            return Err(Failure::new(
                "--picture needs two parameters to draw",
                "add `--slice X Y` or `--projection X Y`",
            ));
        }
        let only_boxes = [
            ("--objective", self.objective.is_some()),
            ("--world", self.world.is_some()),
            ("--symmetric", self.symmetric),
            ("--cap", self.cap.is_some() && !self.volume),
            ("--precision", self.precision.is_some()),
            ("--growth", self.growth.is_some()),
            ("--sharpen", self.sharpen),
            ("--timeout", self.timeout.is_some()),
            ("--contains", self.contains.is_some()),
            ("--order", self.order.is_some()),
        ];
        if let Some((flag, _)) = only_boxes.iter().find(|(_, given)| *given) {
            return Err(Failure::new(
                format!("{flag} applies to boxes, but --method exact computes the whole region"),
                format!("leave out --method exact, or {flag}"),
            ));
        }
        match self.guarantee {
            None | Some(Guarantee::Weak) => Ok(true),
            Some(_) => Err(Failure::new(
                "the region exists only for the weak guarantee; the other guarantees need a box",
                "leave out --method exact, or --guarantee",
            )),
        }
    }

    /// Returns the multiple of the nominal value at which unbounded ends are capped.
    pub(crate) fn cap_or_default(&self) -> Rational {
        let default = library::BestSettings::default().max_deviation;
        self.cap.clone().unwrap_or(default)
    }

    /// Returns the algorithm and its settings.
    ///
    /// # Errors
    /// If an option that only the largest box supports is combined with IRR.
    pub(crate) fn method(
        &self,
    ) -> Result<(Option<library::Method>, library::BestSettings), Failure> {
        let for_best = [
            ("--objective", self.objective.is_some()),
            ("--symmetric", self.symmetric),
            ("--cap", self.cap.is_some()),
        ];
        let given = for_best.iter().find(|(_, given)| *given);
        let method = match (self.method, given) {
            (Some(Method::Irr), Some((flag, _))) => {
                return Err(Failure::new(
                    format!(
                        "{flag} applies to the largest box, which --method irr does not compute"
                    ),
                    format!("leave out --method irr, or {flag}"),
                ));
            }
            (Some(Method::Exact), _) => {
                return Err(Failure::new(
                    "the region is not a box",
                    "leave out --method exact",
                ));
            }
            (None, None) => None,
            (Some(Method::Irr), None) => Some(library::Method::Irr),
            (Some(Method::Best), _) | (None, Some(_)) => Some(library::Method::Best),
        };
        let default = library::BestSettings::default();
        let best = library::BestSettings {
            objective: self.objective.unwrap_or(default.objective),
            symmetric: self.symmetric,
            max_deviation: self.cap_or_default(),
            ..default
        };
        match (best.objective, &self.world) {
            (Objective::Probability, None) => {
                return Err(Failure::new(
                    "--objective probability needs distributions of the durations",
                    "add --world with a world file (docs/reference/formats/world.md)",
                ));
            }
            (Objective::Probability, Some(_)) | (_, None) => {}
            (_, Some(_)) => {
                return Err(Failure::new(
                    "--world applies only to --objective probability",
                    "add that, or leave out --world",
                ));
            }
        }
        Ok((method, best))
    }
}

const VARY_HELP: &str = "\
Quantities for --vary:
  durations                           all durations, those that the executor
                                      chooses included
  duration ACTIONS                    the durations of these
  constant ACTIONS FUNCTION [VALUE]   a number in their effects on the function
  condition ACTIONS FUNCTION [VALUE]  a number in their conditions on it
  initial (FUNCTION object ...)       a value at time 0
  deadline (PREDICATE object ...)     the time of timed initials that make the
                                      fact false
  timed (NAME object ...)             the time of timed initials that change it
                                      in any way
  ?s=VALUE, n0.?r=VALUE               a :synth-parameters number, whose nominal
                                      value is VALUE

ACTIONS is an action's name, a label (n0), or (NAME object _ ...), where _ matches any object. Each \
may be followed by `weight W`, its weight in the search, and `in [LB, UB]`, the range of its values; \
a constant or condition also by `shared`: one parameter for all instances.";

/// The algorithm that computes an envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Method {
    /// Incremental rectangular robustification: widen one bound at a time
    Irr,
    /// The largest box by --objective, with a proof that none is larger
    Best,
    /// No box, but all values for which the plan works, as inequalities
    Exact,
}

/// The algorithm that computes the envelopes of runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum BoxMethod {
    /// Incremental rectangular robustification: widen one bound at a time
    Irr,
    /// The largest box by --objective
    Best,
}

/// The order of the rows of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Order {
    /// As in the plan
    Plan,
    /// By increasing slack, relative to the nominal value
    Tightness,
}

/// The step size after a successful widening.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Growth {
    /// Double it
    Doubling,
    /// Keep it
    Constant,
}

/// The `--vary` specifications that make the durations of these actions the executor's choice.
pub(crate) fn controllable(actions: &[String]) -> Vec<String> {
    actions
        .iter()
        .map(|action| format!("controllable {action}"))
        .collect()
}
