//! Parser for the subset of XML that GraphML files use, with positions.
//!
//! Elements, attributes, texts, CDATA, character references; comments, processing instructions and
//! document types are skipped. Prefixes of names are removed. A document may consist of several
//! root elements, because some tools write that.

use crate::report::Report;

/// Limit on nesting: deeper than any network needs, and shallow enough for any stack.
const DEEPEST: usize = 64;

/// An element and its position.
#[derive(Debug, Default)]
pub(crate) struct Element {
    pub(crate) at: usize,
    pub(crate) name: String,
    pub(crate) attributes: Vec<(String, String)>,
    pub(crate) children: Vec<Element>,
    /// The text directly inside, and its position.
    pub(crate) text: String,
    pub(crate) text_at: usize,
}

impl Element {
    pub(crate) fn attribute(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.as_str())
    }

    /// Returns the children of that name.
    pub(crate) fn named<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Element> {
        self.children.iter().filter(move |child| child.name == name)
    }
}

/// Parses the elements of a document. Returns `None` after reporting a mistake.
pub(crate) fn parse(text: &str, report: &mut Report) -> Option<Vec<Element>> {
    let mut reader = Reader {
        text,
        at: 0,
        open: vec![Element::default()],
    };
    match reader.document() {
        Ok(()) => reader.open.pop().map(|root| root.children),
        Err(wrong) => {
            report.mistake(wrong.at, wrong.message, wrong.help);
            None
        }
    }
}

/// A syntax error in XML: its position and a message.
struct SyntaxError {
    at: usize,
    message: String,
    help: &'static str,
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
    /// The stack of open elements; the first one represents the document.
    open: Vec<Element>,
}

impl Reader<'_> {
    fn syntax_error<T>(
        &self,
        message: impl Into<String>,
        help: &'static str,
    ) -> Result<T, SyntaxError> {
        Err(SyntaxError {
            at: self.at,
            message: message.into(),
            help,
        })
    }

    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    /// Skips everything up to and including `end`.
    fn skip_past(&mut self, end: &str, what: &str) -> Result<(), SyntaxError> {
        match self.rest().find(end) {
            Some(offset) => {
                self.at += offset + end.len();
                Ok(())
            }
            None => self.syntax_error(format!("this {what} has no end"), "the file may be cut off"),
        }
    }

    fn document(&mut self) -> Result<(), SyntaxError> {
        while self.at < self.text.len() {
            if self.rest().starts_with("<!--") {
                self.skip_past("-->", "comment")?;
            } else if self.rest().starts_with("<![CDATA[") {
                self.character_data()?;
            } else if self.rest().starts_with("<?") {
                self.skip_past("?>", "processing instruction")?;
            } else if self.rest().starts_with("<!") {
                self.document_type()?;
            } else if self.rest().starts_with("</") {
                self.end_tag()?;
            } else if self.rest().starts_with('<') {
                self.start_tag()?;
            } else {
                self.characters()?;
            }
        }
        if self.open.len() > 1 {
            let name = &self.open[self.open.len() - 1].name;
            return self.syntax_error(
                format!("the element `{name}` is not closed"),
                "the file may be cut off",
            );
        }
        Ok(())
    }

    /// Skips `<!DOCTYPE …>`, possibly with declarations in brackets.
    fn document_type(&mut self) -> Result<(), SyntaxError> {
        let rest = self.rest();
        let first = rest.find('>');
        let bracket = rest
            .find('[')
            .filter(|&at| first.is_none_or(|end| at < end));
        if bracket.is_some() {
            self.skip_past("]", "document type")?;
        }
        self.skip_past(">", "document type")
    }

    fn character_data(&mut self) -> Result<(), SyntaxError> {
        let start = self.at + "<![CDATA[".len();
        let Some(length) = self.text[start..].find("]]>") else {
            return self.syntax_error("this CDATA section has no end", "the file may be cut off");
        };
        let data = self.text[start..start + length].to_owned();
        self.push_text(&data, start);
        self.at = start + length + "]]>".len();
        Ok(())
    }

    fn characters(&mut self) -> Result<(), SyntaxError> {
        let length = self.rest().find('<').unwrap_or(self.rest().len());
        let start = self.at;
        let text = self.resolve_references(start, start + length)?;
        self.at = start;
        if self.open.len() == 1 && !text.trim().is_empty() {
            self.at += self.rest().len() - self.rest().trim_start().len();
            return self.syntax_error(
                "there is text outside of all elements",
                "the file begins with `<graphml …>` and ends with `</graphml>`",
            );
        }
        self.push_text(&text, start);
        self.at = start + length;
        Ok(())
    }

    fn push_text(&mut self, text: &str, at: usize) {
        if let Some(element) = self.open.last_mut() {
            if element.text.is_empty() {
                element.text_at = at + (text.len() - text.trim_start().len());
            }
            element.text.push_str(text);
        }
    }

    fn end_tag(&mut self) -> Result<(), SyntaxError> {
        let start = self.at + 2;
        let Some(length) = self.text[start..].find('>') else {
            return self.syntax_error("this tag has no end", "the file may be cut off");
        };
        let name = local(self.text[start..start + length].trim());
        let closed = if self.open.len() > 1 {
            self.open.pop()
        } else {
            None
        };
        let Some(element) = closed else {
            return self.syntax_error(
                format!("`</{name}>` has no matching start tag"),
                "remove it, or add the start tag before it",
            );
        };
        if element.name != name {
            return self.syntax_error(
                format!("expected `</{}>`, found `</{name}>`", element.name),
                "close the innermost element first",
            );
        }
        self.at = start + length + 1;
        self.push_child(element);
        Ok(())
    }

    fn push_child(&mut self, element: Element) {
        if let Some(parent) = self.open.last_mut() {
            parent.children.push(element);
        }
    }

    fn start_tag(&mut self) -> Result<(), SyntaxError> {
        let begin = self.at;
        self.at += 1;
        let name = self.name();
        if name.is_empty() {
            self.at = begin;
            return self.syntax_error(
                "this `<` does not begin a tag",
                "write `&lt;` for the character",
            );
        }
        let mut element = Element {
            at: begin,
            name,
            ..Element::default()
        };
        loop {
            self.skip_space();
            if self.rest().starts_with("/>") {
                self.at += 2;
                self.push_child(element);
                return Ok(());
            }
            if self.rest().starts_with('>') {
                self.at += 1;
                break;
            }
            let attribute = self.attribute()?;
            element.attributes.push(attribute);
        }
        if self.open.len() > DEEPEST {
            self.at = begin;
            return self.syntax_error("elements are nested too deeply", "flatten them");
        }
        self.open.push(element);
        Ok(())
    }

    fn attribute(&mut self) -> Result<(String, String), SyntaxError> {
        let name = self.name();
        self.skip_space();
        if name.is_empty() || !self.rest().starts_with('=') {
            return self.syntax_error(
                "this is neither an attribute nor the end of the tag",
                "write `name=\"value\"`",
            );
        }
        self.at += 1;
        self.skip_space();
        let Some(quote @ ('"' | '\'')) = self.rest().chars().next() else {
            return self.syntax_error("this value has no quotes", "write `name=\"value\"`");
        };
        let start = self.at + 1;
        let Some(length) = self.text[start..].find(quote) else {
            return self.syntax_error("this value has no end", "add a quote");
        };
        let value = self.resolve_references(start, start + length)?;
        self.at = start + length + 1;
        Ok((name, value))
    }

    fn name(&mut self) -> String {
        let is_part = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | ':');
        let rest = self.rest();
        let length = rest.find(|c| !is_part(c)).unwrap_or(rest.len());
        let name = local(&rest[..length]);
        self.at += length;
        name
    }

    fn skip_space(&mut self) {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_start().len();
    }

    /// Returns a part of the text with its character references resolved.
    fn resolve_references(&mut self, start: usize, end: usize) -> Result<String, SyntaxError> {
        let text = &self.text[start..end];
        if !text.contains('&') {
            return Ok(text.to_owned());
        }
        let mut resolved = String::new();
        let mut rest = text;
        while let Some(at) = rest.find('&') {
            resolved.push_str(&rest[..at]);
            rest = &rest[at + 1..];
            let known = rest.find(';').and_then(|end| {
                let letter = reference(&rest[..end])?;
                Some((letter, end + 1))
            });
            let Some((letter, length)) = known else {
                self.at = end - rest.len() - 1;
                return self.syntax_error(
                    "this `&` does not begin a known character reference",
                    "write `&amp;` for the character itself",
                );
            };
            resolved.push(letter);
            rest = &rest[length..];
        }
        resolved.push_str(rest);
        Ok(resolved)
    }
}

