//! Checks that an answer agrees with its certificate ([`verify_answer`]), and that it is about a plan
//! ([`verify_answer_of`]).

use std::collections::BTreeMap;

use elbowroom_model::ground::FluentId;
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::{Rational, log_concave};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;

use crate::certificate::{Certificate, Chance, End as Side, Guarantee, Parameter, Reasons};
use crate::check::{InsideCheck, Verified, verify};
use crate::derive::{self, LabelText, NotDerived, Plan, Quantity};
use crate::flaw::Flaw;
use crate::given::GivenPlan;
use crate::sound::Endless;
use crate::{claim, number, probability};

/// Reason why an answer is not verified: there is nothing to check, or the answer is wrong.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnswerError {
    /// The text is not an answer of `elbowroom envelope`.
    #[error("this is not an answer of `elbowroom envelope --method best --json`: {0}")]
    Unreadable(#[from] serde_json::Error),
    /// The answer has another format, which has no certificate.
    #[error(
        "an answer of the format `{0}` has no certificate; only answers of `elbowroom envelope --method \
         best --json`, and of `elbowroom plan --json` that no plan exists, can be verified"
    )]
    OtherAnswer(String),
    /// The answer has no largest box.
    #[error(
        "the answer has no largest box, because it comes from another method, no quantity may \
         deviate, or the nominal plan fails; only answers of `elbowroom envelope --method best \
         --json`, and of `elbowroom plan --json` that no plan exists, can be verified"
    )]
    NoBox,
    /// The answer has no certificate.
    #[error(
        "the answer has no certificate: its search was stopped early, or some ends are undecided"
    )]
    NoCertificate,
    /// The check found a flaw.
    #[error(transparent)]
    Flaw(#[from] Flaw),
    /// The checker has no rule that derives the certificate from the files.
    #[error("not derivable here: {0}")]
    NotDerivable(String),
}

impl AnswerError {
    /// Returns `true` if the check found no flaw, but could not verify the answer: there is nothing
    /// to check, or the checker has no rule for it.
    pub fn is_limit(&self) -> bool {
        !matches!(self, Self::Unreadable(_) | Self::Flaw(_))
    }
}

/// The part that all answers of `elbowroom envelope` have.
#[derive(Deserialize)]
struct AnyAnswer {
    #[allow(dead_code, reason = "read so that nothing else is taken for an answer")]
    format: Format,
    best: Option<IgnoredAny>,
    #[serde(default)]
    settings: AnySettings,
}

#[derive(Default, Deserialize)]
struct AnySettings {
    epsilon: Option<Number>,
}

/// Part of an answer with a largest box that the certificate covers.
#[derive(Deserialize)]
struct Answer {
    domain: Option<String>,
    problem: Option<String>,
    settings: Settings,
    parameters: Vec<ParameterRange>,
    best: Optimum,
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
struct ParameterRange {
    name: String,
    quantity: Option<String>,
    kind: Option<String>,
    action: Option<String>,
    nominal: Number,
    weight: Number,
    lower: End,
    upper: End,
}

impl ParameterRange {
    fn label_text(&self) -> LabelText<'_> {
        LabelText {
            name: &self.name,
            kind: self.kind.as_deref(),
            action: self.action.as_deref(),
            quantity: self.quantity.as_deref(),
        }
    }
}

#[derive(Deserialize)]
struct Optimum {
    objective: Objective,
    symmetric: bool,
    most: Number,
    value: Number,
    bound: Number,
    proved: bool,
    certificate: Option<Certificate>,
    #[serde(default)]
    chances: Vec<Option<Chance>>,
    probability: Option<Probability>,
}

/// Enclosure of the probability that all parameters are inside the box.
#[derive(Deserialize)]
struct Probability {
    least: Number,
    most: Number,
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
    decimal: Option<f64>,
}

/// Returns `true` if `decimal` is the decimal form of `exact`.
fn is_near(decimal: f64, exact: &Rational) -> bool {
    let exact = exact.to_f64();
    (decimal - exact).abs() <= 4.0 * f64::EPSILON * exact.abs()
}

