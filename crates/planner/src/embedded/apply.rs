//! Successor states.

mod conditions;
mod durations;
pub(super) mod effects;
mod placement;

use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;

use super::bound::MetricBound;
use super::compile::{Compiled, Macro, NONE};
use super::expressions::{Form, Moment};
use super::formula::set;
use super::network::{NodeId, SETTLED};
use super::state::{JointMoment, OpenAction, State};
use super::symbolic;
use super::time::{NEVER, Ticks};
use conditions::Side;
use durations::demand_duration;
use placement::{
    insert, keep_in_windows, keep_within, place_known_end, place_timed, project_past, settle,
};

/// A choice of the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Step {
    /// Starts the action, or applies it if it is instantaneous.
    Start(u32),
    /// Starts the action and ends it. In the sequence of happenings, no other happening comes in
    /// between.
    Compressed(u32),
    /// Starts the envelope, applies its content, and ends the envelope. In the sequence of
    /// happenings, no other happening comes in between.
    Macro(u32),
    /// Ends the running action at that index.
    End(u32),
    /// Applies the next timed initials.
    Timed,
}

impl Step {
    /// Returns the basic steps of a macro step in a state; other steps consist of themselves.
    pub(crate) fn parts(self, compiled: &Compiled, state: &State) -> Vec<Self> {
        let Self::Macro(number) = self else {
            return vec![self];
        };
        let Macro { envelope, content } = compiled.macros[number as usize];
        let content = if compiled.action(content).end == NONE {
            Self::Start(content)
        } else {
            Self::Compressed(content)
        };
        // Index at which the start inserts the envelope.
        let place = state.open.partition_point(|open| open.action <= envelope);
        let place = u32::try_from(place).expect("few actions run at the same time");
        vec![Self::Start(envelope), content, Self::End(place)]
    }
}

/// Applies steps to states.
#[derive(Debug)]
pub(crate) struct Stepper<'a> {
    pub(crate) compiled: &'a Compiled,
    /// Latest time of a happening.
    pub(crate) horizon: Ticks,
    /// Upper bound for a better plan, if the metric depends on times.
    pub(crate) limit: Option<MetricBound>,
    /// If present, all happenings stay in the network until the end. The log stores the data for
    /// the exact computation of their times.
    pub(crate) log: Option<Log>,
    /// `true` if later choices happen no earlier.
    pub(crate) is_chronological: bool,
    /// `true` if an over-all condition may be false until the moment is complete.
    pub(crate) joins: bool,
    /// The node of the happening chosen last, in a search that joins happenings.
    newest: NodeId,
    /// `true` if a duration had to be rounded to a tick. Then nothing is proved.
    pub(crate) has_rounded: bool,
}

/// Maximum number of happenings that are joined at one moment.
const MAX_JOINED: u8 = 6;

/// The exact data of a network's nodes, whose times are rounded to ticks.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log {
    /// For each end of an action: its node, the node of its start if the action started in the
    /// plan, and the exact bounds of its duration.
    pub(crate) ends: Vec<(NodeId, NodeId, Rational, Option<Rational>)>,
}

impl<'a> Stepper<'a> {
    pub(crate) fn new(compiled: &'a Compiled) -> Self {
        Self {
            compiled,
            horizon: NEVER,
            limit: None,
            log: None,
            is_chronological: false,
            joins: false,
            newest: SETTLED,
            has_rounded: false,
        }
    }

    /// Returns the state after the step, if the step is applicable.
    pub(crate) fn apply(&mut self, state: &State, step: Step) -> Option<State> {
        // Most inapplicable steps are detected without a copy.
        if let Step::Start(action) | Step::Compressed(action) = step {
            let action = self.compiled.action(action);
            let snap = self.compiled.snap(action.start);
            if state.excludes(self.compiled, action)
                || !snap
                    .condition
                    .literals
                    .iter()
                    .all(|l| l.holds(&state.facts))
            {
                return None;
            }
            let fails = |&test: &u32| {
                let reads_duration = self.compiled.tests[test as usize]
                    .difference
                    .reads_duration();
                !reads_duration && !state.test_holds(self.compiled, test, None)
            };
            if state.symbolic.is_none() && snap.condition.tests.iter().any(fails) {
                return None;
            }
        }
        let mut next = state.clone();
        self.advance(&mut next, step)?;
        if next.symbolic.is_some() {
            // The network keeps all happenings, and a growing vector doubles its memory.
            next.network.shrink();
        }
        Some(next)
    }

