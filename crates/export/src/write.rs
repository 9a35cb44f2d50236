//! Terms of SMT-LIB.

use elbowroom_envelope::linear::{Factor, Linear};
use elbowroom_envelope::obligations::Inequality;
use elbowroom_num::Rational;

/// The symbols of times, by node, and of parameters.
#[derive(Clone, Debug)]
pub(super) struct Symbols {
    /// Symbols of times: of each node of the plan, and of a moment inside an action.
    pub(super) times: Vec<String>,
    /// Symbols of parameters.
    pub(super) parameters: Vec<String>,
}

impl Symbols {
    /// Returns `left <= right`, with positive factors on both sides.
    pub(super) fn inequality(&self, inequality: &Inequality) -> String {
        let (mut left, mut right) = (Vec::new(), Vec::new());
        let mut term = |coefficient: &Rational, factors: &[&str]| {
            let side = if coefficient.is_negative() {
                &mut right
            } else {
                &mut left
            };
            let mut parts: Vec<String> = factors.iter().map(|&part| part.to_owned()).collect();
            let factor = coefficient.abs();
            if factor != Rational::ONE || parts.is_empty() {
                parts.insert(0, number(&factor));
            }
            side.push(applied("*", &parts));
        };
        let Linear {
            constant,
            times,
            parameters,
            products,
        } = &inequality.expression;
        for (node, coefficient) in times {
            term(coefficient, &[self.times[node.index()].as_str()]);
        }
        for (id, coefficient) in parameters {
            term(coefficient, &[self.parameters[id.index()].as_str()]);
        }
        for ((id, factor), coefficient) in products {
            let other = match factor {
                Factor::Time(node) => &self.times[node.index()],
                Factor::Parameter(other) => &self.parameters[other.index()],
            };
            let own = &self.parameters[id.index()];
            term(coefficient, &[own.as_str(), other.as_str()]);
        }
        if !constant.is_zero() {
            term(constant, &[]);
        }
        let sign = if inequality.is_strict { "<" } else { "<=" };
        let sum = |parts: Vec<String>| applied("+", &parts);
        format!("({sign} {} {})", sum(left), sum(right))
    }
}

/// Applies an operator to terms; a single term is returned unchanged, and no terms are 0.
fn applied(operator: &str, parts: &[String]) -> String {
    match parts.len() {
        0 => "0.0".to_owned(),
        1 => parts.concat(),
        _ => format!("({operator} {})", parts.join(" ")),
    }
}

/// Returns the conjunction.
pub(super) fn all(mut parts: Vec<String>) -> String {
    match parts.len() {
        0 => "true".to_owned(),
        1 => parts.remove(0),
        _ => format!("(and {})", parts.join(" ")),
    }
}

/// Formats a real number.
pub(super) fn number(value: &Rational) -> String {
    let size = value.abs();
    let text = size.to_string();
    let text = match text.split_once('/') {
        Some((numerator, denominator)) => format!("(/ {numerator}.0 {denominator}.0)"),
        None => format!("{text}.0"),
    };
    if value.is_negative() {
        format!("(- {text})")
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use elbowroom_envelope::linear::Linear;
    use elbowroom_envelope::obligations::Inequality;
    use elbowroom_num::Rational;
    use elbowroom_plan::{NodeId, ParameterId};

    use super::{Symbols, number};

    #[test]
    fn numbers_are_written_as_positive_reals() {
        assert_eq!(number(&Rational::new(-7, 2)), "(- (/ 7.0 2.0))");
        assert_eq!(number(&Rational::ZERO), "0.0");
    }

    #[test]
    fn negative_terms_move_to_the_other_side() {
        let symbols = Symbols {
            times: vec!["z".to_owned(), "a".to_owned(), "b".to_owned()],
            parameters: vec!["p".to_owned()],
        };
        let mut expression = Linear::difference(NodeId(1), NodeId(2));
        let parameter = Linear::parameter(ParameterId(0));
        expression.add_scaled(&parameter, &Rational::new(-1, 2));
        expression.constant = Rational::from(-3);
        let inequality = Inequality {
            expression,
            is_strict: true,
        };
        let text = symbols.inequality(&inequality);
        assert_eq!(text, "(< b (+ a (* (/ 1.0 2.0) p) 3.0))");
    }
}
