//! Proof that the box of a certificate is inside the envelope.

use elbowroom_envelope::linear::Factor as Multiplicand;
use elbowroom_envelope::obligations::{Difference, Inequality};
use elbowroom_envelope::{
    ConditionProof, ControlProof, ImpossibilityProof, Oracle, Refutation, RefutedCase,
    ScheduleCase, Summand, TimeRule,
};
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, Side};
use elbowroom_verify::sound;
use elbowroom_verify::sound::{
    Affine, Condition, Control, Edge, Endless, Factor, FailureCase, Ground, Multiplied, Product,
    Schedules, Sound, Strategy, TimeTerm, Violation, Wait,
};
use elbowroom_verify::{End, Exact};

use super::super::Subject;

/// Largest number of time points for which a certificate proves that the box is inside.
const MAX_POINTS: usize = 500;

/// Largest number of numbers in such a proof.
const MAX_NUMBERS: usize = 50_000;

/// Returns the proof that the box is inside the envelope, or `None` if it would be too large.
pub(super) fn containment_proof(
    subject: &Subject<'_>,
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
) -> Option<Sound> {
    let plan = subject.plan;
    if plan.plan.nodes.len() > MAX_POINTS {
        return None;
    }
    let control = oracle.control_proof(envelope);
    let sound = Sound {
        endless: infinite_ends(envelope),
        control: control.map_or(Control::Assumed, |proof| to_control(plan, proof)),
        conditions: oracle.condition_proofs(envelope).map(|proofs| {
            // A condition that cannot fail in any way needs no proof.
            let never_fails =
                |why: &ImpossibilityProof| matches!(why, ImpossibilityProof::Cases(ways) if ways.is_empty());
            let proofs = proofs.iter();
            let proofs = proofs.filter(|own| !own.proof.as_ref().is_some_and(never_fails));
            proofs.map(|proof| condition(subject, proof)).collect()
        }),
    };
    (count_numbers(&sound) <= MAX_NUMBERS).then_some(sound)
}

/// Estimates how many numbers a proof contains.
fn count_numbers(sound: &Sound) -> usize {
    let control = match &sound.control {
        Control::Times(times) => times.len(),
        Control::Schedules(cases) => {
            let rules = cases.iter().map(|case| match case {
                Schedules::Split { .. } => 3,
                Schedules::Rule(times) => {
                    times.iter().map(|own| 1 + 2 * own.parameters.len()).sum()
                }
            });
            rules.sum()
        }
        Control::Strategy(strategy) => 3 * (strategy.edges.len() + strategy.waits.len()),
        Control::Assumed => 0,
    };
    let cases = sound.conditions.iter().flatten().flat_map(|own| &own.cases);
    let conditions = cases.map(|case| match case {
        FailureCase::Either { .. } => 3,
        FailureCase::Never(sum) => 2 * sum.len(),
        FailureCase::Ways(ways) => ways.iter().map(count_numbers_in_way).sum(),
    });
    control + conditions.sum::<usize>()
}

fn count_numbers_in_way(way: &Violation) -> usize {
    let inequalities = way
        .inequalities
        .iter()
        .map(|own| 1 + 2 * (own.times.len() + own.parameters.len()) + 3 * own.products.len());
    let sums = way.sums.iter().map(|sum| 2 * sum.len());
    3 * way.differences.len() + inequalities.sum::<usize>() + sums.sum::<usize>()
}

/// Returns the infinite ends of the box.
fn infinite_ends(envelope: &DecoupledEnvelope) -> Vec<Endless> {
    let intervals = envelope.intervals().iter().enumerate();
    let ends = intervals.flat_map(|(parameter, interval)| {
        let sides = Side::BOTH.into_iter();
        let infinite = sides.filter(|side| side.of(interval).value().is_none());
        infinite.map(move |side| Endless {
            parameter,
            end: match side {
                Side::Lower => End::Lower,
                Side::Upper => End::Upper,
            },
        })
    });
    ends.collect()
}

