//! Execution of the plan, happening group by happening group.

use std::cell::OnceCell;
use std::collections::BTreeMap;

use elbowroom_num::Rational;

use super::abort::{Abort, EvaluationContext};
use super::autonomous::EventHistory;
use super::evaluate::Fault;
use super::explain::ExplanationContext;
use super::margin::{Demand, Margins};
use super::preferences::{ActionPreferenceMonitor, Part};
use super::segment::{Falsification, Segment, SegmentPart};
use super::state::{BasicState, Motion, Reading};
use super::timeline::{Group, HappeningKind};
use super::trajectory::TrajectoryMonitor;
use super::violation::{ConditionTime, Reason, ViolationKind};
use super::{Settings, effects, interference};
use crate::derivation::{Derivation, Derived, Moment, holds};
use crate::ground::{Body, Condition, DurativeBody, FactId, SnapAction};
use crate::plan::{Step, TimeTriggeredPlan};
use crate::situation::Situation;
use crate::task::Task;

static NO_SLACK: Rational = Rational::ZERO;

/// State of the validation at some moment.
pub(super) struct Judge<'a> {
    pub(super) task: &'a Task,
    pub(super) plan: &'a TimeTriggeredPlan,
    pub(super) settings: &'a Settings,
    pub(super) derivation: Derivation,
    pub(super) now: BasicState,
    /// Derived facts that hold in `now`, computed on demand.
    pub(super) derived: OnceCell<Derived<Fault>>,
    /// Steps that have started and not ended.
    pub(super) running: BTreeMap<usize, Running>,
    /// Last change of each fact: time and happening.
    pub(super) last_changes: BTreeMap<FactId, (Rational, HappeningKind<'a>)>,
    pub(super) margins: Margins,
    /// Trajectory constraints; `None` if there are none.
    pub(super) trajectory: Option<TrajectoryMonitor<'a>>,
    /// Preferences among the conditions of actions.
    pub(super) preferences: ActionPreferenceMonitor,
    /// Processes and events; `None` if there are none.
    pub(super) event_history: Option<EventHistory>,
}

/// A running durative action.
#[derive(Clone, Debug)]
pub(super) struct Running {
    /// `true` if no happening group has passed since it started.
    pub(super) is_new: bool,
    /// For each end effect, `true` if its guard may still become true.
    pub(super) end_guards: Vec<bool>,
    /// For each continuous effect, `true` if it takes place.
    pub(super) continuous: Vec<bool>,
}

/// Returns the running actions of a situation, by the position of the step that continues each.
pub(super) fn running(situation: &Situation) -> BTreeMap<usize, Running> {
    let under_way = situation.running.iter().enumerate();
    under_way
        .filter_map(|(position, running)| {
            let body = running.action.durative()?;
            let state = Running {
                is_new: false,
                end_guards: vec![true; body.end.effects.len()],
                continuous: vec![true; body.continuous.len()],
            };
            Some((position, state))
        })
        .collect()
}

