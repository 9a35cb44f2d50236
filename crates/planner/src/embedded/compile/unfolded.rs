//! Derived facts that depend on numbers, replaced by the bodies of their rules.
//!
//! The search does not know the truth of a derived fact that reads numbers which depend on times. Its
//! definition is a condition on these numbers, and so a constraint on the times.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Condition, FactId, Guard, SnapAction};
use elbowroom_model::reachability::Grounding;

/// Maximum number of parts of all definitions together.
const MAX_PARTS: usize = 2_000;

/// Returns the grounding without derived facts that read numbers, or `None` if there are none, some
/// depend on themselves, or their definitions are too long.
pub(super) fn unfolded(grounding: &Grounding) -> Option<Grounding> {
    let heads = numeric_heads(grounding);
    if heads.is_empty() {
        return None;
    }
    let mut definitions = Definitions::default();
    for rule in &grounding.rules {
        if heads.contains(&rule.head) {
            definitions
                .bodies
                .entry(rule.head)
                .or_default()
                .push(&rule.body);
        }
    }
    for &head in &heads {
        definitions.define(head)?;
    }
    definitions.is_complete = true;
    let mut result = grounding.clone();
    result.rules.retain(|rule| !heads.contains(&rule.head));
    result.goal = definitions.unfold(&grounding.goal)?;
    for action in &mut result.actions {
        definitions.unfold_action(action)?;
    }
    Some(result)
}

/// Returns the derived facts that read numbers, directly or through other derived facts.
fn numeric_heads(grounding: &Grounding) -> BTreeSet<FactId> {
    let mut heads = BTreeSet::new();
    loop {
        let before = heads.len();
        for rule in &grounding.rules {
            let mut is_numeric = false;
            rule.body.visit_fluents(&mut |_| is_numeric = true);
            rule.body
                .visit_facts(&mut |fact| is_numeric |= heads.contains(&fact));
            if is_numeric {
                heads.insert(rule.head);
            }
        }
        if heads.len() == before {
            return heads;
        }
    }
}

#[derive(Default)]
struct Definitions<'a> {
    bodies: BTreeMap<FactId, Vec<&'a Condition>>,
    /// `None` while it is being unfolded.
    of: BTreeMap<FactId, Option<Condition>>,
    parts: usize,
    is_complete: bool,
}

impl Definitions<'_> {
    fn define(&mut self, head: FactId) -> Option<Condition> {
        if let Some(known) = self.of.get(&head) {
            return known.clone();
        }
        self.of.insert(head, None);
        let bodies = self.bodies.get(&head)?.clone();
        let bodies: Option<Vec<Condition>> = bodies.iter().map(|body| self.unfold(body)).collect();
        let definition = Condition::Or(bodies?);
        self.of.insert(head, Some(definition.clone()));
        Some(definition)
    }

    fn unfold(&mut self, condition: &Condition) -> Option<Condition> {
        self.parts += usize::from(!self.is_complete);
        if self.parts > MAX_PARTS {
            return None;
        }
        Some(match condition {
            Condition::Fact(fact) if self.bodies.contains_key(fact) => self.define(*fact)?,
            Condition::Fact(_) | Condition::Compare(..) => condition.clone(),
            Condition::Not(part) => Condition::Not(Box::new(self.unfold(part)?)),
            Condition::And(parts) => Condition::And(self.unfold_all(parts)?),
            Condition::Or(parts) => Condition::Or(self.unfold_all(parts)?),
        })
    }

    fn unfold_all(&mut self, parts: &[Condition]) -> Option<Vec<Condition>> {
        parts.iter().map(|part| self.unfold(part)).collect()
    }

    fn unfold_guard(&mut self, guard: &mut Guard) -> Option<()> {
        for part in [&mut guard.at_start, &mut guard.over_all, &mut guard.now] {
            *part = self.unfold(part)?;
        }
        Some(())
    }

    fn unfold_snap(&mut self, snap: &mut SnapAction) -> Option<()> {
        snap.condition = self.unfold(&snap.condition)?;
        for effect in &mut snap.effects {
            self.unfold_guard(&mut effect.guard)?;
        }
        Some(())
    }

    fn unfold_action(&mut self, action: &mut Action) -> Option<()> {
        match &mut action.body {
            Body::Instantaneous(snap) => self.unfold_snap(snap),
            Body::Durative(body) => {
                self.unfold_snap(Arc::make_mut(&mut body.start))?;
                body.over_all = self.unfold(&body.over_all)?;
                self.unfold_snap(Arc::make_mut(&mut body.end))?;
                for effect in &mut body.continuous {
                    self.unfold_guard(&mut effect.guard)?;
                }
                Some(())
            }
        }
    }
}
