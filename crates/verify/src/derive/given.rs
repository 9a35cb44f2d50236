//! Check that a certificate's network is that of a plan file with constraints: [`Given`].
//!
//! The constraints of the file are the claim's subject: a box is inside the envelope if all schedules of *them* are
//! valid. So the certificate has exactly these constraints, and those that set the times of timed initials.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Expression};
use elbowroom_model::problem::Unknown;
use elbowroom_model::{Step, Task, TimeTriggeredPlan};

use super::distances::Distances;
use super::{NotDerived, Quantity};
use crate::Exact;
use crate::certificate::{Certificate, Constraint, Guarantee, Limit};
use crate::given::GivenPlan;
use crate::intervals::Intervals;

/// A plan file with constraints, and its earliest schedule at nominal values.
pub(super) struct Given<'a> {
    plan: &'a GivenPlan,
    /// The constraints that the certificate has to have, without observations.
    constraints: Vec<Constraint>,
    /// By instance: its points.
    ends: Vec<[usize; 2]>,
    /// By parameter: its kind and its first instance.
    kinds: Vec<(&'static str, Option<usize>)>,
    /// The actions with parameters in place of open numbers, at their times in the schedule.
    pub(super) steps: TimeTriggeredPlan,
    /// The same with nominal values.
    pub(super) nominal: TimeTriggeredPlan,
}

impl<'a> Given<'a> {
    /// Computes the earliest schedule of the file's constraints at nominal values.
    ///
    /// # Errors
    /// When an action does not exist, there is no schedule, or the goal has an open number.
    pub(super) fn new(task: &Task, plan: &'a GivenPlan) -> Result<Self, NotDerived> {
        let mut actions = Vec::new();
        for own in &plan.instances {
            let action = task.instantiate(own.schema, &own.arguments);
            actions.push(action.map_err(|error| NotDerived::unknown(error.to_string()))?);
        }
        let mut ends = Vec::new();
        let mut points = 1;
        for action in &actions {
            let last = points + usize::from(action.durative().is_some());
            ends.push([points, last]);
            points = last + 1;
        }
        let timed = task.timed().iter().enumerate().map(|(index, timed)| {
            let time = Limit::Number(Exact(timed.time.clone()));
            constraint(0, points + index, time.clone(), time)
        });
        let mut constraints: Vec<Constraint> = timed.collect();
        points += task.timed().len();
        let own = plan.constraints.iter();
        constraints.extend(
            own.map(|own| constraint(own.from, own.to, own.lower.clone(), own.upper.clone())),
        );
        let kinds = kinds(plan, &constraints, &ends);
        let values = plan.parameters.iter().map(|own| own.nominal.clone());
        let values = Intervals::exactly(values);
        let mut distances = Distances::between(points, &constraints, &values)?;
        let mut given = Self {
            plan,
            constraints,
            ends,
            kinds,
            steps: TimeTriggeredPlan::default(),
            nominal: TimeTriggeredPlan::default(),
        };
        let mut time = |point: usize| {
            let earliest = distances.least(0, point)?;
            Ok::<_, NotDerived>(earliest.unwrap_or_default())
        };
        for (index, action) in actions.iter().enumerate() {
            let [start, end] = given.ends[index];
            let start = time(start)?;
            let duration = match action.durative() {
                Some(_) => Some(time(end)? - &start),
                None => None,
            };
            let open = given.with_parameters(task, index, action);
            let nominal = given.at_nominal(index, &open);
            let step = |action: Action| Step {
                start: start.clone(),
                action: Arc::new(action),
                duration: duration.clone(),
            };
            given.steps.steps.push(step(open));
            given.nominal.steps.push(step(nominal));
        }
        let mut is_open = false;
        task.goal().visit_expressions(&mut |expression| {
            expression.visit_leaves(&mut |leaf| is_open |= matches!(leaf, Expression::Unknown(_)));
        });
        if is_open {
            let what = "the goal, which has an open number";
            return Err(NotDerived::unknown(what));
        }
        Ok(given)
    }

