//! Conditions as rules for joins: `head <- atoms, tests`.

use std::rc::Rc;

use crate::problem::{
    Atom, Body, Condition, DurationConstraint, ObjectId, PredicateId, Schema, SchemaId, Term,
    TypeId, Variable,
};

use super::event::{Event, Symbol};
use super::relaxation::Relaxation;
use super::variables;

/// The head is reachable if, for some binding of the variables, all atoms can be true and all tests
/// are possible.
pub(super) struct Rule<'a> {
    pub(super) head: Head,
    /// Number of parameters of the head among the variables.
    pub(super) parameter_count: usize,
    /// Ranges of the head's parameters, then of the variables of quantifiers.
    pub(super) variables: Vec<Rc<Domain>>,
    pub(super) atoms: Vec<JoinAtom>,
    /// Tests whose result is final as soon as their variables are bound.
    pub(super) static_tests: Vec<Test<'a>>,
    /// Tests that may fail at first and succeed later.
    pub(super) tests: Vec<Test<'a>>,
}

/// The conclusion of a rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Head {
    /// An action can start. If `and_end`, it can also end, and otherwise does not start.
    Start { schema: SchemaId, and_end: bool },
    /// A derived fact can be true.
    Derived(PredicateId),
}

/// The objects that a variable ranges over.
pub(super) struct Domain {
    pub(super) objects: Vec<ObjectId>,
    is_member: Vec<bool>,
}

impl Domain {
    pub(super) fn contains(&self, object: ObjectId) -> bool {
        self.is_member.get(object.index()) == Some(&true)
    }
}

/// An atom over the rule's variables.
#[derive(Clone, Debug)]
pub(super) struct JoinAtom {
    pub(super) predicate: PredicateId,
    pub(super) terms: Vec<Term>,
    /// `true` if no facts of this predicate are reached after time 0.
    pub(super) is_static: bool,
}

/// A condition that is tested instead of joined.
#[derive(Clone)]
pub(super) struct Test<'a> {
    kind: TestKind<'a>,
    /// The rule's variable for each of the condition's free variables, by position.
    scope: Vec<usize>,
    /// Variables of the rule that it reads.
    pub(super) reads: Vec<usize>,
}

#[derive(Clone, Copy)]
enum TestKind<'a> {
    /// The condition, or its negation.
    Condition(&'a Condition, bool),
    /// The constraints; `true` includes those that are read at the end.
    Duration(&'a [DurationConstraint], bool),
}

impl Rule<'_> {
    /// Returns `true` if all non-static tests are possible. Blockers as in
    /// [`Relaxation::is_possible`].
    pub(super) fn are_tests_possible(
        &self,
        relaxation: &Relaxation,
        binding: &[ObjectId],
        scratch: &mut Vec<ObjectId>,
        blockers: &mut Vec<Event>,
    ) -> bool {
        let mut tests = self.tests.iter();
        tests.all(|test| test.is_possible(relaxation, binding, scratch, blockers))
    }
}

impl Test<'_> {
    /// Like [`Relaxation::is_possible`], for a binding of the rule's variables.
    pub(super) fn is_possible(
        &self,
        relaxation: &Relaxation,
        binding: &[ObjectId],
        scratch: &mut Vec<ObjectId>,
        blockers: &mut Vec<Event>,
    ) -> bool {
        scratch.clear();
        scratch.extend(self.scope.iter().map(|&variable| binding[variable]));
        match self.kind {
            TestKind::Condition(condition, wanted) => {
                relaxation.is_possible(condition, wanted, scratch, blockers)
            }
            TestKind::Duration(constraints, with_end) => {
                relaxation.is_duration_possible(constraints, with_end, scratch, blockers)
            }
        }
    }
}

