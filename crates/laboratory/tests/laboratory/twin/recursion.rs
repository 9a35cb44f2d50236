//! Optimal value of a small world by plain recursion: at each whole second the agent starts and
//! cancels any actions, and a second later the events occur, in the worst order or in the best one.
//!
//! It uses neither cells nor bounds, and reads neither PDDL nor world files.

use std::collections::BTreeMap;

use super::{Change, ENDS, Literal, Measure, SmallAction, SmallWorld};

impl SmallWorld {
    /// Returns the optimal value from time 0 if events of the same second occur in the worst order,
    /// and in the best one.
    pub(crate) fn best(&self) -> (f64, f64) {
        let start = Now {
            time: 0,
            facts: self.initial,
            running: Vec::new(),
            happened: 0,
            begun: 0,
            number: self.number.unwrap_or_default(),
        };
        // Changes within the first half second occur at once.
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

    /// Returns the possible changes within `seconds`, with their probabilities; more than two of
    /// one kind are ignored.
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

    /// Returns `true` if the goal holds and no running action prevents the end of the run.
    fn is_won(&self, now: &Now) -> bool {
        let holds_up = |action: &SmallAction| action.outcomes.iter().any(|it| it.delay > 0);
        let mut running = now.running.iter();
        let is_enough = self.wanted.is_none_or(|wanted| wanted.holds(now.number));
        is_enough
            && self.goal.iter().all(|fact| now.facts & (1 << fact) != 0)
            && !running.any(|running| holds_up(&self.actions[running.action]))
    }

    /// Returns the courses that remain possible at this `age` of an action. Their weights add up to 1.
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

    /// Returns the probability that an action cannot be cancelled.
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
        // The run ends, and later events do not count.
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
                // An action that fails at once is never started.
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

    /// Advances the time by a second, and applies the events in the order of `choice`.
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

/// Possible course of an action: its probability, the time until it ends or is bound to fail, the
/// total running time, and the kind of end.
#[derive(Clone, Copy, Debug)]
struct Course {
    weight: f64,
    lasts: u32,
    over: u32,
    ending: Ending,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Ending {
    /// Success with that one of the amounts, if there is one.
    Well(usize),
    /// Failure with that outcome, if any.
    Badly(Option<usize>),
}

impl SmallAction {
    /// Returns the maximum number of simultaneous starts. One is enough unless each start takes
    /// more of the number.
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
}

impl Change {
    fn of(self, number: i32, amount: i32) -> i32 {
        match self {
            Self::Increase => number + amount,
            Self::Decrease => number - amount,
            Self::Assign => amount,
        }
    }
}

/// Choice between the values of two orders.
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
    /// Age of an action at which an attempt to cancel it found that it cannot be cancelled.
    found_broken: Option<u32>,
}

/// Returns all permutations.
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
    /// Number of starts of each action at this time, in three bits each.
    begun: u32,
    number: i32,
}

/// Applies a random change to all states that have not reached the goal.
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
