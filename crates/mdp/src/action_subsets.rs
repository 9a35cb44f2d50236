//! Sets of actions: the supporting actions that a set requires, and the worlds of agents restricted
//! to a set.

use elbowroom_model::Task;
use elbowroom_sim::WorldModel;

use super::process::action_model::{ActionModel, Facts};
use super::process::world::TimedWorld;
use super::settings::{NotTabulated, Settings};

/// Returns `actions` with as few of `others` as possible, such that all actions stay reachable from
/// the initial state that are reachable with all `others`. Reachability is relaxed: no fact becomes
/// false, and comparisons of numbers hold.
///
/// # Errors
/// When the task or the world has a feature that the process does not support.
pub fn supported(
    task: &Task,
    model: &WorldModel,
    actions: &[String],
    others: &[String],
) -> Result<Vec<String>, NotTabulated> {
    let settings = Settings {
        only: Some(actions.iter().chain(others).cloned().collect()),
        ..Settings::default()
    };
    let world = TimedWorld::new(task, model, &settings)?;
    let others = others.iter().filter(|other| !actions.contains(other));
    let mut all: Vec<String> = actions.iter().chain(others).cloned().collect();
    let reachable = world.reachable(&all);
    let mut place = actions.len();
    while place < all.len() {
        let without = all.remove(place);
        let is_enough =
            |name: &String| !reachable.contains(name) || world.reachable(&all).contains(name);
        if !actions.iter().all(is_enough) {
            all.insert(place, without);
            place += 1;
        }
    }
    Ok(all)
}

impl TimedWorld {
    /// Returns the actions that are in one of these sets, as bits.
    pub(super) fn in_sets(&self, sets: &[Vec<String>]) -> u64 {
        let acts = self.acts.iter().enumerate();
        let is_asked_for = |act: &ActionModel| sets.iter().flatten().any(|name| *name == act.name);
        let asked_for = acts.filter(|(_, act)| is_asked_for(act));
        asked_for.fold(0, |all, (index, _)| all | 1 << index)
    }

    /// Returns, for each distinct set, the world of its actions and of their
    /// [detours](Self::with_detours). Detours are chosen among the actions that are neither in the
    /// sets nor in `others`.
    pub(super) fn restricted_to(&self, sets: &[Vec<String>], others: &[Vec<String>]) -> Vec<Self> {
        let of_any = self.in_sets(sets) | self.in_sets(others);
        let mut own: Vec<u64> = Vec::new();
        for set in sets {
            let of_set = self.in_sets(std::slice::from_ref(set));
            if of_set != 0 && !own.contains(&of_set) {
                own.push(of_set);
            }
        }
        let kept = own.into_iter();
        kept.map(|own| self.with_detours(own, !of_any)).collect()
    }

    /// Returns the world of the actions `own` and of their detours: the actions in `others` that
    /// can start from facts that `own` actions add, and that add facts that `own` actions read.
    fn with_detours(&self, own: u64, others: u64) -> Self {
        let is_among = |acts: u64, index: usize| acts & (1 << index) != 0;
        let events = self.events.iter();
        let mut given = events.fold(self.initial | self.tested, |facts, event| {
            facts | event.adds
        });
        let mut needed = self.goal.mentions();
        for (index, act) in self.acts.iter().enumerate() {
            if is_among(own, index) {
                given |= act.adds();
                needed |= act.mentions();
            }
        }
        let is_detour = |act: &ActionModel| {
            let start = act.start.needs.conjunction().unwrap_or(0);
            let is_of_use = act.adds() & needed & !start != 0 || act.can_help();
            act.start.needs.is_possible(given) && is_of_use
        };
        let mut keeping = self.clone();
        let acts = keeping.acts.into_iter().enumerate();
        let kept = acts.filter(|(index, act)| {
            is_among(own, *index) || (is_among(others, *index) && is_detour(act))
        });
        keeping.acts = kept.map(|(_, act)| act).collect();
        keeping.compute_changes();
        keeping
    }

    /// Returns the given actions that are reachable if no fact becomes false and comparisons of
    /// numbers hold.
    fn reachable(&self, names: &[String]) -> Vec<String> {
        let events = self.events.iter();
        let mut facts: Facts = events.fold(self.initial | self.tested, |facts, event| {
            facts | event.adds
        });
        let is_asked_for = |name: &str| names.iter().any(|asked| asked.eq_ignore_ascii_case(name));
        let mut waiting: Vec<_> = self
            .acts
            .iter()
            .filter(|act| is_asked_for(&act.name))
            .collect();
        let mut reachable = Vec::new();
        loop {
            let before = waiting.len();
            waiting.retain(|act| {
                let can_start = act.start.needs.is_possible(facts);
                if can_start {
                    facts |= act.adds() | act.adds_by_failing();
                    reachable.push(act.name.clone());
                }
                !can_start
            });
            if waiting.len() == before {
                return reachable;
            }
        }
    }
}
