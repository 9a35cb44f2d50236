//! `elbowroom serve`: a long-lived executive, `docs/serve.md`.

mod answers;
mod changes;
mod first;
mod front;

use std::cell::OnceCell;
use std::fmt;
use std::net::TcpListener;
use std::path::Path;
use std::sync::Arc;

use elbowroom::execute::{NamedText, RunSpec, SpecError};
use elbowroom::executive::Status;
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Source};
use elbowroom::report::trace::TraceWriter;

use super::run::resume::{self, Host};
use super::run::spec;
use super::run::{Job, RESUME_SERVE, aside, checked, journal};
use crate::args::ServeArgs;
use crate::attendance::Attendance;
use crate::calendar::dated;
use crate::exit::{Answer, Exit, Failure};
use crate::input;
use crate::interrupt::Interrupt;
use crate::output::{self, Output};
use elbowroom_executive::clock::Clock;
use elbowroom_executive::http::{self, AccessControl, Listener};
use elbowroom_executive::journal::Segments;
use elbowroom_executive::messages::plain;
use first::Client;
use front::{Front, Refused};

/// The length of a journal from which on it is begun anew, in bytes.
const LONG: u64 = 10_000_000;

/// The name of a problem that a client gives.
const GIVEN: &str = "the problem that was given";

/// Executes what is asked for, until it is asked to end.
pub(crate) fn run(arguments: &ServeArgs, output: &mut Output) -> Answer {
    check(arguments)?;
    let interrupt = Interrupt::listen_with_world();
    // A token that cannot be read is told before anything is done.
    control(arguments, &interrupt)?;
    if let Some(journal) = &arguments.run.resume {
        let server = Server {
            arguments,
            front: OnceCell::new(),
        };
        let answer = resume::run(journal, &arguments.run, &server, output);
        if let Some(front) = server.front.get() {
            front.close();
        }
        return in_order(answer);
    }
    let Some(domain) = &arguments.run.domain else {
        return Err(Failure::new(
            "DOMAIN is missing",
            "give the domain, in PDDL",
        ));
    };
    let domain_text: NamedText = (&input::source(domain, "domain")?).into();
    let mut since = None;
    let problem = |domain: &NamedText| match &arguments.run.problem {
        Some(problem) => {
            let problem = input::source(problem, "problem")?;
            let (problem, at) = dated(arguments.calendar(), domain, problem, output)?;
            since = at;
            Ok((&problem).into())
        }
        None => Ok(NamedText {
            name: GIVEN.to_owned(),
            text: String::new(),
        }),
    };
    let (mut spec, world) = spec::of(&arguments.run, domain, problem)?;
    lasting(&mut spec, arguments)?;
    let given = if arguments.run.problem.is_some() {
        Some(checked(&arguments.run, &spec, world.as_ref(), output)?)
    } else {
        heeded(&domain_text)?;
        spec.check().map_err(spec::contradiction)?;
        None
    };
    let journal = journal(&arguments.run, RESUME_SERVE)?;
    let journal =
        journal.map(|file| file.with_rotation(Some(segments(arguments)), &output::warnings()));
    let front = open(arguments, &interrupt, &domain_text)?;
    let (task, first, client) = if let Some((task, first)) = given {
        (task, first, None)
    } else {
        let of = (&mut spec, world.as_ref());
        let Some(((task, first), at, client)) = await_problem(&front, arguments, of, output) else {
            // It was asked to end before there was a problem.
            front.close();
            return Ok(Exit::Yes);
        };
        since = at;
        (task, first, Some(client))
    };
    let begun = || {
        if let Some(client) = &client {
            client.accept();
        }
    };
    let answer = begin(&front, &spec, &task).and_then(|attendance| {
        let job = Job {
            aside: aside(&arguments.run, &interrupt),
            spec: &spec,
            task: &task,
            first,
            interrupt: &interrupt,
            attendance: &attendance,
            journal,
            begun: &begun,
            since,
        };
        job.execute(&arguments.run, output)
    });
    if let (Some(client), Err(failure)) = (&client, &answer) {
        client.refuse(refusal(503, failure));
    }
    front.close();
    in_order(answer)
}

/// A problem, and the plan to begin with.
type Begun = (Arc<Task>, Option<TimeTriggeredPlan>);