    /// Applies the step in place. The state is unusable if this fails.
    pub(crate) fn advance(&mut self, state: &mut State, step: Step) -> Option<()> {
        match step {
            Step::Start(action) => {
                self.start(state, action)?;
            }
            Step::Compressed(action) => {
                let place = self.start(state, action)?;
                self.preserves_conditions(state)?;
                self.end(state, place)?;
            }
            Step::Macro(_) => {
                for part in step.parts(self.compiled, state) {
                    self.advance(state, part)?;
                }
            }
            Step::End(place) => self.end(state, place as usize)?,
            Step::Timed => self.timed(state)?,
        }
        if self.can_settle(state) && self.is_chronological {
            project_past(state, self.compiled.longest_distance);
        }
        self.preserves_conditions_or_joins(state)?;
        let is_in_time = state.earliest_end() <= self.horizon;
        (is_in_time && self.has_times(state)).then_some(())
    }

    /// Returns `true` if some times satisfy the demands. While a plan is extracted, this is checked
    /// only if demands may move happenings to later windows: the search has checked each of these
    /// states, and the times of the last state satisfy all demands.
    fn has_times(&self, state: &mut State) -> bool {
        let metric = self.compiled.metric.as_ref();
        let limit = metric.zip(self.limit.as_ref());
        self.log.is_some() && state.network.within().is_empty()
            || symbolic::is_possible(state, self.compiled, limit)
    }

    /// Returns `true` if happenings may leave the network.
    fn can_settle(&self, state: &State) -> bool {
        self.log.is_none() && state.symbolic.is_none() && !self.joins
    }

    /// Returns `Some` if all over-all conditions hold, or further happenings of the same moment may
    /// still satisfy them.
    fn preserves_conditions_or_joins(&self, state: &mut State) -> Option<()> {
        let before = state.joint.take();
        let is_kept = self.preserves_conditions(state);
        if is_kept.is_some() || !self.joins || self.newest == SETTLED {
            return is_kept;
        }
        let count = before.map_or(1, |joint| joint.count + 1);
        state.joint = Some(JointMoment {
            node: self.newest,
            count,
        });
        (count < MAX_JOINED).then_some(())
    }

