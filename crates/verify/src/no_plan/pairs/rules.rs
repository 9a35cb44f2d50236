//! Rules that derive bounds from others, and the check that a list of bounds is inductive.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

use super::{Atom, Bounds, Earliest, Key, Kind, Structure};
use crate::no_plan::earliest_times::ConditionContext;

/// Claimed bounds, to be checked.
pub type Claims = BTreeMap<Key, Earliest>;

impl Bounds for Claims {
    fn get(&self, key: Key) -> Option<&Earliest> {
        BTreeMap::get(self, &key)
    }

    fn begin(&self, _: usize) -> Option<&Earliest> {
        None
    }
}

impl Structure<'_> {
    /// Returns `true` if the atoms have contradictory literals.
    pub fn excludes(&self, one: usize, other: usize) -> bool {
        let theirs = &self.literals[other];
        let mut literals = self.literals[one].iter();
        literals.any(|own| theirs.contains(&(own.0, !own.1)))
    }

    fn at_least<'b>(&'b self, known: &'b impl Bounds, key: Key) -> &'b Earliest {
        known.get(key).unwrap_or(&self.before)
    }

    /// Returns the earliest time at which two atoms have become true together.
    pub fn pair<'b>(&'b self, known: &'b impl Bounds, one: usize, other: usize) -> &'b Earliest {
        let own = self.at_least(known, Key::pair(one, other));
        if one == other {
            return own.max(&self.relaxed_times[one]);
        }
        if self.excludes(one, other) {
            return &Earliest::Never;
        }
        let alone = [one, other].map(|atom| self.at_least(known, Key::Pair(atom, atom)));
        let floors = [one, other].map(|atom| &self.relaxed_times[atom]);
        let floor = floors[0].max(floors[1]);
        own.max(alone[0]).max(alone[1]).max(floor)
    }

    /// Visits the pairs that are true together just before a happening, and the least time before
    /// it.
    pub fn visit_pairs_before(
        &self,
        happening: usize,
        visit: &mut impl FnMut(usize, usize, &Rational),
    ) {
        let operator = &self.operators[happening];
        for (place, &one) in operator.reads.iter().enumerate() {
            for &other in &operator.reads[place..] {
                visit(one, other, self.epsilon);
            }
        }
        for (place, &one) in operator.holds.iter().enumerate() {
            for &other in operator.holds[place..].iter().chain(&operator.reads) {
                visit(one, other, &Rational::ZERO);
            }
        }
    }

    /// Returns the earliest time of a happening.
    pub fn earliest(&self, number: usize, known: &impl Bounds) -> Earliest {
        if let Some(begin) = known.begin(number) {
            return begin.clone();
        }
        let operator = &self.operators[number];
        if !operator.is_possible {
            return Earliest::Never;
        }
        let mut time = Earliest::From(self.earliest_times.now.clone());
        self.visit_pairs_before(number, &mut |one, other, delay| {
            time.raise(self.pair(known, one, other), delay);
        });
        if let Kind::End(process) = operator.kind {
            let begun = self.earliest_start(process, known);
            time.raise(&begun, &self.processes[process].least);
        }
        self.earliest_allowed_time(number, time)
    }

    /// Returns the earliest time of a happening without other bounds: never, if the atom `with` is
    /// not true after it.
    pub fn earliest_without_bounds(&self, happening: usize, with: Option<usize>) -> Earliest {
        let operator = &self.operators[happening];
        let is_ended = with.is_some_and(|atom| operator.ends.contains(&atom));
        if is_ended || !operator.is_possible {
            return Earliest::Never;
        }
        self.earliest_allowed_time(happening, Earliest::From(self.earliest_times.now.clone()))
    }

    /// Returns the least separation of interfering happenings.
    pub fn epsilon(&self) -> &Rational {
        self.epsilon
    }

    /// Returns the earliest start of an action.
    pub fn earliest_start(&self, process: usize, known: &impl Bounds) -> Earliest {
        match (
            &self.processes[process].initial_start,
            self.start_of[process],
        ) {
            (Some(begun), _) => Earliest::From(begun.clone()),
            (None, Some(start)) => self.earliest(start, known),
            (None, None) => Earliest::Never,
        }
    }

    /// Visits the atoms that are true together with `atom` just before a happening after which
    /// `atom` is still true.
    pub fn visit_atoms_kept_with(
        &self,
        happening: usize,
        atom: usize,
        visit: &mut impl FnMut(usize, usize),
    ) {
        let operator = &self.operators[happening];
        for &one in operator.reads.iter().chain(&operator.holds) {
            visit(one, atom);
            for &other in &self.implied_atoms[atom] {
                visit(one, other);
            }
        }
        if operator.reads.is_empty() && operator.holds.is_empty() {
            visit(atom, atom);
        }
    }

    /// Returns the earliest time of a happening that keeps an atom true; `begin` is the earliest
    /// time of the happening.
    pub fn earliest_with(
        &self,
        number: usize,
        atom: usize,
        begin: &Earliest,
        known: &impl Bounds,
    ) -> Earliest {
        let operator = &self.operators[number];
        if !operator.is_possible || operator.ends.contains(&atom) {
            return Earliest::Never;
        }
        let mut time = begin.clone();
        self.visit_atoms_kept_with(number, atom, &mut |one, other| {
            time.raise(self.pair(known, one, other), &Rational::ZERO);
        });
        if let Kind::End(process) = operator.kind {
            let [since_start, since] = self.earliest_ends_with(process, atom, known);
            time = time.max(since_start.min(since));
        }
        self.earliest_allowed_time(number, time)
    }

    /// Returns the earliest end of an action with an atom that has been true since its start, and
    /// with one that has become true since.
    pub fn earliest_ends_with(
        &self,
        process: usize,
        atom: usize,
        known: &impl Bounds,
    ) -> [Earliest; 2] {
        let own = &self.processes[process];
        let started = match &own.initial_start {
            None => self.at_least(known, Key::Started(process, atom)).clone(),
            // Only one instance was running initially, so no other one is running when it ends.
            Some(begun) if self.is_initial[atom] && self.atoms[atom] != Atom::Running(process) => {
                Earliest::From(begun.clone())
            }
            Some(_) => Earliest::Never,
        };
        let since = self.at_least(known, Key::Meanwhile(process, atom));
        [started.plus(&own.least), since.clone()]
    }

    /// Returns the earliest time, not before `time`, at which timed initials and durations allow
    /// the happening.
    pub fn earliest_allowed_time(&self, happening: usize, time: Earliest) -> Earliest {
        let operator = &self.operators[happening];
        let Earliest::From(time) = time else {
            return Earliest::Never;
        };
        let moments = &self.earliest_times;
        let possible = match operator.kind {
            Kind::Timed(number) => {
                let own = &self.times[number];
                (time <= *own).then(|| own.clone())
            }
            Kind::Start(_) if !operator.has_windows => Some(time),
            Kind::Start(number) => {
                if let Some(body) = self.processes[number].durative() {
                    let first = moments.starts(
                        body,
                        &time,
                        ConditionContext::StaticOnly,
                        ConditionContext::StaticOnly,
                    );
                    first.map(|own| own.0)
                } else {
                    let condition = self.processes[number].instant();
                    moments.next(condition, &time, ConditionContext::StaticOnly)
                }
            }
            Kind::End(number) => {
                let process = &self.processes[number];
                let end = match process.durative().filter(|_| operator.has_windows) {
                    Some(body) => {
                        moments.end_from(body, &process.least, &time, ConditionContext::StaticOnly)
                    }
                    None => Some(time),
                };
                let latest = process.initial_start.as_ref().zip(process.most.as_ref());
                end.filter(|end| latest.is_none_or(|(begun, most)| *end <= begun + most))
            }
        };
        possible.map_or(Earliest::Never, Earliest::From)
    }

    /// Returns the happenings that can make a bound applicable, each with the atom that is true
    /// before and after it, if any.
    pub fn enabling_happenings(&self, key: Key) -> Vec<(usize, Option<usize>)> {
        match key {
            Key::Pair(one, other) => {
                let mut occasions = Vec::new();
                for (made, kept) in [(one, other), (other, one)] {
                    for &operator in &self.adders[made] {
                        let makes_both = self.operators[operator].adds.contains(&kept);
                        occasions.push((operator, (!makes_both).then_some(kept)));
                    }
                }
                occasions
            }
            Key::Started(process, atom) => {
                let Some(start) = self.start_of[process] else {
                    return Vec::new();
                };
                let is_made = self.operators[start].adds.contains(&atom)
                    && self.atoms[atom] != Atom::Running(process);
                vec![(start, (!is_made).then_some(atom))]
            }
            Key::Meanwhile(process, atom) => {
                let Some(&running) = self.numbers.get(&Atom::Running(process)) else {
                    return Vec::new();
                };
                let adders = self.adders[atom].iter();
                adders.map(|&operator| (operator, Some(running))).collect()
            }
        }
    }

    /// Returns the earliest time of an occasion.
    pub fn enabling_time(
        &self,
        (operator, with): (usize, Option<usize>),
        known: &impl Bounds,
    ) -> Earliest {
        let begin = self.earliest(operator, known);
        match with {
            Some(atom) => self.earliest_with(operator, atom, &begin, known),
            None => begin,
        }
    }

    /// Returns the first violated claim, with the happening that violates it; `None` for the
    /// initial state.
    pub fn first_violation(&self, claims: &Claims) -> Option<(Key, Option<usize>)> {
        for (&key, claimed) in claims {
            let is_from_the_start = match key {
                Key::Pair(one, other) => self.is_initial[one] && self.is_initial[other],
                Key::Started(process, _) => self.start_of[process].is_none(),
                Key::Meanwhile(..) => false,
            };
            if is_from_the_start && *claimed > self.before {
                return Some((key, None));
            }
            if let Key::Pair(one, other) = key
                && one != other
                && self.excludes(one, other)
            {
                continue;
            }
            for occasion in self.enabling_happenings(key) {
                if self.enabling_time(occasion, claims) < *claimed {
                    return Some((key, Some(occasion.0)));
                }
            }
        }
        None
    }

    /// Returns `true` if each alternative of the goal needs two atoms that are never true together.
    pub fn is_goal_excluded(&self, known: &impl Bounds) -> bool {
        self.goals
            .iter()
            .all(|goal| self.contradiction(goal, known).is_some())
    }

    /// Returns the atoms that each alternative of the goal needs.
    pub fn goals(&self) -> &[Vec<usize>] {
        &self.goals
    }

    /// Returns the earliest time at which two atoms can be true together, without any bounds.
    pub fn relaxed_bound(&self, one: usize, other: usize) -> &Earliest {
        if one != other && self.excludes(one, other) {
            return &Earliest::Never;
        }
        Ord::max(&self.relaxed_times[one], &self.relaxed_times[other])
    }

    /// Returns two of these atoms that are never true together.
    pub fn contradiction(&self, atoms: &[usize], known: &impl Bounds) -> Option<(usize, usize)> {
        let places = atoms.iter().enumerate();
        let mut pairs =
            places.flat_map(|(place, &one)| atoms[place..].iter().map(move |&other| (one, other)));
        pairs.find(|&(one, other)| *self.pair(known, one, other) == Earliest::Never)
    }
}

impl Earliest {
    /// Raises the bound to `time` plus a delay, if that is later.
    pub fn raise(&mut self, time: &Self, delay: &Rational) {
        let is_later = match (&*self, time) {
            (Self::Never, _) => false,
            (_, Self::Never) => true,
            (Self::From(own), Self::From(time)) if delay.is_zero() => own < time,
            (Self::From(own), Self::From(time)) => *own < time + delay,
        };
        if is_later {
            *self = time.plus(delay);
        }
    }
}
