//! Computation of replies.

use std::sync::Arc;
use std::time::Duration;

use elbowroom::answers::check::{CheckAnswer, CheckFinding, CheckRequest, ValidationReport, check};
use elbowroom::answers::envelope::{EnvelopeFinding, EnvelopeRequest, Search, envelope};
use elbowroom::answers::plan::{PlanFinding, PlanRequest, plan};
use elbowroom::answers::region::{RegionFinding, RegionSettings, region};
use elbowroom::answers::run::simulate;
use elbowroom::answers::stn::{StnFinding, StnRequest, stn};
use elbowroom::envelope::{BestSettings, Guarantee};
use elbowroom::execute::{RunInputs, RunSpec, SpecError, WorldNames};
use elbowroom::execution::executors::{DEFAULT_EXECUTOR, EXECUTORS};
use elbowroom::execution::run::{MissingPlan, TimeoutRule, Verdict};
use elbowroom::model::validate::Settings;
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Diagnostic};
use elbowroom::plan::format;
use elbowroom::plan::parametrize::VarySpec;
use elbowroom::report::trace::TraceWriter;
use elbowroom::sim::WorldModel;
use elbowroom::{AnyPlan, PlanKind, RoundingRule};
use serde_json::json;

use crate::deadline_observer::DeadlineObserver;
use crate::question::{
    CheckQuestion, EnvelopeQuestion, Method, PageQuestion, PlanQuestion, Question, RunQuestion,
    StnQuestion, Text,
};
use crate::reply::{Failure, Reply, document};

/// Exit codes, see `docs/reference/exit-codes.md`.
const YES: u8 = 0;
const NO: u8 = 1;
const BAD_INPUT: u8 = 2;
const LIMIT: u8 = 3;
const INTERRUPTED: u8 = 130;

type Clock<'a> = dyn FnMut() -> Duration + Send + 'a;

pub(crate) fn answer(question: &Question, clock: &mut Clock<'_>) -> Result<Reply, Failure> {
    let mut clock = || clock();
    match question {
        Question::Check(question) => check_plan(question),
        Question::Plan(question) => find_plan(question, &mut clock),
        Question::Stn(question) => relax_plan(question),
        Question::Envelope(question) => compute_envelope(question, &mut clock),
        Question::Run(question) => execute_plan(question, &mut clock),
        Question::Page(question) => page(question),
        Question::About => about(),
    }
}

/// A problem, and the warnings about its texts.
struct ParsedProblem {
    task: Task,
    warnings: Vec<Diagnostic>,
}

impl ParsedProblem {
    fn parse(domain: &Text, problem: &Text, epsilon: Option<&str>) -> Result<Self, Failure> {
        let epsilon = match epsilon {
            Some(text) => positive("epsilon", text)?,
            None => Task::default_epsilon(),
        };
        let (problem, warnings) = pddl::read_problem(&domain.source(), &problem.source())?;
        let task = Task::new(problem).with_epsilon(epsilon);
        Ok(Self { task, warnings })
    }

    /// Reads a plan of either kind. The content, or the extension `.stn`, determines the kind.
    fn plan(&mut self, text: &Text) -> Result<AnyPlan, Failure> {
        self.parse_plan_with_rounding(text, &RoundingRule::default())
    }

    fn parse_plan_with_rounding(
        &mut self,
        text: &Text,
        rule: &RoundingRule,
    ) -> Result<AnyPlan, Failure> {
        let has_name_of_stn = text.name.to_ascii_lowercase().ends_with(".stn");
        if has_name_of_stn || PlanKind::of_text(&text.text) == PlanKind::Stn {
            return Ok(AnyPlan::Stn(format::read(text.source(), &self.task)?));
        }
        let (plan, warnings) = rule.read_plan(&text.source(), &self.task)?;
        self.warnings.extend(warnings);
        Ok(AnyPlan::TimeTriggered(plan))
    }

