//! Parser of world files.

mod changes;
mod failures;
mod hazards;
mod number;
mod section;

use elbowroom_model::Problem;
use elbowroom_model::pattern::ActionPattern;
use elbowroom_num::Rational;
use elbowroom_text::{Diagnostic, Severity, Source, Span};
use toml::Spanned;

use super::{Amount, ExogenousChange, ExogenousEvent, ReportReliability, Rule, WorldModel};
use crate::draw::Distribution;
use crate::pattern::{NameKind, read_pattern};
use section::{File, Section, Shape};

/// A distribution with its position, its minimum and its maximum.
type ParsedDistribution = (Span, Distribution, Limit, Limit);

/// A minimum or a maximum, with its position.
type Limit = Option<(Span, f64)>;

/// The text, and the problem that defines its names.
struct Reader<'a> {
    source: &'a Source,
    problem: &'a Problem,
}

type Read<T> = Result<T, Diagnostic>;

pub(super) fn read(source: &Source, problem: &Problem) -> Read<WorldModel> {
    let reader = Reader { source, problem };
    let file: File = elbowroom_text::toml::read(source)?;
    if file.format.get_ref() != "elbowroom-world" {
        return Err(reader.error_at(&file.format.span(), "write format = \"elbowroom-world\""));
    }
    if *file.version.get_ref() != 1 {
        return Err(reader.error_at(&file.version.span(), "this program reads version 1"));
    }
    let mut model = WorldModel::without_deviations();
    if let Some(resolution) = &file.resolution {
        let value = resolution.get_ref().exact();
        model.resolution = value
            .filter(Rational::is_positive)
            .ok_or_else(|| reader.error_at(&resolution.span(), "it must be greater than 0"))?;
    }
    for section in &file.duration {
        let rule = reader.rule_of(section, "[[duration]]", &["action", "relative"])?;
        let rule = reader.check_not_negative(section, rule)?;
        model.durations.push((reader.action(section)?, rule));
    }
    for section in &file.delay {
        let rule = reader.rule_of(section, "[[delay]]", &["action"])?;
        let rule = reader.check_not_negative(section, rule)?;
        model.delays.push((reader.action(section)?, rule));
    }
    for section in &file.amount {
        model.amounts.push(reader.amount(section)?);
    }
    for section in &file.failure {
        model.failures.push(reader.failing(section)?);
    }
    for section in &file.event {
        model.exogenous.push(reader.exogenous(section)?);
    }
    for section in &file.hazard {
        model
            .hazards
            .push(reader.hazard(section, &model.resolution)?);
    }
    if let Some(section) = &file.reports {
        model.reports = reader.reports(section)?;
    }
    Ok(model)
}

