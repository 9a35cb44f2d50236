use rand::SeedableRng;

use super::*;

fn draw_samples(distribution: impl rand_distr::Distribution<f64>, count: usize) -> Vec<f64> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    (0..count).map(|_| distribution.sample(&mut rng)).collect()
}

/// Returns the best point of a fine grid, by exhaustive search.
fn best_on_grid(samples: &[Sample], around: (f64, f64)) -> (f64, f64) {
    let mut best = (f64::NEG_INFINITY, (0.0, 0.0));
    for i in 0..=200 {
        for j in 0..=200 {
            let mean = around.0 + (f64::from(i) - 100.0) * 0.01;
            let deviation = around.1 + (f64::from(j) - 100.0) * 0.005;
            if deviation <= 0.0 {
                continue;
            }
            let value = log_likelihood(
                samples,
                1e-9,
                |x| standard_density((x - mean) / deviation) / deviation,
                |x| upper_tail((x - mean) / deviation),
            );
            if value > best.0 {
                best = (value, (mean, deviation));
            }
        }
    }
    best.1
}

#[test]
fn newton_agrees_with_grid_search() {
    let values = draw_samples(
        rand_distr::Normal::new(12.0, 3.0).expect("a distribution"),
        60,
    );
    for limit in [f64::INFINITY, 14.0, 12.0, 10.0] {
        let samples: Vec<Sample> = values
            .iter()
            .map(|&value| {
                if value <= limit {
                    Sample::observed(value)
                } else {
                    Sample::censored(limit)
                }
            })
            .collect();
        let (mean, deviation, _) = location_and_scale(&samples).expect("a fit");
        let grid = best_on_grid(&samples, (mean, deviation));
        assert!((grid.0 - mean).abs() <= 0.0101, "{grid:?} {mean}");
        assert!((grid.1 - deviation).abs() <= 0.0051, "{grid:?} {deviation}");
    }
}

#[test]
fn censored_samples_affect_the_fit() {
    let values = draw_samples(
        rand_distr::Normal::new(12.0, 3.0).expect("a distribution"),
        400,
    );
    let samples: Vec<Sample> = values
        .iter()
        .map(|&value| {
            if value <= 12.0 {
                Sample::observed(value)
            } else {
                Sample::censored(12.0)
            }
        })
        .collect();
    let fit = best(&samples, 0.001).expect("a fit");
    assert!((fit.mean - 12.0).abs() < 0.6, "{fit:?}");
    // Without the censored samples, the estimated durations would be too short.
    let kept: Vec<Sample> = samples.iter().filter(|s| !s.is_censored).copied().collect();
    let naive = best(&kept, 0.001).expect("a fit");
    assert!(naive.mean < 10.5, "{naive:?}");
}

#[test]
fn true_family_is_selected() {
    let of = |values: Vec<f64>| {
        let samples: Vec<Sample> = values.into_iter().map(Sample::observed).collect();
        best(&samples, 0.001).expect("a fit").distribution
    };
    let normal = rand_distr::Normal::new(20.0, 5.0).expect("a distribution");
    assert!(matches!(
        of(draw_samples(normal, 300)),
        Distribution::Normal { .. }
    ));
    let lognormal = rand_distr::LogNormal::new(1.0, 0.8).expect("a distribution");
    assert!(matches!(
        of(draw_samples(lognormal, 300)),
        Distribution::LogNormal { .. }
    ));
    let uniform = rand_distr::Uniform::new(4.0, 9.0).expect("a distribution");
    assert!(matches!(
        of(draw_samples(uniform, 300)),
        Distribution::Uniform { .. }
    ));
    assert_eq!(of(vec![5.0; 10]), Distribution::Constant(5.0));
    // Two clusters, which no family fits.
    let heaps = (0..60).map(|i| {
        if i % 2 == 0 {
            3.0 + f64::from(i) / 1e3
        } else {
            30.0
        }
    });
    assert!(matches!(of(heaps.collect()), Distribution::Empirical(_)));
}

#[test]
fn degenerate_samples_are_fitted() {
    assert_eq!(best(&[], 0.001), None);
    assert_eq!(best(&[Sample::censored(4.0)], 0.001), None);
    assert!(best(&[Sample::observed(0.0)], 0.001).is_some());
    assert!(best(&[Sample::observed(1.0), Sample::censored(9.0)], 0.001).is_none());
    let wide = [Sample::observed(1e-9), Sample::observed(1e12)];
    assert!(best(&wide, 0.001).is_some());
}
