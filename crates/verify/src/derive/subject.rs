//! Happenings of a plan: [`Subject`].

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::ground::{
    Body, Change, Condition, DurativeBody, Effect, Expression, FactId, FluentId, Guard,
};
use elbowroom_model::problem::{Comparison, Unknown};
use elbowroom_model::{Footprint, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::NotDerived;
use super::given::Given;
use super::histories::Histories;
use crate::certificate::Certificate;

/// The event at a time point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PointKind {
    /// Time zero.
    Zero,
    /// The start of the step at this position.
    Start(usize),
    /// The end of the step at this position.
    End(usize),
    /// The step at this position, which takes no time.
    Instant(usize),
    /// Timed initials.
    Timed(usize),
}

/// A time point of the plan.
pub(super) struct Point {
    pub(super) kind: PointKind,
    /// The time in the plan.
    pub(super) time: Rational,
    pub(super) footprint: Footprint,
    /// Facts that it makes true in every state.
    adds: BTreeSet<FactId>,
    /// Facts that it deletes in every state.
    deletes: BTreeSet<FactId>,
}

impl Point {
    /// Returns `true` if the fact has the wanted truth value after this point, in every state.
    pub(super) fn establishes(&self, fact: FactId, wanted: bool) -> bool {
        if wanted {
            self.adds.contains(&fact)
        } else {
            self.deletes.contains(&fact) && !self.footprint.adds.contains(&fact)
        }
    }

    /// Returns `true` if this point may change the fact from its wanted truth value.
    pub(super) fn threatens(&self, fact: FactId, wanted: bool) -> bool {
        if wanted {
            self.footprint.deletes.contains(&fact) && !self.adds.contains(&fact)
        } else {
            self.footprint.adds.contains(&fact)
        }
    }

    /// Returns `true` if this point changes a fact or fluent in `read`.
    pub(super) fn writes(&self, read: &Footprint) -> bool {
        self.footprint.writes_reads_of(read)
    }
}

/// A plan as its time points.
pub(super) struct Subject<'a> {
    pub(super) task: &'a Task,
    /// The steps, in order of start, or in that of the plan file with constraints.
    pub(super) steps: Vec<&'a Step>,
    /// By step: its name in certificates.
    names: Vec<String>,
    /// `true` if the plan file has constraints, which are not made from the domain.
    pub(super) is_given: bool,
    /// Time zero, then the start and the end of each step, then timed initials.
    pub(super) points: Vec<Point>,
    /// By step: the points of its start and its end.
    pub(super) ends: Vec<[usize; 2]>,
    /// The initial values that are parameters.
    pub(super) initials: BTreeMap<FluentId, usize>,
    /// `true` if no effect has a condition, each conjunct of an over-all condition is about one fact, and no number
    /// depends on times. The plan needs no bounds but orders then.
    pub(super) is_plain: bool,
}

