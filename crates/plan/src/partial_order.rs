//! Partially ordered plans whose actions may be skipped and repeated: [`partial_order`].
//!
//! Input of the adaptive executor (Olisipo, TIME 2021, section 2.1; Lima et al. 2020).
//! [`deorder`](crate::deorder::deorder) keeps every order that the plan as a whole needs in order
//! to work in all schedules. Here only two kinds are kept:
//!
//! - **duration**: the duration of an action;
//! - **interference**: the later happening would invalidate the earlier one, by undoing a condition
//!   or an effect of it.
//!
//! *Causal* orders, where the earlier happening establishes a condition of the later one, are
//! dropped. The component that chooses an order reads from the state whether a condition holds; it
//! may also have been established in another way. Bounds from timed initials are not links either:
//! timed initials are in the list of nodes, and are part of an order like actions.

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Condition, Effect, FactId, SnapAction};
use elbowroom_model::{Footprint, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use crate::deorder::{Labelled, durations, labelled};
use crate::durations::with_bounds_of_conditions;
use crate::stn_plan::{Bound, Constraint, Instance, InstanceId, Node, NodeId, StnPlan};

/// Actions, and the few orderings among their happenings that are independent of skipped actions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PartialOrderPlan {
    /// Actions, labelled `n0`, `n1`, … in order of their start.
    pub instances: Vec<Instance>,
    /// For each step of the original plan, its instance.
    pub instance_of_step: Vec<InstanceId>,
    /// Planned duration of each instance; `None` for an instantaneous one, or without a plan.
    pub planned: Vec<Option<Rational>>,
    /// [`Node::Zero`], then each instance's start and end, or instant, in order, then the timed
    /// initials in order of time: the nodes of the [`StnPlan`] of the same instances.
    pub nodes: Vec<Node>,
    /// Orderings. A link only applies if both of its nodes are executed.
    pub links: Vec<Link>,
}

/// `lower <= to - from <= upper`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Link {
    /// The earlier happening.
    pub from: NodeId,
    /// The later happening.
    pub to: NodeId,
    /// Least difference, not negative.
    pub lower: Rational,
    /// Greatest difference; `None` if there is none.
    pub upper: Option<Rational>,
    /// Kind of the link.
    pub kind: LinkKind,
}

/// Kind of a [`Link`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LinkKind {
    /// `from` and `to` are start and end of one action.
    Duration,
    /// `to` undoes a condition or an effect of `from`.
    Interference,
}

impl PartialOrderPlan {
    /// Creates a plan of actions without any order, with the durations that the domain allows if
    /// these do not depend on the state.
    pub fn unordered(task: &Task, actions: impl IntoIterator<Item = Action>) -> Self {
        let steps = actions.into_iter().map(|action| Step {
            start: Rational::ZERO,
            duration: action.durative().map(|_| Rational::ZERO),
            action: Arc::new(action),
        });
        let plan = TimeTriggeredPlan {
            steps: steps.collect(),
        };
        let Labelled {
            plan: stn_plan,
            instances,
            ..
        } = labelled(task, &plan);
        let nodes = stn_plan.nodes();
        let footprints: Vec<Footprint> = nodes
            .map(|(node, _)| stn_plan.footprint(task, node))
            .collect();
        let bounded = with_all_bounds(&stn_plan);
        let constraints = durations::state_independent_bounds(task, &bounded, &footprints);
        let links = constraints.into_iter().map(duration_link);
        Self {
            links: links.collect(),
            instance_of_step: instances,
            planned: vec![None; stn_plan.instances.len()],
            instances: stn_plan.instances,
            nodes: stn_plan.nodes,
        }
    }

    /// Returns the instance with that id.
    pub fn instance(&self, id: InstanceId) -> &Instance {
        &self.instances[id.index()]
    }

    /// Returns all instances with their ids.
    pub fn instances(&self) -> impl Iterator<Item = (InstanceId, &Instance)> + '_ {
        let numbered = self.instances.iter().enumerate();
        numbered.map(|(index, instance)| (InstanceId::from(index), instance))
    }

    /// Returns the least and the greatest duration of an instance; `(0, 0)` for an instantaneous
    /// one.
    pub fn duration(&self, id: InstanceId) -> (Rational, Option<Rational>) {
        let is_it = |link: &&Link| {
            link.kind == LinkKind::Duration && self.nodes[link.from.index()] == Node::Start(id)
        };
        match self.links.iter().find(is_it) {
            Some(link) => (link.lower.clone(), link.upper.clone()),
            None => (Rational::ZERO, Some(Rational::ZERO)),
        }
    }

    /// Returns the interference links as pairs of nodes.
    pub fn interference(&self) -> impl Iterator<Item = &Link> + '_ {
        let is_it = |link: &&Link| link.kind == LinkKind::Interference;
        self.links.iter().filter(is_it)
    }
}

