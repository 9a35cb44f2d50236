//! Times before which pairs of atoms are not true together: the least fixpoint of the checker's
//! rules, and the bounds of it that a proof needs.

use elbowroom_num::Rational;
use elbowroom_verify::no_plan::pairs::{Bounds, Claims, Earliest, Key, Structure};

use super::{Effort, EffortExhausted};

/// Maximum number of atoms, and of actions.
const MAX_ELEMENTS: usize = 1_000;

/// Maximum number of looked-up bounds (some seconds).
const MAX_LOOKUPS: usize = 200_000_000;

/// Number of looked-up bounds per unit of work: see [`Effort`].
const LOOKUPS_PER_WORK: u64 = 10;

/// Reasons for a missing proof by pairs.
pub(super) enum Failure {
    TooMany,
    /// The goal is reachable by the rules for pairs.
    Reachable,
    Stopped,
}

/// Computes claims that exclude the goal and that follow from each other.
pub(super) fn claims(
    structure: &Structure<'_>,
    effort: &mut Effort<'_>,
) -> Result<Claims, Failure> {
    if structure.atom_count() > MAX_ELEMENTS || structure.action_count() > MAX_ELEMENTS {
        return Err(Failure::TooMany);
    }
    let mut table = Table::of(structure);
    table.propagate(effort)?;
    table.needed()
}

/// All bounds, by number.
struct Table<'a> {
    structure: &'a Structure<'a>,
    count: usize,
    pair: Vec<Earliest>,
    started: Vec<Earliest>,
    meanwhile: Vec<Earliest>,
    begin: Vec<Earliest>,
    /// For each atom and each action, the round of the last decrease of one of its bounds.
    atom_round: Vec<u32>,
    action_round: Vec<u32>,
    round: u32,
}

impl Bounds for Table<'_> {
    fn get(&self, key: Key) -> Option<&Earliest> {
        Some(match key {
            Key::Pair(one, other) => &self.pair[one * self.count + other],
            Key::Started(action, atom) => &self.started[action * self.count + atom],
            Key::Meanwhile(action, atom) => &self.meanwhile[action * self.count + atom],
        })
    }

    fn begin(&self, happening: usize) -> Option<&Earliest> {
        Some(&self.begin[happening])
    }
}

/// The bounds without the present bound of a happening, whose time is being recomputed.
struct TableWithout<'a>(&'a Table<'a>, usize);

impl Bounds for TableWithout<'_> {
    fn get(&self, key: Key) -> Option<&Earliest> {
        self.0.get(key)
    }

    fn begin(&self, happening: usize) -> Option<&Earliest> {
        self.0.begin(happening).filter(|_| happening != self.1)
    }
}

impl<'a> Table<'a> {
    /// Creates the table before any happening.
    fn of(structure: &'a Structure<'a>) -> Self {
        let (count, actions) = (structure.atom_count(), structure.action_count());
        let mut table = Self {
            count,
            pair: vec![Earliest::Never; count * count],
            started: vec![Earliest::Never; actions * count],
            meanwhile: vec![Earliest::Never; actions * count],
            begin: vec![Earliest::Never; structure.happening_count()],
            atom_round: vec![0; count],
            action_round: vec![0; actions],
            round: 0,
            structure,
        };
        for one in 0..count {
            for other in one..count {
                if structure.initial(one).is_some()
                    && let Some(before) = structure.initial(other)
                {
                    table.pair[one * count + other] = before.clone();
                }
            }
        }
        table
    }

    /// Applies happenings until no bound is lowered any more.
    fn propagate(&mut self, effort: &mut Effort<'_>) -> Result<(), Failure> {
        let happenings = self.structure.happening_count();
        let mut last = vec![0; happenings];
        let mut looks = 0;
        loop {
            self.round += 1;
            let mut changed = false;
            for (happening, last) in last.iter_mut().enumerate() {
                if *last > 0 && !self.is_due(happening, *last) {
                    continue;
                }
                *last = self.round;
                let own = self.count * (1 + self.structure.needed_by(happening).count());
                looks += own;
                let spent = effort.spend(1 + own as u64 / LOOKUPS_PER_WORK);
                spent.map_err(|EffortExhausted| Failure::Stopped)?;
                changed |= self.fire(happening);
            }
            if !changed {
                return Ok(());
            }
            if looks > MAX_LOOKUPS {
                return Err(Failure::TooMany);
            }
        }
    }

    /// Returns `true` if a bound that a happening reads was lowered since round `last`.
    fn is_due(&self, happening: usize, last: u32) -> bool {
        let [_, ended] = self.structure.start_or_end(happening);
        let mut needs = self.structure.needed_by(happening).peekable();
        needs.peek().is_none()
            || needs.any(|atom| self.atom_round[atom] >= last)
            || ended.is_some_and(|action| self.action_round[action] >= last)
    }

    /// Lowers the bounds on the effects of a happening. Returns `true` if a bound changed.
    fn fire(&mut self, happening: usize) -> bool {
        let structure = self.structure;
        let begin = structure.earliest(happening, &TableWithout(self, happening));
        let [started, _] = structure.start_or_end(happening);
        if begin == Earliest::Never {
            return false;
        }
        let mut changed = false;
        if begin < self.begin[happening] {
            self.begin[happening] = begin.clone();
            if let Some(action) = started {
                self.action_round[action] = self.round;
            }
        }
        let made = structure.made_by(happening);
        let runs = |atom: usize| structure.runs(atom);
        for (place, &one) in made.iter().enumerate() {
            for &other in &made[place..] {
                changed |= self.lower(Key::pair(one, other), &begin);
            }
            if let Some(action) = started
                && runs(one) != Some(action)
            {
                changed |= self.lower(Key::Started(action, one), &begin);
            }
        }
        for atom in 0..self.count {
            let is_made = made.contains(&atom);
            let other = runs(atom);
            if is_made && other.is_none() {
                continue;
            }
            let time = structure.earliest_with(happening, atom, &begin, self);
            if time == Earliest::Never {
                continue;
            }
            if !is_made {
                for &one in made {
                    changed |= self.lower(Key::pair(one, atom), &time);
                }
            }
            if let Some(action) = started
                && (!is_made || other == started)
            {
                changed |= self.lower(Key::Started(action, atom), &time);
            }
            if let Some(action) = other {
                for &one in made {
                    changed |= self.lower(Key::Meanwhile(action, one), &time);
                }
            }
        }
        changed
    }

