//! Conditions as trees of `PlanSys2`.

use crate::knowledge::{Node, Param, Tree, node};

/// Operators of expressions, in the order of their numbers. The first one has the number 13 since
/// version 2.0.10; older versions had three fewer types of nodes, and the numbers were lower by
/// three.
const EXPRESSIONS: [&str; 9] = ["=", ">=", ">", "<=", "<", "*", "/", "+", "-"];
const FIRST_EXPRESSION: u8 = 13;

/// Parsed PDDL text.
enum SExpression {
    Word(String),
    List(Vec<SExpression>),
}

/// Returns a subgoal in the form of `PlanSys2`'s executor: `(and PART)`. Returns `None` if the text
/// is not a condition.
pub fn sub_goal(text: &str) -> Option<Tree> {
    let mut tree = Tree {
        nodes: vec![Node {
            node_type: node::AND,
            ..Node::default()
        }],
    };
    let form = read(text)?;
    let part = condition(&form, false, &mut tree.nodes)?;
    tree.nodes[0].children.push(part);
    Some(tree)
}

fn read(text: &str) -> Option<SExpression> {
    let spaced = text.replace('(', " ( ").replace(')', " ) ");
    let mut open: Vec<Vec<SExpression>> = vec![Vec::new()];
    for word in spaced.split_whitespace() {
        match word {
            "(" => open.push(Vec::new()),
            ")" => {
                let list = SExpression::List(open.pop()?);
                open.last_mut()?.push(list);
            }
            word => open
                .last_mut()?
                .push(SExpression::Word(word.to_lowercase())),
        }
    }
    let mut forms = open.pop().filter(|_| open.is_empty())?;
    forms.pop().filter(|_| forms.is_empty())
}

/// Adds a condition with its parts, and returns its position.
fn condition(form: &SExpression, is_negated: bool, nodes: &mut Vec<Node>) -> Option<u32> {
    let (name, parts) = headed(form)?;
    let node_type = match name {
        "and" => node::AND,
        "or" => node::OR,
        "not" => node::NOT,
        name if EXPRESSIONS[..5].contains(&name) => return expression(form, is_negated, nodes),
        _ => return named(form, node::PREDICATE, is_negated, nodes),
    };
    if node_type == node::NOT && parts.len() != 1 {
        return None;
    }
    let place = add(nodes, node_type, is_negated)?;
    for part in parts {
        let child = condition(part, is_negated ^ (node_type == node::NOT), nodes)?;
        nodes[place as usize].children.push(child);
    }
    Some(place)
}

fn expression(form: &SExpression, is_negated: bool, nodes: &mut Vec<Node>) -> Option<u32> {
    if let SExpression::Word(word) = form {
        let value: f64 = word.parse().ok()?;
        let place = add(nodes, node::NUMBER, is_negated)?;
        nodes[place as usize].value = value;
        return Some(place);
    }
    let (name, parts) = headed(form)?;
    let Some(number) = EXPRESSIONS.iter().position(|it| *it == name) else {
        return named(form, node::FUNCTION, is_negated, nodes);
    };
    let place = add(nodes, node::EXPRESSION, is_negated)?;
    nodes[place as usize].expression_type = FIRST_EXPRESSION + u8::try_from(number).ok()?;
    for part in parts {
        let child = expression(part, false, nodes)?;
        nodes[place as usize].children.push(child);
    }
    Some(place)
}

/// Adds a fact or a fluent.
fn named(
    form: &SExpression,
    node_type: u8,
    is_negated: bool,
    nodes: &mut Vec<Node>,
) -> Option<u32> {
    let (name, objects) = headed(form)?;
    let object = |form: &SExpression| match form {
        SExpression::Word(name) => Some(Param {
            name: name.clone(),
            ..Param::default()
        }),
        SExpression::List(_) => None,
    };
    let parameters = objects.iter().map(object).collect::<Option<Vec<_>>>()?;
    let place = add(nodes, node_type, is_negated)?;
    let node = &mut nodes[place as usize];
    (node.name, node.parameters) = (name.to_owned(), parameters);
    Some(place)
}

fn headed(form: &SExpression) -> Option<(&str, &[SExpression])> {
    match form {
        SExpression::List(parts) => match parts.split_first()? {
            (SExpression::Word(name), rest) => Some((name, rest)),
            (SExpression::List(_), _) => None,
        },
        SExpression::Word(_) => None,
    }
}

fn add(nodes: &mut Vec<Node>, node_type: u8, negate: bool) -> Option<u32> {
    let node_id = u32::try_from(nodes.len()).ok()?;
    nodes.push(Node {
        node_type,
        node_id,
        negate,
        ..Node::default()
    });
    Some(node_id)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Converts a tree to PDDL, using only the numbers of the nodes.
    fn text(tree: &Tree, place: u32) -> String {
        let it = &tree.nodes[place as usize];
        assert_eq!(it.node_id, place);
        let names: Vec<_> = match it.node_type {
            node::PREDICATE | node::FUNCTION => {
                let objects = it.parameters.iter().map(|it| it.name.clone());
                std::iter::once(it.name.clone()).chain(objects).collect()
            }
            node::NUMBER => return it.value.to_string(),
            other => {
                let word = match other {
                    node::AND => "and",
                    node::OR => "or",
                    node::NOT => "not",
                    node::EXPRESSION => EXPRESSIONS[usize::from(it.expression_type - 13)],
                    _ => panic!("{it:?}"),
                };
                let parts = it.children.iter().map(|it| text(tree, *it));
                std::iter::once(word.to_owned()).chain(parts).collect()
            }
        };
        format!("({})", names.join(" "))
    }

    #[test]
    fn sub_goal_is_wrapped_in_a_single_and() {
        for part in [
            "(at r1 gate)",
            "(done)",
            "(not (at r1 gate))",
            "(or (at r1 gate) (and (done) (not (done))))",
            "(>= (charge r1) 2.5)",
            "(< (+ (charge r1) (total)) (* 2 (charge r2)))",
        ] {
            let tree = sub_goal(part).expect("a condition");
            assert_eq!(text(&tree, 0), format!("(and {part})"));
        }
        let tree = sub_goal("(not (at r1 gate))").expect("a condition");
        assert_eq!(
            tree.nodes.iter().map(|it| it.negate).collect::<Vec<_>>(),
            [false, false, true]
        );
    }

    #[test]
    fn invalid_condition_has_no_tree() {
        for part in [
            "",
            "done",
            "(at r1",
            "(at r1))",
            "(not)",
            "(at (r1))",
            "(>= a 2)",
            "() ()",
        ] {
            assert_eq!(sub_goal(part), None, "{part}");
        }
    }
}
