//! What the run believes and what the problem expert has, kept the same.

mod change;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use crate::knowledge::Node;
pub use change::{Key, Seen};
use change::{State, Value, change_of};

/// The number of a [`Call`]; each is used once.
pub type CallId = u64;

/// How long an answer of the problem expert is waited for.
const PATIENCE: Duration = Duration::from_secs(5);

/// Something that the problem expert is asked for.
#[derive(Clone, Debug, PartialEq)]
pub enum Call {
    /// `problem_expert/get_problem_predicates`.
    Predicates,
    /// `problem_expert/get_problem_functions`.
    Functions,
    /// `problem_expert/add_problem_predicate`.
    Add(Node),
    /// `problem_expert/remove_problem_predicate`.
    Remove(Node),
    /// `problem_expert/add_problem_function`, for a fluent that has no value there.
    Define(Node),
    /// `problem_expert/update_problem_function`.
    Update(Node),
    /// `problem_expert/remove_problem_function`.
    Forget(Node),
}

/// What the problem expert has answered; why not, where it has refused.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// To the first two of [`Call`].
    States(Result<Vec<Node>, String>),
    /// To the others.
    Done(Result<(), String>),
}

/// Keeps a problem expert and a run of one opinion.
///
/// What the run has changed is told, in order, one call at a time. What others have changed there is read whenever it says
/// that something has changed, and is [seen](Self::seen). Three rules decide who wins:
///
/// 1. At the beginning of a run the problem expert does: where it is otherwise than the problem, that is seen. But a problem
///    expert that has nothing at all of what the problem says is about something else, and is left alone.
/// 2. What the run has changed and has not yet told wins over what is read meanwhile.
/// 3. Otherwise the last change wins, in the order in which the problem expert has them.
///
/// A change that the problem expert refuses stays the run's own: it is said, and neither told again nor taken back.
#[derive(Debug, Default)]
pub struct Mirror {
    is_there: bool,
    said: Said,
    following: Following,
    /// As the run believes it; `None` before it has said anything.
    believed: Option<State>,
    /// As the problem expert has it, as far as is known; `None` before it was read.
    held: Option<State>,
    /// How it writes each word.
    spelling: BTreeMap<String, String>,
    /// To be told, oldest first.
    untold: VecDeque<(Key, Value)>,
    writing: Option<Writing>,
    /// What it was told, and may have or not: that was not answered.
    unsure: BTreeSet<Key>,
    reading: Option<Reading>,
    /// Something may have changed since it was read last.
    is_stale: bool,
    last: CallId,
    calls: Vec<(CallId, Call)>,
    seen: Vec<Seen>,
    remarks: Vec<String>,
}

/// What people have been told already.
#[derive(Clone, Copy, Debug, Default)]
struct Said {
    /// That there is no problem expert.
    is_missing: bool,
    /// That it does not answer.
    is_silent: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Following {
    /// No run is under way.
    #[default]
    Nothing,
    /// Whether it is about the same problem is not known yet.
    Asking,
    Yes,
    /// It is about something else.
    No,
}

#[derive(Debug)]
struct Writing {
    call: CallId,
    key: Key,
    value: Value,
    since: Duration,
}

#[derive(Debug)]
struct Reading {
    predicates: CallId,
    functions: CallId,
    facts: Option<Vec<Node>>,
    numbers: Option<Vec<Node>>,
    since: Duration,
    /// What the run has changed since it was asked for.
    touched: BTreeSet<Key>,
}

impl Mirror {
    /// A run begins; `text` is its problem, for the spelling of its words, or empty.
    pub fn begin(&mut self, text: &str) {
        let is_word = |it: char| !(it == '(' || it == ')' || it.is_whitespace());
        let words = text.split(|it: char| !is_word(it));
        let words = words.filter(|word| word.chars().any(char::is_uppercase));
        self.spelling
            .extend(words.map(|word| (word.to_lowercase(), word.to_owned())));
        self.following = Following::Asking;
        self.believed = None;
        self.held = None;
        self.reading = None;
        self.seen.clear();
    }

    /// The run is over. What it has changed is still told.
    pub fn end(&mut self) {
        if self.following == Following::Asking {
            self.untold.clear();
        }
        self.following = Following::Nothing;
        self.believed = None;
        self.seen.clear();
    }

