//! Writer of problem files: from a problem, or the remaining problem in mid-execution, to text.
//!
//! With it, programs that only read files can plan from any [`Situation`]. Time 0 of the text is
//! [`Situation::time`], future timed initials keep their distance from now, and a running action
//! becomes timed initials with its end effects. Timed initials cannot protect the conditions of a
//! running action; the validator checks these.

mod insertion;
mod running;
mod term;

use std::fmt::Write;

use elbowroom_model::ground::{Change, Expression, FactId};
use elbowroom_model::problem::{self, Constraint, Modal, Object, TypeId};
use elbowroom_model::{Situation, State, Task, TimedHappening};
use elbowroom_num::Rational;

pub use insertion::with_initials;
pub use running::end_times;
use running::ends_of_running;

/// Settings for writing a problem as PDDL text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProblemText {
    /// For each running action, the time on the task's clock at which it will end; see
    /// [`end_times`].
    pub ends: Vec<Rational>,
    /// Number of digits to which numbers without a finite decimal are rounded. If `None`, they are
    /// written exactly as `p/q`, which [`read_problem`](crate::read_problem) reads but other
    /// programs may not.
    pub digits: Option<u32>,
}

/// Reason why a situation cannot be written as a problem file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WriteProblemError {
    /// The number of ends differs from that of running actions.
    #[error("{running} actions are running, but {ends} end times are given")]
    EndCount {
        /// The number of actions that are running.
        running: usize,
        /// The number of ends given.
        ends: usize,
    },
    /// An action ends now, or is overdue.
    #[error("{action} would end now or earlier: apply its end, and plan from the resulting state")]
    EndsNow {
        /// The action.
        action: String,
    },
    /// The end is not possible.
    #[error("{action} cannot end at {end}: its duration must be {possible}")]
    Impossible {
        /// The action.
        action: String,
        /// The end.
        end: Rational,
        /// The possible durations.
        possible: String,
    },
    /// There are trajectory constraints, and the plan has begun.
    #[error(
        "a problem file cannot express the states so far, on which the problem's trajectory \
         constraints depend"
    )]
    UnknownPast,
    /// The effects at the end of the action, or until then, are not known in advance.
    #[error(
        "a problem file cannot express that {action} is running: {why}; use the embedded planner"
    )]
    Inexpressible {
        /// The action.
        action: String,
        /// The part that timed initials cannot express.
        why: String,
    },
}

/// Returns the text of a problem file for `task`'s domain that begins in `situation`. When
/// [`read_problem`](crate::read_problem) reads the text, it returns the same problem, up to the
/// order of facts.
///
/// Facts that follow from rules are not written. The goal's preferences are written among the
/// constraints. In mid-execution, preferences about the trajectory are omitted, as is a
/// metric that counts violations, because the file cannot state past violations.
///
/// # Errors
/// If a running action cannot be expressed: it changes numbers while it runs, it has conditional
/// effects that are still open, or it ends at no time later than now. Also if hard constraints
/// apply to a course that has already begun.
///
/// ```
/// use elbowroom_model::{Situation, Task};
/// use elbowroom_num::Rational;
/// use elbowroom_pddl::{ProblemText, Source, read_problem, write_problem};
///
/// let domain = Source::new(
///     "shop.pddl",
///     "(define (domain shop) (:predicates (open) (sold))
///        (:durative-action sell :duration (= ?duration 5)
///          :condition (at end (open)) :effect (at end (sold))))",
/// );
/// let problem = Source::new(
///     "day.pddl",
///     "(define (problem day) (:domain shop)
///        (:init (open) (at 30 (not (open)))) (:goal (sold)))",
/// );
/// let task = Task::new(read_problem(&domain, &problem)?.0);
/// let later = Situation { time: Rational::from(20), ..Situation::initial(&task) };
/// let text = write_problem(&task, &later, &ProblemText::default())?;
/// assert!(text.contains("(at 10 (not (open)))"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_problem(
    task: &Task,
    situation: &Situation,
    how: &ProblemText,
) -> Result<String, WriteProblemError> {
    let ends = ends_of_running(task, situation, &how.ends)?;
    let problem = task.problem();
    let mut text = format!(
        "(define (problem {})\n(:domain {})\n",
        problem.name, problem.domain
    );
    let writer = Writer { task, options: how };
    writer.objects(&mut text);
    text.push_str("(:init\n");
    writer.state(&situation.state, &mut text);
    let to_come = task.timed().iter().filter(|h| h.time > situation.time);
    let mut timed: Vec<&TimedHappening> = to_come.chain(&ends).collect();
    timed.sort_by(|a, b| a.time.cmp(&b.time));
    for happening in timed {
        writer.timed(happening, &situation.time, &mut text);
    }
    text.push_str(")\n");
    let mut names = Vec::new();
    // Writing to a string cannot fail.
    let goal = writer.condition(&problem.goal, &mut names);
    let _ = writeln!(text, "(:goal {goal})");
    let is_begun = *situation != Situation::initial(task);
    writer.constraints(is_begun, &mut text)?;
    if let Some(metric) = &problem.metric
        && !(is_begun && counts_violations(&metric.expression))
    {
        let direction = if metric.maximize {
            "maximize"
        } else {
            "minimize"
        };
        let expression = writer.expression(&metric.expression, &names);
        let _ = writeln!(text, "(:metric {direction} {expression})");
    }
    text.push_str(")\n");
    Ok(text)
}

/// Returns `true` if a metric depends on preferences.
fn counts_violations(metric: &problem::Expression) -> bool {
    let mut counts = false;
    metric.visit_leaves(&mut |leaf| {
        counts |= matches!(leaf, problem::Expression::Violations(_));
    });
    counts
}

