//! The world of the timed optimum: facts are bits, actions and events are numbered.

use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, FactId};
use elbowroom_num::Rational;
use elbowroom_sim::{Distribution, Rule, Side, WorldModel};

use super::compile::{Compiler, actions, relevant};
use super::failures::{Ending, Failed};
use super::{NotTabulated, Settings};

/// Which facts are true.
pub(crate) type Facts = u128;

/// A condition on facts.
#[derive(Clone, Debug)]
pub(crate) enum Needs {
    All(Vec<Needs>),
    Any(Vec<Needs>),
    Not(Box<Needs>),
    Fact(Facts),
}

/// A start or an end.
#[derive(Clone, Debug)]
pub(crate) struct Snap {
    pub(crate) needs: Needs,
    pub(crate) adds: Facts,
    pub(crate) deletes: Facts,
}

/// An action.
#[derive(Clone, Debug)]
pub(crate) struct Act {
    pub(crate) name: String,
    pub(crate) action: Arc<Action>,
    pub(crate) start: Snap,
    /// What is needed over all, and its end; `None` for instantaneous actions.
    pub(crate) rest: Option<(Needs, Snap)>,
    pub(crate) planned: Rational,
    /// P(it fails midway), given that it starts.
    pub(crate) midway: f64,
    /// P(it fails at its end), given that it starts.
    pub(crate) at_end: f64,
    /// How things may stand when it has failed; the shares add up to 1.
    pub(crate) failures: Vec<Failed>,
    /// Whether it may do any good to cancel it.
    pub(crate) may_be_cancelled: bool,
    /// Whether nothing is ever better than to start it as soon as one can.
    pub(crate) is_eager: bool,
}

/// Something that happens by itself.
#[derive(Clone, Debug)]
pub(crate) struct Event {
    pub(crate) adds: Facts,
    pub(crate) deletes: Facts,
    pub(crate) occurs: Occurs,
}

/// How often something happens by itself.
#[derive(Clone, Debug)]
pub(crate) enum Occurs {
    /// At most once: how likely, and when.
    Once { probability: f64, time: Rule },
    /// Again and again, so many times per second, whatever has been before.
    Rate(f64),
}

