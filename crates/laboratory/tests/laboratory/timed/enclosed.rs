//! The bounds of small worlds enclose the values of a plain recursion.

use elbowroom::mdp::{Settings, TimedOptimum};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::bounds;
use super::twin::{self, SmallWorld};
use crate::sampled::one_in;

/// Returns the bounds of a small world on one grid, and checks that they enclose the values of the
/// recursion up to `slack`.
fn enclosing(
    world: &SmallWorld,
    first_cells: u32,
    [worst, best]: [f64; 2],
    slack: f64,
) -> TimedOptimum {
    let settings = Settings {
        first_cells: first_cells as usize,
        horizon: Some(i64::from(twin::ENDS).into()),
        // No refinement of the grid.
        gap: 1.0,
        ..Settings::default()
    };
    let found = bounds(&world.domain(), &world.problem(), &world.world(), &settings);
    assert!(
        found.lower <= worst + slack && best <= found.upper + slack,
        "{worst} to {best} is outside of {found:?}\n{world:#?}"
    );
    found
}

#[test]
fn bounds_enclose_recursion() {
    let mut close = 0;
    for number in 0..200 {
        let mut rng = ChaCha8Rng::seed_from_u64(number);
        let world = SmallWorld::random(&mut rng, number % 2 == 0);
        let (worst, best) = world.best();
        for first_cells in [twin::ENDS / 2, twin::ENDS] {
            let found = enclosing(&world, first_cells, [worst, best], 1e-12);
            if first_cells == twin::ENDS && best > 0.0 && found.upper - found.lower < 0.1 {
                close += 1;
            }
        }
    }
    assert!(
        close >= 20,
        "only {close} worlds with close bounds: too few to mean something"
    );
}

/// A policy with a subset of the actions that acts only at events is never better than the optimum.
/// In some random worlds it is nearly as good.
#[test]
fn restricted_agent_is_never_better_than_the_optimum() {
    let mut near = 0;
    for number in 0..60 {
        let mut rng = ChaCha8Rng::seed_from_u64(4000 + number);
        let world = SmallWorld::random(&mut rng, number % 2 == 0);
        let (worst, best) = world.best();
        let all = ["(a0)", "(a1)", "(a2)"].map(str::to_owned);
        let settings = Settings {
            first_cells: twin::ENDS as usize,
            horizon: Some(i64::from(twin::ENDS).into()),
            most_states: 1_000,
            gap: 0.0,
            plans: vec![all[..1].to_vec(), all[..2].to_vec(), all.to_vec()],
            ..Settings::default()
        };
        let found = bounds(&world.domain(), &world.problem(), &world.world(), &settings);
        let lower = found.within.map_or(0.0, |within| within.lower);
        assert!(
            lower <= best + 1e-9,
            "{lower} is more than {best}\n{world:#?}"
        );
        near += usize::from(worst > 0.0 && worst < 1.0 && lower > worst - 0.1);
    }
    assert!(
        near >= 5,
        "only {near} worlds in which that is nearly as good: too few to mean something"
    );
}

#[test]
fn bounds_enclose_recursion_with_failure_effects() {
    let (mut close, mut matters) = (0, 0);
    for number in 0..200 {
        let mut rng = ChaCha8Rng::seed_from_u64(2000 + number);
        let world = SmallWorld::with_outcomes(&mut rng, number % 2 == 0);
        let (worst, best) = world.best();
        for first_cells in [twin::ENDS / 2, twin::ENDS] {
            let found = enclosing(&world, first_cells, [worst, best], 1e-12);
            let is_open = best > 0.0 && worst < 1.0;
            if first_cells == twin::ENDS && is_open && found.upper - found.lower < 0.3 {
                close += 1;
                let (plain, _) = world.without_outcomes().best();
                matters += usize::from((plain - worst).abs() > 0.01);
            }
        }
    }
    assert!(
        close >= 20 && matters >= 10,
        "only {close} worlds with close bounds, and in {matters} of them outcomes matter: too few \
         to mean something"
    );
}

/// Worlds with amounts that vary; in half of them everything happens at known times.
#[test]
fn bounds_enclose_recursion_with_numbers() {
    let (mut close, mut matters) = ([0; 2], 0);
    for number in 0..worlds(200) {
        let mut rng = ChaCha8Rng::seed_from_u64(6000 + number);
        let world = SmallWorld::with_numbers(&mut rng, number % 2 == 0);
        let plain = world.without_numbers().best();
        for world in [world.clone(), world.with_known_times()] {
            let (worst, best) = world.best();
            for first_cells in [twin::ENDS / 2, twin::ENDS] {
                let found = enclosing(&world, first_cells, [worst, best], 1e-9);
                let is_open = best > 0.0 && worst < 1.0;
                if first_cells == twin::ENDS && is_open && found.upper - found.lower < 0.3 {
                    close[usize::from(world.has_known_times())] += 1;
                    matters += usize::from((plain.0 - worst).abs() > 0.01);
                }
            }
        }
    }
    assert!(
        close.iter().all(|close| *close >= 8) && matters >= 5,
        "only {close:?} worlds with close bounds, and in {matters} of them numbers matter: too few \
         to mean something"
    );
}

/// Facts and failures, with everything at known times.
#[test]
fn bounds_enclose_recursion_at_known_times() {
    let mut close = 0;
    for number in 0..worlds(200) {
        let mut rng = ChaCha8Rng::seed_from_u64(7000 + number);
        let asks_for_less = number % 2 == 0;
        let world = if number % 3 == 0 {
            SmallWorld::with_outcomes(&mut rng, asks_for_less)
        } else {
            SmallWorld::random(&mut rng, asks_for_less)
        };
        let world = world.with_known_times();
        let (worst, best) = world.best();
        let found = enclosing(&world, twin::ENDS, [worst, best], 1e-9);
        let is_open = best > 0.0 && worst < 1.0;
        close += usize::from(is_open && found.upper - found.lower < 0.2);
    }
    assert!(
        close >= 12,
        "only {close} worlds with close bounds: too few to mean something"
    );
}

#[test]
fn bounds_enclose_recursion_with_rates() {
    // The recursion ignores more than two changes in a second.
    const LEFT_OUT: f64 = 5e-4;
    let mut close = 0;
    for number in 0..200 / one_in::<u64>(2) {
        let mut rng = ChaCha8Rng::seed_from_u64(1000 + number);
        let world = SmallWorld::with_rates(&mut rng, number % 2 == 0);
        let (worst, best) = world.best();
        for first_cells in [twin::ENDS / 2, twin::ENDS] {
            let found = enclosing(&world, first_cells, [worst, best], LEFT_OUT);
            let is_open = best > 0.0 && worst < 1.0 - LEFT_OUT;
            if first_cells == twin::ENDS && is_open && found.upper - found.lower < 0.3 {
                close += 1;
            }
        }
    }
    assert!(
        close >= 5,
        "only {close} worlds with close bounds: too few to mean something"
    );
}

/// Returns the number of worlds, from the environment or by default.
fn worlds(count: u64) -> u64 {
    let asked_for = std::env::var("ELBOWROOM_WORLDS").ok();
    asked_for.map_or(count, |text| text.parse().expect("a number of worlds"))
}
