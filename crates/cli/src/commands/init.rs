//! `elbowroom init`: a new project from a template.

use std::fs;
use std::io::{self, ErrorKind, Write as _};
use std::path::Path;

use elbowroom_executive::messages::io_error_message;

use crate::args::{InitArgs, Template};
use crate::exit::{Answer, Exit, Failure};
use crate::output;

/// Files of a template, as names and texts. `{name}` is replaced by the name of the project.
type Files = &'static [(&'static str, &'static str)];

/// Returns the files of these names in one folder of `templates`.
macro_rules! files {
    ($folder:literal: $($name:literal),+) => {
        &[$(($name, include_str!(concat!("../../templates/", $folder, "/", $name)))),+]
    };
}

const DELIVERY: Files = files!(
    "delivery": "README.md", "domain.pddl", "problem.pddl", "plan.plan", "world.toml", "robot.py",
    "experiment.toml"
);
const WARD: Files = files!(
    "ward": "README.md", "domain.pddl", "problem.pddl", "plan.plan", "world.toml", "robot.py",
    "experiment.toml"
);
const CALENDAR: Files = files!(
    "calendar": "README.md", "domain.pddl", "problem.pddl", "calendar.toml", "plan.plan",
    "world.toml", "robot.py", "experiment.toml"
);

/// The library that `robot.py` imports, a copy of that in `clients/python`, because a package must
/// contain all of its files.
const LIBRARY: &str = include_str!("../../templates/elbowroom_world.py");
/// The notebook of all templates, with `{problem}` for the file that it reads.
const NOTEBOOK: &str = include_str!("../../templates/notebook.ipynb");

/// Writes the project.
pub(crate) fn run(arguments: &InitArgs) -> Answer {
    let folder = &arguments.folder;
    prepare(folder)?;
    // The notebook cannot read a calendar; README.md first exports the problem with its dates.
    let (files, problem) = match arguments.template {
        Template::Delivery => (DELIVERY, "problem.pddl"),
        Template::Ward => (WARD, "problem.pddl"),
        Template::Calendar => (CALENDAR, "dated.pddl"),
    };
    let name = name(folder);
    for (file, text) in files {
        write(folder, file, &text.replace("{name}", &name))?;
    }
    write(folder, "elbowroom_world.py", LIBRARY)?;
    let quoted = serde_json::Value::from(name).to_string();
    let notebook = NOTEBOOK.replace("{name}", &quoted[1..quoted.len() - 1]);
    write(
        folder,
        "notebook.ipynb",
        &notebook.replace("{problem}", problem),
    )?;
    output::print(&format!(
        "{} has a project with {} files; README.md there has the next commands\n",
        folder.display(),
        files.len() + 2
    ))?;
    Ok(Exit::Yes)
}

/// Returns the name of the project: that of its folder.
fn name(folder: &Path) -> String {
    let absolute = folder.canonicalize();
    let absolute = absolute.as_deref().unwrap_or(folder);
    let name = absolute.file_name().unwrap_or("project".as_ref());
    let name = name.to_string_lossy();
    name.chars().filter(|c| !c.is_control()).collect()
}

/// Creates the folder, or checks that it is empty.
fn prepare(folder: &Path) -> Result<(), Failure> {
    let refused = |error: &io::Error| cannot_write(folder, error);
    match fs::read_dir(folder) {
        Ok(mut entries) => match entries.next() {
            None => Ok(()),
            Some(_) => Err(Failure::new(
                format!("the folder {} is not empty", folder.display()),
                "choose another name; nothing was written",
            )),
        },
        Err(error) if error.kind() == ErrorKind::NotFound => {
            fs::create_dir_all(folder).map_err(|error| refused(&error))
        }
        Err(error) if error.kind() == ErrorKind::NotADirectory => Err(Failure::new(
            format!("{} is a file, not a folder", folder.display()),
            "choose another name; nothing was written",
        )),
        Err(error) => Err(refused(&error)),
    }
}

/// Writes a file that does not exist yet.
fn write(folder: &Path, name: &str, text: &str) -> Result<(), Failure> {
    let path = folder.join(name);
    fs::File::create_new(&path)
        .and_then(|mut file| file.write_all(text.as_bytes()))
        .map_err(|error| cannot_write(&path, &error))
}

fn cannot_write(path: &Path, error: &io::Error) -> Failure {
    Failure::new(
        format!(
            "cannot write {}: {}",
            path.display(),
            io_error_message(error)
        ),
        "choose a name in an existing, writable folder",
    )
}
