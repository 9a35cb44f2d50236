//! Uncertain initial facts, until they are observed: [`InitialBelief`].

use std::collections::BTreeMap;

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body, Change, Condition, FactId, SnapAction};
use elbowroom_model::problem::{ObjectId, PredicateId};
use elbowroom_probability::{Belief, Likelihoods};

use crate::event::Ending;
use crate::executor::PlanEvent;

/// Probabilities of initial facts that have not been observed yet: the `[beliefs]` of a likelihood
/// file. A fact counts as observed when its change is reported, when an action has an effect on it,
/// and when an action that needs it starts or ends.
#[derive(Clone, Debug)]
pub(super) struct InitialBelief(BTreeMap<(PredicateId, Vec<ObjectId>), f64>);

impl InitialBelief {
    pub(super) fn of(likelihoods: &Likelihoods) -> Self {
        Self(likelihoods.beliefs.clone())
    }

    /// Returns `true` if no fact is uncertain.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Processes a news item; `action` is the action that it concerns.
    pub(super) fn learn(&mut self, news: &PlanEvent, action: Option<&Action>, task: &Task) {
        match (news, action) {
            (PlanEvent::Fact(fact), _) => self.mark_observed(task, *fact),
            (PlanEvent::Started { .. }, Some(action)) => match &action.body {
                Body::Instantaneous(snap) => self.observe_happening(task, snap),
                Body::Durative(body) => self.observe_happening(task, &body.start),
            },
            (PlanEvent::Ended { ending, .. }, Some(action)) if *ending == Ending::Succeeded => {
                if let Some(body) = action.durative() {
                    self.mark_condition_held(task, &body.over_all);
                    self.observe_happening(task, &body.end);
                }
            }
            _ => {}
        }
    }

    fn observe_happening(&mut self, task: &Task, snap: &SnapAction) {
        self.mark_condition_held(task, &snap.condition);
        for effect in &snap.effects {
            if let Change::Add(fact) | Change::Delete(fact) = effect.change {
                self.mark_observed(task, fact);
            }
        }
    }

    /// Marks the conjuncts of a condition as having held. Of a disjunction, the part that held is
    /// unknown.
    fn mark_condition_held(&mut self, task: &Task, condition: &Condition) {
        for part in condition.conjuncts() {
            match part {
                Condition::Fact(fact) => self.mark_fact(task, *fact, true),
                Condition::Not(part) => {
                    if let Condition::Fact(fact) = **part {
                        self.mark_fact(task, fact, false);
                    }
                }
                _ => {}
            }
        }
    }

    fn mark_fact(&mut self, task: &Task, fact: FactId, truth: bool) {
        let was = self.0.get_mut(&task.atom(fact));
        if let Some(probability) = was {
            *probability = f64::from(u8::from(truth));
        }
    }

    /// Marks a fact as observed: only reports and effects determine it from now on.
    fn mark_observed(&mut self, task: &Task, fact: FactId) {
        self.0.remove(&task.atom(fact));
    }

    /// Sets the probabilities of the facts that are still uncertain.
    pub(super) fn apply(&self, task: &Task, belief: &mut Belief) {
        for ((predicate, arguments), probability) in &self.0 {
            if let Some(fact) = task.find_fact(*predicate, arguments) {
                belief.set(fact, *probability);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use elbowroom_model::{Step, Task};
    use elbowroom_num::Rational;
    use elbowroom_pddl::{Source, read_plan, read_problem};
    use elbowroom_probability::{Belief, Likelihoods, likelihoods};

    use super::InitialBelief;
    use crate::event::Ending;
    use crate::executor::{PlanEvent, StepId};

    /// The action `lift` needs the crate closed throughout, and the crate is not on the floor
    /// afterwards.
    fn lifting_task() -> (Arc<Task>, Step, Likelihoods) {
        let domain = Source::new(
            "d",
            "(define (domain d) (:requirements :negative-preconditions :durative-actions)
               (:predicates (floor) (open) (here) (far))
               (:durative-action lift :parameters () :duration (= ?duration 1)
                 :condition (and (at start (here)) (over all (not (open))))
                 :effect (at start (not (floor)))))",
        );
        let problem = Source::new(
            "p",
            "(define (problem p) (:domain d) (:init (floor) (here)) (:goal (and (not (floor)) (far))))",
        );
        let (problem, _) = read_problem(&domain, &problem).unwrap();
        let task = Task::new(problem);
        let (plan, _) = read_plan(&Source::new("x", "0: (lift) [1]"), &task).unwrap();
        let text = "format = \"elbowroom-likelihoods\"\nversion = 1
            defaults = { becomes_true = 0.0, becomes_false = 0.0, start = 1.0, effect = 1.0 }
            beliefs = { floor = 0.9, here = 0.8, open = 0.3, far = 0.2 }";
        let likelihoods = likelihoods::read(text, &task).unwrap();
        (Arc::new(task), plan.steps[0].clone(), likelihoods)
    }

    fn initial_probabilities(initial: &InitialBelief, task: &Task) -> Vec<f64> {
        let mut belief = Belief::certain(task.initial());
        initial.apply(task, &mut belief);
        let names = ["(floor)", "(here)", "(open)", "(far)"];
        let facts = names.iter().map(|name| task.fact_named(name).unwrap());
        facts.map(|fact| belief.probability(fact)).collect()
    }

    #[test]
    fn fact_is_uncertain_until_observed() {
        let (task, step, likelihoods) = lifting_task();
        let mut initial = InitialBelief::of(&likelihoods);
        let close = |found: Vec<f64>, expected: [f64; 4]| {
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-12, "{found} {expected}");
            }
        };
        close(initial_probabilities(&initial, &task), [0.9, 0.8, 0.3, 0.2]);
        let started = PlanEvent::Started {
            step: StepId(0),
            time: Rational::ZERO,
            measured: Vec::new(),
        };
        initial.learn(&started, Some(&step.action), &task);
        // The start needed `here`. The start effect deletes `floor`, so its probability is no
        // longer applied, and the initial state has it.
        close(initial_probabilities(&initial, &task), [1.0, 1.0, 0.3, 0.2]);
        let ended = |ending| PlanEvent::Ended {
            step: StepId(0),
            time: Rational::ONE,
            ending,
            measured: Vec::new(),
        };
        initial.learn(&ended(Ending::Cancelled), Some(&step.action), &task);
        close(initial_probabilities(&initial, &task), [1.0, 1.0, 0.3, 0.2]);
        initial.learn(&ended(Ending::Succeeded), Some(&step.action), &task);
        close(initial_probabilities(&initial, &task), [1.0, 1.0, 0.0, 0.2]);
        let far = task.fact_named("(far)").unwrap();
        initial.learn(&PlanEvent::Fact(far), None, &task);
        close(initial_probabilities(&initial, &task), [1.0, 1.0, 0.0, 0.0]);
    }
}
