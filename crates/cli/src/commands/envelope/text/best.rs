//! Description of the quality of the best box.

use elbowroom::answers::envelope::{Best, LimitedRange, Probability, Relax, ShadowPrices};
use elbowroom::envelope::Objective;
use elbowroom::num::Rational;

use crate::number::{self, Rounding};

/// Lists the bounds whose relaxation gains most, or returns `None` if there are none.
pub(super) fn best_relaxations(best: &Best) -> Option<String> {
    /// Maximum number of entries of a list.
    const MAX_NAMED: usize = 3;
    let gain = |worth: &ShadowPrices| match best.objective {
        Objective::LeastSlack => {
            let percent = &worth.gain * &Rational::from(100);
            format!(
                "{} % to the least slack",
                number::rounded(&percent, 2, Rounding::Down)
            )
        }
        Objective::Volume => {
            let percent = &worth.gain * &Rational::from(100);
            format!("{} % to the volume", number::nearest(&percent))
        }
        Objective::Probability => {
            let percent = &worth.gain * &Rational::from(100);
            format!("{} % to the probability", number::nearest(&percent))
        }
        _ => format!("{} to the sum of the widths", number::nearest(&worth.gain)),
    };
    let named = best.worth.iter().take(MAX_NAMED).map(|worth| {
        let relax = match worth.relax {
            Relax::More => "more",
            Relax::Less => "less",
        };
        format!("1 {relax} of {} adds {}", worth.bound, gain(worth))
    });
    let named: Vec<String> = named.collect();
    (!named.is_empty()).then(|| format!("Most valuable relaxations: {}.", named.join("; ")))
}

/// Describes the volume as the geometric mean of the widths.
fn volume_text(best: &Best, parameters: &[LimitedRange]) -> String {
    let weights: Rational = parameters
        .iter()
        .map(|own| own.range.quantity.weight.clone())
        .sum();
    // The geometric mean is easier to understand than a product of many numbers.
    let mean = |logarithm: &Rational| {
        let mean = (logarithm.to_f64() / weights.to_f64().max(f64::MIN_POSITIVE)).exp();
        let percent = Rational::from_f64_exactly(mean * 100.0).unwrap_or_default();
        format!("{} %", number::rounded(&percent, 1, Rounding::Down))
    };
    let value = mean(&best.value);
    let counted = number::nearest(&best.most);
    let also = if best.is_proved {
        "Proved optimal: no box has a volume that is more than a millionth greater".to_owned()
    } else {
        format!("No box has more than {}", mean(&best.bound))
    };
    format!(
        "The geometric mean of the widths is {value} of the nominal values, with deviations \
         capped at {counted} times these. {also}"
    )
}

/// Describes the probability that all durations stay inside the box.
fn probability_text(best: &Best, probability: &Probability) -> String {
    let percent = |value: &Rational, rounding| {
        let percent = value * &Rational::from(100);
        format!("{} %", number::rounded(&percent, 3, rounding))
    };
    if probability.most.is_zero() {
        return "With the distributions of the world file, the probability that all durations stay \
                inside is 0 for every box"
            .to_owned();
    }
    let least = percent(&probability.least, Rounding::Down);
    let most = percent(&probability.most, Rounding::Up);
    let also = if best.is_proved {
        format!("Proved optimal to within a millionth: no box has more than {most}")
    } else {
        format!("No box has more than {most}")
    };
    format!(
        "With the distributions of the world file, all durations stay inside with a probability \
         of at least {least}. {also}"
    )
}

/// Describes the objective value of the box, and its proved upper bound.
pub(super) fn objective_text(best: &Best, parameters: &[LimitedRange]) -> String {
    if let Some(probability) = &best.probability {
        return probability_text(best, probability);
    }
    if best.objective == Objective::Volume {
        return volume_text(best, parameters);
    }
    let number = |value: &Rational| match best.objective {
        Objective::LeastSlack => {
            let percent = value * &Rational::from(100);
            format!("{} %", number::rounded(&percent, 1, Rounding::Down))
        }
        _ => number::nearest(value),
    };
    let value = number(&best.value);
    let what = match best.objective {
        Objective::LeastSlack => "least slack of any bound",
        _ => "sum of the widths",
    };
    let counted = format!(
        "with deviations capped at {} times the nominal values",
        number::nearest(&best.most)
    );
    match (best.is_proved, best.objective) {
        (true, Objective::LeastSlack) => format!(
            "The {what} is {value}, {counted}. Proved optimal: no bound can gain slack unless one \
             with at most as much slack loses some"
        ),
        (true, _) => format!("The {what} is {value}, {counted}. Proved optimal: no box has more"),
        (false, _) if best.value < best.bound => format!(
            "The {what} is {value}, {counted}. No box has more than {}",
            number(&best.bound)
        ),
        (false, _) => {
            format!(
                "The {what} is {value}, {counted}. No box has more, but its other bounds \
                 could be wider"
            )
        }
    }
}