    fn plan_with_times(
        &mut self,
        text: &Text,
        rule: &RoundingRule,
    ) -> Result<TimeTriggeredPlan, Failure> {
        match self.parse_plan_with_rounding(text, rule)? {
            AnyPlan::TimeTriggered(plan) => Ok(plan),
            AnyPlan::Stn(_) => Err(Failure::new(format!(
                "{} is an STN plan file, which describes many plans; give a plan with fixed times",
                text.name
            ))),
        }
    }
}

fn check_plan(question: &CheckQuestion) -> Result<Reply, Failure> {
    let mut read = ParsedProblem::parse(
        &question.domain,
        &question.problem,
        question.epsilon.as_deref(),
    )?;
    let tolerance = question.tolerance.as_deref();
    let tolerance = tolerance
        .map(|text| number("tolerance", text))
        .transpose()?;
    let rule = RoundingRule::with_tolerance(tolerance);
    let plan = match &question.plan {
        Some(text) => Some(read.plan_with_times(text, &rule)?),
        None => None,
    };
    let request = CheckRequest {
        task: &read.task,
        plan: plan.as_ref(),
        name: question
            .plan
            .as_ref()
            .map_or_else(String::new, |text| text.name.clone()),
        settings: Settings::default(),
    };
    let answer = check(&request).map_err(Failure::new)?;
    let is_invalid = matches!(
        answer,
        CheckAnswer::Plan(ValidationReport {
            finding: CheckFinding::Invalid { .. },
            ..
        })
    );
    Ok(Reply {
        exit: if is_invalid { NO } else { YES },
        document: document(&answer, &read.warnings)?,
        ..Reply::default()
    })
}

fn find_plan(
    question: &PlanQuestion,
    clock: &mut (dyn FnMut() -> Duration + Send),
) -> Result<Reply, Failure> {
    let read = ParsedProblem::parse(
        &question.domain,
        &question.problem,
        question.epsilon.as_deref(),
    )?;
    let limit = limit(question.time_limit.as_deref())?;
    let mut request = PlanRequest {
        task: &read.task,
        first_plan_only: question.first || limit.is_none(),
        most_memory: None,
        self_overlap: question.self_overlap,
        threads: 1,
    };
    let mut outcome =
        plan(&mut request, &mut DeadlineObserver::start(clock, limit)).map_err(Failure::new)?;
    let files = [&question.domain.name[..], &question.problem.name];
    outcome.answer.name_files(files);
    Ok(Reply {
        exit: match &outcome.answer.finding {
            PlanFinding::Plan { .. } => YES,
            PlanFinding::NoPlan { .. } => NO,
            PlanFinding::None { .. } => LIMIT,
        },
        document: document(&outcome.answer, &read.warnings)?,
        ..Reply::default()
    })
}

fn relax_plan(question: &StnQuestion) -> Result<Reply, Failure> {
    let mut read = ParsedProblem::parse(
        &question.domain,
        &question.problem,
        question.epsilon.as_deref(),
    )?;
    let plan = read.plan(&question.plan)?;
    let request = StnRequest {
        task: &read.task,
        plan,
    };
    let outcome = stn(&request).map_err(Failure::new)?;
    let stn = match &outcome.plan {
        Some(plan) => Some(format::write(&read.task, plan).map_err(Failure::new)?),
        None => None,
    };
    Ok(Reply {
        exit: match &outcome.answer.finding {
            StnFinding::Network { .. } => YES,
            StnFinding::Invalid { .. } => NO,
        },
        document: document(&outcome.answer, &read.warnings)?,
        stn,
        ..Reply::default()
    })
}

