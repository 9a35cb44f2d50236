//! Text for consoles: layout, styles, wrapped lines, and the table of tolerances.
//!
//! Texts contain escape sequences for styles. The program that prints them removes those that its output does not
//! support.

pub mod tolerance_table;
mod wrap;

use anstyle::{AnsiColor, Style};

pub use wrap::{push_paragraph, push_wrapped, wrap};

/// Layout of text: width and character set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextLayout {
    /// Maximum number of columns.
    pub width: usize,
    /// `true` if characters beyond ASCII may be used.
    pub unicode: bool,
}

impl TextLayout {
    /// Layout of plain text, for pipes and files.
    pub const PLAIN: Self = Self {
        width: 80,
        unicode: false,
    };
}

/// Style of headings and results.
pub const EMPHASIS: Style = Style::new().bold();
/// Style of secondary information.
pub const SECONDARY: Style = Style::new().dimmed();
/// Style of success.
pub const SUCCESS: Style = AnsiColor::Green.on_default().bold();
/// Style of errors.
pub const ERROR: Style = AnsiColor::Red.on_default().bold();
/// Style of warnings.
pub const WARNING: Style = AnsiColor::Yellow.on_default().bold();
/// Style of advice.
pub const HINT: Style = AnsiColor::Cyan.on_default().bold();

/// Returns the text with escape sequences for a style. They are removed if the output does not
/// support colours.
pub fn styled(style: Style, text: &str) -> String {
    if text.is_empty() {
        return String::new();
    }
    format!("{style}{text}{style:#}")
}

/// Returns a count with its noun: `1 check`, `2 checks`.
pub fn count_with_noun(count: usize, what: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {what}{plural}")
}
