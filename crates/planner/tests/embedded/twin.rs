//! A slow search over all sequences of happenings, each scheduled by Bellman and Ford and shown to
//! the judge, finds a plan exactly when the planner does.

use std::fmt::Write;
use std::ops::ControlFlow;

use elbowroom_model::ground::Action;
use elbowroom_model::validate::{self, Settings as Strictness, Verdict};
use elbowroom_model::{Footprint, Situation, Step, Task, TimeTriggeredPlan, validate_from};
use elbowroom_num::Rational;
use elbowroom_planner::{Answer, Settings, plan};
use proptest::prelude::*;

use crate::world::{describe, task};

/// The most happenings of a plan that the twin looks for.
const MOST: usize = 6;

/// Facts f0 … f3, an action for each entry, and timed initials.
#[derive(Clone, Debug)]
struct Draft {
    actions: Vec<DraftAction>,
    initial: u8,
    goal: u8,
    timed: Vec<(u8, u8, bool)>,
}

#[derive(Clone, Debug)]
struct DraftAction {
    /// 0: it takes no time.
    duration: u8,
    at_start: Option<(u8, bool)>,
    over_all: Option<u8>,
    start: Vec<(u8, bool)>,
    end: Vec<(u8, bool)>,
    /// Taken from the store at the start, which must have so much.
    cost: u8,
    /// Put into the store at the end.
    gain: i8,
    /// Whether the store must not run out meanwhile.
    minds: bool,
}

fn drafts() -> impl Strategy<Value = Draft> {
    let literal = || (0..4_u8, any::<bool>());
    let effects = || prop::collection::vec(literal(), 0..3);
    let action = (
        0..4_u8,
        prop::option::of(literal()),
        prop::option::of(0..4_u8),
        effects(),
        effects(),
        0..2_u8,
        (-2..2_i8, any::<bool>()),
    );
    let action = action.prop_map(
        |(duration, at_start, over_all, start, end, cost, (gain, minds))| DraftAction {
            duration,
            at_start,
            over_all,
            start,
            end,
            cost,
            gain,
            minds,
        },
    );
    (
        prop::collection::vec(action, 1..4),
        0..16_u8,
        1..16_u8,
        prop::collection::vec((1..5_u8, 0..4_u8, any::<bool>()), 0..3),
    )
        .prop_map(|(actions, initial, goal, timed)| Draft {
            actions,
            initial,
            goal,
            timed,
        })
}

fn written(literals: &[(u8, bool)], when: &str) -> String {
    let mut text = String::new();
    // A fact both added and deleted at once is not what is tested here.
    let mut seen = Vec::new();
    for (fact, truth) in literals {
        if seen.contains(fact) {
            continue;
        }
        seen.push(*fact);
        let literal = if *truth {
            format!("(f{fact})")
        } else {
            format!("(not (f{fact}))")
        };
        if when.is_empty() {
            write!(text, " {literal}").expect("as written above");
        } else {
            write!(text, " (at {when} {literal})").expect("as written above");
        }
    }
    text
}

