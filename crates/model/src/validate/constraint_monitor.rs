//! Track of one trajectory constraint: when its conditions hold, and whether it is
//! satisfied.

use std::cmp::Ordering;

use elbowroom_num::Rational;

use super::violation::Reason;
use crate::constraint::Modal;
use crate::describe::decimal;
use crate::ground::Condition;
use crate::task::Task;

/// Precision of the irrational beginning of a phase.
const CLOSE: (i64, i64) = (1, 1_000_000);

/// Beginning of a phase.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PhaseStart {
    /// The time. An irrational time is up to a millionth later.
    pub(super) time: Rational,
    /// `true` if `time` is exact.
    pub(super) is_exact: bool,
    /// `true` if the phase begins right after that moment, which does not belong to it.
    pub(super) is_after: bool,
}

impl PhaseStart {
    pub(super) fn at(time: &Rational) -> Self {
        Self {
            time: time.clone(),
            is_exact: true,
            is_after: false,
        }
    }

    /// Returns an upper bound of the time.
    fn latest(&self) -> Rational {
        if self.is_exact {
            self.time.clone()
        } else {
            &self.time + Rational::new(CLOSE.0, CLOSE.1)
        }
    }

    /// Compares the first moments of the phase to a time; `None` if undecided.
    fn order(&self, time: &Rational) -> Option<Ordering> {
        if !self.is_exact {
            // The beginning lies strictly between the two.
            return if *time <= self.time {
                Some(Ordering::Greater)
            } else if *time >= self.latest() {
                Some(Ordering::Less)
            } else {
                None
            };
        }
        match self.time.cmp(time) {
            Ordering::Equal if self.is_after => Some(Ordering::Greater),
            order => Some(order),
        }
    }
}

/// Interval during which the conditions of a constraint do not change.
#[derive(Clone, Debug)]
pub(super) struct Phase {
    from: PhaseStart,
    /// Truth values of the conditions; the second is `false` if there is only one.
    holds: [bool; 2],
    /// Reasons why the first condition is false, if that may be a violation.
    reasons: Vec<Reason>,
}

/// Phases of one constraint.
#[derive(Clone, Debug, Default)]
pub(super) struct ConstraintMonitor(Vec<Phase>);

/// Result for a constraint.
#[derive(Debug)]
pub(super) enum Finding {
    Satisfied,
    /// Beginning of the violation, reason, and reasons why the condition is false then.
    Violated(PhaseStart, String, Vec<Reason>),
    /// Two times are too close to each other for a decision.
    Unclear(Rational),
}

impl ConstraintMonitor {
    /// Records the truth values of the conditions from a moment on.
    pub(super) fn push(
        &mut self,
        from: PhaseStart,
        holds: [bool; 2],
        explain: impl FnOnce() -> Vec<Reason>,
    ) {
        if self.0.last().is_some_and(|last| last.holds == holds) {
            return;
        }
        let reasons = if holds[0] { Vec::new() } else { explain() };
        self.0.push(Phase {
            from,
            holds,
            reasons,
        });
    }

    /// Evaluates the constraint for a plan that ends at `end`.
    pub(super) fn finding(&self, task: &Task, modal: &Modal<Condition>, end: &Rational) -> Finding {
        let text = |condition| task.describe_condition(condition);
        let broken = |phase: &Phase, why: String| {
            Finding::Violated(phase.from.clone(), why, phase.reasons.clone())
        };
        let at =
            |time: &Rational, why: String| Finding::Violated(PhaseStart::at(time), why, Vec::new());
        match modal {
            Modal::AtEnd(c) => match self.0.last() {
                Some(last) if !last.holds[0] => Finding::Violated(
                    PhaseStart::at(end),
                    format!("{} does not hold at the end", text(c)),
                    last.reasons.clone(),
                ),
                _ => Finding::Satisfied,
            },
            Modal::Always(c) => match self.0.iter().find(|phase| !phase.holds[0]) {
                Some(phase) => broken(phase, format!("{} does not hold", text(c))),
                None => Finding::Satisfied,
            },
            Modal::Sometime(c) if self.0.iter().any(|phase| phase.holds[0]) => {
                let _ = c;
                Finding::Satisfied
            }
            Modal::Sometime(c) => at(end, format!("{} never holds", text(c))),
            Modal::Within(time, c) => self.within(time).unwrap_or_else(|| {
                let by = decimal(time);
                at(time, format!("{} does not hold until {by}", text(c)))
            }),
            Modal::AtMostOnce(c) => match self.0.iter().filter(|p| p.holds[0]).nth(1) {
                Some(phase) => broken(phase, format!("{} holds again", text(c))),
                None => Finding::Satisfied,
            },
            Modal::SometimeAfter(c, d) => {
                let Some(position) = self.0.iter().rposition(|phase| phase.holds[0]) else {
                    return Finding::Satisfied;
                };
                if self.0[position..].iter().any(|phase| phase.holds[1]) {
                    return Finding::Satisfied;
                }
                let why = format!(
                    "{} holds, but {} does not hold then or later",
                    text(c),
                    text(d)
                );
                broken(&self.0[position], why)
            }
            Modal::SometimeBefore(c, d) => {
                let Some(position) = self.0.iter().position(|phase| phase.holds[0]) else {
                    return Finding::Satisfied;
                };
                let phase = &self.0[position];
                // In a phase without a first moment, each moment has an earlier one in the phase.
                let is_before = phase.from.is_after && phase.holds[1];
                if is_before || self.0[..position].iter().any(|phase| phase.holds[1]) {
                    return Finding::Satisfied;
                }
                let why = format!("{} holds, but {} never held before", text(c), text(d));
                broken(phase, why)
            }
            Modal::AlwaysWithin(time, c, d) => {
                let why = || {
                    let (c, d, time) = (text(c), text(d), decimal(time));
                    format!("{c} holds, but {d} does not hold within {time}")
                };
                self.always_within(time, &why)
            }
            Modal::HoldDuring(from, until, c) => {
                self.throughout(from, Some(until), &format!("{} does not hold", text(c)))
            }
            Modal::HoldAfter(from, c) => {
                self.throughout(from, None, &format!("{} does not hold", text(c)))
            }
        }
    }

