//! Checks that no state of a plan is a dead end, even if the plan must end as early as possible.

mod numbers;

use std::fmt::Write;

use elbowroom_model::Task;
use elbowroom_pddl::{Source, read_problem};
use proptest::prelude::*;

use super::H2;
use crate::embedded::apply::{Step, Stepper};
use crate::embedded::compile::Compiled;
use crate::embedded::root::root;
use crate::embedded::state::State;
use crate::embedded::testing::{choices, compiled};
use crate::embedded::time::{NEVER, Ticks};
use numbers::{Demand, Numbers};

/// Maximum number of choices of the exhaustive search.
const MOST: usize = 6;

/// Conditions at start, over all and at end, effects at start and at end: a fact and its truth.
#[derive(Clone, Debug)]
struct DraftAction {
    duration: u8,
    needs: Vec<(u8, bool)>,
    lasting: Option<(u8, bool)>,
    at_end: Option<(u8, bool)>,
    start: Vec<(u8, bool)>,
    end: Vec<(u8, bool)>,
    is_conditional: bool,
}

#[derive(Clone, Debug)]
pub(crate) struct Draft {
    actions: Vec<DraftAction>,
    initial: u8,
    goal: Vec<(u8, bool)>,
    timed: Vec<(u8, u8, bool)>,
    /// For each action, if there are numbers.
    numbers: Vec<Numbers>,
    /// Initial values of the two numbers.
    values: (i8, i8),
    demands: Vec<Demand>,
}

/// Generates drafts in which two numbers are also compared and changed.
pub(crate) fn numeric_drafts() -> impl Strategy<Value = Draft> {
    (
        drafts(),
        prop::collection::vec(numbers::numbers(), 4),
        (-3..4_i8, -3..4_i8),
        numbers::goals(),
    )
        .prop_map(|(draft, numbers, values, demands)| Draft {
            numbers,
            values,
            demands,
            ..draft
        })
}

pub(crate) fn drafts() -> impl Strategy<Value = Draft> {
    let literal = || (0..5_u8, prop::bool::weighted(0.7));
    let few = |most| prop::collection::vec(literal(), 0..most);
    let action = (
        1..4_u8,
        few(3),
        prop::option::of(literal()),
        prop::option::weighted(0.2, literal()),
        few(3),
        few(3),
        prop::bool::weighted(0.1),
    );
    let action = action.prop_map(
        |(duration, needs, lasting, at_end, start, end, is_conditional)| DraftAction {
            duration,
            needs,
            lasting,
            at_end,
            start,
            end,
            is_conditional,
        },
    );
    (
        prop::collection::vec(action, 2..5),
        0..32_u8,
        prop::collection::vec(literal(), 1..4),
        prop::collection::vec((1..6_u8, 0..5_u8, any::<bool>()), 0..3),
    )
        .prop_map(|(actions, initial, goal, timed)| Draft {
            actions,
            initial,
            goal,
            timed,
            numbers: Vec::new(),
            values: (0, 0),
            demands: Vec::new(),
        })
}

fn written(literals: &[(u8, bool)], when: &str) -> String {
    let mut text = String::new();
    let mut seen = Vec::new();
    for &(fact, truth) in literals {
        if seen.contains(&fact) {
            continue;
        }
        seen.push(fact);
        let literal = if truth {
            format!("(f{fact})")
        } else {
            format!("(not (f{fact}))")
        };
        write!(text, " ({when} {literal})").expect("strings take all");
    }
    text
}

impl Draft {
    pub(crate) fn task(&self) -> Task {
        let mut domain = "(define (domain d) (:requirements :durative-actions :adl
            :timed-initial-literals :numeric-fluents) (:predicates (f0) (f1) (f2) (f3) (f4))
            (:functions (n0) (n1))"
            .to_owned();
        for (number, action) in self.actions.iter().enumerate() {
            let mut needs = written(&action.needs, "at start");
            needs += &written(action.lasting.as_slice(), "over all");
            needs += &written(action.at_end.as_slice(), "at end");
            let mut effects = written(&action.start, "at start");
            let mut end = written(&action.end, "at end");
            if let Some(numbers) = self.numbers.get(number) {
                let [at_start, at_end] = numbers.effects();
                needs += &numbers.needs();
                effects += &at_start;
                end += &at_end;
            }
            if action.is_conditional && !end.is_empty() {
                write!(effects, "(when (at end (f0)) (and {end}))").expect("strings take all");
            } else {
                effects += &end;
            }
            write!(
                domain,
                "(:durative-action a{number} :parameters () :duration (= ?duration {})
                  :condition (and{needs}) :effect (and{effects}))",
                action.duration
            )
            .expect("strings take all");
        }
        let mut problem = "(define (problem p) (:domain d) (:init".to_owned();
        for fact in (0..5).filter(|fact| self.initial >> fact & 1 == 1) {
            write!(problem, " (f{fact})").expect("strings take all");
        }
        write!(
            problem,
            "(= (n0) {}) (= (n1) {})",
            self.values.0, self.values.1
        )
        .expect("strings take all");
        // Happenings of one time have no order, so no fact may become both true and false.
        let mut said = std::collections::BTreeSet::new();
        for &(time, fact, truth) in &self.timed {
            if !said.insert((time, fact)) {
                continue;
            }
            problem += &written(&[(fact, truth)], &format!("at {time}"));
        }
        let demands = self.demands.iter().map(Demand::text);
        let goal = written(&self.goal, "and") + &demands.collect::<String>();
        write!(problem, ") (:goal (and {goal})))").expect("strings take all");
        let sources = (
            Source::new("domain.pddl", domain + ")"),
            Source::new("problem.pddl", problem),
        );
        match read_problem(&sources.0, &sources.1) {
            Ok((problem, _)) => Task::new(problem),
            Err(diagnostics) => panic!("{}", diagnostics.render(false)),
        }
    }
}

/// Returns the earliest end of all plans from a state, by trying all choices, or [`NEVER`] if there
/// is no plan with so few choices. Also checks that no state of a plan is a dead end.
fn earliest_end(
    compiled: &Compiled,
    pairs: &mut H2<'_>,
    state: &State,
    left: usize,
    budget: &mut u32,
) -> Ticks {
    let mut best = NEVER;
    let goal = |state: &State| compiled.goal.holds(&state.facts, &mut |_| true);
    if state.open.is_empty() && goal(state) {
        // A plan without happenings ends before it begins.
        best = state.earliest_end().max(compiled.now);
    }
    *budget = budget.saturating_sub(1);
    if left > 0 && *budget > 0 {
        // Each running action needs one choice for its end.
        let is_too_late = |step: &Step| matches!(step, Step::Start(_)) && state.open.len() >= left;
        for step in choices(compiled, state).filter(|step| !is_too_late(step)) {
            let mut stepper = Stepper::new(compiled);
            if let Some(next) = stepper.apply(state, step) {
                let end = earliest_end(compiled, pairs, &next, left - 1, budget);
                best = best.min(end);
            }
        }
    }
    if best < NEVER {
        pairs.horizon = best;
        assert!(
            !pairs.is_dead_end(state),
            "a plan that ends at {best}: {state:?}"
        );
    }
    best
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, ..ProptestConfig::default() })]

    #[test]
    fn no_state_of_a_valid_plan_is_a_dead_end(draft in drafts()) {
        let task = draft.task();
        let compiled = compiled(&task);
        let mut pairs = H2::of(&compiled).expect("small");
        let mut budget = 3_000;
        earliest_end(&compiled, &mut pairs, &root(&compiled), MOST, &mut budget);
    }
}
