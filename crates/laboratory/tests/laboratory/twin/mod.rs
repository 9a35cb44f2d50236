//! Small worlds in which all durations and times are whole and even. They are generated here,
//! [written](text) as PDDL and as a world file, and solved by a [plain recursion](recursion).

mod recursion;
mod text;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// End of the run, the deadline of the goal.
pub(crate) const ENDS: u32 = 8;

const FACTS: usize = 4;

/// Fact, and its required truth value.
type Literal = (usize, bool);

#[derive(Clone, Debug)]
pub(crate) struct SmallWorld {
    actions: Vec<SmallAction>,
    events: Vec<SmallEvent>,
    changes: Vec<SmallChange>,
    initial: u32,
    goal: Vec<usize>,
    /// Initial value of the number, if there is one.
    number: Option<i32>,
    /// Final condition on the number.
    wanted: Option<Measure>,
}

/// Lower or upper bound on the number.
#[derive(Clone, Copy, Debug)]
struct Measure {
    at_least: bool,
    bound: i32,
}

/// Conditions and effects of an action on the number.
#[derive(Clone, Debug, Default)]
struct SmallAmount {
    start: Option<Measure>,
    over_all: Option<Measure>,
    end: Option<Measure>,
    /// Amount that its start takes.
    taken: i32,
    /// Change by its end, with one of these amounts.
    at_end: Option<(Change, Vec<i32>)>,
}

#[derive(Clone, Copy, Debug)]
enum Change {
    Increase,
    Decrease,
    Assign,
}

#[derive(Clone, Debug)]
struct SmallAction {
    start: Option<Literal>,
    over_all: Option<Literal>,
    end: Option<Literal>,
    at_start: Option<Literal>,
    at_end: Literal,
    durations: Vec<u32>,
    fails: f64,
    /// `true` if a failure undoes the start effects.
    is_undone: bool,
    outcomes: Vec<SmallOutcome>,
    amount: SmallAmount,
}

/// Outcome of a failure.
#[derive(Clone, Debug)]
struct SmallOutcome {
    /// Share of the failures.
    share: f64,
    changes: Vec<Literal>,
    /// Delay of the failure. The action cannot be cancelled until then.
    delay: u32,
}

#[derive(Clone, Debug)]
struct SmallEvent {
    change: Literal,
    times: Vec<u32>,
    probability: f64,
}

/// Spontaneous change of a fact, with its rate per second. The world has whole seconds.
#[derive(Clone, Debug)]
struct SmallChange {
    change: Literal,
    rate: f64,
}

impl SmallWorld {
    /// Returns a random world with facts that change at a rate. It has fewer actions and events,
    /// because there are many orders.
    pub(crate) fn with_rates(rng: &mut ChaCha8Rng, asks_for_less: bool) -> Self {
        let mut world = Self::random(rng, asks_for_less);
        world.actions.truncate(2);
        world.events.truncate(1);
        let count = rng.random_range(1..=2);
        let changes = (0..count).map(|_| SmallChange {
            change: (rng.random_range(0..FACTS), rng.random_bool(0.5)),
            rate: if rng.random_bool(0.5) { 0.02 } else { 0.05 },
        });
        world.changes = changes.collect();
        // One rate for each direction of a fact.
        world.changes.sort_by_key(|change| change.change);
        world.changes.dedup_by_key(|change| change.change);
        world
    }

    /// Returns a random world with failures that have outcomes and delays.
    pub(crate) fn with_outcomes(rng: &mut ChaCha8Rng, asks_for_less: bool) -> Self {
        let mut world = Self::random(rng, asks_for_less);
        world.events.truncate(1);
        for action in &mut world.actions {
            action.fails = if rng.random_bool(0.7) { 0.5 } else { 0.0 };
            action.is_undone = rng.random_bool(0.3);
            let count = rng.random_range(0..=2);
            let outcomes = (0..count).map(|_| {
                let fact = rng.random_range(0..FACTS);
                let mut changes = vec![(fact, rng.random_bool(0.5))];
                if rng.random_bool(0.3) {
                    changes.push(((fact + 1) % FACTS, rng.random_bool(0.5)));
                }
                SmallOutcome {
                    share: if rng.random_bool(0.5) { 0.5 } else { 0.25 },
                    changes,
                    delay: if rng.random_bool(0.4) { 2 } else { 0 },
                }
            });
            action.outcomes = outcomes.collect();
        }
        world
    }

    /// Returns a random world without events. Its goal can become unreachable, because starts use
    /// up facts and failures delete others.
    #[allow(dead_code, reason = "not all tests that share this ask for it")]
    pub(crate) fn with_costly_failures(rng: &mut ChaCha8Rng) -> Self {
        let mut world = Self::with_outcomes(rng, false);
        world.events.clear();
        world.initial = 0b0011;
        world.goal = vec![2, 3];
        world.actions.push(world.actions[0].clone());
        for (index, action) in world.actions.iter_mut().enumerate() {
            let needed = rng.random_range(0..2 + index / 2);
            action.start = Some((needed, true));
            action.at_start = rng.random_bool(0.4).then_some((needed, false));
            let added = if index < 2 {
                2 + index
            } else {
                rng.random_range(0..FACTS)
            };
            action.at_end = (added, true);
            for outcome in &mut action.outcomes {
                outcome.delay = 0;
                // Failures must not help to reach the goal.
                outcome.changes.truncate(1);
                if outcome.changes[0].1 {
                    outcome.changes[0].0 = needed;
                }
            }
        }
        world
    }

