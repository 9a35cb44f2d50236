//! JSON parser with positions, exact numbers, and the bare infinities that some programs write.
//!
//! Python writes `Infinity`, which strict JSON does not have. Numbers keep their text, so that they
//! can be parsed exactly.

use std::borrow::Cow;

use crate::report::Report;

/// Limit on nesting: deeper than any network needs, and shallow enough for any stack.
const DEEPEST: usize = 64;

/// A value and its position.
#[derive(Debug)]
pub(crate) struct Json<'a> {
    pub(crate) at: usize,
    pub(crate) value: Value<'a>,
}

#[derive(Debug)]
pub(crate) enum Value<'a> {
    Null,
    Bool,
    /// The text of the number; also `Infinity`, `-Infinity` and `NaN`.
    Number(&'a str),
    Text(Cow<'a, str>),
    List(Vec<Json<'a>>),
    Object(Vec<(Cow<'a, str>, Json<'a>)>),
}

impl<'a> Json<'a> {
    /// Returns the member of that name; the last one, if there are several.
    pub(crate) fn member(&self, name: &str) -> Option<&Json<'a>> {
        match &self.value {
            Value::Object(members) => {
                let found = members.iter().rev().find(|(key, _)| key == name);
                found.map(|(_, value)| value)
            }
            _ => None,
        }
    }

    pub(crate) fn list(&self) -> Option<&[Json<'a>]> {
        match &self.value {
            Value::List(items) => Some(items),
            _ => None,
        }
    }

    pub(crate) fn members(&self) -> Option<&[(Cow<'a, str>, Json<'a>)]> {
        match &self.value {
            Value::Object(members) => Some(members),
            _ => None,
        }
    }

    pub(crate) fn text(&self) -> Option<&str> {
        match &self.value {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    /// Returns the kind of the value, for a message.
    pub(crate) fn kind(&self) -> &'static str {
        match &self.value {
            Value::Null => "null",
            Value::Bool => "a truth value",
            Value::Number(_) => "a number",
            Value::Text(_) => "a text",
            Value::List(_) => "a list",
            Value::Object(_) => "an object",
        }
    }
}

/// Parses a document. Returns `None` after reporting a mistake.
pub(crate) fn parse<'a>(text: &'a str, report: &mut Report) -> Option<Json<'a>> {
    let mut reader = Reader { text, at: 0 };
    let read = reader.value(0).and_then(|value| {
        reader.skip_space();
        if reader.at < text.len() {
            return Err(
                reader.syntax_error("unexpected text after the end of the document", "remove it")
            );
        }
        Ok(value)
    });
    read.map_err(|wrong| report.mistake(wrong.at, wrong.message, wrong.help))
        .ok()
}

/// A syntax error in JSON: its position and a message.
struct SyntaxError {
    at: usize,
    message: String,
    help: &'static str,
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Reader<'a> {
    fn syntax_error(&self, message: impl Into<String>, help: &'static str) -> SyntaxError {
        SyntaxError {
            at: self.at,
            message: message.into(),
            help,
        }
    }

    fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    fn skip_space(&mut self) {
        while matches!(self.peek(), Some(b' ' | b'\t' | b'\r' | b'\n')) {
            self.at += 1;
        }
    }

    /// Returns the text at this place, for a message.
    fn current_text(&self) -> String {
        match self.text[self.at..].chars().next() {
            Some(letter) => format!("`{letter}`"),
            None => "the end of the text".to_owned(),
        }
    }

