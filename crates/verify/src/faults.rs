//! Checks proofs about failures: answers of `elbowroom envelope --faults --json`.
//!
//! The proof contains a temporal network whose actions may fail. "The plan affords k failures" is
//! proved by latest times in layers: layer j of a time point bounds its time after at most j
//! failures on each path to it, if everything starts as early as possible. "It does not" is proved
//! by a path of lower bounds to a time point that misses its deadline.
//!
//! The check is about the network in the answer. It does not derive the network from the files.

use elbowroom_num::Rational;
use serde::Deserialize;

use crate::certificate;

/// A proved claim about failures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VerifiedFaults {
    /// The number of failures.
    pub faults: usize,
    /// `true` if one strategy works for all of them; `false` if none does.
    pub is_affordable: bool,
}

/// Reason why an answer about failures is not verified.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FaultsError {
    /// The text is not such an answer.
    #[error("this is not an answer of `elbowroom envelope --faults K --json`: {0}")]
    Unreadable(#[from] serde_json::Error),
    /// The answer has no proof.
    #[error("the answer has no proof: only deadlines may bound the times of the plan from above")]
    NoProof,
    /// The proof is wrong.
    #[error("{0}")]
    Flaw(String),
}

#[derive(Deserialize)]
struct Answer {
    #[serde(rename = "format")]
    _format: Format,
    faults: Option<usize>,
    proof: Option<Proof>,
    box_faults: Option<usize>,
}

#[derive(Deserialize)]
enum Format {
    #[serde(rename = "elbowroom-faults")]
    Faults,
}

#[derive(Deserialize)]
struct Proof {
    faults: usize,
    nodes: Vec<String>,
    requirements: Vec<Requirement>,
    attempts: Vec<Attempt>,
    recovery: Exact,
    #[serde(default)]
    latest: Vec<Vec<Option<Exact>>>,
    #[serde(default)]
    path: Vec<PathStep>,
}

/// A number of an answer: `{ "exact": "7/2", "decimal": 3.5 }`.
#[derive(Clone, Deserialize)]
#[serde(from = "Pair")]
struct Exact(Rational);

#[derive(Deserialize)]
struct Pair {
    exact: certificate::Exact,
}

impl From<Pair> for Exact {
    fn from(pair: Pair) -> Self {
        Self(pair.exact.0)
    }
}

#[derive(Deserialize)]
struct Requirement {
    from: usize,
    to: usize,
    bound: Exact,
}

#[derive(Deserialize)]
struct Attempt {
    start: usize,
    end: usize,
    lower: Exact,
    upper: Option<Exact>,
    retries: usize,
}

#[derive(Deserialize)]
struct PathStep {
    node: usize,
    layer: usize,
}

/// Checks the proof in an answer about failures.
///
/// # Errors
/// The reason why it is not verified.
pub fn verify_faults(text: &str) -> Result<VerifiedFaults, FaultsError> {
    let answer: Answer = serde_json::from_str(text)?;
    let proof = answer.proof.ok_or(FaultsError::NoProof)?;
    let claimed = answer.box_faults;
    let network = Network::new(proof).map_err(flaw)?;
    let faults = network.proof.faults;
    if network.proof.path.is_empty() {
        if claimed != Some(faults) {
            return Err(flaw("the proof is about another number of failures"));
        }
        network.check_latest().map_err(flaw)?;
        return Ok(VerifiedFaults {
            faults,
            is_affordable: true,
        });
    }
    if answer.faults.is_none_or(|own| own < faults) {
        return Err(flaw("the proof is about more failures than the answer"));
    }
    network.check_path().map_err(flaw)?;
    Ok(VerifiedFaults {
        faults,
        is_affordable: false,
    })
}

fn flaw(message: impl Into<String>) -> FaultsError {
    FaultsError::Flaw(message.into())
}

/// A lower bound of the network.
#[derive(Clone, Copy)]
enum Edge {
    /// The action of an attempt, from its start to its end.
    Attempt(usize),
    /// A precedence from a node, with its least difference.
    After,
}

/// The network of a proof.
struct Network {
    proof: Proof,
    /// The times of time points that are fixed.
    fixed: Vec<Option<Rational>>,
    /// The attempt that starts at each node.
    starting: Vec<Option<usize>>,
    /// The attempt that ends at each node.
    ending: Vec<Option<usize>>,
}

