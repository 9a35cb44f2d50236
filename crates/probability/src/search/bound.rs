//! Upper bound of the probability of all continuations of a sequence, and lower bound of their
//! length.
//!
//! The paper bounds P(A ∩ G) by P(A) (Proposition 3). This bound is weak: it ignores that the
//! needed actions may fail, that the probability of their conditions decays in the meantime, and
//! that achieved goals must last until the end. In addition to P(A), this bound includes:
//!
//! - *Needed instances*: running ones, and those without which a goal or a needed instance has no
//!   support without failures (only if orders must work nominally). Each contributes the success
//!   probability of its start.
//! - *Facts*: each needed fact contributes the probability that it is true, once. This probability
//!   is at most the best value of its Markov chain, and of the remaining effects on it.
//! - *Queueing*: needed instances end one after another, and each starts before it ends. The j-th
//!   end comes after `j - 1` ends and at least `j - running` starts. The conditions of an end decay
//!   until then, and its effects decay afterwards, while the others end. The best assignment of
//!   ends to ranks bounds the product.

use elbowroom_plan::InstanceId;

use super::assignment;
use super::chain::Chain;
use super::coupling::Couplings;
use super::nominal::{Nominal, Truth};
use super::queue::Queue;
use super::separations::Separations;
use crate::model::{Event, Model, Requirement, Semantics};
use crate::network::PrunedNetwork;

/// Data of a model for the bound, computed once for all searches.
#[derive(Clone, Debug)]
pub(crate) struct Bounds {
    /// For each fact, the instances that change it; `None` for timed initials.
    setters: Vec<Vec<Setter>>,
    /// End and over-all conditions of each instance.
    needs_at_end: Vec<Vec<(usize, bool)>>,
    /// Over-all conditions of each instance.
    needs_throughout: Vec<Vec<(usize, bool)>>,
    /// Start conditions of each instance.
    needs_at_start: Vec<Vec<(usize, bool)>>,
    goal: Vec<(usize, bool)>,
    /// For each instance, the positions in `goal` of the facts that its end changes.
    goal_at_end: Vec<Vec<usize>>,
}

/// Bound for all completions of a sequence.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bound {
    /// Upper bound of P(A ∩ G).
    pub(crate) probability: f64,
    /// Lower bound of the number of happenings of the order, including those of the sequence. Among
    /// equally likely orders, the shortest one is preferred. A world without uncertainty has many
    /// such orders, and without this bound the search would examine all of them.
    pub(crate) length: usize,
}

impl Bound {
    /// Bound of a sequence that cannot become an order.
    pub(crate) const IMPOSSIBLE: Self = Self {
        probability: 0.0,
        length: usize::MAX,
    };

    /// Returns the bound of a sequence that is continued at the same moment. Over-all conditions
    /// are not included, because the next happening may make them true.
    pub(crate) fn of_start(network: &PrunedNetwork<'_>) -> Self {
        Self {
            probability: network.actions_probability() * (1.0 + 1e-12),
            length: network.sequence().len() + 1,
        }
    }
}

/// An effect that changes a fact.
#[derive(Clone, Copy, Debug)]
struct Setter {
    by: Option<InstanceId>,
    at_end: bool,
    makes_true: bool,
    /// P(true) afterwards, or `None` if it depends on the previous value.
    leaves: Option<f64>,
    /// `true` if the effect has no condition.
    is_unconditional: bool,
}

/// State of the search that the bound reads.
pub(crate) struct BoundContext<'a> {
    pub(crate) nominal: &'a Nominal,
    /// `true` if the order must work without failures.
    pub(crate) must_work: bool,
    pub(crate) is_free: &'a dyn Fn(InstanceId) -> bool,
    /// `true` if timed initials are pending.
    pub(crate) has_timed: bool,
}

