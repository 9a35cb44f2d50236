//! Interval of one quantity while the others have their planned values.

use std::collections::BTreeMap;

use elbowroom::answers::envelope::Quantity;
use elbowroom::answers::region::{PieceAnswer, RowAnswer};
use elbowroom::num::Rational;
use elbowroom::report::decimal::{Rounding, rounded_inwards};

use crate::plan::SliderInterval;

/// Interval of a quantity while the others have their planned values: each end with `true` if it is
/// excluded.
#[derive(Default)]
pub(super) struct IntervalWithOthersFixed {
    lower: Option<(Rational, bool)>,
    upper: Option<(Rational, bool)>,
}

impl IntervalWithOthersFixed {
    /// Returns the interval in the piece that contains the planned values, unbounded if there is
    /// none.
    pub(super) fn of(parameters: &[Quantity], pieces: &[PieceAnswer], place: usize) -> Self {
        let nominal: BTreeMap<&str, &Rational> = parameters
            .iter()
            .map(|it| (it.name.as_str(), &it.nominal))
            .collect();
        let own = parameters[place].name.as_str();
        let sum = |row: &RowAnswer, but: &str| -> Rational {
            let factors = row.factors.iter().filter(|(name, _)| *name != but);
            let products =
                factors.filter_map(|(name, factor)| Some(*nominal.get(name.as_str())? * &factor.0));
            products.sum()
        };
        let is_satisfied = |row: &RowAnswer| {
            let sum = sum(row, "");
            sum < row.bound || sum == row.bound && !row.strict
        };
        let mut alone = Self::default();
        let planned = pieces.iter().find(|it| it.rows.iter().all(is_satisfied));
        for row in planned.iter().flat_map(|piece| &piece.rows) {
            let Some(factor) = row.factors.get(own) else {
                continue;
            };
            let end = (&row.bound - &sum(row, own)) / &factor.0;
            let (kept, is_nearer): (_, fn(&Rational, &Rational) -> bool) = if factor.0.is_negative()
            {
                (&mut alone.lower, |new, old| new > old)
            } else {
                (&mut alone.upper, |new, old| new < old)
            };
            match kept {
                Some((old, is_open)) if *old == end => *is_open |= row.strict,
                Some((old, _)) if !is_nearer(&end, old) => {}
                _ => *kept = Some((end, row.strict)),
            }
        }
        alone
    }

    fn words(&self, nominal: &Rational) -> String {
        let lower = self.lower.as_ref().map(|(end, is_open)| {
            let end = rounded_inwards(end, nominal, Rounding::Up);
            if *is_open {
                format!("more than {end}")
            } else {
                end
            }
        });
        let upper = self.upper.as_ref().map(|(end, is_open)| {
            let end = rounded_inwards(end, nominal, Rounding::Down);
            if *is_open {
                format!("less than {end}")
            } else {
                end
            }
        });
        let reach = match (lower, upper) {
            (None, None) => "anything".to_owned(),
            (Some(lower), None) => format!("{lower} or more"),
            (None, Some(upper)) => format!("{upper} or less"),
            (Some(lower), Some(upper)) => format!("{lower} to {upper}"),
        };
        format!("with the others as planned: {reach}")
    }
}

/// Converts the interval for a slider.
pub(super) fn reach<'a>(
    (alone, quantity): (&'a IntervalWithOthersFixed, &'a Quantity),
) -> SliderInterval<'a> {
    SliderInterval {
        quantity,
        lower: alone.lower.as_ref().map(|(end, _)| end),
        upper: alone.upper.as_ref().map(|(end, _)| end),
        words: alone.words(&quantity.nominal),
    }
}
