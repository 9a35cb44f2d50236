//! Search for the largest box along one direction.

use std::ops::ControlFlow;

use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParameterId, ParametrizedPlan, Side};

use crate::cut::Cut;
use crate::cut_generation::CheckOutcome;
use crate::obligations::Refusal;
use crate::oracle::Oracle;
use crate::row::Row;

/// Number of halvings of an interval when no linear cut is known.
const HALVINGS: usize = 40;

/// Boxes that grow with a number: each end lies at `min(most, base + number · step)`.
#[derive(Clone, Debug)]
pub(crate) struct LineSearch {
    /// By [`place`]: the reach of the end at 0.
    pub(crate) base: Vec<Rational>,
    /// The distance by which the end moves out per unit; not negative.
    pub(crate) step: Vec<Rational>,
    /// Greatest reach of the end; `None` without limit.
    pub(crate) most: Vec<Option<Rational>>,
}

/// Largest box along a [`LineSearch`], as bounds on its number.
#[derive(Clone, Debug)]
pub(crate) struct SearchBounds {
    /// The box with this number is inside the envelope.
    pub(crate) lower_bound: Rational,
    /// No box with a greater number is inside; the same as `inside` if that is exact.
    pub(crate) upper_bound: Rational,
    /// Cut that rejects greater numbers, by position; `None` if only the caller's limit does, or if
    /// the reason is not linear.
    pub(crate) cut: Option<usize>,
}

/// Returns the position of an end in a list: lower and upper, parameter by parameter.
pub(crate) fn end_index(end: BoxEnd) -> usize {
    2 * end.parameter.index() + end.side.index()
}

impl LineSearch {
    /// Creates a ray at the nominal values, without a direction. Ends may reach as far as the
    /// ranges of the parameters; those of uncertain durations are at 0 or later.
    pub(crate) fn new(plan: &ParametrizedPlan) -> Self {
        let count = plan.parameters.len();
        let mut ray = Self {
            base: Vec::with_capacity(2 * count),
            step: vec![Rational::ZERO; 2 * count],
            most: Vec::with_capacity(2 * count),
        };
        for parameter in &plan.parameters {
            for side in Side::BOTH {
                let point = Interval::point(parameter.nominal.clone());
                ray.base.push(side.reach(&point).unwrap_or_default());
                ray.most.push(side.reach(&parameter.range));
            }
        }
        ray
    }

    /// Returns the reach of the end at a place.
    pub(crate) fn reach(&self, place: usize, number: &Rational) -> Rational {
        let reach = &self.base[place] + &self.step[place] * number;
        match &self.most[place] {
            // An end that does not move stays where it is.
            Some(most) if !self.step[place].is_zero() => reach.min(most.clone()),
            _ => reach,
        }
    }

    /// Returns the box of a number.
    pub(crate) fn at(&self, plan: &ParametrizedPlan, number: &Rational) -> DecoupledEnvelope {
        let mut envelope = DecoupledEnvelope::point(&plan.nominal());
        for index in 0..plan.parameters.len() {
            let lower = -self.reach(2 * index, number);
            let upper = self.reach(2 * index + 1, number);
            envelope =
                envelope.with_interval(ParameterId::from(index), Interval::closed(lower, upper));
        }
        envelope
    }

    /// Searches for the greatest number from `least` to `most` whose box is inside the envelope.
    /// The box of `least` must be inside.
    ///
    /// A rejected box yields cuts. The greatest number that satisfies them is checked next, so the
    /// first accepted number is the result. If no linear cut is known, the interval is halved. New
    /// cuts are added to `cuts`. `on_step` receives the greatest number so far before each check,
    /// and can end the search.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub(crate) fn search(
        &self,
        oracle: &mut Oracle,
        least: &Rational,
        most: &Rational,
        cuts: &mut Vec<Cut>,
        on_step: &mut dyn FnMut(&Oracle, &Rational) -> ControlFlow<()>,
    ) -> Result<SearchBounds, Refusal> {
        let plan = std::sync::Arc::clone(oracle.plan());
        let mut reached = SearchBounds {
            lower_bound: least.clone(),
            upper_bound: most.clone(),
            cut: None,
        };
        for (index, cut) in cuts.iter().enumerate() {
            self.lower_to_cut(&mut reached, cut, index);
        }
        let half = Rational::new(1, 2);
        let mut halvings = 0;
        let mut next = reached.upper_bound.clone();
        while reached.lower_bound < reached.upper_bound && halvings < HALVINGS {
            if on_step(oracle, &reached.lower_bound).is_break() {
                break;
            }
            let halve = match oracle.check_with_cuts(&self.at(&plan, &next), 1)? {
                CheckOutcome::Accepted => {
                    reached.lower_bound = next;
                    true
                }
                CheckOutcome::Cuts(found) => {
                    let before = reached.upper_bound.clone();
                    for cut in found {
                        self.lower_to_cut(&mut reached, &cut, cuts.len());
                        cuts.push(cut);
                    }
                    // The bound itself is not reached, or it was known before.
                    let is_stuck = reached.upper_bound == before && next == before;
                    if reached.upper_bound > next {
                        reached.upper_bound = next;
                    }
                    is_stuck
                }
                CheckOutcome::Unknown => {
                    reached.upper_bound = next;
                    reached.cut = None;
                    true
                }
            };
            next = if halve {
                halvings += 1;
                (&reached.lower_bound + &reached.upper_bound) * &half
            } else {
                reached.upper_bound.clone()
            };
        }
        Ok(reached)
    }

    /// Lowers the greatest possible number to the limit of a cut.
    fn lower_to_cut(&self, reached: &mut SearchBounds, cut: &Cut, index: usize) {
        let left = self.cut_limit(cut, &reached.upper_bound);
        let left = left.unwrap_or_default().max(reached.lower_bound.clone());
        if left < reached.upper_bound {
            reached.upper_bound = left;
            reached.cut = Some(index);
        }
    }

    /// Returns the greatest number up to `most` that satisfies a cut.
    fn cut_limit(&self, cut: &Cut, most: &Rational) -> Option<Rational> {
        let left = cut.rows.iter().filter_map(|row| self.row_limit(row, most));
        left.max()
    }

    /// Returns the greatest number up to `most` for which a row holds, ignoring strictness.
    fn row_limit(&self, row: &Row, most: &Rational) -> Option<Rational> {
        let value = |number: &Rational| {
            let sum = row.factors.iter().map(|(end, factor)| {
                let reach = self.reach(end_index(*end), number);
                &reach * factor
            });
            sum.fold(Rational::ZERO, |sum, term| sum + term) - &row.bound
        };
        // The value is linear between the numbers at which ends reach their limits.
        let mut corners = vec![Rational::ZERO, most.clone()];
        for end in row.factors.keys() {
            let place = end_index(end);
            if let Some(limit) = &self.most[place]
                && let Some(number) = (limit - &self.base[place]).checked_div(&self.step[place])
                && number.is_positive()
                && number < *most
            {
                corners.push(number);
            }
        }
        corners.sort_unstable();
        let mut above: Option<(Rational, Rational)> = None;
        for number in corners.into_iter().rev() {
            let here = value(&number);
            if !here.is_positive() {
                let Some((far, there)) = above else {
                    return Some(number);
                };
                // From `here <= 0` at `number` to `there > 0` at `far`.
                let share = (-&here).checked_div(&(&there - &here))?;
                return Some(&number + &(&(&far - &number) * &share));
            }
            above = Some((number, here));
        }
        None
    }
}
