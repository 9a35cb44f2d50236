//! The conditions and effects of happenings that can make clauses false.

use elbowroom_model::problem::{Condition, Effect, Guard};

use super::Obstacle;
use super::clauses::{Literal, LiteralSubject};
use super::regression::{Difficulty, Moment, all, any, not};
use super::rewriting::{Consequence, GUARDED, MOVING, Rewriting, WatchedClause};

impl Rewriting<'_> {
    /// Returns the conditions and effects that a happening gets in addition to its own, because of
    /// the clauses that it can make false.
    pub(super) fn consequences(
        &self,
        moment: &Moment<'_>,
    ) -> Result<(Vec<Condition>, Vec<Effect>), Obstacle> {
        let (mut needs, mut more) = (Vec::new(), Vec::new());
        for effect in moment.effects {
            for one in &self.watched {
                for literal in &one.clause {
                    let found = consequence(moment, effect, (one, literal)).map_err(to_obstacle);
                    match self.apply_coverage(found)?.flatten() {
                        Some(Consequent::Need(need)) => needs.push(need),
                        Some(Consequent::Effect(effect)) => more.push(effect),
                        None => {}
                    }
                }
            }
        }
        Ok((needs, more))
    }
}

fn to_obstacle(difficulty: Difficulty) -> Obstacle {
    match difficulty {
        Difficulty::Guarded => GUARDED,
        Difficulty::Moving => MOVING,
    }
}

/// The effect of a clause on a happening.
enum Consequent {
    Need(Condition),
    Effect(Effect),
}

/// Returns the consequence of a literal of a clause that an effect may make false, or `None` if it
/// never does.
fn consequence(
    moment: &Moment<'_>,
    effect: &Effect,
    (one, literal): (&WatchedClause, &Literal),
) -> Result<Option<Consequent>, Difficulty> {
    let Some(falsifies) = moment.falsifies(effect, literal)? else {
        return Ok(None);
    };
    // Another literal holds afterwards, or this one does because of another effect.
    let is_regained = match &literal.subject {
        LiteralSubject::Fact(..) => literal.truth && moment.adds(literal),
        LiteralSubject::Number(_) => true,
    };
    let others = one.clause.iter();
    let mut ways = moment.before_any(others.filter(|other| is_regained || *other != literal))?;
    let (when, change) = match &one.consequence {
        Consequence::Never => {
            ways.insert(0, not(falsifies));
            return Ok(Some(Consequent::Need(any(ways))));
        }
        Consequence::Effect(when, change) => (when.clone(), change),
        Consequence::EffectOrObservation(change, _) => (Condition::TRUE, change),
    };
    let now = all([when, falsifies]
        .into_iter()
        .chain(ways.into_iter().map(not)));
    Ok(Some(Consequent::Effect(Effect {
        variables: Vec::new(),
        guard: Guard {
            now,
            ..Guard::default()
        },
        change: change.clone(),
    })))
}
