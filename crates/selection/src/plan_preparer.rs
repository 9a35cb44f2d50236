//! Preparation of plans: deordering, parameters, envelopes.

use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;

use elbowroom_envelope::explain::Explainer;
use elbowroom_envelope::obligations::Refusal;
use elbowroom_envelope::pipeline::{self, PipelineError};
use elbowroom_envelope::{Guarantee, Oracle, Settings as SearchSettings, irr};
use elbowroom_execution::{
    DispatchableCache, PlanForm, PreparationResult, PrepareError, Preparer, RegionOracle,
};
use elbowroom_model::ground::Action;
use elbowroom_model::validate::Verdict;
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::{End, Interval, Rational, work};
use elbowroom_plan::deorder::{self, Deordered};
use elbowroom_plan::parametrize::{ParametrizeError, VarySpec, parametrize};
use elbowroom_plan::partial_order::partial_order;
use elbowroom_plan::{
    Bound, BoxEnd, Constraint, DecoupledEnvelope, Node, NodeId, ParameterId, ParametrizedPlan,
    Reason, Schedule, Side, StnPlan, Valuation, network_node,
};
use elbowroom_stn::ConsistentNetwork;

use crate::box_search::EnvelopeSettings;
use crate::box_search::grow;
use crate::open_durations;
use crate::postponement;
use crate::propositional::{to_propositional, with_fixed_durations};
use crate::slack;
use crate::timeouts::PlannedTimeout;
use crate::vary::is_about_an_absent_action;

/// Prepares plans with [`pipeline`].
#[derive(Clone)]
pub struct PlanPreparer<'a> {
    settings: EnvelopeSettings,
    may_continue: Option<MayContinue<'a>>,
}

/// Maximum number of times that open durations are chosen for a plan, each with a new envelope.
const MAX_CHOICES: usize = 4;

/// Decides whether the computation of an envelope continues.
type MayContinue<'a> = Arc<dyn Fn() -> bool + Send + Sync + 'a>;

impl fmt::Debug for PlanPreparer<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            settings,
            may_continue,
        } = self;
        f.debug_struct("PlanPreparer")
            .field("settings", settings)
            .field("has_limit", &may_continue.is_some())
            .finish()
    }
}

