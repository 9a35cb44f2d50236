//! Conditions: literals, comparisons, disjunctions and quantifiers.

use super::random::Random;
use super::sketch::{Sketch, decimal};
use super::world::{arguments, multiple};
use super::{is_valid, last_value, sketch};

/// Context of a condition.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scope<'a> {
    /// Terms that may be arguments.
    pub(crate) terms: &'a [&'a str],
    /// `true` if `?duration` may be read.
    pub(crate) reads_duration: bool,
}

/// Draws a condition; `depth` limits how deeply connectives are nested.
pub(crate) fn draw(
    random: &mut Random,
    sketch: &Sketch,
    scope: &Scope<'_>,
    depth: usize,
) -> String {
    let features = sketch.features;
    if depth > 0 && features.disjunction && random.chance(35) {
        let left = draw(random, sketch, scope, depth - 1);
        let right = draw(random, sketch, scope, depth - 1);
        return if features.negation && random.chance(15) {
            format!("(imply {left} {right})")
        } else {
            format!("(or {left} {right})")
        };
    }
    if depth > 0 && features.quantifiers && random.chance(30) {
        let kind = random.pick(&["forall", "exists"]);
        let mut terms = scope.terms.to_vec();
        terms.extend(["?q", "?q"]);
        let inner = Scope {
            terms: &terms,
            ..*scope
        };
        let body = draw(random, sketch, &inner, depth - 1);
        return format!("({kind} (?q - thing) {body})");
    }
    if depth > 0 && features.negation && random.chance(8) {
        let left = draw(random, sketch, scope, depth - 1);
        let right = draw(random, sketch, scope, depth - 1);
        return format!("(not (and {left} {right}))");
    }
    if depth > 0 && random.chance(8) {
        let left = draw(random, sketch, scope, depth - 1);
        let right = draw(random, sketch, scope, depth - 1);
        return format!("(and {left} {right})");
    }
    if !sketch.functions.is_empty() && random.chance(40) {
        comparison(random, sketch, scope)
    } else {
        literal(random, sketch, scope)
    }
}

fn literal(random: &mut Random, sketch: &Sketch, scope: &Scope<'_>) -> String {
    let derived = !sketch.derived.is_empty() && random.chance(50);
    let (prefix, arities) = if derived {
        ("d", &sketch.derived)
    } else {
        ("p", &sketch.predicates)
    };
    let number = random.below(arities.len());
    let argument = argument(random, arities[number], scope);
    let atom = format!("({prefix}{number}{argument})");
    if sketch.features.negation && random.chance(40) {
        format!("(not {atom})")
    } else {
        atom
    }
}

fn comparison(random: &mut Random, sketch: &Sketch, scope: &Scope<'_>) -> String {
    let number = random.below(sketch.functions.len());
    let fluent = fluent(random, sketch, scope, number);
    let comparison = random.pick(&[">=", "<=", ">", "<", ">=", "<=", "="]);
    let bound = if random.chance(15) {
        let other = random.below(sketch.functions.len());
        self::fluent(random, sketch, scope, other)
    } else if scope.reads_duration && random.chance(20) {
        "?duration".to_owned()
    } else {
        decimal(multiple(random, sketch, number))
    };
    format!("({comparison} {fluent} {bound})")
}

/// Draws a ground or lifted fluent of a function.
pub(crate) fn fluent(
    random: &mut Random,
    sketch: &Sketch,
    scope: &Scope<'_>,
    number: usize,
) -> String {
    let argument = argument(random, sketch.functions[number].arity, scope);
    format!("(n{number}{argument})")
}

fn argument(random: &mut Random, arity: usize, scope: &Scope<'_>) -> String {
    match arity {
        0 => String::new(),
        _ => format!(" {}", random.pick(scope.terms)),
    }
}

/// Returns the terms in a schema.
pub(crate) fn terms(has_parameter: bool) -> &'static [&'static str] {
    if has_parameter {
        &["?x", "?x", "?x", "a", "b"]
    } else {
        &["a", "b"]
    }
}

/// Adds conditions that the plan meets to the actions.
pub(crate) fn add(random: &mut Random, sketch: &mut Sketch) {
    for number in 0..sketch.schemas.len() {
        for _ in 0..2 + random.below(4) {
            let schema = &sketch.schemas[number];
            let scope = Scope {
                terms: terms(schema.has_parameter),
                reads_duration: false,
            };
            let condition = draw(random, sketch, &scope, 2);
            let condition = if schema.duration.is_some() {
                let when = random.pick(&["at start", "over all", "over all", "at end"]);
                format!("({when} {condition})")
            } else {
                condition
            };
            sketch.schemas[number].conditions.push(condition);
            if !is_valid(sketch, true) {
                sketch.schemas[number].conditions.pop();
            }
        }
    }
}

/// Adds goals that the plan reaches and the empty plan does not; `None` if none was found.
pub(crate) fn add_goal(random: &mut Random, sketch: &mut Sketch) -> Option<()> {
    let scope = Scope {
        terms: &sketch::OBJECTS,
        reads_duration: false,
    };
    let mut candidates: Vec<String> = Vec::new();
    for number in 0..sketch.predicates.len() {
        for argument in arguments(sketch.predicates[number]) {
            candidates.push(format!("(p{number}{argument})"));
        }
    }
    if sketch.features.exact_goal
        && let Some(value) = last_value(sketch)
    {
        let comparison = random.pick(&[">=", "<="]);
        candidates.insert(0, format!("({comparison} (n0) {value})"));
    }
    for _ in 0..10 {
        let candidate = draw(random, sketch, &scope, 2);
        let place = random.below(candidates.len() + 1);
        candidates.insert(place, candidate);
    }
    let mut needs_plan = !sketch.constraints.is_empty() && !is_valid(sketch, false);
    let wanted = 1 + random.below(3);
    for candidate in candidates {
        if sketch.goal.len() >= wanted {
            break;
        }
        sketch.goal.push(candidate);
        let is_reached = is_valid(sketch, true);
        let is_new = is_reached && !is_valid(sketch, false);
        if is_reached && (is_new || needs_plan && random.chance(30)) {
            needs_plan = true;
        } else {
            sketch.goal.pop();
        }
    }
    needs_plan.then_some(())
}
