//! Queries about a box with one end moved out that do not change the stored proofs: [`Probe`].

use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope};

use super::{CheckScope, Oracle};
use crate::objection::Objection;
use crate::obligations::Refusal;
use crate::soundness::ProofMargins;

/// State for many queries about one accepted box of an oracle.
///
/// A check that accepts a wider box replaces the proofs by those of that box. The next check of
/// another end would then have to compute those of the accepted box again. A probe keeps them. The
/// oracle must not be used for other queries while a probe is in use.
#[derive(Debug)]
pub(crate) struct Probe {
    /// The accepted box.
    envelope: DecoupledEnvelope,
    /// Margins of the proofs of the conditions; `None` if only the times are checked.
    margins: Option<ProofMargins>,
    /// `true` if known rows of earlier searches decide about boxes that contain the accepted one.
    knows_rows: bool,
}

impl Oracle {
    /// Makes a box the accepted one, and prepares queries about it; `None` if it is not inside the
    /// envelope. Not counted as a check.
    pub(crate) fn probe(&mut self, envelope: &DecoupledEnvelope) -> Option<Probe> {
        self.accept_if_inside(envelope);
        if !self.has_accepted_proofs || !self.controllability.is_about(envelope) {
            return None;
        }
        let margins = match self.scope {
            CheckScope::All => Some(self.soundness.as_ref()?.margins(envelope)?),
            CheckScope::TimesOnly => None,
        };
        let knows_rows = envelope.contains(&self.order_values);
        if knows_rows {
            self.cut_pool.set_current_box(envelope);
        }
        Some(Probe {
            envelope: envelope.clone(),
            margins,
            knows_rows,
        })
    }
}

impl Probe {
    /// Returns the objection to the box with an end moved out from `from` to `to`; `None` if that
    /// box is inside the envelope. If a reason found by an earlier search rejects it, that reason
    /// is used.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub(crate) fn objection(
        &mut self,
        oracle: &mut Oracle,
        (end, from, to): (BoxEnd, &Rational, &Rational),
    ) -> Result<Option<Objection>, Refusal> {
        oracle.checks += 1;
        if self.knows_rows
            && let Some(objection) = oracle.known_objection(&self.envelope, (end, from, to))
        {
            return Ok(Some(objection));
        }
        let margins = self.margins.as_ref();
        let proofs_hold = margins.is_none_or(|it| it.allow(end, &(to - from)));
        self.envelope.set_reach(end, Some(to.clone()));
        let objection = oracle.objection_to_moved(&self.envelope, end, proofs_hold);
        self.envelope.set_reach(end, Some(from.clone()));
        objection
    }
}

impl Oracle {
    /// Returns the objection of a known row to `envelope` with an end moved out; `envelope` is the
    /// current box of the pool.
    pub(super) fn known_objection(
        &self,
        envelope: &DecoupledEnvelope,
        (end, from, to): (BoxEnd, &Rational, &Rational),
    ) -> Option<Objection> {
        let rows = self.cut_pool.refusing_rows(end, from, Some(to));
        let ([row], Some(ground)) = rows? else {
            return None;
        };
        self.objection_of_row((row, ground), envelope, (end, to))
    }

    /// Returns the objection to the accepted box with `end` moved out, which is `candidate`. Stored
    /// proofs do not change. `proofs_hold` states that those of the conditions hold in it.
    fn objection_to_moved(
        &mut self,
        candidate: &DecoupledEnvelope,
        end: BoxEnd,
        proofs_hold: bool,
    ) -> Result<Option<Objection>, Refusal> {
        if !proofs_hold
            && let Some(soundness) = &mut self.soundness
            && let Some(broken) =
                soundness.broken_if_moved(&self.task, &self.plan, candidate, end)?
        {
            return Ok(Some(Objection::Broken(broken)));
        }
        let Some(found) = self.controllability.refuses_if_moved(candidate, end)? else {
            return Ok(None);
        };
        self.without_schedule += 1;
        let accepted = self.accepted.as_ref().map(|accepted| (accepted, end));
        let objection = self.controllability.objection(candidate, found, accepted);
        Ok(Some(objection))
    }
}
