//! Serialization of the members of a [`RunSpec`](super::RunSpec): most are texts in the syntax of
//! the command line.

use serde::{Deserialize, Deserializer};

/// A member that may be `null`, but not left out.
pub(super) fn required<'de, D, T>(deserializer: D) -> Result<Option<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de>,
{
    Option::deserialize(deserializer)
}

/// Serialization as a text.
pub(crate) mod as_text {
    use std::borrow::Cow;
    use std::fmt::Display;
    use std::str::FromStr;

    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(crate) fn serialize<T: Display, S: Serializer>(
        value: &T,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_str(value)
    }

    pub(crate) fn deserialize<'de, T, D>(deserializer: D) -> Result<T, D::Error>
    where
        T: FromStr<Err: Display>,
        D: Deserializer<'de>,
    {
        let text = Cow::<str>::deserialize(deserializer)?;
        text.parse().map_err(D::Error::custom)
    }
}

/// Serialization as a list of texts.
pub(crate) mod listed {
    use std::fmt::Display;
    use std::str::FromStr;

    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(crate) fn serialize<T: Display, S: Serializer>(
        values: &[T],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(values.iter().map(ToString::to_string))
    }

    pub(crate) fn deserialize<'de, T, D>(deserializer: D) -> Result<Vec<T>, D::Error>
    where
        T: FromStr<Err: Display>,
        D: Deserializer<'de>,
    {
        let texts = Vec::<String>::deserialize(deserializer)?;
        let values = texts.iter().map(|text| text.parse());
        values.collect::<Result<_, _>>().map_err(D::Error::custom)
    }
}

/// Serialization of a positive number as a text.
pub(super) mod positive {
    use elbowroom_num::Rational;
    use serde::de::Error;
    use serde::{Deserializer, Serializer};

    use super::as_text;

    pub(in crate::execute::spec) fn serialize<S: Serializer>(
        number: &Rational,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        as_text::serialize(number, serializer)
    }

    pub(in crate::execute::spec) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Rational, D::Error> {
        let number: Rational = as_text::deserialize(deserializer)?;
        if number.is_positive() {
            Ok(number)
        } else {
            Err(D::Error::custom(format!("{number} must be greater than 0")))
        }
    }

    /// Serialization of a positive number or `null`; the member is required.
    pub(in crate::execute::spec) mod nullable {
        use elbowroom_num::Rational;
        use serde::de::Error;
        use serde::{Deserialize, Deserializer, Serialize, Serializer};

        #[allow(
            clippy::ref_option,
            reason = "this is how serde hands over a field of that type"
        )]
        pub(in crate::execute::spec) fn serialize<S: Serializer>(
            number: &Option<Rational>,
            serializer: S,
        ) -> Result<S::Ok, S::Error> {
            let text = number.as_ref().map(ToString::to_string);
            text.serialize(serializer)
        }

        pub(in crate::execute::spec) fn deserialize<'de, D: Deserializer<'de>>(
            deserializer: D,
        ) -> Result<Option<Rational>, D::Error> {
            let Some(text) = Option::<String>::deserialize(deserializer)? else {
                return Ok(None);
            };
            let text = serde::de::value::StringDeserializer::new(text);
            super::deserialize(text)
                .map(Some)
                .map_err(|error: serde::de::value::Error| D::Error::custom(error))
        }
    }

    /// Serialization of a positive number or `null`; the member is optional.
    pub(in crate::execute::spec) use nullable as option;
}