    /// Returns the kind of a parameter.
    pub(super) fn kind(&self, parameter: usize) -> Option<&'static str> {
        self.kinds.get(parameter).map(|(kind, _)| *kind)
    }

    /// Returns the labels of the instances.
    pub(super) fn labels(&self) -> Vec<String> {
        let instances = self.plan.instances.iter();
        instances.map(|own| own.label.clone()).collect()
    }

    /// Returns the action with parameters in place of the numbers that the domain leaves open.
    fn with_parameters(&self, task: &Task, instance: usize, action: &Action) -> Action {
        let names = |unknown: &Unknown| match unknown {
            Unknown::Domain(index) => task.problem().unknowns.get(*index as usize).cloned(),
            Unknown::Action(index) => {
                let schema = &task.problem().schemas[action.schema.index()];
                let name = schema.unknowns.get(*index as usize)?;
                Some(format!("{}.{name}", self.plan.instances[instance].label))
            }
            Unknown::Parameter(_) => None,
        };
        action.map_leaves(&mut |leaf| {
            let Expression::Unknown(unknown) = leaf else {
                return None;
            };
            let name = names(unknown)?;
            let mut parameters = self.plan.parameters.iter();
            let place = parameters.position(|own| own.name.eq_ignore_ascii_case(&name))?;
            let place = u32::try_from(place).ok()?;
            Some(Expression::Unknown(Unknown::Parameter(place)))
        })
    }

    /// Returns the action with nominal values in place of parameters. If its duration is a parameter, the domain
    /// does not limit it.
    fn at_nominal(&self, instance: usize, action: &Action) -> Action {
        let mut action = action.map_leaves(&mut |leaf| match leaf {
            Expression::Unknown(Unknown::Parameter(place)) => {
                let parameter = self.plan.parameters.get(*place as usize)?;
                Some(Expression::Constant(parameter.nominal.clone()))
            }
            _ => None,
        });
        if self.is_open(instance)
            && let Body::Durative(body) = &mut action.body
        {
            body.duration.clear();
        }
        action
    }

    /// Returns `true` if the duration of an instance is a parameter.
    pub(super) fn is_open(&self, instance: usize) -> bool {
        let [start, end] = self.ends[instance];
        let mut constraints = self.constraints.iter();
        constraints.any(|own| own.from == start && own.to == end && set_to(own).is_some())
    }

    /// Returns `true` if the duration of an instance is a parameter or a number.
    pub(super) fn has_known_duration(&self, instance: usize) -> bool {
        let [start, end] = self.ends[instance];
        let is_told = |own: &Constraint| own.lower == own.upper && own.lower != Limit::None;
        let mut constraints = self.constraints.iter();
        start == end || constraints.any(|own| own.from == start && own.to == end && is_told(own))
    }

    /// Returns the quantities of the parameters, each once.
    ///
    /// # Errors
    /// The first difference of the certificate's network or parameters from those of the file.
    pub(super) fn check(&self, certificate: &Certificate) -> Result<Vec<Quantity>, NotDerived> {
        let known = self.plan.parameters.len();
        if let Some(more) = certificate.parameters.get(known) {
            let what = format!(
                "{}, which is not a parameter of the plan file: `--vary` with a plan file that has \
                 constraints",
                more.name
            );
            return Err(NotDerived::Unknown(what));
        }
        if certificate.parameters.len() < known {
            let what = format!(
                "the plan file has the parameter {}",
                self.plan.parameters[certificate.parameters.len()].name
            );
            return Err(NotDerived::differs(what));
        }
        for (own, given) in certificate.parameters.iter().zip(&self.plan.parameters) {
            let is_same = own.name == given.name
                && own.nominal == given.nominal
                && own.weight == given.weight;
            if !is_same {
                let what = format!(
                    "the plan file has the parameter {} with the nominal value {} and the weight {}",
                    given.name, given.nominal, given.weight
                );
                return Err(NotDerived::differs(what));
            }
        }
        let name = |point: usize| certificate.points.get(point).cloned().unwrap_or_default();
        let is_weak = certificate.guarantee == Guarantee::Weak;
        let mut observed = BTreeSet::new();
        for (index, own) in self.constraints.iter().enumerate() {
            let is_of_action = self.ends.contains(&[own.from, own.to]);
            let is_observed =
                !is_weak && is_of_action && set_to(own).is_some() && observed.insert(own.to);
            let wanted = Constraint {
                observed: is_observed,
                ..own.clone()
            };
            if certificate.constraints.get(index) != Some(&wanted) {
                let (from, to) = (name(own.from), name(own.to));
                let what = format!("constraint {index} of the plan file, from `{from}` to `{to}`");
                return Err(NotDerived::differs(what));
            }
        }
        if let Some(more) = certificate.constraints.get(self.constraints.len()) {
            let what = format!(
                "the plan file has no constraint from `{}` to `{}`",
                name(more.from),
                name(more.to)
            );
            return Err(NotDerived::differs(what));
        }
        let quantities = self
            .kinds
            .iter()
            .enumerate()
            .map(|(parameter, (kind, step))| {
                let action = step.map(|step| self.steps.steps[step].action.name.clone());
                Quantity {
                    parameter,
                    kind,
                    step: *step,
                    group: None,
                    action,
                }
            });
        Ok(quantities.collect())
    }

    /// Checks that no parameter has a narrower range than in the file.
    ///
    /// # Errors
    /// The first one that has.
    pub(super) fn ranges(&self, certificate: &Certificate) -> Result<(), NotDerived> {
        for (own, given) in certificate.parameters.iter().zip(&self.plan.parameters) {
            let [least, most] = &given.range;
            let least = least.as_ref().map(|least| &own.nominal - least);
            let most = most.as_ref().map(|most| most - &own.nominal);
            super::is_not_narrower(certificate, own, [least, most])?;
        }
        Ok(())
    }
}