/// See [`timed`](super).
#[derive(Clone, Debug)]
pub(crate) struct TimedWorld {
    pub(crate) model: WorldModel,
    /// The facts that matter; the place of each is its bit.
    pub(crate) facts: Vec<FactId>,
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

impl TimedWorld {
    pub(crate) fn new(
        task: &Task,
        model: &WorldModel,
        settings: &Settings,
    ) -> Result<Self, NotTabulated> {
        if let Some(feature) = task.only_judged() {
            return Err(NotTabulated::new(format!(
                "it does not heed {feature}, which the problem has"
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
        let compiler = Compiler {
            task,
            facts: relevant(task, model, &actions, &goal),
        };
        if compiler.facts.len() > 128 {
            return Err(NotTabulated::new(format!(
                "{} facts matter, and 128 is the most",
                compiler.facts.len()
            )));
        }
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
        let mut world = Self {
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
        world.see_what_changes();
        world.horizon = world.end_of_runs(settings)?;
        Ok(world)
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
                act.may_be_cancelled = act.may_gain_by_cancelling(&self.model);
                // It takes nothing away, and what it gives stays. Whoever starts it later could as
                // well have it over earlier.
                act.is_eager = act.ends_safely()
                    && !act.may_hold_up()
                    && act.deletes() == 0
                    && act.adds() & self.deletable == 0;
            }
        }
    }

    /// Whether the goal can be reached if deletions do nothing, from these facts, with what may
    /// still come about by itself and by what is under way.
    pub(super) fn is_hopeful(&self, facts: Facts, under_way: u64, happened: u32) -> bool {
        let mut facts = facts;
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
        !self.is_monotone || adds & !facts != 0 || adds & self.deletable != 0
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
            None => (end.adds, act.ends_kindly() && end.needs.hold(facts)),
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

impl Needs {
    pub(super) fn hold(&self, facts: Facts) -> bool {
        match self {
            Self::All(parts) => parts.iter().all(|part| part.hold(facts)),
            Self::Any(parts) => parts.iter().any(|part| part.hold(facts)),
            Self::Not(part) => !part.hold(facts),
            Self::Fact(fact) => facts & fact != 0,
        }
    }

    /// Whether they may hold if more facts may be false than these.
    fn is_possible(&self, facts: Facts) -> bool {
        match self {
            Self::All(parts) => parts.iter().all(|part| part.is_possible(facts)),
            Self::Any(parts) => parts.iter().any(|part| part.is_possible(facts)),
            Self::Not(part) => part.may_fail(facts),
            Self::Fact(fact) => facts & fact != 0,
        }
    }

    /// Whether they may be false if more facts may be false than these; any fact may be false.
    fn may_fail(&self, facts: Facts) -> bool {
        match self {
            Self::All(parts) => parts.iter().any(|part| part.may_fail(facts)),
            Self::Any(parts) => parts.iter().all(|part| part.may_fail(facts)),
            Self::Not(part) => part.is_possible(facts),
            Self::Fact(_) => true,
        }
    }

    /// The facts that must all be true, if that is all there is to it.
    fn conjunction(&self) -> Option<Facts> {
        match self {
            Self::All(parts) => parts
                .iter()
                .try_fold(0, |all, part| Some(all | part.conjunction()?)),
            Self::Fact(fact) => Some(*fact),
            Self::Any(_) | Self::Not(_) => None,
        }
    }

    fn has_negation(&self) -> bool {
        match self {
            Self::All(parts) | Self::Any(parts) => parts.iter().any(Self::has_negation),
            Self::Not(_) => true,
            Self::Fact(_) => false,
        }
    }
}

impl Snap {
    /// Additions win over deletions of the same happening.
    pub(super) fn apply(&self, facts: Facts) -> Facts {
        (facts & !self.deletes) | self.adds
    }
}

impl Event {
    pub(super) fn apply(&self, facts: Facts) -> Facts {
        (facts & !self.deletes) | self.adds
    }

    /// Whether it happens again and again, so that nobody has to remember that it has.
    pub(crate) fn is_recurrent(&self) -> bool {
        matches!(self.occurs, Occurs::Rate(_))
    }

    /// How likely it is over at that time, in seconds; never for certain if it happens again.
    pub(super) fn is_over_by(&self, time: f64, side: Side, resolution: f64) -> Option<f64> {
        match &self.occurs {
            Occurs::Once {
                probability,
                time: rule,
            } => {
                let share = rule.share(time, side, 0.0, resolution)?;
                Some(share * probability)
            }
            Occurs::Rate(_) => Some(0.0),
        }
    }

    /// Whether it only makes facts false.
    pub(super) fn is_harmful(&self) -> bool {
        self.adds == 0
    }
}

impl Act {
    fn has_negation(&self) -> bool {
        let rest = self.rest.as_ref();
        self.start.needs.has_negation()
            || rest
                .is_some_and(|(over_all, end)| over_all.has_negation() || end.needs.has_negation())
    }

    /// All that it may make true.
    fn adds(&self) -> Facts {
        let end = self.rest.as_ref().map_or(0, |(_, end)| end.adds);
        self.start.adds | self.adds_by_failing() | end
    }

    /// All that it may make false.
    fn deletes(&self) -> Facts {
        let end = self.rest.as_ref().map_or(0, |(_, end)| end.deletes);
        self.start.deletes | self.deletes_by_failing() | end
    }

    /// Whether its end deletes nothing that matters.
    pub(super) fn ends_kindly(&self) -> bool {
        self.rest
            .as_ref()
            .is_some_and(|(_, end)| end.deletes & !end.adds == 0)
    }

    /// Whether its end needs nothing but what it needs all the time anyway, so that no moment is
    /// better for it to end than another.
    fn ends_safely(&self) -> bool {
        self.rest.as_ref().is_some_and(|(over_all, end)| {
            let always = over_all.conjunction().unwrap_or(0);
            end.needs
                .conjunction()
                .is_some_and(|needs| needs & !always == 0)
        })
    }

    /// Whether there can be something in cancelling it where more facts are never worse: its end
    /// may do harm, well or badly, or who begins anew may be done earlier than who goes on.
    fn may_gain_by_cancelling(&self, model: &WorldModel) -> bool {
        !self.ends_kindly()
            || !self.ends_safely()
            || self.deletes_by_failing() != 0
            || self.may_hold_up()
            || model
                .duration_rule(&self.name)
                .is_some_and(|rule| !is_fixed(rule))
    }
}

fn is_fixed(rule: &Rule) -> bool {
    matches!(rule.distribution, Distribution::Constant(_))
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
