//! One run of the planner: which search gets how many turns, and what becomes of the plans.

mod improve;
mod refining;

use std::ops::ControlFlow;

use elbowroom_model::validate::Report;
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};

use super::answer::{Answer, Counts, Found, Objective, Phase, Progress, Proof, Settings, Stopped};
use super::apply::Step;
use super::bound::MetricBound;
use super::compile::{self, Compiled, Compressibility};
use super::extract;
use super::formula::Literal;
use super::needless::without_needless;
use super::reasons::{self, Names};
use super::refine::Refiner;
use super::relaxed;
use super::search::{Aim, Search, Strategy, Turn};
use super::symmetry::Symmetry;
use super::tuning::{Member, Technique};

/// How much work lies between two reports, in operators of estimates and what they change: about ten
/// milliseconds.
const REPORT_WORK: u64 = 2_000_000;

/// The number of looked-up pairs that lie between two reports at most: some milliseconds.
const REPORT_LOOKUPS: u64 = 4_000_000;

/// What turns count for between two reports, at most, where each state is a linear program.
const REPORT_SYMBOLIC_TURNS: u64 = 8;

/// What turns count for between two reports, at most: one each, more where much is unsettled.
const REPORT_TURNS: u64 = 256;

pub(super) fn none_found(stopped: Stopped, counts: Counts) -> Answer {
    Answer::NoneFound { stopped, counts }
}

/// One run.
pub(super) struct Planner<'a> {
    pub(super) task: &'a Task,
    pub(super) situation: &'a Situation,
    pub(super) settings: &'a Settings,
    pub(super) observe: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
    pub(super) compiled: &'a Compiled,
    pub(super) symmetry: &'a Symmetry,
    pub(super) names: &'a Names,
    pub(super) progress: Progress,
    pub(super) best: Option<Found>,
    /// Whether something is used up and filled up.
    pub(super) has_reservoirs: bool,
    /// The choices of the best plan.
    pub(super) best_steps: Vec<Step>,
    /// Whether no better plan has been looked for near it.
    pub(super) is_fresh: bool,
    /// The work near the best plan since the last report.
    pub(super) unreported: u64,
    /// What makes better plans of the best one.
    pub(super) refiner: Option<Refiner<'a>>,
}

