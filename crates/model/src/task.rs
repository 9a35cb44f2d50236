//! A problem with its table of ground facts and fluents.

use std::collections::BTreeMap;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};

use elbowroom_num::Rational;

use crate::autonomous::Autonomous;
use crate::constraint::{Constraints, Modal};
use crate::derivation::{Derivation, Rules};
use crate::domains::Domains;
use crate::ground::{Change, Condition, FactId, FluentId};
use crate::grounder::Grounder;
use crate::problem::{self, FunctionId, ObjectId, PredicateId, Problem, SchemaId};
use crate::state::{State, TimedHappening};
use crate::table::Table;

const CONTROLS: &str = "control parameters (`:control`)";
const CONSTRAINTS: &str = "trajectory constraints (`:constraints`)";

/// A problem, and the ground facts and fluents mentioned so far.
///
/// Facts and fluents enter a table on first mention, so that a plan can be validated without
/// grounding the whole problem. The table only grows, and clones share it, as do
/// [`Task::starting_from`] and [`Situation::remaining_task`](crate::Situation::remaining_task): a
/// fact has the same number in all of them. Numbers follow the order of first mention. If threads
/// mention facts in no fixed order, each thread needs its own table ([`Task::with_own_table`]) for
/// reproducible results.
#[derive(Clone, Debug)]
pub struct Task {
    pub(crate) problem: Arc<Problem>,
    epsilon: Rational,
    pub(crate) domains: Arc<Domains>,
    table: Arc<RwLock<Table>>,
    pub(crate) initial: State,
    pub(crate) timed: Vec<TimedHappening>,
    pub(crate) goal: Condition,
    pub(crate) constraints: Arc<Constraints>,
    autonomous: Arc<Autonomous>,
    /// For each predicate, the positions of its rules in the problem.
    rules_of_predicate: Arc<Vec<Vec<usize>>>,
}

impl Task {
    /// Creates the task of a problem: its initial state, timed happenings and goal are ground; ε is
    /// 0.001.
    pub fn new(problem: impl Into<Arc<Problem>>) -> Self {
        Self::of(&problem.into(), Arc::default())
    }

    /// Creates the task of a problem that extends this task's: it has the same objects, and further
    /// predicates, functions and actions after the existing ones. Facts and fluents keep their
    /// numbers.
    #[must_use]
    pub fn extended(&self, problem: impl Into<Arc<Problem>>) -> Self {
        Self::of(&problem.into(), Arc::clone(&self.table)).with_epsilon(self.epsilon.clone())
    }

    fn of(problem: &Arc<Problem>, table: Arc<RwLock<Table>>) -> Self {
        let mut task = Self {
            problem: Arc::clone(problem),
            epsilon: Self::default_epsilon(),
            domains: Arc::new(Domains::of(problem)),
            table,
            initial: State::default(),
            timed: Vec::new(),
            goal: Condition::TRUE,
            constraints: Arc::default(),
            autonomous: Arc::default(),
            rules_of_predicate: Arc::new(rules_of_predicate(problem)),
        };
        let mut initial = State::default();
        let (timed, goal, constraints, autonomous) = task.grounding(|grounder| {
            for (predicate, arguments) in &problem.initial_facts {
                initial.facts.insert(grounder.fact(*predicate, arguments));
            }
            for (function, arguments, value) in &problem.initial_values {
                let fluent = grounder.fluent(*function, arguments);
                initial.values.insert(fluent, value.clone());
            }
            let timed = grounder.ground_timed();
            let goal = grounder.ground_condition(&problem.goal, &mut Vec::new());
            let constraints = grounder.constraints();
            (timed, goal, constraints, grounder.autonomous())
        });
        task.autonomous = Arc::new(autonomous);
        task.constraints = Arc::new(constraints);
        (task.initial, task.timed, task.goal) = (initial, timed, goal);
        task
    }

    /// Returns the lifted problem.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// Returns the default of the least separation of interfering happenings (ε).
    pub fn default_epsilon() -> Rational {
        Rational::new(1, 1000)
    }

    /// Returns the task with another least separation of interfering happenings (ε); positive, in
    /// the problem's unit of time.
    #[must_use]
    pub fn with_epsilon(mut self, epsilon: Rational) -> Self {
        self.epsilon = epsilon;
        self
    }

    /// Returns the least separation of interfering happenings (ε), in the problem's unit of time.
    /// The validator, orders, envelopes, planners and runs all use this value for plans of the
    /// task.
    pub fn epsilon(&self) -> &Rational {
        &self.epsilon
    }

    /// Returns the state at time 0.
    pub fn initial(&self) -> &State {
        &self.initial
    }

    /// Returns the timed initials, one entry per time, sorted by time.
    pub fn timed(&self) -> &[TimedHappening] {
        &self.timed
    }

