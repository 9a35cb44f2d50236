//! The world of the timed optimum: facts are bits, actions and events are numbered.

use elbowroom_model::Task;
use elbowroom_model::ground::FactId;
use elbowroom_sim::{Side, WorldModel};

use super::action_model::{ActionModel, Ending, Event, Facts, Needs, Occurs};
use super::applicable::actions;
use super::compile::Compiler;
use super::value_intervals::{Number, Span, Test};
use crate::settings::{NotTabulated, Settings, Side as Bounding};

/// A task in a world, as a semi-Markov decision process: see the [crate](crate).
#[derive(Clone, Debug)]
pub struct TimedWorld {
    pub(crate) model: WorldModel,
    /// The relevant facts; the position of each is its bit.
    pub facts: Vec<FactId>,
    pub(crate) numbers: Vec<Number>,
    /// Comparisons of numbers; their bits come after those of the facts.
    pub(crate) tests: Vec<Test>,
    /// The bits of all comparisons.
    pub(crate) tested: Facts,
    /// The side of the bound, which decides on comparisons that hold for some values only.
    side: Bounding,
    /// The relevant actions.
    pub acts: Vec<ActionModel>,
    /// The relevant events of the world.
    pub events: Vec<Event>,
    /// The facts that are true at the beginning.
    pub initial: Facts,
    /// The condition of success.
    pub goal: Needs,
    /// `true` if more facts are never worse: no condition requires a fact to be false.
    pub(crate) is_monotone: bool,
    /// The facts that an action or event may make false.
    deletable: Facts,
    /// The facts that an action or event may make true.
    addable: Facts,
    /// The latest end of a run, in seconds.
    pub horizon: f64,
}

/// Maximum number of actions and events, which are bits.
const MAX_ACTS: usize = 64;
const MAX_EVENTS: usize = 32;

/// Maximum number of facts and comparisons of numbers together.
const MAX_FACTS: usize = 128;

impl TimedWorld {
    /// Compiles the task and the world.
    ///
    /// # Errors
    /// When the task or the world has a feature that the process does not support.
    pub fn new(task: &Task, model: &WorldModel, settings: &Settings) -> Result<Self, NotTabulated> {
        if let Some(feature) = task.validator_only_feature() {
            return Err(NotTabulated::new(format!("the problem has {feature}")));
        }
        if !model.reports.is_perfect() {
            return Err(NotTabulated::new("the world's reports are not perfect"));
        }
        if model.exogenous.iter().any(|event| !event.is_reported) {
            return Err(NotTabulated::new(
                "the world has events that it does not report",
            ));
        }
        if model.hazards.iter().any(|hazard| !hazard.is_reported) {
            return Err(NotTabulated::new(
                "the world has facts that change at a rate without being reported",
            ));
        }
        let actions = actions(task, model, settings)?;
        let goal = task.goal().clone();
        let compiler = Compiler::new(task, model, &actions, &goal)?;
        let events = compiler.events(model)?;
        if events.len() > MAX_EVENTS {
            return Err(NotTabulated::new(format!(
                "{} events are relevant, more than the limit of {MAX_EVENTS}",
                events.len()
            )));
        }
        let mut acts = Vec::new();
        for action in &actions {
            acts.extend(compiler.act(action, model)?);
        }
        if acts.len() > MAX_ACTS {
            return Err(NotTabulated::new(format!(
                "{} actions are relevant, more than the limit of {MAX_ACTS}",
                acts.len()
            )));
        }
        let goal = compiler.needs(&goal)?;
        let initial = task.initial().facts.iter();
        let initial = initial.fold(0, |facts, fact| facts | compiler.bit(*fact));
        let tests = compiler.tests.into_inner();
        let known = compiler.facts.len() + tests.len();
        if known > MAX_FACTS {
            return Err(NotTabulated::new(format!(
                "{known} facts and comparisons are relevant, more than the limit of {MAX_FACTS}"
            )));
        }
        let mut world = Self {
            tested: (0..tests.len()).fold(0, |all, test| all | 1 << (compiler.facts.len() + test)),
            tests,
            numbers: compiler.numbers,
            side: Bounding::Below,
            facts: compiler.facts,
            horizon: latest(&events, model)?,
            is_monotone: !goal.has_negation() && !acts.iter().any(ActionModel::has_negation),
            deletable: 0,
            addable: 0,
            model: model.clone(),
            acts,
            events,
            initial,
            goal,
        };
        world.cut()?;
        world.compute_helpful_tests();
        world.compute_changes();
        world.horizon = world.latest_end(settings)?;
        Ok(world)
    }

    /// Returns `true` if the state contains numbers.
    pub fn has_numbers(&self) -> bool {
        !self.numbers.is_empty()
    }

