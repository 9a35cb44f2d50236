//! Exclusion of self-overlap: instances of one ground action run one after the other.
//!
//! Two instances of an action overlap if each of them starts before the other one has ended. An instance may
//! start when another one ends.
//!
//! Instances of most actions cannot overlap: the start deletes a fact that only the end, or a later action,
//! adds again. A mutex group that contains the running action shows this. For each other action, the latest
//! end becomes an annotation that its starts must follow, and no start is possible while an instance is
//! running.

use elbowroom_model::problem::ObjectId;

use super::compile::{Compiled, NONE};
use super::hash::Map;
use super::mutex::Mutexes;
use super::root::root;

/// Work limit of the search for mutex groups. If a group is not found, an action only gets an
/// unnecessary annotation.
const MAX_WORK: u64 = 2_000_000;

/// Adds exclusions between instances of each ground action that may overlap.
pub(super) fn keep_apart(compiled: &mut Compiled) {
    let mutexes = Mutexes::of(compiled, &root(compiled), MAX_WORK);
    let groups = groups_of_running(compiled, &mutexes);
    for variants in variants(compiled) {
        let starts = |&number: &u32| compiled.action(number).start != NONE;
        let takes_time = |&number: &u32| compiled.action(number).end != NONE;
        let may_overlap = variants.iter().any(starts)
            && variants.iter().any(takes_time)
            && !(variants.iter().all(takes_time) && share_group(&groups, &variants));
        if may_overlap {
            exclude(compiled, &variants);
        }
    }
}

/// Returns the compiled forms of each ground action.
fn variants(compiled: &Compiled) -> Vec<Vec<u32>> {
    let mut places: Map<(u32, &[ObjectId]), usize> = Map::default();
    let mut list: Vec<Vec<u32>> = Vec::new();
    for (number, action) in (0..).zip(&compiled.actions) {
        let key = (action.schema.0, action.arguments.as_slice());
        let place = *places.entry(key).or_insert_with(|| {
            list.push(Vec::new());
            list.len() - 1
        });
        list[place].push(number);
    }
    list
}

/// Returns for each action the mutex groups that contain its running instance.
fn groups_of_running(compiled: &Compiled, mutexes: &Mutexes) -> Vec<Vec<usize>> {
    let mut groups = vec![Vec::new(); compiled.actions.len()];
    for (number, group) in mutexes.groups.iter().enumerate() {
        for &atom in group {
            let running = (atom as usize).checked_sub(compiled.facts.len());
            if let Some(running) = running {
                groups[running].push(number);
            }
        }
    }
    groups
}

fn share_group(groups: &[Vec<usize>], variants: &[u32]) -> bool {
    let Some((&first, others)) = variants.split_first() else {
        return false;
    };
    groups[first as usize].iter().any(|group| {
        let contains = |&other: &u32| groups[other as usize].contains(group);
        others.iter().all(contains)
    })
}

/// Adds the annotation of the latest end. It is greater than all others, so that lists stay sorted.
fn exclude(compiled: &mut Compiled, variants: &[u32]) {
    let annotation = u32::try_from(compiled.annotation_count).expect("fewer than 2^32 annotations");
    compiled.annotation_count += 1;
    for &number in variants {
        let action = &mut compiled.actions[number as usize];
        action.exclusion = annotation;
        let (start, end) = (action.start, action.end);
        if let Some(start) = compiled.snaps.get_mut(start as usize)
            && start.after.last() != Some(&(annotation, 0))
        {
            start.after.push((annotation, 0));
        }
        let last = if end == NONE { start } else { end };
        let last = &mut compiled.snaps[last as usize];
        if last.marks.last() != Some(&annotation) {
            last.marks.push(annotation);
        }
    }
}
