//! Compiles a grounded task.

mod alternatives;
mod durations;
mod finish;
mod snaps;

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::ground::{self, Body, Condition, DurativeBody, FluentId};
use elbowroom_model::reachability::Grounding;
use elbowroom_model::{Footprint, Situation, Task};
use elbowroom_num::Rational;

pub(super) use durations::reads_duration;

use super::compressibility::excludes_itself;
use super::directions::Shifts;
use super::fixed_durations::{needs_fixed_duration, variants_with_fixed_duration};
use super::full_form::full_actions;
use super::guarded::{has_products, moving_fluents, variants_by_guards};
use super::interference::{Links, Separations};
use super::macros::Macro;
use super::metric::Draft;
use super::reads::{read_action, visit_changes, visit_disputed};
use super::symbols::Symbols;
use super::tariffs::{variants_by_tariffs, with_known_tariffs};
use super::times::has_fixed_numbers;
use super::unfolded::unfolded;
use super::unsupported::{Unsupported, check};
use super::without_duration::{takes_no_time, without_duration};
use super::{Action, Compiled, Compressibility, Dates, Duration, Flow, NONE, Snap};
use crate::embedded::formula::Formula;
use crate::embedded::time::{Scale, Ticks};
use crate::embedded::tuning::{Technique, Tuning};

/// Number of actions compiled between two calls of `may_continue`.
const ACTIONS_PER_QUESTION: usize = 256;

/// Reason why there is no compiled problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Failure {
    Unsupported(Unsupported),
    /// `may_continue` returned `false`.
    Stopped,
}

/// The compilation's input besides the problem.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CompileInput<'a> {
    /// The initial situation.
    pub(crate) situation: &'a Situation,
    /// `true` if the problem's metric is the objective.
    pub(crate) metric: bool,
    pub(crate) tuning: &'a Tuning,
}

/// Compiles `grounding`, the part of `task` that is reachable from the situation. Stops when
/// `may_continue` returns `false`.
pub(crate) fn compile(
    task: &Task,
    grounding: &Grounding,
    wanted: CompileInput<'_>,
    may_continue: &mut dyn FnMut() -> bool,
) -> Result<Compiled, Failure> {
    let CompileInput { situation, .. } = wanted;
    let full = full_actions(task, grounding, may_continue).ok_or(Failure::Stopped)?;
    if !may_continue() {
        return Err(Failure::Stopped);
    }
    let mut builder = Builder::new(task);
    let has_fixed_numbers = has_fixed_numbers(grounding, situation);
    let folded = grounding;
    let unfolded = if has_fixed_numbers || !situation.running.is_empty() {
        None
    } else {
        unfolded(grounding)
    };
    let grounding = unfolded.as_ref().unwrap_or(folded);
    let uses_calendars = wanted.tuning.uses(Technique::Calendars);
    let known = uses_calendars
        .then(|| with_known_tariffs(task, grounding, situation))
        .flatten();
    let situation = known.as_ref().unwrap_or(situation);
    let variants = uses_calendars
        .then(|| variants_by_tariffs(task, grounding, situation, wanted.metric))
        .flatten();
    let grounding = variants.as_ref().map_or(grounding, |v| &v.grounding);
    let is_original = unfolded.is_none() && variants.is_none();
    builder.links = Links::new(has_fixed_numbers);
    if !has_fixed_numbers {
        builder.moving = moving_fluents(grounding);
        builder.has_products = has_products(grounding, &builder.moving);
    }
    if wanted.metric {
        builder.metric = Draft::of(builder.task, grounding, situation, has_fixed_numbers);
    }
    builder.read_conditions(grounding, situation);
    for running in &situation.running {
        check(&running.action).map_err(Failure::Unsupported)?;
        builder.links_of(&running.action);
    }
    for (number, action) in grounding.actions.iter().enumerate() {
        check(action).map_err(Failure::Unsupported)?;
        builder.links_of(action);
        if number % ACTIONS_PER_QUESTION == ACTIONS_PER_QUESTION - 1 && !may_continue() {
            return Err(Failure::Stopped);
        }
    }
    let scale = scale_of(task, grounding, situation);
    builder.epsilon = scale.ceil(task.epsilon()).0.max(1);
    for running in &situation.running {
        builder.running(&running.action);
    }
    for (number, action) in grounding.actions.iter().enumerate() {
        let origin = variants.as_ref().map_or(number, |v| v.origins[number]);
        let full = full.get(origin).cloned().flatten();
        let full = full.or_else(|| (!is_original).then(|| folded.actions[origin].clone()));
        if builder.moving.is_empty() {
            builder.action(action, full.as_ref());
            builder.action_without_duration(action, full.as_ref());
            for variant in variants_with_fixed_duration(action, false) {
                builder.action(&variant, Some(full.as_ref().unwrap_or(action)));
            }
        } else {
            builder.variants(action, full.as_ref().unwrap_or(action));
        }
        if number % ACTIONS_PER_QUESTION == ACTIONS_PER_QUESTION - 1 && !may_continue() {
            return Err(Failure::Stopped);
        }
    }
    let mut compiled = builder
        .finish(grounding, wanted, scale, may_continue)
        .ok_or(Failure::Stopped)?;
    compiled.macros = Macro::all(&compiled);
    Ok(compiled)
}

