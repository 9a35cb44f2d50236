//! Success probability of an order, step by step: [`PrunedNetwork`].

mod clock;
mod cluster;
mod effects;
mod facts;
mod ledger;
mod numbers;
mod outcome;

use elbowroom_model::ground::{Condition, Expression};
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};

use crate::model::{Event, Model, Requirement};
use crate::search_state::SearchState;
use clock::Clock;
use facts::Facts;
pub(crate) use facts::Snapshot;
use ledger::Ledger;
pub use ledger::{Loss, LossCause, Reading};
pub(crate) use numbers::Number;
use numbers::Numbers;
use outcome::Outcome;

/// A condition couples more facts than can be tracked exactly.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the success of {happening} depends on {count} uncertain facts; exact calculation supports at \
     most {most}"
)]
pub struct TooCoupled {
    /// The happening with the condition or effect.
    pub happening: String,
    /// Number of facts that would be coupled.
    pub count: usize,
    /// Largest number supported.
    pub most: usize,
}

/// A sequence of happenings.
#[derive(Clone, Copy, Debug)]
pub struct Happenings<'a> {
    /// The happenings.
    pub sequence: &'a [NodeId],
    /// For each happening, `true` if it comes at the moment of the previous one, so that no
    /// over-all condition is required in between; `false` beyond the end of this list.
    pub joined: &'a [bool],
}

impl<'a> From<&'a [NodeId]> for Happenings<'a> {
    /// Creates a sequence without joined happenings.
    fn from(sequence: &'a [NodeId]) -> Self {
        Self {
            sequence,
            joined: &[],
        }
    }
}

impl<'a> From<&'a Vec<NodeId>> for Happenings<'a> {
    fn from(sequence: &'a Vec<NodeId>) -> Self {
        sequence.as_slice().into()
    }
}

impl<'a> Happenings<'a> {
    /// Returns the happenings from a position on.
    pub(crate) fn suffix(self, position: usize) -> Self {
        Self {
            sequence: &self.sequence[position..],
            joined: self.joined.get(position..).unwrap_or_default(),
        }
    }

    /// Returns each happening, with `true` if the next one comes at the same moment.
    pub(crate) fn nodes(self) -> impl Iterator<Item = (NodeId, bool)> + 'a {
        let is_open = move |at: usize| self.joined.get(at + 1) == Some(&true);
        let happenings = self.sequence.iter().enumerate();
        happenings.map(move |(at, node)| (*node, is_open(at)))
    }
}

/// Paper 2's dynamic Bayesian network, pruned, for the order pushed until now.
///
/// [`PrunedNetwork::push`] adds a happening and [`PrunedNetwork::pop`] removes the last one. Both
/// take time proportional to the number of facts and numbers that the happening reads and writes,
/// independent of the length of the order. `docs/research/probability.md` defines the computed values and
/// explains why they are exact.
#[derive(Clone, Debug)]
pub struct PrunedNetwork<'m> {
    model: &'m Model,
    facts: Facts,
    numbers: Numbers,
    /// Remaining durations of actions that were running initially.
    remaining: Vec<(InstanceId, Option<Rational>)>,
    /// Running actions, sorted by start.
    running: Vec<InstanceId>,
    clock: Clock,
    /// P(A), including the over-all conditions of running actions.
    probability: f64,
    /// Number of numeric conditions that are assumed to hold, because their numbers depend on time.
    assumed: usize,
    sequence: Vec<NodeId>,
    /// By happening, `true` if it comes at the same moment as the next one; see
    /// [`PrunedNetwork::push_open`].
    is_open: Vec<bool>,
    marks: Vec<Mark>,
    undo: Vec<Undo>,
    ledger: Ledger,
}

/// State that [`PrunedNetwork::pop`] restores.
#[derive(Clone, Copy, Debug)]
struct Mark {
    facts: facts::Checkpoint,
    undo: usize,
    now: f64,
    probability: f64,
    assumed: usize,
}

#[derive(Clone, Debug)]
enum Undo {
    Number(usize, Number),
    Started,
    /// Position, action, and planned end.
    Ended(usize, InstanceId, f64),
}

impl<'m> PrunedNetwork<'m> {
    /// Creates the network without a happening.
    ///
    /// # Errors
    /// When over-all conditions of running actions couple too many facts.
    pub fn new(model: &'m Model, circumstances: &SearchState) -> Result<Self, TooCoupled> {
        Self::with(model, circumstances, Ledger::default())
    }

