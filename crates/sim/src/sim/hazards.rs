//! Spontaneous changes of facts at a rate.

use elbowroom_execution::Event;
use elbowroom_model::ground::FactId;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::Exp1;

use super::{ComingEvent, SimWorld};
use crate::draw::{Purpose, keyed, rounded};

/// The moments at which a fact changes unless it already has that value: a Poisson process.
/// Restricted to the moments at which the fact has the other value, it is memoryless as well, and
/// independent of the executor's actions.
#[derive(Clone, Debug)]
pub(super) struct PoissonProcess {
    fact: FactId,
    becomes: bool,
    /// Changes per second.
    rate: f64,
    is_reported: bool,
    /// The last of these moments, in seconds, without rounding.
    at: f64,
    rng: ChaCha8Rng,
}

impl SimWorld<'_> {
    /// Adds the first such moment of each fact from now on to the agenda.
    pub(super) fn schedule_spontaneous_changes(&mut self) {
        let task = self.truth.task().clone();
        for (name, hazard) in self.model.hazardous(task.problem()) {
            // The arguments have the right types, so the fact exists.
            let Some(fact) = task.fact_named(&name) else {
                continue;
            };
            for becomes in [false, true] {
                let rate = hazard.rate(becomes);
                if rate > 0.0 {
                    self.spontaneous_changes.push(PoissonProcess {
                        fact,
                        becomes,
                        rate,
                        is_reported: hazard.is_reported,
                        at: self.now.to_f64(),
                        rng: keyed(self.seed, &name, u64::from(becomes), Purpose::Hazard),
                    });
                    self.schedule_next_change(self.spontaneous_changes.len() - 1);
                }
            }
        }
    }

    /// Adds the next such moment to the agenda.
    fn schedule_next_change(&mut self, index: usize) {
        let chance = &mut self.spontaneous_changes[index];
        let pause: f64 = chance.rng.sample(Exp1);
        chance.at += pause / chance.rate;
        let time = rounded(chance.at, &self.model.resolution);
        self.schedule(time, ComingEvent::SpontaneousChange(index));
    }

    /// Processes such a moment: changes the fact if it has the other value.
    pub(super) fn process_spontaneous_change(&mut self, index: usize) {
        let chance = &self.spontaneous_changes[index];
        let (fact, truth, is_reported) = (chance.fact, chance.becomes, chance.is_reported);
        if self.truth.fact(fact) != truth {
            self.truth.change_fact(fact, truth);
            if is_reported {
                self.report(Event::Fact { fact, truth });
            }
        }
        self.schedule_next_change(index);
    }
}
