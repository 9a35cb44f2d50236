//! The rows: each basic variable as a combination of variables that are not basic.

use std::collections::{BTreeMap, BTreeSet};

use super::{Combination, VariableId};
use crate::{Rational, work};

/// Work that is counted for each term of a row that is added to another row.
const TERM_WORK: u64 = 200;

/// `basic = Σ coefficient · other`, over variables that are not basic, without zeros.
pub(super) type Row = BTreeMap<VariableId, Rational>;

#[derive(Clone, Debug, Default)]
pub(super) struct Tableau {
    /// For each variable its row, if it is basic.
    rows: Vec<Option<Row>>,
    /// For each variable that is not basic, the basic variables in whose rows it occurs.
    columns: Vec<BTreeSet<VariableId>>,
    /// All basic variables.
    basic: BTreeSet<VariableId>,
}

impl Tableau {
    /// Adds a variable; it is not basic, and occurs in no row.
    pub(super) fn add_column(&mut self) {
        self.rows.push(None);
        self.columns.push(BTreeSet::new());
    }

    /// Makes `variable`, which occurs nowhere yet, the basic variable of a new row.
    pub(super) fn define(&mut self, variable: VariableId, combination: &Combination) {
        let mut row = Row::new();
        for (term, factor) in combination {
            match &self.rows[term.index()] {
                Some(definition) => add_multiple(&mut row, definition, factor),
                None => add_term(&mut row, *term, factor),
            }
        }
        self.insert(variable, row);
    }

    /// Removes the row of the newest variable, and the variable.
    pub(super) fn remove_newest(&mut self) {
        let newest = VariableId::from_index(self.rows.len() - 1);
        self.take(newest);
        self.rows.pop();
        self.columns.pop();
    }

    pub(super) fn is_basic(&self, variable: VariableId) -> bool {
        self.rows[variable.index()].is_some()
    }

    /// Returns all basic variables, in ascending order.
    pub(super) fn basic(&self) -> impl Iterator<Item = VariableId> {
        self.basic.iter().copied()
    }

    /// Returns the row of a basic variable.
    pub(super) fn row(&self, basic: VariableId) -> &Row {
        self.rows[basic.index()]
            .as_ref()
            .expect("only basic variables are asked for their row")
    }

    /// Returns the basic variables that depend on `variable`, with their coefficients.
    pub(super) fn column(
        &self,
        variable: VariableId,
    ) -> impl Iterator<Item = (VariableId, &Rational)> {
        let basic = self.columns[variable.index()].iter();
        basic.map(move |&basic| (basic, &self.row(basic)[&variable]))
    }

    /// Returns the number of rows that contain `variable`.
    pub(super) fn column_length(&self, variable: VariableId) -> usize {
        self.columns[variable.index()].len()
    }

    /// Solves the row of `leaving` for `entering`, and replaces `entering` everywhere.
    pub(super) fn pivot(&mut self, leaving: VariableId, entering: VariableId) {
        let mut row = self.take(leaving);
        let column = self.columns[entering.index()].len();
        work::spend(TERM_WORK * (1 + column as u64) * (1 + row.len() as u64));
        let pivot = row
            .remove(&entering)
            .expect("the entering variable occurs in the leaving one's row");
        // leaving = pivot · entering + rest, hence entering = leaving / pivot - rest / pivot.
        let inverse = &Rational::ONE / &pivot;
        let factor = -&inverse;
        for coefficient in row.values_mut() {
            *coefficient *= &factor;
        }
        row.insert(leaving, inverse);
        for basic in std::mem::take(&mut self.columns[entering.index()]) {
            self.substitute(basic, entering, &row);
        }
        self.insert(entering, row);
    }

    /// Replaces `variable` by `definition` in the row of `basic`.
    fn substitute(&mut self, basic: VariableId, variable: VariableId, definition: &Row) {
        let row = self.rows[basic.index()]
            .as_mut()
            .expect("columns list basic variables");
        let Some(factor) = row.remove(&variable) else {
            return;
        };
        add_multiple(row, definition, &factor);
        for term in definition.keys() {
            let column = &mut self.columns[term.index()];
            if row.contains_key(term) {
                column.insert(basic);
            } else {
                column.remove(&basic);
            }
        }
    }

    fn insert(&mut self, basic: VariableId, row: Row) {
        work::spend(TERM_WORK * (1 + row.len() as u64));
        for term in row.keys() {
            self.columns[term.index()].insert(basic);
        }
        self.rows[basic.index()] = Some(row);
        self.basic.insert(basic);
    }

    fn take(&mut self, basic: VariableId) -> Row {
        self.basic.remove(&basic);
        let row = self.rows[basic.index()]
            .take()
            .expect("only rows of basic variables are taken");
        for term in row.keys() {
            self.columns[term.index()].remove(&basic);
        }
        row
    }
}

/// Computes `row += factor · other`.
fn add_multiple(row: &mut Row, other: &Row, factor: &Rational) {
    for (term, coefficient) in other {
        add_term(row, *term, &(coefficient * factor));
    }
}

/// Computes `row += coefficient · term`.
fn add_term(row: &mut Row, term: VariableId, coefficient: &Rational) {
    let sum = match row.get(&term) {
        Some(old) => old + coefficient,
        None => coefficient.clone(),
    };
    if sum.is_zero() {
        row.remove(&term);
    } else {
        row.insert(term, sum);
    }
}
