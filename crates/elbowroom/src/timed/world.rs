//! The world of the timed optimum: facts are bits, actions and events are numbered.

use elbowroom_model::Task;
use elbowroom_model::ground::FactId;
use elbowroom_sim::{Side, WorldModel};

use super::act::{Act, Event, Needs, Occurs};
use super::available::actions;
use super::compile::Compiler;
use super::failures::Ending;
use super::numbers::{Number, Span, Test};
use super::{NotTabulated, Settings, Side as Bounding};

/// Which facts are true.
pub(crate) type Facts = u128;

/// See [`timed`](super).
#[derive(Clone, Debug)]
pub(crate) struct TimedWorld {
    pub(crate) model: WorldModel,
    /// The facts that matter; the place of each is its bit.
    pub(crate) facts: Vec<FactId>,
    pub(crate) numbers: Vec<Number>,
    /// Comparisons of numbers; their bits come after those of the facts.
    pub(super) tests: Vec<Test>,
    /// Their bits.
    pub(super) tested: Facts,
    /// From which side comparisons are seen that may or may not hold.
    side: Bounding,
    pub(crate) acts: Vec<Act>,
    pub(crate) events: Vec<Event>,
    pub(crate) initial: Facts,
    pub(crate) goal: Needs,
    /// Whether more facts are never worse: no condition asks for something to be false.
    pub(crate) is_monotone: bool,
    /// The facts that something may make false.
    deletable: Facts,
    /// The facts that something may make true.
    addable: Facts,
    /// In seconds.
    pub(crate) horizon: f64,
}

/// The most actions and events: they are bits of numbers.
const MOST_ACTS: usize = 64;
const MOST_EVENTS: usize = 32;

/// The most facts, and comparisons of numbers, which count as facts.
const MOST_FACTS: usize = 128;

