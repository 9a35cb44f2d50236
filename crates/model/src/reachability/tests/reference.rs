//! Simple reference implementation: sweeps over all instances of all schemas until nothing changes.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_num::Rational;

use crate::ground::{
    Action, Body, Change, Condition, DurationConstraint, Effect, Expression, FactId, FluentId,
    Guard,
};
use crate::problem::{Comparison, ObjectId, Problem, SchemaId, Variable};
use crate::task::Task;

pub(super) struct ReferenceGrounding {
    /// The actions' names, by schema and arguments.
    pub(super) actions: Vec<String>,
    /// The names of the facts that are ever true, sorted.
    pub(super) facts: Vec<String>,
    pub(super) is_goal_possible: bool,
}

/// The atoms found to be possible so far.
#[derive(Clone, PartialEq)]
struct Possible {
    ever_true: BTreeSet<FactId>,
    ever_false: BTreeSet<FactId>,
    changed: BTreeSet<FluentId>,
}

pub(super) fn ground(problem: &Problem) -> ReferenceGrounding {
    let task = Task::new(problem.clone());
    for rule in &problem.rules {
        for arguments in bindings(problem, &rule.parameters) {
            task.grounding(|grounder| grounder.fact(rule.predicate, &arguments));
        }
    }
    let mut candidates: Vec<Action> = (0..problem.schemas.len())
        .flat_map(|schema| instances(&task, SchemaId::from(schema)))
        .collect();
    loop {
        let (possible, started, ended) = sweep(&task, &candidates);
        if started == ended {
            let mut facts: Vec<_> = possible
                .ever_true
                .iter()
                .map(|&f| task.fact_name(f))
                .collect();
            facts.sort();
            return ReferenceGrounding {
                actions: ended
                    .iter()
                    .map(|&index| candidates[index].name.clone())
                    .collect(),
                facts,
                is_goal_possible: possible.holds(&task, task.goal(), true),
            };
        }
        // An instance that starts but cannot end is in no plan.
        let mut index = 0;
        candidates.retain(|_| {
            index += 1;
            !started.contains(&(index - 1)) || ended.contains(&(index - 1))
        });
    }
}

fn instances(task: &Task, schema: SchemaId) -> Vec<Action> {
    let problem = task.problem().clone();
    let parameters = &problem.schemas[schema.index()].parameters;
    bindings(&problem, parameters)
        .iter()
        .map(|arguments| task.instantiate(schema, arguments).unwrap())
        .collect()
}

/// Returns all choices of objects for the variables.
fn bindings(problem: &Problem, variables: &[Variable]) -> Vec<Vec<ObjectId>> {
    let mut all: Vec<Vec<ObjectId>> = vec![Vec::new()];
    for variable in variables {
        let longer = all.iter().flat_map(|front| {
            let objects = problem.objects_of(&variable.types);
            objects.map(|object| [front.as_slice(), &[object]].concat())
        });
        all = longer.collect();
    }
    all
}

/// Returns the fixpoint, and the candidates that start and end in it.
fn sweep(task: &Task, candidates: &[Action]) -> (Possible, BTreeSet<usize>, BTreeSet<usize>) {
    let mut possible = Possible {
        ever_true: task.initial().facts.clone(),
        ever_false: BTreeSet::new(),
        changed: BTreeSet::new(),
    };
    for change in task.timed().iter().flat_map(|timed| &timed.changes) {
        possible.include(change);
    }
    let (mut started, mut ended) = (BTreeSet::new(), BTreeSet::new());
    loop {
        let before = (possible.clone(), started.clone(), ended.clone());
        for (index, action) in candidates.iter().enumerate() {
            if possible.can_start(task, action) {
                started.insert(index);
                possible.start(task, action);
                if possible.can_end(task, action) {
                    ended.insert(index);
                    possible.end(task, action);
                }
            }
        }
        for rule in task.rules().iter() {
            if possible.holds(task, &rule.body, true) {
                possible.ever_true.insert(rule.head);
            }
        }
        if before == (possible.clone(), started.clone(), ended.clone()) {
            return (possible, started, ended);
        }
    }
}

impl Possible {
    fn can_start(&self, task: &Task, action: &Action) -> bool {
        match &action.body {
            Body::Instantaneous(snap) => self.holds(task, &snap.condition, true),
            Body::Durative(body) => {
                let at_start = body.duration.iter().filter(|constraint| !constraint.at_end);
                self.holds(task, &body.start.condition, true)
                    && self.has_admissible_duration(task, &at_start.collect::<Vec<_>>())
            }
        }
    }