    /// Starts a durative action and returns its index among the running actions, or applies an
    /// instantaneous action.
    fn start(&mut self, state: &mut State, number: u32) -> Option<usize> {
        let action = self.compiled.action(number);
        if state.excludes(self.compiled, action) {
            return None;
        }
        let snap = self.compiled.snap(action.start);
        if action.end == NONE {
            let mut place = self.place(state, snap);
            let node = insert(state, self.can_settle(state), snap, &mut place, false)?;
            self.record_last(state, node, &place)?;
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
        let node = insert(state, self.can_settle(state), snap, &mut place, true)?;
        keep_within(state, action, [node, node], least)?;
        self.record_last(state, node, &place)?;
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
            keep_within(state, action, [node, end], 0)?;
            keep_in_windows(state, self.compiled.snap(action.end), end)?;
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
            self.recheck_over_all(state, &[*fluent], (Side::After, &moment))?;
        }
        let mut open = OpenAction {
            action: number,
            node,
            start: state.network.earliest(node),
            least,
            most,
            duration,
            guards,
            end,
            flows,
            beginnings: Vec::new(),
            chosen: Vec::new(),
        };
        self.recheck_all(state, &mut open, (Side::Beginning, &moment))?;
        self.constrain_nested_ends(state, &open)?;
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
            place_known_end(state, snap, &when, open.end)?;
            open.end
        } else if open.node == SETTLED {
            when.earliest = when.earliest.max(open.start + open.least);
            if open.most < NEVER {
                when.latest = when.latest.min(open.start + open.most);
            }
            insert(state, self.can_settle(state), snap, &mut when, false)?
        } else {
            when.after.push((open.node, open.least));
            let node = insert(state, self.can_settle(state), snap, &mut when, true)?;
            keep_within(state, action, [open.node, node], 0)?;
            if open.most < NEVER {
                state.network.add_edge(node, open.node, -open.most).ok()?;
            }
            node
        };
        self.record_last(state, node, &when)?;
        if open.node != SETTLED {
            self.note_end(&open, node);
        }
        let moment = moment(state, || {
            let duration = if open.node == SETTLED && open.duration.is_none() {
                let start = Form::constant(self.start_of_running(&open));
                Form::node(node).plus(&Rational::from(-1), &start)
            } else {
                duration_form(open.duration.as_ref(), open.node, node)
            };
            (
                symbolic::end_form(self.compiled, &open, node),
                Some(duration),
            )
        });
        self.demand(state, &snap.condition, open.duration.as_ref(), &moment)?;
        if state.symbolic.is_some() {
            self.recheck_all(state, &mut open, (Side::Arrival, &moment))?;
            demand_duration(state, action, true, &moment)?;
            for (fluent, _) in &open.flows {
                self.recheck_over_all(state, &[*fluent], (Side::Arrival, &moment))?;
            }
        }
        state.open.remove(place);
        self.take_effect(state, snap, open.guards, open.duration.as_ref(), &moment)?;
        for (fluent, rate) in &open.flows {
            symbolic::flow(state, *fluent, &-rate, &moment.time)?;
            self.recheck_over_all(state, &[*fluent], (Side::After, &moment))?;
        }
        if self.can_settle(state) && !self.is_chronological {
            settle(state);
        }
        Some(())
    }

    /// Returns the start time of an action that was running in the situation. The value is rounded
    /// to ticks, as all times of the search, but exact while a plan is extracted.
    fn start_of_running(&self, open: &OpenAction) -> Rational {
        let running = self.compiled.initial.running.get(open.action as usize);
        let exact = running.filter(|_| self.log.is_some());
        exact.map_or_else(
            || self.compiled.scale.units(open.start),
            |running| running.exact_start.clone(),
        )
    }

    /// Records the exact duration for the times of the plan.
    fn note_end(&mut self, open: &OpenAction, node: NodeId) {
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

    fn timed(&mut self, state: &mut State) -> Option<()> {
        let timed = self.compiled.timed.get(state.timed as usize)?;
        state.timed += 1;
        if self.is_chronological {
            place_timed(state, timed.time)?;
        }
        if self.joins {
            let node = state.network.add_node(timed.time, timed.time, &[]).ok()?;
            self.join(state, node)?;
        }
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
                self.recheck_over_all(state, &[*fluent], (Side::Arrival, &moment))?;
                let value = Form::constant(value.clone());
                symbolic::update(state, *fluent, UpdateOperator::Assign, &value, &moment)?;
                self.recheck_over_all(state, &[*fluent], (Side::After, &moment))?;
            } else {
                state.values[*fluent as usize] = Some(value.clone());
            }
        }
        for &annotation in &timed.marks {
            let annotation = &mut state.annotations[annotation as usize];
            *annotation = (*annotation).max(timed.time);
        }
        state.derive(self.compiled);
        Some(())
    }
}

/// Returns the moment if numbers depend on times. Otherwise the moment is not used.
fn moment(state: &State, form: impl FnOnce() -> (Form, Option<Form>)) -> Moment {
    if state.symbolic.is_none() {
        return Moment::default();
    }
    let (time, duration) = form();
    Moment { time, duration }
}

/// Returns the duration: the constant if there is only one, otherwise the distance from start to
/// end.
fn duration_form(duration: Option<&Rational>, start: NodeId, end: NodeId) -> Form {
    match duration {
        Some(duration) => Form::constant(duration.clone()),
        None => Form::node(end).plus(&Rational::from(-1), &Form::node(start)),
    }
}
