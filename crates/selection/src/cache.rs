//! Planners and preparers with a cache.
//!
//! A planner whose limits are counted, not timed, is a function: the same task and situation have
//! the same answer. In a comparison, many requests are equal: executors abandon a plan after the
//! same observation and are then in the same situation, and so are trials whose step exceeds the
//! same bound. Requests are compared in full, so the results do not depend on the cache.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use elbowroom_execution::{
    PlanAnswer, PlanForm, Planner, PlannerAnswer, PreparationResult, PrepareError, Preparer,
};
use elbowroom_model::{Situation, State, Task, TimeTriggeredPlan, TimedHappening};
use elbowroom_num::Rational;
use indexmap::IndexMap;

/// Cache of requests and answers. It is cleared when it is full.
#[derive(Clone, Debug)]
struct Cache<Q, A> {
    /// Entries by the hash of the request.
    entries: IndexMap<u64, Vec<(Q, A)>>,
    count: usize,
    capacity: usize,
}

impl<Q, A: Clone> Cache<Q, A> {
    fn new(most: usize) -> Self {
        Self {
            entries: IndexMap::new(),
            count: 0,
            capacity: most,
        }
    }

    fn get(&self, hash: u64, is_same: impl Fn(&Q) -> bool) -> Option<A> {
        let mut known = self.entries.get(&hash)?.iter();
        let (_, answer) = known.find(|(question, _)| is_same(question))?;
        Some(answer.clone())
    }

    fn insert(&mut self, hash: u64, question: Q, answer: A) {
        if self.count >= self.capacity {
            self.entries.clear();
            self.count = 0;
        }
        self.count += 1;
        self.entries
            .entry(hash)
            .or_default()
            .push((question, answer));
    }
}

/// A planner with a cache.
///
/// It serves one problem only, and the planner must be a function of task and situation,
/// independent of clocks and random numbers.
#[derive(Clone, Debug)]
pub struct CachingPlanner<P> {
    planner: P,
    cache: Cache<Situation, PlanAnswer>,
    /// The size of the table of facts and fluents that the cached answers refer to.
    table_size: Option<(usize, usize)>,
}

impl<P: Planner> CachingPlanner<P> {
    /// Creates a cache for at most `most` answers.
    pub fn new(planner: P, most: usize) -> Self {
        Self {
            planner,
            cache: Cache::new(most),
            table_size: None,
        }
    }
}

impl<P: Planner> Planner for CachingPlanner<P> {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let table = table_size(task);
        if *self.table_size.get_or_insert(table) != table {
            // Facts that are numbered later may get different numbers in each run.
            return self.planner.plan(task, situation);
        }
        let hash = hash(&(&situation.time, parts(&situation.state)));
        let known = self.cache.get(hash, |known| known == situation);
        if let Some(answer) = known {
            return PlannerAnswer::from(answer);
        }
        let planned = self.planner.plan(task, situation);
        if self::table_size(task) == table {
            let answer = planned.answer.clone();
            self.cache.insert(hash, situation.clone(), answer);
        }
        planned
    }
}

/// A preparer with a cache. It serves one problem only.
#[derive(Clone, Debug)]
pub struct CachingPreparer<P> {
    preparer: P,
    cache: Cache<CacheKey, Result<PreparationResult, PrepareError>>,
    table_size: Option<(usize, usize)>,
}

/// The arguments of a preparer, as a key of the cache.
#[derive(Clone, Debug)]
struct CacheKey {
    need: PlanForm,
    initial: State,
    timed: Vec<TimedHappening>,
    plan: TimeTriggeredPlan,
}

impl<P: Preparer> CachingPreparer<P> {
    /// Creates a cache for at most `most` answers.
    pub fn new(preparer: P, most: usize) -> Self {
        Self {
            preparer,
            cache: Cache::new(most),
            table_size: None,
        }
    }
}

impl<P: Preparer> Preparer for CachingPreparer<P> {
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: PlanForm,
    ) -> Result<PreparationResult, PrepareError> {
        let table = table_size(task);
        if *self.table_size.get_or_insert(table) != table {
            return self.preparer.prepare(task, plan, need);
        }
        let starts: Vec<&Rational> = plan.steps.iter().map(|step| &step.start).collect();
        let timed: Vec<&Rational> = task.timed().iter().map(|timed| &timed.time).collect();
        let hash = hash(&(need as u8, parts(task.initial()), starts, timed));
        let known = self.cache.get(hash, |known| {
            known.need == need
                && known.plan == *plan
                && known.timed == task.timed()
                && known.initial == *task.initial()
        });
        if let Some(answer) = known {
            return answer;
        }
        let answer = self.preparer.prepare(task, plan, need);
        let question = CacheKey {
            need,
            initial: task.initial().clone(),
            timed: task.timed().to_vec(),
            plan: plan.clone(),
        };
        self.cache.insert(hash, question, answer.clone());
        answer
    }
}

/// Returns the size of the task's table. Tables only grow, so two tables of one problem with the
/// same size are equal.
fn table_size(task: &Task) -> (usize, usize) {
    (task.fact_count(), task.fluent_count())
}

fn parts(state: &State) -> impl Hash + '_ {
    (&state.facts, &state.values)
}

fn hash(question: &impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    question.hash(&mut hasher);
    hasher.finish()
}
