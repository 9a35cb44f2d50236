//! From one state to the next.

use elbowroom_model::problem::{Comparison, UpdateOperator};
use elbowroom_num::Rational;

use super::compile::{Action, Change, Compiled, NONE, Snap, Update};
use super::formula::{Formula, set};
use super::network::{NodeId, SETTLED};
use super::state::{Open, State};
use super::time::{NEVER, Ticks};

/// A choice of the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Step {
    /// The action starts, or happens if it takes no time.
    Start(u32),
    /// The action starts, and ends before anything else in the order of happenings.
    Whole(u32),
    /// The action at that place among those under way ends.
    End(u32),
    /// The next timed initials happen.
    Timed,
}

/// Applies steps to states.
#[derive(Debug)]
pub(crate) struct Stepper<'a> {
    pub(crate) compiled: &'a Compiled,
    /// Nothing may happen later.
    pub(crate) horizon: Ticks,
    /// Whether all happenings stay in the network, to be read off at the end.
    pub(crate) keeps_all: bool,
    /// Whether a duration had to be rounded to a tick, so that nothing is proved.
    pub(crate) has_rounded: bool,
}

/// When a happening may be.
struct Place {
    earliest: Ticks,
    latest: Ticks,
    after: Vec<(NodeId, Ticks)>,
}

impl<'a> Stepper<'a> {
    pub(crate) fn new(compiled: &'a Compiled) -> Self {
        Self {
            compiled,
            horizon: NEVER,
            keeps_all: false,
            has_rounded: false,
        }
    }

    /// The state after the step, if the step is possible.
    pub(crate) fn apply(&mut self, state: &State, step: Step) -> Option<State> {
        // Most impossible steps are seen without a copy.
        if let Step::Start(action) | Step::Whole(action) = step {
            let action = self.compiled.action(action);
            let snap = self.compiled.snap(action.start);
            if !snap
                .condition
                .literals
                .iter()
                .all(|l| l.holds(&state.facts))
            {
                return None;
            }
        }
        let mut next = state.clone();
        self.advance(&mut next, step)?;
        Some(next)
    }

    /// Applies the step in place; the state is of no use if that fails.
    pub(crate) fn advance(&mut self, state: &mut State, step: Step) -> Option<()> {
        match step {
            Step::Start(action) => {
                self.start(state, action)?;
            }
            Step::Whole(action) => {
                let place = self.start(state, action)?;
                self.keeps_conditions(state)?;
                self.end(state, place)?;
            }
            Step::End(place) => self.end(state, place as usize)?,
            Step::Timed => self.timed(state)?,
        }
        self.keeps_conditions(state)?;
        (state.earliest_end() <= self.horizon).then_some(())
    }

    /// Starts a durative action and returns its place among those under way, or lets an
    /// instantaneous action happen.
    fn start(&mut self, state: &mut State, number: u32) -> Option<usize> {
        let action = self.compiled.action(number);
        let snap = self.compiled.snap(action.start);
        if action.end == NONE {
            self.require(state, &snap.condition, None)?;
            let place = self.place(state, snap);
            let node = self.insert(state, snap, &place, false)?;
            debug_assert!(self.keeps_all || node == SETTLED || !state.network.is_empty());
            self.take_effect(state, snap, u64::MAX, None)?;
            return Some(0);
        }
        let (least, most, duration) = self.duration_bounds(state, action)?;
        self.require(state, &snap.condition, duration.as_ref())?;
        let guards = self.guards(state, action, duration.as_ref());
        let mut place = self.place(state, snap);
        let next_timed = action.breaking_timed.iter().find(|&&t| t >= state.timed);
        if let Some(&timed) = next_timed {
            let time = self.compiled.timed[timed as usize].time;
            place.latest = place.latest.min(time - least);
        }
        let node = self.insert(state, snap, &place, true)?;
        self.take_effect(state, snap, guards, duration.as_ref())?;
        let open = Open {
            action: number,
            node,
            start: state.network.earliest(node),
            least,
            most,
            duration,
            guards,
        };
        let place = state.open.partition_point(|other| other.action <= number);
        state.open.insert(place, open);
        Some(place)
    }