struct Builder<'a> {
    task: &'a Task,
    symbols: Symbols,
    links: Links,
    epsilon: Ticks,
    snaps: Vec<Snap>,
    separations: Vec<Separations>,
    actions: Vec<Action>,
    over_all: Vec<Condition>,
    metric: Option<Draft>,
    /// The fluents whose values may depend on the times of happenings.
    moving: BTreeSet<FluentId>,
    /// `true` if some effect multiplies moving numbers.
    has_products: bool,
}

/// Returns the grid for all times and constant durations.
fn scale_of(task: &Task, grounding: &Grounding, situation: &Situation) -> Scale {
    let mut numbers: Vec<&Rational> = vec![task.epsilon(), &situation.time];
    numbers.extend(task.timed().iter().map(|timed| &timed.time));
    for running in &situation.running {
        numbers.push(&running.start);
        for end in [&running.duration.lower, &running.duration.upper] {
            numbers.extend(end.value());
        }
    }
    for action in &grounding.actions {
        for constraint in action.durative().map_or(&[][..], |body| &body.duration) {
            if let ground::Expression::Constant(value) = &constraint.bound {
                numbers.push(value);
            }
        }
    }
    Scale::of(numbers.into_iter())
}

impl<'a> Builder<'a> {
    fn new(task: &'a Task) -> Self {
        Self {
            task,
            symbols: Symbols::new(task),
            links: Links::default(),
            epsilon: 1,
            snaps: Vec::new(),
            separations: Vec::new(),
            actions: Vec::new(),
            over_all: Vec::new(),
            metric: None,
            moving: BTreeSet::new(),
            has_products: false,
        }
    }

    /// Numbers all facts that are read, and all relevant fluents, before any effects are compiled.
    /// Other facts and fluents are not part of the states.
    fn read_conditions(&mut self, grounding: &Grounding, situation: &Situation) {
        let symbols = &mut self.symbols;
        symbols.formula(&grounding.goal);
        for rule in &grounding.rules {
            symbols.fact(rule.head);
            symbols.formula(&rule.body);
        }
        let running = situation.running.iter().map(|running| &*running.action);
        for action in running.clone().chain(&grounding.actions) {
            read_action(symbols, action);
        }
        // If a fluent matters, so do the values that its changes read.
        loop {
            let before = symbols.fluents.len();
            if let Some(metric) = &mut self.metric {
                metric.read(symbols);
            }
            for action in running.clone().chain(&grounding.actions) {
                visit_changes(action, &mut |fluent, value| {
                    if symbols.known_fluent(fluent).is_some() {
                        value.visit_fluents(&mut |read| {
                            symbols.fluent(read);
                        });
                    }
                });
            }
            if symbols.fluents.len() == before {
                break;
            }
        }
        // Non-commuting updates at one moment are errors that the validator would report.
        for action in running.clone().chain(&grounding.actions) {
            visit_disputed(action, &mut |fluent| {
                symbols.fluent(fluent);
            });
        }
        // An increase of a fluent without a value is an error that the validator would report.
        for action in running.chain(&grounding.actions) {
            visit_changes(action, &mut |fluent, _| {
                if !situation.state.values.contains_key(&fluent) {
                    symbols.fluent(fluent);
                }
            });
        }
    }

    fn links_of(&mut self, action: &ground::Action) {
        if let Some(body) = action.durative() {
            self.links.note(self.task, &body.over_all);
        }
    }

    fn push_snap(&mut self, snap: Snap, separations: Separations) -> u32 {
        self.snaps.push(snap);
        self.separations.push(separations);
        narrow(self.snaps.len() - 1)
    }

    /// Adds an action that is already running; only its end is compiled.
    fn running(&mut self, action: &ground::Action) {
        let Some(body) = action.durative() else {
            return;
        };
        let footprint = Footprint::of_end(self.task, action);
        let end = self.end_of(body, &footprint);
        let compiled = self.durative(action, body, NONE, end, Vec::new());
        self.actions.push(compiled);
        self.over_all.push(body.over_all.clone());
    }

    fn action(&mut self, action: &ground::Action, full: Option<&ground::Action>) {
        if takes_no_time(action) {
            return;
        }
        let full = full.unwrap_or(action);
        let (starts, ends) = (
            Footprint::of_start(self.task, full),
            Footprint::of_end(self.task, full),
        );
        let shifts = match &full.body {
            Body::Instantaneous(body) => Shifts::of(&body.effects),
            Body::Durative(body) => Shifts::of(&body.start.effects),
        };
        let mut separations = Separations::of(&starts, &shifts, self.epsilon, &self.links);
        match &action.body {
            Body::Instantaneous(body) => self.instant(action, body, separations),
            Body::Durative(body) => {
                separations.add_over_all_start(self.task, &body.over_all, &self.links);
                let mut guards = Vec::new();
                let snap = self.snap(&body.start, &mut guards);
                let start = self.push_snap(snap, separations);
                let shifts = full
                    .durative()
                    .map_or_else(Shifts::default, |body| Shifts::of(&body.end.effects));
                let end = self.end_with(body, &ends, &shifts, &mut guards);
                let compiled = self.durative(action, body, start, end, guards);
                self.over_all.push(body.over_all.clone());
                self.push_action(compiled);
            }
        }
    }

