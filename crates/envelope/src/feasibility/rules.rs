//! Schedules for all values in a box, as rules that compute times from values.
//!
//! Let a parameter be the difference of two times, and let constraints only be violated if it is
//! too small. It can grow: its later time, and all times that bound the latest value of this time,
//! move by the same amount. That violates nothing, because times that do not move are only exceeded
//! by less. In the other direction, the later time and the times that have to follow it soon can
//! move back. So a schedule at the worst ends of these parameters yields one for all of their
//! values. For the other parameters, both ends are examined: schedules for the values between them
//! are interpolated.

use std::collections::BTreeMap;

use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, NodeId, ParameterId, Side};
use elbowroom_stn::{ConsistentNetwork, Constraint, Network, NodeId as ClassId};

use super::Feasibility;
use crate::cycles::Role;
use crate::proof::{ScheduleCase, TimeRule};
use crate::reduction::{Edge, Reduction};

/// Limit on parameters with both ends examined.
const MAX_SPLITS: usize = 6;

impl Feasibility {
    /// Returns rules for all values in a box with a schedule for each value; `None` if there are
    /// too many cases, or if an end is infinite and both ends of its parameter matter.
    pub(crate) fn rules(
        &self,
        reduction: &Reduction,
        envelope: &DecoupledEnvelope,
    ) -> Option<Vec<ScheduleCase>> {
        let all = (0..self.roles.len()).map(ParameterId::from);
        let role = |id: &ParameterId| self.roles[id.index()];
        let splits: Vec<ParameterId> = all.filter(|id| role(id) == Role::Both).collect();
        if splits.len() > MAX_SPLITS {
            return None;
        }
        let mut cases = Vec::new();
        self.split(
            reduction,
            envelope,
            &splits,
            &mut BTreeMap::new(),
            &mut cases,
        )?;
        Some(cases)
    }

    /// Appends the cases of the parameters that are still to be split. Returns the position of the
    /// first.
    fn split(
        &self,
        reduction: &Reduction,
        envelope: &DecoupledEnvelope,
        splits: &[ParameterId],
        values: &mut BTreeMap<ParameterId, Rational>,
        cases: &mut Vec<ScheduleCase>,
    ) -> Option<usize> {
        let place = cases.len();
        let Some((&parameter, rest)) = splits.split_first() else {
            let rule = self.rule(reduction, envelope, values)?;
            cases.push(ScheduleCase::Rule(rule));
            return Some(place);
        };
        cases.push(ScheduleCase::Split(parameter, [0; 2]));
        let mut parts = [0; 2];
        for side in Side::BOTH {
            let value = side.of(envelope.interval(parameter)).value()?;
            values.insert(parameter, value.clone());
            parts[side.index()] = self.split(reduction, envelope, rest, values, cases)?;
        }
        values.remove(&parameter);
        cases[place] = ScheduleCase::Split(parameter, parts);
        Some(place)
    }

    /// Computes a rule for all values of the parameters that are not fixed.
    fn rule(
        &self,
        reduction: &Reduction,
        envelope: &DecoupledEnvelope,
        fixed: &BTreeMap<ParameterId, Rational>,
    ) -> Option<Vec<TimeRule>> {
        // The values of the base schedule, and the ends whose parameters move times.
        let mut base = fixed.clone();
        let mut moving = Vec::new();
        for (index, role) in self.roles.iter().enumerate() {
            let id = ParameterId::from(index);
            let interval = envelope.interval(id);
            let side = match role {
                Role::Both => continue,
                Role::Lower => Side::Lower,
                Role::None if interval.lower.value().is_some() => Side::Lower,
                Role::Upper | Role::None => Side::Upper,
            };
            let value = side.of(interval).value().cloned().unwrap_or_default();
            base.insert(id, value);
            moving.push((id, side));
        }
        let mut network = Network::with_nodes(self.class_count);
        for edge in self.edges() {
            let bound = match edge.end {
                None => edge.constant.clone(),
                Some(BoxEnd { parameter, side }) => match side {
                    Side::Upper => &edge.constant + &base[&parameter],
                    Side::Lower => &edge.constant - &base[&parameter],
                },
            };
            network.add(Constraint {
                from: edge.from,
                to: edge.to,
                bound,
            });
        }
        let network = ConsistentNetwork::try_from(network).ok()?;
        let earliest = network.earliest_schedule(ClassId(0));
        let mut classes: Vec<TimeRule> = earliest
            .times()
            .iter()
            .map(|time| TimeRule {
                constant: time - &earliest.times()[0],
                factors: Vec::new(),
            })
            .collect();
        for (parameter, side) in moving {
            let moves = self.moves_with(parameter, side);
            for (class, rule) in classes.iter_mut().enumerate() {
                // Times are relative to time zero.
                let factor = i64::from(moves[class]) - i64::from(moves[0]);
                if factor != 0 {
                    let factor = Rational::from(factor);
                    rule.constant -= &base[&parameter] * &factor;
                    rule.factors.push((parameter, factor));
                }
            }
        }
        let rules = (0..reduction.node_count()).map(|node| {
            let (class, offset) = reduction.class_of(NodeId::from(node));
            let mut rule = classes[class.index()].clone();
            rule.constant += &offset;
            rule
        });
        Some(rules.collect())
    }

    /// Returns, for each class, `true` if it moves with a parameter that is a difference of times,
    /// as its value moves away from that end.
    fn moves_with(&self, parameter: ParameterId, side: Side) -> Vec<bool> {
        let mut moves = vec![false; self.class_count];
        let is_own = |edge: &&Edge| edge.end.is_some_and(|end| end.parameter == parameter);
        let own = |wanted: Side| {
            let mut own = self.edges().filter(is_own);
            own.find(|edge| edge.end.is_some_and(|end| end.side == wanted))
        };
        // A parameter that bounds a difference from one side only moves nothing.
        let (Some(most), Some(_)) = (own(Side::Upper), own(Side::Lower)) else {
            return moves;
        };
        let mut open = vec![most.to];
        while let Some(class) = open.pop() {
            if std::mem::replace(&mut moves[class.index()], true) {
                continue;
            }
            for edge in self.edges().filter(|edge| !is_own(edge)) {
                match side {
                    Side::Lower if edge.to == class => open.push(edge.from),
                    Side::Upper if edge.from == class => open.push(edge.to),
                    _ => {}
                }
            }
        }
        moves
    }
}
