//! The symbolic run.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use elbowroom_model::Task;
use elbowroom_model::ground::{
    Body, Change, Condition, Effect, Expression, FactId, FluentId, SnapAction,
};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;

use super::dnf::{Alternatives, Wanted, compared};
use super::goal::{goal_cases, lasts};
use super::over_all::literal_cases;
use super::separation::separations;
use super::timeline::{FluentChange, Reading, Timeline};
use super::{
    BadCase, Difference, Obligation, Obligations, OverAll, Refusal, Requirement, Substitution,
};
use crate::linear::Linear;
use crate::parameter::{ParameterKind, ParametrizedPlan};
use crate::stn_plan::{InstanceId, Node, NodeId};

/// How many combinations of outcomes of conditional effects are followed.
const MOST_RUNS: usize = 256;

impl Obligations {
    /// All obligations of a plan.
    ///
    /// `nominal` gives each node its time in some schedule at the nominal parameter values;
    /// `substitution` the parameters that are differences of times.
    ///
    /// # Errors
    /// When something in the plan is beyond exact linear reasoning; the message names it.
    pub(crate) fn compile(
        task: &Task,
        plan: &ParametrizedPlan,
        epsilon: &Rational,
        nominal: &[Rational],
        substitution: &Substitution,
    ) -> Result<Self, Refusal> {
        let mut order: Vec<NodeId> = plan.plan.nodes().map(|(id, _)| id).collect();
        order.sort_by(|a, b| nominal[a.index()].cmp(&nominal[b.index()]).then(a.cmp(b)));
        let mut obligations = Self {
            direct: separations(task, &plan.plan, &order, epsilon),
            over_all: Vec::new(),
        };
        let substitution = Rc::new(substitution.clone());
        let compiler = Compiler {
            task,
            plan,
            order,
            substitution,
        };
        let mut runs = vec![Run {
            position: 0,
            timeline: Timeline::initial(task, plan, &compiler.substitution),
            outcomes: BTreeMap::new(),
        }];
        let mut finished = 0;
        while let Some(run) = runs.pop() {
            match compiler.follow(run, &mut obligations)? {
                Progress::Finished => finished += 1,
                Progress::Split(more) => runs.extend(more),
            }
            if finished + runs.len() > MOST_RUNS {
                return Err(Refusal::TooManyCases {
                    place: "conditional effects".to_owned(),
                    limit: MOST_RUNS,
                });
            }
        }
        Ok(obligations)
    }
}

/// Which part of which effect's guard: effects of the start come before those of the end, and
/// those before continuous ones.
type GuardId = (InstanceId, usize, GuardPart);

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum GuardPart {
    AtStart,
    Now,
}

/// One combination of outcomes of conditional effects, followed up to a position.
#[derive(Clone)]
struct Run {
    position: usize,
    timeline: Timeline,
    outcomes: BTreeMap<GuardId, bool>,
}

enum Progress {
    Finished,
    /// An outcome depends on times or parameters: one run for each alternative.
    Split(Vec<Run>),
}

struct Compiler<'a> {
    task: &'a Task,
    plan: &'a ParametrizedPlan,
    /// All nodes in nominal order.
    order: Vec<NodeId>,
    substitution: Rc<Substitution>,
}

