//! One trajectory of a world.

mod external_end;
mod failures;
mod hazards;
mod mid_execution;
mod world;

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_execution::{ActionHandle, BeliefState, Ending, Event, Measured, Observation};
use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body, Change, Condition, Effect, SnapAction};
use elbowroom_num::Rational;
use rand::Rng;

use crate::draw::{Purpose, keyed};
use crate::model::{ExogenousChange, FailureTime, Outcome, WorldModel};
use hazards::PoissonProcess;
pub use mid_execution::ObservedChanges;

/// A simulated world: the true state, and the coming events.
///
/// It follows the semantics of PDDL, as the validator does. All happenings at one time form a
/// group, whose conditions and amounts are read in the state on arrival. An action that is started
/// at a moment belongs to its group until the world is asked to wait.
///
/// An action whose start condition does not hold does not start. An action whose end condition does
/// not hold fails when it would have ended. An action whose over-all condition does not hold at
/// some moment strictly between start and end fails at once. If the condition fails because numbers
/// change continuously, the action fails at the next multiple of the world's resolution, unless an
/// event comes before that.
#[derive(Debug)]
pub struct SimWorld<'a> {
    model: &'a WorldModel,
    seed: u64,
    truth: BeliefState,
    now: Rational,
    /// The coming happenings, by time and then in the order of their insertion.
    agenda: BTreeMap<(Rational, u64), ComingEvent>,
    /// Number of entries put on the agenda so far.
    scheduled: u64,
    /// Observations that have not been reported.
    unreported: Vec<Observation>,
    /// Number of starts, by action.
    occurrences: BTreeMap<String, u64>,
    /// Commanded actions that have not ended.
    actions: BTreeMap<ActionHandle, CommandedAction<'a>>,
    /// Spontaneous changes at a rate.
    spontaneous_changes: Vec<PoissonProcess>,
}

#[derive(Clone, Debug)]
struct CommandedAction<'a> {
    action: Arc<Action>,
    planned: Option<Rational>,
    occurrence: u64,
    has_started: bool,
    /// The outcome of its failure, if it has one.
    outcome: Option<&'a Outcome>,
    /// `true` if it can only fail any more, and delays the failure.
    is_broken: bool,
}

#[derive(Clone, Debug)]
enum ComingEvent {
    Start(ActionHandle),
    End(ActionHandle),
    Break(ActionHandle),
    Fail(ActionHandle),
    Exogenous(usize),
    SpontaneousChange(usize),
}

impl<'a> SimWorld<'a> {
    /// Creates the world of that seed, at time 0.
    pub fn new(task: Arc<Task>, model: &'a WorldModel, seed: u64) -> Self {
        let mut world = Self::without_events(BeliefState::new(task), model, seed);
        for (index, exogenous) in model.exogenous.iter().enumerate() {
            let name = match &exogenous.change {
                ExogenousChange::Fact(name, _) | ExogenousChange::Value(name, _) => name,
            };
            let mut rng = keyed(seed, name, index as u64, Purpose::Exogenous);
            let happens = rng.random::<f64>() < exogenous.probability;
            let time = exogenous
                .time
                .draw(&Rational::ZERO, &model.resolution, &mut rng);
            if happens {
                world.schedule(time.max(Rational::ZERO), ComingEvent::Exogenous(index));
            }
        }
        world.schedule_spontaneous_changes();
        world
    }

    /// Creates a world without coming events.
    fn without_events(truth: BeliefState, model: &'a WorldModel, seed: u64) -> Self {
        Self {
            truth,
            model,
            seed,
            now: Rational::ZERO,
            agenda: BTreeMap::new(),
            scheduled: 0,
            unreported: Vec::new(),
            occurrences: BTreeMap::new(),
            actions: BTreeMap::new(),
            spontaneous_changes: Vec::new(),
        }
    }

    /// Returns the true state.
    pub fn truth(&self) -> &BeliefState {
        &self.truth
    }

    fn schedule(&mut self, time: Rational, coming: ComingEvent) {
        self.agenda.insert((time, self.scheduled), coming);
        self.scheduled += 1;
    }

    fn report(&mut self, event: Event) {
        self.unreported.push(Observation {
            time: self.now.clone(),
            event,
        });
    }

