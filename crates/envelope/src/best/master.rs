//! Master problem: a linear program for the best box that satisfies all known cuts.

use std::collections::BTreeMap;

use elbowroom_num::simplex::{Optimum, Simplex, VariableId};
use elbowroom_num::{Delta, Rational};
use elbowroom_plan::{ParametrizedPlan, Side};

use super::concave_maximum::CaseContext;
use super::{BoundSource, Variables};
use crate::cut::Cut;

/// Range of a variable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) least: Rational,
    pub(super) most: Rational,
    /// Value above which the objective no longer changes. The range of the parameter, which also
    /// limits `most`, has no influence on it.
    pub(super) objective_max: Rational,
    /// `true` if the variable is strictly less than `far`; linear programs allow it to be `most`.
    pub(super) is_open: bool,
}

/// The best values of the variables in a case, or the proof that there are none.
pub(super) enum Solved {
    /// The best values, with a proof that no other values in this case are better.
    Best {
        values: Vec<Rational>,
        worth: Rational,
        proof: Vec<(BoundSource, Rational)>,
    },
    Impossible(Vec<(BoundSource, Rational)>),
}

/// `Σ factor · variable <= bound`.
pub(super) struct CutRow {
    pub(super) factors: Vec<(usize, Rational)>,
    pub(super) bound: Rational,
    is_strict: bool,
    /// The sum as a variable of the linear program; `None` if it has no terms.
    sum: Option<VariableId>,
}

impl CutRow {
    /// Returns `true` if the row holds, strictly if it is strict.
    pub(super) fn holds(&self, values: &[Rational]) -> bool {
        let terms = self
            .factors
            .iter()
            .map(|(index, factor)| factor * &values[*index]);
        let sum: Rational = terms.sum();
        sum < self.bound || (sum == self.bound && !self.is_strict)
    }
}

/// `max Σ worth · variable` over all cuts with one row and, in a case, over one row each of some
/// others.
pub(super) struct Master {
    simplex: Simplex,
    variables: Vec<VariableId>,
    /// The sources of the bounds, by the tags of the linear program.
    sources: Vec<BoundSource>,
    rows: BTreeMap<(usize, usize), CutRow>,
    /// The rows that hold in all cases.
    global_rows: Vec<(usize, usize)>,
}

impl Master {
    pub(super) fn new(variables: &Variables) -> Self {
        let mut simplex = Simplex::new();
        let ids: Vec<VariableId> = variables
            .max_distances
            .iter()
            .map(|_| simplex.add_variable())
            .collect();
        let mut sources = Vec::new();
        for (index, (id, most)) in ids.iter().zip(&variables.max_distances).enumerate() {
            simplex.assert_lower(*id, Delta::ZERO, sources.len());
            sources.push(BoundSource::Least(index));
            simplex.assert_upper(*id, Delta::from(most.clone()), sources.len());
            sources.push(BoundSource::Most(index));
        }
        Self {
            simplex,
            variables: ids,
            sources,
            rows: BTreeMap::new(),
            global_rows: Vec::new(),
        }
    }

    /// Adds a cut. If it has only one row, the row holds in all cases.
    pub(super) fn add(
        &mut self,
        plan: &ParametrizedPlan,
        variables: &Variables,
        cut: &Cut,
        index: usize,
    ) {
        for (place, row) in cut.rows.iter().enumerate() {
            let (factors, bound) = variables.row(plan, row);
            let terms: Vec<(VariableId, Rational)> = factors
                .iter()
                .map(|(variable, factor)| (self.variables[*variable], factor.clone()))
                .collect();
            let sum = (!terms.is_empty()).then(|| self.simplex.define(&terms));
            let known = CutRow {
                factors,
                bound,
                is_strict: row.is_strict,
                sum,
            };
            self.rows.insert((index, place), known);
        }
        if cut.rows.len() == 1 {
            // Every box inside the envelope satisfies the row, including the nominal values.
            self.assert(index, 0);
            self.global_rows.push((index, 0));
        }
    }

