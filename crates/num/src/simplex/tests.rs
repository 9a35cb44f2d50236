//! The simplex, compared with Fourier-Motzkin elimination.

use std::collections::BTreeMap;
use std::ops::Range;

use proptest::prelude::*;

use super::{Infeasible, Optimum, Simplex, VariableId};
use crate::{Delta, Rational};

/// `Σ coefficients[i] · x_i <= bound`.
#[derive(Clone, Debug)]
struct Inequality {
    coefficients: Vec<Rational>,
    bound: Delta,
}

impl Inequality {
    /// Returns `factor · self + other_factor · other`.
    fn combined(&self, factor: &Rational, other: &Self, other_factor: &Rational) -> Self {
        let pairs = self.coefficients.iter().zip(&other.coefficients);
        Self {
            coefficients: pairs.map(|(a, b)| a * factor + b * other_factor).collect(),
            bound: &self.bound.scaled(factor) + &other.bound.scaled(other_factor),
        }
    }

    fn holds_at(&self, point: &[Rational]) -> bool {
        let sum: Rational = (self.coefficients.iter().zip(point))
            .map(|(a, x)| a * x)
            .sum();
        if self.bound.infinitesimal.is_negative() {
            sum < self.bound.real
        } else {
            sum <= self.bound.real
        }
    }
}

/// Returns the inequalities that remain when `variable` is eliminated.
fn eliminated(system: &[Inequality], variable: usize) -> Vec<Inequality> {
    let mut rest = Vec::new();
    for upper in system {
        let a = &upper.coefficients[variable];
        if a.is_zero() {
            rest.push(upper.clone());
        }
        if !a.is_positive() {
            continue;
        }
        for lower in system {
            let b = &lower.coefficients[variable];
            if b.is_negative() {
                rest.push(upper.combined(&b.abs(), lower, a));
            }
        }
    }
    tightest(rest)
}

/// Removes inequalities that another one with the same left side, up to a factor, implies.
fn tightest(system: Vec<Inequality>) -> Vec<Inequality> {
    let mut bounds: BTreeMap<Vec<Rational>, Delta> = BTreeMap::new();
    for inequality in system {
        let lead = inequality.coefficients.iter().find(|c| !c.is_zero());
        let factor = lead.map_or(Rational::ONE, |lead| Rational::ONE / lead.abs());
        let coefficients = inequality.coefficients.iter().map(|c| c * &factor);
        let bound = inequality.bound.scaled(&factor);
        let tightest = bounds
            .entry(coefficients.collect())
            .or_insert_with(|| bound.clone());
        *tightest = bound.min(tightest.clone());
    }
    let unfold = |(coefficients, bound)| Inequality {
        coefficients,
        bound,
    };
    bounds.into_iter().map(unfold).collect()
}

/// Returns `true` if the inequalities have a solution.
fn is_feasible(system: &[Inequality], variable_count: usize) -> bool {
    let rest = (0..variable_count).fold(system.to_vec(), |rest, v| eliminated(&rest, v));
    rest.iter().all(|left| left.bound >= Delta::ZERO)
}

/// Returns the supremum of `Σ objective[i] · x_i`, of a system that has a solution.
fn supremum(system: &[Inequality], objective: &[Rational]) -> Optimum {
    let count = objective.len();
    let widened = |coefficients: &[Rational], last: i64| {
        let mut coefficients = coefficients.to_vec();
        coefficients.push(Rational::from(last));
        coefficients
    };
    let mut all: Vec<Inequality> = (system.iter())
        .map(|inequality| Inequality {
            coefficients: widened(&inequality.coefficients, 0),
            bound: inequality.bound.clone(),
        })
        .collect();
    let negated: Vec<Rational> = objective.iter().map(|c| -c).collect();
    for coefficients in [widened(&negated, 1), widened(objective, -1)] {
        all.push(Inequality {
            coefficients,
            bound: Delta::ZERO,
        });
    }
    let rest = (0..count).fold(all, |rest, v| eliminated(&rest, v));
    let uppers = rest
        .iter()
        .filter(|left| left.coefficients[count].is_positive());
    uppers
        .map(|left| {
            let inverse = Rational::ONE / &left.coefficients[count];
            left.bound.scaled(&inverse)
        })
        .min()
        .map_or(Optimum::Unbounded, Optimum::Value)
}

/// A simplex that holds inequalities, tagged by their position. Every second one is written in
/// reverse, as a lower bound. Those on one variable need no definition.
struct System {
    simplex: Simplex,
    variables: Vec<VariableId>,
}

impl System {
    fn new(variable_count: usize) -> Self {
        let mut simplex = Simplex::new();
        let variables = (0..variable_count)
            .map(|_| simplex.add_variable())
            .collect();
        Self { simplex, variables }
    }

