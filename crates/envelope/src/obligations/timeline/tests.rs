//! Derived facts at a cut.

use elbowroom_model::problem::{
    Atom, Condition, Expression as Lifted, Fluent, Function, FunctionId, Predicate, PredicateId,
    Problem, Rule,
};

use super::*;

fn atom(number: usize) -> Condition {
    Condition::Atom(Atom {
        predicate: PredicateId::from(number),
        arguments: Vec::new(),
    })
}

/// Returns a task with predicate 0 basic, and the others derived with one rule each.
fn task(bodies: Vec<Condition>) -> Task {
    let predicates = (0..=bodies.len()).map(|number| Predicate {
        name: format!("p{number}"),
        parameters: Vec::new(),
        is_derived: number > 0,
    });
    let goal = Condition::And((0..=bodies.len()).map(atom).collect());
    let rules = bodies.into_iter().enumerate().map(|(number, body)| Rule {
        predicate: PredicateId::from(number + 1),
        parameters: Vec::new(),
        body,
    });
    Task::new(Problem {
        predicates: predicates.collect(),
        functions: vec![Function {
            name: "x".to_owned(),
            parameters: Vec::new(),
        }],
        rules: rules.collect(),
        goal,
        ..Problem::default()
    })
}

/// Returns the value of `p` followed by the number, when everything in the timeline has happened,
/// or nothing has.
fn read(
    task: &Task,
    timeline: &Timeline,
    number: usize,
    has_happened: bool,
) -> Result<bool, Refusal> {
    let reading = Reading {
        task,
        timeline,
        cut: Some(&|_| has_happened),
        moment: NodeId::ZERO,
        action: None,
        substitution: &Substitution::default(),
        location: "here",
        derived: OnceCell::new(),
    };
    let fact = task.find_fact(PredicateId::from(number), &[]);
    reading.fact(fact.expect("in the table"))
}

/// Returns a timeline in which `p0` becomes true.
fn opened(task: &Task) -> Timeline {
    let mut timeline = Timeline::default();
    let fact = task.find_fact(PredicateId(0), &[]);
    timeline.set(NodeId::ZERO, fact.expect("in the table"), true);
    timeline
}

#[test]
fn long_derivation_chain_respects_cut() {
    let length = 100_000;
    let task = task((2..=length).chain([0]).map(atom).collect());
    let timeline = opened(&task);
    assert_eq!(read(&task, &timeline, 1, true), Ok(true));
    assert_eq!(read(&task, &timeline, 1, false), Ok(false));
}

#[test]
fn mutually_dependent_facts_are_evaluated_once() {
    // Forty facts have too many paths to enumerate.
    let last = 40;
    let any_other = |_| Condition::Or((1..=last).map(atom).collect());
    let mut bodies: Vec<_> = (1..=last).map(any_other).collect();
    let task_without_support = task(bodies.clone());
    let timeline = opened(&task_without_support);
    assert_eq!(read(&task_without_support, &timeline, 1, true), Ok(false));
    bodies[last - 1] = Condition::Or(vec![atom(1), atom(0)]);
    let task = task(bodies);
    assert_eq!(read(&task, &opened(&task), 1, true), Ok(true));
}

#[test]
fn varying_number_is_refused_only_if_decisive() {
    let x = Fluent {
        function: FunctionId(0),
        arguments: Vec::new(),
    };
    let is_positive = Condition::Compare(
        Comparison::Greater,
        Lifted::Fluent(x),
        Lifted::Constant(Rational::ZERO),
    );
    let task = task(vec![
        is_positive.clone(),
        Condition::Or(vec![is_positive, atom(0)]),
    ]);
    let mut timeline = opened(&task);
    let fluent = task.find_fluent(FunctionId(0), &[]).expect("in the table");
    let varying = Linear::parameter(ParameterId(0));
    timeline.change(NodeId::ZERO, fluent, FluentChange::Assign(Some(varying)));
    assert!(matches!(
        read(&task, &timeline, 1, true),
        Err(Refusal::NotLinear { .. })
    ));
    assert_eq!(read(&task, &timeline, 2, true), Ok(true));
}

#[test]
fn a_derived_fact_that_depends_on_its_own_negation_is_refused() {
    let task = task(vec![Condition::Not(Box::new(atom(1)))]);
    let refusal = read(&task, &Timeline::default(), 1, true);
    let place = "here".to_owned();
    assert_eq!(refusal, Err(Refusal::Unstratified { place }));
}
