//! Active processes, and the rates of change that they cause.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::ground::FluentId;
use elbowroom_num::Rational;

use super::super::condition::ReadTime;
use super::{Phase, event_label, process_label};
use crate::linear::Linear;
use crate::obligations::Refusal;

impl Phase<'_> {
    /// Determines the processes that are active right after the moment, and executes the events
    /// whose conditions hold right after it.
    pub(super) fn settle(&mut self) -> Result<(), Refusal> {
        loop {
            self.find_active_processes()?;
            let mut ready = Vec::new();
            let mut demands = Vec::new();
            for (index, event) in self.autonomous_of_task().events.iter().enumerate() {
                let (condition, zero) = (&event.snap.condition, Rational::ZERO);
                let view = self.view(&self.now);
                let holds = view.holds(condition, ReadTime::RightAfter(&zero))?;
                let broken = view.violations_after(condition, holds)?;
                demands.push((event_label(event, holds), broken));
                if holds {
                    ready.push(index);
                }
            }
            if ready.is_empty() {
                // No event's condition holds in the part that follows, which is enough.
                return Ok(());
            }
            for (course, broken) in demands {
                self.require_nominal(&course, broken)?;
            }
            self.require_conditions_now(false)?;
            self.next_is_strictly_later = true;
            self.execute_simultaneously(&ready, true)?;
        }
    }

    pub(super) fn find_active_processes(&mut self) -> Result<(), Refusal> {
        let processes = &self.autonomous_of_task().processes;
        let zero = Rational::ZERO;
        let mut on = Vec::new();
        for process in processes {
            self.refuse_derived_numbers(&process.condition, &process.name)?;
            let holds = (self.view(&self.now)).holds(&process.condition, ReadTime::At(&zero))?;
            self.require_now(
                &process.condition,
                holds,
                &process_label(&process.name, holds),
            )?;
            on.push(holds);
        }
        let mut tried = BTreeSet::new();
        loop {
            self.rates = self.rates_under(&on)?;
            let mut then = Vec::new();
            for process in processes {
                let view = self.view(&self.now);
                let holds = view.holds(&process.condition, ReadTime::RightAfter(&zero))?;
                let broken = view.violations_after(&process.condition, holds)?;
                self.require_nominal(&process_label(&process.name, holds), broken)?;
                then.push(holds);
            }
            if then == on {
                self.is_active = on;
                return Ok(());
            }
            if !tried.insert(std::mem::replace(&mut on, then)) {
                return Err(self.obstacle("a process would start and stop infinitely often"));
            }
        }
    }

    /// Returns the rates of all numbers that change while these processes are active.
    fn rates_under(&self, on: &[bool]) -> Result<BTreeMap<FluentId, Linear>, Refusal> {
        let mut rates: BTreeMap<FluentId, Linear> = BTreeMap::new();
        for (fluent, rate) in &self.drifts {
            let sum = rates.entry(*fluent).or_default();
            *sum = sum.plus(rate);
        }
        let mut read = Vec::new();
        let processes = self.autonomous_of_task().processes.iter();
        for (process, _) in processes.zip(on).filter(|(_, on)| **on) {
            for effect in &process.effects {
                let rate = self.view(&self.now).value(&effect.rate)?;
                if !rate.times.is_empty() || !rate.products.is_empty() {
                    return Err(Refusal::NotLinear {
                        place: process.name.clone(),
                        expression: self.compiler.task.describe_expression(&effect.rate),
                    });
                }
                effect
                    .rate
                    .visit_fluents(&mut |fluent| read.push((fluent, process, effect.fluent)));
                let sum = rates.entry(effect.fluent).or_default();
                *sum = sum.plus(&rate);
            }
        }
        match read
            .iter()
            .find(|(fluent, _, _)| rates.contains_key(fluent))
        {
            None => {
                rates.retain(|_, rate| *rate != Linear::default());
                Ok(rates)
            }
            Some((_, process, changed)) => Err(Refusal::ChangingRate {
                place: process.name.clone(),
                fluent: self.compiler.task.fluent_name(*changed),
            }),
        }
    }
}
