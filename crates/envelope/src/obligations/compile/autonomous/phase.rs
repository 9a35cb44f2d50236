//! The course from one happening of the plan to the next one.

mod active_processes;
mod events;
mod invariants;
mod next_event;
mod segment;

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::autonomous::{Autonomous, GroundEvent};
use elbowroom_model::ground::{Condition, Expression, FactId, FluentId};
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, NodeId};

use super::super::{Compiler, Run};
use super::condition::{ReadTime, StateView};
use super::{AutonomousModel, Occurrence, add_autonomous_obligation};
use crate::linear::Linear;
use crate::obligations::dnf::{Alternatives, WantedTruth};
use crate::obligations::timeline::{Reading, Timeline};
use crate::obligations::{Inequality, Obligations, Refusal, Requirement};
use segment::Segment;

/// Limit on the transitions (events, starts and stops of processes) between two happenings of the
/// plan.
const MAX_TRANSITIONS: usize = 200;

/// Symbolic state at a moment, and the changes since the previous happening.
pub(super) struct Phase<'a> {
    compiler: &'a Compiler<'a>,
    autonomous: &'a AutonomousModel,
    node: NodeId,
    next: Option<NodeId>,
    /// Running actions, each with its over-all conditions that processes or events may violate. The
    /// entry without an action holds the conditions on all states.
    running: Vec<(Option<InstanceId>, Vec<&'a Condition>)>,
    /// The continuous changes of the running actions.
    drifts: Vec<(FluentId, Linear)>,
    /// Facts and values now.
    now: Timeline,
    at: Linear,
    rates: BTreeMap<FluentId, Linear>,
    /// For each process, `true` if it is active.
    is_active: Vec<bool>,
    /// The events that have happened at this moment.
    fired: BTreeSet<usize>,
    /// `true` if the next happening must not coincide with this moment.
    next_is_strictly_later: bool,
    facts: BTreeSet<FactId>,
    fluents: BTreeSet<FluentId>,
    occurred: Vec<Occurrence>,
    /// The events before the happening.
    earlier: &'a [Occurrence],
    obligations: &'a mut Obligations,
}

/// Changes made by processes and events.
pub(super) struct PhaseChanges {
    pub(super) facts: Vec<(FactId, bool)>,
    pub(super) values: Vec<(FluentId, Option<Linear>)>,
    pub(super) occurred: Vec<Occurrence>,
}

