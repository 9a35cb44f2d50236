//! Comparison with a simple reference implementation, and limits.

mod random;
mod reference;

use proptest::prelude::*;

use super::{Answer, Grounding, Settings, ground};
use crate::problem::Problem;
use crate::task::Task;

fn grounding_of(problem: Problem) -> (Task, Grounding) {
    let task = Task::new(problem);
    match ground(&task, &Settings::default()) {
        Answer::Complete(grounding) => (task, grounding),
        Answer::LimitReached => panic!("the problems of these tests are small"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn joins_find_the_same_actions_as_the_full_cross_product(
        choices in prop::collection::vec(any::<u8>(), 20..600)
    ) {
        let problem = random::problem(&choices);
        let expected = reference::ground(&problem);
        let (task, grounding) = grounding_of(problem);
        let actions: Vec<_> = grounding.actions.iter().map(|a| a.name.clone()).collect();
        prop_assert_eq!(actions, expected.actions);
        let mut facts: Vec<_> = grounding.facts.iter().map(|&f| task.fact_name(f)).collect();
        facts.sort();
        prop_assert_eq!(facts, expected.facts);
        prop_assert_eq!(grounding.unreachable_goals.is_empty(), expected.is_goal_possible);
    }
}
