//! Approximate maximum of a concave function of the ends of a box: Newton's method with a
//! logarithmic barrier (Boyd & Vandenberghe 2004, chapter 11), in floating-point numbers.
//!
//! The result is only a proposal: the caller computes its exact value.

use std::ops::ControlFlow;

/// All bounds are loosened by this, so that there is an interior point.
const LOOSENING: f64 = 1e-10;
/// Total error from the barriers of all bounds at the end.
const BARRIER_ERROR: f64 = 2e-8;
/// Factor by which the barriers become weaker in each round.
const SHARPENING_FACTOR: f64 = 20.0;
/// Expected gain of a Newton step below which full steps are taken without a line search.
const FULL_STEP_GAIN: f64 = 0.05;
/// The limit on Newton steps in one round.
const MAX_STEPS_PER_ROUND: usize = 60;
/// The limit on Newton steps in all rounds together.
const MAX_STEPS: usize = 600;

/// Number of multiplications, about ten milliseconds, after which `flow` is polled.
const POLL_INTERVAL: usize = 10_000_000;

/// Concave function that is a sum of functions of few variables each.
pub(super) trait Concave {
    /// Adds the gradient, and the negated second derivatives that are not zero. Returns the value.
    fn derive(&self, at: &[f64], gradient: &mut [f64], curvature: &mut [Vec<f64>]) -> f64;

    /// Returns the value; minus infinity outside the domain.
    fn value(&self, at: &[f64]) -> f64;
}

/// `Σ factor · variable <= bound` for each row, and `least <= variable <= most`.
pub(super) struct Polytope {
    pub(super) rows: Vec<(Vec<(usize, f64)>, f64)>,
    pub(super) least: Vec<f64>,
    pub(super) most: Vec<f64>,
}

impl Polytope {
    /// Returns the slack of each bound.
    fn slacks(&self, at: &[f64]) -> Vec<f64> {
        let rows = self.rows.iter().map(|(factors, bound)| {
            let sum: f64 = factors.iter().map(|(index, f)| f * at[*index]).sum();
            bound + LOOSENING - sum
        });
        let own = at.iter().zip(self.least.iter().zip(&self.most));
        rows.chain(own.flat_map(|(value, (least, most))| {
            [value + LOOSENING - least, most + LOOSENING - value]
        }))
        .collect()
    }