    /// Returns the rows that hold in a case.
    pub(super) fn rows<'a>(
        &'a self,
        chosen: &'a [(usize, usize)],
    ) -> impl Iterator<Item = &'a CutRow> {
        let all = self.global_rows.iter().chain(chosen);
        all.filter_map(|place| self.rows.get(place))
    }

    /// Asserts the ranges of the variables.
    fn assert_spans(&mut self, spans: &[Span]) {
        for (index, (id, span)) in self.variables.iter().zip(spans).enumerate() {
            let tag = self.sources.len();
            self.simplex
                .assert_lower(*id, Delta::from(span.least.clone()), tag);
            self.simplex
                .assert_upper(*id, Delta::from(span.most.clone()), tag + 1);
            self.sources
                .extend([BoundSource::Least(index), BoundSource::Most(index)]);
        }
    }

    /// Asserts a row. Returns `false` if it cannot hold.
    fn assert(&mut self, cut: usize, row: usize) -> bool {
        let Some(known) = self.rows.get(&(cut, row)) else {
            return true;
        };
        let Some(sum) = known.sum else {
            return !known.bound.is_negative();
        };
        let tag = self.sources.len();
        self.sources.push(BoundSource::Row(cut, row));
        self.simplex
            .assert_upper(sum, Delta::from(known.bound.clone()), tag);
        true
    }

    /// Computes the best values in the case where these rows hold as well, and the variables lie
    /// within these spans.
    pub(super) fn solve(
        &mut self,
        chosen: &[(usize, usize)],
        spans: &[Span],
        worths: &[Rational],
    ) -> Solved {
        self.simplex.push();
        let tags = self.sources.len();
        self.assert_spans(spans);
        let mut solved = None;
        for &(cut, row) in chosen {
            if !self.assert(cut, row) {
                solved = Some(Solved::Impossible(vec![(
                    BoundSource::Row(cut, row),
                    Rational::ONE,
                )]));
                break;
            }
        }
        let solved = solved.unwrap_or_else(|| self.optimum(worths));
        self.simplex.pop();
        self.sources.truncate(tags);
        solved
    }

    /// Returns the best values in that case that are at most, or at least, these. Strict rows are
    /// satisfied with a small margin. `None` if there are none.
    pub(super) fn best_within(
        &mut self,
        case: CaseContext<'_>,
        (side, limits): (Side, &[Rational]),
        worths: &[Rational],
    ) -> Option<Vec<Rational>> {
        // Margin as a share of the bound.
        let spared = Rational::new(1, 1_000_000_000);
        let chosen = case.chosen;
        self.simplex.push();
        let tags = self.sources.len();
        self.assert_spans(case.spans);
        let mut is_possible = true;
        for &(cut, row) in chosen {
            is_possible &= self.assert(cut, row);
        }
        for (id, limit) in self.variables.iter().zip(limits) {
            let (limit, tag) = (Delta::from(limit.clone()), self.sources.len());
            match side {
                Side::Upper => self.simplex.assert_upper(*id, limit, tag),
                Side::Lower => self.simplex.assert_lower(*id, limit, tag),
            }
        }
        let strict: Vec<(VariableId, Rational)> = self
            .rows(chosen)
            .filter(|row| row.is_strict && row.bound.is_positive())
            .filter_map(|row| Some((row.sum?, &row.bound - &(&row.bound * &spared))))
            .collect();
        for (sum, bound) in strict {
            self.simplex
                .assert_upper(sum, Delta::from(bound), self.sources.len());
        }
        // No proof is needed here, so all these bounds may share one source.
        self.sources.push(BoundSource::Most(0));
        let found = is_possible.then(|| self.optimum(worths));
        self.simplex.pop();
        self.sources.truncate(tags);
        match found {
            Some(Solved::Best { values, .. }) => Some(values),
            _ => None,
        }
    }

    fn optimum(&mut self, worths: &[Rational]) -> Solved {
        let named = |sources: &[BoundSource], proof: Vec<(usize, Rational)>| {
            let named = proof
                .into_iter()
                .map(|(tag, factor)| (sources[tag], factor));
            named.collect()
        };
        let objective = self.variables.iter().copied().zip(worths.iter().cloned());
        let objective: Vec<(VariableId, Rational)> =
            objective.filter(|(_, worth)| !worth.is_zero()).collect();
        match self.simplex.maximize_with_proof(&objective) {
            Err(impossible) => Solved::Impossible(named(&self.sources, impossible.certificate)),
            Ok((optimum, proof)) => {
                let values = self.variables.iter();
                let values = values.map(|id| self.simplex.value(*id).real.clone());
                Solved::Best {
                    values: values.collect(),
                    worth: match optimum {
                        Optimum::Value(value) => value.real,
                        Optimum::Unbounded => unreachable!("every variable has a greatest value"),
                    },
                    proof: named(&self.sources, proof),
                }
            }
        }
    }
}