    /// Adds the action in all its variants. `full`: see [`action_without_duration`](Self::action_without_duration).
    fn variants(&mut self, action: &ground::Action, full: &ground::Action) {
        for variant in variants_by_guards(action, &self.moving) {
            let fixed = variants_with_fixed_duration(&variant, self.has_products);
            let matters = |fluent| self.symbols.known_fluent(fluent).is_some();
            if fixed.is_empty() || !needs_fixed_duration(&variant, &matters) {
                self.action(&variant, Some(full));
            }
            self.action_without_duration(&variant, Some(full));
            for variant in fixed {
                self.action(&variant, Some(full));
            }
        }
    }

    /// Adds the form without duration of an action whose duration may be 0, if there is such a
    /// form.
    fn action_without_duration(&mut self, action: &ground::Action, full: Option<&ground::Action>) {
        let Some(body) = without_duration(self.task, action, full) else {
            return;
        };
        let full = full.unwrap_or(action);
        let mut footprint = Footprint::of_start(self.task, full);
        footprint.include(Footprint::of_end(self.task, full));
        let shifts = full.durative().map(|body| {
            let effects = body.start.effects.iter().chain(&body.end.effects);
            Shifts::of(&effects.cloned().collect::<Vec<_>>())
        });
        let shifts = shifts.unwrap_or_default();
        let separations = Separations::of(&footprint, &shifts, self.epsilon, &self.links);
        self.instant(action, &body, separations);
    }

    /// Adds an action that takes no time.
    fn instant(
        &mut self,
        action: &ground::Action,
        body: &ground::SnapAction,
        separations: Separations,
    ) {
        let snap = self.snap(body, &mut Vec::new());
        let start = self.push_snap(snap, separations);
        self.over_all.push(Condition::TRUE);
        self.push_action(Action {
            schema: action.schema,
            arguments: action.arguments.clone(),
            start,
            end: NONE,
            over_all: Formula::default(),
            dates: Dates::default(),
            guards: Vec::new(),
            duration: Duration {
                least: Rational::ZERO,
                most: Some(Rational::ZERO),
                bounds: Vec::new(),
            },
            flows: Vec::new(),
            breaking_timed: Vec::new(),
            compressibility: Compressibility::Envelope,
            is_compression_safe: false,
            excludes_itself: true,
            exclusion: NONE,
            uses_duration: false,
        });
    }

    /// Adds the end of a running action, whose guards are already decided.
    fn end_of(&mut self, body: &DurativeBody, footprint: &Footprint) -> u32 {
        let mut decided = body.clone();
        for effect in &mut Arc::make_mut(&mut decided.end).effects {
            effect.guard.at_start = Condition::TRUE;
        }
        let shifts = Shifts::of(&body.end.effects);
        self.end_with(&decided, footprint, &shifts, &mut Vec::new())
    }

    fn end_with(
        &mut self,
        body: &DurativeBody,
        footprint: &Footprint,
        shifts: &Shifts,
        guards: &mut Vec<Formula>,
    ) -> u32 {
        let mut separations = Separations::of(footprint, shifts, self.epsilon, &self.links);
        separations.add_over_all_end(self.task, &body.over_all, &self.links);
        let snap = self.snap(&body.end, guards);
        self.push_snap(snap, separations)
    }

    fn durative(
        &mut self,
        action: &ground::Action,
        body: &DurativeBody,
        start: u32,
        end: u32,
        mut guards: Vec<Formula>,
    ) -> Action {
        let mut flows = Vec::new();
        for effect in &body.continuous {
            let guard = (start != NONE && !effect.guard.at_start.is_trivial()).then(|| {
                guards.push(self.symbols.formula(&effect.guard.at_start));
                u8::try_from(guards.len() - 1).unwrap_or(u8::MAX)
            });
            if let Some(fluent) = self.symbols.known_fluent(effect.fluent) {
                flows.push(Flow {
                    fluent,
                    rate: self.symbols.numeric(&effect.rate),
                    guard,
                });
            }
        }
        let over_all = self.symbols.formula(&body.over_all);
        let mut duration = Duration {
            least: Rational::ZERO,
            most: None,
            bounds: Vec::new(),
        };
        for constraint in &body.duration {
            duration.constrain(constraint, self.symbols.numeric(&constraint.bound));
        }
        let uses_duration = !flows.is_empty() || reads_duration(body);
        Action {
            schema: action.schema,
            arguments: action.arguments.clone(),
            start,
            end,
            over_all,
            dates: Dates::default(),
            guards,
            duration,
            flows,
            breaking_timed: Vec::new(),
            compressibility: Compressibility::Envelope,
            is_compression_safe: false,
            excludes_itself: start != NONE && excludes_itself(&self.snaps[start as usize]),
            exclusion: NONE,
            uses_duration,
        }
    }
}

fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2^32 entries")
}
