//! A state of the search: facts and numbers after the happenings chosen so far, and constraints on
//! their times.

mod projection;

use std::hash::{Hash, Hasher};

use elbowroom_num::Rational;

use super::compile::{Action, Compiled, Metric, NONE};
use super::expressions::{Form, Symbolic};
use super::formula::set;
use super::hash::Mixer;
use super::network::{Network, NodeId, SETTLED};
use super::time::{NEVER, Ticks};
pub(crate) use projection::Projection;

/// State of the search.
///
/// The happenings chosen so far are in some order. Only interfering happenings keep this order in
/// time, so a later choice may happen earlier. In this way, a sequence of choices represents a plan
/// with concurrent actions (Coles et al., "Forward-chaining partial-order planning", ICAPS 2010).
#[derive(Clone, Debug, Default)]
pub(crate) struct State {
    /// A bit for each fact.
    pub(crate) facts: Vec<u64>,
    pub(crate) values: Vec<Option<Rational>>,
    /// The metric's sum: see [`Metric`](super::compile::Metric).
    pub(crate) cost: Rational,
    /// The latest settled time of each annotation.
    pub(crate) annotations: Vec<Ticks>,
    /// The actions that have started and not ended.
    pub(crate) open: Vec<OpenAction>,
    /// Number of timed initials that have happened.
    pub(crate) timed: u32,
    pub(crate) network: Network,
    /// The last choice, where choices come in chronological order.
    pub(crate) last: LastChoice,
    /// The incomplete moment, if an over-all condition is false. The next choice happens at the
    /// same moment.
    pub(crate) joint: Option<JointMoment>,
    /// The time of the last settled happening.
    pub(crate) settled_end: Ticks,
    /// The numbers that depend on times, in a problem with such numbers.
    pub(crate) symbolic: Option<Box<Symbolic>>,
}

/// Happenings of one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct JointMoment {
    /// The node of the last one.
    pub(crate) node: NodeId,
    pub(crate) count: u8,
}

/// The happening that was chosen last.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LastChoice {
    /// Its node, or [`SETTLED`].
    pub(crate) node: NodeId,
    /// The time at which it happened, if that is settled. Later happenings are no earlier.
    pub(crate) floor: Ticks,
}

impl Default for LastChoice {
    fn default() -> Self {
        Self {
            node: SETTLED,
            floor: -NEVER,
        }
    }
}

impl LastChoice {
    /// Returns its earliest time.
    pub(crate) fn earliest(self, network: &Network) -> Ticks {
        match self.node {
            SETTLED => self.floor,
            node => self.floor.max(network.earliest(node)),
        }
    }
}

/// A running action.
#[derive(Clone, Debug)]
pub(crate) struct OpenAction {
    pub(crate) action: u32,
    /// The node of its start, or [`SETTLED`].
    pub(crate) node: NodeId,
    /// The time at which it started, if that is settled.
    pub(crate) start: Ticks,
    pub(crate) least: Ticks,
    /// [`NEVER`] if there is no bound.
    pub(crate) most: Ticks,
    /// The duration, if only one is possible.
    pub(crate) duration: Option<Rational>,
    /// The action's guards that held at the start, as a bit mask.
    pub(crate) guards: u64,
    /// The node of its end, if numbers depend on times and it started in the plan; otherwise
    /// [`SETTLED`].
    pub(crate) end: NodeId,
    /// The fluents that it changes continuously, with their rates.
    pub(crate) flows: Vec<(u32, Rational)>,
    /// The strict tests of its over-all condition, with their differences just after its start.
    /// Empty after an instantaneous change of a fluent of the over-all condition, or of its rate.
    pub(crate) beginnings: Vec<(u32, Form)>,
    /// For each disjunction of its over-all condition, the alternative that was demanded last.
    pub(crate) chosen: Vec<Option<usize>>,
}

impl OpenAction {
    /// Returns an action that was running before the search began.
    pub(crate) fn running_initially(
        action: u32,
        start: Ticks,
        least: Ticks,
        most: Option<Ticks>,
    ) -> Self {
        Self {
            action,
            node: SETTLED,
            start,
            least,
            most: most.unwrap_or(NEVER),
            duration: None,
            guards: u64::MAX,
            end: SETTLED,
            flows: Vec::new(),
            beginnings: Vec::new(),
            chosen: Vec::new(),
        }
    }

    fn is_like(&self, other: &Self) -> bool {
        self.action == other.action
            && self.guards == other.guards
            && self.least == other.least
            && self.most == other.most
            && (self.node == SETTLED) == (other.node == SETTLED)
            && self.duration == other.duration
            && self.beginnings == other.beginnings
            && self.chosen == other.chosen
    }
}

impl State {
    /// Returns the initial state of the search, without running actions.
    pub(crate) fn new(compiled: &Compiled, facts: &[bool], values: Vec<Option<Rational>>) -> Self {
        let mut bits = vec![0; compiled.facts.len().div_ceil(64)];
        for (fact, &truth) in facts.iter().enumerate() {
            set(&mut bits, u32::try_from(fact).expect("few facts"), truth);
        }
        let mut state = Self {
            facts: bits,
            values,
            annotations: vec![-NEVER; compiled.annotation_count],
            // Before all happenings at the current time.
            settled_end: compiled.now - 1,
            ..Self::default()
        };
        state.derive(compiled);
        state
    }

