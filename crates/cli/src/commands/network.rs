//! `elbowroom network`: consistency and controllability of a temporal network in an exchange
//! format.

use std::fmt::Write as _;
use std::path::Path;

use elbowroom::network::{
    self, Answer as Found, ControllabilityCheck, ControllableBox, Durations, NetworkFile, Reason,
    Request, Simulated, Simulation, Verdict,
};
use serde_json::Value;

use crate::args::{DispatchChoice, DurationsChoice, NetworkArgs};
use crate::exit::{Answer, Exit, Failure};
use crate::input;
use crate::output::{self, Output};
use crate::terminal::{
    EMPHASIS, ERROR, HINT, SECONDARY, SUCCESS, TextLayout, stdout_layout, styled,
};
use elbowroom::report::console::push_wrapped;
use elbowroom_executive::messages::count_with_noun;

/// Maximum number of bounds printed of a reason; `--json` has all.
const STEPS_SHOWN: usize = 12;

/// Least risk of a link that is printed.
const LEAST_RISK: f64 = 1e-6;

/// Reads a network, decides its properties, and writes the requested files.
pub(crate) fn run(arguments: &NetworkArgs, output: &mut Output) -> Answer {
    let outputs = [&arguments.minimal, &arguments.dispatchable];
    let on_stdout = outputs
        .into_iter()
        .flatten()
        .filter(|path| path.as_os_str() == "-");
    let on_stdout = on_stdout.count() + usize::from(arguments.json);
    if on_stdout > 1 {
        return Err(Failure::new(
            "only one of --json, --minimal and --dispatchable can go to standard output",
            "name a file for the others",
        ));
    }
    let text = input::source(&arguments.file, "network")?;
    let file = network::read(text.name(), text.text().as_bytes())?;
    for remark in &file.remarks {
        output::warn(remark);
    }
    if arguments.minimal.is_some() && !file.is_certain() {
        return Err(Failure::new(
            "the network has contingent links, and only simple networks have a minimal form",
            "--dispatchable writes the form that an executor uses",
        ));
    }
    if arguments.simulate.is_none() && arguments.dispatch != Some(DispatchChoice::Best) {
        if arguments.dispatch.is_some() {
            return Err(Failure::new(
                "--dispatch early only changes simulated runs",
                "add --simulate N",
            ));
        }
        if arguments.durations == DurationsChoice::Uniform {
            return Err(Failure::new(
                "--durations only changes simulated runs and the box of --dispatch best",
                "add --simulate N or --dispatch best",
            ));
        }
    }
    let request = Request {
        most_branches: arguments.branches,
        is_box_requested: match arguments.dispatch {
            None => arguments.simulate.is_some(),
            Some(choice) => choice == DispatchChoice::Best,
        },
        durations: match arguments.durations {
            DurationsChoice::Given => Durations::Given,
            DurationsChoice::Uniform => Durations::Uniform,
        },
        simulation: arguments.simulate.map(|runs| Simulation {
            runs,
            seed: arguments.seed,
        }),
    };
    let found = network::analyze(&file, &request).map_err(|error| Failure::new(error, ""))?;
    let is_box_missing = request.is_box_requested && !found.is_executable() && found.best.is_none();
    write_forms(arguments, &file)?;
    if arguments.json {
        output.json(&document(&arguments.file, &found)?)?;
    } else if on_stdout == 0 {
        output::print(&report(
            text.name(),
            &found,
            is_box_missing,
            stdout_layout(),
        ))?;
    }
    Ok(if found.is_executable() {
        Exit::Yes
    } else {
        Exit::No
    })
}

fn document(file: &Path, found: &Found) -> Result<Value, Failure> {
    let mut document = serde_json::to_value(found)
        .map_err(|error| Failure::new(format!("cannot write the answer: {error}"), ""))?;
    if let Value::Object(members) = &mut document {
        let name = Value::String(file.display().to_string());
        members.shift_insert(2, "file".to_owned(), name);
    }
    Ok(document)
}

/// Writes the minimal and the dispatchable network, if they exist.
fn write_forms(arguments: &NetworkArgs, file: &NetworkFile) -> Result<(), Failure> {
    if let Some(path) = &arguments.minimal {
        match file.minimal() {
            Ok(minimal) => write_network(path, &minimal)?,
            Err(_) => warn_not_written(path, "the network is not consistent"),
        }
    }
    if let Some(path) = &arguments.dispatchable {
        match file.network.dispatchable() {
            Ok(form) => write_network(path, &file.dispatchable(&form))?,
            Err(_) => warn_not_written(path, "the network is not dynamically controllable"),
        }
    }
    Ok(())
}

