//! From one state to the next.

use elbowroom_model::problem::{Comparison, UpdateOperator};
use elbowroom_num::Rational;

use super::compile::{Action, Change, Compiled, NONE, Snap, Update};
use super::formula::{Formula, set};
use super::network::{NodeId, SETTLED};
use super::state::{Open, State};
use super::symbolic::{self, Form, Moment};
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
    /// If present, all happenings stay in the network, to be read off at the end, and what is
    /// needed to compute their times exactly is noted here.
    pub(crate) log: Option<Log>,
    /// Whether a duration had to be rounded to a tick, so that nothing is proved.
    pub(crate) has_rounded: bool,
}

/// What the network does not say of its nodes, whose times are rounded to ticks.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log {
    /// For each end of an action its node, that of its start if it started in the plan, and the
    /// duration's exact bounds.
    pub(crate) ends: Vec<(NodeId, NodeId, Rational, Option<Rational>)>,
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
            log: None,
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
        let is_in_time = state.earliest_end() <= self.horizon;
        (is_in_time && symbolic::is_possible(state, self.compiled.scale)).then_some(())
    }

    /// Whether happenings may leave the network.
    fn settles(&self, state: &State) -> bool {
        self.log.is_none() && state.symbolic.is_none()
    }

    /// Starts a durative action and returns its place among those under way, or lets an
    /// instantaneous action happen.
    fn start(&mut self, state: &mut State, number: u32) -> Option<usize> {
        let action = self.compiled.action(number);
        let snap = self.compiled.snap(action.start);
        if action.end == NONE {
            let place = self.place(state, snap);
            let node = insert(state, self.settles(state), snap, &place, false)?;
            let moment = moment(state, || (Form::node(node), None));
            self.demand(state, &snap.condition, None, &moment)?;
            self.take_effect(state, snap, u64::MAX, None, &moment)?;
            return Some(0);
        }
        let (least, most, duration) = self.duration_bounds(state, action)?;
        let guards = self.guards(state, action, duration.as_ref());
        let mut place = self.place(state, snap);
        let next_timed = action.breaking_timed.iter().find(|&&t| t >= state.timed);
        if let Some(&timed) = next_timed {
            let time = self.compiled.timed[timed as usize].time;
            place.latest = place.latest.min(time - least);
        }
        let node = insert(state, self.settles(state), snap, &place, true)?;
        let mut end = SETTLED;
        if state.symbolic.is_some() {
            let after = [(node, least)];
            end = state
                .network
                .add_node(self.compiled.now, NEVER, &after)
                .ok()?;
            if most < NEVER {
                state.network.add_edge(end, node, -most).ok()?;
            }
        }
        let moment = moment(state, || {
            let duration = duration_form(duration.as_ref(), node, end);
            (Form::node(node), Some(duration))
        });
        self.demand(state, &snap.condition, duration.as_ref(), &moment)?;
        if state.symbolic.is_some() {
            demand_duration(state, action, false, &moment)?;
        }
        let mut flows = Vec::new();
        for flow in &action.flows {
            let takes_place = flow
                .guard
                .is_none_or(|guard| guards >> guard.min(63) & 1 == 1);
            if takes_place {
                let rate = flow.rate.value(&state.values, duration.as_ref())?;
                flows.push((flow.fluent, rate));
            }
        }
        self.take_effect(state, snap, guards, duration.as_ref(), &moment)?;
        for (fluent, rate) in &flows {
            symbolic::flow(state, *fluent, rate, &moment.time)?;
            self.watch(state, &[*fluent], &moment)?;
        }
        let open = Open {
            action: number,
            node,
            start: state.network.earliest(node),
            least,
            most,
            duration,
            guards,
            end,
            flows,
        };
        self.watch_all(state, &open, &moment)?;
        let place = state.open.partition_point(|other| other.action <= number);
        state.open.insert(place, open);
        Some(place)
    }

    fn end(&mut self, state: &mut State, place: usize) -> Option<()> {
        let mut open = state.open[place].clone();
        let action = self.compiled.action(open.action);
        let snap = self.compiled.snap(action.end);
        if state.symbolic.is_none() {
            for bound in action.duration.bounds.iter().filter(|bound| bound.at_end) {
                let value = bound.value.value(&state.values, None)?;
                self.narrow(&mut open.least, &mut open.most, bound.comparison, &value);
            }
        }
        if open.least > open.most {
            return None;
        }
        let mut when = self.place(state, snap);
        let node = if open.end != SETTLED {
            reach_foreseen_end(state, snap, &when, open.end)?;
            open.end
        } else if open.node == SETTLED {
            when.earliest = when.earliest.max(open.start + open.least);
            if open.most < NEVER {
                when.latest = when.latest.min(open.start + open.most);
            }
            insert(state, self.settles(state), snap, &when, false)?
        } else {
            when.after.push((open.node, open.least));
            let node = insert(state, self.settles(state), snap, &when, true)?;
            if open.most < NEVER {
                state.network.add_edge(node, open.node, -open.most).ok()?;
            }
            node
        };
        if open.node != SETTLED {
            self.note_end(&open, node);
        }
        let moment = moment(state, || {
            let duration = if open.node == SETTLED {
                let start = Form::constant(self.compiled.scale.units(open.start));
                Form::node(node).plus(&Rational::from(-1), &start)
            } else {
                duration_form(open.duration.as_ref(), open.node, node)
            };
            (Form::node(node), Some(duration))
        });
        self.demand(state, &snap.condition, open.duration.as_ref(), &moment)?;
        if state.symbolic.is_some() {
            self.watch_all(state, &open, &moment)?;
            demand_duration(state, action, true, &moment)?;
            for (fluent, _) in &open.flows {
                self.watch(state, &[*fluent], &moment)?;
            }
        }
        state.open.remove(place);
        self.take_effect(state, snap, open.guards, open.duration.as_ref(), &moment)?;
        for (fluent, rate) in &open.flows {
            symbolic::flow(state, *fluent, &-rate, &moment.time)?;
        }
        if self.settles(state) {
            settle(state);
        }
        Some(())
    }

    /// Notes the exact duration, for the times of the plan.
    fn note_end(&mut self, open: &Open, node: NodeId) {
        let scale = self.compiled.scale;
        let Some(log) = &mut self.log else { return };
        let (least, most) = if let Some(duration) = &open.duration {
            (duration.clone(), Some(duration.clone()))
        } else {
            let most = (open.most < NEVER).then(|| scale.units(open.most));
            (scale.units(open.least), most)
        };
        log.ends.push((node, open.node, least, most));
    }

    /// Demands the goal of the times.
    pub(crate) fn reach_goal(&mut self, state: &mut State) -> Option<()> {
        let goal = &self.compiled.goal;
        self.demand(state, goal, None, &Moment::default())?;
        symbolic::is_possible(state, self.compiled.scale).then_some(())
    }

    /// Requires a condition, now or, where numbers depend on times, of the times.
    fn demand(
        &mut self,
        state: &mut State,
        condition: &Formula,
        duration: Option<&Rational>,
        moment: &Moment,
    ) -> Option<()> {
        if state.symbolic.is_none() {
            return self.require(state, condition, duration);
        }
        let lost = &mut self.has_rounded;
        symbolic::demand_formula(self.compiled, state, condition, moment, lost)
    }

    /// Demands the over-all condition of an action at some moment.
    fn watch_all(&mut self, state: &mut State, open: &Open, moment: &Moment) -> Option<()> {
        if state.symbolic.is_none() {
            return Some(());
        }
        let over_all = &self.compiled.action(open.action).over_all;
        let moment = Moment {
            time: moment.time.clone(),
            duration: (open.end != SETTLED || open.duration.is_some())
                .then(|| duration_form(open.duration.as_ref(), open.node, open.end)),
        };
        let lost = &mut self.has_rounded;
        symbolic::demand_formula(self.compiled, state, over_all, &moment, lost)
    }

    /// Demands the over-all conditions that read one of the fluents, of all that is under way.
    fn watch(&mut self, state: &mut State, fluents: &[u32], moment: &Moment) -> Option<()> {
        for place in 0..state.open.len() {
            let over_all = &self.compiled.action(state.open[place].action).over_all;
            let mut reads = false;
            over_all.visit_tests(&mut |test| {
                let difference = &self.compiled.tests[test as usize].difference;
                difference.visit_fluents(&mut |fluent| reads |= fluents.contains(&fluent));
            });
            if reads {
                let open = state.open[place].clone();
                self.watch_all(state, &open, moment)?;
            }
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
        let moment = Moment {
            time: Form::constant(self.compiled.scale.units(timed.time)),
            duration: None,
        };
        for (fluent, value) in &timed.assigns {
            if state.symbolic.is_some() {
                self.watch(state, &[*fluent], &moment)?;
                let value = Form::constant(value.clone());
                symbolic::update(state, *fluent, UpdateOperator::Assign, &value, &moment)?;
                self.watch(state, &[*fluent], &moment)?;
            } else {
                state.values[*fluent as usize] = Some(value.clone());
            }
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
        if state.symbolic.is_some() {
            return self.keeps_facts(state);
        }
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

    /// The same where numbers depend on times and are watched as they change.
    fn keeps_facts(&self, state: &State) -> Option<()> {
        let symbolic = state.symbolic.as_ref()?;
        let may_pass = |test: u32, open: &Open| {
            let mut is_governed = false;
            let difference = &self.compiled.tests[test as usize].difference;
            difference.visit_fluents(&mut |fluent| is_governed |= symbolic.governs(fluent));
            is_governed
                || difference.reads_duration()
                || state.passes(self.compiled, test, open.duration.as_ref())
        };
        state
            .open
            .iter()
            .all(|open| {
                let over_all = &self.compiled.action(open.action).over_all;
                over_all.holds(&state.facts, &mut |test| may_pass(test, open))
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
            let value = match bound.value.value(&state.values, None) {
                // It depends on times, and is demanded of them.
                None if state.symbolic.is_some() => continue,
                value => value?,
            };
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
        &mut self,
        state: &mut State,
        snap: &Snap,
        guards: u64,
        duration: Option<&Rational>,
        moment: &Moment,
    ) -> Option<()> {
        let (mut adds, mut deletes) = (Vec::new(), Vec::new());
        let mut updates: Vec<&Update> = snap.updates.iter().collect();
        for effect in &snap.conditional {
            let was_chosen = effect
                .at_start
                .is_none_or(|guard| guards >> guard.min(63) & 1 == 1);
            if was_chosen && self.require(state, &effect.now, duration).is_some() {
                match &effect.change {
                    Change::Add(fact) => adds.push(*fact),
                    Change::Delete(fact) => deletes.push(*fact),
                    Change::Update(update) => updates.push(update),
                }
            }
        }
        if state.symbolic.is_some() {
            self.update_symbolic(state, &updates, moment)?;
        } else {
            update_values(state, &updates, duration)?;
        }
        for &fact in snap.deletes.iter().chain(&deletes) {
            set(&mut state.facts, fact, false);
        }
        for &fact in snap.adds.iter().chain(&adds) {
            set(&mut state.facts, fact, true);
        }
        if !self.compiled.strata.is_empty() {
            state.derive(self.compiled);
        }
        Some(())
    }

    fn update_symbolic(
        &mut self,
        state: &mut State,
        updates: &[&Update],
        moment: &Moment,
    ) -> Option<()> {
        if updates.is_empty() {
            return Some(());
        }
        let fluents: Vec<u32> = updates.iter().map(|update| update.fluent).collect();
        self.watch(state, &fluents, moment)?;
        let read: Option<Vec<_>> = updates
            .iter()
            .map(|update| symbolic::read(state, update, moment))
            .collect();
        for (fluent, operator, amount) in read? {
            symbolic::update(state, fluent, operator, &amount, moment)?;
        }
        self.watch(state, &fluents, moment)
    }
}

/// Carries out numeric effects; all read the state on arrival.
fn update_values(
    state: &mut State,
    updates: &[&Update],
    duration: Option<&Rational>,
) -> Option<()> {
    if updates.is_empty() {
        return Some(());
    }
    let amounts: Option<Vec<Rational>> = updates
        .iter()
        .map(|update| update.value.value(&state.values, duration))
        .collect();
    for (update, amount) in updates.iter().zip(amounts?) {
        let place = &mut state.values[update.fluent as usize];
        *place = Some(match (update.operator, place.take()) {
            (UpdateOperator::Assign, _) => amount,
            (_, None) => return None,
            (UpdateOperator::Increase, Some(old)) => old + amount,
            (UpdateOperator::Decrease, Some(old)) => old - amount,
            (UpdateOperator::ScaleUp, Some(old)) => old * amount,
            (UpdateOperator::ScaleDown, Some(old)) => old.checked_div(&amount)?,
        });
    }
    Some(())
}

/// A moment, where numbers depend on times; elsewhere nobody looks at it.
fn moment(state: &State, form: impl FnOnce() -> (Form, Option<Form>)) -> Moment {
    if state.symbolic.is_none() {
        return Moment::default();
    }
    let (time, duration) = form();
    Moment { time, duration }
}

/// The duration: the only one there is, or the distance from start to end.
fn duration_form(duration: Option<&Rational>, start: NodeId, end: NodeId) -> Form {
    match duration {
        Some(duration) => Form::constant(duration.clone()),
        None => Form::node(end).plus(&Rational::from(-1), &Form::node(start)),
    }
}

/// Gives the happening its place in time. It is settled if nothing can push it and nothing
/// pushes back.
fn insert(
    state: &mut State,
    settles: bool,
    snap: &Snap,
    place: &Place,
    is_unsettled: bool,
) -> Option<NodeId> {
    if !is_unsettled && place.after.is_empty() && settles {
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

/// Lets an action end whose end has been in the network since its start.
fn reach_foreseen_end(state: &mut State, snap: &Snap, place: &Place, end: NodeId) -> Option<()> {
    for &(from, distance) in &place.after {
        state.network.add_edge(from, end, distance).ok()?;
    }
    state.network.delay(end, place.earliest).ok()?;
    state.network.hurry(end, place.latest).ok()?;
    for &stamp in &snap.marks {
        state.network.mark(stamp, end);
    }
    Some(())
}

/// Demands the duration constraints that depend on the state.
fn demand_duration(
    state: &mut State,
    action: &Action,
    at_end: bool,
    moment: &Moment,
) -> Option<()> {
    for bound in action
        .duration
        .bounds
        .iter()
        .filter(|bound| bound.at_end == at_end)
    {
        let value = symbolic::value(state, &bound.value, moment)?;
        let duration = moment.duration.clone()?;
        let difference = duration.plus(&Rational::from(-1), &value);
        symbolic::demand(state, difference, bound.comparison)?;
    }
    Some(())
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
