//! Accepted strategies win: the check of controllability, which is independent of planning, is
//! compared with an exhaustive game, and with the search of another crate.

#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "the helpers of a test are part of it, and the game has some for other tests"
)]

use std::collections::BTreeMap;

use crate::game::{Board, Random};
use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{ContingentLink, UncertainNetwork};
use elbowroom_verify::sound::{Control, Edge, Endless, Sound, Strategy, Wait};
use elbowroom_verify::{
    Certificate, Constraint, End, Exact, Guarantee, Limit, Parameter, Reasons, with_sums,
};

/// Returns a certificate about the network that proves at most that it is controllable.
fn certificate(network: &UncertainNetwork<i64>, strategy: Strategy) -> Certificate {
    let requirements = network.requirements().constraints().iter();
    let mut constraints: Vec<Constraint> = requirements
        .map(|own| Constraint {
            from: own.from.index(),
            to: own.to.index(),
            lower: Limit::None,
            upper: Limit::Number(Exact(Rational::from(own.bound))),
            observed: false,
        })
        .collect();
    let mut parameters = Vec::new();
    let mut slacks = Vec::new();
    let mut endless = Vec::new();
    for (index, link) in network.links().iter().enumerate() {
        constraints.push(Constraint {
            from: link.activation.index(),
            to: link.end.index(),
            lower: Limit::Parameter(index),
            upper: Limit::Parameter(index),
            observed: true,
        });
        parameters.push(Parameter {
            name: index.to_string(),
            nominal: Rational::from(link.lower),
            scale: Rational::ONE,
            weight: Rational::ONE,
            most_below: None,
            most_above: None,
            chance: None,
        });
        let more = link.upper.map(|upper| upper - link.lower);
        slacks.extend([0, more.unwrap_or_default()].map(|own| Exact(Rational::from(own))));
        endless.extend(more.is_none().then_some(Endless {
            parameter: index,
            end: End::Upper,
        }));
    }
    let nodes = network.requirements().nodes();
    Certificate {
        proves: String::new(),
        assumes: Vec::new(),
        guarantee: Guarantee::Dynamic,
        parameters,
        points: nodes.map(|node| node.index().to_string()).collect(),
        constraints,
        symmetric: false,
        counted: Rational::ONE,
        slacks,
        proofs: Vec::new(),
        reasons: Reasons::LeastSlack(Vec::new()),
        sound: Some(Sound {
            endless,
            control: Control::Strategy(strategy),
            conditions: None,
        }),
    }
}

fn is_accepted(network: &UncertainNetwork<i64>, strategy: &Strategy) -> bool {
    let told = with_sums(certificate(network, strategy.clone())).unwrap();
    told.sound.unwrap().control != Control::Assumed
}

/// Returns the edges and waits that the dispatchable form of a controllable network adds.
fn strategy_of(network: &UncertainNetwork<i64>) -> Option<Strategy> {
    let form = network.dynamic().ok()?;
    let mut given: BTreeMap<(usize, usize), i64> = BTreeMap::new();
    for own in network.requirements().constraints() {
        let known = given
            .entry((own.from.index(), own.to.index()))
            .or_insert(own.bound);
        *known = own.bound.min(*known);
    }
    for link in network.links() {
        if link.upper == Some(link.lower) {
            let known = given.entry((link.end.index(), link.activation.index()));
            let known = known.or_insert(-link.lower);
            *known = (-link.lower).min(*known);
        }
    }
    for node in network.requirements().nodes().skip(1) {
        if !network.is_contingent(node) {
            let known = given.entry((node.index(), 0)).or_insert(0);
            *known = 0.min(*known);
        }
    }
    let mut all = given.clone();
    for edge in form.edges().filter(|edge| edge.from != edge.to) {
        let known = all
            .entry((edge.from.index(), edge.to.index()))
            .or_insert(*edge.bound);
        *known = (*edge.bound).min(*known);
    }
    all.retain(|ends, bound| given.get(ends) != Some(bound));
    let edges = all.into_iter().map(|((from, to), most)| Edge {
        from,
        to,
        most: Rational::from(most),
    });
    // A wait without limit is the longest.
    let mut longest: BTreeMap<(usize, usize), Option<i64>> = BTreeMap::new();
    for (node, link, delay) in form.derived_waits() {
        let own = network.link(link);
        if node != own.end && delay.is_none_or(|delay| delay > own.lower) {
            let known = longest.entry((node.index(), link.index())).or_insert(delay);
            *known = known.zip(delay).map(|(one, other)| one.max(other));
        }
    }
    let first = network.requirements().constraints().len();
    let waits = longest.into_iter().map(|((point, link), delay)| Wait {
        point,
        duration: first + link,
        delay: delay.map(|delay| Exact(Rational::from(delay))),
    });
    Some(Strategy {
        edges: edges.collect(),
        waits: waits.collect(),
    })
}