impl Bounds {
    pub(crate) fn of(model: &Model, separations: &Separations, couplings: &Couplings) -> Self {
        let mut setters = vec![Vec::new(); model.facts.len()];
        let mut note = |event: &Event, by: Option<InstanceId>, at_end: bool| {
            for effect in &event.effects {
                let p = effect.probability;
                let leaves = match model.semantics() {
                    Semantics::Paper if effect.makes_true => Some(p),
                    Semantics::Paper => Some(1.0 - p),
                    Semantics::World => None,
                };
                setters[effect.fact].push(Setter {
                    by,
                    at_end,
                    makes_true: effect.makes_true,
                    leaves: leaves.filter(|_| effect.guard.is_none() && !effect.is_certain),
                    is_unconditional: effect.guard.is_none(),
                });
            }
        };
        let mut needs_at_start = Vec::new();
        let mut needs_at_end = Vec::new();
        let mut needs_throughout = Vec::new();
        for (id, _) in model.plan().instances() {
            let (start, end) = (separations.starts[id.index()], separations.ends[id.index()]);
            note(model.event(start), Some(id), false);
            needs_at_start.push(model.event(start).condition.literals.clone());
            let is_coupled = couplings.is_coupled(start) || couplings.is_coupled(end);
            let over_all = if is_coupled {
                // Between happenings of one moment, over-all conditions are not required.
                Vec::new()
            } else {
                model.event(start).over_all.literals.clone()
            };
            let mut needs = Vec::new();
            if start != end {
                note(model.event(end), Some(id), true);
                needs.extend(&model.event(end).condition.literals);
                needs.extend(&over_all);
                needs.sort_unstable();
                needs.dedup();
            }
            needs_at_end.push(needs);
            needs_throughout.push(over_all);
        }
        for (node, _) in &separations.timed {
            note(model.event(*node), None, false);
        }
        let Requirement { literals: goal, .. } = model.goal.clone();
        let mut goal_at_end = vec![Vec::new(); needs_at_end.len()];
        for (place, (fact, _)) in goal.iter().enumerate() {
            for setter in &setters[*fact] {
                if let (Some(id), true) = (setter.by, setter.at_end) {
                    let own: &mut Vec<usize> = &mut goal_at_end[id.index()];
                    if own.last() != Some(&place) {
                        own.push(place);
                    }
                }
            }
        }
        Self {
            setters,
            needs_at_end,
            needs_throughout,
            needs_at_start,
            goal,
            goal_at_end,
        }
    }

    /// Returns a bound for every continuation, including the empty one.
    pub(crate) fn bound(
        &self,
        model: &Model,
        network: &mut PrunedNetwork<'_>,
        action_values: &BoundContext<'_>,
        separations: &Separations,
    ) -> Bound {
        let probability = network.actions_probability();
        if probability <= 0.0 {
            return Bound::IMPOSSIBLE;
        }
        let Some(needed) = self.needed(network, action_values) else {
            return Bound::IMPOSSIBLE;
        };
        let is_durative = |id: &&InstanceId| {
            let (start, end) = (separations.starts[id.index()], separations.ends[id.index()]);
            start != end
        };
        let unstarted = needed.len() - network.running().len();
        let ends = needed.iter().filter(is_durative).count();
        let length = network.sequence().len() + unstarted + ends;
        let mut run = Run {
            bounds: self,
            model,
            network,
            action_values,
            is_counted: vec![false; model.facts.len()],
            bound: probability,
        };
        // Changes of facts with time are ignored, because they may be helpful or harmful.
        if !model.has_rates() {
            run.count(&needed, separations);
        }
        // Products of the same numbers in another order may differ in the last digits.
        Bound {
            probability: run.bound * (1.0 + 1e-12),
            length,
        }
    }

