//! Incremental parser of a planner's output.
//!
//! Nothing is assumed about the program: it may print without end, without line breaks, or bytes
//! that are not text. All memory is bounded.

use std::collections::VecDeque;

use elbowroom_pddl::LineKind;

use super::registry::ExitPhrases;

/// Maximum length of a line; the rest is cut.
const LONGEST_LINE: usize = 64 << 10;
/// Maximum length of a plan. Longer plans are cut, and then rejected by the validator.
const LONGEST_PLAN: usize = 16 << 20;
/// Maximum length of the excerpt from the end of the output.
const EXCERPT: usize = 2000;

/// Parser of one output stream.
#[derive(Debug)]
pub(super) struct OutputParser {
    exit_phrases: ExitPhrases,
    line: Vec<u8>,
    /// The current plan: its timed actions so far, and lines that begin like one.
    plan: String,
    /// `true` if it contains an action.
    is_plan: bool,
    /// Length of the part of the plan that was already reported.
    reported_length: usize,
    /// Actions without times. They are the plan if there is none with times.
    untimed: String,
    has_timed: bool,
    tail: VecDeque<u8>,
    /// Known phrases found in the output.
    pub(super) phrases: FoundPhrases,
    /// Number of bytes read.
    pub(super) bytes: u64,
}

/// The first line with a phrase of each kind.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct FoundPhrases {
    pub(super) unsolvable: Option<String>,
    pub(super) gave_up: Option<String>,
    pub(super) unsupported: Option<String>,
    pub(super) missing: Option<String>,
    pub(super) out_of_memory: Option<String>,
}

/// Messages of programs that run out of memory.
const OUT_OF_MEMORY: &[&str] = &[
    "bad_alloc",
    "out of memory",
    "outofmemoryerror",
    "memoryerror",
    "cannot allocate memory",
    "memory allocation of",
    "memory exhausted",
];

impl OutputParser {
    pub(super) fn new(habits: ExitPhrases) -> Self {
        Self {
            exit_phrases: habits,
            line: Vec::new(),
            plan: String::new(),
            is_plan: false,
            reported_length: 0,
            untimed: String::new(),
            has_timed: false,
            tail: VecDeque::new(),
            phrases: FoundPhrases::default(),
            bytes: 0,
        }
    }

    /// Parses more output. `found` receives each plan that seems complete.
    pub(super) fn feed(&mut self, bytes: &[u8], found: &mut impl FnMut(String)) {
        self.bytes += bytes.len() as u64;
        let kept = &bytes[bytes.len().saturating_sub(EXCERPT)..];
        self.tail.extend(kept);
        let excess = self.tail.len().saturating_sub(EXCERPT);
        self.tail.drain(..excess);
        for piece in bytes.split_inclusive(|&byte| byte == b'\n') {
            let room = LONGEST_LINE.saturating_sub(self.line.len());
            self.line.extend(&piece[..piece.len().min(room)]);
            if piece.ends_with(b"\n") {
                let line = std::mem::take(&mut self.line);
                self.line(&String::from_utf8_lossy(&line), found);
            }
        }
    }

    /// Ends the output. Actions without times count as a plan only if the planner ended
    /// `by_itself`.
    pub(super) fn finish(&mut self, by_itself: bool, found: &mut impl FnMut(String)) {
        let line = std::mem::take(&mut self.line);
        self.line(&String::from_utf8_lossy(&line), found);
        self.report_plan(found);
        if by_itself && !self.has_timed && !self.untimed.is_empty() {
            found(std::mem::take(&mut self.untimed));
        }
    }

    /// Returns the end of the output as printable text.
    pub(super) fn excerpt(&self) -> String {
        let bytes: Vec<u8> = self.tail.iter().copied().collect();
        let text = String::from_utf8_lossy(&bytes);
        let shown = |c: char| match c {
            '\n' | '\t' => c,
            c if c.is_control() => '\u{fffd}',
            c => c,
        };
        text.trim().chars().map(shown).collect()
    }

    /// Parses a line. A carriage return inside it also ends a line.
    fn line(&mut self, line: &str, found: &mut impl FnMut(String)) {
        for part in line.trim_end().split('\r') {
            self.part(part, found);
        }
    }

    fn part(&mut self, line: &str, found: &mut impl FnMut(String)) {
        match LineKind::of(line) {
            kind @ (LineKind::Timed | LineKind::Broken) => {
                self.is_plan |= kind == LineKind::Timed;
                self.has_timed |= self.is_plan;
                if self.plan.len() + line.len() <= LONGEST_PLAN {
                    self.plan.push_str(line.trim_end());
                    self.plan.push('\n');
                }
            }
            // The plan may continue after a blank line. It is then reported again, with more
            // actions.
            LineKind::Blank => self.report_plan(found),
            LineKind::Separator | LineKind::Noise => {
                self.report_plan(found);
                self.plan.clear();
                self.is_plan = false;
                self.reported_length = 0;
                self.find_phrases(line);
            }
            LineKind::Untimed => {
                if self.untimed.len() + line.len() <= LONGEST_PLAN {
                    self.untimed.push_str(line.trim_end());
                    self.untimed.push('\n');
                }
            }
        }
        // Comments may contain known phrases.
        if line.trim_start().starts_with(';') {
            self.find_phrases(line);
        }
    }