impl<'a> Subject<'a> {
    /// Collects the happenings of a plan.
    ///
    /// # Errors
    /// When the task or a step has a feature that the checker has no rule for.
    pub(super) fn new(
        task: &'a Task,
        plan: &'a TimeTriggeredPlan,
        given: Option<&Given<'_>>,
        initials: BTreeMap<FluentId, usize>,
    ) -> Result<Self, NotDerived> {
        if let Some(feature) = task.unsupported_by_analysis() {
            return Err(NotDerived::unknown(feature));
        }
        let (steps, names) = if let Some(given) = given {
            (plan.steps.iter().collect(), given.labels())
        } else {
            let names = (0..plan.steps.len()).map(|step| format!("n{step}"));
            (Step::by_start(&plan.steps), names.collect())
        };
        let mut subject = Self {
            task,
            steps,
            names,
            is_given: given.is_some(),
            points: Vec::new(),
            ends: Vec::new(),
            initials,
            is_plain: true,
        };
        subject.add(PointKind::Zero, Rational::ZERO, Footprint::default(), &[]);
        for position in 0..subject.steps.len() {
            let step = subject.steps[position];
            let start = Footprint::of_start(task, &step.action);
            let first = subject.points.len();
            match (&step.action.body, &step.duration) {
                (Body::Instantaneous(snap), None) => {
                    let what = PointKind::Instant(position);
                    subject.add(what, step.start.clone(), start, &snap.effects);
                    subject.ends.push([first, first]);
                }
                (Body::Durative(body), Some(_)) => {
                    let what = PointKind::Start(position);
                    subject.add(what, step.start.clone(), start, &body.start.effects);
                    let end = Footprint::of_end(task, &step.action);
                    subject.add(PointKind::End(position), step.end(), end, &body.end.effects);
                    subject.ends.push([first, first + 1]);
                }
                _ => {
                    let what = format!("the duration of {}", step.action.name);
                    return Err(NotDerived::Unknown(what));
                }
            }
        }
        for (index, timed) in task.timed().iter().enumerate() {
            let footprint = Footprint::of_timed(timed);
            subject.points.push(Point {
                kind: PointKind::Timed(index),
                time: timed.time.clone(),
                adds: footprint.adds.clone(),
                deletes: footprint.deletes.clone(),
                footprint,
            });
        }
        subject.examine_conditions()?;
        if let Some(given) = given {
            for (step, body) in subject.durative() {
                if !given.has_known_duration(step) && Self::reads_duration_early(body) {
                    let name = &subject.steps[step].action.name;
                    let what = format!("an effect that depends on the duration of {name}");
                    return Err(NotDerived::Unknown(what));
                }
            }
        }
        Ok(subject)
    }

    fn add(&mut self, what: PointKind, time: Rational, footprint: Footprint, effects: &[Effect]) {
        let (mut adds, mut deletes) = (BTreeSet::new(), BTreeSet::new());
        for effect in effects.iter().filter(|effect| effect.guard.is_trivial()) {
            match effect.change {
                Change::Add(fact) => {
                    adds.insert(fact);
                }
                Change::Delete(fact) => {
                    deletes.insert(fact);
                }
                Change::Update { .. } => {}
            }
        }
        self.points.push(Point {
            kind: what,
            time,
            footprint,
            adds,
            deletes,
        });
    }

    /// Returns `true` if an effect of an action at this point has a condition.
    pub(super) fn has_guards(&self, point: usize) -> bool {
        let (step, is_end) = match self.points[point].kind {
            PointKind::Zero | PointKind::Timed(_) => return false,
            PointKind::Start(step) | PointKind::Instant(step) => (step, false),
            PointKind::End(step) => (step, true),
        };
        let effects = match &self.steps[step].action.body {
            Body::Instantaneous(snap) => &snap.effects,
            Body::Durative(body) if is_end => &body.end.effects,
            Body::Durative(body) => &body.start.effects,
        };
        effects.iter().any(|effect| !effect.guard.is_trivial())
    }

    /// Checks that the points of a certificate are those of the plan.
    ///
    /// # Errors
    /// The first difference.
    pub(super) fn labels(&self, certificate: &Certificate) -> Result<(), NotDerived> {
        let (found, wanted) = (certificate.points.len(), self.points.len());
        if found != wanted {
            let what =
                format!("the certificate has {found} time points, and the plan has {wanted}");
            return Err(NotDerived::differs(what));
        }
        for (index, label) in certificate.points.iter().enumerate() {
            let own = self.label(index);
            if *label != own {
                let what =
                    format!("time point {index} is `{label}`, and the plan has `{own}` there");
                return Err(NotDerived::differs(what));
            }
        }
        Ok(())
    }

    /// Returns the name of the point in certificates.
    pub(super) fn label(&self, point: usize) -> String {
        match self.points[point].kind {
            PointKind::Zero => ".zero".to_owned(),
            PointKind::Start(step) => format!("{}.start", self.names[step]),
            PointKind::End(step) => format!("{}.end", self.names[step]),
            PointKind::Instant(step) => self.names[step].clone(),
            PointKind::Timed(index) => format!(".timed{index}"),
        }
    }

