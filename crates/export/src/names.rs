//! Unique names that every reader accepts: letters, digits and underscores.

use std::collections::BTreeSet;

use elbowroom_plan::{NodeId, StnPlan};

/// Returns the names of a plan's time points, by node: `n0_start` for the start of `n0`, and `Z`
/// for time zero, as in the literature.
pub(super) fn points(plan: &StnPlan) -> Vec<String> {
    distinct(plan.nodes().map(|(node, _)| {
        if node == NodeId::ZERO {
            "Z".to_owned()
        } else {
            plan.node_label(node)
        }
    }))
}

/// Makes names unique and replaces other characters.
pub(super) fn distinct(wanted: impl Iterator<Item = String>) -> Vec<String> {
    let mut taken = BTreeSet::new();
    let plain = |name: String| -> String {
        let is_plain = |letter: char| letter.is_ascii_alphanumeric();
        name.trim_start_matches('.')
            .chars()
            .map(|letter| if is_plain(letter) { letter } else { '_' })
            .collect()
    };
    let mut names = Vec::new();
    for wanted in wanted.map(plain) {
        let mut name = wanted.clone();
        let mut number = 2;
        while !taken.insert(name.clone()) {
            name = format!("{wanted}_{number}");
            number += 1;
        }
        names.push(name);
    }
    names
}

#[cfg(test)]
mod tests {
    use super::distinct;

    #[test]
    fn colliding_names_are_made_distinct() {
        let wanted = ["a.b", "a-b", "a_b_2", ".a b"].map(str::to_owned);
        let names = distinct(wanted.into_iter());
        assert_eq!(names, ["a_b", "a_b_2", "a_b_2_2", "a_b_3"]);
    }
}
