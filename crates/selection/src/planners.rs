//! Planners behind the port of [`elbowroom_execution`].

mod shortfall;

use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom_execution::{PlanAnswer, Planner, PlannerAnswer};
use elbowroom_model::{Situation, Task};
use elbowroom_num::Rational;
use elbowroom_planner::embedded::{self, Counts, Proof, Stopped};
use elbowroom_planner::no_plan::{Effort, no_plan_certificate_within, with_any_ends};

/// A planner without a clock: a function from situations to answers.
pub struct FnPlanner<F>(pub F);

impl<F: FnMut(&Task, &Situation) -> PlanAnswer + Send> Planner for FnPlanner<F> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        PlannerAnswer::from((self.0)(task, situation))
    }
}

/// The embedded planner, limited by numbers of states, so that results do not depend on the speed
/// of the machine. It returns the best plan found within the limits.
pub struct Embedded<'a> {
    /// Settings of the search.
    pub settings: embedded::Settings,
    /// Maximum number of states for a plan.
    pub most_states: u64,
    /// Maximum number of these states for a better plan than the first.
    pub improve_states: u64,
    /// Work limit for one plan, in units of [`elbowroom_num::work`]; [`u64::MAX`] for no limit.
    pub work: u64,
    /// The search for the first plan may take this multiple of `work`.
    pub first_plan_factor: u64,
    /// Work limit for a certificate that no plan exists ([`Effort`]). Without a certificate, the
    /// answer is that no plan was found. If 0, no certificate is made.
    pub certificate_work: u64,
    /// The clock for the planning time, in seconds since some fixed time.
    pub clock: Option<&'a (dyn Fn() -> Rational + Sync)>,
    /// Called regularly; returns `false` to stop the search.
    pub may_continue: Option<&'a (dyn Fn() -> bool + Sync)>,
}

impl Planner for Embedded<'_> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let begun = self.clock.map(|clock| clock());
        let (answer, _) = self.plan_with_state_count(task, situation);
        let (answer, shortfall) = self.with_shortfall(task, situation, answer);
        let seconds = self.clock.map(|clock| clock() - begun.unwrap_or_default());
        PlannerAnswer {
            seconds,
            shortfall,
            ..PlannerAnswer::from(answer)
        }
    }
}

impl Default for Embedded<'_> {
    /// Returns a planner with 20,000 states, 2,000 of them for a better plan than the first, and
    /// about a second for a certificate, without a clock.
    fn default() -> Self {
        Self {
            settings: embedded::Settings::default(),
            most_states: 20_000,
            improve_states: 2_000,
            work: u64::MAX,
            first_plan_factor: FIRST_PLAN_FACTOR,
            certificate_work: CERTIFICATE_WORK,
            clock: None,
            may_continue: None,
        }
    }
}

