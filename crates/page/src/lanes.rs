//! Assignment of actions to the lanes of a chart.

use std::collections::BTreeMap;

use crate::document::Grouping;

/// An action to assign: its name and its time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Occupant<'a> {
    /// `(drive rover depot shelf)`.
    pub(crate) name: &'a str,
    /// Start and end.
    pub(crate) time: (f64, f64),
    /// `true` if the action affects the choice of the initial grouping; `false` for abandoned
    /// steps.
    pub(crate) counts: bool,
}

/// The possible groupings, the position of the initial one, and for each action its lane in each
/// grouping.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lanes {
    pub(crate) groupings: Vec<Grouping>,
    pub(crate) chosen: usize,
    pub(crate) of: Vec<Vec<usize>>,
}

/// The lane of actions without an object of the lanes' type.
const OTHERS: &str = "others";

/// Returns the possible groupings of these actions.
///
/// There is one for each type of object that occurs. It has a lane for each object of the type,
/// with the actions whose first object of that type it is. The initial grouping is the type with
/// the best
/// [`score`]: its objects come early in the names of most actions, and have few overlapping actions.
pub(crate) fn lanes<'a>(
    occupants: &[Occupant<'_>],
    type_of: &dyn Fn(&str) -> Option<&'a str>,
) -> Lanes {
    let mut lanes = Lanes {
        groupings: Vec::new(),
        chosen: 0,
        of: vec![Vec::new(); occupants.len()],
    };
    let mut best: Option<(f64, usize)> = None;
    for kind in kinds(occupants, type_of) {
        let keys: Vec<Option<(usize, &str)>> = occupants
            .iter()
            .map(|occupant| {
                let objects = objects(occupant.name).enumerate();
                let mut of_kind = objects.filter(|(_, name)| kind.matches_object(name, type_of));
                of_kind.next()
            })
            .collect();
        let score = score(occupants, &keys);
        if best.is_none_or(|best| score > best) {
            (best, lanes.chosen) = (Some(score), lanes.groupings.len());
        }
        let keys: Vec<Option<&str>> = keys.iter().map(|key| key.map(|(_, name)| name)).collect();
        lanes.add(kind.name().to_owned(), &keys);
    }
    let actions: Vec<Option<&str>> = occupants
        .iter()
        .map(|occupant| {
            occupant
                .name
                .trim_start_matches('(')
                .split([' ', ')'])
                .next()
        })
        .collect();
    lanes.add("action".to_owned(), &actions);
    lanes
}

/// Returns the lane of each of these actions in the initial grouping, by name. An action has its name, start and end.
/// `type_of` returns the type of an object.
pub fn lanes_of_actions<'a, 't>(
    actions: &[(&'a str, (f64, f64))],
    type_of: &dyn Fn(&str) -> Option<&'t str>,
) -> BTreeMap<&'a str, String> {
    let occupants: Vec<Occupant<'_>> = actions
        .iter()
        .map(|&(name, time)| Occupant {
            name,
            time,
            counts: true,
        })
        .collect();
    let lanes = lanes(&occupants, type_of);
    let grouping = &lanes.groupings[lanes.chosen].lanes;
    let lane = |of: &Vec<usize>| grouping[of[lanes.chosen]].clone();
    let names = actions.iter().map(|(name, _)| *name);
    names.zip(lanes.of.iter().map(lane)).collect()
}

impl Lanes {
    fn add(&mut self, name: String, keys: &[Option<&str>]) {
        let mut positions: BTreeMap<&str, usize> = BTreeMap::new();
        let mut grouping = Grouping {
            name,
            lanes: Vec::new(),
        };
        let mut others = None;
        for key in keys.iter().flatten() {
            positions.entry(key).or_insert_with(|| {
                grouping.lanes.push((*key).to_owned());
                grouping.lanes.len() - 1
            });
        }
        for (of, key) in self.of.iter_mut().zip(keys) {
            of.push(match key {
                Some(key) => positions[key],
                None => *others.get_or_insert(grouping.lanes.len()),
            });
        }
        if others.is_some() {
            grouping.lanes.push(OTHERS.to_owned());
        }
        self.groupings.push(grouping);
    }
}

/// Kind of objects whose lanes form a grouping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind<'a> {
    /// The objects of a type.
    Type(&'a str),
    /// The first object of each action, regardless of its type.
    First,
}

impl<'a> Kind<'a> {
    fn matches_object(self, object: &str, type_of: &dyn Fn(&str) -> Option<&'a str>) -> bool {
        match self {
            Self::Type(name) => type_of(object) == Some(name),
            Self::First => true,
        }
    }

    fn name(self) -> &'a str {
        match self {
            Self::Type(name) => name,
            Self::First => "first object",
        }
    }
}

/// Returns the types in order of occurrence, or [`Kind::First`] if there are no types.
fn kinds<'a>(
    occupants: &[Occupant<'_>],
    type_of: &dyn Fn(&str) -> Option<&'a str>,
) -> Vec<Kind<'a>> {
    let mut kinds = Vec::new();
    for object in occupants.iter().flat_map(|occupant| objects(occupant.name)) {
        if let Some(kind) = type_of(object).filter(|kind| *kind != "object") {
            let kind = Kind::Type(kind);
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
    }
    if kinds.is_empty() && occupants.iter().any(|it| objects(it.name).next().is_some()) {
        kinds.push(Kind::First);
    }
    kinds
}

