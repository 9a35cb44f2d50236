//! A planner for worlds without time: [`Shortest`].

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use elbowroom_model::ground::{Action, FactId};
use elbowroom_model::{State, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::{apply, holds, start_of};

/// Plans with as few actions as possible, one after the other; of several such plans the one whose
/// first action comes first in the list of actions, and so on.
///
/// Over-all conditions must hold from before the start, as the authors' search has it, and from
/// after it. Plans are remembered by the state they begin in. For small problems only: it goes
/// through all states that are nearer than the goal.
#[derive(Clone, Debug)]
pub struct Shortest {
    task: Arc<Task>,
    actions: Vec<Action>,
    plans: BTreeMap<BTreeSet<FactId>, Option<Arc<TimeTriggeredPlan>>>,
}

impl Shortest {
    /// A planner that uses these actions, and prefers those that come first.
    pub fn new(task: Arc<Task>, actions: Vec<Action>) -> Self {
        Self {
            task,
            actions,
            plans: BTreeMap::new(),
        }
    }

    /// The plan from here, if there is one.
    pub fn plan(&mut self, state: &State) -> Option<Arc<TimeTriggeredPlan>> {
        if let Some(known) = self.plans.get(&state.facts) {
            return known.clone();
        }
        let plan = self.search(state).map(|steps| Arc::new(self.timed(&steps)));
        self.plans.insert(state.facts.clone(), plan.clone());
        plan
    }

    /// Breadth first; states are met in the order of their lexicographically first shortest plans.
    fn search(&self, from: &State) -> Option<Vec<usize>> {
        let mut came_from: BTreeMap<BTreeSet<FactId>, Option<(usize, BTreeSet<FactId>)>> =
            BTreeMap::from([(from.facts.clone(), None)]);
        let mut open = VecDeque::from([from.clone()]);
        while let Some(state) = open.pop_front() {
            if holds(self.task.goal(), &state) {
                let mut steps = Vec::new();
                let mut at = &state.facts;
                while let Some(Some((action, before))) = came_from.get(at) {
                    steps.push(*action);
                    at = before;
                }
                steps.reverse();
                return Some(steps);
            }
            for (index, action) in self.actions.iter().enumerate() {
                let Some(next) = done(action, &state) else {
                    continue;
                };
                if !came_from.contains_key(&next.facts) {
                    let before = state.facts.clone();
                    came_from.insert(next.facts.clone(), Some((index, before)));
                    open.push_back(next);
                }
            }
        }
        None
    }

    /// One second for each action, and ε between them.
    fn timed(&self, steps: &[usize]) -> TimeTriggeredPlan {
        let mut now = Rational::ZERO;
        let mut timed = Vec::new();
        for &index in steps {
            let action = self.actions[index].clone();
            let duration = action.durative().map(|_| Rational::ONE);
            let start = now.clone();
            now = &start + duration.clone().unwrap_or_default() + self.task.epsilon();
            timed.push(Step {
                start,
                action: Arc::new(action),
                duration,
            });
        }
        TimeTriggeredPlan { steps: timed }
    }
}

/// The state after the whole of an action, if it can be done.
fn done(action: &Action, state: &State) -> Option<State> {
    let mut after = state.clone();
    if !holds(&start_of(action).condition, state) {
        return None;
    }
    apply(start_of(action), &mut after);
    if let Some(body) = action.durative() {
        let works = holds(&body.over_all, state)
            && holds(&body.over_all, &after)
            && holds(&body.end.condition, &after);
        if !works {
            return None;
        }
        apply(&body.end, &mut after);
    }
    Some(after)
}
