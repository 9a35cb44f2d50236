//! Allotment of risk to contingent links: ends of their intervals with the greatest probability
//! under linear cuts.

use super::law::Law;

/// Penalty for the violation of a cut, in units of the logarithm of the probability. It exceeds the
/// gain from a violation unless some interval has almost no width.
const PENALTY: f64 = 1e5;

/// Greatest violation of a cut, in spreads, that counts as none.
const VIOLATION: f64 = 1e-6;

/// Limit on Newton steps for one weight of the barrier.
const NEWTON_STEPS: usize = 60;

/// Factor between two weights of the barrier.
const DECREASE: f64 = 0.1;

/// Linear condition on the ends of intervals: `constant` plus the lower ends minus the upper ends,
/// each as often as its count says, is not negative.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cut {
    pub(super) constant: f64,
    /// Link, end (0 for the lower one, 1 for the upper one) and count.
    pub(super) terms: Vec<(usize, usize, f64)>,
}

/// Maximisation of the sum of the logarithms of the intervals' probabilities under cuts, by an
/// interior-point method. The logarithms are concave for distributions with a log-concave density
/// (Prékopa 1973), so the optimum for these cuts is global.
pub(super) struct Allotment<'a> {
    laws: &'a [Option<Law>],
    cuts: Vec<Cut>,
    /// For each link, the current interval.
    pub(super) intervals: Vec<[f64; 2]>,
    /// Variable ends, in the order of their first cut: link and end.
    variables: Vec<(usize, usize)>,
    /// For each link, the variables of its ends.
    positions: Vec<[Option<usize>; 2]>,
}

/// Value of the barrier function, its gradient and its Hessian.
struct Expansion {
    value: f64,
    gradient: Vec<f64>,
    hessian: Vec<Vec<f64>>,
}

impl<'a> Allotment<'a> {
    /// Creates a program without cuts; `intervals` are those of links without a law.
    pub(super) fn new(laws: &'a [Option<Law>], mut intervals: Vec<[f64; 2]>) -> Self {
        for (law, interval) in laws.iter().zip(&mut intervals) {
            if let Some(law) = law {
                *interval = [law.least, law.most];
            }
        }
        Self {
            laws,
            cuts: Vec::new(),
            positions: vec![[None; 2]; intervals.len()],
            intervals,
            variables: Vec::new(),
        }
    }

    /// Adds a cut. Returns `false` if no choice of the intervals can satisfy it, because it
    /// contains no end of an interval with a law, or is infinite.
    pub(super) fn add(&mut self, mut cut: Cut) -> bool {
        cut.terms.retain(|&(link, end, count)| {
            let is_variable = self.laws[link].is_some();
            if !is_variable {
                let sign = [1.0, -1.0][end];
                cut.constant += sign * count * self.intervals[link][end];
            }
            is_variable
        });
        if cut.terms.is_empty() || !cut.constant.is_finite() {
            return false;
        }
        for &(link, end, _) in &cut.terms {
            let Some(law) = &self.laws[link] else {
                continue;
            };
            if self.positions[link][end].is_none() {
                self.positions[link][end] = Some(self.variables.len());
                self.variables.push((link, end));
                // One spread from the centre, strictly inside the relevant durations.
                let [outer, sign] = [[law.least, -1.0], [law.most, 1.0]][end];
                let center = law.center();
                let reach = f64::min(law.spread, 0.5 * (outer - center).abs());
                self.intervals[link][end] = center + sign * reach;
            }
        }
        self.cuts.push(cut);
        true
    }

