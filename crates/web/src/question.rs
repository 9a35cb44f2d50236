//! Questions. Members have the names and meanings of the command's options.

use elbowroom::envelope::{self, Growth, Guarantee, Objective};
use elbowroom::execute::NamedText;
use elbowroom::text::Source;
use serde::Deserialize;

/// A question. The member `ask` determines its kind.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "ask", rename_all = "lowercase")]
#[allow(clippy::large_enum_variant, reason = "there is one at a time")]
pub enum Question {
    /// Validation of a plan: `elbowroom check`.
    Check(CheckQuestion),
    /// Search for a plan: `elbowroom plan`.
    Plan(PlanQuestion),
    /// Orderings and time bounds of a plan: `elbowroom stn`.
    Stn(StnQuestion),
    /// Tolerated deviations of quantities: `elbowroom envelope`.
    Envelope(EnvelopeQuestion),
    /// Simulated execution of a plan: `elbowroom run`.
    Run(RunQuestion),
    /// Page of an answer or a trace: `elbowroom report`.
    Page(PageQuestion),
    /// Version, and list of executors.
    About,
}

/// A file: its name, for messages, and its content.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Text {
    /// The name.
    pub name: String,
    /// The text.
    pub text: String,
}

/// Validates a plan, or, without a plan, only reads the problem.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckQuestion {
    /// The domain, in PDDL.
    pub domain: Text,
    /// The problem, in PDDL.
    pub problem: Text,
    /// The plan, with fixed times.
    #[serde(default)]
    pub plan: Option<Text>,
    /// Minimum separation of interfering happenings, as an exact number; `0.001` by default.
    #[serde(default)]
    pub epsilon: Option<String>,
    /// Tolerance of times, as VAL's `-t`.
    #[serde(default)]
    pub tolerance: Option<String>,
}

/// Searches for a plan.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct PlanQuestion {
    /// The domain, in PDDL.
    pub domain: Text,
    /// The problem, in PDDL.
    pub problem: Text,
    /// As for a [check](CheckQuestion::epsilon).
    #[serde(default)]
    pub epsilon: Option<String>,
    /// Time limit of the search for better plans, in seconds. Without it, the first plan is
    /// returned.
    #[serde(default)]
    pub time_limit: Option<String>,
    /// `true` if the search ends with the first plan.
    #[serde(default)]
    pub first: bool,
    /// `true` if a ground action may overlap itself in the plan.
    #[serde(default)]
    pub self_overlap: bool,
}

/// Converts a plan to a network.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StnQuestion {
    /// The domain, in PDDL.
    pub domain: Text,
    /// The problem, in PDDL.
    pub problem: Text,
    /// The plan, of either kind.
    pub plan: Text,
    /// As for a [check](CheckQuestion::epsilon).
    #[serde(default)]
    pub epsilon: Option<String>,
}

/// Computes an envelope, or checks if a box is inside.
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is an option of the command"
)]
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct EnvelopeQuestion {
    /// The domain, in PDDL.
    pub domain: Text,
    /// The problem, in PDDL.
    pub problem: Text,
    /// The plan, of either kind.
    pub plan: Text,
    /// As for a [check](CheckQuestion::epsilon).
    #[serde(default)]
    pub epsilon: Option<String>,
    /// Quantities that may deviate; all durations if empty.
    #[serde(default)]
    pub vary: Vec<String>,
    /// Actions whose durations the executor chooses.
    #[serde(default)]
    pub controllable: Vec<String>,
    /// Guarantee inside the envelope.
    #[serde(default)]
    pub guarantee: Option<Guarantee>,
    /// `true` if the dispatcher enforces conditions that bound the difference of two times.
    #[serde(default)]
    pub enforce: bool,
    /// The rule that sets the time-out of each action: `none`, a number of seconds, or `10x,600`, the
    /// default.
    #[serde(default)]
    pub timeout: Option<String>,
    /// The box to check; without it, a large box is computed.
    #[serde(default)]
    pub contains: Option<String>,
    /// The algorithm.
    #[serde(default)]
    pub method: Option<Method>,
    /// With the method `exact`: `true` to compute the region's volume, and the shares of boxes.
    #[serde(default)]
    pub volume: bool,
    /// Random seed of the samples for the volume.
    #[serde(default)]
    pub seed: u64,
    /// Objective of the best box.
    #[serde(default)]
    pub objective: Objective,
    /// With the objective `probability`: the world with the distributions of durations
    /// (`docs/reference/formats/world.md`).
    #[serde(default)]
    pub world: Option<Text>,
    /// `true` if both ends of each interval of the best box must be equally far from the nominal
    /// value.
    #[serde(default)]
    pub symmetric: bool,
    /// Step size at which the search ends; a hundredth of each nominal value by default.
    #[serde(default)]
    pub precision: Option<String>,
    /// Growth of steps after a success.
    #[serde(default)]
    pub growth: Growth,
    /// `true` if each bound is finally moved to its limit.
    #[serde(default)]
    pub sharpen: bool,
    /// Time limit of the search, in seconds.
    #[serde(default)]
    pub time_limit: Option<String>,
}

/// Executes a plan in a simulated world.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct RunQuestion {
    /// The domain, in PDDL.
    pub domain: Text,
    /// The problem, in PDDL.
    pub problem: Text,
    /// The first plan, with fixed times; without it, the planner makes one.
    #[serde(default)]
    pub plan: Option<Text>,
    /// The world (`docs/reference/formats/world.md`); without it, all actions go as planned.
    #[serde(default)]
    pub world: Option<Text>,
    /// Probabilities for the executors that use them (`docs/reference/formats/likelihoods.md`).
    #[serde(default)]
    pub likelihoods: Option<Text>,
    /// The executor; the default one if missing.
    #[serde(default)]
    pub executor: Option<String>,
    /// The seed of the world's random numbers.
    #[serde(default)]
    pub seed: u64,
    /// As for an [envelope](EnvelopeQuestion::guarantee).
    #[serde(default)]
    pub guarantee: Guarantee,
    /// As for an [envelope](EnvelopeQuestion::timeout).
    #[serde(default)]
    pub timeout: Option<String>,
    /// Maximum number of new plans.
    #[serde(default)]
    pub max_replans: Option<usize>,
    /// As for a [check](CheckQuestion::epsilon).
    #[serde(default)]
    pub epsilon: Option<String>,
}

/// The algorithm of an envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Incremental rectangular robustification.
    Irr,
    /// The largest box.
    Best,
    /// The whole region instead of a box.
    Exact,
}

impl Method {
    /// Returns the method of the search for a box.
    pub fn of_boxes(self) -> envelope::Method {
        match self {
            // The whole region is computed without a box.
            Self::Irr | Self::Exact => envelope::Method::Irr,
            Self::Best => envelope::Method::Best,
        }
    }
}

/// Renders the page of an answer or a trace.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PageQuestion {
    /// The answer, as in [`Reply::document`](crate::Reply::document), or the trace.
    pub of: Text,
}

impl Text {
    pub(crate) fn source(&self) -> Source {
        Source::new(self.name.as_str(), self.text.as_str())
    }

    pub(crate) fn named(&self) -> NamedText {
        NamedText {
            name: self.name.clone(),
            text: self.text.clone(),
        }
    }
}
