//! Dynamic controllability compared with a game that is enumerated completely, and the dispatcher
//! tested in worlds of all kinds.

#![allow(
    clippy::unwrap_used,
    clippy::too_many_lines,
    clippy::type_complexity,
    reason = "the helpers of a test are part of it"
)]

use std::sync::Arc;

use crate::game::{Board, Random};
use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{
    Adversary, ContingentLink, Dispatchable, Dispatcher, UncertainNetwork,
};
use elbowroom_stn::{Constraint, Network, NodeId, Weight};

/// Returns the number in the environment variable, for longer manual runs, or the default.
fn many(default: u64) -> u64 {
    std::env::var("ELBOWROOM_NETWORKS")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(default)
}

#[test]
fn verdict_equals_game_result() {
    let mut controllable = 0;
    let count = many(20_000);
    for seed in 0..count {
        let board = Board::random(&mut Random(seed));
        let verdict = board.network().dynamic();
        assert_eq!(
            verdict.is_ok(),
            board.executor_wins(),
            "seed {seed}: {:?} within {}, links {:?}: {:?}",
            board.requirements,
            board.horizon,
            board.links,
            verdict.err()
        );
        let executable = board.network().executable();
        assert_eq!(executable.is_ok(), verdict.is_ok(), "seed {seed}");
        controllable += u64::from(verdict.is_ok());
    }
    // Both results are frequent.
    assert!(
        5 * controllable > count && 5 * (count - controllable) > count,
        "{controllable}"
    );
}

#[test]
fn a_conflict_is_a_negative_cycle_of_the_network() {
    for seed in 0..many(5_000) {
        let network = Board::random(&mut Random(seed)).network();
        let Err(conflict) = network.dynamic() else {
            continue;
        };
        assert!(conflict.is_whole);
        assert!(conflict.total < Weight::zero());
        let sum = conflict
            .steps
            .iter()
            .fold(Weight::zero(), |sum, step| Weight::plus(&sum, &step.bound));
        assert_eq!(conflict.total, sum, "seed {seed}");
        let next = conflict.steps.iter().cycle().skip(1);
        for (step, next) in conflict.steps.iter().zip(next) {
            assert_eq!(step.to, next.from, "seed {seed}");
        }
    }
}

#[test]
fn strong_controllability_implies_dynamic_and_its_times_hold_at_all_corners() {
    let mut both = [0; 2];
    for seed in 0..many(5_000) {
        let board = Board::random(&mut Random(seed));
        let network = board.network();
        let Ok(schedule) = network.strong() else {
            both[0] += 1;
            continue;
        };
        both[1] += 1;
        assert!(network.is_dynamically_controllable(), "seed {seed}");
        for corner in 0..1 << board.links.len() {
            let mut times = schedule.times().to_vec();
            // Links are in no order, so it takes up to one round per link until all activations are
            // known.
            for _ in 0..board.links.len() {
                for (index, &(activation, end, lower, upper)) in board.links.iter().enumerate() {
                    let duration = if corner >> index & 1 == 0 {
                        lower
                    } else {
                        upper
                    };
                    times[end] = times[activation] + duration;
                }
            }
            for constraint in network.requirements().constraints() {
                let difference = times[constraint.to.index()] - times[constraint.from.index()];
                assert!(difference <= constraint.bound, "seed {seed}");
            }
        }
    }
    assert!(both.iter().all(|&count| count > 100), "{both:?}");
}

/// Policy of the world for choosing durations.
#[derive(Clone, Copy, Debug)]
enum World {
    Early,
    Late,
    Corners,
    Arbitrary,
}

