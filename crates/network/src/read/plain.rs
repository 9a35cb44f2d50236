//! Sections of plain text under headings that begin with `#`.
//!
//! ```text
//! # KIND OF NETWORK
//! STNU
//! # Num Time-Points
//! 3
//! # Num Ordinary Edges
//! 1
//! # Num Contingent Links
//! 1
//! # Time-Point Names
//! A C X
//! # Ordinary Edges
//! X 12 C
//! # Contingent Links
//! A 1 3 C
//! ```
//!
//! `X 12 C` means `C - X <= 12`, and `A 1 3 C` means that C happens 1 to 3 after A. Names may be
//! quoted.

use crate::builder::{Builder, GivenLink};
use crate::file::{Format, NetworkFile};
use crate::number::Bound;
use crate::report::Report;

/// The section that a line belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Section {
    Kind,
    Count(HeaderCount),
    Names,
    Edges,
    Links,
}

/// A count in the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum HeaderCount {
    Points,
    Edges,
    Links,
}

impl Section {
    fn of(heading: &str) -> Option<Self> {
        let words: Vec<String> = heading
            .split(|c: char| !c.is_alphanumeric())
            .filter(|word| !word.is_empty())
            .map(str::to_ascii_lowercase)
            .collect();
        let has = |word: &str| words.iter().any(|other| other == word);
        let counts = has("num") || has("number");
        Some(match () {
            () if has("kind") => Self::Kind,
            () if has("points") && counts => Self::Count(HeaderCount::Points),
            () if has("edges") && counts => Self::Count(HeaderCount::Edges),
            () if has("links") && counts => Self::Count(HeaderCount::Links),
            () if has("names") => Self::Names,
            () if has("edges") => Self::Edges,
            () if has("links") => Self::Links,
            () => return None,
        })
    }
}

/// The state of the reader.
struct Reader {
    builder: Builder,
    /// Numbers of time points, edges and links that the file declares, with the positions of these
    /// declarations.
    declared_counts: Vec<(HeaderCount, usize, usize)>,
    edges: usize,
    links: usize,
}

pub(super) fn read(text: &str, report: &mut Report) -> Option<NetworkFile> {
    let mut reader = Reader {
        builder: Builder::new(Format::Plain),
        declared_counts: Vec::new(),
        edges: 0,
        links: 0,
    };
    let mut section = None;
    let mut at = 0;
    for line in text.split('\n') {
        let words = words(line, at);
        match words.first() {
            None => {}
            Some((place, word)) if word.starts_with('#') => {
                section = Section::of(line);
                if section.is_none() {
                    report.mistake(
                        *place,
                        "unknown heading",
                        "expected the kind of network, or the numbers or names of time points, \
                         ordinary edges and contingent links",
                    );
                }
            }
            Some(_) => reader.line(section, &words, report),
        }
        at += line.len() + 1;
    }
    reader.check_counts(report);
    let builder = &mut reader.builder;
    builder.reference = builder.find("Z").or_else(|| builder.find("0"));
    reader.builder.finish(report)
}

/// Returns the words of a line without their quotes, with their positions.
fn words(line: &str, begin: usize) -> Vec<(usize, &str)> {
    let start = line.as_ptr() as usize;
    line.split_whitespace()
        .map(|word| {
            let at = begin + (word.as_ptr() as usize - start);
            let bare = ['\'', '"'].iter().find_map(|&quote| {
                let inner = word.strip_prefix(quote)?;
                inner.strip_suffix(quote)
            });
            (at, bare.unwrap_or(word))
        })
        .collect()
}

impl Reader {
    fn line(&mut self, section: Option<Section>, words: &[(usize, &str)], report: &mut Report) {
        let (at, first) = words[0];
        match section {
            None => {}
            Some(Section::Kind) => {
                let is_known = ["STN", "STNU"]
                    .iter()
                    .any(|kind| kind.eq_ignore_ascii_case(first));
                if !is_known {
                    report.mistake(
                        at,
                        format!("networks of the kind {first} are not supported"),
                        super::REFUSED_HELP,
                    );
                }
            }
            Some(Section::Count(what)) => match first.parse() {
                Ok(count) => self.declared_counts.push((what, count, at)),
                Err(_) => report.mistake(at, "this is not a count", "write a whole number"),
            },
            Some(Section::Names) => {
                for (at, name) in words {
                    self.builder.point(name, *at, report);
                }
            }
            Some(Section::Edges) => self.edge(words, report),
            Some(Section::Links) => self.link(words, report),
        }
    }

    fn edge(&mut self, words: &[(usize, &str)], report: &mut Report) {
        self.edges += 1;
        let [(from_at, from), (most_at, most), (to_at, to)] = words[..] else {
            report.mistake(
                words[0].0,
                "this is not an edge",
                "write `X 12 C`: C comes at most 12 after X",
            );
            return;
        };
        let from = self.builder.named(from, from_at, report);
        let to = self.builder.named(to, to_at, report);
        let most = number(most, most_at, report);
        if let (Some(from), Some(to), Some(most)) = (from, to, most) {
            let bounds = (Bound::NegativeInfinity, most);
            self.builder
                .requirement((from, to), bounds, most_at, report);
        }
    }

    fn link(&mut self, words: &[(usize, &str)], report: &mut Report) {
        self.links += 1;
        let [
            (begin_at, begin),
            (least_at, least),
            (most_at, most),
            (end_at, end),
        ] = words[..]
        else {
            report.mistake(
                words[0].0,
                "this is not a contingent link",
                "write `A 1 3 C`: C comes 1 to 3 after A",
            );
            return;
        };
        let activation = self.builder.named(begin, begin_at, report);
        let end = self.builder.named(end, end_at, report);
        let lower = number(least, least_at, report);
        let upper = number(most, most_at, report);
        if let (Some(activation), Some(end), Some(lower), Some(upper)) =
            (activation, end, lower, upper)
        {
            let link = GivenLink {
                at: begin_at,
                activation,
                end,
                lower,
                upper,
                duration: None,
            };
            self.builder.link(link, report);
        }
    }

    /// Compares the declared counts with the actual ones. A wrong count may mean that the file is
    /// truncated, but the network can still be used, so it is only a remark.
    fn check_counts(&self, report: &mut Report) {
        for &(what, announced, at) in &self.declared_counts {
            let (found, name) = match what {
                HeaderCount::Points => (self.builder.nodes().count(), "time points"),
                HeaderCount::Edges => (self.edges, "ordinary edges"),
                HeaderCount::Links => (self.links, "contingent links"),
            };
            if found == 0 && announced > 0 {
                report.mistake(
                    at,
                    format!("the file announces {announced} {name}, but contains none"),
                    "the file may be cut off",
                );
            } else if found != announced {
                report.remark(format!(
                    "the file announces {announced} {name}, but contains {found}"
                ));
            }
        }
    }
}

fn number(text: &str, at: usize, report: &mut Report) -> Option<Bound> {
    let read = Bound::parse(text);
    if read.is_none() {
        report.mistake(
            at,
            format!("`{text}` is not a number"),
            "write a decimal such as 12.5",
        );
    }
    read
}