/// Returns `true` if the constraint does not depend on the past.
fn is_independent_of_past(constraint: &Constraint) -> bool {
    match constraint {
        Constraint::Modal(modal) => matches!(modal, Modal::AtEnd(_)),
        Constraint::And(parts) => parts.iter().all(is_independent_of_past),
        Constraint::Forall(_, part) | Constraint::Preference(_, part) => {
            is_independent_of_past(part)
        }
    }
}

/// Returns `true` if the constraint consists of preferences only.
fn is_soft(constraint: &Constraint) -> bool {
    match constraint {
        Constraint::Modal(_) => false,
        Constraint::And(parts) => parts.iter().all(is_soft),
        Constraint::Forall(_, part) => is_soft(part),
        Constraint::Preference(..) => true,
    }
}

/// Notation of a deletion.
enum Deleted {
    /// As the deletion of a fact.
    Fact,
    /// As the loss of an object function's value, in this notation.
    Value(String),
    /// Not written.
    Nothing,
}

/// Writes the parts of a problem file.
struct Writer<'a> {
    task: &'a Task,
    options: &'a ProblemText,
}

impl Writer<'_> {
    /// Writes `:objects`, without the domain's constants. Types are written if any object has one.
    fn objects(&self, text: &mut String) {
        let problem = self.task.problem();
        let own = problem.objects.get(problem.constants..).unwrap_or(&[]);
        if own.is_empty() {
            return;
        }
        let is_plain = |object: &Object| object.types == [TypeId::OBJECT];
        let is_typed = !own.iter().all(is_plain);
        text.push_str("(:objects\n");
        for object in own {
            let _ = write!(text, "  {}", object.name);
            if is_typed {
                let _ = write!(text, " - {}", self.types(&object.types));
            }
            text.push('\n');
        }
        text.push_str(")\n");
    }

    fn state(&self, state: &State, text: &mut String) {
        for &fact in &state.facts {
            if !self.task.is_derived(fact) {
                let _ = writeln!(text, "  {}", self.task.fact_name(fact));
            }
        }
        for (&fluent, value) in &state.values {
            let name = self.task.fluent_name(fluent);
            let _ = writeln!(text, "  (= {name} {})", self.number(value));
        }
    }

    /// Writes `:constraints`, without the domain's.
    fn constraints(&self, is_begun: bool, text: &mut String) -> Result<(), WriteProblemError> {
        let problem = self.task.problem();
        let (of_domain, own) = problem
            .constraints
            .split_at(problem.domain_constraints.min(problem.constraints.len()));
        let is_lost = |part: &&Constraint| is_begun && !is_independent_of_past(part);
        let mut all = of_domain.iter().chain(own);
        if all.any(|part| is_lost(&part) && !is_soft(part)) {
            return Err(WriteProblemError::UnknownPast);
        }
        let mut kept = own.iter().filter(|part| !is_lost(part)).peekable();
        if kept.peek().is_some() {
            text.push_str("(:constraints (and\n");
            for constraint in kept {
                let constraint = self.constraint(constraint, &mut Vec::new());
                let _ = writeln!(text, "  {constraint}");
            }
            text.push_str("))\n");
        }
        Ok(())
    }

    fn timed(&self, happening: &TimedHappening, now: &Rational, text: &mut String) {
        let time = self.number(&(&happening.time - now));
        for change in &happening.changes {
            let what = match change {
                Change::Add(fact) => self.task.fact_name(*fact),
                Change::Delete(fact) => match self.undefined(*fact, happening) {
                    Deleted::Fact => format!("(not {})", self.task.fact_name(*fact)),
                    Deleted::Value(undefined) => undefined,
                    Deleted::Nothing => continue,
                },
                Change::Update { fluent, value, .. } => {
                    let Expression::Constant(value) = value else {
                        // Timed initials only assign numbers, and so do the ends made from running
                        // actions.
                        continue;
                    };
                    format!(
                        "(= {} {})",
                        self.task.fluent_name(*fluent),
                        self.number(value)
                    )
                }
            };
            let _ = writeln!(text, "  (at {time} {what})");
        }
    }

    /// Returns the notation of a deletion. If the fact is the value of an object function, the
    /// function becomes undefined unless the happening assigns another value.
    fn undefined(&self, fact: FactId, happening: &TimedHappening) -> Deleted {
        let problem = self.task.problem();
        let (predicate, arguments) = self.task.atom(fact);
        let Some((_, arguments)) = arguments
            .split_last()
            .filter(|_| problem.object_functions.contains(&predicate))
        else {
            return Deleted::Fact;
        };
        let has_another = happening.changes.iter().any(|change| match change {
            Change::Add(fact) => {
                let (other, others) = self.task.atom(*fact);
                other == predicate && others.split_last().is_some_and(|(_, own)| own == arguments)
            }
            _ => false,
        });
        if has_another {
            return Deleted::Nothing;
        }
        let name = &problem.predicates[predicate.index()].name;
        Deleted::Value(format!(
            "(= {} undefined)",
            problem.apply_name(name, arguments)
        ))
    }

    /// Returns the number as a decimal if that is exact, otherwise rounded to
    /// [`ProblemText::digits`].
    fn number(&self, value: &Rational) -> String {
        let is_exact = |text: &String| text.parse().is_ok_and(|read: Rational| read == *value);
        let exact = [12, 60].map(|digits| value.to_decimal(digits));
        match (exact.into_iter().find(is_exact), self.options.digits) {
            (Some(exact), _) => exact,
            (None, Some(digits)) => value.to_decimal(digits),
            (None, None) => value.to_string(),
        }
    }
}