    fn with(
        model: &'m Model,
        circumstances: &SearchState,
        ledger: Ledger,
    ) -> Result<Self, TooCoupled> {
        let mut network = Self {
            model,
            facts: Facts::new(model, &circumstances.belief),
            numbers: Numbers::new(model, &circumstances.values),
            remaining: Vec::new(),
            running: Vec::new(),
            clock: Clock::at(&circumstances.now),
            probability: 1.0,
            assumed: 0,
            sequence: Vec::new(),
            is_open: Vec::new(),
            marks: Vec::new(),
            undo: Vec::new(),
            ledger,
        };
        for running in &circumstances.running {
            let event = model.event(model.start(running.instance));
            let elapsed = &circumstances.now - &running.start;
            let remaining = event.duration.as_ref().map(|duration| duration - &elapsed);
            network.remaining.push((running.instance, remaining));
            network.running.push(running.instance);
            let end = running.start.to_f64() + model.min_duration(running.instance);
            network.clock.ends.push(end);
            for (fluent, _) in &event.continuous {
                let number = &mut network.numbers.changing[*fluent];
                *number = Numbers::after_effect_start(number);
            }
            // The parts of guards about the start have been decided: the action does not contain
            // effects that will not take place, and the others will.
            for (memory, _) in &event.guard_memories {
                network.facts.set_certain(*memory, true);
            }
            for effect in event.effects.iter().filter(|effect| effect.is_certain) {
                network.facts.set_certain(effect.fact, true);
            }
        }
        network.require_throughout(NodeId::ZERO)?;
        Ok(network)
    }

