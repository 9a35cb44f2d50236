//! Conversion of arguments to the specification of a run.

use std::path::Path;

use elbowroom::answers::learn::known_sections;
use elbowroom::execute::{
    AdversaryError, AdversarySettings, FirstPlan, FirstPlanError, MAX_STATES, NamedText, RunSpec,
    SpecError, WorldNames,
};
use elbowroom::execution::executors::EXECUTORS;
use elbowroom::execution::run::{PlanningTime, RunningRule};
use elbowroom::model::Problem;
use elbowroom::num::Rational;
use elbowroom::plan::parametrize::ParametrizeError;
use elbowroom::text::Source;
use elbowroom_executive::learning::MODEL;
use elbowroom_executive::messages::count_with_noun;

use super::super::threads;
use crate::args::{EMBEDDED, FirstPlanChoice, RunArgs, RunningChoice};
use crate::exit::Failure;
use crate::input;
use crate::output;

/// Returns the specification of the arguments, and the names of the world files for messages.
/// Files are read here. Errors in the arguments themselves are reported before files are read and
/// `problem` is called.
pub(in crate::commands) fn of(
    arguments: &RunArgs,
    domain: &Path,
    problem: impl FnOnce(&NamedText) -> Result<NamedText, Failure>,
) -> Result<(RunSpec, WorldNames), Failure> {
    let empty = || NamedText {
        name: String::new(),
        text: String::new(),
    };
    let mut spec = RunSpec {
        planner: arguments.planner.clone(),
        planner_time: arguments.planner_time.clone(),
        world_process: arguments.world_process.clone(),
        has_plan: arguments.plan().is_some(),
        seed: arguments.seed,
        planning_budget: Some(arguments.planning_budget.clone()),
        planner_states: arguments.planner_states.unwrap_or(MAX_STATES),
        improve_states: arguments.improve_states,
        self_overlap: arguments.self_overlap,
        threads: threads_of(arguments, &arguments.planner)?,
        guarantee: arguments.guarantee,
        precision: arguments.precision.clone(),
        objective: arguments.objective()?,
        running: match arguments.running {
            RunningChoice::Cancel => RunningRule::Cancel,
            RunningChoice::Await => RunningRule::Await,
            RunningChoice::Keep => RunningRule::Keep,
        },
        realtime: arguments.realtime.clone(),
        timeout: arguments.timeout.clone(),
        max_replans: arguments.max_replans,
        time_limit: arguments.time_limit.clone(),
        epsilon: arguments.epsilon.clone(),
        ..RunSpec::new(empty(), empty())
    };
    // Reports a misspelt planner before any file is read.
    spec.check_planner().map_err(contradiction_failure)?;
    spec.domain = (&input::source(domain, "domain")?).into();
    spec.executor = arguments
        .executor
        .parse()
        .map_err(|error| Failure::new(error, "`elbowroom run --help` describes them all"))?;
    let vary = arguments.specifications();
    let vary = vary.iter().map(|spec| spec.parse());
    spec.vary = vary
        .collect::<Result<_, _>>()
        .map_err(|error: ParametrizeError| Failure::new(error, ""))?;
    spec.planning_time = planning_time(arguments)?;
    if let Some(path) = &arguments.likelihoods {
        spec.likelihoods = Some((&input::source(path, "likelihoods")?).into());
    }
    let mut names = WorldNames::default();
    if arguments.spoil.is_some() && !arguments.has_adversary() {
        let what = "--spoil has no effect without --world spoiler";
        return Err(Failure::new(
            what,
            "add --world spoiler, or leave out --spoil",
        ));
    }
    if arguments.has_adversary() {
        if spec.realtime.is_some() && spec.has_plan {
            let what = "--world spoiler cannot run on a wall clock";
            return Err(Failure::new(what, "leave out --realtime"));
        }
        let inside = arguments.spoil.clone();
        spec.spoiler = Some(AdversarySettings { inside });
    } else if let Some(path) = &arguments.world {
        let source = input::source(path, "world")?;
        spec.world = Some(source.text().to_owned());
        source.name().clone_into(&mut names.world);
    }
    if let Some(path) = &arguments.believed {
        let source = read_believed_world(path, arguments.learn.as_deref())?;
        spec.believed = Some(source.text().to_owned());
        source.name().clone_into(&mut names.believed);
    }
    spec.problem = problem(&spec.domain)?;
    spec.first_plan = match arguments.first_plan_by {
        Some(FirstPlanChoice::Shortest) => FirstPlan::Shortest,
        Some(FirstPlanChoice::Likeliest) => FirstPlan::Likeliest,
        None => spec.usual_first_plan(),
    };
    spec.plans_believed_durations = spec.usual_durations();
    spec.plans_in_background = spec.can_plan_in_background();
    spec.prepares_in_background = spec.plans_in_background;
    Ok((spec, names))
}