/// Returns `true` if each decimal in the answer matches the exact number next to it.
fn are_decimals_right(value: &Value) -> bool {
    match value {
        Value::Array(items) => items.iter().all(are_decimals_right),
        Value::Object(members) => {
            let exact = members.get("exact").and_then(Value::as_str);
            let exact = exact.and_then(|text| text.parse::<Rational>().ok());
            let decimal = members.get("decimal").and_then(Value::as_f64);
            let is_right = match (exact, decimal) {
                (Some(exact), Some(decimal)) => is_near(decimal, &exact),
                // An infinite number has no decimal.
                (None, Some(_)) => !members.contains_key("exact"),
                (_, None) => true,
            };
            is_right && members.values().all(are_decimals_right)
        }
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => true,
    }
}

/// Returns the ε of an answer, if it has one.
///
/// # Errors
/// When the text is not an answer of `elbowroom envelope`.
pub fn epsilon_of(text: &str) -> Result<Option<Rational>, AnswerError> {
    let any: AnyAnswer = serde_json::from_str(text)?;
    Ok(any.settings.epsilon.map(|epsilon| epsilon.exact))
}

/// Checks an answer as [`verify_answer`] does, and also that the certificate's network and conditions are
/// those of the problem and the plan. Nothing is assumed then.
///
/// The task needs the ε of the answer ([`epsilon_of`]).
///
/// # Errors
/// The errors of [`verify_answer`], a difference from the plan, or a feature that the checker has
/// [no rule for](AnswerError::NotDerivable).
pub fn verify_answer_of(
    text: &str,
    task: &Task,
    plan: &TimeTriggeredPlan,
) -> Result<Verified, AnswerError> {
    verify_answer_in_world(text, task, Plan::Times(plan), None)
}

/// Checks as [`verify_answer_of`] does, against a plan that is given with constraints.
///
/// # Errors
/// Those of [`verify_answer_of`].
pub fn verify_answer_of_network(
    text: &str,
    task: &Task,
    plan: &GivenPlan,
) -> Result<Verified, AnswerError> {
    verify_answer_in_world(text, task, Plan::Network(plan), None)
}

/// Distribution of the duration of an action in a world, from the action's name and its planned
/// duration; `None` if it is always the planned one. The error is the reason why a world's
/// distribution cannot be compared.
pub type Distributions<'a> =
    &'a dyn Fn(&str, &Rational) -> Result<Option<log_concave::LogConcaveDistribution>, String>;

/// Checks as [`verify_answer_of`] does. For a box of the objective `probability` it also checks that the
/// parameters are distributed as in a world; without one, this is the only assumption of the verdict.
///
/// # Errors
/// Those of [`verify_answer_of`].
pub fn verify_answer_in_world(
    text: &str,
    task: &Task,
    plan: Plan<'_>,
    world: Option<Distributions<'_>>,
) -> Result<Verified, AnswerError> {
    let mut verified = verify_answer(text)?;
    let any: AnyAnswer = serde_json::from_str(text)?;
    let answer: Answer = serde_json::from_str(text)?;
    let same = |is_same: bool, what: &str| {
        let differs = || Flaw::Files(what.to_owned());
        is_same.then_some(()).ok_or_else(differs)
    };
    let problem = task.problem();
    let is_named =
        |found: &Option<String>, name: &str| found.as_deref().is_none_or(|own| own == name);
    same(
        is_named(&answer.domain, &problem.domain),
        "the domain has another name",
    )?;
    same(
        is_named(&answer.problem, &problem.name),
        "the problem has another name",
    )?;
    let epsilon = any.settings.epsilon.map(|epsilon| epsilon.exact);
    same(
        epsilon.is_none_or(|epsilon| epsilon == *task.epsilon()),
        "it has another least separation (epsilon)",
    )?;
    let certificate = answer.best.certificate.as_ref();
    let certificate = certificate.ok_or(AnswerError::NoCertificate)?;
    let initials = match plan {
        Plan::Times(_) => initials(&answer, task)?,
        Plan::Network(_) => BTreeMap::new(),
    };
    let derived =
        derive::check(certificate, task, plan, initials).map_err(|error| match error {
            NotDerived::Flaw(flaw) => AnswerError::Flaw(flaw),
            NotDerived::Unknown(what) => AnswerError::NotDerivable(what),
        })?;
    let mut earlier = Vec::new();
    for (index, room) in answer.parameters.iter().enumerate() {
        let label = derived.labels.get(&index);
        let label = label.ok_or(Flaw::UnknownReference("parameter", index))?;
        let what = format!("{} has another meaning", room.name);
        same(label.is_denoted_by(&room.label_text(), &earlier), &what)?;
        earlier.push(room.name.as_str());
    }
    verified.assumes.clear();
    if matches!(certificate.reasons, Reasons::Probability(_)) {
        match world {
            None => verified.assumes.push(claim::DISTRIBUTED.to_owned()),
            Some(world) => distributed(certificate, &derived.quantities, world)?,
        }
    }
    verified.proves = claim::proves_all(certificate);
    verified.from_conditions = std::mem::take(&mut verified.assumed);
    verified.inside = Some(InsideCheck {
        is_controllable: true,
        conditions: Some(derived.conditions),
        assumed: 0,
    });
    Ok(verified)
}

