//! Facts and fluents that are mentioned by name, by somebody who watches the world.

use crate::ground::{FactId, FluentId};
use crate::problem::{ObjectId, Problem, Variable};
use crate::task::Task;

impl Task {
    /// The fact that `(predicate object …)` names; it enters the table if nothing has mentioned it
    /// before. `None` if the problem has no such predicate or objects, or their types do not fit.
    pub fn mention_fact(&mut self, name: &str) -> Option<FactId> {
        let (name, objects) = words(name, &self.problem)?;
        let predicate = self.problem.predicate(&name)?;
        let parameters = &self.problem.predicates[predicate.index()].parameters;
        fit(&objects, parameters, &self.problem).then(|| self.fact(predicate, &objects))
    }

    /// The fluent that `(function object …)` names, in the same way.
    pub fn mention_fluent(&mut self, name: &str) -> Option<FluentId> {
        let (name, objects) = words(name, &self.problem)?;
        let function = self.problem.function(&name)?;
        let parameters = &self.problem.functions[function.index()].parameters;
        fit(&objects, parameters, &self.problem).then(|| self.fluent(function, &objects))
    }
}

/// The first word, and the objects that the others name.
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
