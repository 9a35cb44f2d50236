//! Writes the document on supported PDDL features.

use std::collections::BTreeMap;
use std::fmt::Write;

use elbowroom_pddl::Feature;

use crate::survey::{Domain, Survey, reason};

/// Supported parts of PDDL and their scope.
const SUPPORTED: &[(&str, &str)] = &[
    (
        "Types",
        "hierarchies, `either` for types, variables and objects, `object`",
    ),
    (
        "Objects",
        "constants and objects; names compare without case",
    ),
    (
        "Conditions",
        "`and`, `or`, `not`, `imply`, `forall`, `exists`, `=` of objects, comparisons of numbers",
    ),
    (
        "Numeric fluents",
        "`assign`, `increase`, `decrease`, `scale-up`, `scale-down`; `+ - * /` with any number of operands where applicable; exact numbers",
    ),
    (
        "Conditional and quantified effects",
        "`when`, `forall`, nested; also in durative actions, with conditions at start, over all and at end for effects at end",
    ),
    ("Instantaneous actions", "together with durative ones"),
    (
        "Durative actions",
        "conditions and effects at start, over all, at end; `forall` around time specifiers; `or`, `not`, `exists` over parts of one time",
    ),
    (
        "Durations",
        "`=`, `<=`, `>=`, several of them, read at start or at end, dependent on fluents; `?duration` in conditions and effects: the planned duration until the action ends, the real one at its end",
    ),
    (
        "Continuous effects",
        "any form linear in `#t`; the rate may depend on fluents",
    ),
    (
        "Timed initial literals and fluents",
        "`(at 10 (p))`, `(at 10 (not (p)))`, `(at 10 (= (f) 3))`; two that contradict each other at \
         the same time are an error in the problem; the goal is evaluated after all of them",
    ),
    ("Derived predicates", "stratified rules"),
    (
        "Processes and events",
        "PDDL+ `:process` and `:event`, grounded, validated and respected by envelopes \
         ([how](#processes-and-events)); \
         `:constraint`, which must hold in each state",
    ),
    (
        "Trajectory constraints",
        "`:constraints` of domain and problem (PDDL 3): `at end`, `always`, `sometime`, `within`, \
         `at-most-once`, `sometime-after`, `sometime-before`, `always-within`, `hold-during`, \
         `hold-after`, under `and`, `forall` and `preference`",
    ),
    (
        "Preferences",
        "in goals, conditions of actions (one violation each time) and `:constraints`, under `and` \
         and `forall` (one instance for each object); they never make a plan invalid",
    ),
    (
        "Metrics",
        "read; they do not affect validity; `(is-violated name)` counts the violated \
         instances of a preference",
    ),
    (
        "Open numbers",
        "`:synth-parameters`, of a domain or of an action",
    ),
    (
        "Control parameters",
        "`:control (?cash - number)` of an action: numbers that the plan chooses. In a plan they \
         follow the objects: `0.0: (withdraw ann 12.5) [2]`. Read and validated; planner, \
         networks, envelopes, repairs, odds and runs reject such domains",
    ),
    (
        "Object fluents",
        "functions whose values are objects (PDDL 3.1), as predicates with the value as last \
         argument: `(= (f a) v)`, `(assign (f a) v)`, `undefined`, and `(change (f a) v)` of TFD, \
         which leaves no value while a durative action runs; in conditions, `(f a)` may stand as an \
         argument. All features for predicates apply to them",
    ),
];

/// Semantics of constraints where papers and programs leave it open.
const CONSTRAINTS: &str = "\n## Constraints and preferences\n
The semantics are those of Gerevini, Haslum, Long, Saetti & Dimopoulos (*Deterministic planning in the \
fifth international planning competition*, AIJ 173, 2009): a constraint is evaluated on the sequence of \
states of a plan.

- The state at a time is the one after all happenings at that time. The initial state before all \
  happenings is a separate state.
- The state after the last happening and all timed initials lasts forever: `hold-during` and \
  `hold-after` may extend beyond the end of the plan.