    /// Computes the comparisons that each happening may make true.
    fn compute_helpful_tests(&mut self) {
        let first = self.facts.len();
        for act in &mut self.acts {
            let ends = act.rest.iter_mut().map(|(_, end)| end);
            for snap in ends.chain([&mut act.start]) {
                let tests = self.tests.iter().enumerate();
                let helped = tests
                    .filter(|(_, test)| snap.amounts.iter().any(|amount| amount.may_help(test)));
                snap.helped_tests = helped.fold(0, |all, (place, _)| all | 1 << (first + place));
            }
        }
    }

    /// Computes the data that depends on the set of actions and events.
    pub(crate) fn compute_changes(&mut self) {
        let acts = &self.acts;
        let events = &self.events;
        self.deletable = acts.iter().fold(0, |all, act| all | act.deletes())
            | events.iter().fold(0, |all, event| all | event.deletes);
        self.addable = acts.iter().fold(0, |all, act| all | act.adds())
            | events.iter().fold(0, |all, event| all | event.adds);
        if self.is_monotone {
            for act in &mut self.acts {
                act.may_be_cancelled =
                    act.can_gain_by_cancelling(&self.model) || act.is_about_numbers(self.tested);
                // It deletes nothing, and its added facts stay true. So an earlier start is never
                // worse.
                act.is_eager = act.has_guaranteed_end()
                    && !act.is_about_numbers(self.tested)
                    && !act.can_delay_its_failure()
                    && act.deletes() == 0
                    && act.adds() & self.deletable == 0;
            }
        }
    }

    /// Returns `true` if the goal is reachable from these facts in the delete relaxation, with the
    /// remaining events and the running actions.
    pub(crate) fn can_reach_goal(&self, facts: Facts, under_way: u64, happened: u32) -> bool {
        // All comparisons of numbers are assumed to hold.
        let mut facts = facts | self.tested;
        for (index, event) in self.events.iter().enumerate() {
            if happened & (1 << index) == 0 {
                facts |= event.adds;
            }
        }
        for (index, act) in self.acts.iter().enumerate() {
            if under_way & (1 << index) != 0 {
                facts |= act.adds_by_failing();
            }
        }
        loop {
            if self.goal.is_possible(facts) {
                return true;
            }
            let before = facts;
            for (index, act) in self.acts.iter().enumerate() {
                let can_start = act.start.needs.is_possible(facts);
                if can_start {
                    facts |= act.start.adds | act.adds_by_failing();
                }
                if let Some((over_all, end)) = &act.rest
                    && (can_start || under_way & (1 << index) != 0)
                    && over_all.is_possible(facts)
                    && end.needs.is_possible(facts)
                {
                    facts |= end.adds;
                }
            }
            if facts == before {
                return false;
            }
        }
    }
}

impl TimedWorld {
    /// Returns `true` if an action may be useful. In a monotone world, it is useless if all facts
    /// that it adds are true and stay true.
    pub(crate) fn is_useful(&self, act: usize, facts: Facts) -> bool {
        let adds = self.acts[act].adds();
        !self.is_monotone
            || adds & !facts != 0
            || adds & self.deletable != 0
            || self.acts[act].changes_numbers()
    }

    /// Returns this world with comparisons evaluated for a bound of the given side.
    pub(crate) fn for_bound(&self, side: Bounding) -> Self {
        Self {
            side,
            ..self.clone()
        }
    }

    /// Returns the same world without numeric over-all conditions, so that no action is aborted
    /// because of a number.
    pub(crate) fn without_numbers_over_all(&self) -> Result<Self, NotTabulated> {
        let mut kinder = self.clone();
        for act in &mut kinder.acts {
            if let Some((over_all, _)) = &mut act.rest {
                *over_all = over_all.without(self.tested, true);
            }
        }
        kinder.cut()?;
        kinder.compute_changes();
        Ok(kinder)
    }

    /// Returns the facts together with the comparisons that hold for the numbers.
    pub(crate) fn tested(&self, facts: Facts, numbers: &[Span]) -> Facts {
        self.with_tests(facts, numbers, self.side)
    }

    /// Returns the facts that a certain event deletes and that never become true again.
    pub(crate) fn permanently_deleted(&self, event: usize) -> Facts {
        let event = &self.events[event];
        match event.occurs {
            Occurs::Once { probability, .. } if probability >= 1.0 => event.deletes & !self.addable,
            _ => 0,
        }
    }

    /// Returns `true` if an event is best applied at once: the world is monotone, and the event
    /// only adds facts that stay true. If a fact can be deleted, a later addition may be better.
    pub(crate) fn is_optimal_at_once(&self, event: usize) -> bool {
        let event = &self.events[event];
        self.is_monotone && event.deletes == 0 && event.adds & self.deletable == 0
    }

