//! Contents of a world file: `docs/reference/formats/world.md`.

mod expected_durations;
mod hazard;
mod outcome;
mod text;

use elbowroom_model::Problem;
use elbowroom_model::pattern::ActionPattern;
use elbowroom_num::Rational;
use elbowroom_text::{Diagnostics, Source};
use rand::Rng;

use crate::draw::{Distribution, rounded};

pub use hazard::Hazard;
pub use outcome::{FactOutcome, Outcome, OutcomeChange, Template};

/// A world without a seed.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldModel {
    /// Times and amounts are multiples of this.
    pub resolution: Rational,
    /// The durations of actions. The last rule that matches counts; without a rule, the planned
    /// duration.
    pub durations: Vec<(ActionPattern, Rule)>,
    /// Delays between the commands and the starts of actions; without a rule, 0.
    pub delays: Vec<(ActionPattern, Rule)>,
    /// The amounts of numeric effects; without a rule, those of the domain.
    pub amounts: Vec<Amount>,
    /// Failure probabilities of actions; without a rule, 0.
    pub failures: Vec<FailureRule>,
    /// The exogenous events, apart from the problem's timed initials.
    pub exogenous: Vec<ExogenousEvent>,
    /// Rates of spontaneous changes of facts; without a rule, 0. The last rule that matches counts.
    pub hazards: Vec<Hazard>,
    /// The reliability of the world's reports.
    pub reports: ReportReliability,
}

/// A distribution, clamped and scaled.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// The distribution of the quantity.
    pub distribution: Distribution,
    /// Lower values are replaced by this one.
    pub minimum: Option<f64>,
    /// Greater values are replaced by this one.
    pub maximum: Option<f64>,
    /// `true` if it is a multiple of the planned value, rather than the value itself.
    pub is_relative: bool,
}

/// The amount of an action's effect on a fluent.
#[derive(Clone, Debug, PartialEq)]
pub struct Amount {
    /// The actions.
    pub action: ActionPattern,
    /// The fluents.
    pub fluent: ActionPattern,
    /// The distribution of the amount.
    pub rule: Rule,
}

/// The failure probability of actions.
#[derive(Clone, Debug, PartialEq)]
pub struct FailureRule {
    /// The action.
    pub action: ActionPattern,
    /// The probability.
    pub probability: f64,
    /// The time.
    pub when: FailureTime,
    /// `true` if a failure after the start undoes the start effects on facts: facts that it made
    /// false become true again, and facts that it made true become false. If `false`, the start
    /// effects remain.
    pub is_undone: bool,
    /// Possible outcomes of a failure, applied after the undoing. Their probabilities add up to at
    /// most 1; in the remaining cases the failure changes nothing more.
    pub outcomes: Vec<Outcome>,
}

/// The moment at which an action fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureTime {
    /// It does not start at all.
    AtStart,
    /// At a uniformly distributed time in its duration.
    Midway,
    /// At the time of its end.
    AtEnd,
}

/// An exogenous event.
#[derive(Clone, Debug, PartialEq)]
pub struct ExogenousEvent {
    /// The time.
    pub time: Rule,
    /// The probability that it happens at all.
    pub probability: f64,
    /// The change.
    pub change: ExogenousChange,
    /// `true` if the world reports it. If `false`, it is only noticed when the world is asked to
    /// look, or when an action fails because of it.
    pub is_reported: bool,
}

/// The change by an exogenous event.
#[derive(Clone, Debug, PartialEq)]
pub enum ExogenousChange {
    /// The fact, `(predicate object …)`, becomes true or false.
    Fact(String, bool),
    /// The fluent, `(function object …)`, gets a value.
    Value(String, Rational),
}

/// The reliability of the world's reports. Each probability is that of a single report.
#[derive(Clone, Debug, PartialEq)]
pub struct ReportReliability {
    /// It never arrives.
    pub lost: f64,
    /// It arrives twice.
    pub duplicated: f64,
    /// It arrives late.
    pub late: f64,
    /// The distribution of the delay.
    pub lateness: Rule,
    /// A contradicting report is sent as well.
    pub contradicted: f64,
}

impl Default for WorldModel {
    fn default() -> Self {
        Self::without_deviations()
    }
}

impl WorldModel {
    /// Creates the model of a world without deviations from the plan.
    pub fn without_deviations() -> Self {
        Self {
            resolution: Rational::new(1, 1000),
            durations: Vec::new(),
            delays: Vec::new(),
            amounts: Vec::new(),
            failures: Vec::new(),
            exogenous: Vec::new(),
            hazards: Vec::new(),
            reports: ReportReliability::default(),
        }
    }

    /// Reads a world file for a problem.
    ///
    /// # Errors
    /// The first mistake, with its place.
    pub fn read(source: impl Into<Source>, problem: &Problem) -> Result<Self, Diagnostics> {
        text::read(&source.into(), problem).map_err(Diagnostics::from)
    }