    fn value(&mut self, depth: usize) -> Result<Json<'a>, SyntaxError> {
        self.skip_space();
        let at = self.at;
        if depth > DEEPEST {
            return Err(
                self.syntax_error("lists and objects are nested too deeply", "flatten them")
            );
        }
        let value = match self.peek() {
            Some(b'{') => self.object(depth)?,
            Some(b'[') => self.items(depth)?,
            Some(b'"') => Value::Text(self.string()?),
            Some(b'-' | b'+' | b'.' | b'0'..=b'9' | b'A'..=b'Z' | b'a'..=b'z') => self.word()?,
            _ => {
                let here = self.current_text();
                return Err(self.syntax_error(
                    format!("expected a value, found {here}"),
                    "write a number, a text, a list or an object",
                ));
            }
        };
        Ok(Json { at, value })
    }

    fn object(&mut self, depth: usize) -> Result<Value<'a>, SyntaxError> {
        self.at += 1;
        let mut members = Vec::new();
        loop {
            self.skip_space();
            match self.peek() {
                Some(b'}') if members.is_empty() => break,
                Some(b'"') => {}
                _ => {
                    let here = self.current_text();
                    return Err(self.syntax_error(
                        format!("expected the name of a member, found {here}"),
                        "write names in double quotes",
                    ));
                }
            }
            let name = self.string()?;
            self.skip_space();
            if self.peek() != Some(b':') {
                let here = self.current_text();
                return Err(self.syntax_error(
                    format!("expected `:` after the name `{name}`, found {here}"),
                    "write `\"name\": value`",
                ));
            }
            self.at += 1;
            members.push((name, self.value(depth + 1)?));
            if self.is_last(b'}')? {
                break;
            }
        }
        self.at += 1;
        Ok(Value::Object(members))
    }

    fn items(&mut self, depth: usize) -> Result<Value<'a>, SyntaxError> {
        self.at += 1;
        let mut items = Vec::new();
        self.skip_space();
        if self.peek() != Some(b']') {
            loop {
                items.push(self.value(depth + 1)?);
                if self.is_last(b']')? {
                    break;
                }
            }
        }
        self.at += 1;
        Ok(Value::List(items))
    }

    /// Returns `true` if the list or object ends here; otherwise skips the comma.
    fn is_last(&mut self, end: u8) -> Result<bool, SyntaxError> {
        self.skip_space();
        match self.peek() {
            Some(byte) if byte == end => Ok(true),
            Some(b',') => {
                self.at += 1;
                Ok(false)
            }
            _ => {
                let here = self.current_text();
                Err(self.syntax_error(
                    format!("expected `,` or `{}`, found {here}", char::from(end)),
                    "the file may be cut off or a comma missing",
                ))
            }
        }
    }

    /// Reads a number, `true`, `false`, `null` or an infinity.
    fn word(&mut self) -> Result<Value<'a>, SyntaxError> {
        let start = self.at;
        while let Some(b'-' | b'+' | b'.' | b'0'..=b'9' | b'A'..=b'Z' | b'a'..=b'z') = self.peek() {
            self.at += 1;
        }
        let word = &self.text[start..self.at];
        match word {
            "null" => Ok(Value::Null),
            "true" | "false" => Ok(Value::Bool),
            "Infinity" | "-Infinity" | "+Infinity" | "NaN" => Ok(Value::Number(word)),
            _ if word.starts_with(|c: char| !c.is_ascii_alphabetic()) => Ok(Value::Number(word)),
            _ => {
                self.at = start;
                Err(self.syntax_error(
                    format!("`{word}` is not a value"),
                    "write texts in double quotes",
                ))
            }
        }
    }

    fn string(&mut self) -> Result<Cow<'a, str>, SyntaxError> {
        let start = self.at + 1;
        let bytes = self.text.as_bytes();
        let mut at = start;
        while let Some(&byte) = bytes.get(at) {
            match byte {
                b'"' => {
                    self.at = at + 1;
                    return Ok(Cow::Borrowed(&self.text[start..at]));
                }
                b'\\' => return self.escaped(start, at),
                b'\n' => break,
                _ => at += 1,
            }
        }
        Err(self.syntax_error("the text that begins here has no end", "add a double quote"))
    }

    /// Reads a string with escape sequences, the first of them at `at`.
    fn escaped(&mut self, start: usize, at: usize) -> Result<Cow<'a, str>, SyntaxError> {
        let begin = self.at;
        let mut read = self.text[start..at].to_owned();
        let mut letters = self.text[at..].char_indices();
        while let Some((offset, letter)) = letters.next() {
            match letter {
                '"' => {
                    self.at = at + offset + 1;
                    return Ok(Cow::Owned(read));
                }
                '\\' => match letters.next().map(|(_, letter)| letter) {
                    Some('n') => read.push('\n'),
                    Some('t') => read.push('\t'),
                    Some('r') => read.push('\r'),
                    Some('b') => read.push('\u{8}'),
                    Some('f') => read.push('\u{c}'),
                    Some(same @ ('"' | '\\' | '/')) => read.push(same),
                    Some('u') => {
                        let digits: String = letters.by_ref().take(4).map(|(_, c)| c).collect();
                        let code = u32::from_str_radix(&digits, 16).ok();
                        // Surrogate pairs are not decoded, because no name needs them.
                        let letter = code.and_then(char::from_u32);
                        read.push(letter.unwrap_or(char::REPLACEMENT_CHARACTER));
                    }
                    _ => {
                        self.at = at + offset;
                        return Err(self.syntax_error(
                            "unknown escape sequence",
                            "write `\\\\` for a backslash",
                        ));
                    }
                },
                '\n' => break,
                _ => read.push(letter),
            }
        }
        self.at = begin;
        Err(self.syntax_error("the text that begins here has no end", "add a double quote"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        let mut report = Report::new(&text.into());
        assert!(parse(text, &mut report).is_none(), "{text}");
        report.finish(None::<()>).unwrap_err().to_string()
    }

    #[test]
    fn infinities_and_numbers_keep_their_spelling() {
        let text = r#"{"a": [1.50, -Infinity, Infinity, 2e3], "b": "inf", "a": null}"#;
        let json = parse(text, &mut Report::new(&text.into())).expect("right");
        assert!(matches!(
            json.member("a").expect("there").value,
            Value::Null
        ));
        let Some((_, list)) = json.members().expect("an object").first() else {
            panic!("no member");
        };
        let numbers: Vec<&str> = list
            .list()
            .expect("a list")
            .iter()
            .map(|item| match item.value {
                Value::Number(number) => number,
                _ => panic!("not a number"),
            })
            .collect();
        assert_eq!(numbers, ["1.50", "-Infinity", "Infinity", "2e3"]);
    }

    #[test]
    fn syntax_errors_have_positions() {
        assert!(refused("{\"a\": [1,\n 2").starts_with("text:2:3: error: expected `,` or `]`"));
        assert!(refused("{\"a\" 1}").starts_with("text:1:6: error: expected `:`"));
        assert!(refused("[inf]").starts_with("text:1:2: error: `inf` is not a value"));
        assert!(
            refused("[\"a]").starts_with("text:1:2: error: the text that begins here has no end")
        );
        assert!(refused("[] []").starts_with("text:1:4: error: unexpected text after the end"));
        assert!(refused(&"[".repeat(100_000)).contains("nested too deeply"));
        assert!(refused("").contains("the end of the text"));
    }

    #[test]
    fn escape_sequences_are_resolved() {
        let text = r#"["a\"b\\c\u00e9\n"]"#;
        let json = parse(text, &mut Report::new(&text.into())).expect("right");
        assert_eq!(json.list().expect("a list")[0].text(), Some("a\"b\\cé\n"));
    }
}