fn compute_envelope(
    question: &EnvelopeQuestion,
    clock: &mut (dyn FnMut() -> Duration + Send),
) -> Result<Reply, Failure> {
    let limit = limit(question.time_limit.as_deref())?;
    let mut watch = DeadlineObserver::start(clock, limit);
    let mut read = ParsedProblem::parse(
        &question.domain,
        &question.problem,
        question.epsilon.as_deref(),
    )?;
    let controllable = question.controllable.iter();
    let controllable = controllable.map(|action| format!("controllable {action}"));
    let vary: Result<Vec<VarySpec>, _> = question
        .vary
        .iter()
        .cloned()
        .chain(controllable)
        .map(|text| text.parse())
        .collect();
    let vary = vary.map_err(Failure::new)?;
    let plan = read.plan(&question.plan)?;
    let world = match &question.world {
        Some(text) => {
            let source = pddl::Source::new(text.name.as_str(), text.text.as_str());
            let world = WorldModel::read(&source, read.task.problem());
            Some(Arc::new(world.map_err(Failure::from)?))
        }
        None => None,
    };
    let search = Search::default();
    let precision = match &question.precision {
        Some(text) => Some(positive("precision", text)?),
        None => None,
    };
    let request = EnvelopeRequest {
        name: question.plan.name.clone(),
        vary,
        guarantee: question.guarantee.unwrap_or_default(),
        enforce: question.enforce,
        timeout: timeout(question.timeout.as_deref())?,
        contains: question.contains.clone(),
        search: Search {
            relative: match precision {
                Some(_) => None,
                None => search.relative,
            },
            precision: precision.unwrap_or(search.precision),
            growth: question.growth,
            sharpen: question.sharpen,
            method: question.method.map(Method::of_boxes),
            most_checks: search.most_checks,
            best: BestSettings {
                objective: question.objective,
                symmetric: question.symmetric,
                ..search.best
            },
        },
        world,
        ..EnvelopeRequest::new(&Arc::new(read.task), plan)
    };
    if question.method == Some(Method::Exact) {
        return compute_exact_region(question, &request, &read.warnings, &mut watch);
    }
    let outcome = envelope(&request, &mut watch).map_err(Failure::new)?;
    Ok(Reply {
        exit: match &outcome.answer.finding {
            EnvelopeFinding::Envelope { .. } | EnvelopeFinding::Inside { .. } => YES,
            EnvelopeFinding::Fails(_) | EnvelopeFinding::Outside { .. } => NO,
            EnvelopeFinding::None { .. } => LIMIT,
        },
        document: document(&outcome.answer, &read.warnings)?,
        ..Reply::default()
    })
}

/// Computes the whole region.
fn compute_exact_region(
    question: &EnvelopeQuestion,
    request: &EnvelopeRequest,
    warnings: &[Diagnostic],
    watch: &mut DeadlineObserver<'_>,
) -> Result<Reply, Failure> {
    if question.guarantee.is_some_and(|own| own != Guarantee::Weak) {
        return Err(Failure::new(
            "the region is that of the weak guarantee; the others are about boxes",
        ));
    }
    let settings = RegionSettings {
        with_boxes: question.volume,
        with_volume: question.volume,
        seed: question.seed,
    };
    let outcome = region(request, &settings, watch).map_err(Failure::new)?;
    Ok(Reply {
        exit: match &outcome.answer.finding {
            RegionFinding::Region { pieces, .. } if !pieces.is_empty() => YES,
            RegionFinding::None { .. } => LIMIT,
            _ => NO,
        },
        document: document(&outcome.answer, warnings)?,
        ..Reply::default()
    })
}

/// Parses the rule that sets time-outs.
fn timeout(text: Option<&str>) -> Result<TimeoutRule, Failure> {
    text.map_or(Ok(TimeoutRule::default()), str::parse)
        .map_err(|error| Failure::new(format!("timeout: {error}")))
}

