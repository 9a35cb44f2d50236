//! From a long conflict to shorter ones: [`Shortcuts`].
//!
//! Windows and deadlines bind time points to the beginning. A cycle along many of them is one
//! conflict, the most violated one, and says little about narrower boxes: these are rejected by
//! slightly shorter cycles, one after the other. Divided at the points that are bound to the
//! beginning, the cycle yields short ones, which have fewer ends and often imply it.

use std::ops::RangeInclusive;

use elbowroom_num::Rational;
use elbowroom_plan::DecoupledEnvelope;
use elbowroom_stn::uncertain::{LinkId, Part, Refutation, RefutationPath};
use elbowroom_stn::{ConstraintId, NodeId};

use super::{Reader, steps, whole_cycle_cut};
use crate::cut::Cut;

/// Limit on the steps from the point where a cycle is divided back to its beginning.
const MAX_BACKTRACK: usize = 64;

/// Bound on the difference of a node and the beginning, with the parts that imply it.
#[derive(Clone)]
struct Chord {
    length: Rational,
    parts: Vec<Part>,
}

/// Bounds between nodes and the beginning, through no other node whose time is open.
pub(super) struct Shortcuts {
    /// By node: the greatest distance after the beginning.
    after: Vec<Option<Chord>>,
    /// By node: the negated least distance after the beginning.
    before: Vec<Option<Chord>>,
}

/// Step of a cycle, with its length and target.
struct Step {
    to: NodeId,
    part: Part,
    length: Rational,
}

impl Shortcuts {
    pub(super) fn new(reader: &Reader<'_>) -> Self {
        let origin = NodeId(0);
        let network = reader.network.network.requirements();
        let none = vec![None; network.node_count()];
        let mut fixed = Self {
            after: none.clone(),
            before: none,
        };
        for side in [&mut fixed.after, &mut fixed.before] {
            side[origin.index()] = Some(Chord {
                length: Rational::ZERO,
                parts: Vec::new(),
            });
        }
        for (node, after, before) in fixed_pairs(reader, origin) {
            keep_least(&mut fixed.after, node, after);
            keep_least(&mut fixed.before, node, before);
        }
        let mut all = Self {
            after: fixed.after.clone(),
            before: fixed.before.clone(),
        };
        for id in network.constraint_ids() {
            let constraint = network.constraint(id);
            if let Some(chord) = &fixed.after[constraint.from.index()] {
                let mut parts = chord.parts.clone();
                parts.push(Part::Requirement(id));
                let length = &chord.length + &constraint.bound;
                keep_least(&mut all.after, constraint.to, Chord { length, parts });
            }
            if let Some(chord) = &fixed.before[constraint.to.index()] {
                let mut parts = vec![Part::Requirement(id)];
                parts.extend(chord.parts.iter().cloned());
                let length = &chord.length + &constraint.bound;
                keep_least(&mut all.before, constraint.from, Chord { length, parts });
            }
        }
        all
    }

    /// Returns the cuts of the shortest cycles that result from dividing a conflict at nodes that
    /// are bound to the beginning, provided that they exclude all schedules; none if the conflict
    /// is one of these itself.
    pub(super) fn short_cycle_cuts(
        &self,
        reader: &Reader<'_>,
        refutation: &Refutation,
        envelope: &DecoupledEnvelope,
    ) -> Vec<Cut> {
        let Some(steps) = measure(reader, &refutation.cycle, envelope) else {
            return Vec::new();
        };
        let mut found = Vec::new();
        let mut ranges = Vec::new();
        // The beginning of the last range found; ranges that begin there or before include it.
        let mut beginning = 0;
        for end in 0..steps.len() {
            let Some(back) = &self.before[steps[end].to.index()] else {
                continue;
            };
            let mut length = back.length.clone();
            for begin in (beginning..=end).rev().take(MAX_BACKTRACK) {
                length += &steps[begin].length;
                let from = node_before(&steps, begin);
                let Some(first) = &self.after[from.index()] else {
                    continue;
                };
                if (&length + &first.length).is_negative() && end + 1 - begin < steps.len() {
                    let range = begin..=end;
                    found.extend(self.cycle_cut(reader, &steps, &range, envelope));
                    ranges.push(range);
                    beginning = begin + 1;
                    break;
                }
            }
        }
        found.extend(self.joined(reader, &steps, ranges, envelope));
        found
    }