    /// Returns the instances that every working continuation starts or ends; `None` if there is
    /// none.
    fn needed(
        &self,
        network: &PrunedNetwork<'_>,
        action_values: &BoundContext<'_>,
    ) -> Option<Vec<InstanceId>> {
        let mut needed: Vec<InstanceId> = network.running().to_vec();
        if !action_values.must_work {
            return Some(needed);
        }
        let mut open: Vec<(usize, bool)> = self.goal.clone();
        for id in network.running() {
            open.extend(&self.needs_at_end[id.index()]);
        }
        let mut seen = vec![[false; 2]; self.setters.len()];
        let mut is_needed = vec![false; self.needs_at_start.len()];
        for id in &needed {
            is_needed[id.index()] = true;
        }
        while let Some(literal) = open.pop() {
            let (fact, truth) = literal;
            if std::mem::replace(&mut seen[fact][usize::from(truth)], true) {
                continue;
            }
            if !matches!(
                (action_values.nominal.truth(fact), truth),
                (Truth::False, true) | (Truth::True, false)
            ) {
                continue;
            }
            let mut only: Option<InstanceId> = None;
            let mut is_open = false;
            let mut has_any = false;
            for setter in self.setters[fact].iter().filter(|s| s.makes_true == truth) {
                match setter.by {
                    None => {
                        is_open |= action_values.has_timed;
                        has_any |= action_values.has_timed;
                    }
                    Some(id) if network.running().contains(&id) => {
                        is_open |= setter.at_end;
                        has_any |= setter.at_end;
                    }
                    Some(id) if (action_values.is_free)(id) => {
                        has_any = true;
                        is_open |= only.is_some_and(|other| other != id);
                        only = Some(id);
                    }
                    Some(_) => {}
                }
            }
            if !has_any {
                return None;
            }
            if let Some(id) = only.filter(|id| !is_open && !is_needed[id.index()]) {
                is_needed[id.index()] = true;
                needed.push(id);
                open.extend(&self.needs_at_start[id.index()]);
                open.extend(&self.needs_at_end[id.index()]);
            }
        }
        Some(needed)
    }
}

struct Run<'a, 'm, 'n> {
    bounds: &'a Bounds,
    model: &'a Model,
    network: &'n mut PrunedNetwork<'m>,
    action_values: &'a BoundContext<'a>,
    is_counted: Vec<bool>,
    bound: f64,
}

