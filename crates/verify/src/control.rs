//! Check that all points can be scheduled, as the guarantee requires: [`check`].

mod rules;
mod strategy;
mod times;

use crate::certificate::{Certificate, Guarantee};
use crate::flaw::Flaw;
use crate::intervals::Intervals;
use crate::sound::Control;

/// Checks the proof.
///
/// # Errors
/// The first flaw.
pub(crate) fn check(
    certificate: &Certificate,
    intervals: &Intervals,
    control: &Control,
) -> Result<(), Flaw> {
    match (control, certificate.guarantee) {
        (Control::Assumed, _) => Ok(()),
        (Control::Times(told), Guarantee::Strong) => times::check(certificate, intervals, told),
        (Control::Schedules(cases), Guarantee::Weak) => rules::check(certificate, intervals, cases),
        (Control::Strategy(strategy), Guarantee::Dynamic) => {
            strategy::check(certificate, intervals, strategy)
        }
        _ => Err(Flaw::WrongGuarantee),
    }
}