fn warn_not_written(path: &Path, why: &str) {
    output::print_to_stderr(&format!(
        "{}: {why}, so {} is not written",
        styled(HINT, "note"),
        path.display()
    ));
}

/// Writes a network in the format of the file's extension.
fn write_network(path: &Path, file: &NetworkFile) -> Result<(), Failure> {
    let ending = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
    let ending = ending.as_ref().and_then(|ending| ending.to_str());
    let text = if matches!(ending, Some("stn" | "stnu" | "graphml" | "xml")) {
        network::write_graphml(file).ok_or_else(|| {
            Failure::new(
                "a wait of this network ends only with its link, which GraphML cannot express",
                "write to a file that ends in .json",
            )
        })?
    } else {
        network::write_json(file)
    };
    output::write_file(path, &text)
}

/// Renders the answer as text.
fn report(name: &str, found: &Found, is_box_missing: bool, look: TextLayout) -> String {
    let mut text = String::new();
    let mut parts = vec![
        count_with_noun(found.points, "time point"),
        count_with_noun(found.requirements, "requirement"),
    ];
    if found.links > 0 {
        parts.push(count_with_noun(found.links, "contingent link"));
    }
    let head = format!("{name}: {}, {}", found.read_as, parts.join(", "));
    push_wrapped(&mut text, &head, 0, look.width);
    text.push('\n');
    let promises = [
        ("consistent", Some(&found.consistent)),
        ("weakly controllable", found.weak.as_ref()),
        ("dynamically controllable", found.dynamic.as_ref()),
        ("strongly controllable", found.strong.as_ref()),
    ];
    for (what, promise) in promises {
        let Some(promise) = promise else { continue };
        let (style, word) = match promise.verdict {
            Verdict::Yes => (SUCCESS, "yes"),
            Verdict::No => (ERROR, "no"),
            Verdict::Undecided => (HINT, "undecided"),
        };
        let _ = writeln!(text, "  {what:<24}  {}", styled(style, word));
    }
    push_reasons(&mut text, &promises, look);
    if let Some(best) = &found.best {
        push_box(&mut text, best, look);
    } else if is_box_missing {
        let line = "No box of durations with positive probability was found in which the network \
                    is dynamically controllable.";
        text.push('\n');
        push_wrapped(&mut text, line, 0, look.width);
    }
    if let Some(simulated) = &found.simulation {
        push_simulated(&mut text, simulated, look);
    }
    text
}

/// Appends the reasons why properties do not hold. After a reason why the network is not consistent
/// or not weakly controllable, further reasons are omitted.
fn push_reasons(
    text: &mut String,
    promises: &[(&str, Option<&ControllabilityCheck>)],
    look: TextLayout,
) {
    let mut is_explained = false;
    for (what, promise) in promises {
        let Some(promise) = promise else { continue };
        if let Some(branches) = promise.branches {
            let line = format!(
                "It is undecided whether it is {what}, after {}; --branches raises the limit.",
                count_with_noun(branches, "branch").replace("branchs", "branches")
            );
            text.push('\n');
            push_wrapped(text, &line, 0, look.width);
        }
        let Some(reason) = &promise.reason else {
            continue;
        };
        // A network without any schedule needs no further reason.
        if is_explained {
            continue;
        }
        is_explained = matches!(*what, "consistent" | "weakly controllable");
        push_reason(text, what, reason, look);
    }
}

