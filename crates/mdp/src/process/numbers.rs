//! Numbers of a world: their comparisons and changes, and the division of their values and of random
//! amounts into intervals. The cuts are where a value decides a condition: at once, after constant amounts, or after a second draw. So the
//! division is exact for a number that has changed only by constant amounts.

use std::collections::BTreeSet;

use elbowroom_num::Rational;
use elbowroom_sim::Side as Part;

use super::action_model::{ActionModel, Facts, Snap};
use super::value_intervals::{Amount, ChangeOperator, ChangeValue, INFINITE, Number, Span, UNIT};
use super::world::{TimedWorld, unknown_shape};
use crate::settings::{NotTabulated, Side};

/// Maximum number of cuts of a number, or of a random amount.
const MAX_CUTS: usize = 64;

/// Maximum number of constant amounts that are added up to find cuts.
const MAX_SUMMED: usize = 8;

impl Amount {
    /// Returns the cut of the amount that separates changes (or assigned values) of at most `way`
    /// from larger ones, in millionths.
    fn cut(&self, way: i64) -> i64 {
        match self.change {
            ChangeOperator::Set | ChangeOperator::Add => way,
            ChangeOperator::Subtract => -way - 1,
        }
    }
}

impl TimedWorld {
    /// Returns the facts together with the comparisons that hold for the numbers, for this side.
    pub(crate) fn with_tests(&self, facts: Facts, numbers: &[Span], side: Side) -> Facts {
        let tests = self.tests.iter().enumerate();
        let holding = tests.filter(|(_, test)| test.holds(numbers[test.number], side));
        let first = self.facts.len();
        holding.fold(facts & !self.tested, |all, (place, _)| {
            all | 1 << (first + place)
        })
    }

    /// Applies the changes of a happening to numbers, with the given draw.
    pub(crate) fn apply_changes(&self, numbers: &mut [Span], snap: &Snap, draw: usize) {
        for (amount, by) in snap.amounts.iter().zip(&snap.draws[draw].1) {
            let number = amount.number;
            numbers[number] = amount.apply_to(&self.numbers[number], numbers[number], *by);
        }
    }

