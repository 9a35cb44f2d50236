//! The lifted problem: contents of a domain and a problem file, with names resolved to ids.
//!
//! Variables are numbered by position: an action's parameters come first, then the variables of
//! each enclosing quantifier, outermost first. A [`Term::Variable`] is an index into that list.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_num::Rational;

use crate::pattern::ActionPattern;

pub use crate::autonomous::{Event, Process};
pub use crate::constraint::{ActionPreference, Constraint, Modal};
pub use crate::expression::{Comparison, Unknown};

/// Declares an index into one of [`Problem`]'s lists.
macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);

        impl $name {
            /// Returns the position in the list.
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }

        impl From<usize> for $name {
            fn from(index: usize) -> Self {
                Self(u32::try_from(index).expect("fewer than 2^32 entries"))
            }
        }
    };
}

id! {
    /// An entry of [`Problem::types`].
    TypeId
}
id! {
    /// An entry of [`Problem::objects`].
    ObjectId
}
id! {
    /// An entry of [`Problem::predicates`].
    PredicateId
}
id! {
    /// An entry of [`Problem::functions`].
    FunctionId
}
id! {
    /// An entry of [`Problem::schemas`].
    SchemaId
}
id! {
    /// An entry of [`Problem::preferences`].
    PreferenceId
}

impl TypeId {
    /// The type of everything, `object`: always the first of [`Problem::types`].
    pub const OBJECT: Self = Self(0);
}

/// A planning problem, domain included.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Problem {
    /// The domain's name.
    pub domain: String,
    /// The problem's name.
    pub name: String,
    /// All types; the first is `object`.
    pub types: Vec<Type>,
    /// The domain's constants, then the problem's objects.
    pub objects: Vec<Object>,
    /// Number of constants of the domain among the objects.
    pub constants: usize,
    /// Basic and derived predicates. `=` is not among them, see [`Condition::Equal`].
    pub predicates: Vec<Predicate>,
    /// Predicates that represent functions whose values are objects (PDDL 3.1). The last argument
    /// is the value.
    pub object_functions: Vec<PredicateId>,
    /// Numeric functions.
    pub functions: Vec<Function>,
    /// Instantaneous and durative actions.
    pub schemas: Vec<Schema>,
    /// By action: the positions of its `:control` parameters among its unknowns. A plan chooses
    /// these numbers, one for each instance.
    pub controls: BTreeMap<SchemaId, Vec<u32>>,
    /// Processes: continuous changes while a condition holds (PDDL+).
    pub processes: Vec<Process>,
    /// Events: they happen as soon as a condition holds (PDDL+).
    pub events: Vec<Event>,
    /// The rules of derived predicates; several may share a head.
    pub rules: Vec<Rule>,
    /// `:synth-parameters` of the domain. Each is one unknown for the whole domain.
    pub unknowns: Vec<String>,
    /// The facts that hold at time 0.
    pub initial_facts: Vec<(PredicateId, Vec<ObjectId>)>,
    /// The numbers at time 0; a function value not listed is undefined.
    pub initial_values: Vec<(FunctionId, Vec<ObjectId>, Rational)>,
    /// Timed initial literals and fluents, as written (not sorted).
    pub timed: Vec<TimedInitial>,
    /// The goal condition.
    pub goal: Condition,
    /// Names of all preferences. Those without a name are called `anonymous`.
    pub preferences: Vec<String>,
    /// Trajectory constraints: the domain's, then the goal's preferences, then the
    /// problem's.
    pub constraints: Vec<Constraint>,
    /// Number of constraints of the domain among the constraints.
    pub domain_constraints: usize,
    /// The preferences among the conditions of actions.
    pub action_preferences: Vec<ActionPreference>,
    /// The metric to optimize. It has no influence on validity.
    pub metric: Option<Metric>,
    /// Expected durations in place of those that the domain fixes; none in a problem as written.
    pub expected_durations: ExpectedDurations,
}

