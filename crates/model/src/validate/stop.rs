//! Results that stop the validation before the end of the plan.

use std::collections::BTreeSet;

use elbowroom_num::Rational;

use super::judge::Judge;
use super::piece::Break;
use super::reading::Fault;
use super::state::Now;
use super::timeline::{Group, What};
use super::violation::{
    ActionInstance, Difficulty, Mistake, Occurrence, Point, Undecided, Violation, When,
};
use crate::ground::{Change, Condition, DurationConstraint, Expression, FluentId};
use crate::task::Task;

/// Reason for the stop; boxed, because most calls succeed.
#[derive(Debug)]
pub(super) enum Stop {
    Violation(Box<Violation>),
    Undecided(Box<Undecided>),
}

impl Stop {
    pub(super) fn continuous_guard(task: &Task, time: &Rational, fluent: FluentId) -> Self {
        Self::Undecided(Box::new(Undecided {
            time: Some(time.clone()),
            difficulty: Difficulty::ContinuousGuard {
                fluent: task.fluent_name(fluent),
            },
        }))
    }

    /// Returns the stop with the happenings that make the violated condition true after it is read.
    pub(super) fn with_late_changes(mut self, late: Vec<Occurrence>) -> Self {
        if let Self::Violation(violation) = &mut self
            && let Mistake::Condition { too_late, .. } = &mut violation.mistake
        {
            *too_late = late;
        }
        self
    }
}

/// The expression being evaluated, and its moment.
pub(super) struct Place<'a> {
    time: &'a Rational,
    step: Option<usize>,
    subject: Subject<'a>,
}

