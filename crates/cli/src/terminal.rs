//! Properties of the output device: width, character set and colours.

use std::env;
use std::io::{self, IsTerminal};

pub(crate) use elbowroom::report::console::{
    EMPHASIS, ERROR, HINT, SECONDARY, SUCCESS, TextLayout, WARNING, styled,
};

/// Maximum width; longer lines are hard to read.
const MAX_WIDTH: usize = 110;

/// Returns the layout for standard output.
pub(crate) fn stdout_layout() -> TextLayout {
    if !io::stdout().is_terminal() {
        return TextLayout::PLAIN;
    }
    let width = columns().unwrap_or(TextLayout::PLAIN.width);
    TextLayout {
        width: width.clamp(40, MAX_WIDTH),
        unicode: locale_is_utf8(),
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
