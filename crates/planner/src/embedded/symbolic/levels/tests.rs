//! Compares bounds on expressions over times with times that satisfy the constraints: none exceeds
//! a bound.

use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;
use proptest::prelude::*;

use super::highest_value;
use crate::embedded::expressions::{Form, Symbolic};
use crate::embedded::network::Network;
use crate::embedded::time::Scale;

/// Sequential actions: duration bounds, a rate, and whether the level must not exceed its capacity
/// at the end.
type Draft = Vec<(u8, u8, i8, bool)>;

fn drafts() -> impl Strategy<Value = (Draft, Vec<u8>)> {
    let action = (0..4_u8, 0..4_u8, -3..4_i8, any::<bool>());
    let chosen = prop::collection::vec(0..4_u8, 4);
    (prop::collection::vec(action, 1..5), chosen)
}

proptest! {
    #[test]
    fn feasible_times_never_exceed_bound((draft, chosen) in drafts()) {
        let scale = Scale::of(std::iter::empty());
        let tick = |time: u8| scale.floor(&Rational::from(i64::from(time))).0;
        let (mut network, mut symbolic) = (Network::default(), Symbolic::default());
        let capacity = Rational::from(10);
        let mut level = Form::constant(Rational::from(5));
        let mut times: Vec<Rational> = Vec::new();
        let mut keeps_capacity = true;
        for ((least, room, rate, is_capped), chosen) in draft.iter().zip(&chosen) {
            let after = network.node_count().checked_sub(1);
            let after: Vec<_> = after.map(|end| (u16::try_from(end).unwrap(), 0)).into_iter().collect();
            let start = network.add_node(0, i64::MAX / 4, &after).unwrap();
            let end = network.add_node(0, i64::MAX / 4, &[(start, tick(*least))]).unwrap();
            network.add_edge(end, start, -tick(least + room)).unwrap();
            let begin = times.last().cloned().unwrap_or(Rational::ZERO);
            let duration = least + chosen % (room + 1);
            times.push(begin.clone());
            times.push(begin + Rational::from(i64::from(duration)));
            let rate = Rational::from(i64::from(*rate));
            level = level.plus(&rate, &Form::node(end)).plus(&-&rate, &Form::node(start));
            if *is_capped {
                let over = level.clone().plus(&Rational::from(-1), &Form::constant(capacity.clone()));
                keeps_capacity &= over.at(&times) <= Rational::ZERO;
                symbolic.demand(over, Comparison::AtMost);
            }
        }
        prop_assume!(keeps_capacity);
        let highest = highest_value(level.clone(), &symbolic, &network, scale);
        // All durations are bounded.
        let highest = highest.expect("a bound");
        prop_assert!(level.at(&times) <= highest, "{} > {highest}", level.at(&times));
        if level.as_constant().is_none() && draft.last().is_some_and(|last| last.3 && last.2 != 0) {
            prop_assert!(highest <= capacity);
        }
    }
}
