//! Failures, against games in whole seconds that are searched exhaustively.

use std::collections::BTreeMap;

use elbowroom_envelope::faults::{Attempt, FaultNetwork, FaultVerdict, Layers, decide};
use elbowroom_num::Rational;
use elbowroom_stn::{Constraint, NodeId};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Deadline of all actions.
const HORIZON: i64 = 11;

/// The state of an action in a game.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Phase {
    Waiting,
    Running(i64),
    Recovering(i64),
    Done,
}

/// State of a game.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct State {
    time: i64,
    phases: Vec<Phase>,
    failures: Vec<usize>,
    first: Vec<Option<i64>>,
    last: Vec<Option<i64>>,
    ends: Vec<Option<i64>>,
}

/// Game of an executor against a world that decides durations, failures and recoveries.
struct Game {
    attempts: Vec<(i64, i64, usize)>,
    requirements: Vec<(usize, usize, i64)>,
    recovery: (i64, i64),
    faults: usize,
    known: BTreeMap<State, bool>,
}

fn whole(value: &Rational) -> i64 {
    assert!(value.is_integer());
    value.as_small().unwrap().0
}

impl Game {
    fn new(network: &FaultNetwork, faults: usize) -> Self {
        let attempts = network.attempts.iter().map(|own| {
            let upper = own.upper.as_ref().unwrap();
            (whole(&own.lower), whole(upper), own.retries)
        });
        let requirements = network.requirements.iter();
        let requirements =
            requirements.map(|own| (own.from.index(), own.to.index(), whole(&own.bound)));
        Self {
            attempts: attempts.collect(),
            requirements: requirements.collect(),
            recovery: (whole(&network.recovery[0]), whole(&network.recovery[1])),
            faults,
            known: BTreeMap::new(),
        }
    }

    fn is_won(&mut self) -> bool {
        let count = self.attempts.len();
        let state = State {
            time: 0,
            phases: vec![Phase::Waiting; count],
            failures: vec![0; count],
            first: vec![None; count],
            last: vec![None; count],
            ends: vec![None; count],
        };
        self.executor_wins(&state)
    }

    /// Returns the final time of a node; `None` if it can still change.
    fn final_time(state: &State, node: usize, of_first: bool) -> Option<i64> {
        if node == 0 {
            return Some(0);
        }
        let action = (node - 1) / 2;
        match (node % 2 == 1, of_first) {
            (true, true) => state.first[action],
            (true, false) => state.ends[action].and(state.last[action]),
            (false, _) => state.ends[action],
        }
    }

    fn is_violated(&self, state: &State) -> bool {
        if state.time > HORIZON {
            return true;
        }
        self.requirements.iter().any(|&(from, to, bound)| {
            let from = Self::final_time(state, from, bound <= 0);
            let to = Self::final_time(state, to, false);
            matches!((from, to), (Some(from), Some(to)) if to - from > bound)
        })
    }

    /// The executor starts some of the actions that may start.
    fn executor_wins(&mut self, state: &State) -> bool {
        if self.is_violated(state) {
            return false;
        }
        if state.phases.iter().all(|phase| *phase == Phase::Done) {
            return true;
        }
        if let Some(&known) = self.known.get(state) {
            return known;
        }
        let count = state.phases.len();
        let mut wins = false;
        for choice in 0..(1_usize << count) {
            let starts = |action: usize| choice >> action & 1 == 1;
            if (0..count).any(|own| starts(own) && state.phases[own] != Phase::Waiting) {
                continue;
            }
            let mut next = state.clone();
            for action in (0..count).filter(|&own| starts(own)) {
                next.phases[action] = Phase::Running(state.time);
                next.first[action].get_or_insert(state.time);
                next.last[action] = Some(state.time);
            }
            next.time += 1;
            if self.survives_world(&next, 0) {
                wins = true;
                break;
            }
        }
        self.known.insert(state.clone(), wins);
        wins
    }

    /// The world decides about each action, one after the other.
    fn survives_world(&mut self, state: &State, action: usize) -> bool {
        let Some(&phase) = state.phases.get(action) else {
            return self.executor_wins(state);
        };
        let mut nexts = Vec::new();
        match phase {
            Phase::Waiting | Phase::Done => nexts.push(state.clone()),
            Phase::Running(since) => {
                let (lower, upper, retries) = self.attempts[action];
                let elapsed = state.time - since;
                if elapsed < upper {
                    nexts.push(state.clone());
                }
                if elapsed >= lower {
                    let mut next = state.clone();
                    next.phases[action] = Phase::Done;
                    next.ends[action] = Some(state.time);
                    nexts.push(next);
                }
                let all: usize = state.failures.iter().sum();
                if state.failures[action] < retries && all < self.faults {
                    let mut next = state.clone();
                    next.failures[action] += 1;
                    next.phases[action] = Phase::Recovering(state.time);
                    if self.recovery.1 > 0 {
                        nexts.push(next.clone());
                    }
                    if self.recovery.0 == 0 {
                        next.phases[action] = Phase::Waiting;
                        nexts.push(next);
                    }
                }
            }
            Phase::Recovering(since) => {
                let elapsed = state.time - since;
                if elapsed < self.recovery.1 {
                    nexts.push(state.clone());
                }
                if elapsed >= self.recovery.0 {
                    let mut next = state.clone();
                    next.phases[action] = Phase::Waiting;
                    nexts.push(next);
                }
            }
        }
        nexts
            .iter()
            .all(|next| self.survives_world(next, action + 1))
    }
}