/// A bound in terms of starts that the executor decides: `(from, to, least)`.
type Precedence = (usize, usize, Rational);

impl Network {
    fn new(proof: Proof) -> Result<Self, String> {
        let count = proof.nodes.len();
        let mut network = Self {
            fixed: vec![None; count],
            starting: vec![None; count],
            ending: vec![None; count],
            proof,
        };
        let proof = &network.proof;
        if count == 0 || proof.recovery.0.is_negative() {
            return Err("the network has no time zero, or a negative recovery".to_owned());
        }
        let is_known = |own: &Requirement| own.from < count && own.to < count;
        if !proof.requirements.iter().all(is_known) {
            return Err("a requirement names an unknown time point".to_owned());
        }
        network.fixed[0] = Some(Rational::ZERO);
        for (index, own) in proof.attempts.iter().enumerate() {
            let upper = own.upper.as_ref().map(|upper| &upper.0);
            if own.start >= count
                || own.end >= count
                || own.end == 0
                || own.start == own.end
                || own.lower.0.is_negative()
                || upper.is_some_and(|upper| *upper < own.lower.0)
                || network.ending[own.end].is_some()
            {
                return Err(format!("attempt {index} is malformed"));
            }
            network.ending[own.end] = Some(index);
            if own.start == 0 {
                if upper != Some(&own.lower.0) || own.retries > 0 {
                    return Err(format!("the time of attempt {index} is not fixed"));
                }
                network.fixed[own.end] = Some(own.lower.0.clone());
            } else if network.starting[own.start].replace(index).is_some() {
                return Err(format!("attempt {index} shares its start"));
            }
        }
        for own in &proof.requirements {
            if own.from != 0
                || network.starting[own.to].is_some()
                || network.ending[own.to].is_some()
            {
                continue;
            }
            let is_opposite = |other: &&Requirement| {
                other.from == own.to && other.to == 0 && other.bound.0 == -&own.bound.0
            };
            if own.to != 0 && proof.requirements.iter().find(is_opposite).is_some() {
                network.fixed[own.to] = Some(own.bound.0.clone());
            }
        }
        Ok(network)
    }

    /// Returns the time of a number of failures of an attempt, and the successful one if requested.
    fn length(&self, index: usize, failures: usize, and_success: bool) -> Option<Rational> {
        let own = &self.proof.attempts[index];
        let mut length = Rational::ZERO;
        if failures > 0 {
            let count = Rational::from(i64::try_from(failures).ok()?);
            length = count * (&own.upper.as_ref()?.0 + &self.proof.recovery.0);
        }
        if and_success {
            length += &own.upper.as_ref()?.0;
        }
        Some(length)
    }

    /// Returns the greatest number of failures of an attempt that are left in a layer.
    fn left(&self, index: usize, layer: usize) -> usize {
        let retries = self.proof.attempts[index].retries;
        retries.min(self.proof.faults - layer)
    }

    /// Returns the length of an edge with a number of failures, from a layer; `None` if it has no
    /// limit.
    fn edge_length(
        &self,
        edge: Edge,
        (from, _, least): &Precedence,
        layer: usize,
        failures: usize,
    ) -> Option<Rational> {
        match (edge, self.starting[*from]) {
            (Edge::Attempt(index), _) => self.length(index, failures, true),
            (Edge::After, Some(index)) if self.proof.attempts[index].retries > 0 => {
                let last_start = self.length(index, failures, false)?;
                // As long as a failure is left, only the end shows which attempt is the last.
                if failures == self.left(index, layer) {
                    Some(last_start + least)
                } else {
                    let end = self.length(index, failures, true)?;
                    Some(end.max(last_start + least))
                }
            }
            (Edge::After, _) => Some(least.clone()),
        }
    }

    /// Returns the greatest number of failures on an edge.
    fn most_on(&self, edge: Edge, from: usize, layer: usize) -> usize {
        match edge {
            Edge::Attempt(index) => self.left(index, layer),
            Edge::After => self.starting[from].map_or(0, |index| self.left(index, layer)),
        }
    }

