//! The pruned network, compared with exact inference by the Python package pgmpy.
//!
//! Runs if `python3`, or the program in `ELBOWROOM_PYTHON`, has pgmpy. Otherwise, reports that it
//! is skipped.

use std::fmt::Write as _;
use std::io::Write as _;
use std::process::{Command, Stdio};

use crate::reference::random::{Case, Taste, case, order};
use crate::shared::skipped;
use elbowroom_model::ground::{Body, Condition, FactId};
use elbowroom_plan::{Node, NodeId};
use elbowroom_probability::{Model, PrunedNetwork, Semantics};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Builds the complete, unpruned network, and computes P(A) and P(A ∩ G).
const SCRIPT: &str = r#"
import itertools, json, sys
from pgmpy.factors.discrete import TabularCPD
from pgmpy.inference import VariableElimination
try:
    from pgmpy.models import DiscreteBayesianNetwork as Network
except ImportError:
    from pgmpy.models import BayesianNetwork as Network

def table(name, parents, chance):
    rows = [[], []]
    for values in itertools.product([0, 1], repeat=len(parents)):
        p = chance(values)
        rows[0].append(1 - p)
        rows[1].append(p)
    return TabularCPD(name, 2, rows, evidence=parents or None, evidence_card=[2] * len(parents) or None)

for line in sys.stdin:
    case = json.loads(line)
    network, tables = Network(), []
    def add(name, parents, chance):
        network.add_node(name)
        for parent in parents:
            network.add_edge(parent, name)
        tables.append(table(name, parents, chance))
    for fact, p in enumerate(case["belief"]):
        add(f"f{fact}@0", [], lambda _, p=p: p)
    for k, step in enumerate(case["steps"], 1):
        # A node may be needed several times; it is a parent once.
        wanted = {}
        for fact, layer, truth in step["needs"]:
            wanted.setdefault(f"f{fact}@{layer}", set()).add(truth)
        parents = list(wanted)
        needs = [wanted[name] for name in parents]
        if step["start"]:
            parents.append(f"a{step['start']}")
            needs.append({1})
        def acts(values, needs=needs, p=step["success"]):
            return p if all(need == {v} for v, need in zip(values, needs)) else 0.0
        add(f"a{k}", parents, acts)
        for fact, (up, down) in enumerate(case["flips"]):
            def flips(v, up=up, down=down):
                return 1 - down if v else up
            before = f"f{fact}@{k-1}"
            if str(fact) in step["effects"]:
                p = step["effects"][str(fact)]
                add(f"f{fact}@{k}", [before, f"a{k}"], lambda v, p=p, flips=flips: p if v[1] else flips(v[0]))
            else:
                add(f"f{fact}@{k}", [before], lambda v, flips=flips: flips(v[0]))
    network.add_cpds(*tables)
    assert network.check_model()
    last = len(case["steps"])
    actions = [f"a{k}" for k in range(1, last + 1)]
    goal = {}
    for fact, truth in case["goal"]:
        goal.setdefault(f"f{fact}@{last}", set()).add(truth)
    inference = VariableElimination(network)
    def joint(wanted):
        if not wanted:
            return 1.0
        # One by one: P(x1) P(x2 | x1) ...
        evidence, p = {}, 1.0
        for name, value in wanted:
            distribution = inference.query([name], evidence=evidence, show_progress=False)
            p *= float(distribution.get_value(**{name: value}))
            if p == 0.0:
                return 0.0
            evidence[name] = value
        return p
    acted = [(name, 1) for name in actions]
    p_actions = joint(acted)
    if any(len(truths) > 1 for truths in goal.values()):
        p_success = 0.0
    else:
        p_success = joint(acted + [(name, min(truths)) for name, truths in goal.items()])
    print(repr(p_actions), repr(p_success), flush=True)
"#;

const PLAIN: Taste = Taste {
    facts: 3,
    actions: 2,
    couples: false,
    negations: true,
    is_easy: true,
    timed: false,
    numbers: false,
};

