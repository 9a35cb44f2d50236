//! A problem with its table of ground facts and fluents.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, OnceLock};

use elbowroom_num::Rational;
use indexmap::Equivalent;

use crate::derivation::{Derivation, GroundRule, Rules, Strata};
use crate::domains::Domains;
use crate::ground::{Change, Condition, FactId, FluentId};
use crate::hash::Set;
use crate::problem::{FunctionId, ObjectId, PredicateId, Problem, SchemaId};

/// A problem, and the ground facts and fluents met so far.
///
/// Facts and fluents enter the table when something mentions them, so that a plan can be judged
/// without grounding the whole problem.
#[derive(Clone, Debug)]
pub struct Task {
    pub(crate) problem: Arc<Problem>,
    pub(crate) domains: Arc<Domains>,
    pub(crate) facts: Set<(PredicateId, Vec<ObjectId>)>,
    pub(crate) fluents: Set<(FunctionId, Vec<ObjectId>)>,
    pub(crate) initial: State,
    pub(crate) timed: Vec<TimedHappening>,
    pub(crate) goal: Condition,
    /// For each predicate, the positions of its rules in the problem.
    pub(crate) rules_of_predicate: Arc<Vec<Vec<usize>>>,
    pub(crate) rules: Rules,
    /// The strata of `rules`, once something has asked for them; inside, `None` if there are none.
    strata: OnceLock<Option<Arc<Strata>>>,
    /// Derived facts whose rules are not in `rules` yet.
    waiting: Vec<FactId>,
    is_grounding_rules: bool,
}

/// The truth of facts and the values of fluents at one moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// What is true, derived facts aside.
    pub facts: BTreeSet<FactId>,
    /// The defined fluents' values.
    pub values: BTreeMap<FluentId, Rational>,
}

/// All timed initials of one time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedHappening {
    /// When they happen.
    pub time: Rational,
    /// What happens: additions, deletions and assignments of constants.
    pub changes: Vec<Change>,
}

/// An action cannot be instantiated as asked.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InstantiateError {
    /// The number of arguments is wrong.
    #[error("`{action}` takes {expected} arguments, not {found}")]
    ArgumentCount {
        /// The action's name.
        action: String,
        /// How many it takes.
        expected: usize,
        /// How many were given.
        found: usize,
    },
    /// An argument is not of the parameter's type.
    #[error("`{object}` cannot stand for {variable} of `{action}`: it is not of type {expected}")]
    ArgumentType {
        /// The action's name.
        action: String,
        /// The parameter.
        variable: String,
        /// The object given.
        object: String,
        /// The type asked for.
        expected: String,
    },
}

impl Task {
    /// The task of a problem: its initial state, timed happenings and goal, made ground.
    pub fn new(problem: impl Into<Arc<Problem>>) -> Self {
        let problem = problem.into();
        let mut task = Self {
            problem: Arc::clone(&problem),
            domains: Arc::new(Domains::of(&problem)),
            facts: Set::default(),
            fluents: Set::default(),
            initial: State::default(),
            timed: Vec::new(),
            goal: Condition::TRUE,
            rules_of_predicate: Arc::new(rules_of_predicate(&problem)),
            rules: Rules::default(),
            strata: OnceLock::new(),
            waiting: Vec::new(),
            is_grounding_rules: false,
        };
        for (predicate, arguments) in &problem.initial_facts {
            let fact = task.fact(*predicate, arguments);
            task.initial.facts.insert(fact);
        }
        for (function, arguments, value) in &problem.initial_values {
            let fluent = task.fluent(*function, arguments);
            task.initial.values.insert(fluent, value.clone());
        }
        task.timed = task.ground_timed();
        task.goal = task.ground_condition(&problem.goal, &mut Vec::new());
        task
    }

    /// The lifted problem.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// The state at time 0.
    pub fn initial(&self) -> &State {
        &self.initial
    }

    /// The timed initials, one entry per time, by time.
    pub fn timed(&self) -> &[TimedHappening] {
        &self.timed
    }

    /// What must hold at the end.
    pub fn goal(&self) -> &Condition {
        &self.goal
    }

    /// The rules of all derived facts in the table, closed under what their bodies mention.
    pub fn rules(&self) -> &[GroundRule] {
        self.rules.as_slice()
    }

    /// The rules whose head is the fact; none for a basic fact.
    pub fn rules_of(&self, fact: FactId) -> &[GroundRule] {
        self.rules.of(fact)
    }