fn to_control(plan: &ParametrizedPlan, proof: ControlProof) -> Control {
    match proof {
        ControlProof::Times(times) => {
            let nominal = DecoupledEnvelope::point(&plan.nominal());
            let network = plan.uncertain_network(&nominal);
            let is_observed = |node: elbowroom_plan::NodeId| {
                let links = network.as_ref().map(|network| &network.links[..]);
                let mut links = links.unwrap_or_default().iter();
                links.any(|&link| plan.plan.constraints[link].to == node)
            };
            let nodes = plan.plan.nodes().map(|(node, _)| node);
            let times = nodes.map(|node| {
                let time = Exact(times[node].clone());
                (!is_observed(node)).then_some(time)
            });
            Control::Times(times.collect())
        }
        ControlProof::Schedules(cases) => {
            let cases = cases.into_iter().map(|case| match case {
                ScheduleCase::Split(parameter, cases) => Schedules::Split {
                    parameter: parameter.index(),
                    cases,
                },
                ScheduleCase::Rule(times) => {
                    Schedules::Rule(times.into_iter().map(affine).collect())
                }
            });
            Control::Schedules(cases.collect())
        }
        ControlProof::Strategy(strategy) => Control::Strategy(Strategy {
            edges: strategy
                .edges
                .into_iter()
                .map(|(from, to, most)| Edge {
                    from: from.index(),
                    to: to.index(),
                    most,
                })
                .collect(),
            waits: strategy
                .waits
                .into_iter()
                .map(|(point, duration, delay)| Wait {
                    point: point.index(),
                    duration,
                    delay: delay.map(Exact),
                })
                .collect(),
        }),
    }
}

fn affine(rule: TimeRule) -> Affine {
    let factors = rule.factors.into_iter();
    Affine {
        constant: rule.constant,
        parameters: factors
            .map(|(parameter, factor)| Factor {
                parameter: parameter.index(),
                factor,
            })
            .collect(),
    }
}

fn condition(subject: &Subject<'_>, proof: &ConditionProof) -> Condition {
    let mut cases = Vec::new();
    if let Some(why) = &proof.proof {
        append_case(why, &mut cases);
    }
    Condition {
        why: subject.explainer.requirement(&proof.requirement),
        during: proof
            .during
            .map(|own| own.map(elbowroom_plan::NodeId::index)),
        cases,
    }
}

/// Appends a case after those that it is split into, and returns the position of the first.
fn append_case(why: &ImpossibilityProof, cases: &mut Vec<FailureCase>) -> usize {
    let place = cases.len();
    match why {
        ImpossibilityProof::NoMoment(sum) => cases.push(FailureCase::Never(summands(sum))),
        ImpossibilityProof::Cases(ways) => {
            cases.push(FailureCase::Ways(ways.iter().map(to_way).collect()));
        }
        ImpossibilityProof::Split(event, after, before) => {
            let event = event.index();
            cases.push(FailureCase::Either {
                event,
                cases: [0; 2],
            });
            let parts = [append_case(after, cases), append_case(before, cases)];
            cases[place] = FailureCase::Either {
                event,
                cases: parts,
            };
        }
    }
    place
}

fn to_way(own: &RefutedCase) -> Violation {
    Violation {
        differences: own.differences.iter().map(difference).collect(),
        inequalities: own.inequalities.iter().map(inequality).collect(),
        corners: own.corners.iter().map(|id| id.index()).collect(),
        sums: own.sums.iter().map(summands).collect(),
    }
}

fn difference(own: &Difference) -> sound::Difference {
    sound::Difference {
        from: own.from.index(),
        to: own.to.index(),
        most: own.bound.clone(),
        strict: own.is_strict,
    }
}

fn inequality(own: &Inequality) -> sound::Inequality {
    let expression = &own.expression;
    let times = expression.times.iter().map(|(node, factor)| TimeTerm {
        point: node.index(),
        factor: factor.clone(),
    });
    let values = expression.parameters.iter().map(|(id, factor)| Factor {
        parameter: id.index(),
        factor: factor.clone(),
    });
    let products = expression
        .products
        .iter()
        .map(|((id, by), factor)| Product {
            parameter: id.index(),
            by: match by {
                Multiplicand::Time(node) => Multiplied::Time(node.index()),
                Multiplicand::Parameter(other) => Multiplied::Parameter(other.index()),
            },
            factor: factor.clone(),
        });
    sound::Inequality {
        constant: expression.constant.clone(),
        times: times.collect(),
        parameters: values.collect(),
        products: products.collect(),
        strict: own.is_strict,
    }
}

fn summands(sum: &Refutation) -> Vec<sound::Summand> {
    let all = sum.iter().map(|(of, factor)| sound::Summand {
        of: match *of {
            Summand::NonNegativeTime(node) => Ground::Beginning(node.index()),
            Summand::AtLeast(index) => Ground::Least(index),
            Summand::AtMost(index) => Ground::Most(index),
            Summand::Difference(place) => Ground::Difference(place),
            Summand::Inequality(place) => Ground::Inequality(place),
        },
        factor: factor.clone(),
    });
    all.collect()
}
