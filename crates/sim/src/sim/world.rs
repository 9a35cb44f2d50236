//! Implementation of the port: commands and waits.

use std::sync::Arc;

use elbowroom_execution::{Command, Ending, Event, Observation, TimeAdvance, World, WorldError};
use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_num::Rational;

use super::{ComingEvent, CommandedAction, SimWorld};
use crate::draw::{Purpose, keyed};

impl World for SimWorld<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.advance(now, false);
        match command {
            Command::Start {
                ticket,
                action,
                duration,
            } => {
                let count = self.occurrences.entry(action.name.clone()).or_default();
                let occurrence = *count;
                *count += 1;
                self.actions.insert(
                    *ticket,
                    CommandedAction {
                        action: Arc::clone(action),
                        planned: duration.clone(),
                        occurrence,
                        has_started: false,
                        outcome: None,
                        is_broken: false,
                    },
                );
                let mut rng = keyed(self.seed, &action.name, occurrence, Purpose::Delay);
                let delay = self.model.delay(&action.name, &mut rng);
                if delay.is_positive() {
                    self.schedule(&self.now + delay, ComingEvent::Start(*ticket));
                } else {
                    self.start(*ticket);
                }
            }
            Command::Cancel { ticket } => {
                // An action that has broken down ends when it fails, and not before.
                let is_broken = |own: &CommandedAction<'_>| own.is_broken;
                if self.actions.get(ticket).is_some_and(is_broken) {
                    return Ok(());
                }
                if self.actions.remove(ticket).is_some() {
                    self.truth.stop(*ticket);
                    self.report(Event::Ended {
                        ticket: *ticket,
                        ending: Ending::Cancelled,
                        measured: Vec::new(),
                    });
                }
            }
        }
        Ok(())
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        self.advance(until, true);
        Ok(TimeAdvance {
            now: self.now.clone(),
            observations: std::mem::take(&mut self.unreported),
        })
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        let facts = facts.iter().map(|&fact| Event::Fact {
            fact,
            truth: self.truth.fact(fact),
        });
        let values = fluents.iter().filter_map(|&fluent| {
            Some(Event::Value {
                fluent,
                value: self.truth.value(fluent)?.clone(),
            })
        });
        let events = facts.chain(values).map(|event| Observation {
            time: self.now.clone(),
            event,
        });
        Ok(events.collect())
    }
}
