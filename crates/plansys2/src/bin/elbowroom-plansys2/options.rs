//! Options of the command line and the environment.

use std::env;
use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};

const ABOUT: &str = "A world for `elbowroom run … --world-process elbowroom-plansys2`: the action \
                     performers of PlanSys2, over DDS and without ROS.

PlanSys2's own executor \
                     must be off: otherwise both executors would choose performers. A second \
                     elbowroom-plansys2 refuses. docs/reference/plansys2.md describes the sequence.";

/// Command line of the program.
#[derive(Debug, Parser)]
#[command(version, about = ABOUT, args_conflicts_with_subcommands = true)]
pub(super) struct Options {
    #[command(subcommand)]
    pub(super) command: Option<Mode>,
    #[command(flatten)]
    pub(super) network: NetworkOptions,
    /// Actions that must have a performer before time begins, separated by commas; the program ends
    /// with an error if one is missing. By default, time begins a second after the first performer
    /// was discovered
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(super) needs: Vec<String>,
    /// Seconds to wait for performers [default: the environment's `ELBOWROOM_PERFORMERS_WITHIN`, or
    /// 10]
    #[arg(long, value_name = "S")]
    within: Option<f64>,
}

/// Subcommand.
#[derive(Debug, Subcommand)]
pub(super) enum Mode {
    /// Stand in for planner and executor
    #[command(
        about = "Stand in for PlanSys2's planner and executor: planner/get_plan, execute_plan, and the states of both nodes"
    )]
    Serve(ServeOptions),
    /// Relay lines to the program that serves
    #[command(hide = true)]
    Relay {
        /// Socket of that program.
        socket: PathBuf,
    },
}

/// Options of `serve`.
#[derive(Debug, Args)]
pub(super) struct ServeOptions {
    /// The command that plans and executes
    #[arg(long, value_name = "COMMAND", default_value = "elbowroom")]
    pub(super) elbowroom: String,
    /// The executor, see `elbowroom run --help`; the default is that of the command
    #[arg(long, value_name = "NAME")]
    pub(super) executor: Option<String>,
    /// Time limit for planning, in seconds
    #[arg(long, value_name = "S", default_value = "60")]
    plan_within: f64,
}

/// Checked options of `serve`.
#[derive(Debug)]
pub(super) struct ServeSettings {
    pub(super) elbowroom: String,
    pub(super) executor: Option<String>,
    pub(super) plan_within: Duration,
}

impl ServeOptions {
    /// Checks the options.
    ///
    /// # Errors
    /// An option is invalid; the text says what to do.
    pub(super) fn checked(self) -> Result<ServeSettings, String> {
        let plan_within = seconds(self.plan_within)?;
        // Runs start in another folder, so the path is made absolute. A name without a folder is
        // searched in PATH.
        let elbowroom = if self.elbowroom.contains('/') {
            let full = std::path::absolute(&self.elbowroom);
            full.map_err(|e| format!("cannot use {}: {e}", self.elbowroom))?
                .display()
                .to_string()
        } else {
            self.elbowroom
        };
        Ok(ServeSettings {
            elbowroom,
            executor: self.executor,
            plan_within,
        })
    }
}

fn seconds(number: f64) -> Result<Duration, String> {
    Duration::try_from_secs_f64(number)
        .map_err(|_| format!("expected a waiting time of at least 0 s, found {number} s"))
}

/// Options of the connection to the robots.
#[derive(Debug, Args)]
pub(super) struct NetworkOptions {
    /// Seconds of the plan per real second [default: the environment's `ELBOWROOM_SPEED`, or 1]
    #[arg(long, global = true, value_name = "X")]
    speed: Option<f64>,
    /// The domain of DDS, from 0 to 232
    /// [default: the environment's `ROS_DOMAIN_ID`, or 0]
    #[arg(long, global = true, value_name = "N")]
    domain_id: Option<u16>,
    /// The namespace of the performers' topics, as in `/robot1`
    #[arg(long, global = true, value_name = "NAME", default_value = "/")]
    namespace: String,
    /// Use only the network interface with this address; may be repeated [default: all; with
    /// `ROS_LOCALHOST_ONLY=1` in the environment, 127.0.0.1]
    #[arg(long, global = true, value_name = "ADDRESS")]
    interface: Vec<IpAddr>,
    #[arg(
        long,
        global = true,
        value_name = "HOW",
        help = "Whether changes by a run are reported to PlanSys2's problem expert, and changes by others there to the run [default: follow for `serve`, else ignore]"
    )]
    problem_expert: Option<ProblemExpert>,
    /// Allow other executors to use the same performers. Each performer must then belong to one
    /// executor
    #[arg(long, global = true)]
    shared: bool,
}

/// Use of the problem expert.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ProblemExpert {
    /// Synchronize it with the run
    Follow,
    /// Ignore it
    Ignore,
}

