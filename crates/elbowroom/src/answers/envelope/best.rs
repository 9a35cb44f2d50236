//! The largest box, and how good it is.

use elbowroom_envelope::{BestRun, BestSettings, NEVER, Objective, Oracle, Reasons};
use elbowroom_num::{End, Rational, enclosed};
use elbowroom_verify::{Certificate, Chance};
use serde::{Deserialize, Serialize};

use super::Subject;
use super::certificate::certificate;
use super::worth::{Worth, worths};
use crate::answers::exact;

/// The objective of a box, and how much better another box could be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Best {
    /// The objective.
    pub objective: Objective,
    /// Whether both ends of an interval had to be equally far from the nominal value.
    pub symmetric: bool,
    /// Ends counted up to a deviation of so many times the nominal value.
    #[serde(with = "exact")]
    pub most: Rational,
    /// The value of the objective: the least deviation, as a share of the nominal value, or the sum
    /// of widths.
    #[serde(with = "exact")]
    pub value: Rational,
    /// An upper bound on the objective of all boxes.
    #[serde(with = "exact")]
    pub bound: Rational,
    /// Whether it is proved that there is no better box.
    #[serde(rename = "proved")]
    pub is_proved: bool,
    /// Why the box is inside the envelope, and no box has more than `bound`, for [`elbowroom_verify`] to
    /// check; `None` if the search
    /// was ended before it was done, or if that could not be told of all ends.
    ///
    /// In a browser it is written and not read: answers are read there to be drawn, and what reads
    /// certificates would be a thirtieth of the module.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(target_family = "wasm", serde(skip_deserializing))]
    pub certificate: Option<Certificate>,
    /// How likely all durations stay inside, if that is the objective.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probability: Option<Probability>,
    /// With that, how each parameter is distributed; `None` for one that always is as planned.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub chances: Vec<Option<Chance>>,
    /// What it would be worth to relax bounds of the plan, the most first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub worth: Vec<Worth>,
}

/// How likely all durations stay inside a box, as a simulation rounds them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Probability {
    /// For the box of the answer: at least this, rounded down to a billionth.
    #[serde(with = "exact")]
    pub least: Rational,
    /// For all boxes: at most this, rounded up to a billionth.
    #[serde(with = "exact")]
    pub most: Rational,
}

impl Probability {
    fn new(subject: &Subject<'_>, settings: &BestSettings, run: &BestRun) -> Self {
        /// Longer than anything lasts, for ends that are infinite.
        const EVER: i64 = 1_000_000_000_000;
        let resolution = subject.request.world.as_ref();
        let resolution = resolution.map_or(Rational::ONE, |world| world.resolution.clone());
        let mut least = Rational::ONE;
        if let Ok(envelope) = &run.envelope {
            for (interval, chance) in envelope.intervals().iter().zip(&settings.chances) {
                let Some(chance) = chance else { continue };
                let end = |end: &End, sign| {
                    end.value()
                        .cloned()
                        .unwrap_or_else(|| Rational::from(sign * EVER))
                };
                let ends = [end(&interval.lower, -1), end(&interval.upper, 1)];
                least *= &chance.inside([&ends[0], &ends[1]], &resolution);
                least = enclosed::billionths_below(&least);
            }
        } else {
            least = Rational::ZERO;
        }
        let most = if run.bound <= Rational::from(NEVER) {
            Rational::ZERO
        } else {
            let [_, most] = enclosed::exp_of_minus(&(-&run.bound).max(Rational::ZERO));
            enclosed::billionths_above(&most).min(Rational::ONE)
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
    // Where no box has any probability, there are no logarithms to prove anything of.
    let is_possible =
        settings.objective != Objective::Probability || run.bound > Rational::from(NEVER);
    let has_certificate = is_possible
        && !run.is_cancelled
        && (run.is_proved || matches!(run.proof.reasons, Reasons::Tree(_)));
    let certificate = match &run.envelope {
        Ok(envelope) if has_certificate => {
            certificate(subject, settings, &run.proof, (oracle, envelope))
        }
        _ => None,
    };
    Best {
        worth: if run.is_proved {
            worths(subject, &run.proof)
        } else {
            Vec::new()
        },
        certificate,
        probability: (settings.objective == Objective::Probability)
            .then(|| Probability::new(subject, settings, &run)),
        chances: settings
            .chances
            .iter()
            .map(|own| own.as_ref().map(Into::into))
            .collect(),
        objective: settings.objective,
        symmetric: settings.symmetric,
        most: settings.most.clone(),
        value: run.value,
        bound: run.bound,
        is_proved: run.is_proved,
    }
}
