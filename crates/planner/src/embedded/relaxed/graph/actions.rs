//! Conversion of actions to operators.

use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

use super::super::super::compile::{
    Action, Change, Compiled, Compressibility, Flow, NONE, Snap, Update,
};
use super::super::super::formula::{Numeric, Test};
use super::super::super::hash::Map;
use super::super::super::time::{NEVER, Ticks};
use super::super::numbers;
use super::{Gain, Graph, Kind, Stays};

/// An operator before it enters the graph.
pub(super) struct Draft<'a> {
    pub(super) kind: Kind,
    pub(super) needs: Vec<u32>,
    pub(super) is_running: Option<u32>,
    /// Stays that it adds.
    pub(super) offers: Vec<u32>,
    pub(super) action: &'a Action,
    pub(super) snaps: &'a [&'a Snap],
}

impl Graph {
    /// Adds the operators of an action. The start gets a separate operator only if `starts_alone`.
    pub(super) fn add_action(
        &mut self,
        compiled: &Compiled,
        stays: &Stays,
        number: u32,
        compresses: Option<Compressibility>,
        starts_alone: bool,
    ) {
        let action = compiled.action(number);
        if action.end == NONE {
            let snap = compiled.snap(action.start);
            let needs = self.propositions(&snap.condition);
            self.start_of[number as usize] = self.add_snaps(
                compiled,
                &Draft {
                    kind: Kind::Start(number),
                    needs,
                    is_running: None,
                    offers: Vec::new(),
                    action,
                    snaps: &[snap],
                },
            );
            return;
        }
        let end = compiled.snap(action.end);
        let running = self.running(number);
        let mut end_needs = self.propositions(&end.condition);
        if action.start != NONE && starts_alone {
            let start = compiled.snap(action.start);
            let mut needs = self.propositions(&start.condition);
            needs.extend(self.propositions(&compiled.needed_before_start(action)));
            needs.extend(stays.needs(compiled, action));
            let gained: Vec<u32> = effects_of(start).collect();
            let literals = action.over_all.literals.iter().map(|literal| literal.0);
            let tests = action.over_all.tests.iter().map(|&test| self.test(test));
            let over_all: Vec<u32> = literals.chain(tests).collect();
            let is_compressed = compresses
                .is_some_and(|compresses| action.compressibility >= compresses)
                && end_needs
                    .iter()
                    .all(|need| over_all.contains(need) || gained.contains(need));
            let (snaps, kind) = if is_compressed {
                (vec![start, end], Kind::Compressed(number))
            } else {
                (vec![start], Kind::Start(number))
            };
            self.start_of[number as usize] = self.add_snaps(
                compiled,
                &Draft {
                    kind,
                    needs,
                    is_running: (!is_compressed).then_some(running),
                    offers: stays.offers(compiled, number).collect(),
                    action,
                    snaps: &snaps,
                },
            );
        }
        end_needs.push(running);
        self.end_of[number as usize] = self.add_snaps(
            compiled,
            &Draft {
                kind: Kind::End(number),
                needs: end_needs,
                is_running: None,
                offers: Vec::new(),
                action,
                snaps: &[end],
            },
        );
    }

    /// Adds an operator for the snaps together, and one for each conditional effect.
    fn add_snaps(&mut self, compiled: &Compiled, draft: &Draft<'_>) -> u32 {
        let least = least_ticks(compiled, draft.action);
        let mut effects: Vec<(u32, Ticks)> = Vec::new();
        effects.extend(draft.is_running.map(|running| (running, least)));
        effects.extend(draft.offers.iter().map(|&stay| (stay, 0)));
        for (snap, delay) in draft.snaps.iter().zip([0, least]) {
            effects.extend(effects_of(snap).map(|effect| (effect, delay)));
        }
        let span = if draft.snaps.len() > 1 { least } else { 0 };
        let updates: Vec<&Update> = draft.snaps.iter().flat_map(|snap| &snap.updates).collect();
        let mut gains = self.gains_of(compiled, &updates);
        for flow in &draft.action.flows {
            self.add_flow_gain(compiled, flow, &mut gains);
        }
        let windows = self.windows_of(compiled, draft);
        let operator = self.add(draft.kind, 1, draft.needs.clone(), &effects, gains);
        self.operators[operator as usize].windows = windows.clone();
        self.operators[operator as usize].span = span;
        for effect in draft.snaps.iter().flat_map(|snap| &snap.conditional) {
            let mut needs = draft.needs.clone();
            needs.extend(self.propositions(&effect.now));
            if let Some(guard) = effect.at_start
                && !matches!(draft.kind, Kind::End(_))
            {
                needs.extend(self.propositions(&draft.action.guards[guard as usize]));
            }
            let (effects, gains) = match &effect.change {
                Change::Add(fact) => (vec![(2 * fact, 0)], Vec::new()),
                Change::Delete(fact) => (vec![(2 * fact + 1, 0)], Vec::new()),
                Change::Update(update) => (Vec::new(), self.gains_of(compiled, &[update])),
                Change::Cost(_) => continue,
            };
            let extra = self.add(draft.kind, 1, needs, &effects, gains);
            self.operators[extra as usize].is_step = false;
            self.operators[extra as usize].windows = windows.clone();
        }
        operator
    }

