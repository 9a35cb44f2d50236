//! Dead ends as a formula: the states without a way to the goal even if nothing fails.

use std::collections::BTreeMap;

use super::formula::Formula;

/// Returns a formula for the states whose entry in `table` is `true`. Bit `i` of a state is the
/// truth of the `i`-th name.
pub(super) fn states(table: &[bool], names: &[String]) -> Formula {
    if table.iter().all(|is_in| *is_in) {
        return Formula::TRUE;
    }
    if !table.iter().any(|is_in| *is_in) {
        return Formula::FALSE;
    }
    let (last, names) = names.split_last().expect("more than one state");
    let (without, with) = table.split_at(table.len() / 2);
    if with == without {
        return states(with, names);
    }
    let last = Formula::atom(last);
    let (with, without) = (states(with, names), states(without, names));
    // The common part needs no case distinction.
    if with == Formula::TRUE {
        return Formula::any([last, without]);
    }
    if without == Formula::TRUE {
        return Formula::any([last.negated(), with]);
    }
    Formula::any([
        Formula::all([last.clone(), with]),
        Formula::all([last.negated(), without]),
    ])
}

/// Does the same for tables that depend on the running actions, each given by its name. `sets`
/// contains all possible sets of running actions.
pub(super) fn by_set(
    sets: &[(Vec<usize>, Vec<bool>)],
    running: &[String],
    facts: &[String],
) -> Formula {
    let mut groups: BTreeMap<&[bool], Vec<&[usize]>> = BTreeMap::new();
    for (set, table) in sets {
        groups.entry(table).or_default().push(set);
    }
    let is_set = |set: &&[usize]| {
        Formula::all(running.iter().enumerate().map(|(action, name)| {
            let name = Formula::atom(name);
            if set.contains(&action) {
                name
            } else {
                name.negated()
            }
        }))
    };
    // The largest group is "all others".
    let largest = groups.iter().max_by_key(|(_, sets)| sets.len());
    let Some(largest) = largest.map(|(table, _)| *table) else {
        return Formula::FALSE;
    };
    let others: Vec<(Formula, Formula)> = groups
        .iter()
        .filter(|(table, _)| **table != largest)
        .map(|(table, sets)| (Formula::any(sets.iter().map(is_set)), states(table, facts)))
        .collect();
    let rest = others.iter().map(|(set, _)| set.clone().negated());
    let rest = Formula::all(rest.chain([states(largest, facts)]));
    let others = others
        .into_iter()
        .map(|(set, table)| Formula::all([set, table]));
    Formula::any(others.chain([rest]))
}

#[cfg(test)]
mod tests {
    use super::{Formula, by_set, states};

    fn holds(formula: &Formula, names: &[String], state: usize) -> bool {
        match formula {
            Formula::All(parts) => parts.iter().all(|part| holds(part, names, state)),
            Formula::Any(parts) => parts.iter().any(|part| holds(part, names, state)),
            Formula::Not(part) => !holds(part, names, state),
            Formula::Atom(name) => {
                let place = names.iter().position(|other| other == name);
                state & (1 << place.expect("a name")) != 0
            }
        }
    }

    #[test]
    fn formula_matches_its_table() {
        let names: Vec<String> = ["a", "b", "c"].map(str::to_owned).into();
        for table in 0..256_u32 {
            let table: Vec<bool> = (0..8).map(|state| table & (1 << state) != 0).collect();
            let formula = states(&table, &names);
            for (state, is_in) in table.iter().enumerate() {
                assert_eq!(holds(&formula, &names, state), *is_in, "{formula}");
            }
        }
    }

    #[test]
    fn formula_depends_on_running_actions() {
        let facts: Vec<String> = ["a", "b"].map(str::to_owned).into();
        let running: Vec<String> = ["x", "y"].map(str::to_owned).into();
        let names: Vec<String> = facts.iter().chain(&running).cloned().collect();
        for tables in 0..4096_usize {
            let table = |set: usize| {
                let bits = (tables >> (4 * set)) & 15;
                (0..4).map(|state| bits & (1 << state) != 0).collect()
            };
            // At most one of the two is running.
            let sets = [(vec![], table(0)), (vec![0], table(1)), (vec![1], table(2))];
            let formula = by_set(&sets, &running, &facts);
            for (number, (_, table)) in sets.iter().enumerate() {
                for (state, is_in) in table.iter().enumerate() {
                    let under_way = [0, 0b100, 0b1000][number];
                    assert_eq!(holds(&formula, &names, state | under_way), *is_in);
                }
            }
        }
    }
}
