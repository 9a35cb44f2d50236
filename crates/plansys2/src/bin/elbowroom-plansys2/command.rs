//! Child processes of the command `elbowroom`, which plans and executes.

use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::thread;
use std::time::Duration;

use elbowroom_plansys2::interface::{Plan, PlanItem, PlanRequest};
use elbowroom_plansys2::knowledge::Tree;
use elbowroom_plansys2::sub_goal;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use tempfile::TempDir;

use super::Input;

/// Polling interval of a child process.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// Plan with rounded times, and its exact text.
#[derive(Clone, Debug)]
pub(super) struct Planned {
    pub(super) plan: Plan,
    pub(super) text: String,
}

/// Time limit of a child process, and a flag that ends it early.
pub(super) struct ChildLimits {
    pub(super) within: Duration,
    pub(super) is_over: Arc<AtomicBool>,
}

/// Computes a plan with the command.
///
/// # Errors
/// There is no plan, or none was found within the time limit. The text says why.
pub(super) fn plan(
    elbowroom: &str,
    request: &PlanRequest,
    patience: &ChildLimits,
) -> Result<Planned, String> {
    let said = ask(
        elbowroom,
        &["plan", "domain.pddl", "problem.pddl", "--json"],
        request,
        patience,
    )?;
    match said.status.code() {
        Some(0) => steps_of(&said.out).ok_or_else(|| {
            format!(
                "the output of {elbowroom} contains \
                                                              no plan"
            )
        }),
        Some(1) => Err("no plan reaches the goal".to_owned()),
        _ => Err(format!(
            "the planner found no plan ({}): {}",
            said.status,
            said.errors.trim()
        )),
    }
}

/// Checks a domain with the command.
///
/// # Errors
/// The domain is invalid. The text holds the messages of the command.
pub(super) fn validate(
    elbowroom: &str,
    domain: String,
    patience: &ChildLimits,
) -> Result<(), String> {
    // The problem is empty, because only the domain is checked.
    let problem = format!(
        "(define (problem any) (:domain {}) (:init) (:goal (and)))",
        name_of(&domain)
    );
    let texts = PlanRequest { domain, problem };
    let said = ask(
        elbowroom,
        &["check", "domain.pddl", "problem.pddl"],
        &texts,
        patience,
    )?;
    if said.status.success() {
        Ok(())
    } else {
        Err(said.errors.trim().to_owned())
    }
}

/// Sorts the subgoals of a plan by the time at which it reaches them, with the command.
///
/// # Errors
/// The plan does not reach its goal, or the order could not be computed. The text says why.
pub(super) fn sub_goals(
    elbowroom: &str,
    texts: &PlanRequest,
    plan: String,
    patience: &ChildLimits,
) -> Result<Vec<Tree>, String> {
    let folder = folder_with(texts)?;
    let path = folder.path().join("plan.plan");
    fs::write(&path, plan).map_err(|e| unusable(&path, &e))?;
    let line = [
        "check",
        "domain.pddl",
        "problem.pddl",
        "plan.plan",
        "--json",
    ];
    let said = ask_in(&folder, elbowroom, &line, patience)?;
    match said.status.code() {
        Some(0) => ordered(&said.out)
            .ok_or_else(|| format!("the output of {elbowroom} contains no times of the goals")),
        Some(1) => Err("the plan does not reach its goal".to_owned()),
        _ => Err(said.errors.trim().to_owned()),
    }
}

fn ordered(document: &str) -> Option<Vec<Tree>> {
    let document: Value = serde_json::from_str(document).ok()?;
    let goals = document["goals"].as_array()?.iter();
    goals.map(|it| sub_goal(it["goal"].as_str()?)).collect()
}

/// Returns the name of a domain, or `any` if it has none.
fn name_of(domain: &str) -> String {
    let code = domain
        .lines()
        .map(|line| line.split(';').next().unwrap_or_default());
    let text = code.collect::<Vec<_>>().join(" ").to_lowercase();
    let after = text
        .split_once("(domain")
        .map_or("", |(_, after)| after)
        .trim_start();
    let is_end = |it: char| it == '(' || it == ')' || it.is_whitespace();
    let name = after.split(is_end).next().unwrap_or_default();
    if name.is_empty() {
        "any".to_owned()
    } else {
        name.to_owned()
    }
}