/// Waits for a problem that can be executed; whoever gives another one is told why it cannot. `None` if
/// the executive is asked to end before.
fn await_problem(
    front: &Front,
    arguments: &ServeArgs,
    (spec, world): (&mut RunSpec, Option<&Source>),
    output: &mut Output,
) -> Option<(Begun, Option<Clock>, Client)> {
    let interrupt = Interrupt::listen_with_world();
    loop {
        let (text, client) = front.first.wait(&interrupt)?.parts();
        let given = Source::new(GIVEN, text);
        let begun =
            dated(arguments.calendar(), &spec.domain, given, output).and_then(|(problem, at)| {
                spec.problem = (&problem).into();
                Ok((checked(&arguments.run, spec, world, output)?, at))
            });
        match begun {
            Ok((begun, at)) => return Some((begun, at, client)),
            Err(failure) => {
                output::warn(&format!("a problem was refused: {}", failure.sentence()));
                front.first.reopen();
                client.refuse(refusal(422, &failure));
            }
        }
    }
}

/// A failure as it is told to a client.
fn refusal(status: u16, failure: &Failure) -> Refused {
    let help = failure
        .advice()
        .unwrap_or("look at what the executive says");
    Refused::new(status, failure.sentence(), help)
}

/// What a specification is of an executive, which stays.
fn lasting(spec: &mut RunSpec, arguments: &ServeArgs) -> Result<(), Failure> {
    spec.is_lasting = true;
    // Whoever asks for another first plan is told why there is none.
    if arguments.run.first_plan_by.is_none() {
        spec.first_plan = spec.usual_first_plan();
    }
    if spec.world_process.is_none() && spec.realtime.is_none() {
        spec.realtime = Some(Rational::ONE);
        if arguments.run.planning_time.is_none() {
            spec.planning_time = elbowroom::execution::run::PlanningTime::Measured;
        }
    }
    let knows_one_goal = spec.executor.registered.name == "lookahead";
    if knows_one_goal || spec.executor.asks_odds() {
        return Err(Failure::new(
            format!(
                "`{}` reckons with one goal, and goals change here",
                spec.executor
            ),
            "choose another executor, such as guarded or live",
        ));
    }
    spec.plans_aside = spec.can_plan_aside();
    spec.readies_aside = spec.plans_aside;
    Ok(())
}

/// A domain that no problem could be executed of is refused before anybody is asked for one. Whatever
/// else is wrong with it is told with the problem.
fn heeded(domain: &NamedText) -> Result<(), Failure> {
    let mut words = domain.text.split(['(', ')', ' ', '\t', '\r', '\n']);
    let words = &mut words.by_ref().filter(|word| !word.is_empty());
    let name = words.skip_while(|word| !word.eq_ignore_ascii_case("domain"));
    let name = name.take(2).last().unwrap_or_default();
    let nothing = format!("(define (problem nothing) (:domain {name}) (:init) (:goal (and)))");
    let nothing = Source::new("nothing", nothing);
    let Ok((problem, _)) = pddl::read_problem(&domain.source(), &nothing) else {
        return Ok(());
    };
    match Task::new(problem).only_judged() {
        Some(feature) => Err(spec::contradiction(SpecError::Unheeded(feature))),
        None => Ok(()),
    }
}

/// Who runs until told to end has done what was asked when it ends in order.
fn in_order(answer: Answer) -> Answer {
    answer.map(|exit| match exit {
        Exit::Interrupted => Exit::Yes,
        other => other,
    })
}

fn control(arguments: &ServeArgs, interrupt: &Interrupt) -> Result<Option<AccessControl>, Failure> {
    let token = arguments.token.as_ref();
    token
        .map(|path| AccessControl::read(path, interrupt.stop().clone()))
        .transpose()
        .map_err(Failure::from)
}

/// What belongs to `elbowroom run` alone.
fn check(arguments: &ServeArgs) -> Result<(), Failure> {
    let run = &arguments.run;
    let (is_replayed, is_shown) = (run.replay.is_some(), run.serve.is_some());
    for (is_given, option) in [(is_replayed, "--replay"), (is_shown, "--serve")] {
        if is_given {
            return Err(Failure::new(
                format!("{option} belongs to `elbowroom run`"),
                "an executive listens at --http, and its journal is gone on with by --resume",
            ));
        }
    }
    let has_journal = run.journal.is_some() || run.resume.is_some();
    let sized = arguments.journal_size.is_some() || arguments.journal_segments.is_some();
    if sized && !has_journal {
        return Err(Failure::new(
            "there is no journal that could be begun anew",
            "give --journal FILE, or leave out --journal-size and --journal-segments",
        ));
    }
    if run.is_spoiled() {
        return Err(Failure::new(
            "--world spoiler has no wall clock",
            "name a world file, or a program with --world-process",
        ));
    }
    Ok(())
}

