//! Numeric expressions.

use elbowroom_model::problem::{Expression, Unknown};
use elbowroom_num::Rational;

use crate::feature::Feature;
use crate::lower::Reader;
use crate::lower::scope::{Scope, position};
use crate::syntax::Node;

/// Placeholder for an expression that is not understood.
pub(super) const WRONG: Expression = Expression::Constant(Rational::ZERO);

/// Returns the number that a word represents, if it looks like a number.
pub(super) fn number(node: &Node) -> Option<Rational> {
    let word = node.word()?;
    let digits = word.trim_start_matches(['-', '+', '.']);
    if !digits.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    word.parse().ok()
}

impl Reader {
    /// Reads a numeric expression.
    pub(super) fn expression(&mut self, node: &Node, scope: &Scope) -> Expression {
        if let Some(word) = node.lower() {
            return self.number_or_name(&word, node, scope);
        }
        let Some((head, operands)) = node.form() else {
            self.report
                .error(node.span, format!("unexpected `{}`", node.quote()))
                .advise("expected a number, `(function argument …)` or `(+ …)`");
            return WRONG;
        };
        match (head.as_ref(), operands) {
            ("+" | "*" | "-" | "/", []) => {
                self.report
                    .error(node.span, format!("`{head}` without operands"));
                WRONG
            }
            ("+", _) => Expression::Add(self.operands(operands, scope)),
            ("*", _) => Expression::Multiply(self.operands(operands, scope)),
            ("-", [operand]) => match self.expression(operand, scope) {
                Expression::Constant(value) => Expression::Constant(-value),
                other => Expression::Negate(Box::new(other)),
            },
            ("-", [first, rest @ ..]) => {
                let first = Box::new(self.expression(first, scope));
                let mut rest = self.operands(rest, scope);
                let subtrahend = match rest.len() {
                    1 => rest.remove(0),
                    _ => Expression::Add(rest),
                };
                Expression::Subtract(first, Box::new(subtrahend))
            }
            ("/", [dividend, divisor]) => {
                let dividend = Box::new(self.expression(dividend, scope));
                let quotient = self.expression(divisor, scope);
                if quotient == Expression::Constant(Rational::ZERO) && !self.report.is_failed() {
                    self.report.error(divisor.span, "division by zero");
                }
                Expression::Divide(dividend, Box::new(quotient))
            }
            ("/", _) => {
                self.report
                    .error(node.span, "`/` takes two operands")
                    .advise("expected `(/ a b)`");
                WRONG
            }
            ("is-violated", _) if scope.has_total_time => self
                .violations(node, operands)
                .map_or(WRONG, Expression::Violations),
            ("total-time", []) => self.number_or_name("total-time", node, scope),
            _ if number(&node.list().unwrap_or_default()[0]).is_some() => {
                self.report
                    .error(node.span, format!("unexpected `{}`", node.quote()))
                    .advise("write a number without parentheses");
                WRONG
            }
            _ => self.fluent(node, scope).map_or(WRONG, Expression::Fluent),
        }
    }

    fn operands(&mut self, operands: &[Node], scope: &Scope) -> Vec<Expression> {
        operands
            .iter()
            .map(|operand| self.expression(operand, scope))
            .collect()
    }

    fn number_or_name(&mut self, word: &str, node: &Node, scope: &Scope) -> Expression {
        if let Some(value) = number(node) {
            return Expression::Constant(value);
        }
        match word {
            "?duration" if scope.has_duration => Expression::Duration,
            "?duration" => {
                self.report
                    .error(node.span, "`?duration` is not allowed here")
                    .advise("it is defined only in durative actions");
                WRONG
            }
            "#t" => {
                self.report
                    .error(node.span, "`#t` is not allowed here")
                    .advise(
                        "it is defined only in effects of processes, and in continuous effects of \
                         durative actions outside of `at start` and `at end`",
                    );
                WRONG
            }
            "total-time" if scope.has_total_time && !self.names.functions.contains_key(word) => {
                Expression::TotalTime
            }
            _ if word.starts_with('?') => self.unknown(word, node, scope),
            _ => self.fluent(node, scope).map_or(WRONG, Expression::Fluent),
        }
    }

    /// Reads `?name` where a number is expected.
    fn unknown(&mut self, word: &str, node: &Node, scope: &Scope) -> Expression {
        if let Some(unknown) = scope.unknown(word) {
            return Expression::Unknown(unknown);
        }
        if let Some((_, variable)) = scope.variable(word) {
            let asked = variable.name.clone();
            self.report
                .error(node.span, format!("`{asked}` is an object, not a number"))
                .advise("use a function of it, or declare it under `:synth-parameters`");
            return WRONG;
        }
        if let Some(position) = position(&self.problem.unknowns, word) {
            return Expression::Unknown(Unknown::Domain(position));
        }
        self.report
            .error(node.span, format!("unknown number `{word}`"))
            .advise("declare open numbers under `:synth-parameters`");
        WRONG
    }

    /// Reads a number that can be computed without a state: `3`, `(- 3)`, `(/ 1 3)`.
    pub(super) fn constant(&mut self, node: &Node) -> Rational {
        let expression = self.expression(node, &Scope::default());
        value(&expression).unwrap_or_else(|| {
            self.report
                .error(node.span, format!("`{}` is not a constant", node.quote()))
                .advise("expected a number");
            Rational::ZERO
        })
    }

    /// Refuses an expression that is not linear in `#t`.
    pub(super) fn refuse_nonlinear(&mut self, node: &Node) {
        self.report
            .unsupported(
                Feature::NonlinearTime,
                node.span,
                format!("`{}` is not linear in `#t`", node.quote()),
            )
            .advise("write `(* #t rate)`; the rate may depend on fluents");
    }
}

/// Returns the value of an expression without fluents and other names.
fn value(expression: &Expression) -> Option<Rational> {
    expression.evaluate(&mut |_| None)
}
