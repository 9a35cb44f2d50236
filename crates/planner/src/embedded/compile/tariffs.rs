//! Effects that read *tariffs*: numbers that only timed initials change, such as a price.
//!
//! A tariff is constant between two timed initials. So an action whose effects read tariffs becomes one variant
//! for each value that they can have: the effect adds a constant, and a condition requires the value. Conditions
//! on tariffs are [calendars](super::calendars), so the search chooses a value and not an interval, and the
//! happening waits for the first interval with that value.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::ground::{
    Action, Body, Change, Condition, DurativeBody, Expression, FluentId, SnapAction,
};
use elbowroom_model::problem::Comparison;
use elbowroom_model::reachability::Grounding;
use elbowroom_model::{RunningAction, Situation, Task, TimedHappening};
use elbowroom_num::{End, Rational};

use super::metric::ground_metric;
use super::reads::visit_changes;

/// Maximum number of variants of one action.
const MAX_VARIANTS: usize = 64;

/// Maximum number of actions with all their variants.
const MAX_ACTIONS: usize = 20_000;

/// Values of some tariffs at the same time.
type Values = BTreeMap<FluentId, Rational>;

/// The actions in variants.
pub(super) struct Variants {
    pub(super) grounding: Grounding,
    /// The action of each variant, by its position in the original grounding.
    pub(super) origins: Vec<usize>,
}

/// Returns the grounding with variants of the actions whose effects read tariffs, or `None` if there are no such
/// actions, or too many variants.
pub(super) fn variants_by_tariffs(
    task: &Task,
    grounding: &Grounding,
    situation: &Situation,
    has_metric: bool,
) -> Option<Variants> {
    let tariffs = Tariffs::of(task, grounding, situation, has_metric)?;
    let mut actions = Vec::with_capacity(grounding.actions.len());
    let mut origins = Vec::with_capacity(grounding.actions.len());
    for (number, action) in grounding.actions.iter().enumerate() {
        actions.extend(tariffs.variants(action)?);
        if actions.len() > MAX_ACTIONS {
            return None;
        }
        origins.resize(actions.len(), number);
    }
    Some(Variants {
        grounding: Grounding {
            actions,
            ..grounding.clone()
        },
        origins,
    })
}

/// Returns the situation with constants in place of the tariffs that effects of running actions read, or `None` if
/// there are no such effects. Tariffs that can change while such an action may end are left.
pub(super) fn with_known_tariffs(
    task: &Task,
    grounding: &Grounding,
    situation: &Situation,
) -> Option<Situation> {
    let mut changed = BTreeSet::new();
    let running = situation.running.iter().map(|running| &*running.action);
    for action in running.chain(&grounding.actions) {
        visit_changes(action, &mut |fluent, _| {
            changed.insert(fluent);
        });
    }
    let mut known = situation.clone();
    let mut is_changed = false;
    for running in &mut known.running {
        let Some((earliest, latest)) = ends(running, &situation.time) else {
            continue;
        };
        let value_of = |fluent: FluentId| {
            let is_known = !changed.contains(&fluent);
            let value =
                is_known.then(|| value_between(task, situation, fluent, [&earliest, &latest]));
            value.flatten().map(Expression::Constant)
        };
        let mut action = (*running.action).clone();
        let Body::Durative(body) = &mut action.body else {
            continue;
        };
        let mut end = (*body.end).clone();
        for effect in &mut end.effects {
            if let Change::Update { value, .. } = &mut effect.change {
                *value = value.map_leaves(&mut |leaf| match leaf {
                    Expression::Fluent(fluent) => value_of(*fluent),
                    _ => None,
                });
            }
        }
        if end != *body.end {
            is_changed = true;
            body.end = Arc::new(end);
            running.action = Arc::new(action);
        }
    }
    is_changed.then_some(known)
}

/// Returns the earliest and the latest possible end of a running action, or `None` without a latest one.
fn ends(running: &RunningAction, now: &Rational) -> Option<(Rational, Rational)> {
    let lower = match &running.duration.lower {
        End::Closed(lower) | End::Open(lower) => &running.start + lower,
        End::Infinite => now.clone(),
    };
    match &running.duration.upper {
        End::Closed(upper) | End::Open(upper) => {
            Some((lower.max(now.clone()), &running.start + upper))
        }
        End::Infinite => None,
    }
}

