//! Arguments of `elbowroom init`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

#[derive(Args, Debug)]
#[command(after_help = "\
The folder gets a domain, a problem, a plan, a simulated world, a robot program in Python with its \
library, an experiment, a notebook, and README.md with the commands in order.

Example:
  elbowroom init hospital --template ward")]
pub(crate) struct InitArgs {
    /// The folder of the project. It is created; an existing one has to be empty
    #[arg(value_name = "NAME")]
    pub(crate) folder: PathBuf,
    /// The example to start from
    #[arg(long, value_enum, value_name = "TEMPLATE", default_value_t = Template::Delivery)]
    pub(crate) template: Template,
}

/// Example project.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Template {
    /// One robot, one parcel and a deadline
    Delivery,
    /// Two robots with batteries, three deliveries and visiting hours
    Ward,
    /// One robot and two shops, whose opening hours are dates
    Calendar,
}