    /// Returns the durative steps, by position, with the bodies of their actions.
    pub(super) fn durative(&self) -> impl Iterator<Item = (usize, &'a DurativeBody)> + '_ {
        let steps = self.steps.iter().copied().enumerate();
        steps.filter_map(|(position, step)| Some((position, step.action.durative()?)))
    }

    /// Returns the shortest and the longest duration that the domain allows; `None`: no limit. A bound on
    /// numbers that change is the same in all schedules, because its writers keep their order. If it leaves
    /// no choice, it is the planned duration, which the validator has accepted.
    ///
    /// # Errors
    /// When a bound is strict, or is not the same number in all schedules and leaves a choice.
    pub(super) fn allowed(
        &self,
        step: usize,
        body: &DurativeBody,
        histories: &Histories<'_>,
    ) -> Result<(Rational, Option<Rational>), NotDerived> {
        let name = &self.steps[step].action.name;
        let (mut least, mut most) = (Rational::ZERO, None::<Rational>);
        for constraint in &body.duration {
            if self.is_changing(&constraint.bound) && constraint.comparison == Comparison::Equal {
                let planned = self.steps[step].duration.clone().unwrap_or_default();
                return Ok((planned.clone(), Some(planned)));
            }
            let bound = histories.duration_bound(step, constraint);
            let Some(bound) = bound else {
                let what = format!(
                    "a bound on the duration of {name} that is not the same number in all schedules"
                );
                return Err(NotDerived::Unknown(what));
            };
            let (is_lower, is_upper) = match constraint.comparison {
                Comparison::Equal => (true, true),
                Comparison::AtLeast => (true, false),
                Comparison::AtMost => (false, true),
                Comparison::Less | Comparison::Greater => {
                    let what = format!("a strict bound on the duration of {name}");
                    return Err(NotDerived::Unknown(what));
                }
            };
            if is_lower {
                least = least.max(bound.clone());
            }
            if is_upper {
                most = Some(most.map_or(bound.clone(), |most| most.min(bound)));
            }
        }
        Ok((least, most))
    }

    /// Returns `true` if something reads the duration of a step before its end. It is the planned one then, so the
    /// executor must not choose another one.
    pub(super) fn reads_duration_early(body: &DurativeBody) -> bool {
        let is_early = |guard: &Guard| {
            compares_duration(&guard.at_start) || compares_duration(&guard.over_all)
        };
        let mut start = body.start.effects.iter();
        let mut end = body.end.effects.iter();
        let mut continuous = body.continuous.iter();
        compares_duration(&body.start.condition)
            || compares_duration(&body.over_all)
            || start.any(|effect| {
                let is_read = match &effect.change {
                    Change::Update { value, .. } => reads_duration(value),
                    _ => false,
                };
                is_read || is_early(&effect.guard) || compares_duration(&effect.guard.now)
            })
            || end.any(|effect| is_early(&effect.guard))
            || continuous.any(|effect| reads_duration(&effect.rate) || is_early(&effect.guard))
    }

    /// Returns `true` if some happening changes a fluent in the expression, or its initial value is a parameter.
    fn is_changing(&self, expression: &Expression) -> bool {
        let mut is_changing = false;
        expression.visit_fluents(&mut |fluent| {
            is_changing |= self.initials.contains_key(&fluent);
            is_changing |= self.points.iter().any(|point| {
                let own = &point.footprint;
                own.shifts.contains(&fluent) || own.assigns.contains(&fluent)
            });
        });
        is_changing
    }

    /// Determines whether the plan is plain, and checks that bounds on durations do not read
    /// durations.
    fn examine_conditions(&mut self) -> Result<(), NotDerived> {
        let mut is_plain = true;
        for step in &self.steps {
            let (start, end) = match &step.action.body {
                Body::Instantaneous(snap) => (snap, None),
                Body::Durative(body) => (&*body.start, Some(body)),
            };
            let effects = start
                .effects
                .iter()
                .chain(end.iter().flat_map(|body| &body.end.effects));
            for effect in effects {
                is_plain &= effect.guard.is_trivial();
            }
            let Some(body) = end else {
                continue;
            };
            let mut conditions = body.over_all.conjuncts().into_iter();
            is_plain &= conditions.all(|condition| self.literal(condition).is_some());
            let mut effects = body.end.effects.iter();
            is_plain &= body.continuous.is_empty()
                && is_condition_of_state(&body.end.condition)
                && effects.all(|effect| match &effect.change {
                    Change::Update { value, .. } => is_of_state(value),
                    _ => true,
                });
            for constraint in &body.duration {
                if !is_of_state(&constraint.bound) {
                    let what = format!(
                        "a non-numeric bound on the duration of {}",
                        step.action.name
                    );
                    return Err(NotDerived::Unknown(what));
                }
            }
        }
        self.is_plain = is_plain;
        Ok(())
    }

    /// Returns the least and the greatest duration that the domain allows for a step, if it gives
    /// an interval of numbers. A single duration is the planned one. The real duration may deviate
    /// from it, so the result has no bounds then.
    pub(super) fn domain_interval(
        &self,
        step: usize,
        histories: &Histories<'_>,
    ) -> [Option<Rational>; 2] {
        let Some(body) = self.steps[step].action.durative() else {
            return [None, None];
        };
        let mut least: Option<Rational> = None;
        let mut most: Option<Rational> = None;
        for bound in &body.duration {
            let Some(value) = histories.duration_bound(step, bound) else {
                return [None, None];
            };
            let is_equal = bound.comparison == Comparison::Equal;
            if is_equal || matches!(bound.comparison, Comparison::AtLeast | Comparison::Greater) {
                least = least.max(Some(value.clone()));
            }
            if is_equal || matches!(bound.comparison, Comparison::AtMost | Comparison::Less) {
                most = Some(most.map_or(value.clone(), |most| most.min(value.clone())));
            }
        }
        if least == most {
            return [None, None];
        }
        [least, most]
    }

    /// Returns the basic fact of a literal and its wanted truth value, or `None` for other conditions.
    pub(super) fn literal(&self, condition: &Condition) -> Option<(FactId, bool)> {
        let (fact, wanted) = match condition {
            Condition::Fact(fact) => (*fact, true),
            Condition::Not(part) => match **part {
                Condition::Fact(fact) => (fact, false),
                _ => return None,
            },
            _ => return None,
        };
        (!self.task.is_derived(fact)).then_some((fact, wanted))
    }
}

/// Returns `true` if the expression reads `?duration`, or a number that the checker does not know.
fn reads_duration(expression: &Expression) -> bool {
    let mut is_read = false;
    expression.visit_leaves(&mut |leaf| {
        let is_known = matches!(
            leaf,
            Expression::Constant(_)
                | Expression::Fluent(_)
                | Expression::Unknown(Unknown::Parameter(_))
        );
        is_read |= !is_known;
    });
    is_read
}

/// Returns `true` if a comparison in the condition reads `?duration`.
fn compares_duration(condition: &Condition) -> bool {
    let mut is_read = false;
    condition.visit_comparisons(&mut |left, right| {
        is_read |= reads_duration(left) || reads_duration(right);
    });
    is_read
}

/// Returns `true` if the value of the expression depends on the state alone.
fn is_of_state(expression: &Expression) -> bool {
    let mut is_all = true;
    expression.visit_leaves(&mut |leaf| {
        is_all &= matches!(leaf, Expression::Constant(_) | Expression::Fluent(_));
    });
    is_all
}

/// Returns `true` if the truth of the condition depends on the state alone.
pub(super) fn is_condition_of_state(condition: &Condition) -> bool {
    let mut is_all = true;
    condition.visit_comparisons(&mut |left, right| {
        is_all &= is_of_state(left) && is_of_state(right);
    });
    is_all
}

/// Returns `true` if the expression has no quotient, so it has a value as soon as its fluents have values.
pub(super) fn is_always_defined(expression: &Expression) -> bool {
    match expression {
        Expression::Constant(_)
        | Expression::Fluent(_)
        | Expression::Duration
        | Expression::Unknown(Unknown::Parameter(_)) => true,
        Expression::Add(parts) | Expression::Multiply(parts) => parts.iter().all(is_always_defined),
        Expression::Subtract(left, right) => is_always_defined(left) && is_always_defined(right),
        Expression::Negate(part) => is_always_defined(part),
        _ => false,
    }
}