/// Returns the value of a fluent that only timed initials change, if they do not change it between two times
/// (inclusive). `None` for a fluent without changes after the situation.
fn value_between(
    task: &Task,
    situation: &Situation,
    fluent: FluentId,
    [earliest, latest]: [&Rational; 2],
) -> Option<Rational> {
    let mut value = situation.state.values.get(&fluent).cloned();
    let mut is_tariff = false;
    for timed in task
        .timed()
        .iter()
        .filter(|timed| timed.time >= situation.time)
    {
        for change in &timed.changes {
            let Change::Update {
                fluent: other,
                value: new,
                ..
            } = change
            else {
                continue;
            };
            if *other != fluent {
                continue;
            }
            is_tariff = true;
            if timed.time > *latest {
                continue;
            }
            match new {
                Expression::Constant(new) if timed.time < *earliest => value = Some(new.clone()),
                _ => return None,
            }
        }
    }
    value.filter(|_| is_tariff)
}

/// The tariffs that effects read.
struct Tariffs {
    fluents: BTreeSet<FluentId>,
    /// Their values in the situation, and after each of their future changes.
    values: Vec<Values>,
    /// The fluents whose changes matter.
    relevant: BTreeSet<FluentId>,
}

impl Tariffs {
    fn of(
        task: &Task,
        grounding: &Grounding,
        situation: &Situation,
        has_metric: bool,
    ) -> Option<Self> {
        let is_future = |timed: &&TimedHappening| timed.time > situation.time;
        let future = task.timed().iter().filter(is_future);
        let mut fluents = BTreeSet::new();
        let mut others = BTreeSet::new();
        for change in future.clone().flat_map(|timed| &timed.changes) {
            if let Change::Update { fluent, value, .. } = change {
                let is_constant = matches!(value, Expression::Constant(_));
                let kind = if is_constant {
                    &mut fluents
                } else {
                    &mut others
                };
                kind.insert(*fluent);
            }
        }
        if fluents.is_empty() {
            return None;
        }
        let metric = has_metric.then(|| ground_metric(task)).flatten();
        let uses = Uses::of(grounding, situation, metric.as_ref());
        let relevant = &uses.by_conjuncts | &uses.elsewhere;
        let fluents = &(&(&fluents - &others) - &uses.elsewhere) - &uses.changed;
        let initial = &situation.state.values;
        let known = fluents
            .iter()
            .filter_map(|fluent| Some((*fluent, initial.get(fluent)?.clone())));
        let mut current: Values = known.collect();
        let mut values = vec![current.clone()];
        for timed in future {
            for change in &timed.changes {
                if let Change::Update { fluent, value, .. } = change
                    && let Expression::Constant(value) = value
                    && fluents.contains(fluent)
                {
                    current.insert(*fluent, value.clone());
                }
            }
            values.push(current.clone());
        }
        let tariffs = Self {
            fluents,
            values,
            relevant,
        };
        let is_read = |snap: &SnapAction| !tariffs.read_by(snap).is_empty();
        let mut actions = grounding.actions.iter();
        actions
            .any(|action| snaps(action).into_iter().any(is_read))
            .then_some(tariffs)
    }

    /// Returns the tariffs that relevant effects of the happening read.
    fn read_by(&self, snap: &SnapAction) -> BTreeSet<FluentId> {
        let mut read = BTreeSet::new();
        for effect in &snap.effects {
            if let Change::Update { fluent, value, .. } = &effect.change
                && self.relevant.contains(fluent)
            {
                value.visit_fluents(&mut |fluent| {
                    read.insert(fluent);
                });
            }
        }
        &read & &self.fluents
    }

    /// Returns the variants of an action, or `None` if there are too many.
    fn variants(&self, action: &Action) -> Option<Vec<Action>> {
        let bodies: Vec<Body> = match &action.body {
            Body::Instantaneous(snap) => {
                let snaps = self.variants_of(snap)?.into_iter();
                snaps.map(Body::Instantaneous).collect()
            }
            Body::Durative(body) => {
                let shared = |snap| Some(self.variants_of(snap)?.into_iter().map(Arc::new));
                let (starts, ends) = (shared(&body.start)?, shared(&body.end)?);
                let pairs =
                    starts.flat_map(|start| ends.clone().map(move |end| (start.clone(), end)));
                let with_snaps = |(start, end)| {
                    Body::Durative(DurativeBody {
                        start,
                        end,
                        ..body.clone()
                    })
                };
                pairs.map(with_snaps).collect()
            }
        };
        let variant = |body| Action {
            body,
            ..action.clone()
        };
        (bodies.len() <= MAX_VARIANTS).then(|| bodies.into_iter().map(variant).collect())
    }