    fn can_end(&self, task: &Task, action: &Action) -> bool {
        match &action.body {
            Body::Instantaneous(_) => true,
            Body::Durative(body) => {
                // With a duration of 0, the over-all condition is vacuous.
                (self.may_take_no_time(task, body) || self.holds(task, &body.over_all, true))
                    && self.holds(task, &body.end.condition, true)
                    && self.has_admissible_duration(task, &body.duration.iter().collect::<Vec<_>>())
            }
        }
    }

    fn start(&mut self, task: &Task, action: &Action) {
        match &action.body {
            Body::Instantaneous(snap) => self.apply(task, &snap.effects),
            Body::Durative(body) => {
                self.apply(task, &body.start.effects);
                for effect in &body.continuous {
                    if self.is_guard_possible(task, &effect.guard) {
                        self.changed.insert(effect.fluent);
                    }
                }
            }
        }
    }

    fn end(&mut self, task: &Task, action: &Action) {
        if let Body::Durative(body) = &action.body {
            self.apply(task, &body.end.effects);
        }
    }

    fn apply(&mut self, task: &Task, effects: &[Effect]) {
        for effect in effects {
            if self.is_guard_possible(task, &effect.guard) {
                self.include(&effect.change);
            }
        }
    }

    fn is_guard_possible(&self, task: &Task, guard: &Guard) -> bool {
        self.holds(task, &guard.at_start, true)
            && self.holds(task, &guard.over_all, true)
            && self.holds(task, &guard.now, true)
    }

    fn include(&mut self, change: &Change) {
        match change {
            Change::Add(fact) => self.ever_true.insert(*fact),
            Change::Delete(fact) => self.ever_false.insert(*fact),
            Change::Update { fluent, .. } => self.changed.insert(*fluent),
        };
    }

    fn holds(&self, task: &Task, condition: &Condition, wanted: bool) -> bool {
        match condition {
            Condition::Fact(fact) if wanted => self.ever_true.contains(fact),
            Condition::Fact(fact) => {
                task.is_derived(*fact)
                    || self.ever_false.contains(fact)
                    || !task.initial().facts.contains(fact)
            }
            Condition::Compare(comparison, left, right) => {
                self.compares(task, *comparison, left, right, wanted)
            }
            Condition::Not(part) => self.holds(task, part, !wanted),
            Condition::And(parts) if wanted => parts.iter().all(|p| self.holds(task, p, true)),
            Condition::Or(parts) if !wanted => parts.iter().all(|p| self.holds(task, p, false)),
            Condition::And(parts) | Condition::Or(parts) => {
                parts.iter().any(|p| self.holds(task, p, wanted))
            }
        }
    }

    fn compares(
        &self,
        task: &Task,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
        wanted: bool,
    ) -> bool {
        if !self.is_defined(task, left) || !self.is_defined(task, right) {
            return false;
        }
        match (self.value(task, left), self.value(task, right)) {
            (Some(left), Some(right)) => comparison.holds(&left, &right) == wanted,
            _ => true,
        }
    }

    fn is_defined(&self, task: &Task, expression: &Expression) -> bool {
        let mut is_defined = true;
        expression.visit_fluents(&mut |fluent| {
            is_defined &=
                self.changed.contains(&fluent) || task.initial().values.contains_key(&fluent);
        });
        is_defined
    }

    /// Returns the value if it never changes.
    fn value(&self, task: &Task, expression: &Expression) -> Option<Rational> {
        let values: &BTreeMap<FluentId, Rational> = &task.initial().values;
        expression.evaluate(&mut |leaf| match leaf {
            Expression::Fluent(fluent) if !self.changed.contains(fluent) => {
                values.get(fluent).cloned()
            }
            _ => None,
        })
    }

    /// Returns `true` if the duration constraints with a known bound allow 0.
    fn may_take_no_time(&self, task: &Task, body: &crate::ground::DurativeBody) -> bool {
        body.duration.iter().all(|constraint| {
            self.is_defined(task, &constraint.bound)
                && self
                    .value(task, &constraint.bound)
                    .is_none_or(|bound| constraint.comparison.holds(&Rational::ZERO, &bound))
        })
    }

    /// Returns `true` if there is a duration that satisfies all constraints with a known bound.
    fn has_admissible_duration(&self, task: &Task, constraints: &[&DurationConstraint]) -> bool {
        let is_defined = constraints.iter().all(|c| self.is_defined(task, &c.bound));
        let bounds: Vec<_> = constraints
            .iter()
            .filter_map(|c| Some((c.comparison, self.value(task, &c.bound)?)))
            .collect();
        // If any duration is allowed, then 0 or one of the bounds is.
        let mut durations = vec![Rational::ZERO];
        durations.extend(bounds.iter().map(|(_, bound)| bound.clone()));
        durations.retain(|duration| !duration.is_negative());
        is_defined
            && durations.iter().any(|duration| {
                let mut bounds = bounds.iter();
                bounds.all(|(comparison, bound)| comparison.holds(duration, bound))
            })
    }
}
