//! Boxes as text: `dur_0=[7/4,3829/4] (drive rover depot shelf)=12 all=±10%`.

use elbowroom_num::{End, Interval, Rational};
use elbowroom_text::nearest;

use crate::{DecoupledEnvelope, Parameter, ParameterId, ParameterKind, ParametrizedPlan};

/// The name for every parameter.
const ALL: &str = "all";

/// Largest number of parameters that are all listed if a name is unknown. For more parameters, only
/// a similar name is suggested.
const MAX_LISTED: usize = 12;

/// Errors of a text that is not a box of this plan's parameters.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BoxTextError {
    /// An item does not have the form of a name with an interval.
    #[error(
        "`{text}` is not an interval: write NAME=[LOWER,UPPER], NAME=VALUE or NAME=±10%, such as \
         dur_0=[1/2,7.5], dur_0=[0,inf] or all=±10%"
    )]
    Syntax {
        /// The text of the item.
        text: String,
    },
    /// No parameter has that name.
    #[error("there is no parameter `{name}`; {}", .nearest.as_ref().map_or_else(
        || format!("the parameters are {known}"),
        |near| format!("did you mean `{near}`?"),
    ))]
    Unknown {
        /// The name.
        name: String,
        /// The known names.
        known: String,
        /// The most similar name, if there is one.
        nearest: Option<String>,
    },
    /// The name is ambiguous.
    #[error("`{name}` is ambiguous: write {}", choices.join(", "))]
    Ambiguous {
        /// The name.
        name: String,
        /// The names of those parameters.
        choices: Vec<String>,
    },
    /// A parameter is mentioned twice.
    #[error("`{name}` is given two intervals: give it one")]
    Duplicate {
        /// Its name.
        name: String,
    },
    /// An interval contains no number.
    #[error("the interval of `{name}` is empty: its lower end is above its upper end")]
    Empty {
        /// Its name.
        name: String,
    },
}

/// Reads a box: intervals for some of the parameters, separated by spaces. The other parameters
/// keep their nominal value.
///
/// A parameter is written as its name (`dur_0`), and a duration also as its action, `(drive rover
/// depot shelf)`, or the action's label (`n0`). The name `all` applies to every parameter that is
/// not named itself, and the name of an action of the domain (`drive`) to all of its durations that
/// are not named themselves. The name is followed by `=` and an interval `[5,12]`, one value `12`, or a
/// deviation from the nominal value, `±10%` or `±2` (`+-` also works for `±`), which is cut to the
/// parameter's natural range.
///
/// # Errors
/// When the text is not of that form, or names a parameter that the plan does not have.
pub fn parse_box(text: &str, plan: &ParametrizedPlan) -> Result<DecoupledEnvelope, BoxTextError> {
    let mut given: Vec<Option<Interval>> = vec![None; plan.parameters.len()];
    let mut of_all = None;
    let mut of_actions: Vec<(String, Value)> = Vec::new();
    for (name, value) in items(text)? {
        let value = parse_value(&value).ok_or_else(|| BoxTextError::Syntax {
            text: format!("{name}={value}"),
        })?;
        let id = match find(&name, plan) {
            Err(BoxTextError::Unknown { .. }) if name.eq_ignore_ascii_case(ALL) => {
                if of_all.replace(value).is_some() {
                    return Err(BoxTextError::Duplicate { name });
                }
                continue;
            }
            Err(BoxTextError::Unknown { .. }) if is_action_name(&name, plan) => {
                let is_same = |(other, _): &(String, Value)| other.eq_ignore_ascii_case(&name);
                if of_actions.iter().any(is_same) {
                    return Err(BoxTextError::Duplicate { name });
                }
                of_actions.push((name, value));
                continue;
            }
            found => found?,
        };
        let interval = value.around(&plan.parameters[id.index()]);
        if interval.is_empty() {
            return Err(BoxTextError::Empty { name });
        }
        if given[id.index()].replace(interval).is_some() {
            return Err(BoxTextError::Duplicate { name });
        }
    }
    let mut envelope = DecoupledEnvelope::point(&plan.nominal());
    for (index, parameter) in plan.parameters.iter().enumerate() {
        let own = given[index].take();
        let action = schema_name(parameter, plan);
        let of_action = of_actions
            .iter()
            .find(|(name, _)| action.is_some_and(|action| action.eq_ignore_ascii_case(name)))
            .map(|(_, value)| value);
        let shared = of_action.or(of_all.as_ref());
        let interval = own.or_else(|| shared.map(|value| value.around(parameter)));
        if let Some(interval) = interval {
            if interval.is_empty() {
                let name = parameter.name.clone();
                return Err(BoxTextError::Empty { name });
            }
            envelope = envelope.with_interval(index.into(), interval);
        }
    }
    Ok(envelope)
}

