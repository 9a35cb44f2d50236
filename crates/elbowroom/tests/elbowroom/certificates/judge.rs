//! Checks of a certificate's claim about its box that are independent of its proofs: by the search
//! for strategies and fixed times, at all corners of the box, and by linear programs.

use std::collections::BTreeMap;

use elbowroom::num::simplex::{Simplex, VariableId};
use elbowroom::num::{Delta, Rational};
use elbowroom::stn::uncertain::{ContingentLink, UncertainNetwork};
use elbowroom::stn::{self, ConsistentNetwork, Network, NodeId};
use elbowroom::verify::sound::{Condition, Difference, FailureCase, Multiplied, Sound, Violation};
use elbowroom::verify::{Certificate, End, Guarantee, Limit};
use serde_json::Value;

use crate::shared::changed::numbers;

/// Bound for infinite ends, later than any time.
const EVER: i64 = 1_000_000_000;

/// Returns the certificate in an answer.
pub(crate) fn certificate_in(answer: &Value) -> Certificate {
    let certificate = answer.pointer("/best/certificate").expect("a certificate");
    serde_json::from_value(certificate.clone()).expect("the form of a certificate")
}

/// Returns `true` if a change at this place does not affect the proof that no box is better: it is
/// in the proof that the box is inside, or in a constraint without a mention in the proof of an
/// inequality.
pub(crate) fn is_about_the_box(answer: &Value, place: &str) -> bool {
    if place.starts_with("/best/certificate/sound/") {
        return true;
    }
    let Some(rest) = place.strip_prefix("/best/certificate/constraints/") else {
        return false;
    };
    let index: u64 = rest
        .split('/')
        .next()
        .and_then(|own| own.parse().ok())
        .expect("a position");
    let proofs = answer.pointer("/best/certificate/proofs").expect("proofs");
    let mut mentioned = Vec::new();
    numbers(proofs, "", &mut mentioned);
    mentioned.iter().all(|at| {
        let part = ["least", "most", "early", "late", "unlabelled"];
        let is_part = part.iter().any(|own| at.ends_with(&format!("/{own}")));
        !is_part || proofs.pointer(at).and_then(Value::as_u64) != Some(index)
    })
}

/// Returns `true` if the box is inside the envelope, by the conditions that the certificate lists.
pub(crate) fn is_inside(certificate: &Certificate) -> bool {
    let Some(sound) = &certificate.sound else {
        return false;
    };
    let judge = Judge::new(certificate, sound);
    let conditions = sound.conditions.iter().flatten();
    judge.is_controllable() && conditions.into_iter().all(|own| judge.cannot_fail(own))
}

struct Judge<'a> {
    certificate: &'a Certificate,
    intervals: Vec<[Option<Rational>; 2]>,
}

impl<'a> Judge<'a> {
    fn new(certificate: &'a Certificate, sound: &Sound) -> Self {
        let slack = |place: usize| &certificate.slacks[place].0;
        let parameters = certificate.parameters.iter().enumerate();
        let intervals = parameters.map(|(index, own)| {
            let [below, above] = if certificate.symmetric {
                [slack(index); 2]
            } else {
                [slack(2 * index), slack(2 * index + 1)]
            };
            [Some(&own.nominal - below), Some(&own.nominal + above)]
        });
        let mut intervals: Vec<_> = intervals.collect();
        for own in &sound.endless {
            intervals[own.parameter][usize::from(own.end == End::Upper)] = None;
        }
        Self {
            certificate,
            intervals,
        }
    }

    fn is_controllable(&self) -> bool {
        if self.certificate.guarantee == Guarantee::Weak {
            return self.has_schedules();
        }
        let Some(network) = self.uncertain() else {
            return false;
        };
        match self.certificate.guarantee {
            Guarantee::Strong => network.strong().is_ok(),
            _ => network.is_dynamically_controllable(),
        }
    }

