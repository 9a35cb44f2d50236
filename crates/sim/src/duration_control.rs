//! Worlds whose action durations are decided from outside, during execution.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_execution::{
    ActionHandle, Command, Event, Observation, TimeAdvance, World, WorldError,
};
use elbowroom_model::ground::{Action, FactId, FluentId};
use elbowroom_num::Rational;

use crate::sim::SimWorld;

/// Decides when running actions end.
pub trait DurationController: Send {
    /// Called when an action has started.
    fn on_start(&mut self, now: &Rational, begun: &StartedAction<'_>);

    /// Called when an action has ended: because of [`due_ends`](Self::due_ends), by a failure, or
    /// by a cancellation.
    fn on_end(&mut self, now: &Rational, ticket: ActionHandle);

    /// Returns the actions that end now. Called after each event, and at each
    /// [look](Self::next_check).
    fn due_ends(&mut self, now: &Rational) -> Vec<ActionHandle>;

    /// Returns the time of the next look if no event comes before; later than `now`.
    fn next_check(&self, now: &Rational) -> Option<Rational>;
}

/// An action that has started.
#[derive(Clone, Copy, Debug)]
pub struct StartedAction<'a> {
    /// The ticket of the start.
    pub ticket: ActionHandle,
    /// The action.
    pub action: &'a Action,
    /// Number of earlier commands to start an action of that name.
    pub occurrence: u64,
    /// The planned duration; `None` if it is instantaneous.
    pub planned: Option<&'a Rational>,
    /// `true` if it ends when the [`DurationController`] says; if `false`, it is instantaneous or is going to
    /// fail.
    pub is_open: bool,
}

/// A simulated world whose action durations are decided by a [`DurationController`].
///
/// The world decides everything else: conditions, failures, delays, reports.
#[derive(Debug)]
pub struct ControlledWorld<'a, P> {
    world: SimWorld<'a>,
    controller: P,
    now: Rational,
    /// Commanded actions that have not started, with their number among those of the same name.
    ordered: BTreeMap<ActionHandle, CommandedStart>,
    occurrences: BTreeMap<String, u64>,
}

#[derive(Debug)]
struct CommandedStart {
    action: Arc<Action>,
    occurrence: u64,
    planned: Option<Rational>,
}

impl<'a, P: DurationController> ControlledWorld<'a, P> {
    /// Combines a world and a duration controller.
    pub fn new(world: SimWorld<'a>, pace: P) -> Self {
        Self {
            world,
            controller: pace,
            now: Rational::ZERO,
            ordered: BTreeMap::new(),
            occurrences: BTreeMap::new(),
        }
    }

    /// Returns the world.
    pub fn world(&self) -> &SimWorld<'a> {
        &self.world
    }

    /// Returns the duration controller.
    pub fn controller(&self) -> &P {
        &self.controller
    }

    /// Notifies the duration controller that a commanded action has started.
    fn begin(&mut self, ticket: ActionHandle, time: &Rational, is_open: bool) {
        if let Some(ordered) = self.ordered.remove(&ticket) {
            let begun = StartedAction {
                ticket,
                action: &ordered.action,
                occurrence: ordered.occurrence,
                planned: ordered.planned.as_ref(),
                is_open,
            };
            self.controller.on_start(time, &begun);
        }
    }

    fn process_observations(&mut self, observations: &[Observation]) {
        for observation in observations {
            match &observation.event {
                Event::Started { ticket, .. } => {
                    let is_open = self.world.hold(*ticket);
                    self.begin(*ticket, &observation.time, is_open);
                }
                Event::Ended { ticket, .. } => self.controller.on_end(&observation.time, *ticket),
                _ => {}
            }
        }
    }
}

impl<P: DurationController> World for ControlledWorld<'_, P> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.now.clone_from(now);
        let Command::Start {
            ticket,
            action,
            duration,
        } = command
        else {
            return self.world.command(now, command);
        };
        let count = self.occurrences.entry(action.name.clone()).or_default();
        let ordered = CommandedStart {
            action: Arc::clone(action),
            occurrence: *count,
            planned: duration.clone(),
        };
        *count += 1;
        self.ordered.insert(*ticket, ordered);
        self.world.command(now, command)?;
        // Before time passes, because the planned duration may be 0.
        if self.world.hold(*ticket) {
            self.begin(*ticket, now, true);
        }
        Ok(())
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        loop {
            for ticket in self.controller.due_ends(&self.now) {
                self.world.release(ticket);
            }
            let look = self.controller.next_check(&self.now);
            let stop = look.into_iter().chain([until.clone()]).min();
            let passage = self.world.wait(&stop.unwrap_or_default())?;
            self.now.clone_from(&passage.now);
            self.process_observations(&passage.observations);
            if !passage.observations.is_empty() || passage.now >= *until {
                return Ok(passage);
            }
        }
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        self.world.look(facts, fluents)
    }
}

/// A duration controller with a duration fixed in advance for each start of an action.
#[derive(Clone, Debug, Default)]
pub struct FixedDurations {
    /// For each action's name, its durations in order of its starts.
    durations: BTreeMap<String, Vec<Rational>>,
    /// The end of each running action.
    ends: BTreeMap<ActionHandle, Rational>,
}

impl FixedDurations {
    /// Creates the controller. `durations` has, for each action's name, its durations in order of
    /// its starts; further starts take the planned duration.
    pub fn new(durations: BTreeMap<String, Vec<Rational>>) -> Self {
        let ends = BTreeMap::new();
        Self { durations, ends }
    }
}

impl DurationController for FixedDurations {
    fn on_start(&mut self, now: &Rational, begun: &StartedAction<'_>) {
        if !begun.is_open {
            return;
        }
        let known = self.durations.get(&begun.action.name);
        let place = usize::try_from(begun.occurrence).unwrap_or(usize::MAX);
        let duration = known.and_then(|known| known.get(place));
        if let Some(duration) = duration.or(begun.planned) {
            self.ends.insert(begun.ticket, now + duration);
        }
    }

    fn on_end(&mut self, _now: &Rational, ticket: ActionHandle) {
        self.ends.remove(&ticket);
    }

    fn due_ends(&mut self, now: &Rational) -> Vec<ActionHandle> {
        let due = self.ends.iter().filter(|(_, end)| *end <= now);
        let due: Vec<ActionHandle> = due.map(|(ticket, _)| *ticket).collect();
        for ticket in &due {
            self.ends.remove(ticket);
        }
        due
    }

    fn next_check(&self, _now: &Rational) -> Option<Rational> {
        self.ends.values().min().cloned()
    }
}