/// Listens, and says where.
fn open(
    arguments: &ServeArgs,
    interrupt: &Interrupt,
    domain: &NamedText,
) -> Result<Arc<Front>, Failure> {
    let control = control(arguments, interrupt)?;
    let address = arguments.http.0;
    let cannot = |why: &dyn fmt::Display| {
        Failure::new(
            format!("cannot listen at {address}: {why}"),
            "choose another port with --http; with port 0, a free one is taken",
        )
    };
    let listener = TcpListener::bind(address).map_err(|error| cannot(&plain(&error)))?;
    let own = listener
        .local_addr()
        .map_err(|error| cannot(&plain(&error)))?;
    let socket = match &arguments.socket {
        Some(path) => Some(socket(path)?),
        None => None,
    };
    let has_token = control.is_some();
    let front = Arc::new(Front::new(control, own, domain));
    for (listener, is_local_only) in [
        (Some(Listener::Tcp(listener)), own.ip().is_loopback()),
        (socket, false),
    ] {
        let Some(listener) = listener else { continue };
        let (served, known) = (Arc::clone(&front), Arc::clone(&front));
        let is_known = move |request: &http::Request| known.is_known(request);
        http::serve(listener, is_known, move |request, stream| {
            served.serve(request, is_local_only, stream)
        });
    }
    let with_token = if has_token {
        ""
    } else {
        "; to be looked at only, as there is no --token"
    };
    output::tell(&format!("listening at http://{own}/{with_token}"));
    if let Some(path) = &arguments.socket {
        output::tell(&format!("listening at {}", path.display()));
    }
    Ok(front)
}

/// A socket that only its owner can reach. One that nobody listens at any more is replaced.
#[cfg(unix)]
fn socket(path: &Path) -> Result<Listener, Failure> {
    use std::os::unix::fs::PermissionsExt as _;
    use std::os::unix::net::{UnixListener, UnixStream};

    let cannot = |why: &dyn fmt::Display| {
        Failure::new(
            format!("cannot listen at {}: {why}", path.display()),
            "choose a path at which there is nothing, in a folder that exists and that you may write to",
        )
    };
    let is_socket = std::fs::symlink_metadata(path)
        .is_ok_and(|it| std::os::unix::fs::FileTypeExt::is_socket(&it.file_type()));
    if is_socket {
        if UnixStream::connect(path).is_ok() {
            return Err(cannot(&"another program listens there"));
        }
        let _ = std::fs::remove_file(path);
    }
    let listener = UnixListener::bind(path).map_err(|error| cannot(&plain(&error)))?;
    let owner_only = std::fs::Permissions::from_mode(0o600);
    std::fs::set_permissions(path, owner_only).map_err(|error| cannot(&plain(&error)))?;
    Ok(Listener::Unix(listener))
}

#[cfg(not(unix))]
fn socket(path: &Path) -> Result<Listener, Failure> {
    Err(Failure::new(
        format!(
            "cannot listen at {}: this system has no such sockets",
            path.display()
        ),
        "leave out --socket; --http serves the same",
    ))
}

/// From now on there is a run to ask about.
fn begin(front: &Front, spec: &RunSpec, task: &Arc<Task>) -> Result<Attendance, Failure> {
    let status = Status::new(task, spec.timeout.clone());
    let buffer = front.buffer();
    let mut header = |line: &str| buffer.add(line);
    let written = TraceWriter::new(Arc::clone(task), &mut header).header(spec);
    written.map_err(|error| Failure::new(format!("cannot show the run: {error}"), ""))?;
    front.begin(status.clone(), task);
    Ok(Attendance::by(
        front.queue().clone(),
        status,
        buffer.clone(),
    ))
}

fn segments(arguments: &ServeArgs) -> Segments {
    Segments {
        size: arguments.journal_size.unwrap_or(LONG),
        kept: arguments.journal_segments.unwrap_or(1),
    }
}

/// Attends a run that goes on after a crash.
struct Server<'a> {
    arguments: &'a ServeArgs,
    front: OnceCell<Arc<Front>>,
}

impl Host for Server<'_> {
    fn attend(
        &self,
        spec: &RunSpec,
        task: &Arc<Task>,
        interrupt: &Interrupt,
    ) -> Result<Attendance, Failure> {
        if !spec.is_lasting {
            return Err(Failure::new(
                "this is the journal of a run that ends with its goal",
                "go on with `elbowroom run --resume`",
            ));
        }
        let front = open(self.arguments, interrupt, &spec.domain)?;
        let attendance = begin(&front, spec, task);
        let _ = self.front.set(front);
        attendance
    }

    fn segments(&self) -> Option<Segments> {
        Some(segments(self.arguments))
    }
}
