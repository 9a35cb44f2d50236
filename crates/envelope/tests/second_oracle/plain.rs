//! The plainly right oracle: every order of the time points, ties included.
//!
//! It goes through all orders in which the happenings can fall, group by group, and does what the
//! judge does, with values that are expressions in times and parameters. Each question ("can this
//! condition be false here?") is one linear program over all schedules with that order.
//!
//! Parameters that multiply something are not left open: a few values of each are tried. So
//! "inside" is certain only without such products; "broken" always comes with a schedule.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::ground::{
    Body, Change, Condition, DurativeBody, Effect, Expression, FluentId, SnapAction,
};
use elbowroom_model::problem::{Comparison, Unknown, UpdateOperator};
use elbowroom_model::{Footprint, Task};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{
    Bound, DecoupledEnvelope, InstanceId, Node, NodeId, ParametrizedPlan, Valuation,
};

use crate::polynomial::{Polynomial, Symbol};
use crate::system::{Relation, System};

/// Whether a box is inside the robustness envelope.
#[derive(Clone, Debug)]
pub(crate) enum Answer {
    Inside,
    /// For these values the plan has no schedule.
    NoSchedule(Valuation),
    /// This schedule for these values breaks something.
    Broken(Break),
}

/// What breaks, and where.
#[derive(Clone, Debug)]
pub(crate) struct Break {
    pub(crate) what: String,
    pub(crate) valuation: Valuation,
    pub(crate) schedule: Vec<Rational>,
    /// It is only that a timed initial is too near to another one, or to an action from after the
    /// end of the plan. The judge does not mind.
    pub(crate) is_only_timed: bool,
}

/// No answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GaveUp {
    TooManyOrders,
    NotLinear,
    NotCovered,
}

/// Whether all values in the box have a schedule, and all schedules for them are valid.
pub(crate) fn check(
    task: &Task,
    plan: &ParametrizedPlan,
    epsilon: &Rational,
    envelope: &DecoupledEnvelope,
    most_groups: usize,
) -> Result<Answer, GaveUp> {
    if let Some(valuation) = without_schedule(plan, envelope) {
        return Ok(Answer::NoSchedule(valuation));
    }
    let mut multiplied = BTreeSet::new();
    let found = loop {
        match all_combinations(task, plan, epsilon, envelope, &multiplied, most_groups) {
            Ok(found) => break found,
            Err(Trouble::GaveUp(reason)) => return Err(reason),
            Err(Trouble::Product(polynomial)) => {
                let more = factors(&polynomial);
                if more.is_empty() || more.is_subset(&multiplied) {
                    return Err(GaveUp::NotLinear);
                }
                multiplied.extend(more);
            }
        }
    };
    Ok(match found {
        Some(found) => Answer::Broken(found),
        None => Answer::Inside,
    })
}

/// Values in the box for which the plan's network has no schedule.
///
/// The values that have one are a projection of the polyhedron of values and schedules, so they
/// form a convex set, and a box lies in it exactly if all its corners do. An infinite end is taken
/// to be farther away than any number in a small case can reach.
pub(crate) fn without_schedule(
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
) -> Option<Valuation> {
    corners(envelope).into_iter().find(|corner| {
        let point = DecoupledEnvelope::point(corner);
        !System::new(plan, &point).is_feasible()
    })
}

/// All combinations of ends.
pub(crate) fn corners(envelope: &DecoupledEnvelope) -> Vec<Valuation> {
    combinations(&envelope.intervals, &|interval| {
        let mut ends = vec![lower(interval), upper(interval)];
        ends.dedup();
        ends
    })
}

fn combinations(
    intervals: &[Interval],
    values: &dyn Fn(&Interval) -> Vec<Rational>,
) -> Vec<Valuation> {
    let mut combinations = vec![Vec::new()];
    for interval in intervals {
        let values = values(interval);
        combinations = combinations
            .iter()
            .flat_map(|so_far: &Valuation| {
                values.iter().map(move |value| {
                    let mut longer = so_far.clone();
                    longer.push(value.clone());
                    longer
                })
            })
            .collect();
    }
    combinations
}

