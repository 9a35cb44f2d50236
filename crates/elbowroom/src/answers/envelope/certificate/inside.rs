//! Proof that the box of a certificate is inside the envelope.

use elbowroom_envelope::linear::Factor as Multiplicand;
use elbowroom_envelope::obligations::{Difference, Inequality};
use elbowroom_envelope::{
    ConditionProof, ControlProof, Impossible, Oracle, Refutation, ScheduleCase, Summand, TimeRule,
    Unfailing,
};
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, Side};
use elbowroom_verify::sound;
use elbowroom_verify::sound::{
    Affine, Condition, Control, Edge, Endless, Factor, Failing, Ground, Multiplied, Product,
    Schedules, Sound, Strategy, Timed, Wait, Way,
};
use elbowroom_verify::{End, Exact};

use super::super::Subject;

/// Largest number of time points for which a certificate proves that the box is inside.
const MOST_POINTS: usize = 500;

/// Largest number of numbers in such a proof.
const MOST_NUMBERS: usize = 50_000;

/// Returns the proof that the box is inside the envelope, or `None` if it would be too large.
pub(super) fn sound(
    subject: &Subject<'_>,
    oracle: &mut Oracle,
    envelope: &DecoupledEnvelope,
) -> Option<Sound> {
    let plan = subject.plan;
    if plan.plan.nodes.len() > MOST_POINTS {
        return None;
    }
    let control = oracle.control_proof(envelope);
    let sound = Sound {
        endless: endless(envelope),
        control: control.map_or(Control::Assumed, |proof| control_of(plan, proof)),
        conditions: oracle.condition_proofs(envelope).map(|proofs| {
            // A condition that cannot fail in any way needs no proof.
            let never_fails =
                |why: &Unfailing| matches!(why, Unfailing::Ways(ways) if ways.is_empty());
            let proofs = proofs.iter();
            let proofs = proofs.filter(|own| !own.why.as_ref().is_some_and(never_fails));
            proofs.map(|proof| condition(subject, proof)).collect()
        }),
    };
    (numbers(&sound) <= MOST_NUMBERS).then_some(sound)
}

/// Estimates how many numbers a proof contains.
fn numbers(sound: &Sound) -> usize {
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
        Failing::Either { .. } => 3,
        Failing::Never(sum) => 2 * sum.len(),
        Failing::Ways(ways) => ways.iter().map(numbers_of_way).sum(),
    });
    control + conditions.sum::<usize>()
}

fn numbers_of_way(way: &Way) -> usize {
    let inequalities = way
        .inequalities
        .iter()
        .map(|own| 1 + 2 * (own.times.len() + own.parameters.len()) + 3 * own.products.len());
    let sums = way.sums.iter().map(|sum| 2 * sum.len());
    3 * way.differences.len() + inequalities.sum::<usize>() + sums.sum::<usize>()
}

/// Returns the infinite ends of the box.
fn endless(envelope: &DecoupledEnvelope) -> Vec<Endless> {
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

fn control_of(plan: &ParametrizedPlan, proof: ControlProof) -> Control {
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
    if let Some(why) = &proof.why {
        unfailing(why, &mut cases);
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
fn unfailing(why: &Unfailing, cases: &mut Vec<Failing>) -> usize {
    let place = cases.len();
    match why {
        Unfailing::Never(sum) => cases.push(Failing::Never(summands(sum))),
        Unfailing::Ways(ways) => cases.push(Failing::Ways(ways.iter().map(way).collect())),
        Unfailing::Either(event, after, before) => {
            let event = event.index();
            cases.push(Failing::Either {
                event,
                cases: [0; 2],
            });
            let parts = [unfailing(after, cases), unfailing(before, cases)];
            cases[place] = Failing::Either {
                event,
                cases: parts,
            };
        }
    }
    place
}

fn way(own: &Impossible) -> Way {
    Way {
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
    let times = expression.times.iter().map(|(node, factor)| Timed {
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
            Summand::Beginning(node) => Ground::Beginning(node.index()),
            Summand::AtLeast(index) => Ground::Least(index),
            Summand::AtMost(index) => Ground::Most(index),
            Summand::Difference(place) => Ground::Difference(place),
            Summand::Inequality(place) => Ground::Inequality(place),
        },
        factor: factor.clone(),
    });
    all.collect()
}
