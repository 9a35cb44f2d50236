//! Z3 process that reads SMT-LIB text.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use crate::second_oracle::setting;

/// A running solver.
pub(crate) struct Z3 {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    milliseconds: u64,
}

/// Result of a satisfiability check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Found {
    Model,
    NoModel,
    /// The query took too long, or is beyond the solver.
    Unknown,
}

/// Python program that prints the folder of the binary in the package `z3-solver`.
const WHEEL: &str = "import importlib.util as u, os; \
    p = os.path.dirname(u.find_spec('z3').origin); \
    print(next(c for c in (os.path.join(p, 'bin', 'z3'), \
    os.path.join(p, '..', '..', '..', '..', 'bin', 'z3')) if os.path.exists(c)))";

impl Z3 {
    /// Starts the solver; `None` if it is not installed.
    pub(crate) fn start() -> Option<Self> {
        Self::at("z3").or_else(|| {
            let output = Command::new("python3").args(["-c", WHEEL]).output().ok()?;
            let path = String::from_utf8(output.stdout).ok()?;
            Self::at(path.trim())
        })
    }

    fn at(path: &str) -> Option<Self> {
        if path.is_empty() {
            return None;
        }
        let mut child = Command::new(path)
            .arg("-in")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let input = child.stdin.take()?;
        let output = BufReader::new(child.stdout.take()?);
        Some(Self {
            child,
            input,
            output,
            milliseconds: setting("ELBOWROOM_Z3_MILLISECONDS", 3000),
        })
    }

    /// Checks whether the text, declarations and assertions, has a model.
    pub(crate) fn ask(&mut self, text: &str) -> Found {
        let question = format!(
            "(reset)\n(set-option :timeout {})\n{text}(check-sat)\n",
            self.milliseconds
        );
        self.input
            .write_all(question.as_bytes())
            .and_then(|()| self.input.flush())
            .expect("the solver is running");
        let mut answer = String::new();
        self.output.read_line(&mut answer).expect("text");
        match answer.trim() {
            "sat" => Found::Model,
            "unsat" => Found::NoModel,
            "unknown" | "timeout" => Found::Unknown,
            other => panic!("the solver says {other} of\n{text}"),
        }
    }
}

impl Drop for Z3 {
    fn drop(&mut self) {
        // The process has no state worth saving.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