    /// Draws the duration of an action with the planned duration `planned`.
    pub fn duration(&self, action: &str, planned: &Rational, rng: &mut impl Rng) -> Rational {
        let duration = match last_matching_rule(&self.durations, action) {
            Some(rule) => rule.draw(planned, &self.resolution, rng),
            None => planned.clone(),
        };
        // A planned duration that is positive stays positive.
        duration.max(planned.min(&self.resolution).clone())
    }

    /// Returns the rule for the duration of an action; `None` for the planned duration.
    pub fn duration_rule(&self, action: &str) -> Option<&Rule> {
        last_matching_rule(&self.durations, action)
    }

    /// Returns the rule for the delay between the command and the start of an action; `None` for no
    /// delay.
    pub fn delay_rule(&self, action: &str) -> Option<&Rule> {
        last_matching_rule(&self.delays, action)
    }

    /// Draws the delay between the command and the start of an action.
    pub fn delay(&self, action: &str, rng: &mut impl Rng) -> Rational {
        let rule = last_matching_rule(&self.delays, action);
        let delay = rule.map(|rule| rule.draw(&Rational::ZERO, &self.resolution, rng));
        delay.unwrap_or_default().max(Rational::ZERO)
    }

    /// Returns the rule for the amount by which an action changes a fluent.
    pub fn amount(&self, action: &str, fluent: &str) -> Option<&Rule> {
        let matching =
            |amount: &&Amount| amount.action.matches(action) && amount.fluent.matches(fluent);
        self.amounts
            .iter()
            .rev()
            .find(matching)
            .map(|amount| &amount.rule)
    }

    /// Draws whether an action fails.
    pub fn fails(&self, action: &str, rng: &mut impl Rng) -> bool {
        let failing = self.failure_rule(action);
        failing.is_some_and(|failing| rng.random::<f64>() < failing.probability)
    }

    /// Returns the failure rule of an action.
    pub fn failure_rule(&self, action: &str) -> Option<&FailureRule> {
        let mut rules = self.failures.iter().rev();
        rules.find(|rule| rule.action.matches(action))
    }
}

impl Rule {
    /// Returns `true` if it always gives the same value.
    pub fn is_certain(&self) -> bool {
        matches!(self.distribution, Distribution::Constant(_))
    }

    /// Draws a value, if the planned one is `planned`.
    pub fn draw(&self, planned: &Rational, resolution: &Rational, rng: &mut impl Rng) -> Rational {
        let mut value = self.distribution.draw(rng);
        if let Some(minimum) = self.minimum {
            value = value.max(minimum);
        }
        if let Some(maximum) = self.maximum {
            value = value.min(maximum);
        }
        if self.is_relative {
            value *= planned.to_f64();
        }
        rounded(value, resolution)
    }

    /// Returns `true` if a value written in the file is negative, or if all values that can be
    /// drawn are. A distribution that merely extends below 0 is permitted; draws below 0 count as
    /// 0.
    fn can_be_negative(&self) -> bool {
        let cut = |value: f64| {
            let value = self.minimum.map_or(value, |minimum| value.max(minimum));
            self.maximum.map_or(value, |maximum| value.min(maximum))
        };
        match &self.distribution {
            Distribution::Constant(value) => cut(*value) < 0.0,
            Distribution::Empirical(values) => values.iter().any(|value| cut(*value) < 0.0),
            Distribution::Uniform { to, .. } | Distribution::Triangular { to, .. } => {
                cut(*to) < 0.0
            }
            Distribution::Normal { .. }
            | Distribution::LogNormal { .. }
            | Distribution::Exponential { .. }
            | Distribution::Gamma { .. } => self.maximum.is_some_and(|maximum| maximum < 0.0),
        }
    }
}

impl From<Distribution> for Rule {
    /// Creates a rule without limits and scaling.
    fn from(distribution: Distribution) -> Self {
        Self {
            distribution,
            minimum: None,
            maximum: None,
            is_relative: false,
        }
    }
}

impl Default for ReportReliability {
    /// Perfect reports: each arrives at once, once, and is true.
    fn default() -> Self {
        Self {
            lost: 0.0,
            duplicated: 0.0,
            late: 0.0,
            lateness: Distribution::Constant(0.0).into(),
            contradicted: 0.0,
        }
    }
}

impl ReportReliability {
    /// Returns `true` if all reports come at once, once, and are true.
    pub fn is_perfect(&self) -> bool {
        let all = [self.lost, self.duplicated, self.late, self.contradicted];
        all.iter().all(|probability| *probability <= 0.0)
    }
}

fn last_matching_rule<'a>(rules: &'a [(ActionPattern, Rule)], action: &str) -> Option<&'a Rule> {
    let mut rules = rules.iter().rev();
    rules
        .find(|(pattern, _)| pattern.matches(action))
        .map(|(_, rule)| rule)
}
