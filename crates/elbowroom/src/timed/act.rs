//! What the world is made of: conditions, starts and ends, actions, and what happens by itself.

use std::sync::Arc;

use elbowroom_model::ground::Action;
use elbowroom_num::Rational;
use elbowroom_sim::{Distribution, Rule, Side, WorldModel};

use super::failures::Failed;
use super::numbers::{Amount, Span};
use super::world::Facts;

/// A condition on facts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Needs {
    All(Vec<Needs>),
    Any(Vec<Needs>),
    Not(Box<Needs>),
    Fact(Facts),
}

/// A start or an end.
#[derive(Clone, Debug)]
pub(crate) struct Snap {
    pub(crate) needs: Needs,
    pub(crate) adds: Facts,
    pub(crate) deletes: Facts,
    /// What becomes of numbers.
    pub(crate) amounts: Vec<Amount>,
    /// The comparisons that may come to hold by these.
    pub(super) helps: Facts,
    /// How the amounts may come out, with how likely each of the ways is; at least one.
    pub(crate) draws: Vec<(f64, Vec<Span>)>,
}

/// An action.
#[derive(Clone, Debug)]
pub(crate) struct Act {
    pub(crate) name: String,
    pub(crate) action: Arc<Action>,
    pub(crate) start: Snap,
    /// What is needed over all, and its end; `None` for instantaneous actions.
    pub(crate) rest: Option<(Needs, Snap)>,
    pub(crate) planned: Rational,
    /// P(it fails midway), given that it starts.
    pub(crate) midway: f64,
    /// P(it fails at its end), given that it starts.
    pub(crate) at_end: f64,
    /// How things may stand when it has failed; the shares add up to 1.
    pub(crate) failures: Vec<Failed>,
    /// Whether it may do any good to cancel it.
    pub(crate) may_be_cancelled: bool,
    /// Whether nothing is ever better than to start it as soon as one can.
    pub(crate) is_eager: bool,
}

/// Something that happens by itself.
#[derive(Clone, Debug)]
pub(crate) struct Event {
    pub(crate) adds: Facts,
    pub(crate) deletes: Facts,
    pub(crate) occurs: Occurs,
}

/// How often something happens by itself.
#[derive(Clone, Debug)]
pub(crate) enum Occurs {
    /// At most once: how likely, and when.
    Once { probability: f64, time: Rule },
    /// Again and again, so many times per second, whatever has been before.
    Rate(f64),
}

impl Needs {
    pub(super) fn hold(&self, facts: Facts) -> bool {
        match self {
            Self::All(parts) => parts.iter().all(|part| part.hold(facts)),
            Self::Any(parts) => parts.iter().any(|part| part.hold(facts)),
            Self::Not(part) => !part.hold(facts),
            Self::Fact(fact) => facts & fact != 0,
        }
    }

    /// What is left of them if these facts are as one would have them: such that the needs hold, or, if that is
    /// what is wanted, do not.
    pub(super) fn without(&self, facts: Facts, hold: bool) -> Self {
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

    /// Whether they may hold if more facts may be false than these.
    pub(super) fn is_possible(&self, facts: Facts) -> bool {
        match self {
            Self::All(parts) => parts.iter().all(|part| part.is_possible(facts)),
            Self::Any(parts) => parts.iter().any(|part| part.is_possible(facts)),
            Self::Not(part) => part.may_fail(facts),
            Self::Fact(fact) => facts & fact != 0,
        }
    }

    /// Whether they may be false if more facts may be false than these; any fact may be false.
    fn may_fail(&self, facts: Facts) -> bool {
        match self {
            Self::All(parts) => parts.iter().any(|part| part.may_fail(facts)),
            Self::Any(parts) => parts.iter().all(|part| part.may_fail(facts)),
            Self::Not(part) => part.is_possible(facts),
            Self::Fact(_) => true,
        }
    }

    /// The facts that must all be true, if that is all there is to it.
    pub(super) fn conjunction(&self) -> Option<Facts> {
        match self {
            Self::All(parts) => parts
                .iter()
                .try_fold(0, |all, part| Some(all | part.conjunction()?)),
            Self::Fact(fact) => Some(*fact),
            Self::Any(_) | Self::Not(_) => None,
        }
    }

    /// The facts that it reads.
    pub(crate) fn mentions(&self) -> Facts {
        match self {
            Self::All(parts) | Self::Any(parts) => {
                parts.iter().fold(0, |all, part| all | part.mentions())
            }
            Self::Not(part) => part.mentions(),
            Self::Fact(fact) => *fact,
        }
    }

    pub(super) fn has_negation(&self) -> bool {
        match self {
            Self::All(parts) | Self::Any(parts) => parts.iter().any(Self::has_negation),
            Self::Not(_) => true,
            Self::Fact(_) => false,
        }
    }
}

impl Snap {
    /// Whether nothing that matters changes.
    pub(super) fn does_nothing(&self) -> bool {
        self.adds | self.deletes == 0 && self.amounts.is_empty()
    }

