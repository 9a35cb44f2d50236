//! Random conditions and effects on two numbers, `n0` and `n1`.

use std::fmt::Write;

use proptest::prelude::*;

/// `n0 * first + n1 * second comparison bound`.
#[derive(Clone, Debug)]
pub(super) struct Demand {
    factors: (i8, i8),
    comparison: &'static str,
    bound: i8,
}

/// A change of a number by a constant, plus a multiple of the other number.
#[derive(Clone, Debug)]
pub(super) struct Change {
    number: u8,
    operator: &'static str,
    constant: i8,
    others: i8,
}

/// The numeric conditions of an action at the start, over all and at the end, and its changes at
/// the start and at the end.
#[derive(Clone, Debug)]
pub(super) struct Numbers {
    needs: Vec<(&'static str, Demand)>,
    start: Option<Change>,
    end: Option<Change>,
}

fn demands() -> impl Strategy<Value = Demand> {
    let comparison = prop::sample::select(vec![">=", ">=", ">", "<=", "<", "="]);
    // Most demands concern one number, as most conditions do.
    let factors = prop_oneof![
        Just((1, 0)),
        Just((0, 1)),
        (-2..3_i8, -2..3_i8).prop_filter("something is read", |it| *it != (0, 0)),
    ];
    (factors, comparison, -6..13_i8).prop_map(|(factors, comparison, bound)| Demand {
        factors,
        comparison,
        bound,
    })
}

fn changes() -> impl Strategy<Value = Change> {
    let operator = prop::sample::select(vec!["increase", "increase", "decrease", "assign"]);
    let others = prop_oneof![4 => Just(0), 1 => -1..3_i8];
    (0..2_u8, operator, -3..4_i8, others).prop_map(|(number, operator, constant, others)| Change {
        number,
        operator,
        constant,
        others,
    })
}

/// Generates the conditions and effects of an action on the numbers.
pub(super) fn numbers() -> impl Strategy<Value = Numbers> {
    let when = prop::sample::select(vec!["at start", "at start", "over all", "at end"]);
    (
        prop::collection::vec((when, demands()), 0..2),
        prop::option::weighted(0.3, changes()),
        prop::option::weighted(0.7, changes()),
    )
        .prop_map(|(needs, start, end)| Numbers { needs, start, end })
}

/// Generates the goal's conditions on the numbers.
pub(super) fn goals() -> impl Strategy<Value = Vec<Demand>> {
    prop::collection::vec(demands(), 0..3)
}

impl Demand {
    pub(super) fn text(&self) -> String {
        let (first, second) = self.factors;
        let sum = match self.factors {
            (1, 0) => "(n0)".to_owned(),
            (0, 1) => "(n1)".to_owned(),
            _ => format!("(+ (* {first} (n0)) (* {second} (n1)))"),
        };
        format!("({} {sum} {})", self.comparison, self.bound)
    }
}

impl Change {
    fn text(&self) -> String {
        let (number, other) = (self.number, 1 - self.number);
        let amount = match self.others {
            0 => self.constant.to_string(),
            factor => format!("(+ {} (* {factor} (n{other})))", self.constant),
        };
        format!("({} (n{number}) {amount})", self.operator)
    }
}

impl Numbers {
    /// Returns the conditions as text.
    pub(super) fn needs(&self) -> String {
        let mut text = String::new();
        for (when, demand) in &self.needs {
            write!(text, " ({when} {})", demand.text()).expect("strings take all");
        }
        text
    }

    /// Returns the effects at the start, and those at the end.
    pub(super) fn effects(&self) -> [String; 2] {
        [("at start", &self.start), ("at end", &self.end)].map(|(when, change)| {
            let change = change.as_ref();
            change.map_or(String::new(), |it| format!(" ({when} {})", it.text()))
        })
    }
}
