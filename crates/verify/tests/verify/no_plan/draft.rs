//! Small random problems, and a checker of certificates for them that depends neither on PDDL nor
//! on the model: it walks along a time grid.

use std::collections::BTreeMap;
use std::fmt::Write;

use elbowroom_num::Rational;
use elbowroom_verify::no_plan::NoPlan;

use crate::game::Random;

const FACTS: usize = 5;
const LAST: i64 = 60;

/// Facts f0 … f4.
#[derive(Clone, Debug)]
pub(crate) struct Draft {
    actions: Vec<Action>,
    initial: Vec<usize>,
    timed: Vec<(i64, usize, bool)>,
    goal: Vec<usize>,
}

#[derive(Clone, Debug)]
struct Action {
    least: i64,
    most: i64,
    at_start: Vec<usize>,
    over_all: Vec<usize>,
    at_end: Vec<usize>,
    start: Vec<(usize, bool)>,
    end: Vec<(usize, bool)>,
}

fn some(random: &mut Random, most: usize) -> Vec<usize> {
    let mut facts = Vec::new();
    for _ in 0..random.below(most + 1) {
        let fact = random.below(FACTS);
        if !facts.contains(&fact) {
            facts.push(fact);
        }
    }
    facts
}

impl Draft {
    pub(crate) fn random(random: &mut Random) -> Self {
        let count = 1 + random.below(4);
        let actions = (0..count).map(|_| {
            let mut effects = |most| -> Vec<(usize, bool)> {
                let facts = some(random, most);
                let with_truth = facts.into_iter().map(|fact| (fact, random.below(4) > 0));
                with_truth.collect()
            };
            let (start, end) = (effects(1), effects(2));
            let least = random.whole(1, 4);
            let more = if random.below(3) == 0 { 2 } else { 0 };
            Action {
                least,
                most: least + more,
                at_start: some(random, 1),
                over_all: some(random, 1),
                at_end: some(random, 1),
                start,
                end,
            }
        });
        let actions = actions.collect();
        let timed = (0..random.below(4)).map(|_| {
            (
                random.whole(1, 7),
                random.below(FACTS),
                random.below(2) == 0,
            )
        });
        let mut timed: Vec<(i64, usize, bool)> = timed.collect();
        timed.sort_unstable();
        // The reader rejects facts that become true and false at one time.
        timed.dedup_by_key(|own| (own.0, own.1));
        let mut goal = some(random, 2);
        if goal.is_empty() {
            goal.push(0);
        }
        Self {
            actions,
            initial: some(random, 2),
            timed,
            goal,
        }
    }

    /// Returns the smaller variants: without one action, initial fact or addition, or with timed
    /// initials one earlier.
    pub(crate) fn smaller_variants(&self) -> Vec<Self> {
        let mut all = Vec::new();
        for number in 0..self.actions.len() {
            let mut other = self.clone();
            other.actions.remove(number);
            all.push(other);
            let mut other = self.clone();
            other.actions[number].end.retain(|own| !own.1);
            all.push(other);
        }
        for number in 0..self.initial.len() {
            let mut other = self.clone();
            other.initial.remove(number);
            all.push(other);
        }
        if self.timed.iter().all(|own| own.0 > 1) && !self.timed.is_empty() {
            let mut other = self.clone();
            other.timed.iter_mut().for_each(|own| own.0 -= 1);
            all.push(other);
        }
        all.retain(|own| !own.actions.is_empty());
        all
    }

    pub(crate) fn has_fixed_durations(&self) -> bool {
        self.actions
            .iter()
            .all(|action| action.least == action.most)
    }