/// Output of the command.
struct CommandOutput {
    status: ExitStatus,
    out: String,
    errors: String,
}

/// Runs the command in a folder with these texts as `domain.pddl` and `problem.pddl`.
fn ask(
    elbowroom: &str,
    line: &[&str],
    texts: &PlanRequest,
    patience: &ChildLimits,
) -> Result<CommandOutput, String> {
    ask_in(&folder_with(texts)?, elbowroom, line, patience)
}

/// Runs the command in an existing folder.
fn ask_in(
    folder: &TempDir,
    elbowroom: &str,
    line: &[&str],
    patience: &ChildLimits,
) -> Result<CommandOutput, String> {
    let [out, errors] = ["out", "errors"].map(|name| folder.path().join(name));
    let create = |path: &Path| File::create(path).map_err(|e| unusable(path, &e));
    let mut child = Command::new(elbowroom)
        .args(line)
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(create(&out)?)
        .stderr(create(&errors)?)
        .spawn()
        .map_err(|e| not_started(elbowroom, &e))?;
    let ended =
        wait(&mut child, patience).map_err(|e| format!("cannot wait for {elbowroom}: {e}"))?;
    let status = ended
        .ok_or_else(|| format!("time limit of {} s exceeded", patience.within.as_secs_f64()))?;
    let read = |path: &Path| fs::read_to_string(path).unwrap_or_default();
    Ok(CommandOutput {
        status,
        out: read(&out),
        errors: read(&errors),
    })
}

/// Waits for the process to end. Returns `None` if it was killed.
fn wait(child: &mut Child, patience: &ChildLimits) -> io::Result<Option<ExitStatus>> {
    let mut waited = Duration::ZERO;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if waited >= patience.within || patience.is_over.load(Ordering::Relaxed) {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        thread::sleep(POLL_INTERVAL);
        waited += POLL_INTERVAL;
    }
}

fn steps_of(document: &str) -> Option<Planned> {
    let document: Value = serde_json::from_str(document).ok()?;
    let number = |value: &Value| value["decimal"].as_f64();
    let step = |step: &Value| {
        Some(PlanItem {
            time: to_f32(number(&step["start"])?),
            action: step["action"].as_str()?.to_owned(),
            // An instantaneous action has no duration.
            duration: number(&step["duration"]).map_or(0.0, to_f32),
        })
    };
    let items: Option<Vec<_>> = document["steps"].as_array()?.iter().map(step).collect();
    let text = document["plan"].as_str()?.to_owned();
    Some(Planned {
        plan: Plan { items: items? },
        text,
    })
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "the messages have no wider numbers"
)]
fn to_f32(number: f64) -> f32 {
    number as f32
}

/// Running `elbowroom run`, for which this program is the world.
pub(super) struct Running {
    pid: Option<Pid>,
    socket: PathBuf,
    _folder: TempDir,
}

impl Running {
    /// Starts the command. Its output and its exit code are sent to `inputs`.
    ///
    /// # Errors
    /// The command cannot be started. The text says why.
    pub(super) fn start(
        elbowroom: &str,
        executor: Option<&str>,
        texts: &PlanRequest,
        plan: &str,
        inputs: &Sender<Input>,
    ) -> Result<Self, String> {
        let folder = folder_with(texts)?;
        let path = folder.path().join("plan.plan");
        fs::write(&path, plan).map_err(|e| unusable(&path, &e))?;
        let socket = folder.path().join("world");
        let listener = UnixListener::bind(&socket).map_err(|e| unusable(&socket, &e))?;
        let own = std::env::current_exe()
            .map_err(|e| format!("cannot find the path of this program: {e}"))?;
        // The world is started in that folder, so that only this program's own path could contain
        // blanks.
        let relay = folder.path().join("relay");
        std::os::unix::fs::symlink(&own, &relay).map_err(|e| unusable(&relay, &e))?;
        let mut child = Command::new(elbowroom)
            .arg("run")
            .args(["domain.pddl", "problem.pddl", "plan.plan"])
            .args(executor.into_iter().flat_map(|name| ["--executor", name]))
            .args(["--world-process", "./relay relay world"])
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .spawn()
            .map_err(|e| not_started(elbowroom, &e))?;
        let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
        let heard = inputs.clone();
        thread::spawn(move || listen(&listener, &heard));
        let over = inputs.clone();
        thread::spawn(move || {
            let code = child.wait().ok().and_then(|status| status.code());
            let _ = over.send(Input::RunEnded(code));
        });
        Ok(Self {
            pid,
            socket,
            _folder: folder,
        })
    }

