//! Explanations for failed controllability checks, with the names of the file.

use elbowroom_network::weak::StepGround;
use elbowroom_network::{NetworkFile, WeakControllability, weak as find_weak};
use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{Conflict, Ground, LinkId};
use elbowroom_stn::{ConstraintId, NodeId};

use super::answer::{ControllabilityCheck, LinkDuration, Number, Reason, Step, Time, Verdict};

/// Checks whether there is a schedule for some durations of the links.
pub(super) fn consistent(file: &NetworkFile) -> ControllabilityCheck {
    let network = file.kind_network();
    let Err(cycle) = network.consistency() else {
        return ControllabilityCheck::yes();
    };
    let mut grounds = Vec::new();
    let mut steps = Vec::new();
    for &id in &cycle.constraints {
        let ground = kind_ground(file, id);
        let constraint = network.constraint(id);
        let words = file.bound_in_words(constraint.from, constraint.to, &constraint.bound);
        let given = match ground {
            Ground::Requirement(_) => "requirement",
            Ground::Early(_) | Ground::Late(_) => "duration",
        };
        steps.push(step(given, words));
        grounds.push(ground);
    }
    // All bounds of links are used as they are; no duration is at an end of its interval.
    ControllabilityCheck::no(Reason {
        by: Number::from(&-cycle.total),
        steps,
        is_whole: true,
        durations: Vec::new(),
    })
}

/// Returns the origin of a constraint of [`NetworkFile::kind_network`]. `Late` is a link's upper
/// bound.
fn kind_ground(file: &NetworkFile, id: ConstraintId) -> Ground {
    let mut rest = id.index();
    let requirements = file.network.requirements().constraints().len();
    if rest < requirements {
        return Ground::Requirement(id);
    }
    rest -= requirements;
    for link in file.network.link_ids() {
        let has_upper = usize::from(file.network.link(link).upper.is_some());
        if rest <= has_upper {
            return if rest < has_upper {
                Ground::Late(link)
            } else {
                Ground::Early(link)
            };
        }
        rest -= has_upper + 1;
    }
    Ground::Requirement(id)
}

/// Checks weak controllability.
pub(super) fn weak(file: &NetworkFile, most_branches: usize) -> ControllabilityCheck {
    match find_weak(&file.network, most_branches) {
        WeakControllability::Controllable => ControllabilityCheck::yes(),
        WeakControllability::Undecided { branches } => ControllabilityCheck {
            verdict: Verdict::Undecided,
            branches: Some(branches),
            ..ControllabilityCheck::yes()
        },
        WeakControllability::Uncontrollable(conflict) => {
            let durations = conflict.durations.iter();
            let steps = conflict.steps.iter().map(|given| match given.ground {
                StepGround::Requirement(id) => step("requirement", file.requirement_in_words(id)),
                StepGround::Link(id) => {
                    let duration = &conflict.durations[&id];
                    step("duration", file.duration_in_words(id, duration))
                }
            });
            ControllabilityCheck::no(Reason {
                by: Number::from(&-&conflict.total),
                steps: steps.collect(),
                is_whole: true,
                durations: durations
                    .map(|(&id, value)| duration(file, id, value))
                    .collect(),
            })
        }
    }
}

/// Returns the answer for a network that is not dynamically controllable, with the conflict.
pub(super) fn dynamic(file: &NetworkFile, conflict: &Conflict<Rational>) -> ControllabilityCheck {
    let grounds: Vec<Ground> = conflict.steps.iter().map(|step| step.ground).collect();
    let total = conflict.total.clone().into_finite();
    ControllabilityCheck::no(Reason {
        by: total.map_or_else(Number::infinite, |total| Number::from(&-total)),
        steps: steps(file, &grounds),
        is_whole: conflict.is_whole,
        durations: ends(file, &grounds),
    })
}

/// Checks strong controllability.
pub(super) fn strong(file: &NetworkFile) -> ControllabilityCheck {
    match file.network.strong() {
        Ok(schedule) => {
            let network = &file.network;
            let chosen: Vec<NodeId> = network
                .requirements()
                .nodes()
                .filter(|&node| !network.is_contingent(node))
                .collect();
            let zero = match file.reference.filter(|&node| !network.is_contingent(node)) {
                Some(reference) => Some(schedule[reference].clone()),
                None => chosen.iter().map(|&node| schedule[node].clone()).min(),
            };
            let zero = zero.unwrap_or_default();
            let times = chosen.into_iter().map(|node| Time {
                point: file.point(node).to_owned(),
                time: Number::from(&(&schedule[node] - &zero)),
            });
            ControllabilityCheck {
                schedule: times.collect(),
                ..ControllabilityCheck::yes()
            }
        }
        Err(conflict) => ControllabilityCheck::no(Reason {
            by: match &conflict.total {
                Some(total) => Number::from(&-total),
                None => Number::infinite(),
            },
            steps: steps(file, &conflict.grounds),
            is_whole: true,
            durations: ends(file, &conflict.grounds),
        }),
    }
}

fn steps(file: &NetworkFile, grounds: &[Ground]) -> Vec<Step> {
    let steps = grounds.iter().map(|ground| match *ground {
        Ground::Requirement(id) => step("requirement", file.requirement_in_words(id)),
        Ground::Early(id) => step("early", file.early_in_words(id)),
        Ground::Late(id) => step("late", file.late_in_words(id)),
    });
    steps.collect()
}

fn step(given: &str, words: String) -> Step {
    Step {
        given: given.to_owned(),
        words,
    }
}

/// Returns the links of a conflict, each with the end of its interval.
fn ends(file: &NetworkFile, grounds: &[Ground]) -> Vec<LinkDuration> {
    let mut known: Vec<Ground> = Vec::new();
    let mut durations = Vec::new();
    for &ground in grounds {
        if known.contains(&ground) {
            continue;
        }
        known.push(ground);
        let (id, at, value) = match ground {
            Ground::Requirement(_) => continue,
            Ground::Early(id) => (id, "lower", Some(&file.network.link(id).lower)),
            Ground::Late(id) => (id, "upper", file.network.link(id).upper.as_ref()),
        };
        let link = file.network.link(id);
        durations.push(LinkDuration {
            activation: file.point(link.activation).to_owned(),
            end: file.point(link.end).to_owned(),
            at: at.to_owned(),
            value: value.map_or_else(Number::infinite, Number::from),
        });
    }
    durations
}

fn duration(file: &NetworkFile, id: LinkId, value: &Rational) -> LinkDuration {
    let link = file.network.link(id);
    let at = match value {
        _ if *value == link.lower => "lower",
        _ if Some(value) == link.upper.as_ref() => "upper",
        _ => "within",
    };
    LinkDuration {
        activation: file.point(link.activation).to_owned(),
        end: file.point(link.end).to_owned(),
        at: at.to_owned(),
        value: Number::from(value),
    }
}