    fn end(&mut self, state: &mut State, place: usize) -> Option<()> {
        let mut open = state.open.remove(place);
        let action = self.compiled.action(open.action);
        let snap = self.compiled.snap(action.end);
        self.require(state, &snap.condition, open.duration.as_ref())?;
        for bound in action.duration.bounds.iter().filter(|bound| bound.at_end) {
            let value = bound.value.value(&state.values, None)?;
            self.narrow(&mut open.least, &mut open.most, bound.comparison, &value);
        }
        if open.least > open.most {
            return None;
        }
        let mut when = self.place(state, snap);
        if open.node == SETTLED {
            when.earliest = when.earliest.max(open.start + open.least);
            if open.most < NEVER {
                when.latest = when.latest.min(open.start + open.most);
            }
            self.insert(state, snap, &when, false)?;
        } else {
            when.after.push((open.node, open.least));
            let node = self.insert(state, snap, &when, true)?;
            if open.most < NEVER {
                state.network.add_edge(node, open.node, -open.most).ok()?;
            }
        }
        self.take_effect(state, snap, open.guards, open.duration.as_ref())?;
        if !self.keeps_all {
            settle(state);
        }
        Some(())
    }

    fn timed(&mut self, state: &mut State) -> Option<()> {
        let timed = self.compiled.timed.get(state.timed as usize)?;
        state.timed += 1;
        for &fact in &timed.deletes {
            set(&mut state.facts, fact, false);
        }
        for &fact in &timed.adds {
            set(&mut state.facts, fact, true);
        }
        for (fluent, value) in &timed.assigns {
            state.values[*fluent as usize] = Some(value.clone());
        }
        for &stamp in &timed.marks {
            let stamp = &mut state.stamps[stamp as usize];
            *stamp = (*stamp).max(timed.time);
        }
        state.derive(self.compiled);
        Some(())
    }

    /// When the snap may happen, after all that was chosen before.
    fn place(&self, state: &State, snap: &Snap) -> Place {
        let mut place = Place {
            earliest: self.compiled.now,
            latest: self.horizon,
            after: Vec::new(),
        };
        for &(stamp, distance) in &snap.after {
            place.earliest = place.earliest.max(state.stamps[stamp as usize] + distance);
        }
        for &(stamp, node) in &state.network.marks {
            if let Ok(found) = snap.after.binary_search_by_key(&stamp, |after| after.0) {
                place.after.push((node, snap.after[found].1));
            }
        }
        for &(timed, distance) in &snap.before_timed {
            if timed >= state.timed {
                let time = self.compiled.timed[timed as usize].time;
                place.latest = place.latest.min(time - distance);
            }
        }
        place
    }

    /// Gives the happening its place in time. It is settled if nothing can push it and nothing
    /// pushes back.
    fn insert(
        &self,
        state: &mut State,
        snap: &Snap,
        place: &Place,
        is_unsettled: bool,
    ) -> Option<NodeId> {
        if !is_unsettled && place.after.is_empty() && !self.keeps_all {
            if place.earliest > place.latest {
                return None;
            }
            for &stamp in &snap.marks {
                let stamp = &mut state.stamps[stamp as usize];
                *stamp = (*stamp).max(place.earliest);
            }
            state.settled_end = state.settled_end.max(place.earliest);
            return Some(SETTLED);
        }
        let node = state
            .network
            .add_node(place.earliest, place.latest, &place.after)
            .ok()?;
        for &stamp in &snap.marks {
            state.network.mark(stamp, node);
        }
        Some(node)
    }

    fn require(
        &self,
        state: &State,
        condition: &Formula,
        duration: Option<&Rational>,
    ) -> Option<()> {
        condition
            .holds(&state.facts, &mut |test| {
                state.passes(self.compiled, test, duration)
            })
            .then_some(())
    }

    /// What is under way still finds its over-all condition true.
    fn keeps_conditions(&self, state: &State) -> Option<()> {
        state
            .open
            .iter()
            .all(|open| {
                let over_all = &self.compiled.action(open.action).over_all;
                self.require(state, over_all, open.duration.as_ref())
                    .is_some()
            })
            .then_some(())
    }

    fn guards(&self, state: &State, action: &Action, duration: Option<&Rational>) -> u64 {
        let holds = |guard: &Formula| self.require(state, guard, duration).is_some();
        let guards = action.guards.iter().enumerate();
        guards.fold(0, |bits, (number, guard)| {
            bits | u64::from(holds(guard)) << number.min(63)
        })
    }

