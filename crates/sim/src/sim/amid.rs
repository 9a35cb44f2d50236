//! Worlds that begin in the middle of an execution, conditioned on the observations so far.

use elbowroom_execution::{Progression, SeenChange, Ticket, Underway};
use elbowroom_model::ground::FactId;
use elbowroom_num::Rational;
use rand::Rng;

use super::{Coming, Commanded, SimWorld};
use crate::draw::{Purpose, keyed};
use crate::model::{Exogenous, ExogenousChange, Failure, WorldModel};

/// Number of draws for one that is consistent with the observations.
const DRAWS: u64 = 64;

/// Maximum difference of times that count as equal when an observed change is matched with an
/// event, as a share of the range of the drawn times.
const SAME: f64 = 0.05;

/// Observations of the facts that may change by themselves.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// The observed changes, in order of time. Each is marked as spontaneous or not.
    pub changes: Vec<SeenChange>,
}

impl Seen {
    /// Returns the observed truth of the fact at that time, which is before the present;
    /// `initially` if it was not observed before.
    fn was(&self, fact: FactId, time: &Rational, initially: bool) -> bool {
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
    pub fn amid(belief: &Progression, model: &'a WorldModel, seed: u64, past: &Seen) -> Self {
        let now = belief.time().clone();
        let mut world = Self::empty(belief.clone(), model, seed);
        world.now.clone_from(&now);
        for (ticket, underway) in belief.running() {
            world.go_on(*ticket, underway);
        }
        let over = world.matched(past);
        for (index, exogenous) in model.exogenous.iter().enumerate() {
            if over.contains(&index) {
                continue;
            }
            if let Some(time) = world.to_come(index, exogenous, past) {
                world.put(time, Coming::Exogenous(index));
            }
        }
        world.expose();
        world
    }

    /// Draws the end of a running action.
    fn go_on(&mut self, ticket: Ticket, underway: &Underway) {
        let name = &underway.action.name;
        let mut commanded = Commanded {
            action: underway.action.clone(),
            planned: Some(underway.planned.clone()),
            occurrence: 0,
            has_started: true,
            outcome: None,
            is_broken: false,
        };
        let key = format!("{name} running since {}", underway.start);
        let failing = self.model.failing(name);
        let mut coming = None;
        for draw in 0..DRAWS {
            let rng = |purpose| keyed(self.seed, &key, draw, purpose);
            let duration =
                self.model
                    .duration(name, &underway.planned, &mut rng(Purpose::Duration));
            let mut dice = rng(Purpose::Failure);
            let fails = failing.filter(|failing| dice.random::<f64>() < failing.probability);
            let Some(failing) = fails.filter(|failing| failing.when != Failure::AtStart) else {
                let end = &underway.start + &duration;
                // An action that failed at its start is not running.
                if fails.is_none() && end > self.now {
                    coming = Some((end, Coming::End(ticket)));
                    break;
                }
                continue;
            };
            let outcome = failing.outcome(&mut rng(Purpose::Outcome));
            let share = match failing.when {
                Failure::Midway => crate::draw::rounded(dice.random(), &self.model.resolution),
                _ => Rational::ONE,
            };
            let breaks = &underway.start + duration * share;
            let fails = outcome.map_or(breaks.clone(), |outcome| &breaks + &outcome.delay);
            if fails > self.now {
                commanded.outcome = outcome;
                commanded.is_broken = breaks <= self.now;
                coming = Some(if commanded.is_broken {
                    (fails, Coming::Fail(ticket))
                } else {
                    (breaks, Coming::Break(ticket))
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
        let (time, what) = coming.unwrap_or_else(|| (late(), Coming::End(ticket)));
        self.actions.insert(ticket, commanded);
        self.put(time, what);
    }

    /// Returns the events that explain the observed changes. Among several candidates, each is
    /// drawn in proportion to its probability of coming at such a time.
    fn matched(&self, past: &Seen) -> Vec<usize> {
        let mut matched: Vec<usize> = Vec::new();
        let changes = past.changes.iter().filter(|change| change.is_by_itself);
        for (number, change) in changes.enumerate() {
            let events = self.model.exogenous.iter().enumerate();
            let weights: Vec<(usize, u64)> = events
                .filter(|(index, event)| {
                    !matched.contains(index)
                        && self.changes(event) == Some((change.fact, change.truth))
                })
                .map(|(index, event)| (index, self.often_at(index, event, &change.time)))
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
    fn changes(&self, event: &Exogenous) -> Option<(FactId, bool)> {
        match &event.change {
            ExogenousChange::Fact(name, truth) => {
                Some((self.truth.task().fact_named(name)?, *truth))
            }
            ExogenousChange::Value(..) => None,
        }
    }

    fn drawn(&self, index: usize, event: &Exogenous, draw: u64) -> Option<Rational> {
        let name = match &event.change {
            ExogenousChange::Fact(name, _) | ExogenousChange::Value(name, _) => name,
        };
        let key = format!("{name} seen from {}", self.now);
        let occurrence = index as u64 * DRAWS + draw;
        let mut rng = keyed(self.seed, &key, occurrence, Purpose::Exogenous);
        let happens = rng.random::<f64>() < event.probability;
        let time = event
            .time
            .draw(&Rational::ZERO, &self.model.resolution, &mut rng);
        happens.then(|| time.max(Rational::ZERO))
    }

    /// Returns the number of draws close to that time.
    fn often_at(&self, index: usize, event: &Exogenous, time: &Rational) -> u64 {
        let drawn = (0..DRAWS).filter_map(|draw| self.drawn(index, event, draw));
        let drawn: Vec<f64> = drawn.map(|time| time.to_f64()).collect();
        let least = drawn.iter().copied().fold(f64::INFINITY, f64::min);
        let most = drawn.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let width = ((most - least) * SAME).max(self.model.resolution.to_f64());
        let near = |it: &&f64| (*it - time.to_f64()).abs() <= width;
        drawn.iter().filter(near).count() as u64
    }

    /// Draws the time of an event that was not observed; `None` if it does not come any more.
    fn to_come(&self, index: usize, event: &Exogenous, past: &Seen) -> Option<Rational> {
        for draw in 0..DRAWS {
            let time = self.drawn(index, event, draw)?;
            if time > self.now {
                return Some(time);
            }
            // A past event that would have been reported must have changed nothing.
            let went_unseen = match self.changes(event) {
                Some((fact, truth)) => {
                    let initially = self.truth.task().initial().facts.contains(&fact);
                    !event.is_reported || past.was(fact, &time, initially) == truth
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
