//! `elbowroom run`: execute a plan in a world.

mod planner;
mod process;
mod realtime;
mod replay;
mod text;
mod trace_file;

use std::sync::Arc;

use elbowroom::envelope::Guarantee;
use elbowroom::execute::{Analyst, Spoiling, WholeRegion, check_vary};
use elbowroom::execution::executors::{ExecutorSpec, Foresight, Means};
use elbowroom::execution::run::{
    PlanningTime, Ports, Report, Run, RunSettings, RunningRule, Verdict,
};
use elbowroom::execution::{Need, Odds, Planner, Preparer, Recorder, World};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl::Source;
use elbowroom::probability::{Likelihoods, likelihoods};
use elbowroom::report::trace;
use elbowroom::sim::{Paced, SimWorld, Unreliable, WorldModel};
use elbowroom::{flow, parse_box};
use serde_json::{Value, json};

use crate::args::{RunArgs, RunningChoice};
use crate::exit::{Answer, Exit, Failure};
use crate::input::{self, AnyPlan};
use crate::interrupt::Interrupt;
use crate::output::{self, tame};
use planner::Who;
use realtime::{Pace, PacedPlanner, Realtime};
use trace_file::TraceFile;

/// Executes a plan, or plays a stored run back.
pub(crate) fn run(arguments: &RunArgs) -> Answer {
    if let Some(path) = &arguments.replay {
        return replay::run(path, arguments.json);
    }
    let (Some(domain), Some(problem)) = (&arguments.domain, &arguments.problem) else {
        return Err(Failure::new("DOMAIN and PROBLEM are missing", ""));
    };
    // A misspelt planner is told before files are read.
    let who = Who::named(arguments)?;
    let texts = Texts {
        domain: input::source(domain, "domain")?,
        problem: input::source(problem, "problem")?,
    };
    let mut task = texts.task()?;
    let first = match &arguments.plan {
        Some(path) => Some(time_triggered(&mut task, path)?),
        None => None,
    };
    let likelihoods = likelihoods_text(arguments)?;
    let choices = Choices::of(arguments, likelihoods.as_ref(), &task)?;
    check_vary(&task, &choices.flow.vary).map_err(|error| {
        Failure::new(error, "`elbowroom help envelope` says what --vary can name")
    })?;
    who.suits(&choices.executor, arguments)?;
    let world = world_text(arguments)?;
    let mut file = TraceFile::open(arguments.trace.as_deref())?;
    let interrupt = Interrupt::listen();
    let header = header(arguments, &texts, world.as_deref(), likelihoods.as_ref());
    let job = Job {
        arguments,
        texts,
        choices,
        who,
        task: Arc::new(task),
        first,
        interrupt: interrupt.clone(),
    };
    let report = {
        let mut sink = |line: &str| file.write(line);
        let mut writer = trace::TraceWriter::new(Arc::clone(&job.task), &mut sink);
        writer.header(header);
        match &arguments.world_process {
            Some(command) => {
                let manners = process::Manners {
                    patience: arguments.answer_within.clone(),
                    is_strict: arguments.strict_world,
                };
                let mut world =
                    process::ProcessWorld::start(command, &job.task, manners, interrupt)?;
                let report = job.run(&mut world, None, None, &mut writer);
                world.stop();
                report
            }
            None => job.simulated(world.as_deref(), &mut writer)?,
        }
    };
    let trouble = file.close();
    let shown = if arguments.json {
        output::print_json(&text::document(&report))
    } else {
        output::print(&text::human(&report))
    };
    // The run has been what it was, whatever became of its record.
    if let Some(trouble) = trouble {
        output::warn(&trouble);
    }
    shown?;
    exit(&report.verdict)
}

/// Everything that a run needs but the world.
struct Job<'a> {
    arguments: &'a RunArgs,
    texts: Texts,
    choices: Choices,
    who: Who,
    task: Arc<Task>,
    first: Option<TimeTriggeredPlan>,
    interrupt: Interrupt,
}

