//! Processes and events compared with a slow reference simulation in very many small time steps.
//!
//! The reference does not use polynomials. In each step it adds rate times step, exactly, and then
//! applies the events whose conditions hold. Bounds are chosen such that its steps never hit one,
//! so it detects each change at most one step too late.

#![allow(
    clippy::format_push_string,
    reason = "the tests put texts together, and know what is in them"
)]

use elbowroom_model::Task;
use elbowroom_model::validate::{Settings, Verdict, validate};
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_plan, read_problem};

const FLUENTS: usize = 3;
const FACTS: usize = 3;
/// Steps in a unit of time.
const STEPS: i64 = 512;
const HORIZON: i64 = 6;

/// Pseudo-random numbers with a fixed seed.
struct Rng(u64);

impl Rng {
    fn below(&mut self, bound: u64) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        usize::try_from((self.0 >> 33) % bound).expect("a small number")
    }
}

/// `x[fluent] >= bound` or its opposite, and the truth of a fact.
struct Condition {
    fluent: usize,
    is_above: bool,
    bound: Rational,
    fact: usize,
    truth: bool,
}

impl Condition {
    fn any(dice: &mut Rng, number: i64) -> Self {
        Self {
            fluent: dice.below(FLUENTS as u64),
            is_above: dice.below(2) == 0,
            // No two conditions share a bound, and no step hits one.
            bound: Rational::from(i64::try_from(dice.below(7)).expect("small") - 3)
                + Rational::new(2 * number + 1, 37),
            fact: dice.below(FACTS as u64),
            truth: dice.below(2) == 0,
        }
    }

    fn text(&self) -> String {
        let symbol = if self.is_above { ">=" } else { "<" };
        let fact = format!("(p{})", self.fact);
        let fact = if self.truth {
            fact
        } else {
            format!("(not {fact})")
        };
        format!("(and ({symbol} (x{}) {}) {fact})", self.fluent, self.bound)
    }

    fn holds(&self, state: &State) -> bool {
        (state.numbers[self.fluent] >= self.bound) == self.is_above
            && state.facts[self.fact] == self.truth
    }
}

struct State {
    numbers: Vec<Rational>,
    facts: Vec<bool>,
}

/// Processes that each change one number, and events that each negate the fact of their own
/// condition, so that they cannot happen again at once, and add to a number.
struct World {
    processes: Vec<(Condition, usize, i64)>,
    events: Vec<(Condition, usize, i64)>,
    state: State,
}

impl World {
    fn any(dice: &mut Rng) -> Self {
        let mut number = 0;
        let mut rule = |dice: &mut Rng| {
            number += 1;
            let rate = [-2, -1, 1, 2][dice.below(4)];
            (
                Condition::any(dice, number),
                dice.below(FLUENTS as u64),
                rate,
            )
        };
        Self {
            processes: (0..4).map(|_| rule(dice)).collect(),
            events: (0..2).map(|_| rule(dice)).collect(),
            state: State {
                numbers: (0..FLUENTS)
                    .map(|_| Rational::from(i64::try_from(dice.below(5)).expect("small") - 2))
                    .collect(),
                facts: (0..FACTS).map(|_| dice.below(2) == 0).collect(),
            },
        }
    }

    fn task(&self) -> Task {
        let mut domain =
            "(define (domain d) (:predicates (p0) (p1) (p2) (over)) (:functions (x0) (x1) (x2))
            (:action stop :effect (over))\n"
                .to_owned();
        for (index, (condition, fluent, rate)) in self.processes.iter().enumerate() {
            let condition = condition.text();
            domain += &format!(
                "(:process a{index} :precondition {condition} :effect (increase (x{fluent}) (* #t {rate})))\n"
            );
        }
        for (index, (condition, fluent, amount)) in self.events.iter().enumerate() {
            let fact = format!("(p{})", condition.fact);
            let turned = if condition.truth {
                format!("(not {fact})")
            } else {
                fact
            };
            let condition = condition.text();
            domain += &format!(
                "(:event e{index} :precondition {condition} :effect (and {turned} (increase (x{fluent}) {amount})))\n"
            );
        }
        let mut problem = "(define (problem p) (:domain d) (:goal (over)) (:init\n".to_owned();
        for (index, value) in self.state.numbers.iter().enumerate() {
            problem += &format!("(= (x{index}) {value})\n");
        }
        for (index, _) in self
            .state
            .facts
            .iter()
            .enumerate()
            .filter(|(_, truth)| **truth)
        {
            problem += &format!("(p{index})\n");
        }
        let domain = Source::new("domain.pddl", domain + ")");
        let problem = Source::new("problem.pddl", problem + "))");
        match read_problem(&domain, &problem) {
            Ok((problem, _)) => Task::new(problem),
            Err(diagnostics) => panic!("{}", diagnostics.render(false)),
        }
    }

    /// Simulates step by step and returns the state at the horizon. Returns `None` if the events
    /// never stop.
    fn live(mut self) -> Option<State> {
        let step = Rational::new(1, STEPS);
        self.happen()?;
        for _ in 0..HORIZON * STEPS {
            let at_work: Vec<_> = self
                .processes
                .iter()
                .filter(|(when, ..)| when.holds(&self.state))
                .collect();
            for (_, fluent, rate) in at_work {
                self.state.numbers[*fluent] += Rational::from(*rate) * &step;
            }
            self.happen()?;
        }
        Some(self.state)
    }

    fn happen(&mut self) -> Option<()> {
        for _ in 0..10 {
            let ready = self
                .events
                .iter()
                .position(|(when, ..)| when.holds(&self.state));
            let Some(ready) = ready else {
                return Some(());
            };
            let (when, fluent, amount) = &self.events[ready];
            self.state.facts[when.fact] = !when.truth;
            self.state.numbers[*fluent] += Rational::from(*amount);
        }
        None
    }
}

#[test]
fn validator_agrees_with_small_step_simulation() {
    let mut dice = Rng(20_060_301);
    let (mut compared, mut others) = (0, 0);
    for case in 0..150 {
        let world = World::any(&mut dice);
        let task = world.task();
        let plan = Source::new("plan", format!("{HORIZON}: (stop)"));
        let (plan, _) = read_plan(&plan, &task).expect("a plan");
        let verdict = validate(&task, &plan, &Settings::default());
        let Verdict::Valid(report) = verdict else {
            // Infinitely many events, interfering events, or chattering processes.
            others += 1;
            continue;
        };
        let Some(slow) = world.live() else {
            panic!("case {case}: the twin finds events without end")
        };
        compared += 1;
        // Each of a few changes comes at most a step late.
        let close = Rational::new(40, STEPS);
        for (index, expected) in slow.numbers.iter().enumerate() {
            let fluent = task.fluent_named(&format!("(x{index})")).expect("a fluent");
            let value = &report.state.values[&fluent];
            assert!(
                (value - expected).abs() <= close,
                "case {case}: (x{index}) = {} against {}",
                value.to_decimal(4),
                expected.to_decimal(4)
            );
        }
    }
    assert!(compared >= 60, "{compared} compared, {others} others");
}
