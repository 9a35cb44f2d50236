//! Processes and events: the symbolic run between two happenings of the plan.
//!
//! The *transitions* are the events, and the starts and stops of processes. Let the order of the
//! plan's happenings and of the transitions be fixed. Then the time of each transition is a linear
//! expression in the times before it, because a number that changes at a constant rate reaches its
//! threshold after a linear delay. The run follows the transitions at the nominal values, and
//! requires the same sequence in every schedule: in each part between two transitions, no event's
//! condition becomes true, and processes stay active or inactive. All numbers are linear in time
//! within a part, so conditions throughout it are decided at its two ends.
//!
//! The requirement is sufficient, but not necessary: a plan may also work with another sequence.

mod condition;
mod phase;

use std::collections::BTreeSet;

use elbowroom_model::ground::{Change, Condition, FactId, FluentId};
use elbowroom_model::{Footprint, Modal, Task};
use elbowroom_plan::{Node, NodeId, ParametrizedPlan, Schedule, Valuation};

use super::{Compiler, Run};
use crate::linear::Linear;
use crate::obligations::timeline::FluentChange;
use crate::obligations::{
    BadCase, Difference, Inequality, Obligation, Obligations, Refusal, Requirement,
};
use phase::Phase;

/// Behaviour of the world without the plan, as far as it is the same for the whole run.
pub(super) struct AutonomousModel {
    /// Footprint of each event.
    footprints: Vec<Footprint>,
    /// Conditions that must hold in every state.
    state_constraints: Vec<Condition>,
    /// The facts that events change.
    facts: BTreeSet<FactId>,
    /// The fluents that processes and events change.
    fluents: BTreeSet<FluentId>,
    /// The nominal schedule, whose course is followed.
    times: Schedule,
    /// The nominal values of the parameters.
    values: Valuation,
}

/// Event that has happened.
#[derive(Clone)]
pub(super) struct Occurrence {
    event: usize,
    /// The happening before it.
    after: NodeId,
    at: Linear,
}

impl AutonomousModel {
    /// Collects the behaviour; `None` if there are no processes, events or constraints on all
    /// states.
    pub(super) fn collect(
        task: &Task,
        plan: &ParametrizedPlan,
        (times, values): (&Schedule, &Valuation),
    ) -> Result<Option<Self>, Refusal> {
        let autonomous = task.autonomous();
        if autonomous.is_empty() {
            return Ok(None);
        }
        let constraints = task.constraints();
        let mut always = Vec::new();
        for constraint in &constraints.hard {
            match constraint {
                Modal::Always(condition) if !constraints.depends_on_unknown_past() => {
                    always.push(condition.clone());
                }
                _ => {
                    return Err(Refusal::Autonomous {
                        place: task.describe_modal(constraint),
                        obstacle: "together with processes and events, `always` is the only \
                                   supported trajectory constraint"
                            .to_owned(),
                    });
                }
            }
        }
        let events = autonomous.events.iter();
        let footprints: Vec<_> = events
            .map(|event| Footprint::of_snap(task, &event.snap))
            .collect();
        let mut model = Self {
            footprints,
            state_constraints: always,
            facts: BTreeSet::new(),
            fluents: BTreeSet::new(),
            times: times.clone(),
            values: values.clone(),
        };
        for effect in autonomous
            .events
            .iter()
            .flat_map(|event| &event.snap.effects)
        {
            match &effect.change {
                Change::Add(fact) | Change::Delete(fact) => model.facts.insert(*fact),
                Change::Update { fluent, .. } => model.fluents.insert(*fluent),
            };
        }
        let processes = autonomous.processes.iter();
        let effects = processes.flat_map(|process| &process.effects);
        model.fluents.extend(effects.map(|effect| effect.fluent));
        model.refuse_changing_rates(task, plan)?;
        Ok(Some(model))
    }

    /// Refuses rates of actions that processes or events change, because they are read at the start
    /// of the action.
    fn refuse_changing_rates(&self, task: &Task, plan: &ParametrizedPlan) -> Result<(), Refusal> {
        for instance in &plan.plan.instances {
            let Some(body) = instance.action.durative() else {
                continue;
            };
            for effect in &body.continuous {
                let mut is_changed = false;
                effect
                    .rate
                    .visit_fluents(&mut |fluent| is_changed |= self.fluents.contains(&fluent));
                if is_changed {
                    return Err(Refusal::ChangingRate {
                        place: instance.action.name.clone(),
                        fluent: task.fluent_name(effect.fluent),
                    });
                }
            }
        }
        Ok(())
    }

    /// Returns `true` if a condition reads facts or fluents that processes and events change.
    pub(super) fn changes(&self, task: &Task, condition: &Condition) -> bool {
        let mut reads = false;
        task.visit_facts_of(condition, &mut |fact| reads |= self.facts.contains(&fact));
        task.visit_fluents_of(condition, &mut |fluent| {
            reads |= self.fluents.contains(&fluent);
        });
        reads
    }
}

