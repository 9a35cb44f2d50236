//! `adaptable`: Olisipo, on a clock.

mod initial;
mod orders;
mod repetitions;
mod rest;

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::Step;
use elbowroom_plan::InstanceId;
use elbowroom_probability::{
    LayerDispatch, Likelihoods, Model, OrderSearch, Reconsider, SearchSettings, Semantics,
};

use super::chooser::Chooser;
use super::{Foresight, Registered};
use crate::dispatch::replan;
use crate::executor::Need;
use crate::executor::{Decided, Executor, Mission, Moment, Planned, StepId};
use crate::reason::{About, Cause, Reason};
use initial::Initial;
pub use orders::Orders;
use rest::Rest;

pub(super) const REGISTERED: Registered = Registered {
    name: "adaptable",
    argument: None,
    is_optional: false,
    summary: "Executes the order of the plan's actions that is most likely to succeed from \
              the present state: it skips, repeats and reorders actions where that is \
              likelier and there is time for it, and replans when no order can work.",
    paper: "Olisipo in Ribeiro et al. (2021), sections 2.2.1 and 2.2.2",
    need: Need::PartialOrder,
    make: |_, means| {
        Box::new(Adaptable {
            initial: Initial::of(&means.likelihoods),
            likelihoods: means.likelihoods,
            orders: means.orders,
            foresight: None,
            is_table_circling: false,
            state: None,
        })
    },
};

/// For `lookahead`: greatest number of happenings of a plan whose orders are searched completely
/// before each start.
const SHORT: usize = 20;

/// See [`REGISTERED`]. With foresight it is `lookahead`.
#[derive(Clone)]
pub(super) struct Adaptable {
    likelihoods: Arc<Likelihoods>,
    /// Uncertain initial facts. A new plan does not change them.
    initial: Initial,
    /// Searches of plans that were adopted earlier.
    orders: Option<Orders>,
    foresight: Option<Foresight>,
    /// `true` if the table of a small world has led to the same state repeatedly. Orders are
    /// executed then.
    is_table_circling: bool,
    state: Option<Rest>,
}

impl Executor for Adaptable {
    fn need(&self) -> Need {
        REGISTERED.need
    }

    fn adopt(&mut self, mission: &Mission) -> Result<(), Box<Reason>> {
        let (chooser, steps) = match self.tabulated(mission) {
            Some(tabulated) => tabulated,
            None => self.orders(mission)?,
        };
        self.state = Some(Rest::new(mission, chooser, steps, &self.likelihoods));
        Ok(())
    }

    fn decide(&mut self, moment: &Moment<'_>) -> Decided {
        let Some(rest) = &mut self.state else {
            return super::without_plan();
        };
        for news in moment.news {
            if !self.initial.is_empty() {
                let task = moment.belief.task();
                self.initial.learn(news, rest.action_of(news), task);
            }
            if let Some(reason) = rest.learn(news, moment, &self.likelihoods) {
                return replan(reason);
            }
        }
        let decided = rest.next(moment, &self.initial);
        self.is_table_circling |= rest.is_table_circling();
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
    pub(super) fn with_foresight(likelihoods: Arc<Likelihoods>, foresight: Foresight) -> Self {
        Self {
            initial: Initial::of(&likelihoods),
            likelihoods,
            orders: None,
            foresight: Some(foresight),
            is_table_circling: false,
            state: None,
        }
    }

    /// Returns the table of a small world, with its actions. `None` if an action is running or the
    /// state is uncertain.
    fn tabulated(&self, mission: &Mission) -> Option<(Chooser, Vec<Step>)> {
        let foresight = self.foresight.as_ref()?;
        // A table requires a fully known state.
        if !mission.running.is_empty() || !self.initial.is_empty() || self.is_table_circling {
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
        let chooser = Chooser::Table {
            table,
            search,
            value: 0.0,
        };
        Some((chooser, steps))
    }

    /// Returns the search for orders of a plan, with its steps.
    fn orders(&self, mission: &Mission) -> Result<(Chooser, Vec<Step>), Box<Reason>> {
        let looks_ahead = self.foresight.is_some();
        let Some(plan) = mission.order.clone() else {
            let reason = Reason::new(Cause::NoOrder).about(About::NoPartialOrder);
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
            return Ok((Chooser::Orders(Box::new(dispatch)), steps));
        }
        let kept = known.is_some().then(|| plan.clone());
        let task = Arc::clone(&mission.task);
        let semantics = if looks_ahead {
            Semantics::World
        } else {
            Semantics::Paper
        };
        let model = Model::new(task, plan, &self.likelihoods, semantics).map_err(|missing| {
            let about = About::Said(missing.to_string());
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
        let as_planned = search.as_timed(&steps);
        let search = search.beginning_with(as_planned);
        let is_short = search.model().plan().nodes.len() <= SHORT;
        let reconsider = if looks_ahead && is_short {
            Reconsider::Always
        } else {
            Reconsider::WhenNoLayerFits
        };
        let dispatch = LayerDispatch::new(search, reconsider);
        if let (Some(orders), Some(plan)) = (known, kept) {
            orders.put(&mission.task, plan, &steps, &dispatch);
        }
        Ok((Chooser::Orders(Box::new(dispatch)), steps))
    }
}
