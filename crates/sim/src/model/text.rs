//! Reading world files.

use std::ops::Range;

use elbowroom_model::Problem;
use elbowroom_num::Rational;
use serde::Deserialize;
use toml::Spanned;

use super::{
    Amount, Exogenous, ExogenousChange, Failing, Failure, Reports, Rule, WorldFileError, WorldModel,
};
use crate::draw::Distribution;
use crate::pattern::{ActionPattern, Names};

/// The file as it stands.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: Spanned<String>,
    version: Spanned<i64>,
    resolution: Option<Spanned<f64>>,
    #[serde(default)]
    duration: Vec<Spanned<Section>>,
    #[serde(default)]
    delay: Vec<Spanned<Section>>,
    #[serde(default)]
    amount: Vec<Spanned<Section>>,
    #[serde(default)]
    failure: Vec<Spanned<Section>>,
    #[serde(default)]
    event: Vec<Spanned<Section>>,
    reports: Option<Spanned<Section>>,
}

/// Whatever can stand in one section; which of it may, depends on the section.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Section {
    action: Option<Spanned<String>>,
    fluent: Option<Spanned<String>>,
    fact: Option<Spanned<String>>,
    becomes: Option<Spanned<Becomes>>,
    probability: Option<Spanned<f64>>,
    when: Option<Spanned<String>>,
    reported: Option<bool>,
    constant: Option<Spanned<f64>>,
    normal: Option<Spanned<Shape>>,
    lognormal: Option<Spanned<Shape>>,
    uniform: Option<Spanned<Shape>>,
    triangular: Option<Spanned<Shape>>,
    values: Option<Spanned<Vec<f64>>>,
    minimum: Option<f64>,
    maximum: Option<f64>,
    relative: Option<bool>,
    lost: Option<Spanned<f64>>,
    duplicated: Option<Spanned<f64>>,
    late: Option<Spanned<f64>>,
    contradicted: Option<Spanned<f64>>,
}

/// The numbers of a distribution.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Shape {
    mean: Option<f64>,
    deviation: Option<f64>,
    from: Option<f64>,
    to: Option<f64>,
    mode: Option<f64>,
    minimum: Option<f64>,
    maximum: Option<f64>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Becomes {
    Truth(bool),
    Value(f64),
}

/// A distribution where it stands, with its minimum and maximum.
type Found = (Range<usize>, Distribution, Option<f64>, Option<f64>);

/// The text, to find lines in.
struct Reader<'a> {
    text: &'a str,
    problem: &'a Problem,
}

type Read<T> = Result<T, WorldFileError>;

pub(super) fn read(text: &str, problem: &Problem) -> Read<WorldModel> {
    let reader = Reader { text, problem };
    let file: File = toml::from_str(text)
        .map_err(|error| reader.wrong(&error.span().unwrap_or(0..0), error.message()))?;
    if file.format.get_ref() != "elbowroom-world" {
        return Err(reader.wrong(&file.format.span(), "write format = \"elbowroom-world\""));
    }
    if *file.version.get_ref() != 1 {
        return Err(reader.wrong(&file.version.span(), "this program reads version 1"));
    }
    let mut model = WorldModel::as_planned();
    if let Some(resolution) = &file.resolution {
        let value = exact(*resolution.get_ref());
        model.resolution = value
            .filter(Rational::is_positive)
            .ok_or_else(|| reader.wrong(&resolution.span(), "it must be greater than 0"))?;
    }
    for section in &file.duration {
        let rule = reader.rule(section)?;
        model.durations.push((reader.action(section)?, rule));
    }
    for section in &file.delay {
        let rule = reader.rule(section)?;
        model.delays.push((reader.action(section)?, rule));
    }
    for section in &file.amount {
        let fluent = section.get_ref().fluent.as_ref();
        let fluent = fluent.ok_or_else(|| reader.wrong(&section.span(), "`fluent` is missing"))?;
        model.amounts.push(Amount {
            action: reader.action(section)?,
            fluent: reader.pattern(fluent, Names::Functions)?,
            rule: reader.rule(section)?,
        });
    }
    for section in &file.failure {
        model.failures.push(reader.failing(section)?);
    }
    for section in &file.event {
        model.exogenous.push(reader.exogenous(section)?);
    }
    if let Some(section) = &file.reports {
        model.reports = reader.reports(section)?;
    }
    Ok(model)
}