    /// Returns the network with uncontrollable durations, or `None` if a constraint depends on an
    /// infinite end.
    fn uncertain(&self) -> Option<UncertainNetwork> {
        let mut network = Network::with_nodes(self.certificate.points.len());
        let mut links = Vec::new();
        for own in &self.certificate.constraints {
            let (from, to) = (node(own.from), node(own.to));
            if let (true, Limit::Parameter(parameter)) = (own.observed, &own.lower) {
                let [lower, upper] = self.intervals[*parameter].clone();
                links.push(ContingentLink {
                    activation: from,
                    end: to,
                    lower: lower.filter(|lower| !lower.is_negative())?,
                    upper,
                });
                continue;
            }
            let worst = |limit: &Limit, side: usize| match limit {
                Limit::None => Some(None),
                Limit::Number(number) => Some(Some(number.0.clone())),
                Limit::Parameter(parameter) => {
                    Some(Some(self.intervals[*parameter][side].clone()?))
                }
            };
            if let Some(upper) = worst(&own.upper, 0)? {
                network.add(stn::Constraint::at_most(from, to, upper));
            }
            if let Some(lower) = worst(&own.lower, 1)? {
                network.add(stn::Constraint::at_least(from, to, lower));
            }
        }
        let ends: Vec<NodeId> = links.iter().map(|link| link.end).collect();
        for point in 1..self.certificate.points.len() {
            if !ends.contains(&node(point)) {
                network.add(stn::Constraint::at_least(
                    node(0),
                    node(point),
                    Rational::ZERO,
                ));
            }
        }
        UncertainNetwork::new(network, links).ok()
    }

    /// Returns `true` if there is a schedule at each corner of the box.
    fn has_schedules(&self) -> bool {
        let count = self.intervals.len();
        (0..1_usize << count).all(|corner| {
            let value = |parameter: usize| {
                let is_upper = (corner >> parameter) & 1 == 1;
                let end = self.intervals[parameter][usize::from(is_upper)].clone();
                let ever = Rational::from(if is_upper { EVER } else { -EVER });
                end.unwrap_or(ever)
            };
            let mut network = Network::with_nodes(self.certificate.points.len());
            for point in 1..self.certificate.points.len() {
                network.add(stn::Constraint::at_least(
                    node(0),
                    node(point),
                    Rational::ZERO,
                ));
            }
            for own in &self.certificate.constraints {
                let (from, to) = (node(own.from), node(own.to));
                let limit = |limit: &Limit| match limit {
                    Limit::None => None,
                    Limit::Number(number) => Some(number.0.clone()),
                    Limit::Parameter(parameter) => Some(value(*parameter)),
                };
                if let Some(upper) = limit(&own.upper) {
                    network.add(stn::Constraint::at_most(from, to, upper));
                }
                if let Some(lower) = limit(&own.lower) {
                    network.add(stn::Constraint::at_least(from, to, lower));
                }
            }
            ConsistentNetwork::try_from(network).is_ok()
        })
    }

    /// Returns `true` if no schedule for values in the box violates the condition in one of the
    /// listed ways.
    fn cannot_fail(&self, condition: &Condition) -> bool {
        let moment = self.certificate.points.len();
        let before = |earlier: usize, later: usize| Difference {
            from: later,
            to: earlier,
            most: Rational::ZERO,
            strict: true,
        };
        let between = condition
            .during
            .map(|[start, end]| [before(start, moment), before(moment, end)]);
        let mut open = vec![(0, between.into_iter().flatten().collect::<Vec<_>>())];
        while let Some((index, known)) = open.pop() {
            match condition.cases.get(index) {
                None => return false,
                Some(FailureCase::Either { event, cases }) => {
                    let mut after = before(*event, moment);
                    after.strict = false;
                    for (case, difference) in cases.iter().zip([after, before(moment, *event)]) {
                        let mut known = known.clone();
                        known.push(difference);
                        open.push((*case, known));
                    }
                }
                Some(FailureCase::Never(_)) => {
                    let nothing = Violation {
                        differences: Vec::new(),
                        inequalities: Vec::new(),
                        corners: Vec::new(),
                        sums: Vec::new(),
                    };
                    if self.is_possible(&nothing, &known) {
                        return false;
                    }
                }
                Some(FailureCase::Ways(ways)) => {
                    if ways.iter().any(|way| self.is_possible(way, &known)) {
                        return false;
                    }
                }
            }
        }
        true
    }