/// Returns the partial order of a valid plan with fixed times.
///
/// Durations get the domain's interval, restricted by the action's conditions on its duration, or
/// the plan's own number if these bounds depend on the schedule.
pub fn partial_order(task: &Task, plan: &TimeTriggeredPlan) -> PartialOrderPlan {
    let Labelled {
        plan: stn_plan,
        instances,
        times,
    } = labelled(task, plan);
    let bounded = with_all_bounds(&stn_plan);
    let mut links: Vec<Link> = durations::constraints(task, &bounded, &times)
        .into_iter()
        .map(duration_link)
        .collect();
    let uses: Vec<Use> = stn_plan
        .nodes()
        .map(|(node, _)| Use::of(task, &stn_plan, node))
        .collect();
    let happenings: Vec<NodeId> = stn_plan
        .nodes()
        .filter(|(_, what)| !matches!(what, Node::Zero | Node::Timed(_)))
        .map(|(node, _)| node)
        .collect();
    for &from in &happenings {
        for &to in &happenings {
            if times[from] < times[to] && uses[to.index()].threatens(&uses[from.index()]) {
                links.push(Link {
                    from,
                    to,
                    lower: task.epsilon().clone(),
                    upper: None,
                    kind: LinkKind::Interference,
                });
            }
        }
    }
    let mut planned = vec![None; stn_plan.instances.len()];
    for (instance, step) in instances.iter().zip(&plan.steps) {
        planned[instance.index()].clone_from(&step.duration);
    }
    PartialOrderPlan {
        instance_of_step: instances,
        planned,
        instances: stn_plan.instances,
        nodes: stn_plan.nodes,
        links,
    }
}

/// Returns the plan with the bounds on durations from conditions added to those of the domain.
fn with_all_bounds(plan: &StnPlan) -> StnPlan {
    let mut plan = plan.clone();
    for instance in &mut plan.instances {
        instance.action = with_bounds_of_conditions(&instance.action);
    }
    plan
}

fn duration_link(constraint: Constraint) -> Link {
    let number = |bound: Bound| match bound {
        Bound::Finite(number) => Some(number),
        Bound::Infinite | Bound::Parameter(_) => None,
    };
    Link {
        from: constraint.from,
        to: constraint.to,
        lower: number(constraint.lower).unwrap_or_default(),
        upper: number(constraint.upper),
        kind: LinkKind::Duration,
    }
}

/// Conditions and effects of a happening.
#[derive(Default)]
struct Use {
    /// Facts that must be true; basic facts under a derived one are in both sets.
    needs_true: BTreeSet<FactId>,
    needs_false: BTreeSet<FactId>,
    footprint: Footprint,
    /// Over-all conditions belong to the end.
    throughout: Footprint,
}

impl Use {
    fn of(task: &Task, plan: &StnPlan, node: NodeId) -> Self {
        let mut uses = Self {
            footprint: plan.footprint(task, node),
            ..Self::default()
        };
        let action = |id: InstanceId| -> &Action { &plan.instance(id).action };
        match plan.nodes[node.index()] {
            Node::Zero | Node::Timed(_) => {}
            Node::Start(id) | Node::Instant(id) => match &action(id).body {
                Body::Instantaneous(snap) => uses.include_snap(task, snap),
                Body::Durative(body) => {
                    uses.include_snap(task, &body.start);
                    for effect in &body.end.effects {
                        uses.include(task, &effect.guard.at_start);
                    }
                }
            },
            Node::End(id) => {
                if let Body::Durative(body) = &action(id).body {
                    uses.include_snap(task, &body.end);
                    uses.include(task, &body.over_all);
                    uses.throughout = Footprint::of_condition(task, &body.over_all);
                    for effect in &body.end.effects {
                        uses.include(task, &effect.guard.over_all);
                    }
                }
            }
        }
        uses
    }

    fn include_snap(&mut self, task: &Task, snap: &SnapAction) {
        self.include(task, &snap.condition);
        for Effect { guard, .. } in &snap.effects {
            self.include(task, &guard.now);
            // An effect that does not happen in the plan must not happen in another order either.
            self.include(task, &Condition::Not(Box::new(guard.now.clone())));
        }
    }

    fn include(&mut self, task: &Task, condition: &Condition) {
        self.include_signed(task, condition, true);
    }

    fn include_signed(&mut self, task: &Task, condition: &Condition, is_positive: bool) {
        match condition {
            Condition::Fact(fact) if task.is_derived(*fact) => {
                task.visit_facts_of(condition, &mut |basic| {
                    self.needs_true.insert(basic);
                    self.needs_false.insert(basic);
                });
            }
            Condition::Fact(fact) => {
                let needs = if is_positive {
                    &mut self.needs_true
                } else {
                    &mut self.needs_false
                };
                needs.insert(*fact);
            }
            Condition::Compare(..) => {}
            Condition::Not(part) => self.include_signed(task, part, !is_positive),
            Condition::And(parts) | Condition::Or(parts) => {
                for part in parts {
                    self.include_signed(task, part, is_positive);
                }
            }
        }
    }

    /// Returns `true` if this happening, which comes after `earlier` in the plan, would invalidate
    /// it if it came before.
    fn threatens(&self, earlier: &Self) -> bool {
        let meet = |a: &BTreeSet<_>, b: &BTreeSet<_>| !a.is_disjoint(b);
        let (own, other) = (&self.footprint, &earlier.footprint);
        let writes = |fluents: &BTreeSet<_>| {
            !own.assigns.is_disjoint(fluents) || !own.shifts.is_disjoint(fluents)
        };
        meet(&own.deletes, &earlier.needs_true)
            || meet(&own.adds, &earlier.needs_false)
            || meet(&own.deletes, &other.adds)
            || meet(&own.adds, &other.deletes)
            || writes(&other.reads_fluents)
            || writes(&earlier.throughout.reads_fluents)
            || writes(&other.assigns)
            || !own.assigns.is_disjoint(&other.shifts)
    }
}
