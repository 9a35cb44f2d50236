//! Conversion of PDDL and plan text to the model, and back.
//!
//! The inputs are texts, as [`Source`]s. The outputs are a [`Problem`](elbowroom_model::Problem), a
//! [`TimeTriggeredPlan`](elbowroom_model::TimeTriggeredPlan), and [`Diagnostic`]s that report
//! errors and expectations with line, column and excerpt.
//!
//! Structure of the crate:
//!
//! 1. `syntax`: text to words to nested lists, each with its position. Deep nesting is refused
//!    here, so that all later steps may recurse.
//! 2. `lower`: lists to the model, with names resolved. One file for each part of the language.
//!    After a mistake, the reader continues and reports further mistakes.
//! 3. `plan_text`: output of planners to a plan, and back.
//! 4. `problem_text`: a problem, also one in mid-execution, back to text.
//!
//! PDDL 2.1 levels 1 to 4, PDDL 2.2 and PDDL+ are read. Unsupported features ([`Feature`]) are
//! refused by name and position, or ignored with a warning where they cannot affect validity. The
//! readers do not panic on any input. They open no files: the caller names each text.
//!
//! ```
//! use elbowroom_model::Task;
//! use elbowroom_pddl::{Source, read_plan, read_problem, write_plan};
//!
//! let domain = Source::new(
//!     "lamp.pddl",
//!     "(define (domain lamp) (:predicates (lit))
//!        (:durative-action glow :duration (= ?duration 5) :effect (at start (lit))))",
//! );
//! let problem = Source::new(
//!     "evening.pddl",
//!     "(define (problem evening) (:domain lamp) (:init) (:goal (lit)))",
//! );
//! let (problem, warnings) = read_problem(&domain, &problem)?;
//! assert!(warnings.is_empty());
//!
//! let task = Task::new(problem);
//! let (plan, _) = read_plan(&Source::new("plan", "0.5: (GLOW)"), &task)?;
//! assert_eq!(write_plan(&task, &plan), "0.500: (glow) [5.000]\n");
//!
//! let mistaken = read_plan(&Source::new("plan", "0.5: (glwo)"), &task).unwrap_err();
//! assert_eq!(mistaken.to_string(), "plan:1:7: error: unknown action `glwo`; did you mean `glow`?");
//! # Ok::<(), elbowroom_pddl::Diagnostics>(())
//! ```

mod feature;
mod lower;
mod plan_text;
mod problem_text;
mod report;
mod source;
mod syntax;

pub use elbowroom_text::{Diagnostic, Diagnostics, Label, Severity, Source};
pub use feature::{Feature, is_unsupported};
pub use lower::{read_goal, read_problem};
pub use plan_text::{
    LineKind, PrintedPlan, PrintedStep, read_plan, read_printed_plan, write_plan,
    write_rounded_plan,
};
pub use problem_text::{ProblemText, WriteProblemError, end_times, with_initials, write_problem};