enum Subject<'a> {
    Condition(When, &'a Condition),
    Bound(&'a DurationConstraint),
    Value(&'a Expression),
    Rate,
}

impl<'a> Place<'a> {
    pub(super) fn condition(
        time: &'a Rational,
        step: Option<usize>,
        when: When,
        condition: &'a Condition,
    ) -> Self {
        Self {
            time,
            step,
            subject: Subject::Condition(when, condition),
        }
    }

    pub(super) fn bound(time: &'a Rational, step: usize, bound: &'a DurationConstraint) -> Self {
        Self {
            time,
            step: Some(step),
            subject: Subject::Bound(bound),
        }
    }

    pub(super) fn effect(time: &'a Rational, step: Option<usize>, value: &'a Expression) -> Self {
        Self {
            time,
            step,
            subject: Subject::Value(value),
        }
    }

    pub(super) fn rate(time: &'a Rational, step: Option<usize>) -> Self {
        Self {
            time,
            step,
            subject: Subject::Rate,
        }
    }
}

impl<'a> Judge<'a> {
    /// Returns a violation of a step, or of the goal.
    pub(super) fn violation(&self, time: &Rational, step: Option<usize>, mistake: Mistake) -> Stop {
        let action = step.map(|position| self.instance(position));
        Stop::Violation(Box::new(Violation {
            time: time.clone(),
            action,
            mistake,
        }))
    }

    pub(super) fn instance(&self, position: usize) -> ActionInstance {
        ActionInstance::of(self.plan, position)
    }

    pub(super) fn occurrence(&self, what: What<'a>, time: &Rational) -> Occurrence {
        Occurrence {
            time: time.clone(),
            point: match what {
                What::Start(_) => Point::Start,
                What::End(_) => Point::End,
                What::Instant(_) => Point::Instant,
                What::Timed(_) => Point::Timed,
                What::Event(_) => Point::Event,
            },
            event: match what {
                What::Event(event) => Some(self.task.autonomous().events[event].name.clone()),
                _ => None,
            },
            action: what.step().map(|position| self.instance(position)),
        }
    }

    /// Returns the violation for a condition at `place` that is false in the state `then`; for
    /// over-all conditions, from the moment `broken` on.
    pub(super) fn fails(&self, place: &Place<'_>, then: &Now, broken: Option<&Break>) -> Stop {
        let Subject::Condition(when, condition) = place.subject else {
            unreachable!("only conditions fail");
        };
        let time = match broken {
            Some(broken) => place.time + &broken.at,
            None => place.time.clone(),
        };
        let mistake = Mistake::Condition {
            when,
            condition: self.as_written(condition, place.step),
            is_after: broken.is_some_and(|broken| broken.is_after),
            is_exact: broken.is_none_or(|broken| broken.is_exact),
            reasons: self.explain(condition, then, (place.step, when)),
            too_late: Vec::new(),
        };
        self.violation(&time, place.step, mistake)
    }

    /// Returns the happenings of the group that may make a condition true which is false on arrival.
    pub(super) fn late_changes(&self, condition: &Condition, group: &Group<'a>) -> Vec<Occurrence> {
        let happenings = group.happenings.iter();
        let late = happenings.filter(|own| self.may_make_true(own.what, condition));
        late.map(|own| self.occurrence(own.what, &own.time))
            .collect()
    }

    /// Returns `true` if an effect of the happening can make the false condition true.
    fn may_make_true(&self, what: What<'a>, condition: &Condition) -> bool {
        let literal = match condition {
            Condition::Fact(fact) => Some((*fact, true)),
            Condition::Not(part) => match **part {
                Condition::Fact(fact) => Some((fact, false)),
                _ => None,
            },
            _ => None,
        };
        let literal = literal.filter(|(fact, _)| !self.task.is_derived(*fact));
        let (mut facts, mut fluents) = (BTreeSet::new(), BTreeSet::new());
        self.task.visit_facts_of(condition, &mut |fact| {
            facts.insert(fact);
        });
        self.task.visit_fluents_of(condition, &mut |fluent| {
            fluents.insert(fluent);
        });
        let suits = |change: &Change| match (change, literal) {
            (Change::Add(fact), Some(wanted)) => wanted == (*fact, true),
            (Change::Delete(fact), Some(wanted)) => wanted == (*fact, false),
            (Change::Add(fact) | Change::Delete(fact), None) => facts.contains(fact),
            (Change::Update { fluent, .. }, _) => fluents.contains(fluent),
        };
        if let What::Timed(timed) = what {
            timed.changes.iter().any(suits)
        } else {
            let effects = self.snap(what).into_iter().flat_map(|snap| &snap.effects);
            effects.map(|effect| &effect.change).any(suits)
        }
    }

    /// Returns the condition of a step, or the goal, in PDDL notation.
    fn as_written(&self, condition: &Condition, step: Option<usize>) -> String {
        let action = step.map(|position| &*self.plan.steps[position].action);
        self.task.describe_condition_of(action, condition)
    }

    /// Converts a fault to a violation or an undecided result.
    pub(super) fn stop(&self, fault: Fault, place: &Place<'_>) -> Stop {
        let within = match place.subject {
            Subject::Condition(_, condition) => self.task.describe_condition(condition),
            Subject::Bound(bound) => format!(
                "the duration bound {}",
                self.task.describe_expression(&bound.bound)
            ),
            Subject::Value(value) => format!(
                "the effect's value {}",
                self.task.describe_expression(value)
            ),
            Subject::Rate => "a rate of continuous change".to_owned(),
        };
        let difficulty = match fault {
            Fault::Undefined(fluent) => {
                let fluent = self.task.fluent_name(fluent);
                let mistake = Mistake::Undefined { fluent, within };
                return self.violation(place.time, place.step, mistake);
            }
            Fault::DivisionByZero(divisor) => {
                let divisor = self.task.describe_expression(&divisor);
                let mistake = Mistake::DivisionByZero { divisor, within };
                return self.violation(place.time, place.step, mistake);
            }
            Fault::Open(unknown) => Difficulty::Open {
                unknown: self.task.describe_unknown(unknown),
                within,
            },
            Fault::Misplaced(expression) => Difficulty::Misplaced {
                expression: self.task.describe_expression(&expression),
                within,
            },
            Fault::Quotient(divisor) => Difficulty::Quotient {
                divisor: self.task.describe_expression(&divisor),
                within,
            },
            Fault::Irrational(fluent) => Difficulty::Irrational {
                fluent: self.task.fluent_name(fluent),
                within,
            },
            Fault::Circular(fluent) => Difficulty::Nonlinear {
                fluent: self.task.fluent_name(fluent),
            },
        };
        Stop::Undecided(Box::new(Undecided {
            time: Some(place.time.clone()),
            difficulty,
        }))
    }
}
