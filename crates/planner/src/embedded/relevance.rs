//! Relevance of actions to the goal.
//!
//! An action is relevant if it changes a fact or a fluent that the goal reads, or that a condition
//! of a relevant action reads. A plan stays valid without the irrelevant actions, since the
//! remaining steps do not read their effects (Nebel, Dimopoulos & Koehler, "Ignoring irrelevant
//! facts and operators in plan generation", ECP 1997; this part loses no plans). For example, if an
//! action builds an object from any two others, most of its instances are irrelevant.
//!
//! Timed initials need no special treatment: they happen in every plan, and the goal counts after
//! all of them.

use elbowroom_model::ground::{
    Action, Body, Change, Condition, Effect, Expression, FactId, FluentId, SnapAction,
};
use elbowroom_model::problem::{self, UpdateOperator};
use elbowroom_model::reachability::Grounding;
use elbowroom_model::{Situation, Task};

/// Removes the actions that are irrelevant to the goal and cannot improve the metric.
pub(crate) fn keep_relevant(task: &Task, grounding: &mut Grounding, situation: &Situation) {
    let mut relevance = Relevance::of(grounding);
    relevance.read(&grounding.goal);
    for running in &situation.running {
        relevance.read_action(&running.action);
    }
    if let Some(metric) = &task.problem().metric {
        let only_grows = !metric.maximize && is_growing(&metric.expression);
        let is_time = matches!(metric.expression, problem::Expression::TotalTime);
        for (number, action) in grounding.actions.iter().enumerate() {
            if !is_time && changes_numbers(action, only_grows) {
                relevance.keep(number);
            }
        }
    }
    relevance.spread(grounding);
    let mut is_relevant = relevance.is_relevant.iter();
    grounding
        .actions
        .retain(|_| is_relevant.next().is_some_and(|&is_relevant| is_relevant));
}

/// Returns `true` if a metric grows monotonically with its fluents.
fn is_growing(expression: &problem::Expression) -> bool {
    use problem::Expression as E;
    match expression {
        E::Constant(value) => !value.is_negative(),
        E::Fluent(_) | E::TotalTime => true,
        E::Add(parts) => parts.iter().all(is_growing),
        E::Multiply(parts) => {
            let is_constant = |part: &&E| matches!(part, E::Constant(_));
            parts.iter().all(is_growing)
                && parts.iter().filter(|part| !is_constant(part)).count() <= 1
        }
        _ => false,
    }
}

/// Returns `true` if an action changes numbers such that the metric could improve. If `only_grows`,
/// additions do not improve the metric.
fn changes_numbers(action: &Action, only_grows: bool) -> bool {
    let matters = |effect: &Effect| match &effect.change {
        Change::Update {
            operator, value, ..
        } => {
            let is_added = *operator == UpdateOperator::Increase
                && matches!(value, Expression::Constant(value) if !value.is_negative());
            !(only_grows && is_added)
        }
        Change::Add(_) | Change::Delete(_) => false,
    };
    let has_flows = action
        .durative()
        .is_some_and(|body| !body.continuous.is_empty());
    has_flows || snaps(action).any(|snap| snap.effects.iter().any(matters))
}

/// Returns the happenings of an action.
fn snaps(action: &Action) -> impl Iterator<Item = &SnapAction> {
    let (first, second) = match &action.body {
        Body::Instantaneous(body) => (body, None),
        Body::Durative(body) => (&*body.start, Some(&*body.end)),
    };
    [Some(first), second].into_iter().flatten()
}

/// Backward search from the goal.
struct Relevance {
    is_relevant: Vec<bool>,
    /// For each fact and each fluent, the actions that change it.
    of_fact: Vec<Vec<usize>>,
    of_fluent: Vec<Vec<usize>>,
    is_read: (Vec<bool>, Vec<bool>),
    facts: Vec<FactId>,
    fluents: Vec<FluentId>,
    actions: Vec<usize>,
}

