//! The general case: several inequalities at once, or parameters that occur in several places.

use std::collections::BTreeMap;

use elbowroom_num::simplex::{Simplex, VariableId};
use elbowroom_num::{Delta, Rational};
use elbowroom_stn::Constraint;

use super::certificate::{Certificate, Term};
use super::violation_case::add_times;
use crate::linear::Linear;
use crate::obligations::Inequality;
use crate::reduction::Reduction;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParameterId, Side, Valuation};

/// Meaning of a bound of the linear program.
enum Meaning {
    Edge(usize),
    End(BoxEnd),
    /// An assumption or an inequality.
    Given(Term, Delta),
    Zero,
}

struct Program<'a> {
    reduction: &'a Reduction,
    simplex: Simplex,
    classes: Vec<VariableId>,
    parameters: BTreeMap<ParameterId, VariableId>,
    meanings: Vec<Meaning>,
}

/// Returns the proof that no schedule of the box, with the assumed constraints, satisfies all
/// inequalities (which are free of products); `None` if one does.
pub(crate) fn refute(
    reduction: &Reduction,
    envelope: &DecoupledEnvelope,
    assumed: &[Constraint<Delta>],
    inequalities: &[Inequality],
) -> Option<Certificate> {
    let mut program = Program::new(reduction, envelope, assumed, inequalities);
    let infeasible = program.simplex.check().err()?;
    let mut certificate = Certificate::default();
    for (tag, factor) in infeasible.certificate {
        let term = match program.meanings[tag] {
            Meaning::Edge(index) => Some(Term::Edge(index)),
            Meaning::Given(term, _) => Some(term),
            // The ends in the sum follow from the rest.
            Meaning::End(_) | Meaning::Zero => None,
        };
        certificate
            .terms
            .extend(term.map(|term| (term, factor.clone())));
        match &program.meanings[tag] {
            Meaning::Edge(index) => {
                certificate.add_constant(
                    &Delta::from(reduction.edges()[*index].constant.clone()),
                    &factor,
                );
            }
            Meaning::End(end) => certificate.add_end(*end, &factor),
            Meaning::Given(_, constant) => certificate.add_constant(constant, &factor),
            Meaning::Zero => {}
        }
    }
    Some(certificate.complete())
}

/// Returns times of all classes and values of the parameters that satisfy everything, if there are
/// any. They minimise `least`, if it has a minimum.
pub(crate) fn witness(
    reduction: &Reduction,
    envelope: &DecoupledEnvelope,
    assumed: &[Constraint<Delta>],
    inequalities: &[Inequality],
    least: Option<&Linear>,
) -> Option<(Vec<Rational>, Valuation)> {
    let mut program = Program::new(reduction, envelope, assumed, inequalities);
    program.simplex.check().ok()?;
    if let Some(least) = least {
        let (row, _) = program.row(least);
        // Without a minimum, any values are accepted.
        program.simplex.minimize(&row).ok()?;
    }
    let model = program.simplex.model();
    let times: Vec<Rational> = program
        .classes
        .iter()
        .map(|variable| model[variable.index()].clone())
        .collect();
    let count = envelope.intervals().len();
    let values = (0..count).map(ParameterId::from).map(|id| {
        program
            .parameters
            .get(&id)
            .map(|variable| model[variable.index()].clone())
            .unwrap_or_default()
    });
    Some((times, values.collect()))
}

impl<'a> Program<'a> {
    fn new(
        reduction: &'a Reduction,
        envelope: &DecoupledEnvelope,
        assumed: &[Constraint<Delta>],
        inequalities: &[Inequality],
    ) -> Self {
        let mut simplex = Simplex::new();
        // One additional class for the moment of an over-all condition, whether or not it occurs.
        let classes = (0..=reduction.class_count())
            .map(|_| simplex.add_variable())
            .collect();
        let mut program = Self {
            reduction,
            simplex,
            classes,
            parameters: BTreeMap::new(),
            meanings: Vec::new(),
        };
        program.fix_zero();
        for index in 0..envelope.intervals().len() {
            program.add_parameter(ParameterId::from(index), envelope);
        }
        for index in 0..reduction.edges().len() {
            program.add_edge(index);
        }
        for (index, constraint) in assumed.iter().enumerate() {
            let row = [
                (program.classes[constraint.to.index()], Rational::ONE),
                (program.classes[constraint.from.index()], Rational::from(-1)),
            ];
            program.at_most(
                &row,
                constraint.bound.clone(),
                Meaning::Given(Term::Assumed(index), constraint.bound.clone()),
            );
        }
        for (index, inequality) in inequalities.iter().enumerate() {
            program.add_inequality(index, inequality);
        }
        program
    }

