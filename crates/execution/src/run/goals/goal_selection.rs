//! Pursuit of goals that can be reached together.
//!
//! At first, an executive pursues all open goals together. If there is no plan for all of them,
//! some are selected ([`Selection`]) and the other goals are set aside. These are pursued when the
//! selected ones are achieved, or when the goals change. Goals that are added while a plan is
//! executed are added to those of the plan; if no plan reaches all of them, the new goals are set
//! aside and the plan continues. If there are several goals, each is closed as soon as it is
//! achieved.

use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_num::Rational;

use super::open_goal::OpenGoal;
use super::selection::{GoalSet, Selection, SelectionStep};
use super::shortfall::Conflict;
use super::{GoalContext, GoalManager};
use crate::record::{Entry, GoalChange};
use crate::run::reachability::unreachable_conditions;
use crate::run::settings::Verdict;

/// Maximum number of goals that are listed in a reason.
const MAX_LISTED_GOALS: usize = 5;

/// A selection among the open goals.
pub(super) struct GoalSelection {
    /// The names of the goals, in order of preference.
    names: Vec<String>,
    selection: Selection,
    /// The goals that are pursued during the selection.
    tried: GoalSet,
}

impl GoalSelection {
    /// Creates a selection that tries all these goals.
    fn trying_all(names: Vec<String>, selection: Selection) -> Self {
        Self {
            selection,
            tried: (0..names.len()).collect(),
            names,
        }
    }

    /// Creates a selection among these goals that tries all of them. Goals of greater value are
    /// preferred, then earlier ones.
    fn among_goals(mut goals: Vec<(String, Rational)>) -> Self {
        goals.sort_by(|(_, value), (_, other)| other.cmp(value));
        let (names, values) = goals.into_iter().unzip();
        Self::trying_all(names, Selection::among(values))
    }

    fn position(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|it| it == name)
    }

    /// Leaves a goal out of all further attempts.
    pub(super) fn exclude(&mut self, name: &str) {
        if let Some(position) = self.position(name) {
            self.selection.exclude(GoalSet::from([position]));
        }
    }

    /// Records that no plan reaches all goals of a conflict, or a goal that is proven to be late.
    fn note_proofs(&mut self, conflicts: &[Conflict], goals: &[OpenGoal]) {
        for goal in goals.iter().filter(|goal| goal.is_proven_late) {
            self.exclude(&goal.name);
        }
        for conflict in conflicts {
            let members = conflict.goals.iter().map(|name| self.position(name));
            if let Some(set) = members.collect::<Option<GoalSet>>() {
                self.selection.exclude(set);
            }
        }
    }

    /// Returns the names of those goals of the set that are open.
    fn open(&self, set: &GoalSet, goals: &[OpenGoal]) -> BTreeSet<String> {
        let names = set.iter().map(|it| &self.names[*it]);
        let is_open = |name: &&String| goals.iter().any(|goal| goal.name == **name);
        names.filter(is_open).cloned().collect()
    }
}