    /// Returns the model.
    pub fn model(&self) -> &'m Model {
        self.model
    }

    /// Returns the current sequence.
    pub fn sequence(&self) -> &[NodeId] {
        &self.sequence
    }

    /// Returns the actions that have started and not ended, sorted by start.
    pub fn running(&self) -> &[InstanceId] {
        &self.running
    }

    /// Returns P(A), the probability that all happenings until now succeed.
    ///
    /// While actions are running, their over-all conditions until now are included, because every
    /// order contains their ends. If none is running, this is the paper's P(A).
    #[doc(alias = "P(A)")]
    pub fn actions_probability(&self) -> f64 {
        self.probability
    }

    /// Returns P(A ∩ G), the probability that all happenings succeed and the goal holds after them.
    ///
    /// # Errors
    /// When the goal couples too many facts.
    #[doc(alias = "P(A and G)")]
    pub fn success_probability(&mut self) -> Result<f64, TooCoupled> {
        let before = self.mark();
        let model = self.model;
        let required = self.require(&model.goal, NodeId::ZERO, Reading::Goal);
        let probability = self.probability;
        self.restore(before);
        required.map(|()| probability)
    }

    /// Returns the losses of an order's probability, in the order of its happenings; those of the
    /// goal come last. The masses and P(A ∩ G) add up to 1.
    ///
    /// # Errors
    /// When a condition couples too many facts.
    pub fn losses(
        model: &'m Model,
        circumstances: &SearchState,
        happenings: Happenings<'_>,
    ) -> Result<Vec<Loss>, TooCoupled> {
        let mut network = Self::with(model, circumstances, Ledger::recording())?;
        network.push_all(happenings)?;
        network.require(&model.goal, NodeId::ZERO, Reading::Goal)?;
        Ok(network.ledger.close())
    }

    /// Returns the number of numeric conditions that are assumed to hold, because they read numbers
    /// that depend on the times of happenings, not only on their order.
    pub fn assumed_conditions(&self) -> usize {
        self.assumed
    }

    /// Returns the probability that a fact holds now, given that all happenings until now
    /// succeeded.
    pub fn marginal(&mut self, fact: elbowroom_model::ground::FactId) -> Option<f64> {
        let position = self.model.position(fact)?;
        Some(self.marginal_at(position))
    }

    pub(crate) fn marginal_at(&mut self, position: usize) -> f64 {
        self.facts.marginal(self.model, position)
    }

    /// Returns the present distribution of the facts, for comparisons.
    pub(crate) fn snapshot(&mut self, is_relevant: &dyn Fn(usize) -> bool) -> facts::Snapshot {
        self.facts.snapshot(self.model, is_relevant)
    }

    pub(crate) fn number(&self, fluent: usize) -> &Number {
        &self.numbers.changing[fluent]
    }

    /// Adds a happening; returns [`PrunedNetwork::actions_probability`].
    ///
    /// The happening must be possible: for an end, its action is running; for a start, it is not.
    ///
    /// # Errors
    /// When it couples too many facts; then nothing is added.
    pub fn push(&mut self, node: NodeId) -> Result<f64, TooCoupled> {
        self.push_as(node, false)
    }

    /// Adds a happening that is followed by another one at the same moment. Over-all conditions of
    /// running actions are required only after the last happening of the moment.
    ///
    /// # Errors
    /// When it couples too many facts; then nothing is added.
    pub fn push_open(&mut self, node: NodeId) -> Result<f64, TooCoupled> {
        self.push_as(node, true)
    }

    /// Adds happenings.
    ///
    /// # Errors
    /// When one of them couples too many facts.
    pub fn push_all(&mut self, happenings: Happenings<'_>) -> Result<(), TooCoupled> {
        for (node, is_open) in happenings.nodes() {
            self.push_as(node, is_open)?;
        }
        Ok(())
    }

    pub(crate) fn push_as(&mut self, node: NodeId, is_open: bool) -> Result<f64, TooCoupled> {
        let before = self.mark();
        if let Err(error) = self.apply_event(node, self.model.event(node), is_open) {
            self.restore(before);
            return Err(error);
        }
        self.marks.push(before);
        self.sequence.push(node);
        self.is_open.push(is_open);
        Ok(self.probability)
    }

    /// Returns `true` if another happening has to follow at the moment of the last one.
    pub(crate) fn is_open(&self) -> bool {
        self.is_open.last() == Some(&true)
    }

    /// Returns the happenings of the last moment: the last one, and those before it that it is
    /// joined with.
    pub(crate) fn moment(&self) -> &[NodeId] {
        let before = self.is_open.iter().rev().skip(1);
        let joined = before.take_while(|is_open| **is_open).count();
        let last = self.sequence.len().saturating_sub(1 + joined);
        &self.sequence[last..]
    }

    /// Returns, for each happening, `true` if it comes at the moment of the previous one.
    pub(crate) fn joined(&self) -> Vec<bool> {
        let before = std::iter::once(&false).chain(&self.is_open);
        before.take(self.is_open.len()).copied().collect()
    }

    /// Returns `true` if no over-all condition of a running action is certainly false.
    pub(crate) fn may_be_settled(&mut self) -> bool {
        let model = self.model;
        (0..self.running.len()).all(|place| {
            let over_all = &model.event(model.start(self.running[place])).over_all;
            let mut literals = over_all.literals.iter();
            let are_possible = literals.all(|&(fact, truth)| {
                let p = self.marginal_at(fact);
                if truth { p > 0.0 } else { p < 1.0 }
            });
            let coupled = over_all.coupled.iter().map(|coupled| &coupled.condition);
            let mut conditions = over_all.numeric.iter().chain(coupled);
            are_possible && conditions.all(|condition| self.truth(condition) != Some(false))
        })
    }

    /// Adds a failed attempt to start an action, or a failed end, although its conditions hold.
    /// Facts change by themselves, and the attempt can be repeated. A failed end has the effects of
    /// the failure; if there are several possible outcomes, the result is 0. Returns the
    /// probability of the sequence.
    ///
    /// This cannot be undone by [`Self::pop`].
    ///
    /// # Errors
    /// When its condition couples too many facts.
    pub(crate) fn push_failure(&mut self, node: NodeId) -> Result<f64, TooCoupled> {
        if let Node::End(id) = self.model.plan().nodes[node.index()] {
            let Some(failed) = self.model.failed_end_event(node) else {
                self.probability = 0.0;
                return Ok(0.0);
            };
            self.apply_event(node, &failed, false)?;
            // The remaining duration is only valid for the first run.
            self.remaining.retain(|(running, _)| *running != id);
            return Ok(self.probability);
        }
        let event = self.model.event(node);
        self.require(&event.condition, node, Reading::OnArrival)?;
        self.probability *= 1.0 - event.success;
        self.facts.apply(self.model, &[], true);
        self.require_throughout(node)?;
        Ok(self.probability)
    }

    /// Removes the last happening.
    pub fn pop(&mut self) {
        if let Some(mark) = self.marks.pop() {
            self.sequence.pop();
            self.is_open.pop();
            self.restore(mark);
        }
    }

    /// Applies a happening, given as an event.
    fn apply_event(
        &mut self,
        node: NodeId,
        event: &Event,
        is_open: bool,
    ) -> Result<(), TooCoupled> {
        let model = self.model;
        if !self.is_open() {
            self.advance_to(node)?;
        }
        self.require(&event.condition, node, Reading::OnArrival)?;
        let is_end = matches!(model.plan().nodes[node.index()], Node::End(_));
        self.multiply(event.success, (node, Reading::OnArrival), || {
            if is_end {
                LossCause::End
            } else {
                LossCause::Start
            }
        });
        let updates = self.updates(node, event);
        self.apply_fact_effects(node, event)?;
        for (fluent, number) in updates {
            self.set_number(fluent, number);
        }
        match model.plan().nodes[node.index()] {
            Node::Start(id) => {
                self.running.push(id);
                self.clock
                    .ends
                    .push(self.clock.now + model.min_duration(id));
                self.undo.push(Undo::Started);
            }
            Node::End(id) => {
                if let Some(place) = self.running.iter().position(|&running| running == id) {
                    self.running.remove(place);
                    let end = self.clock.ends.remove(place);
                    self.undo.push(Undo::Ended(place, id, end));
                }
            }
            Node::Zero | Node::Instant(_) | Node::Timed(_) => {}
        }
        if is_open {
            return Ok(());
        }
        self.require_throughout(node)
    }

    /// Multiplies the probability, and records the loss.
    fn multiply(
        &mut self,
        mass: f64,
        (node, reading): (NodeId, Reading),
        cause: impl FnOnce() -> LossCause,
    ) {
        let before = self.probability;
        self.probability *= mass;
        let position = match reading {
            Reading::Goal => self.sequence.len().checked_sub(1),
            _ => (node != NodeId::ZERO).then_some(self.sequence.len()),
        };
        let masses = (before, self.probability);
        self.ledger.record(position, reading, masses, cause);
    }

    /// Requires, in the present layer, the over-all conditions of the running actions.
    fn require_throughout(&mut self, node: NodeId) -> Result<(), TooCoupled> {
        let model = self.model;
        for place in 0..self.running.len() {
            let id = self.running[place];
            let start = model.event(model.start(id));
            self.require(&start.over_all, node, Reading::Throughout(id))?;
            for (memory, condition) in &start.guard_memories {
                let forget = Outcome {
                    fact: *memory,
                    makes_true: false,
                    probability: 1.0,
                    is_certain: true,
                };
                let unless = Condition::Not(Box::new(condition.clone()));
                match self.truth(&unless) {
                    Some(false) => {}
                    Some(true) => self.facts.set_certain_later(*memory, false),
                    None => {
                        let guarded = [(Some(unless), forget)];
                        self.transform_facts(node, &guarded, false)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Conditions the distribution on a requirement in the present layer.
    fn require(
        &mut self,
        requirement: &Requirement,
        node: NodeId,
        reading: Reading,
    ) -> Result<(), TooCoupled> {
        let model = self.model;
        for &(fact, truth) in &requirement.literals {
            let mass = self.facts.require(model, fact, truth);
            let fact = model.facts[fact];
            self.multiply(mass, (node, reading), || LossCause::Fact { fact, truth });
        }
        for condition in &requirement.numeric {
            match self.truth(condition) {
                Some(true) => {}
                Some(false) => {
                    self.multiply(0.0, (node, reading), || {
                        LossCause::Condition(condition.clone())
                    });
                }
                None => self.assumed += 1,
            }
        }
        for coupled in &requirement.coupled {
            let numbers = &self.numbers;
            let value = |leaf: &Expression| numbers.value(model, leaf, None);
            let required =
                self.facts
                    .require_coupled(model, &coupled.condition, &coupled.facts, &value);
            match required {
                Ok((mass, rests_on_time)) => {
                    self.multiply(mass, (node, reading), || {
                        LossCause::Condition(coupled.condition.clone())
                    });
                    self.assumed += usize::from(rests_on_time);
                }
                Err(count) => return Err(self.too_coupled(node, count)),
            }
        }
        Ok(())
    }

    /// Returns the truth value of a condition if it is certain, else `None`.
    fn truth(&mut self, condition: &Condition) -> Option<bool> {
        let (model, numbers) = (self.model, &self.numbers);
        let value = |leaf: &Expression| numbers.value(model, leaf, None);
        self.facts.truth(model, condition, &value)
    }

    fn too_coupled(&self, node: NodeId, count: usize) -> TooCoupled {
        TooCoupled {
            happening: self.model.describe_node(node),
            count,
            most: facts::MAX_COUPLED,
        }
    }

    fn mark(&self) -> Mark {
        Mark {
            facts: self.facts.checkpoint(),
            undo: self.undo.len(),
            now: self.clock.now,
            probability: self.probability,
            assumed: self.assumed,
        }
    }

    fn restore(&mut self, mark: Mark) {
        while self.undo.len() > mark.undo {
            match self.undo.pop() {
                Some(Undo::Number(fluent, number)) => self.numbers.changing[fluent] = number,
                Some(Undo::Started) => {
                    self.running.pop();
                    self.clock.ends.pop();
                }
                Some(Undo::Ended(place, id, end)) => {
                    self.running.insert(place, id);
                    self.clock.ends.insert(place, end);
                }
                None => {}
            }
        }
        self.facts.undo_to(mark.facts);
        self.clock.now = mark.now;
        self.probability = mark.probability;
        self.assumed = mark.assumed;
    }
}
