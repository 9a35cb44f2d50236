//! `adaptable`: Olisipo, on a clock.

mod initial_belief;
mod order_cache;
mod remaining_order;
mod repetitions;

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::Step;
use elbowroom_plan::InstanceId;
use elbowroom_probability::{
    LayerDispatch, Likelihoods, Model, OrderSearch, Reconsider, SearchSettings, Semantics,
};

use super::happening_choice::HappeningChooser;
use super::{ExecutorEntry, Needs, PolicyTableCache, Role};
use crate::dispatch::replan;
use crate::executor::PlanForm;
use crate::executor::{Decided, DecisionContext, Executor, Planned, PreparedPlan, StepId};
use crate::reason::{Cause, Reason, Subject};
use initial_belief::InitialBelief;
pub use order_cache::OrderCache;
use remaining_order::RemainingOrder;

pub(super) const REGISTERED: ExecutorEntry = ExecutorEntry {
    name: "adaptable",
    argument: None,
    is_optional: false,
    summary: "Executes the order of the plan's actions that is most likely to succeed from the \
              present state: it skips, repeats and reorders actions where that is more likely to \
              succeed and time permits, and replans when no order reaches the goal.",
    paper: "Olisipo in Ribeiro et al. (2021), sections 2.2.1 and 2.2.2",
    needs: Needs {
        orders: true,
        ..Needs::plan(PlanForm::PartialOrder)
    },
    roles: &[Role::FirstPlan, Role::RemainingPlan, Role::Evaluation],
    make: |_, means| {
        Box::new(Adaptable {
            initial: InitialBelief::of(&means.likelihoods),
            likelihoods: means.likelihoods,
            orders: means.order_cache,
            policy_tables: None,
            is_table_cycling: false,
            state: None,
        })
    },
};

/// For `lookahead`: maximum number of happenings of a plan for which the orders are searched
/// completely before each start.
const MAX_EXACT_HAPPENINGS: usize = 20;

/// See [`REGISTERED`]. With foresight it is `lookahead`.
#[derive(Clone)]
pub(super) struct Adaptable {
    likelihoods: Arc<Likelihoods>,
    /// Uncertain initial facts. A new plan does not change them.
    initial: InitialBelief,
    /// Searches of plans that were adopted earlier.
    orders: Option<OrderCache>,
    policy_tables: Option<PolicyTableCache>,
    /// `true` if the table of a small world has led to the same state repeatedly. Orders are
    /// executed then.
    is_table_cycling: bool,
    state: Option<RemainingOrder>,
}

impl Executor for Adaptable {
    fn need(&self) -> PlanForm {
        REGISTERED.needs.plan
    }

    fn adopt(&mut self, mission: &PreparedPlan) -> Result<(), Box<Reason>> {
        let (chooser, steps) = match self.table_policy(mission) {
            Some(tabulated) => tabulated,
            None => self.order_policy(mission)?,
        };
        self.state = Some(RemainingOrder::new(
            mission,
            chooser,
            steps,
            &self.likelihoods,
        ));
        Ok(())
    }

    fn decide(&mut self, moment: &DecisionContext<'_>) -> Decided {
        let Some(rest) = &mut self.state else {
            return super::without_plan();
        };
        for news in moment.plan_events {
            if !self.initial.is_empty() {
                let task = moment.belief.task();
                self.initial.learn(news, rest.action_of(news), task);
            }
            if let Some(reason) = rest.learn(news, moment, &self.likelihoods) {
                return replan(reason);
            }
        }
        let decided = rest.next(moment, &self.initial);
        self.is_table_cycling |= rest.is_table_cycling();
        decided
    }

    fn window(&self, step: StepId, is_end: bool) -> Option<Planned> {
        self.state.as_ref()?.window(step, is_end)
    }

    fn fork(&self) -> Option<Box<dyn Executor>> {
        Some(Box::new(self.clone()))
    }
}