- `hold-during t u` and `hold-after t` also apply to the state that holds at `t`, which may have \
  begun earlier. (VAL starts with the first state that begins in the window: [agreement with VAL](../research/val-agreement.md#comparison-with-vals-program).)
- Where numbers change continuously, all times count, not only those of happenings. Times are \
  compared exactly; if two of them are less than a millionth apart and one is irrational, the \
  constraint is undecided.
- Constraints cannot be nested. In `(preference p (and c d))`, `p` is violated once if `c` or `d` is; in \
  `(forall (?x) (preference p …))` there is an instance for each object. A preference that reads a \
  number without a value is violated.
- A plan that violates a constraint is invalid, and the validator reports the time and the reason. In \
  mid-execution, the past states are unknown, so that constraints are undecided.
- The embedded planner finds plans under all forms \
  ([details](../research/planners-embedded.md#trajectory-constraints)). Networks and envelopes respect constraints on facts: the happenings that change them keep their order, and \
  deadlines become bounds. Runs and other plans in mid-execution, STN plan files and odds do not \
  support constraints, and reject them.

";

/// Semantics of processes and events, and the planners and executors that account for them.
const AUTONOMOUS: &str = "\n## Processes and events\n
The semantics are those of Fox & Long (*Modelling mixed discrete-continuous domains for planning*, JAIR \
27, 2006).

- A process is active whenever its condition holds, from the initial state on. Its effects are \
  `(increase (f) (* #t rate))` and `(decrease …)`, without `when`. Rates of processes and of actions \
  add up.
- An event happens as soon as its condition holds: after the happening or other event that \
  makes it true, and before the plan's happenings at that time. If a condition holds only right \
  after a time, as `(> (x) 3)` does when `x` rises through 3, the event happens right after it.
- An event happens once at a time. An event whose effects leave its precondition true, or two events that make \
  each other's true again, would happen endlessly: the plan is invalid, and the validator names the \
  event. The same holds for two events that interfere at the same time.
- The plan's happenings must be ε later than an event with which they interfere.
- The times of events, and of starts and stops of processes, are zeros of polynomials, and are \
  compared exactly, also if they are irrational. A number whose course changes or stops at an \
  irrational time with an irrational value is not represented: if a condition or effect reads it, the plan is \
  undecided.
- Also undecided, with the reason: rates that depend on their own fluent (air resistance); a \
  process that would start and stop endlessly; more than 1000 events, starts and stops of processes \
  between two happenings of the plan.
- A `:constraint` (of the dialect of ENHSP) is `(always condition)` for all its parameters.
- `elbowroom envelope` accounts for events whose order is known and whose times are linear, and reports \
  the obstacle otherwise ([details](guarantees.md#processes-and-events)). The embedded planner, \
  networks of plans, largest and exact envelopes, repairs, odds and runs reject such domains. \
  External planners can be used, and their plans are validated.

";

/// Returns the document. Without a survey, it has no tables.
pub(crate) fn document(survey: Option<&Survey>) -> String {
    let mut text = String::from(
        "# PDDL support\n\n\
         <!-- Written by `cargo run --release -p elbowroom-pddl --example pddl_support`. -->\n\n\
         PDDL 2.1 levels 1 to 4, with the timed initial literals and derived predicates of PDDL \
         2.2, and processes and events (PDDL+). Requirement flags have no effect.\n\n## Executed\n\n",
    );
    for (name, what) in SUPPORTED {
        line(&mut text, format_args!("- **{name}**: {what}"));
    }
    text.push_str("\n## Refused or ignored\n\nRejections name the feature and its place. Ignored features never affect validity.\n\n");
    for feature in Feature::ALL {
        line(
            &mut text,
            format_args!("- **{}**: {}", feature.name(), feature.summary()),
        );
    }
    text.push_str(AUTONOMOUS);
    text.push_str(CONSTRAINTS);
    if let Some(survey) = survey {
        benchmarks(survey, &mut text);
    }
    text
}

fn benchmarks(survey: &Survey, text: &mut String) {
    let instances: usize = survey.domains.iter().map(|domain| domain.instances).sum();
    let read: usize = survey.domains.iter().map(|domain| domain.read).sum();
    let grounded: usize = survey.domains.iter().map(|domain| domain.grounded).sum();
    let (plans, plans_read) = survey.plans;
    line(
        text,
        format_args!(
            "\n## Benchmarks\n\n{read} of {instances} instances are read, and {grounded} of these \
             are grounded; {plans_read} of their {plans} plans are read. The instances that \
             are not read, by reason:\n"
        ),
    );
    line(text, format_args!("|reason|instances|\n|---|---:|"));
    for (reason, count) in reasons(survey) {
        line(text, format_args!("|{reason}|{count}|"));
    }
    text.push_str("\n### By domain\n\n");
    text.push_str(
        "*Ground* counts the grounded problems, *actions* their reachable ground actions \
         in total.\n\n",
    );
    text.push_str("|domain|instances|read|ground|actions|refused|why|\n");
    text.push_str("|---|---:|---:|---:|---:|---:|---|\n");
    for domain in &survey.domains {
        line(
            text,
            format_args!(
                "|{}|{}|{}|{}|{}|{}|{}|",
                domain.name,
                domain.instances,
                domain.read,
                domain.grounded,
                domain.actions,
                domain.refused.len(),
                why(domain)
            ),
        );
    }
    text.push_str("\n### Mistakes in the files\n\nThe first error of each file; rejected features are not listed.\n\n");
    for domain in &survey.domains {
        let mut shown = BTreeMap::new();
        for (path, errors) in &domain.refused {
            if let Some(error) = errors.iter().find(|error| Feature::of(error).is_none()) {
                shown
                    .entry(error.to_string())
                    .or_insert_with(Vec::new)
                    .push(path);
            }
        }
        for (error, paths) in shown {
            let count = match paths.len() {
                1 => String::new(),
                count => format!(" ({count} instances)"),
            };
            line(text, format_args!("- {error}{count}"));
        }
    }
    text.push_str("\n### Warnings\n\n");
    for domain in &survey.domains {
        for (message, count) in &domain.warnings {
            line(text, format_args!("- {}: {message} ({count})", domain.name));
        }
    }
}

/// Counts the refused instances by reason.
pub(crate) fn reasons(survey: &Survey) -> BTreeMap<String, usize> {
    let mut reasons = BTreeMap::new();
    for domain in &survey.domains {
        for (_, errors) in &domain.refused {
            *reasons.entry(reason(errors)).or_default() += 1;
        }
    }
    reasons
}

fn why(domain: &Domain) -> String {
    let mut reasons: Vec<_> = domain.refused.iter().map(|(_, e)| reason(e)).collect();
    reasons.sort();
    reasons.dedup();
    reasons.join("; ")
}

fn line(text: &mut String, line: std::fmt::Arguments) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{line}");
}
