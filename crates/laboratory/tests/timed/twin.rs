//! Small worlds in which all durations and times are whole and even, written out as PDDL and as a
//! world file, and their best value by plain recursion: at each whole second the agent starts and
//! cancels what it likes, and a second later happens what happens, in some order.
//!
//! It knows neither cells nor bounds, and reads neither PDDL nor world files.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// The run ends then, and with it all hope is gone.
pub(crate) const ENDS: u32 = 8;

const FACTS: usize = 4;

/// A fact, and whether it must be true.
type Literal = (usize, bool);

#[derive(Debug)]
pub(crate) struct SmallWorld {
    actions: Vec<SmallAction>,
    events: Vec<SmallEvent>,
    initial: u32,
    goal: Vec<usize>,
}

#[derive(Debug)]
struct SmallAction {
    start: Option<Literal>,
    over_all: Option<Literal>,
    end: Option<Literal>,
    at_start: Option<Literal>,
    at_end: Literal,
    durations: Vec<u32>,
    fails: f64,
}

#[derive(Debug)]
struct SmallEvent {
    change: Literal,
    times: Vec<u32>,
    probability: f64,
}

impl SmallWorld {
    /// `asks_for_less`: conditions may ask for facts to be false, and ends may delete.
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
            initial,
            goal: vec![rng.random_range(0..FACTS), rng.random_range(0..FACTS)],
        }
    }

    pub(crate) fn domain(&self) -> String {
        let mut text =
            "(define (domain small) (:requirements :durative-actions :negative-preconditions)
            (:predicates (f0) (f1) (f2) (f3))\n"
                .to_owned();
        for (index, action) in self.actions.iter().enumerate() {
            let timed = |when: &str, what: Option<Literal>| {
                what.map_or(String::new(), |what| format!("({when} {})", words(what)))
            };
            let _ = write!(
                text,
                "(:durative-action a{index} :parameters () :duration (= ?duration {})
                   :condition (and {} {} {}) :effect (and {} {}))\n",
                action.durations[0],
                timed("at start", action.start),
                timed("over all", action.over_all),
                timed("at end", action.end),
                timed("at start", action.at_start),
                timed("at end", Some(action.at_end)),
            );
        }
        text + ")"
    }

    pub(crate) fn problem(&self) -> String {
        let facts = (0..FACTS).filter(|fact| self.initial & (1 << fact) != 0);
        let listed = |facts: &mut dyn Iterator<Item = usize>| {
            let words: Vec<String> = facts.map(|fact| format!("(f{fact})")).collect();
            words.join(" ")
        };
        let initial = listed(&mut facts.clone());
        let goal = listed(&mut self.goal.iter().copied());
        format!(
            "(define (problem p) (:domain small)
               (:init {initial}) (:goal (and {goal})))"
        )
    }

    pub(crate) fn world(&self) -> String {
        let mut text = "format = \"elbowroom-world\"\nversion = 1\n".to_owned();
        for (index, action) in self.actions.iter().enumerate() {
            let _ = writeln!(
                text,
                "[[duration]]\naction = \"a{index}\"\nvalues = {:?}",
                action.durations
            );
            let _ = writeln!(
                text,
                "[[failure]]\naction = \"a{index}\"\nprobability = {}",
                action.fails
            );
        }
        for event in &self.events {
            let (fact, truth) = event.change;
            let _ = writeln!(
                text,
                "[[event]]\nfact = \"(f{fact})\"\nbecomes = {truth}\nvalues = {:?}\nprobability = {}",
                event.times, event.probability
            );
        }
        text
    }

    /// The best that can be reached from time 0.
    pub(crate) fn best(&self) -> f64 {
        let start = Now {
            time: 0,
            facts: self.initial,
            running: Vec::new(),
            happened: 0,
            begun: 0,
        };
        self.value(&start, &mut BTreeMap::new())
    }

    fn is_won(&self, now: &Now) -> bool {
        self.goal.iter().all(|fact| now.facts & (1 << fact) != 0)
    }

    fn value(&self, now: &Now, known: &mut BTreeMap<Now, f64>) -> f64 {
        if self.is_won(now) {
            return 1.0;
        }
        // The run ends, and nothing that happens later is of use.
        if now.time == ENDS {
            return 0.0;
        }
        if let Some(value) = known.get(now) {
            return *value;
        }
        let mut best = self.wait(now, known);
        for index in 0..self.actions.len() {
            let action = &self.actions[index];
            let mut after = now.clone();
            if let Some(place) = now.running.iter().position(|(own, _)| *own == index) {
                after.running.remove(place);
            } else if now.begun & (1 << index) == 0
                && action.start.is_none_or(|it| holds(it, now.facts))
            {
                after.begun |= 1 << index;
                after.running.push((index, now.time));
                after.running.sort_unstable();
                after.facts = action.at_start.map_or(now.facts, |it| set(it, now.facts));
                self.break_off(&mut after);
            } else {
                continue;
            }
            best = best.max(self.value(&after, known));
        }
        known.insert(now.clone(), best);
        best
    }

    /// A second passes.
    fn wait(&self, now: &Now, known: &mut BTreeMap<Now, f64>) -> f64 {
        let time = now.time + 1;
        let mut all = vec![(
            1.0,
            Now {
                time,
                begun: 0,
                ..now.clone()
            },
        )];
        for &(index, since) in &now.running {
            let action = &self.actions[index];
            let age = time - since;
            let left = action.durations.iter().filter(|it| **it >= age).count();
            let due = action.durations.iter().filter(|it| **it == age).count();
            let due = share(due, left);
            let ways = [
                (due * (1.0 - action.fails), Some(true)),
                (due * action.fails, Some(false)),
                (1.0 - due, None),
            ];
            all = branch(
                all,
                &ways,
                |after, way| {
                    let (Some(is_well), Some(place)) =
                        (way, after.running.iter().position(|it| it.0 == index))
                    else {
                        return;
                    };
                    after.running.remove(place);
                    if is_well && action.end.is_none_or(|it| holds(it, after.facts)) {
                        after.facts = set(action.at_end, after.facts);
                        self.break_off(after);
                    }
                },
                |now| self.is_won(now),
            );
        }
        for (index, event) in self
            .events
            .iter()
            .enumerate()
            .filter(|(index, _)| now.happened & (1 << index) == 0)
        {
            let count = |of: &dyn Fn(u32) -> bool| {
                share(
                    event.times.iter().filter(|it| of(**it)).count(),
                    event.times.len(),
                ) * event.probability
            };
            let due = count(&|it| it == time) / (1.0 - count(&|it| it < time));
            all = branch(
                all,
                &[(due, true), (1.0 - due, false)],
                |after, happens| {
                    if happens {
                        after.happened |= 1 << index;
                        after.facts = set(event.change, after.facts);
                        self.break_off(after);
                    }
                },
                |now| self.is_won(now),
            );
        }
        all.iter()
            .map(|(p, after)| p * self.value(after, known))
            .sum()
    }

    fn break_off(&self, now: &mut Now) {
        let facts = now.facts;
        now.running.retain(|(index, _)| {
            self.actions[*index]
                .over_all
                .is_none_or(|it| holds(it, facts))
        });
    }
}

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Now {
    time: u32,
    facts: u32,
    running: Vec<(usize, u32)>,
    happened: u32,
    /// What began at this very time, as bits: nothing begins twice.
    begun: u32,
}

/// What is won stays won.
fn branch<T: Copy>(
    all: Vec<(f64, Now)>,
    ways: &[(f64, T)],
    change: impl Fn(&mut Now, T),
    is_won: impl Fn(&Now) -> bool,
) -> Vec<(f64, Now)> {
    let mut longer = Vec::new();
    for (weight, now) in all {
        for (p, way) in ways.iter().filter(|(p, _)| *p > 0.0) {
            let mut after = now.clone();
            if !is_won(&after) {
                change(&mut after, *way);
            }
            longer.push((weight * p, after));
        }
    }
    longer
}

fn share(part: usize, of: usize) -> f64 {
    let number = |count: usize| f64::from(u32::try_from(count).expect("few"));
    if part == 0 {
        0.0
    } else {
        number(part) / number(of)
    }
}

fn holds((fact, truth): Literal, facts: u32) -> bool {
    (facts & (1 << fact) != 0) == truth
}

fn set((fact, truth): Literal, facts: u32) -> u32 {
    if truth {
        facts | (1 << fact)
    } else {
        facts & !(1 << fact)
    }
}

fn words((fact, truth): Literal) -> String {
    if truth {
        format!("(f{fact})")
    } else {
        format!("(not (f{fact}))")
    }
}