impl Job<'_> {
    /// A run in a world; `model` is what is known of it, and `pace` its wall clock, if it has one.
    fn run(
        &self,
        world: &mut dyn World,
        model: Option<&WorldModel>,
        pace: Option<&Pace>,
        recorder: &mut dyn Recorder,
    ) -> Report {
        let (choices, first) = (&self.choices, self.first.as_ref());
        let is_to_end = || self.interrupt.is_requested();
        let asked = |planning: Planning<'_>, world: &mut dyn World, recorder: &mut dyn Recorder| {
            choices.run_with(&self.task, first, world, planning, recorder, &is_to_end)
        };
        let run = |planning: Planning<'_>| {
            let Some(pace) = pace else {
                return asked(planning, world, recorder);
            };
            let mut paced = PacedPlanner {
                inner: planning.planner,
                pace,
                planning_time: &choices.settings.planning_time,
            };
            let planning = Planning {
                planner: &mut paced,
                odds: planning.odds,
            };
            asked(planning, world, recorder)
        };
        let interrupt = &self.interrupt;
        self.who
            .with(self.arguments, &self.texts, choices, model, interrupt, run)
    }

    /// A run in a world that lets each action end when that is worst, inside the box that is given,
    /// or inside the plan's envelope.
    fn spoiled(&self, recorder: &mut dyn Recorder) -> Result<Report, Failure> {
        let arguments = self.arguments;
        let Some(first) = &self.first else {
            return Err(Failure::new(
                "there is no plan for --world spoiler to spoil",
                "give one with --plan",
            ));
        };
        if arguments.realtime.is_some() {
            let what = "--world spoiler has no wall clock";
            return Err(Failure::new(what, "leave out --realtime"));
        }
        let mut analyst = Analyst::new(self.choices.flow.clone());
        let prepared = analyst.prepare(&self.task, first, Need::OpenNetwork);
        let prepared = prepared.map_err(|error| Failure::new(error, ""))?;
        let envelope = match (&arguments.spoil, prepared.envelope) {
            (Some(text), _) => parse_box(text, &prepared.plan)
                .map_err(|error| Failure::new(format!("--spoil: {error}"), ""))?,
            (None, Some(envelope)) => envelope,
            (None, None) => {
                let what = "the plan has no envelope to spoil it in";
                return Err(Failure::new(what, "give a box with --spoil"));
            }
        };
        let network = prepared.plan.uncertain_network(&envelope).map_err(|_| {
            let what = "in this box nothing satisfies the plan's constraints";
            Failure::new(what, "give a smaller box with --spoil")
        })?;
        let model = WorldModel::as_planned();
        let sim = SimWorld::new(Arc::clone(&self.task), &model, arguments.seed);
        let spoiling = Spoiling::new(&prepared.plan.plan, &network, &prepared.nominal);
        let mut world = Paced::new(sim, spoiling);
        Ok(self.run(&mut world, Some(&model), None, recorder))
    }

    fn simulated(
        &self,
        world: Option<&str>,
        recorder: &mut dyn Recorder,
    ) -> Result<Report, Failure> {
        let arguments = self.arguments;
        if arguments.is_spoiled() {
            return self.spoiled(recorder);
        }
        let model = match world {
            Some(text) => WorldModel::read(text, self.task.problem()).map_err(|error| {
                let path = arguments
                    .world
                    .as_deref()
                    .unwrap_or(std::path::Path::new("-"));
                Failure::new(
                    format!("{}, {error}", path.display()),
                    "docs/formats/world.md describes world files",
                )
            })?,
            None => WorldModel::as_planned(),
        };
        let sim = SimWorld::new(Arc::clone(&self.task), &model, arguments.seed);
        let (reports, resolution) = (model.reports.clone(), model.resolution.clone());
        let mut plain;
        let mut unreliable;
        let world: &mut dyn World = if reports.is_perfect() {
            plain = sim;
            &mut plain
        } else {
            unreliable = Unreliable::new(sim, reports, arguments.seed, resolution);
            &mut unreliable
        };
        let Some(factor) = &arguments.realtime else {
            return Ok(self.run(world, Some(&model), None, recorder));
        };
        let pace = Pace::new(factor);
        let mut world = Realtime {
            inner: world,
            pace: &pace,
            interrupt: &self.interrupt,
        };
        Ok(self.run(&mut world, Some(&model), Some(&pace), recorder))
    }
}