    fn fix_zero(&mut self) {
        let zero = self.classes[0];
        let tag = self.tag(Meaning::Zero);
        self.simplex.assert_upper(zero, Delta::ZERO, tag);
        self.simplex.assert_lower(zero, Delta::ZERO, tag);
    }

    fn add_parameter(&mut self, parameter: ParameterId, envelope: &DecoupledEnvelope) {
        let variable = self.simplex.add_variable();
        self.parameters.insert(parameter, variable);
        let interval = envelope.interval(parameter);
        if let Some(upper) = interval.upper.value() {
            let tag = self.tag(Meaning::End(BoxEnd {
                parameter,
                side: Side::Upper,
            }));
            self.simplex
                .assert_upper(variable, Delta::from(upper.clone()), tag);
        }
        if let Some(lower) = interval.lower.value() {
            let tag = self.tag(Meaning::End(BoxEnd {
                parameter,
                side: Side::Lower,
            }));
            self.simplex
                .assert_lower(variable, Delta::from(lower.clone()), tag);
        }
    }

    /// Adds `t_to - t_from -/+ parameter <= constant`.
    fn add_edge(&mut self, index: usize) {
        let edge = &self.reduction.edges()[index];
        let mut row: BTreeMap<VariableId, Rational> = BTreeMap::new();
        *row.entry(self.classes[edge.to.index()]).or_default() += Rational::ONE;
        *row.entry(self.classes[edge.from.index()]).or_default() -= Rational::ONE;
        if let Some(end) = edge.end {
            let sign = match end.side {
                Side::Upper => Rational::from(-1),
                Side::Lower => Rational::ONE,
            };
            *row.entry(self.parameters[&end.parameter]).or_default() += sign;
        }
        let row: Vec<_> = row
            .into_iter()
            .filter(|(_, factor)| !factor.is_zero())
            .collect();
        let bound = Delta::from(edge.constant.clone());
        self.at_most(&row, bound, Meaning::Edge(index));
    }

    /// Returns the expression as a combination of variables, and its constant.
    fn row(&self, expression: &Linear) -> (Vec<(VariableId, Rational)>, Rational) {
        let mut row: BTreeMap<VariableId, Rational> = BTreeMap::new();
        let constant = add_times(self.reduction, expression, |class, coefficient| {
            *row.entry(self.classes[class.index()]).or_default() += coefficient;
        });
        for (id, coefficient) in &expression.parameters {
            *row.entry(self.parameters[id]).or_default() += coefficient;
        }
        row.retain(|_, factor| !factor.is_zero());
        (row.into_iter().collect(), constant)
    }

    fn add_inequality(&mut self, index: usize, inequality: &Inequality) {
        let (row, constant) = self.row(&inequality.expression);
        let bound = if inequality.is_strict {
            Delta::just_below(-constant)
        } else {
            Delta::from(-constant)
        };
        let meaning = Meaning::Given(Term::Inequality(index), bound.clone());
        self.at_most(&row, bound, meaning);
    }

    fn at_most(&mut self, row: &[(VariableId, Rational)], bound: Delta, meaning: Meaning) {
        let tag = self.tag(meaning);
        let sum = self.simplex.define(row);
        self.simplex.assert_upper(sum, bound, tag);
    }

    fn tag(&mut self, meaning: Meaning) -> usize {
        self.meanings.push(meaning);
        self.meanings.len() - 1
    }
}
