//! The command `elbowroom`: robustness envelopes, execution and validation of temporal plans.
//!
//! The output streams and exit codes are a stable interface, see `docs/reference/exit-codes.md`. This crate is
//! the only one that prints. The library does the computations, and `elbowroom-executive` executes
//! plans.

mod args;
mod calendar;
mod commands;
mod deadline;
mod exit;
mod file;
mod input;
mod interrupt;
mod limits;
mod number;
mod output;
mod panic_hook;
mod progress;
mod terminal;
mod time_limit;

use std::ffi::OsString;

use args::{Command, CommandLine};
use exit::Exit;
use output::Output;

/// Runs the command with a command line, the program's name first, and returns the exit code.
///
/// Intended for programs that do nothing else: a wrong command line, `--help`, a panic and a second
/// Ctrl-C end the process, and the answer is printed.
pub fn run(line: Vec<OsString>) -> u8 {
    panic_hook::install_hook();
    let CommandLine { color, command } = args::read(line);
    anstream::ColorChoice::from(color).write_global();
    let as_json = command.is_json();
    let mut output = Output::default();
    let answer = match command {
        Command::Init(arguments) => commands::init::run(&arguments),
        Command::Check(arguments) => commands::check::run(&arguments, &mut output),
        Command::Plan(arguments) => commands::plan::run(&arguments, &mut output),
        Command::Stn(arguments) => commands::stn::run(&arguments, &mut output),
        Command::Envelope(arguments) => commands::envelope::run(&arguments, &mut output),
        Command::WorldCheck(arguments) => commands::world_check::run(&arguments, &mut output),
        Command::Compare(arguments) => commands::compare::run(&arguments, &mut output),
        Command::Learn(arguments) => commands::learn::run(&arguments, &mut output),
        Command::Odds(arguments) => commands::odds::run(&arguments, &mut output),
        Command::Network(arguments) => commands::network::run(&arguments, &mut output),
        Command::Export(arguments) => commands::export::run(&arguments, &mut output),
        Command::Verify(arguments) => commands::verify::run(&arguments, &mut output),
        Command::Val(arguments) => commands::val::run(&arguments, &mut output),
        Command::Report(arguments) => commands::report::run(&arguments),
        Command::Completions(arguments) => commands::completions::completions(&arguments),
        Command::Mcp => commands::mcp::run(),
        Command::Version => output::print(concat!("elbowroom ", env!("CARGO_PKG_VERSION"), "\n"))
            .map(|()| Exit::Yes),
        Command::Man(arguments) => commands::completions::man(&arguments),
        Command::Serve(arguments) => commands::serve::run(&arguments, &mut output),
        Command::Ctl(arguments) => commands::ctl::run(&arguments, &mut output),
        Command::Run(arguments) => commands::run::run(&arguments, &mut output),
    };
    let exit = answer.unwrap_or_else(|failure| {
        output.fail(&failure, as_json);
        Exit::BadInput
    });
    exit as u8
}
