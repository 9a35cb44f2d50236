use rand::{Rng as _, SeedableRng as _, seq::IndexedRandom as _};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::knowledge::{Param, node};

fn at(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

fn node(name: &str, value: f64) -> Node {
    let mut words = name.split_whitespace().map(str::to_owned);
    let name = words.next().expect("a name");
    let parameter = |name| Param {
        name,
        ..Param::default()
    };
    Node {
        node_type: if value.to_bits() == 0 {
            node::PREDICATE
        } else {
            node::FUNCTION
        },
        name,
        parameters: words.map(parameter).collect(),
        value,
        ..Node::default()
    }
}

fn name(node: &Node) -> String {
    let objects = node.parameters.iter().map(|it| it.name.clone());
    std::iter::once(node.name.clone())
        .chain(objects)
        .collect::<Vec<_>>()
        .join(" ")
}

/// Problem expert of `PlanSys2`, which preserves the spelling of names.
#[derive(Default)]
struct Expert {
    facts: BTreeSet<String>,
    numbers: BTreeMap<String, f64>,
    /// Received changes, in order.
    received: Vec<String>,
    refuses: Option<&'static str>,
    /// `true` if its state has changed since the last notification.
    has_changed: bool,
}

impl Expert {
    fn with(facts: &[&str], numbers: &[(&str, f64)]) -> Self {
        Self {
            facts: facts.iter().map(ToString::to_string).collect(),
            numbers: numbers
                .iter()
                .map(|(name, value)| ((*name).to_owned(), *value))
                .collect(),
            ..Self::default()
        }
    }

    fn answer(&mut self, call: &Call) -> Answer {
        let (what, node) = match call {
            Call::Predicates => {
                return Answer::States(Ok(self.facts.iter().map(|it| node(it, 0.0)).collect()));
            }
            Call::Functions => {
                return Answer::States(Ok(self
                    .numbers
                    .iter()
                    .map(|(it, value)| Node {
                        node_type: node::FUNCTION,
                        value: *value,
                        ..node(it, 0.0)
                    })
                    .collect()));
            }
            Call::Add(node) => ("add", node),
            Call::Remove(node) => ("remove", node),
            Call::Define(node) => ("define", node),
            Call::Update(node) => ("update", node),
            Call::Forget(node) => ("forget", node),
        };
        let name = name(node);
        if self.refuses == Some(name.as_str()) {
            return Answer::Done(Err("it is not valid".to_owned()));
        }
        self.received.push(match what {
            "define" | "update" => format!("{what} {name} {}", node.value),
            _ => format!("{what} {name}"),
        });
        let is_known = self.numbers.contains_key(&name);
        match what {
            "add" => {
                self.facts.insert(name);
            }
            "remove" => {
                self.facts.remove(&name);
            }
            // An undefined fluent cannot be updated.
            "update" if !is_known => return Answer::Done(Err("function not valid".to_owned())),
            "define" | "update" => {
                self.numbers.insert(name, node.value);
            }
            _ => {
                self.numbers.remove(&name);
            }
        }
        self.has_changed = true;
        Answer::Done(Ok(()))
    }

    /// Answers calls until none is due.
    fn talk(&mut self, mirror: &mut ProblemSync, now: Duration) {
        loop {
            if std::mem::take(&mut self.has_changed) {
                mirror.on_change();
            }
            mirror.tick(now);
            let calls = mirror.calls();
            if calls.is_empty() {
                return;
            }
            for (id, call) in calls {
                let answer = self.answer(&call);
                mirror.on_answer(id, answer);
            }
        }
    }
}

fn fact(name: &str, truth: bool) -> (String, bool) {
    (name.to_owned(), truth)
}

fn number(name: &str, value: f64) -> (String, Option<f64>) {
    (name.to_owned(), Some(value))
}

/// Starts a run that believes that robot r is at a with a charge of 5.
fn begun(expert: &mut Expert) -> ProblemSync {
    let mut mirror = ProblemSync::default();
    mirror.set_available(true);
    mirror.begin("");
    mirror.set_beliefs(&[fact("(at r a)", true)], &[number("(charge r)", 5.0)]);
    expert.talk(&mut mirror, at(0));
    mirror
}

#[test]
fn changes_of_run_are_written_once_in_order() {
    let mut expert = Expert::with(&["at r a"], &[("charge r", 5.0)]);
    let mut mirror = begun(&mut expert);
    mirror.set_beliefs(&[fact("(at r a)", false)], &[]);
    mirror.set_beliefs(
        &[fact("(at r b)", true)],
        &[number("(charge r)", 3.5), number("(driven r)", 1.0)],
    );
    expert.talk(&mut mirror, at(1));
    assert_eq!(
        expert.received,
        [
            "remove at r a",
            "add at r b",
            "update charge r 3.5",
            "define driven r 1"
        ]
    );
    assert_eq!(mirror.seen(), []);
    assert!(mirror.is_idle() && mirror.remarks().is_empty());
    mirror.set_beliefs(&[], &[("(driven r)".to_owned(), None)]);
    expert.talk(&mut mirror, at(2));
    assert_eq!(
        expert.received.last().map(String::as_str),
        Some("forget driven r")
    );
}

#[test]
fn changes_by_others_are_reported_once() {
    let mut expert = Expert::with(&["at r a"], &[("charge r", 5.0)]);
    let mut mirror = begun(&mut expert);
    expert.facts.insert("blocked b".to_owned());
    expert.facts.remove("at r a");
    expert.numbers.insert("charge r".to_owned(), 1.0);
    mirror.on_change();
    expert.talk(&mut mirror, at(1));
    let seen = [
        ExternalChange::Fact("(at r a)".to_owned(), false),
        ExternalChange::Fact("(blocked b)".to_owned(), true),
        ExternalChange::Value("(charge r)".to_owned(), 1.0),
    ];
    assert_eq!(mirror.seen(), seen);
    // The run confirms the belief.
    mirror.set_beliefs(
        &[fact("(at r a)", false), fact("(blocked b)", true)],
        &[number("(charge r)", 1.0)],
    );
    mirror.on_change();
    expert.talk(&mut mirror, at(2));
    assert_eq!(mirror.seen(), []);
    assert!(expert.received.is_empty(), "{:?}", expert.received);
}

#[test]
fn initial_state_of_expert_wins_over_older_beliefs() {
    let mut expert = Expert::with(&["at r a", "blocked b"], &[("charge r", 4.0)]);
    let mut mirror = ProblemSync::default();
    mirror.set_available(true);
    mirror.begin("");
    mirror.set_beliefs(
        &[fact("(at r a)", true), fact("(open b)", true)],
        &[number("(charge r)", 5.0)],
    );
    mirror.set_beliefs(&[fact("(at r a)", false)], &[]);
    expert.talk(&mut mirror, at(0));
    let seen = [
        ExternalChange::Fact("(blocked b)".to_owned(), true),
        ExternalChange::Fact("(open b)".to_owned(), false),
        ExternalChange::Value("(charge r)".to_owned(), 4.0),
    ];
    assert_eq!(mirror.seen(), seen);
    assert_eq!(expert.received, ["remove at r a"]);
}

#[test]
fn changes_during_read_are_kept() {
    let mut expert = Expert::with(&["at r a"], &[]);
    let mut mirror = begun(&mut expert);
    mirror.on_change();
    mirror.tick(at(1));
    // The run changes the state while the answers are pending.
    let asked = mirror.calls();
    let answers: Vec<_> = asked
        .iter()
        .map(|(id, call)| (*id, expert.answer(call)))
        .collect();
    assert_eq!(answers.len(), 2);
    mirror.set_beliefs(&[fact("(at r a)", false)], &[]);
    mirror.tick(at(1));
    let told = mirror.calls();
    assert_eq!(told.len(), 1, "nothing waits for what is read");
    for (id, answer) in answers {
        mirror.on_answer(id, answer);
    }
    assert_eq!(mirror.seen(), []);
    let answer = expert.answer(&told[0].1);
    mirror.on_answer(told[0].0, answer);
    expert.talk(&mut mirror, at(1));
    assert_eq!((mirror.seen(), expert.facts.len()), (vec![], 0));
}

#[test]
fn problem_expert_with_another_problem_is_not_modified() {
    let mut expert = Expert::with(&["cooked rice"], &[]);
    let mut mirror = begun(&mut expert);
    mirror.set_beliefs(&[fact("(at r a)", false)], &[]);
    mirror.on_change();
    expert.talk(&mut mirror, at(1));
    assert!(expert.received.is_empty() && mirror.seen().is_empty() && mirror.is_idle());
    assert_eq!(
        mirror.remarks(),
        ["the problem expert contains nothing of this problem, and is not used"]
    );
}

#[test]
fn refused_write_is_reported_and_not_repeated() {
    let mut expert = Expert::with(&["at r a"], &[("charge r", 5.0)]);
    let mut mirror = begun(&mut expert);
    expert.refuses = Some("at r b");
    mirror.set_beliefs(&[fact("(at r b)", true)], &[number("(charge r)", 2.0)]);
    expert.talk(&mut mirror, at(1));
    mirror.on_change();
    expert.talk(&mut mirror, at(2));
    assert_eq!(
        mirror.remarks(),
        ["the problem expert rejects (at r b): it is not valid"]
    );
    assert_eq!(expert.received, ["update charge r 2"]);
    assert_eq!(mirror.seen(), []);
}

#[test]
fn silent_expert_is_asked_again_with_one_warning() {
    let mut expert = Expert::with(&["at r a"], &[]);
    let mut mirror = begun(&mut expert);
    mirror.set_beliefs(&[fact("(at r b)", true)], &[]);
    let mut asked = 0;
    for second in 1..=21 {
        mirror.tick(at(second));
        asked += mirror.calls().len();
    }
    assert_eq!(asked, 5, "each 5 s");
    assert_eq!(mirror.remarks().len(), 1);
    assert!(!mirror.is_idle());
    expert.talk(&mut mirror, at(26));
    assert_eq!(expert.received, ["add at r b"]);
    assert!(mirror.is_idle());
}

#[test]
fn missing_expert_warns_once_and_late_expert_is_updated() {
    let mut mirror = ProblemSync::default();
    mirror.begin("");
    mirror.set_beliefs(&[fact("(at r a)", true)], &[]);
    mirror.set_beliefs(&[fact("(at r a)", false)], &[]);
    for second in 0..3 {
        mirror.tick(at(second));
        assert!(mirror.calls().is_empty() && mirror.is_idle());
    }
    assert_eq!(
        mirror.remarks(),
        ["there is no problem expert: changes by runs are not reported"]
    );
    let mut expert = Expert::with(&["at r a"], &[]);
    mirror.set_available(true);
    expert.talk(&mut mirror, at(3));
    assert_eq!((expert.received.len(), mirror.seen()), (1, vec![]));
}

#[test]
fn last_changes_are_written_after_end() {
    let mut expert = Expert::with(&["at r a"], &[]);
    let mut mirror = begun(&mut expert);
    mirror.set_beliefs(&[fact("(at r a)", false)], &[]);
    mirror.end();
    assert!(!mirror.is_idle());
    expert.facts.insert("blocked b".to_owned());
    mirror.on_change();
    expert.talk(&mut mirror, at(1));
    assert!(mirror.is_idle() && mirror.seen().is_empty());
    assert_eq!(expert.received, ["remove at r a"]);
}

#[test]
fn spelling_of_problem_and_expert_is_kept() {
    let mut expert = Expert::with(&["robot_At R2D2 hall"], &[]);
    let mut mirror = ProblemSync::default();
    mirror.set_available(true);
    mirror.begin("(define (problem p) (:objects R2D2 - robot hall Kitchen - room))");
    mirror.set_beliefs(&[fact("(robot_at r2d2 hall)", true)], &[]);
    expert.talk(&mut mirror, at(0));
    assert_eq!(mirror.seen(), []);
    mirror.set_beliefs(
        &[
            fact("(robot_at r2d2 hall)", false),
            fact("(robot_at r2d2 kitchen)", true),
        ],
        &[],
    );
    expert.talk(&mut mirror, at(1));
    assert_eq!(
        expert.received,
        ["remove robot_At R2D2 hall", "add robot_At R2D2 Kitchen"]
    );
}

/// Run and problem expert, connected by messages that may be late or lost.
struct Simulation {
    rng: ChaCha8Rng,
    expert: Expert,
    mirror: ProblemSync,
    /// Beliefs of the run, from its own actions and reported changes.
    facts: BTreeMap<String, bool>,
    value: f64,
    open: Vec<(CallId, Call)>,
    answers: Vec<(CallId, Answer)>,
}

impl Simulation {
    fn new(seed: u64) -> Self {
        let facts = [("p a", true), ("here", true)];
        let mut play = Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            expert: Expert::with(&["p a", "here"], &[("n", 1.0)]),
            mirror: ProblemSync::default(),
            facts: facts.map(|(it, truth)| (it.to_owned(), truth)).into(),
            value: 1.0,
            open: Vec::new(),
            answers: Vec::new(),
        };
        play.mirror.set_available(true);
        play.mirror.begin("");
        let all = facts.map(|(it, truth)| fact(&format!("({it})"), truth));
        play.mirror.set_beliefs(&all, &[number("(n)", 1.0)]);
        play
    }

    fn believe(&mut self, it: &str, truth: bool) {
        if self.facts.insert(it.to_owned(), truth) != Some(truth) {
            self.mirror
                .set_beliefs(&[fact(&format!("({it})"), truth)], &[]);
        }
    }

    fn count(&mut self, value: f64) {
        self.value = value;
        self.mirror.set_beliefs(&[], &[number("(n)", value)]);
    }

    /// Makes a random change, or delivers an answer. When `is_busy` is `false`, answers are only
    /// delivered, and none is lost.
    fn act(&mut self, is_busy: bool, others_act: bool) {
        let it = *["p a", "p b", "q"].choose(&mut self.rng).expect("some");
        match self.rng.random_range(0..8) {
            0 if is_busy => {
                let truth = self.rng.random();
                self.believe(it, truth);
            }
            1 if is_busy => self.count(self.value + 1.0),
            2 if is_busy && others_act => {
                let facts = &mut self.expert.facts;
                let is_added = self.rng.random();
                self.expert.has_changed |= if is_added {
                    facts.insert(it.to_owned())
                } else {
                    facts.remove(it)
                };
            }
            3 if is_busy && others_act => {
                let value = f64::from(self.rng.random_range(100..900));
                self.expert.numbers.insert("n".to_owned(), value);
                self.expert.has_changed = true;
            }
            4..6 if !self.open.is_empty() => {
                let (id, call) = self.open.remove(0);
                let answer = self.expert.answer(&call);
                if !is_busy || self.rng.random_bool(0.8) {
                    self.answers.push((id, answer));
                }
            }
            6..8 if !self.answers.is_empty() => {
                let place = self.rng.random_range(0..self.answers.len());
                let (id, answer) = self.answers.remove(place);
                self.mirror.on_answer(id, answer);
            }
            _ => {}
        }
    }

    /// Collects the pending calls. Returns the changes that the run sees, after it has adopted
    /// them.
    fn settle(&mut self, now: Duration, is_busy: bool) -> Vec<ExternalChange> {
        if std::mem::take(&mut self.expert.has_changed) {
            self.mirror.on_change();
        }
        self.mirror.tick(now);
        for call in self.mirror.calls() {
            if !is_busy || self.rng.random_bool(0.9) {
                self.open.push(call);
            }
        }
        let seen = self.mirror.seen();
        for it in &seen {
            match it {
                ExternalChange::Fact(it, truth) => {
                    self.believe(it.trim_matches(['(', ')']), *truth);
                }
                ExternalChange::Value(_, value) => self.count(*value),
            }
        }
        seen
    }
}