    /// Returns the same world without outcomes of failures.
    #[allow(
        dead_code,
        reason = "one of the tests that share this compares with it"
    )]
    pub(crate) fn without_outcomes(&self) -> Self {
        let mut plain = self.clone();
        for action in &mut plain.actions {
            action.is_undone = false;
            action.outcomes.clear();
        }
        plain
    }

    /// Returns a random world. With `asks_for_less`, conditions may require facts to be false, and
    /// ends may delete facts.
    pub(crate) fn random(rng: &mut ChaCha8Rng, asks_for_less: bool) -> Self {
        let literal = |rng: &mut ChaCha8Rng| {
            (
                rng.random_range(0..FACTS),
                !asks_for_less || rng.random_bool(0.7),
            )
        };
        let maybe = |rng: &mut ChaCha8Rng| rng.random_bool(0.4).then(|| literal(rng));
        let even = |rng: &mut ChaCha8Rng| {
            let count = rng.random_range(1..=2);
            (0..count).map(|_| 2 * rng.random_range(1..=2)).collect()
        };
        let actions = (0..3).map(|_| SmallAction {
            start: maybe(rng),
            over_all: maybe(rng),
            end: maybe(rng),
            at_start: rng
                .random_bool(0.4)
                .then(|| (rng.random_range(0..FACTS), rng.random_bool(0.5))),
            at_end: (
                rng.random_range(0..FACTS),
                !asks_for_less || rng.random_bool(0.8),
            ),
            durations: even(rng),
            fails: if rng.random_bool(0.5) { 0.25 } else { 0.0 },
            is_undone: false,
            outcomes: Vec::new(),
            amount: SmallAmount::default(),
        });
        let actions = actions.collect();
        let events = (0..2).map(|_| SmallEvent {
            change: (rng.random_range(0..FACTS), rng.random_bool(0.4)),
            times: even(rng),
            probability: 0.5,
        });
        let events = events.collect();
        let initial = rng.random_range(0..1 << FACTS);
        Self {
            actions,
            events,
            changes: Vec::new(),
            initial,
            goal: vec![rng.random_range(0..FACTS), rng.random_range(0..FACTS)],
            number: None,
            wanted: None,
        }
    }

    /// Returns a random world with a number that actions change by random amounts.
    #[allow(dead_code, reason = "not all tests that share this have numbers")]
    pub(crate) fn with_numbers(rng: &mut ChaCha8Rng, asks_for_less: bool) -> Self {
        let mut world = Self::random(rng, asks_for_less);
        let measure = |rng: &mut ChaCha8Rng, share: f64| {
            let bound = rng.random_range(0..=3);
            let at_least = !asks_for_less || rng.random_bool(0.7);
            rng.random_bool(share)
                .then_some(Measure { at_least, bound })
        };
        world.number = Some(rng.random_range(0..=3));
        world.wanted = measure(rng, 0.5);
        for action in &mut world.actions {
            let count = rng.random_range(1..=3);
            let amounts = (0..count).map(|_| rng.random_range(0..=3)).collect();
            let change = match rng.random_range(0..4) {
                0 => Some((Change::Increase, amounts)),
                1 | 2 => Some((Change::Decrease, amounts)),
                _ => Some((Change::Assign, amounts)),
            };
            let at_start = rng.random_bool(0.2);
            action.amount = SmallAmount {
                start: measure(rng, 0.3),
                over_all: measure(rng, 0.2),
                end: measure(rng, 0.2),
                taken: i32::from(at_start),
                at_end: change.filter(|_| !at_start && rng.random_bool(0.8)),
            };
        }
        world
    }

    /// Returns the same world without conditions on the number.
    #[allow(dead_code, reason = "not all tests that share this have numbers")]
    pub(crate) fn without_numbers(&self) -> Self {
        let mut plain = self.clone();
        plain.wanted = None;
        for action in &mut plain.actions {
            action.amount = SmallAmount::default();
        }
        plain
    }

    #[allow(dead_code, reason = "not all tests that share this have known times")]
    pub(crate) fn has_known_times(&self) -> bool {
        let mut durations = self.actions.iter().map(|action| action.durations.len());
        durations.all(|count| count == 1) && self.events.iter().all(|event| event.times.len() == 1)
    }

    /// Returns the same world with all events at known times.
    #[allow(dead_code, reason = "not all tests that share this have known times")]
    pub(crate) fn with_known_times(mut self) -> Self {
        for action in &mut self.actions {
            action.durations.truncate(1);
        }
        for event in &mut self.events {
            event.times.truncate(1);
        }
        self
    }
}