    /// Returns the goal condition.
    pub fn goal(&self) -> &Condition {
        &self.goal
    }

    /// Returns the trajectory constraints and all preferences, including those of the goal.
    pub fn constraints(&self) -> &Constraints {
        &self.constraints
    }

    /// Returns the processes and events.
    pub fn autonomous(&self) -> &Autonomous {
        &self.autonomous
    }

    /// Returns a feature of the problem that only the validator supports, and envelopes to a
    /// documented extent. Components that find, change or execute plans must reject it.
    pub fn unsupported_by_analysis(&self) -> Option<&'static str> {
        if !self.autonomous.is_empty() {
            return Some("processes and events (PDDL+)");
        }
        (!self.problem.controls.is_empty()).then_some(CONTROLS)
    }

    /// Returns a feature of the problem that affects the validity of plans and that only the
    /// validator supports, or only the validator, networks and planners. All other components must
    /// reject it.
    pub fn validator_only_feature(&self) -> Option<&'static str> {
        if let Some(feature) = self.unsupported_by_analysis() {
            return Some(feature);
        }
        (!self.constraints.hard.is_empty()).then_some(CONSTRAINTS)
    }

    /// Returns a feature of the problem that affects the validity of plans and that the boxes of a
    /// given network do not respect. With processes and events, they respect constraints to a
    /// documented extent.
    pub fn unsupported_by_boxes(&self) -> Option<&'static str> {
        if !self.problem.controls.is_empty() {
            return Some(CONTROLS);
        }
        let are_heeded = self.constraints.hard.is_empty() || !self.autonomous.is_empty();
        (!are_heeded).then_some(CONSTRAINTS)
    }

    /// Returns the task with another goal. Facts and fluents keep their numbers.
    #[must_use]
    pub fn with_goal(&self, goal: problem::Condition) -> Self {
        let mut task = self.clone();
        task.goal = self.grounding(|grounder| grounder.ground_condition(&goal, &mut Vec::new()));
        let mut problem = (*self.problem).clone();
        problem.goal = goal;
        task.problem = Arc::new(problem);
        task
    }

    /// Returns the task with deadlines, on its clock: each condition holds at some moment between
    /// the beginning of a plan and the deadline. Unlike for constraints of the problem, states
    /// before the plan do not matter. Returns `None` if the task has constraints or preferences of
    /// its own.
    #[must_use]
    pub fn with_deadlines<'c>(
        &self,
        deadlines: impl IntoIterator<Item = (Rational, &'c problem::Condition)>,
    ) -> Option<Self> {
        if !self.constraints.is_empty() && !self.constraints.ignores_past {
            return None;
        }
        let ground = |condition| {
            self.grounding(|grounder| grounder.ground_condition(condition, &mut Vec::new()))
        };
        let deadlines = deadlines.into_iter();
        Some(self.with_ground_deadlines(deadlines.map(|(deadline, it)| (deadline, ground(it)))))
    }

    /// Returns the task with these deadlines in place of its constraints, as in
    /// [`Task::with_deadlines`].
    #[must_use]
    pub fn with_ground_deadlines(
        &self,
        deadlines: impl IntoIterator<Item = (Rational, Condition)>,
    ) -> Self {
        let deadlines = deadlines.into_iter();
        let constraints = Constraints {
            hard: deadlines
                .map(|(deadline, it)| Modal::Within(deadline, it))
                .collect(),
            ignores_past: true,
            ..Constraints::default()
        };
        Self {
            constraints: Arc::new(constraints),
            ..self.clone()
        }
    }

    /// Returns the deadlines of [`Task::with_deadlines`], in their order, each with its condition.
    pub fn deadlines(&self) -> impl Iterator<Item = (&Rational, &Condition)> {
        let hard = self
            .constraints
            .hard
            .iter()
            .filter(|_| self.constraints.ignores_past);
        hard.filter_map(|constraint| match constraint {
            Modal::Within(deadline, condition) => Some((deadline, condition)),
            _ => None,
        })
    }

    /// Returns the task with a separate entry for each timed initial in [`timed`](Self::timed),
    /// including those at the same time.
    #[must_use]
    pub fn with_separate_timed_initials(&self) -> Self {
        let mut task = self.clone();
        let apart = self.timed.iter().flat_map(|group| {
            group.changes.iter().map(|change| TimedHappening {
                time: group.time.clone(),
                changes: vec![change.clone()],
            })
        });
        task.timed = apart.collect();
        task
    }

    /// Returns the task with its timed initials at other times, by their position in
    /// [`timed`](Self::timed), and with other initial values of some fluents. The lifted
    /// [`problem`](Self::problem) does not change.
    #[must_use]
    pub fn with_numbers(
        &self,
        times: &[Rational],
        values: impl IntoIterator<Item = (FluentId, Rational)>,
    ) -> Self {
        let mut task = self.clone();
        task.initial.values.extend(values);
        let mut by_time: BTreeMap<&Rational, Vec<Change>> = BTreeMap::new();
        for (timed, time) in self.timed.iter().zip(times) {
            let changes = by_time.entry(time).or_default();
            changes.extend(timed.changes.iter().cloned());
        }
        let groups = by_time.into_iter().map(|(time, changes)| TimedHappening {
            time: time.clone(),
            changes,
        });
        task.timed = groups.collect();
        task
    }

    /// Returns the task with its own table. Numbers of facts and fluents that are mentioned from
    /// now on are not valid for other tasks.
    #[must_use]
    pub fn with_own_table(&self) -> Self {
        Self {
            table: Arc::new(RwLock::new(self.table().clone())),
            ..self.clone()
        }
    }

    /// Returns the table, locked. While the lock is held, no function that locks the table may be
    /// called.
    pub(crate) fn table(&self) -> RwLockReadGuard<'_, Table> {
        // A thread that panicked may at most have omitted its addition, so the table is consistent.
        self.table.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Calls `ground`, which may enter facts and fluents into the table. The table is locked
    /// meanwhile.
    pub(crate) fn grounding<T>(&self, ground: impl FnOnce(&mut Grounder<'_>) -> T) -> T {
        let mut table = self.table.write().unwrap_or_else(PoisonError::into_inner);
        let rules = &self.rules_of_predicate;
        ground(&mut Grounder::new(
            &self.problem,
            &self.domains,
            rules,
            &mut table,
        ))
    }

    /// Returns the rules of all derived facts in the table, closed under the facts that their
    /// bodies mention.
    pub fn rules(&self) -> Arc<Rules> {
        Arc::clone(self.table().rules())
    }

    /// Returns the sorted rules of derived facts; `None` if a fact depends on its own negation.
    pub fn derivation(&self) -> Option<Derivation> {
        if self.problem.rules.is_empty() {
            return Some(Derivation::default());
        }
        self.table().derivation()
    }

    /// Returns `true` if rules define the fact.
    pub fn is_derived(&self, fact: FactId) -> bool {
        // Fast path: most problems have no rules.
        if self.problem.rules.is_empty() {
            return false;
        }
        let predicate = self.table().atom(fact).0;
        self.problem.predicates[predicate.index()].is_derived
    }

    /// Returns the number of facts in the table.
    pub fn fact_count(&self) -> usize {
        self.table().fact_count()
    }

    /// Returns the number of fluents in the table.
    pub fn fluent_count(&self) -> usize {
        self.table().fluent_count()
    }

    /// Returns `(predicate object …)`.
    pub fn fact_name(&self, fact: FactId) -> String {
        let table = self.table();
        let (predicate, arguments) = table.atom(fact);
        self.problem.apply_predicate(*predicate, arguments)
    }

    /// Returns `(function object …)`.
    pub fn fluent_name(&self, fluent: FluentId) -> String {
        let table = self.table();
        let (function, arguments) = table.application(fluent);
        self.problem
            .apply_name(&self.problem.functions[function.index()].name, arguments)
    }

    /// Returns the function of a fluent.
    pub fn function_of(&self, fluent: FluentId) -> FunctionId {
        self.table().application(fluent).0
    }

    /// Returns the predicate and the objects of a fact.
    pub fn atom(&self, fact: FactId) -> (PredicateId, Vec<ObjectId>) {
        self.table().atom(fact).clone()
    }

    /// Returns the function and the objects of a fluent.
    pub fn application(&self, fluent: FluentId) -> (FunctionId, Vec<ObjectId>) {
        self.table().application(fluent).clone()
    }

    /// Returns the fluent, if it is in the table.
    pub fn find_fluent(&self, function: FunctionId, arguments: &[ObjectId]) -> Option<FluentId> {
        self.table().find_fluent(function, arguments)
    }

    /// Returns the fact, if it is in the table.
    pub fn find_fact(&self, predicate: PredicateId, arguments: &[ObjectId]) -> Option<FactId> {
        self.table().find_fact(predicate, arguments)
    }

    /// Returns `(name arg …)` of an action.
    pub fn action_name(&self, schema: SchemaId, arguments: &[ObjectId]) -> String {
        self.problem
            .apply_name(&self.problem.schemas[schema.index()].name, arguments)
    }
}

fn rules_of_predicate(problem: &Problem) -> Vec<Vec<usize>> {
    let mut positions = vec![Vec::new(); problem.predicates.len()];
    for (position, rule) in problem.rules.iter().enumerate() {
        positions[rule.predicate.index()].push(position);
    }
    positions
}