    /// The bounds of an action that would start now, and the duration if there is only one.
    fn duration_bounds(
        &mut self,
        state: &State,
        action: &Action,
    ) -> Option<(Ticks, Ticks, Option<Rational>)> {
        let mut least = action.duration.least.clone();
        let mut most = action.duration.most.clone();
        for bound in action.duration.bounds.iter().filter(|bound| !bound.at_end) {
            let value = bound.value.value(&state.values, None)?;
            let (raises, lowers) = sides(bound.comparison);
            if raises && value > least {
                least.clone_from(&value);
            }
            if lowers && most.as_ref().is_none_or(|most| value < *most) {
                most = Some(value);
            }
        }
        if most.as_ref().is_some_and(|most| *most < least) {
            return None;
        }
        let scale = self.compiled.scale;
        let duration = (most.as_ref() == Some(&least)).then(|| least.clone());
        let (up, is_exact) = scale.ceil(&least);
        self.has_rounded |= !is_exact;
        let down = match &most {
            None => NEVER,
            Some(most) => {
                let (down, is_exact) = scale.floor(most);
                self.has_rounded |= !is_exact;
                down
            }
        };
        // Between two ticks, take the lower one for both.
        let least = if up > down { down } else { up };
        Some((least, down, duration))
    }

    fn narrow(
        &mut self,
        least: &mut Ticks,
        most: &mut Ticks,
        comparison: Comparison,
        value: &Rational,
    ) {
        let (raises, lowers) = sides(comparison);
        let (down, is_exact) = self.compiled.scale.floor(value);
        self.has_rounded |= !is_exact;
        if raises {
            *least = (*least).max(down);
        }
        if lowers {
            *most = (*most).min(down);
        }
    }

    /// Carries out the effects: all read the state on arrival.
    fn take_effect(
        &self,
        state: &mut State,
        snap: &Snap,
        guards: u64,
        duration: Option<&Rational>,
    ) -> Option<()> {
        let mut updates: Vec<(u32, UpdateOperator, Rational)> = Vec::new();
        let read = |update: &Update, state: &State| {
            let value = update.value.value(&state.values, duration)?;
            Some((update.fluent, update.operator, value))
        };
        for update in &snap.updates {
            updates.push(read(update, state)?);
        }
        let (mut adds, mut deletes) = (Vec::new(), Vec::new());
        for effect in &snap.conditional {
            let was_chosen = effect
                .at_start
                .is_none_or(|guard| guards >> guard.min(63) & 1 == 1);
            if was_chosen && self.require(state, &effect.now, duration).is_some() {
                match &effect.change {
                    Change::Add(fact) => adds.push(*fact),
                    Change::Delete(fact) => deletes.push(*fact),
                    Change::Update(update) => updates.push(read(update, state)?),
                }
            }
        }
        for &fact in snap.deletes.iter().chain(&deletes) {
            set(&mut state.facts, fact, false);
        }
        for &fact in snap.adds.iter().chain(&adds) {
            set(&mut state.facts, fact, true);
        }
        for (fluent, operator, value) in updates {
            let place = &mut state.values[fluent as usize];
            *place = Some(match (operator, place.take()) {
                (UpdateOperator::Assign, _) => value,
                (_, None) => return None,
                (UpdateOperator::Increase, Some(old)) => old + value,
                (UpdateOperator::Decrease, Some(old)) => old - value,
                (UpdateOperator::ScaleUp, Some(old)) => old * value,
                (UpdateOperator::ScaleDown, Some(old)) => old.checked_div(&value)?,
            });
        }
        if !self.compiled.strata.is_empty() {
            state.derive(self.compiled);
        }
        Some(())
    }
}

/// Whether a duration constraint bounds from below, and from above.
fn sides(comparison: Comparison) -> (bool, bool) {
    match comparison {
        Comparison::Less | Comparison::AtMost => (false, true),
        Comparison::Equal => (true, true),
        Comparison::AtLeast | Comparison::Greater => (true, false),
    }
}

/// Takes what nothing can push any more out of the network.
fn settle(state: &mut State) {
    if state.network.is_empty() {
        return;
    }
    let open = &state.open;
    let mut nodes = open.iter().map(|open| open.node).filter(|&n| n != SETTLED);
    let end = state.network.earliest_end();
    let stamps = &mut state.stamps;
    let names = state.network.settle(&mut nodes, &mut |stamp, time| {
        let stamp = &mut stamps[stamp as usize];
        *stamp = (*stamp).max(time);
    });
    for open in &mut state.open {
        if open.node != SETTLED {
            open.node = names[open.node as usize];
        }
    }
    // At its earliest, what is left may be earlier than what was settled; but it cannot end
    // earlier than it does now.
    state.settled_end = state.settled_end.max(end);
}
