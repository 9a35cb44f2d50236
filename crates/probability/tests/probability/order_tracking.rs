//! Cached data of an order leads to the same decisions as a computation from scratch.

use crate::shared;
use std::fmt::Write;
use std::sync::Arc;

use elbowroom_num::Rational;
use elbowroom_plan::NodeId;
use elbowroom_probability::dispatch::{goal_holds, lattermost_layer, never_interrupt};
use elbowroom_probability::{
    Choice, LayerDispatch, Likelihoods, Model, OrderSearch, Reconsider, Running, SearchSettings,
    SearchState, Semantics, TotalOrderPlan,
};

/// Pseudorandom numbers.
struct Random(u64);

impl Random {
    fn below(&mut self, count: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).unwrap() % count
    }

    fn chance(&mut self, percent: usize) -> bool {
        self.below(100) < percent
    }

    fn pick<'t, T>(&mut self, among: &'t [T]) -> &'t T {
        &among[self.below(among.len())]
    }
}

const FACTS: usize = 6;

/// Generates a random plan of a random domain. Some have a counter, and some have facts that change
/// at absolute times, often for just one of the actions.
fn random_search(dice: &mut Random) -> OrderSearch {
    let fact = |dice: &mut Random| format!("(f{})", dice.below(FACTS));
    let has_number = dice.chance(30);
    let (mut actions, mut plan) = (String::new(), String::new());
    let count = 2 + dice.below(4);
    for index in 0..count {
        let (least, more) = (1 + dice.below(6), dice.below(8));
        let duration = if dice.chance(60) {
            format!("(= ?duration {least})")
        } else {
            format!(
                "(and (>= ?duration {least}) (<= ?duration {}))",
                least + more
            )
        };
        let mut conditions = String::new();
        for when in ["at start", "over all", "at end"] {
            if dice.chance(35) {
                let own = fact(dice);
                let own = if dice.chance(25) {
                    format!("(not {own})")
                } else {
                    own
                };
                write!(conditions, "({when} {own})").unwrap();
            }
        }
        if has_number && dice.chance(40) {
            write!(conditions, "(at start (<= (n) {}))", 2 + dice.below(4)).unwrap();
        }
        let mut effects = format!("(at end (f{}))", dice.below(FACTS));
        for when in ["at start", "at end"] {
            if dice.chance(40) {
                let own = fact(dice);
                let own = if dice.chance(50) {
                    format!("(not {own})")
                } else {
                    own
                };
                write!(effects, "({when} {own})").unwrap();
            }
        }
        if has_number {
            effects.push_str("(at end (increase (n) 1))");
        }
        writeln!(
            actions,
            "(:durative-action a{index} :parameters () :duration {duration}
               :condition (and {conditions}) :effect (and {effects}))"
        )
        .unwrap();
        writeln!(plan, "{}: (a{index}) [{least}]", index * 20).unwrap();
    }
    let facts: Vec<String> = (0..FACTS).map(|index| format!("(f{index})")).collect();
    let mut init: String = facts.iter().filter(|_| dice.chance(60)).cloned().collect();
    for index in 0..dice.below(3) {
        let own = fact(dice);
        let own = if dice.chance(50) {
            format!("(not {own})")
        } else {
            own
        };
        write!(init, "(at {} {own})", 3 + 2 * dice.below(12) + index % 2).unwrap();
    }
    let goal: String = (0..=dice.below(3)).map(|_| fact(dice)).collect();
    let domain = format!(
        "(define (domain d) (:requirements :fluents :timed-initial-literals :negative-preconditions)
           (:predicates {}) (:functions (n)) {actions})",
        facts.concat()
    );
    let problem =
        format!("(define (problem p) (:domain d) (:init {init} (= (n) 0)) (:goal (and {goal})))");
    let (task, plan) = shared::read_task(&domain, &problem, &plan);
    let mut likelihoods = Likelihoods::certain();
    likelihoods.defaults.becomes_false = Some(0.02);
    likelihoods.defaults.becomes_true = Some(0.01);
    let model = Model::new(Arc::new(task), plan, &likelihoods, Semantics::Paper).unwrap();
    OrderSearch::new(model, SearchSettings::default())
}