impl TimedWorld {
    pub(crate) fn new(
        task: &Task,
        model: &WorldModel,
        settings: &Settings,
    ) -> Result<Self, NotTabulated> {
        if let Some(feature) = task.only_judged() {
            return Err(NotTabulated::new(format!(
                "it does not support {feature}, which the problem has"
            )));
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
                "the world has facts that change at a rate and does not report it",
            ));
        }
        let actions = actions(task, model, settings)?;
        let goal = task.goal().clone();
        let compiler = Compiler::new(task, model, &actions, &goal)?;
        let events = compiler.events(model)?;
        if events.len() > MOST_EVENTS {
            return Err(NotTabulated::new(format!(
                "{} events matter, and {MOST_EVENTS} is the most",
                events.len()
            )));
        }
        let mut acts = Vec::new();
        for action in &actions {
            acts.extend(compiler.act(action, model)?);
        }
        if acts.len() > MOST_ACTS {
            return Err(NotTabulated::new(format!(
                "{} actions matter, and {MOST_ACTS} is the most",
                acts.len()
            )));
        }
        let goal = compiler.needs(&goal)?;
        let initial = task.initial().facts.iter();
        let initial = initial.fold(0, |facts, fact| facts | compiler.bit(*fact));
        let tests = compiler.tests.into_inner();
        let known = compiler.facts.len() + tests.len();
        if known > MOST_FACTS {
            return Err(NotTabulated::new(format!(
                "{known} facts and comparisons matter, and {MOST_FACTS} is the most"
            )));
        }
        let mut world = Self {
            tested: (0..tests.len()).fold(0, |all, test| all | 1 << (compiler.facts.len() + test)),
            tests,
            numbers: compiler.numbers,
            side: Bounding::Below,
            facts: compiler.facts,
            horizon: latest(&events, model)?,
            is_monotone: !goal.has_negation() && !acts.iter().any(Act::has_negation),
            deletable: 0,
            addable: 0,
            model: model.clone(),
            acts,
            events,
            initial,
            goal,
        };
        world.cut()?;
        world.see_what_helps();
        world.see_what_changes();
        world.horizon = world.end_of_runs(settings)?;
        Ok(world)
    }

    /// Enters which comparisons may come to hold by what happenings do to numbers.
    fn see_what_helps(&mut self) {
        let first = self.facts.len();
        for act in &mut self.acts {
            let ends = act.rest.iter_mut().map(|(_, end)| end);
            for snap in ends.chain([&mut act.start]) {
                let tests = self.tests.iter().enumerate();
                let helped = tests
                    .filter(|(_, test)| snap.amounts.iter().any(|amount| amount.may_help(test)));
                snap.helps = helped.fold(0, |all, (place, _)| all | 1 << (first + place));
            }
        }
    }

    /// Enters what follows from the actions and events that there are.
    pub(super) fn see_what_changes(&mut self) {
        let acts = &self.acts;
        let events = &self.events;
        self.deletable = acts.iter().fold(0, |all, act| all | act.deletes())
            | events.iter().fold(0, |all, event| all | event.deletes);
        self.addable = acts.iter().fold(0, |all, act| all | act.adds())
            | events.iter().fold(0, |all, event| all | event.adds);
        if self.is_monotone {
            for act in &mut self.acts {
                act.may_be_cancelled =
                    act.may_gain_by_cancelling(&self.model) || act.is_about_numbers(self.tested);
                // It takes nothing away, and what it gives stays. Whoever starts it later could as
                // well have it over earlier.
                act.is_eager = act.ends_safely()
                    && !act.is_about_numbers(self.tested)
                    && !act.may_hold_up()
                    && act.deletes() == 0
                    && act.adds() & self.deletable == 0;
            }
        }
    }

    /// Whether the goal can be reached if deletions do nothing, from these facts, with what may
    /// still come about by itself and by what is under way.
    pub(super) fn is_hopeful(&self, facts: Facts, under_way: u64, happened: u32) -> bool {
        // Numbers are what it takes.
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
    /// Whether it may do any good to do this: not if more facts are never worse, and all that it
    /// makes true is true and stays so.
    pub(super) fn is_useful(&self, act: usize, facts: Facts) -> bool {
        let adds = self.acts[act].adds();
        !self.is_monotone
            || adds & !facts != 0
            || adds & self.deletable != 0
            || self.acts[act].changes_numbers()
    }

    /// The same world, as a bound from that side sees comparisons that may or may not hold.
    pub(super) fn seen_from(&self, side: Bounding) -> Self {
        Self {
            side,
            ..self.clone()
        }
    }

    /// The same world, in which no action is broken off because of a number.
    pub(super) fn without_numbers_over_all(&self) -> Result<Self, NotTabulated> {
        let mut kinder = self.clone();
        for act in &mut kinder.acts {
            if let Some((over_all, _)) = &mut act.rest {
                *over_all = over_all.without(self.tested, true);
            }
        }
        kinder.cut()?;
        kinder.see_what_changes();
        Ok(kinder)
    }

    /// Facts, with the comparisons that hold of numbers.
    pub(super) fn tested(&self, facts: Facts, numbers: &[Span]) -> Facts {
        self.with_tests(facts, numbers, self.side)
    }

    /// What an event makes false for certain, and nothing makes true.
    pub(super) fn lost_for_good(&self, event: usize) -> Facts {
        let event = &self.events[event];
        match event.occurs {
            Occurs::Once { probability, .. } if probability >= 1.0 => event.deletes & !self.addable,
            _ => 0,
        }
    }

    /// Whether an event is best over at once: more facts are never worse, and what it gives nothing
    /// takes away. What can be taken away is better given after that.
    pub(super) fn is_best_at_once(&self, event: usize) -> bool {
        let event = &self.events[event];
        self.is_monotone && event.deletes == 0 && event.adds & self.deletable == 0
    }

    /// Whether an event is best over last: more facts are never worse, and what it takes away
    /// nothing gives back. What can be given back is better taken before that.
    pub(super) fn is_best_last(&self, event: usize) -> bool {
        let event = &self.events[event];
        self.is_monotone && event.adds == 0 && event.deletes & self.addable == 0
    }

    /// Whether an action that is about to end, well or badly, had best do so at once.
    pub(super) fn ends_best_at_once(&self, act: usize, ending: Ending, facts: Facts) -> bool {
        let act = &self.acts[act];
        let Some((_, end)) = &act.rest else {
            return false;
        };
        let (gives, does_no_harm) = match act.failed(ending) {
            None => (
                end.adds,
                act.ends_kindly() && end.amounts.is_empty() && end.needs.hold(facts),
            ),
            Some(failed) => (failed.adds, failed.deletes == 0),
        };
        self.is_monotone && does_no_harm && gives & self.deletable == 0
    }

    /// Whether there can be something in cancelling an action for who may do so at any moment:
    /// besides what [`Act::may_be_cancelled`] says, what its end gives may be better given later.
    pub(super) fn may_gain_by_cancelling(&self, act: usize) -> bool {
        let act = &self.acts[act];
        let gives = act.rest.as_ref().map_or(0, |(_, end)| end.adds);
        act.may_be_cancelled || gives & self.deletable != 0
    }
}

