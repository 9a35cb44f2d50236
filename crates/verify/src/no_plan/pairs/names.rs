//! File format of atoms and claims.

use super::{Atom, Claims, Earliest, Key, Structure};
use crate::Exact;
use crate::no_plan::{MutexPair, NoPlanFlaw, fact};

impl Structure<'_> {
    fn name(&self, atom: usize) -> String {
        let process = |number: usize| &self.processes[number];
        match self.atoms[atom] {
            Atom::Literal((fact, true)) => self.earliest_times.task.fact_name(fact),
            Atom::Literal((fact, false)) => {
                format!("(not {})", self.earliest_times.task.fact_name(fact))
            }
            Atom::Running(number) => self.processes[number].title(),
            Atom::Ended(number) => format!("ended {}", process(number).name),
        }
    }

    /// Returns the claims in the format of the certificate.
    pub fn to_groups(&self, claims: &Claims) -> Vec<MutexPair> {
        let mut groups: Vec<MutexPair> = Vec::new();
        let mut sorted: Vec<(&Earliest, &Key)> = claims.iter().map(|(k, t)| (t, k)).collect();
        sorted.sort();
        for (time, key) in sorted {
            let from = match time {
                Earliest::From(time) => Some(Exact(time.clone())),
                Earliest::Never => None,
            };
            if groups.last().is_none_or(|last| last.from != from) {
                groups.push(MutexPair {
                    from,
                    ..MutexPair::default()
                });
            }
            let Some(group) = groups.last_mut() else {
                continue;
            };
            match *key {
                Key::Pair(one, other) => {
                    group.together.push([one, other].map(|own| self.name(own)));
                }
                Key::Started(process, atom) => {
                    group
                        .started
                        .push([self.processes[process].title(), self.name(atom)]);
                }
                Key::Meanwhile(process, atom) => {
                    group
                        .meanwhile
                        .push([self.processes[process].title(), self.name(atom)]);
                }
            }
        }
        groups
    }

    /// Reads the claims of a certificate.
    ///
    /// # Errors
    /// When a name does not exist, or a claim is repeated.
    pub fn parse_groups(&self, groups: &[MutexPair]) -> Result<Claims, NoPlanFlaw> {
        let mut names = std::collections::BTreeMap::new();
        for atom in 0..self.atoms.len() {
            if !matches!(self.atoms[atom], Atom::Literal(_))
                && names.insert(self.name(atom), atom).is_some()
            {
                return Err(NoPlanFlaw::Unknown("an action with two running instances"));
            }
        }
        let atom = |name: &String| {
            let known = names.get(name).copied().or_else(|| self.literal(name));
            known.ok_or_else(|| NoPlanFlaw::NoSuchFact(name.clone()))
        };
        let action = |name: &String| {
            let known = names.get(name).and_then(|&atom| self.runs(atom));
            known.ok_or_else(|| NoPlanFlaw::NoSuchFact(name.clone()))
        };
        let mut claims = Claims::new();
        for group in groups {
            let from = group.from.as_ref();
            let time = from.map_or(Earliest::Never, |from| Earliest::From(from.0.clone()));
            let mut claim = |key: Key, [one, other]: &[String; 2]| {
                if claims.insert(key, time.clone()).is_some() {
                    return Err(NoPlanFlaw::Twice(format!("{one}, {other}")));
                }
                Ok(())
            };
            for pair in &group.together {
                claim(Key::pair(atom(&pair[0])?, atom(&pair[1])?), pair)?;
            }
            for pair in &group.started {
                claim(Key::Started(action(&pair[0])?, atom(&pair[1])?), pair)?;
            }
            for pair in &group.meanwhile {
                claim(Key::Meanwhile(action(&pair[0])?, atom(&pair[1])?), pair)?;
            }
        }
        Ok(claims)
    }

    fn literal(&self, name: &str) -> Option<usize> {
        let inner = name
            .strip_prefix("(not ")
            .and_then(|rest| rest.strip_suffix(')'));
        let (predicate, objects) = fact(self.earliest_times.task, inner.unwrap_or(name))?;
        let fact = self.earliest_times.task.find_fact(predicate, &objects)?;
        let literal = Atom::Literal((fact, inner.is_none()));
        self.numbers.get(&literal).copied()
    }

    /// Returns a claim in words.
    pub fn describe_claim(&self, key: Key) -> String {
        match key {
            Key::Pair(one, other) if one == other => format!("`{}`", self.name(one)),
            Key::Pair(one, other) => format!("`{}` with `{}`", self.name(one), self.name(other)),
            Key::Started(process, atom) => {
                format!(
                    "`{}` after `{}`",
                    self.processes[process].title(),
                    self.name(atom)
                )
            }
            Key::Meanwhile(process, atom) => {
                format!(
                    "`{}` during `{}`",
                    self.name(atom),
                    self.processes[process].title()
                )
            }
        }
    }

    /// Returns a happening in words.
    pub fn describe_happening(&self, number: usize) -> String {
        match self.start_or_end(number) {
            [Some(action), _] => format!("`{}`", self.processes[action].name),
            [_, Some(action)] => format!("the end of `{}`", self.processes[action].name),
            _ => "a timed initial".to_owned(),
        }
    }
}