    /// The problem expert was found, or is gone.
    pub fn found(&mut self, is_there: bool) {
        self.is_stale |= is_there && !self.is_there;
        self.is_there = is_there;
    }

    /// It says that something has changed.
    pub fn notified(&mut self) {
        self.is_stale = true;
    }

    /// The run says what it believes: at first all of it, later what has changed. Names are in brackets.
    pub fn believe(&mut self, facts: &[(String, bool)], values: &[(String, Option<f64>)]) {
        let facts = facts
            .iter()
            .map(|(name, truth)| (Key::fact(name), truth.then_some(1.0)));
        let values = values
            .iter()
            .map(|(name, value)| (Key::number(name), *value));
        let changes: Vec<_> = facts.chain(values).collect();
        let Some(believed) = &mut self.believed else {
            self.believed = Some(changes.into_iter().collect());
            self.is_stale = true;
            return;
        };
        for (key, value) in &changes {
            believed.insert(key.clone(), *value);
        }
        if self.following == Following::No {
            return;
        }
        for (key, value) in changes {
            if let Some(reading) = &mut self.reading {
                reading.touched.insert(key.clone());
            }
            self.untold.retain(|(other, _)| *other != key);
            let is_known = self.held.as_ref().is_some_and(|held| {
                held.get(&key).copied().flatten().map(f64::to_bits) == value.map(f64::to_bits)
            });
            let is_being_told = self.writing.as_ref().is_some_and(|it| it.key == key);
            if !is_known || is_being_told || self.unsure.contains(&key) {
                self.untold.push_back((key, value));
            }
        }
    }

    /// Nothing is left to be told to anybody.
    pub fn is_idle(&self) -> bool {
        !self.is_there || (self.untold.is_empty() && self.writing.is_none())
    }

    /// An answer has come.
    pub fn answered(&mut self, call: CallId, answer: Answer) {
        match answer {
            Answer::Done(outcome) => {
                if let Some(writing) = self.writing.take_if(|it| it.call == call) {
                    self.said.is_silent = false;
                    self.unsure.remove(&writing.key);
                    match outcome {
                        Ok(()) => {
                            if let Some(held) = &mut self.held {
                                held.insert(writing.key, writing.value);
                            }
                        }
                        Err(why) => self.remarks.push(format!(
                            "the problem expert does not take {}: {why}",
                            writing.key.told(writing.value)
                        )),
                    }
                }
            }
            Answer::States(outcome) => {
                let is_asked = |it: &Reading| it.predicates == call || it.functions == call;
                let Some(reading) = self.reading.as_mut().filter(|it| is_asked(it)) else {
                    return;
                };
                self.said.is_silent = false;
                match outcome {
                    Ok(nodes) if reading.predicates == call => reading.facts = Some(nodes),
                    Ok(nodes) => reading.numbers = Some(nodes),
                    Err(why) => {
                        self.reading = None;
                        self.remarks.push(format!(
                            "the problem expert does not report its contents: {why}"
                        ));
                        return;
                    }
                }
                if reading.facts.is_some()
                    && reading.numbers.is_some()
                    && let Some(reading) = self.reading.take()
                {
                    self.has_read(&reading);
                }
            }
        }
    }

