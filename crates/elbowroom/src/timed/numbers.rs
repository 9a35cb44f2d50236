//! Numbers that actions change: what is known of each is between which values it lies.
//!
//! A condition that compares a number counts as one more fact. Seen from above it holds if some of the
//! values meet it, seen from below if all do. What is drawn at an action's end is cut where that decides a
//! condition, at once or after amounts that are known; so of a number from which nothing but
//! known amounts has been taken nothing is lost by the cut.

use std::collections::BTreeSet;

use elbowroom_model::ground::FluentId;
use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;
use elbowroom_sim::{Rule, Side as Part};

use super::act::{Act, Snap};
use super::world::{Facts, unknown_shape};
use super::{NotTabulated, Side, TimedWorld};

/// Numbers are counted in millionths.
const UNIT: i64 = 1_000_000;

/// Beyond this, in millionths, a number counts as infinite.
const FAR: i64 = 1 << 60;

/// The most places at which the values of a number, or of what is drawn, are cut.
const MOST_CUTS: usize = 64;

/// After how many known amounts a condition may decide where to cut.
const MOST_SUMMED: usize = 8;

/// The values between which a number lies, both included, in millionths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Span {
    pub(super) low: i64,
    pub(super) high: i64,
}

/// A number that actions change.
#[derive(Clone, Debug)]
pub(crate) struct Number {
    pub(super) fluent: FluentId,
    pub(super) initial: Span,
    /// Values of which each is told from those above it, in order.
    edges: Vec<i64>,
    /// Values from which nothing but known amounts lead to those that are known.
    known: Vec<i64>,
}

/// A comparison, which is a fact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Test {
    pub(super) number: usize,
    pub(super) comparison: Compared,
    /// In millionths.
    pub(super) bound: i64,
}

/// How a number compares with a bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compared {
    AtMost,
    AtLeast,
    Equal,
    Unequal,
}

/// What a happening does to a number.
#[derive(Clone, Debug)]
pub(crate) struct Amount {
    pub(super) number: usize,
    pub(super) change: Changed,
    pub(super) by: By,
}

/// In which way a number changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Changed {
    /// It becomes that.
    Set,
    /// So much is added.
    Added,
    /// So much is taken away.
    Taken,
}

/// By how much a number changes.
#[derive(Clone, Debug)]
pub(super) enum By {
    /// In millionths.
    Known(i64),
    /// A value that is drawn for one that is planned.
    Drawn { rule: Rule, planned: f64 },
}

/// A number in millionths, if it is a whole number of them.
pub(super) fn units(value: &Rational) -> Option<i64> {
    let (whole, one) = (value * &Rational::from(UNIT)).as_small()?;
    (one == 1 && whole.abs() < FAR).then_some(whole)
}

impl Span {
    pub(super) fn point(value: i64) -> Self {
        Self {
            low: value,
            high: value,
        }
    }

    /// A value that may lie between two whole numbers of millionths.
    fn around(value: &Rational) -> Option<Self> {
        let all = value * &Rational::from(UNIT);
        let (low, _) = all.floor().as_small()?;
        let (high, _) = all.ceil().as_small()?;
        Some(Self { low, high })
    }

    fn plus(self, other: Self) -> Self {
        Self {
            low: sum(self.low, other.low),
            high: sum(self.high, other.high),
        }
    }

    fn negated(self) -> Self {
        Self {
            low: -self.high,
            high: -self.low,
        }
    }
}

/// The sum of two lower or two upper ends; what is beyond is infinite.
fn sum(left: i64, right: i64) -> i64 {
    if left.abs() >= FAR {
        left
    } else {
        left.saturating_add(right).clamp(-FAR, FAR)
    }
}

