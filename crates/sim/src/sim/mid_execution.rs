//! Worlds that begin in the middle of an execution, conditioned on the observations so far.

use elbowroom_execution::{ActionHandle, BeliefState, ObservedChange, RunningActionState};
use elbowroom_model::ground::FactId;
use elbowroom_num::Rational;
use rand::Rng;

use super::{ComingEvent, CommandedAction, SimWorld};
use crate::draw::{Purpose, keyed};
use crate::model::{ExogenousChange, ExogenousEvent, FailureTime, WorldModel};

/// Number of draws for one that is consistent with the observations.
const MAX_DRAWS: u64 = 64;

/// Maximum difference of times that count as equal when an observed change is matched with an
/// event, as a share of the range of the drawn times.
const MATCH_TOLERANCE: f64 = 0.05;

/// Observations of the facts that may change by themselves.
#[derive(Clone, Debug, Default)]
pub struct ObservedChanges {
    /// The observed changes, in order of time. Each is marked as spontaneous or not.
    pub changes: Vec<ObservedChange>,
}

impl ObservedChanges {
    /// Returns the observed truth of the fact at that time, which is before the present;
    /// `initially` if it was not observed before.
    fn truth_at(&self, fact: FactId, time: &Rational, initially: bool) -> bool {
        let mut before = self
            .changes
            .iter()
            .filter(|it| it.fact == fact && it.time <= *time);
        before.next_back().map_or(initially, |it| it.truth)
    }
}

impl<'a> SimWorld<'a> {
    /// Creates a world that continues from a belief, which is taken as the true state at its time.
    ///
    /// Running actions take the rest of a duration that is drawn from those that are longer than
    /// the time so far, and fail with the probability of an action that has not failed so far.
    /// Coming events are drawn consistently with the observations. The results of later starts
    /// depend only on the seed and on the number of starts of the action since `belief`, so
    /// different executors that continue from here meet the same world, as long as they do the
    /// same.
    pub fn mid_execution(
        belief: &BeliefState,
        model: &'a WorldModel,
        seed: u64,
        past: &ObservedChanges,
    ) -> Self {
        let now = belief.time().clone();
        let mut world = Self::without_events(belief.clone(), model, seed);
        world.now.clone_from(&now);
        for (ticket, underway) in belief.running() {
            world.draw_end(*ticket, underway);
        }
        let over = world.explaining_events(past);
        for (index, exogenous) in model.exogenous.iter().enumerate() {
            if over.contains(&index) {
                continue;
            }
            if let Some(time) = world.draw_unobserved_event(index, exogenous, past) {
                world.schedule(time, ComingEvent::Exogenous(index));
            }
        }
        world.schedule_spontaneous_changes();
        world
    }

    /// Draws the end of a running action.
    fn draw_end(&mut self, ticket: ActionHandle, underway: &RunningActionState) {
        let name = &underway.action.name;
        let mut commanded = CommandedAction {
            action: underway.action.clone(),
            planned: Some(underway.planned.clone()),
            occurrence: 0,
            has_started: true,
            outcome: None,
            is_broken: false,
        };
        let key = format!("{name} running since {}", underway.start);
        let failing = self.model.failure_rule(name);
        let mut coming = None;
        for draw in 0..MAX_DRAWS {
            let rng = |purpose| keyed(self.seed, &key, draw, purpose);
            let duration =
                self.model
                    .duration(name, &underway.planned, &mut rng(Purpose::Duration));
            let mut dice = rng(Purpose::Failure);
            let fails = failing.filter(|failing| dice.random::<f64>() < failing.probability);
            let Some(failing) = fails.filter(|failing| failing.when != FailureTime::AtStart) else {
                let end = &underway.start + &duration;
                // An action that failed at its start is not running.
                if fails.is_none() && end > self.now {
                    coming = Some((end, ComingEvent::End(ticket)));
                    break;
                }
                continue;
            };
            let outcome = failing.outcome(&mut rng(Purpose::Outcome));
            let share = match failing.when {
                FailureTime::Midway => crate::draw::rounded(dice.random(), &self.model.resolution),
                _ => Rational::ONE,
            };
            let breaks = &underway.start + duration * share;
            let fails = outcome.map_or(breaks.clone(), |outcome| &breaks + &outcome.delay);
            if fails > self.now {
                commanded.outcome = outcome;
                commanded.is_broken = breaks <= self.now;
                coming = Some(if commanded.is_broken {
                    (fails, ComingEvent::Fail(ticket))
                } else {
                    (breaks, ComingEvent::Break(ticket))
                });
                break;
            }
        }
        // No draw lasts that long, so a quarter of the time so far is added.
        let late = || {
            let elapsed = &self.now - &underway.start;
            let quarter = elapsed / Rational::from(4);
            &self.now + quarter.max(self.model.resolution.clone())
        };
        let (time, what) = coming.unwrap_or_else(|| (late(), ComingEvent::End(ticket)));
        self.actions.insert(ticket, commanded);
        self.schedule(time, what);
    }