    pub(super) fn gains_of(&self, compiled: &Compiled, updates: &[&Update]) -> Vec<(u32, Gain)> {
        let mut gains: Vec<(u32, Gain)> = Vec::new();
        // A fluent can occur in as many tests as there are actions.
        let mut known: Map<u32, ()> = Map::default();
        for update in updates {
            for &test in &self.tests_of_fluent[update.fluent as usize] {
                if updates.len() == 1 || known.insert(test, ()).is_none() {
                    let gain = numbers::gain(compiled, test, updates);
                    if gain != Gain::Adds(0.0) {
                        gains.push((test, gain));
                    }
                }
            }
        }
        gains
    }

    /// Adds the gains of a continuous change, which may reach any value in its direction.
    pub(super) fn add_flow_gain(
        &self,
        compiled: &Compiled,
        flow: &Flow,
        gains: &mut Vec<(u32, Gain)>,
    ) {
        let Some(rate) = flow.rate.as_constant() else {
            self.add_any_gain(flow.fluent, gains);
            return;
        };
        for &test in &self.tests_of_fluent[flow.fluent as usize] {
            let data = &compiled.tests[test as usize];
            if may_help(data, flow.fluent, rate) {
                gains.retain(|(known, _)| *known != test);
                gains.push((test, Gain::Reaches(0)));
            }
        }
    }

    /// Adds every gain of the fluent that a test can require.
    pub(super) fn add_any_gain(&self, fluent: u32, gains: &mut Vec<(u32, Gain)>) {
        for &test in &self.tests_of_fluent[fluent as usize] {
            gains.retain(|(known, _)| *known != test);
            gains.push((test, Gain::Reaches(0)));
        }
    }
}

/// Returns `true` if a test may pass because a fluent grows at a rate.
fn may_help(test: &Test, fluent: u32, rate: &Rational) -> bool {
    let Numeric::Linear(linear) = &test.difference else {
        return !rate.is_zero();
    };
    let of_fluent = linear.terms.iter().find(|(other, _)| *other == fluent);
    let slope = of_fluent.map_or(Rational::ZERO, |(_, coefficient)| coefficient * rate);
    match test.comparison {
        Comparison::Less | Comparison::AtMost => slope.is_negative(),
        Comparison::Equal => !slope.is_zero(),
        Comparison::AtLeast | Comparison::Greater => slope.is_positive(),
    }
}

/// Returns the least duration of an action, where it does not depend on the state.
pub(super) fn least_ticks(compiled: &Compiled, action: &Action) -> Ticks {
    compiled.scale.floor(&action.duration.least).0
}

/// Returns the greatest duration of an action, where it does not depend on the state; [`NEVER`] if
/// there is no bound.
pub(super) fn most_ticks(compiled: &Compiled, action: &Action) -> Ticks {
    let most = action.duration.most.as_ref();
    most.map_or(NEVER, |most| compiled.scale.ceil(most).0)
}

pub(super) fn effects_of(snap: &Snap) -> impl Iterator<Item = u32> + '_ {
    let adds = snap.adds.iter().map(|fact| 2 * fact);
    adds.chain(snap.deletes.iter().map(|fact| 2 * fact + 1))
}