/// Returns the network with modified link durations and the same requirements.
fn changed(network: &UncertainNetwork<i64>, random: &mut Random) -> UncertainNetwork<i64> {
    let links = network.links().iter().map(|link| {
        let lower = (link.lower + random.whole(-2, 2)).max(0);
        let upper = link
            .upper
            .map(|upper| (upper + random.whole(-2, 2)).max(lower));
        ContingentLink {
            lower,
            upper,
            ..link.clone()
        }
    });
    UncertainNetwork::new(network.requirements().clone(), links.collect()).unwrap()
}

/// Returns the network with a link of unbounded duration.
fn with_unbounded_link(
    network: &UncertainNetwork<i64>,
    random: &mut Random,
) -> UncertainNetwork<i64> {
    let mut links = network.links().to_vec();
    if !links.is_empty() {
        let index = random.below(links.len());
        links[index].upper = None;
    }
    let mut requirements = elbowroom_stn::Network::with_nodes(network.requirements().node_count());
    for own in network.requirements().constraints() {
        // A deadline for all points would leave nothing to test.
        if own.from.index() != 0 {
            requirements.add(own.clone());
        }
    }
    UncertainNetwork::new(requirements, links).unwrap()
}

#[test]
fn dispatchable_form_of_controllable_network_is_accepted() {
    let mut random = Random(11);
    let (mut accepted, mut played, mut waits, mut endless) = (0, 0, 0, 0);
    for round in 0..20_000 {
        let board = Board::random(&mut random);
        let mut network = board.network();
        let has_end = round % 4 > 0;
        if !has_end {
            network = with_unbounded_link(&network, &mut random);
        }
        let Some(strategy) = strategy_of(&network) else {
            continue;
        };
        assert!(
            is_accepted(&network, &strategy),
            "{network:?}\n{strategy:?}"
        );
        accepted += 1;
        waits += usize::from(!strategy.waits.is_empty());
        endless += usize::from(network.links().iter().any(|link| link.upper.is_none()));
        if has_end && played < 300 && !network.links().is_empty() {
            assert!(board.executor_wins(), "{network:?}");
            played += 1;
        }
    }
    let enough = accepted > 2_000 && played == 300 && waits > 100 && endless > 100;
    assert!(enough, "{accepted} {played} {waits} {endless}");
}

#[test]
fn strategy_accepted_for_another_network_is_correct_there() {
    let mut random = Random(13);
    let (mut accepted, mut refused, mut uncontrollable, mut played) = (0, 0, 0, 0);
    for _ in 0..20_000 {
        let board = Board::random(&mut random);
        let Some(mut strategy) = strategy_of(&board.network()) else {
            continue;
        };
        for _ in 0..10 {
            let other = changed(&board.network(), &mut random);
            // Sometimes a bound or a wait is modified.
            if let Some(edge) = strategy.edges.last_mut().filter(|_| random.below(3) == 0) {
                edge.most += Rational::from(random.whole(-2, 2));
            }
            if let Some(wait) = strategy.waits.last_mut().filter(|_| random.below(3) == 0) {
                wait.delay = Some(Exact(Rational::from(random.whole(1, 6))));
            }
            let is_controllable = other.is_dynamically_controllable();
            uncontrollable += usize::from(!is_controllable);
            if !is_accepted(&other, &strategy) {
                refused += 1;
                continue;
            }
            accepted += 1;
            assert!(is_controllable, "{other:?}\n{strategy:?}");
            if played < 300 && !other.links().is_empty() {
                let links = other.links().iter();
                let links = links.map(|own| {
                    let (from, to) = (own.activation.index(), own.end.index());
                    (from, to, own.lower, own.upper.unwrap())
                });
                let board = Board {
                    count: board.count,
                    horizon: board.horizon,
                    requirements: board.requirements.clone(),
                    links: links.collect(),
                };
                assert!(board.executor_wins(), "{other:?}\n{strategy:?}");
                played += 1;
            }
        }
    }
    let enough = accepted > 5_000 && refused > 5_000 && uncontrollable > 5_000 && played == 300;
    assert!(enough, "{accepted} {refused} {uncontrollable} {played}");
}
