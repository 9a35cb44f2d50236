//! Nominal state of an order: its state without failures.

use elbowroom_model::derivation::{Moment, holds};
use elbowroom_model::ground::{Condition, Expression, FactId};
use elbowroom_model::problem::Comparison;
use elbowroom_plan::InstanceId;

use crate::model::{Event, Model, Requirement, is_fact};
use crate::search_state::SearchState;

/// Truth value of a fact without failures. Numbers are not tracked here, so an effect whose
/// condition reads them may or may not take place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Truth {
    False,
    True,
    /// Undecided by the belief, or by an effect whose condition reads numbers, and nothing has
    /// decided it since.
    Open,
}

impl From<bool> for Truth {
    fn from(truth: bool) -> Self {
        if truth { Self::True } else { Self::False }
    }
}

/// Decision whether an effect takes place without failures.
#[derive(Clone, Copy, Debug)]
enum EffectStatus {
    TakesPlace,
    Skipped,
    /// It depends on numbers.
    Open,
}

/// Nominal state along an order.
#[derive(Clone, Debug)]
pub(crate) struct Nominal {
    truths: Vec<Truth>,
    undo: Vec<(usize, Truth)>,
}

impl Nominal {
    /// Returns the believed state, and `true` if the running actions can continue in it.
    pub(crate) fn new(model: &Model, circumstances: &SearchState) -> (Self, bool) {
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
            // Guards about the start have been decided: the remaining effects will take place.
            let start = model.event(model.start(running.instance));
            let memories = start.effects.iter().filter(|effect| effect.is_certain);
            for memory in memories {
                nominal.set(memory.fact, Truth::True);
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

    fn set(&mut self, fact: usize, truth: Truth) {
        let old = std::mem::replace(&mut self.truths[fact], truth);
        self.undo.push((fact, old));
    }

    /// Applies a happening. Returns `false` if its conditions, or those of the running actions, are
    /// impossible.
    pub(crate) fn apply(&mut self, model: &Model, event: &Event, running: &[InstanceId]) -> bool {
        self.apply_open(model, event) && self.stays_possible(model, running)
    }

    /// Like [`Self::apply`], for a happening that is followed by another one at the same moment:
    /// the over-all conditions of the running actions need not hold in between.
    pub(crate) fn apply_open(&mut self, model: &Model, event: &Event) -> bool {
        if !self.assume(model, &event.condition) {
            return false;
        }
        // Guards are read before any effect.
        let effects: Vec<(usize, bool, EffectStatus)> = event
            .effects
            .iter()
            .map(|effect| {
                (
                    effect.fact,
                    effect.makes_true,
                    self.effect_status(model, effect.guard.as_ref()),
                )
            })
            .collect();
        for makes_true in [false, true] {
            for &(fact, _, taking) in effects.iter().filter(|(_, truth, _)| *truth == makes_true) {
                match taking {
                    EffectStatus::TakesPlace => self.set(fact, Truth::from(makes_true)),
                    EffectStatus::Open if self.truths[fact] != Truth::from(makes_true) => {
                        self.set(fact, Truth::Open);
                    }
                    EffectStatus::Open | EffectStatus::Skipped => {}
                }
            }
        }
        true
    }

    /// Decides whether an effect with this guard takes place. Undecided facts are assumed to have
    /// the values with which it does.
    fn effect_status(&self, model: &Model, guard: Option<&Condition>) -> EffectStatus {
        let Some(guard) = guard else {
            return EffectStatus::TakesPlace;
        };
        match self.reading(model, guard) {
            Ok(true) => EffectStatus::TakesPlace,
            Ok(false) => EffectStatus::Skipped,
            Err(Open) => {
                let mut reads_numbers = false;
                model
                    .task()
                    .visit_fluents_of(guard, &mut |_| reads_numbers = true);
                // The memory of a start is undecided if it depends on numbers.
                guard.visit_facts(&mut |fact| reads_numbers |= !is_fact(fact));
                if reads_numbers {
                    EffectStatus::Open
                } else {
                    EffectStatus::TakesPlace
                }
            }
        }
    }

    /// Returns `true` if the over-all conditions of these actions hold now, with the guards of their effects.
    pub(crate) fn is_settled(&self, model: &Model, running: &[InstanceId]) -> bool {
        running.iter().all(|&id| {
            let start = model.event(model.start(id));
            let mut literals = start.over_all.literals.iter();
            let mut coupled = start.over_all.coupled.iter();
            let mut watches = start.guard_memories.iter();
            literals.all(|&(fact, truth)| self.truths[fact] == Truth::from(truth))
                && coupled.all(|coupled| self.reading(model, &coupled.condition) == Ok(true))
                && watches.all(|(memory, condition)| {
                    self.truths[*memory] == Truth::False
                        || self.reading(model, condition) == Ok(true)
                })
        })
    }

    /// Returns `true` if the over-all conditions of these actions may hold now.
    pub(crate) fn stays_possible(&mut self, model: &Model, running: &[InstanceId]) -> bool {
        running.iter().all(|&id| {
            let start = model.event(model.start(id));
            for (memory, condition) in &start.guard_memories {
                if self.is_certainly_false(model, condition) {
                    self.set(*memory, Truth::False);
                }
            }
            self.assume(model, &start.over_all)
        })
    }

    /// Returns `true` if a requirement may hold. Undecided facts get the required values.
    pub(crate) fn assume(&mut self, model: &Model, requirement: &Requirement) -> bool {
        for &(fact, truth) in &requirement.literals {
            match self.truths[fact] {
                Truth::Open => self.set(fact, truth.into()),
                own if own == Truth::from(truth) => {}
                _ => return false,
            }
        }
        requirement
            .coupled
            .iter()
            .all(|coupled| self.possible(model, &coupled.condition))
    }

    /// Returns `true` if the condition holds, or may hold.
    fn possible(&self, model: &Model, condition: &Condition) -> bool {
        self.reading(model, condition).unwrap_or(true)
    }

    fn is_certainly_false(&self, model: &Model, condition: &Condition) -> bool {
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
                holds(condition, &derivation.with_derived_facts(&basic, &derived))
            }
            _ => holds(condition, &basic),
        }
    }
}

/// The condition reads an undecided fact or a number, so it cannot be evaluated here; the network
/// handles it.
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