impl Test {
    /// The comparison of a number with a bound in millionths, which are whole numbers.
    pub(super) fn new(number: usize, comparison: Comparison, bound: i64) -> Self {
        let (comparison, bound) = match comparison {
            // What is counted in millionths is below a bound if it is at most a millionth less.
            Comparison::Less => (Compared::AtMost, bound - 1),
            Comparison::AtMost => (Compared::AtMost, bound),
            Comparison::Equal => (Compared::Equal, bound),
            Comparison::AtLeast => (Compared::AtLeast, bound),
            Comparison::Greater => (Compared::AtLeast, bound + 1),
        };
        Self {
            number,
            comparison,
            bound,
        }
    }

    /// The comparison that holds where this one does not.
    pub(super) fn negated(self) -> Self {
        let (comparison, bound) = match self.comparison {
            Compared::AtMost => (Compared::AtLeast, self.bound + 1),
            Compared::AtLeast => (Compared::AtMost, self.bound - 1),
            Compared::Equal => (Compared::Unequal, self.bound),
            Compared::Unequal => (Compared::Equal, self.bound),
        };
        Self {
            comparison,
            bound,
            ..self
        }
    }

    /// Whether it holds for some of the values (from above), or for all (from below).
    fn holds(self, span: Span, side: Side) -> bool {
        let bound = self.bound;
        match side {
            Side::Above => match self.comparison {
                Compared::AtMost => span.low <= bound,
                Compared::AtLeast => span.high >= bound,
                Compared::Equal => span.low <= bound && bound <= span.high,
                Compared::Unequal => span != Span::point(bound),
            },
            Side::Below => !self.negated().holds(span, Side::Above),
        }
    }

    /// The values after which it changes.
    fn edges(self) -> Vec<i64> {
        match self.comparison {
            Compared::AtMost => vec![self.bound],
            Compared::AtLeast => vec![self.bound - 1],
            Compared::Equal | Compared::Unequal => vec![self.bound - 1, self.bound],
        }
    }
}

impl Number {
    pub(super) fn new(fluent: FluentId, initial: i64) -> Self {
        Self {
            fluent,
            initial: Span::point(initial),
            edges: Vec::new(),
            known: Vec::new(),
        }
    }

    /// All values that need not be told from some of these. A single one stays what it is where it is
    /// known how one comes to it.
    fn widened(&self, span: Span) -> Span {
        if span.low == span.high && self.known.binary_search(&span.low).is_ok() {
            return span;
        }
        let below = self.edges.partition_point(|edge| *edge < span.low);
        let above = self.edges.partition_point(|edge| *edge < span.high);
        Span {
            low: below
                .checked_sub(1)
                .map_or(-FAR, |place| self.edges[place] + 1),
            high: self.edges.get(above).copied().unwrap_or(FAR),
        }
    }
}

impl Amount {
    /// The place of the number.
    pub(super) fn number(&self) -> usize {
        self.number
    }

    /// Whether that comparison may hold because of it, where it does not.
    pub(super) fn may_help(&self, test: &Test) -> bool {
        let rises = match (self.change, &self.by) {
            (Changed::Set, _) | (_, By::Drawn { .. }) => None,
            (Changed::Added, By::Known(value)) => Some(*value > 0),
            (Changed::Taken, By::Known(value)) => Some(*value < 0),
        };
        let wanted = match test.comparison {
            Compared::AtLeast => Some(true),
            Compared::AtMost => Some(false),
            Compared::Equal | Compared::Unequal => None,
        };
        self.number == test.number && (rises.is_none() || wanted.is_none() || rises == wanted)
    }

    /// Whether the number becomes that, whatever it was.
    pub(super) fn sets(&self) -> bool {
        self.change == Changed::Set
    }

    pub(super) fn is_drawn(&self) -> bool {
        matches!(self.by, By::Drawn { .. })
    }

    /// The most by which the number can change, if it is then no further than that way.
    fn cut(&self, way: i64) -> i64 {
        match self.change {
            Changed::Set | Changed::Added => way,
            Changed::Taken => -way - 1,
        }
    }

