//! `elbowroom serve`: a long-lived executive, `docs/reference/serve.md`.

use std::cell::OnceCell;
use std::sync::Arc;

use elbowroom::execute::{NamedText, RunInputs, RunSpec, SpecError, WorldNames};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Source};

use super::run::resume::{self, ResumeHost};
use super::run::spec;
use super::run::{Job, RESUME_SERVE, access, checked, journal};
use crate::args::{RunArgs, ServeArgs};
use crate::calendar::with_calendar;
use crate::exit::{Answer, Exit, Failure};
use crate::input;
use crate::interrupt::Interrupt;
use crate::output::{self, Output};
use elbowroom_executive::api::{self, ApiError, ApiRouter, Client};
use elbowroom_executive::clock::Clock;
use elbowroom_executive::history::HistoryFiles;
use elbowroom_executive::journal::Segments;
use elbowroom_executive::operator::OperatorInterface;
use elbowroom_executive::{Error, make_persistent};

/// Default length of a journal at which it is rotated, in bytes.
const DEFAULT_JOURNAL_SIZE: u64 = 10_000_000;

/// The name of a problem submitted by a client.
const SUBMITTED_PROBLEM: &str = "the problem that was given";

/// Runs the executive until it is stopped.
pub(crate) fn run(arguments: &ServeArgs, output: &mut Output) -> Answer {
    check(arguments)?;
    let interrupt = Interrupt::listen_with_world();
    // Reports an unreadable token before anything is started.
    access(&arguments.run, &interrupt)?;
    if let Some(journal) = &arguments.run.resume {
        let server = Server {
            arguments,
            router: OnceCell::new(),
        };
        let answer = resume::run(journal, &arguments.run, &server, output);
        if let Some(router) = server.router.get() {
            router.close();
        }
        return interrupt_as_success(answer);
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
            let (problem, at) = with_calendar(arguments.calendar(), domain, problem, output)?;
            since = at;
            Ok((&problem).into())
        }
        None => Ok(NamedText {
            name: SUBMITTED_PROBLEM.to_owned(),
            text: String::new(),
        }),
    };
    let (mut spec, names) = spec::of(&arguments.run, domain, problem)?;
    configure_executive(&mut spec, arguments);
    let given = if arguments.run.problem.is_some() {
        Some(checked(&arguments.run, spec.clone(), &names, output)?)
    } else {
        check_domain(&domain_text)?;
        spec.check_new().map_err(spec::contradiction_failure)?;
        None
    };
    let journal = journal(&arguments.run, RESUME_SERVE)?;
    let journal =
        journal.map(|file| file.with_rotation(Some(segments(arguments)), &output::warnings()));
    let router = open(arguments, &interrupt, &domain_text)?;
    set_history_files(&router, &arguments.run);
    let (inputs, first, client) = if let Some((inputs, first)) = given {
        (inputs, first, None)
    } else {
        announce(arguments, &router);
        let of = (&spec, &names);
        let Some(((inputs, first), at, client)) = await_problem(&router, arguments, of, output)
        else {
            // The executive was stopped before it received a problem.
            router.close();
            return Ok(Exit::Yes);
        };
        since = at;
        (inputs, first, Some(client))
    };
    let started = || {
        if let Some(client) = &client {
            client.accept();
        }
    };
    let answer = router
        .begin_run(&inputs)
        .map_err(Failure::from)
        .and_then(|operator| {
            if client.is_none() {
                announce(arguments, &router);
            }
            let job = Job {
                inputs: &inputs,
                first_plan: first,
                interrupt: &interrupt,
                operator: &operator,
                journal,
                started: &started,
                clock: since,
            };
            job.execute(&arguments.run, output)
        });
    if let (Some(client), Err(failure)) = (&client, &answer) {
        client.refuse(refusal(503, failure));
    }
    router.close();
    interrupt_as_success(answer)
}

/// The inputs of a run, and its first plan if one is given.
type InitialRun = (RunInputs, Option<TimeTriggeredPlan>);

/// Waits for a problem that can be executed. Rejects other problems with the reason. Returns `None`
/// if the executive is stopped before.
fn await_problem(
    router: &ApiRouter,
    arguments: &ServeArgs,
    (spec, names): (&RunSpec, &WorldNames),
    output: &mut Output,
) -> Option<(InitialRun, Option<Clock>, Client)> {
    let interrupt = Interrupt::listen_with_world();
    loop {
        let (text, client) = router.initial_problem().wait(interrupt.stop())?.parts();
        let given = Source::new(SUBMITTED_PROBLEM, text);
        let begun = with_calendar(arguments.calendar(), &spec.domain, given, output).and_then(
            |(problem, at)| {
                let spec = RunSpec {
                    problem: (&problem).into(),
                    ..spec.clone()
                };
                Ok((checked(&arguments.run, spec, names, output)?, at))
            },
        );
        match begun {
            Ok((begun, at)) => return Some((begun, at, client)),
            Err(failure) => {
                output::warn(&format!("a problem was rejected: {}", failure.sentence()));
                router.initial_problem().reopen();
                client.refuse(refusal(422, &failure));
            }
        }
    }
}

/// Converts a failure to an error response.
fn refusal(status: u16, failure: &Failure) -> ApiError {
    let help = failure
        .advice()
        .unwrap_or("see the messages of the executive");
    ApiError::new(status, failure.sentence(), help)
}