impl Compiler<'_> {
    fn follow(&self, mut run: Run, obligations: &mut Obligations) -> Result<Progress, Refusal> {
        while let Some(&node) = self.order.get(run.position) {
            if let Some(split) = self.decide_guards(&mut run, node, obligations)? {
                return Ok(Progress::Split(split));
            }
            self.happen(&mut run, node, obligations)?;
            run.position += 1;
        }
        self.finish(run, obligations)?;
        Ok(Progress::Finished)
    }

    /// Settles every guard that is read at the node; `Some` if one can turn out either way.
    fn decide_guards(
        &self,
        run: &mut Run,
        node: NodeId,
        obligations: &mut Obligations,
    ) -> Result<Option<Vec<Run>>, Refusal> {
        for (id, guard) in self.guards_read_at(node)? {
            if run.outcomes.contains_key(&id) {
                continue;
            }
            let (instance, index, _) = id;
            if run.outcomes.get(&(instance, index, GuardPart::AtStart)) == Some(&false) {
                // The effect will not come about, whatever else its guard says.
                run.outcomes.insert(id, false);
                continue;
            }
            let reading = self.reading(&run.timeline, node);
            let held = reading.alternatives(guard, Wanted::True)?;
            let broken = reading.alternatives(guard, Wanted::False)?;
            let silent = reading.silent(guard)?;
            oblige(
                obligations,
                Requirement::Defined { node },
                &run.timeline,
                silent,
            );
            if broken.is_empty() {
                run.outcomes.insert(id, true);
            } else if held.is_empty() {
                run.outcomes.insert(id, false);
            } else {
                let branch = |outcome: bool, alternatives: Alternatives| {
                    alternatives
                        .into_iter()
                        .map(|assumed| {
                            let mut branch = run.clone();
                            branch.outcomes.insert(id, outcome);
                            branch.timeline.assumptions.extend(assumed);
                            branch
                        })
                        .collect::<Vec<_>>()
                };
                return Ok(Some([branch(true, held), branch(false, broken)].concat()));
            }
        }
        Ok(None)
    }

    /// The non-trivial guards read on arrival at a node.
    fn guards_read_at(&self, node: NodeId) -> Result<Vec<(GuardId, &Condition)>, Refusal> {
        let (instance, is_end) = match self.plan.plan.nodes[node.index()] {
            Node::Zero | Node::Timed(_) => return Ok(Vec::new()),
            Node::Start(id) | Node::Instant(id) => (id, false),
            Node::End(id) => (id, true),
        };
        let action = &self.plan.plan.instance(instance).action;
        let mut guards = Vec::new();
        let mut read = |index: usize, part: GuardPart, condition| {
            guards.push(((instance, index, part), condition));
        };
        match &action.body {
            Body::Instantaneous(snap) => {
                for (index, effect) in snap.effects.iter().enumerate() {
                    read(index, GuardPart::Now, &effect.guard.now);
                }
            }
            Body::Durative(body) => {
                let ends = body.start.effects.len();
                let continuous = ends + body.end.effects.len();
                let over_all = body.end.effects.iter().map(|effect| &effect.guard);
                let over_all = over_all.chain(body.continuous.iter().map(|effect| &effect.guard));
                if over_all
                    .into_iter()
                    .any(|guard| !guard.over_all.is_trivial())
                {
                    return Err(Refusal::GuardOverAll {
                        place: action.name.clone(),
                    });
                }
                if is_end {
                    for (index, effect) in body.end.effects.iter().enumerate() {
                        read(ends + index, GuardPart::Now, &effect.guard.now);
                    }
                } else {
                    for (index, effect) in body.start.effects.iter().enumerate() {
                        read(index, GuardPart::Now, &effect.guard.now);
                    }
                    for (index, effect) in body.end.effects.iter().enumerate() {
                        read(ends + index, GuardPart::AtStart, &effect.guard.at_start);
                    }
                    for (index, effect) in body.continuous.iter().enumerate() {
                        read(
                            continuous + index,
                            GuardPart::AtStart,
                            &effect.guard.at_start,
                        );
                    }
                }
            }
        }
        guards.retain(|(_, condition)| !condition.is_trivial());
        Ok(guards)
    }

    /// What the happening at a node requires and changes.
    fn happen(
        &self,
        run: &mut Run,
        node: NodeId,
        obligations: &mut Obligations,
    ) -> Result<(), Refusal> {
        match self.plan.plan.nodes[node.index()] {
            Node::Zero => Ok(()),
            Node::Timed(index) => {
                let effects = self.task.timed()[index]
                    .changes
                    .iter()
                    .map(|change| (change, true));
                self.apply(run, node, effects, obligations)
            }
            Node::Instant(id) | Node::Start(id) => {
                let action = &self.plan.plan.instance(id).action;
                let snap = match &action.body {
                    Body::Instantaneous(snap) => snap,
                    Body::Durative(body) => {
                        self.require_duration(run, node, id, false, obligations)?;
                        &body.start
                    }
                };
                self.require(run, node, snap, obligations)?;
                let effects = effects(run, id, 0, &snap.effects);
                let drifts = self.drifts(run, node, id)?;
                self.apply(run, node, effects.into_iter(), obligations)?;
                for (fluent, rate) in drifts {
                    let value = self
                        .reading(&run.timeline, node)
                        .linear(&Expression::Fluent(fluent))?;
                    if value.is_none() || rate.is_none() {
                        self.never_takes_time(run, node, id, obligations);
                    }
                    let rate = rate.unwrap_or_default();
                    run.timeline.change(node, fluent, FluentChange::Drift(rate));
                }
                Ok(())
            }
            Node::End(id) => {
                let Body::Durative(body) = &self.plan.plan.instance(id).action.body else {
                    return Ok(());
                };
                self.require_duration(run, node, id, true, obligations)?;
                self.require(run, node, &body.end, obligations)?;
                let effects = effects(run, id, body.start.effects.len(), &body.end.effects);
                let since = self.plan.plan.start(id);
                let first = body.start.effects.len() + body.end.effects.len();
                // Values on arrival include the drift up to now, so it ends after the effects are
                // read; increases commute with it, assignments begin from zero drift either way.
                let read = self.read_changes(run, node, effects.into_iter(), obligations)?;
                for (index, effect) in body.continuous.iter().enumerate() {
                    if run.outcomes.get(&(id, first + index, GuardPart::AtStart)) != Some(&false) {
                        run.timeline
                            .change(node, effect.fluent, FluentChange::DriftEnd(since));
                    }
                }
                record(run, node, read);
                Ok(())
            }
        }
    }

    /// The continuous changes that begin at the start of an instance, with their rates; `None` is
    /// an undefined one.
    fn drifts(
        &self,
        run: &Run,
        node: NodeId,
        instance: InstanceId,
    ) -> Result<Vec<(FluentId, Option<Linear>)>, Refusal> {
        let action = &self.plan.plan.instance(instance).action;
        let Some(body) = action.durative() else {
            return Ok(Vec::new());
        };
        let first = body.start.effects.len() + body.end.effects.len();
        let mut drifts = Vec::new();
        for (index, effect) in body.continuous.iter().enumerate() {
            if run
                .outcomes
                .get(&(instance, first + index, GuardPart::AtStart))
                == Some(&false)
            {
                continue;
            }
            let changing = || Refusal::ChangingRate {
                place: action.name.clone(),
                fluent: self.task.fluent_name(effect.fluent),
            };
            if self.changes_later(&effect.rate, node) {
                return Err(changing());
            }
            let rate = self.reading(&run.timeline, node).linear(&effect.rate)?;
            let is_linear = |rate: &Linear| rate.times.is_empty() && rate.products.is_empty();
            if !rate.as_ref().is_none_or(is_linear) {
                return Err(Refusal::NotLinear {
                    place: action.name.clone(),
                    expression: self.task.describe_expression(&effect.rate),
                });
            }
            drifts.push((effect.fluent, rate));
        }
        Ok(drifts)
    }

    /// Whether anything from the node on may change what the expression reads.
    fn changes_later(&self, expression: &Expression, node: NodeId) -> bool {
        let mut read = Vec::new();
        expression.visit_fluents(&mut |fluent| read.push(fluent));
        if read.is_empty() {
            return false;
        }
        self.order
            .iter()
            .skip_while(|&&other| other != node)
            .any(|&later| {
                let footprint = self.plan.plan.footprint(self.task, later);
                read.iter().any(|fluent| {
                    footprint.shifts.contains(fluent) || footprint.assigns.contains(fluent)
                })
            })
    }

    fn apply<'e>(
        &self,
        run: &mut Run,
        node: NodeId,
        effects: impl Iterator<Item = (&'e Change, bool)>,
        obligations: &mut Obligations,
    ) -> Result<(), Refusal> {
        let read = self.read_changes(run, node, effects, obligations)?;
        record(run, node, read);
        Ok(())
    }

    /// The changes that come about, with right-hand sides read on arrival; deletions first, so
    /// that an addition by the same happening wins.
    fn read_changes<'e>(
        &self,
        run: &Run,
        node: NodeId,
        effects: impl Iterator<Item = (&'e Change, bool)>,
        obligations: &mut Obligations,
    ) -> Result<Vec<Recorded>, Refusal> {
        let (mut recorded, mut additions) = (Vec::new(), Vec::new());
        let mut updates: BTreeMap<FluentId, Vec<UpdateOperator>> = BTreeMap::new();
        for (change, _) in effects.filter(|&(_, happens)| happens) {
            match change {
                Change::Add(fact) => additions.push(Recorded::Fact(*fact, true)),
                Change::Delete(fact) => recorded.push(Recorded::Fact(*fact, false)),
                Change::Update {
                    operator,
                    fluent,
                    value,
                } => {
                    updates.entry(*fluent).or_default().push(*operator);
                    let reading = self.reading(&run.timeline, node);
                    let value = reading.linear(value)?;
                    let old = reading.linear(&Expression::Fluent(*fluent))?;
                    let new = updated(&reading, *operator, old, value)?;
                    if new.is_none() {
                        // An effect without a value breaks the plan, whatever the times are.
                        obligations.direct.push(Obligation {
                            requirement: Requirement::Defined { node },
                            bad_cases: vec![BadCase {
                                differences: Vec::new(),
                                inequalities: run.timeline.assumptions.clone(),
                            }],
                        });
                    }
                    recorded.push(Recorded::Fluent(
                        *fluent,
                        new.unwrap_or(FluentChange::Assign(None)),
                    ));
                }
            }
        }
        self.forbid_conflicts(run, node, &updates, obligations);
        recorded.append(&mut additions);
        Ok(recorded)
    }

    /// Several updates of one fluent by one happening must all be increases and decreases. Timed
    /// initials that come after the plan's last action do not count.
    fn forbid_conflicts(
        &self,
        run: &Run,
        node: NodeId,
        updates: &BTreeMap<FluentId, Vec<UpdateOperator>>,
        obligations: &mut Obligations,
    ) {
        for (&fluent, operators) in updates {
            if operators.len() == 1 || operators.iter().all(|operator| operator.is_additive()) {
                continue;
            }
            let when = match self.plan.plan.nodes[node.index()] {
                Node::Timed(_) => lasts(&self.plan.plan)
                    .into_iter()
                    .map(|last| vec![Difference::not_after(node, last)])
                    .collect(),
                _ => vec![Vec::new()],
            };
            let bad_cases = when.into_iter().map(|differences| BadCase {
                differences,
                inequalities: run.timeline.assumptions.clone(),
            });
            obligations.direct.push(Obligation {
                requirement: Requirement::OneUpdate { node, fluent },
                bad_cases: bad_cases.collect(),
            });
        }
    }

    /// A continuous change without a value or a rate breaks the plan, unless its action takes no
    /// time.
    fn never_takes_time(
        &self,
        run: &Run,
        node: NodeId,
        instance: InstanceId,
        obligations: &mut Obligations,
    ) {
        let (start, end) = (self.plan.plan.start(instance), self.plan.plan.end(instance));
        obligations.direct.push(Obligation {
            requirement: Requirement::Defined { node },
            bad_cases: vec![BadCase {
                differences: vec![Difference::before(start, end)],
                inequalities: run.timeline.assumptions.clone(),
            }],
        });
    }

    /// The conditions of a happening.
    fn require(
        &self,
        run: &Run,
        node: NodeId,
        snap: &SnapAction,
        obligations: &mut Obligations,
    ) -> Result<(), Refusal> {
        for condition in snap.condition.conjuncts() {
            let broken = self
                .reading(&run.timeline, node)
                .alternatives(condition, Wanted::NotTrue)?;
            let requirement = Requirement::Condition {
                node,
                condition: condition.clone(),
            };
            oblige(obligations, requirement, &run.timeline, broken);
        }
        Ok(())
    }

    /// The duration constraints read at the start or at the end.
    fn require_duration(
        &self,
        run: &Run,
        node: NodeId,
        instance: InstanceId,
        at_end: bool,
        obligations: &mut Obligations,
    ) -> Result<(), Refusal> {
        let Some(body) = self.plan.plan.instance(instance).action.durative() else {
            return Ok(());
        };
        let (start, end) = (self.plan.plan.start(instance), self.plan.plan.end(instance));
        let duration = Linear::difference(start, end);
        if !at_end {
            obligations.direct.push(Obligation {
                requirement: Requirement::Duration {
                    instance,
                    constraint: None,
                },
                bad_cases: vec![BadCase {
                    differences: vec![Difference::before(end, start)],
                    inequalities: run.timeline.assumptions.clone(),
                }],
            });
        }
        let is_open = self
            .plan
            .parameters
            .iter()
            .any(|parameter| parameter.kind == ParameterKind::Duration(instance));
        if is_open {
            return Ok(());
        }
        for (index, constraint) in body.duration.iter().enumerate() {
            if constraint.at_end != at_end {
                continue;
            }
            let bound = self
                .reading(&run.timeline, node)
                .linear(&constraint.bound)?;
            let broken = match bound {
                Some(bound) => compared(constraint.comparison, &duration, &bound, false),
                None => vec![Vec::new()],
            };
            let requirement = Requirement::Duration {
                instance,
                constraint: Some(index),
            };
            oblige(obligations, requirement, &run.timeline, broken);
        }
        Ok(())
    }

    /// What can be said only when the whole timeline is known: over-all conditions and goal.
    fn finish(&self, run: Run, obligations: &mut Obligations) -> Result<(), Refusal> {
        let timeline = Rc::new(run.timeline);
        let plan = &self.plan.plan;
        for (index, instance) in plan.instances.iter().enumerate() {
            let id = InstanceId::from(index);
            let Some(body) = instance.action.durative() else {
                continue;
            };
            for condition in body.over_all.conjuncts() {
                let (start, end) = (plan.start(id), plan.end(id));
                let literal = match condition {
                    Condition::Fact(fact) => Some((*fact, true)),
                    Condition::Not(part) => match &**part {
                        Condition::Fact(fact) => Some((*fact, false)),
                        _ => None,
                    },
                    _ => None,
                };
                match literal {
                    Some((fact, wanted)) if !self.task.is_derived(fact) => {
                        obligations.direct.push(Obligation {
                            requirement: Requirement::OverAll {
                                instance: id,
                                condition: condition.clone(),
                            },
                            bad_cases: literal_cases(&timeline, fact, wanted, start, end),
                        });
                    }
                    _ => obligations.over_all.push(OverAll::new(
                        self.task,
                        plan,
                        id,
                        condition,
                        &self.order,
                        &timeline,
                        &self.substitution,
                    )),
                }
            }
        }
        for condition in self.plan.goal.conjuncts() {
            let bad_cases = goal_cases(self.task, plan, &timeline, &self.substitution, condition)?;
            let requirement = Requirement::Goal {
                condition: condition.clone(),
            };
            obligations.direct.push(Obligation {
                requirement,
                bad_cases,
            });
        }
        Ok(())
    }

    /// Reading everything recorded so far, at a node.
    fn reading<'r>(&'r self, timeline: &'r Timeline, node: NodeId) -> Reading<'r> {
        let plan = &self.plan.plan;
        let (action, place) = match plan.nodes[node.index()] {
            Node::Start(id) | Node::End(id) => (
                Some((plan.start(id), plan.end(id))),
                plan.instance(id).action.name.as_str(),
            ),
            Node::Instant(id) => (None, plan.instance(id).action.name.as_str()),
            Node::Zero | Node::Timed(_) => (None, "timed initials"),
        };
        Reading {
            task: self.task,
            timeline,
            cut: &|_| true,
            moment: node,
            action,
            substitution: &self.substitution,
            place,
            derived: OnceCell::new(),
        }
    }
}

