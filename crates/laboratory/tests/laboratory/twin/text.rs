//! Small worlds as PDDL and as world files.

use std::fmt::Write as _;

use super::{Change, FACTS, Literal, Measure, SmallChange, SmallOutcome, SmallWorld};

impl SmallWorld {
    pub(crate) fn domain(&self) -> String {
        let mut text =
            "(define (domain small) (:requirements :durative-actions :negative-preconditions)
            (:predicates (f0) (f1) (f2) (f3)) (:functions (n))\n"
                .to_owned();
        for (index, action) in self.actions.iter().enumerate() {
            let timed = |when: &str, what: Option<Literal>| {
                what.map_or(String::new(), |what| format!("({when} {})", words(what)))
            };
            let measured = |when: &str, what: Option<Measure>| {
                what.map_or(String::new(), |what| format!("({when} {})", what.words()))
            };
            let amount = &action.amount;
            let taken = match amount.taken {
                0 => String::new(),
                taken => format!("(at start (decrease (n) {taken}))"),
            };
            let changed = amount.at_end.as_ref().map(|(change, amounts)| {
                format!("(at end ({} (n) {}))", change.word(), amounts[0])
            });
            let _ = write!(
                text,
                "(:durative-action a{index} :parameters () :duration (= ?duration {})
                   :condition (and {} {} {} {} {} {}) :effect (and {} {} {taken} {}))\n",
                action.durations[0],
                timed("at start", action.start),
                timed("over all", action.over_all),
                timed("at end", action.end),
                measured("at start", amount.start),
                measured("over all", amount.over_all),
                measured("at end", amount.end),
                timed("at start", action.at_start),
                timed("at end", Some(action.at_end)),
                changed.unwrap_or_default(),
            );
        }
        text + ")"
    }

    pub(crate) fn problem(&self) -> String {
        let facts = (0..FACTS).filter(|fact| self.initial & (1 << fact) != 0);
        let listed = |facts: &mut dyn Iterator<Item = usize>| {
            let words: Vec<String> = facts.map(|fact| format!("(f{fact})")).collect();
            words.join(" ")
        };
        let initial = listed(&mut facts.clone());
        let goal = listed(&mut self.goal.iter().copied());
        let number = self.number.unwrap_or_default();
        let wanted = self.wanted.map_or(String::new(), Measure::words);
        format!(
            "(define (problem p) (:domain small)
               (:init (= (n) {number}) {initial}) (:goal (and {goal} {wanted})))"
        )
    }

    pub(crate) fn world(&self) -> String {
        let mut text = "format = \"elbowroom-world\"\nversion = 1\n".to_owned();
        let mut amount_of = String::new();
        for (index, action) in self.actions.iter().enumerate() {
            let _ = writeln!(
                text,
                "[[duration]]\naction = \"a{index}\"\nvalues = {:?}",
                action.durations
            );
            let _ = writeln!(
                text,
                "[[failure]]\naction = \"a{index}\"\nprobability = {}",
                action.fails
            );
            if let Some((_, amounts)) = &action.amount.at_end {
                let _ = writeln!(
                    amount_of,
                    "[[amount]]\naction = \"a{index}\"\nfluent = \"n\"\nvalues = {amounts:?}"
                );
            }
            if action.is_undone {
                text += "undone = true\n";
            }
            for outcome in &action.outcomes {
                let _ = writeln!(
                    text,
                    "[[failure.outcome]]\nprobability = {}\ndelay = {}\n{}",
                    outcome.share,
                    outcome.delay,
                    outcome.changes_text()
                );
            }
        }
        text += &amount_of;
        for event in &self.events {
            let (fact, truth) = event.change;
            let _ = writeln!(
                text,
                "[[event]]\nfact = \"(f{fact})\"\nbecomes = {truth}\nvalues = {:?}\nprobability = {}",
                event.times, event.probability
            );
        }
        if !self.changes.is_empty() {
            text = text.replace("version = 1\n", "version = 1\nresolution = 1\n");
        }
        for fact in 0..FACTS {
            let mut rates = String::new();
            for (word, truth) in [("true", true), ("false", false)] {
                let of = |change: &&SmallChange| change.change == (fact, truth);
                if let Some(change) = self.changes.iter().find(of) {
                    let _ = writeln!(rates, "becomes_{word}_per_second = {}", change.rate);
                }
            }
            if !rates.is_empty() {
                let _ = writeln!(text, "[[hazard]]\nfact = \"(f{fact})\"\n{rates}");
            }
        }
        text
    }
}

impl SmallWorld {
    /// Returns the failures of the world as a likelihood file, without spontaneous changes.
    #[allow(dead_code, reason = "not all tests that share this have likelihoods")]
    pub(crate) fn likelihoods(&self) -> String {
        let mut text = "format = \"elbowroom-likelihoods\"\nversion = 1\n[defaults]\nstart = 1.0\n\
            effect = 1.0\nbecomes_true = 0.0\nbecomes_false = 0.0\n"
            .to_owned();
        for (index, action) in self.actions.iter().enumerate() {
            if action.fails == 0.0 {
                continue;
            }
            let _ = writeln!(
                text,
                "[actions.a{index}]\nend = {:?}\nundone = {}",
                1.0 - action.fails,
                action.is_undone
            );
            for outcome in &action.outcomes {
                let _ = writeln!(
                    text,
                    "[[actions.a{index}.outcome]]\nprobability = {:?}\n{}",
                    outcome.share,
                    outcome.changes_text()
                );
            }
        }
        text
    }
}

impl SmallOutcome {
    /// Returns the changes in the common format of world and likelihood files.
    fn changes_text(&self) -> String {
        let list = |truth: bool| {
            let facts = self.changes.iter().filter(|change| change.1 == truth);
            facts
                .map(|(fact, _)| format!("(f{fact})"))
                .collect::<Vec<_>>()
        };
        format!(
            "becomes_true = {:?}\nbecomes_false = {:?}",
            list(true),
            list(false)
        )
    }
}

impl Measure {
    fn words(self) -> String {
        let word = if self.at_least { ">=" } else { "<=" };
        format!("({word} (n) {})", self.bound)
    }
}

impl Change {
    fn word(self) -> &'static str {
        match self {
            Self::Increase => "increase",
            Self::Decrease => "decrease",
            Self::Assign => "assign",
        }
    }
}

fn words((fact, truth): Literal) -> String {
    if truth {
        format!("(f{fact})")
    } else {
        format!("(not (f{fact}))")
    }
}
