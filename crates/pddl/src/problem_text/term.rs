//! Lifted conditions and expressions as text.

use std::borrow::Cow;

use elbowroom_model::problem::{
    Condition, Constraint, Expression, Term, TypeId, Unknown, Variable,
};

use super::Writer;

/// The names of the variables that are in scope, outermost first.
type Names<'a> = Vec<Cow<'a, str>>;

impl Writer<'_> {
    /// Returns `type`, or `(either type …)`.
    pub(super) fn types(&self, types: &[TypeId]) -> String {
        let name = |id: &TypeId| self.task.problem().types[id.index()].name.as_str();
        match types {
            [] => "object".to_owned(),
            [only] => name(only).to_owned(),
            several => {
                let names: Vec<_> = several.iter().map(name).collect();
                format!("(either {})", names.join(" "))
            }
        }
    }

    /// Returns the condition as text, with variables numbered as in `names`.
    pub(super) fn condition<'a>(&self, condition: &'a Condition, names: &mut Names<'a>) -> String {
        let problem = self.task.problem();
        match condition {
            Condition::Atom(atom) if problem.object_functions.contains(&atom.predicate) => {
                let name = &problem.predicates[atom.predicate.index()].name;
                let whole = self.applied(name, &atom.arguments, names);
                let (application, value) = whole.rsplit_once(' ').unwrap_or((&whole, ")"));
                format!("(= {application}) {value}")
            }
            Condition::Atom(atom) => {
                let name = &problem.predicates[atom.predicate.index()].name;
                self.applied(name, &atom.arguments, names)
            }
            Condition::Equal(left, right) => self.applied("=", &[*left, *right], names),
            Condition::Compare(comparison, left, right) => format!(
                "({} {} {})",
                comparison.symbol(),
                self.expression(left, names),
                self.expression(right, names)
            ),
            Condition::Not(part) => format!("(not {})", self.condition(part, names)),
            Condition::And(parts) => self.joined("and", parts, names),
            Condition::Or(parts) => self.joined("or", parts, names),
            Condition::Forall(variables, part) => self.quantified("forall", variables, part, names),
            Condition::Exists(variables, part) => self.quantified("exists", variables, part, names),
        }
    }

    /// Returns the constraint as text, with variables numbered as in `names`.
    pub(super) fn constraint<'a>(
        &self,
        constraint: &'a Constraint,
        names: &mut Names<'a>,
    ) -> String {
        match constraint {
            Constraint::Modal(modal) => {
                let mut text = format!("({}", modal.name());
                for time in modal.times() {
                    text.push(' ');
                    text.push_str(&self.number(time));
                }
                for condition in modal.conditions() {
                    text.push(' ');
                    text.push_str(&self.condition(condition, names));
                }
                text + ")"
            }
            Constraint::And(parts) => {
                let parts: Vec<_> = parts.iter().map(|p| self.constraint(p, names)).collect();
                format!("(and {})", parts.join(" "))
            }
            Constraint::Forall(variables, part) => {
                let (declared, outside) = self.declared(variables, names);
                let part = self.constraint(part, names);
                names.truncate(outside);
                format!("(forall ({declared}) {part})")
            }
            Constraint::Preference(preference, part) => {
                let name = &self.task.problem().preferences[preference.index()];
                format!("(preference {name} {})", self.constraint(part, names))
            }
        }
    }

    /// Adds variables to the scope. Returns their declaration, and the previous number of names.
    fn declared<'a>(&self, variables: &'a [Variable], names: &mut Names<'a>) -> (String, usize) {
        let outside = names.len();
        let mut declared = Vec::new();
        for variable in variables {
            let name = unused(&variable.name, names);
            declared.push(format!("{name} - {}", self.types(&variable.types)));
            names.push(name);
        }
        (declared.join(" "), outside)
    }

    fn joined<'a>(&self, head: &str, parts: &'a [Condition], names: &mut Names<'a>) -> String {
        let mut text = format!("({head}");
        for part in parts {
            text.push(' ');
            text.push_str(&self.condition(part, names));
        }
        text.push(')');
        text
    }

    fn quantified<'a>(
        &self,
        quantifier: &str,
        variables: &'a [Variable],
        part: &'a Condition,
        names: &mut Names<'a>,
    ) -> String {
        let (declared, outside) = self.declared(variables, names);
        let part = self.condition(part, names);
        names.truncate(outside);
        format!("({quantifier} ({declared}) {part})")
    }

    /// Returns the expression as text, with variables numbered as in `names`.
    pub(super) fn expression(&self, expression: &Expression, names: &Names<'_>) -> String {
        let problem = self.task.problem();
        let two = |operator: &str, left: &Expression, right: &Expression| {
            let [left, right] = [left, right].map(|part| self.expression(part, names));
            format!("({operator} {left} {right})")
        };
        let many = |operator: &str, parts: &[Expression]| {
            let parts: Vec<_> = parts.iter().map(|p| self.expression(p, names)).collect();
            format!("({operator} {})", parts.join(" "))
        };
        match expression {
            Expression::Constant(value) => self.number(value),
            Expression::Fluent(fluent) => {
                let name = &problem.functions[fluent.function.index()].name;
                self.applied(name, &fluent.arguments, names)
            }
            Expression::Duration => "?duration".to_owned(),
            Expression::TotalTime => "(total-time)".to_owned(),
            Expression::Violations(preference) => {
                format!("(is-violated {})", problem.preferences[preference.index()])
            }
            // Outside of actions, only the domain's own unknowns can occur.
            Expression::Unknown(
                Unknown::Domain(place) | Unknown::Action(place) | Unknown::Parameter(place),
            ) => problem
                .unknowns
                .get(*place as usize)
                .cloned()
                .unwrap_or_else(|| format!("?unknown{place}")),
            Expression::Add(parts) => many("+", parts),
            Expression::Multiply(parts) => many("*", parts),
            Expression::Subtract(left, right) => two("-", left, right),
            Expression::Divide(left, right) => two("/", left, right),
            Expression::Negate(part) => format!("(- {})", self.expression(part, names)),
        }
    }

    fn applied(&self, name: &str, arguments: &[Term], names: &Names<'_>) -> String {
        let mut text = format!("({name}");
        for argument in arguments {
            text.push(' ');
            match argument {
                Term::Variable(position) => text.push_str(&names[*position]),
                Term::Object(object) => {
                    text.push_str(&self.task.problem().objects[object.index()].name);
                }
            }
        }
        text.push(')');
        text
    }
}

/// Returns the name, or a similar one if an enclosing quantifier already uses it.
fn unused<'a>(name: &'a str, names: &Names<'_>) -> Cow<'a, str> {
    let is_taken = |name: &str| names.iter().any(|own| own.eq_ignore_ascii_case(name));
    let mut free = Cow::Borrowed(name);
    while is_taken(&free) {
        free.to_mut().push('_');
    }
    free
}