impl PlanPreparer<'_> {
    /// Creates a preparer. It ignores the specifications in `settings.vary` that name nothing in a
    /// plan.
    pub fn new(settings: EnvelopeSettings) -> Self {
        Self {
            settings,
            may_continue: None,
        }
    }

    /// Stops the computation of an envelope when `may_continue` returns `false`, and uses the box
    /// found so far. It is called after each step. The box is sound at any time, but may be smaller
    /// than possible.
    #[must_use]
    pub fn stopped_unless<'l>(
        self,
        may_continue: impl Fn() -> bool + Send + Sync + 'l,
    ) -> PlanPreparer<'l> {
        PlanPreparer {
            settings: self.settings,
            may_continue: Some(Arc::new(may_continue)),
        }
    }

    fn flow(&self) -> ControlFlow<()> {
        match &self.may_continue {
            Some(may_continue) if !may_continue() => ControlFlow::Break(()),
            _ => flow_until_stop(),
        }
    }

    /// Returns the specifications that match something in the plan.
    fn specs(&self, task: &Task, freed: &Deordered) -> Result<Vec<VarySpec>, ParametrizeError> {
        let mut fitting = Vec::new();
        for spec in &self.settings.vary {
            let plan = freed.plan.clone();
            let one = std::slice::from_ref(spec);
            match parametrize(task, plan, &freed.nominal, one) {
                // Another specification may define the value of an undefined number.
                Ok(_) | Err(ParametrizeError::NoNominal { .. }) => fitting.push(spec.clone()),
                Err(ParametrizeError::NothingMatches { .. }) => {}
                Err(error) if is_about_an_absent_action(task, spec, &error) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(fitting)
    }

    fn open(&self, task: &Task, freed: Deordered) -> Result<ParametrizedPlan, PrepareError> {
        let specs = self.specs(task, &freed)?;
        if specs.is_empty() && !self.settings.vary.is_empty() {
            return Ok(pipeline::without_parameters(task, freed));
        }
        pipeline::open(task, freed, &specs).map_err(preparation_error)
    }

    /// Returns the orderings that facts require: see
    /// [`PlanForm::Orderings`](elbowroom_execution::PlanForm::Orderings).
    fn orderings(
        task: &Task,
        plan: &TimeTriggeredPlan,
        need: PlanForm,
    ) -> Result<PreparationResult, PrepareError> {
        let mut deordered = deorder::deorder(task, &to_propositional(task, plan))?;
        let order = (need == PlanForm::PartialOrder)
            .then(|| partial_order(task, &with_fixed_durations(plan)));
        for (instance, step) in deordered.instances.iter().zip(&plan.steps) {
            deordered.plan.instances[instance.index()].action = step.action.clone();
        }
        Ok(PreparationResult {
            time_triggered: plan.clone(),
            plan: ParametrizedPlan::closed(task, deordered.plan),
            instances: deordered.instances,
            nominal: deordered.nominal,
            envelope: None,
            forms: DispatchableCache::default(),
            order,
        })
    }

    fn envelope(
        &self,
        task: &Arc<Task>,
        plan: &Arc<ParametrizedPlan>,
        nominal: &Schedule,
    ) -> Result<DecoupledEnvelope, PrepareError> {
        let beyond = |refusal: Refusal| PrepareError::Unsupported(refusal.to_string());
        let guarantee = self.settings.guarantee;
        let oracle = if deorder::keeps_all_that_is_read(task, plan, nominal) {
            Oracle::of_times(task, plan, guarantee)
        } else {
            Oracle::new(task, plan, guarantee)
        };
        let mut oracle = oracle.map_err(beyond)?;
        let search = &self.settings.search;
        let how = (search, search.method_for(task));
        let world = self.settings.world.as_ref();
        let grown = grow(&mut oracle, how, world, &mut |_| self.flow());
        let grown = grown.map_err(|error| PrepareError::Unsupported(error.to_string()))?;
        grown.envelope.map_err(|_| PrepareError::NoGuarantee)
    }
}

impl Preparer for PlanPreparer<'_> {
    /// Of a plan with an open network, the starts of some actions are postponed if that gives it
    /// more slack.
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: PlanForm,
    ) -> Result<PreparationResult, PrepareError> {
        let prepared = self.prepare_as_given(task, plan, need)?;
        if need != PlanForm::OpenNetwork || !prepared.plan.durations_move_numbers() {
            return Ok(prepared);
        }
        let postponed = postponement::postpone(task, plan);
        let postponed = postponed.and_then(|later| self.prepare_as_given(task, &later, need).ok());
        let is_better = |later: &PreparationResult| slack::has_more_slack(later, &prepared);
        Ok(postponed.filter(is_better).unwrap_or(prepared))
    }
}

impl PlanPreparer<'_> {
    /// Prepares the plan with its own starts as planned times.
    fn prepare_as_given(
        &self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: PlanForm,
    ) -> Result<PreparationResult, PrepareError> {
        let is_about_orders = matches!(need, PlanForm::Orderings | PlanForm::PartialOrder);
        if is_about_orders && pipeline::validate_plan(task, plan).is_valid() {
            return Self::orderings(task, plan, need);
        }
        let mut freed = pipeline::deorder_or_reschedule(task, plan).map_err(preparation_error)?;
        fix_running_starts(&mut freed.plan);
        if is_about_orders {
            return Self::orderings(task, plan, need);
        }
        let time_triggered = plan.clone();
        let nominal = freed.nominal.clone();
        let instances = freed.instances.clone();
        let given = freed.plan.clone();
        let plan = Arc::new(match need {
            PlanForm::Orderings | PlanForm::PartialOrder | PlanForm::Network => {
                pipeline::without_parameters(task, freed)
            }
            PlanForm::OpenNetwork | PlanForm::Envelope => self.open(task, freed)?,
        });
        if matches!(need, PlanForm::OpenNetwork | PlanForm::Envelope)
            && let Some(beyond) = PlannedTimeout::find(&plan, &self.settings.timeout)
        {
            return Err(PrepareError::Unsupported(beyond.message()));
        }
        let envelope = match need {
            PlanForm::Envelope => Some(self.envelope(task, &plan, &nominal)?),
            PlanForm::OpenNetwork => self.envelope(task, &plan, &nominal).ok(),
            PlanForm::Orderings | PlanForm::PartialOrder | PlanForm::Network => None,
        };
        let prepared = PreparationResult {
            time_triggered,
            plan: Arc::unwrap_or_clone(plan),
            instances,
            nominal,
            envelope,
            forms: DispatchableCache::default(),
            order: None,
        };
        Ok(match need {
            PlanForm::OpenNetwork => self.with_open_durations(task, &given, prepared),
            _ => prepared,
        })
    }

    /// Moves the durations that the domain leaves open away from the ends of their intervals, with
    /// a new envelope around them if that has more slack.
    fn with_open_durations(
        &self,
        task: &Arc<Task>,
        given: &StnPlan,
        mut prepared: PreparationResult,
    ) -> PreparationResult {
        for _ in 0..MAX_CHOICES {
            if !open_durations::choose(task, given, &mut prepared) {
                break;
            }
            let plan = Arc::new(prepared.plan.clone());
            let envelope = self.envelope(task, &plan, &prepared.nominal).ok();
            let wider = PreparationResult {
                envelope,
                ..prepared.clone()
            };
            if !slack::has_more_slack(&wider, &prepared) {
                break;
            }
            prepared = wider;
        }
        prepared
    }
}

