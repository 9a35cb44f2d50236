//! The embedded temporal planner.
//!
//! Forward search over the starts and ends of actions, in the line of CRIKEY3, POPF and COLIN
//! (Coles, Fox, Long & Smith, AAAI 2008; Coles, Coles, Fox & Long, ICAPS 2010 and IJCAI 2009), with
//! the queues of LAMA (Richter & Westphal, JAIR 2010).
//!
//! Structure of the module:
//!
//! 1. [`plan`] grounds the task from the situation, and compiles it (`compile`): small integers for
//!    facts and fluents, ticks for time, and for each happening the list of happenings that must be
//!    separated from it.
//! 2. `search` chooses happenings one after the other. Only interfering happenings keep that order
//!    in time, so a sequence of choices represents a plan with many concurrent actions. The times
//!    that are not yet fixed form a small network (`network`).
//! 3. `relaxed` estimates the distance to the goal.
//! 4. `extract` turns the choices into a plan with times, and passes it to the validator.
//! 5. `trajectory` compiles trajectory constraints into conditions and goals beforehand.
//! 6. `run` divides the time among searches: first for any plan, then for better ones.
//! 7. `refine` improves the best plan.

mod action_elimination;
mod answer;
mod apply;
mod bound;
mod compile;
mod deadline_explanation;
mod end_windows;
mod expressions;
mod extract;
mod final_numbers;
mod formula;
mod h2;
mod hash;
mod landmarks;
mod local_search;
mod mutex;
mod mutex_pairs;
mod network;
mod postponed_deadlines;
mod relaxed;
mod relevance;
mod root;
mod run;
mod search;
mod self_overlap;
mod state;
mod step_costs;
mod symbolic;
mod symmetry;
#[cfg(test)]
mod testing;
mod time;
mod trajectory;
mod tuning;
mod windows;

use std::ops::ControlFlow;
use std::sync::OnceLock;

use elbowroom_model::ground::Change;
use elbowroom_model::reachability::{self, Grounding};
use elbowroom_model::{Situation, Task};
use elbowroom_num::{Rational, work};

pub use answer::{Answer, Counts, FoundPlan, Objective, Phase, Progress, Proof, Settings, Stopped};
pub use compile::Unsupported;
pub use tuning::{Member, Technique, Tuning, TuningError};

use compile::{CompileInput, Failure};
use deadline_explanation::Names;
use postponed_deadlines::Detours;
use run::{Frame, Planner, none_found};
use symmetry::Symmetry;

/// Estimated work of grounding and compiling one action.
const ACTION_WORK: u64 = 20_000;