    /// Returns `true` if an event is best applied last: the world is monotone, and the event only
    /// deletes facts that stay false. If a fact can be added again, an earlier deletion may be
    /// better.
    pub(crate) fn is_optimal_last(&self, event: usize) -> bool {
        let event = &self.events[event];
        self.is_monotone && event.adds == 0 && event.deletes & self.addable == 0
    }

    /// Returns `true` if the pending end of an action is best applied at once.
    pub(crate) fn end_is_optimal_at_once(&self, act: usize, ending: Ending, facts: Facts) -> bool {
        let act = &self.acts[act];
        let Some((_, end)) = &act.rest else {
            return false;
        };
        let (gives, does_no_harm) = match act.failed(ending) {
            None => (
                end.adds,
                act.has_harmless_end() && end.amounts.is_empty() && end.needs.holds(facts),
            ),
            Some(failed) => (failed.adds, failed.deletes == 0),
        };
        self.is_monotone && does_no_harm && gives & self.deletable == 0
    }

    /// Returns `true` if cancelling an action may be useful for an agent that can do so at any
    /// time: by [`ActionModel::may_be_cancelled`], or because a later end may be better for facts that can
    /// be deleted.
    pub(crate) fn can_gain_by_cancelling(&self, act: usize) -> bool {
        let act = &self.acts[act];
        let gives = act.rest.as_ref().map_or(0, |(_, end)| end.adds);
        act.may_be_cancelled || gives & self.deletable != 0
    }
}

/// Returns a time after all events that happen at most once.
fn latest(events: &[Event], model: &WorldModel) -> Result<f64, NotTabulated> {
    let mut latest: f64 = 0.0;
    for event in events {
        let Occurs::Once { time: rule, .. } = &event.occurs else {
            continue;
        };
        let beyond = |time: f64| {
            let share =
                rule.probability_of_side(time, Side::AtMost, 0.0, model.resolution.to_f64());
            share.map(|share| 1.0 - share)
        };
        let mut time: f64 = 1.0;
        while beyond(time).ok_or_else(unknown_shape)? > 1e-12 {
            time *= 2.0;
            if time > 1e9 {
                return Err(NotTabulated::new(
                    "an event may happen later than 10^9 seconds",
                ));
            }
        }
        let (mut early, mut late) = (0.0, time);
        for _ in 0..50 {
            let middle = f64::midpoint(early, late);
            if beyond(middle).ok_or_else(unknown_shape)? > 1e-12 {
                early = middle;
            } else {
                late = middle;
            }
        }
        // The time is rounded up to the resolution, so that boundaries of cells are round numbers.
        let resolution = model.resolution.to_f64();
        latest = latest.max((late / resolution - 1e-6).ceil() * resolution);
    }
    Ok(latest)
}

impl TimedWorld {
    /// Returns the latest end of a run: the given horizon, or the time of the last event.
    ///
    /// If facts change at a rate, there is no last event, unless the goal becomes unreachable after
    /// the last single event. Then the horizon is a time after which little is likely to happen.
    /// Both bounds hold for any horizon: a run that has not reached the goal by then counts as
    /// failed in the lower bound, and as successful in the upper bound if the goal is still
    /// reachable.
    fn latest_end(&self, settings: &Settings) -> Result<f64, NotTabulated> {
        if let Some(horizon) = &settings.horizon {
            return Ok(horizon.to_f64());
        }
        let rates = self.events.iter().filter_map(|event| match event.occurs {
            Occurs::Rate(rate) => Some(rate),
            Occurs::Once { .. } => None,
        });
        let slowest = rates.fold(f64::INFINITY, f64::min);
        if slowest.is_finite() && self.can_continue_after_events() {
            let planned = self.acts.iter().map(|act| act.planned.to_f64());
            let all = planned.sum::<f64>().max(1.0);
            return Ok((self.horizon + 2.0 * all + (7.0 / slowest).min(100.0 * all)).ceil());
        }
        if self.horizon <= 0.0 {
            return Err(NotTabulated::new(
                "there are no events, so no time limit can be derived",
            ));
        }
        Ok(self.horizon)
    }

    /// Returns `true` if the goal may be reachable after all events that happen at most once.
    fn can_continue_after_events(&self) -> bool {
        let mut gone = 0;
        for event in &self.events {
            if let Occurs::Once { probability, .. } = event.occurs
                && probability >= 1.0
            {
                gone |= event.deletes & !self.addable;
            }
        }
        let under_way = self.acts.iter().enumerate();
        let under_way = under_way.fold(0, |all, (index, _)| all | 1 << index);
        self.can_reach_goal(!gone, under_way, u32::MAX)
    }
}

pub(crate) fn unknown_shape() -> NotTabulated {
    NotTabulated::new("there is a gamma distribution")
}