impl Adaptable {
    /// Creates `lookahead`.
    pub(super) fn with_policy_tables(
        likelihoods: Arc<Likelihoods>,
        foresight: PolicyTableCache,
    ) -> Self {
        Self {
            initial: InitialBelief::of(&likelihoods),
            likelihoods,
            orders: None,
            policy_tables: Some(foresight),
            is_table_cycling: false,
            state: None,
        }
    }

    /// Returns the table of a small world, with its actions. `None` if an action is running or the
    /// state is uncertain.
    fn table_policy(&self, mission: &PreparedPlan) -> Option<(HappeningChooser, Vec<Step>)> {
        let foresight = self.policy_tables.as_ref()?;
        // A table requires a fully known state.
        if !mission.running.is_empty() || !self.initial.is_empty() || self.is_table_cycling {
            return None;
        }
        let table = foresight.table(&mission.task, &self.likelihoods)?;
        let steps = table.steps().to_vec();
        // The world may have left the states that the likelihoods permit. The plan then needs
        // actions that the table does not have.
        let is_known = |planned: &Step| {
            let mut actions = steps.iter().map(|step| &step.action);
            let planned = &planned.action;
            actions.any(|it| it.schema == planned.schema && it.arguments == planned.arguments)
        };
        if !mission.time_triggered.steps.iter().all(is_known) {
            return None;
        }
        let search = Box::new(table.search());
        let chooser = HappeningChooser::Table {
            table,
            search,
            value: 0.0,
        };
        Some((chooser, steps))
    }

    /// Returns the search for orders of a plan, with its steps.
    fn order_policy(
        &self,
        mission: &PreparedPlan,
    ) -> Result<(HappeningChooser, Vec<Step>), Box<Reason>> {
        let looks_ahead = self.policy_tables.is_some();
        let Some(plan) = mission.order.clone() else {
            let reason = Reason::new(Cause::NoOrder).about(Subject::NoPartialOrder);
            return Err(Box::new(reason));
        };
        // In both, running actions come first.
        let by_instance = plan
            .instance_of_step
            .iter()
            .zip(&mission.time_triggered.steps);
        let by_instance: BTreeMap<InstanceId, &Step> =
            by_instance.map(|(&id, step)| (id, step)).collect();
        let steps: Vec<Step> = by_instance.into_values().cloned().collect();
        let known = self.orders.as_ref();
        if let Some(dispatch) = known.and_then(|it| it.get(&mission.task, &plan, &steps)) {
            return Ok((HappeningChooser::OrderSearch(Box::new(dispatch)), steps));
        }
        let kept = known.is_some().then(|| plan.clone());
        let task = Arc::clone(&mission.task);
        let semantics = if looks_ahead {
            Semantics::World
        } else {
            Semantics::Paper
        };
        let model = Model::new(task, plan, &self.likelihoods, semantics).map_err(|missing| {
            let about = Subject::ExternalMessage(missing.to_string());
            Box::new(Reason::new(Cause::NoOrder).about(about))
        })?;
        // On a clock, facts do not change from step to step. An order that relies on such changes
        // would repeat steps in vain.
        let model = if looks_ahead {
            model.without_luck()
        } else {
            model
        };
        let search = OrderSearch::new(model, SearchSettings::default());
        let as_planned = search.timed_sequence(&steps);
        let search = search.beginning_with(as_planned);
        let is_short = search.model().plan().nodes.len() <= MAX_EXACT_HAPPENINGS;
        let reconsider = if looks_ahead && is_short {
            Reconsider::Always
        } else {
            Reconsider::WhenNoLayerFits
        };
        let dispatch = LayerDispatch::new(search, reconsider);
        if let (Some(orders), Some(plan)) = (known, kept) {
            orders.put(&mission.task, plan, &steps, &dispatch);
        }
        Ok((HappeningChooser::OrderSearch(Box::new(dispatch)), steps))
    }
}
