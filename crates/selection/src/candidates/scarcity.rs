//! Variants of problems with less production or more consumption than planned.

use elbowroom_model::Task;
use elbowroom_model::problem::{
    Body, Change, Effect, Expression, Fluent, ObjectId, Problem, SchemaId, Term, UpdateOperator,
};
use elbowroom_num::Rational;
use elbowroom_sim::draw::keyed;
use elbowroom_sim::{Purpose, Rule, WorldModel};

use super::variant::{SAMPLES, SEED, quantile_index};
use crate::rewrite::add_function_of;

/// Scarcity of amounts in a variant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Scarcity {
    /// The quantile, in percent: in this share of cases, the amounts are no scarcer than in the
    /// variant.
    pub(super) quantile: u64,
    /// The position of the rule in the world; `None` for all rules.
    pub(super) of: Option<usize>,
}

/// Returns the scarcities to plan for. Those of a single rule come first: if several amounts are
/// scarce at once, there may be no plan, but plans for a single scarce amount are still useful.
pub(super) fn scarcities(world: &WorldModel) -> Vec<Scarcity> {
    let rules =
        || (0..world.amounts.len()).filter(|place| !world.amounts[*place].rule.is_certain());
    let mut all = Vec::new();
    for quantile in [80, 95, 99] {
        let of = |place| Scarcity {
            quantile,
            of: Some(place),
        };
        all.extend(rules().map(of));
        if quantile == 80 && rules().count() > 1 {
            all.push(Scarcity { quantile, of: None });
        }
    }
    all
}

impl Scarcity {
    /// Describes the variant for users.
    pub(super) fn describe(self, world: Option<&WorldModel>) -> String {
        let rule = self.of.and_then(|place| world?.amounts.get(place));
        let what = rule.map_or("amounts".to_owned(), |rule| rule.fluent.to_string());
        let quantile = self.quantile;
        format!("for {what} scarcer than in {quantile} % of cases")
    }

    /// Makes amounts scarce: the quantile of consumption, and the opposite quantile of production,
    /// but never less scarce than planned. Effects without a constant amount do not change.
    pub(super) fn apply(self, task: &Task, problem: &mut Problem, world: &WorldModel) {
        for schema in (0..problem.schemas.len()).map(SchemaId::from) {
            for (at_end, place) in updates(problem, schema) {
                let effect = &effects(problem, schema, at_end)[place];
                let Some(new) = self.scarce(task, problem, schema, effect.clone(), world) else {
                    continue;
                };
                let (values, problem_now) = new;
                *problem = problem_now;
                if let Some(effect) = effects_mut(problem, schema, at_end).get_mut(place)
                    && let Change::Update { value, .. } = &mut effect.change
                {
                    *value = values;
                }
            }
        }
    }

    /// Returns the expression that replaces a constant amount, and the problem that defines its
    /// values.
    fn scarce(
        self,
        task: &Task,
        problem: &Problem,
        schema: SchemaId,
        effect: Effect,
        world: &WorldModel,
    ) -> Option<(Expression, Problem)> {
        let Change::Update {
            operator,
            fluent,
            value: Expression::Constant(planned),
        } = effect.change
        else {
            return None;
        };
        let rule_of = |name: &str, arguments: &[ObjectId]| {
            let fluent = ground(problem, &fluent, arguments)?;
            let rules = world.amounts.iter().enumerate().rev();
            let mut rules =
                rules.filter(|(_, rule)| rule.action.matches(name) && rule.fluent.matches(&fluent));
            let (place, amount) = rules.next()?;
            self.of.is_none_or(|of| of == place).then_some(&amount.rule)
        };
        let mut is_any = false;
        let mut next = problem.clone();
        let value = add_function_of(task, schema, "amount", &mut next, &|name, arguments| {
            Some(match rule_of(name, arguments) {
                Some(rule) => self.amount(rule, operator, &planned, name, world),
                None => planned.clone(),
            })
        });
        for (_, _, given) in &next.initial_values[problem.initial_values.len()..] {
            is_any |= *given != planned;
        }
        is_any.then_some((value, next))
    }

    fn amount(
        self,
        rule: &Rule,
        operator: UpdateOperator,
        planned: &Rational,
        name: &str,
        world: &WorldModel,
    ) -> Rational {
        let draw = |sample| {
            let mut rng = keyed(SEED + sample, name, 0, Purpose::Amount);
            rule.draw(planned, &world.resolution, &mut rng)
        };
        let mut draws: Vec<Rational> = (0..SAMPLES).map(draw).collect();
        draws.sort();
        match operator {
            UpdateOperator::Decrease | UpdateOperator::ScaleDown => draws
                [quantile_index(self.quantile)]
            .clone()
            .max(planned.clone()),
            UpdateOperator::Increase | UpdateOperator::ScaleUp | UpdateOperator::Assign => {
                let few = &draws[quantile_index(100 - self.quantile.min(100))];
                few.clone().min(planned.clone())
            }
        }
    }
}

/// Returns the numeric effects of a schema: `true` for an effect at the end, and its position.
fn updates(problem: &Problem, schema: SchemaId) -> Vec<(bool, usize)> {
    let of = |at_end| {
        let numbered = effects(problem, schema, at_end).iter().enumerate();
        let updates = numbered.filter(|(_, effect)| {
            matches!(effect.change, Change::Update { .. }) && effect.variables.is_empty()
        });
        updates.map(move |(place, _)| (at_end, place))
    };
    of(false).chain(of(true)).collect()
}

fn effects(problem: &Problem, schema: SchemaId, at_end: bool) -> &[Effect] {
    match (&problem.schemas[schema.index()].body, at_end) {
        (Body::Instantaneous { effects, .. }, false) => effects,
        (Body::Durative { start_effects, .. }, false) => start_effects,
        (Body::Durative { end_effects, .. }, true) => end_effects,
        (Body::Instantaneous { .. }, true) => &[],
    }
}

fn effects_mut(problem: &mut Problem, schema: SchemaId, at_end: bool) -> &mut [Effect] {
    match (&mut problem.schemas[schema.index()].body, at_end) {
        (Body::Instantaneous { effects, .. }, false) => effects,
        (Body::Durative { start_effects, .. }, false) => start_effects,
        (Body::Durative { end_effects, .. }, true) => end_effects,
        (Body::Instantaneous { .. }, true) => &mut [],
    }
}

/// Returns the name of a fluent of an instance.
fn ground(problem: &Problem, fluent: &Fluent, arguments: &[ObjectId]) -> Option<String> {
    let mut name = format!("({}", problem.functions[fluent.function.index()].name);
    for term in &fluent.arguments {
        let object = match term {
            Term::Variable(place) => *arguments.get(*place)?,
            Term::Object(object) => *object,
        };
        name.push(' ');
        name.push_str(&problem.objects[object.index()].name);
    }
    name.push(')');
    Some(name)
}
