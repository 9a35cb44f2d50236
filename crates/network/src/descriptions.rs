//! Descriptions of bounds in words, with the file's own names.

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::LinkId;
use elbowroom_stn::{ConstraintId, NodeId};

use crate::file::NetworkFile;

/// Digits after the decimal point in messages.
const DIGITS: u32 = 3;

/// Formats a number with few decimals.
pub fn decimal(value: &Rational) -> String {
    value.to_decimal(DIGITS)
}

impl NetworkFile {
    /// Describes `to - from <= bound` in words: "C at most 12 after X", "X at least 7 after C".
    pub fn bound_in_words(&self, from: NodeId, to: NodeId, bound: &Rational) -> String {
        let (from, to) = (self.point(from), self.point(to));
        if bound.is_negative() {
            format!("{from} at least {} after {to}", decimal(&-bound))
        } else if bound.is_zero() {
            format!("{to} not after {from}")
        } else {
            format!("{to} at most {} after {from}", decimal(bound))
        }
    }

    /// Describes a requirement in words.
    pub fn requirement_in_words(&self, id: ConstraintId) -> String {
        let constraint = self.network.requirements().constraint(id);
        self.bound_in_words(constraint.from, constraint.to, &constraint.bound)
    }

    /// Describes that a link may end as early as its lower bound.
    pub fn early_in_words(&self, id: LinkId) -> String {
        let link = self.network.link(id);
        let (begin, end) = (self.point(link.activation), self.point(link.end));
        let lower = decimal(&link.lower);
        format!("{end} may come as early as {lower} after {begin}")
    }

    /// Describes that a link may end as late as its upper bound.
    pub fn late_in_words(&self, id: LinkId) -> String {
        let link = self.network.link(id);
        let (begin, end) = (self.point(link.activation), self.point(link.end));
        match &link.upper {
            Some(upper) => {
                format!("{end} may come as late as {} after {begin}", decimal(upper))
            }
            None => format!("{end} may come arbitrarily late after {begin}"),
        }
    }

    /// Describes that a link has this duration.
    pub fn duration_in_words(&self, id: LinkId, duration: &Rational) -> String {
        let link = self.network.link(id);
        let (begin, end) = (self.point(link.activation), self.point(link.end));
        format!("{end} comes {} after {begin}", decimal(duration))
    }
}