#[test]
fn exact_inference_of_the_whole_network_gives_the_same() {
    let python = std::env::var("ELBOWROOM_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has_pgmpy = Command::new(&python)
        .args(["-c", "import pgmpy"])
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success());
    if !has_pgmpy {
        skipped(format_args!("{python} has no pgmpy"));
        return;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let (mut asked, mut expected) = (String::new(), Vec::new());
    for _ in 0..60 {
        let mut case = case(&mut rng, PLAIN);
        case.circumstances.running.clear();
        let order = order(&mut rng, &case);
        let Some(text) = described(&case, &order) else {
            continue;
        };
        asked.push_str(&text);
        asked.push('\n');
        let model = Model::new(
            case.task.clone(),
            case.plan.clone(),
            &case.likelihoods,
            Semantics::Paper,
        );
        let model = model.unwrap();
        let mut network = PrunedNetwork::new(&model, &case.circumstances).unwrap();
        for &node in &order {
            network.push(node).unwrap();
        }
        let success = network.success_probability().unwrap();
        expected.push((network.actions_probability(), success));
    }
    let mut process = Command::new(&python)
        .args(["-c", SCRIPT])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    process
        .stdin
        .take()
        .unwrap()
        .write_all(asked.as_bytes())
        .unwrap();
    let output = process.wait_with_output().unwrap();
    assert!(output.status.success());
    let answers = String::from_utf8(output.stdout).unwrap();
    let mut possible = 0;
    assert_eq!(answers.lines().count(), expected.len());
    for (line, (actions, success)) in answers.lines().zip(&expected) {
        let numbers: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        assert!(
            (numbers[0] - actions).abs() < 1e-9,
            "{numbers:?} {actions} {success}"
        );
        assert!(
            (numbers[1] - success).abs() < 1e-9,
            "{numbers:?} {actions} {success}"
        );
        possible += usize::from(*success > 0.0);
    }
    assert!(
        possible > 15,
        "{possible} of {} were possible",
        expected.len()
    );
}

/// Returns the network in the format of the script; `None` if it has unsupported features.
fn described(case: &Case, order: &[NodeId]) -> Option<String> {
    let facts: Vec<FactId> = case.facts().collect();
    let joined = |parts: Vec<String>| format!("[{}]", parts.join(","));
    let belief = facts
        .iter()
        .map(|&fact| format!("{:?}", case.circumstances.belief.probability(fact)));
    let flips = facts.iter().map(|&fact| {
        let flip = case
            .likelihoods
            .spontaneous_change(&case.task, fact)
            .unwrap();
        format!("[{:?},{:?}]", flip.becomes_true, flip.becomes_false)
    });
    let mut steps = Vec::new();
    for (at, &node) in order.iter().enumerate() {
        let (id, is_end) = match case.plan.nodes[node.index()] {
            Node::Start(id) | Node::Instant(id) => (id, false),
            Node::End(id) => (id, true),
            Node::Zero | Node::Timed(_) => return None,
        };
        let action = &case.plan.instance(id).action;
        let mut needs = Vec::new();
        let mut start = 0;
        let snap = match &action.body {
            Body::Instantaneous(snap) => snap,
            Body::Durative(body) if !is_end => &body.start,
            Body::Durative(body) => {
                let begun = order
                    .iter()
                    .position(|&other| case.plan.nodes[other.index()] == Node::Start(id));
                start = begun? + 1;
                for layer in start..=at {
                    literals(&body.over_all, layer, &mut needs)?;
                }
                &body.end
            }
        };
        literals(&snap.condition, at, &mut needs)?;
        let fact_effects = case.fact_effects(action, snap);
        if fact_effects.len() < snap.effects.len() {
            return None;
        }
        let mut effects: Vec<(FactId, f64)> = Vec::new();
        for (fact, makes_true, p) in fact_effects {
            if effects.iter().any(|(other, _)| *other == fact) {
                return None;
            }
            effects.push((fact, if makes_true { p } else { 1.0 - p }));
        }
        let success = if is_end {
            1.0
        } else {
            case.likelihoods.start(action).unwrap()
        };
        let effects: Vec<String> = effects
            .iter()
            .map(|(fact, p)| format!("\"{}\":{p:?}", fact.0))
            .collect();
        let mut step = String::new();
        write!(
            step,
            "{{\"needs\":{},\"start\":{start},\"success\":{success:?},\"effects\":{{{}}}}}",
            joined(needs),
            effects.join(",")
        )
        .unwrap();
        steps.push(step);
    }
    let mut goal = Vec::new();
    literals(case.task.goal(), usize::MAX, &mut goal)?;
    Some(format!(
        "{{\"belief\":{},\"flips\":{},\"steps\":{},\"goal\":{}}}",
        joined(belief.collect()),
        joined(flips.collect()),
        joined(steps),
        joined(goal)
    ))
}

/// Collects the literals of a conjunction, as `[fact, layer, truth]`, without the layer for the
/// goal.
fn literals(condition: &Condition, layer: usize, found: &mut Vec<String>) -> Option<()> {
    let mut note = |fact: FactId, truth: u8| {
        found.push(if layer == usize::MAX {
            format!("[{},{truth}]", fact.0)
        } else {
            format!("[{},{layer},{truth}]", fact.0)
        });
    };
    for part in condition.conjuncts() {
        match part {
            Condition::Fact(fact) => note(*fact, 1),
            Condition::Not(part) => match **part {
                Condition::Fact(fact) => note(fact, 0),
                _ => return None,
            },
            _ => return None,
        }
    }
    Some(())
}