/// Executes a network, each point as early as possible (or at random later), and returns the times.
fn execute(
    network: &UncertainNetwork<i64>,
    form: &Arc<Dispatchable<i64>>,
    world: World,
    lingers: bool,
    random: &mut Random,
) -> Result<Vec<i64>, String> {
    let count = network.requirements().node_count();
    let durations: Vec<i64> = network
        .links()
        .iter()
        .map(|link| {
            let upper = link.upper.unwrap_or(link.lower + 50);
            match world {
                World::Early => link.lower,
                World::Corners if random.below(2) == 0 => link.lower,
                World::Late | World::Corners => upper,
                World::Arbitrary => random.whole(link.lower, upper),
            }
        })
        .collect();
    let mut dispatcher = Dispatcher::new(Arc::clone(form));
    dispatcher
        .record(NodeId(0), &0)
        .map_err(|missed| format!("{missed:?}"))?;
    let mut now = 0;
    while (0..count).any(|node| {
        dispatcher
            .event_time(NodeId(u32::try_from(node).unwrap()))
            .is_none()
    }) {
        // Executes the world's events until now, which may cause further ones.
        let ends = |dispatcher: &Dispatcher<i64>| {
            let due = network.links().iter().zip(&durations);
            due.filter(|(link, _)| dispatcher.event_time(link.end).is_none())
                .filter_map(|(link, duration)| {
                    Some((dispatcher.event_time(link.activation)? + duration, link.end))
                })
                .min()
        };
        while let Some((time, end)) = ends(&dispatcher).filter(|(time, _)| *time <= now) {
            dispatcher
                .record(end, &time)
                .map_err(|missed| format!("{missed:?}"))?;
        }
        let next_end = ends(&dispatcher).map(|(time, _)| time);
        let ready: Vec<(i64, Option<i64>, NodeId)> = dispatcher
            .ready()
            .filter_map(|node| {
                let earliest = dispatcher.earliest(node).ok()?.copied().unwrap_or(now);
                Some((earliest.max(now), dispatcher.window(node).1.copied(), node))
            })
            .collect();
        let first = ready
            .iter()
            .filter(|(earliest, ..)| *earliest == now)
            .min_by_key(|(_, latest, node)| (latest.unwrap_or(i64::MAX), *node));
        // No point may be delayed beyond the earliest of all latest times.
        let deadline = ready.iter().filter_map(|(_, latest, _)| *latest).min();
        if let Some(&(_, _, node)) = first
            && (!lingers
                || deadline.is_some_and(|deadline| deadline <= now)
                || random.below(3) == 0)
        {
            dispatcher
                .record(node, &now)
                .map_err(|missed| format!("{missed:?}"))?;
            continue;
        }
        let opening = ready
            .iter()
            .map(|(earliest, ..)| *earliest)
            .filter(|time| *time > now)
            .min();
        let mut next: Vec<i64> = next_end.into_iter().chain(opening).collect();
        if first.is_some() {
            next.push(now + 1);
        }
        let Some(next) = next.into_iter().min() else {
            break;
        };
        now = next;
    }
    let times = (0..count).map(|node| {
        let node = NodeId(u32::try_from(node).unwrap());
        let time = dispatcher.event_time(node).copied();
        time.ok_or_else(|| format!("{node} never happens"))
    });
    times.collect()
}

#[test]
fn dispatcher_satisfies_requirements_in_any_world() {
    let mut runs = 0;
    for seed in 0..many(20_000) {
        let mut random = Random(seed);
        let board = Board::random(&mut random);
        let network = board.network();
        let form = match seed % 4 {
            0 => network.dynamic(),
            _ => network.executable(),
        };
        let Ok(form) = form else {
            continue;
        };
        let form = Arc::new(form);
        for world in [
            World::Early,
            World::Late,
            World::Corners,
            World::Arbitrary,
            World::Arbitrary,
        ] {
            for lingers in [false, true] {
                let told = || {
                    format!(
                        "seed {seed}, {world:?}, {lingers}: {:?} within {}, links {:?}",
                        board.requirements, board.horizon, board.links
                    )
                };
                let times = execute(&network, &form, world, lingers, &mut random)
                    .unwrap_or_else(|trouble| panic!("{}: {trouble}", told()));
                for constraint in network.requirements().constraints() {
                    let difference = times[constraint.to.index()] - times[constraint.from.index()];
                    assert!(difference <= constraint.bound, "{}: {times:?}", told());
                }
                runs += 1;
            }
        }
    }
    assert!(runs > 1000);
}