    /// Maximises the probability until the weight of the barrier is at most `weight`. Returns
    /// `false` if the cuts leave no intervals with positive width.
    pub(super) fn solve(&mut self, weight: f64) -> bool {
        if self.cuts.is_empty() {
            return true;
        }
        let mut point: Vec<f64> = self
            .variables
            .iter()
            .map(|&(link, end)| self.intervals[link][end])
            .collect();
        let worst = (0..self.cuts.len()).map(|cut| -self.slack(cut, &point));
        let mut excess = worst.fold(0.0, f64::max) + 1.0;
        point.push(excess);
        let mut barrier: f64 = 1.0;
        loop {
            self.center(&mut point, barrier);
            if barrier <= weight {
                break;
            }
            barrier *= DECREASE;
        }
        excess = point[self.variables.len()];
        for (&(link, end), &value) in self.variables.iter().zip(&point) {
            self.intervals[link][end] = value;
        }
        excess < f64::max(VIOLATION, weight)
    }

    /// Returns the slack of a cut, in units of the largest spread in it.
    fn slack(&self, cut: usize, point: &[f64]) -> f64 {
        let cut = &self.cuts[cut];
        let sum = cut
            .terms
            .iter()
            .fold(cut.constant, |sum, &(link, end, count)| {
                let value = self.positions[link][end].map_or(0.0, |at| point[at]);
                sum + [1.0, -1.0][end] * count * value
            });
        sum / self.unit(cut)
    }

    fn unit(&self, cut: &Cut) -> f64 {
        let spreads = cut.terms.iter().filter_map(|&(link, _, count)| {
            let law = self.laws[link].as_ref()?;
            Some(count * law.spread)
        });
        spreads.fold(f64::MIN_POSITIVE, f64::max)
    }

    /// Minimises the barrier function for one weight by Newton's method.
    fn center(&self, point: &mut Vec<f64>, weight: f64) {
        for _ in 0..NEWTON_STEPS {
            elbowroom_num::work::spend(1);
            let Some(here) = self.expand(point, weight) else {
                return;
            };
            let Some(step) = newton_step(&here.hessian, &here.gradient) else {
                return;
            };
            let decrease: f64 = step.iter().zip(&here.gradient).map(|(a, b)| -a * b).sum();
            if decrease < weight * 1e-3 {
                return;
            }
            let mut length = 1.0;
            loop {
                let next: Vec<f64> = point
                    .iter()
                    .zip(&step)
                    .map(|(a, b)| a + length * b)
                    .collect();
                let value = self.value(&next, weight);
                if value.is_some_and(|value| value <= here.value - 0.1 * length * decrease) {
                    *point = next;
                    break;
                }
                length *= 0.5;
                if length < 1e-9 {
                    return;
                }
            }
        }
    }

    fn interval(&self, link: usize, point: &[f64]) -> [f64; 2] {
        [0, 1]
            .map(|end| self.positions[link][end].map_or(self.intervals[link][end], |at| point[at]))
    }

    /// Returns the barrier function; `None` outside its domain.
    fn value(&self, point: &[f64], weight: f64) -> Option<f64> {
        let excess = point[self.variables.len()];
        if excess <= 0.0 {
            return None;
        }
        let mut value = PENALTY * excess - weight * excess.ln();
        for (link, law) in self.laws.iter().enumerate() {
            let Some(law) = law else { continue };
            if self.positions[link] == [None; 2] {
                continue;
            }
            let [lower, upper] = self.interval(link, point);
            let mass = law.mass([lower, upper]).probability;
            if lower >= upper || mass <= 0.0 {
                return None;
            }
            value -= mass.ln();
            for (end, reach) in [(0, lower - law.least), (1, law.most - upper)] {
                if self.positions[link][end].is_some() {
                    if reach <= 0.0 {
                        return None;
                    }
                    value -= weight * (reach / law.spread).ln();
                }
            }
        }
        for cut in 0..self.cuts.len() {
            let slack = self.slack(cut, point) + excess;
            if slack <= 0.0 {
                return None;
            }
            value -= weight * slack.ln();
        }
        value.is_finite().then_some(value)
    }