    /// Returns `true` if an instance of the action is running that it must not overlap.
    pub(crate) fn excludes(&self, compiled: &Compiled, action: &Action) -> bool {
        let is_same =
            |open: &OpenAction| compiled.action(open.action).exclusion == action.exclusion;
        action.exclusion != NONE && self.open.iter().any(is_same)
    }

    /// Computes the truth of derived facts.
    pub(crate) fn derive(&mut self, compiled: &Compiled) {
        for (rules, heads) in compiled.strata.iter().zip(&compiled.derived) {
            for &head in heads {
                set(&mut self.facts, head, false);
            }
            loop {
                let mut changed = false;
                for rule in rules {
                    if super::formula::is_set(&self.facts, rule.head) {
                        continue;
                    }
                    let holds = rule.body.holds(&self.facts, &mut |test| {
                        self.test_holds(compiled, test, None)
                    });
                    if holds {
                        set(&mut self.facts, rule.head, true);
                        changed = true;
                    }
                }
                if !changed {
                    break;
                }
            }
        }
    }

    /// Returns `true` if a numeric test holds. A test that reads a fluent without a value does not
    /// hold.
    pub(crate) fn test_holds(
        &self,
        compiled: &Compiled,
        test: u32,
        duration: Option<&Rational>,
    ) -> bool {
        let test = &compiled.tests[test as usize];
        test.difference
            .value(&self.values, duration)
            .is_some_and(|value| test.comparison.holds(&value, &Rational::ZERO))
    }

    /// Returns the earliest time at which all chosen happenings and all running actions, with their
    /// least durations, can be over.
    pub(crate) fn earliest_end(&self) -> Ticks {
        let open = self.open.iter().map(|open| {
            let start = if open.node == SETTLED {
                open.start
            } else {
                self.network.earliest(open.node)
            };
            start + open.least
        });
        open.fold(
            self.settled_end.max(self.network.earliest_end()),
            Ticks::max,
        )
    }

    /// Returns a hash of all parts except the times.
    pub(crate) fn discrete_hash(&self) -> u64 {
        let mut mixer = Mixer::default();
        for word in &self.facts {
            mixer.write_u64(*word);
        }
        for value in &self.values {
            value.hash(&mut mixer);
        }
        for open in &self.open {
            mixer.write_u32(open.action);
            mixer.write_u64(open.guards);
        }
        mixer.write_u32(self.timed);
        mixer.finish()
    }

    /// Returns a hash of the facts, the running actions and the timed initials to come, without
    /// numbers.
    pub(crate) fn fact_hash(&self) -> u64 {
        let mut mixer = Mixer::default();
        for word in &self.facts {
            mixer.write_u64(*word);
        }
        for open in &self.open {
            mixer.write_u32(open.action);
        }
        mixer.write_u32(self.timed);
        mixer.finish()
    }

    /// Returns `true` if two states differ only in times.
    pub(crate) fn is_discretely(&self, other: &Self) -> bool {
        self.facts == other.facts
            && self.timed == other.timed
            && self.open.len() == other.open.len()
            && self.open.iter().zip(&other.open).all(|(a, b)| a.is_like(b))
            && self.values == other.values
            && self.symbolic == other.symbolic
    }

    /// Returns `true` if all settled happenings were no later than in the other state, and the
    /// unsettled ones can be as early. Precondition: the two states differ only in times.
    pub(crate) fn has_no_later_annotations_than(&self, other: &Self) -> bool {
        if self.settled_end > other.settled_end {
            return false;
        }
        if self.network.marks.is_empty() && other.network.marks.is_empty() {
            return at_most(&self.annotations, &other.annotations);
        }
        at_most(&self.latest_annotations(), &other.latest_annotations())
    }

    /// Returns the annotations, with those of unsettled happenings at their earliest times.
    fn latest_annotations(&self) -> Vec<Ticks> {
        let mut annotations = self.annotations.clone();
        for &(annotation, node) in &self.network.marks {
            let annotation = &mut annotations[annotation as usize];
            *annotation = (*annotation).max(self.network.earliest(node));
        }
        annotations
    }

    /// Returns the cost so far by the metric, without the time. Returns `None` if it depends on
    /// times that are not chosen yet.
    pub(crate) fn spent(&self, metric: &Metric) -> Option<Rational> {
        Some(metric.values.value(&self.values, None)? + &self.cost)
    }

    /// Returns an estimate of the memory, in bytes.
    pub(crate) fn size(&self) -> usize {
        size_of::<Self>()
            + 8 * (self.facts.len() + self.annotations.len())
            + size_of::<Option<Rational>>() * self.values.len()
            + size_of::<OpenAction>() * self.open.len()
            + self.network.size()
            + self.symbolic.as_ref().map_or(0, |symbolic| symbolic.size())
    }
}

fn at_most(left: &[Ticks], right: &[Ticks]) -> bool {
    left.iter().zip(right).all(|(a, b)| a <= b)
}