/// Returns all rules of a problem: one or more for each schema and each rule of a derived
/// predicate.
pub(super) fn rules_of<'a>(
    relaxation: &Relaxation<'a>,
    is_start_silent: impl Fn(&Schema) -> bool,
) -> Vec<Rule<'a>> {
    let problem = relaxation.problem;
    let mut rules = Vec::new();
    for (index, schema) in problem.schemas.iter().enumerate() {
        let mut drafts = Drafts::new(relaxation, &schema.parameters);
        let scope = drafts.parameters();
        let mut and_end = true;
        match &schema.body {
            Body::Instantaneous { condition, .. } => drafts.require(condition, true, &scope),
            Body::Durative {
                duration,
                at_start,
                over_all,
                at_end,
                ..
            } => {
                // With a duration of 0, the over-all condition is vacuous.
                let may_be_vacuous =
                    !over_all.is_trivial() && relaxation.can_any_take_no_time(duration);
                and_end = is_start_silent(schema) && !may_be_vacuous;
                drafts.require(at_start, true, &scope);
                drafts.require_duration(duration, and_end, &scope);
                // Static conditions do not depend on the effects of the start.
                drafts.only_static = !and_end;
                if !may_be_vacuous {
                    drafts.require(over_all, true, &scope);
                }
                drafts.require(at_end, true, &scope);
            }
        }
        let schema = SchemaId::from(index);
        rules.extend(drafts.finish(Head::Start { schema, and_end }));
    }
    for rule in &problem.rules {
        let mut drafts = Drafts::new(relaxation, &rule.parameters);
        let scope = drafts.parameters();
        drafts.require(&rule.body, true, &scope);
        rules.extend(drafts.finish(Head::Derived(rule.predicate)));
    }
    rules
}

/// Limit on the alternatives that disjunctions produce; further disjunctions become tests.
const MAX_ALTERNATIVES: usize = 16;

/// Rules under construction from a condition: their disjunction.
struct Drafts<'r, 'a> {
    relaxation: &'r Relaxation<'a>,
    parameter_count: usize,
    alternatives: Vec<Draft<'a>>,
    /// Number of groups of alternatives like the current one.
    groups: usize,
    /// `true` to skip conditions that are not static.
    only_static: bool,
}

#[derive(Clone, Default)]
struct Draft<'a> {
    variables: Vec<Vec<TypeId>>,
    atoms: Vec<JoinAtom>,
    static_tests: Vec<Test<'a>>,
    tests: Vec<Test<'a>>,
}

impl<'r, 'a> Drafts<'r, 'a> {
    fn new(relaxation: &'r Relaxation<'a>, parameters: &[Variable]) -> Self {
        let variables = parameters.iter().map(|v| v.types.clone()).collect();
        Self {
            relaxation,
            parameter_count: parameters.len(),
            alternatives: vec![Draft {
                variables,
                ..Draft::default()
            }],
            groups: 1,
            only_static: false,
        }
    }

    fn parameters(&self) -> Vec<usize> {
        (0..self.parameter_count).collect()
    }

    /// Adds the condition, or its negation, to all alternatives. `scope` holds the rule's variable
    /// for each of the condition's, by position.
    fn require(&mut self, condition: &'a Condition, wanted: bool, scope: &[usize]) {
        match (condition, wanted) {
            (Condition::Not(part), _) => self.require(part, !wanted, scope),
            (Condition::And(parts), true) | (Condition::Or(parts), false) => {
                for part in parts {
                    self.require(part, wanted, scope);
                }
            }
            _ if self.only_static && !self.relaxation.is_static(condition, wanted) => {}
            (Condition::Atom(atom), true) => self.require_atom(atom, scope),
            (Condition::Or(parts), true) | (Condition::And(parts), false)
                if self.groups * self.alternatives.len() * parts.len() <= MAX_ALTERNATIVES =>
            {
                self.split(parts, wanted, scope);
            }
            (Condition::Exists(variables, part), true)
            | (Condition::Forall(variables, part), false)
                if binds_all(part, wanted, scope.len()..scope.len() + variables.len()) =>
            {
                self.require_some(variables, part, wanted, scope);
            }
            _ => self.add_test(TestKind::Condition(condition, wanted), scope),
        }
    }

    fn require_atom(&mut self, atom: &Atom, scope: &[usize]) {
        let terms = atom.arguments.iter().map(|&term| match term {
            Term::Variable(position) => Term::Variable(scope[position]),
            Term::Object(object) => Term::Object(object),
        });
        let symbol = Symbol::True(atom.predicate);
        let atom = JoinAtom {
            predicate: atom.predicate,
            terms: terms.collect(),
            is_static: !self.relaxation.is_written(symbol),
        };
        for draft in &mut self.alternatives {
            draft.atoms.push(atom.clone());
        }
    }

    fn require_duration(
        &mut self,
        constraints: &'a [DurationConstraint],
        with_end: bool,
        scope: &[usize],
    ) {
        if !constraints.is_empty() {
            self.add_test(TestKind::Duration(constraints, with_end), scope);
        }
    }