/// Generates circumstances that fit one of the layers, or nearly.
fn near_a_layer(dice: &mut Random, search: &OrderSearch, order: &TotalOrderPlan) -> SearchState {
    let model = search.model();
    let mut now = SearchState::initial(model.task());
    let epsilon = model.task().epsilon();
    let second = Rational::from(i64::try_from(dice.below(30)).unwrap());
    let a_little = [
        Rational::ZERO,
        -epsilon,
        epsilon.clone(),
        epsilon / Rational::from(2),
    ];
    now.now = (second + dice.pick(&a_little)).max(Rational::ZERO);
    let layer = dice.pick(&order.layers);
    for fact in model.facts() {
        now.belief.set(fact, *dice.pick(&[0.0, 1.0, 0.4, 0.6]));
    }
    for &(fact, truth) in &layer.literals {
        now.belief
            .set(fact, f64::from(u8::from(truth != dice.chance(4))));
    }
    for &instance in &layer.running {
        if dice.chance(97) {
            let ago = Rational::new(i64::try_from(dice.below(12)).unwrap(), 2);
            let start = (&now.now - ago + dice.pick(&a_little)).min(now.now.clone());
            now.running.push(Running { instance, start });
        }
    }
    now.running
        .sort_by(|a, b| (&a.start, a.instance).cmp(&(&b.start, b.instance)));
    for _ in 0..dice.below(4) {
        let node = NodeId::from(1 + dice.below(model.plan().nodes.len() - 1));
        let agos = [Rational::ZERO, epsilon / Rational::from(3)];
        let ago = dice.pick(&agos);
        now.recent.push((node, &now.now - ago));
    }
    now.recent.sort_by(|a, b| a.1.cmp(&b.1));
    let fluents: Vec<_> = now.values.keys().copied().collect();
    for fluent in fluents {
        now.values.insert(
            fluent,
            Rational::from(i64::try_from(dice.below(5)).unwrap()),
        );
    }
    now
}

#[test]
fn cached_layers_equal_recomputed_layers() {
    let mut dice = Random(20_261_123);
    let (mut plans, mut fitting, mut windowed, mut unfit) = (0, 0, 0, 0);
    while plans < 200 {
        let search = random_search(&mut dice);
        let start = SearchState::initial(search.model().task());
        let mut dispatch = LayerDispatch::new(search.clone(), Reconsider::WhenNoLayerFits);
        dispatch.choose(&start, &mut never_interrupt).unwrap();
        if dispatch
            .order()
            .is_none_or(|order| order.sequence.is_empty())
        {
            continue;
        }
        plans += 1;
        for _ in 0..40 {
            let Some(order) = dispatch.order().cloned() else {
                break;
            };
            let now = near_a_layer(&mut dice, &search, &order);
            let expected = lattermost_layer(&search, &order, &now);
            let is_over = now.running.is_empty()
                && search.is_goal_settled(&now.now)
                && goal_holds(search.model(), &now);
            // A copy, so that both continue from the same order.
            let chosen = dispatch.clone().choose(&now, &mut never_interrupt).unwrap();
            let followed = dispatch.choose(&now, &mut never_interrupt).unwrap();
            assert_eq!(chosen, followed);
            match (followed, expected) {
                (Choice::GoalReached, _) => assert!(is_over),
                (Choice::Next(next), Some((position, slot))) => {
                    let expected = (order.sequence[position], position, slot, false);
                    assert_eq!(
                        (
                            next.node,
                            next.position,
                            next.slot.clone(),
                            next.is_new_order
                        ),
                        expected
                    );
                    fitting += 1;
                    windowed += usize::from(next.slot.latest.is_some());
                }
                (Choice::Next(next), None) => {
                    assert!(next.is_new_order);
                    unfit += 1;
                }
                (Choice::Replan, None) => unfit += 1,
                (followed, expected) => panic!("{followed:?}, but {expected:?}"),
            }
        }
    }
    assert!(
        fitting > 750 && windowed > 150 && unfit > 150,
        "{fitting} {windowed} {unfit}"
    );
}
