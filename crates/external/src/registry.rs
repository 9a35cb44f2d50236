//! Registry of known planners.

use std::env;
use std::path::{Path, PathBuf};

use super::command::{Command, CommandError, find_program};

/// A known planner: its command line and its messages.
#[derive(Debug)]
pub struct Registered {
    /// The name in requests.
    pub name: &'static str,
    /// A summary, in one sentence.
    pub summary: &'static str,
    /// The environment variable with the path of the program.
    pub variable: &'static str,
    /// The names of the program in `PATH`.
    pub programs: &'static [&'static str],
    /// Its arguments, with the placeholders of [`Command`].
    pub arguments: &'static [&'static str],
    /// Advice on how to get it.
    pub install_hint: &'static str,
    /// The phrases it prints.
    pub exit_phrases: ExitPhrases,
}

/// Phrases, in lower case, that planners print when they end without a plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExitPhrases {
    /// There is no plan. This claim of the planner is not verified.
    pub unsolvable: &'static [&'static str],
    /// The search was abandoned, or reached a limit of the planner's own.
    pub gave_up: &'static [&'static str],
    /// The planner does not support the problem.
    pub unsupported: &'static [&'static str],
    /// A required component is not installed.
    pub missing: &'static [&'static str],
}

/// The known planners, in the order of the documentation.
pub const REGISTRY: &[Registered] = &[
    Registered {
        name: "popf",
        summary: "POPF: forward chaining, partial order, linear continuous change \
                  (Coles, Coles, Fox and Long, ICAPS 2010)",
        variable: "ELBOWROOM_POPF",
        programs: &["popf", "popf3-clp", "popf2"],
        arguments: &["{domain}", "{problem}"],
        install_hint: "build it from its source (ROSPlan and PlanSys2 contain it), and put `popf` \
                       into PATH or its path into ELBOWROOM_POPF",
        exit_phrases: COLIN_FAMILY,
    },
    Registered {
        name: "optic",
        summary: "OPTIC: POPF with preferences and time-dependent costs; continues to better plans \
                  (Benton, Coles and Coles, ICAPS 2012)",
        variable: "ELBOWROOM_OPTIC",
        programs: &["optic-clp", "optic", "optic-cplex"],
        arguments: &["{domain}", "{problem}"],
        install_hint: "build it from its source, and put `optic-clp` into PATH or its path into \
                     ELBOWROOM_OPTIC",
        exit_phrases: COLIN_FAMILY,
    },
    Registered {
        name: "tfd",
        summary: "Temporal Fast Downward: forward search with context-enhanced additive heuristic \
                  (Eyerich, Mattmüller and Röger, ICAPS 2009)",
        variable: "ELBOWROOM_TFD",
        programs: &["tfd"],
        arguments: &["{domain}", "{problem}", "{plan}"],
        install_hint: "build it from its source, and put the path of its script `plan` into \
                     ELBOWROOM_TFD",
        exit_phrases: ExitPhrases {
            unsolvable: &[
                "completely explored state space -- no solution",
                "initial state is a dead end",
            ],
            gave_up: &["search stopped without finding a solution"],
            unsupported: &["not supported", "notimplementederror"],
            missing: &[],
        },
    },
    Registered {
        name: "lpg-td",
        summary: "LPG-td: local search on temporal action graphs; continues to better plans \
                  (Gerevini, Saetti and Serina, JAIR 2006)",
        variable: "ELBOWROOM_LPG",
        programs: &["lpg-td", "lpg"],
        // Happenings are separated in its plan files, but not in its printed plans. A fixed seed
        // makes it deterministic.
        arguments: &[
            "-o",
            "{domain}",
            "-f",
            "{problem}",
            "-out",
            "{plan}",
            "-n",
            "1000",
            "-seed",
            "2004",
            "-cputime",
            "{time}",
        ],
        install_hint: "`pip install up-lpg` installs the program `up_lpg/lpg`; put its path into \
                       ELBOWROOM_LPG",
        exit_phrases: ExitPhrases {
            unsolvable: &[
                "the problem is unsolvable",
                "no plan will solve it",
                "goals of the planning problem can not be reached",
            ],
            gave_up: &["search limit exceeded", "max time exceeded", "no solution"],
            unsupported: &["syntax error", "not supported", "not yet handled"],
            missing: &[],
        },
    },
];

/// The phrases of POPF and its relatives.
const COLIN_FAMILY: ExitPhrases = ExitPhrases {
    unsolvable: &[
        ";; problem unsolvable!",
        "cannot be found either in the initial state",
    ],
    gave_up: &["; problem unsolvable by ehc, and best-first search has been disabled"],
    unsupported: &[
        "this planner does not support",
        "are not supported",
        "is not supported",
        "cannot handle",
    ],
    missing: &[],
};

/// The phrases of the shim for unified-planning.
const UNIFIED_PLANNING: ExitPhrases = ExitPhrases {
    unsolvable: &["elbowroom: unsolvable"],
    gave_up: &["elbowroom: gave up"],
    unsupported: &["elbowroom: unsupported", "not supported"],
    missing: &["elbowroom: missing"],
};

