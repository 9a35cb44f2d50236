//! What an order does when nothing goes wrong.

use elbowroom_model::derivation::{Moment, holds};
use elbowroom_model::ground::{Condition, Expression, FactId};
use elbowroom_model::problem::Comparison;
use elbowroom_plan::InstanceId;

use crate::circumstances::Circumstances;
use crate::model::{Event, Model, Requirement};

/// The truth of a fact if nothing goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Truth {
    False,
    True,
    /// The belief leaves it open, and nothing has decided it since.
    Open,
}

impl From<bool> for Truth {
    fn from(truth: bool) -> Self {
        if truth { Self::True } else { Self::False }
    }
}

/// The nominal state along an order.
#[derive(Clone, Debug)]
pub(crate) struct Nominal {
    truths: Vec<Truth>,
    undo: Vec<(usize, Truth)>,
}

impl Nominal {
    /// The state as it is believed, and whether the actions under way can go on in it.
    pub(crate) fn new(model: &Model, circumstances: &Circumstances) -> (Self, bool) {
        let belief = &circumstances.belief;
        let truth = |&fact: &FactId| match belief.probability(fact) {
            p if p <= 0.0 => Truth::False,
            p if p >= 1.0 => Truth::True,
            _ => Truth::Open,
        };
        let mut nominal = Self {
            truths: model.facts.iter().map(truth).collect(),
            undo: Vec::new(),
        };
        let mut under_way = Vec::new();
        for running in &circumstances.running {
            under_way.push(running.instance);
            // Guards of the start have been decided: the effects that are left will take place.
            let start = model.event(model.start(running.instance));
            let memories = start.effects.iter().filter(|effect| effect.is_certain);
            for memory in memories {
                nominal.set(memory.fact, true);
            }
        }
        let works = nominal.stays_possible(model, &under_way);
        (nominal, works)
    }

    pub(crate) fn truth(&self, fact: usize) -> Truth {
        self.truths[fact]
    }

    pub(crate) fn checkpoint(&self) -> usize {
        self.undo.len()
    }

    pub(crate) fn undo_to(&mut self, checkpoint: usize) {
        while self.undo.len() > checkpoint {
            if let Some((fact, truth)) = self.undo.pop() {
                self.truths[fact] = truth;
            }
        }
    }

    fn set(&mut self, fact: usize, truth: bool) {
        let old = std::mem::replace(&mut self.truths[fact], truth.into());
        self.undo.push((fact, old));
    }

    /// Does a happening, if its conditions, and those of the actions under way, leave it possible.
    pub(crate) fn apply(&mut self, model: &Model, event: &Event, running: &[InstanceId]) -> bool {
        if !self.admit(model, &event.condition) {
            return false;
        }
        let takes_place = |guard: &Option<Condition>| match guard {
            None => true,
            Some(guard) => self.possible(model, guard) && !self.surely_not(model, guard),
        };
        let effects: Vec<(usize, bool)> = event
            .effects
            .iter()
            .filter(|effect| takes_place(&effect.guard))
            .map(|effect| (effect.fact, effect.makes_true))
            .collect();
        for makes_true in [false, true] {
            for &(fact, _) in effects.iter().filter(|(_, truth)| *truth == makes_true) {
                self.set(fact, makes_true);
            }
        }
        self.stays_possible(model, running)
    }

    /// Whether what is needed throughout these actions may hold now.
    fn stays_possible(&mut self, model: &Model, running: &[InstanceId]) -> bool {
        running.iter().all(|&id| {
            let start = model.event(model.start(id));
            for (memory, condition) in &start.watches {
                if self.surely_not(model, condition) {
                    self.set(*memory, false);
                }
            }
            self.admit(model, &start.over_all)
        })
    }

    /// Whether a requirement may hold; if so, what was open is decided as it says.
    pub(crate) fn admit(&mut self, model: &Model, requirement: &Requirement) -> bool {
        for &(fact, truth) in &requirement.literals {
            match self.truths[fact] {
                Truth::Open => self.set(fact, truth),
                own if own == Truth::from(truth) => {}
                _ => return false,
            }
        }
        requirement
            .coupled
            .iter()
            .all(|coupled| self.possible(model, &coupled.condition))
    }

    /// Whether the condition holds, or may hold.
    fn possible(&self, model: &Model, condition: &Condition) -> bool {
        self.reading(model, condition).unwrap_or(true)
    }

    fn surely_not(&self, model: &Model, condition: &Condition) -> bool {
        self.reading(model, condition) == Ok(false)
    }

    fn reading(&self, model: &Model, condition: &Condition) -> Result<bool, Open> {
        let basic = Reading {
            model,
            nominal: self,
        };
        match model.task().derivation() {
            Some(derivation) if derivation.is_read_by(condition) => {
                let derived = derivation.derive(&basic);
                holds(condition, &derivation.on_top_of(&basic, &derived))
            }
            _ => holds(condition, &basic),
        }
    }
}

/// A fact that is open, or a number; those are the network's business.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Open;

struct Reading<'a> {
    model: &'a Model,
    nominal: &'a Nominal,
}

impl Moment<Open> for Reading<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, Open> {
        match self.model.position(fact).map(|at| self.nominal.truths[at]) {
            Some(Truth::True) => Ok(true),
            Some(Truth::Open) => Err(Open),
            Some(Truth::False) | None => Ok(false),
        }
    }

    fn compare(&self, _: Comparison, _: &Expression, _: &Expression) -> Result<bool, Open> {
        Err(Open)
    }
}