    /// Returns the lower bound of a requirement between time points that are not fixed, as one
    /// between starts; `None` if it is an upper bound. The flag is `true` if it is exact.
    fn precedence(&self, own: &Requirement) -> Option<(Precedence, bool)> {
        let least = -&own.bound.0;
        if least.is_negative() {
            return None;
        }
        let Some(index) = self.ending[own.from] else {
            return Some(((own.to, own.from, least), true));
        };
        let attempt = &self.proof.attempts[index];
        let least = least - &attempt.lower.0;
        let is_exact = !least.is_negative();
        let least = if is_exact { least } else { Rational::ZERO };
        Some(((own.to, attempt.start, least), is_exact))
    }

    /// Returns the release `node >= time` of a requirement whose other end is fixed.
    fn release(&self, own: &Requirement, time: &Rational) -> (usize, Rational) {
        let least = time - &own.bound.0;
        match self.ending[own.from] {
            None => (own.from, least),
            Some(index) => {
                let attempt = &self.proof.attempts[index];
                (attempt.start, least - &attempt.lower.0)
            }
        }
    }

    /// Returns the last start at worst, or the time itself.
    fn last_start(&self, node: usize, layer: usize, time: &Rational) -> Option<Rational> {
        match self.starting[node] {
            None => Some(time.clone()),
            Some(index) => Some(time + &self.length(index, self.left(index, layer), false)?),
        }
    }

    fn check_latest(&self) -> Result<(), String> {
        let layers = self.proof.faults + 1;
        let latest = &self.proof.latest;
        if latest.len() != self.proof.nodes.len() || latest.iter().any(|own| own.len() != layers) {
            return Err("a time point has no latest times".to_owned());
        }
        let name = |node: usize| &self.proof.nodes[node];
        let is_at_least = |node: usize, layer: usize, least: Option<&Rational>| {
            let own: Option<&Exact> = latest[node][layer].as_ref();
            own.is_none_or(|own| least.is_some_and(|least| own.0 >= *least))
        };
        let mut edges: Vec<(Edge, Precedence)> = Vec::new();
        for (index, own) in self.proof.attempts.iter().enumerate() {
            if own.start != 0 {
                edges.push((Edge::Attempt(index), (own.start, own.end, Rational::ZERO)));
            }
        }
        for node in 0..latest.len() {
            for layer in 0..layers {
                if !is_at_least(node, layer, Some(&Rational::ZERO)) {
                    return Err(format!("the latest time of {} is negative", name(node)));
                }
            }
        }
        for own in &self.proof.requirements {
            match (&self.fixed[own.from], &self.fixed[own.to]) {
                (Some(from), Some(to)) => {
                    if *to > from + &own.bound.0 {
                        return Err("fixed times contradict each other".to_owned());
                    }
                }
                (Some(from), None) => {
                    let deadline = from + &own.bound.0;
                    for (layer, time) in latest[own.to].iter().enumerate() {
                        let time = time.as_ref();
                        let time = time.and_then(|time| self.last_start(own.to, layer, &time.0));
                        if time.is_none_or(|time| time > deadline) {
                            return Err(format!("{} may miss its deadline", name(own.to)));
                        }
                    }
                }
                (None, Some(to)) => {
                    let (node, least) = self.release(own, to);
                    for layer in 0..layers {
                        if !is_at_least(node, layer, Some(&least)) {
                            return Err(format!("{} cannot be so early", name(node)));
                        }
                    }
                }
                (None, None) => match self.precedence(own) {
                    // A bound on a duration that its interval implies.
                    Some(((from, to, least), _)) if from == to && least.is_zero() => {}
                    Some((edge, _)) => edges.push((Edge::After, edge)),
                    None => {
                        return Err(format!(
                            "{} has an upper bound that is not a deadline",
                            name(own.to)
                        ));
                    }
                },
            }
        }
        for (kind, edge) in &edges {
            let (from, to, _) = edge;
            for (layer, time) in latest[*from].iter().enumerate() {
                let time = time.as_ref().map(|own| &own.0);
                for failures in 0..=self.most_on(*kind, *from, layer) {
                    let length = self.edge_length(*kind, edge, layer, failures);
                    let time = time.zip(length).map(|(time, own)| time + &own);
                    if !is_at_least(*to, layer + failures, time.as_ref()) {
                        return Err(format!("{} may be later than stated", name(*to)));
                    }
                }
            }
        }
        self.check_order(&edges)
    }

