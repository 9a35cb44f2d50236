//! Comparison with the enumeration of all corners.

use proptest::prelude::*;

use super::*;
use crate::{ConsistentNetwork, Constraint, Network};

/// A quantity's bounds: from a node to another, at most and at least the quantity plus this
/// much; and the interval it is in.
#[derive(Clone, Debug)]
struct Given {
    node_count: usize,
    /// From, to, bound.
    fixed: Vec<(usize, usize, i64)>,
    quantities: Vec<Quantity>,
}

#[derive(Clone, Debug)]
struct Quantity {
    /// From, to, and width of the difference; a quantity with several of them is coupled.
    differences: Vec<(usize, usize, i64)>,
    lower: i64,
    width: i64,
}

impl Given {
    fn edges(&self) -> Vec<OpenBound<usize>> {
        let node = |index: usize| NodeId(u32::try_from(index).unwrap());
        let fixed = self.fixed.iter().map(|&(from, to, bound)| OpenBound {
            from: node(from),
            to: node(to),
            constant: Rational::from(bound),
            quantity: None,
        });
        let own = self.quantities.iter().enumerate().flat_map(|(index, own)| {
            own.differences.iter().flat_map(move |&(from, to, slack)| {
                let edge = |from, to, constant, side| OpenBound {
                    from: node(from),
                    to: node(to),
                    constant: Rational::from(constant),
                    quantity: Some((index, side)),
                };
                [
                    edge(from, to, 0, Side::Upper),
                    edge(to, from, slack, Side::Lower),
                ]
            })
        });
        fixed.chain(own).collect()
    }

    fn value(&self, quantity: usize, side: Side) -> Rational {
        let own = &self.quantities[quantity];
        Rational::from(match side {
            Side::Lower => own.lower,
            Side::Upper => own.lower + own.width,
        })
    }

    fn is_consistent_at(&self, sides: &dyn Fn(usize) -> Side) -> bool {
        let mut network = Network::with_nodes(self.node_count);
        for edge in self.edges() {
            let value = edge.quantity.map(|(quantity, own)| {
                let value = self.value(quantity, sides(quantity));
                match own {
                    Side::Upper => value,
                    Side::Lower => -value,
                }
            });
            network.add(Constraint {
                from: edge.from,
                to: edge.to,
                bound: edge.constant + value.unwrap_or_default(),
            });
        }
        ConsistentNetwork::try_from(network).is_ok()
    }

    fn has_corner_without_schedule(&self) -> bool {
        (0..1_u32 << self.quantities.len()).any(|corner| {
            !self.is_consistent_at(&|quantity| match corner >> quantity & 1 {
                0 => Side::Lower,
                _ => Side::Upper,
            })
        })
    }

    fn found(&self) -> Result<Option<Corner<usize>>, TooManyBranches> {
        let branching = Branching {
            bounds: self.edges(),
            node_count: self.node_count,
            is_pair: &|quantity| self.quantities[quantity].differences.len() == 1,
            value: &|quantity, side| self.value(quantity, side),
            most_branches: 1 << 14,
        };
        branching.corner_without_schedule()
    }
}

fn given() -> impl Strategy<Value = Given> {
    (2..7_usize).prop_flat_map(|node_count| {
        let node = 0..node_count;
        let fixed = prop::collection::vec((node.clone(), node.clone(), -3..9_i64), 0..10);
        let differences = prop::collection::vec((node.clone(), node, 0..3_i64), 1..3);
        let quantity =
            (differences, -3..6_i64, 0..4_i64).prop_map(|(differences, lower, width)| Quantity {
                differences,
                lower,
                width,
            });
        let quantities = prop::collection::vec(quantity, 0..7);
        (Just(node_count), fixed, quantities).prop_map(|(node_count, fixed, quantities)| Given {
            node_count,
            fixed,
            quantities,
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn branching_agrees_with_corner_enumeration(given in given()) {
        let found = given.found().unwrap();
        prop_assert_eq!(found.is_some(), given.has_corner_without_schedule());
        if let Some(sides) = found {
            for others in [Side::Lower, Side::Upper] {
                let side = |quantity| sides.get(&quantity).copied().unwrap_or(others);
                prop_assert!(!given.is_consistent_at(&side));
            }
        }
    }
}

/// Returns a row of differences, each a quantity from 1 to 3. The end of the row has one bound from
/// above and one from below.
fn row(length: usize, least: i64, most: i64) -> Given {
    let quantities = (0..length).map(|index| Quantity {
        differences: vec![(index, index + 1, 0)],
        lower: 1,
        width: 2,
    });
    Given {
        node_count: length + 1,
        fixed: vec![(0, length, most), (length, 0, -least)],
        quantities: quantities.collect(),
    }
}

#[test]
fn forty_quantities_in_a_row_need_no_branches() {
    let sum = 40;
    assert_eq!(row(40, sum, 3 * sum).found(), Ok(None));
    let too_late = row(40, sum, 3 * sum - 1).found().unwrap().unwrap();
    assert_eq!(too_late.len(), 40);
    assert!(too_late.values().all(|side| *side == Side::Upper));
    let too_early = row(40, sum + 1, 3 * sum).found().unwrap().unwrap();
    assert!(too_early.values().all(|side| *side == Side::Lower));
}
