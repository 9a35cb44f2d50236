//! Trajectory constraints: evaluation.
//!
//! For each constraint, the validator records the truth values of its conditions at the beginning,
//! after each happening group, and, while numbers move, in each cell between two cuts (see
//! [`piece`](super::piece)). Only changes are stored: a [`Phase`] begins when the truth value of a
//! condition changes and lasts until the next change; the last one lasts forever. This is
//! sufficient, because the first moments of phases decide each constraint.

use elbowroom_num::Rational;

use super::abort::{Abort, EvaluationContext};
use super::constraint_monitor::{ConstraintMonitor, Finding, PhaseStart};
use super::evaluate::Fault;
use super::judge::Judge;
use super::segment::Segment;
use super::violation::{ConditionTime, Undecided, UndecidedReason, ViolationKind};
use crate::constraint::{Constraints, Modal};
use crate::ground::Condition;

/// Phases of all constraints of a task.
#[derive(Debug)]
pub(super) struct TrajectoryMonitor<'a> {
    constraints: &'a Constraints,
    hard: Vec<ConstraintMonitor>,
    soft: Vec<Vec<ConstraintMonitor>>,
}

impl<'a> TrajectoryMonitor<'a> {
    pub(super) fn new(constraints: &'a Constraints) -> Self {
        let tracks = |count| vec![ConstraintMonitor::default(); count];
        Self {
            constraints,
            hard: tracks(constraints.hard.len()),
            soft: constraints
                .soft
                .iter()
                .map(|soft| tracks(soft.all.len()))
                .collect(),
        }
    }