/// The rules for expected durations. The last rule that matches an action applies.
///
/// They concern actions whose duration the domain fixes by a single `(= ?duration …)` at the start, and that do not
/// read it before their end. A range of durations is a constraint, from which plans choose, so it stays as it is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExpectedDurations {
    /// The rules.
    pub rules: Vec<ExpectedDuration>,
    /// The schemas whose duration bounds already have the expected values.
    pub is_included: BTreeSet<SchemaId>,
}

/// An expected duration: a multiple of the domain's duration, plus a number of seconds.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpectedDuration {
    /// The actions.
    pub actions: ActionPattern,
    /// The multiple of the domain's duration; not negative.
    pub factor: Rational,
    /// The added number of seconds; not negative.
    pub seconds: Rational,
}

/// A type and its direct supertypes (none for `object`; several for `either`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Type {
    /// The name, in lower case.
    pub name: String,
    /// Direct supertypes.
    pub parents: Vec<TypeId>,
}

/// A constant or object. Names keep the case of their declaration; they compare without case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// The name as declared.
    pub name: String,
    /// Its types; more than one for `either`.
    pub types: Vec<TypeId>,
}

/// A variable with the types it ranges over (the union, for `either`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variable {
    /// The name with its question mark.
    pub name: String,
    /// The union of these types.
    pub types: Vec<TypeId>,
}

/// A predicate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Predicate {
    /// The name, in lower case.
    pub name: String,
    /// Argument types.
    pub parameters: Vec<Variable>,
    /// `true` if rules define it. Effects must not change it then.
    pub is_derived: bool,
}

/// A numeric function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Function {
    /// The name, in lower case.
    pub name: String,
    /// Argument types.
    pub parameters: Vec<Variable>,
}

/// An argument: a variable or an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Term {
    /// See the module's documentation for the numbering.
    Variable(usize),
    /// A constant or object.
    Object(ObjectId),
}

/// A predicate applied to terms.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Atom {
    /// The predicate.
    pub predicate: PredicateId,
    /// The arguments, one for each parameter of the predicate.
    pub arguments: Vec<Term>,
}

/// A function applied to terms.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fluent {
    /// The function.
    pub function: FunctionId,
    /// The arguments, one for each parameter of the function.
    pub arguments: Vec<Term>,
}

/// A condition on a state. The empty conjunction is true, the empty disjunction false.
#[derive(Clone, Debug, PartialEq)]
pub enum Condition {
    /// The fact is true.
    Atom(Atom),
    /// Both terms denote the same object.
    Equal(Term, Term),
    /// A comparison of numbers.
    Compare(Comparison, Expression, Expression),
    /// Not.
    Not(Box<Condition>),
    /// All of them.
    And(Vec<Condition>),
    /// At least one of them.
    Or(Vec<Condition>),
    /// For all objects of the variables' types.
    Forall(Vec<Variable>, Box<Condition>),
    /// For some objects of the variables' types.
    Exists(Vec<Variable>, Box<Condition>),
}

impl Condition {
    /// The condition that always holds.
    pub const TRUE: Self = Self::And(Vec::new());

    /// Returns `true` if this is the empty conjunction.
    pub fn is_trivial(&self) -> bool {
        matches!(self, Self::And(parts) if parts.is_empty())
    }
}

impl Default for Condition {
    fn default() -> Self {
        Self::TRUE
    }
}

/// A numeric expression.
pub type Expression = crate::expression::Expression<Fluent>;

/// An action schema.
#[derive(Clone, Debug, PartialEq)]
pub struct Schema {
    /// The name, in lower case.
    pub name: String,
    /// The parameters.
    pub parameters: Vec<Variable>,
    /// `:synth-parameters` of the action. Each is one unknown per instance.
    pub unknowns: Vec<String>,
    /// Its conditions and effects.
    pub body: Body,
}

