//! Enumeration of the orders of happenings, by groups of simultaneous ones.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Task;
use elbowroom_model::ground::{Body, DurativeBody, FluentId, SnapAction};
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, ParametrizedPlan};

use super::{Break, GaveUp};
use crate::second_oracle::polynomial::{Polynomial, Symbol};
use crate::second_oracle::system::{Relation, System};

/// Reason why the search ended without an answer.
pub(super) enum Trouble {
    GaveUp(GaveUp),
    /// This polynomial is not linear.
    Product(Polynomial),
}

pub(super) type Step = Result<(), Trouble>;

pub(super) struct Search<'a> {
    pub(super) task: &'a Task,
    pub(super) plan: &'a ParametrizedPlan,
    pub(super) epsilon: &'a Rational,
    pub(super) system: System,
    /// Values of the multiplied parameters.
    pub(super) fixed: BTreeMap<usize, Rational>,
    /// Number of further groups that may be examined.
    pub(super) left: usize,
    pub(super) found: Option<Break>,
}

/// The state after some groups.
#[derive(Clone)]
pub(super) struct World {
    pub(super) facts: Vec<bool>,
    pub(super) values: Vec<Option<Polynomial>>,
    pub(super) running: BTreeMap<InstanceId, Running>,
    /// All nodes so far, and those of the last group.
    pub(super) placed: Vec<usize>,
    pub(super) last: Vec<usize>,
    pub(super) remaining: Vec<usize>,
}

#[derive(Clone)]
pub(super) struct Running {
    pub(super) is_new: bool,
    /// Values of the guards read at the start, of end effects and of continuous ones.
    pub(super) end_guards: Vec<bool>,
    pub(super) continuous: Vec<bool>,
}

/// State in which a condition or expression is evaluated.
#[derive(Clone)]
pub(super) struct Context {
    pub(super) facts: Vec<bool>,
    pub(super) values: Vec<Option<Polynomial>>,
    pub(super) duration: Option<Polynomial>,
}

impl<'a> Search<'a> {
    pub(super) fn initial(&self) -> World {
        let mut facts = vec![false; self.task.fact_count()];
        for fact in &self.task.initial().facts {
            facts[fact.index()] = true;
        }
        let mut values = vec![None; self.task.fluent_count()];
        for (fluent, value) in &self.task.initial().values {
            values[fluent.index()] = Some(Polynomial::constant(value));
        }
        for (fluent, id) in &self.plan.initial {
            values[fluent.index()] = Some(self.parameter(id.index()));
        }
        World {
            facts,
            values,
            running: BTreeMap::new(),
            placed: Vec::new(),
            last: Vec::new(),
            remaining: (1..self.plan.plan.nodes.len()).collect(),
        }
    }

    pub(super) fn parameter(&self, index: usize) -> Polynomial {
        match self.fixed.get(&index) {
            Some(value) => Polynomial::constant(value),
            None => Polynomial::symbol(Symbol::Parameter(index)),
        }
    }

    pub(super) fn node(&self, node: usize) -> Node {
        self.plan.plan.nodes[node]
    }

    pub(super) fn assert(&mut self, polynomial: &Polynomial, relation: Relation) -> Step {
        let asserted = self.system.assert(polynomial, relation);
        asserted.map_err(|_| Trouble::Product(polynomial.clone()))
    }

    fn assert_before(&mut self, earlier: usize, later: usize) -> Step {
        let gap = Polynomial::difference(Symbol::Time(later), Symbol::Time(earlier));
        self.assert(&gap, Relation::Below)
    }

    pub(super) fn report(&mut self, what: String) {
        // The last check may have been about a narrower system that was not feasible.
        if !self.system.is_feasible() {
            return;
        }
        let (valuation, schedule) = self.system.model();
        self.found = Some(Break {
            what,
            valuation,
            schedule,
            is_only_timed: false,
        });
    }

    /// Tries every group of simultaneous nodes that can come next: those in `group` and any of the
    /// remaining ones from `from` on.
    pub(super) fn next_groups(
        &mut self,
        world: &World,
        group: &mut Vec<usize>,
        from: usize,
    ) -> Step {
        for index in from..world.remaining.len() {
            let node = world.remaining[index];
            self.system.push();
            if let Some(&companion) = group.first() {
                let gap = Polynomial::difference(Symbol::Time(companion), Symbol::Time(node));
                self.assert(&gap, Relation::Zero)?;
            } else if let Some(&last) = world.last.first() {
                self.assert_before(last, node)?;
            }
            if self.system.is_feasible() {
                group.push(node);
                self.close(world, group)?;
                self.next_groups(world, group, index + 1)?;
                group.pop();
            }
            self.system.pop();
            if self.found.is_some() {
                break;
            }
        }
        Ok(())
    }

