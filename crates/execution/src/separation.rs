//! Minimum separation of interfering happenings, for executors whose networks do not order them.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::ground::Action;
use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;
use elbowroom_probability::Likelihoods;

/// Recent and expected happenings, on the plan's clock.
///
/// An executor that knows only orderings starts an action as soon as possible.
/// [`separated`](Self::separated) delays the start until neither it nor the planned end is less
/// than ε from an interfering happening.
#[derive(Clone, Debug)]
pub(crate) struct Separation {
    epsilon: Rational,
    /// Changes of the last ε, each with the first time at which an interfering happening is
    /// permitted.
    recent: Vec<(Footprint, Rational)>,
    /// The planned ends of running actions, by a number that the executor chooses.
    expected: BTreeMap<u32, Expected>,
    /// Timed initials, in order of time.
    timed: Vec<(Footprint, Rational)>,
    /// Source of the facts that failures change; `None` if failures are unknown.
    likelihoods: Option<Arc<Likelihoods>>,
}

/// The planned end of a running action.
#[derive(Clone, Debug)]
struct Expected {
    time: Rational,
    /// The footprint of a successful end.
    successful: Footprint,
    /// The same with everything that a failure writes.
    possible: Footprint,
}

impl Separation {
    /// Creates the separation for a plan whose clock reads 0 at `origin`.
    pub(crate) fn new(task: &Task, origin: &Rational) -> Self {
        let timed = task.timed().iter();
        let timed = timed.map(|it| (Footprint::of_timed(it), &it.time - origin));
        Self {
            epsilon: task.epsilon().clone(),
            recent: Vec::new(),
            expected: BTreeMap::new(),
            timed: timed.collect(),
            likelihoods: None,
        }
    }

    /// Includes the facts that failures change, by `likelihoods`, in the planned ends of actions.
    pub(crate) fn with_failures(mut self, likelihoods: Arc<Likelihoods>) -> Self {
        self.likelihoods = Some(likelihoods);
        self
    }

    /// Records a change at `time`.
    pub(crate) fn note(&mut self, change: Footprint, time: &Rational) {
        self.recent.push((change, time + &self.epsilon));
    }

    /// Records that an action starts at `time` and is expected to take `duration`.
    pub(crate) fn start(
        &mut self,
        number: u32,
        (task, action): (&Task, &Action),
        duration: Option<&Rational>,
        time: &Rational,
    ) {
        self.note(Footprint::of_start(task, action), time);
        if let Some(duration) = duration {
            self.expect_end(number, (task, action), time + duration);
        }
    }

    /// Records that a running action is expected to end at `end`.
    pub(crate) fn expect_end(
        &mut self,
        number: u32,
        (task, action): (&Task, &Action),
        end: Rational,
    ) {
        let expected = Expected {
            time: end,
            successful: Footprint::of_end(task, action),
            possible: self.possible_end(task, action),
        };
        self.expected.insert(number, expected);
    }

    /// Records that an action has ended at `time`; `succeeded` if its end effects took place. The
    /// changes of a failure are recorded when they are reported.
    pub(crate) fn end(&mut self, number: u32, succeeded: bool, time: &Rational) {
        let ended = self.expected.remove(&number);
        if let Some(ended) = ended.filter(|_| succeeded) {
            self.note(ended.successful, time);
        }
    }

    /// Returns the footprint of an action's end, successful or failed.
    fn possible_end(&self, task: &Task, action: &Action) -> Footprint {
        let mut footprint = Footprint::of_end(task, action);
        let likelihoods = self.likelihoods.iter();
        for (fact, becomes) in likelihoods.flat_map(|it| it.failure_changes(task, action)) {
            footprint.include_fact(fact, becomes);
        }
        footprint
    }

    /// Returns the time after `now` until which the action has to wait, or `None` if it may start
    /// now.
    pub(crate) fn separated(
        &mut self,
        (task, action): (&Task, &Action),
        duration: Option<&Rational>,
        now: &Rational,
    ) -> Option<Rational> {
        self.recent.retain(|(_, separated)| separated > now);
        let start = Footprint::of_start(task, action);
        let recent = self.recent.iter();
        let recent = recent.filter(|(change, _)| change.interferes_with(&start));
        let recent = recent.map(|(_, separated)| separated.clone());
        let soon = self
            .separated_times_near(&start, now)
            .filter(|time| time > now);
        let ends = duration.into_iter().flat_map(|duration| {
            let end = self.possible_end(task, action);
            let times: Vec<Rational> = self.separated_times_near(&end, &(now + duration)).collect();
            times.into_iter().map(move |time| time - duration)
        });
        recent.chain(soon).chain(ends).max()
    }

    /// Returns, for each interfering happening less than ε from `time`, the first time that is
    /// separated from it.
    fn separated_times_near<'s>(
        &'s self,
        footprint: &'s Footprint,
        time: &'s Rational,
    ) -> impl Iterator<Item = Rational> + 's {
        let (from, until) = (time - &self.epsilon, time + &self.epsilon);
        let first = self.timed.partition_point(|(_, it)| *it <= from);
        let timed = self.timed[first..].iter();
        let timed = timed.take_while(move |(_, it)| *it < until);
        let expected = self.expected.values();
        let expected = expected.map(|it| (&it.possible, &it.time));
        let expected = expected.chain(timed.map(|(other, it)| (other, it)));
        let near = expected.filter(move |(_, it)| (*it - time).abs() < self.epsilon);
        let near = near.filter(|(other, _)| other.interferes_with(footprint));
        near.map(|(_, it)| it + &self.epsilon)
    }
}
