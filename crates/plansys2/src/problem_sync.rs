//! Synchronization of a run's beliefs with the problem expert.

mod change;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use crate::knowledge::Node;
pub use change::{ExternalChange, Key};
use change::{State, Value, change_of};

/// Number of a [`Call`], unique.
pub type CallId = u64;

/// Time limit for an answer of the problem expert.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);

/// Request to the problem expert.
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
    /// `problem_expert/add_problem_function`, for a fluent without a value there.
    Define(Node),
    /// `problem_expert/update_problem_function`.
    Update(Node),
    /// `problem_expert/remove_problem_function`.
    Forget(Node),
}

/// Answer of the problem expert, or the reason of a refusal.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// Answer to [`Call::Predicates`] and [`Call::Functions`].
    States(Result<Vec<Node>, String>),
    /// Answer to the other calls.
    Done(Result<(), String>),
}

/// Synchronizes a problem expert with a run.
///
/// Changes by the run are written in their order, one call at a time. Whenever the problem expert
/// reports a change, its state is read, and the changes of others are [reported to the
/// run](Self::seen). Three rules resolve conflicts:
///
/// 1. At the beginning of a run, the problem expert wins: its differences from the problem are
///    reported. A problem expert without any fact or fluent of the problem is about another
///    problem, and is ignored.
/// 2. A change by the run that has not been written yet wins over a state that is read meanwhile.
/// 3. Otherwise the last change wins, in the order of the problem expert.
///
/// If the problem expert refuses a change, the run keeps it. The refusal is reported to the user,
/// and the change is neither written again nor undone.
#[derive(Debug, Default)]
pub struct ProblemSync {
    is_there: bool,
    warnings: ReportedWarnings,
    sync_state: SyncState,
    /// Beliefs of the run; `None` before its first report.
    believed: Option<State>,
    /// Last known state of the problem expert; `None` before the first read.
    expert_state: Option<State>,
    /// Spelling of each word in the problem expert.
    spelling: BTreeMap<String, String>,
    /// Changes to write, oldest first.
    pending_writes: VecDeque<(Key, Value)>,
    writing: Option<Writing>,
    /// Keys whose last write was not answered, so the problem expert may or may not have it.
    unconfirmed: BTreeSet<Key>,
    reading: Option<Reading>,
    /// `true` if the state may have changed since the last read.
    is_stale: bool,
    last: CallId,
    calls: Vec<(CallId, Call)>,
    seen: Vec<ExternalChange>,
    remarks: Vec<String>,
}

/// Messages that the user has already received.
#[derive(Clone, Copy, Debug, Default)]
struct ReportedWarnings {
    /// There is no problem expert.
    is_missing: bool,
    /// It does not answer.
    is_silent: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum SyncState {
    /// No run is active.
    #[default]
    Inactive,
    /// Its first state is being read, to find out whether it is about the same problem.
    Checking,
    Active,
    /// It is about another problem.
    Disabled,
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
    /// Keys that the run has changed since the read began.
    touched: BTreeSet<Key>,
}

impl ProblemSync {
    /// Starts a run. `text` is its problem, for the spelling of its words, or empty.
    pub fn begin(&mut self, text: &str) {
        let is_word = |it: char| !(it == '(' || it == ')' || it.is_whitespace());
        let words = text.split(|it: char| !is_word(it));
        let words = words.filter(|word| word.chars().any(char::is_uppercase));
        self.spelling
            .extend(words.map(|word| (word.to_lowercase(), word.to_owned())));
        self.sync_state = SyncState::Checking;
        self.believed = None;
        self.expert_state = None;
        self.reading = None;
        self.seen.clear();
    }

    /// Ends the run. Its pending changes are still written.
    pub fn end(&mut self) {
        if self.sync_state == SyncState::Checking {
            self.pending_writes.clear();
        }
        self.sync_state = SyncState::Inactive;
        self.believed = None;
        self.seen.clear();
    }

    /// Sets whether the problem expert is available.
    pub fn set_available(&mut self, is_there: bool) {
        self.is_stale |= is_there && !self.is_there;
        self.is_there = is_there;
    }

    /// Takes a change notification of the problem expert.
    pub fn on_change(&mut self) {
        self.is_stale = true;
    }

    /// Takes beliefs of the run: all of them at first, changes later. Names are in brackets.
    pub fn set_beliefs(&mut self, facts: &[(String, bool)], values: &[(String, Option<f64>)]) {
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
        if self.sync_state == SyncState::Disabled {
            return;
        }
        for (key, value) in changes {
            if let Some(reading) = &mut self.reading {
                reading.touched.insert(key.clone());
            }
            self.pending_writes.retain(|(other, _)| *other != key);
            let is_known = self.expert_state.as_ref().is_some_and(|held| {
                held.get(&key).copied().flatten().map(f64::to_bits) == value.map(f64::to_bits)
            });
            let is_being_told = self.writing.as_ref().is_some_and(|it| it.key == key);
            if !is_known || is_being_told || self.unconfirmed.contains(&key) {
                self.pending_writes.push_back((key, value));
            }
        }
    }

    /// Returns `true` if no change is pending, or if the problem expert is unavailable.
    pub fn is_idle(&self) -> bool {
        !self.is_there || (self.pending_writes.is_empty() && self.writing.is_none())
    }

