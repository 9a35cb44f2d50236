//! The largest box, and its objective.

use elbowroom_envelope::{BestRun, BestSettings, LOG_OF_ZERO, Objective, OptimalityProof, Oracle};
use elbowroom_num::{End, Rational, enclosures};
use elbowroom_verify::{Certificate, Chance};
use serde::{Deserialize, Serialize};

use super::Subject;
use super::certificate::certificate;
use super::shadow_prices::{ShadowPrices, shadow_prices};
use crate::answers::exact;

/// The objective of a box, and a bound on that of all other boxes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Best {
    /// The objective.
    pub objective: Objective,
    /// `true` if both ends of an interval had to be equally far from the nominal value.
    pub symmetric: bool,
    /// Cap on the deviations of ends, as a multiple of the nominal value.
    #[serde(with = "exact")]
    pub most: Rational,
    /// The value of the objective: the least deviation, as a share of the nominal value, or the sum
    /// of widths.
    #[serde(with = "exact")]
    pub value: Rational,
    /// An upper bound on the objective of all boxes.
    #[serde(with = "exact")]
    pub bound: Rational,
    /// `true` if it is proved that there is no better box.
    #[serde(rename = "proved")]
    pub is_proved: bool,
    /// Proof that the box is inside the envelope and that no box exceeds `bound`, in the form that
    /// [`elbowroom_verify`] checks. `None` if the search was interrupted, or if some end is
    /// undecided.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub certificate: Option<Certificate>,
    /// Probability that all durations stay inside, if that is the objective.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probability: Option<Probability>,
    /// For that objective, the distribution of each parameter; `None` for a parameter that is
    /// always as planned.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub chances: Vec<Option<Chance>>,
    /// Gains from relaxing bounds of the plan, largest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub worth: Vec<ShadowPrices>,
}

/// Probability that all durations, rounded as in a simulation, stay inside a box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Probability {
    /// Lower bound for the box of the answer, rounded down to a billionth.
    #[serde(with = "exact")]
    pub least: Rational,
    /// Upper bound for all boxes, rounded up to a billionth.
    #[serde(with = "exact")]
    pub most: Rational,
}

impl Probability {
    fn new(subject: &Subject<'_>, settings: &BestSettings, run: &BestRun) -> Self {
        /// Replacement for infinite ends, beyond any duration.
        const INFINITY_SUBSTITUTE: i64 = 1_000_000_000_000;
        let resolution = subject.request.world.as_ref();
        let resolution = resolution.map_or(Rational::ONE, |world| world.resolution.clone());
        let mut least = Rational::ONE;
        if let Ok(envelope) = &run.envelope {
            for (interval, chance) in envelope.intervals().iter().zip(&settings.distributions) {
                let Some(chance) = chance else { continue };
                let end = |end: &End, sign| {
                    end.value()
                        .cloned()
                        .unwrap_or_else(|| Rational::from(sign * INFINITY_SUBSTITUTE))
                };
                let ends = [end(&interval.lower, -1), end(&interval.upper, 1)];
                least *= &chance.probability_inside([&ends[0], &ends[1]], &resolution);
                least = enclosures::floor_to_billionth(&least);
            }
        } else {
            least = Rational::ZERO;
        }
        let most = if run.bound <= Rational::from(LOG_OF_ZERO) {
            Rational::ZERO
        } else {
            let [_, most] = enclosures::exp_of_minus(&(-&run.bound).max(Rational::ZERO));
            enclosures::ceil_to_billionth(&most).min(Rational::ONE)
        };
        Self { least, most }
    }
}

/// Returns the objective of the best box, with its proof.
pub(super) fn best(
    subject: &Subject<'_>,
    oracle: &mut Oracle,
    settings: &BestSettings,
    run: BestRun,
) -> Best {
    // If no box has a positive probability, there are no logarithms to prove anything about.
    let is_possible =
        settings.objective != Objective::Probability || run.bound > Rational::from(LOG_OF_ZERO);
    let has_certificate = is_possible
        && !run.is_cancelled
        && (run.is_proved || matches!(run.proof.reasons, OptimalityProof::Tree(_)));
    let certificate = match &run.envelope {
        Ok(envelope) if has_certificate => {
            certificate(subject, settings, &run.proof, (oracle, envelope))
        }
        _ => None,
    };
    Best {
        worth: if run.is_proved {
            shadow_prices(subject, &run.proof)
        } else {
            Vec::new()
        },
        certificate,
        probability: (settings.objective == Objective::Probability)
            .then(|| Probability::new(subject, settings, &run)),
        chances: settings
            .distributions
            .iter()
            .map(|own| own.as_ref().map(Into::into))
            .collect(),
        objective: settings.objective,
        symmetric: settings.symmetric,
        most: settings.max_deviation.clone(),
        value: run.value,
        bound: run.bound,
        is_proved: run.is_proved,
    }
}