    /// Asks the command to shut down.
    pub(super) fn interrupt(&self) {
        if let Some(pid) = self.pid {
            // Fails if the process has already ended.
            let _ = kill_process(pid, Signal::INT);
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Unblocks the listener if the relay never connected.
        let _ = UnixStream::connect(&self.socket);
    }
}

fn listen(listener: &UnixListener, inputs: &Sender<Input>) {
    let Ok((stream, _)) = listener.accept() else {
        return;
    };
    let Ok(answers) = stream.try_clone() else {
        return;
    };
    let _ = inputs.send(Input::Connected(answers));
    for line in BufReader::new(stream).lines() {
        let Ok(line) = line else { break };
        if inputs.send(Input::Line(line)).is_err() {
            break;
        }
    }
    let _ = inputs.send(Input::Closed);
}

/// Relays lines between Elbowroom and the program that started it.
///
/// # Errors
/// That program has ended.
pub(super) fn relay(socket: &Path) -> Result<(), String> {
    let failed = |e: io::Error| format!("lost the connection to the executing program: {e}");
    let mut stream = UnixStream::connect(socket).map_err(failed)?;
    let answers = stream.try_clone().map_err(failed)?;
    thread::spawn(move || {
        for line in io::stdin().lock().lines() {
            let Ok(line) = line else { break };
            if writeln!(stream, "{line}").is_err() {
                break;
            }
        }
        let _ = stream.shutdown(std::net::Shutdown::Both);
    });
    for line in BufReader::new(answers).lines() {
        let mut out = io::stdout().lock();
        writeln!(out, "{}", line.map_err(failed)?)
            .and_then(|()| out.flush())
            .map_err(failed)?;
    }
    Ok(())
}

fn folder_with(texts: &PlanRequest) -> Result<TempDir, String> {
    let folder =
        tempfile::tempdir().map_err(|e| format!("cannot create a temporary folder: {e}"))?;
    for (name, text) in [
        ("domain.pddl", &texts.domain),
        ("problem.pddl", &texts.problem),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, text).map_err(|e| unusable(&path, &e))?;
    }
    Ok(folder)
}

fn unusable(path: &Path, error: &io::Error) -> String {
    format!("cannot use {}: {error}", path.display())
}

fn not_started(elbowroom: &str, error: &io::Error) -> String {
    format!("cannot start {elbowroom}: {error}; give its path with --elbowroom")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn domain_name_is_read_from_define_form() {
        for (text, name) in [
            (
                "; (domain no)\n(define (domain Yard)\n (:requirements))",
                "yard",
            ),
            ("(DEFINE (DOMAIN\n yard))", "yard"),
            ("(define (domain", "any"),
            ("", "any"),
        ] {
            assert_eq!(name_of(text), name, "{text}");
        }
    }

    #[test]
    fn parts_of_a_goal_are_read_in_their_order() {
        let document =
            r#"{"goals":[{"goal":"(done b)","time":{}},{"goal":"(>= (n) 2)","time":{}}]}"#;
        let trees = ordered(document).expect("an order");
        let expected = ["(done b)", "(>= (n) 2)"].map(|it| sub_goal(it).expect("a condition"));
        assert_eq!(trees, expected);
        assert!(ordered("{}").is_none() && ordered("nonsense").is_none());
    }

    #[test]
    fn a_plan_is_read_with_actions_that_take_no_time() {
        let document = r#"{"steps":[{"start":{"exact":"1/3","decimal":0.3333},"action":"(beep)","duration":null}],"plan":"0.333: (beep)\n"}"#;
        let planned = steps_of(document).expect("a plan");
        let item = PlanItem {
            time: 0.3333,
            action: "(beep)".into(),
            duration: 0.0,
        };
        assert_eq!(planned.plan.items, [item]);
        assert_eq!(planned.text, "0.333: (beep)\n");
        assert!(steps_of("{}").is_none() && steps_of("nonsense").is_none());
    }
}
