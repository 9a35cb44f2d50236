//! JSON schemas of documents, generated from their declarations.

use elbowroom::report::exact::Exact;
use serde_json::{Map, Value, json};

/// A type whose JSON form can be described.
pub trait Described {
    /// Returns the schema, in the form of `OpenAPI` 3.1 and JSON Schema 2020-12. Referenced schemas
    /// are added to `definitions`.
    fn schema(definitions: &mut Map<String, Value>) -> Value;
}

impl Described for String {
    fn schema(_: &mut Map<String, Value>) -> Value {
        json!({ "type": "string" })
    }
}

impl Described for bool {
    fn schema(_: &mut Map<String, Value>) -> Value {
        json!({ "type": "boolean" })
    }
}

impl Described for u64 {
    fn schema(_: &mut Map<String, Value>) -> Value {
        json!({ "type": "integer", "minimum": 0 })
    }
}

impl Described for usize {
    fn schema(definitions: &mut Map<String, Value>) -> Value {
        u64::schema(definitions)
    }
}

impl Described for Exact {
    fn schema(definitions: &mut Map<String, Value>) -> Value {
        let number = json!({
            "type": "object",
            "description": "A number: exactly, as an integer or a fraction, and the nearest float.",
            "properties": { "exact": { "type": "string" }, "decimal": { "type": "number" } },
            "required": ["exact", "decimal"],
        });
        definitions.insert("Number".to_owned(), number);
        json!({ "$ref": "#/components/schemas/Number" })
    }
}

impl<T: Described> Described for Option<T> {
    fn schema(definitions: &mut Map<String, Value>) -> Value {
        json!({ "anyOf": [T::schema(definitions), { "type": "null" }] })
    }
}

impl<T: Described> Described for Vec<T> {
    fn schema(definitions: &mut Map<String, Value>) -> Value {
        json!({ "type": "array", "items": T::schema(definitions) })
    }
}

/// Declares documents. Their comments and fields also define their schemas.
macro_rules! documents {
    ($(
        $(#[doc = $about:literal])+
        $(#[serde($($serde:tt)+)])?
        pub struct $name:ident {
            $(
                $(#[doc = $meaning:literal])+
                $([optional $default:meta])?
                pub $field:ident: $type:ty,
            )*
        }
    )+) => {
        $(
            $(#[doc = $about])+
            #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
            $(#[serde($($serde)+)])?
            pub struct $name {
                $(
                    $(#[doc = $meaning])+
                    $(#[$default])?
                    pub $field: $type,
                )*
            }

            impl $crate::interface::Described for $name {
                fn schema(
                    definitions: &mut serde_json::Map<String, serde_json::Value>,
                ) -> serde_json::Value {
                    let name = stringify!($name);
                    if !definitions.contains_key(name) {
                        let mut properties = serde_json::Map::new();
                        let mut required: Vec<&str> = Vec::new();
                        $(
                            let mut schema = <$type>::schema(definitions);
                            let meaning = concat!($($meaning),+).trim();
                            schema["description"] = meaning.into();
                            properties.insert(stringify!($field).to_owned(), schema);
                            let is_optional = false $(|| !stringify!($default).is_empty())?;
                            if !is_optional {
                                required.push(stringify!($field));
                            }
                        )*
                        let about = concat!($($about),+).trim();
                        let schema = serde_json::json!({
                            "type": "object",
                            "description": about,
                            "properties": properties,
                            "required": required,
                        });
                        definitions.insert(name.to_owned(), schema);
                    }
                    serde_json::json!({ "$ref": format!("#/components/schemas/{name}") })
                }
            }
        )+
    };
}

pub(super) use documents;
