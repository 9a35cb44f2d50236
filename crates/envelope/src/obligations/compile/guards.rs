//! Outcomes of conditional effects.

use elbowroom_model::ground::{Body, Change, Condition, Effect};

use super::super::dnf::{Alternatives, WantedTruth};
use super::super::{Obligations, Refusal, Requirement};
use super::{Compiler, Run, add_obligation};
use elbowroom_plan::{InstanceId, Node, NodeId};

/// Identifier of a part of an effect's guard: effects of the start come before those of the end,
/// and those before continuous ones.
pub(super) type GuardId = (InstanceId, usize, GuardPart);

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum GuardPart {
    AtStart,
    Now,
}

impl Compiler<'_> {
    /// Decides every guard that is read at the node. Returns `Some` if the outcome of one is open.
    pub(super) fn decide_guards(
        &self,
        run: &mut Run,
        node: NodeId,
        obligations: &mut Obligations,
    ) -> Result<Option<Vec<Run>>, Refusal> {
        for (id, guard) in self.guards_read_at(node)? {
            if run.outcomes.contains_key(&id) {
                continue;
            }
            let (instance, index, _) = id;
            if run.outcomes.get(&(instance, index, GuardPart::AtStart)) == Some(&false) {
                // The effect does not take place, whatever the rest of its guard.
                run.outcomes.insert(id, false);
                continue;
            }
            let reading = self.reading(&run.timeline, node);
            let held = reading.alternatives(guard, WantedTruth::True)?;
            let broken = reading.alternatives(guard, WantedTruth::False)?;
            let silent = reading.undefined_cases(guard)?;
            add_obligation(
                obligations,
                Requirement::Defined { node },
                &run.timeline,
                silent,
            );
            if broken.is_empty() {
                run.outcomes.insert(id, true);
            } else if held.is_empty() {
                run.outcomes.insert(id, false);
            } else {
                let branch = |outcome: bool, alternatives: Alternatives| {
                    alternatives
                        .into_iter()
                        .map(|assumed| {
                            let mut branch = run.clone();
                            branch.outcomes.insert(id, outcome);
                            branch.timeline.assumptions.extend(assumed);
                            branch
                        })
                        .collect::<Vec<_>>()
                };
                return Ok(Some([branch(true, held), branch(false, broken)].concat()));
            }
        }
        Ok(None)
    }

    /// Returns the non-trivial guards read on arrival at a node.
    pub(super) fn guards_read_at(
        &self,
        node: NodeId,
    ) -> Result<Vec<(GuardId, &Condition)>, Refusal> {
        let (instance, is_end) = match self.plan.plan.nodes[node.index()] {
            Node::Zero | Node::Timed(_) => return Ok(Vec::new()),
            Node::Start(id) | Node::Instant(id) => (id, false),
            Node::End(id) => (id, true),
        };
        let action = &self.plan.plan.instance(instance).action;
        let mut guards = Vec::new();
        let mut read = |index: usize, part: GuardPart, condition| {
            guards.push(((instance, index, part), condition));
        };
        match &action.body {
            Body::Instantaneous(snap) => {
                for (index, effect) in snap.effects.iter().enumerate() {
                    read(index, GuardPart::Now, &effect.guard.now);
                }
            }
            Body::Durative(body) => {
                let ends = body.start.effects.len();
                let continuous = ends + body.end.effects.len();
                let over_all = body.end.effects.iter().map(|effect| &effect.guard);
                let over_all = over_all.chain(body.continuous.iter().map(|effect| &effect.guard));
                if over_all
                    .into_iter()
                    .any(|guard| !guard.over_all.is_trivial())
                {
                    return Err(Refusal::GuardOverAll {
                        place: action.name.clone(),
                    });
                }
                if is_end {
                    for (index, effect) in body.end.effects.iter().enumerate() {
                        read(ends + index, GuardPart::Now, &effect.guard.now);
                    }
                } else {
                    for (index, effect) in body.start.effects.iter().enumerate() {
                        read(index, GuardPart::Now, &effect.guard.now);
                    }
                    for (index, effect) in body.end.effects.iter().enumerate() {
                        read(ends + index, GuardPart::AtStart, &effect.guard.at_start);
                    }
                    for (index, effect) in body.continuous.iter().enumerate() {
                        read(
                            continuous + index,
                            GuardPart::AtStart,
                            &effect.guard.at_start,
                        );
                    }
                }
            }
        }
        guards.retain(|(_, condition)| !condition.is_trivial());
        Ok(guards)
    }
}

/// Returns the changes of effects, each with `true` if its guard holds in this run.
pub(super) fn effects<'e>(
    run: &Run,
    instance: InstanceId,
    first: usize,
    effects: &'e [Effect],
) -> Vec<(&'e Change, bool)> {
    effects
        .iter()
        .enumerate()
        .map(|(index, effect)| {
            let held = |part| run.outcomes.get(&(instance, first + index, part)) != Some(&false);
            (
                &effect.change,
                held(GuardPart::Now) && held(GuardPart::AtStart),
            )
        })
        .collect()
}