impl<'a> Judge<'a> {
    /// Processes all groups, then checks the goal. With `from`, actions are already running at that
    /// time.
    pub(super) fn run(
        &mut self,
        from: Option<&Rational>,
        groups: &[Group<'a>],
    ) -> Result<(), Abort> {
        let mut before = from;
        let begin = from.cloned().unwrap_or_default();
        self.record_state(&begin)?;
        if self.event_history.is_some() {
            before = Some(&begin);
            self.fire_now(&begin)?;
            self.record_state(&begin)?;
        }
        for (position, group) in groups.iter().enumerate() {
            if let Some(before) = before.filter(|before| **before < group.time) {
                if self.event_history.is_some() {
                    self.advance_with_autonomous(before, &group.time)?;
                } else {
                    self.pass(before, &group.time)?;
                }
            }
            before = Some(&group.time);
            self.arrive(group)?;
            interference::check(self, &groups[..=position])?;
            self.check_separation_from_events(group)?;
            self.apply(group)?;
            self.fire_now(&group.time)?;
            self.record_state(&group.time)?;
        }
        let end = before.cloned().unwrap_or_default();
        if let Some(course) = &self.trajectory {
            course.violation(self, &end)?;
        }
        let at_end = Group {
            time: end,
            happenings: Vec::new(),
        };
        self.require(self.task.goal(), ConditionTime::Goal, None, &at_end)
    }

    /// Records the state from `time` on for the trajectory constraints.
    fn record_state(&mut self, time: &Rational) -> Result<(), Abort> {
        let Some(mut course) = self.trajectory.take() else {
            return Ok(());
        };
        course.note(self, time)?;
        self.trajectory = Some(course);
        Ok(())
    }

    /// Advances from just after the group at `from` to the arrival at the next one.
    fn pass(&mut self, from: &Rational, to: &Rational) -> Result<(), Abort> {
        let rates = effects::rates(self);
        let motion = Motion::from(&self.now, &rates)
            .map_err(|(step, fault)| self.to_abort(fault, &EvaluationContext::rate(from, step)))?;
        let length = to - from;
        self.watch_over_all(from, &motion, &length, None)?;
        self.record_phases(from, &motion, &length, None)?;
        motion.advance_state(&mut self.now, &length);
        self.derived.take();
        for running in self.running.values_mut() {
            running.is_new = false;
        }
        Ok(())
    }

    /// Records the changes until `length` later for the trajectory constraints, in the given
    /// part.
    pub(super) fn record_phases(
        &mut self,
        from: &Rational,
        motion: &Motion,
        length: &Rational,
        part: Option<&SegmentPart>,
    ) -> Result<(), Abort> {
        if motion.is_constant() && part.is_none() {
            return Ok(());
        }
        let Some(mut course) = self.trajectory.take() else {
            return Ok(());
        };
        let piece = Segment {
            now: &self.now,
            motion,
            length,
            derivation: &self.derivation,
            slack: &self.settings.slack,
            part,
        };
        course.note_motion(self, &piece, from)?;
        self.trajectory = Some(course);
        Ok(())
    }

    /// Checks the over-all conditions of running actions, and the over-all guards of their effects,
    /// at every moment from the group at `from` until `length` later, in the given part.
    pub(super) fn watch_over_all(
        &mut self,
        from: &Rational,
        motion: &Motion,
        length: &Rational,
        part: Option<&SegmentPart>,
    ) -> Result<(), Abort> {
        let mut running = std::mem::take(&mut self.running);
        let mut margins = std::mem::take(&mut self.margins);
        let mut preferences = std::mem::take(&mut self.preferences);
        let piece = Segment {
            now: &self.now,
            motion,
            length,
            derivation: &self.derivation,
            slack: self.slack(ConditionTime::OverAll),
            part,
        };
        let mut first: Option<(Falsification, EvaluationContext<'_>)> = None;
        for (&position, state) in &mut running {
            let (step, body) = self.durative(position);
            let duration = step.duration.as_ref();
            let when = (position, duration, state.is_new);
            preferences.watch(&piece, when, (self.task, from));
            for (index, conjunct) in body.over_all.conjuncts().into_iter().enumerate() {
                let place = EvaluationContext::condition(
                    from,
                    Some(position),
                    ConditionTime::OverAll,
                    conjunct,
                );
                let broken = piece
                    .first_falsification(conjunct, duration, !state.is_new)
                    .map_err(|fault| self.to_abort(fault, &place))?;
                if let Some(broken) = broken
                    && first
                        .as_ref()
                        .is_none_or(|(earlier, _)| broken.is_before(earlier))
                {
                    first = Some((broken, place));
                }
                if let Some(demand) = Demand::of(conjunct) {
                    let key = (Some(position), ConditionTime::OverAll, index);
                    margins.watch(key, &demand, &piece, duration, from);
                }
            }
            for (effect, flag) in body.end.effects.iter().zip(&mut state.end_guards) {
                let guard = &effect.guard.over_all;
                if *flag && !guard.is_trivial() {
                    let place = EvaluationContext::condition(
                        from,
                        Some(position),
                        ConditionTime::OverAll,
                        guard,
                    );
                    let broken = piece
                        .first_falsification(guard, duration, !state.is_new)
                        .map_err(|fault| self.to_abort(fault, &place))?;
                    *flag = broken.is_none();
                }
            }
        }
        if let Some((broken, place)) = first {
            let mut then = self.now.clone();
            motion.advance_state(&mut then, &broken.witness);
            return Err(self.fails(&place, &then, Some(&broken)));
        }
        self.running = running;
        self.margins = margins;
        self.preferences = preferences;
        Ok(())
    }

    /// Checks the conditions of all happenings of a group, all in the same state.
    fn arrive(&mut self, group: &Group<'a>) -> Result<(), Abort> {
        for happening in &group.happenings {
            let time = &group.time;
            match happening.kind {
                HappeningKind::Timed(_) | HappeningKind::Event(_) => {}
                HappeningKind::Instant(position) => {
                    if let Body::Instantaneous(snap) = &self.plan.steps[position].action.body {
                        self.require(&snap.condition, ConditionTime::Now, Some(position), group)?;
                        self.read_preferences(position, Part::Start, time);
                    }
                }
                HappeningKind::Start(position) => {
                    let (_, body) = self.durative(position);
                    self.check_duration(position, false, time)?;
                    self.require(
                        &body.start.condition,
                        ConditionTime::Start,
                        Some(position),
                        group,
                    )?;
                    self.read_preferences(position, Part::Start, time);
                    let running = self.begin(position, time)?;
                    self.running.insert(position, running);
                }
                HappeningKind::End(position) => {
                    let (_, body) = self.durative(position);
                    self.check_duration(position, true, time)?;
                    self.require(
                        &body.end.condition,
                        ConditionTime::End,
                        Some(position),
                        group,
                    )?;
                    self.read_preferences(position, Part::End, time);
                }
            }
        }
        Ok(())
    }

    /// Reads the preferences of a step that belong to its start or end.
    fn read_preferences(&mut self, position: usize, part: Part, time: &Rational) {
        let mut preferences = std::mem::take(&mut self.preferences);
        preferences.read(self, position, part, time);
        self.preferences = preferences;
    }

    /// Evaluates, at its start, the guards of the effects of an action.
    fn begin(&self, position: usize, time: &Rational) -> Result<Running, Abort> {
        let (_, body) = self.durative(position);
        let read = |guard: &Condition| {
            let place =
                EvaluationContext::condition(time, Some(position), ConditionTime::Start, guard);
            self.reads(guard, Some(position))
                .map_err(|fault| self.to_abort(fault, &place))
        };
        let mut running = Running {
            is_new: true,
            end_guards: Vec::new(),
            continuous: Vec::new(),
        };
        for effect in &body.end.effects {
            running.end_guards.push(read(&effect.guard.at_start)?);
        }
        for effect in &body.continuous {
            if !effect.guard.over_all.is_trivial() {
                return Err(Abort::continuous_guard(self.task, time, effect.fluent));
            }
            running.continuous.push(read(&effect.guard.at_start)?);
        }
        Ok(running)
    }

    fn check_duration(&self, position: usize, at_end: bool, time: &Rational) -> Result<(), Abort> {
        let (step, body) = self.durative(position);
        let duration = step.duration.clone().unwrap_or_default();
        for constraint in body
            .duration
            .iter()
            .filter(|constraint| constraint.at_end == at_end)
        {
            let value = self
                .reading(Some(position))
                .value(&constraint.bound)
                .map_err(|fault| {
                    self.to_abort(fault, &EvaluationContext::bound(time, position, constraint))
                })?;
            if !self
                .settings
                .allows(constraint.comparison, &duration, &value)
            {
                let mistake = ViolationKind::Duration {
                    duration,
                    comparison: constraint.comparison,
                    bound: self.task.describe_expression(&constraint.bound),
                    value,
                };
                return Err(self.violation(time, Some(position), mistake));
            }
        }
        Ok(())
    }

    /// Checks a condition in the current state, on arrival at a group, conjunct by conjunct.
    fn require(
        &mut self,
        condition: &Condition,
        when: ConditionTime,
        step: Option<usize>,
        group: &Group<'a>,
    ) -> Result<(), Abort> {
        let time = &group.time;
        for (index, conjunct) in condition.conjuncts().into_iter().enumerate() {
            let place = EvaluationContext::condition(time, step, when, conjunct);
            match self.reads(conjunct, step) {
                Ok(true) => {}
                Ok(false) => {
                    let violation = self.fails(&place, &self.now, None);
                    let late = self.late_changes(conjunct, group);
                    // Validation ends here, so the effects are applied for the message only.
                    let becomes_true = !late.is_empty()
                        && self.apply(group).is_ok()
                        && matches!(self.reads(conjunct, step), Ok(true));
                    return Err(if becomes_true {
                        violation.with_late_changes(late)
                    } else {
                        violation
                    });
                }
                Err(fault) => return Err(self.to_abort(fault, &place)),
            }
            if let Some(demand) = Demand::of(conjunct) {
                let mut margins = std::mem::take(&mut self.margins);
                margins.read((step, when, index), &demand, &self.reading(step), time);
                self.margins = margins;
            }
        }
        Ok(())
    }

    /// Returns the tolerance of comparisons in such a condition.
    fn slack(&self, when: ConditionTime) -> &'a Rational {
        match when {
            ConditionTime::OverAll => &NO_SLACK,
            _ => &self.settings.slack,
        }
    }

    /// Returns `true` if a condition of a step, or the goal, holds in the current state.
    pub(super) fn reads(&self, condition: &Condition, step: Option<usize>) -> Result<bool, Fault> {
        let current = (&self.now, &self.derived);
        let reader = (step, &self.settings.slack);
        self.with_moment(condition, current, reader, &|_, moment| {
            holds(condition, moment)
        })
    }

    /// Returns the numbers in the current state as a step reads them.
    pub(super) fn reading(&self, step: Option<usize>) -> Reading<'_> {
        self.reading_of(&self.now, (step, &self.settings.slack))
    }

