//! Language of comments, documents, messages and test names, as CONTRIBUTING.md describes it.
//!
//! The test counts lines with words that readers stumble over. A hit is not always a mistake, so it
//! bounds shares only.

use std::fs;
use std::path::{Path, PathBuf};

use crate::workspace;

/// Words that doc comments and test names do not begin with.
const QUESTION_WORDS: [&str; 10] = [
    "what", "whether", "how", "who", "where", "why", "which", "whoever", "whatever", "wherever",
];

/// Phrases to avoid, in lower case, between spaces.
const PHRASES: [&str; 52] = [
    "what is",
    "what was",
    "what are",
    "what has",
    "what had",
    "what it",
    "what they",
    "what can",
    "what could",
    "what comes",
    "what no",
    "who",
    "whoever",
    "nobody",
    "somebody",
    "everybody",
    "those who",
    "told",
    "tell",
    "tells",
    "heed",
    "heeds",
    "reckon",
    "reckons",
    "bears",
    "borne",
    "under way",
    "go on",
    "goes on",
    "go by",
    "goes by",
    "gone on",
    "take up",
    "takes up",
    "taken up",
    "give up",
    "gives up",
    "given up",
    "let go",
    "lets go",
    "comes of",
    "becomes of",
    "so many",
    "so long",
    "anew",
    "amid",
    "by turns",
    "all the same",
    "it is said",
    "of which",
    "by which",
    "in which",
];

/// Number of texts and of those with a hit.
#[derive(Debug, Default)]
struct Share {
    all: usize,
    hits: Vec<String>,
}

impl Share {
    fn count(&mut self, text: &str, is_hit: bool, place: impl FnOnce() -> String) {
        self.all += 1;
        if is_hit {
            self.hits.push(format!("{}: {}", place(), text.trim()));
        }
    }

    fn assert_at_most(&self, percent: usize, kind: &str) {
        assert!(self.all > 100, "only {} {kind} were found", self.all);
        assert!(
            self.hits.len() * 100 <= self.all * percent,
            "{} of {} {kind} have a phrase that CONTRIBUTING.md advises against; at most {percent} % may:\n{}",
            self.hits.len(),
            self.all,
            self.hits.join("\n")
        );
    }
}

/// Returns `true` if a text contains a phrase to avoid. Quoted code does not count.
fn has_phrase(text: &str) -> bool {
    let prose: String = text.split('`').step_by(2).collect::<Vec<_>>().join(" x ");
    let is_word = |c: char| c.is_alphanumeric() || c == '\'';
    let words: Vec<String> = prose
        .split(|c| !is_word(c))
        .filter(|word| !word.is_empty())
        .map(str::to_lowercase)
        .collect();
    let spaced = format!(" {} ", words.join(" "));
    PHRASES
        .iter()
        .any(|phrase| spaced.contains(&format!(" {phrase} ")))
}

fn begins_with_question_word(text: &str) -> bool {
    let first = text.split(|c: char| !c.is_alphanumeric()).next();
    first.is_some_and(|word| QUESTION_WORDS.contains(&word.to_lowercase().as_str()))
}

/// Returns the files below a folder with this extension, without build output.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path
            .file_name()
            .and_then(|name| name.to_str())
            .unwrap_or("");
        if path.is_dir() {
            if !matches!(name, "target" | "node_modules") && !name.starts_with('.') {
                found.extend(files(&path, extension));
            }
        } else if path.extension().is_some_and(|it| it == extension) {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Returns the string literals of a line with at least four words.
fn messages(line: &str) -> impl Iterator<Item = &str> {
    let parts = line.split('"').skip(1).step_by(2);
    parts.filter(|text| text.split_whitespace().count() >= 4)
}

#[test]
fn code_comments_and_messages_use_plain_terms() {
    let (mut comments, mut openings) = (Share::default(), Share::default());
    let (mut strings, mut tests) = (Share::default(), Share::default());
    for path in files(&workspace().join("crates"), "rs") {
        let code = fs::read_to_string(&path).expect("a text");
        let has_messages = path.components().any(|it| it.as_os_str() == "src");
        let (mut is_in_doc, mut is_test) = (false, false);
        for (index, line) in code.lines().enumerate() {
            let place = || format!("{}:{}", path.display(), index + 1);
            let line = line.trim_start();
            let doc = line.strip_prefix("///").or(line.strip_prefix("//!"));
            if let Some(comment) = doc.or(line.strip_prefix("//")) {
                let text = comment.trim_start();
                comments.count(text, has_phrase(text), place);
                if doc.is_some() && !is_in_doc {
                    openings.count(text, begins_with_question_word(text), place);
                }
            } else if has_messages {
                for text in messages(line) {
                    strings.count(text, has_phrase(text), place);
                }
            }
            if let (true, Some(name)) = (is_test, line.strip_prefix("fn ")) {
                tests.count(
                    name,
                    begins_with_question_word(&name.replace('_', " ")),
                    place,
                );
            }
            is_test = line == "#[test]" || is_test && line.starts_with("#[");
            is_in_doc = doc.is_some();
        }
    }
    comments.assert_at_most(3, "comment lines");
    openings.assert_at_most(3, "openings of doc comments");
    strings.assert_at_most(2, "messages");
    tests.assert_at_most(1, "test names");
}

#[test]
fn documents_use_plain_terms() {
    let mut lines = Share::default();
    for path in files(&workspace(), "md") {
        if path.ends_with("CHANGELOG.md") {
            continue;
        }
        let mut is_fenced = false;
        for (index, line) in fs::read_to_string(&path)
            .expect("a text")
            .lines()
            .enumerate()
        {
            if line.trim_start().starts_with("```") {
                is_fenced = !is_fenced;
            } else if !is_fenced && !line.trim().is_empty() {
                lines.count(line, has_phrase(line), || {
                    format!("{}:{}", path.display(), index + 1)
                });
            }
        }
    }
    lines.assert_at_most(2, "document lines");
}

#[test]
fn phrases_are_found_as_whole_words_outside_code() {
    assert!(has_phrase("The run goes on."));
    assert!(has_phrase("It is under\u{20}way, as it was"));
    assert!(!has_phrase("The counter `under way` is shown."));
    assert!(!has_phrase("A foretold threshold."));
    assert!(begins_with_question_word("Whether it holds"));
    assert!(!begins_with_question_word("Returns `true` if it holds"));
}
