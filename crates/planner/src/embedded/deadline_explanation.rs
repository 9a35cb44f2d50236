//! Explanation of an unreachable goal: the missing parts, and the deadlines that make them
//! unreachable.

use elbowroom_model::Task;
use elbowroom_num::Rational;

use super::answer::Proof;
use super::compile::{Compiled, Compressibility};
use super::formula::Literal;
use super::h2::H2;
use super::relaxed::{Missing, Relaxed};
use super::root::root;
use super::time::Ticks;

/// Maximum number of deadlines that are tested one by one.
const MAX_SUSPECTS: usize = 24;

/// The names used in a proof.
#[derive(Debug)]
pub(crate) struct Names {
    /// By position in [`Compiled::facts`]; empty for facts that no proof mentions.
    facts: Vec<String>,
}

impl Names {
    /// Returns the names of the facts that the goal reads and timed initials change. `task` is the
    /// grounded task.
    pub(crate) fn of(task: &Task, compiled: &Compiled) -> Self {
        let mut facts = vec![String::new(); compiled.facts.len()];
        let mut name = |fact: u32| {
            facts[fact as usize] = task.fact_name(compiled.facts[fact as usize]);
        };
        compiled
            .goal
            .visit_literals(&mut |literal| name(literal.fact()));
        for timed in &compiled.timed {
            timed
                .adds
                .iter()
                .chain(&timed.deletes)
                .for_each(|&fact| name(fact));
        }
        let literals = compiled.calendars.iter().filter_map(|c| c.literal);
        literals.for_each(|literal| name(literal.fact()));
        Self { facts }
    }

    fn literal(&self, literal: Literal) -> String {
        let name = &self.facts[literal.fact() as usize];
        if literal.truth() {
            name.clone()
        } else {
            format!("(not {name})")
        }
    }
}

/// Returns a proof that no plan exists, if timed initials make a part of the goal false for good,
/// or if the goal is unreachable from the initial state even when reached facts are never lost.
pub(crate) fn relaxed_proof(names: &Names, compiled: &Compiled) -> Option<Proof> {
    let uncompressed: Option<Compressibility> = None;
    let initial = root(compiled);
    let mut relaxed = Relaxed::new(compiled, uncompressed);
    if let Some((literal, end)) = relaxed.expired_goal() {
        let end = exact(&compiled.scale.units(end));
        let literal = names.literal(literal);
        let why = format!("`{literal}` is false from {end} on in every plan");
        return Some(Proof::Unreachable(vec![why]));
    }
    if relaxed.evaluate(&initial).is_some() {
        return None;
    }
    let suspects = (0..relaxed.timetable_count()).map(|number| {
        let mut copy = Relaxed::new(compiled, uncompressed);
        copy.ignore_timetable(number)
    });
    let suspects: Vec<_> = suspects.collect();
    let mut fails_without = |ignored: &[usize]| {
        let mut without = Relaxed::new(compiled, uncompressed);
        for &number in ignored {
            without.ignore_timetable(number);
        }
        without.evaluate(&initial).is_none()
    };
    let goal = in_words(names, &relaxed.missing_goals(), " and ");
    Some(build_proof(
        names,
        compiled,
        goal,
        &suspects,
        &mut fails_without,
    ))
}

/// Returns a proof that no plan exists, if two parts of the goal cannot hold together in time. The
/// search for the responsible deadlines stops when `may_continue` returns `false`.
pub(crate) fn pairs_proof(
    names: &Names,
    compiled: &Compiled,
    may_continue: &mut dyn FnMut() -> bool,
) -> Option<Proof> {
    let initial = root(compiled);
    let mut pairs = H2::of(compiled)?;
    if !pairs.is_dead_end(&initial) {
        return None;
    }
    let (missing, are_together) = pairs.missing_goals();
    let joint = if are_together {
        " together with "
    } else {
        " and "
    };
    let goal = in_words(names, &missing, joint);
    let suspects: Vec<_> = (0..pairs.timetable_count())
        .map(|number| {
            let kept = pairs.ignore_timetable(number);
            let suspect = pairs.deadline(number, &kept);
            pairs.restore_timetable(number, kept);
            suspect
        })
        .collect();
    let mut is_stopped = false;
    let mut fails_without = |ignored: &[usize]| {
        is_stopped = is_stopped || !may_continue();
        if is_stopped {
            return true;
        }
        let kept: Vec<_> = ignored
            .iter()
            .map(|&number| (number, pairs.ignore_timetable(number)))
            .collect();
        let is_dead_end = pairs.is_dead_end(&initial);
        for (number, spans) in kept {
            pairs.restore_timetable(number, spans);
        }
        is_dead_end
    };
    Some(build_proof(
        names,
        compiled,
        goal,
        &suspects,
        &mut fails_without,
    ))
}

/// Returns the missing parts of the goal in words, separated by `joint`.
fn in_words(names: &Names, missing: &[Missing], joint: &str) -> String {
    if missing.is_empty() {
        return "the end of a running action".to_owned();
    }
    let parts = missing.iter().map(|missing| match missing {
        Missing::Literal(literal) => format!("`{}`", names.literal(*literal)),
        Missing::Other => "a part of the goal".to_owned(),
    });
    parts.collect::<Vec<String>>().join(joint)
}

/// Returns the proof: the missing parts of the goal, and the deadlines without which it would be
/// reachable.
fn build_proof(
    names: &Names,
    compiled: &Compiled,
    goal: String,
    suspects: &[Option<(Literal, Ticks)>],
    fails_without: &mut dyn FnMut(&[usize]) -> bool,
) -> Proof {
    let guilty = minimal_deadlines(suspects, fails_without);
    if guilty.is_empty() {
        return Proof::Unreachable(vec![format!("{goal} cannot be reached")]);
    }
    let deadlines = guilty.iter().map(|&(literal, end)| {
        let end = exact(&compiled.scale.units(end));
        let verb = if literal.truth() {
            "closes"
        } else {
            "no longer holds"
        };
        format!("`{}` {verb} at {end}", names.literal(literal))
    });
    Proof::TooLate {
        goal,
        deadline: deadlines.collect::<Vec<_>>().join(" and "),
    }
}

/// Returns the number as a decimal if it has at most nine digits after the point, else as a
/// fraction.
fn exact(number: &Rational) -> String {
    let decimals = (3..=9).map(|digits| number.to_decimal(digits));
    let mut decimals = decimals.filter(|text| text.parse().as_ref() == Ok(number));
    decimals.next().unwrap_or_else(|| number.to_string())
}

/// Returns a minimal set of deadlines without which the goal would be reachable: none of them can
/// be omitted. A single deadline is preferred.
fn minimal_deadlines(
    suspects: &[Option<(Literal, Ticks)>],
    fails_without: &mut dyn FnMut(&[usize]) -> bool,
) -> Vec<(Literal, Ticks)> {
    let numbers = (0..suspects.len()).filter(|&number| suspects[number].is_some());
    let mut ignored: Vec<usize> = numbers.collect();
    if ignored.is_empty() || fails_without(&ignored) {
        return Vec::new();
    }
    if ignored.len() <= MAX_SUSPECTS {
        let alone = ignored.iter().find(|&&number| !fails_without(&[number]));
        if let Some(&number) = alone {
            ignored = vec![number];
        } else {
            for number in ignored.clone() {
                let without: Vec<usize> =
                    ignored.iter().copied().filter(|&n| n != number).collect();
                if !fails_without(&without) {
                    ignored = without;
                }
            }
        }
    }
    let found = ignored.iter().filter_map(|&number| suspects[number]);
    found.collect()
}