impl Planner<'_> {
    pub(super) fn run(mut self) -> Answer {
        let compiled = self.compiled;
        let strategies = self.strategies();
        let mut is_over = vec![false; strategies.len()];
        // The others are made when their first turn comes: that takes its time where actions are many.
        let mut searches = vec![Search::new(compiled, self.symmetry, strategies[0])];
        let mut stopped = match self.work(&mut searches[0], compiled.tuning.root_check_after) {
            Outcome::Stop(stopped) => Some(stopped),
            Outcome::Better | Outcome::BudgetSpent => None,
            Outcome::Over => {
                is_over[0] = searches[0].is_incomplete();
                (!is_over[0]).then_some(Stopped::Exhausted)
            }
        };
        if self.best.is_none()
            && compiled.tuning.uses(Technique::DeadEnds)
            && stopped.is_none_or(|stopped| stopped == Stopped::Exhausted)
            && compiled.is_relaxation_exact()
            && let Some(proof) = self.pairs_proof()
        {
            let counts = self.progress.counts;
            return Answer::Unsolvable { proof, counts };
        }
        let tuning = &compiled.tuning;
        let mut budget = if self.is_refining() {
            tuning.improving_round
        } else if self.needs_concurrency() {
            tuning.first_round_with_concurrency
        } else if self.has_reservoirs {
            tuning.first_round_with_reservoirs
        } else {
            tuning.first_round
        };
        // Where there are reservoirs, the first search fills them up, and has by far the best chance.
        if !self.has_reservoirs {
            let most = tuning.first_round_work / (1 + searches[0].size());
            budget = budget.min(most.max(tuning.root_check_after));
        }
        while stopped.is_none() && !self.is_first_plan_enough() {
            let was_refining = self.is_refining();
            for (number, is_over) in is_over.iter_mut().enumerate() {
                if *is_over {
                    continue;
                }
                if number == searches.len() {
                    let strategy = strategies[number];
                    searches.push(Search::new(compiled, self.symmetry, strategy));
                }
                let search = &mut searches[number];
                if self.is_refining() && !was_refining {
                    budget = budget.min(tuning.improving_round);
                }
                let share = share(search, budget, compiled);
                match self.work(search, share) {
                    Outcome::Stop(reason) => stopped = Some(reason),
                    Outcome::Better | Outcome::BudgetSpent => {}
                    Outcome::Over if search.is_incomplete() => *is_over = true,
                    Outcome::Over => stopped = Some(Stopped::Exhausted),
                }
                if stopped.is_some() || self.is_first_plan_enough() {
                    break;
                }
                stopped = self.refine(share);
                if stopped.is_some() {
                    break;
                }
            }
            if !is_over.contains(&false) {
                stopped = stopped.or(Some(Stopped::Exhausted));
            }
            budget = budget.saturating_mul(2);
        }
        let is_proof = stopped == Some(Stopped::Exhausted)
            && compiled.is_exact
            && compiled.incomplete_because.is_none()
            && searches.iter().any(|search| !search.is_incomplete());
        let freed: usize = searches.iter().map(|search| search.counts().memory).sum();
        drop(searches);
        let stopped = stopped.unwrap_or_else(|| {
            self.progress.counts.memory -= freed;
            self.improve()
        });
        let counts = self.progress.counts;
        match self.best {
            Some(found) => Answer::Plan {
                found,
                stopped,
                counts,
            },
            None if is_proof => Answer::Unsolvable {
                proof: Proof::Exhausted {
                    states: counts.evaluated,
                },
                counts,
            },
            None => none_found(stopped, counts),
        }
    }

    /// Whether these searches have done their part: better plans are looked for by others.
    fn is_first_plan_enough(&self) -> bool {
        self.best.is_some() && self.compiled.metric.is_some()
    }

    /// The searches that take turns, the complete one last. Where something is used up and filled
    /// up, estimates that count it find most plans sooner, but not all. Where actions offer
    /// something while they run, some searches choose happenings in the order of time.
    fn strategies(&self) -> Vec<Strategy> {
        let tuning = &self.compiled.tuning;
        if let Some(member) = tuning.only {
            return vec![Strategy::of(member, tuning)];
        }
        let mut compressing = vec![Member::Compressing];
        let holds =
            |action: &compile::Action| action.compressibility == Compressibility::HoldsResource;
        if self.compiled.actions.iter().any(holds) {
            compressing.push(Member::CompressingSafe);
        }
        let mut strategies = Vec::new();
        for member in compressing {
            let strategy = Strategy::of(member, tuning);
            if self.has_reservoirs {
                strategies.push(strategy.replenishing());
            }
            strategies.push(strategy);
        }
        let mut add = |member| strategies.push(Strategy::of(member, tuning));
        if self.needs_concurrency() {
            add(Member::Chronological);
            if tuning.uses(Technique::Consumables)
                && !relaxed::consumables(self.compiled).is_empty()
            {
                add(Member::Saving);
            }
        }
        if !self.compiled.is_symbolic {
            if tuning.uses(Technique::Width) {
                add(Member::Width);
            }
            if tuning.uses(Technique::Novelty) {
                add(Member::Novelty);
            }
        }
        add(Member::Complete);
        strategies
    }

    /// Whether things may have to happen at the same time: some action offers to others what they
    /// need only while it runs, or waits for others before it can end.
    fn needs_concurrency(&self) -> bool {
        let compiled = self.compiled;
        let needs = |action: &compile::Action| {
            if action.start == compile::NONE || action.end == compile::NONE {
                return false;
            }
            let (start, end) = (compiled.snap(action.start), compiled.snap(action.end));
            let is_kept = |literal: &Literal| {
                let own = if literal.truth() {
                    &start.adds
                } else {
                    &start.deletes
                };
                action.over_all.literals.contains(literal)
                    || start.condition.literals.contains(literal)
                    || own.contains(&literal.fact())
            };
            let waits = end
                .condition
                .literals
                .iter()
                .any(|literal| !is_kept(literal));
            waits || action.compressibility == Compressibility::Envelope && action.flows.is_empty()
        };
        compiled.tuning.uses(Technique::Chronological)
            && !compiled.is_symbolic
            && compiled.actions.iter().any(needs)
    }

    /// A proof from the bound on pairs. Told to stop meanwhile, it names no deadlines.
    fn pairs_proof(&mut self) -> Option<Proof> {
        let Self {
            observe,
            progress,
            names,
            compiled,
            ..
        } = self;
        let mut goes_on = || observe(progress).is_continue();
        reasons::pairs_proof(names, compiled, &mut goes_on)
    }

    /// Lets a search evaluate `budget` states.
    fn work(&mut self, search: &mut Search<'_>, budget: u64) -> Outcome {
        self.progress.phase = if self.best.is_some() {
            Phase::Improving
        } else if search.prunes_unsafely() {
            Phase::Incomplete
        } else {
            Phase::Complete
        };
        self.demand_better(search);
        let before = (self.progress.counts, search.counts());
        let most_turns = if self.compiled.is_symbolic {
            REPORT_SYMBOLIC_TURNS
        } else {
            REPORT_TURNS
        };
        let report_every = (REPORT_WORK / (1 + search.weight())).clamp(1, most_turns);
        let mut reported = (search.labour(), search.lookups());
        let mut spent = 0;
        while spent < budget || self.keeps_its_turn(search, budget, spent) {
            let result = search.turn();
            spent += search.price();
            // To schedule and to judge a candidate takes longer than many turns, and one that is no
            // better than the best plan may be followed by any number of others.
            let mut is_report_due = false;
            match result {
                Turn::Over => {
                    self.count(&before, search);
                    return Outcome::Over;
                }
                Turn::Nothing => {}
                Turn::Goal(steps) => {
                    self.count(&before, search);
                    if let Some(outcome) = self.consider(&steps, search) {
                        return outcome;
                    }
                    spent += steps.len() as u64;
                    is_report_due = true;
                }
            }
            let lookups = search.lookups() - reported.1;
            is_report_due |=
                search.labour() - reported.0 >= report_every || lookups >= REPORT_LOOKUPS;
            if is_report_due {
                reported = (search.labour(), search.lookups());
                self.count(&before, search);
                if (self.observe)(&self.progress).is_break() {
                    return Outcome::Stop(Stopped::Interrupted);
                }
                if self.progress.counts.memory > self.settings.max_memory {
                    return Outcome::Stop(Stopped::OutOfMemory);
                }
            }
        }
        self.count(&before, search);
        Outcome::BudgetSpent
    }

    /// Whether a search goes on though its turns are used up: it still comes nearer to a first plan.
    /// One that does not compress works no more than a first round may come to.
    fn keeps_its_turn(&self, search: &Search<'_>, budget: u64, spent: u64) -> bool {
        let tuning = &self.compiled.tuning;
        self.best.is_none()
            && budget > tuning.root_check_after
            && (search.compresses() || spent < tuning.first_round_work / (1 + search.size()))
            && search.has_come_nearer()
    }

    fn count(&mut self, before: &(Counts, Counts), search: &Search<'_>) {
        let (counts, start, now) = (&mut self.progress.counts, before.1, search.counts());
        counts.expanded = before.0.expanded + now.expanded - start.expanded;
        counts.generated = before.0.generated + now.generated - start.generated;
        counts.evaluated = before.0.evaluated + now.evaluated - start.evaluated;
        counts.memory = before.0.memory + now.memory - start.memory;
    }

    /// Looks at the choices that a search takes for a plan.
    fn consider(&mut self, steps: &[Step], search: &mut Search<'_>) -> Option<Outcome> {
        match self.judge(steps) {
            Judged::Refused => search.has_lost = true,
            Judged::NoBetter => {}
            Judged::Stop(stopped) => return Some(Outcome::Stop(stopped)),
            Judged::Better if self.compiled.metric.is_some() || self.is_refining() => {
                return Some(Outcome::Better);
            }
            Judged::Better => self.demand_better(search),
        }
        None
    }

    /// Asks the judge about the plan of these choices, and reports it if it is better than the best.
    fn judge(&mut self, steps: &[Step]) -> Judged {
        let (task, situation) = (self.task, self.situation);
        let mut is_interrupted = false;
        let mut goes_on = || {
            is_interrupted = (self.observe)(&self.progress).is_break();
            !is_interrupted
        };
        let judged = extract::plan_of(task, situation, self.compiled, steps, &mut goes_on);
        if is_interrupted {
            return Judged::Stop(Stopped::Interrupted);
        }
        let Some((plan, report)) = judged else {
            return Judged::Refused;
        };
        let worth = |found: &Found| (found.value.clone(), found.makespan.clone());
        let whole = self.value(plan.clone(), &report);
        let mut goes_on = || {
            is_interrupted = (self.observe)(&self.progress).is_break();
            !is_interrupted
        };
        let (plan, report) = without_needless(task, situation, plan, report, &mut goes_on);
        // A metric can prefer what nothing needs, such as one that rewards time.
        let fewer = self.value(plan, &report);
        let found = if worth(&fewer) <= worth(&whole) {
            fewer
        } else {
            whole
        };
        if self
            .best
            .as_ref()
            .is_some_and(|best| worth(best) <= worth(&found))
        {
            return if is_interrupted {
                Judged::Stop(Stopped::Interrupted)
            } else {
                Judged::NoBetter
            };
        }
        self.progress.best = Some(found.value.clone());
        self.progress.plan = Some(found.clone());
        self.best = Some(found);
        self.best_steps = steps.to_vec();
        self.is_fresh = true;
        let flow = (self.observe)(&self.progress);
        self.progress.plan = None;
        if flow.is_break() || is_interrupted {
            return Judged::Stop(Stopped::Interrupted);
        }
        if self.settings.first_plan_only {
            return Judged::Stop(Stopped::FirstPlan);
        }
        Judged::Better
    }

    /// From now on only plans count that are better than the best one.
    fn demand_better(&self, search: &mut Search<'_>) {
        let Some(best) = &self.best else { return };
        let (end, _) = self.compiled.scale.floor(&best.makespan);
        if self.compiled.metric.is_none() {
            search.set_horizon(end - 1);
            return;
        }
        let may_equal = search.aim() == Aim::Shortest;
        if may_equal {
            search.set_horizon(end - 1);
        }
        search.set_limit(MetricBound {
            value: best.value.clone(),
            may_equal,
        });
    }

    fn value(&self, plan: TimeTriggeredPlan, report: &Report) -> Found {
        let makespan = report.makespan.clone();
        let metric = report.metric(self.task);
        let is_maximized = self
            .task
            .problem()
            .metric
            .as_ref()
            .is_some_and(|m| m.maximize);
        let value = match (&metric, self.settings.objective) {
            (Some(metric), Objective::Metric) if is_maximized => -metric,
            (Some(metric), Objective::Metric) => metric.clone(),
            _ => makespan.clone(),
        };
        Found {
            plan,
            makespan,
            metric,
            value,
        }
    }
}

/// How many turns a search gets of a round.
fn share(search: &Search<'_>, budget: u64, compiled: &Compiled) -> u64 {
    if search.prunes_unsafely() {
        budget
    } else {
        budget / compiled.tuning.incomplete_share.max(1)
    }
}

/// The reason why a share of a search ended.
enum Outcome {
    Stop(Stopped),
    /// With a better plan, where the metric decides.
    Better,
    Over,
    BudgetSpent,
}

/// What became of choices that were taken for a plan.
enum Judged {
    Refused,
    NoBetter,
    Better,
    Stop(Stopped),
}