fn constraint(from: usize, to: usize, lower: Limit, upper: Limit) -> Constraint {
    Constraint {
        from,
        to,
        lower,
        upper,
        observed: false,
    }
}

/// Returns the parameter that a constraint sets its difference to.
fn set_to(constraint: &Constraint) -> Option<usize> {
    match (&constraint.lower, &constraint.upper) {
        (Limit::Parameter(lower), Limit::Parameter(upper)) if lower == upper => Some(*lower),
        _ => None,
    }
}

/// Returns the kind of each parameter, and the first instance that it belongs to.
fn kinds(
    plan: &GivenPlan,
    constraints: &[Constraint],
    ends: &[[usize; 2]],
) -> Vec<(&'static str, Option<usize>)> {
    let labels: BTreeMap<&str, usize> = plan
        .instances
        .iter()
        .enumerate()
        .map(|(index, own)| (own.label.as_str(), index))
        .collect();
    let kind = |(index, own): (usize, &crate::given::GivenParameter)| {
        let is_of = |step: usize| {
            let [start, end] = ends[step];
            let mut all = constraints.iter();
            let is_it = |own: &Constraint| own.from == start && own.to == end;
            start != end && all.any(|own| is_it(own) && set_to(own) == Some(index))
        };
        let mut in_order = constraints.iter().filter(|own| set_to(own) == Some(index));
        let first =
            in_order.find_map(|own| ends.iter().position(|ends| *ends == [own.from, own.to]));
        if let Some(step) = first.filter(|step| is_of(*step)) {
            return ("duration", Some(step));
        }
        match own.name.split_once(".?") {
            Some((label, _)) if labels.contains_key(label) => {
                ("constant", labels.get(label).copied())
            }
            _ if own.name.starts_with('?') => ("domain", None),
            _ => (super::BOUND, None),
        }
    };
    plan.parameters.iter().enumerate().map(kind).collect()
}