    fn report_plan(&mut self, found: &mut impl FnMut(String)) {
        if self.is_plan && self.plan.len() > self.reported_length {
            self.reported_length = self.plan.len();
            found(self.plan.clone());
        }
    }

    fn find_phrases(&mut self, line: &str) {
        let text = line.to_lowercase();
        let said = |phrases: &[&str]| phrases.iter().any(|phrase| text.contains(phrase));
        let heard = [
            (&mut self.phrases.unsolvable, self.exit_phrases.unsolvable),
            (&mut self.phrases.gave_up, self.exit_phrases.gave_up),
            (&mut self.phrases.unsupported, self.exit_phrases.unsupported),
            (&mut self.phrases.missing, self.exit_phrases.missing),
            (&mut self.phrases.out_of_memory, OUT_OF_MEMORY),
        ];
        for (saying, phrases) in heard {
            if saying.is_none() && said(phrases) {
                *saying = Some(shortened(line.trim()));
            }
        }
    }
}

/// Returns the line, shortened if it is long.
fn shortened(line: &str) -> String {
    const LONGEST: usize = 300;
    match line.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEST_PHRASES: ExitPhrases = ExitPhrases {
        unsolvable: &["problem unsolvable"],
        gave_up: &["search limit"],
        unsupported: &[],
        missing: &[],
    };

    /// Returns the plans in a text that arrives in pieces of `size` bytes.
    fn plans(text: &[u8], size: usize) -> (Vec<String>, OutputParser) {
        let mut log = OutputParser::new(TEST_PHRASES);
        let mut plans = Vec::new();
        for piece in text.chunks(size) {
            log.feed(piece, &mut |plan| plans.push(plan));
        }
        log.finish(true, &mut |plan| plans.push(plan));
        (plans, log)
    }

    #[test]
    fn each_plan_is_reported_for_any_chunking() {
        let text = b"b (1.000 | 0.100)(G)
; Plan found with metric 3.000
; Time 0.01
0.000: (a x)  [1.000]
1.001: (b)  [2.000]

 * All goal deadlines now no later than 3.000
0.000: (c)  [1.000]
;;;; Solution Found
0.500: (c)  [0.500]";
        for size in [1, 7, 4096] {
            let (plans, log) = plans(text, size);
            assert_eq!(
                plans,
                [
                    "0.000: (a x)  [1.000]\n1.001: (b)  [2.000]\n",
                    "0.000: (c)  [1.000]\n",
                    "0.500: (c)  [0.500]\n"
                ]
            );
            assert_eq!(log.bytes, text.len() as u64);
        }
    }

    #[test]
    fn malformed_line_is_reported_only_between_actions() {
        let (plans, _) = plans(b"0: (a\n1: (b)\nnoise\n2: (c\n", 100);
        assert_eq!(plans, ["0: (a\n1: (b)\n"]);
    }

    #[test]
    fn a_plan_without_times_counts_if_there_is_no_other() {
        let (classical, _) = plans(b"step 1\n(a)\n(b)\n", 100);
        assert_eq!(classical, ["(a)\n(b)\n"]);
        let (timed, _) = plans(b"(goal reached)\n0: (a)\n", 100);
        assert_eq!(timed, ["0: (a)\n"]);
    }

    #[test]
    fn phrases_are_found_in_comments_and_plain_lines() {
        let (_, log) = plans(b";; Problem UNSOLVABLE!\nSearch limit exceeded\n", 5);
        let sayings = log.phrases;
        assert_eq!(
            sayings.unsolvable.as_deref(),
            Some(";; Problem UNSOLVABLE!")
        );
        assert_eq!(sayings.gave_up.as_deref(), Some("Search limit exceeded"));
        assert_eq!(sayings.unsupported, None);
    }

    #[test]
    fn endless_output_is_kept_in_little_memory() {
        let mut log = OutputParser::new(TEST_PHRASES);
        let mut ignore = |_| {};
        for _ in 0..1000 {
            log.feed(&[b'x'; 10_000], &mut ignore);
            log.feed(&[0xff; 10_000], &mut ignore);
        }
        assert!(log.line.capacity() <= 2 * LONGEST_LINE);
        for _ in 0..30_000 {
            log.feed(b"0: (a b c) [1]\n(a b c)\n", &mut ignore);
            log.feed(b"0:", &mut ignore);
        }
        assert!(log.plan.len() <= LONGEST_PLAN && log.untimed.len() <= LONGEST_PLAN);
        assert!(log.tail.len() <= EXCERPT);
        assert!(log.excerpt().len() <= 3 * EXCERPT);
    }
}
