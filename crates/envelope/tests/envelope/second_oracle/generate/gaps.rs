//! Constraints around the nominal schedule.

use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;
use elbowroom_plan::{Bound, DecoupledEnvelope, InstanceId, Node, Schedule, Valuation};

use super::{Nominal, sample};
use crate::second_oracle::case::{Gap, instance_of};
use crate::second_oracle::system::System;

impl Nominal<'_> {
    /// Adds constraints around the nominal schedule: on durations, on happenings that interfere, on
    /// those that change what an over-all condition reads, and some at random.
    pub(super) fn add_gaps(&mut self) {
        let nodes = self.nodes();
        let (task, plan) = self.case.build();
        for (index, _) in self.durations() {
            let id = InstanceId::from(index);
            let width = *self.dice.pick(&[0, 0, 0, 1, 3]);
            self.add_gap(Node::Start(id), Node::End(id), width, None);
        }
        for (later, &second) in nodes.iter().enumerate() {
            for (earlier, &first) in nodes.iter().enumerate() {
                let ordered = (&self.schedule[earlier.into()], earlier)
                    < (&self.schedule[later.into()], later);
                let is_timed = matches!((first, second), (Node::Timed(_), Node::Timed(_)));
                let is_own = instance_of(first) == instance_of(second);
                if !ordered || earlier == 0 || is_timed || is_own {
                    continue;
                }
                let footprint = |node: usize| {
                    plan.plan
                        .footprint(&task, elbowroom_plan::NodeId::from(node))
                };
                let must = footprint(earlier).interferes_with(&footprint(later));
                let watch = over_all_reads(&task, &plan, first, second, &footprint(earlier))
                    || over_all_reads(&task, &plan, second, first, &footprint(later));
                let gap = &self.schedule[later.into()] - &self.schedule[earlier.into()];
                if must && self.dice.chance(94) {
                    let least = self.case.epsilon.clone().min(gap);
                    let width = *self.dice.pick(&[0, 1, 2, 4, 40, 40]);
                    self.add_gap(first, second, width, Some(least));
                } else if watch && self.dice.chance(85) {
                    let width = *self.dice.pick(&[0, 1, 2, 40]);
                    self.add_gap(first, second, width, Some(Rational::ZERO));
                } else if self.dice.chance(10) {
                    let width = *self.dice.pick(&[0, 1, 2, 4, 40]);
                    self.add_gap(first, second, width, None);
                }
            }
        }
        for &node in &nodes[1..] {
            if !matches!(node, Node::Timed(_)) && self.dice.chance(20) {
                let width = *self.dice.pick(&[0, 1, 2, 4]);
                self.add_gap(Node::Zero, node, width, None);
            }
        }
    }

    /// Adds a limit that only makes the numbers too large for machine integers.
    pub(super) fn add_far_limit(&mut self) {
        let nodes = self.nodes();
        let to = *self.dice.pick(&nodes[1..]);
        self.case.gaps.push(Gap {
            from: Node::Zero,
            to,
            lower: Bound::Infinite,
            upper: Bound::Finite(Rational::from(i64::MAX / 3)),
        });
    }

    /// Adds a constraint around the nominal difference, `width` halves wide, or unbounded.
    fn add_gap(&mut self, from: Node, to: Node, width: i64, least: Option<Rational>) {
        let gap = &self.time(to) - &self.time(from);
        let slack = Rational::new(width, 2);
        let lower = &gap - &slack;
        let lower = match least {
            Some(least) if width >= 40 => Bound::Finite(least),
            Some(least) => Bound::Finite(lower.max(least)),
            None if width >= 40 => Bound::Infinite,
            None => Bound::Finite(lower),
        };
        let upper = if width >= 40 {
            Bound::Infinite
        } else {
            Bound::Finite(gap + slack)
        };
        self.case.gaps.push(Gap {
            from,
            to,
            lower,
            upper,
        });
    }

    /// Searches for invalid schedules at the nominal values, and narrows constraints until none is
    /// found, so that many of the boxes are inside.
    pub(super) fn tighten(&mut self) {
        for _ in 0..8 {
            let (_, plan) = self.case.build();
            let valuation = plan.nominal();
            let system = System::new(&plan, &DecoupledEnvelope::point(&valuation));
            let Some(bad) = self.bad_schedule(system, &valuation) else {
                return;
            };
            let nodes = self.nodes();
            let differs = |a: usize, b: usize| {
                &bad[b.into()] - &bad[a.into()]
                    != &self.schedule[b.into()] - &self.schedule[a.into()]
            };
            let mut pairs = Vec::new();
            for a in 0..nodes.len() {
                for b in a + 1..nodes.len() {
                    if differs(a, b) {
                        pairs.push((a, b));
                    }
                }
            }
            if pairs.is_empty() {
                return;
            }
            let (a, b) = *self.dice.pick(&pairs);
            let width = *self.dice.pick(&[0, 0, 1]);
            self.add_gap(nodes[a], nodes[b], width, None);
        }
    }

    fn bad_schedule(&mut self, mut system: System, valuation: &Valuation) -> Option<Schedule> {
        (0..8).find_map(|_| {
            let schedule = sample(&mut system, self.dice)?.1;
            let is_valid = self.case.validate(valuation, &schedule).is_valid();
            (!is_valid).then_some(schedule)
        })
    }
}

/// Returns `true` if an over-all condition of the running action reads what the footprint writes.
fn over_all_reads(
    task: &Task,
    plan: &elbowroom_plan::ParametrizedPlan,
    running: Node,
    writer: Node,
    footprint: &Footprint,
) -> bool {
    let (Node::Start(id) | Node::End(id)) = running else {
        return false;
    };
    let action = &plan.plan.instance(id).action;
    instance_of(writer) != Some(id)
        && action.durative().is_some_and(|body| {
            footprint.writes_reads_of(&Footprint::of_condition(task, &body.over_all))
        })
}