impl Draft {
    fn task(&self) -> Task {
        let mut domain = "(:requirements :durative-actions :numeric-fluents :adl
            :timed-initial-literals) (:predicates (f0) (f1) (f2) (f3)) (:functions (store))"
            .to_owned();
        for (number, action) in self.actions.iter().enumerate() {
            let needs = action.at_start.iter().copied().collect::<Vec<_>>();
            if action.duration == 0 {
                let mut needs = written(&needs, "");
                let mut effects = written(&action.start, "");
                if action.cost > 0 {
                    write!(needs, " (>= (store) {})", action.cost).expect("strings take all");
                    write!(effects, " (decrease (store) {})", action.cost)
                        .expect("strings take all");
                }
                write!(
                    domain,
                    "(:action a{number} :parameters () :precondition (and{needs})
                      :effect (and{effects}))",
                )
                .expect("as written above");
                continue;
            }
            let mut needs = written(&needs, "start");
            let mut effects = written(&action.start, "start");
            effects += &written(&action.end, "end");
            if let Some(fact) = action.over_all {
                write!(needs, " (over all (f{fact}))").expect("strings take all");
            }
            if action.minds {
                needs += " (over all (>= (store) 0))";
            }
            if action.gain != 0 {
                write!(effects, " (at end (increase (store) {}))", action.gain)
                    .expect("strings take all");
            }
            if action.cost > 0 {
                write!(needs, " (at start (>= (store) {}))", action.cost)
                    .expect("strings take all");
                write!(effects, " (at start (decrease (store) {}))", action.cost)
                    .expect("strings take all");
            }
            write!(
                domain,
                "(:durative-action a{number} :parameters () :duration (= ?duration {})
                  :condition (and{needs}) :effect (and{effects}))",
                action.duration
            )
            .expect("as written above");
        }
        let facts = |bits: u8| {
            let facts = (0..4).filter(|bit| bits >> bit & 1 == 1);
            facts
                .map(|bit| format!("(f{bit})"))
                .collect::<Vec<_>>()
                .concat()
        };
        let mut initial = facts(self.initial) + "(= (store) 2)";
        for (time, fact, truth) in &self.timed {
            let literal = written(&[(*fact, *truth)], "");
            write!(initial, " (at {time}{literal})").expect("as written above");
        }
        let goal = facts(self.goal);
        task(&domain, &format!("(:init {initial}) (:goal (and {goal}))"))
    }
}

/// One happening of a sequence: an action's start or instant, or the end of an earlier one.
#[derive(Clone, Copy, Debug)]
enum Choice {
    Start(usize),
    End(usize),
}

/// All sequences of happenings up to a length, timed initials put in between in all ways.
struct Twin<'a> {
    task: &'a Task,
    actions: Vec<Action>,
    sequence: Vec<Choice>,
    budget: usize,
}

