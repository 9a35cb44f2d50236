//! The best box that satisfies what is known so far: a linear program.

use std::collections::BTreeMap;

use elbowroom_num::simplex::{Optimum, Simplex, VariableId};
use elbowroom_num::{Delta, Rational};
use elbowroom_plan::ParametrizedPlan;

use super::{Source, Variables};
use crate::cut::Cut;

/// The best values of the variables in a case, or the proof that there are none.
pub(super) enum Solved {
    /// They are worth so much, and nothing in this case is worth more.
    Best {
        values: Vec<Rational>,
        worth: Rational,
        proof: Vec<(Source, Rational)>,
    },
    Impossible(Vec<(Source, Rational)>),
}

/// `max Σ worth · variable` over the cuts of one row, and, in a case, over a row each of some
/// others.
pub(super) struct Master {
    simplex: Simplex,
    variables: Vec<VariableId>,
    objective: Vec<(VariableId, Rational)>,
    /// The sources of the bounds, by the tags of the linear program.
    sources: Vec<Source>,
    /// The rows of the cuts, as variables with their bounds, where they have any factor.
    rows: BTreeMap<(usize, usize), (Option<VariableId>, Rational)>,
}

impl Master {
    pub(super) fn new(variables: &Variables, worths: &[Rational]) -> Self {
        let mut simplex = Simplex::new();
        let ids: Vec<VariableId> = variables
            .most
            .iter()
            .map(|_| simplex.add_variable())
            .collect();
        let mut sources = Vec::new();
        for (index, (id, most)) in ids.iter().zip(&variables.most).enumerate() {
            simplex.assert_lower(*id, Delta::ZERO, sources.len());
            sources.push(Source::Least(index));
            simplex.assert_upper(*id, Delta::from(most.clone()), sources.len());
            sources.push(Source::Most(index));
        }
        let objective = ids.iter().copied().zip(worths.iter().cloned());
        Self {
            simplex,
            objective: objective.collect(),
            variables: ids,
            sources,
            rows: BTreeMap::new(),
        }
    }

    /// Makes a cut known; if it has one row only, that holds in all cases.
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
                .into_iter()
                .map(|(variable, factor)| (self.variables[variable], factor))
                .collect();
            let sum = (!terms.is_empty()).then(|| self.simplex.define(&terms));
            self.rows.insert((index, place), (sum, bound));
        }
        if cut.rows.len() == 1 {
            // Every box inside the envelope satisfies it, the nominal values among them.
            self.assert(index, 0);
        }
    }

    /// Asserts a row; `false` if it cannot hold.
    fn assert(&mut self, cut: usize, row: usize) -> bool {
        let Some((sum, bound)) = self.rows.get(&(cut, row)) else {
            return true;
        };
        let Some(sum) = sum else {
            return !bound.is_negative();
        };
        let tag = self.sources.len();
        self.sources.push(Source::Row(cut, row));
        self.simplex
            .assert_upper(*sum, Delta::from(bound.clone()), tag);
        true
    }

    /// The best values in the case in which these rows hold, too.
    pub(super) fn solve(&mut self, chosen: &[(usize, usize)]) -> Solved {
        self.simplex.push();
        let tags = self.sources.len();
        let mut solved = None;
        for &(cut, row) in chosen {
            if !self.assert(cut, row) {
                solved = Some(Solved::Impossible(vec![(
                    Source::Row(cut, row),
                    Rational::ONE,
                )]));
                break;
            }
        }
        let solved = solved.unwrap_or_else(|| self.optimum());
        self.simplex.pop();
        self.sources.truncate(tags);
        solved
    }

    fn optimum(&mut self) -> Solved {
        let named = |sources: &[Source], proof: Vec<(usize, Rational)>| {
            let named = proof
                .into_iter()
                .map(|(tag, factor)| (sources[tag], factor));
            named.collect()
        };
        match self.simplex.maximize_with_proof(&self.objective) {
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
