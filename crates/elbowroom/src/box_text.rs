//! Boxes as text: `dur_0=[7/4,3829/4] dur_7=[0,inf]`.

use elbowroom_num::{End, Interval, Rational};
use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan};

/// A text is not a box of this plan's parameters.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BoxTextError {
    /// Something else than `name=[lower,upper]`.
    #[error(
        "`{text}` is not an interval: write name=[lower,upper], such as d0=[1/2,7.5] or d0=[0,inf]"
    )]
    Syntax {
        /// What was found.
        text: String,
    },
    /// No parameter has that name.
    #[error("there is no parameter `{name}`; the parameters are {known}")]
    Unknown {
        /// The name given.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A parameter is mentioned twice.
    #[error("`{name}` is given two intervals: give it one")]
    Twice {
        /// Its name.
        name: String,
    },
    /// An interval holds no number.
    #[error("the interval of `{name}` is empty: its lower end is above its upper end")]
    Empty {
        /// Its name.
        name: String,
    },
}

/// Reads a box: `name=[lower,upper]` for some of the parameters, separated by spaces. The other
/// parameters keep their nominal value.
///
/// # Errors
/// When the text is not of that form, or names what is not a parameter of the plan.
pub fn parse_box(text: &str, plan: &ParametrizedPlan) -> Result<DecoupledEnvelope, BoxTextError> {
    let mut envelope = DecoupledEnvelope::point(&plan.nominal());
    let mut given = vec![false; plan.parameters.len()];
    for item in items(text) {
        let (name, interval) =
            parse_item(&item).ok_or_else(|| BoxTextError::Syntax { text: item.clone() })?;
        let id = plan.find(&name).ok_or_else(|| BoxTextError::Unknown {
            name: name.clone(),
            known: known(plan),
        })?;
        if std::mem::replace(&mut given[id.index()], true) {
            return Err(BoxTextError::Twice { name });
        }
        if interval.is_empty() {
            return Err(BoxTextError::Empty { name });
        }
        envelope.intervals[id.index()] = interval;
    }
    Ok(envelope)
}

/// Writes a box as [`parse_box`] reads it, exactly.
pub fn write_box(envelope: &DecoupledEnvelope, plan: &ParametrizedPlan) -> String {
    let items: Vec<String> = plan
        .parameters
        .iter()
        .zip(&envelope.intervals)
        .map(|(parameter, interval)| {
            let lower = interval
                .lower
                .value()
                .map_or_else(|| "-inf".to_owned(), ToString::to_string);
            let upper = interval
                .upper
                .value()
                .map_or_else(|| "inf".to_owned(), ToString::to_string);
            format!("{}=[{lower},{upper}]", parameter.name)
        })
        .collect();
    items.join(" ")
}

/// The text split after each `]`, with spaces taken out.
fn items(text: &str) -> Vec<String> {
    text.split_inclusive(']')
        .map(|item| item.split_whitespace().collect::<String>())
        .map(|item| item.trim_start_matches([',', ';']).to_owned())
        .filter(|item| !item.is_empty())
        .collect()
}

fn parse_item(item: &str) -> Option<(String, Interval)> {
    let (name, rest) = item.split_once('=')?;
    let (lower, upper) = rest.strip_prefix('[')?.strip_suffix(']')?.split_once(',')?;
    if name.is_empty() {
        return None;
    }
    let end = |text: &str, infinity: &[&str]| {
        if infinity.contains(&text) {
            return Some(End::Infinite);
        }
        text.parse::<Rational>().ok().map(End::Closed)
    };
    let interval = Interval {
        lower: end(lower, &["-inf"])?,
        upper: end(upper, &["inf", "+inf"])?,
    };
    Some((name.to_owned(), interval))
}

fn known(plan: &ParametrizedPlan) -> String {
    if plan.parameters.is_empty() {
        return "none".to_owned();
    }
    let names: Vec<String> = plan
        .parameters
        .iter()
        .map(|parameter| format!("`{}`", parameter.name))
        .collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use elbowroom_model::ground::Condition;
    use elbowroom_num::{Interval, Rational};
    use elbowroom_plan::{Parameter, ParameterKind, ParametrizedPlan, StnPlan};

    use super::{BoxTextError, parse_box, write_box};

    fn plan() -> ParametrizedPlan {
        let parameter = |name: &str| Parameter {
            name: name.to_owned(),
            kind: ParameterKind::Bound,
            nominal: Rational::from(5),
            weight: Rational::ONE,
            range: Interval::at_least(Rational::ZERO),
        };
        ParametrizedPlan {
            plan: StnPlan::default(),
            parameters: vec![parameter("d0"), parameter("d1")],
            initial: BTreeMap::new(),
            goal: Condition::TRUE,
        }
    }

    #[test]
    fn a_box_is_read_as_it_is_written() {
        let plan = plan();
        for text in ["d0=[7/4,3829/4] d1=[0,inf]", "d0=[5,5] d1=[-inf,9]"] {
            let envelope = parse_box(text, &plan).unwrap();
            assert_eq!(write_box(&envelope, &plan), text);
        }
        let loose = parse_box(" d1 = [ 0.5 , 9 ] ", &plan).unwrap();
        assert_eq!(write_box(&loose, &plan), "d0=[5,5] d1=[1/2,9]");
    }

    #[test]
    fn what_is_wrong_with_a_box_is_said() {
        let error = |text: &str| parse_box(text, &plan()).unwrap_err();
        assert!(matches!(error("d0=7"), BoxTextError::Syntax { .. }));
        assert!(matches!(error("d0=[7]"), BoxTextError::Syntax { .. }));
        assert!(matches!(error("d0=[1,x]"), BoxTextError::Syntax { .. }));
        assert!(matches!(error("d0=[inf,1]"), BoxTextError::Syntax { .. }));
        assert!(matches!(error("d0=[2,1]"), BoxTextError::Empty { .. }));
        assert!(matches!(
            error("d0=[1,2] d0=[1,2]"),
            BoxTextError::Twice { .. }
        ));
        assert_eq!(
            error("x=[1,2]").to_string(),
            "there is no parameter `x`; the parameters are `d0`, `d1`"
        );
    }
}
