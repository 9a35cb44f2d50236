//! What can be asked. The members are named as the options of the command, and mean the same.

use elbowroom::envelope::{self, Growth, Guarantee, Objective};
use elbowroom::execute::NamedText;
use elbowroom::text::Source;
use serde::Deserialize;

/// A question, told by its member `ask`.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "ask", rename_all = "lowercase")]
#[allow(clippy::large_enum_variant, reason = "there is one at a time")]
pub enum Question {
    /// Is a plan valid? `elbowroom check`.
    Check(CheckQuestion),
    /// Is there a plan? `elbowroom plan`.
    Plan(PlanQuestion),
    /// Which orderings and times does it need? `elbowroom stn`.
    Stn(StnQuestion),
    /// How far may each quantity deviate? `elbowroom envelope`.
    Envelope(EnvelopeQuestion),
    /// What comes of executing it? `elbowroom run`.
    Run(RunQuestion),
    /// What does that look like? `elbowroom report`.
    Page(PageQuestion),
    /// Which version is this, and which executors are there?
    About,
}

/// A file: its name, for messages, and what stands in it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Text {
    /// The name.
    pub name: String,
    /// The text.
    pub text: String,
}

/// Asks whether a plan is valid, or, without a plan, whether a problem can be read.
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
    /// The least separation of interfering happenings, as an exact number: `0.001` if there is
    /// none.
    #[serde(default)]
    pub epsilon: Option<String>,
    /// By how much times may be off, as VAL's `-t`.
    #[serde(default)]
    pub tolerance: Option<String>,
}

/// Asks for a plan.
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
    /// Better plans are looked for until so many seconds have passed; without it, the first is
    /// taken.
    #[serde(default)]
    pub time_limit: Option<String>,
    /// Whether the first plan is enough, whatever time is left.
    #[serde(default)]
    pub first: bool,
    /// `true` if a ground action may overlap itself in the plan.
    #[serde(default)]
    pub self_overlap: bool,
}

/// Asks for a plan's network.
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

/// Asks for an envelope, or whether a box is inside.
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
    /// What may deviate; all durations if empty.
    #[serde(default)]
    pub vary: Vec<String>,
    /// Actions whose durations the executor chooses.
    #[serde(default)]
    pub controllable: Vec<String>,
    /// What holds inside the envelope.
    #[serde(default)]
    pub guarantee: Option<Guarantee>,
    /// Whether the dispatcher enforces conditions that bound the difference of two times.
    #[serde(default)]
    pub enforce: bool,
    /// The rule that sets the time-out of each action: `none`, a number of seconds, or `10x,600`, the
    /// default.
    #[serde(default)]
    pub timeout: Option<String>,
    /// The box that is asked about; without one, a large one is looked for.
    #[serde(default)]
    pub contains: Option<String>,
    /// The algorithm.
    #[serde(default)]
    pub method: Option<Method>,
    /// With the method `exact`: whether the answer has the region's volume, and boxes with their
    /// shares of it.
    #[serde(default)]
    pub volume: bool,
    /// The seed of what is sampled for that.
    #[serde(default)]
    pub seed: u64,
    /// What the best box is the greatest of.
    #[serde(default)]
    pub objective: Objective,
    /// With the objective `probability`: the world that says how long actions take
    /// (`docs/formats/world.md`).
    #[serde(default)]
    pub world: Option<Text>,
    /// Whether both ends of the best box's intervals are equally far from the nominal value.
    #[serde(default)]
    pub symmetric: bool,
    /// The step size at which the search ends; without one, a hundredth of each nominal value.
    #[serde(default)]
    pub precision: Option<String>,
    /// Whether steps double after a success.
    #[serde(default)]
    pub growth: Growth,
    /// Whether each bound is moved to its limit in the end.
    #[serde(default)]
    pub sharpen: bool,
    /// The search ends after so many seconds.
    #[serde(default)]
    pub time_limit: Option<String>,
}

/// Asks for a run in a simulated world.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct RunQuestion {
    /// The domain, in PDDL.
    pub domain: Text,
    /// The problem, in PDDL.
    pub problem: Text,
    /// The plan to begin with, with fixed times; without one, one is made.
    #[serde(default)]
    pub plan: Option<Text>,
    /// The world (`docs/formats/world.md`); without one, everything goes as planned.
    #[serde(default)]
    pub world: Option<Text>,
    /// Probabilities for the executors that use them (`docs/formats/likelihoods.md`).
    #[serde(default)]
    pub likelihoods: Option<Text>,
    /// The executor; `live` if there is none.
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
    /// How many new plans may be made.
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
    /// No box, but the whole region.
    Exact,
}

impl Method {
    /// The method of the search for a box.
    pub fn of_boxes(self) -> envelope::Method {
        match self {
            // The whole region is found without looking for a box.
            Self::Irr | Self::Exact => envelope::Method::Irr,
            Self::Best => envelope::Method::Best,
        }
    }
}

/// Asks for the page about an answer or a trace.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PageQuestion {
    /// The answer, as a [reply](crate::Reply::document) has it, or the trace.
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
