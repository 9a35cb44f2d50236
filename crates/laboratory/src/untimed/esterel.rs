//! Baseline of paper 2: [`Esterel`].

use std::sync::Arc;

use elbowroom_model::ground::Action;
use elbowroom_model::{Situation, State, Step, Task, TimeTriggeredPlan};
use elbowroom_plan::deorder::deorder;
use elbowroom_plan::{Bound, Instance, Node, StnPlan};

use super::{ExecutorEntry, InstrumentedWorld, UntimedExecutor, start_of};

pub(super) const REGISTERED: ExecutorEntry = ExecutorEntry {
    name: "esterel",
    summary: "The baseline: happenings as soon as the network allows, failed starts \
              repeated without limit, a new plan when a condition is false.",
    paper: "the Esterel Dispatcher of ROSPlan, in Ribeiro et al. (2021), section 3",
    construct: |means| Ok(Box::new(Esterel::new(Arc::clone(&means.task)))),
};

/// Executes the deordered plan like `ROSPlan`'s Esterel dispatcher, node by node.
///
/// Each pass visits the happenings in the order of the plan, and executes each one whose
/// predecessors in the network are done. An action does not end in the pass of its start. A failed
/// start ends the pass, and is retried in the next one, without limit. If the condition of a due
/// happening does not hold, the execution ends. Over-all conditions and effects are not monitored,
/// and the goal is not checked before the plan is completed.
#[derive(Clone, Debug)]
pub struct Esterel {
    task: Arc<Task>,
    networks: Vec<(Arc<TimeTriggeredPlan>, Vec<Happening>)>,
}

#[derive(Clone, Debug)]
struct Happening {
    action: Arc<Action>,
    /// Position of its start, if it is an end.
    start: Option<usize>,
    /// Positions of its predecessors.
    after: Vec<usize>,
}

impl Esterel {
    /// Creates an executor for plans of this task.
    pub fn new(task: Arc<Task>) -> Self {
        Self {
            task,
            networks: Vec::new(),
        }
    }

    fn network(&mut self, plan: &Arc<TimeTriggeredPlan>, state: &State) -> usize {
        let known = self.networks.iter().position(|(p, _)| Arc::ptr_eq(p, plan));
        known.unwrap_or_else(|| {
            let happenings = happenings(&self.task, plan, state);
            self.networks.push((Arc::clone(plan), happenings));
            self.networks.len() - 1
        })
    }
}

impl UntimedExecutor for Esterel {
    fn execute(&mut self, plan: &Arc<TimeTriggeredPlan>, stage: &mut InstrumentedWorld<'_>) {
        let index = self.network(plan, stage.state());
        let happenings = &self.networks[index].1;
        let mut is_done = vec![false; happenings.len()];
        while !is_done.iter().all(|&done| done) {
            // Starts are reported between passes.
            let has_started = is_done.clone();
            for (index, happening) in happenings.iter().enumerate() {
                let is_due = happening.after.iter().all(|&before| is_done[before])
                    && happening.start.is_none_or(|start| has_started[start]);
                if is_done[index] || !is_due {
                    continue;
                }
                if stage.is_over() {
                    return;
                }
                let action = &*happening.action;
                let body = action.durative().filter(|_| happening.start.is_some());
                let snap = body.map_or_else(|| start_of(action), |body| &body.end);
                if !stage.holds(&snap.condition) {
                    return;
                }
                if body.is_some() {
                    // The plan ends with a failed action.
                    if !stage.end(action) {
                        return;
                    }
                } else if !stage.attempt(action) {
                    break;
                }
                is_done[index] = true;
            }
        }
    }
}

/// Returns the happenings of a plan with their predecessors.
fn happenings(task: &Task, plan: &TimeTriggeredPlan, state: &State) -> Vec<Happening> {
    let mut situation = Situation::initial(task);
    situation.state = state.clone();
    let task = task.starting_from(&situation);
    let deordered = deorder(&task, plan);
    let is_ordered = deordered.is_ok();
    // A planner may return an infeasible plan. Its actions are executed in the order of the list.
    let network = deordered.map_or_else(
        |_| StnPlan::unconstrained(&task, listed(plan)),
        |deordered| deordered.plan,
    );
    let mut happenings: Vec<Happening> = Vec::new();
    for (node, meaning) in network.nodes() {
        let (id, start) = match meaning {
            Node::Start(id) | Node::Instant(id) => (id, None),
            Node::End(id) => (id, Some(network.start(id).index() - 1)),
            Node::Zero | Node::Timed(_) => continue,
        };
        let before = network.constraints.iter().filter_map(|constraint| {
            let is_later = matches!(&constraint.lower, Bound::Finite(least) if least.is_positive());
            (is_later && constraint.to == node && constraint.from.index() > 0)
                .then(|| constraint.from.index() - 1)
        });
        let mut after: Vec<usize> = before.collect();
        if !is_ordered && node.index() > 1 {
            after.push(node.index() - 2);
        }
        happenings.push(Happening {
            action: Arc::clone(&network.instance(id).action),
            start,
            after,
        });
    }
    happenings
}

/// Returns the actions of a plan in the order of the list.
fn listed(plan: &TimeTriggeredPlan) -> Vec<Instance> {
    let instance = |(index, step): (usize, &Step)| Instance {
        label: format!("n{index}"),
        action: step.action.clone(),
    };
    plan.steps.iter().enumerate().map(instance).collect()
}
