//! Dead ends: states from which the stronger bound (temporal `h²`) proves that there is no plan,
//! and the frequency of its computation.

use super::super::compile::Compiled;
use super::super::h2::H2;
use super::super::state::State;
use super::super::time::{NEVER, Ticks};

/// The detection of dead ends, with a share of the time.
#[derive(Debug)]
pub(super) struct DeadEnds<'a> {
    compiled: &'a Compiled,
    /// Created at its first use.
    pairs: Option<H2<'a>>,
    /// `true` if there are too many pairs.
    is_too_large: bool,
    budget: CheckBudget,
    /// Size of an estimate: number of operators.
    size: u64,
    /// Number of states evaluated so far.
    pub(super) evaluated: u64,
    /// Latest time of a happening.
    pub(super) horizon: Ticks,
}

impl<'a> DeadEnds<'a> {
    pub(super) fn new(compiled: &'a Compiled, size: u64) -> Self {
        Self {
            compiled,
            pairs: None,
            is_too_large: false,
            budget: CheckBudget::START,
            size,
            evaluated: 0,
            horizon: NEVER,
        }
    }

    /// Returns the number of pairs that have been looked up.
    pub(super) fn lookups(&self) -> u64 {
        self.pairs.as_ref().map_or(0, |pairs| pairs.work)
    }

    /// Returns `true` if the state is proved to be a dead end. Returns `false` without a check if
    /// the budget does not permit one.
    pub(super) fn is_dead_end(&mut self, state: &State) -> bool {
        if self.pairs.is_none() && !self.is_too_large {
            self.pairs = H2::of(self.compiled);
            self.is_too_large = self.pairs.is_none();
        }
        let Some(pairs) = &mut self.pairs else {
            return false;
        };
        let patience = self.compiled.tuning.dead_end_patience.max(1);
        let share = 1 + self.evaluated / patience;
        if !self.budget.may_check(self.size, share) {
            return false;
        }
        pairs.horizon = self.horizon;
        let before = pairs.work;
        let is_dead_end = pairs.is_dead_end(state);
        self.budget.note(pairs.work - before, is_dead_end);
        is_dead_end
    }
}

/// Share of the time that the stronger bound may take: at first at most about half, if it prunes
/// all states. Many of the pruned states would never have been expanded, so the savings may be
/// small. They are more likely the longer a search takes, so the share grows.
///
/// Time is measured in looked-up pairs. An estimate takes as long as about 80 of them for each of
/// its operators.
#[derive(Clone, Copy, Debug)]
struct CheckBudget {
    /// Number of pairs that may be looked up now.
    credit: u64,
    /// Number of pairs looked up by the last check.
    price: u64,
    /// Fraction of the last checks that pruned a state, in 256ths.
    cuts: u64,
}

impl CheckBudget {
    const START: Self = Self {
        credit: 0,
        price: 0,
        cuts: 64,
    };

    /// Adds the credit for one more state with an estimate of size `size`. `share` grows with the
    /// duration of the search. Returns `true` if a check is permitted.
    fn may_check(&mut self, size: u64, share: u64) -> bool {
        self.credit = (self.credit + (16 + self.cuts * share / 4) * size).min(2 * self.price);
        self.credit >= self.price
    }

    /// Records a check that looked up `price` pairs.
    fn note(&mut self, price: u64, has_cut: bool) {
        self.price = price;
        self.credit = self.credit.saturating_sub(price);
        self.cuts = (7 * self.cuts + if has_cut { 256 } else { 0 }) / 8;
    }
}
