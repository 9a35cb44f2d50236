//! Properties of the output device: width, character set and colours.

use std::env;
use std::io::{self, IsTerminal};

use anstyle::{AnsiColor, Style};

/// Width assumed without a terminal.
const DEFAULT_WIDTH: usize = 80;
/// Maximum width; longer lines are hard to read.
const MAX_WIDTH: usize = 110;

/// Layout of text: width and character set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TextLayout {
    /// Maximum number of columns.
    pub(crate) width: usize,
    /// `true` if characters beyond ASCII may be used.
    pub(crate) unicode: bool,
}

impl TextLayout {
    /// Layout of plain text, for pipes and files.
    pub(crate) const PLAIN: Self = Self {
        width: DEFAULT_WIDTH,
        unicode: false,
    };

    /// Returns the layout for standard output.
    pub(crate) fn of_stdout() -> Self {
        if !io::stdout().is_terminal() {
            return Self::PLAIN;
        }
        let width = columns().unwrap_or(DEFAULT_WIDTH);
        Self {
            width: width.clamp(40, MAX_WIDTH),
            unicode: locale_is_utf8(),
        }
    }
}

/// Returns the width of the terminal on standard output, or `None` if it is not a terminal or does
/// not report its width.
pub(crate) fn columns() -> Option<usize> {
    if !io::stdout().is_terminal() {
        return None;
    }
    let known = terminal_size::terminal_size().map(|(width, _)| usize::from(width.0));
    // A terminal without a height (serial line, `script`) can still have a width.
    #[cfg(unix)]
    let known = known.or_else(|| {
        let size = rustix::termios::tcgetwinsize(io::stdout()).ok()?;
        Some(usize::from(size.ws_col)).filter(|width| *width > 0)
    });
    known
}

/// Returns `true` if the locale's character encoding is UTF-8. The variables are read in POSIX
/// order.
fn locale_is_utf8() -> bool {
    let locale = ["LC_ALL", "LC_CTYPE", "LANG"]
        .iter()
        .filter_map(|name| env::var(name).ok())
        .find(|value| !value.is_empty());
    match locale {
        Some(locale) => {
            let locale = locale.to_ascii_lowercase();
            locale.contains("utf-8") || locale.contains("utf8")
        }
        None => cfg!(windows),
    }
}

/// Style of headings and results.
pub(crate) const EMPHASIS: Style = Style::new().bold();
/// Style of secondary information.
pub(crate) const SECONDARY: Style = Style::new().dimmed();
/// Style of success.
pub(crate) const SUCCESS: Style = AnsiColor::Green.on_default().bold();
/// Style of errors.
pub(crate) const ERROR: Style = AnsiColor::Red.on_default().bold();
/// Style of warnings.
pub(crate) const WARNING: Style = AnsiColor::Yellow.on_default().bold();
/// Style of advice.
pub(crate) const HINT: Style = AnsiColor::Cyan.on_default().bold();

/// Returns the text with escape sequences for a style. They are removed if the output does not
/// support colours.
pub(crate) fn styled(style: Style, text: &str) -> String {
    if text.is_empty() {
        return String::new();
    }
    format!("{style}{text}{style:#}")
}