/// Finds a plan from `situation`.
///
/// `observe` is called regularly, and for each better plan. If it returns `Break`, or if the
/// thread's computations should end early ([`work::is_stopped`]), the search ends and returns the
/// best plan so far. Every plan has been found valid by [`elbowroom_model::validate_from`],
/// exactly, with the given ε. The same input gives the same answer, and the same sequence of
/// reports.
pub fn plan(
    task: &Task,
    situation: &Situation,
    settings: &Settings,
    observe: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Answer {
    if let Some(feature) = task.unsupported_by_analysis() {
        return Answer::Unsupported(Unsupported {
            feature: feature.to_owned(),
            place: format!("domain {}", task.problem().domain),
        });
    }
    let observe = &mut |progress: &Progress| {
        let flow = observe(progress);
        if work::is_stopped() {
            ControlFlow::Break(())
        } else {
            flow
        }
    };
    // Threads of this search count for this one.
    work::with_fixed_cost(
        || {
            if trajectory::is_responsible_for(task, situation, settings) {
                trajectory::plan(task, situation, settings, observe)
            } else {
                search_with_detours(task, situation, settings, observe)
            }
        },
        |answer| answer.counts().map_or(0, |counts| counts.work),
    )
}

/// As [`plan`], for a task without trajectory constraints, with [detours](postponed_deadlines) if
/// there are deadlines.
fn search_with_detours(
    task: &Task,
    situation: &Situation,
    settings: &Settings,
    observe: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Answer {
    let Some(mut detours) = Detours::new(task, situation, settings) else {
        return search_for_plans(task, None, situation, settings, observe);
    };
    let mut report = |progress: &Progress| detours.observe(progress, observe);
    let answer = search_for_plans(task, None, situation, settings, &mut report);
    detours.answer(answer, observe)
}

/// As [`plan`], for a task without trajectory constraints. `constrained` is the
/// same task with constraints, and its situation; plans that violate them are not accepted.
///
/// If timed initials change fluents that the metric may read, a first plan is found without the
/// metric: fluents that only conditions read are [calendars](compile::calendars).
fn search_for_plans(
    task: &Task,
    constrained: Option<(&Task, &Situation)>,
    situation: &Situation,
    settings: &Settings,
    observe: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Answer {
    let mut changes = task.timed().iter().flat_map(|timed| &timed.changes);
    let has_timed_fluents = changes.any(|change| matches!(change, Change::Update { .. }));
    let is_metric = !settings.first_plan_only
        && settings.objective == Objective::Metric
        && task.problem().metric.is_some();
    if !has_timed_fluents || !is_metric {
        return search_once(task, constrained, situation, settings, observe);
    }
    let first_only = Settings {
        first_plan_only: true,
        ..settings.clone()
    };
    let first = search_once(task, constrained, situation, &first_only, observe);
    let (found, counts) = match first {
        Answer::Plan {
            found,
            stopped: Stopped::FirstPlan,
            counts,
        } => (found, counts),
        answer => return answer,
    };
    improve_on(
        (task, constrained),
        situation,
        settings,
        (found, counts),
        observe,
    )
}

/// Continues with a search that does not know the plan that was found, and reports better plans
/// only. `counts` are those of the search that found it.
fn improve_on(
    (task, constrained): (&Task, Option<(&Task, &Situation)>),
    situation: &Situation,
    settings: &Settings,
    (found, counts): (FoundPlan, Counts),
    observe: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Answer {
    let is_better = |value: &Rational| *value < found.value;
    let mut report = |progress: &Progress| {
        let mut progress = progress.clone();
        progress.counts = progress.counts.after(&counts);
        if !progress.best.as_ref().is_some_and(is_better) {
            progress.plan = None;
            progress.best = Some(found.value.clone());
        }
        observe(&progress)
    };
    let answer = search_once(task, constrained, situation, settings, &mut report);
    let more = answer.counts().copied().unwrap_or_default();
    let stopped = match &answer {
        Answer::Plan { stopped, .. } | Answer::NoneFound { stopped, .. } => *stopped,
        Answer::Unsolvable { .. } | Answer::Unsupported(_) => Stopped::Exhausted,
    };
    let other = answer.found().filter(|other| is_better(&other.value));
    Answer::Plan {
        found: other.unwrap_or(&found).clone(),
        stopped,
        counts: more.after(&counts),
    }
}

/// As [`search_for_plans`], with one compiled form of the task.
fn search_once(
    task: &Task,
    constrained: Option<(&Task, &Situation)>,
    situation: &Situation,
    settings: &Settings,
    observe: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Answer {
    let mut progress = Progress::default();
    let begin = work::spent();
    if observe(&progress).is_break() {
        return none_found(Stopped::Interrupted, progress.counts);
    }
    let continued;
    let grounded = if *situation == Situation::initial(task) {
        task
    } else {
        continued = task.starting_from(situation);
        &continued
    };
    let limits = reachability::Settings::default();
    let mut is_stopped = false;
    let mut may_continue = || {
        is_stopped = observe(&progress).is_break();
        !is_stopped
    };
    let mut grounding = match reachability::ground_while(grounded, &limits, &mut may_continue) {
        reachability::Answer::Complete(grounding) => grounding,
        reachability::Answer::LimitReached if is_stopped => {
            return none_found(Stopped::Interrupted, progress.counts);
        }
        reachability::Answer::LimitReached => {
            return none_found(Stopped::OutOfMemory, progress.counts);
        }
    };
    progress.counts.actions = grounding.actions.len() as u64;
    work::spend(ACTION_WORK.saturating_mul(progress.counts.actions));
    if let Some(proof) = unreachable(grounded, &grounding, situation) {
        return Answer::Unsolvable {
            proof,
            counts: progress.counts,
        };
    }
    grounding
        .actions
        .retain(|action| !settings.without.contains(&action.name));
    let tuning = &settings.tuning;
    if tuning.uses(Technique::Relevance) {
        relevance::keep_relevant(grounded, &mut grounding, situation);
    }
    progress.counts.actions = grounding.actions.len() as u64;
    let mut may_continue = || observe(&progress).is_continue();
    let wanted = CompileInput {
        situation,
        tuning,
        metric: !settings.first_plan_only && settings.objective == Objective::Metric,
    };
    let mut compiled = match compile::compile(grounded, &grounding, wanted, &mut may_continue) {
        Ok(compiled) => compiled,
        Err(Failure::Unsupported(unsupported)) => return Answer::Unsupported(unsupported),
        Err(Failure::Stopped) => return none_found(Stopped::Interrupted, progress.counts),
    };
    if !settings.self_overlap {
        self_overlap::keep_apart(&mut compiled);
    }
    let names = Names::of(grounded, &compiled);
    if compiled.is_relaxation_exact()
        && let Some(proof) = deadline_explanation::relaxed_proof(&names, &compiled)
    {
        return Answer::Unsolvable {
            proof,
            counts: progress.counts,
        };
    }
    if observe(&progress).is_break() {
        return none_found(Stopped::Interrupted, progress.counts);
    }
    // If actions are forbidden to some objects only, symmetries of the problem are not symmetries
    // of the restricted problem.
    let symmetry = if tuning.uses(Technique::Symmetry) && settings.without.is_empty() {
        Symmetry::of(grounded, &compiled)
    } else {
        Symmetry::default()
    };
    if observe(&progress).is_break() {
        return none_found(Stopped::Interrupted, progress.counts);
    }
    let mutex_pairs = OnceLock::new();
    let frame = Frame::new(
        (task, constrained),
        situation,
        settings,
        (&compiled, &mutex_pairs),
    );
    progress.counts.work = work::spent() - begin;
    Planner::new(frame, (&names, &symmetry), progress, observe).run()
}

fn unreachable(task: &Task, grounding: &Grounding, situation: &Situation) -> Option<Proof> {
    let unreachable = grounding.unreachable_goals.iter();
    let unreachable = unreachable.map(|goal| (goal, "cannot become true"));
    let is_false = final_numbers::false_comparisons(task, grounding, situation).into_iter();
    let is_false = is_false.map(|goal| (goal, "is false after all timed initials in every plan"));
    let reasons: Vec<_> = unreachable
        .chain(is_false)
        .map(|(goal, why)| format!("`{}` {why}", task.describe_condition(goal)))
        .collect();
    let is_proof = !reasons.is_empty() || grounding.goal.is_contradiction();
    is_proof.then_some(Proof::Unreachable(reasons))
}
