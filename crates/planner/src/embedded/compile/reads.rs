//! Facts and fluents that actions read and change.

use elbowroom_model::ground::{self, Body, Change as ModelChange};

use super::symbols::Symbols;

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
pub(super) fn visit_changes(
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