    fn combination(&self, coefficients: &[Rational]) -> Vec<(VariableId, Rational)> {
        let pairs = self.variables.iter().copied().zip(coefficients.to_vec());
        pairs.filter(|(_, c)| !c.is_zero()).collect()
    }

    fn add(&mut self, inequality: &Inequality, tag: usize) {
        let row = self.combination(&inequality.coefficients);
        if let [(variable, factor)] = &row[..] {
            let bound = inequality.bound.scaled(&(Rational::ONE / factor));
            if factor.is_positive() {
                self.simplex.assert_upper(*variable, bound, tag);
            } else {
                self.simplex.assert_lower(*variable, bound, tag);
            }
        } else if tag.is_multiple_of(2) {
            let sum = self.simplex.define(&row);
            self.simplex
                .assert_upper(sum, inequality.bound.clone(), tag);
        } else {
            let negated: Vec<_> = row.iter().map(|(v, c)| (*v, -c)).collect();
            let sum = self.simplex.define(&negated);
            self.simplex.assert_lower(sum, -&inequality.bound, tag);
        }
    }

    fn point(&self) -> Vec<Rational> {
        let model = self.simplex.model();
        self.variables
            .iter()
            .map(|v| model[v.index()].clone())
            .collect()
    }
}

/// Returns `true` if the multipliers prove that the inequalities have no solution. A bound on a
/// single variable was divided by the size of its coefficient, so its multiplier is divided as
/// well.
fn proves(infeasible: &Infeasible, system: &[Inequality], variable_count: usize) -> bool {
    let mut sum = Inequality {
        coefficients: vec![Rational::ZERO; variable_count],
        bound: Delta::ZERO,
    };
    for (tag, multiplier) in &infeasible.certificate {
        let inequality = &system[*tag];
        let mut terms = inequality.coefficients.iter().filter(|c| !c.is_zero());
        let size = match (terms.next(), terms.next()) {
            (Some(only), None) => only.abs(),
            _ => Rational::ONE,
        };
        if !multiplier.is_positive() {
            return false;
        }
        sum = sum.combined(&Rational::ONE, inequality, &(multiplier / size));
    }
    sum.coefficients.iter().all(Rational::is_zero) && sum.bound < Delta::ZERO
}

const VARIABLES: usize = 3;

fn coefficients() -> impl Strategy<Value = Vec<Rational>> {
    prop::collection::vec((-3..4_i64).prop_map(Rational::from), VARIABLES)
}

fn inequalities(count: Range<usize>) -> impl Strategy<Value = Vec<Inequality>> {
    let bound = (-6..9_i64, 1..3_i64, any::<bool>()).prop_map(|(n, d, is_strict)| {
        let number = Rational::new(n, d);
        if is_strict {
            Delta::just_below(number)
        } else {
            Delta::from(number)
        }
    });
    let inequality = (coefficients(), bound).prop_map(|(coefficients, bound)| Inequality {
        coefficients,
        bound,
    });
    prop::collection::vec(inequality, count)
}

