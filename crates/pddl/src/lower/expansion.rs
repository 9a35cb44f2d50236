//! How large conditions and effects become when quantifiers are expanded.
//!
//! The model expands quantifiers over objects. A few nested ones over many objects would use up
//! all memory there, so they are refused here, where the text can be shown.

use elbowroom_model::Problem;
use elbowroom_model::problem::{Body, Condition, Effect, Guard, Variable};

use crate::lower::Reader;
use crate::source::Span;

/// Most parts that one condition, or the effects of one action, may have when expanded.
const MOST_PARTS: u64 = 10_000_000;

impl Reader {
    /// Reports what is too large when expanded. Objects must have been read.
    pub(super) fn check_expansion(&mut self, goal: Option<Span>) {
        let problem = &self.problem;
        let mut too_large: Vec<(Span, String)> = Vec::new();
        let mut check = |size: u64, span: Span, what: String| {
            if size > MOST_PARTS {
                too_large.push((span, what));
            }
        };
        if let Some(span) = goal {
            check(
                of_condition(&problem.goal, problem),
                span,
                "the goal".to_owned(),
            );
        }
        for (rule, span) in problem.rules.iter().zip(&self.rule_spans) {
            let name = &problem.predicates[rule.predicate.index()].name;
            let size = of_condition(&rule.body, problem);
            check(size, *span, format!("this rule of `{name}`"));
        }
        for (schema, span) in problem.schemas.iter().zip(&self.schema_spans) {
            let size = of_body(&schema.body, problem);
            check(size, *span, format!("action `{}`", schema.name));
        }
        for (span, what) in too_large {
            self.report
                .error(span, format!("{what} has more than {MOST_PARTS} parts"))
                .label("when its quantifiers are expanded")
                .help("use fewer nested quantifiers, or narrower types");
        }
    }
}

fn of_body(body: &Body, problem: &Problem) -> u64 {
    match body {
        Body::Instantaneous { condition, effects } => {
            of_condition(condition, problem).saturating_add(of_effects(effects, problem))
        }
        Body::Durative {
            at_start,
            over_all,
            at_end,
            start_effects,
            end_effects,
            continuous,
            ..
        } => {
            let conditions = [at_start, over_all, at_end].map(|part| of_condition(part, problem));
            let effects = [start_effects, end_effects].map(|part| of_effects(part, problem));
            let continuous = continuous
                .iter()
                .map(|effect| of_guarded(&effect.variables, &effect.guard, problem));
            sum(conditions.into_iter().chain(effects).chain(continuous))
        }
    }
}

fn of_effects(effects: &[Effect], problem: &Problem) -> u64 {
    sum(effects
        .iter()
        .map(|effect| of_guarded(&effect.variables, &effect.guard, problem)))
}

fn of_guarded(variables: &[Variable], guard: &Guard, problem: &Problem) -> u64 {
    let parts = [&guard.at_start, &guard.over_all, &guard.now];
    let guard = sum(parts.map(|part| of_condition(part, problem)));
    combinations(variables, problem).saturating_mul(guard.saturating_add(1))
}

fn of_condition(condition: &Condition, problem: &Problem) -> u64 {
    match condition {
        Condition::Atom(_) | Condition::Equal(..) | Condition::Compare(..) => 1,
        Condition::Not(part) => of_condition(part, problem),
        Condition::And(parts) | Condition::Or(parts) => {
            sum(parts.iter().map(|part| of_condition(part, problem)))
        }
        Condition::Forall(variables, part) | Condition::Exists(variables, part) => {
            combinations(variables, problem).saturating_mul(of_condition(part, problem))
        }
    }
}

/// How many ways there are to choose objects for the variables.
fn combinations(variables: &[Variable], problem: &Problem) -> u64 {
    variables.iter().fold(1, |product: u64, variable| {
        let objects = problem.objects_of(&variable.types).count();
        product.saturating_mul(u64::try_from(objects).unwrap_or(u64::MAX))
    })
}

fn sum(sizes: impl IntoIterator<Item = u64>) -> u64 {
    sizes.into_iter().fold(0, u64::saturating_add)
}
