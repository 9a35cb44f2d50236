//! Shell completions and manual pages.

use std::path::Path;

use crate::args::{self, CompletionsArgs, ManArgs};
use crate::exit::{Answer, Exit, Failure};
use crate::output;
use elbowroom_executive::messages::io_error_message;

/// `elbowroom completions`: prints a completion script for a shell.
pub(crate) fn completions(arguments: &CompletionsArgs) -> Answer {
    let mut script = Vec::new();
    clap_complete::generate(
        arguments.shell,
        &mut args::command(),
        "elbowroom",
        &mut script,
    );
    output::print(&String::from_utf8_lossy(&script))?;
    Ok(Exit::Yes)
}

/// `elbowroom man`: prints the page of the command, or writes the pages of all commands.
pub(crate) fn man(arguments: &ManArgs) -> Answer {
    let command = args::command();
    if let Some(folder) = &arguments.folder {
        clap_mangen::generate_to(command, folder).map_err(|error| cannot_write(folder, &error))?;
    } else {
        let mut page = Vec::new();
        clap_mangen::Man::new(command)
            .render(&mut page)
            .map_err(|error| Failure::new(io_error_message(&error), ""))?;
        output::print(&String::from_utf8_lossy(&page))?;
    }
    Ok(Exit::Yes)
}

fn cannot_write(folder: &Path, error: &std::io::Error) -> Failure {
    Failure::new(
        format!(
            "cannot write manual pages to {}: {}",
            folder.display(),
            io_error_message(error)
        ),
        "choose an existing, writable folder",
    )
}
