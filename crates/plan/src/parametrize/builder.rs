//! A plan whose quantities are being replaced by parameters, one specification after another.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Task;
use elbowroom_model::ground::FluentId;
use elbowroom_num::{End, Interval, Rational};

use super::constants::Place;
use super::{ParametrizeError, Target, VarySpec, select};
use crate::network::Schedule;
use crate::parameter::{Parameter, ParameterKind, ParametrizedPlan};
use crate::stn_plan::{Bound, InstanceId, NodeId, Reason};
use crate::unknowns::{self, OpenNumber};
use crate::valuation::ParameterId;

/// A quantity that at most one parameter represents.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Quantity {
    Duration(InstanceId),
    Timed(usize),
    Initial(FluentId),
    Open(OpenNumber),
    /// Parameters of one constant each, identified by their names.
    Constant(String),
}

/// A plan whose quantities are being replaced by parameters.
pub(super) struct ParametrizationBuilder<'a> {
    pub(super) task: &'a Task,
    pub(super) nominal: &'a Schedule,
    pub(super) plan: ParametrizedPlan,
    pub(super) parameter_of_quantity: BTreeMap<Quantity, ParameterId>,
    open_numbers: BTreeMap<OpenNumber, ParameterId>,
    /// Names of all parameters.
    names: BTreeSet<String>,
    /// Instances whose durations the executor chooses.
    pub(super) controllable: BTreeSet<InstanceId>,
}

impl<'a> ParametrizationBuilder<'a> {
    /// Creates the state for a plan with its present parameters.
    pub(super) fn new(
        task: &'a Task,
        plan: ParametrizedPlan,
        nominal: &'a Schedule,
    ) -> Result<Self, ParametrizeError> {
        if unknowns::do_rules_mention_unknowns(task) {
            return Err(ParametrizeError::OpenRule);
        }
        let names = plan.parameters.iter();
        let names = names.map(|parameter| parameter.name.clone()).collect();
        Ok(Self {
            task,
            nominal,
            plan,
            names,
            parameter_of_quantity: BTreeMap::new(),
            open_numbers: BTreeMap::new(),
            controllable: BTreeSet::new(),
        })
    }

    /// Applies all specifications.
    pub(super) fn apply_all(&mut self, specs: &[VarySpec]) -> Result<(), ParametrizeError> {
        // Durations that the executor chooses are not opened, whatever the order of the list.
        let (controllable, open): (Vec<_>, Vec<_>) = specs
            .iter()
            .partition(|spec| matches!(spec.target, Target::Controllable(_)));
        for spec in controllable.into_iter().chain(open) {
            self.apply(spec)?;
        }
        Ok(())
    }

    fn apply(&mut self, spec: &VarySpec) -> Result<(), ParametrizeError> {
        match &spec.target {
            Target::Durations => {
                let plan = &self.plan.plan;
                let durative = |id: &InstanceId| plan.instance(*id).action.durative().is_some();
                let all = (0..plan.instances.len()).map(InstanceId::from);
                let all: Vec<_> = all.filter(durative).collect();
                self.open_durations(spec, &all)
            }
            Target::Duration(selection) => {
                let instances = select::instances(self.task, &self.plan.plan, spec, selection)?;
                self.open_durations(spec, &instances)
            }
            Target::Controllable(selection) => {
                let instances = select::instances(self.task, &self.plan.plan, spec, selection)?;
                self.controllable.extend(instances);
                Ok(())
            }
            Target::Constant(target) => self.open_constants(spec, target, Place::Effects),
            Target::Condition(target) => self.open_constants(spec, target, Place::Conditions),
            Target::Initial(atom) => self.open_initial(spec, atom),
            Target::Timed {
                atom,
                only_deletions,
            } => self.open_timed(spec, atom, *only_deletions),
            Target::Unknown { name, nominal } => self.open_unknown(spec, name, nominal),
        }
    }