    /// Calls `visit` for each constraint with its track, and `true` if it is hard.
    fn visit(
        &mut self,
        mut visit: impl FnMut(&'a Modal<Condition>, &mut ConstraintMonitor, bool) -> Result<(), Abort>,
    ) -> Result<(), Abort> {
        for (modal, track) in self.constraints.hard.iter().zip(&mut self.hard) {
            visit(modal, track, true)?;
        }
        for (soft, tracks) in self.constraints.soft.iter().zip(&mut self.soft) {
            for (modal, track) in soft.all.iter().zip(tracks) {
                visit(modal, track, false)?;
            }
        }
        Ok(())
    }

    /// Records the present state, which begins at `time`.
    pub(super) fn note(&mut self, judge: &Judge<'_>, time: &Rational) -> Result<(), Abort> {
        self.visit(|modal, track, is_hard| {
            let mut holds = [false; 2];
            for (condition, holds) in modal.conditions().into_iter().zip(&mut holds) {
                *holds = truth(
                    judge,
                    judge.reads(condition, None),
                    condition,
                    time,
                    is_hard,
                )?;
            }
            let now = &judge.now;
            let explain = || match modal.conditions().first() {
                Some(condition) if is_hard && explains(modal) => {
                    judge.explain(condition, now, (None, ConditionTime::Trajectory))
                }
                _ => Vec::new(),
            };
            track.push(PhaseStart::at(time), holds, explain);
            Ok(())
        })
    }

    /// Records the changes while numbers move, from the group at `from` on.
    pub(super) fn note_motion(
        &mut self,
        judge: &Judge<'_>,
        piece: &Segment<'_>,
        from: &Rational,
    ) -> Result<(), Abort> {
        self.visit(|modal, track, is_hard| {
            let conditions = modal.conditions();
            let place =
                EvaluationContext::condition(from, None, ConditionTime::Trajectory, conditions[0]);
            let cells = match piece.course(&conditions) {
                Ok(cells) => cells,
                Err(fault @ (Fault::Undefined(_) | Fault::DivisionByZero(_))) if !is_hard => {
                    let _ = fault;
                    return Ok(());
                }
                Err(fault) => return Err(judge.to_abort(fault, &place)),
            };
            for cell in cells {
                let mut holds = [false; 2];
                for (known, holds) in cell.holds.iter().zip(&mut holds) {
                    *holds = *known;
                }
                let beginning = PhaseStart {
                    time: from + cell.at,
                    is_exact: cell.is_exact,
                    is_after: cell.is_open,
                };
                track.push(beginning, holds, Vec::new);
            }
            Ok(())
        })
    }

    /// Returns the first violation of a hard constraint, for a plan that ends at `end`.
    pub(super) fn violation(&self, judge: &Judge<'_>, end: &Rational) -> Result<(), Abort> {
        if self.constraints.depends_on_unknown_past && !self.constraints.hard.is_empty() {
            return Err(undecided(None, UndecidedReason::PastStates));
        }
        let mut first: Option<(PhaseStart, ViolationKind)> = None;
        let mut unclear = None;
        for (modal, track) in self.constraints.hard.iter().zip(&self.hard) {
            match track.finding(judge.task, modal, end) {
                Finding::Satisfied => {}
                Finding::Unclear(time) => {
                    unclear.get_or_insert_with(|| (time, judge.task.describe_modal(modal)));
                }
                Finding::Violated(at, why, reasons) => {
                    let key = |at: &PhaseStart| (at.time.clone(), at.is_after);
                    if first
                        .as_ref()
                        .is_some_and(|(earlier, _)| key(earlier) <= key(&at))
                    {
                        continue;
                    }
                    let mistake = ViolationKind::Constraint {
                        constraint: judge.task.describe_modal(modal),
                        why,
                        is_after: at.is_after,
                        is_exact: at.is_exact,
                        reasons,
                    };
                    first = Some((at, mistake));
                }
            }
        }
        match (first, unclear) {
            (Some((at, mistake)), _) => Err(judge.violation(&at.time, None, mistake)),
            (None, Some((time, constraint))) => Err(undecided(
                Some(time),
                UndecidedReason::CloseTimes { constraint },
            )),
            (None, None) => Ok(()),
        }
    }

    /// Returns, for each soft constraint, the violation, if there is one; `Err` if it is undecided.
    pub(super) fn soft(
        &self,
        judge: &Judge<'_>,
        end: &Rational,
    ) -> Vec<Result<Option<(Rational, String)>, Undecided>> {
        let constraints = self.constraints.soft.iter().zip(&self.soft);
        constraints
            .map(|(soft, tracks)| {
                if self.constraints.depends_on_unknown_past {
                    return Err(Undecided {
                        time: None,
                        reason: UndecidedReason::PastStates,
                    });
                }
                let mut unclear = None;
                for (modal, track) in soft.all.iter().zip(tracks) {
                    let constraint = || judge.task.describe_modal(modal);
                    match track.finding(judge.task, modal, end) {
                        Finding::Satisfied => {}
                        Finding::Violated(at, why, _) => {
                            return Ok(Some((at.time, format!("{}: {why}", constraint()))));
                        }
                        Finding::Unclear(time) => {
                            unclear = Some(Undecided {
                                time: Some(time),
                                reason: UndecidedReason::CloseTimes {
                                    constraint: constraint(),
                                },
                            });
                        }
                    }
                }
                unclear.map_or(Ok(None), Err)
            })
            .collect()
    }
}

fn undecided(time: Option<Rational>, difficulty: UndecidedReason) -> Abort {
    Abort::Undecided(Box::new(Undecided {
        time,
        reason: difficulty,
    }))
}

/// Returns the truth value. An undefined soft condition does not hold.
fn truth(
    judge: &Judge<'_>,
    read: Result<bool, Fault>,
    condition: &Condition,
    time: &Rational,
    is_hard: bool,
) -> Result<bool, Abort> {
    match read {
        Err(Fault::Undefined(_) | Fault::DivisionByZero(_)) if !is_hard => Ok(false),
        Err(fault) => Err(judge.to_abort(
            fault,
            &EvaluationContext::condition(time, None, ConditionTime::Trajectory, condition),
        )),
        Ok(truth) => Ok(truth),
    }
}

/// Returns `true` if the false condition itself is the violation of the constraint.
fn explains(modal: &Modal<Condition>) -> bool {
    matches!(
        modal,
        Modal::Always(_) | Modal::HoldDuring(..) | Modal::HoldAfter(..) | Modal::AtEnd(_)
    )
}
