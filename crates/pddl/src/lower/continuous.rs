//! Rates of continuous change: the expressions with `#t`.

use elbowroom_model::problem::{Expression, UpdateOperator};
use elbowroom_num::Rational;

use crate::lower::Reader;
use crate::lower::scope::Scope;
use crate::syntax::{Kind, Node};

/// `constant + rate * #t`; a part that is missing is zero.
#[derive(Debug, Default)]
struct Linear {
    constant: Option<Expression>,
    rate: Option<Expression>,
}

impl Reader {
    /// Returns the rate of a continuous effect, including its sign. Returns `None`, with a report,
    /// if there is none.
    pub(super) fn rate(
        &mut self,
        value: &Node,
        operator: UpdateOperator,
        effect: &Node,
        scope: &Scope,
    ) -> Option<Expression> {
        if !mentions_time(value) {
            self.expression(value, scope);
            self.missing_moment(effect);
            return None;
        }
        let Linear { constant, rate } = self.linear(value, scope)?;
        if constant.is_some() {
            self.report
                .error(
                    value.span,
                    format!("`{}` is not a rate times `#t`", value.quote()),
                )
                .advise(
                    "write parts that do not depend on `#t` as an effect `at start` or `at end`",
                );
            return None;
        }
        let rate = rate?;
        Some(match (operator, rate) {
            (UpdateOperator::Increase, rate) => rate,
            // Not evaluated even if it is a number, so that the text as written stays visible.
            (_, rate) => Expression::Negate(Box::new(rate)),
        })
    }

    fn linear(&mut self, node: &Node, scope: &Scope) -> Option<Linear> {
        if node.is("#t") {
            return Some(Linear {
                constant: None,
                rate: Some(Expression::Constant(Rational::ONE)),
            });
        }
        if !mentions_time(node) {
            return Some(Linear {
                constant: Some(self.expression(node, scope)),
                rate: None,
            });
        }
        let (head, operands) = node.form().or_else(|| {
            self.expression(node, scope);
            None
        })?;
        let parts: Vec<_> = operands.iter().map(|o| self.linear(o, scope)).collect();
        let parts = parts.into_iter().collect::<Option<Vec<_>>>()?;
        match (head.as_ref(), parts.len()) {
            ("+", _) => Some(sum(parts)),
            ("-", 1) => parts.into_iter().next().map(Linear::negated),
            ("-", _) => {
                let mut parts = parts.into_iter();
                let first = parts.next();
                Some(sum(first.into_iter().chain(parts.map(Linear::negated))))
            }
            ("*", _) => {
                let mut parts = parts.into_iter();
                let mut product = parts.next()?;
                for part in parts {
                    if product.rate.is_some() && part.rate.is_some() {
                        self.refuse_nonlinear(node);
                        return None;
                    }
                    product = product.times(part);
                }
                Some(product)
            }
            ("/", 2) => {
                let [dividend, divisor] = <[Linear; 2]>::try_from(parts).ok()?;
                let Linear {
                    constant: Some(divisor),
                    rate: None,
                } = divisor
                else {
                    self.refuse_nonlinear(node);
                    return None;
                };
                let over = |part| Expression::Divide(Box::new(part), Box::new(divisor.clone()));
                Some(Linear {
                    constant: dividend.constant.map(over),
                    rate: dividend.rate.map(over),
                })
            }
            _ => {
                self.report
                    .error(node.span, format!("unexpected `{}`", node.quote()))
                    .advise("`#t` is allowed in sums, products and dividends only");
                None
            }
        }
    }
}

impl Linear {
    fn negated(self) -> Self {
        let negated = |part| Expression::Negate(Box::new(part));
        Self {
            constant: self.constant.map(negated),
            rate: self.rate.map(negated),
        }
    }

    /// Returns the product. At most one factor may have a rate.
    fn times(self, other: Self) -> Self {
        let (timed, factor) = if other.rate.is_some() {
            (other, self.constant)
        } else {
            (self, other.constant)
        };
        let factor = factor.unwrap_or(Expression::Constant(Rational::ZERO));
        Self {
            constant: timed.constant.map(|part| times(part, factor.clone())),
            rate: timed.rate.map(|part| times(part, factor)),
        }
    }
}

fn sum(parts: impl IntoIterator<Item = Linear>) -> Linear {
    let (mut constants, mut rates) = (Vec::new(), Vec::new());
    for part in parts {
        constants.extend(part.constant);
        rates.extend(part.rate);
    }
    let add = |mut parts: Vec<Expression>| match parts.len() {
        0 => None,
        1 => parts.pop(),
        _ => Some(Expression::Add(parts)),
    };
    Linear {
        constant: add(constants),
        rate: add(rates),
    }
}

fn times(left: Expression, right: Expression) -> Expression {
    let one = Expression::Constant(Rational::ONE);
    match (left, right) {
        (left, right) if right == one => left,
        (left, right) if left == one => right,
        (Expression::Multiply(mut left), right) => {
            left.push(right);
            Expression::Multiply(left)
        }
        (left, right) => Expression::Multiply(vec![left, right]),
    }
}

/// Returns `true` if `#t` occurs in the node.
pub(super) fn mentions_time(node: &Node) -> bool {
    match &node.kind {
        Kind::Word(word) => word.eq_ignore_ascii_case("#t"),
        Kind::List(nodes) => nodes.iter().any(mentions_time),
    }
}
