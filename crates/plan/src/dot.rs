//! STN plans as pictures.

use std::fmt::Write as _;

use elbowroom_model::Task;

use crate::{Bound, Constraint, Node, ParametrizedPlan, Reason};

/// Returns the network as a graph for Graphviz: `dot -Tsvg`.
///
/// Each action is a box, with its start and end side by side. Arrows are constraints; mere
/// orderings are dashed.
pub fn to_dot(task: &Task, plan: &ParametrizedPlan) -> String {
    let network = &plan.plan;
    let mut dot = String::from(
        "digraph plan {\n  rankdir=LR;\n  node [shape=box, style=rounded, fontname=\"sans-serif\"];\n  \
         edge [fontname=\"sans-serif\", fontsize=10];\n",
    );
    for (id, node) in network.nodes() {
        let (label, shape) = match node {
            Node::Zero => ("0".to_owned(), "circle"),
            Node::Timed(index) => (task.timed()[index].time.to_decimal(3), "diamond"),
            Node::Start(_) | Node::End(_) | Node::Instant(_) => {
                (network.describe_node(task, id), "box")
            }
        };
        let _ = writeln!(
            dot,
            "  n{} [label={}, shape={shape}];",
            id.0,
            quoted(&label)
        );
    }
    for constraint in &network.constraints {
        let style = match constraint.reason {
            Reason::Duration(_) => "bold",
            Reason::Interference
            | Reason::SelfOverlap
            | Reason::OverAll
            | Reason::Side
            | Reason::TrajectoryConstraint => "dashed",
            Reason::Given | Reason::Timed(_) | Reason::Pinned => "solid",
        };
        let label = label(plan, constraint);
        let _ = writeln!(
            dot,
            "  n{} -> n{} [label={}, style={style}];",
            constraint.from.0,
            constraint.to.0,
            quoted(&label)
        );
    }
    dot.push_str("}\n");
    dot
}

/// Returns the reason for a constraint, in one word.
pub fn reason(reason: &Reason) -> &'static str {
    match reason {
        Reason::Given => "given",
        Reason::Duration(_) => "duration",
        Reason::Timed(_) => "timed",
        Reason::Interference => "interference",
        Reason::OverAll | Reason::Side => "over all",
        Reason::SelfOverlap => "self-overlap",
        Reason::TrajectoryConstraint => "course",
        Reason::Pinned => "pinned",
    }
}

/// Returns `[lower, upper]`, or an empty text for a mere ordering.
fn label(plan: &ParametrizedPlan, constraint: &Constraint) -> String {
    let bound = |bound: &Bound, infinity: &str| match bound {
        Bound::Infinite => infinity.to_owned(),
        Bound::Finite(value) => value.to_decimal(3),
        Bound::Parameter(id) => plan.parameter(*id).name.clone(),
    };
    let lower = bound(&constraint.lower, "-inf");
    if constraint.lower == constraint.upper {
        return lower;
    }
    format!("[{lower}, {}]", bound(&constraint.upper, "inf"))
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}