/// Checks that each parameter is the duration of an action, distributed as in the world.
fn distributed(
    certificate: &Certificate,
    quantities: &[Quantity],
    world: Distributions<'_>,
) -> Result<(), AnswerError> {
    for (index, parameter) in certificate.parameters.iter().enumerate() {
        let mut own = quantities.iter().filter(|own| own.parameter == index);
        let action = match (own.next(), own.next()) {
            (Some(own), None) if own.kind == "duration" => own.action.as_ref(),
            _ => None,
        };
        let what = || {
            format!(
                "the distribution of {}, which is not a duration",
                parameter.name
            )
        };
        let action = action.ok_or_else(|| AnswerError::NotDerivable(what()))?;
        let chance = world(action, &parameter.nominal).map_err(AnswerError::NotDerivable)?;
        if parameter.chance != chance.as_ref().map(Chance::from) {
            let what = format!("the world has another distribution for the duration of {action}");
            return Err(Flaw::Files(what).into());
        }
    }
    Ok(())
}

/// Returns the parameters that are initial values, by fluent.
fn initials(answer: &Answer, task: &Task) -> Result<BTreeMap<FluentId, usize>, AnswerError> {
    let mut initials = BTreeMap::new();
    for (parameter, room) in answer.parameters.iter().enumerate() {
        match room.kind.as_deref() {
            None | Some("duration" | "timed") => {}
            Some("initial") => {
                let quantity = room.quantity.as_deref().unwrap_or_default();
                let mut fluents = task.initial().values.keys();
                let fluent =
                    fluents.find(|own| quantity == format!("initial {}", task.fluent_name(**own)));
                let what = || Flaw::Files(format!("{} is not an initial value", room.name));
                let known = initials.insert(*fluent.ok_or_else(what)?, parameter);
                known.map_or(Ok(()), |_| Err(what()))?;
            }
            Some(kind) => {
                let what = format!("{}, a parameter of the kind `{kind}`", room.name);
                return Err(AnswerError::NotDerivable(what));
            }
        }
    }
    Ok(initials)
}