    fn split(&mut self, parts: &'a [Condition], wanted: bool, scope: &[usize]) {
        let before = std::mem::take(&mut self.alternatives);
        let mut after = Vec::new();
        for part in parts {
            self.alternatives.clone_from(&before);
            self.require(part, wanted, scope);
            after.append(&mut self.alternatives);
        }
        self.alternatives = after;
    }

    /// Requires `part`, or its negation, for some values of the variables.
    fn require_some(
        &mut self,
        variables: &[Variable],
        part: &'a Condition,
        wanted: bool,
        scope: &[usize],
    ) {
        // Alternatives have different numbers of variables, so each one is processed separately.
        let mut after = Vec::new();
        let before = std::mem::take(&mut self.alternatives);
        let groups = self.groups;
        self.groups *= before.len();
        for mut draft in before {
            let first = draft.variables.len();
            let types = variables.iter().map(|variable| variable.types.clone());
            draft.variables.extend(types);
            let mut scope = scope.to_vec();
            scope.extend(first..draft.variables.len());
            self.alternatives = vec![draft];
            self.require(part, wanted, &scope);
            after.append(&mut self.alternatives);
        }
        self.alternatives = after;
        self.groups = groups;
    }

    fn add_test(&mut self, kind: TestKind<'a>, scope: &[usize]) {
        let mut positions = vec![false; scope.len()];
        let is_static = match kind {
            TestKind::Condition(condition, wanted) => {
                variables::of_condition(condition, &mut positions);
                self.relaxation.is_static(condition, wanted)
            }
            TestKind::Duration(constraints, _) => {
                for constraint in constraints {
                    variables::of_expression(&constraint.bound, &mut positions);
                }
                self.relaxation.is_static_duration(constraints)
            }
        };
        let reads = (scope.iter().zip(&positions))
            .filter_map(|(&variable, &is_read)| is_read.then_some(variable))
            .collect();
        let scope = scope.to_vec();
        let test = Test { kind, scope, reads };
        for draft in &mut self.alternatives {
            if is_static {
                draft.static_tests.push(test.clone());
            } else {
                draft.tests.push(test.clone());
            }
        }
    }

    fn finish(self, head: Head) -> impl Iterator<Item = Rule<'a>> {
        let (relaxation, parameter_count) = (self.relaxation, self.parameter_count);
        let alternatives = self.alternatives.into_iter();
        let possible = alternatives.filter(move |draft| {
            // No variable is bound yet, so only tests without variables can be decided.
            let unbound = vec![ObjectId(0); draft.variables.len()];
            draft.static_tests.iter().all(|test| {
                !test.reads.is_empty()
                    || test.is_possible(relaxation, &unbound, &mut Vec::new(), &mut Vec::new())
            })
        });
        possible.map(move |draft| Rule {
            head,
            parameter_count,
            variables: draft
                .variables
                .iter()
                .map(|types| Rc::new(domain(relaxation, types)))
                .collect(),
            atoms: draft.atoms,
            static_tests: draft.static_tests,
            tests: draft.tests,
        })
    }
}

fn domain(relaxation: &Relaxation, types: &[TypeId]) -> Domain {
    let objects = relaxation.domains.objects(types).into_owned();
    let mut is_member = vec![false; relaxation.problem.objects.len()];
    for object in &objects {
        is_member[object.index()] = true;
    }
    Domain { objects, is_member }
}

/// Returns `true` if, for each of these variables, a conjunct of the condition (of its negation if
/// not `wanted`) is an atom that contains it. A join then finds their values; otherwise it would
/// try all objects.
fn binds_all(condition: &Condition, wanted: bool, mut variables: std::ops::Range<usize>) -> bool {
    fn binds(condition: &Condition, wanted: bool, variable: usize) -> bool {
        match (condition, wanted) {
            (Condition::Atom(atom), true) => atom.arguments.contains(&Term::Variable(variable)),
            (Condition::Not(part), _) => binds(part, !wanted, variable),
            (Condition::And(parts), true) | (Condition::Or(parts), false) => {
                parts.iter().any(|part| binds(part, wanted, variable))
            }
            (Condition::Exists(_, part), true) | (Condition::Forall(_, part), false) => {
                binds(part, wanted, variable)
            }
            _ => false,
        }
    }
    variables.all(|variable| binds(condition, wanted, variable))
}
