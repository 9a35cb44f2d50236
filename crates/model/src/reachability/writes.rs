//! Kinds of events that a problem's actions and timed initials can cause, and kinds that its
//! conditions depend on.

use crate::problem::{Body, Change, Condition, Expression, Problem, Schema, Term, TimedChange};

use super::event::{Symbol, Symbols};

/// Returns all kinds of events that can occur after time 0.
pub(super) fn written(problem: &Problem) -> Symbols {
    let mut written = Symbols::default();
    for schema in &problem.schemas {
        match &schema.body {
            Body::Instantaneous { effects, .. } => {
                written.extend(effects.iter().map(|effect| symbol_of(&effect.change)));
            }
            Body::Durative {
                start_effects,
                end_effects,
                continuous,
                ..
            } => {
                let effects = start_effects.iter().chain(end_effects);
                written.extend(effects.map(|effect| symbol_of(&effect.change)));
                let fluents = continuous.iter().map(|effect| effect.fluent.function);
                written.extend(fluents.map(Symbol::Changed));
            }
        }
    }
    for timed in &problem.timed {
        written.insert(match &timed.change {
            TimedChange::Add(predicate, _) => Symbol::True(*predicate),
            TimedChange::Delete(predicate, _) => Symbol::False(*predicate),
            TimedChange::Assign(function, ..) => Symbol::Changed(*function),
        });
    }
    let heads = problem.rules.iter().map(|rule| rule.predicate);
    written.extend(heads.map(Symbol::True));
    written
}

/// Returns the kind of event of a change.
pub(super) fn symbol_of(change: &Change) -> Symbol {
    match change {
        Change::Add(atom) => Symbol::True(atom.predicate),
        Change::Delete(atom) => Symbol::False(atom.predicate),
        Change::Update { fluent, .. } => Symbol::Changed(fluent.function),
    }
}

/// Returns the arguments of the changed fact or fluent.
pub(super) fn terms_of(change: &Change) -> &[Term] {
    match change {
        Change::Add(atom) | Change::Delete(atom) => &atom.arguments,
        Change::Update { fluent, .. } => &fluent.arguments,
    }
}

/// Returns `true` if no condition depends on the start of the action: none reads any of the events
/// that it causes before its end.
pub(super) fn is_start_silent(schema: &Schema, read: &Symbols) -> bool {
    match &schema.body {
        Body::Instantaneous { .. } => true,
        Body::Durative {
            start_effects,
            continuous,
            ..
        } => {
            let changes = start_effects.iter().map(|effect| symbol_of(&effect.change));
            let fluents = continuous.iter().map(|effect| effect.fluent.function);
            let mut events = changes.chain(fluents.map(Symbol::Changed));
            events.all(|event| !read.contains(event))
        }
    }
}

/// Returns all kinds of events that could make some condition of the problem true, including the
/// goal.
pub(super) fn read(problem: &Problem) -> Symbols {
    let mut read = Symbols::default();
    let mut visit = |symbol| {
        read.insert(symbol);
    };
    for schema in &problem.schemas {
        visit_body(&schema.body, &mut visit);
    }
    for rule in &problem.rules {
        visit_condition(&rule.body, true, &mut visit);
    }
    visit_condition(&problem.goal, true, &mut visit);
    read
}

fn visit_body(body: &Body, visit: &mut impl FnMut(Symbol)) {
    let (conditions, effects): (Vec<_>, Vec<_>) = match body {
        Body::Instantaneous { condition, effects } => (vec![condition], effects.iter().collect()),
        Body::Durative {
            duration,
            at_start,
            over_all,
            at_end,
            start_effects,
            end_effects,
            continuous,
        } => {
            for constraint in duration {
                visit_expression(&constraint.bound, visit);
            }
            for effect in continuous {
                visit_condition(&effect.guard.at_start, true, visit);
                visit_condition(&effect.guard.over_all, true, visit);
            }
            (
                vec![at_start, over_all, at_end],
                start_effects.iter().chain(end_effects).collect(),
            )
        }
    };
    for condition in conditions {
        visit_condition(condition, true, visit);
    }
    for effect in effects {
        for condition in [
            &effect.guard.at_start,
            &effect.guard.over_all,
            &effect.guard.now,
        ] {
            visit_condition(condition, true, visit);
        }
    }
}

/// Calls `visit` for each kind of event that could contribute to making the condition true, or, if
/// not `wanted`, false.
pub(super) fn visit_condition(condition: &Condition, wanted: bool, visit: &mut impl FnMut(Symbol)) {
    match condition {
        Condition::Atom(atom) if wanted => visit(Symbol::True(atom.predicate)),
        Condition::Atom(atom) => visit(Symbol::False(atom.predicate)),
        Condition::Equal(..) => {}
        Condition::Compare(_, left, right) => {
            visit_expression(left, visit);
            visit_expression(right, visit);
        }
        Condition::Not(part) => visit_condition(part, !wanted, visit),
        Condition::And(parts) | Condition::Or(parts) => {
            for part in parts {
                visit_condition(part, wanted, visit);
            }
        }
        Condition::Forall(_, part) | Condition::Exists(_, part) => {
            visit_condition(part, wanted, visit);
        }
    }
}

/// Calls `visit` for the change of each function read.
pub(super) fn visit_expression(expression: &Expression, visit: &mut impl FnMut(Symbol)) {
    expression.visit_fluents(&mut |fluent| visit(Symbol::Changed(fluent.function)));
}
