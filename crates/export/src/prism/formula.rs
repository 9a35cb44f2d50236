//! Formulas and numbers of the PRISM language.

use std::fmt::{self, Display, Formatter};

use elbowroom_num::Rational;

/// A formula over the variables of a model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Formula {
    /// The conjunction; `true` if it is empty.
    All(Vec<Formula>),
    /// The disjunction; `false` if it is empty.
    Any(Vec<Formula>),
    Not(Box<Formula>),
    /// A name, or a comparison of numbers.
    Atom(String),
}

impl Formula {
    pub(super) const TRUE: Self = Self::All(Vec::new());
    pub(super) const FALSE: Self = Self::Any(Vec::new());

    pub(super) fn atom(text: impl Into<String>) -> Self {
        Self::Atom(text.into())
    }

    /// Returns the conjunction, without redundant parts.
    pub(super) fn all(parts: impl IntoIterator<Item = Self>) -> Self {
        let mut kept = Vec::new();
        for part in parts {
            match part {
                Self::All(inner) => kept.extend(inner),
                part if part == Self::FALSE => return Self::FALSE,
                part if kept.contains(&part) => {}
                part => kept.push(part),
            }
        }
        single(kept, Self::All)
    }

    /// Returns the disjunction, without redundant parts.
    pub(super) fn any(parts: impl IntoIterator<Item = Self>) -> Self {
        let mut kept = Vec::new();
        for part in parts {
            match part {
                Self::Any(inner) => kept.extend(inner),
                part if part == Self::TRUE => return Self::TRUE,
                part => kept.push(part),
            }
        }
        single(kept, Self::Any)
    }

    /// Returns the negation.
    pub(super) fn negated(self) -> Self {
        match self {
            Self::Not(part) => *part,
            part if part == Self::TRUE => Self::FALSE,
            part if part == Self::FALSE => Self::TRUE,
            part => Self::Not(Box::new(part)),
        }
    }
}

fn single(mut parts: Vec<Formula>, many: impl FnOnce(Vec<Formula>) -> Formula) -> Formula {
    match (parts.pop(), parts.is_empty()) {
        (Some(only), true) => only,
        (last, _) => {
            parts.extend(last);
            many(parts)
        }
    }
}

impl Display for Formula {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let joined = |f: &mut Formatter<'_>, parts: &[Self], sign: &str| {
            for (place, part) in parts.iter().enumerate() {
                if place > 0 {
                    write!(f, " {sign} ")?;
                }
                match part {
                    Self::All(_) | Self::Any(_) => write!(f, "({part})")?,
                    Self::Not(_) | Self::Atom(_) => write!(f, "{part}")?,
                }
            }
            Ok(())
        };
        match self {
            Self::All(parts) if parts.is_empty() => f.write_str("true"),
            Self::Any(parts) if parts.is_empty() => f.write_str("false"),
            Self::All(parts) => joined(f, parts, "&"),
            Self::Any(parts) => joined(f, parts, "|"),
            Self::Not(part) => match &**part {
                Self::Atom(name) if !name.contains(['=', '<', '>']) => write!(f, "!{name}"),
                part => write!(f, "!({part})"),
            },
            Self::Atom(name) => f.write_str(name),
        }
    }
}

/// Returns the probability as the decimal number in the file, not as the nearest binary fraction.
pub(super) fn exact(probability: f64) -> Rational {
    let text = format!("{probability}");
    text.parse()
        .expect("a finite number in decimals is a fraction")
}

/// Formats a number that has finitely many decimals, with all of them.
pub(super) fn decimal(number: &Rational) -> String {
    let ten = Rational::from(10);
    let mut digits = 0;
    let mut scaled = number.clone();
    while !scaled.is_integer() {
        scaled = &scaled * &ten;
        digits += 1;
    }
    number.to_decimal(digits)
}

/// Formats `p : update + …`, without updates of probability 0. The probabilities add up to 1.
pub(super) fn choice(ways: &[(Rational, String)]) -> String {
    let ways: Vec<_> = ways.iter().filter(|(p, _)| !p.is_zero()).collect();
    match ways.as_slice() {
        [(_, only)] => only.clone(),
        ways => {
            let ways = ways.iter();
            let ways: Vec<String> = ways
                .map(|(p, update)| format!("{} : {update}", decimal(p)))
                .collect();
            ways.join(" + ")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Formula, choice, decimal, exact};

    #[test]
    fn formulas_respect_operator_precedence() {
        let [a, b, c] = ["a", "b", "t=1"].map(Formula::atom);
        let either = Formula::any([a.clone(), b.clone()]);
        let all = Formula::all([either.clone(), c.clone().negated(), Formula::TRUE]);
        assert_eq!(all.to_string(), "(a | b) & !(t=1)");
        assert_eq!(all.negated().to_string(), "!((a | b) & !(t=1))");
        assert_eq!(Formula::all([a.clone(), Formula::FALSE]), Formula::FALSE);
        assert_eq!(Formula::any([b, Formula::TRUE]).to_string(), "true");
        assert_eq!(Formula::all([Formula::all([]), a.clone()]), a);
        assert_eq!(either.negated().negated().to_string(), "a | b");
    }

    #[test]
    fn probabilities_keep_their_decimals() {
        assert_eq!(decimal(&exact(0.1)), "0.1");
        assert_eq!(decimal(&(&exact(0.35) * &exact(0.07))), "0.0245");
        let ways = [(exact(0.0), "x"), (exact(1.0), "y")];
        assert_eq!(choice(&ways.map(|(p, way)| (p, way.to_owned()))), "y");
    }
}
