//! Features that cannot be searched.

use elbowroom_model::ground;

/// A feature that the embedded planner does not support, with the action or other element that uses
/// it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the embedded planner does not handle {feature} ({place}); try an external planner")]
pub struct Unsupported {
    /// The feature that is not supported.
    pub feature: String,
    /// The action or other element that uses it.
    pub place: String,
}

/// Rejects actions that cannot be searched.
pub(super) fn check(action: &ground::Action) -> Result<(), Unsupported> {
    let refuse = |feature: &str| {
        Err(Unsupported {
            feature: feature.to_owned(),
            place: format!("action {}", action.name),
        })
    };
    let mut has_unknown = false;
    let _ = action.map_leaves(&mut |leaf| {
        has_unknown |= matches!(leaf, ground::Expression::Unknown(_));
        None
    });
    if has_unknown {
        return refuse("open numbers (:synth-parameters)");
    }
    let Some(body) = action.durative() else {
        return Ok(());
    };
    let guarded = |effect: &&ground::Effect| !effect.guard.over_all.is_trivial();
    if body.end.effects.iter().any(|e| guarded(&e)) {
        return refuse("effects under a condition over the whole action");
    }
    if body
        .continuous
        .iter()
        .any(|e| !e.guard.over_all.is_trivial())
    {
        return refuse("continuous effects under a condition over the whole action");
    }
    Ok(())
}