    fn least_slack(&self, at: &[f64]) -> f64 {
        self.slacks(at).into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Returns approximately the maximum of the function, searched from the best of these starting
    /// points. `None` if none of them is inside, or if `flow` ends the search.
    pub(super) fn maximize(
        &self,
        function: &dyn Concave,
        starts: &[Vec<f64>],
        flow: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Vec<f64>> {
        let inside = starts.iter().map(|start| (self.least_slack(start), start));
        let (slack, start) = inside.max_by(|one, other| one.0.total_cmp(&other.0))?;
        if !(slack > 0.0 && function.value(start).is_finite()) {
            return None;
        }
        let mut at = start.clone();
        let count = self.rows.len() + 2 * at.len();
        #[allow(clippy::cast_precision_loss, reason = "a count of bounds")]
        let last = count as f64 / BARRIER_ERROR;
        let in_rows = self.rows.iter().map(|(factors, _)| factors.len().pow(2));
        let work = at.len().pow(3) / 6 + in_rows.sum::<usize>();
        let (mut sharpness, mut steps, mut worked) = (1.0_f64, 0, 0_usize);
        loop {
            let most = MAX_STEPS.min(steps + MAX_STEPS_PER_ROUND);
            while steps < most && self.newton(function, sharpness, &mut at) {
                steps += 1;
                worked += work;
                if worked > POLL_INTERVAL {
                    worked = 0;
                    if flow().is_break() {
                        return None;
                    }
                }
            }
            if sharpness >= last || steps >= MAX_STEPS {
                return Some(at);
            }
            sharpness = (sharpness * SHARPENING_FACTOR).min(last);
        }
    }

    /// Returns the maximised value: the function plus the barriers.
    fn merit(&self, function: &dyn Concave, sharpness: f64, at: &[f64]) -> f64 {
        let slacks = self.slacks(at);
        if slacks.iter().any(|slack| *slack <= 0.0) {
            return f64::NEG_INFINITY;
        }
        sharpness * function.value(at) + slacks.iter().map(|slack| slack.ln()).sum::<f64>()
    }

    /// Takes one Newton step. Returns `false` if there is nothing left to gain.
    fn newton(&self, function: &dyn Concave, sharpness: f64, at: &mut Vec<f64>) -> bool {
        let count = at.len();
        let mut gradient = vec![0.0; count];
        let mut curvature = vec![vec![0.0; count]; count];
        function.derive(at, &mut gradient, &mut curvature);
        for (slope, row) in gradient.iter_mut().zip(&mut curvature) {
            *slope *= sharpness;
            for own in row {
                *own *= sharpness;
            }
        }
        let slacks = self.slacks(at);
        for ((factors, _), slack) in self.rows.iter().zip(&slacks) {
            for (one, factor) in factors {
                gradient[*one] -= factor / slack;
                for (other, second) in factors {
                    curvature[*one][*other] += factor / slack * (second / slack);
                }
            }
        }
        for (index, own) in slacks[self.rows.len()..].chunks(2).enumerate() {
            let (below, above) = (1.0 / own[0], 1.0 / own[1]);
            gradient[index] += below - above;
            curvature[index][index] += below * below + above * above;
        }
        let Some(direction) = solve(curvature, &gradient) else {
            return false;
        };
        let promise: f64 = direction.iter().zip(&gradient).map(|(d, g)| d * g).sum();
        // Half of it would be the gain of the step if the function were quadratic.
        if promise.is_nan() || promise < 1e-9 {
            return false;
        }
        let moved = |length: f64| -> Vec<f64> {
            let moved = at.iter().zip(&direction);
            moved.map(|(value, step)| value + length * step).collect()
        };
        if promise < FULL_STEP_GAIN {
            // This close to the optimum, full steps converge, and their gains are too small to be
            // measured.
            let full = moved(1.0);
            let is_inside = self.least_slack(&full) > 0.0;
            if is_inside {
                *at = full;
            }
            return is_inside;
        }
        let before = self.merit(function, sharpness, at);
        let mut length = 1.0;
        while length > 1e-12 {
            let moved = moved(length);
            if self.merit(function, sharpness, &moved) >= before + 0.1 * length * promise {
                *at = moved;
                return true;
            }
            length *= 0.5;
        }
        false
    }
}

/// Solves `matrix · x = right` for a symmetric, positive definite matrix (Cholesky, after scaling
/// all rows and columns to the same size).
fn solve(mut matrix: Vec<Vec<f64>>, right: &[f64]) -> Option<Vec<f64>> {
    let count = right.len();
    let sizes: Vec<f64> = (0..count).map(|i| matrix[i][i].sqrt()).collect();
    if sizes.iter().any(|size| !(size.is_finite() && *size > 0.0)) {
        return None;
    }
    for i in 0..count {
        for j in 0..=i {
            let mut sum = matrix[i][j] / sizes[i] / sizes[j];
            if i == j {
                sum += 1e-13;
            }
            let (above, own) = matrix.split_at(i);
            let first = if i == j { &own[0] } else { &above[j] };
            sum -= first[..j]
                .iter()
                .zip(&own[0][..j])
                .map(|(a, b)| a * b)
                .sum::<f64>();
            if i == j {
                if sum <= 0.0 {
                    return None;
                }
                matrix[i][i] = sum.sqrt();
            } else {
                matrix[i][j] = sum / matrix[j][j];
            }
        }
    }
    let mut solution: Vec<f64> = right.iter().zip(&sizes).map(|(r, s)| r / s).collect();
    for i in 0..count {
        let sum: f64 = (0..i).map(|j| matrix[i][j] * solution[j]).sum();
        solution[i] = (solution[i] - sum) / matrix[i][i];
    }
    for i in (0..count).rev() {
        let sum: f64 = (i + 1..count).map(|j| matrix[j][i] * solution[j]).sum();
        solution[i] = (solution[i] - sum) / matrix[i][i];
    }
    Some(solution.iter().zip(&sizes).map(|(x, s)| x / s).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sum of the logarithms.
    struct Logarithms;

    impl Concave for Logarithms {
        fn derive(&self, at: &[f64], gradient: &mut [f64], curvature: &mut [Vec<f64>]) -> f64 {
            for (index, value) in at.iter().enumerate() {
                gradient[index] += 1.0 / (value + 1e-6);
                curvature[index][index] += (value + 1e-6).powi(-2);
            }
            self.value(at)
        }

        fn value(&self, at: &[f64]) -> f64 {
            at.iter().map(|value| (value + 1e-6).ln()).sum()
        }
    }

    #[test]
    fn product_maximum_splits_budget_by_price() {
        // x + 2 y + 4 z <= 12 and z <= 1/2: z is at its upper bound, the others share the rest
        // equally.
        let polytope = Polytope {
            rows: vec![(vec![(0, 1.0), (1, 2.0), (2, 4.0)], 12.0)],
            least: vec![0.0; 3],
            most: vec![100.0, 100.0, 0.5],
        };
        let found = polytope
            .maximize(&Logarithms, &[vec![0.0; 3]], &mut || {
                ControlFlow::Continue(())
            })
            .unwrap();
        for (found, known) in found.iter().zip([5.0, 2.5, 0.5]) {
            assert!((found - known).abs() < 1e-5, "{found} {known}");
        }
    }

    #[test]
    fn long_computation_polls_flow() {
        let polytope = Polytope {
            rows: vec![((0..500).map(|index| (index, 1.0)).collect(), 1.0)],
            least: vec![0.0; 500],
            most: vec![9.0; 500],
        };
        let mut asked = 0;
        let found = polytope.maximize(&Logarithms, &[vec![0.0; 500]], &mut || {
            asked += 1;
            ControlFlow::Break(())
        });
        assert_eq!((found, asked), (None, 1));
    }

    #[test]
    fn fixed_variable_does_not_block_others() {
        let polytope = Polytope {
            rows: vec![(vec![(0, 1.0)], 0.0), (vec![(1, 1.0), (2, 1.0)], 1.0)],
            least: vec![0.0; 3],
            most: vec![9.0; 3],
        };
        let found = polytope
            .maximize(&Logarithms, &[vec![0.0; 3]], &mut || {
                ControlFlow::Continue(())
            })
            .unwrap();
        for (found, known) in found.iter().zip([0.0, 0.5, 0.5]) {
            assert!((found - known).abs() < 1e-5, "{found} {known}");
        }
    }
}
