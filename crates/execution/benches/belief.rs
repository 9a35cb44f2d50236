//! Time to progress the belief state through 200 sequential actions, for growing numbers of facts.
//! Each action has one over-all condition and one effect.

use std::sync::Arc;

use divan::Bencher;
use divan::counter::ItemsCount;
use elbowroom_execution::{ActionHandle, BeliefState};
use elbowroom_model::ground::{
    Action, Body, Change, Condition, DurativeBody, Effect, FactId, Guard, SnapAction,
};
use elbowroom_model::problem::{Predicate, PredicateId, SchemaId};
use elbowroom_model::{Problem, Task};
use elbowroom_num::Rational;

fn main() {
    divan::main();
}

/// Number of actions that start and end in one sample.
const ACTIONS: usize = 200;

#[divan::bench(args = [1_000, 10_000, 100_000])]
fn belief(bencher: Bencher<'_, '_>, facts: usize) {
    let predicates = (0..facts).map(|index| Predicate {
        name: format!("p{index}"),
        parameters: Vec::new(),
        is_derived: false,
    });
    let all = (0..facts).map(|index| (PredicateId::from(index), Vec::new()));
    let task = Arc::new(Task::new(Problem {
        predicates: predicates.collect(),
        initial_facts: all.collect(),
        ..Problem::default()
    }));
    let fact = |index: usize| {
        let predicate = PredicateId::from(index % facts);
        task.find_fact(predicate, &[]).expect("true at first")
    };
    let actions: Vec<Arc<Action>> = (0..ACTIONS)
        .map(|index| Arc::new(action(index, fact(index * 7919), fact(index * 104_729))))
        .collect();
    bencher
        .counter(ItemsCount::new(ACTIONS))
        .with_inputs(|| BeliefState::new(Arc::clone(&task)))
        .bench_local_values(|mut belief| {
            let mut now = Rational::ZERO;
            for (action, ticket) in actions.iter().zip(0..) {
                let ticket = ActionHandle(ticket);
                belief.advance_for_happening(&now).expect("no numbers");
                let outcome = belief.start(ticket, action, &Rational::ONE, &[]);
                outcome.expect("no numbers");
                now += Rational::ONE;
                belief.advance_for_happening(&now).expect("no numbers");
                belief.end(ticket, &[]).expect("no numbers");
                assert!(belief.violated_action().is_none());
            }
            belief
        });
}

fn action(index: usize, needed: FactId, changed: FactId) -> Action {
    let snap = |condition, effects| Arc::new(SnapAction { condition, effects });
    let guard = || Condition::TRUE;
    let effect = Effect {
        guard: Guard {
            at_start: guard(),
            over_all: guard(),
            now: guard(),
        },
        change: Change::Add(changed),
    };
    Action {
        schema: SchemaId(0),
        arguments: Vec::new(),
        name: format!("(work{index})"),
        body: Body::Durative(DurativeBody {
            duration: Vec::new(),
            start: snap(Condition::Fact(needed), Vec::new()),
            over_all: Condition::Fact(needed),
            end: snap(Condition::TRUE, vec![effect]),
            continuous: Vec::new(),
            is_running: false,
        }),
    }
}
