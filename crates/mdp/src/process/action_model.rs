//! Parts of the world: conditions, starts and ends, actions, failures, and events.

use std::sync::Arc;

use elbowroom_model::ground::Action;
use elbowroom_num::Rational;
use elbowroom_sim::{Distribution, Rule, Side, WorldModel};

use super::value_intervals::{Amount, Span};

/// A set of true facts.
pub type Facts = u128;

/// A condition on facts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Needs {
    /// All parts hold.
    All(Vec<Needs>),
    /// At least one part holds.
    Any(Vec<Needs>),
    /// The part does not hold.
    Not(Box<Needs>),
    /// The fact is true; 0 for a fact that never is.
    Fact(Facts),
}

/// A start or an end.
#[derive(Clone, Debug)]
pub struct Snap {
    /// Its condition.
    pub needs: Needs,
    /// The facts that it makes true.
    pub adds: Facts,
    /// The facts that it makes false, unless it also adds them.
    pub deletes: Facts,
    /// The changes of numbers.
    pub(crate) amounts: Vec<Amount>,
    /// The comparisons that may become true by these changes.
    pub(crate) helped_tests: Facts,
    /// The possible amounts, with their probabilities; at least one.
    pub(crate) draws: Vec<(f64, Vec<Span>)>,
}

/// An action.
#[derive(Clone, Debug)]
pub struct ActionModel {
    /// Its name with objects, `(name object …)`.
    pub name: String,
    pub(crate) action: Arc<Action>,
    /// Its start.
    pub start: Snap,
    /// The over-all condition and the end; `None` for instantaneous actions.
    pub rest: Option<(Needs, Snap)>,
    pub(crate) planned: Rational,
    /// Probability that it fails midway, given that it starts.
    pub midway_failure: f64,
    /// Probability that it fails at its end, given that it starts.
    pub end_failure: f64,
    /// The possible outcomes of a failure; the shares add up to 1.
    pub failures: Vec<FailureKind>,
    /// `true` if cancelling it may be useful.
    pub(crate) may_be_cancelled: bool,
    /// `true` if starting it as soon as possible is always optimal.
    pub(crate) is_eager: bool,
}

/// An outcome of a failure.
#[derive(Clone, Debug, PartialEq)]
pub struct FailureKind {
    /// Conditional probability of this outcome, given that the action fails.
    pub(crate) share: f64,
    /// The added facts, without deleted ones.
    pub adds: Facts,
    /// The deleted facts.
    pub deletes: Facts,
    /// Time in seconds for which the action continues to run after the failure; it cannot be
    /// cancelled then.
    pub delay: f64,
}

/// The end of an action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Ending {
    /// Success, with this draw of the amounts.
    Success(u16),
    /// Failure, with this outcome.
    Failure(u8),
}

/// An event of the world.
#[derive(Clone, Debug)]
pub struct Event {
    /// The facts that it makes true.
    pub adds: Facts,
    /// The facts that it makes false, unless it also adds them.
    pub deletes: Facts,
    pub(crate) occurs: Occurs,
}

/// Number of occurrences of an event.
#[derive(Clone, Debug)]
pub(crate) enum Occurs {
    /// At most once, with this probability and this distribution of the time.
    Once { probability: f64, time: Rule },
    /// A Poisson process with this rate per second.
    Rate(f64),
}

impl Needs {
    pub(crate) fn holds(&self, facts: Facts) -> bool {
        match self {
            Self::All(parts) => parts.iter().all(|part| part.holds(facts)),
            Self::Any(parts) => parts.iter().any(|part| part.holds(facts)),
            Self::Not(part) => !part.holds(facts),
            Self::Fact(fact) => facts & fact != 0,
        }
    }

    /// Simplifies the condition with the facts fixed: to the values that help it to hold, or, with
    /// `hold` false, to the values that help it to fail.
    pub(crate) fn without(&self, facts: Facts, hold: bool) -> Self {
        let parts = |parts: &[Self]| parts.iter().map(|part| part.without(facts, hold)).collect();
        match self {
            Self::All(all) => Self::All(parts(all)),
            Self::Any(any) => Self::Any(parts(any)),
            Self::Not(part) => Self::Not(Box::new(part.without(facts, !hold))),
            Self::Fact(fact) if fact & facts == 0 => Self::Fact(*fact),
            Self::Fact(_) if hold => Self::All(Vec::new()),
            Self::Fact(_) => Self::Any(Vec::new()),
        }
    }

