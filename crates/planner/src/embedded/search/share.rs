//! How often the stronger bound is asked.

/// How many states a search evaluates that takes long.
const LONG: u64 = 4096;

/// How much of the time the stronger bound may take: at first at most about half, if it cuts all
/// states. Many that it cuts would never have had their turn, so cutting many need not save much;
/// but the longer a search takes, the likelier it does, and the more is allowed.
///
/// Time is counted in pairs looked up; an estimate takes as long as some 80 of them for each of its
/// operators.
#[derive(Clone, Copy, Debug)]
pub(super) struct Share {
    /// How many pairs may be looked up now.
    credit: u64,
    /// How many the last answer took.
    price: u64,
    /// How many of the last answers have cut a state, in 256ths.
    cuts: u64,
}

impl Share {
    pub(super) const START: Self = Self {
        credit: 0,
        price: 0,
        cuts: 64,
    };

    /// One more state with an estimate of that size, after so many. Whether to ask.
    pub(super) fn asks(&mut self, size: u64, evaluated: u64) -> bool {
        let doubts = 1 + evaluated / LONG;
        self.credit = (self.credit + (16 + self.cuts * doubts / 4) * size).min(2 * self.price);
        self.credit >= self.price
    }

    /// An answer took so many look-ups.
    pub(super) fn note(&mut self, price: u64, has_cut: bool) {
        self.price = price;
        self.credit = self.credit.saturating_sub(price);
        self.cuts = (7 * self.cuts + if has_cut { 256 } else { 0 }) / 8;
    }
}