    /// Additions win over deletions of the same happening.
    pub(super) fn apply(&self, facts: Facts) -> Facts {
        (facts & !self.deletes) | self.adds
    }
}

impl Event {
    pub(super) fn apply(&self, facts: Facts) -> Facts {
        (facts & !self.deletes) | self.adds
    }

    /// Whether it happens again and again, so that nobody has to remember that it has.
    pub(crate) fn is_recurrent(&self) -> bool {
        matches!(self.occurs, Occurs::Rate(_))
    }

    /// How likely it is over at that time, in seconds; never for certain if it happens again.
    pub(super) fn is_over_by(&self, time: f64, side: Side, resolution: f64) -> Option<f64> {
        match &self.occurs {
            Occurs::Once {
                probability,
                time: rule,
            } => {
                let share = rule.share(time, side, 0.0, resolution)?;
                Some(share * probability)
            }
            Occurs::Rate(_) => Some(0.0),
        }
    }

    /// Whether it only makes facts false.
    pub(super) fn is_harmful(&self) -> bool {
        self.adds == 0
    }
}

impl Act {
    /// Whether its end alone is all that the goal asks for.
    pub(super) fn wins(&self, goal: &Needs) -> bool {
        self.rest.iter().any(|(_, end)| goal.hold(end.adds))
    }

    /// Whether it may end in more than one way.
    pub(super) fn has_chances(&self) -> bool {
        let end = self.rest.as_ref();
        self.fails() || end.is_some_and(|(_, end)| end.draws.len() > 1)
    }

    /// Whether it may fail once it has started.
    pub(super) fn fails(&self) -> bool {
        self.midway > 0.0 || self.at_end > 0.0
    }

    /// Whether some comparison may come to hold by it.
    pub(super) fn helps(&self) -> bool {
        let end = self.rest.as_ref().map_or(0, |(_, end)| end.helps);
        self.start.helps | end != 0
    }

    /// Whether it changes numbers.
    pub(super) fn changes_numbers(&self) -> bool {
        let end = self.rest.as_ref();
        !self.start.amounts.is_empty() || end.is_some_and(|(_, end)| !end.amounts.is_empty())
    }

    /// Whether it changes numbers, or goes on or ends by them.
    pub(super) fn is_about_numbers(&self, tested: Facts) -> bool {
        let reads = |needs: &Needs| needs.mentions() & tested != 0;
        let rest = self.rest.as_ref();
        self.changes_numbers()
            || rest.is_some_and(|(over_all, end)| reads(over_all) || reads(&end.needs))
    }

    /// The facts that it reads.
    pub(super) fn mentions(&self) -> Facts {
        let rest = self.rest.as_ref();
        let later = rest.map_or(0, |(over_all, end)| {
            over_all.mentions() | end.needs.mentions()
        });
        self.start.needs.mentions() | later
    }

    pub(super) fn has_negation(&self) -> bool {
        let rest = self.rest.as_ref();
        self.start.needs.has_negation()
            || rest
                .is_some_and(|(over_all, end)| over_all.has_negation() || end.needs.has_negation())
    }

    /// All that it may make true.
    pub(super) fn adds(&self) -> Facts {
        let end = self.rest.as_ref().map_or(0, |(_, end)| end.adds);
        self.start.adds | self.adds_by_failing() | end
    }

    /// All that it may make false.
    pub(super) fn deletes(&self) -> Facts {
        let end = self.rest.as_ref().map_or(0, |(_, end)| end.deletes);
        self.start.deletes | self.deletes_by_failing() | end
    }

    /// Whether its end deletes nothing that matters.
    pub(super) fn ends_kindly(&self) -> bool {
        self.rest
            .as_ref()
            .is_some_and(|(_, end)| end.deletes & !end.adds == 0)
    }

    /// Whether its end needs nothing but what it needs all the time anyway, so that no moment is
    /// better for it to end than another.
    pub(super) fn ends_safely(&self) -> bool {
        self.rest.as_ref().is_some_and(|(over_all, end)| {
            let always = over_all.conjunction().unwrap_or(0);
            end.needs
                .conjunction()
                .is_some_and(|needs| needs & !always == 0)
        })
    }

    /// Whether there can be something in cancelling it where more facts are never worse: its end
    /// may do harm, well or badly, or who begins anew may be done earlier than who goes on.
    pub(super) fn may_gain_by_cancelling(&self, model: &WorldModel) -> bool {
        !self.ends_kindly()
            || !self.ends_safely()
            || self.deletes_by_failing() != 0
            || self.may_hold_up()
            || model
                .duration_rule(&self.name)
                .is_some_and(|rule| !is_fixed(rule))
    }
}

fn is_fixed(rule: &Rule) -> bool {
    matches!(rule.distribution, Distribution::Constant(_))
}