/// Fixes the starts of running actions. These starts have no conditions or effects, so nothing else
/// constrains them, and the envelope would depend on the choice of their times.
fn fix_running_starts(plan: &mut StnPlan) {
    let is_under_way = |action: &Action| {
        let body = action.durative();
        body.is_some_and(|body| body.is_running)
    };
    let starts: Vec<NodeId> = plan
        .nodes()
        .filter_map(|(node, what)| match what {
            Node::Start(id) if is_under_way(&plan.instance(id).action) => Some(node),
            _ => None,
        })
        .collect();
    plan.constraints
        .extend(starts.into_iter().map(|start| Constraint {
            from: NodeId::ZERO,
            to: start,
            lower: Bound::Finite(Rational::ZERO),
            upper: Bound::Finite(Rational::ZERO),
            reason: Reason::Given,
        }));
}

/// Initial step size of the search for a box around the values of a remaining plan: a value is
/// moved by itself divided by this number. Values are moved alternately, so that none uses up the
/// slack of the others.
const FIRST_STEP: i64 = 16;

/// Maximum number of box checks of this search, per parameter.
const MAX_CHECKS: usize = 64;

/// The exact envelope, checked point by point. If a plan is beyond exact analysis, the validator
/// checks its earliest times.
#[derive(Clone, Copy, Debug, Default)]
pub struct ExactRegion;

impl ExactRegion {
    /// Returns the oracle for a plan with these nominal values.
    fn oracle_at(
        task: &Arc<Task>,
        plan: &ParametrizedPlan,
        values: &Valuation,
    ) -> Result<Oracle, Refusal> {
        let mut plan = plan.clone();
        for (parameter, value) in plan.parameters.iter_mut().zip(values) {
            parameter.nominal = value.clone();
        }
        Oracle::new(task, &Arc::new(plan), Guarantee::Weak)
    }

    /// Validates the plan at its earliest times, with these values. An undecided plan is accepted.
    ///
    /// # Errors
    /// The violation, in words.
    fn validate_at(task: &Task, plan: &ParametrizedPlan, values: &Valuation) -> Result<(), String> {
        let network = ConsistentNetwork::try_from(plan.plan.network(values));
        let network = network.map_err(|_| "no times satisfy the plan's constraints".to_owned())?;
        let schedule = network.earliest_schedule(network_node(NodeId::ZERO));
        let fixed = plan.plan.at(values).scheduled(&schedule.into());
        match pipeline::validate_plan(task, &fixed) {
            Verdict::Invalid(violation) => Err(violation.to_string()),
            _ => Ok(()),
        }
    }

    /// Returns the plan with each range cut to the values between 0 and twice the present value.
    fn with_narrow_ranges(plan: &ParametrizedPlan, values: &Valuation) -> ParametrizedPlan {
        let mut plan = plan.clone();
        for (parameter, value) in plan.parameters.iter_mut().zip(values) {
            parameter.weight = Rational::new(1, FIRST_STEP);
            let room = value.abs();
            let near = Interval::closed(value - &room, value + &room);
            let range = parameter.range.intersection(&near);
            // Observed values may be out of range.
            let has_value = range.contains(value);
            parameter.range = if has_value {
                range
            } else {
                Interval::point(value.clone())
            };
        }
        plan
    }
}