impl Relevance {
    fn of(grounding: &Grounding) -> Self {
        let mut found = Self {
            is_relevant: vec![false; grounding.actions.len()],
            of_fact: Vec::new(),
            of_fluent: Vec::new(),
            is_read: (Vec::new(), Vec::new()),
            facts: Vec::new(),
            fluents: Vec::new(),
            actions: Vec::new(),
        };
        for (number, action) in grounding.actions.iter().enumerate() {
            for effect in snaps(action).flat_map(|snap| &snap.effects) {
                match effect.change {
                    Change::Add(fact) | Change::Delete(fact) => {
                        push(&mut found.of_fact, fact.index(), number);
                    }
                    Change::Update { fluent, .. } => {
                        push(&mut found.of_fluent, fluent.index(), number);
                    }
                }
            }
            for effect in action.durative().iter().flat_map(|body| &body.continuous) {
                push(&mut found.of_fluent, effect.fluent.index(), number);
            }
        }
        found
    }

    fn keep(&mut self, action: usize) {
        if !std::mem::replace(&mut self.is_relevant[action], true) {
            self.actions.push(action);
        }
    }

    /// Marks the facts and fluents of a condition as relevant.
    fn read(&mut self, condition: &Condition) {
        let (facts, fluents) = (&mut self.facts, &mut self.fluents);
        condition.visit_facts(&mut |fact| facts.push(fact));
        condition.visit_fluents(&mut |fluent| fluents.push(fluent));
    }

    fn read_action(&mut self, action: &Action) {
        for snap in snaps(action) {
            self.read(&snap.condition);
            for effect in &snap.effects {
                let guard = &effect.guard;
                for condition in [&guard.at_start, &guard.over_all, &guard.now] {
                    self.read(condition);
                }
                if let Change::Update { value, .. } = &effect.change {
                    value.visit_fluents(&mut |fluent| self.fluents.push(fluent));
                }
            }
        }
        if let Some(body) = action.durative() {
            self.read(&body.over_all);
            for bound in &body.duration {
                let fluents = &mut self.fluents;
                bound
                    .bound
                    .visit_fluents(&mut |fluent| fluents.push(fluent));
            }
            for effect in &body.continuous {
                let guard = &effect.guard;
                for condition in [&guard.at_start, &guard.over_all, &guard.now] {
                    self.read(condition);
                }
                let fluents = &mut self.fluents;
                effect
                    .rate
                    .visit_fluents(&mut |fluent| fluents.push(fluent));
            }
        }
    }

    /// Propagates relevance to everything that a relevant part depends on.
    fn spread(&mut self, grounding: &Grounding) {
        let mut rules: Vec<Vec<usize>> = Vec::new();
        for (number, rule) in grounding.rules.iter().enumerate() {
            push(&mut rules, rule.head.index(), number);
        }
        loop {
            if let Some(action) = self.actions.pop() {
                self.read_action(&grounding.actions[action]);
            } else if let Some(fact) = self.facts.pop() {
                if !mark(&mut self.is_read.0, fact.index()) {
                    continue;
                }
                for rule in rules.get(fact.index()).into_iter().flatten() {
                    self.read(&grounding.rules[*rule].body);
                }
                for action in take(&mut self.of_fact, fact.index()) {
                    self.keep(action);
                }
            } else if let Some(fluent) = self.fluents.pop() {
                if mark(&mut self.is_read.1, fluent.index()) {
                    for action in take(&mut self.of_fluent, fluent.index()) {
                        self.keep(action);
                    }
                }
            } else {
                return;
            }
        }
    }
}

fn push(lists: &mut Vec<Vec<usize>>, place: usize, entry: usize) {
    if lists.len() <= place {
        lists.resize(place + 1, Vec::new());
    }
    lists[place].push(entry);
}

fn take(lists: &mut [Vec<usize>], place: usize) -> Vec<usize> {
    lists.get_mut(place).map(std::mem::take).unwrap_or_default()
}

/// Sets a mark. Returns `true` if it is new.
fn mark(marks: &mut Vec<bool>, place: usize) -> bool {
    if marks.len() <= place {
        marks.resize(place + 1, false);
    }
    !std::mem::replace(&mut marks[place], true)
}
