//! Rendering of a document as one HTML file.

use serde::Serialize;

use crate::document::Document;

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
/// Scripts of the page, ordered so that each one calls earlier ones only.
const SCRIPTS: &[&str] = &[
    include_str!("script/elements.js"),
    include_str!("script/table.js"),
    include_str!("script/drawing.js"),
    include_str!("script/chart.js"),
    include_str!("script/scrub.js"),
    include_str!("script/plots.js"),
    include_str!("script/points.js"),
    include_str!("script/sliders.js"),
    include_str!("script/plane.js"),
    include_str!("script/live.js"),
    include_str!("script/page.js"),
];

/// Renders the page as a self-contained file.
pub(crate) fn html(document: &Document) -> String {
    fill_template(document, &FILE)
}

/// Renders the live page of a running run, which is updated by its server.
pub(crate) fn live_html(document: &Document) -> String {
    fill_template(document, &LIVE)
}

/// Differences between a page in a file and a live page.
struct Kind {
    live: &'static str,
    reach: &'static str,
    foot: &'static str,
}

const FILE: Kind = Kind {
    live: "",
    reach: "",
    foot: "Made by Elbowroom. This page is a single file without external resources.",
};

const LIVE: Kind = Kind {
    live: " data-live",
    reach: "; connect-src 'self'",
    foot: "Served by Elbowroom while it runs the plan. <code>elbowroom report</code> makes a \
           permanent page from the run's trace.",
};

fn fill_template(document: &Document, kind: &Kind) -> String {
    let parts = [
        ("{live}", kind.live.to_owned()),
        ("{reach}", kind.reach.to_owned()),
        ("{foot}", kind.foot.to_owned()),
        ("{title}", as_text(&document.title)),
        ("{verdict}", as_text(&document.verdict.words)),
        ("{style}", STYLE.to_owned()),
        ("{data}", as_data(document)),
        ("{script}", SCRIPTS.concat()),
    ];
    // Inserted texts are not searched for placeholders, because they may contain anything.
    let mut page = String::new();
    let mut rest = TEMPLATE;
    while let Some((before, name, after)) = next(rest, &parts) {
        page.push_str(before);
        page.push_str(name);
        rest = after;
    }
    page.push_str(rest);
    page
}

/// Returns the text before the next placeholder, its replacement, and the text after it.
fn next<'a>(template: &'a str, parts: &'a [(&str, String)]) -> Option<(&'a str, &'a str, &'a str)> {
    let places = parts
        .iter()
        .filter_map(|(name, text)| Some((template.find(name)?, name, text)));
    let (position, name, text) = places.min_by_key(|(position, ..)| *position)?;
    Some((
        &template[..position],
        text,
        &template[position + name.len()..],
    ))
}

/// Escapes a text for use between tags.
fn as_text(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// Serializes a value as JSON for a script block. The result cannot end the block or begin a
/// comment.
fn as_data(value: &impl Serialize) -> String {
    let json = serde_json::to_string(value).unwrap_or_else(|_| "null".to_owned());
    let mut safe = String::with_capacity(json.len());
    for character in json.chars() {
        match character {
            '<' => safe.push_str("\\u003c"),
            '>' => safe.push_str("\\u003e"),
            '&' => safe.push_str("\\u0026"),
            '\u{2028}' => safe.push_str("\\u2028"),
            '\u{2029}' => safe.push_str("\\u2029"),
            other => safe.push(other),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::{as_data, html};
    use crate::document::{Document, Tone, Verdict};

    const HOSTILE: &str =
        "</script><script>alert(1)</script><!-- {data} {script} & \u{2028} \u{202e}";

    #[test]
    fn hostile_text_in_data_stays_valid_json() {
        let data = as_data(&HOSTILE);
        assert!(!data.contains(['<', '>', '&', '\u{2028}']));
        let read: String = serde_json::from_str(&data).unwrap();
        assert_eq!(read, HOSTILE);
    }

    #[test]
    fn inserted_text_is_not_searched_for_placeholders() {
        let document = Document {
            title: HOSTILE.to_owned(),
            verdict: Verdict {
                tone: Tone::Plain,
                words: HOSTILE.to_owned(),
            },
            facts: Vec::new(),
            sections: Vec::new(),
            texts: Vec::new(),
            is_paused: false,
            more: Vec::new(),
        };
        let page = html(&document);
        assert_eq!(page.matches("alert(1)</script>").count(), 0);
        let empty = Document {
            title: String::new(),
            verdict: Verdict {
                tone: Tone::Plain,
                words: String::new(),
            },
            ..document
        };
        let tags = |page: &str| page.matches("<script").count();
        assert_eq!(tags(&page), tags(&html(&empty)));
        let places = page.matches("{data}").count();
        assert_eq!(places, 5, "three times as text, twice in the data");
    }
}
