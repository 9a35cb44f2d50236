//! Forged certificates: random modifications of valid ones, and ones with tighter inequalities.

use elbowroom::num::Rational;
use elbowroom::verify::{AnswerError, Certificate, Verified, with_sums};
use serde_json::{Value, json};

use super::shared::changed::{changed, numbers};

/// Generator of random forgeries, with counts.
pub(super) struct Forger {
    draw: Draw,
    count: usize,
    harmless: usize,
}

impl Forger {
    /// Creates a forger. The same seed gives the same modifications.
    pub(super) fn new(seed: u64) -> Self {
        Self {
            draw: Draw(seed),
            count: 0,
            harmless: 0,
        }
    }

    /// Checks that the verifier rejects a number of random modifications of an answer, unless they
    /// have the same claim.
    pub(super) fn attack(
        &mut self,
        (answer, times): (&Value, usize),
        verify: &dyn Fn(&Value) -> Result<Verified, AnswerError>,
        what: &str,
    ) {
        for _ in 0..times {
            let broken = mutated(answer, &mut self.draw);
            if broken == *answer {
                continue;
            }
            self.count += 1;
            if verify(&broken).is_ok() {
                self.harmless += 1;
                assert_eq!(claim(&broken), claim(answer), "{what}");
            }
        }
    }

    /// Prints the counts, and returns the number of forged certificates.
    pub(super) fn print_counts(&self) -> usize {
        let Self {
            count, harmless, ..
        } = self;
        println!("{count} mutated certificates, of which {harmless} still prove the same claim");
        *count
    }
}

/// Returns answers with one tighter inequality each that the certificate only states. Another box
/// would be the best one then.
pub(super) fn tightened(answer: &Value) -> Vec<Value> {
    let proofs = answer.pointer("/best/certificate/proofs");
    let proofs = proofs.and_then(Value::as_array).expect("a list");
    let mut forged = Vec::new();
    for (index, proof) in proofs.iter().enumerate() {
        let Some(constant) = proof.pointer("/assumed/sums/0/constant") else {
            continue;
        };
        let constant: Rational = constant.as_str().expect("a number").parse().expect("exact");
        let tighter = constant - Rational::new(1, 100);
        let place = format!("/best/certificate/proofs/{index}/assumed/sums/0/constant");
        let mut broken = answer.clone();
        *broken.pointer_mut(&place).expect("a number") = json!(tighter.to_string());
        add_up(&mut broken);
        forged.push(broken);
    }
    forged
}

/// Recomputes the sums that follow from the certificate.
fn add_up(broken: &mut Value) {
    let certificate = broken["best"]["certificate"].clone();
    let certificate: Option<Certificate> = serde_json::from_value(certificate).ok();
    if let Some(certificate) = certificate.and_then(|own| with_sums(own).ok()) {
        broken["best"]["certificate"] = json!(certificate);
    }
}

/// Random numbers from a seed (an xorshift generator).
struct Draw(u64);

impl Draw {
    fn below(&mut self, count: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from(self.0 >> 33).expect("31 bits") % count.max(1)
    }
}

/// Returns the paths of all lists and objects inside a value.
fn places(value: &Value, path: &str, lists: &mut Vec<String>) {
    match value {
        Value::Object(members) => {
            for (name, member) in members {
                places(member, &format!("{path}/{name}"), lists);
            }
        }
        Value::Array(members) => {
            if !members.is_empty() {
                lists.push(path.to_owned());
            }
            for (index, member) in members.iter().enumerate() {
                places(member, &format!("{path}/{index}"), lists);
            }
        }
        _ => {}
    }
}

/// Returns a random modification of an answer.
fn mutated(answer: &Value, draw: &mut Draw) -> Value {
    let mut broken = answer.clone();
    let mut found = Vec::new();
    let root = match draw.below(8) {
        0 | 1 => "/parameters",
        2 if answer.pointer("/best/probability").is_some() => "/best",
        _ => "/best/certificate",
    };
    let part = answer.pointer(root).expect("a member").clone();
    match draw.below(6) {
        // A number is replaced by another one, or by one from another path.
        0 | 1 => {
            numbers(&part, root, &mut found);
            let place = &found[draw.below(found.len())];
            let other = &found[draw.below(found.len())];
            let other = answer.pointer(other).expect("a number").clone();
            let number = broken.pointer_mut(place).expect("a number");
            *number = match (&*number, &other) {
                (Value::String(_), Value::String(_)) if draw.below(2) == 0 => other,
                _ => changed(number),
            };
        }
        // An element of a list disappears, or is exchanged with another one.
        kind @ (2 | 3) => {
            places(&part, root, &mut found);
            let place = &found[draw.below(found.len())];
            let list = broken.pointer_mut(place).and_then(Value::as_array_mut);
            let list = list.expect("a list");
            let (one, other) = (draw.below(list.len()), draw.below(list.len()));
            if kind == 2 {
                list.remove(one);
            } else {
                list.swap(one, other);
            }
        }
        // A bound of the network is loosened or moved, or another agent controls it.
        4 => {
            let list = "/best/certificate/constraints";
            let count = answer
                .pointer(list)
                .and_then(Value::as_array)
                .map_or(0, Vec::len);
            let points = answer.pointer("/best/certificate/points");
            let points = points.and_then(Value::as_array).map_or(0, Vec::len);
            let own = broken.pointer_mut(&format!("{list}/{}", draw.below(count)));
            let own = own.expect("a constraint");
            match draw.below(5) {
                0 => own["lower"] = json!("none"),
                1 => own["upper"] = json!("none"),
                2 => own["from"] = json!(draw.below(points)),
                3 => own["to"] = json!(draw.below(points)),
                _ => own["observed"] = json!(!own["observed"].as_bool().unwrap_or_default()),
            }
        }
        // Names are exchanged.
        _ => {
            let list = broken
                .pointer_mut("/parameters")
                .and_then(Value::as_array_mut);
            let list = list.expect("a list");
            let (one, other) = (draw.below(list.len()), draw.below(list.len()));
            for member in ["name", "quantity", "action"] {
                let (left, right) = (list[one][member].clone(), list[other][member].clone());
                list[one][member] = right;
                list[other][member] = left;
            }
        }
    }
    if draw.below(2) == 0 {
        add_up(&mut broken);
    }
    broken
}

/// Returns the claims of an answer, without its reasons.
pub(super) fn claim(answer: &Value) -> Vec<Value> {
    let members = [
        "/domain",
        "/problem",
        "/settings/epsilon",
        "/settings/guarantee",
        "/best/objective",
        "/best/symmetric",
        "/best/most",
        "/best/value",
        "/best/bound",
        "/best/probability",
        "/best/chances",
    ];
    let members = members.iter().map(|place| answer.pointer(place).cloned());
    let rooms = answer["parameters"].as_array().into_iter().flatten();
    let rooms = rooms.map(|room| {
        let own = [
            "name", "quantity", "action", "nominal", "weight", "lower", "upper",
        ];
        Some(own.iter().map(|member| room[*member].clone()).collect())
    });
    members.chain(rooms).flatten().collect()
}
