//! Evaluation of one stratum of mutually dependent facts by counting.
//!
//! The bodies of the rules, with negations moved to the leaves, are a circuit of gates. A gate
//! counts the parts that it still needs. Each part that becomes true is propagated once.

use std::collections::{BTreeMap, VecDeque};

use super::{Derivation, Derived, GroundRule, Moment, holds};
use crate::ground::{Condition, FactId};

/// Evaluates the facts of a stratum. The strata below it have been evaluated.
pub(super) fn evaluate_stratum<F: Clone>(
    derivation: &Derivation,
    stratum: &[FactId],
    basic: &dyn Moment<F>,
    derived: &mut Derived<F>,
) {
    let mut circuit = Circuit::default();
    for &fact in stratum {
        circuit.watchers.insert(fact, Vec::new());
    }
    {
        let below = derivation.with_derived_facts(basic, derived);
        for rule in stratum.iter().flat_map(|&fact| derivation.rules_of(fact)) {
            let gate = circuit.gate(1, Output::Head(rule));
            circuit.connect(&rule.body, true, gate, &below);
        }
    }
    let certain = std::mem::take(&mut circuit.certain);
    circuit.run(certain, |rule| {
        let is_new = !derived.holds(rule.head);
        derived.holding[rule.head.index()] = true;
        is_new
    });
    // From here on, undefined parts count as true. A rule whose gate is completed now depends on an
    // undefined part.
    let unclear = std::mem::take(&mut circuit.unclear);
    circuit.run(unclear, |rule| {
        if derived.is_settled(rule.head) {
            return false;
        }
        let truth = holds(&rule.body, &derivation.with_derived_facts(basic, derived));
        match truth {
            Err(fault) => derived.set_unclear(rule.head, fault),
            Ok(_) => {
                unreachable!("the rule depends on an undefined part, so it cannot be evaluated")
            }
        }
        true
    });
}

#[derive(Default)]
struct Circuit<'a> {
    gates: Vec<Gate<'a>>,
    /// For each fact of the stratum, the gates that it is a part of, with multiplicity.
    watchers: BTreeMap<FactId, Vec<usize>>,
    /// Gates with a true part, with multiplicity.
    certain: VecDeque<usize>,
    /// Gates with an undefined part, with multiplicity.
    unclear: VecDeque<usize>,
}

struct Gate<'a> {
    missing: usize,
    output: Output<'a>,
}

#[derive(Clone, Copy)]
enum Output<'a> {
    Gate(usize),
    Head(&'a GroundRule),
}

impl<'a> Circuit<'a> {
    fn gate(&mut self, missing: usize, output: Output<'a>) -> usize {
        self.gates.push(Gate { missing, output });
        self.gates.len() - 1
    }

    /// Makes the condition, or its negation unless `sign`, a part of the gate.
    fn connect<F>(
        &mut self,
        condition: &Condition,
        sign: bool,
        gate: usize,
        below: &dyn Moment<F>,
    ) {
        let (parts, is_conjunction) = match condition {
            Condition::Not(part) => return self.connect(part, !sign, gate, below),
            Condition::Fact(fact) => {
                if let Some(watchers) = self.watchers.get_mut(fact) {
                    debug_assert!(sign, "no fact is negated within its stratum");
                    return watchers.push(gate);
                }
                return self.add_input(&holds(condition, below), sign, gate);
            }
            Condition::Compare(..) => return self.add_input(&holds(condition, below), sign, gate),
            Condition::And(parts) => (parts, sign),
            Condition::Or(parts) => (parts, !sign),
        };
        if is_conjunction && parts.is_empty() {
            return self.certain.push_back(gate);
        }
        let missing = if is_conjunction { parts.len() } else { 1 };
        let own = self.gate(missing, Output::Gate(gate));
        for part in parts {
            self.connect(part, sign, own, below);
        }
    }

    fn add_input<F>(&mut self, truth: &Result<bool, F>, sign: bool, gate: usize) {
        match truth {
            Ok(truth) if *truth == sign => self.certain.push_back(gate),
            Ok(_) => {}
            Err(_) => self.unclear.push_back(gate),
        }
    }

    /// Counts one part for each entry of the queue, and propagates completed gates. `accept`
    /// returns `true` if a completed rule determines its head.
    fn run(&mut self, mut queue: VecDeque<usize>, mut accept: impl FnMut(&GroundRule) -> bool) {
        while let Some(gate) = queue.pop_front() {
            let gate = &mut self.gates[gate];
            if gate.missing == 0 {
                continue;
            }
            gate.missing -= 1;
            if gate.missing > 0 {
                continue;
            }
            match gate.output {
                Output::Gate(parent) => queue.push_back(parent),
                Output::Head(rule) => {
                    if accept(rule) {
                        queue.extend(&self.watchers[&rule.head]);
                    }
                }
            }
        }
    }
}