    /// Time passes. To be called a few times a second, and after everything else; then [`Self::calls`], [`Self::seen`] and
    /// [`Self::remarks`] have what is to be done.
    pub fn tick(&mut self, now: Duration) {
        if !self.is_there {
            if self.believed.is_some() && !std::mem::replace(&mut self.said.is_missing, true) {
                let text = "there is no problem expert: changes by runs are not reported";
                self.remarks.push(text.to_owned());
            }
            // Whoever comes back is asked anew; what it was asked for last may be lost.
            (self.reading, self.is_stale) = (None, true);
            return;
        }
        let is_late = |since: Duration| now.saturating_sub(since) >= PATIENCE;
        if self.reading.as_ref().is_some_and(|it| is_late(it.since)) {
            (self.reading, self.is_stale) = (None, true);
            self.complain();
        }
        if let Some(late) = self.writing.take_if(|it| is_late(it.since)) {
            self.unsure.insert(late.key.clone());
            // It does no harm to be told the same twice.
            if self.untold.iter().all(|(key, _)| *key != late.key) {
                self.untold.push_front((late.key, late.value));
            }
            self.complain();
        }
        let may_write = matches!(self.following, Following::Yes | Following::Nothing);
        if self.writing.is_none()
            && may_write
            && let Some((key, value)) = self.untold.pop_front()
        {
            let held = self.held.as_ref();
            let is_defined = held.is_some_and(|it| it.get(&key).is_some_and(Option::is_some));
            let call = self.call(change_of(&key, value, is_defined, &self.spelling));
            let since = now;
            self.writing = Some(Writing {
                call,
                key,
                value,
                since,
            });
        }
        let may_read = match self.following {
            // What the run has changed since its beginning waits for this answer.
            Following::Asking => self.believed.is_some(),
            Following::Yes => self.writing.is_none() && self.untold.is_empty(),
            Following::Nothing | Following::No => false,
        };
        if may_read && self.is_stale && self.reading.is_none() {
            self.is_stale = false;
            let touched = if self.following == Following::Asking {
                self.untold.iter().map(|(key, _)| key.clone()).collect()
            } else {
                BTreeSet::new()
            };
            self.reading = Some(Reading {
                predicates: self.call(Call::Predicates),
                functions: self.call(Call::Functions),
                facts: None,
                numbers: None,
                since: now,
                touched,
            });
        }
    }

    /// What the problem expert is to be asked for now.
    pub fn calls(&mut self) -> Vec<(CallId, Call)> {
        std::mem::take(&mut self.calls)
    }

    /// What others have changed there, for the run.
    pub fn seen(&mut self) -> Vec<Seen> {
        std::mem::take(&mut self.seen)
    }

    /// For people.
    pub fn remarks(&mut self) -> Vec<String> {
        std::mem::take(&mut self.remarks)
    }

    fn call(&mut self, call: Call) -> CallId {
        self.last += 1;
        self.calls.push((self.last, call));
        self.last
    }

    /// Once, until it answers again.
    fn complain(&mut self) {
        if !std::mem::replace(&mut self.said.is_silent, true) {
            self.remarks.push(format!(
                "the problem expert has not answered for {} s; the request is repeated, and the run continues",
                PATIENCE.as_secs()
            ));
        }
    }

    fn has_read(&mut self, reading: &Reading) {
        let Some(believed) = &mut self.believed else {
            return;
        };
        let mut now_held = State::new();
        for node in reading.facts.iter().flatten() {
            now_held.insert(Key::of_fact(node, &mut self.spelling), Some(1.0));
        }
        for node in reading.numbers.iter().flatten() {
            now_held.insert(Key::of_number(node, &mut self.spelling), Some(node.value));
        }
        let is_first = self.held.is_none();
        if self.following == Following::Asking {
            if !believed.is_empty() && !now_held.keys().any(|key| believed.contains_key(key)) {
                self.following = Following::No;
                self.untold.clear();
                self.remarks.push(
                    "the problem expert has nothing of this problem, and is left alone".to_owned(),
                );
                return;
            }
            self.following = Following::Yes;
        }
        let before = self.held.take();
        let before = before.as_ref().unwrap_or(believed).clone();
        let value_in = |state: &State, key: &Key| state.get(key).copied().flatten();
        let is_same = |one: Value, other: Value| one.map(f64::to_bits) == other.map(f64::to_bits);
        let keys: BTreeSet<Key> = before.keys().chain(now_held.keys()).cloned().collect();
        for key in keys {
            let theirs = value_in(&now_held, &key);
            let is_ours = reading.touched.contains(&key)
                || self.untold.iter().any(|(other, _)| *other == key)
                || self.writing.as_ref().is_some_and(|it| it.key == key);
            if is_ours {
                // Whatever was read is older than what was changed, or may be.
                if !is_first {
                    now_held.insert(key.clone(), value_in(&before, &key));
                }
                self.is_stale = true;
                continue;
            }
            if is_same(theirs, value_in(&before, &key)) {
                continue;
            }
            if !is_same(theirs, value_in(believed, &key)) {
                believed.insert(key.clone(), theirs);
                self.seen.extend(Seen::of(&key, theirs));
            }
        }
        self.held = Some(now_held);
    }
}