impl Run<'_, '_, '_> {
    fn count(&mut self, needed: &[InstanceId], separations: &Separations) {
        let running = self.network.running().len();
        // Lower bound of the number of needed happenings.
        let mut steps = 0;
        let mut ends: Vec<InstanceId> = Vec::new();
        for (place, &id) in needed.iter().enumerate() {
            let (start, end) = (separations.starts[id.index()], separations.ends[id.index()]);
            if place >= running {
                self.bound *= self.model.event(start).success;
                steps += 1;
            }
            if start != end {
                self.bound *= self.model.event(end).success;
                steps += 1;
                ends.push(id);
            }
        }
        let queue = Queue {
            running,
            ends: ends.len(),
        };
        let shares: Vec<Vec<f64>> = ends
            .iter()
            .map(|&id| self.factors_by_rank(id, queue))
            .collect();
        self.bound *= assignment::best_product(&shares);
        for &id in needed.iter().skip(running) {
            for &(fact, truth) in &self.bounds.needs_at_start[id.index()] {
                self.count_fact(fact, truth, 0);
            }
        }
        for &(fact, truth) in &self.bounds.goal {
            self.count_fact(fact, truth, steps);
        }
    }

    /// Returns the contribution of one end, at each rank among the ends: the probability that its
    /// conditions last until then, and that its effects last from then on.
    ///
    /// It is open whether more starts come before or after this end. As probabilities decay, each
    /// factor is log-convex in the number of starts before it, so one of the extremes is best.
    fn factors_by_rank(&mut self, id: InstanceId, queue: Queue) -> Vec<f64> {
        let is_new = |literal: &&(usize, bool), is_counted: &mut Vec<bool>| {
            !std::mem::replace(&mut is_counted[literal.0], true)
        };
        let bounds = self.bounds;
        let needs = bounds.needs_at_end[id.index()].iter();
        let needs: Vec<(usize, bool)> = needs
            .filter(|literal| is_new(literal, &mut self.is_counted))
            .copied()
            .collect();
        let mut brings: Vec<(Chain, f64)> = Vec::new();
        for &place in &bounds.goal_at_end[id.index()] {
            let (fact, truth) = bounds.goal[place];
            if self.is_counted[fact] || !self.is_last_to_set(id, fact, truth) {
                continue;
            }
            self.is_counted[fact] = true;
            let own = bounds.setters[fact].iter();
            let own = own.filter(|setter| setter.by == Some(id) && setter.makes_true == truth);
            let chance = |p: f64| if truth { p } else { 1.0 - p };
            let own = own.filter_map(|setter| setter.leaves.map(chance));
            let chain = Chain::of(self.model.spontaneous_changes[fact], truth);
            brings.push((chain, own.fold(0.0, f64::max)));
        }
        let mut with = |before: usize, after: usize| -> f64 {
            let needs = needs.iter();
            let lasting: f64 = needs
                .map(|&literal| self.persistence_bound(id, literal, before))
                .product();
            let brings = brings.iter();
            let kept: f64 = brings
                .map(|(chain, p)| chain.best_after(*p, after))
                .product();
            lasting * kept
        };
        let mut share = |rank| {
            let [early, late] = queue.neighbours(rank);
            with(early.0, early.1).max(with(late.0, late.1))
        };
        queue.ranks().into_iter().map(&mut share).collect()
    }

    /// Returns an upper bound of the probability that a condition of an end lasts until then, if
    /// the end is at least `before` steps away.
    ///
    /// An over-all condition must never fail after the start. The best start is just before the
    /// end: until then, a lost fact may be restored by a spontaneous change.
    fn persistence_bound(
        &mut self,
        id: InstanceId,
        (fact, truth): (usize, bool),
        before: usize,
    ) -> f64 {
        let literal = (fact, truth);
        let bounds = self.bounds;
        let is_throughout = bounds.needs_throughout[id.index()].contains(&literal);
        let chain = Chain::of(self.model.spontaneous_changes[fact], truth);
        let mut to_come = bounds.setters[fact].iter();
        if !is_throughout || !chain.is_steady() || to_come.any(|setter| self.is_pending(setter)) {
            return self.fact_bound(fact, truth, before);
        }
        let steps = i32::try_from(before).unwrap_or(i32::MAX);
        let stays = 1.0 - chain.fails();
        if self.network.running().contains(&id) {
            return stays.powi(steps);
        }
        if before > 0 && bounds.needs_at_start[id.index()].contains(&literal) {
            return self.fact_bound(fact, truth, before - 1) * stays;
        }
        self.fact_bound(fact, truth, before)
    }

    /// Returns `true` if only the end of `id` can still change the fact, and the fact does not have
    /// the required value yet.
    fn is_last_to_set(&self, id: InstanceId, fact: usize, truth: bool) -> bool {
        let nominal = self.action_values.nominal.truth(fact);
        if !self.action_values.must_work || nominal != Truth::from(!truth) {
            return false;
        }
        let mut is_set = false;
        for setter in &self.bounds.setters[fact] {
            if !self.is_pending(setter) {
                continue;
            }
            if setter.by != Some(id) || !setter.at_end || setter.leaves.is_none() {
                return false;
            }
            is_set |= setter.makes_true == truth && setter.is_unconditional;
        }
        is_set
    }

    fn is_pending(&self, setter: &Setter) -> bool {
        match setter.by {
            None => self.action_values.has_timed,
            Some(id) if self.network.running().contains(&id) => setter.at_end,
            Some(id) => (self.action_values.is_free)(id),
        }
    }

    /// Includes a needed fact once.
    fn count_fact(&mut self, fact: usize, truth: bool, steps: usize) {
        if !std::mem::replace(&mut self.is_counted[fact], true) {
            self.bound *= self.fact_bound(fact, truth, steps);
        }
    }

    /// Returns an upper bound of the probability that a fact has a truth value after at least
    /// `steps` steps.
    fn fact_bound(&mut self, fact: usize, truth: bool, steps: usize) -> f64 {
        let chain = Chain::of(self.model.spontaneous_changes[fact], truth);
        let of = |p: f64| if truth { p } else { 1.0 - p };
        // If an effect must establish the value, the present value is irrelevant.
        let must_be_set = self.action_values.must_work
            && self.action_values.nominal.truth(fact) == Truth::from(!truth);
        let mut best: f64 = 0.0;
        if !must_be_set {
            best = chain.best_after(of(self.network.marginal_at(fact)), steps);
        }
        for setter in &self.bounds.setters[fact] {
            if !self.is_pending(setter) || (must_be_set && setter.makes_true != truth) {
                continue;
            }
            match setter.leaves {
                None => return 1.0,
                Some(p) => best = best.max(chain.best_after(of(p), 0)),
            }
        }
        best
    }
}
