//! Probabilities of intervals, and linear bounds on their logarithms, compared with counting.

use proptest::prelude::*;

use elbowroom_num::log_concave::{
    Cell, CutPosition, Density, LogConcaveDistribution, Reach, Steps, TangentPoint,
};
use elbowroom_num::{Rational, enclosures};

fn number(tenths: i64) -> Rational {
    Rational::new(tenths, 10)
}

fn densities() -> impl Strategy<Value = Density> {
    prop_oneof![
        (0..80_i64, 1..80_i64).prop_map(|(from, width)| Density::Uniform {
            from: number(from),
            to: number(from + width),
        }),
        (0..60_i64, 0..40_i64, 0..40_i64).prop_map(|(from, up, down)| Density::Triangular {
            from: number(from),
            mode: number(from + up),
            to: number(from + up + down + 1),
        }),
        (20..80_i64, 3..40_i64).prop_map(|(mean, deviation)| Density::Normal {
            mean: number(mean),
            deviation: number(deviation),
        }),
        (0..60_i64, 3..40_i64).prop_map(|(from, mean)| Density::Exponential {
            from: number(from),
            mean: number(mean),
        }),
        (10..20_i64, 1..6_i64).prop_map(|(location, spread)| Density::Lognormal {
            location: number(location),
            spread: number(spread),
        }),
    ]
}

fn chances() -> impl Strategy<Value = LogConcaveDistribution> {
    let cut = || prop::option::of((0..11_i64).prop_map(|own| own * 10));
    let dense = (densities(), cut(), cut()).prop_map(|(density, low, high)| {
        let resolution = Rational::new(1, 10);
        LogConcaveDistribution::dense(density, low.map(number), high.map(number), &resolution)
            .expect("a sound density")
    });
    let values = prop::collection::vec((0..22_i64).prop_map(|own| own * 5), 1..6);
    prop_oneof![
        3 => dense,
        1 => values.prop_map(|own| {
            LogConcaveDistribution::values(own.into_iter().map(number).collect()).expect("some values")
        }),
    ]
}

/// Generates a cell with a reach in it.
fn cells() -> impl Strategy<Value = (Cell, Reach)> {
    let side = || {
        prop::collection::vec((0..7_i64).prop_map(|own| own * 10), 3).prop_map(|mut ends| {
            ends.sort_unstable();
            ends
        })
    };
    (side(), side(), any::<bool>()).prop_map(|(below, above, is_open)| {
        let cell = Cell {
            below: [number(below[0]), number(below[2])],
            above: [number(above[0]), number(above[2])],
            is_open: [is_open, is_open],
        };
        (cell, [number(below[1]), number(above[1])])
    })
}

proptest! {
    #[test]
    fn bound_on_cell_exceeds_all_its_intervals(
        chance in chances(),
        (cell, at) in cells(),
        slopes in (0..20_i64, 0..20_i64),
        point in (1..9_i64).prop_map(|own| own * 10),
    ) {
        let point = number(point);
        let slopes = [Rational::new(slopes.0, 16), Rational::new(slopes.1, 16)];
        let touches = [TangentPoint::At(at.clone()), TangentPoint::Mass(number(3)), TangentPoint::NoContact];
        for touch in touches {
            let Some(height) = chance.gap(&point, &cell, &touch, &slopes) else { continue };
            // Reaches outside the cell are not checked.
            let most = |side: usize, [near, far]: &[Rational; 2]| {
                if cell.is_open[side] && near < far { 5_i64 } else { 6 }
            };
            prop_assume!(!cell.is_open[0] || (cell.below[0] < cell.below[1] && cell.above[0] < cell.above[1]));
            for step in 0..=most(0, &cell.below) {
                for other in 0..=most(1, &cell.above) {
                    let place = |[near, far]: &[Rational; 2], step: i64| {
                        near + &((far - near) * Rational::new(step, 6))
                    };
                    let reach = [place(&cell.below, step), place(&cell.above, other)];
                    let [mass, _] = chance.probability_bounds(&point, &reach);
                    let Some([below, _]) = enclosures::ln(&mass) else { continue };
                    let bound = &height + &slopes[0] * &reach[0] + &slopes[1] * &reach[1];
                    prop_assert!(below <= bound, "{:?} at {:?}: {} > {}", touch, reach, below, bound);
                }
            }
        }
    }

    #[test]
    fn tangent_touches_at_its_point(
        density in densities(),
        (cell, at) in cells(),
        point in (1..9_i64).prop_map(|own| own * 10),
    ) {
        let point = number(point);
        let chance = LogConcaveDistribution::dense(density, None, None, &Rational::new(1, 1000)).unwrap();
        let LogConcaveDistribution::Dense(dense) = &chance else { return Ok(()) };
        let Some(seen) = dense.cut_positions(&point, &cell) else { return Ok(()) };
        prop_assume!(seen.iter().all(|own| *own == CutPosition::NotReached));
        let Some(([mass, _], rises)) = dense.tangent(&point, &seen, &at) else { return Ok(()) };
        prop_assume!(mass > Rational::new(1, 1_000_000));
        let slopes = rises.map(|[low, _]| low);
        let height = chance.gap(&point, &cell, &TangentPoint::At(at.clone()), &slopes).unwrap();
        let [_, above] = enclosures::ln(&mass).unwrap();
        let bound = &height + &slopes[0] * &at[0] + &slopes[1] * &at[1];
        prop_assert!(bound - above < Rational::new(1, 100_000_000));
    }

    #[test]
    fn rounded_number_is_no_more_probable_than_widened_interval(
        chance in chances(),
        (_, at) in cells(),
        point in (1..9_i64).prop_map(|own| own * 10),
    ) {
        let point = number(point);
        let (lower, upper) = (&point - &at[0], &point + &at[1]);
        let inside = chance.probability_inside([&lower, &upper], &Rational::new(1, 10));
        let [_, above] = chance.probability_bounds(&point, &at);
        prop_assert!(inside <= above);
    }

    #[test]
    fn interval_beyond_support_has_probability_zero_or_gains_nothing(
        chance in chances(),
        (_, at) in cells(),
        point in (1..9_i64).prop_map(|own| own * 10),
    ) {
        let point = number(point);
        let [(least_below, most_below), (least_above, most_above)] = chance.limits(&point);
        let [low, high] = chance.probability_bounds(&point, &at);
        if at[0] < least_below || at[1] < least_above {
            prop_assert!(low.is_zero());
        } else if !matches!(&chance, LogConcaveDistribution::Dense(own) if own.density.concavity_limit().is_some()) {
            let cut = |value: &Rational, most: &Option<Rational>| {
                most.as_ref().map_or(value.clone(), |most| value.clone().min(most.clone()))
            };
            let kept = [cut(&at[0], &most_below), cut(&at[1], &most_above)];
            let [_, kept] = chance.probability_bounds(&point, &kept);
            prop_assert!(kept >= low && kept <= high.max(kept.clone()), "{kept} {low}");
        }
    }
}