    fn applied(&self, number: &Number, before: Span, by: Span) -> Span {
        let after = match self.change {
            Changed::Set => by,
            Changed::Added => before.plus(by),
            Changed::Taken => before.plus(by.negated()),
        };
        number.widened(after)
    }
}

impl TimedWorld {
    /// Facts, with the comparisons that hold for numbers as this side sees them.
    pub(super) fn with_tests(&self, facts: Facts, numbers: &[Span], side: Side) -> Facts {
        let tests = self.tests.iter().enumerate();
        let holding = tests.filter(|(_, test)| test.holds(numbers[test.number], side));
        let first = self.facts.len();
        holding.fold(facts & !self.tested, |all, (place, _)| {
            all | 1 << (first + place)
        })
    }

    /// Numbers after a happening, if that is what is drawn.
    pub(super) fn changed(&self, numbers: &mut [Span], snap: &Snap, draw: usize) {
        for (amount, by) in snap.amounts.iter().zip(&snap.draws[draw].1) {
            let number = amount.number;
            numbers[number] = amount.applied(&self.numbers[number], numbers[number], *by);
        }
    }

    /// The spans in which numbers with these values may lie in a state, the most exact first.
    pub(super) fn spans_of(&self, values: &[Rational]) -> Option<Vec<Vec<Span>>> {
        let mut all = vec![Vec::new()];
        for (number, value) in self.numbers.iter().zip(values) {
            let span = Span::around(value)?;
            let mut ways = vec![number.widened(span)];
            if ways[0].low == ways[0].high {
                let wider = Number {
                    known: Vec::new(),
                    ..number.clone()
                };
                ways.push(wider.widened(span));
            }
            let longer = all.iter().flat_map(|before: &Vec<Span>| {
                ways.iter().map(move |way| {
                    let mut longer = before.clone();
                    longer.push(*way);
                    longer
                })
            });
            all = longer.collect();
        }
        Some(all)
    }

    /// Enters where numbers are cut, and how what is drawn may come out.
    pub(super) fn cut(&mut self) -> Result<(), NotTabulated> {
        for place in 0..self.numbers.len() {
            self.cut_number(place);
        }
        for act in 0..self.acts.len() {
            let of_start = self.draws(&self.acts[act].start)?;
            self.acts[act].start.draws = of_start;
            if let Some((_, end)) = &self.acts[act].rest {
                let of_end = self.draws(end)?;
                if let Some((_, end)) = &mut self.acts[act].rest {
                    end.draws = of_end;
                }
            }
        }
        Ok(())
    }

    fn amounts_of(&self, number: usize) -> impl Iterator<Item = &Amount> {
        let snaps = self.acts.iter().flat_map(|act| {
            let end = act.rest.iter().map(|(_, end)| end);
            std::iter::once(&act.start).chain(end)
        });
        let amounts = snaps.flat_map(|snap| &snap.amounts);
        amounts.filter(move |amount| amount.number == number)
    }

    /// Those of actions with which it is not over.
    fn amounts_before_goal(&self, number: usize) -> impl Iterator<Item = &Amount> {
        let acts = self.acts.iter().filter(|act| !act.wins(&self.goal));
        let snaps = acts.flat_map(|act| {
            let end = act.rest.iter().map(|(_, end)| end);
            std::iter::once(&act.start).chain(end)
        });
        let amounts = snaps.flat_map(|snap| &snap.amounts);
        amounts.filter(move |amount| amount.number == number)
    }

    /// Values that are known from the beginning, or once they are set.
    fn anchors(&self, number: usize) -> BTreeSet<i64> {
        let set = self.amounts_of(number).filter_map(|amount| match amount {
            Amount {
                change: Changed::Set,
                by: By::Known(value),
                ..
            } => Some(*value),
            _ => None,
        });
        set.chain([self.numbers[number].initial.low]).collect()
    }

