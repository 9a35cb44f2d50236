//! Approximately best values of a concave objective, and exact ones near them.

use std::ops::ControlFlow;

use elbowroom_num::Rational;

use super::Variables;
use super::barrier::{Concave, Polytope};
use super::master::{Master, Solved, Span};

/// One case of a search.
#[derive(Clone, Copy)]
pub(super) struct CaseContext<'a> {
    /// The rows that hold in it.
    pub(super) chosen: &'a [(usize, usize)],
    /// The range of each variable; empty if they may have all values.
    pub(super) spans: &'a [Span],
    /// The values of a box inside the envelope.
    pub(super) known: &'a [Rational],
}

/// Returns approximately the best values in a case, rounded; `None` if they are not found, or if
/// `flow` ends the search.
pub(super) fn approximate_optimum(
    function: &dyn Concave,
    master: &mut Master,
    variables: &Variables,
    case: CaseContext<'_>,
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Vec<Rational>> {
    let scales: Vec<f64> = variables.scales.iter().map(Rational::to_f64).collect();
    let rows = master.rows(case.chosen).map(|row| {
        let factors: Vec<(usize, f64)> = row
            .factors
            .iter()
            .map(|(variable, factor)| (*variable, factor.to_f64() * scales[*variable]))
            .collect();
        let size = factors.iter().map(|own| own.1.abs()).fold(0.0, f64::max);
        let factors = factors.into_iter().map(|(v, factor)| (v, factor / size));
        (factors.collect(), row.bound.to_f64() / size)
    });
    let rows = rows.filter(|(factors, _): &(Vec<_>, _)| !factors.is_empty());
    let in_scale = |values: &[Rational]| -> Vec<f64> {
        let values = values.iter().zip(&scales);
        values
            .map(|(value, scale)| value.to_f64() / scale)
            .collect()
    };
    let (least, most) = spans(variables, case.spans);
    let polytope = Polytope {
        rows: rows.collect(),
        least: in_scale(&least),
        most: in_scale(&most),
    };
    let inner: Vec<f64> = in_scale(case.known)
        .iter()
        .map(|value| value * 0.9)
        .collect();
    let mut starts = vec![inner, vec![0.0; scales.len()]];
    let is_cut = !case.chosen.is_empty() || least.iter().any(Rational::is_positive);
    if is_cut || !case.spans.is_empty() {
        // The chosen alternatives may not hold near any known box.
        let even: Vec<Rational> = vec![Rational::ONE; scales.len()];
        if let Solved::Best { values, .. } = master.solve(case.chosen, case.spans, &even) {
            starts.push(in_scale(&values));
        }
    }
    let found = polytope.maximize(function, &starts, flow)?;
    let rounded = found
        .iter()
        .zip(&variables.scales)
        .zip(least.iter().zip(&most));
    let rounded = rounded.map(|((value, scale), (least, most))| {
        let fine = Rational::new(1, 1_000_000_000_000);
        let value = Rational::from_f64_rounded(*value, &fine)?;
        let near = Rational::new(1, 100_000_000);
        Some(if (&value - &near) * scale < *least {
            least.clone()
        } else if &(&value + &near) * scale >= *most {
            most.clone()
        } else {
            let grid = power_of_ten(&(&fine * scale));
            ((value * scale) / &grid).floor() * &grid
        })
    });
    rounded.collect()
}

/// Returns the least and the greatest value of each variable.
fn spans(variables: &Variables, spans: &[Span]) -> (Vec<Rational>, Vec<Rational>) {
    if spans.is_empty() {
        let least = vec![Rational::ZERO; variables.count()];
        return (least, variables.max_distances.clone());
    }
    let both = spans
        .iter()
        .map(|own| (own.least.clone(), own.most.clone()));
    both.unzip()
}

/// Returns the same values with fewer digits, if they are as good.
pub(super) fn shorten_digits(
    values: Vec<Rational>,
    master: &Master,
    variables: &Variables,
    case: CaseContext<'_>,
    worth: &dyn Fn(&[Rational]) -> Rational,
) -> Vec<Rational> {
    let (least, most) = spans(variables, case.spans);
    let tidy = values
        .iter()
        .zip(&variables.scales)
        .zip(least.iter().zip(&most));
    let tidy: Vec<Rational> = tidy
        .map(|((value, scale), (least, most))| {
            let grid = power_of_ten(&(scale / &Rational::from(100_000)));
            let steps = value / &grid + Rational::new(1, 2);
            (steps.floor() * &grid).min(most.clone()).max(least.clone())
        })
        .collect();
    let loss = Rational::new(1, 100_000_000);
    let holds = master.rows(case.chosen).all(|row| row.holds(&tidy));
    if holds && worth(&tidy) + loss >= worth(&values) {
        tidy
    } else {
        values
    }
}

/// Returns the greatest power of ten that is at most this number; 1 if the number is not positive.
pub(super) fn power_of_ten(number: &Rational) -> Rational {
    let ten = Rational::from(10);
    let mut power = Rational::ONE;
    if !number.is_positive() {
        return power;
    }
    while power > *number {
        power = power / &ten;
    }
    while &power * &ten <= *number {
        power *= &ten;
    }
    power
}