/// Moves the ends of a box onto the nearby ends of ranges, if the plan still works there. The
/// search misses them, because its steps are proportional to the values. For example, the lower end
/// of the remaining duration of a running action is 0.
fn extend_to_ranges(oracle: &mut Oracle, known: DecoupledEnvelope) -> DecoupledEnvelope {
    let plan = Arc::clone(oracle.plan());
    let mut wider = known.clone();
    for end in BoxEnd::all(plan.parameters.len()) {
        let own = plan.parameter(end.parameter);
        let value = Interval::point(own.nominal.clone());
        let nearby = end
            .side
            .reach(&value)
            .map(|reach| reach + own.nominal.abs());
        let border = end.side.reach(&own.range);
        let is_closed = matches!(end.side.of(&own.range), End::Closed(_));
        if is_closed && border < nearby {
            wider.set_reach(end, border);
        }
    }
    match oracle.objection(&wider) {
        Ok(None) => wider,
        _ => known,
    }
}

impl RegionOracle for ExactRegion {
    fn is_feasible(
        &mut self,
        task: &Arc<Task>,
        plan: &ParametrizedPlan,
        values: &Valuation,
    ) -> bool {
        if !plan.reads_more_than_facts(task) {
            // The network contains all orderings that facts require, for any durations. The
            // executor has this network.
            return true;
        }
        let objection = Self::oracle_at(task, plan, values)
            .ok()
            .and_then(|mut oracle| oracle.objection(&DecoupledEnvelope::point(values)).ok());
        match objection {
            Some(objection) => objection.is_none(),
            None => Self::validate_at(task, plan, values).is_ok(),
        }
    }

    /// Runs IRR with a small initial step, so that it stays near the values.
    fn surroundings(
        &mut self,
        task: &Arc<Task>,
        plan: &ParametrizedPlan,
        values: &Valuation,
    ) -> Result<DecoupledEnvelope, String> {
        if !plan.reads_more_than_facts(task) {
            return Ok(DecoupledEnvelope::point(values));
        }
        let plan = Self::with_narrow_ranges(plan, values);
        let judged =
            || Self::validate_at(task, &plan, values).map(|()| DecoupledEnvelope::point(values));
        let Ok(mut oracle) = Self::oracle_at(task, &plan, values) else {
            return judged();
        };
        let settings = SearchSettings {
            relative: Some(Rational::new(1, 2 * FIRST_STEP)),
            most_checks: Some(MAX_CHECKS * plan.parameters.len()),
            ..SearchSettings::default()
        };
        let Ok(run) = irr(&mut oracle, &settings, &mut |_| flow_until_stop()) else {
            return judged();
        };
        let known = run.envelope.map_err(|objection| {
            let explainer = Explainer::new(task, oracle.plan());
            let point = DecoupledEnvelope::point(values);
            explainer.objection(&oracle, &point, &objection).reason
        })?;
        Ok(extend_to_ranges(&mut oracle, known))
    }

    /// Uses one oracle for all values, so that only the proofs that use the larger value are
    /// repeated.
    fn growing<'a>(
        &'a mut self,
        task: &'a Arc<Task>,
        plan: &'a ParametrizedPlan,
        values: &Valuation,
        parameter: ParameterId,
    ) -> Box<dyn FnMut(&Rational) -> bool + 'a> {
        if !plan.reads_more_than_facts(task) {
            return Box::new(|_| true);
        }
        let Ok(mut oracle) = Self::oracle_at(task, plan, values) else {
            let mut tried = values.clone();
            return Box::new(move |value| {
                tried[parameter].clone_from(value);
                Self::validate_at(task, plan, &tried).is_ok()
            });
        };
        let end = BoxEnd {
            parameter,
            side: Side::Upper,
        };
        Box::new(move |value| matches!(oracle.try_reach(end, Some(value.clone())), Ok(true)))
    }

    fn fork(&self) -> Option<Box<dyn RegionOracle>> {
        Some(Box::new(*self))
    }
}

/// Ends a search after a stop request.
fn flow_until_stop() -> ControlFlow<()> {
    if work::is_stopped() {
        return ControlFlow::Break(());
    }
    ControlFlow::Continue(())
}

fn preparation_error(error: PipelineError) -> PrepareError {
    match error {
        PipelineError::Invalid(violation) => PrepareError::Invalid(violation),
        PipelineError::Deorder(error) => PrepareError::Deorder(error),
        PipelineError::Parametrize(error) => PrepareError::Parametrize(error),
        PipelineError::Refused(_) => PrepareError::Unsupported(error.to_string()),
    }
}
