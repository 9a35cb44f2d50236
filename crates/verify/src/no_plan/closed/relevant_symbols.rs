//! Facts and fluents that are relevant in states.

use std::collections::BTreeSet;

use elbowroom_model::ground::{
    Body, Change, Condition, Effect, Expression, FactId, FluentId, SnapAction,
};

use crate::no_plan::instances::Instances;
use crate::no_plan::processes::Process;

/// Sets of relevant facts and fluents.
#[derive(Debug, Default)]
pub(super) struct RelevantSymbols {
    /// Facts that something reads.
    pub(super) read: BTreeSet<FactId>,
    /// Read facts that something changes.
    pub(super) facts: BTreeSet<FactId>,
    /// Changing facts that are read only positively, and not by conditions of effects.
    pub(super) harmless_when_true: BTreeSet<FactId>,
    /// Fluents that something reads.
    pub(super) read_fluents: BTreeSet<FluentId>,
    /// Read fluents that something changes, but not continuously.
    pub(super) fluents: BTreeSet<FluentId>,
    /// Read fluents that change continuously.
    pub(super) flowing: BTreeSet<FluentId>,
    read_exactly: BTreeSet<FactId>,
    changed: BTreeSet<FactId>,
    changed_fluents: BTreeSet<FluentId>,
}

impl RelevantSymbols {
    pub(super) fn of(instances: &Instances, processes: &[Process]) -> Self {
        let mut own = Self::default();
        own.read(instances.task.goal(), true);
        for process in processes {
            match &process.body {
                Body::Instantaneous(snap) => own.read_snap(snap),
                Body::Durative(body) => {
                    own.read_snap(&body.start);
                    own.read_snap(&body.end);
                    own.read(&body.over_all, true);
                    for bound in &body.duration {
                        own.read_expression(&bound.bound);
                    }
                    let flows = body.continuous.iter().map(|effect| effect.fluent);
                    own.flowing.extend(flows);
                }
            }
        }
        for happening in &instances.initial.timed {
            own.note(&happening.changes.iter().collect::<Vec<_>>());
        }
        // Fluents that determine the value of a relevant fluent are relevant.
        loop {
            let before = own.read_fluents.len();
            for process in processes {
                let effects = effects(&process.body);
                own.read_sources(&effects);
            }
            if own.read_fluents.len() == before {
                break;
            }
        }
        own.facts = own.read.intersection(&own.changed).copied().collect();
        own.harmless_when_true = own.facts.difference(&own.read_exactly).copied().collect();
        let changed = own.read_fluents.intersection(&own.changed_fluents);
        own.fluents = changed.copied().collect();
        own.fluents.retain(|fluent| !own.flowing.contains(fluent));
        own
    }

    fn read(&mut self, condition: &Condition, is_wanted: bool) {
        match condition {
            Condition::Fact(fact) => {
                self.read.insert(*fact);
                if !is_wanted {
                    self.read_exactly.insert(*fact);
                }
            }
            Condition::Compare(_, left, right) => {
                self.read_expression(left);
                self.read_expression(right);
            }
            Condition::Not(part) => self.read(part, !is_wanted),
            Condition::And(parts) | Condition::Or(parts) => {
                for part in parts {
                    self.read(part, is_wanted);
                }
            }
        }
    }

    fn read_expression(&mut self, expression: &Expression) {
        expression.visit_fluents(&mut |fluent| {
            self.read_fluents.insert(fluent);
        });
    }

    fn read_snap(&mut self, snap: &SnapAction) {
        self.read(&snap.condition, true);
        for effect in &snap.effects {
            self.read(&effect.guard.now, true);
            self.read(&effect.guard.now, false);
        }
        self.note(
            &snap
                .effects
                .iter()
                .map(|effect| &effect.change)
                .collect::<Vec<_>>(),
        );
    }

    fn note(&mut self, changes: &[&Change]) {
        for change in changes {
            match change {
                Change::Add(fact) | Change::Delete(fact) => {
                    self.changed.insert(*fact);
                }
                Change::Update { fluent, .. } => {
                    self.changed_fluents.insert(*fluent);
                }
            }
        }
    }

    fn read_sources(&mut self, effects: &[&Effect]) {
        for effect in effects {
            if let Change::Update { fluent, value, .. } = &effect.change
                && self.read_fluents.contains(fluent)
            {
                self.read_expression(value);
            }
        }
    }
}

fn effects(body: &Body) -> Vec<&Effect> {
    match body {
        Body::Instantaneous(snap) => snap.effects.iter().collect(),
        Body::Durative(body) => body.start.effects.iter().chain(&body.end.effects).collect(),
    }
}