/// Returns a name without its prefix.
fn local(name: &str) -> String {
    name.rsplit(':').next().unwrap_or_default().to_owned()
}

/// Returns the character that `&name;` encodes.
fn reference(name: &str) -> Option<char> {
    match name {
        "lt" => Some('<'),
        "gt" => Some('>'),
        "amp" => Some('&'),
        "quot" => Some('"'),
        "apos" => Some('\''),
        _ => {
            let digits = name.strip_prefix('#')?;
            let code = match digits.strip_prefix(['x', 'X']) {
                Some(digits) => u32::from_str_radix(digits, 16),
                None => digits.parse(),
            };
            code.ok().and_then(char::from_u32)
        }
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
    fn unused_constructs_are_skipped() {
        let text = "<?xml version='1.0'?>\n<!DOCTYPE g [<!ENTITY a 'b'>]>\n<!-- <x> -->\
                    <x:g a='1 &lt; 2' b=\"'\"><n/>t&#233;<![CDATA[<&]]></x:g>";
        let elements = parse(text, &mut Report::new(&text.into())).expect("right");
        let [g] = &elements[..] else {
            panic!("one element")
        };
        assert_eq!(g.name, "g");
        assert_eq!(g.attribute("a"), Some("1 < 2"));
        assert_eq!(g.attribute("b"), Some("'"));
        assert_eq!(g.text, "té<&");
        assert_eq!(g.named("n").count(), 1);
    }

    #[test]
    fn syntax_errors_have_positions() {
        assert!(
            refused("<a>\n<b></a>").starts_with("text:2:4: error: expected `</b>`, found `</a>`")
        );
        assert!(refused("<a>").contains("the element `a` is not closed"));
        assert!(refused("</a>").starts_with("text:1:1: error: `</a>` has no matching start tag"));
        assert!(refused("<a b=c/>").starts_with("text:1:6: error: this value has no quotes"));
        assert!(refused("<a b/>").contains("neither an attribute"));
        assert!(
            refused("<a>&x;</a>")
                .starts_with("text:1:4: error: this `&` does not begin a known character")
        );
        assert!(refused("<!-- a").contains("this comment has no end"));
        assert!(refused("a <b/>").contains("text outside of all elements"));
        assert!(refused(&"<a>".repeat(100_000)).contains("nested too deeply"));
    }
}