/// Returns the objects in an action's name.
fn objects(name: &str) -> impl Iterator<Item = &str> {
    name.trim_matches(['(', ')']).split_whitespace().skip(1)
}

/// Rates a grouping. Each action with an object of the kind adds 1 / (1 + its position among the
/// arguments), and subtracts 1 if it overlaps an earlier action on the same lane. Each other action
/// subtracts 1. The second number is that of actions with an object of the kind.
#[allow(
    clippy::cast_precision_loss,
    reason = "positions of arguments are small"
)]
fn score(occupants: &[Occupant<'_>], keys: &[Option<(usize, &str)>]) -> (f64, usize) {
    let mut order: Vec<usize> = (0..occupants.len())
        .filter(|&it| occupants[it].counts)
        .collect();
    order.sort_by(|&a, &b| occupants[a].time.0.total_cmp(&occupants[b].time.0));
    let mut busy: BTreeMap<&str, f64> = BTreeMap::new();
    let (mut score, mut covered) = (0.0, 0);
    for index in order {
        let Some((position, object)) = keys[index] else {
            score -= 1.0;
            continue;
        };
        covered += 1;
        let (start, end) = occupants[index].time;
        let until = busy.entry(object).or_insert(f64::NEG_INFINITY);
        score += 1.0 / (1.0 + position as f64);
        if start < *until {
            score -= 1.0;
        }
        *until = until.max(end);
    }
    (score, covered)
}

#[cfg(test)]
mod tests {
    use super::{Occupant, lanes};

    fn occupant(name: &str, time: (f64, f64)) -> Occupant<'_> {
        Occupant {
            name,
            time,
            counts: true,
        }
    }

    fn type_of(object: &str) -> Option<&'static str> {
        match object {
            "r1" | "r2" => Some("robot"),
            "a" | "b" => Some("place"),
            _ => None,
        }
    }

    #[test]
    fn actions_without_robot_share_a_lane() {
        let occupants = [
            ("(drive r1 a b)", (0.0, 5.0)),
            ("(drive r2 a b)", (0.0, 7.0)),
            ("(open b)", (1.0, 2.0)),
            ("(load r1 b)", (5.1, 6.0)),
        ]
        .map(|(name, time)| occupant(name, time));
        let lanes = lanes(&occupants, &type_of);
        let names: Vec<&str> = lanes.groupings.iter().map(|it| it.name.as_str()).collect();
        assert_eq!(names, ["robot", "place", "action"]);
        assert_eq!(lanes.chosen, 0);
        assert_eq!(lanes.groupings[0].lanes, ["r1", "r2", "others"]);
        assert_eq!(lanes.groupings[1].lanes, ["a", "b"]);
        let by_robot: Vec<usize> = lanes.of.iter().map(|of| of[0]).collect();
        assert_eq!(by_robot, [0, 1, 2, 0]);
    }

    #[test]
    fn objects_with_overlapping_actions_are_not_initial_lanes() {
        let occupants =
            ["(serve a r1)", "(serve a r2)", "(serve a r3)"].map(|name| occupant(name, (0.0, 9.0)));
        let type_of = |object: &str| Some(if object == "a" { "place" } else { "robot" });
        let lanes = lanes(&occupants, &type_of);
        assert_eq!(lanes.groupings[lanes.chosen].name, "robot");
    }

    #[test]
    fn initial_lanes_hold_most_actions() {
        let names = [
            "(load k1 r1)",
            "(load k2 r1)",
            "(drive r1 a b)",
            "(unload k1 r1)",
            "(unload k2 r1)",
        ];
        let times = [0.0, 2.0, 4.0, 6.0, 8.0];
        let occupants: Vec<_> = names
            .iter()
            .zip(times)
            .map(|(name, start)| occupant(name, (start, start + 1.0)))
            .collect();
        let type_of = |object: &str| {
            Some(if object.starts_with('k') {
                "crate"
            } else {
                type_of(object)?
            })
        };
        let lanes = lanes(&occupants, &type_of);
        assert_eq!(lanes.groupings[lanes.chosen].name, "robot");
    }

    #[test]
    fn abandoned_actions_do_not_affect_lane_choice() {
        let mut occupants = ["(drive r1 a)", "(drive r1 b)", "(open b)"].map(|name| Occupant {
            counts: name != "(drive r1 b)",
            ..occupant(name, (0.0, 9.0))
        });
        assert_eq!(lanes(&occupants, &type_of).chosen, 1, "places do as well");
        occupants[2].counts = false;
        assert_eq!(lanes(&occupants, &type_of).chosen, 0);
    }

    #[test]
    fn untyped_lane_is_first_object_or_action() {
        let untyped = [occupant("(go x y)", (0.0, 1.0))];
        let names = |occupants: &[Occupant<'_>]| -> Vec<String> {
            let lanes = lanes(occupants, &|_| None);
            lanes.groupings.into_iter().map(|it| it.name).collect()
        };
        assert_eq!(names(&untyped), ["first object", "action"]);
        assert_eq!(names(&[occupant("(idle)", (0.0, 1.0))]), ["action"]);
        assert_eq!(names(&[]), ["action"]);
    }
}