/// Writes a box in the syntax of [`parse_box`], exactly.
pub fn write_box(envelope: &DecoupledEnvelope, plan: &ParametrizedPlan) -> String {
    let items: Vec<String> = plan
        .parameters
        .iter()
        .zip(envelope.intervals())
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

/// Splits the text into names and the texts after their `=`.
fn items(text: &str) -> Result<Vec<(String, String)>, BoxTextError> {
    let is_between = |c: char| c.is_whitespace() || matches!(c, ',' | ';');
    let wrong = |text: &str| BoxTextError::Syntax {
        text: text.trim().to_owned(),
    };
    let mut items = Vec::new();
    let mut rest = text.trim_start_matches(is_between);
    while !rest.is_empty() {
        let (name, after) = rest.split_once('=').ok_or_else(|| wrong(rest))?;
        let after = after.trim_start();
        let end = if after.starts_with('[') {
            after.find(']').map(|end| end + 1)
        } else {
            Some(after.find(is_between).unwrap_or(after.len()))
        };
        let end = end.ok_or_else(|| wrong(rest))?;
        let name = name.split_whitespace().collect::<Vec<_>>().join(" ");
        let name = name.replace("( ", "(").replace(" )", ")");
        if name.is_empty() {
            return Err(wrong(rest));
        }
        let value = after[..end].split_whitespace().collect();
        items.push((name, value));
        rest = after[end..].trim_start_matches(is_between);
    }
    Ok(items)
}

/// The value or interval after the `=`.
enum Value {
    Interval(Interval),
    /// The largest distance from the nominal value, in both directions.
    Deviation(Rational),
    /// The same as a share of the nominal value.
    Share(Rational),
}

fn parse_value(text: &str) -> Option<Value> {
    let deviation = text.strip_prefix('±').or_else(|| text.strip_prefix("+-"));
    if let Some(deviation) = deviation {
        let number = |text: &str| {
            let number: Option<Rational> = text.parse().ok();
            number.filter(|number| !number.is_negative())
        };
        return match deviation.strip_suffix('%') {
            Some(percent) => Some(Value::Share(number(percent)? / Rational::from(100))),
            None => number(deviation).map(Value::Deviation),
        };
    }
    let Some(ends) = text.strip_prefix('[') else {
        return text
            .parse()
            .ok()
            .map(|value| Value::Interval(Interval::point(value)));
    };
    let (lower, upper) = ends.strip_suffix(']')?.split_once(',')?;
    let end = |text: &str, infinity: &[&str]| {
        if infinity.contains(&text) {
            return Some(End::Infinite);
        }
        text.parse::<Rational>().ok().map(End::Closed)
    };
    Some(Value::Interval(Interval {
        lower: end(lower, &["-inf"])?,
        upper: end(upper, &["inf", "+inf"])?,
    }))
}

impl Value {
    /// Returns the values of the parameter that this describes.
    fn around(&self, parameter: &Parameter) -> Interval {
        let nominal = &parameter.nominal;
        let reach = match self {
            Self::Interval(interval) => return interval.clone(),
            Self::Deviation(reach) => reach.clone(),
            Self::Share(share) => &nominal.abs() * share,
        };
        let limit = |own: Rational, natural: Option<&Rational>, is_lower: bool| match natural {
            Some(natural) if (own < *natural) == is_lower => natural.clone(),
            _ => own,
        };
        let range = &parameter.range;
        Interval {
            lower: End::Closed(limit(nominal - &reach, range.lower.value(), true)),
            upper: End::Closed(limit(nominal + &reach, range.upper.value(), false)),
        }
    }
}

/// Returns the name of the action in the domain whose duration the parameter is.
fn schema_name<'p>(parameter: &Parameter, plan: &'p ParametrizedPlan) -> Option<&'p str> {
    let ParameterKind::Duration(id) = parameter.kind else {
        return None;
    };
    let name = &plan.plan.instance(id).action.name;
    name.trim_start_matches('(').split([' ', ')']).next()
}

/// Returns `true` if a parameter is the duration of an action of the domain with this name.
fn is_action_name(name: &str, plan: &ParametrizedPlan) -> bool {
    let mut names = plan.parameters.iter();
    names.any(|parameter| {
        schema_name(parameter, plan).is_some_and(|action| action.eq_ignore_ascii_case(name))
    })
}