fn push_reason(text: &mut String, what: &str, reason: &Reason, look: TextLayout) {
    let by = match reason.by.exact.as_str() {
        "inf" => "without limit".to_owned(),
        _ => format!("by {}", reason.by.short()),
    };
    let title = format!("Not {what}: these contradict each other {by}");
    let _ = writeln!(text, "\n{}", styled(EMPHASIS, &title));
    for step in reason.steps.iter().take(STEPS_SHOWN) {
        push_wrapped(text, &step.words, 2, look.width);
    }
    let more = reason.steps.len().saturating_sub(STEPS_SHOWN);
    if more > 0 || !reason.is_whole {
        let more = if reason.is_whole {
            format!("and {more} more (--json has all)")
        } else {
            "and more, too many to list".to_owned()
        };
        let _ = writeln!(text, "  {}", styled(SECONDARY, &more));
    }
    // Other steps state the used end of a link themselves.
    let are_fixed = reason.steps.iter().any(|step| step.given == "duration");
    if are_fixed && !reason.durations.is_empty() {
        let ends = reason.durations.iter().map(|link| {
            let at = match link.at.as_str() {
                "within" => "",
                "lower" => " (its lower bound)",
                _ => " (its upper bound)",
            };
            let value = match link.value.exact.as_str() {
                "inf" => "any time".to_owned(),
                _ => link.value.short(),
            };
            format!("{} to {} takes {value}{at}", link.activation, link.end)
        });
        let ends: Vec<String> = ends.collect();
        let shown = ends.len().min(STEPS_SHOWN);
        let mut line = format!("where {}", ends[..shown].join(", "));
        if ends.len() > shown {
            let _ = write!(line, ", and {} more", ends.len() - shown);
        }
        push_wrapped(text, &line, 2, look.width);
    }
}

/// Appends the bounds on the probability of success, and the links that carry a risk, the riskiest
/// first.
fn push_box(text: &mut String, best: &ControllableBox, look: TextLayout) {
    let title = "Most probable controllable box";
    let _ = writeln!(text, "\n{}", styled(EMPHASIS, title));
    let line = format!(
        "A run succeeds with a probability of at least {} if durations are as in the file, and of at \
         least {} for any dependence between them: it succeeds while each duration lies in its \
         interval.",
        percent_down(best.given),
        percent_down(best.least)
    );
    push_wrapped(text, &line, 0, look.width);
    let mut links: Vec<_> = best
        .links
        .iter()
        .filter(|link| link.probability < 1.0 - LEAST_RISK)
        .collect();
    links.sort_by(|one, other| one.probability.total_cmp(&other.probability));
    for link in links.iter().take(STEPS_SHOWN) {
        let line = format!(
            "{} to {} takes {} to {} ({})",
            link.activation,
            link.end,
            link.lower.short(),
            link.upper.short(),
            percent_down(link.probability),
        );
        push_wrapped(text, &line, 2, look.width);
    }
    if links.len() > STEPS_SHOWN {
        let more = format!("and {} more (--json has all)", links.len() - STEPS_SHOWN);
        let _ = writeln!(text, "  {}", styled(SECONDARY, &more));
    }
}

/// Formats a probability as a percentage, rounded down.
fn percent_down(probability: f64) -> String {
    format!("{:.1}%", (probability * 1000.0).floor() / 10.0)
}

fn push_simulated(text: &mut String, simulated: &Simulated, look: TextLayout) {
    let percent = |share: f64| format!("{:.1}%", share * 100.0);
    let [least, most] = simulated.interval;
    let durations = match simulated.durations {
        Durations::Given => "as in the file",
        Durations::Uniform => "uniformly between their bounds",
    };
    let executor = match simulated.executor.as_str() {
        "dispatchable" => "by the dispatchable network",
        "best-box" => "by the dispatchable network of the most probable controllable box",
        _ => "as early as the windows allow, without a guarantee",
    };
    let mut line = format!(
        "{} of {} succeed: {}, with 95% confidence between {} and {}. Durations are drawn \
         {durations} (seed {}); points are dispatched {executor}.",
        simulated.successes,
        count_with_noun(usize::try_from(simulated.runs).unwrap_or(usize::MAX), "run"),
        percent(simulated.share),
        percent(least),
        percent(most),
        simulated.seed,
    );
    if simulated.outside > 0 {
        let _ = write!(
            line,
            " In {} a duration lies outside the bounds of its link.",
            count_with_noun(
                usize::try_from(simulated.outside).unwrap_or(usize::MAX),
                "run"
            )
        );
    }
    text.push('\n');
    push_wrapped(text, &line, 0, look.width);
    if !simulated.broken.is_empty() {
        let _ = writeln!(text, "\n{}", styled(EMPHASIS, "Most often violated"));
        for broken in &simulated.broken {
            let line = format!("{} ({})", broken.requirement, broken.runs);
            push_wrapped(text, &line, 2, look.width);
        }
    }
}
