//! Check that the plan has each constraint of a certificate's network, and that no duration and no time
//! of timed initials is missing.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Footprint;
use elbowroom_num::Rational;

use super::histories::Histories;
use super::subject::{Point, PointKind, Subject};
use super::trajectory::TrajectoryDerivation;
use super::{NotDerived, Quantity};
use crate::certificate::{Certificate, Constraint, Guarantee, Limit, Part, Proof};

/// Returns the quantities of the parameters, each once.
///
/// # Errors
/// The first constraint that the plan does not have, missing duration or time, or unused parameter.
pub(super) fn check(
    certificate: &Certificate,
    histories: &Histories<'_>,
    course: &TrajectoryDerivation,
) -> Result<Vec<Quantity>, NotDerived> {
    let subject = histories.subject;
    let mut reader = Reader {
        certificate,
        histories,
        subject,
        sides: sides(subject),
        set: BTreeSet::new(),
        narrowed: Vec::new(),
        quantities: BTreeMap::new(),
    };
    for (index, constraint) in certificate.constraints.iter().enumerate() {
        let is_needed =
            reader.sets(constraint)? || reader.orders(constraint) || course.implies(constraint);
        if !is_needed && !reader.fixes_controllable_duration(index) {
            let [from, to] = [constraint.from, constraint.to].map(|point| reader.name(point));
            let what = format!(
                "constraint {index}, from `{from}` to `{to}`, is not a constraint \
                                of the plan"
            );
            return Err(if subject.is_plain {
                NotDerived::differs(what)
            } else {
                NotDerived::Unknown(what)
            });
        }
    }
    reader.proofs_leave_out_narrowed()?;
    let durations = subject.durative().map(|(step, _)| subject.ends[step][1]);
    let timed = |point: &usize| matches!(subject.points[*point].kind, PointKind::Timed(_));
    let timed = (0..subject.points.len()).filter(timed);
    for point in durations.chain(timed) {
        if !reader.set.contains(&point) {
            let what = format!(
                "no constraint defines the time of `{}`",
                subject.label(point)
            );
            return Err(NotDerived::differs(what));
        }
    }
    for (index, parameter) in certificate.parameters.iter().enumerate() {
        let mut initials = subject.initials.values();
        let is_initial = initials.any(|own| *own == index);
        let is_time = reader.quantities.contains_key(&index);
        if is_initial && is_time {
            let what = format!("{}, which denotes several quantities", parameter.name);
            return Err(NotDerived::Unknown(what));
        }
        if !is_initial && !is_time {
            let what = format!("nothing in the plan depends on {}", parameter.name);
            return Err(NotDerived::differs(what));
        }
    }
    Ok(reader.quantities.into_values().collect())
}

struct Reader<'a> {
    certificate: &'a Certificate,
    histories: &'a Histories<'a>,
    subject: &'a Subject<'a>,
    /// Orders that over-all conditions need: the second point does not come before the first.
    sides: BTreeSet<(usize, usize)>,
    /// Ends of actions and timed initials that a constraint has set.
    set: BTreeSet<usize>,
    /// Constraints that keep a duration at the planned one where the domain leaves a choice.
    narrowed: Vec<usize>,
    quantities: BTreeMap<usize, Quantity>,
}

