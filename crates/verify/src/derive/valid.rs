//! Check that every schedule of a network is a valid plan.

use elbowroom_model::Footprint;
use elbowroom_model::ground::FactId;
use elbowroom_num::Rational;

use super::distances::Distances;
use super::failures::Failure;
use super::histories::Histories;
use super::linear::Inequality;
use super::numbers::Numbers;
use super::subject::{PointKind, Subject, is_condition_of_state};
use super::{NotDerived, failures};

/// Possible failures of conditions for which it was derived that no schedule with values in the box
/// has them.
pub(super) struct Refuted {
    /// Those of over-all conditions on numbers that vary.
    pub(super) conditions: Vec<Failure>,
    /// Interfering happenings that are too near to each other. The box contains the plan's own times, so it has
    /// a schedule with this failure if it has one with the other order.
    pub(super) separations: Vec<Failure>,
}

/// Checks separations and over-all conditions in all schedules, and returns their refuted failures.
///
/// # Errors
/// The first of them that does not follow from the network.
pub(super) fn check(
    subject: &Subject<'_>,
    histories: &Histories<'_>,
    numbers: &mut Numbers<'_>,
) -> Result<Refuted, NotDerived> {
    let mut checker = Checker { subject, numbers };
    let separations = checker.separations()?;
    let mut known = Vec::new();
    for (step, body) in subject.durative() {
        let [start, end] = subject.ends[step];
        if !checker.is_before(start, end, &Rational::ZERO)? {
            let what = format!("`{}` may come before its start", subject.label(end));
            return Err(NotDerived::differs(what));
        }
        for condition in body.over_all.conjuncts() {
            let literal = subject.literal(condition);
            if let Some(literal) = literal
                && checker.is_preserved(step, literal)?
            {
                continue;
            }
            let read = Footprint::of_condition(subject.task, condition);
            let mut fluents = read.reads_fluents.iter();
            let has_steps_alone = fluents.all(|fluent| histories.has_steps_alone(*fluent))
                && is_condition_of_state(condition);
            if has_steps_alone && checker.keeps_planned_values(step, &read)? {
                continue;
            }
            let failures =
                failures::throughout(subject, histories, checker.distances(), (step, condition))?;
            for failure in &failures {
                if !checker.numbers.refutes(failure)? {
                    let what = format!(
                        "in some schedules of the network, {} may fail",
                        failure.description
                    );
                    return Err(if literal.is_some() {
                        NotDerived::differs(what)
                    } else {
                        NotDerived::Unknown(what)
                    });
                }
            }
            known.extend(failures);
        }
    }
    Ok(Refuted {
        conditions: known,
        separations,
    })
}

struct Checker<'c, 'a> {
    subject: &'c Subject<'c>,
    numbers: &'c mut Numbers<'a>,
}

impl Checker<'_, '_> {
    fn distances(&mut self) -> &mut Distances {
        &mut self.numbers.distances
    }

    fn is_before(
        &mut self,
        earlier: usize,
        later: usize,
        least: &Rational,
    ) -> Result<bool, NotDerived> {
        Ok(self.distances().is_before(earlier, later, least)?)
    }

    /// Checks that interfering happenings are at least ε apart, in the order of the plan. Two groups of timed
    /// initials may be as near to each other as in the problem.
    fn separations(&mut self) -> Result<Vec<Failure>, NotDerived> {
        let subject = self.subject;
        let mut failures = Vec::new();
        let epsilon = subject.task.epsilon();
        for later in 1..subject.points.len() {
            for earlier in 1..later {
                let (one, other) = (&subject.points[earlier], &subject.points[later]);
                if !one.footprint.interferes_with(&other.footprint) {
                    continue;
                }
                let (first, second) = if one.time <= other.time {
                    (earlier, later)
                } else {
                    (later, earlier)
                };
                let are_timed = matches!(
                    (one.kind, other.kind),
                    (PointKind::Timed(_), PointKind::Timed(_))
                );
                let apart = (&one.time - &other.time).abs();
                let least = if are_timed {
                    apart.min(epsilon.clone())
                } else {
                    epsilon.clone()
                };
                if !self.is_before(first, second, &least)? {
                    let what = format!(
                        "in some schedules of the network, `{}` is not {epsilon} after `{}`, which it \
                         interferes with",
                        subject.label(second),
                        subject.label(first)
                    );
                    return Err(NotDerived::differs(what));
                }
                let [first, second] = [first, second].map(|point| self.numbers.places.time(point));
                let mut expression = second.minus(&first);
                expression.constant -= least;
                failures.push(Failure {
                    description: String::new(),
                    moment: None,
                    inequalities: vec![Inequality {
                        expression,
                        is_strict: true,
                    }],
                });
            }
        }
        Ok(failures)
    }

    /// Returns `true` if a fact keeps its wanted truth value throughout a step. It has the value initially, or
    /// a point no later than the start establishes it. All points that may change it come before that point,
    /// or after the end.
    fn is_preserved(
        &mut self,
        step: usize,
        (fact, wanted): (FactId, bool),
    ) -> Result<bool, NotDerived> {
        let subject = self.subject;
        let [start, end] = subject.ends[step];
        let spoils = |index: &usize| subject.points[*index].threatens(fact, wanted);
        let all = 1..subject.points.len();
        let mut spoiling = Vec::new();
        for point in all.clone().filter(spoils) {
            if point != end && !self.is_before(end, point, &Rational::ZERO)? {
                spoiling.push(point);
            }
        }
        if spoiling.is_empty() && subject.task.initial().facts.contains(&fact) == wanted {
            return Ok(true);
        }
        for since in all.filter(|index| subject.points[*index].establishes(fact, wanted)) {
            if since == end || (since != start && !self.is_before(since, start, &Rational::ZERO)?) {
                continue;
            }
            let mut is_since = true;
            for &point in &spoiling {
                is_since = is_since && self.is_before(point, since, &Rational::ZERO)?;
            }
            if is_since {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Returns `true` if the facts and fluents in `read` have the same sequence of values throughout a step
    /// as in the plan: each writer is before the action, after it, or inside it in a fixed order.
    fn keeps_planned_values(&mut self, step: usize, read: &Footprint) -> Result<bool, NotDerived> {
        let subject = self.subject;
        let [start, end] = subject.ends[step];
        let time = |point: usize| &subject.points[point].time;
        let zero = Rational::ZERO;
        // The validator does not check the interior of an action without duration.
        if time(start) == time(end) {
            return Ok(false);
        }
        let mut inside: Vec<usize> = Vec::new();
        for point in 1..subject.points.len() {
            if point == start || point == end || !subject.points[point].writes(read) {
                continue;
            }
            if self.is_before(point, start, &zero)? || self.is_before(end, point, &zero)? {
                continue;
            }
            let is_inside =
                self.is_before(start, point, &zero)? && self.is_before(point, end, &zero)?;
            // The validator has checked the states before and after a writer that is inside in the plan.
            if !is_inside || time(point) <= time(start) || time(point) >= time(end) {
                return Ok(false);
            }
            for &other in &inside {
                let (first, second) = if time(other) < time(point) {
                    (other, point)
                } else {
                    (point, other)
                };
                if time(first) == time(second) || !self.is_before(first, second, &zero)? {
                    return Ok(false);
                }
            }
            inside.push(point);
        }
        Ok(true)
    }
}
