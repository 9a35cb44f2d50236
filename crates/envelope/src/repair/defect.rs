//! Flaws of a schedule, and the alternatives that avoid them.

use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_model::ground::{Condition, FactId};
use elbowroom_num::Rational;
use elbowroom_plan::{NodeId, ParametrizedPlan, Schedule, Valuation};

use super::BindingConstraint;
use super::moment;
use super::orders::{Orders, read_by};
use crate::linear::Linear;
use crate::obligations::{
    BadCase, Difference, Obligation, Obligations, OverAll, Refusal, Requirement, Substitution,
};

/// `expression <= 0`, or `< 0` when strict, and the constraint that requires it.
pub(super) type Alternative = (Linear, bool, BindingConstraint);

/// Flaw of a schedule.
pub(super) enum Defect {
    /// All obligations are met.
    None,
    /// This requirement cannot be met while happenings keep their order.
    Unrepairable(Requirement),
    /// One of these holds in every valid schedule of the case.
    Cases {
        alternatives: Vec<Alternative>,
        /// The pair whose order the case decides, if any.
        decides: Option<(NodeId, NodeId)>,
    },
}

/// Finds flaws of one plan's schedules.
pub(super) struct DefectFinder<'a> {
    pub(super) task: &'a Task,
    pub(super) plan: &'a ParametrizedPlan,
    pub(super) orders: &'a Orders,
    pub(super) substitution: &'a Substitution,
}

impl DefectFinder<'_> {
    /// Returns a flaw of the schedule, in a case that decides the order of some happenings.
    ///
    /// # Errors
    /// If something is beyond linear reasoning in the order of this schedule.
    pub(super) fn find(
        &self,
        values: &Valuation,
        schedule: &Schedule,
        decided: &BTreeSet<(NodeId, NodeId)>,
    ) -> Result<Defect, Refusal> {
        let compiled =
            Obligations::compile(self.task, self.plan, (schedule, values), self.substitution)?;
        // Separations come first: while they are violated, the other obligations assume an order
        // that may not exist.
        for obligation in &compiled.direct {
            if let Some(case) = broken(obligation, values, schedule) {
                return Ok(self.defect_of(obligation, case, decided));
            }
        }
        for over_all in &compiled.over_all {
            if let Some(flaw) = self.broken_throughout(over_all, values, schedule, decided)? {
                return Ok(flaw);
            }
        }
        Ok(Defect::None)
    }

    fn defect_of(
        &self,
        obligation: &Obligation,
        case: &BadCase,
        decided: &BTreeSet<(NodeId, NodeId)>,
    ) -> Defect {
        let requirement = &obligation.requirement;
        if let Some(flaw) = self.order_of(requirement, decided) {
            return flaw;
        }
        let hindrance = || BindingConstraint::Requirement(requirement.clone());
        let differences = case.differences.iter().map(|difference| {
            let Difference {
                from,
                to,
                bound,
                is_strict,
            } = difference;
            // `to - from` is not below the bound.
            let mut expression = Linear::difference(*to, *from);
            expression.constant = bound.clone();
            (expression, !is_strict, hindrance())
        });
        let inequalities = case.inequalities.iter().map(|inequality| {
            let negated = inequality.expression.scaled(&Rational::from(-1));
            (negated, !inequality.is_strict, hindrance())
        });
        let alternatives: Vec<Alternative> = differences.chain(inequalities).collect();
        if alternatives.is_empty() {
            return Defect::Unrepairable(requirement.clone());
        }
        Defect::Cases {
            alternatives,
            decides: None,
        }
    }

    /// Returns the next undecided order of happenings that a requirement depends on.
    fn order_of(
        &self,
        requirement: &Requirement,
        decided: &BTreeSet<(NodeId, NodeId)>,
    ) -> Option<Defect> {
        let epsilon = self.task.epsilon();
        let pair = if let Requirement::Separation { first, second } = requirement {
            self.orders.pair(*first, *second, decided)?
        } else {
            let (facts, numbers, anchors) = self.reads(requirement);
            self.orders.undecided(&facts, numbers, &anchors, decided)?
        };
        let alternative = |first: NodeId, second: NodeId| {
            let mut expression = Linear::difference(second, first);
            expression.constant = epsilon.clone();
            (expression, false, BindingConstraint::Order(first, second))
        };
        Some(Defect::Cases {
            alternatives: vec![alternative(pair.0, pair.1), alternative(pair.1, pair.0)],
            decides: Some(pair),
        })
    }

    /// Returns the facts that a requirement depends on, `true` if it depends on numbers, and the
    /// happenings at which it reads them.
    fn reads(&self, requirement: &Requirement) -> (BTreeSet<FactId>, bool, Vec<NodeId>) {
        let of = |condition: &Condition, anchors: Vec<NodeId>| {
            let (facts, numbers) = read_by(self.task, condition);
            (facts, numbers, anchors)
        };
        let plan = &self.plan.plan;
        match requirement {
            Requirement::Condition { node, condition } => of(condition, vec![*node]),
            Requirement::OverAll {
                instance,
                condition,
            } => of(condition, vec![plan.start(*instance), plan.end(*instance)]),
            Requirement::Goal { condition } => of(condition, Vec::new()),
            Requirement::Duration { instance, .. } => {
                let anchors = vec![plan.start(*instance), plan.end(*instance)];
                (BTreeSet::new(), true, anchors)
            }
            Requirement::Defined { node } | Requirement::SingleUpdate { node, .. } => {
                (BTreeSet::new(), true, vec![*node])
            }
            Requirement::Autonomous { after, .. } => (BTreeSet::new(), true, vec![*after]),
            Requirement::Separation { first, second } => {
                (BTreeSet::new(), false, vec![*first, *second])
            }
        }
    }

    fn broken_throughout(
        &self,
        over_all: &OverAll,
        values: &Valuation,
        schedule: &Schedule,
        decided: &BTreeSet<(NodeId, NodeId)>,
    ) -> Result<Option<Defect>, Refusal> {
        let Some(found) =
            moment::avoiding_alternatives(self.task, &self.plan.plan, over_all, values, schedule)?
        else {
            return Ok(None);
        };
        let requirement = Requirement::OverAll {
            instance: over_all.instance,
            condition: over_all.condition.clone(),
        };
        if let Some(flaw) = self.order_of(&requirement, decided) {
            return Ok(Some(flaw));
        }
        let hindrance = || BindingConstraint::Requirement(requirement.clone());
        let alternatives = found.into_iter();
        Ok(Some(Defect::Cases {
            alternatives: alternatives
                .map(|(expression, is_strict)| (expression, is_strict, hindrance()))
                .collect(),
            decides: None,
        }))
    }
}

/// Returns the bad case that holds in the schedule, if any.
fn broken<'a>(
    obligation: &'a Obligation,
    values: &Valuation,
    schedule: &Schedule,
) -> Option<&'a BadCase> {
    obligation.bad_cases.iter().find(|case| {
        let differences = case.differences.iter().all(|own| {
            let difference = &schedule[own.to] - &schedule[own.from];
            difference < own.bound || (difference == own.bound && !own.is_strict)
        });
        let mut inequalities = case.inequalities.iter();
        differences && inequalities.all(|own| own.holds(schedule, values))
    })
}