/// Checked options, with the environment's.
#[derive(Debug)]
pub(super) struct Settings {
    pub(super) needs: Vec<String>,
    pub(super) within: Duration,
    pub(super) speed: f64,
    pub(super) domain_id: u16,
    pub(super) namespace: String,
    /// Addresses of network interfaces; empty for all.
    pub(super) interfaces: Vec<IpAddr>,
    /// The option as given; its default depends on the subcommand.
    pub(super) problem_expert: Option<ProblemExpert>,
    /// `true` if other executors may use the same performers.
    pub(super) is_shared: bool,
}

impl Options {
    /// Adds the values of the environment and checks the options.
    ///
    /// # Errors
    /// An option is invalid; the text says what to do.
    pub(super) fn settings(self) -> Result<Settings, String> {
        let within = or_variable(self.within, "ELBOWROOM_PERFORMERS_WITHIN", 10.0)?;
        let within = seconds(within)?;
        let network = self.network;
        let speed = or_variable(network.speed, "ELBOWROOM_SPEED", 1.0)?;
        if !(speed > 0.0 && speed.is_finite()) {
            return Err(format!("the speed must be a number above 0, not {speed}"));
        }
        let domain_id = or_variable(network.domain_id, "ROS_DOMAIN_ID", 0)?;
        if domain_id > 232 {
            return Err(format!("the domain must be from 0 to 232, not {domain_id}"));
        }
        let mut interfaces = network.interface;
        if interfaces.is_empty() && env::var("ROS_LOCALHOST_ONLY").is_ok_and(|it| it == "1") {
            interfaces.push(Ipv4Addr::LOCALHOST.into());
        }
        Ok(Settings {
            needs: self.needs.iter().map(|it| it.to_lowercase()).collect(),
            within,
            speed,
            domain_id,
            namespace: namespace(&network.namespace)?,
            interfaces,
            problem_expert: network.problem_expert,
            is_shared: network.shared,
        })
    }
}

/// Returns the given value, that of the environment variable, or the default.
fn or_variable<T: FromStr>(given: Option<T>, variable: &str, default: T) -> Result<T, String> {
    match (given, env::var(variable)) {
        (Some(given), _) => Ok(given),
        (None, Ok(text)) if !text.is_empty() => {
            let read = text.trim().parse();
            read.map_err(|_| {
                format!(
                    "the environment variable {variable} has the invalid value \
                                      {text:?}; change or unset it"
                )
            })
        }
        _ => Ok(default),
    }
}

/// Returns the namespace with slashes around it: `/` or `/robot1/`.
fn namespace(text: &str) -> Result<String, String> {
    let inner = text.trim_matches('/');
    let is_name = |part: &str| {
        part.starts_with(|it: char| it.is_ascii_alphabetic() || it == '_')
            && part
                .chars()
                .all(|it| it.is_ascii_alphanumeric() || it == '_')
    };
    if inner.is_empty() {
        Ok("/".to_owned())
    } else if inner.split('/').all(is_name) {
        Ok(format!("/{inner}/"))
    } else {
        Err(format!(
            "{text:?} is not a namespace; expected letters, digits and _ between slashes"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(words: &[&str]) -> Result<Settings, String> {
        Options::try_parse_from([&["elbowroom-plansys2"], words].concat())
            .expect("options")
            .settings()
    }

    #[test]
    fn names_of_actions_are_separated_by_commas_and_read_without_case() {
        let settings = settings(&["--needs", "Move,pick", "--within", "2.5"]).expect("settings");
        assert_eq!(settings.needs, ["move", "pick"]);
        assert_eq!(settings.within, Duration::from_millis(2500));
    }

    #[test]
    fn namespaces_have_slashes_around() {
        for (given, expected) in [("/", "/"), ("robot1", "/robot1/"), ("/a/b_2/", "/a/b_2/")] {
            assert_eq!(namespace(given).as_deref(), Ok(expected));
        }
        for given in ["/2/", "a//b", "a b", "ä"] {
            assert!(namespace(given).is_err(), "{given}");
        }
    }

    #[test]
    fn invalid_options_are_refused() {
        for words in [
            ["--within", "-1"],
            ["--within", "NaN"],
            ["--speed", "0"],
            ["--speed", "inf"],
            ["--domain-id", "233"],
        ] {
            let line = format!("{}={}", words[0], words[1]);
            assert!(settings(&[&line]).is_err(), "{line}");
        }
    }

    #[test]
    fn network_options_are_accepted_after_serve() {
        let words = [
            "elbowroom-plansys2",
            "serve",
            "--domain-id",
            "7",
            "--namespace",
            "robot1",
            "--elbowroom",
            "./here",
        ];
        let mut options = Options::try_parse_from(words).expect("options");
        let Some(Mode::Serve(serving)) = options.command.take() else {
            panic!("serve");
        };
        let serving = serving.checked().expect("settings");
        assert!(serving.elbowroom.starts_with('/') && serving.elbowroom.ends_with("/here"));
        let settings = options.settings().expect("settings");
        assert_eq!(
            (settings.domain_id, settings.namespace.as_str()),
            (7, "/robot1/")
        );
        let both = ["elbowroom-plansys2", "--needs", "move", "serve"];
        assert!(
            Options::try_parse_from(both).is_err(),
            "nothing waits for it"
        );
    }
}
