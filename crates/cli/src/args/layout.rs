//! Layout of the help: headings of options, and examples at the end.

use clap::{Command, CommandFactory as _};

use super::CommandLine;

/// Options of a command under one heading. All other options are under *Options*.
struct Heading {
    commands: &'static [&'static str],
    title: &'static str,
    options: &'static [&'static str],
}

const RUNS: &[&str] = &["run", "serve"];

/// The headings, in the order of the help of a command.
const HEADINGS: &[Heading] = &[
    Heading {
        commands: &["run", "serve", "envelope", "plan", "odds"],
        title: "Input",
        options: &[
            "calendar",
            "begin",
            "plan",
            "likelihoods",
            "believed",
            "tolerance",
            "epsilon",
        ],
    },
    Heading {
        commands: RUNS,
        title: "Planner",
        options: &[
            "planner",
            "planner_time",
            "first_plan_by",
            "planning_budget",
            "planner_states",
            "improve_states",
            "self_overlap",
            "jobs",
            "planning_time",
            "planner_memory",
            "max_replans",
        ],
    },
    Heading {
        commands: RUNS,
        title: "Executor and guarantee",
        options: &[
            "executor",
            "running",
            "timeout",
            "time_limit",
            "vary",
            "controllable",
            "guarantee",
            "method",
            "precision",
            "objective",
        ],
    },
    Heading {
        commands: RUNS,
        title: "World",
        options: &[
            "world",
            "seed",
            "spoil",
            "realtime",
            "world_process",
            "answer_within",
            "restart_world",
            "strict_world",
        ],
    },
    Heading {
        commands: RUNS,
        title: "Recording",
        options: &[
            "trace",
            "perfetto",
            "mcap",
            "journal",
            "journal_size",
            "journal_segments",
            "resume",
            "replay",
            "learn",
        ],
    },
    Heading {
        commands: RUNS,
        title: "Service",
        options: &["serve", "http", "socket", "token"],
    },
    Heading {
        commands: &["envelope"],
        title: "Quantities and guarantee",
        options: &["vary", "controllable", "guarantee", "enforce", "timeout"],
    },
    Heading {
        commands: &["envelope"],
        title: "Search",
        options: &[
            "method",
            "objective",
            "world",
            "symmetric",
            "cap",
            "precision",
            "growth",
            "sharpen",
            "time_limit",
        ],
    },
    Heading {
        commands: &["envelope"],
        title: "Region (--method exact)",
        options: &["volume", "seed", "slice", "projection", "picture"],
    },
    Heading {
        commands: &["envelope"],
        title: "Other questions",
        options: &["contains", "repair", "change", "keep"],
    },
    Heading {
        commands: &["plan"],
        title: "Planner",
        options: &[
            "planner",
            "time_limit",
            "first",
            "objective",
            "world",
            "self_overlap",
            "memory",
            "jobs",
        ],
    },
    Heading {
        commands: &["odds"],
        title: "Executors in a simulated world",
        options: &["world", "executor", "samples", "seed"],
    },
];