/// Domain and problem as they stand in their files.
pub(super) struct Texts {
    pub(super) domain: Source,
    pub(super) problem: Source,
}

impl Texts {
    pub(super) fn task(&self) -> Result<Task, Failure> {
        let read = elbowroom::pddl::read_problem(&self.domain, &self.problem);
        Ok(Task::new(Arc::new(input::with_warnings(read)?)))
    }
}

/// Who makes plans, and who knows of likelier ones.
pub(super) struct Planning<'a> {
    pub(super) planner: &'a mut dyn Planner,
    pub(super) odds: Option<Box<dyn Odds>>,
}

/// How to run, from the command line.
pub(super) struct Choices {
    pub(super) executor: ExecutorSpec,
    pub(super) settings: RunSettings,
    pub(super) flow: flow::Settings,
    /// Certain, unless there is a file.
    pub(super) likelihoods: Arc<Likelihoods>,
}

impl Choices {
    fn of(arguments: &RunArgs, likelihoods: Option<&Source>, task: &Task) -> Result<Self, Failure> {
        let choices = Self::new(
            &arguments.executor,
            &arguments.specifications(),
            arguments.guarantee.into(),
            &arguments.precision,
            RunSettings {
                epsilon: arguments.epsilon.clone(),
                running: match arguments.running {
                    RunningChoice::Cancel => RunningRule::Cancel,
                    RunningChoice::Await => RunningRule::Await,
                    RunningChoice::Keep => RunningRule::Keep,
                },
                planning_time: planning_time(planning_time_text(arguments))?,
                most_replans: arguments.max_replans,
                time_limit: arguments.time_limit.clone(),
                ..RunSettings::default()
            },
        )?;
        match likelihoods {
            Some(text) => choices.with_likelihoods(text, task),
            None => Ok(choices),
        }
    }

    /// Goes by these likelihoods.
    pub(super) fn with_likelihoods(self, text: &Source, task: &Task) -> Result<Self, Failure> {
        let read = likelihoods::read(text.text().as_bytes(), task);
        let likelihoods = read.map_err(|error| {
            Failure::new(
                format!("{}, {error}", text.name()),
                "docs/formats/likelihoods.md describes likelihood files",
            )
        })?;
        Ok(Self {
            likelihoods: Arc::new(likelihoods),
            ..self
        })
    }

    pub(super) fn new(
        executor: &str,
        vary: &[String],
        guarantee: Guarantee,
        precision: &Rational,
        settings: RunSettings,
    ) -> Result<Self, Failure> {
        let executor = executor
            .parse()
            .map_err(|error| Failure::new(error, "`elbowroom run --help` describes them all"))?;
        let specs = vary.iter().map(|spec| spec.parse());
        let vary = specs.collect::<Result<_, _>>().map_err(
            |error: elbowroom::plan::parametrize::ParametrizeError| Failure::new(error, ""),
        )?;
        let mut flow = flow::Settings {
            epsilon: settings.epsilon.clone(),
            vary,
            guarantee,
            ..flow::Settings::default()
        };
        flow.search.precision = precision.clone();
        Ok(Self {
            executor,
            settings,
            flow,
            likelihoods: Arc::new(Likelihoods::certain()),
        })
    }

    pub(super) fn run_with(
        &self,
        task: &Arc<Task>,
        first: Option<&TimeTriggeredPlan>,
        world: &mut dyn World,
        planning: Planning<'_>,
        recorder: &mut dyn Recorder,
        is_to_end: &dyn Fn() -> bool,
    ) -> Report {
        let mut analyst = Analyst::new(self.flow.clone());
        let mut executor = self.executor.build(Means {
            region: Box::new(WholeRegion {
                epsilon: self.settings.epsilon.clone(),
            }),
            likelihoods: Arc::clone(&self.likelihoods),
            odds: planning.odds,
            foresight: Foresight::default(),
        });
        let ports = Ports {
            world,
            planner: planning.planner,
            preparer: &mut analyst,
            executor: executor.as_mut(),
            need: self.executor.registered.need,
            recorder,
        };
        let run = Run::new(Arc::clone(task), &self.settings, ports);
        run.ending_when(is_to_end).explaining().go(first)
    }
}

