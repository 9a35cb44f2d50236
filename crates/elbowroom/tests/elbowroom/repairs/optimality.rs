//! Small random plans: no change on a grid costs less than the repair that was found.

use std::sync::Arc;

use elbowroom::answers::NoObserver;
use elbowroom::answers::repair::{Orders, RepairFinding, RepairRequest, repair};
use elbowroom::model::{Footprint, Step, Task, TimeTriggeredPlan, validate};
use elbowroom::num::Rational;
use elbowroom::pddl::{Source, read_plan, read_problem};
use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Problem with two actions whose durations, and two timed initials whose times, may change.
struct Small {
    domain: String,
    /// Durations, then the times at which the shop opens and closes.
    nominal: [i64; 4],
    weights: [i64; 4],
    is_open: bool,
    charge: i64,
    plan: String,
}

/// All numbers are multiples of 1 / `UNIT`, which is also ε.
const UNIT: i64 = 2;
/// Maximum number on the grid, in units.
const MOST: i64 = 14;

impl Small {
    fn random(rng: &mut ChaCha8Rng) -> Self {
        let needs = [
            "",
            "(at start (open))",
            "(at end (open))",
            "(over all (open))",
        ];
        let first = needs.choose(rng).expect("several");
        let second = needs.choose(rng).expect("several");
        let order = [
            "",
            "(at start (done))",
            "(at end (done))",
            "(at start (idle))",
        ]
        .choose(rng)
        .expect("several");
        let uses = ["", "(at end (>= (x) ?duration))", "(at start (>= (x) 1))"]
            .choose(rng)
            .expect("several");
        let drain = [
            "",
            "(at end (decrease (x) ?duration))",
            "(decrease (x) (* #t 1))",
        ]
        .choose(rng)
        .expect("several");
        let goal = if rng.random_bool(0.3) {
            "(over all (>= (x) 1))"
        } else {
            ""
        };
        let durations = [rng.random_range(1..=3), rng.random_range(1..=3)];
        let domain = format!(
            "(define (domain d) (:predicates (open) (done) (idle)) (:functions (x))
               (:durative-action one :parameters () :duration (= ?duration {})
                 :condition (and {first} {uses} {goal})
                 :effect (and (at start (not (idle))) (at end (idle)) (at end (done)) {drain}))
               (:durative-action two :parameters () :duration (= ?duration {})
                 :condition (and {second} {order} {uses})
                 :effect (and (at start (decrease (x) 1)) {drain})))",
            durations[0], durations[1]
        );
        let opens = rng.random_range(1..=3);
        let closes = rng.random_range(opens + 1..=5);
        let starts = [0, rng.random_range(0..=4)];
        Self {
            domain,
            nominal: [durations[0], durations[1], opens, closes],
            weights: [0; 4].map(|_| rng.random_range(1..=3)),
            is_open: rng.random_bool(0.5),
            charge: rng.random_range(1..=6),
            plan: format!(
                "{}: (one) [{}]\n{}.25: (two) [{}]",
                starts[0], durations[0], starts[1], durations[1]
            ),
        }
    }

    /// Returns the task with other times, in units.
    fn task(&self, timed: [i64; 2]) -> Task {
        let [opens, closes] = timed.map(|time| Rational::new(time, UNIT));
        let problem = format!(
            "(define (problem p) (:domain d) (:init (idle) (= (x) {}) {}
               (at {opens} (open)) (at {closes} (not (open)))) (:goal (done)))",
            self.charge,
            if self.is_open { "(open)" } else { "" },
        );
        let problem = problem.replace("(at 0 ", "(at 1/100 ");
        let domain = Source::new("domain", self.domain.clone());
        let (problem, _) = read_problem(&domain, &Source::new("problem", problem))
            .unwrap_or_else(|mistakes| panic!("{}", mistakes.render(false)));
        Task::new(problem).with_epsilon(Rational::new(1, UNIT))
    }

    fn cost(&self, values: [i64; 4]) -> Rational {
        let costs = (0..4).map(|at| {
            let deviation = Rational::new(values[at] - UNIT * self.nominal[at], UNIT);
            deviation.abs() * Rational::from(self.weights[at])
        });
        costs.sum()
    }
}

/// Returns the same step with another start and duration, which becomes the duration of its action.
fn with_times(step: &Step, start: i64, duration: i64) -> Step {
    use elbowroom::model::ground::{Body, DurationConstraint, Expression};
    use elbowroom::model::problem::Comparison;
    let duration = Rational::new(duration, UNIT);
    let mut step = step.clone();
    if let Body::Durative(body) = &mut std::sync::Arc::make_mut(&mut step.action).body {
        body.duration = vec![DurationConstraint {
            comparison: Comparison::Equal,
            bound: Expression::Constant(duration.clone()),
            at_end: false,
        }];
    }
    step.start = Rational::new(start, UNIT);
    step.duration = Some(duration);
    step
}

