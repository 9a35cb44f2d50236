//! Regression: conditions after the effects of a happening, as conditions of the state before it.
//!
//! Effects are those of a schema, so their arguments may be variables. Clauses contain objects
//! only.

use elbowroom_model::problem::{
    Atom, Change, Condition, Effect, Expression, Fluent, FunctionId, ObjectId, PredicateId,
    Problem, Term, UpdateOperator, Variable,
};

use super::clauses::{Literal, LiteralSubject, Number, Numbers};

/// Maximum number of ways in which the effects of one happening can change the fluents of a
/// comparison.
const MAX_WAYS: usize = 64;

/// Effects that cannot be regressed.
#[derive(Clone, Copy, Debug)]
pub(super) enum Difficulty {
    /// An effect under a condition at another moment.
    Guarded,
    /// A number that changes continuously, or in too many ways.
    Moving,
}

/// One moment of a schema: its parameters and effects.
#[derive(Clone, Copy)]
pub(super) struct Moment<'a> {
    pub(super) problem: &'a Problem,
    pub(super) numbers: &'a Numbers,
    pub(super) parameters: &'a [Variable],
    pub(super) effects: &'a [Effect],
}

/// A fluent whose arguments are objects.
type Ground = (FunctionId, Vec<ObjectId>);

impl Moment<'_> {
    /// Returns the condition under which this effect alone makes a literal false, or `None` if it
    /// never does.
    pub(super) fn falsifies(
        &self,
        effect: &Effect,
        literal: &Literal,
    ) -> Result<Option<Condition>, Difficulty> {
        match &literal.subject {
            LiteralSubject::Fact(predicate, objects) => {
                self.effect_condition(effect, *predicate, objects, !literal.truth)
            }
            LiteralSubject::Number(position) => {
                let mut ways = Vec::new();
                for fluent in fluents(self.numbers.get(*position)) {
                    ways.extend(self.updates(effect, &fluent)?);
                }
                Ok((!ways.is_empty()).then(|| any(ways)))
            }
        }
    }

    /// Returns the condition before the happening under which a literal holds after it.
    pub(super) fn before(&self, literal: &Literal) -> Result<Condition, Difficulty> {
        let now = literal.condition(self.numbers);
        match &literal.subject {
            LiteralSubject::Fact(predicate, objects) => {
                let adds = self.writers(*predicate, objects, true)?;
                let deletes = self.writers(*predicate, objects, false)?;
                // Additions win.
                Ok(if literal.truth {
                    let mut ways = adds;
                    ways.push(all([now].into_iter().chain(deletes.into_iter().map(not))));
                    any(ways)
                } else {
                    let mut ways = deletes;
                    ways.push(now);
                    all(adds.into_iter().map(not).chain([any(ways)]))
                })
            }
            LiteralSubject::Number(position) => {
                let after = self.compared_after(self.numbers.get(*position))?;
                Ok(if literal.truth { after } else { not(after) })
            }
        }
    }

    /// Returns `true` if some effect may make the fact of this literal true.
    pub(super) fn adds(&self, literal: &Literal) -> bool {
        self.effects
            .iter()
            .any(|effect| match (&effect.change, &literal.subject) {
                (Change::Add(atom), LiteralSubject::Fact(predicate, _)) => {
                    atom.predicate == *predicate
                }
                _ => false,
            })
    }

    /// Returns for each of these literals the condition before the happening under which it holds
    /// after it.
    pub(super) fn before_any<'l>(
        &self,
        clause: impl IntoIterator<Item = &'l Literal>,
    ) -> Result<Vec<Condition>, Difficulty> {
        clause.into_iter().map(|one| self.before(one)).collect()
    }

    fn writers(
        &self,
        predicate: PredicateId,
        objects: &[ObjectId],
        truth: bool,
    ) -> Result<Vec<Condition>, Difficulty> {
        let mut found = Vec::new();
        for effect in self.effects {
            found.extend(self.effect_condition(effect, predicate, objects, truth)?);
        }
        Ok(found)
    }

    /// Returns the condition under which an effect gives a fact this truth.
    fn effect_condition(
        &self,
        effect: &Effect,
        predicate: PredicateId,
        objects: &[ObjectId],
        truth: bool,
    ) -> Result<Option<Condition>, Difficulty> {
        match &effect.change {
            Change::Add(atom) if truth => self.fires(effect, atom, predicate, objects),
            Change::Delete(atom) if !truth => self.fires(effect, atom, predicate, objects),
            _ => Ok(None),
        }
    }

    fn fires(
        &self,
        effect: &Effect,
        atom: &Atom,
        predicate: PredicateId,
        objects: &[ObjectId],
    ) -> Result<Option<Condition>, Difficulty> {
        if atom.predicate != predicate {
            return Ok(None);
        }
        self.equality_condition(effect, &atom.arguments, objects)
    }

    /// Returns the condition under which an effect changes a fluent.
    fn updates(&self, effect: &Effect, fluent: &Ground) -> Result<Option<Condition>, Difficulty> {
        match &effect.change {
            Change::Update { fluent: own, .. } if own.function == fluent.0 => {
                self.equality_condition(effect, &own.arguments, &fluent.1)
            }
            _ => Ok(None),
        }
    }

    /// Returns the condition under which the arguments denote these objects.
    fn equality_condition(
        &self,
        effect: &Effect,
        arguments: &[Term],
        objects: &[ObjectId],
    ) -> Result<Option<Condition>, Difficulty> {
        let variables: Vec<&Variable> = self.parameters.iter().chain(&effect.variables).collect();
        let mut same = Vec::new();
        for (&term, &object) in arguments.iter().zip(objects) {
            match term {
                Term::Object(own) if own == object => {}
                Term::Variable(position)
                    if self.problem.has_type(object, &variables[position].types) =>
                {
                    same.push(Condition::Equal(term, Term::Object(object)));
                }
                Term::Object(_) | Term::Variable(_) => return Ok(None),
            }
        }
        if !effect.guard.at_start.is_trivial() || !effect.guard.over_all.is_trivial() {
            return Err(Difficulty::Guarded);
        }
        same.push(effect.guard.now.clone());
        let fires = all(same);
        Ok(Some(if effect.variables.is_empty() {
            fires
        } else {
            Condition::Exists(effect.variables.clone(), Box::new(fires))
        }))
    }

    /// Returns the condition before the happening under which a comparison holds after it.
    fn compared_after(&self, number: &Number) -> Result<Condition, Difficulty> {
        /// The conditions of a way, and the updates that it consists of.
        type UpdatePath = (Vec<Condition>, Vec<(usize, Ground)>);
        let fluents = fluents(number);
        let mut ways: Vec<UpdatePath> = vec![UpdatePath::default()];
        for (position, effect) in self.effects.iter().enumerate() {
            for fluent in &fluents {
                let Some(fires) = self.updates(effect, fluent)? else {
                    continue;
                };
                if !effect.variables.is_empty() {
                    return Err(Difficulty::Moving);
                }
                let mut more = Vec::new();
                for (conditions, done) in ways {
                    // One effect changes one fluent.
                    if done.iter().all(|(other, _)| *other != position) {
                        let mut with = (conditions.clone(), done.clone());
                        with.0.push(fires.clone());
                        with.1.push((position, fluent.clone()));
                        more.push(with);
                    }
                    let mut left = conditions;
                    left.push(not(fires.clone()));
                    more.push((left, done));
                }
                ways = more;
                if ways.len() > MAX_WAYS {
                    return Err(Difficulty::Moving);
                }
            }
        }
        let mut found = Vec::new();
        for (mut conditions, done) in ways {
            let mut difficulty = None;
            let mut after = |side: &Expression| {
                side.map_leaves(&mut |leaf| {
                    let Expression::Fluent(fluent) = leaf else {
                        return None;
                    };
                    let own = done.iter().filter(|(_, other)| *other == ground(fluent));
                    match self.value_after(fluent, own.map(|(position, _)| *position)) {
                        Ok(value) => Some(value),
                        Err(other) => {
                            difficulty = Some(other);
                            None
                        }
                    }
                })
            };
            let (left, right) = (after(&number.1), after(&number.2));
            if let Some(difficulty) = difficulty {
                return Err(difficulty);
            }
            conditions.push(Condition::Compare(number.0, left, right));
            found.push(all(conditions));
        }
        Ok(any(found))
    }

    /// Returns a fluent's value after these effects.
    fn value_after(
        &self,
        fluent: &Fluent,
        effects: impl Iterator<Item = usize>,
    ) -> Result<Expression, Difficulty> {
        let mut value = Expression::Fluent(fluent.clone());
        let effects: Vec<usize> = effects.collect();
        let is_one = effects.len() == 1;
        for position in effects {
            let Change::Update {
                operator,
                value: amount,
                ..
            } = &self.effects[position].change
            else {
                continue;
            };
            // Only sums do not depend on the order of their parts.
            if !is_one && !operator.is_additive() {
                return Err(Difficulty::Moving);
            }
            let amount = amount.clone();
            value = match operator {
                UpdateOperator::Assign => amount,
                UpdateOperator::Increase => Expression::Add(vec![value, amount]),
                UpdateOperator::Decrease => Expression::Subtract(Box::new(value), Box::new(amount)),
                UpdateOperator::ScaleUp => Expression::Multiply(vec![value, amount]),
                UpdateOperator::ScaleDown => Expression::Divide(Box::new(value), Box::new(amount)),
            };
        }
        Ok(value)
    }
}