/// The part of an action that depends on whether it takes time.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// `:action`
    Instantaneous {
        /// Condition on arrival.
        condition: Condition,
        /// Effects.
        effects: Vec<Effect>,
    },
    /// `:durative-action`
    Durative {
        /// Constraints on the duration. All have to hold; without any, all durations `>= 0` are
        /// allowed.
        duration: Vec<DurationConstraint>,
        /// Condition on arrival at the start.
        at_start: Condition,
        /// Condition at every moment of the open interval between start and end.
        over_all: Condition,
        /// Condition on arrival at the end.
        at_end: Condition,
        /// Effects at the start. Their guards have only the part `now`.
        start_effects: Vec<Effect>,
        /// Effects at the end.
        end_effects: Vec<Effect>,
        /// Continuous changes while the action runs.
        continuous: Vec<ContinuousEffect>,
    },
}

/// `?duration comparison bound`.
#[derive(Clone, Debug, PartialEq)]
pub struct DurationConstraint {
    /// Comparison operator: `=`, `<=` or `>=`.
    pub comparison: Comparison,
    /// The bound; may depend on fluents.
    pub bound: Expression,
    /// `true` if the bound reads the state on arrival at the end (`at end`), not at the start.
    pub at_end: bool,
}

/// An effect with its quantifiers and conditions.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// Variables of the enclosing `forall`s: the effect happens for all of their objects.
    pub variables: Vec<Variable>,
    /// Condition of the effect.
    pub guard: Guard,
    /// The change.
    pub change: Change,
}

/// The condition of a conditional effect (`when`), by the moment at which its parts are read.
/// All three must hold; unconditional effects have three trivial parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Guard {
    /// Read on arrival at the action's start, remembered until the end. End effects only.
    pub at_start: Condition,
    /// Must hold throughout the action. End effects only.
    pub over_all: Condition,
    /// Read on arrival at the effect's own moment.
    pub now: Condition,
}

/// The change that an effect makes.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// The fact becomes true. Wins over a deletion by the same happening.
    Add(Atom),
    /// The fact becomes false.
    Delete(Atom),
    /// The fluent changes.
    Update {
        /// The assignment operator.
        operator: UpdateOperator,
        /// The fluent.
        fluent: Fluent,
        /// Operand of the update.
        value: Expression,
    },
}

/// An assignment operator: `assign`, `increase` and their like.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum UpdateOperator {
    /// `:= value`
    Assign,
    /// `+= value`
    Increase,
    /// `-= value`
    Decrease,
    /// `*= value`
    ScaleUp,
    /// `/= value`
    ScaleDown,
}

impl UpdateOperator {
    /// Returns the PDDL keyword.
    pub fn name(self) -> &'static str {
        match self {
            Self::Assign => "assign",
            Self::Increase => "increase",
            Self::Decrease => "decrease",
            Self::ScaleUp => "scale-up",
            Self::ScaleDown => "scale-down",
        }
    }

    /// Returns `true` if two such updates of one fluent may happen at the same time: only increases
    /// and decreases commute.
    pub fn is_additive(self) -> bool {
        matches!(self, Self::Increase | Self::Decrease)
    }
}

/// While the action runs, `d fluent / dt` has the term `rate` (negated for a decrease).
/// PDDL writes it `(increase fluent (* #t rate))`.
#[derive(Clone, Debug, PartialEq)]
pub struct ContinuousEffect {
    /// Variables of the enclosing `forall`s.
    pub variables: Vec<Variable>,
    /// Condition of the effect; only `at_start` and `over_all` can be non-trivial.
    pub guard: Guard,
    /// The fluent.
    pub fluent: Fluent,
    /// Change per unit of time, sign included.
    pub rate: Expression,
}

/// `head` holds whenever `body` does; the head's arguments are the rule's variables 0, 1, ….
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// The derived predicate.
    pub predicate: PredicateId,
    /// The head's arguments.
    pub parameters: Vec<Variable>,
    /// Condition under which it holds.
    pub body: Condition,
}