/// When all that happens at most once has happened, if it ever does.
fn latest(events: &[Event], model: &WorldModel) -> Result<f64, NotTabulated> {
    let mut latest: f64 = 0.0;
    for event in events {
        let Occurs::Once { time: rule, .. } = &event.occurs else {
            continue;
        };
        let beyond = |time: f64| {
            let share = rule.share(time, Side::UpTo, 0.0, model.resolution.to_f64());
            share.map(|share| 1.0 - share)
        };
        let mut time: f64 = 1.0;
        while beyond(time).ok_or_else(unknown_shape)? > 1e-12 {
            time *= 2.0;
            if time > 1e9 {
                return Err(NotTabulated::new(
                    "there is an event that may take more than 10^9 seconds to come",
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
        // Up to the resolution, so that boundaries of cells are round numbers.
        let resolution = model.resolution.to_f64();
        latest = latest.max((late / resolution - 1e-6).ceil() * resolution);
    }
    Ok(latest)
}

impl TimedWorld {
    /// When a run ends at the latest: when it is asked to, or when nothing more happens by itself.
    ///
    /// Where facts change at a rate that is never, unless all hope is gone with the last of what
    /// happens once. So there it is a time after which little is left to happen. Both bounds hold
    /// whatever it is: who has not reached the goal by then counts as lost from below, and as
    /// somebody who may yet reach it from above.
    fn end_of_runs(&self, settings: &Settings) -> Result<f64, NotTabulated> {
        if let Some(horizon) = &settings.horizon {
            return Ok(horizon.to_f64());
        }
        let rates = self.events.iter().filter_map(|event| match event.occurs {
            Occurs::Rate(rate) => Some(rate),
            Occurs::Once { .. } => None,
        });
        let slowest = rates.fold(f64::INFINITY, f64::min);
        if slowest.is_finite() && self.may_go_on() {
            let planned = self.acts.iter().map(|act| act.planned.to_f64());
            let all = planned.sum::<f64>().max(1.0);
            return Ok((self.horizon + 2.0 * all + (7.0 / slowest).min(100.0 * all)).ceil());
        }
        if self.horizon <= 0.0 {
            return Err(NotTabulated::new(
                "nothing happens by itself, so there is nothing to be late for",
            ));
        }
        Ok(self.horizon)
    }

    /// Whether there may be hope when all that happens at most once has happened.
    fn may_go_on(&self) -> bool {
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
        self.is_hopeful(!gone, under_way, u32::MAX)
    }
}

pub(super) fn unknown_shape() -> NotTabulated {
    NotTabulated::new("there is a gamma distribution")
}