#[test]
fn probabilities_match_samples() {
    // Some ten thousand evenly spread quantiles represent random draws.
    let quantile = |density: &Density, share: f64| -> f64 {
        let (mut low, mut high): (f64, f64) = (-100.0, 200.0);
        for _ in 0..60 {
            let middle = f64::midpoint(low, high);
            let at = Rational::from_f64_exactly(middle).unwrap();
            if density.cdf_bounds(&at)[0].to_f64() < share {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    };
    let density = Density::Normal {
        mean: Rational::from(10),
        deviation: Rational::from(3),
    };
    let resolution = Rational::new(1, 10);
    let cuts = [Some(Rational::from(7)), Some(Rational::from(14))];
    let [minimum, maximum] = cuts;
    let chance =
        LogConcaveDistribution::dense(density.clone(), minimum, maximum, &resolution).unwrap();
    let draws: Vec<f64> = (0..2000)
        .map(|index| quantile(&density, (f64::from(index) + 0.5) / 2000.0))
        .map(|own| (own.clamp(7.0, 14.0) * 10.0).round() / 10.0)
        .collect();
    for (lower, upper) in [
        (70, 140),
        (71, 139),
        (90, 140),
        (70, 110),
        (100, 100),
        (20, 69),
    ] {
        let inside = chance.probability_inside([&number(lower), &number(upper)], &resolution);
        let ends = [number(lower).to_f64() - 1e-9, number(upper).to_f64() + 1e-9];
        let count = draws
            .iter()
            .filter(|own| ends[0] <= **own && **own <= ends[1])
            .count();
        let share = f64::from(u32::try_from(count).unwrap()) / 2000.0;
        assert!(
            (inside.to_f64() - share).abs() < 2e-3,
            "{lower} {upper}: {inside} {share}"
        );
    }
}

#[test]
fn value_steps_sum_to_interval_probability() {
    let values: Vec<Rational> = [10, 20, 30, 40, 40, 70].map(number).to_vec();
    let chance = LogConcaveDistribution::Values(values.clone());
    let cell = Cell {
        below: [number(5), number(25)],
        above: [number(0), number(15)],
        is_open: [false; 2],
    };
    let steps = Steps::new(&values, &number(30), &cell);
    let total = steps.sides.iter().filter_map(|own| own.last());
    let total = steps.center + total.map(|(_, share)| share).sum::<Rational>();
    let far = [cell.below[1].clone(), cell.above[1].clone()];
    assert_eq!(chance.probability_bounds(&number(30), &far)[0], total);
}

#[test]
fn short_interval_probability_has_small_relative_error() {
    // The probability is the density in the middle times the width, as the interval is very short.
    let bells = [
        Density::Normal {
            mean: Rational::from(10),
            deviation: Rational::from(3),
        },
        Density::Lognormal {
            location: Rational::from(2),
            spread: Rational::new(1, 2),
        },
    ];
    for density in bells {
        for tenths in [3, 20, 74, 100, 170, 300] {
            let (lower, width) = (number(tenths), Rational::new(1, 1_000_000_000));
            let upper = &lower + &width;
            let [least, most] = density.between([Some(&lower), Some(&upper)]);
            let [below, above] = density.density_bounds(&lower);
            let [later_below, later_above] = density.density_bounds(&upper);
            assert!(
                least <= above.max(later_above) * &width,
                "{density:?} {tenths}"
            );
            assert!(
                most >= below.min(later_below) * &width,
                "{density:?} {tenths}"
            );
            let apart = (&most - &least).checked_div(&most).unwrap();
            assert!(
                apart < Rational::new(1, 1_000_000),
                "{density:?} {tenths}: {apart}"
            );
        }
    }
}