impl Embedded<'_> {
    /// Returns the answer, and the number of evaluated states.
    pub fn plan_with_state_count(&self, task: &Task, situation: &Situation) -> (PlanAnswer, u64) {
        let mut states = 0;
        let answer = self.answer(task, situation, &mut states);
        (answer, states)
    }

    fn answer(&self, task: &Task, situation: &Situation, states: &mut u64) -> PlanAnswer {
        let most_work = self.work.saturating_mul(self.first_plan_factor);
        let answer = embedded::plan(task, situation, &self.settings, &mut |progress| {
            let (limit, work) = match progress.best {
                Some(_) => (self.improve_states.min(self.most_states), self.work),
                None => (self.most_states, most_work),
            };
            *states = progress.counts.evaluated;
            let is_wanted = self.may_continue.is_none_or(|may_continue| may_continue());
            let is_over = progress.counts.evaluated >= limit || progress.counts.work >= work;
            if is_over || !is_wanted {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        match answer {
            embedded::Answer::Plan { found, .. } => PlanAnswer::Plan(found.plan),
            answer => {
                let may_continue = || self.may_continue.is_none_or(|may_continue| may_continue());
                let limits = (self.most_states, self.certificate_work);
                without_plan(&answer, (task, situation), limits, &may_continue)
            }
        }
    }
}

/// Converts an answer of the embedded planner without a plan to an answer of a run's planner.
/// `limits`: on the states of the search, and on the work for a certificate.
pub(crate) fn without_plan(
    answer: &embedded::Answer,
    (task, situation): (&Task, &Situation),
    (most_states, certificate_work): (u64, u64),
    may_continue: &dyn Fn() -> bool,
) -> PlanAnswer {
    let why = match answer {
        embedded::Answer::Unsolvable { proof, .. } => {
            let may_continue = &mut || may_continue();
            return refuted_answer((task, situation), proof, certificate_work, may_continue);
        }
        // This answer does not depend on the existence of plans.
        embedded::Answer::Unsupported(unsupported) => {
            let why = unsupported.to_string();
            return PlanAnswer::Failed { why };
        }
        _ if !may_continue() => "planning was interrupted".to_owned(),
        embedded::Answer::NoneFound {
            stopped,
            without_self_overlap,
            counts,
        } => no_plan_reason(*stopped, (*counts, *without_self_overlap), most_states),
        embedded::Answer::Plan { .. } => "no plan was found".to_owned(),
    };
    PlanAnswer::NotFound { why }
}

/// The default planning budget: the limit on the work for one plan, in seconds of one processor.
pub const PLANNING_BUDGET: i64 = 2;

/// Converts a planning budget in seconds of one processor to units of [`elbowroom_num::work`]:
/// about one per nanosecond.
pub fn planning_work(seconds: &Rational) -> u64 {
    let time = Duration::try_from_secs_f64(seconds.to_f64());
    time.map_or(u64::MAX, |time| {
        u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
    })
}

/// See [`Embedded::first_plan_factor`].
pub(crate) const FIRST_PLAN_FACTOR: u64 = 4;

/// Returns the reason why the embedded planner has no plan after a search of at most `most_states` states.
///
/// The second member of `counts` is `true` if plans with self-overlap were excluded.
fn no_plan_reason(stopped: Stopped, counts: (Counts, bool), most_states: u64) -> String {
    match stopped {
        Stopped::Exhausted => exhausted(counts.0, counts.1),
        Stopped::OutOfMemory => format!(
            "no plan was found within the planner's memory limit, after {} states",
            counts.0.evaluated
        ),
        _ if counts.0.evaluated < most_states => format!(
            "no plan was found within the planning budget (`--planning-budget`), after {} states",
            counts.0.evaluated
        ),
        _ => format!("no plan was found after {most_states} states (`--planner-states`)"),
    }
}

/// Returns the reason why there is no plan after a search of all reachable states.
pub fn exhausted(counts: Counts, without_self_overlap: bool) -> String {
    let evaluated = counts.evaluated;
    let without = if without_self_overlap {
        " without self-overlap (`--self-overlap`)"
    } else {
        ""
    };
    format!(
        "no plan found{without}: search space exhausted after {evaluated} states; this does not \
         prove that none exists"
    )
}

/// Beginning of the answer after a search of all plans without self-overlap, if no certificate
/// covers the others.
pub const WITHOUT_SELF_OVERLAP: &str = "no plan without self-overlap (`--self-overlap`)";

/// Work limit for a certificate in a run: about a second.
pub const CERTIFICATE_WORK: u64 = 10_000_000;

/// Returns the work limit for a certificate with this planning budget, in seconds: about as long, and at most
/// [`CERTIFICATE_WORK`].
pub fn certificate_work(budget: &Rational) -> u64 {
    // A unit of certificates takes about a hundred nanoseconds.
    (planning_work(budget) / 100).min(CERTIFICATE_WORK)
}

/// Returns the answer to the embedded planner's claim that no plan exists from a situation. No plan exists if
/// a certificate proves it for all ends of the running actions; otherwise, none was found.
fn refuted_answer(
    (task, situation): (&Task, &Situation),
    proof: &Proof,
    work: u64,
    may_continue: &mut dyn FnMut() -> bool,
) -> PlanAnswer {
    let from = with_any_ends(situation);
    match no_plan_certificate_within(task, &from, &mut Effort::of(work, may_continue)) {
        Ok(_) => PlanAnswer::Unsolvable,
        Err(why) => {
            let none = match proof {
                Proof::WithoutSelfOverlap { .. } => WITHOUT_SELF_OVERLAP,
                _ => "no plan was found",
            };
            PlanAnswer::NotFound {
                why: format!(
                    "{none}: search space exhausted. There is no certificate that none exists: \
                     {why}"
                ),
            }
        }
    }
}