/// Checks the certificate of an answer, and that the answer agrees with it.
///
/// # Errors
/// The text is not such an answer, or the first flaw.
pub fn verify_answer(text: &str) -> Result<Verified, AnswerError> {
    let whole: Value = serde_json::from_str(text)?;
    let format = whole.get("format").and_then(Value::as_str);
    let other = format.filter(|own| own.starts_with("elbowroom-") && *own != "elbowroom-envelope");
    if let Some(other) = other {
        return Err(AnswerError::OtherAnswer(other.to_owned()));
    }
    let any: AnyAnswer = serde_json::from_str(text)?;
    any.best.ok_or(AnswerError::NoBox)?;
    let answer: Answer = serde_json::from_str(text)?;
    check_equal(
        whole.get("version") == Some(&Value::from(1)),
        "the version, which is 1,",
    )?;
    check_equal(are_decimals_right(&whole), "a decimal and its exact number")?;
    let best = &answer.best;
    let certificate = best.certificate.as_ref();
    let certificate = certificate.ok_or(AnswerError::NoCertificate)?;
    let verified = verify(certificate)?;
    let objective = match certificate.reasons {
        Reasons::LeastSlack(_) => Objective::LeastSlack,
        Reasons::Widths(_) => Objective::Widths,
        Reasons::Volume { .. } => Objective::Volume,
        Reasons::Probability(_) => Objective::Probability,
    };
    check_equal(best.objective == objective, "the objective")?;
    check_equal(best.most.exact == certificate.counted, "how far ends count")?;
    check_equal(best.symmetric == certificate.symmetric, "`symmetric`")?;
    check_equal(
        answer.settings.guarantee == certificate.guarantee,
        "the guarantee",
    )?;
    check_equal(best.value.exact == verified.value, "the value")?;
    check_equal(best.bound.exact == verified.bound, "the bound")?;
    check_equal(
        best.proved == (verified.bound <= &verified.value + &verified.tolerance),
        "whether the box is proved to be the best",
    )?;
    check_equal(
        answer.parameters.len() == certificate.parameters.len(),
        "the number of parameters",
    )?;
    let chances = certificate.parameters.iter().map(|own| &own.chance);
    let is_told = best.chances.iter().eq(chances.clone());
    check_equal(
        is_told || (best.chances.is_empty() && chances.flatten().next().is_none()),
        "the distributions",
    )?;
    let parameters = answer.parameters.iter().zip(&certificate.parameters);
    for (index, (room, own)) in parameters.enumerate() {
        check_interval(&answer, certificate, (index, room, own))?;
    }
    check_equal(
        is_probability_consistent(&answer, certificate, &verified.bound),
        "the probability",
    )?;
    Ok(verified)
}

/// Returns `true` if the answer's probability matches the enclosure that the certificate's
/// distributions give for its box, with the certificate's intervals. An answer for another
/// objective must not have a probability.
fn is_probability_consistent(answer: &Answer, certificate: &Certificate, bound: &Rational) -> bool {
    let Some(told) = &answer.best.probability else {
        return answer.best.objective != Objective::Probability;
    };
    let ends = answer.parameters.iter();
    let ends = ends.map(|room| [&room.lower, &room.upper].map(|end| end.exact.parse().ok()));
    let own = probability::enclosure(certificate, ends, bound);
    answer.best.objective == Objective::Probability
        && own.is_some_and(|own| own == [told.least.exact.clone(), told.most.exact.clone()])
}

/// Checks that the interval of a parameter in the answer is the certificate's.
fn check_interval(
    answer: &Answer,
    certificate: &Certificate,
    (index, room, own): (usize, &ParameterRange, &Parameter),
) -> Result<(), Flaw> {
    check_equal(
        room.name == own.name && room.nominal.exact == own.nominal,
        &format!("parameter {index}"),
    )?;
    check_equal(
        room.weight.exact == own.weight,
        &format!("the weight of {}", own.name),
    )?;
    let size = own.nominal.abs();
    check_equal(
        size.is_zero() || own.scale == size,
        &format!("the scale of {}", own.name),
    )?;
    let counted = &own.scale * &answer.best.most.exact;
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
        let is_that = end.exact.parse::<Rational>().is_ok_and(|own| {
            own == value && end.decimal.is_none_or(|decimal| is_near(decimal, &value))
        });
        // An end is infinite if it is as far out as deviations are counted and no proof limits it.
        let is_endless = end.exact == endless && *slack == counted && !certificate.symmetric;
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
        check_equal(
            is_end && most.as_ref().is_none_or(|most| most.0 <= counted),
            &format!("the interval of {}", own.name),
        )?;
    }
    Ok(())
}

/// Returns an error that names `what`, unless answer and certificate agree on it.
fn check_equal(is_same: bool, what: &str) -> Result<(), Flaw> {
    let differs = || Flaw::Differs(what.to_owned());
    is_same.then_some(()).ok_or_else(differs)
}
