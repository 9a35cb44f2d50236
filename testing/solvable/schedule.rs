//! The witness plan: which actions, when and for how long.

use super::random::Random;
use super::sketch::{Lasting, OBJECTS, ONE, Sketch, Step};

/// ε of tasks, in billionths.
const EPSILON: i128 = ONE / 1000;

pub(crate) fn draw(random: &mut Random, sketch: &mut Sketch) {
    let features = sketch.features;
    let count = 1 + random.below(4) + 3 * usize::from(features.busy);
    let mut moments = vec![0, ONE, 3 * ONE];
    for _ in 0..count {
        let schema = random.below(sketch.schemas.len());
        let duration = sketch.schemas[schema]
            .duration
            .map_or(0, |lasting| chosen(random, lasting));
        let base = random.pick(&moments);
        let apart = if features.together && random.chance(60) {
            0
        } else {
            random.pick(&[EPSILON, EPSILON, ONE / 2, ONE / 4, ONE])
        };
        let mut step = Step {
            schema,
            object: random.pick(&OBJECTS),
            start: (base + apart).max(0),
            duration,
        };
        // A step that ends just when, or just before, something else happens.
        if random.chance(20) && base > duration + EPSILON {
            step.start = base - duration - if features.together { 0 } else { EPSILON };
        }
        moments.extend([step.start, step.start + duration]);
        let copies = features.overlap && random.chance(40);
        sketch.steps.push(step.clone());
        if copies {
            let delay = random.pick(&[0, 0, EPSILON, duration / 2]);
            step.start += delay;
            if random.chance(40) {
                step.object = random.pick(&OBJECTS);
            }
            sketch.steps.push(step);
        }
    }
    sketch.steps.sort_by_key(|step| step.start);
}

fn chosen(random: &mut Random, lasting: Lasting) -> i128 {
    let Lasting { least, most } = lasting;
    random.pick(&[least, least, most, least + (most - least) / 2])
}
