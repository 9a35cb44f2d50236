//! Parts of a problem that share no changing fact.

use std::collections::BTreeMap;

use crate::model::{Event, Model, Requirement, visit_facts};
use crate::search_state::SearchState;

/// A part of the problem that the goal needs.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    /// Positions of the facts that the part reads or changes, sorted.
    pub(super) facts: Vec<usize>,
    /// Indices of its actions, sorted.
    pub(super) instances: Vec<usize>,
    /// Conjuncts of the goal.
    pub(super) goal: Requirement,
}

/// Returns `true` for a probability that is neither 0 nor 1.
pub(super) fn is_uncertain(probability: f64) -> bool {
    probability > 0.0 && probability < 1.0
}

/// Returns the parts that contain a conjunct of the goal, in the order of their first item.
pub(super) fn parts(model: &Model, initial: &SearchState) -> Vec<Part> {
    let facts = model.facts.len();
    let instances = model.plan().instances.len();
    let goals = conjuncts(&model.goal);
    let reads = |item: usize| match item.checked_sub(instances) {
        Some(goal) => facts_of_requirement(model, &goals[goal]),
        None => facts_of_instance(model, item),
    };
    let items: Vec<Vec<usize>> = (0..instances + goals.len()).map(reads).collect();
    let couples = coupling_facts(model, initial);
    let mut sets = DisjointSets::new(facts + items.len());
    for (item, read) in items.iter().enumerate() {
        for &fact in read.iter().filter(|fact| couples[**fact]) {
            sets.unite(fact, facts + item);
        }
    }
    let changes_by_itself = |flip: &crate::likelihoods::SpontaneousChange| {
        flip.becomes_true > 0.0 || flip.becomes_false > 0.0
    };
    if model.spontaneous_changes.iter().any(changes_by_itself) {
        (1..items.len()).for_each(|item| sets.unite(facts, facts + item));
    }
    let mut parts: BTreeMap<usize, Part> = BTreeMap::new();
    for (item, read) in items.iter().enumerate() {
        let part = parts.entry(sets.root(facts + item)).or_default();
        part.facts.extend(read);
        match item.checked_sub(instances) {
            Some(goal) => part.add_goal(&goals[goal]),
            None => part.instances.push(item),
        }
    }
    let mut parts: Vec<Part> = parts.into_values().collect();
    parts.retain(|part| part.goal != Requirement::default());
    for part in &mut parts {
        part.facts.sort_unstable();
        part.facts.dedup();
    }
    parts
}

impl Part {
    fn add_goal(&mut self, conjunct: &Requirement) {
        self.goal.literals.extend(&conjunct.literals);
        self.goal.numeric.extend(conjunct.numeric.iter().cloned());
        self.goal.coupled.extend(conjunct.coupled.iter().cloned());
    }
}

/// Splits a requirement into its conjuncts.
fn conjuncts(requirement: &Requirement) -> Vec<Requirement> {
    let empty = Requirement::default;
    let literals = requirement.literals.iter().map(|literal| Requirement {
        literals: vec![*literal],
        ..empty()
    });
    let numeric = requirement.numeric.iter().map(|part| Requirement {
        numeric: vec![part.clone()],
        ..empty()
    });
    let coupled = requirement.coupled.iter().map(|part| Requirement {
        coupled: vec![part.clone()],
        ..empty()
    });
    literals.chain(numeric).chain(coupled).collect()
}

/// Returns, for each fact, `true` if the items that read it depend on each other: an action may
/// change it, or its initial value is uncertain.
fn coupling_facts(model: &Model, initial: &SearchState) -> Vec<bool> {
    let belief = |fact| is_uncertain(initial.belief.probability(fact));
    let mut couples: Vec<bool> = model.facts.iter().map(|&fact| belief(fact)).collect();
    for fact in model.events.iter().flat_map(changed_facts) {
        couples[fact] = true;
    }
    couples
}

/// Returns the facts that an event may change.
fn changed_facts(event: &Event) -> impl Iterator<Item = usize> + '_ {
    let outcomes = event.failure_outcomes.iter();
    let failures = outcomes.flat_map(|outcome| outcome.changes.iter().map(|change| change.0));
    event
        .effects
        .iter()
        .map(|effect| effect.fact)
        .chain(failures)
}

/// Returns the facts that an action reads or changes.
fn facts_of_instance(model: &Model, instance: usize) -> Vec<usize> {
    let id = elbowroom_plan::InstanceId::from(instance);
    let mut facts = Vec::new();
    for node in [model.start(id), model.end(id)] {
        let event = model.event(node);
        facts.extend(facts_of_requirement(model, &event.condition));
        facts.extend(facts_of_requirement(model, &event.over_all));
        facts.extend(changed_facts(event));
        for guard in event.effects.iter().filter_map(|it| it.guard.as_ref()) {
            visit_facts(model.task(), guard, &mut |fact| {
                facts.extend(model.position(fact));
            });
        }
    }
    facts
}

fn facts_of_requirement(model: &Model, requirement: &Requirement) -> Vec<usize> {
    let literals = requirement.literals.iter().map(|(fact, _)| *fact);
    let coupled = requirement.coupled.iter().flat_map(|it| it.facts.clone());
    let mut facts: Vec<usize> = literals.chain(coupled).collect();
    for condition in &requirement.numeric {
        visit_facts(model.task(), condition, &mut |fact| {
            facts.extend(model.position(fact));
        });
    }
    facts
}

/// Union-find forest. The root of a set is its least member.
struct DisjointSets {
    parent: Vec<usize>,
}

impl DisjointSets {
    fn new(members: usize) -> Self {
        Self {
            parent: (0..members).collect(),
        }
    }

    fn root(&mut self, member: usize) -> usize {
        let mut at = member;
        while self.parent[at] != at {
            self.parent[at] = self.parent[self.parent[at]];
            at = self.parent[at];
        }
        at
    }

    fn unite(&mut self, one: usize, other: usize) {
        let (one, other) = (self.root(one), self.root(other));
        self.parent[one.max(other)] = one.min(other);
    }
}