    /// Returns the domain and the problem as text.
    pub(crate) fn text(&self) -> (String, String) {
        let mut domain = "(:requirements :durative-actions :duration-inequalities \
                          :timed-initial-literals) (:predicates"
            .to_owned();
        for fact in 0..FACTS {
            write!(domain, " (f{fact})").unwrap();
        }
        domain.push(')');
        for (number, action) in self.actions.iter().enumerate() {
            let conditions = [
                ("at start", &action.at_start),
                ("over all", &action.over_all),
                ("at end", &action.at_end),
            ];
            let conditions: String = conditions
                .iter()
                .flat_map(|(when, facts)| facts.iter().map(move |f| format!(" ({when} (f{f}))")))
                .collect();
            let effects = [("at start", &action.start), ("at end", &action.end)];
            let effects: String = effects
                .iter()
                .flat_map(|(when, literals)| {
                    literals.iter().map(move |(fact, truth)| {
                        if *truth {
                            format!(" ({when} (f{fact}))")
                        } else {
                            format!(" ({when} (not (f{fact})))")
                        }
                    })
                })
                .collect();
            write!(
                domain,
                "(:durative-action a{number} :parameters ()
                   :duration (and (>= ?duration {}) (<= ?duration {}))
                   :condition (and{conditions}) :effect (and{effects}))",
                action.least, action.most
            )
            .unwrap();
        }
        let mut problem = "(:init".to_owned();
        for fact in &self.initial {
            write!(problem, " (f{fact})").unwrap();
        }
        for (time, fact, truth) in &self.timed {
            if *truth {
                write!(problem, " (at {time} (f{fact}))").unwrap();
            } else {
                write!(problem, " (at {time} (not (f{fact})))").unwrap();
            }
        }
        problem.push_str(") (:goal (and");
        for fact in &self.goal {
            write!(problem, " (f{fact})").unwrap();
        }
        problem.push_str("))");
        (domain, problem)
    }

    /// Returns `true` if no action makes the fact true.
    fn is_fixed(&self, fact: usize) -> bool {
        let adds = |effects: &[(usize, bool)]| effects.contains(&(fact, true));
        !self
            .actions
            .iter()
            .any(|own| adds(&own.start) || adds(&own.end))
    }

    /// Returns `true` if a fact that no action makes true may be true just before a time in half
    /// units.
    fn may_hold(&self, fact: usize, halves: i64) -> bool {
        let mut holds = self.initial.contains(&fact);
        let mut times: Vec<i64> = self.timed.iter().map(|own| own.0).collect();
        times.dedup();
        for time in times.into_iter().filter(|time| 2 * time < halves) {
            let at = |truth| self.timed.contains(&(time, fact, truth));
            holds = at(true) || holds && !at(false);
        }
        holds
    }

    /// Returns `true` if the fact may be true just before or just after a time in half units.
    fn touches(&self, fact: usize, halves: i64) -> bool {
        self.may_hold(fact, halves) || self.may_hold(fact, halves + 1)
    }

    /// Returns `true` if the certificate proves, by definition, that there is no plan.
    pub(crate) fn is_proof(&self, certificate: &NoPlan) -> bool {
        let mut from: BTreeMap<usize, Rational> = BTreeMap::new();
        for group in &certificate.reached {
            for name in &group.facts {
                let fact = name[2..name.len() - 1].parse().unwrap();
                if from.insert(fact, group.from.0.clone()).is_some() {
                    return false;
                }
            }
        }
        let listed = |fact: usize, time: i64| {
            let from = from.get(&fact);
            from.is_some_and(|from| *from <= Rational::from(time))
        };
        let can_hold = |fact: usize, time: i64| {
            if self.is_fixed(fact) {
                self.touches(fact, 2 * time)
            } else {
                listed(fact, time)
            }
        };
        let kept = |fact: usize, time: i64| self.is_fixed(fact) || listed(fact, time);
        if !self.initial.iter().all(|&fact| kept(fact, 0)) {
            return false;
        }
        let mut adds = self.timed.iter().filter(|own| own.2);
        if !adds.all(|&(time, fact, _)| kept(fact, time)) {
            return false;
        }
        for action in &self.actions {
            for start in 0..LAST {
                for end in start + action.least..=start + action.most {
                    let starts = action.at_start.iter().all(|&f| can_hold(f, start))
                        && action.over_all.iter().all(|&f| {
                            !self.is_fixed(f)
                                || (2 * start + 1..=2 * end).all(|half| self.may_hold(f, half))
                        })
                        && action
                            .at_end
                            .iter()
                            .all(|&f| !self.is_fixed(f) || can_hold(f, end));
                    let ends = starts
                        && action.over_all.iter().all(|&f| kept(f, start))
                        && action.at_end.iter().all(|&f| kept(f, end));
                    let keeps = |effects: &[(usize, bool)], time: i64| {
                        let mut adds = effects.iter().filter(|own| own.1);
                        adds.all(|&(fact, _)| listed(fact, time))
                    };
                    if starts && !keeps(&action.start, start) || ends && !keeps(&action.end, end) {
                        return false;
                    }
                }
            }
        }
        !self.goal.iter().all(|&fact| {
            if self.is_fixed(fact) {
                self.may_hold(fact, 2 * LAST)
            } else {
                from.contains_key(&fact)
            }
        })
    }
}
