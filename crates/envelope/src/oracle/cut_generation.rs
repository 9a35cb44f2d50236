//! Derivation of cuts from rejected boxes.

use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope};

use super::{CheckScope, Oracle};
use crate::cut::{Cut, Ground};
use crate::cut_generation::CheckOutcome;
use crate::cut_pool::CutPool;
use crate::objection::Objection;
use crate::obligations::Refusal;
use crate::row::Row;

impl Oracle {
    /// Checks a box that contains the nominal values. If it is not inside the envelope, returns at
    /// most `most` cuts, which apply to all boxes that contain the nominal values.
    ///
    /// Takes about as long as [`objection`](Self::objection); the accepted box does not change.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub(crate) fn check_with_cuts(
        &mut self,
        envelope: &DecoupledEnvelope,
        most: usize,
    ) -> Result<CheckOutcome, Refusal> {
        self.checks += 1;
        self.has_accepted_proofs = false;
        self.proofs_hold_in_last = false;
        let is_there = self.scope == CheckScope::TimesOnly
            || self.soundness.is_some() && envelope.contains(&self.order_values);
        if !is_there && self.move_to(envelope)?.is_some() {
            return Ok(CheckOutcome::Unknown);
        }
        // The cut of a condition is only valid if all values have a schedule.
        let learnt = self
            .controllability
            .generate_cuts(&self.plan, envelope, most)?;
        if learnt != CheckOutcome::Accepted || self.scope == CheckScope::TimesOnly {
            self.proofs_hold_in_last = learnt == CheckOutcome::Accepted;
            return Ok(learnt);
        }
        let Some(soundness) = &mut self.soundness else {
            return Ok(CheckOutcome::Unknown);
        };
        let broken = soundness.all_broken(&self.task, &self.plan, envelope, None, most)?;
        if broken.is_empty() {
            self.proofs_hold_in_last = true;
            return Ok(CheckOutcome::Accepted);
        }
        let rows = soundness.rows(&self.plan, &broken, envelope);
        let cuts = broken.into_iter().zip(rows).filter_map(|(broken, row)| {
            Some(Cut {
                rows: vec![row?],
                ground: Ground::Condition(broken),
            })
        });
        let cuts: Vec<Cut> = cuts.collect();
        if cuts.is_empty() {
            return Ok(CheckOutcome::Unknown);
        }
        Ok(CheckOutcome::Cuts(cuts))
    }

    /// Makes a box that includes the accepted one the accepted box, if it is inside the envelope;
    /// otherwise returns cuts. Not counted as a check.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub(crate) fn accept_or_cuts(
        &mut self,
        envelope: &DecoupledEnvelope,
    ) -> Result<CheckOutcome, Refusal> {
        let checks = self.checks;
        let learnt = self.widen_or_cuts(envelope);
        self.checks = checks;
        learnt
    }

    fn widen_or_cuts(&mut self, envelope: &DecoupledEnvelope) -> Result<CheckOutcome, Refusal> {
        // The stored proofs of the accepted box make it cheap to move one end.
        if self.has_accepted_proofs
            && let Some(end) = self.only_end(envelope)
            && self.widen(end, end.reach(envelope))?.is_none()
        {
            return Ok(CheckOutcome::Accepted);
        }
        let learnt = self.check_with_cuts(envelope, usize::MAX)?;
        if learnt == CheckOutcome::Accepted {
            self.accepted = Some(envelope.clone());
            self.has_accepted_proofs = true;
        }
        Ok(learnt)
    }

    /// Returns the end that differs from the accepted box, if there is exactly one.
    fn only_end(&self, envelope: &DecoupledEnvelope) -> Option<BoxEnd> {
        let accepted = self.accepted.as_ref()?;
        let count = envelope.intervals().len();
        let mut ends = BoxEnd::all(count).filter(|end| {
            let (old, new) = (
                accepted.interval(end.parameter),
                envelope.interval(end.parameter),
            );
            end.side.of(old) != end.side.of(new)
        });
        let end = ends.next()?;
        ends.next().is_none().then_some(end)
    }

    /// Returns `true` if every box with this end at that reach is outside the envelope, judging by
    /// the end alone. `None` is infinitely far.
    pub(crate) fn is_too_far(&self, end: BoxEnd, reach: Option<&Rational>) -> bool {
        self.controllability.is_too_far(end, reach)
    }

    /// Returns `true` if checking a box that is far too wide takes no longer than checking a narrow
    /// one.
    pub(crate) fn is_wide_check_cheap(&self) -> bool {
        self.scope == CheckScope::TimesOnly
    }

    /// Replaces the accepted box by a box inside it.
    pub(crate) fn shrink_accepted(&mut self, envelope: &DecoupledEnvelope) {
        self.has_accepted_proofs &= self.accepted.as_ref() == Some(envelope);
        self.accepted = Some(envelope.clone());
    }

    /// Sets the number of checks, which includes boxes whose outcome was known already.
    pub(crate) fn count_checks(&mut self, checks: usize) {
        self.checks = checks;
    }

    /// Stores the reasons that a search has found.
    pub(crate) fn store_cuts(&mut self, known: CutPool) {
        self.cut_pool = known;
    }

    /// Like [`objection`](Self::objection), for a box with one end moved out. If a reason found by
    /// an earlier search rejects that box as well, it is reused.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub fn objection_to_widening(
        &mut self,
        envelope: &DecoupledEnvelope,
        end: BoxEnd,
        reach: Option<Rational>,
    ) -> Result<Option<Objection>, Refusal> {
        if envelope.contains(&self.order_values)
            && let (Some(from), Some(to)) = (end.reach(envelope), &reach)
        {
            self.cut_pool.set_current_box(envelope);
            if let Some(objection) = self.known_objection(envelope, (end, &from, to)) {
                self.checks += 1;
                return Ok(Some(objection));
            }
        }
        let candidate = end.with_reach(envelope, reach);
        let Some(accepted) = self.accepted.take_if(|accepted| accepted == envelope) else {
            return self.objection(&candidate);
        };
        // The stored proofs of the accepted box make it cheap to move one end.
        let reason = self.check_widened(&accepted, &candidate, end);
        self.has_accepted_proofs &= !matches!(reason, Ok(None));
        let widened = self.has_accepted_proofs.then_some((&accepted, end));
        let objection =
            reason.map(|reason| reason.map(|it| self.objection_of(&candidate, it, widened)));
        self.accepted = Some(accepted);
        objection
    }

    /// Makes a box the accepted one, if it is inside the envelope, in preparation of many queries
    /// with one end further out. Not counted as a check.
    pub(crate) fn accept_if_inside(&mut self, envelope: &DecoupledEnvelope) {
        let checks = self.checks;
        self.has_accepted_proofs = matches!(self.check_from_scratch(envelope), Ok(None));
        self.checks = checks;
        if self.has_accepted_proofs {
            self.accepted = Some(envelope.clone());
        }
    }

    /// Returns the known objection of a row to a box with one end moved out; `None` if none is
    /// stored and it has to be computed.
    pub(super) fn objection_of_row(
        &self,
        (row, ground): (&Row, &Ground),
        envelope: &DecoupledEnvelope,
        (moved, reach): (BoxEnd, &Rational),
    ) -> Option<Objection> {
        match ground {
            Ground::Condition(broken) => Some(Objection::Broken(broken.clone())),
            // The row contains one end of each parameter, and there is no schedule at these ends.
            Ground::Cycle(_) | Ground::Semireducible(_) => {
                let mut values = envelope.nearest(&self.plan.nominal());
                for end in row.factors.keys() {
                    values[end.parameter] = if end == moved {
                        end.side.value_at_reach(reach)
                    } else {
                        let interval = envelope.interval(end.parameter);
                        end.side.of(interval).value()?.clone()
                    };
                }
                Some(Objection::NoSchedule(values))
            }
            Ground::Fixed(_) | Ground::Box(_) => None,
        }
    }
}
