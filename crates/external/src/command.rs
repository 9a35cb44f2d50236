//! Command lines with placeholders for files.

use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// A program and its arguments, with placeholders for files and limits.
///
/// | placeholder | stands for |
/// |---|---|
/// | `{domain}`, `{problem}` | the files to read |
/// | `{plan}` | a file to write; also `{plan}.1`, `{plan}_1.SOL` and their like are read |
/// | `{time}` | the time limit in whole seconds, rounded up; a day if there is none |
/// | `{memory}` | the memory limit in MB; a million if there is none |
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Command {
    /// The program: a path, or a name to search in `PATH`.
    pub program: PathBuf,
    /// Its arguments, with placeholders.
    pub arguments: Vec<String>,
}

/// An error in a planner's command line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CommandError {
    /// It is empty.
    #[error(
        "an empty command line: write a program and its arguments, with {{domain}} and {{problem}}"
    )]
    Empty,
    /// A quotation mark is not closed.
    #[error("unbalanced {0} in the command line")]
    Unclosed(char),
    /// It lacks the placeholder of a file.
    #[error(
        "this command line has no place for the {what} file: write {{{what}}} there, as in \
         `myplanner {{domain}} {{problem}}`"
    )]
    Missing {
        /// `domain` or `problem`.
        what: &'static str,
    },
    /// It contains an unknown placeholder.
    #[error(
        "unknown placeholder `{{{0}}}`; known are {{domain}}, {{problem}}, {{plan}}, {{time}} and \
         {{memory}}"
    )]
    Unknown(String),
}

/// The values of the placeholders.
#[derive(Clone, Debug)]
pub(super) struct PlaceholderValues {
    pub(super) domain: PathBuf,
    pub(super) problem: PathBuf,
    pub(super) plan: PathBuf,
    /// Time limit in seconds.
    pub(super) time: u64,
    /// Memory limit in MB.
    pub(super) memory: u64,
}

impl Command {
    /// Splits a command line like a shell: at spaces, with quotation marks, and with backslashes
    /// that escape the next character. It is not run by a shell.
    ///
    /// # Errors
    /// If a quotation mark is not closed, or a placeholder is unknown or missing.
    pub fn parse(line: &str) -> Result<Self, CommandError> {
        let mut words = words(line)?.into_iter();
        let program = words.next().ok_or(CommandError::Empty)?;
        let arguments: Vec<String> = words.collect();
        for argument in &arguments {
            check_placeholders(argument)?;
        }
        for (what, placeholder) in [("domain", "{domain}"), ("problem", "{problem}")] {
            if !arguments.iter().any(|a| a.contains(placeholder)) {
                return Err(CommandError::Missing { what });
            }
        }
        Ok(Self {
            program: PathBuf::from(program),
            arguments,
        })
    }

    /// Returns the arguments with all placeholders replaced. Other arguments that are relative
    /// paths of existing files become absolute, because the planner runs in its own folder.
    pub(super) fn substitute(&self, filling: &PlaceholderValues) -> Vec<OsString> {
        let fill = |argument: &String| {
            if !argument.contains('{') {
                let path = Path::new(argument);
                let is_file = path.is_relative() && path.exists();
                return match std::path::absolute(path) {
                    Ok(absolute) if is_file => absolute.into_os_string(),
                    _ => OsString::from(argument),
                };
            }
            let text = argument
                .replace("{domain}", &filling.domain.to_string_lossy())
                .replace("{problem}", &filling.problem.to_string_lossy())
                .replace("{plan}", &filling.plan.to_string_lossy())
                .replace("{time}", &filling.time.to_string())
                .replace("{memory}", &filling.memory.to_string());
            OsString::from(text)
        };
        self.arguments.iter().map(fill).collect()
    }
}