    /// Makes the group the next one, with everything else after it.
    fn close(&mut self, world: &World, group: &[usize]) -> Step {
        if self.found.is_some() {
            return Ok(());
        }
        self.system.push();
        let others = world.remaining.iter().filter(|node| !group.contains(node));
        for &other in others {
            self.assert_before(group[0], other)?;
        }
        if self.system.is_feasible() {
            self.left = self
                .left
                .checked_sub(1)
                .ok_or(Trouble::GaveUp(GaveUp::TooManyOrders))?;
            let mut world = world.clone();
            self.pass(&mut world, group[0])?;
            if self.found.is_none() {
                self.arrive(&world, group)?;
            }
        }
        self.system.pop();
        Ok(())
    }

    /// Advances the time from the last group to the node.
    fn pass(&mut self, world: &mut World, node: usize) -> Step {
        let Some(&last) = world.last.first() else {
            return Ok(());
        };
        let rates = self.rates(world)?.into_iter().map(|(fluent, rate)| {
            let value = world.values[fluent.index()].as_ref();
            Some((fluent, rate.zip(value)?.0))
        });
        let Some(rates) = rates.collect::<Option<Vec<_>>>() else {
            self.report("no value to change, or no rate".to_owned());
            return Ok(());
        };
        let moved = |moment: Symbol| {
            let elapsed = Polynomial::difference(Symbol::Time(last), moment);
            let mut values = world.values.clone();
            for (fluent, rate) in &rates {
                let value = &mut values[fluent.index()];
                *value = value.as_ref().map(|old| old.plus(&rate.times(&elapsed)));
            }
            values
        };
        let at_moment = moved(Symbol::Moment);
        let since = Polynomial::difference(Symbol::Moment, Symbol::Time(last));
        let until = Polynomial::difference(Symbol::Time(node), Symbol::Moment);
        for (&id, running) in &world.running {
            // The over-all interval is open; at a group within it, the state after the group is
            // relevant.
            let since_relation = if running.is_new {
                Relation::Below
            } else {
                Relation::NotAbove
            };
            let context = Context {
                facts: world.facts.clone(),
                values: at_moment.clone(),
                duration: Some(self.duration(id)),
            };
            self.system.push();
            self.assert(&since, since_relation)?;
            self.assert(&until, Relation::Below)?;
            let over_all = &self.durative(id).over_all;
            self.require(over_all, &context, &format!("over all of {}", id.0))?;
            self.system.pop();
        }
        world.values = moved(Symbol::Time(node));
        for running in world.running.values_mut() {
            running.is_new = false;
        }
        Ok(())
    }

    /// Returns the rates of the active continuous effects.
    fn rates(&self, world: &World) -> Result<Vec<(FluentId, Option<Polynomial>)>, Trouble> {
        let mut rates = Vec::new();
        let mut moving = BTreeSet::new();
        let mut read = BTreeSet::new();
        for (&id, running) in &world.running {
            let context = Context {
                facts: world.facts.clone(),
                values: world.values.clone(),
                duration: Some(self.duration(id)),
            };
            let continuous = self.durative(id).continuous.iter();
            for (effect, _) in continuous.zip(&running.continuous).filter(|(_, on)| **on) {
                let rate = self.value(&effect.rate, &context)?;
                effect.rate.visit_fluents(&mut |fluent| {
                    read.insert(fluent);
                });
                moving.insert(effect.fluent);
                rates.push((effect.fluent, rate));
            }
        }
        if moving.is_disjoint(&read) {
            Ok(rates)
        } else {
            Err(Trouble::GaveUp(GaveUp::NotLinear))
        }
    }

    pub(super) fn durative(&self, id: InstanceId) -> &'a DurativeBody {
        let action = &self.plan.plan.instances[id.index()].action;
        action.durative().expect("only durative actions run")
    }

    fn duration(&self, id: InstanceId) -> Polynomial {
        let place = |wanted: Node| {
            let node = self.plan.plan.nodes.iter().position(|&node| node == wanted);
            Symbol::Time(node.expect("every action has its nodes"))
        };
        Polynomial::difference(place(Node::Start(id)), place(Node::End(id)))
    }

    pub(super) fn snap(&self, id: InstanceId) -> &'a SnapAction {
        match &self.plan.plan.instances[id.index()].action.body {
            Body::Instantaneous(snap) => snap,
            Body::Durative(_) => unreachable!("an instant"),
        }
    }

    pub(super) fn context(&self, world: &World, node: usize) -> Context {
        let duration = match self.node(node) {
            Node::Start(id) | Node::End(id) => Some(self.duration(id)),
            _ => None,
        };
        Context {
            facts: world.facts.clone(),
            values: world.values.clone(),
            duration,
        }
    }
}