impl Compiler<'_> {
    /// Runs processes and events from a happening to the next one.
    pub(super) fn advance(
        &self,
        autonomous: &AutonomousModel,
        run: &mut Run,
        obligations: &mut Obligations,
    ) -> Result<(), Refusal> {
        let node = self.order[run.position];
        let next = self.order.get(run.position + 1).copied();
        self.separate_from_events(autonomous, run, node, obligations);
        let mut course = Phase::starting_after((self, autonomous), run, (node, next), obligations);
        if node == NodeId::ZERO {
            // The initial state must be stable as well.
            course.require_final_conditions()?;
        }
        course.execute_current_events()?;
        match next {
            Some(next) => course.advance_to(next)?,
            None => course.require_final_conditions()?,
        }
        let course = course.end();
        let at = next.unwrap_or(node);
        for (fact, truth) in course.facts {
            run.timeline.set(at, fact, truth);
        }
        for (fluent, value) in course.values {
            run.timeline.change(at, fluent, FluentChange::Assign(value));
        }
        run.occurred.extend(course.occurred);
        Ok(())
    }

    /// Adds the obligation that a happening of the plan is ε away from earlier events that it
    /// interferes with.
    fn separate_from_events(
        &self,
        autonomous: &AutonomousModel,
        run: &Run,
        node: NodeId,
        obligations: &mut Obligations,
    ) {
        if matches!(
            self.plan.plan.nodes[node.index()],
            Node::Zero | Node::Timed(_)
        ) {
            return;
        }
        let own = self.plan.plan.footprint(self.task, node);
        for Occurrence { event, after, at } in &run.occurred {
            if !autonomous.footprints[*event].interferes_with(&own) {
                continue;
            }
            // Violated if the distance minus ε is negative.
            let mut distance = Linear::difference(NodeId::ZERO, node).minus(at);
            distance.constant -= self.task.epsilon();
            let name = &self.task.autonomous().events[*event].name;
            let words = self.plan.plan.describe_node(self.task, node);
            let requirement = Requirement::Autonomous {
                after: *after,
                course: format!("the event {name} must come before {words}, by at least ε"),
            };
            let broken = Inequality {
                expression: distance,
                is_strict: true,
            };
            add_autonomous_obligation(
                obligations,
                requirement,
                &run.timeline.assumptions,
                vec![vec![broken]],
            );
        }
    }

    /// Returns the error for conditional effects with open outcomes, which are not supported
    /// together with processes and events.
    pub(super) fn guard_depends(&self, node: NodeId) -> Refusal {
        Refusal::Autonomous {
            place: self.plan.plan.describe_node(self.task, node),
            obstacle: "a conditional effect, on which processes and events depend, may or may not \
                       occur, depending on times or parameters"
                .to_owned(),
        }
    }
}

/// Adds an obligation, unless it cannot be violated. Differences of two times are stored as such.
fn add_autonomous_obligation(
    obligations: &mut Obligations,
    requirement: Requirement,
    assumptions: &[Inequality],
    broken: Vec<Vec<Inequality>>,
) {
    let mut bad_cases = Vec::new();
    for case in broken
        .into_iter()
        .filter_map(crate::obligations::dnf::drop_constants)
    {
        let mut bad = BadCase {
            differences: Vec::new(),
            inequalities: assumptions.to_vec(),
        };
        for inequality in case {
            match as_difference(&inequality) {
                Some(difference) => bad.differences.push(difference),
                None => bad.inequalities.push(inequality),
            }
        }
        bad_cases.push(bad);
    }
    // Numbers often do not change, so that the same requirement occurs again.
    let is_known = |known: &Obligation| {
        matches!(known.requirement, Requirement::Autonomous { .. }) && known.bad_cases == bad_cases
    };
    if !bad_cases.is_empty() && !obligations.direct.iter().any(is_known) {
        obligations.direct.push(Obligation {
            requirement,
            bad_cases,
        });
    }
}

/// Converts `to - from + constant <= 0` to a bound on a difference.
fn as_difference(inequality: &Inequality) -> Option<Difference> {
    let Linear {
        constant,
        times,
        parameters,
        products,
    } = &inequality.expression;
    if !parameters.is_empty() || !products.is_empty() {
        return None;
    }
    let one = elbowroom_num::Rational::ONE;
    let with = |sign: &elbowroom_num::Rational| {
        let mut nodes = times.iter().filter(|(_, factor)| factor == sign);
        let node = nodes.next().map_or(NodeId::ZERO, |(node, _)| *node);
        nodes.next().is_none().then_some(node)
    };
    let minus = -&one;
    if times
        .iter()
        .any(|(_, factor)| *factor != one && *factor != minus)
    {
        return None;
    }
    Some(Difference {
        from: with(&minus)?,
        to: with(&one)?,
        bound: -constant,
        is_strict: inequality.is_strict,
    })
}