    /// The values at which conditions change, each once.
    fn thresholds(&self, number: usize) -> BTreeSet<i64> {
        let first = self.facts.len();
        let asked_for = self.asked_for();
        let tests = self.tests.iter().enumerate();
        let own = tests.filter(|(place, test)| {
            test.number == number && asked_for & (1 << (first + place)) != 0
        });
        own.flat_map(|(_, test)| test.edges()).collect()
    }

    /// The facts and comparisons that some condition reads.
    fn asked_for(&self) -> Facts {
        let of_act = |act: &Act| {
            let rest = act.rest.as_ref();
            let rest = rest.map_or(0, |(over_all, end)| {
                over_all.mentions() | end.needs.mentions()
            });
            act.start.needs.mentions() | rest
        };
        let of_acts = self.acts.iter().fold(0, |all, act| all | of_act(act));
        of_acts | self.goal.mentions()
    }

    /// What known amounts add up to, those of fewer amounts first.
    fn sums(&self, number: usize) -> Vec<i64> {
        let steps = self
            .amounts_before_goal(number)
            .filter_map(|amount| match amount {
                Amount {
                    change: Changed::Added,
                    by: By::Known(value),
                    ..
                } => Some(*value),
                Amount {
                    change: Changed::Taken,
                    by: By::Known(value),
                    ..
                } => Some(-*value),
                _ => None,
            });
        let steps: BTreeSet<i64> = steps.collect();
        let ends: BTreeSet<i64> = &self.anchors(number) | &self.thresholds(number);
        let range = ends.last().unwrap_or(&0) - ends.first().unwrap_or(&0);
        let mut all = vec![0];
        let mut seen = BTreeSet::from([0]);
        let mut last = vec![0];
        for _ in 0..MOST_SUMMED {
            let mut next = Vec::new();
            for sum in &last {
                for step in &steps {
                    let longer: i64 = sum + step;
                    if longer.abs() <= range && seen.insert(longer) {
                        next.push(longer);
                    }
                }
            }
            all.extend(&next);
            last = next;
        }
        all
    }

    fn cut_number(&mut self, place: usize) {
        let sums = self.sums(place);
        let anchors = self.anchors(place);
        let mut edges = BTreeSet::new();
        let mut known = BTreeSet::new();
        let (lowest, highest) = (anchors.first().copied(), anchors.last().copied());
        let only = |one: Changed, other: Changed| {
            self.amounts_of(place).all(|amount| match amount.by {
                By::Known(value) => match amount.change {
                    Changed::Set => true,
                    change => (change == one && value >= 0) || (change == other && value <= 0),
                },
                By::Drawn { .. } => amount.change == one && self.is_never_negative(amount),
            })
        };
        let only_falls = only(Changed::Taken, Changed::Added);
        // A number that only rises is never below all that are known, and one that only falls never above.
        if let Some(lowest) = lowest.filter(|_| only(Changed::Added, Changed::Taken)) {
            edges.insert(lowest - 1);
        }
        for sum in sums {
            for edge in self.thresholds(place) {
                let is_beyond = only_falls && highest.is_some_and(|highest| edge - sum > highest);
                if edges.len() < MOST_CUTS && !is_beyond {
                    edges.insert(edge - sum);
                }
            }
            for anchor in &anchors {
                if known.len() < MOST_CUTS {
                    known.insert(anchor + sum);
                }
            }
        }
        let drawn = self.amounts_of(place).filter(|amount| amount.is_drawn());
        for (anchor, half) in drawn.flat_map(|amount| self.halves(amount)) {
            if edges.len() < MOST_CUTS {
                edges.insert(anchor + half);
            }
        }
        let number = &mut self.numbers[place];
        number.edges = edges.into_iter().collect();
        number.known = known.into_iter().collect();
    }

