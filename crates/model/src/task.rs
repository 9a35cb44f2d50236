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

/// A problem, and the ground facts and fluents met so far.
///
/// Facts and fluents enter a table when something mentions them, so that a plan can be judged
/// without grounding the whole problem. The table only grows, and clones share it, as do
/// [`Task::beginning_at`] and [`Situation::rest_of_task`](crate::Situation::rest_of_task): a fact
/// has one number in all of them, whoever mentions it first. Numbers follow the order of first
/// mention; where threads mention facts in no fixed order, each needs a table of its own
/// ([`Task::with_own_table`]) for results to be the same each time.
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
    /// The task of a problem: its initial state, timed happenings and goal, made ground; ε is
    /// 0.001.
    pub fn new(problem: impl Into<Arc<Problem>>) -> Self {
        Self::of(&problem.into(), Arc::default())
    }

    /// The task of a problem that extends this task's: with the same objects, and with further predicates, functions
    /// and actions after its own. Facts and fluents keep their numbers.
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

    /// The lifted problem.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// The default of the least separation of interfering happenings (ε).
    pub fn default_epsilon() -> Rational {
        Rational::new(1, 1000)
    }

    /// The same task with another least separation of interfering happenings (ε); positive, in the
    /// problem's unit of time.
    #[must_use]
    pub fn with_epsilon(mut self, epsilon: Rational) -> Self {
        self.epsilon = epsilon;
        self
    }

    /// The least separation of interfering happenings (ε), in the problem's unit of time. All that
    /// reasons about plans of this task goes by it: the judge, orders, envelopes, planners, runs.
    pub fn epsilon(&self) -> &Rational {
        &self.epsilon
    }

    /// The state at time 0.
    pub fn initial(&self) -> &State {
        &self.initial
    }

    /// The timed initials, one entry per time, by time.
    pub fn timed(&self) -> &[TimedHappening] {
        &self.timed
    }

    /// The goal condition.
    pub fn goal(&self) -> &Condition {
        &self.goal
    }

    /// The constraints on the course of a plan, and the preferences about it, those of the goal
    /// among them.
    pub fn constraints(&self) -> &Constraints {
        &self.constraints
    }

    /// The processes and events, which happen without a plan.
    pub fn autonomous(&self) -> &Autonomous {
        &self.autonomous
    }

    /// The part of the problem, if there is one, that nobody heeds but the judge, and envelopes as
    /// far as they say so. All who find, change or carry out plans must refuse it.
    pub fn left_to_the_judge(&self) -> Option<&'static str> {
        if !self.autonomous.is_empty() {
            return Some("processes and events (PDDL+)");
        }
        (!self.problem.controls.is_empty()).then_some(CONTROLS)
    }

    /// The part of the problem, if there is one, that decides whether a plan is valid and that
    /// only the judge heeds, or networks and planners too. Those who do not must refuse it.
    pub fn only_judged(&self) -> Option<&'static str> {
        if let Some(feature) = self.left_to_the_judge() {
            return Some(feature);
        }
        (!self.constraints.hard.is_empty()).then_some(CONSTRAINTS)
    }

    /// The part of the problem, if there is one, that decides whether a plan is valid and that the
    /// boxes of a network given as such do not heed. Where there are processes and events, they heed
    /// constraints, too, as far as they say so.
    pub fn beyond_boxes(&self) -> Option<&'static str> {
        if !self.problem.controls.is_empty() {
            return Some(CONTROLS);
        }
        let are_heeded = self.constraints.hard.is_empty() || !self.autonomous.is_empty();
        (!are_heeded).then_some(CONSTRAINTS)
    }

    /// The same task with another goal. Facts and fluents keep their numbers.
    #[must_use]
    pub fn with_goal(&self, goal: problem::Condition) -> Self {
        let mut task = self.clone();
        task.goal = self.grounding(|grounder| grounder.ground_condition(&goal, &mut Vec::new()));
        let mut problem = (*self.problem).clone();
        problem.goal = goal;
        task.problem = Arc::new(problem);
        task
    }

    /// The same task with deadlines, on its clock: each condition holds at some moment between the beginning
    /// of a plan and the deadline. Unlike for constraints of the problem, states before the plan do not matter.
    /// Returns `None` if the task has constraints or preferences of its own.
    #[must_use]
    pub fn with_deadlines<'c>(
        &self,
        deadlines: impl IntoIterator<Item = (Rational, &'c problem::Condition)>,
    ) -> Option<Self> {
        if !self.constraints.is_empty() && !self.constraints.begin_now {
            return None;
        }
        let ground = |condition| {
            self.grounding(|grounder| grounder.ground_condition(condition, &mut Vec::new()))
        };
        let deadlines = deadlines.into_iter();
        Some(self.with_ground_deadlines(deadlines.map(|(deadline, it)| (deadline, ground(it)))))
    }

    /// The same task with these deadlines in place of its constraints, as [`Task::with_deadlines`].
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
            begin_now: true,
            ..Constraints::default()
        };
        Self {
            constraints: Arc::new(constraints),
            ..self.clone()
        }
    }

    /// The deadlines of [`Task::with_deadlines`], in their order, each with its condition.
    pub fn deadlines(&self) -> impl Iterator<Item = (&Rational, &Condition)> {
        let hard = self
            .constraints
            .hard
            .iter()
            .filter(|_| self.constraints.begin_now);
        hard.filter_map(|constraint| match constraint {
            Modal::Within(deadline, condition) => Some((deadline, condition)),
            _ => None,
        })
    }

    /// The same task with each timed initial in an entry of its own in [`timed`](Self::timed), so that
    /// those of one time can be told apart.
    #[must_use]
    pub fn with_timed_apart(&self) -> Self {
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

    /// The same task with its timed initials at other times, by their position in
    /// [`timed`](Self::timed), and with other initial values of some fluents. The lifted
    /// [`problem`](Self::problem) stays as it is.
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

    /// The same task with a table of its own, in which what is mentioned from now on gets numbers
    /// that mean nothing elsewhere.
    #[must_use]
    pub fn with_own_table(&self) -> Self {
        Self {
            table: Arc::new(RwLock::new(self.table().clone())),
            ..self.clone()
        }
    }

    /// The table. Nothing that may want it, too, may be called while it is held.
    pub(crate) fn table(&self) -> RwLockReadGuard<'_, Table> {
        // Whoever panicked has at most left out what it was about to add.
        self.table.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Grounds something, which may enter facts and fluents into the table. The table is held
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

    /// The rules of all derived facts in the table, closed under what their bodies mention.
    pub fn rules(&self) -> Arc<Rules> {
        Arc::clone(self.table().rules())
    }

    /// How derived facts follow from basic ones; `None` if one depends on its own negation.
    pub fn derivation(&self) -> Option<Derivation> {
        if self.problem.rules.is_empty() {
            return Some(Derivation::default());
        }
        self.table().derivation()
    }

    /// Whether rules define the fact.
    pub fn is_derived(&self, fact: FactId) -> bool {
        // Most problems have no rules, and this is asked often.
        if self.problem.rules.is_empty() {
            return false;
        }
        let predicate = self.table().atom(fact).0;
        self.problem.predicates[predicate.index()].is_derived
    }

    /// The number of facts that are in the table.
    pub fn fact_count(&self) -> usize {
        self.table().fact_count()
    }

    /// The number of fluents that are in the table.
    pub fn fluent_count(&self) -> usize {
        self.table().fluent_count()
    }

    /// `(predicate object …)`.
    pub fn fact_name(&self, fact: FactId) -> String {
        let table = self.table();
        let (predicate, arguments) = table.atom(fact);
        self.problem.apply_predicate(*predicate, arguments)
    }

    /// `(function object …)`.
    pub fn fluent_name(&self, fluent: FluentId) -> String {
        let table = self.table();
        let (function, arguments) = table.application(fluent);
        self.problem
            .apply_name(&self.problem.functions[function.index()].name, arguments)
    }

    /// The function whose value for some objects the fluent is.
    pub fn function_of(&self, fluent: FluentId) -> FunctionId {
        self.table().application(fluent).0
    }

    /// The predicate and the objects of a fact.
    pub fn atom(&self, fact: FactId) -> (PredicateId, Vec<ObjectId>) {
        self.table().atom(fact).clone()
    }

    /// The function and the objects of a fluent.
    pub fn application(&self, fluent: FluentId) -> (FunctionId, Vec<ObjectId>) {
        self.table().application(fluent).clone()
    }

    /// The fluent in the table, if something has mentioned it.
    pub fn find_fluent(&self, function: FunctionId, arguments: &[ObjectId]) -> Option<FluentId> {
        self.table().find_fluent(function, arguments)
    }

    /// The fact in the table, if something has mentioned it.
    pub fn find_fact(&self, predicate: PredicateId, arguments: &[ObjectId]) -> Option<FactId> {
        self.table().find_fact(predicate, arguments)
    }

    /// `(name arg …)` of an action.
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
