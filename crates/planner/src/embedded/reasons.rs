//! Why the goal is out of reach even when nothing that was reached is ever lost.

use elbowroom_model::Task;

use super::answer::Proof;
use super::compile::{Compiled, Eagerness};
use super::formula::Literal;
use super::relaxed::{Missing, Relaxed};

/// A proof that no plan exists, if the relaxed goal is out of reach from the beginning.
pub(crate) fn relaxed_proof(task: &Task, compiled: &Compiled) -> Option<Proof> {
    let no_haste: Option<Eagerness> = None;
    let mut relaxed = Relaxed::new(compiled, no_haste);
    if relaxed.evaluate(&compiled.initial).is_some() {
        return None;
    }
    let name = |literal: Literal| {
        let name = task.fact_name(compiled.facts[literal.fact() as usize]);
        if literal.truth() {
            name
        } else {
            format!("(not {name})")
        }
    };
    let goals: Vec<String> = relaxed
        .missing_goals()
        .iter()
        .map(|missing| match missing {
            Missing::Literal(literal) => format!("`{}`", name(*literal)),
            Missing::Other => "a part of the goal".to_owned(),
        })
        .collect();
    let what = if goals.is_empty() {
        "the end of an action under way".to_owned()
    } else {
        goals.join(" and ")
    };
    // The deadline without which it would be within reach is to blame.
    for number in 0..relaxed.timetable_count() {
        let mut without = Relaxed::new(compiled, no_haste);
        let Some((literal, end)) = without.ignore_timetable(number) else {
            continue;
        };
        if without.evaluate(&compiled.initial).is_some() {
            let end = compiled.scale.units(end).to_decimal(3);
            let (name, closes) = if literal.truth() {
                (name(literal), "closes")
            } else {
                (name(literal), "no longer holds")
            };
            return Some(Proof::TooLate {
                goal: what,
                deadline: format!("`{name}` {closes} at {end}"),
            });
        }
    }
    Some(Proof::Unreachable(vec![format!(
        "{what} cannot be reached"
    )]))
}