/// Returns the fluents that a comparison reads.
fn fluents(number: &Number) -> Vec<Ground> {
    let mut found: Vec<Ground> = Vec::new();
    for side in [&number.1, &number.2] {
        side.visit_fluents(&mut |fluent| {
            let fluent = ground(fluent);
            if !found.contains(&fluent) {
                found.push(fluent);
            }
        });
    }
    found
}

fn ground(fluent: &Fluent) -> Ground {
    (fluent.function, objects(&fluent.arguments))
}

/// Returns the objects among arguments without variables.
pub(super) fn objects(arguments: &[Term]) -> Vec<ObjectId> {
    let object = |term: &Term| match term {
        Term::Object(object) => Some(*object),
        Term::Variable(_) => None,
    };
    arguments.iter().filter_map(object).collect()
}

pub(super) fn not(condition: Condition) -> Condition {
    match condition {
        Condition::Not(part) => *part,
        other => Condition::Not(Box::new(other)),
    }
}

pub(super) fn all(parts: impl IntoIterator<Item = Condition>) -> Condition {
    let parts = parts.into_iter().filter(|part| !part.is_trivial());
    let mut parts: Vec<Condition> = parts.collect();
    match parts.len() {
        1 => parts.remove(0),
        _ => Condition::And(parts),
    }
}

pub(super) fn any(mut parts: Vec<Condition>) -> Condition {
    match parts.len() {
        1 => parts.remove(0),
        _ => Condition::Or(parts),
    }
}