const FAR: i64 = 1_000_000;

fn lower(interval: &Interval) -> Rational {
    match (interval.lower.value(), interval.upper.value()) {
        (Some(lower), _) => lower.clone(),
        (None, Some(upper)) => upper - Rational::from(FAR),
        (None, None) => Rational::from(-FAR),
    }
}

fn upper(interval: &Interval) -> Rational {
    match (interval.lower.value(), interval.upper.value()) {
        (_, Some(upper)) => upper.clone(),
        (Some(lower), None) => lower + Rational::from(FAR),
        (None, None) => Rational::from(FAR),
    }
}

/// Both ends and some values in between.
fn samples(interval: &Interval) -> Vec<Rational> {
    let (lower, upper) = (lower(interval), upper(interval));
    let at = |part: Rational| &lower + (&upper - &lower) * part;
    let mut samples: Vec<_> = [(0, 1), (1, 4), (1, 2), (3, 4), (1, 1)]
        .map(|(numerator, denominator)| at(Rational::new(numerator, denominator)))
        .into();
    if interval.lower.is_infinite() || interval.upper.is_infinite() {
        let near = (-3..=3).map(|step| Rational::from(step * 4));
        samples.extend(near.filter(|value| interval.contains(value)));
    }
    samples.sort();
    samples.dedup();
    samples
}

/// The parameters in products.
fn factors(polynomial: &Polynomial) -> BTreeSet<usize> {
    let products = polynomial.products();
    let symbols = products.flat_map(|factors| factors.iter());
    symbols
        .filter_map(|symbol| match symbol {
            Symbol::Parameter(index) => Some(*index),
            Symbol::Time(_) | Symbol::Moment => None,
        })
        .collect()
}

fn all_combinations(
    task: &Task,
    plan: &ParametrizedPlan,
    epsilon: &Rational,
    envelope: &DecoupledEnvelope,
    multiplied: &BTreeSet<usize>,
    most_groups: usize,
) -> Result<Option<Break>, Trouble> {
    let intervals: Vec<_> = multiplied
        .iter()
        .map(|&index| envelope.intervals[index].clone())
        .collect();
    for values in combinations(&intervals, &samples) {
        let fixed: BTreeMap<_, _> = multiplied.iter().copied().zip(values).collect();
        let mut part = envelope.clone();
        for (&index, value) in &fixed {
            part.intervals[index] = Interval::point(value.clone());
        }
        let mut search = Search {
            task,
            plan,
            epsilon,
            system: System::new(plan, &part),
            fixed,
            left: most_groups,
            found: None,
        };
        if search.system.is_feasible() {
            let world = search.initial();
            search.next_groups(&world, &mut Vec::new(), 0)?;
        }
        if search.found.is_some() {
            return Ok(search.found);
        }
    }
    Ok(None)
}

/// Why the search ended without an answer.
enum Trouble {
    GaveUp(GaveUp),
    /// This is not linear.
    Product(Polynomial),
}

type Step = Result<(), Trouble>;

struct Search<'a> {
    task: &'a Task,
    plan: &'a ParametrizedPlan,
    epsilon: &'a Rational,
    system: System,
    /// Values of parameters that multiply something.
    fixed: BTreeMap<usize, Rational>,
    /// How many more groups may be looked at.
    left: usize,
    found: Option<Break>,
}

/// The state after some groups.
#[derive(Clone)]
struct World {
    facts: Vec<bool>,
    values: Vec<Option<Polynomial>>,
    running: BTreeMap<InstanceId, Running>,
    /// All nodes so far, and those of the last group.
    placed: Vec<usize>,
    last: Vec<usize>,
    remaining: Vec<usize>,
}

#[derive(Clone)]
struct Running {
    is_new: bool,
    /// What the guards read at the start said, of end effects and of continuous ones.
    end_guards: Vec<bool>,
    continuous: Vec<bool>,
}