    /// Returns `true` if the condition may hold if some of the true facts are made false.
    pub(crate) fn is_possible(&self, facts: Facts) -> bool {
        match self {
            Self::All(parts) => parts.iter().all(|part| part.is_possible(facts)),
            Self::Any(parts) => parts.iter().any(|part| part.is_possible(facts)),
            Self::Not(part) => part.may_fail(facts),
            Self::Fact(fact) => facts & fact != 0,
        }
    }

    /// Returns `true` if the condition may fail if some of the true facts are made false.
    fn may_fail(&self, facts: Facts) -> bool {
        match self {
            Self::All(parts) => parts.iter().any(|part| part.may_fail(facts)),
            Self::Any(parts) => parts.iter().all(|part| part.may_fail(facts)),
            Self::Not(part) => part.is_possible(facts),
            Self::Fact(_) => true,
        }
    }

    /// Returns the facts of the condition if it is a conjunction of facts.
    pub(crate) fn conjunction(&self) -> Option<Facts> {
        match self {
            Self::All(parts) => parts
                .iter()
                .try_fold(0, |all, part| Some(all | part.conjunction()?)),
            Self::Fact(fact) => Some(*fact),
            Self::Any(_) | Self::Not(_) => None,
        }
    }

    /// Returns the facts that it reads.
    pub fn mentions(&self) -> Facts {
        match self {
            Self::All(parts) | Self::Any(parts) => {
                parts.iter().fold(0, |all, part| all | part.mentions())
            }
            Self::Not(part) => part.mentions(),
            Self::Fact(fact) => *fact,
        }
    }

    pub(crate) fn has_negation(&self) -> bool {
        match self {
            Self::All(parts) | Self::Any(parts) => parts.iter().any(Self::has_negation),
            Self::Not(_) => true,
            Self::Fact(_) => false,
        }
    }
}

impl Snap {
    /// Returns `true` if it changes no relevant fact or number.
    pub(crate) fn does_nothing(&self) -> bool {
        self.adds | self.deletes == 0 && self.amounts.is_empty()
    }

    /// Applies the effects on facts; additions win over deletions.
    pub(crate) fn apply(&self, facts: Facts) -> Facts {
        (facts & !self.deletes) | self.adds
    }
}

impl Event {
    pub(crate) fn apply(&self, facts: Facts) -> Facts {
        (facts & !self.deletes) | self.adds
    }

    /// Returns `true` if it may happen again, so that the state need not record its occurrence.
    pub fn is_recurrent(&self) -> bool {
        matches!(self.occurs, Occurs::Rate(_))
    }

    /// Returns the probability that the event is over at a time, in seconds; 0 for recurrent
    /// events.
    pub(crate) fn is_over_by(&self, time: f64, side: Side, resolution: f64) -> Option<f64> {
        match &self.occurs {
            Occurs::Once {
                probability,
                time: rule,
            } => {
                let share = rule.probability_of_side(time, side, 0.0, resolution)?;
                Some(share * probability)
            }
            Occurs::Rate(_) => Some(0.0),
        }
    }

    /// Returns `true` if it only makes facts false.
    pub(crate) fn is_harmful(&self) -> bool {
        self.adds == 0
    }
}

impl FailureKind {
    pub(crate) fn apply(&self, facts: Facts) -> Facts {
        (facts & !self.deletes) | self.adds
    }
}

impl ActionModel {
    /// Returns all facts that a failure may make true.
    pub(crate) fn adds_by_failing(&self) -> Facts {
        let failures = self.failures.iter();
        failures.fold(0, |all, failed| all | failed.adds)
    }

    /// Returns all facts that a failure may make false.
    pub(crate) fn deletes_by_failing(&self) -> Facts {
        let failures = self.failures.iter();
        failures.fold(0, |all, failed| all | failed.deletes)
    }

    /// Returns the outcome of the failure, if it is one.
    pub(crate) fn failed(&self, ending: Ending) -> Option<&FailureKind> {
        match ending {
            Ending::Success(_) => None,
            Ending::Failure(way) => self.failures.get(usize::from(way)),
        }
    }

