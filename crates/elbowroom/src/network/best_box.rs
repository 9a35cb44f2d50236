//! Most probable box of durations that makes a network dynamically controllable.
//!
//! The search is conflict-directed (Wang & Williams, AAAI 2015): the exact check of a box returns a
//! conflict, a cycle of negative length. The cycle is a linear condition on the ends of the
//! intervals. The allotment of risk maximises the probability under all conditions so far. A conflict may also be resolved by bounds for which its cycle is no longer
//! semi-reducible, so the box is not always the most probable one. The box is always controllable.

use elbowroom_network::NetworkFile;
use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{Conflict, Dispatchable, Ground, UncertainNetwork};

use super::allotment::{Allotment, Cut};
use super::answer::{ControllableBox, LinkInterval, Number};
use super::law::Law;
use super::simulate::Durations;

/// Limit on exact checks of a box.
const MAX_CHECKS: usize = 400;

/// Weights of the barrier: a rough one while conflicts are found, then a fine one.
const WEIGHTS: [f64; 2] = [1e-3, 1e-7];

/// Amount that is subtracted from a probability for the rounding of floating-point numbers.
const ROUNDING: f64 = 1e-9;

/// Box of durations that makes a network dynamically controllable.
pub(super) struct BestBox {
    /// The network with these bounds.
    pub(super) network: UncertainNetwork<Rational>,
    /// Probability of each link's interval.
    pub(super) masses: Vec<f64>,
    /// Lower bound on the probability of success, whatever the dependence between the durations.
    pub(super) least: f64,
    /// Lower bound on the probability of success for the correlations of the file: links of
    /// different groups are independent.
    pub(super) given: f64,
    /// Number of exact checks.
    pub(super) checks: usize,
}

/// Returns the most probable box found; `None` if no box with positive probability is controllable,
/// or the limit on checks is reached before the first box.
pub(super) fn find(file: &NetworkFile, durations: Durations) -> Option<BestBox> {
    let network = &file.network;
    let laws: Vec<Option<Law>> = network
        .link_ids()
        .map(|id| Law::of(file, id, durations))
        .collect();
    let ends = network.links().iter().map(|link| {
        let upper = link.upper.as_ref().map_or(f64::INFINITY, Rational::to_f64);
        [link.lower.to_f64(), upper]
    });
    let mut allotment = Allotment::new(&laws, ends.collect());
    let mut found = None;
    let mut checks = 0;
    'search: for weight in WEIGHTS {
        if !allotment.solve(weight) {
            break;
        }
        loop {
            checks += 1;
            let Some(boxed) = with_intervals(network, &laws, &allotment.intervals) else {
                break 'search;
            };
            let Err(conflict) = boxed.check_controllability() else {
                found = Some(boxed);
                break;
            };
            let is_open = checks < MAX_CHECKS
                && conflict.is_whole
                && allotment.add(cut(&conflict))
                && allotment.solve(weight);
            if !is_open {
                break 'search;
            }
        }
    }
    found.map(|boxed| BestBox::new(file, &laws, boxed, checks))
}

/// Returns the condition under which the conflict's cycle is not negative.
fn cut(conflict: &Conflict) -> Cut {
    let mut constant = 0.0;
    let mut terms: Vec<(usize, usize, f64)> = Vec::new();
    for step in &conflict.steps {
        let (link, end) = match step.ground {
            Ground::Early(link) => (link.index(), 0),
            Ground::Late(link) => (link.index(), 1),
            Ground::Requirement(_) => {
                let bound = step.bound.clone().into_finite();
                constant += bound.map_or(f64::NEG_INFINITY, |bound| bound.to_f64());
                continue;
            }
        };
        match terms
            .iter_mut()
            .find(|term| (term.0, term.1) == (link, end))
        {
            Some(term) => term.2 += 1.0,
            None => terms.push((link, end, 1.0)),
        }
    }
    Cut { constant, terms }
}

/// Returns the network with these intervals, rounded inwards to short decimals. Rounding inwards
/// violates no cut.
fn with_intervals(
    network: &UncertainNetwork<Rational>,
    laws: &[Option<Law>],
    intervals: &[[f64; 2]],
) -> Option<UncertainNetwork<Rational>> {
    let mut links = network.links().to_vec();
    for ((link, law), [lower, upper]) in links.iter_mut().zip(laws).zip(intervals) {
        let Some(law) = law else { continue };
        let unit = decimal_unit(law.spread);
        let steps = |value: f64| Rational::from_f64_as_written(value).map(|value| value / &unit);
        let (lower, upper) = (steps(*lower)?.ceil(), steps(*upper)?.floor());
        if lower > upper {
            return None;
        }
        link.lower = lower * &unit;
        link.upper = Some(upper * &unit);
    }
    UncertainNetwork::new(network.requirements().clone(), links).ok()
}

/// Returns a decimal unit that is at most 10^-5 of the spread.
fn decimal_unit(spread: f64) -> Rational {
    let mut unit = Rational::ONE;
    let mut size = 1.0;
    while size * 1e5 > spread && size > 1e-12 {
        unit = unit / Rational::from(10);
        size /= 10.0;
    }
    unit
}

impl BestBox {
    fn new(
        file: &NetworkFile,
        laws: &[Option<Law>],
        network: UncertainNetwork<Rational>,
        checks: usize,
    ) -> Self {
        let masses: Vec<f64> = laws
            .iter()
            .zip(network.links())
            .map(|(law, link)| {
                let upper = link.upper.as_ref().map(Rational::to_f64);
                let interval = [link.lower.to_f64(), upper.unwrap_or(f64::INFINITY)];
                law.as_ref()
                    .map_or(1.0, |law| law.mass(interval).probability)
            })
            .collect();
        let together = |links: &mut dyn Iterator<Item = usize>| {
            let risk: f64 = links.map(|link| 1.0 - masses[link]).sum();
            f64::max(1.0 - risk, 0.0)
        };
        let least = together(&mut (0..masses.len()));
        let mut given = 1.0;
        let mut is_grouped = vec![false; masses.len()];
        for group in &file.correlations {
            let mut links = group.links.iter().map(|link| link.index());
            given *= together(&mut links);
            for link in &group.links {
                is_grouped[link.index()] = true;
            }
        }
        let alone = masses
            .iter()
            .zip(&is_grouped)
            .filter(|(_, grouped)| !**grouped);
        given *= alone.map(|(mass, _)| mass).product::<f64>();
        Self {
            network,
            least: f64::max(least - ROUNDING, 0.0),
            given: f64::max(given - ROUNDING, 0.0),
            masses,
            checks,
        }
    }

    /// Returns the box as a part of an answer.
    pub(super) fn describe(&self, file: &NetworkFile) -> ControllableBox {
        let links = self.network.links().iter().zip(&self.masses);
        let links = links.map(|(link, &probability)| LinkInterval {
            activation: file.point(link.activation).to_owned(),
            end: file.point(link.end).to_owned(),
            lower: (&link.lower).into(),
            upper: link
                .upper
                .as_ref()
                .map_or_else(Number::infinite, Number::from),
            probability,
        });
        ControllableBox {
            least: self.least,
            given: self.given,
            links: links.collect(),
            checks: self.checks,
        }
    }

    /// Returns the dispatchable form of the network in the box.
    pub(super) fn dispatchable(&self) -> Option<Dispatchable<Rational>> {
        self.network.clone().into_executable().ok()
    }
}
