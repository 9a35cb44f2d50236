//! Facts and fluents that actions read and change.

use elbowroom_model::ground::{self, Body, Change as ModelChange};

use super::symbols::Symbols;
use super::{Action, Change, Snap, Update};
use crate::embedded::formula::{Formula, Test};

/// Numbers the facts and fluents in the action's conditions.
pub(super) fn read_action(symbols: &mut Symbols, action: &ground::Action) {
    let snap = |symbols: &mut Symbols, snap: &ground::SnapAction| {
        symbols.formula(&snap.condition);
        for effect in &snap.effects {
            symbols.formula(&effect.guard.now);
            symbols.formula(&effect.guard.at_start);
        }
    };
    match &action.body {
        Body::Instantaneous(body) => snap(symbols, body),
        Body::Durative(body) => {
            snap(symbols, &body.start);
            snap(symbols, &body.end);
            symbols.formula(&body.over_all);
            for constraint in &body.duration {
                symbols.numeric(&constraint.bound);
            }
            for effect in &body.continuous {
                symbols.formula(&effect.guard.at_start);
            }
        }
    }
}

/// Calls `visit` for each numeric effect of the action.
pub(in crate::embedded) fn visit_changes(
    action: &ground::Action,
    visit: &mut impl FnMut(ground::FluentId, &ground::Expression),
) {
    let effects = |effects: &[ground::Effect], visit: &mut dyn FnMut(_, &_)| {
        for effect in effects {
            if let ModelChange::Update { fluent, value, .. } = &effect.change {
                visit(*fluent, value);
            }
        }
    };
    match &action.body {
        Body::Instantaneous(body) => effects(&body.effects, visit),
        Body::Durative(body) => {
            effects(&body.start.effects, visit);
            effects(&body.end.effects, visit);
            for effect in &body.continuous {
                visit(effect.fluent, &effect.rate);
            }
        }
    }
}

/// Calls `visit` for each fluent that several effects of one moment update, not all of them by
/// increases and decreases.
pub(super) fn visit_disputed(action: &ground::Action, visit: &mut impl FnMut(ground::FluentId)) {
    let mut look = |effects: &[ground::Effect]| {
        let updates = effects.iter().filter_map(|effect| match &effect.change {
            ModelChange::Update {
                operator, fluent, ..
            } => Some((*fluent, operator.is_additive())),
            _ => None,
        });
        let updates: Vec<_> = updates.collect();
        for (place, &(fluent, is_additive)) in updates.iter().enumerate() {
            let others = &updates[..place];
            if others
                .iter()
                .any(|&(other, also)| other == fluent && !(is_additive && also))
            {
                visit(fluent);
            }
        }
    };
    match &action.body {
        Body::Instantaneous(body) => look(&body.effects),
        Body::Durative(body) => {
            look(&body.start.effects);
            look(&body.end.effects);
        }
    }
}

/// Calls `visit` for each fluent in the tests of a formula.
pub(super) fn visit_tests(formula: &Formula, tests: &[Test], visit: &mut dyn FnMut(u32)) {
    formula.visit_tests(&mut |test| tests[test as usize].difference.visit_fluents(visit));
}

/// Calls `visit` for each fluent that the compiled action reads or changes.
pub(super) fn visit_fluents(
    action: &Action,
    snaps: &[Snap],
    tests: &[Test],
    visit: &mut dyn FnMut(u32),
) {
    let update = |update: &Update, visit: &mut dyn FnMut(u32)| {
        visit(update.fluent);
        update.value.visit_fluents(visit);
    };
    for snap in [action.start, action.end] {
        let Some(snap) = snaps.get(snap as usize) else {
            continue;
        };
        visit_tests(&snap.condition, tests, visit);
        snap.updates.iter().for_each(|own| update(own, visit));
        for effect in &snap.conditional {
            visit_tests(&effect.now, tests, visit);
            match &effect.change {
                Change::Update(own) => update(own, visit),
                Change::Cost(value) => value.visit_fluents(visit),
                Change::Add(_) | Change::Delete(_) => {}
            }
        }
        if let Some(cost) = &snap.cost {
            cost.visit_fluents(visit);
        }
    }
    visit_tests(&action.over_all, tests, visit);
    for guard in &action.guards {
        visit_tests(guard, tests, visit);
    }
    for bound in &action.duration.bounds {
        bound.value.visit_fluents(visit);
    }
    for flow in &action.flows {
        visit(flow.fluent);
        flow.rate.visit_fluents(visit);
    }
}
