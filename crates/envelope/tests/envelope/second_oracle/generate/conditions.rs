//! Conditions and duration bounds that hold in the nominal schedule.

use elbowroom_model::Problem;
use elbowroom_model::problem::{Body, Comparison, Condition, DurationConstraint, Expression};
use elbowroom_model::validate::Verdict;
use elbowroom_num::Rational;
use elbowroom_plan::Valuation;

use super::skeleton::{constant, fact, fluent};
use super::{Nominal, Theme};

/// The place of a condition in an action, or the goal.
#[derive(Clone, Copy)]
enum Place {
    Start(usize),
    OverAll(usize),
    End(usize),
    Goal,
}

impl Nominal<'_> {
    /// Adds conditions that hold in the nominal schedule, and sometimes one that does not.
    pub(super) fn add_conditions(&mut self) {
        let mut places = vec![Place::Goal, Place::Goal];
        for (index, schema) in self.case.problem.schemas.iter().enumerate() {
            places.push(Place::Start(index));
            if matches!(schema.body, Body::Durative { .. }) {
                places.extend([Place::OverAll(index), Place::OverAll(index)]);
                places.push(Place::End(index));
            }
        }
        for place in places {
            for _ in 0..*self.dice.pick(&[0, 0, 1, 1, 1]) {
                for _ in 0..4 {
                    let mut candidate = self.case.clone();
                    let condition = self.condition(place);
                    add(&mut candidate.problem, place, condition);
                    if self.works(&candidate) || self.dice.chance(1) {
                        self.case = candidate;
                        break;
                    }
                }
            }
        }
    }

    fn condition(&mut self, place: Place) -> Condition {
        let compound = if self.theme == Theme::Timed { 4 } else { 10 };
        match self.dice.below(compound) {
            0 => Condition::Or(vec![self.simple(place), self.simple(place)]),
            1 => {
                let parts = vec![self.simple(place), self.simple(place)];
                let part = if self.dice.chance(50) {
                    Condition::Or(parts)
                } else {
                    Condition::And(parts)
                };
                Condition::Not(Box::new(part))
            }
            _ => self.simple(place),
        }
    }

    fn simple(&mut self, place: Place) -> Condition {
        let (facts, fluents) = (
            self.case.problem.predicates.len(),
            self.case.problem.functions.len(),
        );
        if self.dice.chance(40) {
            return fact(self.dice, facts);
        }
        let first = Expression::Fluent(fluent(self.dice.below(fluents)));
        let left = match self.dice.below(6) {
            0 if fluents > 1 => {
                let second = Expression::Fluent(fluent(1 - self.dice.below(2)));
                if self.dice.chance(50) {
                    Expression::Add(vec![first, second])
                } else {
                    Expression::Subtract(Box::new(first), Box::new(second))
                }
            }
            1 if self.dice.chance(20) => {
                Expression::Divide(Box::new(first), Box::new(constant(self.dice.half(1, 3))))
            }
            1 if self.has_duration(place) => {
                Expression::Subtract(Box::new(first), Box::new(Expression::Duration))
            }
            _ => first,
        };
        let (comparison, right) = self.near(place, &left);
        Condition::Compare(comparison, left, constant(right))
    }

    fn has_duration(&self, place: Place) -> bool {
        match place {
            Place::Goal => false,
            Place::Start(index) | Place::OverAll(index) | Place::End(index) => {
                matches!(self.case.problem.schemas[index].body, Body::Durative { .. })
            }
        }
    }

    /// Returns a comparison that holds by a small margin, as far as the validator can compute the
    /// value.
    fn near(&mut self, place: Place, left: &Expression) -> (Comparison, Rational) {
        let comparison = *self.dice.pick(&[
            Comparison::AtLeast,
            Comparison::AtLeast,
            Comparison::Greater,
            Comparison::AtMost,
            Comparison::AtMost,
            Comparison::Less,
            Comparison::Equal,
        ]);
        let is_upper = matches!(comparison, Comparison::AtMost | Comparison::Less);
        let far = Rational::from(if is_upper { 10_000 } else { -10_000 });
        let asked = if is_upper {
            Comparison::AtMost
        } else {
            Comparison::AtLeast
        };
        let mut probe = self.case.clone();
        let condition = Condition::Compare(asked, left.clone(), constant(far.clone()));
        add(&mut probe.problem, place, condition);
        let valuation = Valuation::default();
        let Verdict::Valid(report) = probe.validate(&valuation, &self.schedule) else {
            return (comparison, self.dice.half(0, 10));
        };
        let margins = report.margins.iter().map(|margin| &margin.margin);
        let huge = margins.filter(|margin| **margin > Rational::from(5000));
        let Some(margin) = huge.min() else {
            return (comparison, self.dice.half(0, 10));
        };
        let slack = match comparison {
            Comparison::Equal => Rational::ZERO,
            _ => self
                .dice
                .pick(&[
                    Rational::ZERO,
                    Rational::new(1, 2),
                    Rational::ONE,
                    Rational::from(3),
                ])
                .clone(),
        };
        let right = if is_upper {
            far - margin + slack
        } else {
            far + margin - slack
        };
        (comparison, right)
    }

    /// Adds bounds on durations, as domains have them.
    pub(super) fn add_durations(&mut self) {
        let starts: Vec<_> = self.durations();
        for (index, duration) in starts {
            let limit = |comparison, bound| DurationConstraint {
                comparison,
                bound,
                at_end: false,
            };
            let slack = self.dice.half(0, 4);
            let fluents = self.case.problem.functions.len();
            let mut limits = match self.dice.below(8) {
                0..=3 => vec![limit(Comparison::Equal, constant(duration.clone()))],
                4 => vec![
                    limit(Comparison::AtLeast, constant(&duration - &slack)),
                    limit(Comparison::AtMost, constant(&duration + &slack)),
                ],
                5 => {
                    let bound = Expression::Fluent(fluent(self.dice.below(fluents)));
                    vec![limit(Comparison::AtMost, bound)]
                }
                6 => vec![limit(Comparison::AtMost, constant(&duration + &slack))],
                _ => Vec::new(),
            };
            if self.dice.chance(15) {
                for limit in &mut limits {
                    limit.at_end = true;
                }
            }
            let mut candidate = self.case.clone();
            set_duration(&mut candidate.problem, index, limits);
            if !self.works(&candidate) {
                let exact = limit(Comparison::Equal, constant(duration));
                set_duration(&mut candidate.problem, index, vec![exact]);
            }
            self.case = candidate;
        }
    }
}

fn add(problem: &mut Problem, place: Place, condition: Condition) {
    let target = match place {
        Place::Goal => &mut problem.goal,
        Place::Start(index) => match &mut problem.schemas[index].body {
            Body::Instantaneous { condition, .. } => condition,
            Body::Durative { at_start, .. } => at_start,
        },
        Place::OverAll(index) | Place::End(index) => match &mut problem.schemas[index].body {
            Body::Durative {
                over_all, at_end, ..
            } => {
                if matches!(place, Place::OverAll(_)) {
                    over_all
                } else {
                    at_end
                }
            }
            Body::Instantaneous { .. } => unreachable!("only durative actions have these"),
        },
    };
    if let Condition::And(parts) = target {
        parts.push(condition);
    }
}

fn set_duration(problem: &mut Problem, index: usize, limits: Vec<DurationConstraint>) {
    if let Body::Durative { duration, .. } = &mut problem.schemas[index].body {
        *duration = limits;
    }
}
