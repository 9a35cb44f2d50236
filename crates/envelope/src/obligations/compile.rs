//! Symbolic execution of a plan.

mod autonomous;
mod changes;
mod guards;

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{Body, Condition, Expression, SnapAction};

use autonomous::{AutonomousModel, Occurrence};
use changes::record;
use guards::{GuardId, GuardPart, effects};

use super::dnf::{Alternatives, WantedTruth, compared};
use super::goal::goal_cases;
use super::over_all::{Happenings, literal_cases};
use super::precedence::Precedence;
use super::separation::separations;
use super::timeline::{FluentChange, Reading, Timeline};
use super::{
    BadCase, Difference, Obligation, Obligations, OverAll, Refusal, Requirement, Substitution,
    ensure_not_stopped,
};
use crate::linear::Linear;
use elbowroom_plan::{
    InstanceId, Node, NodeId, ParameterKind, ParametrizedPlan, Schedule, Valuation,
};

/// Limit on combinations of outcomes of conditional effects.
const MAX_RUNS: usize = 256;

impl Obligations {
    /// Compiles all obligations of a plan.
    ///
    /// `nominal` gives each node its time in some schedule at the values `around`; `substitution`
    /// contains the parameters that are differences of times.
    ///
    /// # Errors
    /// If something in the plan is beyond exact linear reasoning; the message names it.
    pub fn compile(
        task: &Task,
        plan: &ParametrizedPlan,
        (nominal, around): (&Schedule, &Valuation),
        substitution: &Substitution,
    ) -> Result<Self, Refusal> {
        let mut order: Vec<NodeId> = plan.plan.nodes().map(|(id, _)| id).collect();
        order.sort_by(|a, b| nominal[*a].cmp(&nominal[*b]).then(a.cmp(b)));
        let mut obligations = Self {
            direct: separations(task, &plan.plan, &order),
            over_all: Vec::new(),
        };
        let substitution = Arc::new(substitution.clone());
        let open = plan.parameters.iter().filter_map(|it| match it.kind {
            ParameterKind::Duration(instance) => Some(instance),
            _ => None,
        });
        let compiler = Compiler {
            task,
            plan,
            nominal,
            order,
            open: open.collect(),
            substitution,
            autonomous: AutonomousModel::collect(task, plan, (nominal, around))?,
        };
        let mut runs = vec![Run {
            position: 0,
            timeline: Timeline::initial(task, plan, &compiler.substitution),
            outcomes: BTreeMap::new(),
            occurred: Vec::new(),
        }];
        let mut finished = 0;
        while let Some(run) = runs.pop() {
            match compiler.simulate(run, &mut obligations)? {
                Progress::Finished => finished += 1,
                Progress::Split(more) => runs.extend(more),
            }
            if finished + runs.len() > MAX_RUNS {
                return Err(Refusal::TooManyCases {
                    place: "conditional effects".to_owned(),
                    limit: MAX_RUNS,
                });
            }
        }
        // The obligations live as long as the plan.
        obligations.direct.shrink_to_fit();
        obligations.over_all.shrink_to_fit();
        Ok(obligations)
    }
}

/// One combination of outcomes of conditional effects, executed up to a position.
#[derive(Clone)]
struct Run {
    position: usize,
    timeline: Timeline,
    outcomes: BTreeMap<GuardId, bool>,
    /// The events that have happened.
    occurred: Vec<Occurrence>,
}

enum Progress {
    Finished,
    /// An outcome depends on times or parameters: one run for each alternative.
    Split(Vec<Run>),
}

struct Compiler<'a> {
    task: &'a Task,
    plan: &'a ParametrizedPlan,
    nominal: &'a Schedule,
    /// All nodes in nominal order.
    order: Vec<NodeId>,
    /// The actions whose durations are open.
    open: BTreeSet<InstanceId>,
    substitution: Arc<Substitution>,
    /// Processes, events and constraints on all states, if there are any.
    autonomous: Option<AutonomousModel>,
}

impl Compiler<'_> {
    fn simulate(&self, mut run: Run, obligations: &mut Obligations) -> Result<Progress, Refusal> {
        while let Some(&node) = self.order.get(run.position) {
            ensure_not_stopped()?;
            if let Some(split) = self.decide_guards(&mut run, node, obligations)? {
                if self.autonomous.is_some() {
                    return Err(self.guard_depends(node));
                }
                return Ok(Progress::Split(split));
            }
            self.apply_happening(&mut run, node, obligations)?;
            if let Some(autonomous) = &self.autonomous {
                self.advance(autonomous, &mut run, obligations)?;
            }
            run.position += 1;
        }
        self.finish(run, obligations)?;
        Ok(Progress::Finished)
    }

    /// Adds the requirements of the happening at a node, and applies its changes.
    fn apply_happening(
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
                // read. Increases commute with it, and assignments begin from zero drift in either
                // case.
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

    /// Adds the conditions of a happening.
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
                .alternatives(condition, WantedTruth::NotTrue)?;
            let requirement = Requirement::Condition {
                node,
                condition: condition.clone(),
            };
            add_obligation(obligations, requirement, &run.timeline, broken);
        }
        Ok(())
    }

    /// Adds the duration constraints read at the start or at the end.
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
        if self.open.contains(&instance) {
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
            add_obligation(obligations, requirement, &run.timeline, broken);
        }
        Ok(())
    }

    /// Adds the obligations that need the whole timeline: over-all conditions and goal.
    fn finish(&self, run: Run, obligations: &mut Obligations) -> Result<(), Refusal> {
        let plan = &self.plan.plan;
        let all = Arc::new(Happenings {
            timeline: run.timeline,
            precedence: Precedence::of(self.plan, &self.order, self.nominal),
            substitution: Arc::clone(&self.substitution),
        });
        let timeline = &all.timeline;
        for (index, instance) in plan.instances.iter().enumerate() {
            let id = InstanceId::from(index);
            let Some(body) = instance.action.durative() else {
                continue;
            };
            for condition in body.over_all.conjuncts() {
                // Conditions that depend on processes or events were compiled during the symbolic
                // run.
                if self
                    .autonomous
                    .as_ref()
                    .is_some_and(|autonomous| autonomous.changes(self.task, condition))
                {
                    continue;
                }
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
                            bad_cases: literal_cases(timeline, fact, wanted, start, end),
                        });
                    }
                    _ => obligations
                        .over_all
                        .push(OverAll::new(self.task, plan, id, condition, &all)),
                }
            }
        }
        for condition in self.plan.goal.conjuncts() {
            let bad_cases = goal_cases(self.task, timeline, &self.substitution, condition)?;
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

    /// Returns the context for evaluation at a node, after everything recorded so far.
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
            cut: None,
            moment: node,
            action,
            substitution: &self.substitution,
            location: place,
            derived: OnceCell::new(),
        }
    }
}

/// Adds an obligation unless it cannot be violated.
fn add_obligation(
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
