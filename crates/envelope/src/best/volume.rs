//! The box with the greatest product of widths.
//!
//! The logarithm of the product is a concave function of the ends, and lies below each of its
//! tangents: `ln x <= ln(1/c) - 1 + c·x` for every slope `c`. So the greatest sum of tangents in a
//! case, a linear program, is an upper bound in this case, and a tight one if the tangents touch at
//! the maximum of the logarithm. Newton's method approximates the maximum ([`barrier`]), and the
//! bound is computed with exact numbers.
//!
//! [`barrier`]: super::barrier

use std::ops::ControlFlow;

use elbowroom_num::{Rational, enclosures};
use elbowroom_plan::{ParametrizedPlan, Side};

use super::barrier::Concave;
use super::concave_maximum::{CaseContext, approximate_optimum, power_of_ten, shorten_digits};
use super::master::{Master, Solved};
use super::objective::Outcome;
use super::{BoundSource, Variables};

/// One parameter.
struct Width {
    /// The variables that move its ends, each with the number of ends it moves.
    variables: Vec<(usize, i64)>,
    weight: Rational,
    scale: Rational,
}

/// Sources of bounds, each with its multiplier.
type Proof = Vec<(BoundSource, Rational)>;

/// `Σ weight · ln(width / scale + foot)`.
pub(super) struct Volume {
    widths: Vec<Width>,
    /// For each parameter, the power of ten that slopes are rounded to.
    grids: Vec<Rational>,
}

/// Returns the constant added to each width, relative to its scale, before the product is computed:
/// a millionth. It makes boxes with an interval of width 0 comparable.
pub fn width_offset() -> Rational {
    Rational::new(1, 1_000_000)
}

impl Volume {
    pub(super) fn new(plan: &ParametrizedPlan, variables: &Variables) -> Self {
        let mut widths: Vec<Width> = plan
            .parameters
            .iter()
            .map(|parameter| Width {
                variables: Vec::new(),
                weight: parameter.weight.clone(),
                scale: Rational::ONE,
            })
            .collect();
        for (index, (ends, scale)) in variables.ends.iter().zip(&variables.scales).enumerate() {
            let width = &mut widths[ends[0].parameter.index()];
            let count = i64::try_from(ends.len()).expect("at most two ends");
            width.variables.push((index, count));
            width.scale = scale.clone();
        }
        // Slopes with a common denominator keep the numbers of the linear program short.
        let grids = widths.iter().map(|width| {
            let fine = Rational::new(1, 1_000_000_000_000);
            power_of_ten(&(&fine / &width.scale))
        });
        Self {
            grids: grids.collect(),
            widths,
        }
    }

    /// Returns the widths relative to their scales, each with the constant [`width_offset`] added.
    fn offset_widths<'a>(&'a self, values: &'a [Rational]) -> impl Iterator<Item = Rational> + 'a {
        self.widths.iter().map(|width| {
            let own = width.variables.iter();
            let sum: Rational = own
                .map(|(v, count)| &values[*v] * &Rational::from(*count))
                .sum();
            sum / &width.scale + width_offset()
        })
    }

    /// Returns bounds on the value of a box.
    fn value_bounds(&self, values: &[Rational]) -> [Rational; 2] {
        let mut sums = [Rational::ZERO, Rational::ZERO];
        for (width, footed) in self.widths.iter().zip(self.offset_widths(values)) {
            let bounds = enclosures::ln(&footed).expect("a width that is not negative, and a foot");
            for (sum, bound) in sums.iter_mut().zip(bounds) {
                *sum += bound * &width.weight;
            }
        }
        sums
    }

    /// Returns the value of a box, rounded down to a billionth.
    pub(super) fn lower_value(&self, values: &[Rational]) -> Rational {
        enclosures::floor_to_billionth(&self.value_bounds(values)[0])
    }

    /// Returns the value of a box, rounded up to a billionth.
    pub(super) fn upper_value(&self, values: &[Rational]) -> Rational {
        enclosures::ceil_to_billionth(&self.value_bounds(values)[1])
    }

