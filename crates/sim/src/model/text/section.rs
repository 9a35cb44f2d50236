//! Structure of world files, and the keys that each section permits.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;

use super::number::{self, Number};

/// The contents of a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) format: Spanned<String>,
    pub(super) version: Spanned<i64>,
    pub(super) resolution: Option<Spanned<Number>>,
    #[serde(default)]
    pub(super) duration: Vec<Spanned<Section>>,
    #[serde(default)]
    pub(super) delay: Vec<Spanned<Section>>,
    #[serde(default)]
    pub(super) amount: Vec<Spanned<Section>>,
    #[serde(default)]
    pub(super) failure: Vec<Spanned<Section>>,
    #[serde(default)]
    pub(super) event: Vec<Spanned<Section>>,
    #[serde(default)]
    pub(super) hazard: Vec<Spanned<Section>>,
    pub(super) reports: Option<Spanned<Section>>,
}

/// All keys of one section; which are allowed depends on the section.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Section {
    pub(super) action: Option<Spanned<String>>,
    pub(super) fluent: Option<Spanned<String>>,
    pub(super) fact: Option<Spanned<String>>,
    pub(super) becomes: Option<Spanned<toml::Value>>,
    #[serde(deserialize_with = "number::optional")]
    pub(super) becomes_true_per_second: Option<Spanned<f64>>,
    #[serde(deserialize_with = "number::optional")]
    pub(super) becomes_false_per_second: Option<Spanned<f64>>,
    #[serde(deserialize_with = "number::optional")]
    pub(super) probability: Option<Spanned<f64>>,
    pub(super) when: Option<Spanned<String>>,
    pub(super) undone: Option<Spanned<bool>>,
    pub(super) outcome: Option<Spanned<Vec<Spanned<OutcomeSection>>>>,
    pub(super) reported: Option<Spanned<bool>>,
    #[serde(deserialize_with = "number::optional")]
    pub(super) constant: Option<Spanned<f64>>,
    pub(super) normal: Option<Spanned<Shape>>,
    pub(super) lognormal: Option<Spanned<Shape>>,
    pub(super) uniform: Option<Spanned<Shape>>,
    pub(super) triangular: Option<Spanned<Shape>>,
    #[serde(deserialize_with = "number::list")]
    pub(super) values: Option<Spanned<Vec<f64>>>,
    #[serde(deserialize_with = "number::optional")]
    pub(super) minimum: Option<Spanned<f64>>,
    #[serde(deserialize_with = "number::optional")]
    pub(super) maximum: Option<Spanned<f64>>,
    pub(super) relative: Option<Spanned<bool>>,
    #[serde(deserialize_with = "number::optional")]
    pub(super) lost: Option<Spanned<f64>>,
    #[serde(deserialize_with = "number::optional")]
    pub(super) duplicated: Option<Spanned<f64>>,
    #[serde(deserialize_with = "number::optional")]
    pub(super) late: Option<Spanned<f64>>,
    #[serde(deserialize_with = "number::optional")]
    pub(super) contradicted: Option<Spanned<f64>>,
}

/// Names of facts or fluents with their positions, and numbers.
pub(super) type Numbers = BTreeMap<Spanned<String>, Spanned<Number>>;

/// An outcome of a failure.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct OutcomeSection {
    #[serde(deserialize_with = "number::optional")]
    pub(super) probability: Option<Spanned<f64>>,
    pub(super) becomes_true: Vec<Spanned<String>>,
    pub(super) becomes_false: Vec<Spanned<String>>,
    pub(super) assign: Numbers,
    pub(super) increase: Numbers,
    pub(super) decrease: Numbers,
    pub(super) delay: Option<Spanned<Number>>,
    pub(super) reported: Option<Spanned<bool>>,
}

