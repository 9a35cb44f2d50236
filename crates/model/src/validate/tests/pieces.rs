//! Comparison of the cutting of pieces with a dense grid of moments.

use proptest::prelude::*;

use super::world::{World, number};
use crate::validate::ViolationKind;
use elbowroom_num::Rational;

/// Generates a comparison of `x` or `y` with a small number, in one of five ways.
fn atom() -> impl Strategy<Value = String> {
    let symbol = prop::sample::select(vec!["<", "<=", "=", ">=", ">"]);
    let fluent = prop::sample::select(vec!["x", "y", "(+ x y)", "(* x y)", "(- x (* 2 y))"]);
    (symbol, fluent, -3..4_i32).prop_map(|(s, f, n)| format!("({s} {f} {n})"))
}

fn condition() -> impl Strategy<Value = String> {
    atom().prop_recursive(2, 8, 3, |inner| {
        let parts = prop::collection::vec(inner.clone(), 1..4);
        prop_oneof![
            inner.prop_map(|part| format!("(not {part})")),
            parts
                .clone()
                .prop_map(|parts| format!("(or {})", parts.join(" "))),
            parts.prop_map(|parts| format!("(and {})", parts.join(" "))),
        ]
    })
}

proptest! {
    /// With slopes and values that are small whole numbers, all comparisons of linear terms
    /// change at multiples of 1/60; a finer grid meets each cell unless a product is compared.
    #[test]
    fn condition_holds_throughout_exactly_if_it_holds_on_dense_grid(
        condition in condition(),
        x in -3..4_i32, y in -3..4_i32, dx in -2..3_i32, dy in -2..3_i32,
    ) {
        let initial = format!("(= x {x}) (= y {y})");
        let rate = format!("x {dx} y {dy}");
        let throughout = World::new(&initial)
            .durative("a", &[("rate", &rate), ("over all", &condition)])
            .judge("0: a [3]");
        let mut sampled = true;
        let steps = 3 * 360;
        for step in 1..steps {
            let time = Rational::new(step, 360);
            let value = |start: i32, slope: i32| {
                Rational::from(start) + Rational::from(slope) * &time
            };
            let state = format!("(= x {}) (= y {})", value(x, dx), value(y, dy));
            sampled &= World::new(&state).goal(&condition).judge("") == "valid";
            if !sampled {
                break;
            }
        }
        // A product may cross a bound and return between two grid points, or touch it outside the
        // grid.
        if condition.contains("(* x y)") {
            prop_assert!(sampled || throughout != "valid");
        } else {
            prop_assert_eq!(sampled, throughout == "valid", "{}", throughout);
        }
    }

    /// The plan that ends at the reported first violation is valid; one that ends a little later is
    /// not.
    #[test]
    fn reported_violation_is_the_earliest(
        condition in condition(),
        x in -3..4_i32, y in -3..4_i32, dx in -2..3_i32, dy in -2..3_i32,
    ) {
        let world = World::new(&format!("(= x {x}) (= y {y})"))
            .durative("a", &[("rate", &format!("x {dx} y {dy}")), ("over all", &condition)]);
        if let Some(violation) = world.verdict("0: a [3]").violation() {
            let ViolationKind::Condition { is_exact, .. } = violation.kind else { panic!() };
            if is_exact {
                prop_assert_eq!(world.judge(&format!("0: a [{}]", violation.time)), "valid");
            }
            let after = &violation.time + number("0.00001");
            prop_assert_ne!(world.judge(&format!("0: a [{after}]")), "valid");
        }
    }
}