    /// Lets time pass until `until`, or until something is reported, if that `is_enough`.
    fn advance(&mut self, until: &Rational, is_enough: bool) {
        loop {
            self.process_due_events();
            let is_told = |world: &Self| is_enough && !world.unreported.is_empty();
            if is_told(self) || self.now >= *until {
                return;
            }
            // All happenings of this moment have been processed.
            while let Some((ticket, why)) = self.first_broken() {
                self.fail(ticket, &why);
            }
            if is_told(self) {
                return;
            }
            let coming = self.agenda.keys().next().map(|(time, _)| time);
            // Timed initials can make running actions fail.
            let next = coming.into_iter().chain(self.truth.next_timed());
            let next = next.chain([until]).min().unwrap_or(until).clone();
            let broken = self
                .truth
                .next_over_all_failure(&next, &self.model.resolution);
            let next = broken.into_iter().chain([next]).min().unwrap_or_default();
            // A moving fluent without a value does not get one.
            let _ = self.truth.advance(&next);
            self.now = next;
        }
    }

    /// Processes all happenings that are due by now.
    fn process_due_events(&mut self) {
        let _ = self.truth.advance(&self.now);
        while let Some(entry) = self.agenda.first_entry() {
            if entry.key().0 > self.now {
                break;
            }
            match entry.remove() {
                ComingEvent::Start(ticket) => self.start(ticket),
                ComingEvent::End(ticket) => self.end(ticket),
                ComingEvent::Break(ticket) => self.break_down(ticket),
                ComingEvent::Fail(ticket) => self.fail_broken_action(ticket),
                ComingEvent::Exogenous(index) => self.change(index),
                ComingEvent::SpontaneousChange(index) => self.process_spontaneous_change(index),
            }
        }
    }

    /// Returns an action whose over-all condition has failed, or fails from now on, with the
    /// reason.
    fn first_broken(&self) -> Option<(ActionHandle, String)> {
        if let Some((ticket, underway)) = self.truth.violated_action() {
            return Some((ticket, self.violated_reason(&underway.violated_conjuncts())));
        }
        let (ticket, parts) = self.truth.failing_actions().into_iter().next()?;
        Some((ticket, self.violated_reason(&parts)))
    }

    fn violated_reason(&self, conditions: &[&Condition]) -> String {
        format!("{} no longer held", self.in_words(conditions))
    }

    fn in_words(&self, conditions: &[&Condition]) -> String {
        let words = conditions
            .iter()
            .map(|condition| self.truth.task().describe_condition(condition));
        words.collect::<Vec<_>>().join(" and ")
    }

    fn start(&mut self, ticket: ActionHandle) {
        let Some(commanded) = self.actions.get(&ticket).cloned() else {
            return;
        };
        let action = &commanded.action;
        let planned = commanded.planned.clone().unwrap_or_default();
        let snap = match &action.body {
            Body::Instantaneous(snap) => snap,
            Body::Durative(body) => &body.start,
        };
        let mut failure = keyed(
            self.seed,
            &action.name,
            commanded.occurrence,
            Purpose::Failure,
        );
        let fails = self
            .model
            .failure_rule(&action.name)
            .filter(|failing| failure.random::<f64>() < failing.probability);
        let outcome = fails.and_then(|failing| {
            let (name, occurrence) = (&action.name, commanded.occurrence);
            failing.outcome(&mut keyed(self.seed, name, occurrence, Purpose::Outcome))
        });
        if let Some(commanded) = self.actions.get_mut(&ticket) {
            commanded.outcome = outcome;
        }
        let fails = fails.map(|failing| failing.when);
        let unmet = self.truth.unmet_on_arrival(&snap.condition, Some(&planned));
        if !unmet.is_empty() {
            let why = format!("it needs {}", self.in_words(&unmet));
            return self.fail(ticket, &why);
        }
        let is_instantaneous = matches!(action.body, Body::Instantaneous(_));
        if fails == Some(FailureTime::AtStart) || (is_instantaneous && fails.is_some()) {
            return self.break_down(ticket);
        }
        let measured = self.measured(&commanded, snap, 0, commanded.planned.as_ref());
        let _ = self.truth.start(ticket, action, &planned, &measured);
        self.report(Event::Started { ticket, measured });
        if is_instantaneous {
            self.actions.remove(&ticket);
            return;
        }
        if let Some(commanded) = self.actions.get_mut(&ticket) {
            commanded.has_started = true;
        }
        let mut rng = keyed(
            self.seed,
            &action.name,
            commanded.occurrence,
            Purpose::Duration,
        );
        let duration = self.model.duration(&action.name, &planned, &mut rng);
        let end = &self.now + &duration;
        match fails {
            Some(FailureTime::AtEnd) => self.schedule(end, ComingEvent::Break(ticket)),
            Some(FailureTime::Midway) => {
                let share = crate::draw::rounded(failure.random(), &self.model.resolution);
                let time = &self.now + duration * share;
                self.schedule(time, ComingEvent::Break(ticket));
            }
            _ => self.schedule(end, ComingEvent::End(ticket)),
        }
    }

