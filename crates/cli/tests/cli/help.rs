//! Layout of the help on a terminal with 80 columns.

#[cfg(target_os = "linux")]
use crate::skipped;
use std::process::Command;

/// Returns the help of a subcommand, or of the whole command, for a terminal with `columns`
/// columns.
fn help(subcommand: Option<&str>, columns: u32) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .args(subcommand)
        .arg("--help")
        .env("COLUMNS", columns.to_string())
        .output()
        .expect("the command can be started");
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).expect("text")
}

/// Returns all subcommands listed in the help.
fn subcommands() -> Vec<String> {
    let help = help(None, 100);
    let listed = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty());
    let names: Vec<String> = listed
        .filter(|line| !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next().map(str::to_owned))
        .collect();
    assert!(names.iter().any(|name| name == "envelope"), "{names:?}");
    names
}

/// Returns the lines after the options. clap lays out the lines before.
fn after_the_options(help: &str) -> Vec<&str> {
    let lines: Vec<&str> = help.lines().collect();
    let is_option = |line: &&str| line.trim_start().starts_with('-') && line.contains("--");
    let last = lines.iter().rposition(is_option).unwrap_or(0);
    let rest = lines.into_iter().skip(last + 1);
    rest.skip_while(|line| line.is_empty() || line.starts_with(' '))
        .collect()
}

#[test]
fn help_lines_fit_into_80_columns() {
    let all = subcommands();
    let names = all.iter().map(|name| Some(name.as_str()));
    for name in names.chain([None]).filter(|name| *name != Some("help")) {
        let help = help(name, 80);
        for line in help.lines() {
            assert!(line.chars().count() <= 80, "{name:?}: {line}");
        }
    }
}

/// Long lists of options are found by their headings.
#[test]
fn options_of_large_commands_are_in_groups() {
    let help = help(Some("run"), 80);
    let headings: Vec<&str> = help
        .lines()
        .filter(|line| !line.starts_with(' ') && line.ends_with(':'))
        .collect();
    let groups = ["Input:", "Planner:", "World:", "Recording:", "Service:"];
    for group in groups {
        assert!(headings.contains(&group), "{headings:?}");
    }
    assert_eq!(headings.last(), Some(&"Examples:"), "{headings:?}");
}

/// Tables in the help must not be wrapped.
#[test]
fn tables_in_the_help_look_the_same_in_80_columns() {
    let mut rows = 0;
    for name in subcommands().iter().filter(|name| *name != "help") {
        let (wide, narrow) = (help(Some(name), 100), help(Some(name), 80));
        let narrow = after_the_options(&narrow);
        for row in after_the_options(&wide) {
            let has_columns = row.starts_with("  ") && row.trim().contains("  ");
            if has_columns {
                assert!(narrow.contains(&row), "{name}: {row}");
                rows += 1;
            }
        }
    }
    assert!(rows > 20, "{rows} rows");
}

/// A terminal can report a width without a height.
#[cfg(target_os = "linux")]
#[test]
fn the_help_fits_into_a_terminal_of_unknown_height() {
    let line = format!(
        "stty cols 70 rows 0; '{}' ctl --help",
        env!("CARGO_BIN_EXE_elbowroom")
    );
    let output = Command::new("script")
        .args(["-qc", &line, "/dev/null"])
        .env("NO_COLOR", "1")
        .stdin(std::process::Stdio::null())
        .output();
    let Ok(output) = output else {
        skipped::skipped("there is no `script`");
        return;
    };
    let help = String::from_utf8(output.stdout).expect("text");
    assert!(help.contains("Usage:"), "{help}");
    for line in help.lines() {
        assert!(line.trim_end().chars().count() <= 70, "{line}");
    }
}
