//! The assignment problem: the Hungarian method (Kuhn 1955, in the form of Jonker and Volgenant).

/// With more rows than this, each row gets its best column. This is also an upper bound, and fast.
pub(super) const MAX_ROWS: usize = 24;

/// Returns an upper bound of the greatest product of one entry from each row, no two from one
/// column, of a square matrix of numbers in [0, 1]. For small matrices, it is exact up to rounding.
/// Rows of large ones may omit entries that are not their greatest.
pub(super) fn best_product(rows: &[Vec<f64>]) -> f64 {
    if rows.len() > MAX_ROWS {
        let best = |row: &Vec<f64>| row.iter().copied().fold(0.0, f64::max);
        return rows.iter().map(best).product();
    }
    match rows {
        [] => 1.0,
        [only] => only[0],
        _ => {
            // Numbers too small for a logarithm are rounded up.
            let cost = |p: &f64| -p.max(1e-300).ln();
            let costs: Vec<Vec<f64>> = rows
                .iter()
                .map(|row| row.iter().map(cost).collect())
                .collect();
            (-least_sum(&costs)).exp() * (1.0 + 1e-12)
        }
    }
}

/// Returns the least sum of one entry from each row, no two from one column.
fn least_sum(costs: &[Vec<f64>]) -> f64 {
    let size = costs.len();
    // Potentials of rows and columns; row and column 0 are artificial.
    let mut row_potential = vec![0.0; size + 1];
    let mut column_potential = vec![0.0; size + 1];
    let mut row_of = vec![0; size + 1];
    let mut previous = vec![0; size + 1];
    for row in 1..=size {
        row_of[0] = row;
        let mut column = 0;
        let mut least = vec![f64::INFINITY; size + 1];
        let mut is_done = vec![false; size + 1];
        while row_of[column] != 0 {
            is_done[column] = true;
            let at = row_of[column];
            let (mut delta, mut next) = (f64::INFINITY, 0);
            for other in (1..=size).filter(|&other| !is_done[other]) {
                let reduced =
                    costs[at - 1][other - 1] - row_potential[at] - column_potential[other];
                if reduced < least[other] {
                    least[other] = reduced;
                    previous[other] = column;
                }
                if least[other] < delta {
                    delta = least[other];
                    next = other;
                }
            }
            for other in 0..=size {
                if is_done[other] {
                    row_potential[row_of[other]] += delta;
                    column_potential[other] -= delta;
                } else {
                    least[other] -= delta;
                }
            }
            column = next;
        }
        while column != 0 {
            let before = previous[column];
            row_of[column] = row_of[before];
            column = before;
        }
    }
    (1..=size)
        .map(|column| costs[row_of[column] - 1][column - 1])
        .sum()
}

#[cfg(test)]
mod tests {
    use super::best_product;

    fn brute_force(rows: &[Vec<f64>], used: &mut Vec<usize>) -> f64 {
        let Some(row) = rows.get(used.len()) else {
            return 1.0;
        };
        let mut best: f64 = 0.0;
        for (column, entry) in row.iter().enumerate() {
            if !used.contains(&column) {
                used.push(column);
                best = best.max(entry * brute_force(rows, used));
                used.pop();
            }
        }
        best
    }

    #[test]
    fn best_product_equals_brute_force() {
        let mut seed: u32 = 1;
        let mut draw = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / f64::from(1 << 24)
        };
        for size in [1, 2, 3, 4, 5, 6] {
            for _ in 0..50 {
                let rows: Vec<Vec<f64>> = (0..size)
                    .map(|_| (0..size).map(|_| draw()).collect())
                    .collect();
                let best = brute_force(&rows, &mut Vec::new());
                let found = best_product(&rows);
                assert!((found - best).abs() <= 1e-9 * best, "{found} {best}");
            }
        }
    }
}