    fn end(&mut self, ticket: ActionHandle) {
        let Some(commanded) = self.actions.get(&ticket).cloned() else {
            return;
        };
        let (Some(body), Some(underway)) = (
            commanded.action.durative(),
            self.truth.running().get(&ticket),
        ) else {
            return;
        };
        let broken = underway.violated_conjuncts();
        if !broken.is_empty() {
            let why = self.violated_reason(&broken);
            return self.fail(ticket, &why);
        }
        let duration = &self.now - &underway.start;
        let condition = &body.end.condition;
        let unmet = self.truth.unmet_on_arrival(condition, Some(&duration));
        if !unmet.is_empty() {
            let why = format!("its end needs {}", self.in_words(&unmet));
            return self.fail(ticket, &why);
        }
        let measured = self.measured(&commanded, &body.end, 1, Some(&duration));
        let _ = self.truth.end(ticket, &measured);
        self.actions.remove(&ticket);
        self.report(Event::Ended {
            ticket,
            ending: Ending::Succeeded,
            measured,
        });
    }

    fn fail(&mut self, ticket: ActionHandle, why: &str) {
        self.truth.stop(ticket);
        if self.actions.remove(&ticket).is_some() {
            self.report(Event::Ended {
                ticket,
                ending: Ending::Failed {
                    why: why.to_owned(),
                },
                measured: Vec::new(),
            });
        }
    }

    /// Draws the amounts that the world file has for a happening; the others are the domain's.
    /// `?duration` is the planned duration at the start, and the real one at the end.
    fn measured(
        &self,
        commanded: &CommandedAction<'_>,
        snap: &SnapAction,
        place: u64,
        duration: Option<&Rational>,
    ) -> Vec<Measured> {
        let action = &commanded.action.name;
        let update = |effect: &Effect| match &effect.change {
            Change::Update { fluent, value, .. } => Some((*fluent, value.clone())),
            _ => None,
        };
        let updates = snap.effects.iter().filter_map(update);
        let measured = updates.filter_map(|(fluent, value)| {
            let name = self.truth.task().fluent_name(fluent);
            let rule = self.model.amount(action, &name)?;
            let nominal = value.evaluate(&mut |leaf| match leaf {
                elbowroom_model::ground::Expression::Fluent(fluent) => {
                    self.truth.value_on_arrival(*fluent).cloned()
                }
                elbowroom_model::ground::Expression::Duration => duration.cloned(),
                _ => None,
            });
            let instance = format!("{action} {name} {place}");
            let mut rng = keyed(self.seed, &instance, commanded.occurrence, Purpose::Amount);
            let amount = rule.draw(
                &nominal.unwrap_or_default(),
                &self.model.resolution,
                &mut rng,
            );
            Some(Measured { fluent, amount })
        });
        measured.collect()
    }

    fn change(&mut self, index: usize) {
        let exogenous = &self.model.exogenous[index];
        let task = Arc::clone(self.truth.task());
        let event = match &exogenous.change {
            ExogenousChange::Fact(name, truth) => {
                // Names that the problem does not have are ignored.
                let Some(fact) = task.fact_named(name) else {
                    return;
                };
                self.truth.change_fact(fact, *truth);
                Event::Fact {
                    fact,
                    truth: *truth,
                }
            }
            ExogenousChange::Value(name, value) => {
                let Some(fluent) = task.fluent_named(name) else {
                    return;
                };
                self.truth.change_value(fluent, value);
                Event::Value {
                    fluent,
                    value: value.clone(),
                }
            }
        };
        if exogenous.is_reported {
            self.report(event);
        }
    }
}
