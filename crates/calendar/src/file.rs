//! Deserialized calendar files.

use std::collections::BTreeMap;

use elbowroom_text::Span;
use serde::Deserialize;
use toml::{Spanned, Value};

use crate::zone::TextError;

/// Calendar file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct File {
    pub(crate) format: Spanned<String>,
    pub(crate) version: Spanned<i64>,
    pub(crate) begin: Option<Spanned<Value>>,
    #[serde(alias = "time-zone")]
    pub(crate) time_zone: Spanned<String>,
    pub(crate) unit: Spanned<String>,
    pub(crate) horizon: Option<Spanned<Value>>,
    #[serde(default)]
    pub(crate) dates: BTreeMap<String, Spanned<Value>>,
    #[serde(default)]
    pub(crate) window: Vec<Spanned<Section>>,
    #[serde(default)]
    pub(crate) value: Vec<Spanned<Section>>,
}

/// Keys of a `[[window]]` or a `[[value]]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Section {
    pub(crate) fact: Option<Spanned<Value>>,
    pub(crate) fluent: Option<Spanned<Value>>,
    pub(crate) value: Option<Spanned<Value>>,
    pub(crate) days: Option<Spanned<Value>>,
    pub(crate) except: Option<Spanned<Value>>,
    pub(crate) hours: Option<Spanned<Value>>,
    pub(crate) from: Option<Spanned<Value>>,
    pub(crate) to: Option<Spanned<Value>>,
}

/// Returns the text of a string or of an unquoted date.
pub(crate) fn text(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Datetime(date) => Some(date.to_string()),
        _ => None,
    }
}

/// Returns the texts of a list, or a single text as a list.
///
/// # Errors
/// The value is neither a text nor a list of texts, or the list is empty.
pub(crate) fn texts(value: &Spanned<Value>) -> Result<(Span, Vec<String>), TextError> {
    let all: Option<Vec<String>> = match value.get_ref() {
        Value::Array(elements) => elements.iter().map(text).collect(),
        other => text(other).map(|text| vec![text]),
    };
    match all.filter(|all| !all.is_empty()) {
        Some(all) => Ok((value.span(), all)),
        None => Err((
            "expected a text in quotes, or a list of texts".to_owned(),
            String::new(),
        )),
    }
}