    /// Returns the parameter of the quantity: the existing one, or a new one.
    pub(super) fn parameter(
        &mut self,
        spec: &VarySpec,
        quantity: Quantity,
        name: String,
        kind: ParameterKind,
        nominal: Rational,
    ) -> Result<ParameterId, ParametrizeError> {
        let id = if let Some(&id) = self.parameter_of_quantity.get(&quantity) {
            id
        } else {
            let id = ParameterId::from(self.plan.parameters.len());
            let range = kind.natural_range(&nominal);
            let name = self.unique_name(name);
            self.names.insert(name.clone());
            self.plan.parameters.push(Parameter {
                name,
                kind,
                nominal,
                weight: Rational::ONE,
                range,
            });
            self.parameter_of_quantity.insert(quantity, id);
            id
        };
        let parameter = &mut self.plan.parameters[id.index()];
        if let Some(weight) = &spec.weight {
            parameter.weight = weight.clone();
        }
        if let Some((lower, upper)) = &spec.range {
            let end = |limit: &Option<Rational>| limit.clone().map_or(End::Infinite, End::Closed);
            parameter.range = Interval {
                lower: end(lower),
                upper: end(upper),
            };
        }
        if parameter.range.contains(&parameter.nominal) {
            return Ok(id);
        }
        Err(ParametrizeError::OutOfRange {
            name: parameter.name.clone(),
            nominal: parameter.nominal.to_string(),
            range: parameter.range.to_string(),
        })
    }

    /// Returns the name, or the name with a number that makes it unique.
    fn unique_name(&self, name: String) -> String {
        if !self.names.contains(&name) {
            return name;
        }
        let numbered = (2..).map(|number: u64| format!("{name}_{number}"));
        let mut free = numbered.filter(|name| !self.names.contains(name));
        free.next().expect("some number is free")
    }

    fn open_unknown(
        &mut self,
        spec: &VarySpec,
        name: &str,
        nominal: &Rational,
    ) -> Result<(), ParametrizeError> {
        let all = unknowns::possible(self.task, &self.plan.plan);
        let full_name = |number: OpenNumber| number.name(self.task, &self.plan.plan);
        let is_meant = |number: &OpenNumber| {
            let full = full_name(*number);
            let is_short = number.instance.is_some()
                && full
                    .rsplit_once('.')
                    .is_some_and(|(_, short)| short.eq_ignore_ascii_case(name));
            is_short || full.eq_ignore_ascii_case(name)
        };
        let meant: Vec<_> = all.iter().copied().filter(is_meant).collect();
        if meant.is_empty() {
            let names: Vec<_> = all.into_iter().map(full_name).collect();
            return Err(select::unknown(spec, "open number", name, names));
        }
        for number in meant {
            let name = number.name(self.task, &self.plan.plan);
            let quantity = Quantity::Open(number);
            if let Some(&id) = self.parameter_of_quantity.get(&quantity) {
                self.plan.parameters[id.index()].nominal = nominal.clone();
            }
            let id = self.parameter(spec, quantity, name, number.kind(), nominal.clone())?;
            self.open_numbers.insert(number, id);
        }
        Ok(())
    }

    pub(super) fn finish(mut self) -> Result<ParametrizedPlan, ParametrizeError> {
        let plan = &mut self.plan;
        for number in unknowns::mentioned(self.task, &plan.plan) {
            // A plan that was read from a file has no open numbers left, but the goal is the
            // task's.
            let is_filled = number.instance.is_none()
                && plan.find(&number.name(self.task, &plan.plan)).is_some();
            if !self.open_numbers.contains_key(&number) && !is_filled {
                return Err(ParametrizeError::NoNominal {
                    name: number.name(self.task, &plan.plan),
                });
            }
        }
        unknowns::substitute_unknowns(&mut plan.plan, &mut plan.goal, &self.open_numbers);
        self.plan.commanded_durations = self.commanded_durations();
        Ok(self.plan.with_planned_durations())
    }

    /// Returns the planned durations of the actions whose durations the executor chooses at their
    /// start.
    fn commanded_durations(&self) -> BTreeMap<InstanceId, Rational> {
        let plan = &self.plan.plan;
        let told = plan.constraints.iter().filter_map(|constraint| {
            let Reason::Duration(id) = constraint.reason else {
                return None;
            };
            let is_left_open = constraint.lower != constraint.upper;
            let is_parameter = |bound: &Bound| bound.parameter().is_some();
            if !is_left_open || is_parameter(&constraint.lower) || is_parameter(&constraint.upper) {
                return None;
            }
            let time = |node: NodeId| &self.nominal[node];
            Some((id, time(plan.end(id)) - time(plan.start(id))))
        });
        told.collect()
    }
}