/// Returns the file to start: the path itself, or the first file with that name in `PATH`.
pub(super) fn find_program(program: &Path) -> Option<PathBuf> {
    let has_folder = program.components().count() > 1;
    if has_folder {
        let path = std::path::absolute(program).ok()?;
        return is_executable(&path).then_some(path);
    }
    let folders = env::var_os("PATH")?;
    env::split_paths(&folders)
        .map(|folder| folder.join(program))
        .find(|path| is_executable(path))
        .and_then(|path| std::path::absolute(path).ok())
}

#[cfg(unix)]
fn is_executable(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    path.metadata()
        .is_ok_and(|file| file.is_file() && file.permissions().mode() & 0o111 != 0)
}

#[cfg(not(unix))]
fn is_executable(path: &Path) -> bool {
    path.is_file()
}

fn check_placeholders(argument: &str) -> Result<(), CommandError> {
    const KNOWN: &[&str] = &["domain", "problem", "plan", "time", "memory"];
    let mut rest = argument;
    while let Some(open) = rest.find('{') {
        rest = &rest[open + 1..];
        let Some(close) = rest.find('}') else {
            return Ok(());
        };
        let name = &rest[..close];
        let is_word = name.chars().all(|c| c.is_ascii_alphabetic());
        // Other braces (`{1,2}`, JSON) are passed to the planner.
        if is_word && !name.is_empty() && !KNOWN.contains(&name) {
            return Err(CommandError::Unknown(name.to_owned()));
        }
        rest = &rest[close + 1..];
    }
    Ok(())
}

/// Splits a line into words.
fn words(line: &str) -> Result<Vec<String>, CommandError> {
    let mut words = Vec::new();
    let mut word: Option<String> = None;
    let mut quote: Option<char> = None;
    let mut characters = line.chars();
    while let Some(character) = characters.next() {
        match (quote, character) {
            (Some(open), character) if character == open => quote = None,
            (None, '"' | '\'') => {
                quote = Some(character);
                word.get_or_insert_default();
            }
            (None | Some('"'), '\\') => {
                let next = characters.next().ok_or(CommandError::Unclosed('\\'))?;
                word.get_or_insert_default().push(next);
            }
            (None, character) if character.is_whitespace() => words.extend(word.take()),
            (_, character) => word.get_or_insert_default().push(character),
        }
    }
    if let Some(open) = quote {
        return Err(CommandError::Unclosed(open));
    }
    words.extend(word);
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arguments(line: &str) -> Vec<String> {
        Command::parse(line).unwrap().arguments
    }

    #[test]
    fn command_line_is_split_like_in_a_shell() {
        let command = Command::parse("'my planner' -x \"a b\" c\\ d '' {domain} -f={problem}");
        let command = command.unwrap();
        assert_eq!(command.program, Path::new("my planner"));
        assert_eq!(
            command.arguments,
            ["-x", "a b", "c d", "", "{domain}", "-f={problem}"]
        );
    }

    #[test]
    fn command_requires_file_placeholders() {
        let mistake = |line| Command::parse(line).unwrap_err().to_string();
        assert!(mistake("popf {domain}").contains("no place for the problem file"));
        assert!(mistake("popf d.pddl p.pddl").contains("no place for the domain file"));
        assert!(mistake(" ").contains("empty"));
        assert!(mistake("popf {domain} {problem} {paln}").contains("{paln}"));
        assert!(mistake("popf '{domain} {problem}").contains('\''));
    }

    #[test]
    fn unknown_braces_are_kept() {
        let line = "p {domain} {problem} {\"a\":1} {1,2} {}";
        assert_eq!(arguments(line)[2..], ["{a:1}", "{1,2}", "{}"]);
    }

    #[test]
    fn missing_program_is_not_found() {
        assert!(find_program(Path::new("sh")).is_some_and(|path| path.is_absolute()));
        assert_eq!(find_program(Path::new("no-such-planner")), None);
        assert_eq!(find_program(Path::new("./no-such-planner")), None);
    }
}