/// A timed initial literal or fluent.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedInitial {
    /// Time of the change, `> 0`.
    pub time: Rational,
    /// The change; ground, never an increase.
    pub change: TimedChange,
}

/// The change that a timed initial makes.
#[derive(Clone, Debug, PartialEq)]
pub enum TimedChange {
    /// The fact becomes true.
    Add(PredicateId, Vec<ObjectId>),
    /// The fact becomes false.
    Delete(PredicateId, Vec<ObjectId>),
    /// The fluent gets a value.
    Assign(FunctionId, Vec<ObjectId>, Rational),
}

/// The problem's metric.
#[derive(Clone, Debug, PartialEq)]
pub struct Metric {
    /// `true` if greater values are better.
    pub maximize: bool,
    /// The expression to optimize.
    pub expression: Expression,
}

impl Problem {
    /// Returns `true` if `sub` is `of` or one of its descendants.
    pub fn is_subtype(&self, sub: TypeId, of: TypeId) -> bool {
        // The reader guarantees that type graphs are acyclic, so this terminates.
        sub == of
            || of == TypeId::OBJECT
            || self.types[sub.index()]
                .parents
                .iter()
                .any(|&parent| self.is_subtype(parent, of))
    }

    /// Returns `true` if `object` has one of `types`.
    ///
    /// An object declared as `either a b` counts as both, as in VAL.
    pub fn has_type(&self, object: ObjectId, types: &[TypeId]) -> bool {
        self.objects[object.index()]
            .types
            .iter()
            .any(|&own| types.iter().any(|&asked| self.is_subtype(own, asked)))
    }

    /// Returns the objects in the range of a variable, in order of declaration.
    pub fn objects_of<'a>(&'a self, types: &'a [TypeId]) -> impl Iterator<Item = ObjectId> + 'a {
        (0..self.objects.len())
            .map(ObjectId::from)
            .filter(move |&o| self.has_type(o, types))
    }

    /// Returns the object with that name, ignoring case.
    pub fn object(&self, name: &str) -> Option<ObjectId> {
        self.objects
            .iter()
            .position(|o| o.name.eq_ignore_ascii_case(name))
            .map(ObjectId::from)
    }

    /// Returns the schema with that name, ignoring case.
    pub fn schema(&self, name: &str) -> Option<SchemaId> {
        self.schemas
            .iter()
            .position(|s| s.name.eq_ignore_ascii_case(name))
            .map(SchemaId::from)
    }

    /// Returns the predicate with that name, ignoring case.
    pub fn predicate(&self, name: &str) -> Option<PredicateId> {
        self.predicates
            .iter()
            .position(|p| p.name.eq_ignore_ascii_case(name))
            .map(PredicateId::from)
    }

    /// Returns the function with that name, ignoring case.
    pub fn function(&self, name: &str) -> Option<FunctionId> {
        self.functions
            .iter()
            .position(|f| f.name.eq_ignore_ascii_case(name))
            .map(FunctionId::from)
    }

    /// Returns a fact in PDDL notation: `(name arg …)`, or `(= (name arg …) value)` for an object
    /// function.
    pub fn apply_predicate(&self, predicate: PredicateId, arguments: &[ObjectId]) -> String {
        let name = &self.predicates[predicate.index()].name;
        match arguments.split_last() {
            Some((value, arguments)) if self.object_functions.contains(&predicate) => {
                let value = &self.objects[value.index()].name;
                format!("(= {} {value})", self.apply_name(name, arguments))
            }
            _ => self.apply_name(name, arguments),
        }
    }

    /// Returns `(name arg …)`.
    pub fn apply_name(&self, name: &str, arguments: &[ObjectId]) -> String {
        let mut text = format!("({name}");
        for argument in arguments {
            text.push(' ');
            text.push_str(&self.objects[argument.index()].name);
        }
        text.push(')');
        text
    }
}