    /// How derived facts follow from basic ones; `None` if one depends on its own negation.
    pub fn derivation(&self) -> Option<Derivation<'_>> {
        let strata = self
            .strata
            .get_or_init(|| Strata::of(&self.rules).map(Arc::new))
            .as_deref()?;
        Some(Derivation::new(&self.rules, strata))
    }

    /// Whether rules define the fact.
    pub fn is_derived(&self, fact: FactId) -> bool {
        let (predicate, _) = self
            .facts
            .get_index(fact.index())
            .expect("a fact of this task");
        self.problem.predicates[predicate.index()].is_derived
    }

    /// How many facts are in the table.
    pub fn fact_count(&self) -> usize {
        self.facts.len()
    }

    /// How many fluents are in the table.
    pub fn fluent_count(&self) -> usize {
        self.fluents.len()
    }

    /// `(predicate object …)`.
    pub fn fact_name(&self, fact: FactId) -> String {
        let (predicate, arguments) = self
            .facts
            .get_index(fact.index())
            .expect("a fact of this task");
        self.problem
            .apply_name(&self.problem.predicates[predicate.index()].name, arguments)
    }

    /// `(function object …)`.
    pub fn fluent_name(&self, fluent: FluentId) -> String {
        let (function, arguments) = self
            .fluents
            .get_index(fluent.index())
            .expect("a fluent of this task");
        self.problem
            .apply_name(&self.problem.functions[function.index()].name, arguments)
    }

    /// The function whose value for some objects the fluent is.
    pub fn function_of(&self, fluent: FluentId) -> FunctionId {
        let (function, _) = self
            .fluents
            .get_index(fluent.index())
            .expect("a fluent of this task");
        *function
    }

    /// The predicate and the objects that make up the fact.
    pub fn atom(&self, fact: FactId) -> (PredicateId, &[ObjectId]) {
        let (predicate, arguments) = self
            .facts
            .get_index(fact.index())
            .expect("a fact of this task");
        (*predicate, arguments)
    }

    /// The fluent in the table, if something has mentioned it.
    pub fn find_fluent(&self, function: FunctionId, arguments: &[ObjectId]) -> Option<FluentId> {
        self.fluents
            .get_index_of(&Key(function, arguments))
            .map(|index| FluentId(narrow(index)))
    }

    /// The fact in the table, if something has mentioned it.
    pub fn find_fact(&self, predicate: PredicateId, arguments: &[ObjectId]) -> Option<FactId> {
        self.facts
            .get_index_of(&Key(predicate, arguments))
            .map(|index| FactId(narrow(index)))
    }

    /// `(name arg …)` of an action.
    pub fn action_name(&self, schema: SchemaId, arguments: &[ObjectId]) -> String {
        self.problem
            .apply_name(&self.problem.schemas[schema.index()].name, arguments)
    }

    pub(crate) fn fact(&mut self, predicate: PredicateId, arguments: &[ObjectId]) -> FactId {
        if let Some(fact) = self.find_fact(predicate, arguments) {
            return fact;
        }
        let (index, _) = self.facts.insert_full((predicate, arguments.to_vec()));
        let fact = FactId(narrow(index));
        if self.problem.predicates[predicate.index()].is_derived {
            self.waiting.push(fact);
            self.ground_waiting_rules();
        }
        fact
    }

    /// Grounds the rules of the derived facts met. Rules mention further derived facts; these wait
    /// for their turn, so that a long chain of rules is no deep recursion.
    fn ground_waiting_rules(&mut self) {
        if std::mem::replace(&mut self.is_grounding_rules, true) {
            return;
        }
        while let Some(fact) = self.waiting.pop() {
            self.ground_rules(fact);
        }
        self.strata.take();
        self.is_grounding_rules = false;
    }

    pub(crate) fn fluent(&mut self, function: FunctionId, arguments: &[ObjectId]) -> FluentId {
        if let Some(fluent) = self.find_fluent(function, arguments) {
            return fluent;
        }
        let (index, _) = self.fluents.insert_full((function, arguments.to_vec()));
        FluentId(narrow(index))
    }
}

fn rules_of_predicate(problem: &Problem) -> Vec<Vec<usize>> {
    let mut positions = vec![Vec::new(); problem.predicates.len()];
    for (position, rule) in problem.rules.iter().enumerate() {
        positions[rule.predicate.index()].push(position);
    }
    positions
}

/// A symbol with its arguments, to look up in a table without a vector of its own.
#[derive(Hash)]
struct Key<'a, S>(S, &'a [ObjectId]);

impl<S: PartialEq> Equivalent<(S, Vec<ObjectId>)> for Key<'_, S> {
    fn equivalent(&self, (symbol, arguments): &(S, Vec<ObjectId>)) -> bool {
        self.0 == *symbol && self.1 == arguments
    }
}

fn narrow(index: usize) -> u32 {
    u32::try_from(index).expect("fewer than 2^32 facts and fluents")
}