impl<'a> Phase<'a> {
    /// Creates the course right after a happening.
    pub(super) fn starting_after(
        (compiler, autonomous): (&'a Compiler<'a>, &'a AutonomousModel),
        run: &'a Run,
        (node, next): (NodeId, Option<NodeId>),
        obligations: &'a mut Obligations,
    ) -> Self {
        let plan = &compiler.plan.plan;
        let position = |node: NodeId| compiler.order.iter().position(|other| *other == node);
        let here = Some(run.position);
        let mut running = vec![(None, autonomous.state_constraints.iter().collect())];
        for (index, instance) in plan.instances.iter().enumerate() {
            let id = InstanceId::from(index);
            let Some(body) = instance.action.durative() else {
                continue;
            };
            if position(plan.start(id)) <= here && here < position(plan.end(id)) {
                let conditions = body.over_all.conjuncts().into_iter();
                let touched = conditions.filter(|own| autonomous.changes(compiler.task, own));
                running.push((Some(id), touched.collect()));
            }
        }
        Self {
            compiler,
            autonomous,
            node,
            next,
            running,
            drifts: run.timeline.drifts(),
            now: run.timeline.snapshot(node),
            at: Linear::difference(NodeId::ZERO, node),
            rates: BTreeMap::new(),
            is_active: Vec::new(),
            fired: BTreeSet::new(),
            next_is_strictly_later: false,
            facts: BTreeSet::new(),
            fluents: BTreeSet::new(),
            occurred: Vec::new(),
            earlier: &run.occurred,
            obligations,
        }
    }

    /// Returns the changes at the end of the course.
    pub(super) fn end(self) -> PhaseChanges {
        let reading = self.reading(&self.now);
        let truth = |fact: &FactId| (*fact, reading.fact(*fact).unwrap_or_default());
        let value = |fluent: &FluentId| {
            let value = reading.linear(&Expression::Fluent(*fluent));
            (*fluent, value.ok().flatten())
        };
        let (facts, values) = (
            self.facts.iter().map(truth).collect(),
            self.fluents.iter().map(value).collect(),
        );
        PhaseChanges {
            facts,
            values,
            occurred: self.occurred,
        }
    }

    /// Executes the events whose conditions hold at the moment.
    pub(super) fn execute_current_events(&mut self) -> Result<(), Refusal> {
        loop {
            let mut ready = Vec::new();
            for (index, event) in self.autonomous_of_task().events.iter().enumerate() {
                let condition = &event.snap.condition;
                self.refuse_derived_numbers(condition, &event.name)?;
                let zero = Rational::ZERO;
                let holds = self.view(&self.now).holds(condition, ReadTime::At(&zero))?;
                self.require_now(condition, holds, &event_label(event, holds))?;
                if holds {
                    ready.push(index);
                }
            }
            if ready.is_empty() {
                return Ok(());
            }
            // The changes of a happening at the same moment would come before the event.
            self.next_is_strictly_later |= self.node != NodeId::ZERO && !self.has_elapsed();
            self.execute_simultaneously(&ready, false)?;
        }
    }

    /// Follows the course from right after the moment to the arrival at the next happening.
    pub(super) fn advance_to(&mut self, next: NodeId) -> Result<(), Refusal> {
        self.require_order(next)?;
        for _ in 0..MAX_TRANSITIONS {
            self.settle()?;
            self.require_conditions_now(!self.has_elapsed())?;
            let until = time_of(next);
            let transition = self.next_transition(&until)?;
            let is_arrival = transition.is_none();
            let part = self.segment_until(transition.unwrap_or(until))?;
            if let Some(pause) = part.split_at.clone() {
                let part = self.segment_until(pause)?;
                self.advance_to_transition(part)?;
                continue;
            }
            if !is_arrival {
                self.advance_to_transition(part)?;
                continue;
            }
            self.require_order(next)?;
            self.advance(part, true)?;
            let before = self.occurred.len();
            self.execute_current_events()?;
            if self.occurred.len() > before {
                return Err(self.obstacle(
                    "an event coincides with the next happening in the nominal schedule: their \
                     order is unknown",
                ));
            }
            return Ok(());
        }
        Err(self.obstacle(&format!(
            "there are more than {MAX_TRANSITIONS} events and starts or stops of processes before \
             the next happening"
        )))
    }

    /// Advances to a transition, or to a pause.
    fn advance_to_transition(&mut self, part: Segment) -> Result<(), Refusal> {
        self.require_later(&part.to)?;
        self.advance(part, false)?;
        self.next_is_strictly_later = false;
        self.execute_current_events()
    }

    /// Adds the conditions at the end of the plan.
    pub(super) fn require_final_conditions(&mut self) -> Result<(), Refusal> {
        self.require_conditions_now(true)
    }

    fn autonomous_of_task(&self) -> &'a Autonomous {
        self.compiler.task.autonomous()
    }

    fn has_elapsed(&self) -> bool {
        self.at != time_of(self.node)
    }

    fn reading<'r>(&'r self, timeline: &'r Timeline) -> Reading<'r> {
        self.reading_of(timeline, None)
    }

    fn reading_of<'r>(&'r self, timeline: &'r Timeline, action: Option<InstanceId>) -> Reading<'r> {
        let plan = &self.compiler.plan.plan;
        Reading {
            task: self.compiler.task,
            timeline,
            cut: None,
            // A snapshot has no drifts, so the moment of reading does not matter.
            moment: NodeId::ZERO,
            action: action.map(|id| (plan.start(id), plan.end(id))),
            substitution: &self.compiler.substitution,
            location: action.map_or("processes and events", |id| &plan.instance(id).action.name),
            derived: OnceCell::new(),
        }
    }

    fn view<'r>(&'r self, timeline: &'r Timeline) -> StateView<'r> {
        self.view_of(timeline, None)
    }

    fn view_of<'r>(&'r self, timeline: &'r Timeline, action: Option<InstanceId>) -> StateView<'r> {
        StateView {
            task: self.compiler.task,
            reading: self.reading_of(timeline, action),
            rates: &self.rates,
            nominal: (&self.autonomous.times, &self.autonomous.values),
        }
    }

    fn obstacle(&self, obstacle: &str) -> Refusal {
        let words = (self.compiler.plan.plan).describe_node(self.compiler.task, self.node);
        Refusal::Autonomous {
            place: format!("after {words}"),
            obstacle: obstacle.to_owned(),
        }
    }