/// Phrases of planners outside the registry.
const COMMON_PHRASES: ExitPhrases = ExitPhrases {
    unsolvable: &[
        "problem unsolvable",
        "problem is unsolvable",
        "no plan will solve it",
        "proven unsolvable",
        "unsolvable_proven",
        "no plan exists",
        "no solution exists",
        "completely explored state space -- no solution",
    ],
    gave_up: &[
        "search limit exceeded",
        "no plan found",
        "no solution found",
    ],
    unsupported: &["not supported", "unsupported"],
    missing: &[],
};

/// A planner to run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Planner {
    /// The name for messages.
    pub name: String,
    /// The kind of program to start.
    pub kind: Kind,
    /// Advice on how to install it.
    pub install_hint: String,
    /// The phrases it prints.
    pub exit_phrases: ExitPhrases,
}

/// The kind of program to start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A program.
    Program(Command),
    /// An engine of unified-planning, by its name there.
    UnifiedPlanning {
        /// The engine.
        engine: String,
        /// The interpreter of Python.
        python: PathBuf,
    },
}

/// An unknown planner.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlannerError {
    /// The name is not in the registry.
    #[error(
        "unknown planner `{0}`; known are {known}, up:ENGINE, and command lines such as \
         \"myplanner {{domain}} {{problem}}\"",
        known = names()
    )]
    Unknown(String),
    /// A command line that cannot be used.
    #[error(transparent)]
    Command(#[from] CommandError),
}

/// Engines with a package `up-ENGINE`. For other names no package is suggested, because one with
/// that name may be unrelated.
const ENGINES: [&str; 8] = [
    "aries",
    "tamer",
    "lpg",
    "enhsp",
    "fast-downward",
    "pyperplan",
    "symk",
    "fmap",
];

impl Planner {
    /// Returns the known planner with this name, the engine of unified-planning for `up:ENGINE`, or
    /// the program of a command line, which contains placeholders or spaces.
    ///
    /// # Errors
    /// If the name is unknown, or the command line lacks the placeholder of a file.
    pub fn named(text: &str) -> Result<Self, PlannerError> {
        let text = text.trim();
        if let Some(engine) = text.strip_prefix("up:") {
            return Ok(Self::unified_planning(engine.trim()));
        }
        if let Some(known) = REGISTRY.iter().find(|p| p.name.eq_ignore_ascii_case(text)) {
            return Ok(known.planner());
        }
        if !text.contains(char::is_whitespace) && !text.contains('{') && !text.is_empty() {
            return Err(PlannerError::Unknown(text.to_owned()));
        }
        let command = Command::parse(text)?;
        Ok(Self {
            name: command.program.display().to_string(),
            kind: Kind::Program(command),
            install_hint: "check the path, or put its folder into PATH".to_owned(),
            exit_phrases: COMMON_PHRASES,
        })
    }

    fn unified_planning(engine: &str) -> Self {
        let python = env::var_os("ELBOWROOM_PYTHON").map_or("python3".into(), PathBuf::from);
        Self {
            name: format!("up:{engine}"),
            kind: Kind::UnifiedPlanning {
                engine: engine.to_owned(),
                python,
            },
            install_hint: if ENGINES.contains(&engine) {
                format!(
                    "install Python and `pip install unified-planning up-{engine}`; if that is not \
                     the `python3` in PATH, put the path of its interpreter into ELBOWROOM_PYTHON"
                )
            } else {
                format!(
                    "check the name: engines of unified-planning are {}; your own engine must be \
                     installed for the `python3` in PATH, or for the interpreter in \
                     ELBOWROOM_PYTHON",
                    ENGINES.join(", ")
                )
            },
            exit_phrases: UNIFIED_PLANNING,
        }
    }
}

impl Registered {
    /// Returns the planner with the path of its program, if it is found.
    pub fn planner(&self) -> Planner {
        let named = env::var_os(self.variable).map(PathBuf::from);
        let program = named.unwrap_or_else(|| {
            let found = self
                .programs
                .iter()
                .find_map(|p| find_program(Path::new(p)));
            found.unwrap_or_else(|| self.programs[0].into())
        });
        Planner {
            name: self.name.to_owned(),
            kind: Kind::Program(Command {
                program,
                arguments: self.arguments.iter().map(|&a| a.to_owned()).collect(),
            }),
            install_hint: self.install_hint.to_owned(),
            exit_phrases: self.exit_phrases,
        }
    }
}

fn names() -> String {
    let names: Vec<_> = REGISTRY.iter().map(|planner| planner.name).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_planner_is_a_name_an_engine_or_a_command_line() {
        assert_eq!(Planner::named("LPG-td").unwrap().name, "lpg-td");
        assert_eq!(Planner::named("up:aries").unwrap().name, "up:aries");
        let own = Planner::named("./mine -x {domain} {problem}").unwrap();
        assert_eq!(own.name, "./mine");
    }

    #[test]
    fn an_unknown_name_lists_the_known_ones() {
        let error = Planner::named("poopf").unwrap_err().to_string();
        assert!(
            error.contains("popf, optic, tfd, lpg-td, up:ENGINE"),
            "{error}"
        );
    }

    #[test]
    fn every_command_of_the_registry_says_where_the_files_go() {
        for planner in REGISTRY {
            let line = format!("program {}", planner.arguments.join(" "));
            assert!(Command::parse(&line).is_ok(), "{}", planner.name);
            let phrases = planner.exit_phrases;
            for phrase in [phrases.unsolvable, phrases.gave_up, phrases.unsupported].concat() {
                assert_eq!(phrase, phrase.to_lowercase());
            }
        }
    }
}
