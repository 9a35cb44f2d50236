//! Small worlds in which all durations and times are whole and even, written out as PDDL and as a
//! world file, and their best value by plain recursion: at each whole second the agent starts and
//! cancels what it likes, and a second later happens what happens, in the worst order or in the
//! best one.
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

    /// The best that can be reached from time 0 if what happens at the same second happens in the
    /// worst order, and in the best one.
    pub(crate) fn best(&self) -> (f64, f64) {
        let start = Now {
            time: 0,
            facts: self.initial,
            running: Vec::new(),
            happened: 0,
            begun: 0,
        };
        let value = |choice| self.value(&start, choice, &mut BTreeMap::new());
        (value(f64::min), value(f64::max))
    }

    fn is_won(&self, now: &Now) -> bool {
        self.goal.iter().all(|fact| now.facts & (1 << fact) != 0)
    }

    fn value(&self, now: &Now, choice: Choice, known: &mut BTreeMap<Now, f64>) -> f64 {
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
        let mut best = self.wait(now, choice, known);
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
            best = best.max(self.value(&after, choice, known));
        }
        known.insert(now.clone(), best);
        best
    }

    /// A second passes, and then happens what happens, in the order of that choice.
    fn wait(&self, now: &Now, choice: Choice, known: &mut BTreeMap<Now, f64>) -> f64 {
        let time = now.time + 1;
        let ends = now.running.iter().map(|&(index, since)| {
            let durations = &self.actions[index].durations;
            let count = |of: &dyn Fn(u32) -> bool| durations.iter().filter(|it| of(**it)).count();
            let age = time - since;
            let due = share(count(&|it| it == age), count(&|it| it >= age));
            (Happening::End(index), due)
        });
        let events = self.events.iter().enumerate();
        let events = events.filter(|(index, _)| now.happened & (1 << index) == 0);
        let events = events.map(|(index, event)| {
            let part = |of: &dyn Fn(u32) -> bool| {
                let count = event.times.iter().filter(|it| of(**it)).count();
                share(count, event.times.len()) * event.probability
            };
            let due = part(&|it| it == time) / (1.0 - part(&|it| it < time));
            (Happening::Event(index), due)
        });
        let due: Vec<_> = ends.chain(events).filter(|(_, p)| *p > 0.0).collect();
        let after = Now {
            time,
            begun: 0,
            ..now.clone()
        };
        let values = orders(&due).into_iter().map(|order| {
            let all = order.iter().fold(vec![(1.0, after.clone())], |all, due| {
                self.happen(all, *due)
            });
            let values = all
                .iter()
                .map(|(p, after)| p * self.value(after, choice, known));
            values.sum()
        });
        values
            .reduce(choice)
            .expect("there is an order, if of nothing")
    }

    fn happen(&self, all: Vec<(f64, Now)>, (what, due): (Happening, f64)) -> Vec<(f64, Now)> {
        let is_won = |now: &Now| self.is_won(now);
        match what {
            Happening::End(index) => {
                let action = &self.actions[index];
                let ways = [
                    (due * (1.0 - action.fails), Some(true)),
                    (due * action.fails, Some(false)),
                    (1.0 - due, None),
                ];
                let end = |after: &mut Now, way| {
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
                };
                branch(all, &ways, end, is_won)
            }
            Happening::Event(index) => {
                let change = |after: &mut Now, happens| {
                    if happens {
                        after.happened |= 1 << index;
                        after.facts = set(self.events[index].change, after.facts);
                        self.break_off(after);
                    }
                };
                branch(all, &[(due, true), (1.0 - due, false)], change, is_won)
            }
        }
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

/// Which of two values the order leads to.
type Choice = fn(f64, f64) -> f64;

#[derive(Clone, Copy, Debug)]
enum Happening {
    End(usize),
    Event(usize),
}

/// All orders of those.
fn orders<T: Copy>(of: &[T]) -> Vec<Vec<T>> {
    let mut all = vec![Vec::new()];
    for (count, item) in of.iter().enumerate() {
        let longer = all.iter().flat_map(|order: &Vec<T>| {
            (0..=count).map(|place| {
                let mut longer = order.clone();
                longer.insert(place, *item);
                longer
            })
        });
        all = longer.collect();
    }
    all
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
