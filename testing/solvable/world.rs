//! Vocabulary, initial state, timed initial literals and fluents, derived predicates.

use super::conditions::{self, Scope};
use super::random::Random;
use super::sketch::{Function, OBJECTS, ONE, Sketch, decimal};

pub(crate) fn draw(random: &mut Random, sketch: &mut Sketch) {
    let features = sketch.features;
    for _ in 0..2 + random.below(3) {
        sketch.predicates.push(usize::from(random.chance(40)));
    }
    if features.numbers || features.continuous || features.reads_duration {
        for _ in 0..=random.below(2) {
            let arity = usize::from(!features.one_number && random.chance(30));
            let unit = unit(random, features.extreme);
            sketch.functions.push(Function { arity, unit });
            if features.one_number {
                break;
            }
        }
    }
    for number in 0..sketch.predicates.len() {
        for argument in arguments(sketch.predicates[number]) {
            if random.chance(30) {
                sketch.initial.push(format!("(p{number}{argument})"));
            }
        }
    }
    for number in 0..sketch.functions.len() {
        for argument in arguments(sketch.functions[number].arity) {
            let value = decimal(multiple(random, sketch, number));
            sketch
                .initial
                .push(format!("(= (n{number}{argument}) {value})"));
        }
    }
    if features.derived {
        derive(random, sketch);
    }
    if features.timed {
        timed(random, sketch);
    }
}

/// Returns the ways to write the arguments of a ground atom.
pub(crate) fn arguments(arity: usize) -> Vec<String> {
    match arity {
        0 => vec![String::new()],
        _ => OBJECTS.iter().map(|object| format!(" {object}")).collect(),
    }
}

/// Unit of a fluent, in billionths.
fn unit(random: &mut Random, extreme: bool) -> i128 {
    if extreme {
        let exponent = random.below(20);
        10_i128.pow(u32::try_from(exponent).expect("small"))
    } else {
        random.pick(&[ONE, ONE, ONE, ONE / 2, ONE / 4, 3 * ONE])
    }
}

/// A small multiple of the unit of a fluent, in billionths.
pub(crate) fn multiple(random: &mut Random, sketch: &Sketch, function: usize) -> i128 {
    let factor = random.pick(&[-2, -1, 0, 0, 1, 1, 2, 3, 4, 5, 6, 10]);
    let unit = if sketch.features.extreme && random.chance(10) {
        unit(random, true)
    } else {
        sketch.functions[function].unit
    };
    factor * unit
}

fn derive(random: &mut Random, sketch: &mut Sketch) {
    for number in 0..=random.below(2) {
        let arity = usize::from(random.chance(40));
        let (terms, head): (&[&str], &str) = if arity == 0 {
            (&["a", "b"], "")
        } else {
            (&["?x", "?x", "a", "b"], " ?x - thing")
        };
        let bodies = 1 + usize::from(random.chance(30));
        for _ in 0..bodies {
            let scope = Scope {
                terms,
                reads_duration: false,
            };
            let body = conditions::draw(random, sketch, &scope, 2);
            sketch
                .rules
                .push(format!("(:derived (d{number}{head}) {body})"));
        }
        sketch.derived.push(arity);
    }
}

fn timed(random: &mut Random, sketch: &mut Sketch) {
    for _ in 0..=random.below(3) {
        let time =
            decimal(random.pick(&[ONE / 2, ONE, 2 * ONE, 3 * ONE, 3 * ONE, 4 * ONE, 7 * ONE]));
        if !sketch.functions.is_empty() && random.chance(35) {
            let number = random.below(sketch.functions.len());
            let argument = random.pick(&arguments(sketch.functions[number].arity));
            let value = decimal(multiple(random, sketch, number));
            let timed = format!("(at {time} (= (n{number}{argument}) {value}))");
            add_timed(
                sketch,
                &format!("(at {time} (= (n{number}{argument})"),
                timed,
            );
        } else {
            let number = random.below(sketch.predicates.len());
            let argument = random.pick(&arguments(sketch.predicates[number]));
            let atom = format!("(p{number}{argument})");
            let literal = if random.chance(50) {
                atom.clone()
            } else {
                format!("(not {atom})")
            };
            let opposite = format!("(at {time} (not {atom}");
            let same = format!("(at {time} {atom}");
            if !sketch
                .initial
                .iter()
                .any(|part| part.starts_with(&opposite))
            {
                add_timed(sketch, &same, format!("(at {time} {literal})"));
            }
        }
    }
}

/// Adds a timed initial unless there is one that begins alike.
fn add_timed(sketch: &mut Sketch, beginning: &str, timed: String) {
    if !sketch
        .initial
        .iter()
        .any(|part| part.starts_with(beginning))
    {
        sketch.initial.push(timed);
    }
}
