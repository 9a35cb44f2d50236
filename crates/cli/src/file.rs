//! Text files.

use std::fs;
use std::io::{self, ErrorKind, IsTerminal, Read};
use std::path::Path;

use elbowroom::text::Source;

use crate::exit::Failure;
use crate::output;
use elbowroom_executive::messages::io_error_message;

/// Maximum size of a file, in bytes: larger than any plan or problem, smaller than memory.
const LARGEST_FILE: u64 = 256 << 20;

/// Reads a text file, or standard input for `-`.
pub(crate) fn source(path: &Path, what: &str) -> Result<Source, Failure> {
    if path.as_os_str() == "-" {
        if io::stdin().is_terminal() {
            output::print_to_stderr(&format!("reading the {what} from standard input"));
        }
        let mut bytes = Vec::new();
        let read = io::stdin()
            .lock()
            .take(LARGEST_FILE)
            .read_to_end(&mut bytes);
        return match read {
            Ok(_) => Ok(Source::from_bytes("standard input", &bytes)),
            Err(error) => Err(Failure::new(
                format!(
                    "cannot read the {what} from standard input: {}",
                    io_error_message(&error)
                ),
                "",
            )),
        };
    }
    let refused = |error: &io::Error| {
        Failure::new(
            format!(
                "cannot read the {what} {}: {}",
                path.display(),
                io_error_message(error)
            ),
            advice(path, what, error),
        )
    };
    let size = fs::metadata(path).map_err(|error| refused(&error))?.len();
    if size > LARGEST_FILE {
        return Err(Failure::new(
            format!("the {what} {} is too large", path.display()),
            "give a text file; this one has more than 256 MB",
        ));
    }
    let bytes = fs::read(path).map_err(|error| refused(&error))?;
    Ok(Source::from_bytes(path.display().to_string(), &bytes))
}

/// Returns advice on a file that cannot be read.
fn advice(path: &Path, what: &str, error: &io::Error) -> String {
    match error.kind() {
        ErrorKind::NotFound => {
            let parent = path
                .parent()
                .filter(|folder| !folder.as_os_str().is_empty());
            match parent {
                Some(folder) if !folder.is_dir() => {
                    format!("the folder {} does not exist", folder.display())
                }
                _ => similar_file(path).map_or_else(
                    || match what {
                        "domain" | "problem" => {
                            "check the path; the order is DOMAIN PROBLEM PLAN".to_owned()
                        }
                        _ => "check the path".to_owned(),
                    },
                    |name| format!("did you mean {name}?"),
                ),
            }
        }
        ErrorKind::PermissionDenied => {
            "reading it is not permitted; check its permissions".to_owned()
        }
        _ if path.is_dir() => "it is a folder; name a file in it".to_owned(),
        _ => String::new(),
    }
}

/// Returns a file in the same folder whose name differs only in extension or case.
fn similar_file(path: &Path) -> Option<String> {
    let stem = path.file_stem()?.to_str()?.to_ascii_lowercase();
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut names: Vec<_> = fs::read_dir(folder)
        .ok()?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| {
            Path::new(name)
                .file_stem()
                .and_then(|other| other.to_str())
                .is_some_and(|other| other.eq_ignore_ascii_case(&stem))
        })
        .collect();
    names.sort();
    let name = names.into_iter().next()?;
    Some(path.with_file_name(name).display().to_string())
}