    /// Returns the happening for each combination of values that its effects can read, or `None` if there are
    /// too many.
    fn variants_of(&self, snap: &SnapAction) -> Option<Vec<SnapAction>> {
        let read = self.read_by(snap);
        if read.is_empty() {
            return Some(vec![snap.clone()]);
        }
        let mut combinations = BTreeSet::new();
        for values in &self.values {
            let values = read
                .iter()
                .map(|fluent| Some((*fluent, values.get(fluent)?.clone())));
            combinations.extend(values.collect::<Option<Values>>());
        }
        let variants = combinations
            .iter()
            .map(|values| self.with_values(snap, values));
        (combinations.len() <= MAX_VARIANTS).then(|| variants.collect())
    }

    /// Returns the happening when the tariffs have these values.
    fn with_values(&self, snap: &SnapAction, values: &Values) -> SnapAction {
        let mut variant = snap.clone();
        for effect in &mut variant.effects {
            if let Change::Update { fluent, value, .. } = &mut effect.change
                && self.relevant.contains(fluent)
            {
                *value = value.map_leaves(&mut |leaf| match leaf {
                    Expression::Fluent(fluent) => {
                        values.get(fluent).cloned().map(Expression::Constant)
                    }
                    _ => None,
                });
            }
        }
        let has_value = |(fluent, value): (&FluentId, &Rational)| {
            let value = Expression::Constant(value.clone());
            Condition::Compare(Comparison::Equal, Expression::Fluent(*fluent), value)
        };
        let conditions = values.iter().map(has_value);
        variant.condition = Condition::And(
            std::iter::once(variant.condition)
                .chain(conditions)
                .collect(),
        );
        variant
    }
}

/// The fluents that the problem reads and changes.
#[derive(Default)]
struct Uses {
    /// Read by conjuncts of conditions, or by effects.
    by_conjuncts: BTreeSet<FluentId>,
    /// Read elsewhere.
    elsewhere: BTreeSet<FluentId>,
    /// Changed by actions.
    changed: BTreeSet<FluentId>,
}

impl Uses {
    fn of(grounding: &Grounding, situation: &Situation, metric: Option<&Expression>) -> Self {
        let mut uses = Self::default();
        uses.read_elsewhere(&grounding.goal);
        for rule in &grounding.rules {
            uses.read_elsewhere(&rule.body);
        }
        if let Some(metric) = metric {
            metric.visit_fluents(&mut |fluent| {
                uses.elsewhere.insert(fluent);
            });
        }
        for action in &grounding.actions {
            uses.note(action);
        }
        // Running actions have no variants. They read only tariffs that may change before they end.
        for running in &situation.running {
            uses.note(&running.action);
            visit_changes(&running.action, &mut |_, value| {
                value.visit_fluents(&mut |fluent| {
                    uses.elsewhere.insert(fluent);
                });
            });
        }
        uses
    }

    fn note(&mut self, action: &Action) {
        visit_changes(action, &mut |fluent, value| {
            self.changed.insert(fluent);
            value.visit_fluents(&mut |fluent| {
                self.by_conjuncts.insert(fluent);
            });
        });
        for snap in snaps(action) {
            self.read_condition(&snap.condition);
            for guard in snap.effects.iter().map(|effect| &effect.guard) {
                for part in [&guard.at_start, &guard.over_all, &guard.now] {
                    self.read_elsewhere(part);
                }
            }
        }
        let Some(body) = action.durative() else {
            return;
        };
        self.read_condition(&body.over_all);
        let bounds = body.duration.iter().map(|constraint| &constraint.bound);
        let rates = body.continuous.iter().map(|effect| &effect.rate);
        for expression in bounds.chain(rates) {
            expression.visit_fluents(&mut |fluent| {
                self.elsewhere.insert(fluent);
            });
        }
        for effect in &body.continuous {
            self.read_elsewhere(&effect.guard.at_start);
        }
    }

    fn read_condition(&mut self, condition: &Condition) {
        for conjunct in condition.conjuncts() {
            if matches!(conjunct, Condition::Compare(..)) {
                conjunct.visit_fluents(&mut |fluent| {
                    self.by_conjuncts.insert(fluent);
                });
            } else {
                self.read_elsewhere(conjunct);
            }
        }
    }

    fn read_elsewhere(&mut self, condition: &Condition) {
        condition.visit_fluents(&mut |fluent| {
            self.elsewhere.insert(fluent);
        });
    }
}

/// Returns the happenings of an action.
fn snaps(action: &Action) -> Vec<&SnapAction> {
    match &action.body {
        Body::Instantaneous(body) => vec![body],
        Body::Durative(body) => vec![&body.start, &body.end],
    }
}
