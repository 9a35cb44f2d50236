//! That an answer says what its certificate proves: [`verify_answer`].

use elbowroom_num::Rational;
use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::certificate::{Certificate, Chance, End as Side, Guarantee, Reasons};
use crate::check::{Verified, verify};
use crate::flaw::Flaw;
use crate::number;
use crate::sound::Endless;

/// Why nothing can be said of an answer, or what is wrong with it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnswerError {
    /// It is no answer with a largest box.
    #[error("this is no answer of `elbowroom envelope --method best --json`: {0}")]
    Unreadable(#[from] serde_json::Error),
    /// It is about no largest box.
    #[error(
        "the answer has no largest box: it was made by another method, nothing may deviate, or the \
         plan does not work as planned"
    )]
    NoBox,
    /// It has no certificate.
    #[error(
        "the answer has no certificate: its search was ended before it was done, or some ends could \
         not be told"
    )]
    NoCertificate,
    /// Something in it is not so.
    #[error(transparent)]
    Flaw(#[from] Flaw),
}

/// The part that all answers of `elbowroom envelope` have.
#[derive(Deserialize)]
struct AnyAnswer {
    #[allow(dead_code, reason = "read so that nothing else is taken for an answer")]
    format: Format,
    best: Option<IgnoredAny>,
}

/// The part of an answer with a largest box that the certificate is about.
#[derive(Deserialize)]
struct Answer {
    settings: Settings,
    parameters: Vec<Room>,
    best: Best,
}

#[derive(Deserialize)]
enum Format {
    #[serde(rename = "elbowroom-envelope")]
    Envelope,
}

#[derive(Deserialize)]
struct Settings {
    guarantee: Guarantee,
}

#[derive(Deserialize)]
struct Room {
    name: String,
    nominal: Number,
    weight: Number,
    lower: End,
    upper: End,
}

#[derive(Deserialize)]
struct Best {
    objective: Objective,
    symmetric: bool,
    most: Number,
    value: Number,
    bound: Number,
    proved: bool,
    certificate: Option<Certificate>,
    #[serde(default)]
    chances: Vec<Option<Chance>>,
}

#[derive(Clone, Copy, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
enum Objective {
    LeastSlack,
    Widths,
    Volume,
    Probability,
}

#[derive(Deserialize)]
struct Number {
    #[serde(with = "number")]
    exact: Rational,
}

#[derive(Deserialize)]
struct End {
    exact: String,
}

/// Checks the certificate of an answer, and that the answer says what it proves.
///
/// # Errors
/// When the text is no such answer, or the first thing in it that is not so.
pub fn verify_answer(text: &str) -> Result<Verified, AnswerError> {
    let any: AnyAnswer = serde_json::from_str(text)?;
    any.best.ok_or(AnswerError::NoBox)?;
    let answer: Answer = serde_json::from_str(text)?;
    let best = &answer.best;
    let certificate = best.certificate.as_ref();
    let certificate = certificate.ok_or(AnswerError::NoCertificate)?;
    let verified = verify(certificate)?;
    let same = |is_same: bool, what: &str| {
        let differs = || Flaw::Differs(what.to_owned());
        is_same.then_some(()).ok_or_else(differs)
    };
    let objective = match certificate.reasons {
        Reasons::LeastSlack(_) => Objective::LeastSlack,
        Reasons::Widths(_) => Objective::Widths,
        Reasons::Volume { .. } => Objective::Volume,
        Reasons::Probability(_) => Objective::Probability,
    };
    same(best.objective == objective, "the objective")?;
    same(best.most.exact == certificate.counted, "how far ends count")?;
    same(best.symmetric == certificate.symmetric, "`symmetric`")?;
    same(
        answer.settings.guarantee == certificate.guarantee,
        "the guarantee",
    )?;
    same(best.value.exact == verified.value, "the value")?;
    same(best.bound.exact == verified.bound, "the bound")?;
    same(
        best.proved == (verified.bound <= &verified.value + &verified.tolerance),
        "whether the box is proved to be the best",
    )?;
    same(
        answer.parameters.len() == certificate.parameters.len(),
        "the number of parameters",
    )?;
    let chances = certificate.parameters.iter().map(|own| &own.chance);
    let is_told = best.chances.iter().eq(chances.clone());
    same(
        is_told || (best.chances.is_empty() && chances.flatten().next().is_none()),
        "the distributions",
    )?;
    for (index, (room, own)) in answer
        .parameters
        .iter()
        .zip(&certificate.parameters)
        .enumerate()
    {
        same(
            room.name == own.name && room.nominal.exact == own.nominal,
            &format!("parameter {index}"),
        )?;
        same(
            room.weight.exact == own.weight,
            &format!("the weight of {}", own.name),
        )?;
        let size = own.nominal.abs();
        same(
            size.is_zero() || own.scale == size,
            &format!("the scale of {}", own.name),
        )?;
        let counted = &own.scale * &best.most.exact;
        let slack = |side: usize| {
            let variable = if certificate.symmetric {
                index
            } else {
                2 * index + side
            };
            &certificate.slacks[variable].0
        };
        let lower = &own.nominal - slack(0);
        let upper = &own.nominal + slack(1);
        let sides = [
            (&room.lower, Side::Lower, lower, slack(0), &own.most_below),
            (&room.upper, Side::Upper, upper, slack(1), &own.most_above),
        ];
        for (end, which, value, slack, most) in sides {
            let endless = match which {
                Side::Lower => "-inf",
                Side::Upper => "inf",
            };
            let is_that = end.exact.parse::<Rational>().is_ok_and(|end| end == value);
            // What reaches as far as counts, and is stopped by nothing, is infinite.
            let is_endless = end.exact == endless && *slack == counted;
            let is_end = match &certificate.sound {
                None => is_that || is_endless,
                Some(sound)
                    if sound.endless.contains(&Endless {
                        parameter: index,
                        end: which,
                    }) =>
                {
                    is_endless
                }
                Some(_) => is_that,
            };
            same(
                is_end && most.as_ref().is_none_or(|most| most.0 <= counted),
                &format!("the interval of {}", own.name),
            )?;
        }
    }
    Ok(verified)
}
