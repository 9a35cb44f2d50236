//! Replacement of numbers by parameters.

use elbowroom_model::Task;
use elbowroom_model::problem::{Expression, Unknown};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{Bound, InstanceId, Node, Parameter, ParameterId, ParameterKind};

use super::{Nominal, Theme};
use crate::second_oracle::case::Gap;
use crate::second_oracle::numbers;

impl Nominal<'_> {
    /// Replaces one to four numbers by parameters or, if parameters are to be shared, puts one or
    /// two of them in up to five places.
    pub(super) fn open_numbers(&mut self) {
        let count = match self.theme {
            Theme::Shared => *self.dice.pick(&[2, 3, 4, 5]),
            _ => *self.dice.pick(&[1, 1, 2, 2, 3, 4]),
        };
        for _ in 0..count {
            let which = match self.theme {
                Theme::Shared => *self.dice.pick(&[0, 4, 4, 9, 9, 9, 9]),
                Theme::Timed if self.dice.chance(60) => 8,
                Theme::Rates if self.dice.chance(70) => 5,
                _ => self.dice.below(10),
            };
            match which {
                0..=3 => self.open_duration(),
                4 => self.open_bound(),
                5..=6 => self.open_constant(),
                7 => self.open_initial(),
                8 => self.open_timed(),
                _ => self.open_again(),
            }
        }
    }

    fn new_parameter(&mut self, kind: ParameterKind, nominal: &Rational) -> ParameterId {
        let id = ParameterId::from(self.case.parameters.len());
        self.case.parameters.push(Parameter {
            name: format!("q{}", id.0),
            kind,
            nominal: nominal.clone(),
            weight: Rational::ONE,
            range: match kind {
                ParameterKind::Duration(_) | ParameterKind::Timed(_) => kind.natural_range(nominal),
                _ => Interval::EVERYTHING,
            },
        });
        id
    }

    fn open_duration(&mut self) {
        let durations = self.durations();
        if durations.is_empty() {
            return;
        }
        let (index, duration) = self.dice.pick(&durations).clone();
        let id = InstanceId::from(index);
        let kind = ParameterKind::Duration(id);
        if self.case.parameters.iter().any(|p| p.kind == kind) {
            return;
        }
        let parameter = self.new_parameter(kind, &duration);
        let (from, to) = (Node::Start(id), Node::End(id));
        self.case
            .gaps
            .retain(|gap| (gap.from, gap.to) != (from, to));
        self.case.gaps.push(Gap {
            from,
            to,
            lower: Bound::Parameter(parameter),
            upper: Bound::Parameter(parameter),
        });
    }

    fn open_bound(&mut self) {
        if self.case.gaps.is_empty() {
            return;
        }
        let index = self.dice.below(self.case.gaps.len());
        let gap = self.case.gaps[index].clone();
        let is_lower = self.dice.chance(50);
        let bound = if is_lower { &gap.lower } else { &gap.upper };
        if let Bound::Finite(value) = bound {
            let parameter = self.new_parameter(ParameterKind::Bound, &value.clone());
            let gap = &mut self.case.gaps[index];
            let place = if is_lower {
                &mut gap.lower
            } else {
                &mut gap.upper
            };
            *place = Bound::Parameter(parameter);
        }
    }

    /// Opens one number in an action or the goal, or all numbers there that equal it.
    fn open_constant(&mut self) {
        let mut found = Vec::new();
        numbers::visit(&mut self.case.problem.clone(), &mut |leaf| {
            if let Expression::Constant(value) = leaf {
                found.push(value.clone());
            }
        });
        if found.is_empty() {
            return;
        }
        let chosen = self.dice.below(found.len());
        let everywhere = self.dice.chance(15);
        let value = found[chosen].clone();
        let parameter = self.new_parameter(ParameterKind::Domain, &value);
        let mut index = 0;
        numbers::visit(&mut self.case.problem, &mut |leaf| {
            if let Expression::Constant(other) = leaf {
                if index == chosen || (everywhere && *other == value) {
                    *leaf = Expression::Unknown(Unknown::Domain(parameter.0));
                }
                index += 1;
            }
        });
    }

    fn open_initial(&mut self) {
        let values = self.case.problem.initial_values.clone();
        if values.is_empty() {
            return;
        }
        let (function, _, value) = self.dice.pick(&values).clone();
        if self.case.initial.contains_key(&function) {
            return;
        }
        let fluent = Task::new(self.case.problem.clone()).find_fluent(function, &[]);
        let fluent = fluent.expect("it has a value");
        let parameter = self.new_parameter(ParameterKind::Initial(fluent), &value);
        self.case.initial.insert(function, parameter);
    }

    fn open_timed(&mut self) {
        let times = self.case.timed_times();
        if times.is_empty() {
            return;
        }
        let group = self.dice.below(times.len());
        if self.case.timed.contains_key(&group) {
            return;
        }
        let parameter = self.new_parameter(ParameterKind::Timed(group), &times[group]);
        self.case.timed.insert(group, parameter);
    }

    /// Puts an existing parameter in one more place, where its nominal value fits.
    fn open_again(&mut self) {
        if self.case.parameters.is_empty() {
            return;
        }
        let index = self.dice.below(self.case.parameters.len());
        let nominal = self.case.parameters[index].nominal.clone();
        let parameter = ParameterId::from(index);
        if self.dice.chance(40) {
            let mut done = false;
            numbers::visit(&mut self.case.problem, &mut |leaf| {
                if !done && matches!(leaf, Expression::Constant(value) if *value == nominal) {
                    *leaf = Expression::Unknown(Unknown::Domain(parameter.0));
                    done = true;
                }
            });
            if done {
                return;
            }
        }
        let nodes = self.nodes();
        let (mut from, mut to) = (*self.dice.pick(&nodes), *self.dice.pick(&nodes));
        let mut gap = &self.time(to) - &self.time(from);
        if gap.is_negative() {
            std::mem::swap(&mut from, &mut to);
            gap = -gap;
        }
        if from == to {
            return;
        }
        let (lower, upper) = match gap.cmp(&nominal) {
            std::cmp::Ordering::Less => (Bound::Infinite, Bound::Parameter(parameter)),
            std::cmp::Ordering::Greater => (Bound::Parameter(parameter), Bound::Infinite),
            std::cmp::Ordering::Equal => (Bound::Parameter(parameter), Bound::Parameter(parameter)),
        };
        self.case.gaps.push(Gap {
            from,
            to,
            lower,
            upper,
        });
    }
}