impl Twin<'_> {
    /// Whether some continuation of the sequence is a plan; `None` if the budget does not suffice.
    fn finds(&mut self) -> Option<bool> {
        self.budget = self.budget.checked_sub(1)?;
        if self.open().is_empty() && self.has_schedule() {
            return Some(true);
        }
        if self.sequence.len() == MOST {
            return Some(false);
        }
        let room = MOST - self.sequence.len();
        let open = self.open();
        for place in &open {
            self.sequence.push(Choice::End(*place));
            let found = self.finds();
            self.sequence.pop();
            if found != Some(false) {
                return found;
            }
        }
        for number in 0..self.actions.len() {
            let takes = 1 + usize::from(self.actions[number].durative().is_some());
            if open.len() + takes > room {
                continue;
            }
            self.sequence.push(Choice::Start(number));
            let found = self.finds();
            self.sequence.pop();
            if found != Some(false) {
                return found;
            }
        }
        Some(false)
    }

    /// The places of the starts that have not ended.
    fn open(&self) -> Vec<usize> {
        let mut open = Vec::new();
        for (place, choice) in self.sequence.iter().enumerate() {
            match choice {
                Choice::Start(action) if self.actions[*action].durative().is_some() => {
                    open.push(place);
                }
                Choice::Start(_) => {}
                Choice::End(start) => open.retain(|other| other != start),
            }
        }
        open
    }

    /// Whether some interleaving with the timed initials gives a valid plan.
    fn has_schedule(&self) -> bool {
        let timed = self.task.timed().len();
        let count = self.sequence.len();
        // For each timed initial, how many happenings come before it; not descending.
        let mut places = vec![0; timed];
        loop {
            if self.is_valid(&places) {
                return true;
            }
            let Some(next) = (0..timed).rev().find(|&t| places[t] < count) else {
                return false;
            };
            let place = places[next] + 1;
            places[next..].fill(place);
        }
    }

    /// Schedules the happenings as early as their order allows, and asks the judge.
    fn is_valid(&self, places: &[usize]) -> bool {
        let epsilon = Rational::new(1, 1000);
        let prints: Vec<Footprint> = self
            .sequence
            .iter()
            .map(|choice| match *choice {
                Choice::Start(action) => Footprint::of_start(self.task, &self.actions[action]),
                Choice::End(start) => Footprint::of_end(self.task, self.action_at(start)),
            })
            .collect();
        let count = self.sequence.len();
        // `to >= from + distance`; the last node is time 0.
        let mut edges: Vec<(usize, usize, Rational)> = Vec::new();
        for (to, choice) in self.sequence.iter().enumerate() {
            edges.push((count, to, Rational::ZERO));
            for from in 0..to {
                let apart = if prints[from].interferes_with(&prints[to]) {
                    epsilon.clone()
                } else {
                    Rational::ZERO
                };
                edges.push((from, to, apart));
            }
            if let Choice::End(start) = *choice {
                let duration = self.duration_at(start);
                edges.push((start, to, duration.clone()));
                edges.push((to, start, -duration));
            }
        }
        for (timed, &place) in self.task.timed().iter().zip(places) {
            let footprint = Footprint::of_timed(timed);
            for (node, print) in prints.iter().enumerate() {
                let apart = if print.interferes_with(&footprint) {
                    epsilon.clone()
                } else {
                    Rational::ZERO
                };
                if node < place {
                    edges.push((node, count, apart - &timed.time));
                } else {
                    edges.push((count, node, &timed.time + apart));
                }
            }
        }
        let mut times = vec![Rational::ZERO; count + 1];
        for round in 0..=count + 1 {
            let mut changed = false;
            for (from, to, distance) in &edges {
                let time = &times[*from] + distance;
                if time > times[*to] {
                    times[*to] = time;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
            if round > count || times[count].is_positive() {
                return false;
            }
        }
        let steps = self.sequence.iter().enumerate();
        let steps = steps.filter_map(|(place, choice)| match *choice {
            Choice::Start(action) => Some(Step {
                start: times[place].clone(),
                action: self.actions[action].clone(),
                duration: self.actions[action]
                    .durative()
                    .map(|_| self.duration_at(place)),
            }),
            Choice::End(_) => None,
        });
        let candidate = TimeTriggeredPlan {
            steps: steps.collect(),
        };
        validate::validate(self.task, &candidate, &Strictness::default()).is_valid()
    }

    fn action_at(&self, place: usize) -> &Action {
        match self.sequence[place] {
            Choice::Start(action) => &self.actions[action],
            Choice::End(_) => unreachable!("ends point to starts"),
        }
    }

    fn duration_at(&self, place: usize) -> Rational {
        let body = self.action_at(place).durative();
        match &body.expect("durative").duration[0].bound {
            elbowroom_model::ground::Expression::Constant(value) => value.clone(),
            _ => unreachable!("durations are constants here"),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    #[test]
    fn the_planner_finds_a_plan_exactly_when_its_twin_does(draft in drafts()) {
        let mut task = draft.task();
        let situation = Situation::initial(&task);
        let mut turns = 0;
        let settings = Settings { first_plan_only: true, ..Settings::default() };
        let answer = plan(&mut task, &situation, &settings, &mut |_| {
            turns += 1;
            if turns > 200 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let names: Vec<_> = (0..draft.actions.len()).map(|n| format!("a{n}")).collect();
        let actions: Vec<Action> = names
            .iter()
            .map(|name| {
                let schema = task.problem().schema(name).expect("as written above");
                task.instantiate(schema, &[]).expect("as written above")
            })
            .collect();
        let mut twin = Twin { task: &task, actions, sequence: Vec::new(), budget: 1_200 };
        let found = twin.finds();
        match &answer {
            Answer::Plan { found: ours, .. } => {
                let verdict =
                    validate_from(&task, &situation, &ours.plan, &Strictness::default());
                prop_assert!(matches!(verdict, Verdict::Valid(_)));
                let happenings: usize = ours
                    .plan
                    .steps
                    .iter()
                    .map(|step| 1 + usize::from(step.duration.is_some()))
                    .sum();
                if happenings <= MOST {
                    prop_assert_ne!(found, Some(false), "{}", describe(&answer));
                }
            }
            Answer::Unsolvable { .. } => {
                prop_assert_ne!(found, Some(true), "{}", describe(&answer));
            }
            Answer::NoneFound { .. } | Answer::Unsupported(_) => {
                // Ends of one time that run the store out together are beyond the planner.
                let is_plain = draft.actions.iter().all(|action| !action.minds);
                prop_assert!(!is_plain || found != Some(true), "{}", describe(&answer));
            }
        }
    }
}
