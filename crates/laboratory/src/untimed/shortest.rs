//! Planner for worlds without time: [`Shortest`].

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use elbowroom_model::ground::{Action, FactId};
use elbowroom_model::{State, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::{apply, holds, start_of};

/// Planner of sequential plans with a minimum number of actions. Of several such plans it returns
/// the lexicographically first one, in the order of the list of actions.
///
/// Over-all conditions must hold from before the start, as in the authors' search, and from after
/// it. Plans are cached by their initial state. Only for small problems, because the search visits
/// all states that are nearer than the goal.
#[derive(Clone, Debug)]
pub struct Shortest {
    task: Arc<Task>,
    actions: Vec<Action>,
    plans: BTreeMap<BTreeSet<FactId>, Option<Arc<TimeTriggeredPlan>>>,
}

impl Shortest {
    /// Creates a planner with these actions. Earlier ones are preferred.
    pub fn new(task: Arc<Task>, actions: Vec<Action>) -> Self {
        Self {
            task,
            actions,
            plans: BTreeMap::new(),
        }
    }

    /// Returns the plan from a state, if there is one.
    pub fn plan(&mut self, state: &State) -> Option<Arc<TimeTriggeredPlan>> {
        if let Some(known) = self.plans.get(&state.facts) {
            return known.clone();
        }
        let plan = self.search(state).map(|steps| Arc::new(self.timed(&steps)));
        self.plans.insert(state.facts.clone(), plan.clone());
        plan
    }

    /// Breadth-first search. States are visited in the order of their lexicographically first
    /// shortest plans.
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

    /// Schedules one second for each action, with ε between them.
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

/// Returns the state after an action has ended, or `None` if it is not applicable.
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