impl Reader<'_> {
    fn error_at(&self, at: &Span, message: impl Into<String>) -> Diagnostic {
        let message = message.into().trim().replace('\n', " ");
        Diagnostic::new(Severity::Error, self.source, at.clone(), message)
    }

    fn pattern(&self, text: &Spanned<String>, names: NameKind) -> Read<ActionPattern> {
        read_pattern(text.get_ref(), names, self.problem)
            .map_err(|problem| self.error_at(&text.span(), problem))
    }

    fn action(&self, section: &Spanned<Section>) -> Read<ActionPattern> {
        let action = section.get_ref().action.as_ref();
        let action = action.ok_or_else(|| self.error_at(&section.span(), "`action` is missing"))?;
        self.pattern(action, NameKind::Actions)
    }

    /// Reads the distribution of a section that has no other keys than `own`.
    fn rule_of(&self, section: &Spanned<Section>, name: &str, own: &[&str]) -> Read<Rule> {
        match section.get_ref().first_superfluous_key(name, own, true) {
            Some((span, message)) => Err(self.error_at(&span, message)),
            None => self.rule(section),
        }
    }

    /// Checks a rule for times, which must not be negative.
    fn check_not_negative(&self, section: &Spanned<Section>, rule: Rule) -> Read<Rule> {
        if !rule.can_be_negative() {
            return Ok(rule);
        }
        Err(self.error_at(
            &section
                .get_ref()
                .distribution_span()
                .unwrap_or_else(|| section.span()),
            "time is never negative; correct the number, or give a `minimum`",
        ))
    }

    fn amount(&self, section: &Spanned<Section>) -> Read<Amount> {
        let rule = self.rule_of(section, "[[amount]]", &["action", "fluent", "relative"])?;
        let fluent = section.get_ref().fluent.as_ref();
        let fluent = fluent.ok_or_else(|| self.error_at(&section.span(), "`fluent` is missing"))?;
        let amount = Amount {
            action: self.action(section)?,
            fluent: self.pattern(fluent, NameKind::Functions)?,
            rule,
        };
        match changes::ineffective_amount_reason(&amount, self.problem) {
            Some(message) => Err(self.error_at(&fluent.span(), message)),
            None => Ok(amount),
        }
    }

    fn probability(&self, value: &Spanned<f64>) -> Read<f64> {
        if (0.0..=1.0).contains(value.get_ref()) {
            Ok(*value.get_ref())
        } else {
            Err(self.error_at(&value.span(), "a probability lies between 0 and 1"))
        }
    }

    /// Reads the distribution of a section, which must be the only one.
    fn rule(&self, section: &Spanned<Section>) -> Read<Rule> {
        let given = section.get_ref();
        let mut found: Vec<ParsedDistribution> = Vec::new();
        let limit = |limit: &Option<Spanned<f64>>| {
            let limit = limit.as_ref();
            limit.map(|limit| (limit.span(), *limit.get_ref()))
        };
        let beside = (limit(&given.minimum), limit(&given.maximum));
        let plain = |span, distribution| (span, distribution, beside.0.clone(), beside.1.clone());
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
                let minimum = self.merge_limits(limit(&limits.minimum), &beside.0)?;
                let maximum = self.merge_limits(limit(&limits.maximum), &beside.1)?;
                found.push((shape.span(), distribution, minimum, maximum));
            }
        }
        let Some((span, distribution, minimum, maximum)) = found.pop() else {
            return Err(self.error_at(
                &section.span(),
                "expected a distribution: constant, normal, lognormal, uniform, triangular or \
                 values",
            ));
        };
        if !found.is_empty() {
            return Err(self.error_at(&span, "expected only one distribution"));
        }
        if let Some(problem) = distribution.problem() {
            return Err(self.error_at(&span, problem));
        }
        for (span, limit) in minimum.iter().chain(&maximum) {
            if !limit.is_finite() {
                return Err(self.error_at(
                    span,
                    "a limit must be finite; leave it out if there is \
                                                none",
                ));
            }
        }
        if let (Some((_, minimum)), Some((span, maximum))) = (&minimum, &maximum)
            && minimum > maximum
        {
            return Err(self.error_at(span, "`maximum` must not be less than `minimum`"));
        }
        Ok(Rule {
            distribution,
            minimum: minimum.map(|(_, minimum)| minimum),
            maximum: maximum.map(|(_, maximum)| maximum),
            is_relative: given.relative.as_ref().is_some_and(|it| *it.get_ref()),
        })
    }

    /// Returns the limit inside the braces or the one next to them. It is an error if there are
    /// both.
    fn merge_limits(&self, inside: Limit, beside: &Limit) -> Read<Limit> {
        match (inside, beside) {
            (Some((span, _)), Some(_)) => Err(self.error_at(
                &span,
                "write this limit only once: inside or outside the braces",
            )),
            (inside, beside) => Ok(inside.or_else(|| beside.clone())),
        }
    }

    fn distribution(&self, name: &str, shape: &Spanned<Shape>) -> Read<Distribution> {
        let given = shape.get_ref();
        let need = |value: Option<f64>, what: &str| {
            value.ok_or_else(|| {
                self.error_at(&shape.span(), format!("`{what}` of {name} is missing"))
            })
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
                    Err(self.error_at(&shape.span(), format!("{name} has no `{what}`")))
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

    fn exogenous(&self, section: &Spanned<Section>) -> Read<ExogenousEvent> {
        let given = section.get_ref();
        let own = ["fact", "fluent", "becomes", "probability", "reported"];
        let time = self.rule_of(section, "[[event]]", &own)?;
        let time = self.check_not_negative(section, time)?;
        let becomes = given.becomes.as_ref();
        let becomes =
            becomes.ok_or_else(|| self.error_at(&section.span(), "`becomes` is missing"))?;
        let value = match becomes.get_ref() {
            toml::Value::Boolean(truth) => NewValue::Truth(*truth),
            toml::Value::Integer(value) => NewValue::Value(Some(Rational::from(*value))),
            toml::Value::Float(value) => NewValue::Value(Rational::from_f64_as_written(*value)),
            toml::Value::String(text) if text.parse::<Rational>().is_ok() => {
                NewValue::Value(text.parse().ok())
            }
            _ => {
                let message = "write true or false for a fact, or a number for a fluent";
                return Err(self.error_at(&becomes.span(), message));
            }
        };
        let change = match (&given.fact, &given.fluent, value) {
            (Some(fact), None, NewValue::Truth(truth)) => {
                self.pattern(fact, NameKind::Predicates)?;
                ExogenousChange::Fact(self.ground(fact)?, truth)
            }
            (None, Some(fluent), NewValue::Value(value)) => {
                self.pattern(fluent, NameKind::Functions)?;
                let value = value
                    .ok_or_else(|| self.error_at(&becomes.span(), "the value must be finite"))?;
                ExogenousChange::Value(self.ground(fluent)?, value)
            }
            _ => {
                return Err(self.error_at(
                    &section.span(),
                    "write `fact` with becomes = true or false, or `fluent` with a number",
                ));
            }
        };
        let probability = given.probability.as_ref();
        Ok(ExogenousEvent {
            time,
            probability: probability.map_or(Ok(1.0), |value| self.probability(value))?,
            change,
            is_reported: given.reported.as_ref().is_none_or(|it| *it.get_ref()),
        })
    }

    /// Reads a name without placeholders.
    fn ground(&self, text: &Spanned<String>) -> Read<String> {
        let name = text.get_ref().trim();
        let name = if name.starts_with('(') {
            name.to_owned()
        } else {
            format!("({name})")
        };
        let words = name.trim_matches(['(', ')']).split_whitespace();
        if words.clone().any(|word| word == "_" || word == "*") {
            return Err(self.error_at(
                &text.span(),
                "name one fact or fluent, with all its objects",
            ));
        }
        Ok(format!("({})", words.collect::<Vec<_>>().join(" ")))
    }

    fn reports(&self, section: &Spanned<Section>) -> Read<ReportReliability> {
        let given = section.get_ref();
        let probability = |value: &Option<Spanned<f64>>| match value {
            Some(value) => self.probability(value),
            None => Ok(0.0),
        };
        let own = ["lost", "duplicated", "late", "contradicted"];
        if let Some((span, message)) = given.first_superfluous_key("[reports]", &own, true) {
            return Err(self.error_at(&span, message));
        }
        let late = probability(&given.late)?;
        let lateness = if late > 0.0 || given.is_distributed() {
            let lateness = self.rule(section)?;
            self.check_not_negative(section, lateness)?
        } else {
            Distribution::Constant(0.0).into()
        };
        if given.late.is_none() && given.is_distributed() {
            return Err(self.error_at(
                &section
                    .get_ref()
                    .distribution_span()
                    .unwrap_or_else(|| section.span()),
                "`late` is missing: the probability of such a late report",
            ));
        }
        Ok(ReportReliability {
            lost: probability(&given.lost)?,
            duplicated: probability(&given.duplicated)?,
            late,
            lateness,
            contradicted: probability(&given.contradicted)?,
        })
    }
}

/// The new value of a fact or a fluent; the value is `None` if it is not finite.
enum NewValue {
    Truth(bool),
    Value(Option<Rational>),
}