/// Adapts a specification for an executive.
fn configure_executive(spec: &mut RunSpec, arguments: &ServeArgs) {
    spec.is_persistent = true;
    // An explicitly requested first plan is kept, so that an error is reported if it is not
    // available.
    if arguments.run.first_plan_by.is_none() {
        spec.first_plan = spec.usual_first_plan();
    }
    if spec.world_process.is_none() && spec.realtime.is_none() {
        spec.realtime = Some(Rational::ONE);
        if arguments.run.planning_time.is_none() {
            spec.planning_time = elbowroom::execution::run::PlanningTime::Measured;
        }
    }
    make_persistent(spec);
}

/// Rejects a domain with errors, or one whose problems cannot be executed, before a problem is
/// given. Warnings are printed with the problem.
fn check_domain(domain: &NamedText) -> Result<(), Failure> {
    let mut words = domain.text.split(['(', ')', ' ', '\t', '\r', '\n']);
    let words = &mut words.by_ref().filter(|word| !word.is_empty());
    let name = words.skip_while(|word| !word.eq_ignore_ascii_case("domain"));
    let name = name.take(2).last().unwrap_or_default();
    let nothing = format!("(define (problem nothing) (:domain {name}) (:init) (:goal (and)))");
    let nothing = Source::new("nothing", nothing);
    let (problem, _) = pddl::read_problem(&domain.source(), &nothing)?;
    match Task::new(problem).validator_only_feature() {
        Some(feature) => Err(spec::contradiction_failure(SpecError::UnsupportedFeature(
            feature,
        ))),
        None => Ok(()),
    }
}

/// Maps an interrupt to success: an executive normally ends by a request to stop.
fn interrupt_as_success(answer: Answer) -> Answer {
    answer.map(|exit| match exit {
        Exit::Interrupted => Exit::Yes,
        other => other,
    })
}

/// Rejects options that only `elbowroom run` supports.
fn check(arguments: &ServeArgs) -> Result<(), Failure> {
    let run = &arguments.run;
    let (is_replayed, is_shown) = (run.replay.is_some(), run.serve.is_some());
    for (is_given, option) in [(is_replayed, "--replay"), (is_shown, "--serve")] {
        if is_given {
            return Err(Failure::new(
                format!("{option} is an option of `elbowroom run`"),
                "an executive listens at --http, and --resume continues its journal",
            ));
        }
    }
    let has_journal = run.journal.is_some() || run.resume.is_some();
    let sized = arguments.journal_size.is_some() || arguments.journal_segments.is_some();
    if sized && !has_journal {
        return Err(Failure::new(
            "--journal-size and --journal-segments need a journal",
            "give --journal FILE, or leave them out",
        ));
    }
    if run.has_adversary() {
        return Err(Failure::new(
            "--world spoiler cannot run on a wall clock",
            "name a world file, or a program with --world-process",
        ));
    }
    Ok(())
}

/// Sets the files of the history: the journal, and the folder with copies of its segments.
fn set_history_files(router: &ApiRouter, arguments: &RunArgs) {
    if let Some(journal) = arguments.journal.as_ref().or(arguments.resume.as_ref()) {
        router.set_history_files(HistoryFiles {
            journal: journal.clone(),
            archive: arguments.learn.clone(),
        });
    }
}

/// Starts the HTTP interface.
fn open(
    arguments: &ServeArgs,
    interrupt: &Interrupt,
    domain: &NamedText,
) -> Result<Arc<ApiRouter>, Error> {
    let control = access(&arguments.run, interrupt)?;
    api::serve(
        arguments.http,
        arguments.socket.as_deref(),
        control,
        Some(domain),
    )
}

/// Prints the address of the executive. If it has a problem, it already accepts requests about it.
fn announce(arguments: &ServeArgs, router: &ApiRouter) {
    let with_token = match &arguments.run.token {
        Some(_) => "",
        None => "; read-only without --token",
    };
    let own = router.address();
    output::print_to_stderr(&format!("listening at http://{own}/{with_token}"));
    if let Some(path) = &arguments.socket {
        output::print_to_stderr(&format!("listening at {}", path.display()));
    }
}

fn segments(arguments: &ServeArgs) -> Segments {
    Segments {
        size: arguments.journal_size.unwrap_or(DEFAULT_JOURNAL_SIZE),
        kept: arguments.journal_segments.unwrap_or(1),
    }
}

/// Host of a run that is resumed after a crash.
struct Server<'a> {
    arguments: &'a ServeArgs,
    router: OnceCell<Arc<ApiRouter>>,
}

impl ResumeHost for Server<'_> {
    fn operator(
        &self,
        inputs: &RunInputs,
        interrupt: &Interrupt,
    ) -> Result<OperatorInterface, Error> {
        let spec = inputs.spec();
        if !spec.is_persistent {
            return Err(Error::new(
                "this is the journal of a single run (`elbowroom run`)",
                "continue with `elbowroom run --resume`",
            ));
        }
        let router = open(self.arguments, interrupt, &spec.domain)?;
        set_history_files(&router, &self.arguments.run);
        let operator = router.begin_run(inputs);
        announce(self.arguments, &router);
        let _ = self.router.set(router);
        operator
    }

    fn segments(&self) -> Option<Segments> {
        Some(segments(self.arguments))
    }
}
