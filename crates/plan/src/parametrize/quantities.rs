//! Replacement of durations, constants, initial values and the times of timed initials by
//! parameters.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::Footprint;
use elbowroom_model::ground::FluentId;
use elbowroom_model::problem::{Comparison, FunctionId};
use elbowroom_num::{End, Interval, Rational};

use super::builder::{ParametrizationBuilder, Quantity};
use super::constants::{self, Place};
use super::{ConstantTarget, ParametrizeError, VarySpec, nothing_matches, select};
use crate::parameter::ParameterKind;
use crate::stn_plan::{Bound, Constraint, Instance, InstanceId, NodeId, Reason};
use crate::valuation::ParameterId;

impl ParametrizationBuilder<'_> {
    pub(super) fn open_durations(
        &mut self,
        spec: &VarySpec,
        instances: &[InstanceId],
    ) -> Result<(), ParametrizeError> {
        let known = self.known_durations();
        let mut set = Vec::new();
        for &id in instances {
            if self.controllable.contains(&id) {
                continue;
            }
            let plan = &self.plan.plan;
            let instance = plan.instance(id);
            if instance.action.durative().is_none() {
                let why = format!("`{}` is instantaneous", instance.action.name);
                return Err(nothing_matches(spec, why));
            }
            let (start, end) = (plan.start(id), plan.end(id));
            if let Some(&known) = known.get(&id) {
                self.parameter_of_quantity
                    .entry(Quantity::Duration(id))
                    .or_insert(known);
            }
            let is_new = !self
                .parameter_of_quantity
                .contains_key(&Quantity::Duration(id));
            let number = instance.label.strip_prefix('n').unwrap_or(&instance.label);
            let name = format!("dur_{number}");
            let nominal = &self.nominal[end] - &self.nominal[start];
            let kind = ParameterKind::Duration(id);
            let parameter = self.parameter(spec, Quantity::Duration(id), name, kind, nominal)?;
            if is_new {
                if spec.range.is_none() {
                    self.limit_to_domain(id, parameter);
                }
                set.push((id, start, end, parameter));
            }
        }
        self.set_durations(&set);
        Ok(())
    }

    /// Limits a duration for which the domain gives an interval to that interval. (If the domain
    /// gives one number, this is the planned duration, and the range of the real one is unlimited.)
    fn limit_to_domain(&mut self, id: InstanceId, parameter: ParameterId) {
        let mut constraints = self.plan.plan.constraints.iter();
        let Some(domain) = constraints.find(|it| it.reason == Reason::Duration(id)) else {
            return;
        };
        if domain.lower == domain.upper {
            return;
        }
        let end = |bound: &Bound| match bound {
            Bound::Finite(value) => End::Closed(value.clone()),
            Bound::Infinite | Bound::Parameter(_) => End::Infinite,
        };
        let parameter = &mut self.plan.parameters[parameter.index()];
        let allowed = parameter.range.intersection(&Interval {
            lower: end(&domain.lower),
            upper: end(&domain.upper),
        });
        // A rounded schedule may slightly miss the interval.
        if allowed.contains(&parameter.nominal) {
            parameter.range = allowed;
        }
    }

    /// Returns the existing parameters of durations.
    fn known_durations(&self) -> BTreeMap<InstanceId, ParameterId> {
        let mut known = BTreeMap::new();
        for (index, parameter) in self.plan.parameters.iter().enumerate() {
            if let ParameterKind::Duration(id) = parameter.kind {
                known.entry(id).or_insert(ParameterId::from(index));
            }
        }
        known
    }

    /// Replaces the constraints on the durations of these instances by parameters, from their
    /// starts to their ends.
    fn set_durations(&mut self, set: &[(InstanceId, NodeId, NodeId, ParameterId)]) {
        let plan = &mut self.plan.plan;
        let ids: BTreeSet<InstanceId> = set.iter().map(|(id, ..)| *id).collect();
        let ends: BTreeSet<_> = set
            .iter()
            .map(|(_, start, end, _)| (*start, *end))
            .collect();
        plan.constraints
            .retain(|constraint| match constraint.reason {
                Reason::Duration(id) => !ids.contains(&id),
                // The pinned duration is only needed for schedules of one duration. Each parameter
                // value has its own.
                Reason::Pinned => !ends.contains(&(constraint.from, constraint.to)),
                _ => true,
            });
        plan.free_durations(set.iter().map(|(id, ..)| *id));
        for &(id, from, to, parameter) in set {
            plan.constraints.push(Constraint {
                from,
                to,
                lower: Bound::Parameter(parameter),
                upper: Bound::Parameter(parameter),
                reason: Reason::Duration(id),
            });
        }
    }

    pub(super) fn open_constants(
        &mut self,
        spec: &VarySpec,
        target: &ConstantTarget,
        place: fn(FunctionId) -> Place,
    ) -> Result<(), ParametrizeError> {
        let instances = select::instances(self.task, &self.plan.plan, spec, &target.instances)?;
        let place = place(select::function(self.task, spec, &target.function)?);
        let mut shared: Option<Rational> = None;
        for id in instances {
            let instance = self.plan.plan.instance(id).clone();
            let found = constants::constants(self.task, &instance.action, place);
            let function = &target.function;
            let value = match (&target.value, &found[..]) {
                (Some(value), _) if found.contains(value) => value.clone(),
                (None, [value]) => value.clone(),
                (_, []) | (Some(_), _) => {
                    let mut why = format!(
                        "`{}` has no such number for `{function}`{}",
                        instance.action.name,
                        select::listed(", only ", &found)
                    );
                    let read = constants::fluents(self.task, &instance.action, place);
                    // A read of the function itself does not determine the amount of its change.
                    let mut others = read.into_iter();
                    if let Some(other) =
                        others.find(|fluent| self.is_other_function(*fluent, target))
                    {
                        let name = self.task.fluent_name(other);
                        why = format!("{why}; to vary the amount, write `initial {name}`");
                    }
                    return Err(nothing_matches(spec, why));
                }
                (None, several) => {
                    return Err(ParametrizeError::Ambiguous {
                        spec: spec.text.clone(),
                        choices: several.iter().map(ToString::to_string).collect(),
                        advice: "add the intended one after the function",
                    });
                }
            };
            let (name, kind) = if target.is_shared {
                let schema = &self.task.problem().schemas[instance.action.schema.index()];
                (format!("{}.{function}", schema.name), ParameterKind::Domain)
            } else {
                (
                    format!("{}.{function}", instance.label),
                    ParameterKind::Constant(id),
                )
            };
            if target.is_shared && shared.as_ref().is_some_and(|other| *other != value) {
                let why = "the number is not the same in all of them".to_owned();
                return Err(nothing_matches(spec, why));
            }
            let quantity = if target.is_shared {
                Quantity::Constant(spec.text.clone())
            } else {
                Quantity::Constant(format!("{} {}", instance.label, spec.text))
            };
            shared = Some(value.clone());
            let parameter = self.parameter(spec, quantity, name, kind, value.clone())?;
            let opened =
                constants::with_parameter(self.task, &instance.action, place, &value, parameter);
            self.plan.plan.instances[id.index()].action = Arc::new(opened);
        }
        Ok(())
    }

    /// Returns `true` if the fluent belongs to another function than the target's.
    fn is_other_function(&self, fluent: FluentId, target: &ConstantTarget) -> bool {
        let function = self.task.problem().function(&target.function);
        Some(self.task.function_of(fluent)) != function
    }

    /// Returns an action whose duration is the value of the fluent at time 0.
    fn action_with_duration(&self, fluent: FluentId) -> Option<&str> {
        let mut instances = self.plan.plan.instances.iter();
        let reads = |instance: &&Instance| {
            instance.action.durative().is_some_and(|body| {
                body.duration.iter().any(|constraint| {
                    let mut is_read = false;
                    let bound = &constraint.bound;
                    bound.visit_fluents(&mut |other| is_read |= other == fluent);
                    is_read && constraint.comparison == Comparison::Equal
                })
            })
        };
        instances.find(reads).map(|instance| &*instance.action.name)
    }

    pub(super) fn open_initial(
        &mut self,
        spec: &VarySpec,
        atom: &[String],
    ) -> Result<(), ParametrizeError> {
        let fluent = select::fluent(self.task, spec, atom)?;
        let Some(value) = self.task.initial().values.get(&fluent).cloned() else {
            let why = format!("{} has no initial value", self.task.fluent_name(fluent));
            return Err(nothing_matches(spec, why));
        };
        if let Some(action) = self.action_with_duration(fluent) {
            let why = format!(
                "the duration of {action} is {}, and the plan fixes it; vary `duration {action}`",
                self.task.fluent_name(fluent)
            );
            return Err(nothing_matches(spec, why));
        }
        let name = format!("initial_{}", joined(atom));
        let kind = ParameterKind::Initial(fluent);
        let id = self.parameter(spec, Quantity::Initial(fluent), name, kind, value)?;
        self.plan.initial.insert(fluent, id);
        Ok(())
    }

    pub(super) fn open_timed(
        &mut self,
        spec: &VarySpec,
        atom: &[String],
        only_deletions: bool,
    ) -> Result<(), ParametrizeError> {
        let groups = select::timed(self.task, spec, atom, only_deletions)?;
        let word = if only_deletions { "deadline" } else { "timed" };
        for group in groups {
            let is_new = !self
                .parameter_of_quantity
                .contains_key(&Quantity::Timed(group));
            let name = format!("{word}_{}", joined(atom));
            let time = self.task.timed()[group].time.clone();
            let kind = ParameterKind::Timed(group);
            let id = self.parameter(spec, Quantity::Timed(group), name, kind, time)?;
            if is_new {
                self.set_timed(group, id);
            }
        }
        Ok(())
    }

    /// Replaces the time of a group of timed initials by the parameter. The group keeps its
    /// position among the groups that change the same facts or fluents.
    fn set_timed(&mut self, group: usize, id: ParameterId) {
        let timed = self.task.timed();
        let plan = &mut self.plan.plan;
        for constraint in &mut plan.constraints {
            if constraint.reason == Reason::Timed(group) {
                constraint.lower = Bound::Parameter(id);
                constraint.upper = Bound::Parameter(id);
            }
        }
        let footprint = Footprint::of_timed(&timed[group]);
        for other in (0..timed.len()).filter(|&other| other != group) {
            if !footprint.interferes_with(&Footprint::of_timed(&timed[other])) {
                continue;
            }
            let (first, second) = (group.min(other), group.max(other));
            // Any positive distance prevents that the groups are simultaneous.
            let gap = &timed[second].time - &timed[first].time;
            let constraint = Constraint {
                from: plan.timed(first),
                to: plan.timed(second),
                lower: Bound::Finite(gap.min(self.task.epsilon().clone())),
                upper: Bound::Infinite,
                reason: Reason::Interference,
            };
            if !plan.constraints.contains(&constraint) {
                plan.constraints.push(constraint);
            }
        }
    }
}

/// Returns a name such as `charge_auv`.
fn joined(atom: &[String]) -> String {
    atom.join("_").to_lowercase()
}