    /// From where on what is drawn leads to a threshold in two steps that are alike, and by how much in each.
    fn halves(&self, amount: &Amount) -> Vec<(i64, i64)> {
        if amount.change == Changed::Set {
            return Vec::new();
        }
        let anchors = self.anchors(amount.number);
        let thresholds = self.thresholds(amount.number);
        let ways = anchors.iter().flat_map(|anchor| {
            let half = move |edge: &i64| (*anchor, (edge - *anchor).div_euclid(2));
            thresholds.iter().map(half)
        });
        let decides = |(_, half): &(i64, i64)| self.may_be_beyond(amount, amount.cut(*half));
        ways.filter(decides).collect()
    }

    /// How likely what is drawn is to be at most that; `None` if its shape is not known.
    fn share(&self, amount: &Amount, value: i64) -> Option<f64> {
        let By::Drawn { rule, planned } = &amount.by else {
            return None;
        };
        #[allow(clippy::cast_precision_loss, reason = "far below 2^52")]
        let value = value as f64 / UNIT as f64;
        rule.share(value, Part::UpTo, *planned, self.model.resolution.to_f64())
    }

    /// Whether what is drawn may be more than that, and may be less.
    fn may_be_beyond(&self, amount: &Amount, value: i64) -> bool {
        let share = self.share(amount, value);
        share.is_some_and(|share| share > 1e-9 && share < 1.0 - 1e-9)
    }

    fn is_never_negative(&self, amount: &Amount) -> bool {
        self.share(amount, -1).is_some_and(|share| share <= 0.0)
    }

    /// How what a happening draws may come out.
    fn draws(&self, snap: &Snap) -> Result<Vec<(f64, Vec<Span>)>, NotTabulated> {
        let mut all: Vec<(f64, Vec<Span>)> = vec![(1.0, Vec::new())];
        for amount in &snap.amounts {
            let parts = match &amount.by {
                By::Known(value) => vec![(1.0, Span::point(*value))],
                By::Drawn { .. } => self.parts(amount).ok_or_else(unknown_shape)?,
            };
            let longer = all.iter().flat_map(|(weight, before)| {
                parts.iter().map(move |(p, span)| {
                    let mut longer = before.clone();
                    longer.push(*span);
                    (weight * p, longer)
                })
            });
            all = longer.collect();
        }
        Ok(all)
    }

    /// What is drawn, cut where that decides something, with how likely each part is.
    fn parts(&self, amount: &Amount) -> Option<Vec<(f64, Span)>> {
        let lowest = if self.is_never_negative(amount) {
            0
        } else {
            -FAR
        };
        let mut parts = Vec::new();
        let (mut low, mut before) = (lowest, 0.0);
        for high in self.cuts(amount).into_iter().chain([FAR]) {
            let until = if high < FAR {
                self.share(amount, high)?
            } else {
                1.0
            };
            let p: f64 = until - before;
            if p > 0.0 {
                parts.push((p, Span { low, high }));
            }
            (low, before) = (high.saturating_add(1), until);
        }
        Some(parts)
    }

    /// Where what is drawn decides something.
    fn cuts(&self, amount: &Amount) -> BTreeSet<i64> {
        let number = amount.number;
        let from = match amount.change {
            Changed::Set => BTreeSet::from([0]),
            Changed::Added | Changed::Taken => self.anchors(number),
        };
        let ways = self.sums(number).into_iter().flat_map(|sum| {
            let thresholds = self.thresholds(number).into_iter();
            let ways =
                thresholds.flat_map(|edge| from.iter().map(move |anchor| edge - anchor - sum));
            ways.collect::<Vec<_>>()
        });
        let halves = self.halves(amount).into_iter().map(|(_, half)| half);
        let mut cuts = BTreeSet::new();
        for way in ways.chain(halves) {
            let cut = amount.cut(way);
            if cuts.len() < MOST_CUTS && self.may_be_beyond(amount, cut) {
                cuts.insert(cut);
            }
        }
        cuts
    }
}