impl GoalManager<'_> {
    /// Returns `true` while goals are selected.
    pub(in crate::run) fn is_selecting_goals(&self) -> bool {
        self.selection.is_some()
    }

    /// Pursues all open goals again, from the next plan on.
    pub(super) fn pursue_all(&mut self, ctx: &mut GoalContext<'_>) {
        self.selection = None;
        let mut is_changed = false;
        for goal in &mut self.goals {
            is_changed |= goal.set_aside.take().is_some();
            goal.unreachable = None;
        }
        if is_changed {
            self.set_goal(ctx);
        }
    }

    /// Adds new goals to the selection. If no plan also reaches these, the present plan continues.
    pub(super) fn add_goals_to_selection(&mut self, ctx: &mut GoalContext<'_>) {
        if self.planned_goals.is_empty() {
            if self.selection.is_some() {
                self.restart_selection(ctx, true);
            }
            return;
        }
        let choosing = self.selection.take();
        let candidates = choosing.map(|choosing| choosing.names);
        let candidates = candidates.unwrap_or_default();
        let (mut planned, mut new) = (Vec::new(), Vec::new());
        for goal in &mut self.goals {
            let known = (goal.name.clone(), goal.terms.value.clone());
            if self.planned_goals.contains(&goal.name) {
                planned.push(known);
            } else if goal.is_pursued() || candidates.contains(&goal.name) {
                goal.set_aside = None;
                new.push(known);
            }
        }
        let greatest = new.iter().map(|(_, value)| value).max();
        let least = planned.iter().map(|(_, value)| value).min();
        self.selection = match (least, greatest) {
            (None, _) => None,
            // Goals of the plan may be set aside for more valuable ones.
            (Some(least), Some(greatest)) if greatest > least => {
                Some(GoalSelection::among_goals([planned, new].concat()))
            }
            _ => {
                let count = planned.len();
                let names: Vec<String> =
                    [planned, new].concat().into_iter().map(|it| it.0).collect();
                let selection = Selection::growing(count, names.len());
                Some(GoalSelection::trying_all(names, selection))
            }
        };
    }

    /// Continues with other goals where the run would otherwise become idle with this verdict.
    /// Returns `false` if there are none.
    pub(in crate::run) fn select_goals_after(
        &mut self,
        ctx: &mut GoalContext<'_>,
        verdict: &Verdict,
    ) -> bool {
        match verdict {
            Verdict::GoalReached => self.pursue_goals_set_aside(ctx),
            Verdict::Unsolvable | Verdict::NoPlan { .. } => {
                self.select_after_closing(ctx) || {
                    self.note_failed_search(verdict);
                    self.select_after_failure(ctx)
                }
            }
            _ => {
                self.pursue_all(ctx);
                false
            }
        }
    }

    /// Closes the pursued goals, which are achieved, and pursues those that were set aside. Returns
    /// `false` if there are none.
    fn pursue_goals_set_aside(&mut self, ctx: &mut GoalContext<'_>) -> bool {
        self.queue_conflicting_goals(ctx);
        self.selection = None;
        if self.goals.iter().all(OpenGoal::is_pursued) {
            return false;
        }
        let (achieved, left) = self.goals.drain(..).partition(OpenGoal::is_pursued);
        self.goals = left;
        let achieved = self.keep_achieved(achieved);
        Self::record_achieved(ctx, &achieved);
        self.pursue_all(ctx);
        self.announce_goals(ctx);
        self.set_goal(ctx);
        self.drop_plan();
        self.has_closed_goals = false;
        self.effects.are_others_pursued = true;
        self.record_change(ctx, "the other goals are reached".to_owned(), true);
        true
    }

    /// Tries again if goals were closed since the plan was requested, because the others may have a
    /// plan.
    fn select_after_closing(&mut self, ctx: &mut GoalContext<'_>) -> bool {
        let has_closed = std::mem::take(&mut self.has_closed_goals);
        if has_closed && !(self.is_selecting_goals() && self.restart_selection(ctx, false)) {
            self.record_change(ctx, "some goals are reached".to_owned(), true);
        }
        has_closed
    }

    /// Begins a selection among all open goals that can become true. `is_tried` is `true` if no
    /// plan was found for all of them; if there are many goals, all of them are not tried together.
    /// Returns `false` if no goal can become true.
    pub(super) fn restart_selection(&mut self, ctx: &mut GoalContext<'_>, is_tried: bool) -> bool {
        let mut choosing = GoalSelection::among_goals(self.set_unreachable_goals_aside(ctx));
        let all = choosing.tried.clone();
        let is_tried = is_tried || matches!(choosing.selection, Selection::Growth(_));
        let step = if is_tried {
            choosing.selection.after_failure(all)
        } else {
            SelectionStep::Try(all)
        };
        self.pursue_selection_step(ctx, choosing, step, true)
    }

    /// Selects among all goals if no plan was found and goals were added since the request.
    pub(in crate::run) fn select_after_added_goals(&mut self, ctx: &mut GoalContext<'_>) {
        if self.has_abandoned_goals() == Some(false) && !self.is_selecting_goals() {
            self.select_after_failure(ctx);
        }
    }

    /// Selects other goals after no plan was found for the pursued ones.
    fn select_after_failure(&mut self, ctx: &mut GoalContext<'_>) -> bool {
        if let Some(mut choosing) = self.selection.take() {
            self.record_unreachable_goals(ctx);
            self.note_proofs(ctx.task, &mut choosing);
            let step = choosing.selection.after_failure(choosing.tried.clone());
            return self.pursue_selection_step(ctx, choosing, step, true);
        }
        if self.goals.len() < 2 {
            return false;
        }
        let tried = self.goals.iter().filter(|goal| goal.is_pursued());
        let tried: BTreeSet<String> = tried.map(|goal| goal.name.clone()).collect();
        let mut choosing = GoalSelection::among_goals(self.set_unreachable_goals_aside(ctx));
        self.note_proofs(ctx.task, &mut choosing);
        let positions = tried.iter().map(|name| choosing.position(name));
        let step = match positions.collect::<Option<GoalSet>>() {
            Some(tried) => choosing.selection.after_failure(tried),
            // Some goals can never become true.
            None => SelectionStep::Try(choosing.tried.clone()),
        };
        self.pursue_selection_step(ctx, choosing, step, true)
    }

    /// Excludes from a selection the sets of goals that are proven to have no plan.
    fn note_proofs(&self, task: &Task, choosing: &mut GoalSelection) {
        choosing.note_proofs(&self.conflicts(task), &self.goals);
    }

    /// Sets aside the open goals that can never become true. Returns the names and values of the
    /// others; those with deadlines come first, in the order of their deadlines.
    fn set_unreachable_goals_aside(
        &mut self,
        ctx: &mut GoalContext<'_>,
    ) -> Vec<(String, Rational)> {
        self.pursue_all(ctx);
        self.record_unreachable_goals(ctx);
        let mut others = Vec::new();
        for goal in &mut self.goals {
            goal.set_aside.clone_from(&goal.unreachable);
            if goal.is_pursued() {
                others.push(&*goal);
            }
        }
        others.sort_by_key(|goal| {
            let deadline = goal.terms.deadline.as_ref();
            (goal.terms.keep, deadline.is_none(), deadline)
        });
        let others = others.iter();
        others
            .map(|goal| (goal.name.clone(), goal.terms.value.clone()))
            .collect()
    }

    /// Records the pursued goals that can never become true.
    fn record_unreachable_goals(&mut self, ctx: &mut GoalContext<'_>) {
        let hopeless = unreachable_conditions(ctx.belief);
        let goals = self.goals.iter_mut();
        for goal in goals.filter(|goal| goal.is_pursued()) {
            let parts = goal.ground.conjuncts().into_iter();
            let lost = parts.filter(|part| hopeless.contains(part));
            let lost: Vec<String> = lost.map(|it| ctx.task.describe_condition(it)).collect();
            let why = || format!("{} can never become true", lost.join(", "));
            goal.unreachable = (!lost.is_empty()).then(why);
        }
    }

    /// Continues a selection that was waiting for a plan to begin.
    pub(super) fn select_after_success(&mut self, ctx: &mut GoalContext<'_>) {
        let (goals, planned) = (&self.goals, &self.planned_goals);
        let is_tried = |choosing: &mut GoalSelection| {
            let tried = choosing.open(&choosing.tried, goals);
            let open = goals.iter().map(|goal| &goal.name);
            tried
                .iter()
                .eq(planned.intersection(&open.cloned().collect()))
        };
        if let Some(mut choosing) = self.selection.take_if(is_tried) {
            let step = choosing.selection.after_success(choosing.tried.clone());
            self.pursue_selection_step(ctx, choosing, step, false);
        } else if self.selection.is_none() {
            self.announce_goals(ctx);
        }
    }

    /// Leaves out the new goals if no plan reaches them in addition to those of the present plan,
    /// which continues. Returns `false` if the failure has another reason.
    pub(in crate::run) fn exclude_new_goals(&mut self, ctx: &mut GoalContext<'_>) -> bool {
        if self.select_after_closing(ctx) {
            return true;
        }
        let has_plan = self.plan.is_some();
        let Some(mut choosing) = self.selection.take_if(|_| has_plan) else {
            return false;
        };
        self.record_unreachable_goals(ctx);
        self.note_proofs(ctx.task, &mut choosing);
        let step = choosing.selection.after_failure(choosing.tried.clone());
        self.pursue_selection_step(ctx, choosing, step, false)
    }

    /// Pursues the goals of the next step. Returns `false` if there is no plan for any goal. A plan
    /// is requested or kept if the step tries goals, or if `is_to_plan` for the selected ones.
    fn pursue_selection_step(
        &mut self,
        ctx: &mut GoalContext<'_>,
        mut choosing: GoalSelection,
        mut step: SelectionStep,
        is_to_plan: bool,
    ) -> bool {
        let conflicts = self.conflicts(ctx.task);
        let (set, pursued, is_last) = loop {
            let (set, is_last) = match step {
                SelectionStep::Try(set) => (set, false),
                SelectionStep::Select(set) => (set, true),
            };
            let pursued = choosing.open(&set, &self.goals);
            if is_last || !pursued.is_empty() {
                break (set, pursued, is_last);
            }
            // All of these goals were closed meanwhile.
            step = choosing.selection.after_failure(set);
        };
        if pursued.is_empty() {
            // Goals that can never become true keep their own reasons in the idle state.
            self.set_unreachable_goals_aside(ctx);
            return false;
        }
        let list = self::list(&choosing, &set, &pursued);
        let candidates = self.goals.iter_mut();
        for goal in candidates.filter(|goal| choosing.names.contains(&goal.name)) {
            let is_aside = !pursued.contains(&goal.name);
            let position = choosing.position(&goal.name).unwrap_or_default();
            let mut conflicts = conflicts.iter();
            let conflict = conflicts.find(|it| it.is_excluding(&goal.name, &pursued));
            let conflict = conflict.map(|it| format!("{} exclude each other", it.in_words()));
            let why = || match &goal.unreachable {
                Some(why) => why.clone(),
                None if choosing.selection.is_excluded(position) => {
                    match (&goal.terms.deadline, &goal.missed_deadline) {
                        (Some(_), Some(late)) => format!(
                            "no plan reaches it by its deadline; it would be reached {late}"
                        ),
                        (Some(_), None) => "no plan reaches it by its deadline".to_owned(),
                        (None, _) => conflict.unwrap_or_else(|| "no plan reaches it".to_owned()),
                    }
                }
                None if choosing.selection.is_untried(position) => {
                    format!("a plan for {list} is sought first")
                }
                None => {
                    conflict.unwrap_or_else(|| format!("no plan reaches it together with {list}"))
                }
            };
            goal.set_aside = is_aside.then(why);
        }
        choosing.tried = set;
        let is_lengthy = matches!(choosing.selection, Selection::Growth(_));
        self.selection = (!is_last).then_some(choosing);
        if is_last || is_lengthy {
            self.announce_goals(ctx);
        }
        if is_last && !is_to_plan {
            self.set_goal(ctx);
        } else {
            self.record_change(ctx, format!("pursued from now on: {list}"), true);
        }
        true
    }

    /// Records the goals that are set aside, and those that are pursued again.
    pub(in crate::run) fn announce_goals(&mut self, ctx: &mut GoalContext<'_>) {
        for goal in &mut self.goals {
            if goal.is_announced == goal.set_aside.is_some() {
                continue;
            }
            goal.is_announced = goal.set_aside.is_some();
            let change = match &goal.set_aside {
                Some(why) => GoalChange::SetAside { why },
                None => GoalChange::Pursued,
            };
            ctx.recorder.record(&Entry::Goal {
                now: ctx.now,
                name: &goal.name,
                change,
            });
        }
    }
}

/// Returns the names of goals, if there are any.
pub(super) fn names_of(goals: &[OpenGoal]) -> Option<String> {
    let names: Vec<String> = goals.iter().map(|it| format!("`{}`", it.name)).collect();
    (!names.is_empty()).then(|| names.join(", "))
}

/// Formats the names of goals.
fn list(choosing: &GoalSelection, set: &GoalSet, open: &BTreeSet<String>) -> String {
    let names = set.iter().map(|it| &choosing.names[*it]);
    let names = names.filter(|name| open.contains(*name));
    let listed = names.take(MAX_LISTED_GOALS).map(|name| format!("`{name}`"));
    let listed: Vec<String> = listed.collect();
    match open.len() - listed.len() {
        0 => listed.join(", "),
        more => format!("{} and {more} others", listed.join(", ")),
    }
}
