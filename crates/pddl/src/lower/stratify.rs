//! Stratification of the rules of derived predicates: no predicate may depend on its own negation.

use elbowroom_model::Problem;
use elbowroom_model::problem::Condition;

/// Returns the rules that negate a predicate which depends on the rule's own head.
pub(super) fn negative_cycles(problem: &Problem) -> Vec<usize> {
    let mut edges: Vec<Vec<usize>> = vec![Vec::new(); problem.predicates.len()];
    let mut negated: Vec<Vec<usize>> = Vec::with_capacity(problem.rules.len());
    for rule in &problem.rules {
        let mut negative = Vec::new();
        visit(&rule.body, false, &mut |predicate, is_negated| {
            edges[rule.predicate.index()].push(predicate);
            if is_negated {
                negative.push(predicate);
            }
        });
        negated.push(negative);
    }
    let component = components(&edges);
    (0..problem.rules.len())
        .filter(|&rule| {
            let own = component[problem.rules[rule].predicate.index()];
            negated[rule].iter().any(|&other| component[other] == own)
        })
        .collect()
}

/// Calls `found` for each predicate of a condition. The flag is `true` if the predicate is negated.
fn visit(condition: &Condition, is_negated: bool, found: &mut impl FnMut(usize, bool)) {
    match condition {
        Condition::Atom(atom) => found(atom.predicate.index(), is_negated),
        Condition::Equal(..) | Condition::Compare(..) => {}
        Condition::Not(part) => visit(part, !is_negated, found),
        Condition::And(parts) | Condition::Or(parts) => {
            for part in parts {
                visit(part, is_negated, found);
            }
        }
        Condition::Forall(_, part) | Condition::Exists(_, part) => visit(part, is_negated, found),
    }
}

/// Returns the strongly connected component of each node, by Kosaraju's algorithm. It uses no
/// recursion, because a chain of rules can be long.
fn components(edges: &[Vec<usize>]) -> Vec<usize> {
    let mut reversed: Vec<Vec<usize>> = vec![Vec::new(); edges.len()];
    for (from, targets) in edges.iter().enumerate() {
        for &to in targets {
            reversed[to].push(from);
        }
    }
    let mut seen = vec![false; edges.len()];
    let mut finished = Vec::with_capacity(edges.len());
    for root in 0..edges.len() {
        walk(root, edges, &mut seen, &mut finished);
    }
    let mut seen = vec![false; edges.len()];
    let mut component = vec![0; edges.len()];
    for (number, &root) in finished.iter().rev().enumerate() {
        let mut members = Vec::new();
        walk(root, &reversed, &mut seen, &mut members);
        for member in members {
            component[member] = number;
        }
    }
    component
}

/// Adds the nodes that are reachable from `root` and not yet seen to `finished`, in postorder.
fn walk(root: usize, edges: &[Vec<usize>], seen: &mut [bool], finished: &mut Vec<usize>) {
    if std::mem::replace(&mut seen[root], true) {
        return;
    }
    let mut path = vec![(root, 0)];
    while let Some((node, next)) = path.last_mut() {
        if let Some(&to) = edges[*node].get(*next) {
            *next += 1;
            if !std::mem::replace(&mut seen[to], true) {
                path.push((to, 0));
            }
        } else {
            finished.push(*node);
            path.pop();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_on_a_cycle_share_a_component() {
        let component = components(&[vec![1], vec![2], vec![0, 3], vec![]]);
        assert_eq!(component[0], component[1]);
        assert_eq!(component[0], component[2]);
        assert_ne!(component[0], component[3]);
    }
}
