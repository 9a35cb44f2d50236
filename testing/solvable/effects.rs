//! Actions: durations and effects.

use super::conditions::{self, Scope, fluent, terms};
use super::random::Random;
use super::sketch::{Lasting, ONE, Schema, Sketch, decimal};
use super::world::multiple;

pub(crate) fn draw(random: &mut Random, sketch: &mut Sketch) {
    let features = sketch.features;
    let more = usize::from(features.busy);
    for _ in 0..=random.below(3) + more {
        let duration =
            (!features.instantaneous || random.chance(60)).then(|| lasting(random, sketch));
        let mut schema = Schema {
            has_parameter: random.chance(50),
            duration,
            conditions: Vec::new(),
            effects: Vec::new(),
        };
        for _ in 0..=random.below(4) + more {
            let effect = effect(random, sketch, &schema);
            schema.effects.push(effect);
        }
        sketch.schemas.push(schema);
    }
}

fn lasting(random: &mut Random, sketch: &Sketch) -> Lasting {
    let features = sketch.features;
    let mut least = random.pick(&[ONE, 2 * ONE, 3 * ONE, 5 * ONE, ONE / 2, 10 * ONE]);
    if features.extreme && random.chance(30) {
        let exponent = random.below(20);
        least = 10_i128.pow(u32::try_from(exponent).expect("small"));
    }
    if features.zero && random.chance(50) {
        least = 0;
    }
    let most = if features.inequalities && random.chance(60) {
        least + random.pick(&[ONE, 2 * ONE, 5 * ONE, 100 * ONE])
    } else {
        least
    };
    Lasting { least, most }
}

fn effect(random: &mut Random, sketch: &Sketch, schema: &Schema) -> String {
    let features = sketch.features;
    if features.continuous && schema.duration.is_some() && random.chance(30) {
        return continuous(random, sketch, schema);
    }
    let mut list = terms(schema.has_parameter).to_vec();
    let is_for_all = features.quantifiers && features.conditional && random.chance(40);
    if is_for_all {
        list.extend(["?q", "?q", "?q"]);
    }
    let scope = Scope {
        terms: &list,
        reads_duration: false,
    };
    let when = random.pick(&["at start", "at end"]);
    let mut change = change(random, sketch, &scope, schema);
    let timed = |when: &str, text: &str| match schema.duration {
        None => text.to_owned(),
        Some(_) => format!("({when} {text})"),
    };
    change = timed(when, &change);
    if features.conditional && (is_for_all || random.chance(40)) {
        let guard = conditions::draw(random, sketch, &scope, 1);
        let reads = if when == "at end" && random.chance(40) {
            "at start"
        } else {
            when
        };
        change = format!("(when {} {change})", timed(reads, &guard));
    }
    if is_for_all {
        change = format!("(forall (?q - thing) {change})");
    }
    change
}

fn change(random: &mut Random, sketch: &Sketch, scope: &Scope<'_>, schema: &Schema) -> String {
    let is_numeric = !sketch.functions.is_empty() && random.chance(40);
    if !is_numeric {
        let number = random.below(sketch.predicates.len());
        let argument = match sketch.predicates[number] {
            0 => String::new(),
            _ => format!(" {}", random.pick(scope.terms)),
        };
        let atom = format!("(p{number}{argument})");
        return if random.chance(35) {
            format!("(not {atom})")
        } else {
            atom
        };
    }
    let number = random.below(sketch.functions.len());
    let fluent = fluent(random, sketch, scope, number);
    let operator = random.pick(&["increase", "increase", "decrease", "assign", "scale-up"]);
    let mut amount = decimal(multiple(random, sketch, number));
    let is_durative = schema.duration.is_some();
    if sketch.features.reads_duration && is_durative && random.chance(60) {
        amount = random.pick(&[
            "?duration".to_owned(),
            format!("(* {amount} ?duration)"),
            format!("(+ {amount} ?duration)"),
        ]);
    } else if random.chance(15) {
        let other = random.below(sketch.functions.len());
        amount = self::fluent(random, sketch, scope, other);
    }
    format!("({operator} {fluent} {amount})")
}

fn continuous(random: &mut Random, sketch: &Sketch, schema: &Schema) -> String {
    let scope = Scope {
        terms: terms(schema.has_parameter),
        reads_duration: false,
    };
    let number = random.below(sketch.functions.len());
    let fluent = fluent(random, sketch, &scope, number);
    let operator = random.pick(&["increase", "decrease"]);
    let rate = decimal(multiple(random, sketch, number).abs());
    format!("({operator} {fluent} (* #t {rate}))")
}
