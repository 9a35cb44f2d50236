//! Against the plain way: all corners, one after the other.

use elbowroom_num::Rational;
use elbowroom_plan::BoxEnd;
use elbowroom_stn::{ConsistentNetwork, Constraint, Network, NodeId as ClassId};
use proptest::prelude::*;

use super::*;

/// A parameter's bounds: from a class to another, at most and at least the parameter plus this
/// much; and the interval it is in.
#[derive(Clone, Debug)]
struct Given {
    class_count: usize,
    /// From, to, bound.
    fixed: Vec<(usize, usize, i64)>,
    parameters: Vec<Parameter>,
}

#[derive(Clone, Debug)]
struct Parameter {
    /// From, to, and how far the least difference is below the greatest; several are coupled.
    differences: Vec<(usize, usize, i64)>,
    lower: i64,
    width: i64,
}

impl Given {
    fn edges(&self) -> Vec<Edge> {
        let class = |index: usize| ClassId(u32::try_from(index).unwrap());
        let fixed = self.fixed.iter().map(|&(from, to, bound)| Edge {
            from: class(from),
            to: class(to),
            constant: Rational::from(bound),
            end: None,
        });
        let own = self.parameters.iter().enumerate().flat_map(|(index, own)| {
            let parameter = ParameterId::from(index);
            own.differences.iter().flat_map(move |&(from, to, slack)| {
                let edge = |from, to, constant, side| Edge {
                    from: class(from),
                    to: class(to),
                    constant: Rational::from(constant),
                    end: Some(BoxEnd { parameter, side }),
                };
                [
                    edge(from, to, 0, Side::Upper),
                    edge(to, from, slack, Side::Lower),
                ]
            })
        });
        fixed.chain(own).collect()
    }

    fn value(&self, parameter: ParameterId, side: Side) -> Rational {
        let own = &self.parameters[parameter.index()];
        Rational::from(match side {
            Side::Lower => own.lower,
            Side::Upper => own.lower + own.width,
        })
    }

    fn is_consistent_at(&self, sides: &dyn Fn(ParameterId) -> Side) -> bool {
        let mut network = Network::with_nodes(self.class_count);
        for edge in self.edges() {
            let value = edge.end.map(|end| {
                let value = self.value(end.parameter, sides(end.parameter));
                match end.side {
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
        (0..1_u32 << self.parameters.len()).any(|corner| {
            !self.is_consistent_at(&|parameter| match corner >> parameter.index() & 1 {
                0 => Side::Lower,
                _ => Side::Upper,
            })
        })
    }

    fn found(&self) -> Result<Option<Sides>, TooManyBranches> {
        let edges = self.edges();
        let branching = Branching {
            edges: edges.iter().collect(),
            class_count: self.class_count,
            is_pair: &|parameter| self.parameters[parameter.index()].differences.len() == 1,
            value: &|parameter, side| self.value(parameter, side),
        };
        branching.corner_without_schedule()
    }
}

fn given() -> impl Strategy<Value = Given> {
    (2..7_usize).prop_flat_map(|class_count| {
        let class = 0..class_count;
        let fixed = prop::collection::vec((class.clone(), class.clone(), -3..9_i64), 0..10);
        let differences = prop::collection::vec((class.clone(), class, 0..3_i64), 1..3);
        let parameter =
            (differences, -3..6_i64, 0..4_i64).prop_map(|(differences, lower, width)| Parameter {
                differences,
                lower,
                width,
            });
        let parameters = prop::collection::vec(parameter, 0..7);
        (Just(class_count), fixed, parameters).prop_map(|(class_count, fixed, parameters)| Given {
            class_count,
            fixed,
            parameters,
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn branches_say_what_all_corners_say(given in given()) {
        let found = given.found().unwrap();
        prop_assert_eq!(found.is_some(), given.has_corner_without_schedule());
        if let Some(sides) = found {
            for others in [Side::Lower, Side::Upper] {
                let side = |parameter| sides.get(&parameter).copied().unwrap_or(others);
                prop_assert!(!given.is_consistent_at(&side));
            }
        }
    }
}

/// A row of differences, each a parameter from 1 to 3, with no bound on where the row ends but one
/// from above and one from below.
fn row(length: usize, least: i64, most: i64) -> Given {
    let parameters = (0..length).map(|index| Parameter {
        differences: vec![(index, index + 1, 0)],
        lower: 1,
        width: 2,
    });
    Given {
        class_count: length + 1,
        fixed: vec![(0, length, most), (length, 0, -least)],
        parameters: parameters.collect(),
    }
}

#[test]
fn forty_parameters_in_a_row_need_no_branches() {
    let sum = 40;
    assert_eq!(row(40, sum, 3 * sum).found(), Ok(None));
    let too_late = row(40, sum, 3 * sum - 1).found().unwrap().unwrap();
    assert_eq!(too_late.len(), 40);
    assert!(too_late.values().all(|side| *side == Side::Upper));
    let too_early = row(40, sum + 1, 3 * sum).found().unwrap().unwrap();
    assert!(too_early.values().all(|side| *side == Side::Lower));
}