impl Reader<'_> {
    fn wrong(&self, at: &Range<usize>, message: impl Into<String>) -> WorldFileError {
        let before = self.text.get(..at.start).unwrap_or(self.text);
        WorldFileError {
            line: 1 + before.matches('\n').count(),
            message: message.into().trim().replace('\n', " "),
        }
    }

    fn pattern(&self, text: &Spanned<String>, names: Names) -> Read<ActionPattern> {
        ActionPattern::read(text.get_ref(), names, self.problem)
            .map_err(|problem| self.wrong(&text.span(), problem))
    }

    fn action(&self, section: &Spanned<Section>) -> Read<ActionPattern> {
        let action = section.get_ref().action.as_ref();
        let action = action.ok_or_else(|| self.wrong(&section.span(), "`action` is missing"))?;
        self.pattern(action, Names::Actions)
    }

    fn probability(&self, value: &Spanned<f64>) -> Read<f64> {
        if (0.0..=1.0).contains(value.get_ref()) {
            Ok(*value.get_ref())
        } else {
            Err(self.wrong(&value.span(), "a probability lies between 0 and 1"))
        }
    }

    /// The one distribution that a section has.
    fn rule(&self, section: &Spanned<Section>) -> Read<Rule> {
        let given = section.get_ref();
        let mut found: Vec<Found> = Vec::new();
        let plain = |span, distribution| (span, distribution, given.minimum, given.maximum);
        if let Some(value) = &given.constant {
            found.push(plain(
                value.span(),
                Distribution::Constant(*value.get_ref()),
            ));
        }
        if let Some(values) = &given.values {
            found.push(plain(
                values.span(),
                Distribution::Empirical(values.get_ref().clone()),
            ));
        }
        let shapes = [
            ("normal", &given.normal),
            ("lognormal", &given.lognormal),
            ("uniform", &given.uniform),
            ("triangular", &given.triangular),
        ];
        for (name, shape) in shapes {
            if let Some(shape) = shape {
                let distribution = self.distribution(name, shape)?;
                let limits = shape.get_ref();
                found.push((
                    shape.span(),
                    distribution,
                    limits.minimum.or(given.minimum),
                    limits.maximum.or(given.maximum),
                ));
            }
        }
        let Some((span, distribution, minimum, maximum)) = found.pop() else {
            return Err(self.wrong(
                &section.span(),
                "say how it is distributed: constant, normal, lognormal, uniform, triangular or values",
            ));
        };
        if !found.is_empty() {
            return Err(self.wrong(&span, "one distribution is enough"));
        }
        if let Some(problem) = distribution.problem() {
            return Err(self.wrong(&span, problem));
        }
        Ok(Rule {
            distribution,
            minimum,
            maximum,
            is_relative: given.relative.unwrap_or(false),
        })
    }

    fn distribution(&self, name: &str, shape: &Spanned<Shape>) -> Read<Distribution> {
        let given = shape.get_ref();
        let need = |value: Option<f64>, what: &str| {
            value.ok_or_else(|| self.wrong(&shape.span(), format!("`{what}` of {name} is missing")))
        };
        let excess = |wanted: &[&str]| {
            let all = [
                ("mean", given.mean),
                ("deviation", given.deviation),
                ("from", given.from),
                ("to", given.to),
                ("mode", given.mode),
            ];
            let excess = all
                .iter()
                .find(|(name, value)| value.is_some() && !wanted.contains(name));
            match excess {
                Some((what, _)) => {
                    Err(self.wrong(&shape.span(), format!("{name} has no `{what}`")))
                }
                None => Ok(()),
            }
        };
        Ok(match name {
            "uniform" => {
                excess(&["from", "to"])?;
                Distribution::Uniform {
                    from: need(given.from, "from")?,
                    to: need(given.to, "to")?,
                }
            }
            "triangular" => {
                excess(&["from", "mode", "to"])?;
                Distribution::Triangular {
                    from: need(given.from, "from")?,
                    mode: need(given.mode, "mode")?,
                    to: need(given.to, "to")?,
                }
            }
            _ => {
                excess(&["mean", "deviation"])?;
                let (mean, deviation) = (
                    need(given.mean, "mean")?,
                    need(given.deviation, "deviation")?,
                );
                if name == "normal" {
                    Distribution::Normal { mean, deviation }
                } else {
                    Distribution::LogNormal { mean, deviation }
                }
            }
        })
    }

    fn failing(&self, section: &Spanned<Section>) -> Read<Failing> {
        let given = section.get_ref();
        let probability = given.probability.as_ref();
        let probability =
            probability.ok_or_else(|| self.wrong(&section.span(), "`probability` is missing"))?;
        let when = match &given.when {
            None => Failure::AtEnd,
            Some(when) => match when.get_ref().as_str() {
                "start" => Failure::AtStart,
                "midway" => Failure::Midway,
                "end" => Failure::AtEnd,
                _ => return Err(self.wrong(&when.span(), "write \"start\", \"midway\" or \"end\"")),
            },
        };
        Ok(Failing {
            action: self.action(section)?,
            probability: self.probability(probability)?,
            when,
        })
    }

    fn exogenous(&self, section: &Spanned<Section>) -> Read<Exogenous> {
        let given = section.get_ref();
        let becomes = given.becomes.as_ref();
        let becomes = becomes.ok_or_else(|| self.wrong(&section.span(), "`becomes` is missing"))?;
        let change = match (&given.fact, &given.fluent, becomes.get_ref()) {
            (Some(fact), None, Becomes::Truth(truth)) => {
                self.pattern(fact, Names::Predicates)?;
                ExogenousChange::Fact(self.ground(fact)?, *truth)
            }
            (None, Some(fluent), Becomes::Value(value)) => {
                self.pattern(fluent, Names::Functions)?;
                let value = exact(*value);
                let value =
                    value.ok_or_else(|| self.wrong(&becomes.span(), "the value must be finite"))?;
                ExogenousChange::Value(self.ground(fluent)?, value)
            }
            _ => {
                return Err(self.wrong(
                    &section.span(),
                    "write `fact` with becomes = true or false, or `fluent` with a number",
                ));
            }
        };
        let probability = given.probability.as_ref();
        Ok(Exogenous {
            time: self.rule(section)?,
            probability: probability.map_or(Ok(1.0), |value| self.probability(value))?,
            change,
            is_reported: given.reported.unwrap_or(true),
        })
    }

    /// A name without placeholders.
    fn ground(&self, text: &Spanned<String>) -> Read<String> {
        let name = text.get_ref().trim();
        let name = if name.starts_with('(') {
            name.to_owned()
        } else {
            format!("({name})")
        };
        let words = name.trim_matches(['(', ')']).split_whitespace();
        if words.clone().any(|word| word == "_" || word == "*") {
            return Err(self.wrong(
                &text.span(),
                "name one fact or fluent, with all its objects",
            ));
        }
        Ok(format!("({})", words.collect::<Vec<_>>().join(" ")))
    }

    fn reports(&self, section: &Spanned<Section>) -> Read<Reports> {
        let given = section.get_ref();
        let probability = |value: &Option<Spanned<f64>>| match value {
            Some(value) => self.probability(value),
            None => Ok(0.0),
        };
        let late = probability(&given.late)?;
        let lateness = if late > 0.0 {
            self.rule(section)?.distribution
        } else {
            Distribution::Constant(0.0)
        };
        Ok(Reports {
            lost: probability(&given.lost)?,
            duplicated: probability(&given.duplicated)?,
            late,
            lateness,
            contradicted: probability(&given.contradicted)?,
        })
    }
}

/// The number as it is written, not as a float rounds it.
fn exact(value: f64) -> Option<Rational> {
    value.is_finite().then(|| value.to_string().parse().ok())?
}
