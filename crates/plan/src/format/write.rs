//! Writer of STN plan files.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use elbowroom_model::Task;
use elbowroom_model::ground::Body;
use elbowroom_num::{End, Rational};

use super::syntax::limit;
use super::tokens::tokens;
use crate::parameter::{Parameter, ParameterKind, ParametrizedPlan};
use crate::stn_plan::{Bound, Constraint, Node, NodeId, StnPlan};
use crate::unknowns;
use crate::valuation::ParameterId;

/// Reason why a plan cannot be written as an STN plan file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WriteError {
    /// The format supports only durations, bounds and the domain's `:synth-parameters`.
    #[error(
        "an STN plan file cannot express these parameters: {}; remove them, or name the numbers \
         with `:synth-parameters` in the domain",
        names.join(", ")
    )]
    NotExpressible {
        /// The parameters.
        names: Vec<String>,
    },
    /// A label or a parameter's name would not be read as one name.
    #[error(
        "`{name}` is not allowed in an STN plan file: choose a name without spaces and \
             punctuation"
    )]
    Name {
        /// The label or name.
        name: String,
    },
}

/// Returns the plan as an STN plan file for [`read`](super::read).
///
/// The file does not contain timed initials. Their times are fixed, so a bound between a timed
/// initial and another node becomes a bound on the other node's time. Bounds on the same difference
/// are merged.
///
/// # Errors
/// When the format cannot express a parameter, or a name is not a word.
pub fn write(task: &Task, plan: &ParametrizedPlan) -> Result<String, WriteError> {
    check_kinds(task, plan)?;
    let labels = plan.plan.instances.iter().map(|instance| &instance.label);
    for name in labels.chain(plan.parameters.iter().map(|p| &p.name)) {
        let is_word = matches!(tokens(name)[..], [word] if word.is_word() && word.text == name);
        if !is_word || limit(name).is_some() {
            return Err(WriteError::Name { name: name.clone() });
        }
    }
    let mut text = String::new();
    for parameter in &plan.parameters {
        parameter_line(&mut text, parameter);
    }
    for instance in &plan.plan.instances {
        let keyword = match instance.action.body {
            Body::Durative(_) => "durative-action",
            Body::Instantaneous(_) => "action",
        };
        let (label, action) = (&instance.label, &instance.action.name);
        line(
            &mut text,
            format_args!("{keyword} instance {label} : {action};"),
        );
    }
    for difference in merged(task, &plan.plan) {
        let to = plan.plan.node_label(difference.to);
        let from = plan.plan.node_label(difference.from);
        let lower = bound(plan, &difference.lower, "-inf");
        let upper = bound(plan, &difference.upper, "inf");
        line(
            &mut text,
            format_args!("c: {to} - {from} in [{lower}, {upper}];"),
        );
    }
    Ok(text)
}

fn line(text: &mut String, content: std::fmt::Arguments<'_>) {
    writeln!(text, "{content}").expect("writing to a string cannot fail");
}

/// A bound on a difference.
#[derive(Clone)]
struct Difference {
    from: NodeId,
    to: NodeId,
    lower: Bound,
    upper: Bound,
}

/// Returns all constraints without timed initials. Numeric ones on the same difference are merged.
fn merged(task: &Task, plan: &StnPlan) -> Vec<Difference> {
    let mut all: Vec<Difference> = Vec::new();
    let mut numeric: BTreeMap<(NodeId, NodeId), usize> = BTreeMap::new();
    for constraint in &plan.constraints {
        let Some(new) = remove_timed(task, plan, constraint) else {
            continue;
        };
        let has_parameter = [&new.lower, &new.upper]
            .into_iter()
            .any(|bound| matches!(bound, Bound::Parameter(_)));
        if has_parameter {
            all.push(new);
        } else if let Some(&index) = numeric.get(&(new.from, new.to)) {
            let old = &mut all[index];
            old.lower = tighter(&old.lower, &new.lower, |new, old| new > old);
            old.upper = tighter(&old.upper, &new.upper, |new, old| new < old);
        } else {
            numeric.insert((new.from, new.to), all.len());
            all.push(new);
        }
    }
    all
}

fn tighter(old: &Bound, new: &Bound, excludes: fn(&Rational, &Rational) -> bool) -> Bound {
    match (old, new) {
        (Bound::Finite(a), Bound::Finite(b)) if !excludes(b, a) => old.clone(),
        (_, Bound::Infinite) => old.clone(),
        _ => new.clone(),
    }
}