/// The run and others change the same facts and fluents at random, while messages are late and
/// lost. Finally both sides have the same state. If others change nothing, the run sees no change.
#[test]
fn both_sides_converge() {
    let (mut seen_of_others, mut conflicts) = (0, 0);
    for seed in 0..400 {
        let others_act = seed % 2 == 0;
        let mut play = Simulation::new(seed);
        for step in 0..400_u64 {
            let is_busy = step < 200;
            play.act(is_busy, others_act);
            let seen = play.settle(Duration::from_millis(step * 200), is_busy);
            assert!(
                others_act || seen.is_empty(),
                "seed {seed}, step {step}: {seen:?} is an echo"
            );
            seen_of_others += seen.len();
            conflicts += usize::from(!play.mirror.is_idle() && play.mirror.reading.is_some());
        }
        let believed = play.facts.iter().filter(|(_, truth)| **truth);
        let believed: BTreeSet<_> = believed.map(|(it, _)| it.clone()).collect();
        assert_eq!(believed, play.expert.facts, "seed {seed}");
        let held = play.expert.numbers.get("n").copied().map(f64::to_bits);
        assert_eq!(held, Some(play.value.to_bits()), "seed {seed}");
        assert!(play.mirror.is_idle(), "seed {seed}");
    }
    // The random scripts must contain enough events.
    assert!(
        seen_of_others > 200 && conflicts > 500,
        "{seen_of_others}, {conflicts}"
    );
}