fn node(index: usize) -> NodeId {
    NodeId(u32::try_from(index).unwrap())
}

/// Returns a random network; with upper bounds other than deadlines if `is_general`.
fn random_network(random: &mut ChaCha8Rng, is_general: bool) -> FaultNetwork {
    let count = random.random_range(2..=3);
    let (start, end) = (
        |own: usize| node(2 * own + 1),
        |own: usize| node(2 * own + 2),
    );
    let attempts = (0..count).map(|own| {
        let lower = random.random_range(1..=2);
        let upper = lower + random.random_range(0..=1);
        Attempt {
            start: start(own),
            end: end(own),
            lower: Rational::from(lower),
            upper: Some(Rational::from(upper)),
            retries: random.random_range(0..=2),
        }
    });
    let attempts: Vec<Attempt> = attempts.collect();
    let mut requirements = Vec::new();
    for own in 0..count {
        requirements.push(Constraint::at_least(node(0), start(own), Rational::ZERO));
        let deadline = Rational::from(random.random_range(3..=HORIZON));
        requirements.push(Constraint::at_most(node(0), end(own), deadline));
        if random.random_range(0..4) == 0 {
            let deadline = Rational::from(random.random_range(2..=6_i64));
            requirements.push(Constraint::at_most(node(0), start(own), deadline));
        }
        for other in 0..own {
            let least = Rational::from(random.random_range(0..=1_i64));
            match random.random_range(0..6) {
                0 | 1 => requirements.push(Constraint::at_least(end(other), start(own), least)),
                2 => requirements.push(Constraint::at_least(start(other), start(own), least)),
                3 => requirements.push(Constraint::at_least(end(other), end(own), least)),
                _ => {}
            }
            if is_general {
                let most = Rational::from(random.random_range(0..=4_i64));
                let (from, to) = match random.random_range(0..5) {
                    0 => (end(other), start(own)),
                    1 => (start(other), start(own)),
                    2 => (end(other), end(own)),
                    3 => (end(own), start(other)),
                    _ => continue,
                };
                requirements.push(Constraint::at_most(from, to, most));
            }
        }
    }
    let least = random.random_range(0..=1);
    FaultNetwork {
        nodes: 2 * count + 1,
        requirements,
        attempts,
        recovery: [
            Rational::from(least),
            Rational::from(random.random_range(least..=1_i64)),
        ],
        shortest_failure: Rational::ONE,
    }
}

/// Compares the decision with the game; returns the verdict and whether it has to be exact.
fn compare(network: &FaultNetwork, faults: usize) -> (FaultVerdict, bool) {
    let is_won = Game::new(network, faults).is_won();
    let verdict = decide(network, faults);
    let is_exact = Layers::new(network).is_some_and(|layers| layers.is_exact());
    match verdict {
        FaultVerdict::Controllable => assert!(is_won, "{faults} failures in {network:#?}"),
        FaultVerdict::Defeated(..) => assert!(!is_won, "{faults} failures in {network:#?}"),
        FaultVerdict::Undecided => assert!(!is_exact, "{faults} failures in {network:#?}"),
    }
    (verdict, is_exact)
}

#[test]
fn verdicts_on_failures_agree_with_exhaustive_games() {
    let mut random = ChaCha8Rng::seed_from_u64(47);
    // Controllable, defeated and undecided: exact class, others.
    let mut counts = [[0; 3]; 2];
    for index in 0..1400 / crate::sampled::one_in::<usize>(4) {
        let network = random_network(&mut random, index % 2 == 1);
        for faults in 0..=2 {
            let (verdict, is_exact) = compare(&network, faults);
            let kind = match verdict {
                FaultVerdict::Controllable => 0,
                FaultVerdict::Defeated(..) => 1,
                FaultVerdict::Undecided => 2,
            };
            counts[usize::from(!is_exact)][kind] += 1;
        }
    }
    println!("exact class: {:?}, others: {:?}", counts[0], counts[1]);
    let [exact, others] = counts;
    assert!(
        exact[0] > 100 && exact[1] > 100 && exact[2] == 0,
        "{exact:?}"
    );
    assert!(others[0] > 50 && others[1] > 50, "{others:?}");
    assert!(others[2] * 10 < others.iter().sum::<usize>(), "{others:?}");
}
