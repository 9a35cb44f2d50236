//! Spontaneous changes of facts at a rate.

use elbowroom_model::Problem;
use elbowroom_model::problem::{ObjectId, Predicate};

use super::WorldModel;
use elbowroom_model::pattern::ActionPattern;

/// Rates of spontaneous changes of facts, per second.
///
/// With a rate of λ, a fact changes within the next `t` seconds with probability 1 − exp(−λ·t), for
/// as long as it has the other value and regardless of the past. So the time until the change is
/// exponentially distributed.
#[derive(Clone, Debug, PartialEq)]
pub struct Hazard {
    /// The facts.
    pub fact: ActionPattern,
    /// The rate while it is false.
    pub becomes_true: f64,
    /// The rate while it is true.
    pub becomes_false: f64,
    /// `true` if the world reports such a change.
    pub is_reported: bool,
}

/// Maximum number of facts with rates.
pub(super) const MAX_FACTS: usize = 10_000;

impl WorldModel {
    /// Returns the rates of a fact, `(predicate object …)`; `None` if it never changes by itself.
    pub fn hazard(&self, fact: &str) -> Option<&Hazard> {
        let mut rules = self.hazards.iter().rev();
        rules.find(|rule| rule.fact.matches(fact))
    }

    /// Returns all facts of the problem that change spontaneously at a rate, by name, each once.
    pub fn hazardous(&self, problem: &Problem) -> Vec<(String, &Hazard)> {
        let mut found = Vec::new();
        for predicate in &problem.predicates {
            let mut rules = self.hazards.iter();
            if rules.any(|rule| rule.fact.may_match(&predicate.name)) {
                for arguments in arguments(predicate, problem) {
                    let name = problem.apply_name(&predicate.name, &arguments);
                    found.extend(self.hazard(&name).map(|rule| (name, rule)));
                }
            }
        }
        found
    }
}

impl Hazard {
    /// Returns the rate of the change to `truth`.
    pub fn rate(&self, truth: bool) -> f64 {
        if truth {
            self.becomes_true
        } else {
            self.becomes_false
        }
    }
}

/// Returns the number of facts of a predicate; `None` if it overflows.
pub(super) fn count(predicate: &Predicate, problem: &Problem) -> Option<usize> {
    let mut parameters = predicate.parameters.iter();
    parameters.try_fold(1_usize, |count, parameter| {
        count.checked_mul(problem.objects_of(&parameter.types).count())
    })
}

fn arguments(predicate: &Predicate, problem: &Problem) -> Vec<Vec<ObjectId>> {
    let mut all = vec![Vec::new()];
    for parameter in &predicate.parameters {
        let objects: Vec<ObjectId> = problem.objects_of(&parameter.types).collect();
        let longer = all.iter().flat_map(|first: &Vec<ObjectId>| {
            objects.iter().map(|object| {
                let mut arguments = first.clone();
                arguments.push(*object);
                arguments
            })
        });
        all = longer.collect();
    }
    all
}