    fn lower(&mut self, key: Key, time: &Earliest) -> bool {
        let count = self.count;
        let known = match key {
            Key::Pair(one, other) => {
                if one != other && self.structure.excludes(one, other) {
                    return false;
                }
                &mut self.pair[one * count + other]
            }
            Key::Started(action, atom) => &mut self.started[action * count + atom],
            Key::Meanwhile(action, atom) => &mut self.meanwhile[action * count + atom],
        };
        if *known <= *time {
            return false;
        }
        *known = time.clone();
        match key {
            Key::Pair(one, other) => {
                self.atom_round[one] = self.round;
                self.atom_round[other] = self.round;
            }
            Key::Started(action, _) | Key::Meanwhile(action, _) => {
                self.action_round[action] = self.round;
            }
        }
        true
    }

    /// Returns the claims of the proof: those that exclude the goal, those that imply them, and so
    /// on.
    fn needed(&self) -> Result<Claims, Failure> {
        let mut wanted = PendingClaims::default();
        for goal in self.structure.goals() {
            let found = self.structure.contradiction(goal, self);
            let (one, other) = found.ok_or(Failure::Reachable)?;
            if *self.structure.relaxed_bound(one, other) != Earliest::Never {
                wanted.add(
                    self.single_bound(one, other, &|time| *time == Earliest::Never),
                    self,
                );
            }
        }
        while let Some(key) = wanted.open.pop() {
            let Some(time) = self.get(key) else { continue };
            for (happening, with) in self.structure.enabling_happenings(key) {
                self.justify(happening, with, time, &mut wanted);
            }
        }
        Ok(wanted.claims)
    }

    /// Returns a bound of a pair that is late enough: that of one of the atoms alone, or that of
    /// the pair.
    fn single_bound(&self, one: usize, other: usize, is_enough: &dyn Fn(&Earliest) -> bool) -> Key {
        let alone = [Key::Pair(one, one), Key::Pair(other, other)];
        let enough = |key: &Key| self.get(*key).is_some_and(is_enough);
        alone
            .into_iter()
            .find(enough)
            .unwrap_or_else(|| Key::pair(one, other))
    }

    /// Adds a bound that implies that a happening is not before `time`.
    fn justify(
        &self,
        happening: usize,
        with: Option<usize>,
        time: &Earliest,
        wanted: &mut PendingClaims,
    ) {
        let structure = self.structure;
        let is_enough =
            |known: Earliest| structure.earliest_allowed_time(happening, known) >= *time;
        let base = structure.earliest_without_bounds(happening, with);
        if base >= *time {
            return;
        }
        let mut is_free = false;
        let mut reasons: Vec<Key> = Vec::new();
        let delays = [structure.epsilon().clone(), Rational::default()];
        let mut look = |one: usize, other: usize, is_read: bool| {
            let delay = &delays[usize::from(!is_read)];
            if is_enough(structure.relaxed_bound(one, other).plus(delay)) {
                is_free = true;
            } else if !is_free && is_enough(structure.pair(self, one, other).plus(delay)) {
                reasons.push(self.single_bound(one, other, &|known| is_enough(known.plus(delay))));
            }
        };
        structure.visit_pairs_before(happening, &mut |one, other, delay| {
            look(one, other, delay.is_positive());
        });
        if let Some(atom) = with {
            structure
                .visit_atoms_kept_with(happening, atom, &mut |one, other| look(one, other, false));
        }
        if is_free {
            return;
        }
        if reasons.iter().any(|key| wanted.claims.contains_key(key)) {
            return;
        }
        let is_never = |key: &&Key| self.get(**key) == Some(&Earliest::Never);
        if let Some(&key) = reasons.iter().find(is_never).or(reasons.first()) {
            wanted.add(key, self);
            return;
        }
        let [_, Some(action)] = structure.start_or_end(happening) else {
            return;
        };
        let least = structure.least(action);
        if is_enough(structure.earliest_start(action, self).plus(least)) {
            // The bounds that delay the start also delay the end.
            if let Some(start) = structure.start_of(action) {
                self.justify(start, None, &self.begin[start], wanted);
            }
            return;
        }
        let Some(atom) = with else { return };
        // Both cases are late: the atom has been true since the start, or it has become true later.
        wanted.add(Key::Meanwhile(action, atom), self);
        if structure.start_of(action).is_some() {
            wanted.add(Key::Started(action, atom), self);
        }
    }
}

/// Needed claims, and those among them that are not justified yet.
#[derive(Default)]
struct PendingClaims {
    claims: Claims,
    open: Vec<Key>,
}

impl PendingClaims {
    fn add(&mut self, key: Key, table: &Table<'_>) {
        if !self.claims.contains_key(&key)
            && let Some(time) = table.get(key)
        {
            self.claims.insert(key, time.clone());
            self.open.push(key);
        }
    }
}
