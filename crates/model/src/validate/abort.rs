//! Results that stop the validation before the end of the plan.

use std::collections::BTreeSet;

use elbowroom_num::Rational;

use super::evaluate::Fault;
use super::judge::Judge;
use super::segment::Falsification;
use super::state::BasicState;
use super::timeline::{Group, HappeningKind};
use super::violation::{
    ActionInstance, ConditionTime, Occurrence, Point, Undecided, UndecidedReason, Violation,
    ViolationKind,
};
use crate::ground::{Change, Condition, DurationConstraint, Expression, FluentId};
use crate::task::Task;

/// Reason for the stop; boxed, because most calls succeed.
#[derive(Debug)]
pub(super) enum Abort {
    Violation(Box<Violation>),
    Undecided(Box<Undecided>),
}

impl Abort {
    pub(super) fn continuous_guard(task: &Task, time: &Rational, fluent: FluentId) -> Self {
        Self::Undecided(Box::new(Undecided {
            time: Some(time.clone()),
            reason: UndecidedReason::ContinuousGuard {
                fluent: task.fluent_name(fluent),
            },
        }))
    }

    /// Returns the stop with the happenings that make the violated condition true after it is read.
    pub(super) fn with_late_changes(mut self, late: Vec<Occurrence>) -> Self {
        if let Self::Violation(violation) = &mut self
            && let ViolationKind::Condition { too_late, .. } = &mut violation.kind
        {
            *too_late = late;
        }
        self
    }
}

/// The expression being evaluated, and its moment.
pub(super) struct EvaluationContext<'a> {
    time: &'a Rational,
    step: Option<usize>,
    subject: Subject<'a>,
}

enum Subject<'a> {
    Condition(ConditionTime, &'a Condition),
    Bound(&'a DurationConstraint),
    Value(&'a Expression),
    Rate,
}

impl<'a> EvaluationContext<'a> {
    pub(super) fn condition(
        time: &'a Rational,
        step: Option<usize>,
        when: ConditionTime,
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
    pub(super) fn violation(
        &self,
        time: &Rational,
        step: Option<usize>,
        mistake: ViolationKind,
    ) -> Abort {
        let action = step.map(|position| self.instance(position));
        Abort::Violation(Box::new(Violation {
            time: time.clone(),
            action,
            kind: mistake,
        }))
    }

    pub(super) fn instance(&self, position: usize) -> ActionInstance {
        ActionInstance::of(self.plan, position)
    }

    pub(super) fn occurrence(&self, what: HappeningKind<'a>, time: &Rational) -> Occurrence {
        Occurrence {
            time: time.clone(),
            point: match what {
                HappeningKind::Start(_) => Point::Start,
                HappeningKind::End(_) => Point::End,
                HappeningKind::Instant(_) => Point::Instant,
                HappeningKind::Timed(_) => Point::Timed,
                HappeningKind::Event(_) => Point::Event,
            },
            event: match what {
                HappeningKind::Event(event) => {
                    Some(self.task.autonomous().events[event].name.clone())
                }
                _ => None,
            },
            action: what.step().map(|position| self.instance(position)),
        }
    }

    /// Returns the violation for a condition at `place` that is false in the state `then`; for
    /// over-all conditions, from the moment `broken` on.
    pub(super) fn fails(
        &self,
        place: &EvaluationContext<'_>,
        then: &BasicState,
        broken: Option<&Falsification>,
    ) -> Abort {
        let Subject::Condition(when, condition) = place.subject else {
            unreachable!("only conditions fail");
        };
        let time = match broken {
            Some(broken) => place.time + &broken.at,
            None => place.time.clone(),
        };
        let mistake = ViolationKind::Condition {
            when,
            condition: self.to_pddl(condition, place.step),
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
        let late = happenings.filter(|own| self.may_make_true(own.kind, condition));
        late.map(|own| self.occurrence(own.kind, &own.time))
            .collect()
    }

    /// Returns `true` if an effect of the happening can make the false condition true.
    fn may_make_true(&self, what: HappeningKind<'a>, condition: &Condition) -> bool {
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
        if let HappeningKind::Timed(timed) = what {
            timed.changes.iter().any(suits)
        } else {
            let effects = self.snap(what).into_iter().flat_map(|snap| &snap.effects);
            effects.map(|effect| &effect.change).any(suits)
        }
    }

    /// Returns the condition of a step, or the goal, in PDDL notation.
    fn to_pddl(&self, condition: &Condition, step: Option<usize>) -> String {
        let action = step.map(|position| &*self.plan.steps[position].action);
        self.task.describe_condition_of(action, condition)
    }

    /// Converts a fault to a violation or an undecided result.
    pub(super) fn to_abort(&self, fault: Fault, place: &EvaluationContext<'_>) -> Abort {
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
                let mistake = ViolationKind::Undefined { fluent, within };
                return self.violation(place.time, place.step, mistake);
            }
            Fault::DivisionByZero(divisor) => {
                let divisor = self.task.describe_expression(&divisor);
                let mistake = ViolationKind::DivisionByZero { divisor, within };
                return self.violation(place.time, place.step, mistake);
            }
            Fault::Open(unknown) => UndecidedReason::Open {
                unknown: self.task.describe_unknown(unknown),
                within,
            },
            Fault::Misplaced(expression) => UndecidedReason::Misplaced {
                expression: self.task.describe_expression(&expression),
                within,
            },
            Fault::Quotient(divisor) => UndecidedReason::Quotient {
                divisor: self.task.describe_expression(&divisor),
                within,
            },
            Fault::Irrational(fluent) => UndecidedReason::Irrational {
                fluent: self.task.fluent_name(fluent),
                within,
            },
            Fault::Circular(fluent) => UndecidedReason::Nonlinear {
                fluent: self.task.fluent_name(fluent),
            },
        };
        Abort::Undecided(Box::new(Undecided {
            time: Some(place.time.clone()),
            reason: difficulty,
        }))
    }
}