/// What a condition or expression is read in.
#[derive(Clone)]
struct Context {
    facts: Vec<bool>,
    values: Vec<Option<Polynomial>>,
    duration: Option<Polynomial>,
}

/// The truth that is looked for. A comparison with an undefined number is neither true nor false.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Want {
    True,
    False,
    NotTrue,
    NotFalse,
}

impl Want {
    fn negated(self) -> Self {
        match self {
            Self::True => Self::False,
            Self::False => Self::True,
            Self::NotTrue => Self::NotFalse,
            Self::NotFalse => Self::NotTrue,
        }
    }
}

type Wanted<'c> = (&'c Condition, Want);

impl<'a> Search<'a> {
    fn initial(&self) -> World {
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

    fn parameter(&self, index: usize) -> Polynomial {
        match self.fixed.get(&index) {
            Some(value) => Polynomial::constant(value),
            None => Polynomial::symbol(Symbol::Parameter(index)),
        }
    }

    fn node(&self, node: usize) -> Node {
        self.plan.plan.nodes[node]
    }

    fn assert(&mut self, polynomial: &Polynomial, relation: Relation) -> Step {
        let asserted = self.system.assert(polynomial, relation);
        asserted.map_err(|_| Trouble::Product(polynomial.clone()))
    }

    fn assert_before(&mut self, earlier: usize, later: usize) -> Step {
        let gap = Polynomial::difference(Symbol::Time(later), Symbol::Time(earlier));
        self.assert(&gap, Relation::Below)
    }

    fn report(&mut self, what: String) {
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
    fn next_groups(&mut self, world: &World, group: &mut Vec<usize>, from: usize) -> Step {
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

    /// The group comes next, everything else after it.
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

    /// The time between the last group and the node.
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
            // The over-all interval is open; at a group within it, the state after the group counts.
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

    /// The rates of the continuous effects at work.
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

    fn durative(&self, id: InstanceId) -> &'a DurativeBody {
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

    /// The conditions of a group, and its distance from others.
    fn arrive(&mut self, world: &World, group: &[usize]) -> Step {
        for &node in group {
            let context = self.context(world, node);
            let what = format!("{:?}", self.node(node));
            match self.node(node) {
                Node::Zero | Node::Timed(_) => {}
                Node::Instant(id) => {
                    let snap = self.snap(id);
                    self.require(&snap.condition, &context, &what)?;
                }
                Node::Start(id) => {
                    self.require_duration(id, false, &context)?;
                    self.require(&self.durative(id).start.condition, &context, &what)?;
                }
                Node::End(id) => {
                    let start = NodeId::index(self.plan.plan.start(id));
                    if !group.contains(&start) && !world.placed.contains(&start) {
                        self.report(format!("{} ends before it starts", id.0));
                        return Ok(());
                    }
                    self.require_duration(id, true, &context)?;
                    self.require(&self.durative(id).end.condition, &context, &what)?;
                }
            }
            if self.found.is_some() {
                return Ok(());
            }
        }
        self.separate(world, group)?;
        if self.found.is_some() {
            return Ok(());
        }
        let mut guards = Vec::new();
        for &node in group {
            guards.extend(self.guards(world, node)?);
        }
        self.decide(world, group, &guards, &mut BTreeMap::new())
    }

    fn snap(&self, id: InstanceId) -> &'a SnapAction {
        match &self.plan.plan.instances[id.index()].action.body {
            Body::Instantaneous(snap) => snap,
            Body::Durative(_) => unreachable!("an instant"),
        }
    }

    fn context(&self, world: &World, node: usize) -> Context {
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

    fn require_duration(&mut self, id: InstanceId, at_end: bool, context: &Context) -> Step {
        for limit in &self.durative(id).duration {
            if limit.at_end == at_end {
                let condition =
                    Condition::Compare(limit.comparison, Expression::Duration, limit.bound.clone());
                self.require(&condition, context, &format!("duration of {}", id.0))?;
            }
        }
        Ok(())
    }

    fn require(&mut self, condition: &Condition, context: &Context, what: &str) -> Step {
        if self.found.is_some() {
            return Ok(());
        }
        self.ways(vec![(condition, Want::NotTrue)], context, &mut |search| {
            search.report(what.to_owned());
            Ok(())
        })
    }

    /// Interfering happenings are at least epsilon apart. Of two timed initials that holds only if
    /// their times are open; then they also keep their order.
    fn separate(&mut self, world: &World, group: &[usize]) -> Step {
        for (position, &node) in group.iter().enumerate() {
            for &other in world.placed.iter().chain(&group[..position]) {
                let footprint = |node: usize| self.footprint(node);
                if !footprint(node).interferes_with(&footprint(other)) {
                    continue;
                }
                let are_timed = match (self.node(node), self.node(other)) {
                    (Node::Timed(late), Node::Timed(early)) => Some((late, early)),
                    _ => None,
                };
                if let Some((late, early)) = are_timed {
                    if !self.is_open(node) && !self.is_open(other) {
                        continue;
                    }
                    if late < early {
                        self.report("timed initials change places".to_owned());
                        self.mark_timed();
                        return Ok(());
                    }
                }
                let gap = Polynomial::difference(Symbol::Time(other), Symbol::Time(node));
                let missing = gap.minus(&Polynomial::constant(self.epsilon));
                self.system.push();
                self.assert(&missing, Relation::Below)?;
                if self.system.is_feasible() {
                    let (first, second) = (self.node(other), self.node(node));
                    self.report(format!("{first:?} and {second:?} too near"));
                    if are_timed.is_some() {
                        self.mark_timed();
                    }
                }
                self.system.pop();
                if self.found.is_some() {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Timed initials after the last action keep away from it as well.
    fn separate_later(&mut self, world: &World) -> Step {
        for (position, &node) in world.remaining.iter().enumerate() {
            if self.found.is_some() {
                return Ok(());
            }
            let mut others = world.clone();
            others.placed.extend(&world.remaining[..position]);
            self.separate(&others, &[node])?;
            self.mark_timed();
        }
        Ok(())
    }

    fn mark_timed(&mut self) {
        if let Some(found) = &mut self.found {
            found.is_only_timed = true;
        }
    }

    /// Whether a node's time depends on a parameter.
    fn is_open(&self, node: usize) -> bool {
        self.plan.plan.constraints.iter().any(|constraint| {
            constraint.to.index() == node
                && constraint.from == NodeId::ZERO
                && matches!(constraint.upper, Bound::Parameter(_))
        })
    }

    fn footprint(&self, node: usize) -> Footprint {
        let action = |id: InstanceId| &self.plan.plan.instances[id.index()].action;
        match self.node(node) {
            Node::Zero => Footprint::default(),
            Node::Start(id) | Node::Instant(id) => Footprint::of_start(self.task, action(id)),
            Node::End(id) => Footprint::of_end(self.task, action(id)),
            Node::Timed(group) => Footprint::of_timed(&self.task.timed()[group]),
        }
    }

    /// The guards read at a node.
    fn guards(&self, world: &World, node: usize) -> Result<Vec<Guard<'a>>, Trouble> {
        let mut guards = Vec::new();
        let duration = self.context(world, node).duration;
        let mut read = |part: Part, index: usize, condition: &'a Condition| {
            guards.push(Guard {
                key: (node, part, index),
                condition,
                duration: duration.clone(),
            });
        };
        let now = |effects: &'a [Effect]| effects.iter().map(|effect| &effect.guard.now);
        match self.node(node) {
            Node::Zero | Node::Timed(_) => {}
            Node::Instant(id) => {
                for (index, guard) in now(&self.snap(id).effects).enumerate() {
                    read(Part::Now, index, guard);
                }
            }
            Node::Start(id) => {
                let body = self.durative(id);
                let ends = body.end.effects.iter().map(|effect| &effect.guard);
                let all = ends.chain(body.continuous.iter().map(|effect| &effect.guard));
                if all.into_iter().any(|guard| !guard.over_all.is_trivial()) {
                    return Err(Trouble::GaveUp(GaveUp::NotCovered));
                }
                for (index, guard) in now(&body.start.effects).enumerate() {
                    read(Part::Now, index, guard);
                }
                for (index, effect) in body.end.effects.iter().enumerate() {
                    read(Part::EndEffect, index, &effect.guard.at_start);
                }
                for (index, effect) in body.continuous.iter().enumerate() {
                    read(Part::Continuous, index, &effect.guard.at_start);
                }
            }
            Node::End(id) => {
                let running = world.running.get(&id);
                for (index, guard) in now(&self.durative(id).end.effects).enumerate() {
                    if running.is_none_or(|running| running.end_guards[index]) {
                        read(Part::Now, index, guard);
                    }
                }
            }
        }
        Ok(guards)
    }

    /// Goes on with each combination of the guards' outcomes.
    fn decide(
        &mut self,
        world: &World,
        group: &[usize],
        guards: &[Guard<'_>],
        outcomes: &mut BTreeMap<GuardKey, bool>,
    ) -> Step {
        if self.found.is_some() {
            return Ok(());
        }
        let Some((guard, rest)) = guards.split_first() else {
            return self.apply(world.clone(), group, outcomes);
        };
        let context = Context {
            facts: world.facts.clone(),
            values: world.values.clone(),
            duration: guard.duration.clone(),
        };
        if mentions_undefined(guard.condition, &context) {
            return Err(Trouble::GaveUp(GaveUp::NotCovered));
        }
        for (want, outcome) in [(Want::True, true), (Want::False, false)] {
            self.ways(vec![(guard.condition, want)], &context, &mut |search| {
                outcomes.insert(guard.key, outcome);
                search.decide(world, group, rest, outcomes)?;
                outcomes.remove(&guard.key);
                Ok(())
            })?;
        }
        Ok(())
    }

    /// Carries out the group's effects and goes on with the next group, or looks at the goal.
    fn apply(
        &mut self,
        mut world: World,
        group: &[usize],
        outcomes: &BTreeMap<GuardKey, bool>,
    ) -> Step {
        let (mut deletes, mut adds) = (Vec::new(), Vec::new());
        let mut updates: BTreeMap<FluentId, Vec<(UpdateOperator, Polynomial)>> = BTreeMap::new();
        for &node in group {
            let context = self.context(&world, node);
            for change in self.changes(node, outcomes) {
                match change {
                    Change::Add(fact) => adds.push(*fact),
                    Change::Delete(fact) => deletes.push(*fact),
                    Change::Update {
                        operator,
                        fluent,
                        value,
                    } => {
                        let value = self.value(value, &context)?;
                        let is_defined = *operator == UpdateOperator::Assign
                            || world.values[fluent.index()].is_some();
                        let (Some(value), true) = (value, is_defined) else {
                            self.report(format!("an effect of {:?} undefined", self.node(node)));
                            return Ok(());
                        };
                        updates.entry(*fluent).or_default().push((*operator, value));
                    }
                }
            }
        }
        for (fluent, updates) in updates {
            if updates.len() > 1 && updates.iter().any(|(operator, _)| !operator.is_additive()) {
                self.report("updates in conflict".to_owned());
                return Ok(());
            }
            for (operator, amount) in updates {
                let old = world.values[fluent.index()].take().unwrap_or_default();
                world.values[fluent.index()] = Some(match operator {
                    UpdateOperator::Assign => amount,
                    UpdateOperator::Increase => old.plus(&amount),
                    UpdateOperator::Decrease => old.minus(&amount),
                    UpdateOperator::ScaleUp => old.times(&amount),
                    UpdateOperator::ScaleDown => {
                        return Err(Trouble::GaveUp(GaveUp::NotCovered));
                    }
                });
            }
        }
        for fact in deletes {
            world.facts[fact.index()] = false;
        }
        for fact in adds {
            world.facts[fact.index()] = true;
        }
        self.start_and_stop(&mut world, group, outcomes);
        world.placed.extend(group);
        world.remaining.retain(|node| !group.contains(node));
        world.last = group.to_vec();
        let is_over = world
            .remaining
            .iter()
            .all(|&node| matches!(self.node(node), Node::Timed(_)));
        if is_over {
            let context = Context {
                facts: world.facts.clone(),
                values: world.values.clone(),
                duration: None,
            };
            let goal = &self.plan.goal;
            self.require(goal, &context, "goal")?;
            return self.separate_later(&world);
        }
        self.next_groups(&world, &mut Vec::new(), 0)
    }

    fn start_and_stop(
        &self,
        world: &mut World,
        group: &[usize],
        outcomes: &BTreeMap<GuardKey, bool>,
    ) {
        for &node in group {
            if let Node::Start(id) = self.node(node) {
                let body = self.durative(id);
                let outcome = |part: Part, index: usize| outcomes[&(node, part, index)];
                let running = Running {
                    is_new: true,
                    end_guards: (0..body.end.effects.len())
                        .map(|index| outcome(Part::EndEffect, index))
                        .collect(),
                    continuous: (0..body.continuous.len())
                        .map(|index| outcome(Part::Continuous, index))
                        .collect(),
                };
                world.running.insert(id, running);
            }
        }
        for &node in group {
            if let Node::End(id) = self.node(node) {
                world.running.remove(&id);
            }
        }
    }

    /// What a node changes.
    fn changes(&self, node: usize, outcomes: &BTreeMap<GuardKey, bool>) -> Vec<&'a Change> {
        let effects = match self.node(node) {
            Node::Zero => return Vec::new(),
            Node::Timed(group) => return self.task.timed()[group].changes.iter().collect(),
            Node::Instant(id) => &self.snap(id).effects,
            Node::Start(id) => &self.durative(id).start.effects,
            Node::End(id) => &self.durative(id).end.effects,
        };
        // Of an action that takes no time, the guards read at the start are in the same group.
        let is_off = |index: usize| match self.node(node) {
            Node::End(id) => {
                let start = self.plan.plan.start(id).index();
                outcomes.get(&(start, Part::EndEffect, index)) == Some(&false)
            }
            _ => false,
        };
        let happens =
            |index: usize| outcomes.get(&(node, Part::Now, index)) == Some(&true) && !is_off(index);
        let effects = effects.iter().enumerate();
        effects
            .filter(|(index, _)| happens(*index))
            .map(|(_, effect)| &effect.change)
            .collect()
    }

    /// Calls `then` in each way in which all conditions have the wanted truth and some schedule is
    /// left.
    fn ways(
        &mut self,
        mut wanted: Vec<Wanted<'_>>,
        context: &Context,
        then: &mut dyn FnMut(&mut Self) -> Step,
    ) -> Step {
        if self.found.is_some() {
            return Ok(());
        }
        let Some((condition, want)) = wanted.pop() else {
            return if self.system.is_feasible() {
                then(self)
            } else {
                Ok(())
            };
        };
        let is_positive = matches!(want, Want::True | Want::NotFalse);
        match condition {
            Condition::Fact(fact) => {
                if context.facts[fact.index()] == is_positive {
                    self.ways(wanted, context, then)?;
                }
            }
            Condition::Not(part) => {
                wanted.push((&**part, want.negated()));
                self.ways(wanted, context, then)?;
            }
            Condition::And(parts) | Condition::Or(parts) => {
                if matches!(condition, Condition::And(_)) == is_positive {
                    wanted.extend(parts.iter().map(|part| (part, want)));
                    self.ways(wanted, context, then)?;
                } else {
                    for part in parts {
                        let mut wanted = wanted.clone();
                        wanted.push((part, want));
                        self.ways(wanted, context, then)?;
                    }
                }
            }
            Condition::Compare(comparison, left, right) => {
                let left = self.value(left, context)?;
                let right = self.value(right, context)?;
                let Some((left, right)) = left.zip(right) else {
                    return match want {
                        Want::True | Want::False => Ok(()),
                        Want::NotTrue | Want::NotFalse => self.ways(wanted, context, then),
                    };
                };
                for (polynomial, relation) in literal(*comparison, &left, &right, is_positive) {
                    self.system.push();
                    self.assert(&polynomial, relation)?;
                    self.ways(wanted.clone(), context, then)?;
                    self.system.pop();
                }
            }
        }
        Ok(())
    }

    /// The value; `None` where it is undefined.
    fn value(
        &self,
        expression: &Expression,
        context: &Context,
    ) -> Result<Option<Polynomial>, Trouble> {
        let all = |parts: &[Expression]| -> Result<Option<Vec<Polynomial>>, Trouble> {
            parts.iter().map(|part| self.value(part, context)).collect()
        };
        Ok(match expression {
            Expression::Constant(value) => Some(Polynomial::constant(value)),
            Expression::Fluent(fluent) => context.values[fluent.index()].clone(),
            Expression::Duration => context.duration.clone(),
            Expression::Unknown(Unknown::Parameter(id)) => Some(self.parameter(*id as usize)),
            Expression::Unknown(_) | Expression::TotalTime => {
                return Err(Trouble::GaveUp(GaveUp::NotCovered));
            }
            Expression::Add(parts) => all(parts)?.map(|parts| {
                let zero = Polynomial::default();
                parts.iter().fold(zero, |sum, part| sum.plus(part))
            }),
            Expression::Multiply(parts) => all(parts)?.map(|parts| {
                let one = Polynomial::constant(&Rational::ONE);
                parts.iter().fold(one, |product, part| product.times(part))
            }),
            Expression::Subtract(left, right) => {
                let (left, right) = (self.value(left, context)?, self.value(right, context)?);
                left.zip(right).map(|(left, right)| left.minus(&right))
            }
            Expression::Divide(left, right) => {
                let (left, right) = (self.value(left, context)?, self.value(right, context)?);
                let Some((left, right)) = left.zip(right) else {
                    return Ok(None);
                };
                let divisor = right.as_constant();
                let divisor = divisor.ok_or(Trouble::GaveUp(GaveUp::NotCovered))?;
                let factor = divisor.reciprocal();
                factor.map(|factor| left.times(&Polynomial::constant(&factor)))
            }
            Expression::Negate(part) => self
                .value(part, context)?
                .map(|value| Polynomial::default().minus(&value)),
        })
    }
}

/// Which effect's guard, and which part of it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Part {
    Now,
    EndEffect,
    Continuous,
}

type GuardKey = (usize, Part, usize);

struct Guard<'a> {
    key: GuardKey,
    condition: &'a Condition,
    duration: Option<Polynomial>,
}

fn mentions_undefined(condition: &Condition, context: &Context) -> bool {
    let mut found = false;
    condition.visit_fluents(&mut |fluent| found |= context.values[fluent.index()].is_none());
    found
}

/// The ways in which `left comparison right` is true, or false.
fn literal(
    comparison: Comparison,
    left: &Polynomial,
    right: &Polynomial,
    wanted: bool,
) -> Vec<(Polynomial, Relation)> {
    let below = || (left.minus(right), Relation::Below);
    let not_above = || (left.minus(right), Relation::NotAbove);
    let above = || (right.minus(left), Relation::Below);
    let not_below = || (right.minus(left), Relation::NotAbove);
    match (comparison, wanted) {
        (Comparison::Less, true) | (Comparison::AtLeast, false) => vec![below()],
        (Comparison::AtMost, true) | (Comparison::Greater, false) => vec![not_above()],
        (Comparison::Greater, true) | (Comparison::AtMost, false) => vec![above()],
        (Comparison::AtLeast, true) | (Comparison::Less, false) => vec![not_below()],
        (Comparison::Equal, true) => vec![(left.minus(right), Relation::Zero)],
        (Comparison::Equal, false) => vec![below(), above()],
    }
}
