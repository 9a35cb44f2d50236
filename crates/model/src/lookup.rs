//! Look-up of facts and fluents by name, as in reports about the world.

use crate::ground::{FactId, FluentId};
use crate::problem::{ObjectId, Problem, Variable};
use crate::task::Task;

impl Task {
    /// Returns the fact with the name `(predicate object …)`, or `(= (function object …) object)`
    /// for a function whose values are objects, in any letter case. Returns `None` if the problem
    /// has no such predicate or objects, or their types do not fit.
    pub fn fact_named(&self, name: &str) -> Option<FactId> {
        let equation = equation(name);
        let (name, objects) = words(equation.as_deref().unwrap_or(name), &self.problem)?;
        let predicate = self.problem.predicate(&name)?;
        if equation.is_some() && !self.problem.object_functions.contains(&predicate) {
            return None;
        }
        let parameters = &self.problem.predicates[predicate.index()].parameters;
        fit(&objects, parameters, &self.problem)
            .then(|| self.grounding(|grounder| grounder.fact(predicate, &objects)))
    }

    /// Returns the fluent with the name `(function object …)`, in the same way.
    pub fn fluent_named(&self, name: &str) -> Option<FluentId> {
        let (name, objects) = words(name, &self.problem)?;
        let function = self.problem.function(&name)?;
        let parameters = &self.problem.functions[function.index()].parameters;
        fit(&objects, parameters, &self.problem)
            .then(|| self.grounding(|grounder| grounder.fluent(function, &objects)))
    }
}

/// Returns `function object … value` for `(= (function object …) value)`, and `None` for anything else.
fn equation(name: &str) -> Option<String> {
    let inside = name.trim().strip_prefix('(')?.strip_suffix(')')?;
    let (application, value) = inside.trim().strip_prefix('=')?.split_once(')')?;
    let application = application.trim().strip_prefix('(')?;
    Some(format!("{application} {value}"))
}

/// Returns the first word, and the objects with the other names.
fn words(name: &str, problem: &Problem) -> Option<(String, Vec<ObjectId>)> {
    let name = name.trim().trim_matches(['(', ')']).to_ascii_lowercase();
    let mut words = name.split_whitespace();
    let first = words.next()?.to_owned();
    let objects: Option<Vec<ObjectId>> = words.map(|word| problem.object(word)).collect();
    Some((first, objects?))
}

fn fit(objects: &[ObjectId], parameters: &[Variable], problem: &Problem) -> bool {
    let mut pairs = objects.iter().zip(parameters);
    objects.len() == parameters.len()
        && pairs.all(|(object, parameter)| problem.has_type(*object, &parameter.types))
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::Task;
    use crate::problem::{Object, Predicate, PredicateId, Problem, Type, TypeId, Variable};

    /// Returns a task with a predicate of two objects, and a hundred objects; no fact holds.
    fn task() -> Task {
        let thing = |name: &str| Variable {
            name: name.to_owned(),
            types: vec![TypeId::from(0)],
        };
        Task::new(Problem {
            types: vec![Type {
                name: "object".to_owned(),
                parents: Vec::new(),
            }],
            objects: (0..100)
                .map(|number| Object {
                    name: format!("o{number}"),
                    types: vec![TypeId::from(0)],
                })
                .collect(),
            predicates: vec![Predicate {
                name: "near".to_owned(),
                parameters: vec![thing("?a"), thing("?b")],
                is_derived: false,
            }],
            ..Problem::default()
        })
    }

    #[test]
    fn fact_has_same_id_in_all_clones_of_task() {
        let task = task();
        let clone = task.clone();
        let first = clone
            .fact_named("(near o1 o2)")
            .expect("objects of the problem");
        let second = task
            .fact_named("( NEAR O2  o1 )")
            .expect("objects of the problem");
        assert_eq!(task.fact_named("(near o1 o2)"), Some(first));
        assert_eq!(clone.fact_name(second), "(near o2 o1)");
        assert_eq!((task.fact_count(), clone.fact_count()), (2, 2));
    }

    #[test]
    fn fact_of_object_fluent_is_found_by_name() {
        let mut problem = task().problem().clone();
        problem.object_functions = [PredicateId::from(0)].into();
        let task = Task::new(problem);
        let fact = task.fact_named("(= (NEAR o1) o2)");
        let fact = fact.expect("objects of the problem");
        assert_eq!(task.fact_name(fact), "(= (near o1) o2)");
        for name in [
            "(= near o1 o2)",
            "(= (near o1))",
            "(= (near) o1)",
            "(= (near o1) o100)",
            "(= (far o1) o2)",
        ] {
            assert_eq!(task.fact_named(name), None, "{name}");
        }
    }

    #[test]
    fn unknown_fact_gets_no_id() {
        let task = task();
        for name in [
            "",
            "()",
            "(far o1 o2)",
            "(near o1)",
            "(near o1 o2 o3)",
            "(near o1 o100)",
        ] {
            assert_eq!(task.fact_named(name), None, "{name}");
            assert_eq!(task.fluent_named(name), None, "{name}");
        }
        assert_eq!(task.fact_count(), 0);
    }

    #[test]
    fn separate_table_keeps_ids_and_grows_independently() {
        let task = task();
        let shared = task.fact_named("(near o1 o2)");
        let own = task.with_own_table();
        assert_eq!(
            own.fact_named("(near o3 o4)"),
            task.fact_named("(near o5 o6)")
        );
        assert_eq!(own.fact_named("(near o1 o2)"), shared);
        assert_eq!((task.fact_count(), own.fact_count()), (2, 2));
    }

    #[test]
    fn threads_that_share_a_table_agree() {
        let task = task();
        let all = || {
            let pairs = (0..100).flat_map(|a| (0..100).map(move |b| (a, b)));
            let facts = pairs.map(|(a, b)| task.fact_named(&format!("(near o{a} o{b})")));
            facts.collect::<Vec<_>>()
        };
        let (one, two) = thread::scope(|scope| {
            let (one, two) = (scope.spawn(all), scope.spawn(all));
            (one.join().expect("no panic"), two.join().expect("no panic"))
        });
        assert_eq!(one, two);
        assert_eq!(task.fact_count(), 10_000);
    }
}
