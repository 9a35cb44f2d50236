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

#[derive(Clone, Debug)]
pub(crate) struct SmallWorld {
    actions: Vec<SmallAction>,
    events: Vec<SmallEvent>,
    changes: Vec<SmallChange>,
    initial: u32,
    goal: Vec<usize>,
    /// What the number is to begin with, if there is one.
    number: Option<i32>,
    /// What it has to be in the end.
    wanted: Option<Measure>,
}

/// What the number must be: at least so much, or at most.
#[derive(Clone, Copy, Debug)]
struct Measure {
    at_least: bool,
    bound: i32,
}

/// What an action has to do with the number.
#[derive(Clone, Debug, Default)]
struct SmallAmount {
    start: Option<Measure>,
    over_all: Option<Measure>,
    end: Option<Measure>,
    /// What its start takes.
    taken: i32,
    /// What its end does, with one of these amounts.
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
    /// Whether a failure undoes what the start did.
    is_undone: bool,
    outcomes: Vec<SmallOutcome>,
    amount: SmallAmount,
}

/// What a failure leaves behind.
#[derive(Clone, Debug)]
struct SmallOutcome {
    /// Of the failures.
    share: f64,
    changes: Vec<Literal>,
    /// How much later it fails; nobody can let it go until then.
    delay: u32,
}

/// One way in which an action may go: how likely that is, how long it takes until nothing but a
/// failure can come of it or it ends, how long it is under way, and as what it ends.
#[derive(Clone, Copy, Debug)]
struct Course {
    weight: f64,
    lasts: u32,
    over: u32,
    ending: Ending,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Ending {
    /// With that one of the amounts, if there is one.
    Well(usize),
    /// With that outcome, if any.
    Badly(Option<usize>),
}

#[derive(Clone, Debug)]
struct SmallEvent {
    change: Literal,
    times: Vec<u32>,
    probability: f64,
}

/// A fact that becomes so again and again, so many times a second. The world counts whole seconds.
#[derive(Clone, Debug)]
struct SmallChange {
    change: Literal,
    rate: f64,
}

impl SmallWorld {
    /// The same kind of world, with facts that change at a rate; fewer actions and events, as there
    /// are many orders.
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
        // One direction of a fact has one rate.
        world.changes.sort_by_key(|change| change.change);
        world.changes.dedup_by_key(|change| change.change);
        world
    }

    /// The same kind of world, with failures that leave something behind and take time.
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

    /// The same world, but that failures leave nothing behind.
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

    /// The same kind of world, with a number that actions change by amounts that vary.
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

    /// The same world, in which nothing asks for a number.
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

    /// The same world, in which all that happens does so at known times.
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

    pub(crate) fn domain(&self) -> String {
        let mut text =
            "(define (domain small) (:requirements :durative-actions :negative-preconditions)
            (:predicates (f0) (f1) (f2) (f3)) (:functions (n))\n"
                .to_owned();
        for (index, action) in self.actions.iter().enumerate() {
            let timed = |when: &str, what: Option<Literal>| {
                what.map_or(String::new(), |what| format!("({when} {})", words(what)))
            };
            let measured = |when: &str, what: Option<Measure>| {
                what.map_or(String::new(), |what| format!("({when} {})", what.words()))
            };
            let amount = &action.amount;
            let taken = match amount.taken {
                0 => String::new(),
                taken => format!("(at start (decrease (n) {taken}))"),
            };
            let changed = amount.at_end.as_ref().map(|(change, amounts)| {
                format!("(at end ({} (n) {}))", change.word(), amounts[0])
            });
            let _ = write!(
                text,
                "(:durative-action a{index} :parameters () :duration (= ?duration {})
                   :condition (and {} {} {} {} {} {}) :effect (and {} {} {taken} {}))\n",
                action.durations[0],
                timed("at start", action.start),
                timed("over all", action.over_all),
                timed("at end", action.end),
                measured("at start", amount.start),
                measured("over all", amount.over_all),
                measured("at end", amount.end),
                timed("at start", action.at_start),
                timed("at end", Some(action.at_end)),
                changed.unwrap_or_default(),
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
        let number = self.number.unwrap_or_default();
        let wanted = self.wanted.map_or(String::new(), Measure::words);
        format!(
            "(define (problem p) (:domain small)
               (:init (= (n) {number}) {initial}) (:goal (and {goal} {wanted})))"
        )
    }

