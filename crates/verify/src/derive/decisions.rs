//! Conditions of effects that depend on times or parameters: [`Decision`].

use std::collections::BTreeSet;

use elbowroom_model::ground::{Body, Condition};

use super::NotDerived;
use super::distances::Distances;
use super::failures::Failure;
use super::histories::{Histories, Undetermined};
use super::linear::Inequality;
use super::subject::PointKind;

/// A condition of an effect: the point, the position of the effect there, and the part of the condition.
pub(super) type GuardId = (usize, usize, usize);

/// A condition of an effect that depends on times or parameters, and has in these histories the truth value that it has
/// at the plan's own times and nominal values.
pub(super) struct Decision {
    pub(super) id: GuardId,
    /// The alternatives for the other truth value.
    pub(super) otherwise: Vec<Failure>,
}

/// The limit on decisions whose opposites are all tried.
const MAX_DECISIONS: usize = 6;

impl Histories<'_> {
    /// Returns `true` if no plan with other decisions is valid at any times: in each schedule some
    /// condition of a happening, or the goal, is false.
    ///
    /// So a box that has values with another decision is not inside the envelope: between these
    /// values and the plan's own times, some decisions change first.
    pub(super) fn needs_decisions(&self, widest: &mut Distances) -> bool {
        let known: BTreeSet<GuardId> = self.decisions.iter().map(|own| own.id).collect();
        if known.len() > MAX_DECISIONS {
            return false;
        }
        let known: Vec<GuardId> = known.into_iter().collect();
        (1..1_usize << known.len()).all(|set| {
            let is_in = |place: &usize| set & (1 << place) != 0;
            let flipped = (0..known.len()).filter(is_in).map(|place| known[place]);
            let flipped = (self.nominal.clone(), flipped.collect());
            let other = Self::with(self.subject, self.places, widest, flipped);
            other.is_ok_and(|other| {
                let mut decisions = other.decisions.iter();
                decisions.all(|own| known.contains(&own.id)) && other.always_fails()
            })
        })
    }

    /// Returns `true` if a condition of a happening, or the goal, is false in all schedules.
    fn always_fails(&self) -> bool {
        let subject = self.subject;
        let fails = |point: usize| {
            let condition = match subject.points[point].kind {
                PointKind::Zero | PointKind::Timed(_) => return false,
                PointKind::Instant(step) | PointKind::Start(step) => {
                    match &subject.steps[step].action.body {
                        Body::Instantaneous(snap) => &snap.condition,
                        Body::Durative(body) => &body.start.condition,
                    }
                }
                PointKind::End(step) => match &subject.steps[step].action.body {
                    Body::Instantaneous(_) => return false,
                    Body::Durative(body) => &body.end.condition,
                },
            };
            self.arrival(point, &mut |reading| reading.holds(condition)) == Ok(false)
        };
        (0..subject.points.len()).any(fails)
            || self.finally(&mut |reading| reading.holds(subject.task.goal())) == Ok(false)
    }

    /// Returns the truth of a condition of an effect, in all schedules or as decided.
    pub(super) fn decide(
        &mut self,
        id: GuardId,
        (condition, at): (&Condition, usize),
        name: &str,
    ) -> Result<bool, NotDerived> {
        let what = || {
            let condition = self.subject.task.describe_condition(condition);
            format!("the condition {condition} of a conditional effect of {name}")
        };
        let found = self.arrival(at, &mut |reading| match reading.holds(condition) {
            Ok(truth) => Ok(Err(truth)),
            Err(Undetermined::Undefined) => Err(NotDerived::Unknown(what())),
            Err(Undetermined::Varying) => {
                let ways = [false, true].map(|wanted| reading.alternatives(condition, wanted));
                let [no, yes] = ways;
                let ways = no.and_then(|no| Ok([no, yes?]));
                ways.map(Ok).map_err(|_| NotDerived::Unknown(what()))
            }
        })?;
        let [no, yes] = match found {
            Err(truth) => return Ok(truth),
            Ok(ways) => ways,
        };
        let holds = |way: &Vec<Inequality>| way.iter().all(|own| self.holds_in_plan(own));
        let is_so = yes.iter().any(holds);
        let other = if is_so { no } else { yes };
        let otherwise = other.into_iter().map(|inequalities| Failure {
            description: what(),
            moment: None,
            inequalities,
        });
        let otherwise = otherwise.collect();
        self.decisions.push(Decision { id, otherwise });
        Ok(is_so != self.flipped.contains(&id))
    }

    /// Returns `true` if an inequality holds at the plan's own times and nominal values.
    fn holds_in_plan(&self, inequality: &Inequality) -> bool {
        let expression = &inequality.expression;
        let mut value = expression.constant.clone();
        for (point, factor) in &expression.times {
            value += &self.subject.points[*point].time * factor;
        }
        for (parameter, factor) in &expression.parameters {
            value += &self.nominal[*parameter] * factor;
        }
        value.is_negative() || (value.is_zero() && !inequality.is_strict)
    }
}