fn execute_plan(
    question: &RunQuestion,
    clock: &mut (dyn FnMut() -> Duration + Send),
) -> Result<Reply, Failure> {
    let mut spec = RunSpec {
        world: question.world.as_ref().map(|world| world.text.clone()),
        likelihoods: question.likelihoods.as_ref().map(Text::named),
        has_plan: question.plan.is_some(),
        seed: question.seed,
        guarantee: question.guarantee,
        ..RunSpec::new(question.domain.named(), question.problem.named())
    };
    if let Some(executor) = &question.executor {
        spec.executor = executor.parse().map_err(Failure::new)?;
    }
    spec.timeout = timeout(question.timeout.as_deref())?;
    if let Some(most) = question.max_replans {
        spec.max_replans = most;
    }
    if let Some(epsilon) = &question.epsilon {
        spec.epsilon = positive("epsilon", epsilon)?;
    }
    let mut read = ParsedProblem::parse(
        &question.domain,
        &question.problem,
        question.epsilon.as_deref(),
    )?;
    let first = match &question.plan {
        Some(text) => Some(read.plan_with_times(text, &RoundingRule::default())?),
        None => None,
    };
    spec.check().map_err(spec_error)?;
    let task = Arc::new(read.task);
    let inputs = RunInputs::of(spec, Arc::clone(&task), &WorldNames::default());
    let inputs = inputs.map_err(spec_error)?;
    let mut trace = String::new();
    let mut sink = |line: &str| trace.push_str(line);
    let mut writer = TraceWriter::new(Arc::clone(&task), &mut sink);
    let written = writer.header(inputs.spec());
    written.map_err(|error| Failure::new(format!("cannot write the trace: {error}")))?;
    let execution = inputs
        .execution(first)
        .map_err(spec_error)?
        .recorded_by(&mut writer);
    let mut watcher = DeadlineObserver::start(clock, None);
    let outcome = simulate(&inputs, execution, &mut watcher).map_err(spec_error)?;
    Ok(Reply {
        exit: match outcome.verdict() {
            Verdict::GoalReached => YES,
            Verdict::Unsolvable
            | Verdict::NoPlan {
                missing: MissingPlan::NotSearched,
                ..
            } => NO,
            Verdict::ReplanLimit | Verdict::TimeLimit | Verdict::NoPlan { .. } => LIMIT,
            Verdict::Interrupted => INTERRUPTED,
            Verdict::PlannerFailed { .. } | Verdict::WorldFailed { .. } => BAD_INPUT,
        },
        document: document(&outcome.answer, &read.warnings)?,
        trace: Some(trace),
        ..Reply::default()
    })
}

/// Converts a specification error. Errors of a world or of likelihoods refer to their texts.
fn spec_error(error: SpecError) -> Failure {
    match error {
        SpecError::Problem(wrong) | SpecError::World(wrong) | SpecError::Likelihoods(wrong) => {
            wrong.into()
        }
        error => Failure::new(error),
    }
}

fn page(question: &PageQuestion) -> Result<Reply, Failure> {
    let page = elbowroom_page::page(&question.of.name, &question.of.text).map_err(Failure::new)?;
    Ok(Reply {
        exit: YES,
        page: Some(page),
        ..Reply::default()
    })
}

fn about() -> Result<Reply, Failure> {
    let executors = EXECUTORS.iter().map(|executor| {
        json!({
            "usage": executor.usage(),
            "example": executor.example(),
            "summary": executor.summary,
        })
    });
    let guarantees = Guarantee::TERMS.iter();
    let guarantees = guarantees.map(|(_, name, meaning)| json!({"name": name, "meaning": meaning}));
    let about = json!({
        "format": "elbowroom-about",
        "version": 1,
        "elbowroom": env!("CARGO_PKG_VERSION"),
        "default_executor": DEFAULT_EXECUTOR,
        "executors": executors.collect::<Vec<_>>(),
        "default_guarantee": Guarantee::default(),
        "guarantees": guarantees.collect::<Vec<_>>(),
    });
    Ok(Reply {
        exit: YES,
        document: document(&about, &[])?,
        ..Reply::default()
    })
}

fn number(name: &str, text: &str) -> Result<Rational, Failure> {
    let wrong = || {
        Failure::new(format!(
            "`{text}` is no number for {name}; write 0.5 or 1/2"
        ))
    };
    let number: Rational = text.parse().map_err(|_| wrong())?;
    if number.is_negative() {
        return Err(Failure::new(format!("{name} is negative: {text}")));
    }
    Ok(number)
}

fn positive(name: &str, text: &str) -> Result<Rational, Failure> {
    let number = number(name, text)?;
    if number.is_zero() {
        return Err(Failure::new(format!(
            "{name} is zero; it has to be positive"
        )));
    }
    Ok(number)
}

fn limit(seconds: Option<&str>) -> Result<Option<Duration>, Failure> {
    let Some(text) = seconds else {
        return Ok(None);
    };
    let seconds = positive("time-limit", text)?.to_f64();
    let limit = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
    Ok(Some(limit))
}