/// Example command lines of a command.
const EXAMPLES: &[(&str, &str)] = &[
    (
        "check",
        "  elbowroom check domain.pddl problem.pddl\n  \
         elbowroom check domain.pddl problem.pddl plan.plan",
    ),
    (
        "plan",
        "  elbowroom plan domain.pddl problem.pddl -o plan.plan\n  \
         elbowroom plan domain.pddl problem.pddl --time-limit 10\n  \
         elbowroom plan domain.pddl problem.pddl --planner up:aries",
    ),
    (
        "envelope",
        "  elbowroom envelope domain.pddl problem.pddl plan.plan\n  \
         elbowroom envelope domain.pddl problem.pddl plan.plan --contains all=±10%\n  \
         elbowroom envelope domain.pddl problem.pddl plan.plan --vary deadline",
    ),
    (
        "run",
        "  elbowroom run domain.pddl problem.pddl --world world.toml --seed 1\n  \
         elbowroom run domain.pddl problem.pddl --world-process \"python3 robot.py\"\n  \
         elbowroom run --resume robot.journal",
    ),
    (
        "serve",
        "  elbowroom serve domain.pddl problem.pddl --world world.toml --realtime 10\n  \
         elbowroom serve domain.pddl --world-process \"python3 robot.py\" --token token",
    ),
    (
        "ctl",
        "  elbowroom ctl state\n  \
         elbowroom ctl goal \"(at rover depot)\" --token token",
    ),
    (
        "compare",
        "  elbowroom compare experiment.toml --trials 100 -o results\n  \
         elbowroom report results -o results.html",
    ),
    ("learn", "  elbowroom learn run.jsonl -o world.toml"),
    ("network", "  elbowroom network tea.stnu"),
    (
        "report",
        "  elbowroom envelope domain.pddl problem.pddl plan.plan --json > envelope.json\n  \
         elbowroom report envelope.json -o envelope.html",
    ),
];

/// Returns the command line with headings and examples.
pub(crate) fn command() -> Command {
    let mut command = CommandLine::command();
    for heading in HEADINGS {
        for name in heading.commands {
            command = command.mut_subcommand(name, |command| with_heading(command, heading));
        }
    }
    for (name, examples) in EXAMPLES {
        command = command.mut_subcommand(name, |command| with_examples(command, examples));
    }
    command
}

fn with_heading(mut command: Command, heading: &Heading) -> Command {
    for id in heading.options {
        // `plan` is an option of `run` and an argument of `envelope`.
        let is_option = command
            .get_arguments()
            .any(|argument| argument.get_id() == id && !argument.is_positional());
        if is_option {
            command = command.mut_arg(id, |argument| argument.help_heading(heading.title));
        }
    }
    command
}

fn with_examples(command: Command, examples: &str) -> Command {
    let word = if examples.contains('\n') {
        "Examples"
    } else {
        "Example"
    };
    let append = |text: Option<String>| match text {
        Some(text) => format!("{}\n\n{word}:\n{examples}", text.trim_end()),
        None => format!("{word}:\n{examples}"),
    };
    let short = command.get_after_help().map(ToString::to_string);
    let long = command.get_after_long_help().map(ToString::to_string);
    let command = match long {
        Some(long) => command.after_long_help(append(Some(long))),
        None => command,
    };
    command.after_help(append(short))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::{EXAMPLES, HEADINGS, command};
    use crate::args::CommandLine;
    use clap::FromArgMatches as _;

    #[test]
    fn the_command_line_is_consistent() {
        command().debug_assert();
    }

    /// A renamed option must not lose its heading silently.
    #[test]
    fn headings_name_options_that_exist() {
        let command = command();
        for heading in HEADINGS {
            let commands = heading.commands.iter();
            let known: BTreeSet<&str> = commands
                .flat_map(|name| {
                    let command = command.find_subcommand(name).expect("a command");
                    command
                        .get_arguments()
                        .map(|argument| argument.get_id().as_str())
                })
                .collect();
            for option in heading.options {
                assert!(known.contains(option), "{}: {option}", heading.title);
            }
        }
    }

    #[test]
    fn examples_are_valid_command_lines() {
        for (name, examples) in EXAMPLES {
            for line in examples.lines() {
                let line = line.replace(['"'], "'");
                let line = line.split(" > ").next().unwrap_or_default();
                let mut words = Vec::new();
                for (index, part) in line.split('\'').enumerate() {
                    if index % 2 == 1 {
                        words.push(part.to_owned());
                    } else {
                        words.extend(part.split_whitespace().map(str::to_owned));
                    }
                }
                let matches = command().try_get_matches_from(words);
                let read = matches.and_then(|matches| CommandLine::from_arg_matches(&matches));
                assert!(read.is_ok(), "{name}: {line}: {}", read.unwrap_err());
            }
        }
    }
}
