//! Dead ends: states that the stronger bound (temporal `h²`) shows no plan to go through, and how
//! often it is asked.

use super::super::compile::Compiled;
use super::super::pairs::Pairs;
use super::super::state::State;
use super::super::time::{NEVER, Ticks};

/// The detection of dead ends, with a share of the time.
#[derive(Debug)]
pub(super) struct DeadEnds<'a> {
    compiled: &'a Compiled,
    /// Made when it is first asked.
    pairs: Option<Pairs<'a>>,
    /// Whether there are too many pairs.
    is_too_large: bool,
    budget: CheckBudget,
    /// How much there is to an estimate.
    size: u64,
    /// After how many states it is asked.
    pub(super) evaluated: u64,
    /// Nothing may happen later.
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

    /// The number of pairs that have been looked up.
    pub(super) fn lookups(&self) -> u64 {
        self.pairs.as_ref().map_or(0, |pairs| pairs.work)
    }

    /// Whether no plan begins like this, as far as it is known, or worth the time to find out.
    pub(super) fn is_dead_end(&mut self, state: &State) -> bool {
        if self.pairs.is_none() && !self.is_too_large {
            self.pairs = Pairs::of(self.compiled);
            self.is_too_large = self.pairs.is_none();
        }
        let Some(pairs) = &mut self.pairs else {
            return false;
        };
        let patience = self.compiled.tuning.dead_end_patience.max(1);
        let share = 1 + self.evaluated / patience;
        if !self.budget.asks(self.size, share) {
            return false;
        }
        pairs.horizon = self.horizon;
        let before = pairs.work;
        let is_dead_end = pairs.is_dead_end(state);
        self.budget.note(pairs.work - before, is_dead_end);
        is_dead_end
    }
}

/// How much of the time the stronger bound may take: at first at most about half, if it cuts all
/// states. Many that it cuts would never have had their turn, so cutting many need not save much;
/// but the longer a search takes, the likelier it does, and the more is allowed.
///
/// Time is counted in pairs looked up; an estimate takes as long as some 80 of them for each of its
/// operators.
#[derive(Clone, Copy, Debug)]
struct CheckBudget {
    /// The number of pairs that may be looked up now.
    credit: u64,
    /// How many the last answer took.
    price: u64,
    /// How many of the last answers have cut a state, in 256ths.
    cuts: u64,
}

impl CheckBudget {
    const START: Self = Self {
        credit: 0,
        price: 0,
        cuts: 64,
    };

    /// One more state with an estimate of that size; a larger share of the time may be taken the
    /// longer the search takes. Whether to ask.
    fn asks(&mut self, size: u64, share: u64) -> bool {
        self.credit = (self.credit + (16 + self.cuts * share / 4) * size).min(2 * self.price);
        self.credit >= self.price
    }

    /// An answer took so many look-ups.
    fn note(&mut self, price: u64, has_cut: bool) {
        self.price = price;
        self.credit = self.credit.saturating_sub(price);
        self.cuts = (7 * self.cuts + if has_cut { 256 } else { 0 }) / 8;
    }
}