/// Reads the world file of `--believed`. In a folder of `--learn` it is the model. If there is no
/// model yet, all actions are expected to go as planned.
fn read_believed_world(path: &Path, learn: Option<&Path>) -> Result<Source, Failure> {
    let is_new = learn == Some(path) && !path.exists();
    if !path.is_dir() && !is_new {
        return input::source(path, "world");
    }
    let model = path.join(MODEL);
    if model.exists() {
        return input::source(&model, "world");
    }
    output::warn(&format!(
        "{} has no model yet: everything is assumed to go as planned",
        path.display()
    ));
    Ok(Source::new(
        "world",
        "format = \"elbowroom-world\"\nversion = 1\n",
    ))
}

/// Removes sections of a learnt model that do not fit the problem, with a warning. Other world
/// files are not changed.
pub(super) fn fit_model(arguments: &RunArgs, spec: &mut RunSpec, problem: &Problem) {
    let Some(folder) = arguments.believed.as_ref().filter(|it| it.is_dir()) else {
        return;
    };
    let model = spec.believed.as_deref().unwrap_or_default();
    let (model, left_out) = known_sections(model, problem);
    if left_out > 0 {
        let sections = count_with_noun(left_out, "section");
        let path = folder.join(MODEL);
        output::warn(&format!(
            "{}: {sections} ignored, not applicable to this problem",
            path.display()
        ));
    }
    spec.believed = Some(model);
}

/// Returns the number of threads for a planner of this name. The default is one, because the robot
/// needs the other processors during a run.
pub(super) fn threads_of(arguments: &RunArgs, planner: &str) -> Result<usize, Failure> {
    let is_embedded = planner.eq_ignore_ascii_case(EMBEDDED);
    threads::thread_count(arguments.jobs, 1, is_embedded)
}

/// Returns the rule for planning time. By default, planning takes time on a wall clock and in a
/// world process.
fn planning_time(arguments: &RunArgs) -> Result<PlanningTime, Failure> {
    let has_clock = arguments.realtime.is_some() || arguments.world_process.is_some();
    match (&arguments.planning_time, has_clock) {
        (Some(text), _) => text.parse().map_err(|_| {
            Failure::new(
                format!("`--planning-time {text}` is neither `measured` nor a number of seconds"),
                "write, for example, --planning-time 2.5",
            )
        }),
        (None, true) => Ok(PlanningTime::Measured),
        (None, false) => Ok(PlanningTime::Seconds(Rational::ZERO)),
    }
}

/// Returns a failure with advice on contradictory arguments or files.
pub(in crate::commands) fn contradiction_failure(error: SpecError) -> Failure {
    let hint = match &error {
        SpecError::Problem(wrong) => return Failure::from(wrong.clone()),
        SpecError::World(wrong) => {
            return Failure::from(wrong.clone())
                .with_default_advice("docs/reference/formats/world.md describes world files");
        }
        SpecError::Likelihoods(wrong) => {
            return Failure::from(wrong.clone()).with_default_advice(
                "docs/reference/formats/likelihoods.md describes likelihood files",
            );
        }
        SpecError::Planner(_) => {
            "`elbowroom plan --help` lists the planners; `embedded` is always available, and \
             `none` disables planning"
        }
        SpecError::UnsupportedFeature(_) => "`elbowroom check` validates plans of such a domain",
        SpecError::NeedsWorld(_) => {
            "give it a world file with --world or --believed, or name another executor"
        }
        SpecError::UnusedLikelihoods(_) => {
            let users = EXECUTORS.iter().filter(|it| it.needs.orders);
            let users: Vec<_> = users.map(|it| format!("`{}`", it.name)).collect();
            return Failure::new(
                error,
                format!(
                    "leave out --likelihoods; {} use them. Failures and changes in a world file \
                     (--world, --believed) are for the other executors",
                    users.join(" and ")
                ),
            );
        }
        SpecError::NeedsEmbedded(_) => "leave out --planner, or the number in the executor's name",
        SpecError::SelfOverlap(_) => "leave out --self-overlap, or --planner",
        SpecError::FirstPlan(why) => match why {
            FirstPlanError::Given => "leave out the plan, or --first-plan",
            FirstPlanError::ExternalPlanner => "leave out --planner, or --first-plan",
            _ => {
                "give it a world file with --world or --believed, or --likelihoods, or leave out --first-plan"
            }
        },
        SpecError::NoTimeLimit(name) => {
            return Failure::new(
                format!("--planner-time has no effect with `--planner {name}`"),
                "leave it out, or name another planner; the embedded one is limited by \
                 --planning-budget",
            );
        }
        SpecError::Adversary(error) => return adversary_failure(error),
        _ => "",
    };
    Failure::new(error, hint)
}

fn adversary_failure(error: &AdversaryError) -> Failure {
    match error {
        AdversaryError::NoPlan => {
            Failure::new("--world spoiler needs a plan", "give one with --plan")
        }
        AdversaryError::Box(message) => Failure::new(format!("--spoil: {message}"), ""),
        AdversaryError::NoEnvelope => Failure::new(error, "give a box with --spoil"),
        AdversaryError::Empty => Failure::new(error, "give a smaller box with --spoil"),
        _ => Failure::new(error, ""),
    }
}