    pub(crate) fn world(&self) -> String {
        let mut text = "format = \"elbowroom-world\"\nversion = 1\n".to_owned();
        let mut amount_of = String::new();
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
            if let Some((_, amounts)) = &action.amount.at_end {
                let _ = writeln!(
                    amount_of,
                    "[[amount]]\naction = \"a{index}\"\nfluent = \"n\"\nvalues = {amounts:?}"
                );
            }
            if action.is_undone {
                text += "undone = true\n";
            }
            for outcome in &action.outcomes {
                let _ = writeln!(
                    text,
                    "[[failure.outcome]]\nprobability = {}\ndelay = {}",
                    outcome.share, outcome.delay
                );
                for (word, truth) in [("true", true), ("false", false)] {
                    let facts = outcome.changes.iter().filter(|change| change.1 == truth);
                    let facts: Vec<String> = facts.map(|(fact, _)| format!("(f{fact})")).collect();
                    let _ = writeln!(text, "becomes_{word} = {facts:?}");
                }
            }
        }
        text += &amount_of;
        for event in &self.events {
            let (fact, truth) = event.change;
            let _ = writeln!(
                text,
                "[[event]]\nfact = \"(f{fact})\"\nbecomes = {truth}\nvalues = {:?}\nprobability = {}",
                event.times, event.probability
            );
        }
        if !self.changes.is_empty() {
            text = text.replace("version = 1\n", "version = 1\nresolution = 1\n");
        }
        for fact in 0..FACTS {
            let mut rates = String::new();
            for (word, truth) in [("true", true), ("false", false)] {
                let of = |change: &&SmallChange| change.change == (fact, truth);
                if let Some(change) = self.changes.iter().find(of) {
                    let _ = writeln!(rates, "becomes_{word}_per_second = {}", change.rate);
                }
            }
            if !rates.is_empty() {
                let _ = writeln!(text, "[[hazard]]\nfact = \"(f{fact})\"\n{rates}");
            }
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
            number: self.number.unwrap_or_default(),
        };
        // What comes within half a second comes at once.
        let value = |choice: Choice| {
            let mut known = BTreeMap::new();
            let begun = self.often(0.5).into_iter().map(|(p, changes)| {
                let due: Vec<_> = changes
                    .iter()
                    .map(|it| (Happening::Change(*it), 1.0))
                    .collect();
                let values = orders(&due).into_iter().map(|order| {
                    let mut all = vec![(1.0, start.clone())];
                    for due in order {
                        all = self.happen(all, due);
                    }
                    let values = all
                        .iter()
                        .map(|(p, after)| p * self.value(after, choice, &mut known));
                    values.sum::<f64>()
                });
                p * values
                    .reduce(choice)
                    .expect("there is an order, if of nothing")
            });
            begun.sum()
        };
        (value(f64::min), value(f64::max))
    }

    /// Which changes come in so many seconds, as often as they do, with how likely that is; more
    /// than twice is left out.
    fn often(&self, seconds: f64) -> Vec<(f64, Vec<usize>)> {
        let mut all = vec![(1.0, Vec::new())];
        for (index, change) in self.changes.iter().enumerate() {
            let mean = change.rate * seconds;
            let counts = [1.0, mean, mean * mean / 2.0].map(|share| share * (-mean).exp());
            let longer = all.iter().flat_map(|(weight, list)| {
                counts.iter().enumerate().map(move |(times, p)| {
                    let mut list: Vec<usize> = list.clone();
                    list.extend(std::iter::repeat_n(index, times));
                    (weight * p, list)
                })
            });
            all = longer.collect();
        }
        all
    }

    /// The run is over when the goal holds and everything that is under way has been let go.
    fn is_won(&self, now: &Now) -> bool {
        let holds_up = |action: &SmallAction| action.outcomes.iter().any(|it| it.delay > 0);
        let mut running = now.running.iter();
        let is_enough = self.wanted.is_none_or(|wanted| wanted.holds(now.number));
        is_enough
            && self.goal.iter().all(|fact| now.facts & (1 << fact) != 0)
            && !running.any(|running| holds_up(&self.actions[running.action]))
    }

    /// All courses that an action may still take which has been under way for so long; as shares
    /// they add up to 1.
    fn courses(&self, running: Running, age: u32) -> Vec<Course> {
        let action = &self.actions[running.action];
        let mut all = Vec::new();
        for &lasts in &action.durations {
            let mut add = |weight: f64, delay: u32, ending| {
                all.push(Course {
                    weight,
                    lasts,
                    over: lasts + delay,
                    ending,
                });
            };
            let amounts = action.amount.at_end.as_ref().map_or(1, |(_, of)| of.len());
            for amount in 0..amounts {
                let weight = (1.0 - action.fails) * share(1, amounts);
                add(weight, 0, Ending::Well(amount));
            }
            let mut plain = 1.0;
            for (index, outcome) in action.outcomes.iter().enumerate() {
                plain -= outcome.share;
                let ending = Ending::Badly(Some(index));
                add(action.fails * outcome.share, outcome.delay, ending);
            }
            add(action.fails * plain, 0, Ending::Badly(None));
        }
        all.retain(|course| course.weight > 0.0 && course.over >= age);
        if let Some(found) = running.found_broken {
            all.retain(|course| course.lasts <= found && course.over > found);
        }
        let sum: f64 = all.iter().map(|course| course.weight).sum();
        for course in &mut all {
            course.weight /= sum;
        }
        all
    }

    /// How likely nobody can let an action go.
    fn is_broken(&self, running: Running, time: u32) -> f64 {
        let age = time - running.since;
        let courses = self.courses(running, age + 1).into_iter();
        let broken = courses.filter(|course| course.lasts <= age);
        broken.map(|course| course.weight).sum()
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
            let mut running = now.running.iter();
            if let Some(place) = running.position(|own| own.action == index) {
                let own = now.running[place];
                if own.found_broken.is_some() {
                    continue;
                }
                let broken = self.is_broken(own, now.time);
                after.running[place].found_broken = Some(now.time - own.since);
                let kept = if broken > 0.0 {
                    broken * self.value(&after, choice, known)
                } else {
                    0.0
                };
                after.running.remove(place);
                let gone = if broken < 1.0 {
                    (1.0 - broken) * self.value(&after, choice, known)
                } else {
                    0.0
                };
                best = best.max(kept + gone);
                continue;
            } else if (now.begun >> (3 * index)) & 7 < action.most_begun()
                && action.start.is_none_or(|it| holds(it, now.facts))
                && action.amount.start.is_none_or(|it| it.holds(now.number))
            {
                after.begun += 1 << (3 * index);
                after.running.push(Running {
                    action: index,
                    since: now.time,
                    found_broken: None,
                });
                after.running.sort_unstable();
                after.facts = action.at_start.map_or(now.facts, |it| set(it, now.facts));
                after.number -= action.amount.taken;
                self.break_off(&mut after);
                // Nobody starts what breaks off at once.
                if !after.running.iter().any(|running| running.action == index) {
                    continue;
                }
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
        let ends = now.running.iter().map(|&running| {
            let courses = self.courses(running, time - running.since).into_iter();
            let due = courses.filter(|course| course.over == time - running.since);
            let due = due.map(|course| course.weight).sum();
            (Happening::End(running), due)
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
        let often = self.often(1.0).into_iter().map(|(p, changes)| {
            let changes = changes.iter().map(|it| (Happening::Change(*it), 1.0));
            let due: Vec<_> = due.iter().copied().chain(changes).collect();
            let values = orders(&due).into_iter().map(|order| {
                let all = order.iter().fold(vec![(1.0, after.clone())], |all, due| {
                    self.happen(all, *due)
                });
                let values = all
                    .iter()
                    .map(|(p, after)| p * self.value(after, choice, known));
                values.sum()
            });
            p * values
                .reduce(choice)
                .expect("there is an order, if of nothing")
        });
        often.sum()
    }

    fn happen(&self, all: Vec<(f64, Now)>, (what, due): (Happening, f64)) -> Vec<(f64, Now)> {
        let is_won = |now: &Now| self.is_won(now);
        match what {
            Happening::End(running) => {
                let action = &self.actions[running.action];
                let age = all.first().map_or(0, |(_, now)| now.time - running.since);
                let courses = self.courses(running, age).into_iter();
                let over = courses.filter(|course| course.over == age);
                let mut ways: Vec<_> = over
                    .map(|course| (course.weight, Some(course.ending)))
                    .collect();
                ways.push((1.0 - due, None));
                let end = |after: &mut Now, way| {
                    let is_it = |it: &Running| it.action == running.action;
                    let (Some(ending), Some(place)) = (way, after.running.iter().position(is_it))
                    else {
                        return;
                    };
                    after.running.remove(place);
                    let changes: Vec<Literal> = match ending {
                        Ending::Well(amount)
                            if action.end.is_none_or(|it| holds(it, after.facts))
                                && action.amount.end.is_none_or(|it| it.holds(after.number)) =>
                        {
                            if let Some((change, amounts)) = &action.amount.at_end {
                                after.number = change.of(after.number, amounts[amount]);
                            }
                            vec![action.at_end]
                        }
                        Ending::Well(_) => Vec::new(),
                        Ending::Badly(outcome) => {
                            let undone = action.at_start.filter(|_| action.is_undone);
                            let undone = undone.map(|(fact, truth)| (fact, !truth));
                            let left = outcome.map(|it| action.outcomes[it].changes.clone());
                            undone
                                .into_iter()
                                .chain(left.into_iter().flatten())
                                .collect()
                        }
                    };
                    if !changes.is_empty() {
                        for change in changes {
                            after.facts = set(change, after.facts);
                        }
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
            Happening::Change(index) => {
                let change = |after: &mut Now, ()| {
                    after.facts = set(self.changes[index].change, after.facts);
                    self.break_off(after);
                };
                branch(all, &[(1.0, ())], change, is_won)
            }
        }
    }

    fn break_off(&self, now: &mut Now) {
        let (facts, number) = (now.facts, now.number);
        now.running.retain(|running| {
            let action = &self.actions[running.action];
            action.over_all.is_none_or(|it| holds(it, facts))
                && action.amount.over_all.is_none_or(|it| it.holds(number))
        });
    }
}

impl SmallAction {
    /// How many times it may begin at one time: once is enough, if each start does not take more of the number.
    fn most_begun(&self) -> u32 {
        if self.amount.taken > 0 { 4 } else { 1 }
    }
}

impl Measure {
    fn holds(self, number: i32) -> bool {
        if self.at_least {
            number >= self.bound
        } else {
            number <= self.bound
        }
    }

    fn words(self) -> String {
        let word = if self.at_least { ">=" } else { "<=" };
        format!("({word} (n) {})", self.bound)
    }
}

impl Change {
    fn word(self) -> &'static str {
        match self {
            Self::Increase => "increase",
            Self::Decrease => "decrease",
            Self::Assign => "assign",
        }
    }

    fn of(self, number: i32, amount: i32) -> i32 {
        match self {
            Self::Increase => number + amount,
            Self::Decrease => number - amount,
            Self::Assign => amount,
        }
    }
}

/// Which of two values the order leads to.
type Choice = fn(f64, f64) -> f64;

#[derive(Clone, Copy, Debug)]
enum Happening {
    End(Running),
    Event(usize),
    Change(usize),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Running {
    action: usize,
    since: u32,
    /// How long it had been under way when somebody wanted to let it go and could not.
    found_broken: Option<u32>,
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
    running: Vec<Running>,
    happened: u32,
    /// How many times each began at this very time, in three bits each.
    begun: u32,
    number: i32,
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
