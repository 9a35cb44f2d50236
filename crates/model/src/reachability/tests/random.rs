//! Small random problems, each determined by a sequence of choices.

use elbowroom_num::Rational;

use crate::problem::{
    Atom, Body, Change, Comparison, Condition, ContinuousEffect, DurationConstraint, Effect,
    Expression, Fluent, Function, FunctionId, Guard, Object, ObjectId, Predicate, PredicateId,
    Problem, Rule, Schema, Term, TimedChange, TimedInitial, Type, TypeId, UpdateOperator, Variable,
};

/// Builds the problem from the choices. Missing choices are 0.
pub(super) fn problem(choices: &[u8]) -> Problem {
    let mut chooser = Chooser {
        choices: choices.iter(),
        signatures: Vec::new(),
        function_arities: vec![0, 1],
        derived: 0,
    };
    chooser.problem()
}

struct Chooser<'c> {
    choices: std::slice::Iter<'c, u8>,
    /// Number of arguments of each predicate.
    signatures: Vec<usize>,
    function_arities: Vec<usize>,
    /// Number of derived predicates, which come last.
    derived: usize,
}

impl Chooser<'_> {
    fn below(&mut self, bound: usize) -> usize {
        usize::from(self.choices.next().copied().unwrap_or(0)) % bound.max(1)
    }

    fn one_in(&mut self, count: usize) -> bool {
        self.below(count) == count - 1
    }

    fn some<T>(&mut self, most: usize, mut make: impl FnMut(&mut Self) -> T) -> Vec<T> {
        let count = self.below(most + 1);
        (0..count).map(|_| make(self)).collect()
    }

    fn problem(&mut self) -> Problem {
        let object_count = 1 + self.below(4);
        let objects = (0..object_count)
            .map(|index| Object {
                name: format!("o{index}"),
                types: match self.below(4) {
                    0 => vec![TypeId(1)],
                    1 => vec![TypeId(2)],
                    2 => vec![TypeId(0)],
                    _ => vec![TypeId(2), TypeId(3)],
                },
            })
            .collect();
        self.signatures = vec![1, 2, 0, 1, 2, 1];
        self.derived = 2;
        let predicates = (self.signatures.iter().enumerate())
            .map(|(index, &arity)| Predicate {
                name: format!("p{index}"),
                parameters: anything(arity),
                is_derived: index >= self.signatures.len() - self.derived,
            })
            .collect();
        let functions = (self.function_arities.iter().enumerate())
            .map(|(index, &arity)| Function {
                name: format!("f{index}"),
                parameters: anything(arity),
            })
            .collect();
        let named = |name: &str, parents: &[u32]| Type {
            name: name.into(),
            parents: parents.iter().map(|&parent| TypeId(parent)).collect(),
        };
        Problem {
            types: vec![
                named("object", &[]),
                named("t1", &[0]),
                named("t2", &[1]),
                named("t3", &[0]),
            ],
            objects,
            predicates,
            functions,
            initial_facts: self.some(16, |c| c.ground_basic(object_count)),
            initial_values: self.some(3, |c| {
                let function = c.below(2);
                let arguments = c.objects(function, object_count);
                (FunctionId::from(function), arguments, c.number())
            }),
            timed: self.some(2, |c| c.timed(object_count)),
            schemas: (0..=self.below(4))
                .map(|index| self.schema(index))
                .collect(),
            rules: self.some(3, Self::rule),
            goal: self.condition(0, 2),
            ..Problem::default()
        }
    }

    fn number(&mut self) -> Rational {
        Rational::from(i64::try_from(self.below(4)).unwrap() - 1)
    }

    fn objects(&mut self, count: usize, object_count: usize) -> Vec<ObjectId> {
        (0..count)
            .map(|_| ObjectId::from(self.below(object_count)))
            .collect()
    }

    fn ground_basic(&mut self, object_count: usize) -> (PredicateId, Vec<ObjectId>) {
        let predicate = self.below(self.signatures.len() - self.derived);
        let arguments = self.objects(self.signatures[predicate], object_count);
        (PredicateId::from(predicate), arguments)
    }

    fn timed(&mut self, object_count: usize) -> TimedInitial {
        let change = match self.below(3) {
            0 => {
                let (predicate, arguments) = self.ground_basic(object_count);
                TimedChange::Add(predicate, arguments)
            }
            1 => {
                let (predicate, arguments) = self.ground_basic(object_count);
                TimedChange::Delete(predicate, arguments)
            }
            _ => TimedChange::Assign(FunctionId(0), Vec::new(), self.number()),
        };
        TimedInitial {
            time: Rational::ONE,
            change,
        }
    }

    fn variables(&mut self, most: usize) -> Vec<Variable> {
        self.some(most, |c| Variable {
            name: "?v".into(),
            types: match c.below(5) {
                0 => vec![TypeId(1)],
                1 => vec![TypeId(2)],
                2 => vec![TypeId(2), TypeId(3)],
                _ => vec![TypeId(0)],
            },
        })
    }

    fn rule(&mut self) -> Rule {
        let basic = self.signatures.len() - self.derived;
        let predicate = basic + self.below(self.derived);
        let parameters = anything(self.signatures[predicate]);
        Rule {
            predicate: PredicateId::from(predicate),
            body: self.conjunction(parameters.len()),
            parameters,
        }
    }

    fn schema(&mut self, index: usize) -> Schema {
        let parameters = self.variables(3);
        let scope = parameters.len();
        let body = if self.one_in(3) {
            Body::Instantaneous {
                condition: self.conjunction(scope),
                effects: self.some(4, |c| c.effect(scope, false)),
            }
        } else {
            Body::Durative {
                duration: self.some(2, |c| DurationConstraint {
                    comparison: [Comparison::Equal, Comparison::AtMost, Comparison::AtLeast]
                        [c.below(3)],
                    bound: c.expression(scope),
                    at_end: c.one_in(4),
                }),
                at_start: self.conjunction(scope),
                over_all: self.conjunction(scope),
                at_end: self.condition(scope, 1),
                start_effects: self.some(3, |c| c.effect(scope, false)),
                end_effects: self.some(3, |c| c.effect(scope, true)),
                continuous: self.some(1, |c| ContinuousEffect {
                    variables: Vec::new(),
                    guard: Guard::default(),
                    fluent: c.fluent(scope),
                    rate: c.expression(scope),
                }),
            }
        };
        Schema {
            name: format!("a{index}"),
            parameters,
            unknowns: Vec::new(),
            body,
        }
    }

    fn effect(&mut self, scope: usize, at_end: bool) -> Effect {
        let variables = if self.one_in(3) {
            self.variables(1)
        } else {
            Vec::new()
        };
        let scope = scope + variables.len();
        let mut guard = Guard::default();
        if self.one_in(3) {
            guard.now = self.condition(scope, 1);
        }
        if at_end && self.one_in(4) {
            guard.at_start = self.condition(scope, 1);
        }
        let change = match self.below(5) {
            0 | 1 => Change::Add(self.basic_atom(scope)),
            2 | 3 => Change::Delete(self.basic_atom(scope)),
            _ => Change::Update {
                operator: UpdateOperator::Assign,
                fluent: self.fluent(scope),
                value: self.expression(scope),
            },
        };
        Effect {
            variables,
            guard,
            change,
        }
    }

    fn terms(&mut self, count: usize, scope: usize) -> Vec<Term> {
        (0..count).map(|_| self.term(scope)).collect()
    }

    fn term(&mut self, scope: usize) -> Term {
        if scope == 0 || self.one_in(8) {
            Term::Object(ObjectId(0))
        } else {
            Term::Variable(self.below(scope))
        }
    }

    fn basic_atom(&mut self, scope: usize) -> Atom {
        let predicate = self.below(self.signatures.len() - self.derived);
        self.atom_of(predicate, scope)
    }

    fn atom_of(&mut self, predicate: usize, scope: usize) -> Atom {
        Atom {
            predicate: PredicateId::from(predicate),
            arguments: self.terms(self.signatures[predicate], scope),
        }
    }

    fn fluent(&mut self, scope: usize) -> Fluent {
        let function = self.below(2);
        Fluent {
            function: FunctionId::from(function),
            arguments: self.terms(self.function_arities[function], scope),
        }
    }

    fn expression(&mut self, scope: usize) -> Expression {
        match self.below(4) {
            0 | 1 => Expression::Constant(self.number()),
            2 => Expression::Fluent(self.fluent(scope)),
            _ => Expression::Add(vec![
                Expression::Fluent(self.fluent(scope)),
                Expression::Constant(self.number()),
            ]),
        }
    }

    /// Generates a conjunction, mostly of atoms, as in real problems.
    fn conjunction(&mut self, scope: usize) -> Condition {
        Condition::And(self.some(3, |c| {
            if c.one_in(4) {
                c.condition(scope, 2)
            } else {
                let predicate = c.below(c.signatures.len());
                Condition::Atom(c.atom_of(predicate, scope))
            }
        }))
    }

    fn condition(&mut self, scope: usize, depth: usize) -> Condition {
        let leaf = depth == 0;
        match self.below(if leaf { 5 } else { 12 }) {
            0 | 1 => {
                let predicate = self.below(self.signatures.len());
                Condition::Atom(self.atom_of(predicate, scope))
            }
            2 => Condition::Equal(self.term(scope), self.term(scope)),
            3 => Condition::Compare(
                [Comparison::Less, Comparison::Equal, Comparison::AtLeast][self.below(3)],
                self.expression(scope),
                self.expression(scope),
            ),
            4 => {
                let predicate = self.below(self.signatures.len());
                Condition::Not(Box::new(Condition::Atom(self.atom_of(predicate, scope))))
            }
            5 => Condition::Not(Box::new(self.condition(scope, depth - 1))),
            6..=8 => Condition::And(self.some(3, |c| c.condition(scope, depth - 1))),
            9 => Condition::Or(self.some(2, |c| c.condition(scope, depth - 1))),
            10 => {
                let variables = self.variables(2);
                let scope = scope + variables.len();
                Condition::Forall(variables, Box::new(self.condition(scope, depth - 1)))
            }
            _ => {
                let variables = self.variables(2);
                let scope = scope + variables.len();
                Condition::Exists(variables, Box::new(self.condition(scope, depth - 1)))
            }
        }
    }
}

fn anything(count: usize) -> Vec<Variable> {
    let variable = Variable {
        name: "?v".into(),
        types: vec![TypeId::OBJECT],
    };
    vec![variable; count]
}
