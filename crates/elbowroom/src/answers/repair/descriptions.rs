//! Descriptions of repairs in words.

use elbowroom_envelope::explain::Explainer;
use elbowroom_envelope::obligations::Requirement;
use elbowroom_envelope::{BindingConstraint, Repair};
use elbowroom_model::ground::{Change as Effect, Condition};
use elbowroom_num::Rational;
use elbowroom_plan::{Bound, Constraint, Node, NodeId, ParameterId, Side, Valuation};

use super::Change;
use super::subject::Subject;

/// Number of digits of numbers in descriptions.
const DIGITS: u32 = 6;

impl Subject {
    fn explainer(&self) -> Explainer<'_> {
        Explainer::new(&self.task, &self.plan)
    }

    /// Returns the quantities that cost something at these values.
    pub(super) fn changes(&self, values: &Valuation) -> Vec<Change> {
        let changes = self.changeable.iter().filter_map(|own| {
            let to = &values[own.parameter];
            let below = own.free_range.lower.value().filter(|least| to < *least);
            let above = own.free_range.upper.value().filter(|most| to > *most);
            let from = below.or(above)?;
            Some(Change {
                quantity: self.quantity(own.parameter),
                from: from.clone(),
                to: to.clone(),
                weight: own.weight.clone(),
            })
        });
        changes.collect()
    }

    fn quantity(&self, id: ParameterId) -> String {
        let bound = self.bounds.iter().find(|(own, _)| *own == id);
        bound.map_or_else(|| self.explainer().quantity(id), |(_, words)| words.clone())
    }

    /// Describes the bounds and conditions that determine the cost of the repair.
    pub(super) fn cost_reasons(&self, repair: &Repair) -> Vec<String> {
        let hindrances = repair.explanation.iter().map(|(hindrance, _)| hindrance);
        let mut words: Vec<String> = Vec::new();
        for hindrance in hindrances.filter(|own| !matches!(own, BindingConstraint::Range(_))) {
            if let Some(own) = self.hindrance(hindrance)
                && !words.contains(&own)
            {
                words.push(own);
            }
        }
        words
    }

    /// Describes the bounds and conditions that prevent any repair.
    pub(super) fn hindrances(&self, hindrances: &[BindingConstraint]) -> Vec<String> {
        let mut words: Vec<String> = Vec::new();
        for hindrance in hindrances {
            let own = match hindrance {
                BindingConstraint::Requirement(requirement) => {
                    Some(self.describe_missing(requirement))
                }
                other => self.hindrance(other),
            };
            if let Some(own) = own.filter(|own| !words.contains(own)) {
                words.push(own);
            }
        }
        words
    }

    /// Describes a requirement that cannot be met; for a fact, also whether any action makes it
    /// true.
    fn describe_missing(&self, requirement: &Requirement) -> String {
        let words = self.explainer().requirement(requirement);
        let (Requirement::Condition { condition, .. }
        | Requirement::OverAll { condition, .. }
        | Requirement::Goal { condition }) = requirement
        else {
            return words;
        };
        let Condition::Fact(fact) = condition else {
            return words;
        };
        let nodes = self.plan.plan.nodes();
        let mut added = nodes.map(|(node, _)| self.plan.plan.footprint(&self.task, node).adds);
        let is_made = added.any(|adds| adds.contains(fact));
        let is_so = self.task.initial().facts.contains(fact);
        if is_made || is_so || self.task.is_derived(*fact) {
            format!("{words}, which is false at that point in the order of the plan")
        } else {
            format!("{words}, which nothing in the plan makes true")
        }
    }

    fn hindrance(&self, hindrance: &BindingConstraint) -> Option<String> {
        let explainer = self.explainer();
        match hindrance {
            BindingConstraint::TimeZero => None,
            BindingConstraint::Range(id) => Some(format!("range of the {}", self.quantity(*id))),
            BindingConstraint::Requirement(requirement) => Some(explainer.requirement(requirement)),
            BindingConstraint::Order(first, second) => {
                let requirement = Requirement::Separation {
                    first: *first,
                    second: *second,
                };
                Some(explainer.requirement(&requirement))
            }
            BindingConstraint::Bound(index, side) => {
                let constraint = &self.plan.plan.constraints[*index];
                match self.plan.plan.nodes[constraint.to.index()] {
                    Node::Timed(timed) => {
                        let time = self.task.timed()[timed].time.to_decimal(DIGITS);
                        Some(match self.task.timed()[timed].changes.as_slice() {
                            [Effect::Delete(fact)] => {
                                format!("deadline of {} at {time}", self.task.fact_name(*fact))
                            }
                            _ => format!("timed initials at {time}"),
                        })
                    }
                    _ => explainer.describe_bound(constraint, *side),
                }
            }
        }
    }

    /// Describes an additional bound of an STN plan.
    pub(super) fn bound(&self, constraint: &Constraint) -> Option<String> {
        let values = self.plan.nominal();
        let side = |bound: &Bound, side: Side| {
            let value: Rational = bound.at(&values)?;
            let words = self.describe_bound_between(constraint.from, constraint.to, side);
            Some(format!("{words}: {}", value.to_decimal(DIGITS)))
        };
        let sides = [
            side(&constraint.lower, Side::Lower),
            side(&constraint.upper, Side::Upper),
        ];
        let sides: Vec<String> = sides.into_iter().flatten().collect();
        (!sides.is_empty()).then(|| sides.join(", "))
    }

    /// Describes a bound of a constraint.
    pub(super) fn describe_bound_between(&self, from: NodeId, to: NodeId, side: Side) -> String {
        let words = |node: NodeId| self.plan.plan.describe_node(&self.task, node);
        let extreme = match side {
            Side::Lower => "least",
            Side::Upper => "most",
        };
        if from == NodeId::ZERO {
            let extreme = match side {
                Side::Lower => "earliest",
                Side::Upper => "latest",
            };
            return format!("{extreme} {}", words(to));
        }
        format!("{extreme} time from {} to {}", words(from), words(to))
    }
}
