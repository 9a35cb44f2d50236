//! Possible violations of conditions by numbers that vary: [`Failure`].

use elbowroom_model::Footprint;
use elbowroom_model::ground::{Body, Condition, DurationConstraint, Expression, SnapAction};
use elbowroom_num::Rational;

use super::NotDerived;
use super::distances::Distances;
use super::histories::{Histories, Value};
use super::linear::{Inequality, Linear};
use super::offset_components::OffsetComponents;
use super::point_state::{PointState, compared};
use super::subject::{PointKind, Subject};

/// Limit on the number of considered sets: of points that can come before a moment inside an
/// action.
const MAX_SETS: usize = 4096;

/// Possible violation of a condition: all inequalities hold.
#[derive(Clone, Debug)]
pub(super) struct Failure {
    /// The condition, in words.
    pub(super) description: String,
    /// For a condition throughout an action: where it fails.
    pub(super) moment: Option<Place>,
    pub(super) inequalities: Vec<Inequality>,
}

/// A moment strictly between two points, at or after some points, and before others.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub(super) start: usize,
    pub(super) end: usize,
    pub(super) before: Vec<usize>,
    pub(super) after: Vec<usize>,
}

/// Collects the failures of conditions at happenings, of the goal, and of bounds on durations that are no
/// parameters, as far as numbers vary.
///
/// # Errors
/// When a number has no value or is not linear.
pub(super) fn at_points(
    subject: &Subject<'_>,
    histories: &Histories<'_>,
    places: &OffsetComponents,
    is_open: &dyn Fn(usize) -> bool,
) -> Result<Vec<Failure>, NotDerived> {
    let mut failures = Vec::new();
    for (index, point) in subject.points.iter().enumerate() {
        let (step, is_end) = match point.kind {
            PointKind::Zero | PointKind::Timed(_) => continue,
            PointKind::Start(step) | PointKind::Instant(step) => (step, false),
            PointKind::End(step) => (step, true),
        };
        let (snap, bounds): (&SnapAction, &[DurationConstraint]) =
            match &subject.steps[step].action.body {
                Body::Instantaneous(snap) => (snap, &[]),
                Body::Durative(body) if is_end => (&*body.end, &body.duration),
                Body::Durative(body) => (&*body.start, &body.duration),
            };
        let label = subject.label(index);
        histories.arrival(index, &mut |reading| {
            for condition in snap.condition.conjuncts() {
                failures.extend(of_condition(subject, reading, condition, &label)?);
            }
            if is_open(step) {
                return Ok(());
            }
            let [start, end] = subject.ends[step].map(|point| places.time(point));
            let duration = end.minus(&start);
            for bound in bounds.iter().filter(|bound| bound.at_end == is_end) {
                failures.extend(of_bound(subject, reading, bound, &duration, &label)?);
            }
            Ok::<(), NotDerived>(())
        })?;
    }
    histories.finally(&mut |reading| {
        for condition in subject.task.goal().conjuncts() {
            failures.extend(of_condition(subject, reading, condition, "the goal")?);
        }
        Ok::<(), NotDerived>(())
    })?;
    Ok(failures)
}

/// Returns the failures of a condition at one moment.
fn of_condition(
    subject: &Subject<'_>,
    reading: &PointState<'_>,
    condition: &Condition,
    label: &str,
) -> Result<Vec<Failure>, NotDerived> {
    if reading.holds(condition) == Ok(true) {
        return Ok(Vec::new());
    }
    let what = || {
        let condition = subject.task.describe_condition(condition);
        format!("{condition}, which `{label}` needs")
    };
    Ok(failures(
        what,
        None,
        reading.alternatives(condition, false)?,
    ))
}

fn failures(
    what: impl Fn() -> String,
    moment: Option<&Place>,
    alternatives: Vec<Vec<Inequality>>,
) -> Vec<Failure> {
    let failures = alternatives.into_iter().map(|inequalities| Failure {
        description: what(),
        moment: moment.cloned(),
        inequalities,
    });
    failures.collect()
}