    fn expand(&self, point: &[f64], weight: f64) -> Option<Expansion> {
        let value = self.value(point, weight)?;
        let last = self.variables.len();
        let mut gradient = vec![0.0; last + 1];
        let mut hessian = vec![vec![0.0; last + 1]; last + 1];
        let excess = point[last];
        gradient[last] = PENALTY - weight / excess;
        hessian[last][last] = weight / (excess * excess);
        for (link, law) in self.laws.iter().enumerate() {
            let Some(law) = law else { continue };
            if self.positions[link] == [None; 2] {
                continue;
            }
            let interval = self.interval(link, point);
            let mass = law.mass(interval);
            // Relative densities with the sign of their effect on the probability.
            let share = [
                -mass.density[0] / mass.probability,
                mass.density[1] / mass.probability,
            ];
            let slope = [
                -mass.slope[0] / mass.probability,
                mass.slope[1] / mass.probability,
            ];
            let reach = [interval[0] - law.least, interval[1] - law.most];
            for end in 0..2 {
                let Some(at) = self.positions[link][end] else {
                    continue;
                };
                gradient[at] -= share[end] + weight / reach[end];
                let curvature = share[end] * share[end] - slope[end];
                hessian[at][at] += curvature.max(0.0) + weight / (reach[end] * reach[end]);
            }
            if let [Some(lower), Some(upper)] = self.positions[link] {
                hessian[lower][upper] += share[0] * share[1];
                hessian[upper][lower] += share[0] * share[1];
            }
        }
        for (index, cut) in self.cuts.iter().enumerate() {
            let slack = self.slack(index, point) + excess;
            let unit = self.unit(cut);
            let mut row = vec![(last, 1.0)];
            row.extend(cut.terms.iter().filter_map(|&(link, end, count)| {
                Some((self.positions[link][end]?, [1.0, -1.0][end] * count / unit))
            }));
            for &(one, a) in &row {
                gradient[one] -= weight * a / slack;
                for &(other, b) in &row {
                    hessian[one][other] += weight * a * b / (slack * slack);
                }
            }
        }
        Some(Expansion {
            value,
            gradient,
            hessian,
        })
    }
}

/// Solves `hessian * step = -gradient` by Cholesky decomposition. A multiple of the diagonal is
/// added until the matrix is positive definite.
fn newton_step(hessian: &[Vec<f64>], gradient: &[f64]) -> Option<Vec<f64>> {
    let mut damping = 0.0;
    for _ in 0..12 {
        let mut matrix = hessian.to_vec();
        for (row, line) in matrix.iter_mut().enumerate() {
            line[row] *= 1.0 + damping;
        }
        if decompose(&mut matrix) {
            let mut step: Vec<f64> = gradient.iter().map(|part| -part).collect();
            for row in 0..step.len() {
                let known: f64 = (0..row).map(|at| matrix[row][at] * step[at]).sum();
                step[row] = (step[row] - known) / matrix[row][row];
            }
            for row in (0..step.len()).rev() {
                let rows = row + 1..step.len();
                let known: f64 = rows.map(|at| matrix[at][row] * step[at]).sum();
                step[row] = (step[row] - known) / matrix[row][row];
            }
            return step.iter().all(|part| part.is_finite()).then_some(step);
        }
        damping = if damping == 0.0 { 1e-9 } else { damping * 30.0 };
    }
    None
}

/// Replaces the lower triangle of a matrix by its Cholesky factor. Returns `false` if the matrix is
/// not positive definite.
fn decompose(matrix: &mut [Vec<f64>]) -> bool {
    for row in 0..matrix.len() {
        let (done, rest) = matrix.split_at_mut(row);
        let line = &mut rest[0];
        for column in 0..row {
            let other = &done[column];
            let known: f64 = line[..column].iter().zip(other).map(|(a, b)| a * b).sum();
            line[column] = (line[column] - known) / other[column];
        }
        let known: f64 = line[..row].iter().map(|part| part * part).sum();
        let rest = line[row] - known;
        if rest.is_nan() || rest <= line[row].abs() * 1e-15 {
            return false;
        }
        line[row] = rest.sqrt();
    }
    true
}
