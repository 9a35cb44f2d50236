//! Case distinctions, and the bound that follows in each case.

use elbowroom_num::Rational;

use super::Checker;
use crate::certificate::{Case, Multiplier, Reasons, Source, Total};
use crate::flaw::Flaw;
use crate::probability::Span;

/// Unprocessed case: its position, the inequalities that hold in it (proof and position), and the
/// spans of the variables.
type PendingCase = (usize, Vec<(usize, usize)>, Vec<Span>);

/// Computes the bound on the objective from a sum, the factors of variables in it, and their spans.
type BoundFunction<'a> = dyn Fn(&Total, &[Rational], &[Span]) -> Option<Rational> + 'a;

impl Checker<'_> {
    /// Returns the spans of the variables before any split.
    fn spans(&self) -> Vec<Span> {
        let is_probability = matches!(self.certificate.reasons, Reasons::Probability(_));
        let spans = self.scales.iter().map(|scale| Span {
            least: Rational::ZERO,
            far: is_probability.then(|| scale * &self.certificate.counted),
            is_open: false,
        });
        let mut spans: Vec<Span> = spans.collect();
        if is_probability {
            self.chances.restrict_spans(&mut spans);
        }
        spans
    }

    /// Returns the spans of the variables in the two parts of a split.
    fn split_spans(
        &self,
        variable: usize,
        at: &Rational,
        spans: &[Span],
    ) -> Result<[Vec<Span>; 2], Flaw> {
        let own = spans
            .get(variable)
            .ok_or(Flaw::UnknownReference("variable", variable))?;
        let is_there = self.chances.has_jump_at(variable, at);
        let is_inside = own.least < *at && own.far.as_ref().is_some_and(|far| at <= far);
        if !is_there || !is_inside {
            return Err(Flaw::Jump(variable));
        }
        let (mut nearer, mut farther) = (spans.to_vec(), spans.to_vec());
        nearer[variable].far = Some(at.clone());
        nearer[variable].is_open = true;
        farther[variable].least = at.clone();
        Ok([nearer, farther])
    }

    /// Returns, for each case, the spans of the variables; `None` if the case is not reached.
    pub(super) fn spans_of(&self, cases: &[Case]) -> Result<Vec<Option<Vec<Span>>>, Flaw> {
        let mut all: Vec<Option<Vec<Span>>> = vec![None; cases.len()];
        let mut open = vec![(0, self.spans())];
        while let Some((index, spans)) = open.pop() {
            let case = cases
                .get(index)
                .ok_or(Flaw::UnknownReference("case", index))?;
            if all[index].is_some() {
                return Err(Flaw::Tree(index));
            }
            match case {
                Case::Either { cases, .. } => {
                    open.extend(cases.iter().map(|case| (*case, spans.clone())));
                }
                Case::Split {
                    variable,
                    at,
                    cases,
                } => {
                    let parts = self.split_spans(*variable, at, &spans)?;
                    open.extend(cases.iter().copied().zip(parts));
                }
                Case::Sum(_) | Case::Impossible(_) => {}
            }
            all[index] = Some(spans);
        }
        Ok(all)
    }

    /// Checks that the cases are exhaustive, and returns the greatest of their bounds. The bound of
    /// a case follows from the sum of its inequalities.
    pub(super) fn cases(
        &self,
        cases: &[Case],
        follows: &BoundFunction<'_>,
    ) -> Result<Rational, Flaw> {
        let mut bound: Option<Rational> = None;
        let mut is_seen = vec![false; cases.len()];
        let mut open: Vec<PendingCase> = vec![(0, Vec::new(), self.spans())];
        while let Some((index, chosen, spans)) = open.pop() {
            let case = cases
                .get(index)
                .ok_or(Flaw::UnknownReference("case", index))?;
            if std::mem::replace(&mut is_seen[index], true) {
                return Err(Flaw::Tree(index));
            }
            match case {
                Case::Either { proof, cases } => {
                    let rows = self
                        .rows
                        .get(*proof)
                        .ok_or(Flaw::UnknownReference("proof", *proof))?;
                    if rows.len() != cases.len() {
                        return Err(Flaw::Count {
                            what: "cases",
                            found: cases.len(),
                            wanted: rows.len(),
                        });
                    }
                    for (row, case) in cases.iter().enumerate() {
                        let mut chosen = chosen.clone();
                        chosen.push((*proof, row));
                        open.push((*case, chosen, spans.clone()));
                    }
                }
                Case::Split {
                    variable,
                    at,
                    cases,
                } => {
                    let parts = self.split_spans(*variable, at, &spans)?;
                    for (case, spans) in cases.iter().zip(parts) {
                        open.push((*case, chosen.clone(), spans));
                    }
                }
                Case::Sum(total) => {
                    let (factors, sum) = self.sum(index, &total.of, (&chosen, &spans))?;
                    if sum != total.bound {
                        return Err(Flaw::Sum(index));
                    }
                    let own = follows(total, &factors, &spans).ok_or(Flaw::Sum(index))?;
                    bound = Some(bound.map_or(own.clone(), |bound| bound.max(own)));
                }
                Case::Impossible(total) => {
                    let (factors, sum) = self.sum(index, &total.of, (&chosen, &spans))?;
                    let is_free = factors.iter().all(Rational::is_zero);
                    if !is_free
                        || !sum.is_negative()
                        || sum != total.bound
                        || !total.slopes.is_empty()
                        || !total.touches.is_empty()
                        || total.most.is_some()
                    {
                        return Err(Flaw::Sum(index));
                    }
                }
            }
        }
        if let Some(index) = is_seen.iter().position(|is_seen| !is_seen) {
            return Err(Flaw::Tree(index));
        }
        // If all cases were impossible, there would be no box, not even the nominal values.
        bound.ok_or(Flaw::Sum(0))
    }

    /// Returns the sum of inequalities, each times its multiplier.
    pub(super) fn sum(
        &self,
        case: usize,
        multipliers: &[Multiplier],
        (chosen, spans): (&[(usize, usize)], &[Span]),
    ) -> Result<(Vec<Rational>, Rational), Flaw> {
        let mut factors = vec![Rational::ZERO; self.slacks.len()];
        let mut bound = Rational::ZERO;
        for Multiplier { source, factor } in multipliers {
            if factor.is_negative() {
                return Err(Flaw::Negative(case));
            }
            match *source {
                Source::Row(proof, row) => {
                    let rows = self
                        .rows
                        .get(proof)
                        .ok_or(Flaw::UnknownReference("proof", proof))?;
                    if rows.len() != 1 && !chosen.contains(&(proof, row)) {
                        return Err(Flaw::InequalityNotInCase(case));
                    }
                    let row = rows
                        .get(row)
                        .ok_or(Flaw::UnknownReference("inequality", row))?;
                    for (sum, own) in factors.iter_mut().zip(&row.factors) {
                        *sum += own * factor;
                    }
                    bound += &row.bound * factor;
                }
                Source::Most(variable) => {
                    let own = self.most.get(variable).and_then(Option::as_ref);
                    let far = spans.get(variable).and_then(|span| span.far.as_ref());
                    let most = match (own, far) {
                        (Some(own), Some(far)) => Some(own.min(far)),
                        (own, far) => own.or(far),
                    };
                    let most = most.ok_or(Flaw::UnknownReference("variable", variable))?;
                    factors[variable] += factor;
                    bound += most * factor;
                }
                Source::Least(variable) => {
                    let sum = factors.get_mut(variable);
                    *sum.ok_or(Flaw::UnknownReference("variable", variable))? -= factor;
                    bound -= &spans[variable].least * factor;
                }
            }
        }
        Ok((factors, bound))
    }
}