/// The parameters of a distribution.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Shape {
    #[serde(deserialize_with = "number::plain")]
    pub(super) mean: Option<f64>,
    #[serde(deserialize_with = "number::plain")]
    pub(super) deviation: Option<f64>,
    #[serde(deserialize_with = "number::plain")]
    pub(super) from: Option<f64>,
    #[serde(deserialize_with = "number::plain")]
    pub(super) to: Option<f64>,
    #[serde(deserialize_with = "number::plain")]
    pub(super) mode: Option<f64>,
    #[serde(deserialize_with = "number::optional")]
    pub(super) minimum: Option<Spanned<f64>>,
    #[serde(deserialize_with = "number::optional")]
    pub(super) maximum: Option<Spanned<f64>>,
}

/// The keys of distributions, then those of their limits.
const DISTRIBUTION: &[&str] = &[
    "constant",
    "normal",
    "lognormal",
    "uniform",
    "triangular",
    "values",
    "minimum",
    "maximum",
];

impl Section {
    /// Returns all keys that are present, with their positions.
    fn present_keys(&self) -> Vec<(&'static str, Range<usize>)> {
        fn span_of<T>(value: Option<&Spanned<T>>) -> Option<Range<usize>> {
            value.map(Spanned::span)
        }
        let all = [
            ("action", span_of(self.action.as_ref())),
            ("fluent", span_of(self.fluent.as_ref())),
            ("fact", span_of(self.fact.as_ref())),
            ("becomes", span_of(self.becomes.as_ref())),
            (
                "becomes_true_per_second",
                span_of(self.becomes_true_per_second.as_ref()),
            ),
            (
                "becomes_false_per_second",
                span_of(self.becomes_false_per_second.as_ref()),
            ),
            ("probability", span_of(self.probability.as_ref())),
            ("when", span_of(self.when.as_ref())),
            ("undone", span_of(self.undone.as_ref())),
            ("outcome", span_of(self.outcome.as_ref())),
            ("reported", span_of(self.reported.as_ref())),
            ("constant", span_of(self.constant.as_ref())),
            ("normal", span_of(self.normal.as_ref())),
            ("lognormal", span_of(self.lognormal.as_ref())),
            ("uniform", span_of(self.uniform.as_ref())),
            ("triangular", span_of(self.triangular.as_ref())),
            ("values", span_of(self.values.as_ref())),
            ("minimum", span_of(self.minimum.as_ref())),
            ("maximum", span_of(self.maximum.as_ref())),
            ("relative", span_of(self.relative.as_ref())),
            ("lost", span_of(self.lost.as_ref())),
            ("duplicated", span_of(self.duplicated.as_ref())),
            ("late", span_of(self.late.as_ref())),
            ("contradicted", span_of(self.contradicted.as_ref())),
        ];
        let given = all.into_iter();
        given
            .filter_map(|(name, span)| Some((name, span?)))
            .collect()
    }

    /// Returns the first superfluous key, if any, with its position and a message. Permitted are
    /// `own` and, if `is_distributed`, the keys of distributions.
    pub(super) fn first_superfluous_key(
        &self,
        name: &str,
        own: &[&str],
        is_distributed: bool,
    ) -> Option<(Range<usize>, String)> {
        let extra = if is_distributed { DISTRIBUTION } else { &[] };
        let given = self.present_keys();
        let is_known = |key: &&str| own.contains(key) || extra.contains(key);
        let (key, span) = given.into_iter().find(|(key, _)| !is_known(key))?;
        let known: Vec<&str> = own.iter().chain(extra).copied().collect();
        let known = known.join(", ");
        let message = format!("`{key}` has no meaning in {name}; leave it out. Known are {known}");
        Some((span, message))
    }

    /// Returns `true` if it contains a distribution.
    pub(super) fn is_distributed(&self) -> bool {
        let mut given = self.present_keys().into_iter();
        given.any(|(key, _)| DISTRIBUTION.contains(&key))
    }

    /// Returns the position of its distribution.
    pub(super) fn distribution_span(&self) -> Option<Range<usize>> {
        let is_limit = |key: &str| key == "minimum" || key == "maximum";
        let mut given = self.present_keys().into_iter();
        given
            .find(|(key, _)| DISTRIBUTION.contains(key) && !is_limit(key))
            .map(|(_, span)| span)
    }
}