/// Returns the parameter with that name, or the duration of that action.
///
/// # Errors
/// When no parameter of the plan has this name.
pub fn find(name: &str, plan: &ParametrizedPlan) -> Result<ParameterId, BoxTextError> {
    if let Some(id) = plan.find(name) {
        return Ok(id);
    }
    let durations: Vec<(ParameterId, &str, &str)> = plan
        .parameters
        .iter()
        .enumerate()
        .filter_map(|(index, parameter)| match parameter.kind {
            ParameterKind::Duration(id) => {
                let instance = plan.plan.instance(id);
                let names = (&*instance.action.name, &*instance.label);
                Some((ParameterId::from(index), names.0, names.1))
            }
            _ => None,
        })
        .collect();
    let is_meant = |(_, action, label): &&(ParameterId, &str, &str)| {
        action.eq_ignore_ascii_case(name) || *label == name
    };
    let found: Vec<ParameterId> = durations.iter().filter(is_meant).map(|it| it.0).collect();
    match found[..] {
        [id] => Ok(id),
        [] => {
            // Names of parameters are similar, so a short list of them helps more than a single
            // suggestion.
            let names = plan.parameters.iter().map(|parameter| &*parameter.name);
            let names = names.filter(|_| plan.parameters.len() > MAX_LISTED);
            let actions = durations.iter().map(|(_, action, _)| *action);
            Err(BoxTextError::Unknown {
                name: name.to_owned(),
                known: known_names(plan),
                nearest: nearest(name, names.chain(actions)).map(str::to_owned),
            })
        }
        _ => Err(BoxTextError::Ambiguous {
            name: name.to_owned(),
            choices: found
                .iter()
                .map(|id| format!("`{}`", plan.parameters[id.index()].name))
                .collect(),
        }),
    }
}

fn known_names(plan: &ParametrizedPlan) -> String {
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

    use crate::{Parameter, ParameterKind, ParametrizedPlan, StnPlan};
    use elbowroom_model::ground::Condition;
    use elbowroom_num::{Interval, Rational};

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
            commanded_durations: BTreeMap::new(),
            goal: Condition::TRUE,
        }
    }

    #[test]
    fn box_text_round_trips() {
        let plan = plan();
        for text in ["d0=[7/4,3829/4] d1=[0,inf]", "d0=[5,5] d1=[-inf,9]"] {
            let envelope = parse_box(text, &plan).unwrap();
            assert_eq!(write_box(&envelope, &plan), text);
        }
        let loose = parse_box(" d1 = [ 0.5 , 9 ] ", &plan).unwrap();
        assert_eq!(write_box(&loose, &plan), "d0=[5,5] d1=[1/2,9]");
    }

    #[test]
    fn value_and_deviation_are_parsed_as_intervals() {
        let plan = plan();
        for (text, expected) in [
            ("d0=7", "d0=[7,7] d1=[5,5]"),
            ("d0=±10% d1=+-2", "d0=[9/2,11/2] d1=[3,7]"),
            ("all=±10%", "d0=[9/2,11/2] d1=[9/2,11/2]"),
            ("all=±10%, d1=[1,9]", "d0=[9/2,11/2] d1=[1,9]"),
            // A duration is at least 0.
            ("d1=±9", "d0=[5,5] d1=[0,14]"),
        ] {
            let envelope = parse_box(text, &plan).unwrap();
            assert_eq!(write_box(&envelope, &plan), expected, "{text}");
        }
    }

    #[test]
    fn errors_in_box_text_are_reported() {
        let error = |text: &str| parse_box(text, &plan()).unwrap_err();
        assert!(matches!(error("d0"), BoxTextError::Syntax { .. }));
        assert!(matches!(error("d0="), BoxTextError::Syntax { .. }));
        assert!(matches!(error("=[1,2]"), BoxTextError::Syntax { .. }));
        assert!(matches!(error("d0=±-1"), BoxTextError::Syntax { .. }));
        assert!(matches!(error("d0=[1,2"), BoxTextError::Syntax { .. }));
        assert!(matches!(
            error("all=±1 all=±2"),
            BoxTextError::Duplicate { .. }
        ));
        assert!(matches!(error("d0=[7]"), BoxTextError::Syntax { .. }));
        assert!(matches!(error("d0=[1,x]"), BoxTextError::Syntax { .. }));
        assert!(matches!(error("d0=[inf,1]"), BoxTextError::Syntax { .. }));
        assert!(matches!(error("d0=[2,1]"), BoxTextError::Empty { .. }));
        assert!(matches!(
            error("d0=[1,2] d0=[1,2]"),
            BoxTextError::Duplicate { .. }
        ));
        assert_eq!(
            error("xyz=[1,2]").to_string(),
            "there is no parameter `xyz`; the parameters are `d0`, `d1`"
        );
        let mut many = plan();
        let first = many.parameters[0].clone();
        many.parameters.extend((2..20).map(|number| Parameter {
            name: format!("rate_{number}"),
            ..first.clone()
        }));
        assert_eq!(
            parse_box("rte_7=[1,2]", &many).unwrap_err().to_string(),
            "there is no parameter `rte_7`; did you mean `rate_7`?"
        );
    }
}