/// Returns the constraint with `.zero` in place of a timed initial, or `None` if it is only about
/// fixed times.
fn remove_timed(task: &Task, plan: &StnPlan, constraint: &Constraint) -> Option<Difference> {
    let time = |node: NodeId| match plan.nodes[node.index()] {
        Node::Timed(index) => Some(task.timed()[index].time.clone()),
        _ => None,
    };
    let is_fixed = |node: NodeId| node == NodeId::ZERO || time(node).is_some();
    let (from, to) = (constraint.from, constraint.to);
    let mut difference = Difference {
        from,
        to,
        lower: constraint.lower.clone(),
        upper: constraint.upper.clone(),
    };
    let shift = match (time(from), time(to)) {
        (None, None) => return Some(difference),
        _ if is_fixed(from) && is_fixed(to) => return None,
        (Some(time), _) => time,
        (None, Some(time)) => -time,
    };
    for bound in [&mut difference.lower, &mut difference.upper] {
        if let Bound::Finite(value) = bound {
            *value += &shift;
        }
    }
    if time(from).is_some() {
        difference.from = NodeId::ZERO;
        return Some(difference);
    }
    // `timed - x in [l, u]` is `x - timed in [-u, -l]`.
    let negated = |bound: Bound| match bound {
        Bound::Finite(value) => Bound::Finite(-value),
        other => other,
    };
    Some(Difference {
        from: NodeId::ZERO,
        to: from,
        lower: negated(difference.upper),
        upper: negated(difference.lower),
    })
}

fn bound(plan: &ParametrizedPlan, bound: &Bound, infinity: &str) -> String {
    match bound {
        Bound::Infinite => infinity.to_owned(),
        Bound::Finite(value) => number(value),
        Bound::Parameter(id) => plan.parameter(*id).name.clone(),
    }
}

fn parameter_line(text: &mut String, parameter: &Parameter) {
    let natural = parameter.kind.natural_range(&parameter.nominal);
    let limit = |keyword: &str, end: &End, natural: &End, infinity: &str| match end.value() {
        _ if end == natural => String::new(),
        Some(value) => format!(" {keyword} {}", number(value)),
        None => format!(" {keyword} {infinity}"),
    };
    let weight = if parameter.weight == Rational::ONE {
        String::new()
    } else {
        format!(" weight {}", number(&parameter.weight))
    };
    let name = &parameter.name;
    let default = number(&parameter.nominal);
    let lower = limit("lb", &parameter.range.lower, &natural.lower, "-inf");
    let upper = limit("ub", &parameter.range.upper, &natural.upper, "inf");
    line(
        text,
        format_args!("parameter {name}{weight} default {default}{lower}{upper};"),
    );
}

/// Returns a decimal if that is exact and short, else a fraction.
fn number(value: &Rational) -> String {
    const DIGITS: u32 = 9;
    let decimal = value.to_decimal(DIGITS);
    if decimal.parse().as_ref() == Ok(value) {
        decimal
    } else {
        value.to_string()
    }
}

fn check_kinds(task: &Task, plan: &ParametrizedPlan) -> Result<(), WriteError> {
    let open: Vec<(String, ParameterKind)> = unknowns::possible(task, &plan.plan)
        .into_iter()
        .map(|number| (number.name(task, &plan.plan), number.kind()))
        .collect();
    let is_expressible = |parameter: &Parameter| match parameter.kind {
        ParameterKind::Duration(_) | ParameterKind::Bound => true,
        ParameterKind::Domain | ParameterKind::Constant(_) => open.iter().any(|(name, kind)| {
            *kind == parameter.kind && name.eq_ignore_ascii_case(&parameter.name)
        }),
        ParameterKind::Initial(_) | ParameterKind::Timed(_) => false,
    };
    let is_timed = |node: NodeId| matches!(plan.plan.nodes[node.index()], Node::Timed(_));
    let bounds_timed = |id: ParameterId| {
        plan.plan.constraints.iter().any(|constraint| {
            (is_timed(constraint.from) || is_timed(constraint.to))
                && [&constraint.lower, &constraint.upper].contains(&&Bound::Parameter(id))
        })
    };
    let names: Vec<String> = plan
        .parameters
        .iter()
        .enumerate()
        .filter(|(index, p)| !is_expressible(p) || bounds_timed(ParameterId::from(*index)))
        .map(|(_, parameter)| parameter.name.clone())
        .collect();
    if names.is_empty() {
        Ok(())
    } else {
        Err(WriteError::NotExpressible { names })
    }
}
