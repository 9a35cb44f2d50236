//! Effects of running actions at their ends, as timed initials.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Change, DurativeBody, Expression, FluentId, SnapAction};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_model::{RunningAction, Situation, Task, TimedHappening};
use elbowroom_num::{End, Interval, Rational};

use super::WriteProblemError;

/// Returns the earliest possible end of each running action that is at least `epsilon` from now.
///
/// # Errors
/// If the only remaining end of an action is now or in the past.
pub fn end_times(
    situation: &Situation,
    epsilon: &Rational,
) -> Result<Vec<Rational>, WriteProblemError> {
    let end = |running: &RunningAction| {
        let elapsed = &situation.time - &running.start;
        let later = Interval::at_least(&elapsed + epsilon);
        let left = running.duration.intersection(&later);
        // Otherwise it may end even sooner, but later than now.
        let left = if left.is_empty() {
            running.duration.clone()
        } else {
            left
        };
        let shortest = shortest(&left, epsilon).filter(|duration| *duration > elapsed);
        shortest
            .map(|duration| &running.start + duration)
            .ok_or_else(|| WriteProblemError::EndsNow {
                action: running.action.name.clone(),
            })
    };
    situation.running.iter().map(end).collect()
}

/// Returns the smallest number in an interval. If the lower end is excluded, returns a number above
/// it.
fn shortest(interval: &Interval, epsilon: &Rational) -> Option<Rational> {
    if interval.is_empty() {
        return None;
    }
    match &interval.lower {
        End::Closed(lower) => Some(lower.clone()),
        End::Open(lower) => {
            let step = match interval.width() {
                Some(width) => (&width * &Rational::new(1, 2)).min(epsilon.clone()),
                None => epsilon.clone(),
            };
            Some(lower + step)
        }
        End::Infinite => None,
    }
}

/// Returns the changes by the running actions at their `ends`, each as separate timed initials.
pub(super) fn ends_of_running(
    task: &Task,
    situation: &Situation,
    ends: &[Rational],
) -> Result<Vec<TimedHappening>, WriteProblemError> {
    if ends.len() != situation.running.len() {
        return Err(WriteProblemError::EndCount {
            running: situation.running.len(),
            ends: ends.len(),
        });
    }
    // Increases accumulate in the order of the ends.
    let mut order: Vec<_> = situation.running.iter().zip(ends).collect();
    order.sort_by_key(|(_, end)| *end);
    let mut values = situation.state.values.clone();
    let mut happenings = Vec::new();
    for (running, end) in order {
        check_end(situation, running, end)?;
        let unspeakable = |why: String| WriteProblemError::Inexpressible {
            action: running.action.name.clone(),
            why,
        };
        let Some(body) = running.action.durative() else {
            continue;
        };
        if let Some(why) = beyond_timed_initials(task, body) {
            return Err(unspeakable(why));
        }
        let duration = end - &running.start;
        let changes = changes_at(task, &body.end, &duration, &mut values).map_err(unspeakable)?;
        happenings.push(TimedHappening {
            time: end.clone(),
            changes,
        });
    }
    Ok(happenings)
}

fn check_end(
    situation: &Situation,
    running: &RunningAction,
    end: &Rational,
) -> Result<(), WriteProblemError> {
    let action = running.action.name.clone();
    if *end <= situation.time {
        return Err(WriteProblemError::EndsNow { action });
    }
    if !running.duration.contains(&(end - &running.start)) {
        return Err(WriteProblemError::Impossible {
            action,
            end: end.clone(),
            possible: running.duration.to_string(),
        });
    }
    Ok(())
}

/// Returns the reason why the remaining part of an action cannot be written as changes at known
/// times.
fn beyond_timed_initials(task: &Task, body: &DurativeBody) -> Option<String> {
    if let Some(effect) = body.continuous.first() {
        let fluent = task.fluent_name(effect.fluent);
        return Some(format!("it changes {fluent} while it runs"));
    }
    let guarded = body
        .end
        .effects
        .iter()
        .find(|effect| !effect.guard.is_trivial())?;
    let target = match &guarded.change {
        Change::Add(fact) | Change::Delete(fact) => task.fact_name(*fact),
        Change::Update { fluent, .. } => task.fluent_name(*fluent),
    };
    Some(format!(
        "it is undecided whether it changes {target} at its end"
    ))
}

/// Returns the changes at an action's end with expressions evaluated by `values`, which is updated.
/// Other changes of the fluents until then are not predicted; the validator accounts for them.
fn changes_at(
    task: &Task,
    end: &SnapAction,
    duration: &Rational,
    values: &mut BTreeMap<FluentId, Rational>,
) -> Result<Vec<Change>, String> {
    let before = values.clone();
    let mut changes = Vec::new();
    for effect in &end.effects {
        match &effect.change {
            Change::Add(fact) => changes.push(Change::Add(*fact)),
            Change::Delete(fact) => {
                // An addition at the same time wins, but not every planner knows that.
                let added = Change::Add(*fact);
                if !end.effects.iter().any(|other| other.change == added) {
                    changes.push(Change::Delete(*fact));
                }
            }
            Change::Update {
                operator,
                fluent,
                value,
            } => {
                let mut leaf = |leaf: &Expression| match leaf {
                    Expression::Fluent(fluent) => before.get(fluent).cloned(),
                    Expression::Duration => Some(duration.clone()),
                    _ => None,
                };
                let name = || task.fluent_name(*fluent);
                let by = value
                    .evaluate(&mut leaf)
                    .ok_or_else(|| format!("its effect on {} at its end is unknown", name()))?;
                let old = values.get(fluent).cloned();
                let new = updated(*operator, old, &by)
                    .ok_or_else(|| format!("{}, which it changes, has no value", name()))?;
                values.insert(*fluent, new);
            }
        }
    }
    let mut updated: Vec<FluentId> = Vec::new();
    for effect in &end.effects {
        if let Change::Update { fluent, .. } = effect.change
            && !updated.contains(&fluent)
        {
            updated.push(fluent);
            changes.push(Change::Update {
                operator: UpdateOperator::Assign,
                fluent,
                value: Expression::Constant(values[&fluent].clone()),
            });
        }
    }
    Ok(changes)
}

/// Returns a fluent's value after an update, or `None` if the old value is needed and missing.
fn updated(operator: UpdateOperator, old: Option<Rational>, by: &Rational) -> Option<Rational> {
    match operator {
        UpdateOperator::Assign => Some(by.clone()),
        UpdateOperator::Increase => Some(old? + by),
        UpdateOperator::Decrease => Some(old? - by),
        UpdateOperator::ScaleUp => Some(old? * by),
        UpdateOperator::ScaleDown => old?.checked_div(by),
    }
}