    pub(super) fn solve(
        &self,
        master: &mut Master,
        variables: &Variables,
        case: CaseContext<'_>,
        flow: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Outcome {
        let CaseContext { chosen, known, .. } = case;
        let mut is_over = false;
        let mut may_continue = || {
            let flow = flow();
            is_over |= flow.is_break();
            flow
        };
        let guess = approximate_optimum(
            &ScaledVolume(self),
            master,
            variables,
            case,
            &mut may_continue,
        );
        if is_over {
            return Outcome::Unknown;
        }
        let guess = guess.unwrap_or_else(|| known.to_vec());
        let near = self.slopes(&guess);
        let worths = self.coefficients(variables, &near);
        let values = master.best_within(case, (Side::Upper, &guess), &worths);
        let values = values.map(|values| {
            let values = shorten_digits(values, master, variables, case, &|own| {
                self.lower_value(own)
            });
            // Uses the slack that rounding has left, and moves variables that do not change the
            // objective.
            let filled = master.best_within(case, (Side::Lower, &values), &worths);
            filled.unwrap_or(values)
        });
        // Rounding makes boxes simpler, but unrounded values give better slopes.
        let rounded = values.as_ref().map(|values| self.slopes(values));
        let mut best: Option<(Rational, Vec<Rational>, Proof, Vec<Rational>)> = None;
        for slopes in std::iter::once(near).chain(rounded) {
            match master.solve(chosen, &[], &self.coefficients(variables, &slopes)) {
                Solved::Impossible(proof) => return Outcome::Impossible(proof),
                Solved::Best {
                    values: corner,
                    worth,
                    proof,
                } => {
                    let bound = self.bound(&slopes, worth);
                    if best.as_ref().is_none_or(|known| bound < known.0) {
                        best = Some((bound, corner, proof, slopes));
                    }
                }
            }
        }
        let Some((bound, corner, proof, slopes)) = best else {
            return Outcome::Unknown;
        };
        Outcome::Best {
            values: values.unwrap_or(corner),
            bound,
            proof,
            slopes,
            touches: Vec::new(),
        }
    }

    /// Returns an upper bound on the objective. `sum` is the greatest value of the tangents with
    /// these slopes, without their constants.
    fn bound(&self, slopes: &[Rational], sum: Rational) -> Rational {
        let heights = self.widths.iter().zip(slopes).filter_map(|(width, slope)| {
            let touches = width.weight.checked_div(&(slope * &width.scale))?;
            let [_, above] = enclosures::ln(&touches)?;
            let foot = width_offset() * &width.scale * slope;
            Some((above - Rational::ONE) * &width.weight + foot)
        });
        enclosures::ceil_to_billionth(&(heights.sum::<Rational>() + sum))
    }

    /// Returns the slope of each parameter's tangent at these values.
    fn slopes(&self, values: &[Rational]) -> Vec<Rational> {
        let all = self
            .widths
            .iter()
            .zip(&self.grids)
            .zip(self.offset_widths(values));
        all.map(|((width, grid), footed)| {
            let slope = width.weight.checked_div(&(footed * &width.scale));
            let steps = slope.and_then(|slope| slope.checked_div(grid));
            steps.map_or(Rational::ZERO, |steps| steps.ceil() * grid)
        })
        .collect()
    }

    /// Returns the coefficient of each variable in the tangents.
    fn coefficients(&self, variables: &Variables, slopes: &[Rational]) -> Vec<Rational> {
        let mut worths = vec![Rational::ZERO; variables.count()];
        for (width, slope) in self.widths.iter().zip(slopes) {
            for (variable, count) in &width.variables {
                worths[*variable] = slope * &Rational::from(*count);
            }
        }
        worths
    }
}

/// The same objective for values relative to their scales, in floating-point numbers.
struct ScaledVolume<'a>(&'a Volume);

impl ScaledVolume<'_> {
    fn terms<'a>(&'a self, at: &'a [f64]) -> impl Iterator<Item = (&'a Width, f64, f64)> + 'a {
        self.0.widths.iter().map(|width| {
            let own = width.variables.iter();
            let sum: f64 = own
                .map(|(variable, count)| at[*variable] * ends(*count))
                .sum();
            (width, width.weight.to_f64(), sum + width_offset().to_f64())
        })
    }
}

fn ends(count: i64) -> f64 {
    if count == 1 { 1.0 } else { 2.0 }
}

impl Concave for ScaledVolume<'_> {
    fn derive(&self, at: &[f64], gradient: &mut [f64], curvature: &mut [Vec<f64>]) -> f64 {
        let mut value = 0.0;
        for (width, weight, footed) in self.terms(at) {
            value += weight * footed.ln();
            for (one, count) in &width.variables {
                gradient[*one] += weight * ends(*count) / footed;
                for (other, second) in &width.variables {
                    curvature[*one][*other] +=
                        weight * ends(*count) * ends(*second) / (footed * footed);
                }
            }
        }
        value
    }

    fn value(&self, at: &[f64]) -> f64 {
        self.terms(at)
            .map(|(_, weight, footed)| {
                if weight == 0.0 {
                    0.0
                } else {
                    weight * footed.ln()
                }
            })
            .sum()
    }
}
