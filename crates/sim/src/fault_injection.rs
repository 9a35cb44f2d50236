//! A world with unreliable reports.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_execution::{
    ActionHandle, BeliefState, Command, Ending, Event, Observation, TimeAdvance, World, WorldError,
};
use elbowroom_model::Task;
use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_num::Rational;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::draw::{Purpose, keyed};
use crate::model::{ReportReliability, WorldModel};
use crate::sim::{ObservedChanges, SimWorld};

/// Decorator that loses, repeats, delays and contradicts the reports of another world. Answers to
/// [`World::look`] are not changed.
#[derive(Debug)]
pub struct FaultInjector<W> {
    inner: W,
    reports: ReportReliability,
    rng: ChaCha8Rng,
    resolution: Rational,
    now: Rational,
    /// Reports in transit, by the time of their arrival.
    coming: BTreeMap<(Rational, u64), Observation>,
    count: u64,
}

impl WorldModel {
    /// Creates the world of that seed, with the model's reliability of reports.
    pub fn world(&self, task: &Arc<Task>, seed: u64) -> Box<dyn World + '_> {
        let sim = SimWorld::new(Arc::clone(task), self, seed);
        if self.reports.is_perfect() {
            return Box::new(sim);
        }
        let (reports, resolution) = (self.reports.clone(), self.resolution.clone());
        Box::new(FaultInjector::new(sim, reports, seed, resolution))
    }
}

impl WorldModel {
    /// Creates a sample of the world that continues from a belief: [`SimWorld::mid_execution`], with the
    /// model's reliability of reports.
    pub fn world_in_mid_execution(
        &self,
        belief: &BeliefState,
        seed: u64,
        past: &ObservedChanges,
    ) -> Box<dyn World + '_> {
        let sim = SimWorld::mid_execution(belief, self, seed, past);
        if self.reports.is_perfect() {
            return Box::new(sim);
        }
        let (reports, resolution) = (self.reports.clone(), self.resolution.clone());
        Box::new(FaultInjector::new(sim, reports, seed, resolution))
    }
}

impl<W: World> FaultInjector<W> {
    /// Wraps the world `inner`. `reports` is the reliability of its reports.
    pub fn new(inner: W, reports: ReportReliability, seed: u64, resolution: Rational) -> Self {
        Self {
            inner,
            reports,
            rng: keyed(seed, "", 0, Purpose::Report),
            resolution,
            now: Rational::ZERO,
            coming: BTreeMap::new(),
            count: 0,
        }
    }

    /// Returns the wrapped world.
    pub fn inner(&self) -> &W {
        &self.inner
    }

    fn draw_bool(&mut self, probability: f64) -> bool {
        self.rng.random::<f64>() < probability
    }

    /// Sends a report, which may arrive late.
    fn send(&mut self, observation: Observation) {
        let mut arrival = self.now.clone();
        if self.draw_bool(self.reports.late) {
            let rule = &self.reports.lateness;
            let lateness = rule.draw(&Rational::ZERO, &self.resolution, &mut self.rng);
            arrival += &lateness.max(Rational::ZERO);
        }
        self.coming.insert((arrival, self.count), observation);
        self.count += 1;
    }

    fn report(&mut self, observation: &Observation) {
        if self.draw_bool(self.reports.contradicted) {
            self.send(Observation {
                time: observation.time.clone(),
                event: opposite(&observation.event),
            });
        }
        if self.draw_bool(self.reports.lost) {
            return;
        }
        let copies = if self.draw_bool(self.reports.duplicated) {
            2
        } else {
            1
        };
        for _ in 0..copies {
            self.send(observation.clone());
        }
    }
}

impl<W: World> World for FaultInjector<W> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let mut told = Vec::new();
        while told.is_empty() {
            let arrival = self.coming.keys().next().map(|(time, _)| time.clone());
            let target = arrival.into_iter().chain([until.clone()]).min();
            let target = target.unwrap_or_default().max(self.now.clone());
            let passage = self.inner.wait(&target)?;
            self.now = passage.now.max(self.now.clone());
            for observation in &passage.observations {
                self.report(observation);
            }
            while let Some(entry) = self.coming.first_entry() {
                if entry.key().0 > self.now {
                    break;
                }
                told.push(entry.remove());
            }
            if self.now >= *until && passage.observations.is_empty() {
                break;
            }
        }
        Ok(TimeAdvance {
            now: self.now.clone(),
            observations: told,
        })
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        self.inner.look(facts, fluents)
    }
}

/// Returns a report that contradicts this one.
fn opposite(event: &Event) -> Event {
    let failed = |ticket: ActionHandle| Event::Ended {
        ticket,
        ending: Ending::Failed {
            why: "reported as failed".to_owned(),
        },
        measured: Vec::new(),
    };
    match event {
        Event::Started { ticket, .. }
        | Event::Ended {
            ticket,
            ending: Ending::Succeeded,
            ..
        } => failed(*ticket),
        Event::Ended { ticket, .. } => Event::Ended {
            ticket: *ticket,
            ending: Ending::Succeeded,
            measured: Vec::new(),
        },
        Event::Feedback { .. }
        | Event::Requested(_)
        | Event::PlanMade
        | Event::PlanReady
        | Event::Unintelligible { .. } => event.clone(),
        Event::Fact { fact, truth } => Event::Fact {
            fact: *fact,
            truth: !truth,
        },
        Event::Value { fluent, value } => Event::Value {
            fluent: *fluent,
            value: -value - Rational::ONE,
        },
    }
}