    /// Checks that the first condition holds at a moment no later than `time`; `None` if it does
    /// not.
    fn within(&self, time: &Rational) -> Option<Finding> {
        // The first phase that satisfies the condition is the earliest.
        let phase = self.0.iter().find(|phase| phase.holds[0])?;
        match phase.from.order(time) {
            Some(Ordering::Greater) => None,
            Some(_) => Some(Finding::Satisfied),
            None => Some(Finding::Unclear(time.clone())),
        }
    }

    fn always_within(&self, time: &Rational, why: &dyn Fn() -> String) -> Finding {
        let mut unclear = None;
        for (position, phase) in self.0.iter().enumerate() {
            // The first moment of a phase has the longest wait.
            if !phase.holds[0] || phase.holds[1] {
                continue;
            }
            let answered = self.0[position..].iter().find(|phase| phase.holds[1]);
            let is_kept = answered.map_or(Some(false), |later| {
                let (from, to) = (&phase.from, &later.from);
                if from.is_exact && to.is_exact {
                    // If the phase with the response has no first moment, the response comes later
                    // than any wait that begins at a first moment.
                    let is_later = to.is_after && !from.is_after;
                    return Some(match (&to.time - &from.time).cmp(time) {
                        Ordering::Less => true,
                        Ordering::Equal => !is_later,
                        Ordering::Greater => false,
                    });
                }
                let (least, most) = (&to.time - from.latest(), to.latest() - &from.time);
                if most <= *time {
                    Some(true)
                } else if least >= *time {
                    Some(false)
                } else {
                    None
                }
            });
            match is_kept {
                Some(true) => {}
                Some(false) => {
                    return Finding::Violated(phase.from.clone(), why(), Vec::new());
                }
                None => unclear = Some(phase.from.time.clone()),
            }
        }
        unclear.map_or(Finding::Satisfied, Finding::Unclear)
    }

    /// Checks that the first condition holds at each moment from `from` until before `until`.
    fn throughout(&self, from: &Rational, until: Option<&Rational>, why: &str) -> Finding {
        if until.is_some_and(|until| until <= from) {
            return Finding::Satisfied;
        }
        let mut unclear = None;
        for (position, phase) in self.0.iter().enumerate() {
            if phase.holds[0] {
                continue;
            }
            let begins_before = until.map_or(Some(true), |until| {
                Some(phase.from.order(until)? == Ordering::Less)
            });
            let ends_after = self.0.get(position + 1).map_or(Some(true), |next| {
                Some(next.from.order(from)? == Ordering::Greater)
            });
            match (begins_before, ends_after) {
                (Some(true), Some(true)) => {
                    let is_under_way = phase.from.order(from) != Some(Ordering::Greater);
                    let begins = if is_under_way {
                        PhaseStart::at(from)
                    } else {
                        phase.from.clone()
                    };
                    return Finding::Violated(begins, why.to_owned(), phase.reasons.clone());
                }
                (Some(false), _) | (_, Some(false)) => {}
                _ => unclear = Some(phase.from.time.clone()),
            }
        }
        unclear.map_or(Finding::Satisfied, Finding::Unclear)
    }
}
