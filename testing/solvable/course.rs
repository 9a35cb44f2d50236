//! PDDL 3 constraints.

use super::conditions::{self, Scope};
use super::is_valid;
use super::random::Random;
use super::sketch::{OBJECTS, ONE, Sketch, decimal};

/// Adds constraints that the plan meets.
pub(crate) fn add(random: &mut Random, sketch: &mut Sketch) {
    for _ in 0..2 + random.below(4) {
        let constraint = draw(random, sketch);
        sketch.constraints.push(constraint);
        if !is_valid(sketch, true) {
            sketch.constraints.pop();
        }
    }
}

fn draw(random: &mut Random, sketch: &Sketch) -> String {
    let scope = Scope {
        terms: &OBJECTS,
        reads_duration: false,
    };
    let first = conditions::draw(random, sketch, &scope, 1);
    let second = conditions::draw(random, sketch, &scope, 1);
    let time = random.pick(&[0, ONE, 2 * ONE, 3 * ONE, 5 * ONE, 10 * ONE]);
    let later = decimal(time + random.pick(&[ONE / 2, ONE, 5 * ONE]));
    let time = decimal(time);
    match random.below(9) {
        0 => format!("(always {first})"),
        1 => format!("(sometime {first})"),
        2 => format!("(within {later} {first})"),
        3 => format!("(at-most-once {first})"),
        4 => format!("(sometime-after {first} {second})"),
        5 => format!("(sometime-before {first} {second})"),
        6 => format!("(always-within {later} {first} {second})"),
        7 => format!("(hold-during {time} {later} {first})"),
        _ => format!("(hold-after {time} {first})"),
    }
}