#[test]
fn optimality_proof_sums_to_the_objective() {
    let mut simplex = Simplex::new();
    let (x, y) = (simplex.add_variable(), simplex.add_variable());
    let sum = simplex.define(&[(x, Rational::ONE), (y, Rational::ONE)]);
    for (variable, bound, tag) in [(x, 3, 1), (y, 4, 2), (sum, 5, 3)] {
        simplex.assert_upper(variable, Delta::from(Rational::from(bound)), tag);
    }
    simplex.assert_lower(y, Delta::ZERO, 4);
    // 2x + y = (x <= 3) + (x + y <= 5)
    let objective = [(x, Rational::from(2)), (y, Rational::ONE)];
    let (optimum, proof) = simplex.maximize_with_proof(&objective).unwrap();
    assert_eq!(optimum, Optimum::Value(Delta::from(Rational::from(8))));
    assert_eq!(proof, [(1, Rational::ONE), (3, Rational::ONE)]);
    // x - 2y = (x <= 3) + 2 (-y <= 0)
    let objective = [(x, Rational::ONE), (y, Rational::from(-2))];
    let (optimum, proof) = simplex.maximize_with_proof(&objective).unwrap();
    assert_eq!(optimum, Optimum::Value(Delta::from(Rational::from(3))));
    assert_eq!(proof, [(1, Rational::ONE), (4, Rational::from(2))]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn verdict_equals_fourier_motzkin_with_proof(
        inequalities in inequalities(1..8),
    ) {
        let mut system = System::new(VARIABLES);
        for (tag, inequality) in inequalities.iter().enumerate() {
            system.add(inequality, tag);
        }
        match system.simplex.check() {
            Ok(()) => {
                let point = system.point();
                prop_assert!(inequalities.iter().all(|i| i.holds_at(&point)));
            }
            Err(infeasible) => prop_assert!(proves(&infeasible, &inequalities, VARIABLES)),
        }
        let expected = is_feasible(&inequalities, VARIABLES);
        prop_assert_eq!(system.simplex.check().is_ok(), expected);
    }

    #[test]
    fn optima_equal_fourier_motzkin(
        inequalities in inequalities(1..8),
        objectives in prop::collection::vec(coefficients(), 1..4),
    ) {
        let mut system = System::new(VARIABLES);
        for (tag, inequality) in inequalities.iter().enumerate() {
            system.add(inequality, tag);
        }
        for objective in &objectives {
            let combination = system.combination(objective);
            let Ok(optimum) = system.simplex.maximize(&combination) else {
                prop_assert!(!is_feasible(&inequalities, VARIABLES));
                return Ok(());
            };
            prop_assert_eq!(optimum, supremum(&inequalities, objective));
            let negated: Vec<Rational> = objective.iter().map(|c| -c).collect();
            let least = match supremum(&inequalities, &negated) {
                Optimum::Unbounded => Optimum::Unbounded,
                Optimum::Value(value) => Optimum::Value(-&value),
            };
            prop_assert_eq!(system.simplex.minimize(&combination), Ok(least));
            prop_assert!(inequalities.iter().all(|i| i.holds_at(&system.point())));
        }
    }

    #[test]
    fn pop_restores_bounds_of_lower_level(
        base in inequalities(1..5),
        levels in prop::collection::vec(inequalities(1..3), 1..4),
        checks in prop::collection::vec(any::<bool>(), 4),
    ) {
        let mut system = System::new(VARIABLES);
        let mut stack = vec![base];
        for (tag, inequality) in stack[0].iter().enumerate() {
            system.add(inequality, tag);
        }
        for (level, added) in levels.into_iter().enumerate() {
            system.simplex.push();
            let mut all = stack[level].clone();
            for inequality in added {
                system.add(&inequality, all.len());
                all.push(inequality);
            }
            if checks[level] {
                let verdict = system.simplex.check().is_ok();
                prop_assert_eq!(verdict, is_feasible(&all, VARIABLES));
            }
            stack.push(all);
        }
        while let Some(inequalities) = stack.pop() {
            match system.simplex.check() {
                Ok(()) => {
                    let point = system.point();
                    prop_assert!(inequalities.iter().all(|i| i.holds_at(&point)));
                }
                Err(infeasible) => {
                    prop_assert!(proves(&infeasible, &inequalities, VARIABLES));
                    prop_assert!(!is_feasible(&inequalities, VARIABLES));
                }
            }
            system.simplex.pop();
        }
    }
}

#[test]
fn a_strict_and_a_plain_bound_at_one_number_contradict_each_other() {
    let mut system = Simplex::new();
    let x = system.add_variable();
    system.assert_lower(x, Delta::from(Rational::from(5)), 10);
    system.assert_upper(x, Delta::just_below(Rational::from(5)), 20);
    let clash = system.check().expect_err("5 <= x < 5");
    assert_eq!(clash.tags().collect::<Vec<_>>(), [10, 20]);
}

#[test]
fn the_largest_value_below_an_open_end_is_just_below_it() {
    let mut system = Simplex::new();
    let x = system.add_variable();
    let below_five = Delta::just_below(Rational::from(5));
    system.assert_upper(x, below_five.clone(), 0);
    let objective = [(x, Rational::ONE)];
    assert_eq!(system.maximize(&objective), Ok(Optimum::Value(below_five)));
    assert_eq!(system.minimize(&objective), Ok(Optimum::Unbounded));
    assert!(system.model()[x.index()] < Rational::from(5));
}

#[test]
fn a_definition_may_build_on_definitions() {
    let mut system = Simplex::new();
    let (x, y) = (system.add_variable(), system.add_variable());
    let one = || Rational::ONE;
    let sum = system.define(&[(x, one()), (y, one())]);
    let x_again = system.define(&[(sum, one()), (y, -one())]);
    system.assert_lower(x, Delta::from(one()), 0);
    system.assert_upper(x_again, Delta::ZERO, 1);
    let clash = system.check().expect_err("x is one number");
    assert_eq!(clash.certificate.len(), 2);
}

#[test]
fn an_empty_combination_is_zero() {
    let mut system = Simplex::new();
    let nothing = system.define(&[]);
    assert!(system.check().is_ok());
    system.assert_lower(nothing, Delta::from(Rational::ONE), 3);
    let clash = system.check().expect_err("0 >= 1");
    assert_eq!(clash.certificate, [(3, Rational::ONE)]);
}