#[test]
fn unbounded_link_equals_very_large_bound() {
    let mut controllable = [0; 2];
    for seed in 0..many(10_000) {
        let board = Board::random(&mut Random(seed));
        let network = board.network();
        // Removes the horizon, with which no unbounded link would be controllable.
        let mut requirements = Network::with_nodes(board.count);
        for constraint in network.requirements().constraints() {
            if constraint.from != NodeId(0) {
                requirements.add(constraint.clone());
            }
        }
        let unbounded = |upper: Option<i64>, random: &mut Random| {
            let links = network.links().iter().cloned().map(|mut link| {
                if random.below(2) == 0 {
                    link.upper = upper;
                }
                link
            });
            UncertainNetwork::new(requirements.clone(), links.collect()).unwrap()
        };
        let infinite = unbounded(None, &mut Random(seed)).is_dynamically_controllable();
        let large = unbounded(Some(100_000), &mut Random(seed)).is_dynamically_controllable();
        assert_eq!(infinite, large, "seed {seed}");
        controllable[usize::from(infinite)] += 1;
    }
    assert!(
        controllable.iter().all(|&count| count > 100),
        "{controllable:?}"
    );
}

/// Returns the same network with rational bounds.
fn rational(network: &UncertainNetwork<i64>) -> UncertainNetwork {
    let mut requirements = Network::with_nodes(network.requirements().node_count());
    for constraint in network.requirements().constraints() {
        let bound = Rational::from(constraint.bound);
        requirements.add(Constraint::at_most(constraint.from, constraint.to, bound));
    }
    let links = network.links().iter().map(|link| ContingentLink {
        activation: link.activation,
        end: link.end,
        lower: link.lower.into(),
        upper: link.upper.map(Rational::from),
    });
    UncertainNetwork::new(requirements, links.collect()).unwrap()
}

/// Executes a network against the adversary. Returns `true` if every requirement held in the end.
fn survives(board: &Board, network: &UncertainNetwork, random: &mut Random) -> bool {
    let adversary = Adversary::new(network.clone(), NodeId(0));
    let mut happened: Vec<Option<Rational>> = vec![None; board.count];
    happened[0] = Some(Rational::ZERO);
    let eagerness = 1 + random.below(4);
    for now in 0..=board.horizon {
        let now = Rational::from(now);
        loop {
            for link in adversary.ends_now(&now, &happened) {
                happened[network.link(link).end.index()] = Some(now.clone());
            }
            let free: Vec<usize> = (0..board.count)
                .filter(|&node| {
                    let id = NodeId(u32::try_from(node).unwrap());
                    happened[node].is_none() && !network.is_contingent(id)
                })
                .collect();
            if free.is_empty() || random.below(eagerness) != 0 {
                break;
            }
            happened[free[random.below(free.len())]] = Some(now.clone());
        }
    }
    network
        .requirements()
        .constraints()
        .iter()
        .all(|constraint| {
            match (
                &happened[constraint.from.index()],
                &happened[constraint.to.index()],
            ) {
                (Some(from), Some(to)) => to - from <= constraint.bound,
                _ => false,
            }
        })
}

#[test]
fn adversary_wins_if_network_is_uncontrollable() {
    let mut games = 0;
    for seed in 0..many(3_000) {
        let mut random = Random(seed);
        let board = Board::random(&mut random);
        let network = board.network();
        if network.is_dynamically_controllable() {
            continue;
        }
        for _ in 0..10 {
            assert!(
                !survives(&board, &rational(&network), &mut random),
                "seed {seed}"
            );
            games += 1;
        }
    }
    assert!(games > 1000);
}