    /// Returns the events that explain the observed changes. Among several candidates, each is
    /// drawn in proportion to its probability of coming at such a time.
    fn explaining_events(&self, past: &ObservedChanges) -> Vec<usize> {
        let mut matched: Vec<usize> = Vec::new();
        let changes = past.changes.iter().filter(|change| change.is_spontaneous);
        for (number, change) in changes.enumerate() {
            let events = self.model.exogenous.iter().enumerate();
            let weights: Vec<(usize, u64)> = events
                .filter(|(index, event)| {
                    !matched.contains(index)
                        && self.changes(event) == Some((change.fact, change.truth))
                })
                .map(|(index, event)| (index, self.draws_near(index, event, &change.time)))
                .collect();
            let all: u64 = weights.iter().map(|(_, weight)| weight).sum();
            if all == 0 {
                // The change comes from a fact with a rate, or from the outcome of a failure.
                continue;
            }
            let key = format!("seen {number}");
            let mut left = keyed(self.seed, &key, 0, Purpose::Exogenous).random_range(0..all);
            for (index, weight) in weights {
                if left < weight {
                    matched.push(index);
                    break;
                }
                left -= weight;
            }
        }
        matched
    }

    /// Returns the fact that an event changes, and its new truth.
    fn changes(&self, event: &ExogenousEvent) -> Option<(FactId, bool)> {
        match &event.change {
            ExogenousChange::Fact(name, truth) => {
                Some((self.truth.task().fact_named(name)?, *truth))
            }
            ExogenousChange::Value(..) => None,
        }
    }

    fn draw_event_time(&self, index: usize, event: &ExogenousEvent, draw: u64) -> Option<Rational> {
        let name = match &event.change {
            ExogenousChange::Fact(name, _) | ExogenousChange::Value(name, _) => name,
        };
        let key = format!("{name} seen from {}", self.now);
        let occurrence = index as u64 * MAX_DRAWS + draw;
        let mut rng = keyed(self.seed, &key, occurrence, Purpose::Exogenous);
        let happens = rng.random::<f64>() < event.probability;
        let time = event
            .time
            .draw(&Rational::ZERO, &self.model.resolution, &mut rng);
        happens.then(|| time.max(Rational::ZERO))
    }

    /// Returns the number of draws that are close to `time`.
    fn draws_near(&self, index: usize, event: &ExogenousEvent, time: &Rational) -> u64 {
        let drawn = (0..MAX_DRAWS).filter_map(|draw| self.draw_event_time(index, event, draw));
        let drawn: Vec<f64> = drawn.map(|time| time.to_f64()).collect();
        let least = drawn.iter().copied().fold(f64::INFINITY, f64::min);
        let most = drawn.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let width = ((most - least) * MATCH_TOLERANCE).max(self.model.resolution.to_f64());
        let near = |it: &&f64| (*it - time.to_f64()).abs() <= width;
        drawn.iter().filter(near).count() as u64
    }

    /// Draws the time of an event that was not observed; `None` if it does not come any more.
    fn draw_unobserved_event(
        &self,
        index: usize,
        event: &ExogenousEvent,
        past: &ObservedChanges,
    ) -> Option<Rational> {
        for draw in 0..MAX_DRAWS {
            let time = self.draw_event_time(index, event, draw)?;
            if time > self.now {
                return Some(time);
            }
            // A past event that would have been reported must have changed nothing.
            let went_unseen = match self.changes(event) {
                Some((fact, truth)) => {
                    let initially = self.truth.task().initial().facts.contains(&fact);
                    !event.is_reported || past.truth_at(fact, &time, initially) == truth
                }
                None => true,
            };
            if went_unseen {
                return (!event.is_reported).then(|| self.now.clone());
            }
        }
        None
    }
}