/// Returns the failures of a bound on a duration. A bound on numbers that are the same in all schedules is
/// none of them where it is part of the network. A plan file with constraints need not have it.
fn of_bound(
    subject: &Subject<'_>,
    reading: &PointState<'_>,
    bound: &DurationConstraint,
    duration: &Linear,
    label: &str,
) -> Result<Vec<Failure>, NotDerived> {
    let what = || {
        let name = subject.task.describe_condition(&Condition::Compare(
            bound.comparison,
            Expression::Duration,
            bound.bound.clone(),
        ));
        format!("{name}, which `{label}` needs")
    };
    let Value::Known(value) = reading.expression(&bound.bound) else {
        return Err(NotDerived::Unknown(what()));
    };
    if value.as_number().is_some() && !subject.is_given {
        return Ok(Vec::new());
    }
    let difference = duration.minus(&value);
    let alternatives = compared(bound.comparison, &difference, false);
    Ok(failures(what, None, alternatives))
}

/// Collects the failures of a condition that has to hold throughout a step.
///
/// # Errors
/// When a number has no value or is not linear, or too many points can come before a moment or after it.
pub(super) fn throughout(
    subject: &Subject<'_>,
    histories: &Histories<'_>,
    distances: &mut Distances,
    (step, condition): (usize, &Condition),
) -> Result<Vec<Failure>, NotDerived> {
    let [start, end] = subject.ends[step];
    let read = Footprint::of_condition(subject.task, condition);
    let zero = Rational::ZERO;
    let (mut before, mut after, mut open) = (Vec::new(), Vec::new(), Vec::new());
    for (point, own) in subject.points.iter().enumerate() {
        if point == start || point == end || !own.writes(&read) {
            continue;
        }
        if distances.is_before(point, start, &zero)? {
            before.push(point);
        } else if distances.is_before(end, point, &zero)? {
            after.push(point);
        } else {
            open.push(point);
        }
    }
    open.sort_by_key(|&point| &subject.points[point].time);
    let name = &subject.steps[step].action.name;
    let what = || {
        let condition = subject.task.describe_condition(condition);
        format!("{condition}, an over-all condition of {name}")
    };
    let moment = subject.points.len();
    let planned = subject.steps[step].duration.clone().map(Linear::number);
    let mut found = Vec::new();
    for inside in sets(&open, distances, &what)? {
        let is_inside = |point: &usize| inside.contains(point);
        let (happened, coming): (Vec<usize>, Vec<usize>) =
            open.iter().partition(|own| is_inside(own));
        let place = Place {
            start,
            end,
            before: [&before[..], &happened].concat(),
            after: [&after[..], &coming].concat(),
        };
        let has_happened = |point: usize| point == start || place.before.contains(&point);
        let more = histories.at(
            &has_happened,
            Linear::time(moment),
            planned.clone(),
            &mut |reading| {
                if reading.holds(condition) == Ok(true) {
                    return Ok(Vec::new());
                }
                let alternatives = reading.alternatives(condition, false)?;
                Ok::<_, NotDerived>(failures(what, Some(&place), alternatives))
            },
        )?;
        found.extend(more);
    }
    Ok(found)
}

/// Returns the sets of points that can come before a moment while the others come after it: with each point
/// those that never come later.
fn sets(
    open: &[usize],
    distances: &mut Distances,
    what: &dyn Fn() -> String,
) -> Result<Vec<Vec<usize>>, NotDerived> {
    let mut sets: Vec<Vec<usize>> = vec![Vec::new()];
    for (place, &point) in open.iter().enumerate() {
        let (mut first, mut later) = (Vec::new(), Vec::new());
        for &other in &open[..place] {
            if distances.is_before(other, point, &Rational::ZERO)? {
                first.push(other);
            }
            if distances.is_before(point, other, &Rational::ZERO)? {
                later.push(other);
            }
        }
        let mut more = Vec::new();
        for set in sets {
            let with = first.iter().all(|other| set.contains(other));
            let without = !later.iter().any(|other| set.contains(other));
            if with {
                more.push([&set[..], &[point]].concat());
            }
            if without {
                more.push(set);
            }
        }
        sets = more;
        if sets.len() > MAX_SETS {
            return Err(NotDerived::Unknown(format!(
                "the order of events for {}",
                what()
            )));
        }
    }
    Ok(sets)
}