    /// Returns the possible intervals of numbers with these values in a state, the most exact
    /// first.
    pub(crate) fn spans_of(&self, values: &[Rational]) -> Option<Vec<Vec<Span>>> {
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

    /// Computes the cuts of numbers, and the possible draws of random amounts.
    pub(crate) fn cut(&mut self) -> Result<(), NotTabulated> {
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

    /// Returns the changes of a number by actions that do not reach the goal.
    fn amounts_before_goal(&self, number: usize) -> impl Iterator<Item = &Amount> {
        let acts = self
            .acts
            .iter()
            .filter(|act| !act.achieves_goal(&self.goal));
        let snaps = acts.flat_map(|act| {
            let end = act.rest.iter().map(|(_, end)| end);
            std::iter::once(&act.start).chain(end)
        });
        let amounts = snaps.flat_map(|snap| &snap.amounts);
        amounts.filter(move |amount| amount.number == number)
    }

    /// Returns the known values: the initial one, and those that are assigned.
    fn anchors(&self, number: usize) -> BTreeSet<i64> {
        let set = self.amounts_of(number).filter_map(|amount| match amount {
            Amount {
                change: ChangeOperator::Set,
                by: ChangeValue::Constant(value),
                ..
            } => Some(*value),
            _ => None,
        });
        set.chain([self.numbers[number].initial.low]).collect()
    }

    /// Returns the values at which conditions change.
    fn thresholds(&self, number: usize) -> BTreeSet<i64> {
        let first = self.facts.len();
        let asked_for = self.facts_in_conditions();
        let tests = self.tests.iter().enumerate();
        let own = tests.filter(|(place, test)| {
            test.number == number && asked_for & (1 << (first + place)) != 0
        });
        own.flat_map(|(_, test)| test.edges()).collect()
    }

    /// Returns the facts and comparisons that some condition reads.
    fn facts_in_conditions(&self) -> Facts {
        let of_act = |act: &ActionModel| {
            let rest = act.rest.as_ref();
            let rest = rest.map_or(0, |(over_all, end)| {
                over_all.mentions() | end.needs.mentions()
            });
            act.start.needs.mentions() | rest
        };
        let of_acts = self.acts.iter().fold(0, |all, act| all | of_act(act));
        of_acts | self.goal.mentions()
    }

    /// Returns the sums of constant amounts, those of fewer amounts first.
    fn sums(&self, number: usize) -> Vec<i64> {
        let steps = self
            .amounts_before_goal(number)
            .filter_map(|amount| match amount {
                Amount {
                    change: ChangeOperator::Add,
                    by: ChangeValue::Constant(value),
                    ..
                } => Some(*value),
                Amount {
                    change: ChangeOperator::Subtract,
                    by: ChangeValue::Constant(value),
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
        for _ in 0..MAX_SUMMED {
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
        let only = |one: ChangeOperator, other: ChangeOperator| {
            self.amounts_of(place).all(|amount| match amount.by {
                ChangeValue::Constant(value) => match amount.change {
                    ChangeOperator::Set => true,
                    change => (change == one && value >= 0) || (change == other && value <= 0),
                },
                ChangeValue::Random { .. } => {
                    amount.change == one && self.is_never_negative(amount)
                }
            })
        };
        let only_falls = only(ChangeOperator::Subtract, ChangeOperator::Add);
        // A number that only rises is never below all known values, and one that only falls never
        // above.
        if let Some(lowest) = lowest.filter(|_| only(ChangeOperator::Add, ChangeOperator::Subtract))
        {
            edges.insert(lowest - 1);
        }
        for sum in sums {
            for edge in self.thresholds(place) {
                let is_beyond = only_falls && highest.is_some_and(|highest| edge - sum > highest);
                if edges.len() < MAX_CUTS && !is_beyond {
                    edges.insert(edge - sum);
                }
            }
            for anchor in &anchors {
                if known.len() < MAX_CUTS {
                    known.insert(anchor + sum);
                }
            }
        }
        let drawn = self.amounts_of(place).filter(|amount| amount.is_drawn());
        for (anchor, half) in drawn.flat_map(|amount| self.halves(amount)) {
            if edges.len() < MAX_CUTS {
                edges.insert(anchor + half);
            }
        }
        let number = &mut self.numbers[place];
        number.edges = edges.into_iter().collect();
        number.known = known.into_iter().collect();
    }

    /// Returns pairs of a known value and an amount: two random amounts of this size lead from the
    /// value to a threshold.
    fn halves(&self, amount: &Amount) -> Vec<(i64, i64)> {
        if amount.change == ChangeOperator::Set {
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

    /// Returns the probability that a random amount is at most `value`; `None` if its distribution
    /// function is not available.
    fn share(&self, amount: &Amount, value: i64) -> Option<f64> {
        let ChangeValue::Random { rule, planned } = &amount.by else {
            return None;
        };
        #[allow(clippy::cast_precision_loss, reason = "far below 2^52")]
        let value = value as f64 / UNIT as f64;
        rule.probability_of_side(
            value,
            Part::AtMost,
            *planned,
            self.model.resolution.to_f64(),
        )
    }

    /// Returns `true` if a random amount may be larger than `value`, and may be smaller.
    fn may_be_beyond(&self, amount: &Amount, value: i64) -> bool {
        let share = self.share(amount, value);
        share.is_some_and(|share| share > 1e-9 && share < 1.0 - 1e-9)
    }

    fn is_never_negative(&self, amount: &Amount) -> bool {
        self.share(amount, -1).is_some_and(|share| share <= 0.0)
    }

    /// Returns the possible draws of a happening, with their probabilities.
    fn draws(&self, snap: &Snap) -> Result<Vec<(f64, Vec<Span>)>, NotTabulated> {
        let mut all: Vec<(f64, Vec<Span>)> = vec![(1.0, Vec::new())];
        for amount in &snap.amounts {
            let parts = match &amount.by {
                ChangeValue::Constant(value) => vec![(1.0, Span::point(*value))],
                ChangeValue::Random { .. } => self.parts(amount).ok_or_else(unknown_shape)?,
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

    /// Returns the intervals of a random amount between its cuts, with their probabilities.
    fn parts(&self, amount: &Amount) -> Option<Vec<(f64, Span)>> {
        let lowest = if self.is_never_negative(amount) {
            0
        } else {
            -INFINITE
        };
        let mut parts = Vec::new();
        let (mut low, mut before) = (lowest, 0.0);
        for high in self.cuts(amount).into_iter().chain([INFINITE]) {
            let until = if high < INFINITE {
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

    /// Returns the values of a random amount that decide a condition.
    fn cuts(&self, amount: &Amount) -> BTreeSet<i64> {
        let number = amount.number;
        let from = match amount.change {
            ChangeOperator::Set => BTreeSet::from([0]),
            ChangeOperator::Add | ChangeOperator::Subtract => self.anchors(number),
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
            if cuts.len() < MAX_CUTS && self.may_be_beyond(amount, cut) {
                cuts.insert(cut);
            }
        }
        cuts
    }
}