    /// Checks that no time point waits for itself.
    fn check_order(&self, edges: &[(Edge, Precedence)]) -> Result<(), String> {
        let count = self.proof.nodes.len();
        let mut next = vec![Vec::new(); count];
        let mut open = vec![0_usize; count];
        for (_, (from, to, _)) in edges {
            next[*from].push(*to);
            open[*to] += 1;
        }
        let mut ready: Vec<usize> = (0..count).filter(|&node| open[node] == 0).collect();
        let mut done = 0;
        while let Some(node) = ready.pop() {
            done += 1;
            for &to in &next[node] {
                open[to] -= 1;
                if open[to] == 0 {
                    ready.push(to);
                }
            }
        }
        if done == count {
            Ok(())
        } else {
            Err("time points wait for each other".to_owned())
        }
    }

    /// Checks that no strategy is earlier than a path, and that its last time point misses a
    /// deadline.
    fn check_path(&self) -> Result<(), String> {
        let path = &self.proof.path;
        let is_in =
            |step: &PathStep| step.node < self.proof.nodes.len() && step.layer <= self.proof.faults;
        if !path.iter().all(is_in) {
            return Err("the path leaves the network".to_owned());
        }
        let mut time = self.earliest_release(path[0].node);
        let mut failed = vec![0_usize; self.proof.attempts.len()];
        for pair in path.windows(2) {
            let failures = (pair[1].layer.checked_sub(pair[0].layer))
                .ok_or_else(|| "the layers of the path decrease".to_owned())?;
            if failures > 0 {
                let index = self.starting[pair[0].node];
                failed[index.ok_or_else(|| "what fails is no action".to_owned())?] += failures;
            }
            let step = self.longest_step(pair[0].node, pair[1].node, pair[0].layer, failures);
            time += &step.ok_or_else(|| "a step of the path is no bound".to_owned())?;
        }
        let last = &path[path.len() - 1];
        if let Some(index) = self.starting[last.node] {
            failed[index] += self.left(index, last.layer);
        }
        let mut counts = self.proof.attempts.iter().zip(&failed);
        if counts.any(|(own, failures)| *failures > own.retries) {
            return Err("an action fails more often than it may".to_owned());
        }
        let last_start = self.last_start(last.node, last.layer, &time);
        let misses = |own: &Requirement| {
            let deadline = self.fixed[own.from].as_ref();
            let deadline = deadline.map(|from| from + &own.bound.0);
            let is_last = own.to == last.node && self.fixed[own.to].is_none();
            is_last
                && deadline
                    .zip(last_start.as_ref())
                    .is_some_and(|(deadline, time)| *time > deadline)
        };
        if self.proof.requirements.iter().any(misses) {
            Ok(())
        } else {
            Err("the path misses no deadline".to_owned())
        }
    }

    fn earliest_release(&self, node: usize) -> Rational {
        let mut earliest = self.fixed[node].clone().unwrap_or_default();
        for own in &self.proof.requirements {
            if let (None, Some(to)) = (&self.fixed[own.from], &self.fixed[own.to]) {
                let (released, least) = self.release(own, to);
                if released == node && least > earliest {
                    earliest = least;
                }
            }
        }
        earliest
    }

    fn longest_step(
        &self,
        from: usize,
        to: usize,
        layer: usize,
        failures: usize,
    ) -> Option<Rational> {
        let mut lengths = Vec::new();
        let mut add = |kind: Edge, edge: &Precedence| {
            if failures <= self.most_on(kind, from, layer) {
                lengths.extend(self.edge_length(kind, edge, layer, failures));
            }
        };
        if let Some(index) = self.starting[from]
            && self.proof.attempts[index].end == to
        {
            add(Edge::Attempt(index), &(from, to, Rational::ZERO));
        }
        for own in &self.proof.requirements {
            let is_open = self.fixed[own.from].is_none() && self.fixed[own.to].is_none();
            if let Some((edge, true)) = self.precedence(own)
                && is_open
                && (edge.0, edge.1) == (from, to)
            {
                add(Edge::After, &edge);
            }
        }
        lengths.into_iter().max()
    }
}