impl Reader<'_> {
    fn name(&self, point: usize) -> String {
        let points = &self.certificate.points;
        points.get(point).cloned().unwrap_or_default()
    }

    /// Returns `true` if the constraint sets an action's duration or the time of timed initials, as the
    /// plan and the domain have it, and is the first to do so.
    fn sets(&mut self, constraint: &Constraint) -> Result<bool, NotDerived> {
        let subject = self.subject;
        let what = |point: usize| subject.points.get(point).map(|own| own.kind);
        let (step, planned) = match (what(constraint.from), what(constraint.to)) {
            (Some(PointKind::Start(start)), Some(PointKind::End(end))) if start == end => {
                let step = subject.steps[start];
                (Some(start), step.duration.clone().unwrap_or_default())
            }
            (Some(PointKind::Zero), Some(PointKind::Timed(_))) => {
                (None, subject.points[constraint.to].time.clone())
            }
            _ => return Ok(false),
        };
        let is_weak = self.certificate.guarantee == Guarantee::Weak;
        let is_set = match (&constraint.lower, &constraint.upper) {
            (Limit::Parameter(lower), Limit::Parameter(upper)) if lower == upper => {
                self.quantity(*lower, constraint.to, &planned)?;
                constraint.observed != is_weak
            }
            _ if constraint.observed => false,
            bounds => {
                // The executor chooses other durations only with the weak guarantee.
                let body = step.zip(step.and_then(|step| self.body(step)));
                let (least, most) = match body.filter(|_| is_weak) {
                    None => (planned.clone(), Some(planned)),
                    Some((step, body)) => {
                        let (least, most) = subject.allowed(step, body, self.histories)?;
                        let is_chosen = most.as_ref() != Some(&least)
                            && !self.certificate.constraints.iter().any(|own| {
                                (own.from, own.to) == (constraint.from, constraint.to)
                                    && self.is_as_planned(own)
                            });
                        if is_chosen && Subject::reads_duration_early(body) {
                            let name = &subject.steps[step].action.name;
                            let what = format!("an effect that depends on the duration of {name}");
                            return Err(NotDerived::Unknown(what));
                        }
                        (least, most)
                    }
                };
                let most = most.map_or(Limit::None, |most| Limit::Number(crate::Exact(most)));
                *bounds.0 == Limit::Number(crate::Exact(least)) && *bounds.1 == most
            }
        };
        if !is_set {
            return Ok(false);
        }
        let is_first = self.set.insert(constraint.to);
        Ok(is_first || self.is_repeated(constraint))
    }

    /// Returns `true` if the constraint sets a duration to the planned one.
    fn is_as_planned(&self, constraint: &Constraint) -> bool {
        let what = |point: usize| self.subject.points.get(point).map(|own| own.kind);
        let (Some(PointKind::Start(start)), Some(PointKind::End(end))) =
            (what(constraint.from), what(constraint.to))
        else {
            return false;
        };
        let planned = self.subject.steps[start].duration.clone();
        let planned = Limit::Number(crate::Exact(planned.unwrap_or_default()));
        start == end
            && !constraint.observed
            && constraint.lower == planned
            && constraint.upper == planned
    }

    /// Returns `true` if the constraint keeps a duration that the executor could choose at the planned one. Schedules
    /// of the network are some of all schedules then, so the box is inside the envelope if these are enough.
    fn fixes_controllable_duration(&mut self, index: usize) -> bool {
        let constraint = &self.certificate.constraints[index];
        let is_weak = self.certificate.guarantee == Guarantee::Weak;
        if !is_weak || !self.is_as_planned(constraint) {
            return false;
        }
        self.set.insert(constraint.to);
        self.narrowed.push(index);
        true
    }

    /// Checks that no proof about other boxes uses a constraint that all schedules need not satisfy.
    fn proofs_leave_out_narrowed(&self) -> Result<(), NotDerived> {
        let Some(&first) = self.narrowed.first() else {
            return Ok(());
        };
        let is_other = |part: &Part| match part {
            Part::Least(index) | Part::Most(index) => !self.narrowed.contains(index),
            _ => matches!(part, Part::Beginning(_)),
        };
        let mut proofs = self.certificate.proofs.iter();
        let are_others = proofs.all(|proof| match proof {
            Proof::Cycle(parts) => parts.iter().all(is_other),
            _ => false,
        });
        if are_others {
            return Ok(());
        }
        let constraint = &self.certificate.constraints[first];
        let what = format!(
            "an inequality that may hold only for the nominal duration from `{}` to `{}`",
            self.name(constraint.from),
            self.name(constraint.to)
        );
        Err(NotDerived::Unknown(what))
    }

    /// Returns `true` if all constraints that set the same difference set it to numbers. Those are equal then.
    fn is_repeated(&self, constraint: &Constraint) -> bool {
        let between = self.certificate.constraints.iter().filter(|own| {
            own.from == constraint.from && own.to == constraint.to && own.upper != Limit::None
        });
        let mut limits = between.flat_map(|own| [&own.lower, &own.upper]);
        limits.all(|limit| matches!(limit, Limit::Number(_)))
    }

    fn body(&self, step: usize) -> Option<&elbowroom_model::ground::DurativeBody> {
        self.subject.steps[step].action.durative()
    }

    /// Records the quantity of a parameter that sets the time of an end of an action or of timed initials.
    fn quantity(
        &mut self,
        parameter: usize,
        point: usize,
        planned: &Rational,
    ) -> Result<(), NotDerived> {
        let Some(own) = self.certificate.parameters.get(parameter) else {
            return Err(NotDerived::differs(format!(
                "there is no parameter {parameter}"
            )));
        };
        if own.nominal != *planned {
            let what = format!(
                "the nominal value of {} is {}, and the plan has {planned}",
                own.name, own.nominal
            );
            return Err(NotDerived::differs(what));
        }
        let (step, group) = match self.subject.points[point].kind {
            PointKind::Timed(group) => (None, Some(group)),
            PointKind::Start(step) | PointKind::Instant(step) | PointKind::End(step) => {
                (Some(step), None)
            }
            PointKind::Zero => (None, None),
        };
        let action = step.map(|step| self.subject.steps[step].action.name.clone());
        let kind = if step.is_some() { "duration" } else { "timed" };
        let quantity = Quantity {
            parameter,
            kind,
            step,
            group,
            action,
        };
        if self.quantities.insert(parameter, quantity).is_some() {
            let what = format!("{}, which denotes several quantities", own.name);
            return Err(NotDerived::Unknown(what));
        }
        Ok(())
    }

    /// Returns `true` if the constraint keeps an order that the plan has.
    fn orders(&self, constraint: &Constraint) -> bool {
        let &Constraint { from, to, .. } = constraint;
        let Limit::Number(least) = &constraint.lower else {
            return false;
        };
        if constraint.upper != Limit::None || constraint.observed || from == to {
            return false;
        }
        let points = &self.subject.points;
        let (Some(first), Some(second)) = (points.get(from), points.get(to)) else {
            return false;
        };
        let are_timed = matches!(
            (first.kind, second.kind),
            (PointKind::Timed(_), PointKind::Timed(_))
        );
        let interfere =
            first.time < second.time && first.footprint.interferes_with(&second.footprint);
        // Timed initials may be as near to each other as in the problem.
        let mut apart = self.subject.task.epsilon().clone();
        if are_timed {
            apart = apart.min(&second.time - &first.time);
        }
        let keeps_apart =
            self.sides.contains(&(from, to)) || self.is_end_before_next_start(first, second);
        (interfere && least.0 <= apart) || (keeps_apart && least.0 <= Rational::ZERO)
    }

    /// Returns `true` if the first point ends an instance of an action, and the second one starts another instance
    /// of the same action, no earlier.
    fn is_end_before_next_start(&self, first: &Point, second: &Point) -> bool {
        let (PointKind::End(ended), PointKind::Start(started)) = (first.kind, second.kind) else {
            return false;
        };
        // The end of an action without duration is no later than its own start, but need not be.
        let are_two = ended != started;
        let [ended, started] = [ended, started].map(|step| &self.subject.steps[step].action);
        are_two
            && first.time <= second.time
            && (ended.schema, &ended.arguments) == (started.schema, &started.arguments)
    }
}