    /// Returns the cuts of cycles along two consecutive ranges, four, eight and so on. A longer
    /// cycle often leaves a little less slack for each step than a shorter one. Without these cuts,
    /// each check would find a cycle with one range more.
    fn joined(
        &self,
        reader: &Reader<'_>,
        steps: &[Step],
        mut ranges: Vec<RangeInclusive<usize>>,
        envelope: &DecoupledEnvelope,
    ) -> Vec<Cut> {
        let mut found = Vec::new();
        while ranges.len() > 1 {
            let mut next = Vec::new();
            for pair in ranges.chunks(2) {
                let [one, other] = pair else {
                    next.extend_from_slice(pair);
                    continue;
                };
                let range = *one.start()..=*other.end();
                found.extend(self.cycle_cut(reader, steps, &range, envelope));
                next.push(range);
            }
            ranges = next;
        }
        found
    }

    /// Returns the cut of the cycle from the beginning along these steps, and back.
    fn cycle_cut(
        &self,
        reader: &Reader<'_>,
        steps: &[Step],
        range: &RangeInclusive<usize>,
        envelope: &DecoupledEnvelope,
    ) -> Option<Cut> {
        let first = self.after[node_before(steps, *range.start()).index()].as_ref()?;
        let back = self.before[steps[*range.end()].to.index()].as_ref()?;
        let own = steps[range.clone()].iter().map(|step| &step.part);
        let parts = first.parts.iter().chain(own).chain(&back.parts);
        whole_cycle_cut(reader, parts, envelope)
    }
}

/// Returns the node at which a step of a cycle begins.
fn node_before(steps: &[Step], index: usize) -> NodeId {
    steps[index.checked_sub(1).unwrap_or(steps.len() - 1)].to
}

fn keep_least(chords: &mut [Option<Chord>], node: NodeId, chord: Chord) {
    let known = &mut chords[node.index()];
    if known
        .as_ref()
        .is_none_or(|known| chord.length < known.length)
    {
        *known = Some(chord);
    }
}

/// Returns the nodes whose distance from the beginning is fixed, with the bounds that fix it from
/// both sides.
fn fixed_pairs(reader: &Reader<'_>, origin: NodeId) -> Vec<(NodeId, Chord, Chord)> {
    let network = &reader.network.network;
    let requirements = network.requirements();
    let chord = |length: Rational, part| Chord {
        length,
        parts: vec![part],
    };
    let mut after: Vec<Option<ConstraintId>> = vec![None; requirements.node_count()];
    for id in requirements.leaving(origin) {
        after[requirements.constraint(id).to.index()] = Some(id);
    }
    let fixed = requirements.entering(origin).filter_map(|back| {
        let node = requirements.constraint(back).from;
        let there = after[node.index()]?;
        let bounds = [there, back].map(|id| &requirements.constraint(id).bound);
        (bounds[0] + bounds[1]).is_zero().then(|| {
            let after = chord(bounds[0].clone(), Part::Requirement(there));
            let before = chord(bounds[1].clone(), Part::Requirement(back));
            (node, after, before)
        })
    });
    let links = network.link_ids().filter_map(|id: LinkId| {
        let link = network.link(id);
        let is_fixed = link.activation == origin && link.upper.as_ref() == Some(&link.lower);
        is_fixed.then(|| {
            let after = chord(link.lower.clone(), Part::Early(id));
            (link.end, after, chord(-&link.lower, Part::Late(id)))
        })
    });
    fixed.chain(links).collect()
}

/// Returns the steps of a cycle with their lengths; `None` if one of them is infinite.
fn measure(
    reader: &Reader<'_>,
    cycle: &[RefutationPath],
    envelope: &DecoupledEnvelope,
) -> Option<Vec<Step>> {
    let network = &reader.network.network;
    let step = |part: &Part| {
        let to = match part {
            Part::Requirement(id) => network.requirements().constraint(*id).to,
            Part::Early(id) => network.link(*id).end,
            Part::Late(id) => network.link(*id).activation,
            Part::Path(_) => return None,
        };
        Some(Step {
            to,
            part: part.clone(),
            length: reader.step_length(part)?.0.value(envelope)?,
        })
    };
    steps(cycle).map(step).collect()
}