    /// Returns `true` if a violation is possible at some corner.
    fn is_possible(&self, way: &Violation, known: &[Difference]) -> bool {
        (0..1_usize << way.corners.len()).any(|corner| {
            let mut intervals = self.intervals.clone();
            for (place, &parameter) in way.corners.iter().enumerate() {
                let end = intervals[parameter][(corner >> place) & 1].clone();
                intervals[parameter] = [end.clone(), end];
            }
            self.program(&intervals, way, known)
        })
    }

    /// Returns `true` if the linear program with all constraints of the violation has a solution.
    fn program(
        &self,
        intervals: &[[Option<Rational>; 2]],
        way: &Violation,
        known: &[Difference],
    ) -> bool {
        let mut simplex = Simplex::new();
        let points = self.certificate.points.len();
        let times: Vec<VariableId> = (0..=points).map(|_| simplex.add_variable()).collect();
        simplex.assert_upper(times[0], Delta::ZERO, 0);
        let values: Vec<VariableId> = intervals.iter().map(|_| simplex.add_variable()).collect();
        for (variable, [lower, upper]) in values.iter().zip(intervals) {
            if let Some(lower) = lower {
                simplex.assert_lower(*variable, Delta::from(lower.clone()), 0);
            }
            if let Some(upper) = upper {
                simplex.assert_upper(*variable, Delta::from(upper.clone()), 0);
            }
        }
        for time in &times[..points] {
            simplex.assert_lower(*time, Delta::ZERO, 0);
        }
        let mut rows: Vec<Row> = Vec::new();
        for own in &self.certificate.constraints {
            for (limit, sign) in [(&own.upper, 1), (&own.lower, -1)] {
                let sign = Rational::from(sign);
                let mut row = vec![(times[own.to], sign.clone()), (times[own.from], -&sign)];
                let bound = match limit {
                    Limit::None => continue,
                    Limit::Number(number) => &number.0 * &sign,
                    Limit::Parameter(parameter) => {
                        row.push((values[*parameter], -&sign));
                        Rational::ZERO
                    }
                };
                rows.push((row, bound, false));
            }
        }
        for own in known.iter().chain(&way.differences) {
            let row = vec![
                (times[own.to], Rational::ONE),
                (times[own.from], Rational::from(-1)),
            ];
            rows.push((row, own.most.clone(), own.strict));
        }
        for own in &way.inequalities {
            let mut row = Vec::new();
            let bound = -&own.constant;
            row.extend(
                own.times
                    .iter()
                    .map(|own| (times[own.point], own.factor.clone())),
            );
            row.extend(
                own.parameters
                    .iter()
                    .map(|own| (values[own.parameter], own.factor.clone())),
            );
            for product in &own.products {
                let value = intervals[product.parameter][0].as_ref().expect("a corner");
                let factor = &product.factor * value;
                match product.by {
                    Multiplied::Time(point) => row.push((times[point], factor)),
                    Multiplied::Parameter(other) => row.push((values[other], factor)),
                }
            }
            rows.push((row, bound, own.strict));
        }
        for row in rows {
            hold(&mut simplex, row);
        }
        simplex.check().is_ok()
    }
}

/// `Σ factor · variable <= bound`, or `<` if the last part is `true`.
type Row = (Vec<(VariableId, Rational)>, Rational, bool);

/// Adds a row to the linear program.
fn hold(simplex: &mut Simplex, (row, bound, is_strict): Row) {
    let mut once: BTreeMap<VariableId, Rational> = BTreeMap::new();
    for (variable, factor) in row {
        *once.entry(variable).or_default() += factor;
    }
    once.retain(|_, factor| !factor.is_zero());
    let row: Vec<(VariableId, Rational)> = once.into_iter().collect();
    let bound = if is_strict {
        Delta::just_below(bound)
    } else {
        Delta::from(bound)
    };
    let sum = simplex.define(&row);
    simplex.assert_upper(sum, bound, 0);
}

fn node(index: usize) -> NodeId {
    NodeId(u32::try_from(index).expect("few points"))
}