    fn reading_of<'b>(
        &'b self,
        now: &'b BasicState,
        (step, slack): (Option<usize>, &'b Rational),
    ) -> Reading<'b> {
        let duration = step.and_then(|position| self.plan.steps[position].duration.as_ref());
        Reading {
            now,
            duration,
            slack,
        }
    }

    /// Calls `look` with the moment `now`, with its derived facts if the condition needs them.
    fn with_moment<T>(
        &self,
        condition: &Condition,
        (now, derived): (&BasicState, &OnceCell<Derived<Fault>>),
        (step, slack): (Option<usize>, &Rational),
        look: &dyn Fn(&Reading<'_>, &dyn Moment<Fault>) -> T,
    ) -> T {
        let reading = self.reading_of(now, (step, slack));
        if self.derivation.is_read_by(condition) {
            // Rules cannot read `?duration`.
            let derive = || self.derivation.derive(&self.reading_of(now, (None, slack)));
            let derived = derived.get_or_init(derive);
            look(
                &reading,
                &self.derivation.with_derived_facts(&reading, derived),
            )
        } else {
            look(&reading, &reading)
        }
    }

    /// Returns the reasons why a condition is false in `now`.
    pub(super) fn explain(
        &self,
        condition: &Condition,
        now: &BasicState,
        (step, when): (Option<usize>, ConditionTime),
    ) -> Vec<Reason> {
        self.with_moment(
            condition,
            (now, &OnceCell::new()),
            (step, self.slack(when)),
            &|reading, moment| {
                let since = |fact| {
                    let (time, what) = self.last_changes.get(&fact)?;
                    Some(self.occurrence(*what, time))
                };
                ExplanationContext {
                    task: self.task,
                    reading,
                    moment,
                    last_change: &since,
                }
                .reasons(condition)
            },
        )
    }

    /// Returns the step and its durative body. The step must be durative.
    pub(super) fn durative(&self, position: usize) -> (&'a Step, &'a DurativeBody) {
        let step = &self.plan.steps[position];
        (
            step,
            step.action
                .durative()
                .expect("only durative actions start and end"),
        )
    }

    /// Returns the effects of a happening of the plan; `None` for all others.
    pub(super) fn snap(&self, what: HappeningKind<'a>) -> Option<&'a SnapAction> {
        let action = &self.plan.steps[what.step()?].action;
        match (&action.body, what) {
            (Body::Instantaneous(snap), _) => Some(snap),
            (Body::Durative(body), HappeningKind::End(_)) => Some(&body.end),
            (Body::Durative(body), _) => Some(&body.start),
        }
    }
}
