//! Conversion of nested lists to the model.

mod action;
mod autonomous;
mod condition;
mod constraints;
mod continuous;
mod declarations;
mod derived;
mod domain;
mod duration;
mod effect;
mod expansion;
mod expression;
mod hierarchy;
mod init;
mod names;
mod object_fluents;
mod objective;
mod scope;
mod sections;
mod shift;
mod stratify;
mod term;
mod timed;
mod typed_list;

use elbowroom_model::Problem;
use elbowroom_model::problem::{Condition, TypeId};

use crate::lower::names::Names;
use crate::lower::scope::Scope;
use crate::lower::sections::Sections;
use crate::lower::typed_list::TypeNames;
use crate::report::Report;
use crate::source::{FileId, Span};
use crate::syntax;
use elbowroom_text::Source;
use elbowroom_text::{Diagnostic, Diagnostics};

/// Reads a planning problem from the texts of its domain and problem files.
///
/// Returns the problem with the warnings, if any.
///
/// # Errors
/// Returns all errors and warnings if the texts contain mistakes or unsupported features
/// ([`is_unsupported`](crate::is_unsupported)).
pub fn read_problem(
    domain: &Source,
    problem: &Source,
) -> Result<(Problem, Vec<Diagnostic>), Diagnostics> {
    let mut reader = Reader::new(domain, problem);
    let domain = syntax::parse(FileId::Domain, domain.text(), &mut reader.report);
    let problem = syntax::parse(FileId::Problem, problem.text(), &mut reader.report);
    let domain = Sections::find(FileId::Domain, &domain, &mut reader.report);
    let problem = Sections::find(FileId::Problem, &problem, &mut reader.report);
    if let Some(domain) = &domain {
        reader.domain(domain);
        if let Some(problem) = &problem {
            reader.problem(problem);
        }
    }
    reader.finish()
}

/// Reads a goal for a problem that is already known: one condition, as it is written after `:goal`.
///
/// Returns the condition with the warnings, if any.
///
/// # Errors
/// Returns all mistakes that were found if the text is not a condition over the problem's
/// predicates, functions and objects.
pub fn read_goal(
    goal: &Source,
    problem: &Problem,
) -> Result<(Condition, Vec<Diagnostic>), Diagnostics> {
    let mut reader = Reader::new(&Source::new("domain", ""), goal);
    reader.names = Names::of(problem);
    reader.problem = problem.clone();
    let nodes = syntax::parse(FileId::Problem, goal.text(), &mut reader.report);
    let whole = Span {
        file: FileId::Problem,
        start: 0,
        end: goal.text().len(),
    };
    // A preference would require a metric that counts it.
    let mut scope = Scope {
        without_preferences: 1,
        ..Scope::default()
    };
    let condition = match nodes.as_slice() {
        [node] => reader.condition(node, &mut scope),
        [] => {
            reader
                .report
                .error(whole, "an empty goal")
                .advise("expected a condition such as `(predicate object …)` or `(and …)`");
            Condition::TRUE
        }
        [_, second, ..] => {
            reader
                .report
                .error(second.span, "a second condition in the goal")
                .advise("join them by `and`");
            Condition::TRUE
        }
    };
    if !scope.soft.is_empty() {
        let message = "a preference cannot be part of a goal that is given while a plan runs";
        reader
            .report
            .error(whole, message)
            .advise("write it into the problem, or leave it out");
    }
    reader.problem.goal = condition;
    reader.check_expansion(Some(whole));
    let condition = (!reader.report.is_failed()).then_some(reader.problem.goal);
    Diagnostics::outcome(condition, reader.report.into_diagnostics())
}

/// Reader of a domain and a problem, with the part of the problem read so far.
///
/// After a mistake, the reader substitutes a harmless value and continues, in order to report
/// further mistakes. The result is an error in any case.
struct Reader {
    report: Report,
    problem: Problem,
    names: Names,
    /// Amount of text copied because it encloses more than one effect.
    copied: usize,
    /// The types resolved last.
    resolved_types: Option<(TypeNames, Vec<TypeId>)>,
    /// Position of each schema's name.
    schema_spans: Vec<Span>,
    /// Position of each process's name.
    process_spans: Vec<Span>,
    /// Position of each event's name.
    event_spans: Vec<Span>,
    /// Position of each rule's head.
    rule_spans: Vec<Span>,
    /// Position of each constraint's section.
    constraint_spans: Vec<Span>,
}

impl Reader {
    fn new(domain: &Source, problem: &Source) -> Self {
        Self {
            report: Report::new(domain, problem),
            problem: Problem::default(),
            names: Names::default(),
            copied: 0,
            resolved_types: None,
            schema_spans: Vec::new(),
            process_spans: Vec::new(),
            event_spans: Vec::new(),
            rule_spans: Vec::new(),
            constraint_spans: Vec::new(),
        }
    }

    fn finish(self) -> Result<(Problem, Vec<Diagnostic>), Diagnostics> {
        let problem = (!self.report.is_failed()).then_some(self.problem);
        Diagnostics::outcome(problem, self.report.into_diagnostics())
    }
}