/// Returns the order of each two interfering happenings of different actions.
fn order(task: &Task, plan: &TimeTriggeredPlan) -> Vec<std::cmp::Ordering> {
    let happenings: Vec<(usize, Rational, Footprint)> = plan
        .steps
        .iter()
        .enumerate()
        .flat_map(|(index, step)| {
            [
                (
                    index,
                    step.start.clone(),
                    Footprint::of_start(task, &step.action),
                ),
                (index, step.end(), Footprint::of_end(task, &step.action)),
            ]
        })
        .collect();
    let mut order = Vec::new();
    for (at, (one, time, footprint)) in happenings.iter().enumerate() {
        for (other, later, read) in &happenings[at + 1..] {
            if one != other && footprint.interferes_with(read) {
                order.push(time.cmp(later));
            }
        }
    }
    order
}

/// Returns `true` if the grid has a valid schedule with these values, in one of these orders of
/// interfering actions.
fn has_schedule(
    small: &Small,
    values: [i64; 4],
    plan: &TimeTriggeredPlan,
    (task, orders): (&Task, Orders),
) -> bool {
    let wanted = (orders == Orders::Kept).then(|| order(task, plan));
    let changed = small.task([values[2], values[3]]);
    // Steps are read for the changed task, so that facts have the same numbers.
    let (read, _) = read_plan(&Source::new("plan", small.plan.clone()), &changed).expect("a plan");
    (0..=MOST).any(|first| {
        (0..=MOST).any(|second| {
            let steps = vec![
                with_times(&read.steps[0], first, values[0]),
                with_times(&read.steps[1], second, values[1]),
            ];
            let timed = TimeTriggeredPlan { steps };
            let has_order = |wanted: &Vec<_>| order(&changed, &timed) == *wanted;
            wanted.as_ref().is_none_or(has_order)
                && validate(&changed, &timed, &validate::Settings::default()).is_valid()
        })
    })
}

/// Repairs random plans, and searches for cheaper repairs.
pub(crate) fn compare() {
    let mut rng = ChaCha8Rng::seed_from_u64(14);
    let (mut repaired, mut changed, mut impossible, mut equal) = (0, 0, 0, 0);
    let mut all_orders = 0;
    for round in 0..60 {
        let small = Small::random(&mut rng);
        let task = Arc::new(small.task([UNIT * small.nominal[2], UNIT * small.nominal[3]]));
        let (plan, _) = read_plan(&Source::new("plan", small.plan.clone()), &task).expect("a plan");
        let mut request = RepairRequest::new(&task, plan.clone());
        let names = [
            "duration one",
            "duration two",
            "timed (open)",
            "deadline (open)",
        ];
        let most = MOST / UNIT;
        request.change = names
            .iter()
            .zip(small.weights)
            .map(|(name, weight)| format!("{name} weight {weight} in [0, {most}]"))
            .map(|spec| spec.parse().expect("a quantity"))
            .collect();
        let outcome = repair(&request, &mut NoObserver)
            .unwrap_or_else(|error| panic!("round {round}: {error}\n{}", small.domain));
        let (cost, orders) = match outcome.answer.finding {
            RepairFinding::Repaired {
                bound,
                not_guaranteed,
                orders,
                ..
            } => {
                let (task, plan) = outcome.repaired.as_ref().expect("a repaired plan");
                let verdict = validate(task, plan, &validate::Settings::default());
                assert!(verdict.is_valid(), "round {round}: {verdict:?}");
                assert_eq!(not_guaranteed, None, "round {round}");
                repaired += 1;
                changed += usize::from(!bound.is_zero());
                all_orders += usize::from(orders == Orders::All);
                (Some(bound), orders)
            }
            RepairFinding::Impossible { orders, .. } => {
                impossible += 1;
                (None, orders)
            }
            other @ RepairFinding::None { .. } => panic!("round {round}: {other:?}"),
        };
        let range = || 0..=MOST;
        let mut is_equal = false;
        for one in range() {
            for two in range() {
                for opens in range() {
                    for closes in opens + 1..=MOST {
                        let values = [one, two, opens, closes];
                        let own = small.cost(values);
                        let is_of_interest = match &cost {
                            Some(cost) => own < *cost || (own == *cost && !is_equal),
                            // The grid is too large for all of them; those close to the plan are
                            // enough.
                            None => own <= Rational::from(2),
                        };
                        if is_of_interest && has_schedule(&small, values, &plan, (&task, orders)) {
                            assert!(
                                cost.as_ref() == Some(&own),
                                "round {round}: {values:?} at {own} instead of {cost:?}\n{} {}",
                                small.domain,
                                small.plan
                            );
                            is_equal = true;
                        }
                    }
                }
            }
        }
        equal += usize::from(is_equal);
    }
    println!(
        "{repaired} repaired, {changed} at a cost, {equal} as on the grid, {all_orders} in all orders, \
         {impossible} impossible"
    );
    assert!(changed >= 15 && impossible >= 3 && all_orders >= 15 && equal * 10 >= repaired * 8);
}
