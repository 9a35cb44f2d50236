//! The distance that each end of a box can move before a stored proof fails: [`ProofMargins`].

use elbowroom_num::{Delta, Rational};
use elbowroom_plan::{BoxEnd, DecoupledEnvelope};

use super::Soundness;
use super::certificate::Certificate;
use super::proof::Proof;

/// For each end of a box, the distance below which all stored proofs still hold if only this end
/// moves out.
///
/// A proof's sum increases by `factor · distance`, so the smallest quotient of a proof's margin and
/// its factor decides about all proofs at once. Otherwise a check of each end would add up every
/// proof again.
#[derive(Clone, Debug)]
pub(crate) struct ProofMargins {
    /// By parameter: the margin of its lower and its upper end; `None` if no proof uses the end.
    by_end: Vec<[Option<Rational>; 2]>,
}

impl ProofMargins {
    /// Returns `true` if all proofs hold in the box with this end moved out by `distance`. `false`
    /// decides nothing.
    pub(crate) fn allow(&self, end: BoxEnd, distance: &Rational) -> bool {
        let margin = &self.by_end[end.parameter.index()][end.side.index()];
        margin.as_ref().is_none_or(|margin| distance < margin)
    }

    /// Lowers the margins to those of a proof; `None` if it does not hold in the box.
    fn include(&mut self, proof: &Certificate, envelope: &DecoupledEnvelope) -> Option<()> {
        let value = proof.value(envelope).filter(|sum| *sum < Delta::ZERO)?;
        let margin = -value.real;
        let fixed = proof.fixed.iter().map(|end| (*end, Rational::ZERO));
        let moving = proof.ends().iter().map(|(end, factor)| {
            let quotient = if *factor == Rational::ONE {
                Some(margin.clone())
            } else {
                margin.checked_div(factor)
            };
            (*end, quotient.unwrap_or_default())
        });
        for (end, margin) in moving.chain(fixed) {
            let known = &mut self.by_end[end.parameter.index()][end.side.index()];
            if known.as_ref().is_none_or(|known| margin < *known) {
                *known = Some(margin);
            }
        }
        Some(())
    }
}

impl Soundness {
    /// Returns the margins of the stored proofs in the box; `None` unless every condition has a
    /// proof that holds in it.
    pub(crate) fn margins(&self, envelope: &DecoupledEnvelope) -> Option<ProofMargins> {
        let mut margins = ProofMargins {
            by_end: vec![[None, None]; envelope.intervals().len()],
        };
        for case in &self.direct {
            for proof in case.proofs.as_ref()? {
                margins.include(proof, envelope)?;
            }
        }
        let mut open = Vec::new();
        for proof in &self.over_all {
            open.push(proof.as_ref()?);
            while let Some(proof) = open.pop() {
                match proof {
                    Proof::NoMoment(certificate) => margins.include(certificate, envelope)?,
                    Proof::True(cases) => {
                        for certificate in cases.iter().flatten() {
                            margins.include(certificate, envelope)?;
                        }
                    }
                    Proof::Either(after, before) => open.extend([&**after, &**before]),
                }
            }
        }
        Some(margins)
    }
}

#[cfg(test)]
mod tests {
    use elbowroom_plan::{ParameterId, Side, Valuation};

    use super::*;

    /// A margin is the distance at which the sum of a proof reaches zero, exclusively.
    #[test]
    fn margin_is_smallest_quotient_over_proofs() {
        let end = BoxEnd {
            parameter: ParameterId::from(0),
            side: Side::Upper,
        };
        let valuation: Valuation = [Rational::from(3)].into_iter().collect();
        let envelope = DecoupledEnvelope::point(&valuation);
        let proof = |base: i64, factor: i64| {
            let mut proof = Certificate::default();
            proof.add_constant(&Delta::from(Rational::from(base)), &Rational::ONE);
            proof.add_end(end, &Rational::from(factor));
            proof.complete()
        };
        let mut margins = ProofMargins {
            by_end: vec![[None, None]],
        };
        // 2 · 3 - 20 leaves 14, so 7 per unit; 3 - 9 leaves 6.
        for (base, factor, largest) in [(-20, 2, 7), (-9, 1, 6)] {
            margins.include(&proof(base, factor), &envelope).unwrap();
            assert!(!margins.allow(end, &Rational::from(largest)));
            assert!(margins.allow(end, &(Rational::from(largest) - Rational::new(1, 1000))));
        }
        // The other end is in no proof.
        let other = BoxEnd {
            side: Side::Lower,
            ..end
        };
        assert!(margins.allow(other, &Rational::from(1_000_000)));
        assert_eq!(margins.include(&proof(-3, 1), &envelope), None);
    }
}
