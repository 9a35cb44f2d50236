//! What a refused box says about others.

use elbowroom_plan::DecoupledEnvelope;

use super::Oracle;
use crate::cut::{Cut, Ground};
use crate::learn::Learnt;
use crate::obligations::Refusal;

impl Oracle {
    /// Whether the box, which holds the nominal values, is inside the envelope, and if not, what
    /// that says about others that do.
    ///
    /// Takes about as long as [`objection`](Self::objection); the accepted box stays what it is.
    ///
    /// # Errors
    /// When there are too many cases to tell apart.
    pub(crate) fn learn(&mut self, envelope: &DecoupledEnvelope) -> Result<Learnt, Refusal> {
        self.checks += 1;
        self.remembers_accepted = false;
        self.proofs_hold_in_last = false;
        let is_there = self.soundness.is_some() && envelope.contains(&self.around);
        if !is_there && self.move_to(envelope)?.is_some() {
            return Ok(Learnt::Unknown);
        }
        // What a condition says about other boxes counts where all values have a schedule.
        let learnt = self.controllability.learn(&self.plan, envelope)?;
        if learnt != Learnt::Nothing {
            return Ok(learnt);
        }
        let Some(soundness) = &mut self.soundness else {
            return Ok(Learnt::Unknown);
        };
        let broken = soundness.broken(&self.task, &self.plan, envelope, None)?;
        let Some(broken) = broken else {
            self.proofs_hold_in_last = true;
            return Ok(Learnt::Nothing);
        };
        let row = soundness.row(&self.plan, &broken, envelope);
        Ok(row.map_or(Learnt::Unknown, |row| {
            Learnt::Cut(Cut {
                rows: vec![row],
                ground: Ground::Condition(broken),
            })
        }))
    }
}
