//! Compressibility: the loss of plans if an action ends before any other happening, in the order of
//! happenings.

use super::{Action, Change, Compressibility, Snap};
use crate::embedded::formula::{Formula, Literal};

/// The actions that need a literal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Readers {
    None,
    Only(u32),
    Many,
}

impl Readers {
    fn note(&mut self, action: u32) {
        *self = match *self {
            Self::None => Self::Only(action),
            Self::Only(other) if other == action => Self::Only(action),
            _ => Self::Many,
        };
    }

    pub(super) fn has_other_than(self, action: u32) -> bool {
        !matches!(self, Self::None) && self != Self::Only(action)
    }
}

/// Returns for each literal the actions that need it.
pub(super) fn readers(actions: &[Action], snaps: &[Snap], count: usize) -> Vec<Readers> {
    let mut readers = vec![Readers::None; 2 * count];
    for (number, action) in (0..).zip(actions) {
        let mut note = |formula: &Formula| {
            formula.visit_literals(&mut |literal| {
                readers[literal.index()].note(number);
            });
        };
        note(&action.over_all);
        for snap in [action.start, action.end] {
            if let Some(snap) = snaps.get(snap as usize) {
                note(&snap.condition);
                snap.conditional.iter().for_each(|effect| note(&effect.now));
            }
        }
    }
    readers
}

pub(super) fn compressibility(
    start: &Snap,
    end: &Snap,
    is_read_by_others: &dyn Fn(Literal) -> bool,
) -> Compressibility {
    let conditional = end
        .conditional
        .iter()
        .filter_map(|effect| match effect.change {
            Change::Delete(fact) => Some(fact),
            _ => None,
        });
    let mut withdrawn = end.deletes.iter().copied().chain(conditional);
    let mut given_back = end.adds.iter();
    let offers = withdrawn
        .any(|fact| start.adds.contains(&fact) && is_read_by_others(Literal::new(fact, true)))
        || given_back.any(|fact| {
            start.deletes.contains(fact) && is_read_by_others(Literal::new(*fact, false))
        });
    let lends = end.updates.iter().any(|back| {
        back.operator.is_additive()
            && start
                .updates
                .iter()
                .any(|out| out.fluent == back.fluent && out.operator != back.operator)
    });
    match (offers, lends) {
        (true, _) => Compressibility::Envelope,
        (false, true) => Compressibility::HoldsResource,
        (false, false) => Compressibility::Safe,
    }
}

/// Returns `true` if the start makes a literal of its own condition false.
pub(super) fn excludes_itself(start: &Snap) -> bool {
    start.condition.literals.iter().any(|literal| {
        if literal.truth() {
            start.deletes.contains(&literal.fact())
        } else {
            start.adds.contains(&literal.fact())
        }
    })
}