/// The changes of effects, with whether their guards hold in this run.
fn effects<'e>(
    run: &Run,
    instance: InstanceId,
    first: usize,
    effects: &'e [Effect],
) -> Vec<(&'e Change, bool)> {
    effects
        .iter()
        .enumerate()
        .map(|(index, effect)| {
            let held = |part| run.outcomes.get(&(instance, first + index, part)) != Some(&false);
            (
                &effect.change,
                held(GuardPart::Now) && held(GuardPart::AtStart),
            )
        })
        .collect()
}

/// A change read, not yet recorded.
enum Recorded {
    Fact(FactId, bool),
    Fluent(FluentId, FluentChange),
}

fn record(run: &mut Run, node: NodeId, changes: Vec<Recorded>) {
    for change in changes {
        match change {
            Recorded::Fact(fact, becomes) => run.timeline.set(node, fact, becomes),
            Recorded::Fluent(fluent, change) => run.timeline.change(node, fluent, change),
        }
    }
}

/// What an update does to a fluent; `None` if a number it needs is undefined.
fn updated(
    reading: &Reading<'_>,
    operator: UpdateOperator,
    old: Option<Linear>,
    value: Option<Linear>,
) -> Result<Option<FluentChange>, Refusal> {
    let Some(value) = value else { return Ok(None) };
    if operator == UpdateOperator::Assign {
        return Ok(Some(FluentChange::Assign(Some(value))));
    }
    let Some(old) = old else { return Ok(None) };
    let not_linear = || Refusal::NotLinear {
        place: reading.place.to_owned(),
        expression: format!("a {} effect", operator.name()),
    };
    Ok(Some(match operator {
        UpdateOperator::Assign => FluentChange::Assign(Some(value)),
        UpdateOperator::Increase => FluentChange::Shift(value),
        UpdateOperator::Decrease => FluentChange::Shift(value.scaled(&Rational::from(-1))),
        UpdateOperator::ScaleUp => {
            FluentChange::Assign(Some(old.times(&value).ok_or_else(not_linear)?))
        }
        UpdateOperator::ScaleDown => {
            let divisor = value.as_constant().ok_or_else(not_linear)?;
            let Some(factor) = divisor.reciprocal() else {
                return Ok(None);
            };
            FluentChange::Assign(Some(old.scaled(&factor)))
        }
    }))
}

/// Adds an obligation unless it cannot be violated.
fn oblige(
    obligations: &mut Obligations,
    requirement: Requirement,
    timeline: &Timeline,
    broken: Alternatives,
) {
    if broken.is_empty() {
        return;
    }
    let bad_cases = broken
        .into_iter()
        .map(|inequalities| BadCase {
            differences: Vec::new(),
            inequalities: [&timeline.assumptions[..], &inequalities].concat(),
        })
        .collect();
    obligations.direct.push(Obligation {
        requirement,
        bad_cases,
    });
}