    /// Refuses rules that compare numbers, because their value may change during a part.
    fn refuse_derived_numbers(&self, condition: &Condition, name: &str) -> Result<(), Refusal> {
        let (mut own, mut all) = (0_usize, 0_usize);
        condition.visit_fluents(&mut |_| own += 1);
        (self.compiler.task).visit_fluents_of(condition, &mut |_| all += 1);
        if own == all {
            return Ok(());
        }
        Err(Refusal::Autonomous {
            place: name.to_owned(),
            obstacle: "a derived predicate compares numbers".to_owned(),
        })
    }

    fn require(&mut self, course: &str, broken: Alternatives) {
        let requirement = Requirement::Autonomous {
            after: self.node,
            course: course.to_owned(),
        };
        let assumptions = &self.now.assumptions;
        add_autonomous_obligation(self.obligations, requirement, assumptions, broken);
    }

    /// Adds the requirement ([`demand`](Self::demand)) that the course stays as in the nominal
    /// schedule. Refused if the order of coinciding transitions is unknown.
    fn require_nominal(&mut self, course: &str, broken: Alternatives) -> Result<(), Refusal> {
        if self.holds_nominally(&broken) {
            return Err(self.obstacle(
                "happenings, events, or starts or stops of processes coincide in the nominal \
                 schedule: their order is unknown",
            ));
        }
        self.require(course, broken);
        Ok(())
    }

    /// Returns `true` if one of the alternatives holds in the nominal schedule.
    fn holds_nominally(&self, alternatives: &Alternatives) -> bool {
        let holds = |inequality: &Inequality| {
            let value = &inequality.expression;
            let value = value.value(&self.autonomous.times, &self.autonomous.values);
            value.is_negative() || value.is_zero() && !inequality.is_strict
        };
        alternatives.iter().any(|case| case.iter().all(holds))
    }

    /// Requires that the condition has the wanted value at this moment.
    fn require_now(
        &mut self,
        condition: &Condition,
        wanted: bool,
        course: &str,
    ) -> Result<(), Refusal> {
        let unwanted = if wanted {
            WantedTruth::NotTrue
        } else {
            WantedTruth::True
        };
        let broken = self.reading(&self.now).alternatives(condition, unwanted)?;
        self.require_nominal(course, broken)
    }

    /// Requires that the next happening does not come before this moment, nor at it if that makes a
    /// difference.
    fn require_order(&mut self, next: NodeId) -> Result<(), Refusal> {
        // Simultaneous happenings are processed in the order of their numbers.
        let is_later = self.next_is_strictly_later || !self.has_elapsed() && next < self.node;
        let broken = Inequality {
            expression: time_of(next).minus(&self.at),
            is_strict: !is_later,
        };
        let words = (self.compiler.plan.plan).describe_node(self.compiler.task, next);
        let course = format!(
            "{words} must come after the events that precede it in the nominal \
                              schedule"
        );
        self.require_nominal(&course, vec![vec![broken]])
    }

    /// Requires that the transition comes after this moment.
    fn require_later(&mut self, transition: &Linear) -> Result<(), Refusal> {
        let broken = Inequality {
            expression: transition.minus(&self.at),
            is_strict: false,
        };
        let course = "events, and processes that start or stop, must keep their order";
        self.require_nominal(course, vec![vec![broken]])
    }

    /// Advances to a later moment; `is_arrival` if it is the next happening.
    fn advance(&mut self, part: Segment, is_arrival: bool) -> Result<(), Refusal> {
        for (course, broken) in part.expected {
            self.require_nominal(&course, broken)?;
        }
        for (course, broken) in part.demanded {
            self.require(&course, broken);
        }
        // The timeline already contains the changes by the plan alone.
        let moved = self.rates.keys().copied();
        (self.fluents).extend(moved.filter(|fluent| self.autonomous.fluents.contains(fluent)));
        self.now = part.end_state;
        self.at = part.to;
        self.fired.clear();
        self.require_conditions_on_arrival(is_arrival)
    }
}

fn time_of(node: NodeId) -> Linear {
    Linear::difference(NodeId::ZERO, node)
}

fn event_label(event: &GroundEvent, happens: bool) -> String {
    let name = &event.name;
    if happens {
        format!("the event {name} must happen as in the nominal schedule")
    } else {
        format!("the event {name} must not happen before the next happening")
    }
}

fn process_label(process: &str, is_at_work: bool) -> String {
    let is = if is_at_work { "active" } else { "inactive" };
    format!("the process {process} must be {is} until the next happening")
}