    /// Returns `true` if it may have failed already while it is still running, so that it cannot be
    /// cancelled.
    pub(crate) fn can_delay_its_failure(&self) -> bool {
        self.failures.iter().any(|failed| failed.delay > 0.0)
    }

    /// Returns `true` if the end of the action alone satisfies the goal.
    pub(crate) fn achieves_goal(&self, goal: &Needs) -> bool {
        self.rest.iter().any(|(_, end)| goal.holds(end.adds))
    }

    /// Returns `true` if it has several possible ends.
    pub(crate) fn has_random_ends(&self) -> bool {
        let end = self.rest.as_ref();
        self.can_fail() || end.is_some_and(|(_, end)| end.draws.len() > 1)
    }

    /// Returns `true` if it may fail after its start.
    pub(crate) fn can_fail(&self) -> bool {
        self.midway_failure > 0.0 || self.end_failure > 0.0
    }

    /// Returns `true` if some comparison may become true by it.
    pub(crate) fn can_help(&self) -> bool {
        let end = self.rest.as_ref().map_or(0, |(_, end)| end.helped_tests);
        self.start.helped_tests | end != 0
    }

    /// Returns `true` if it changes numbers.
    pub(crate) fn changes_numbers(&self) -> bool {
        let end = self.rest.as_ref();
        !self.start.amounts.is_empty() || end.is_some_and(|(_, end)| !end.amounts.is_empty())
    }

    /// Returns `true` if it changes numbers, or if its over-all or end condition compares numbers.
    pub(crate) fn is_about_numbers(&self, tested: Facts) -> bool {
        let reads = |needs: &Needs| needs.mentions() & tested != 0;
        let rest = self.rest.as_ref();
        self.changes_numbers()
            || rest.is_some_and(|(over_all, end)| reads(over_all) || reads(&end.needs))
    }

    /// Returns the facts that it reads.
    pub(crate) fn mentions(&self) -> Facts {
        let rest = self.rest.as_ref();
        let later = rest.map_or(0, |(over_all, end)| {
            over_all.mentions() | end.needs.mentions()
        });
        self.start.needs.mentions() | later
    }

    pub(crate) fn has_negation(&self) -> bool {
        let rest = self.rest.as_ref();
        self.start.needs.has_negation()
            || rest
                .is_some_and(|(over_all, end)| over_all.has_negation() || end.needs.has_negation())
    }

    /// Returns all facts that it may make true.
    pub(crate) fn adds(&self) -> Facts {
        let end = self.rest.as_ref().map_or(0, |(_, end)| end.adds);
        self.start.adds | self.adds_by_failing() | end
    }

    /// Returns all facts that it may make false.
    pub(crate) fn deletes(&self) -> Facts {
        let end = self.rest.as_ref().map_or(0, |(_, end)| end.deletes);
        self.start.deletes | self.deletes_by_failing() | end
    }

    /// Returns `true` if its end deletes no relevant fact.
    pub(crate) fn has_harmless_end(&self) -> bool {
        self.rest
            .as_ref()
            .is_some_and(|(_, end)| end.deletes & !end.adds == 0)
    }

    /// Returns `true` if the conditions of its end are among its over-all conditions, so that it
    /// can end at any time.
    pub(crate) fn has_guaranteed_end(&self) -> bool {
        self.rest.as_ref().is_some_and(|(over_all, end)| {
            let always = over_all.conjunction().unwrap_or(0);
            end.needs
                .conjunction()
                .is_some_and(|needs| needs & !always == 0)
        })
    }

    /// Returns `true` if cancelling it may be useful in a monotone world: its end or its failure
    /// may delete facts, or a restarted action may end earlier than the running one.
    pub(crate) fn can_gain_by_cancelling(&self, model: &WorldModel) -> bool {
        !self.has_harmless_end()
            || !self.has_guaranteed_end()
            || self.deletes_by_failing() != 0
            || self.can_delay_its_failure()
            || model
                .duration_rule(&self.name)
                .is_some_and(|rule| !is_fixed(rule))
    }
}

fn is_fixed(rule: &Rule) -> bool {
    matches!(rule.distribution, Distribution::Constant(_))
}