    /// Takes an answer.
    pub fn on_answer(&mut self, call: CallId, answer: Answer) {
        match answer {
            Answer::Done(outcome) => {
                if let Some(writing) = self.writing.take_if(|it| it.call == call) {
                    self.warnings.is_silent = false;
                    self.unconfirmed.remove(&writing.key);
                    match outcome {
                        Ok(()) => {
                            if let Some(held) = &mut self.expert_state {
                                held.insert(writing.key, writing.value);
                            }
                        }
                        Err(why) => self.remarks.push(format!(
                            "the problem expert rejects {}: {why}",
                            writing.key.to_pddl(writing.value)
                        )),
                    }
                }
            }
            Answer::States(outcome) => {
                let is_asked = |it: &Reading| it.predicates == call || it.functions == call;
                let Some(reading) = self.reading.as_mut().filter(|it| is_asked(it)) else {
                    return;
                };
                self.warnings.is_silent = false;
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
                    self.on_read(&reading);
                }
            }
        }
    }

    /// Advances the time. To be called a few times a second and after all other methods, before
    /// [`Self::calls`], [`Self::seen`] and [`Self::remarks`].
    pub fn tick(&mut self, now: Duration) {
        if !self.is_there {
            if self.believed.is_some() && !std::mem::replace(&mut self.warnings.is_missing, true) {
                let text = "there is no problem expert: changes by runs are not reported";
                self.remarks.push(text.to_owned());
            }
            // A problem expert that returns is read again, because the pending answer may be lost.
            (self.reading, self.is_stale) = (None, true);
            return;
        }
        let is_late = |since: Duration| now.saturating_sub(since) >= ANSWER_TIMEOUT;
        if self.reading.as_ref().is_some_and(|it| is_late(it.since)) {
            (self.reading, self.is_stale) = (None, true);
            self.warn_of_silence();
        }
        if let Some(late) = self.writing.take_if(|it| is_late(it.since)) {
            self.unconfirmed.insert(late.key.clone());
            // Repeating a write is harmless.
            if self.pending_writes.iter().all(|(key, _)| *key != late.key) {
                self.pending_writes.push_front((late.key, late.value));
            }
            self.warn_of_silence();
        }
        let may_write = matches!(self.sync_state, SyncState::Active | SyncState::Inactive);
        if self.writing.is_none()
            && may_write
            && let Some((key, value)) = self.pending_writes.pop_front()
        {
            let held = self.expert_state.as_ref();
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
        let may_read = match self.sync_state {
            // Changes that the run has made since its beginning wait for this answer.
            SyncState::Checking => self.believed.is_some(),
            SyncState::Active => self.writing.is_none() && self.pending_writes.is_empty(),
            SyncState::Inactive | SyncState::Disabled => false,
        };
        if may_read && self.is_stale && self.reading.is_none() {
            self.is_stale = false;
            let touched = if self.sync_state == SyncState::Checking {
                self.pending_writes
                    .iter()
                    .map(|(key, _)| key.clone())
                    .collect()
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

    /// Takes the calls that are due.
    pub fn calls(&mut self) -> Vec<(CallId, Call)> {
        std::mem::take(&mut self.calls)
    }

    /// Takes the changes of others, for the run.
    pub fn seen(&mut self) -> Vec<ExternalChange> {
        std::mem::take(&mut self.seen)
    }

    /// Takes the messages for the user.
    pub fn remarks(&mut self) -> Vec<String> {
        std::mem::take(&mut self.remarks)
    }

    fn call(&mut self, call: Call) -> CallId {
        self.last += 1;
        self.calls.push((self.last, call));
        self.last
    }

    /// Reports a missing answer, once until the next answer.
    fn warn_of_silence(&mut self) {
        if !std::mem::replace(&mut self.warnings.is_silent, true) {
            self.remarks.push(format!(
                "the problem expert has not answered for {} s; the request is repeated, and the run continues",
                ANSWER_TIMEOUT.as_secs()
            ));
        }
    }

    fn on_read(&mut self, reading: &Reading) {
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
        let is_first = self.expert_state.is_none();
        if self.sync_state == SyncState::Checking {
            if !believed.is_empty() && !now_held.keys().any(|key| believed.contains_key(key)) {
                self.sync_state = SyncState::Disabled;
                self.pending_writes.clear();
                self.remarks.push(
                    "the problem expert contains nothing of this problem, and is not used"
                        .to_owned(),
                );
                return;
            }
            self.sync_state = SyncState::Active;
        }
        let before = self.expert_state.take();
        let before = before.as_ref().unwrap_or(believed).clone();
        let value_in = |state: &State, key: &Key| state.get(key).copied().flatten();
        let is_same = |one: Value, other: Value| one.map(f64::to_bits) == other.map(f64::to_bits);
        let keys: BTreeSet<Key> = before.keys().chain(now_held.keys()).cloned().collect();
        for key in keys {
            let theirs = value_in(&now_held, &key);
            let is_ours = reading.touched.contains(&key)
                || self.pending_writes.iter().any(|(other, _)| *other == key)
                || self.writing.as_ref().is_some_and(|it| it.key == key);
            if is_ours {
                // The state that was read may be older than the change.
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
                self.seen.extend(ExternalChange::of(&key, theirs));
            }
        }
        self.expert_state = Some(now_held);
    }
}