/// Returns the orders, as in the plan, of actions and the writers that their over-all conditions depend
/// on.
fn sides(subject: &Subject<'_>) -> BTreeSet<(usize, usize)> {
    let mut sides = BTreeSet::new();
    for (step, body) in subject.durative() {
        for condition in body.over_all.conjuncts() {
            let read = Footprint::of_condition(subject.task, condition);
            match subject.literal(condition) {
                Some(literal) => keep_true(subject, step, literal, &mut sides),
                None => keep_sides(subject, step, &read, &mut sides),
            }
        }
    }
    sides
}

/// Adds the orders that keep each writer before the action, inside it, or after it.
fn keep_sides(
    subject: &Subject<'_>,
    step: usize,
    read: &Footprint,
    sides: &mut BTreeSet<(usize, usize)>,
) {
    let [start, end] = subject.ends[step];
    let [begin, finish] = [start, end].map(|point| &subject.points[point].time);
    for (index, point) in subject.points.iter().enumerate() {
        if index == start || index == end || !point.writes(read) {
            continue;
        }
        if point.time <= *begin {
            sides.insert((index, start));
        } else if point.time < *finish {
            sides.extend([(start, index), (index, end)]);
        } else {
            sides.insert((end, index));
        }
    }
}

/// Adds the orders that keep a fact at its wanted truth value throughout the action. If the value must be
/// established first, the first point that does so lastingly comes before the action. If none does, because an
/// action of duration 0 does not need the value, all earlier points that change it stay before the action. Later
/// points that change it come after the action.
fn keep_true(
    subject: &Subject<'_>,
    step: usize,
    (fact, wanted): (elbowroom_model::ground::FactId, bool),
    sides: &mut BTreeSet<(usize, usize)>,
) {
    let [start, end] = subject.ends[step];
    let begin = &subject.points[start].time;
    let is_writer = |index: &usize| {
        let own = &subject.points[*index].footprint;
        own.adds.contains(&fact) || own.deletes.contains(&fact)
    };
    let mut writers: Vec<usize> = (0..subject.points.len()).filter(is_writer).collect();
    writers.sort_by_key(|&index| &subject.points[index].time);
    let makes_so = |index: &usize| {
        let adds = &subject.points[*index].footprint.adds;
        adds.contains(&fact) == wanted
    };
    let is_before = |index: &usize| subject.points[*index].time <= *begin;
    let (before, after) = writers.split_at(writers.partition_point(is_before));
    let spoilt = before.iter().rposition(|index| !makes_so(index));
    let is_so_at_first = subject.task.initial().facts.contains(&fact) == wanted;
    let serving = &before[spoilt.map_or(0, |position| position + 1)..];
    let is_needed = spoilt.is_some() || !is_so_at_first;
    if is_needed
        && !serving.contains(&start)
        && let Some(&first) = serving.first()
    {
        let time = &subject.points[first].time;
        let together = serving
            .iter()
            .filter(|index| subject.points[**index].time == *time);
        sides.extend(together.map(|&index| (index, start)));
    }
    // The action takes no time then, so nothing reads the value. If a writer before it came later, or if its own end
    // came after its start, the value would be needed.
    if is_needed && serving.is_empty() {
        let writers = before.iter().filter(|index| **index != start);
        sides.extend(writers.map(|&index| (index, start)));
    }
    let spoiling = after
        .iter()
        .filter(|index| !makes_so(index) && **index != end);
    sides.extend(spoiling.map(|&index| (end, index)));
}
