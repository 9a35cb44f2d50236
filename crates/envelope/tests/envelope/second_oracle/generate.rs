//! Random cases around a valid schedule.

mod conditions;
mod gaps;
mod opening;
mod skeleton;

use elbowroom_model::problem::Body;
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, Schedule, Valuation};

use crate::second_oracle::case::Case;
use crate::second_oracle::random::Random;
use crate::second_oracle::system::System;
use skeleton::skeleton;

/// Feature that is more frequent in a case.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Theme {
    /// No emphasis.
    Mixed,
    /// Timed initials, open ones, and disjunctions that depend on them.
    Timed,
    /// Continuous effects, and numbers left open in them.
    Rates,
    /// Conditional effects.
    Guards,
    /// Parameters that occur in several places.
    Shared,
}

impl Theme {
    const ALL: [Self; 7] = [
        Self::Mixed,
        Self::Mixed,
        Self::Mixed,
        Self::Timed,
        Self::Rates,
        Self::Guards,
        Self::Shared,
    ];
}

/// Generates the case with that number.
pub(crate) fn generate(seed: u64) -> Case {
    let mut dice = Random::new(seed);
    loop {
        if let Some(case) = attempt(&mut dice) {
            return case;
        }
    }
}

/// Generates a case; `None` if the happenings are in conflict.
fn attempt(dice: &mut Random) -> Option<Case> {
    let theme = *dice.pick(&Theme::ALL);
    let case = Case {
        problem: skeleton(dice, theme),
        gaps: Vec::new(),
        parameters: Vec::new(),
        initial: std::collections::BTreeMap::new(),
        timed: std::collections::BTreeMap::new(),
        epsilon: dice
            .pick(&[
                Rational::new(1, 1000),
                Rational::new(1, 2),
                Rational::new(1, 4),
            ])
            .clone(),
    };
    let schedule = (0..8).find_map(|_| {
        let schedule = times(dice, &case);
        case.validate(&Valuation::default(), &schedule)
            .is_valid()
            .then_some(schedule)
    })?;
    let mut nominal = Nominal {
        case,
        schedule,
        theme,
        dice,
    };
    nominal.add_conditions();
    nominal.add_durations();
    nominal.add_gaps();
    nominal.open_numbers();
    if nominal.dice.chance(75) {
        nominal.tighten();
    }
    if nominal.dice.chance(15) {
        nominal.add_far_limit();
    }
    Some(nominal.case)
}

/// Generates times for all nodes, on a grid of halves.
fn times(dice: &mut Random, case: &Case) -> Schedule {
    let mut schedule = vec![Rational::ZERO];
    for schema in &case.problem.schemas {
        let start = dice.half(0, 9);
        match &schema.body {
            Body::Instantaneous { .. } => schedule.push(start),
            Body::Durative { .. } => {
                let duration = if dice.chance(4) {
                    Rational::ZERO
                } else {
                    dice.half(1, 6)
                };
                let end = &start + &duration;
                schedule.extend([start, end]);
            }
        }
    }
    schedule.extend(case.timed_times());
    Schedule::new(schedule)
}

struct Nominal<'d> {
    case: Case,
    schedule: Schedule,
    theme: Theme,
    dice: &'d mut Random,
}

impl Nominal<'_> {
    fn works(&self, case: &Case) -> bool {
        let valuation = case.parameters.iter().map(|p| p.nominal.clone()).collect();
        case.validate(&valuation, &self.schedule).is_valid()
    }

    /// Returns durative actions with their nominal durations.
    fn durations(&self) -> Vec<(usize, Rational)> {
        let mut durations = Vec::new();
        for (index, schema) in self.case.problem.schemas.iter().enumerate() {
            if matches!(schema.body, Body::Durative { .. }) {
                let id = InstanceId::from(index);
                let gap = &self.time(Node::End(id)) - &self.time(Node::Start(id));
                durations.push((index, gap));
            }
        }
        durations
    }

    fn nodes(&self) -> Vec<Node> {
        self.case.build().1.plan.nodes
    }

    fn time(&self, node: Node) -> Rational {
        let position = self.nodes().iter().position(|&other| other == node);
        self.schedule[position.expect("a node of the plan").into()].clone()
    }
}

/// Samples a schedule for some values: extreme in a random direction, or halfway between two such
/// ones.
pub(crate) fn sample(system: &mut System, dice: &mut Random) -> Option<(Valuation, Schedule)> {
    let mut weights = || (0..20).map(|_| dice.between(-1, 1)).collect::<Vec<_>>();
    let (first, second) = (weights(), weights());
    let (values, times) = system.extreme(&first, HORIZON)?;
    if dice.chance(50) {
        return Some((values, times));
    }
    let (other_values, other_times) = system.extreme(&second, HORIZON)?;
    let middle = |(a, b): (Rational, Rational)| (a + b) * Rational::new(1, 2);
    let values = values.into_iter().zip(other_values).map(middle);
    let times = times.into_iter().zip(other_times).map(middle);
    Some((values.collect(), times.collect()))
}

/// Upper bound on the length of sampled schedules.
const HORIZON: i64 = 60;