fn time_triggered(task: &mut Task, path: &std::path::Path) -> Result<TimeTriggeredPlan, Failure> {
    match input::any_plan(task, path)? {
        AnyPlan::TimeTriggered(plan) => Ok(plan),
        AnyPlan::Stn(_) => Err(Failure::new(
            format!("{} is an STN plan file", path.display()),
            "give a plan with fixed times; its network is made from it",
        )),
    }
}

fn world_text(arguments: &RunArgs) -> Result<Option<String>, Failure> {
    let Some(path) = arguments.world.as_ref().filter(|_| !arguments.is_spoiled()) else {
        return Ok(None);
    };
    let source = input::source(path, "world")?;
    Ok(Some(source.text().to_owned()))
}

fn likelihoods_text(arguments: &RunArgs) -> Result<Option<Source>, Failure> {
    let path = arguments.likelihoods.as_deref();
    path.map(|path| input::source(path, "likelihoods"))
        .transpose()
}

/// On a wall clock, making plans takes time unless somebody says otherwise.
fn planning_time_text(arguments: &RunArgs) -> &str {
    let otherwise = match &arguments.realtime {
        Some(_) => "measured",
        None => "0",
    };
    arguments.planning_time.as_deref().unwrap_or(otherwise)
}

fn planning_time(text: &str) -> Result<PlanningTime, Failure> {
    if text == "measured" {
        return Ok(PlanningTime::Measured);
    }
    match text.parse::<Rational>() {
        Ok(seconds) if !seconds.is_negative() => Ok(PlanningTime::Seconds(seconds)),
        _ => Err(Failure::new(
            format!("`--planning-time {text}` is neither `measured` nor a number of seconds"),
            "write, for example, --planning-time 2.5",
        )),
    }
}

/// Everything that the run depends on, so that it can be played back.
fn header(
    arguments: &RunArgs,
    texts: &Texts,
    world: Option<&str>,
    likelihoods: Option<&Source>,
) -> Value {
    let source = |source: &Source| json!({ "name": source.name(), "text": source.text() });
    json!({
        "domain": source(&texts.domain),
        "problem": source(&texts.problem),
        "world": world,
        "world_process": arguments.world_process,
        "planner": arguments.planner,
        "likelihoods": likelihoods.map(source),
        "has_plan": arguments.plan.is_some(),
        "executor": arguments.executor,
        "seed": arguments.seed,
        "planner_states": arguments.planner_states,
        "improve_states": arguments.improve_states,
        "vary": arguments.specifications(),
        "guarantee": Guarantee::from(arguments.guarantee).name(),
        "precision": arguments.precision.to_string(),
        "running": format!("{:?}", arguments.running).to_lowercase(),
        "planning_time": planning_time_text(arguments),
        "realtime": arguments.realtime.as_ref().map(ToString::to_string),
        "max_replans": arguments.max_replans,
        "time_limit": arguments.time_limit.to_string(),
        "epsilon": arguments.epsilon.to_string(),
    })
}

pub(super) fn exit(verdict: &Verdict) -> Answer {
    Ok(match verdict {
        Verdict::GoalReached => Exit::Yes,
        Verdict::Unsolvable | Verdict::NoPlan { .. } => Exit::No,
        Verdict::ReplanLimit | Verdict::TimeLimit => Exit::Limit,
        Verdict::Interrupted => Exit::Interrupted,
        Verdict::WorldFailed { why } => {
            return Err(Failure::new(
                format!("the world failed: {}", tame(why)),
                "docs/formats/world-protocol.md says what a world must do",
            ));
        }
    })
}
