//! From one plan to the next.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::{RunningAction, Situation, Task};
use elbowroom_num::{Interval, Rational};

use super::{PlanningTime, Run, RunningRule, Stop, Verdict};
use crate::event::Ticket;
use crate::planning::PlanAnswer;
use crate::reason::Reason;
use crate::record::Entry;

impl Run<'_> {
    /// Brings what is running to where a new plan can begin: see [`RunningRule`].
    pub(super) fn settle(&mut self) -> Result<(), Stop> {
        match self.settings.running {
            RunningRule::Keep => return self.cancel_what_cannot_go_on(),
            RunningRule::Await => {}
            RunningRule::Cancel => {
                let running: Vec<Ticket> = self.account.open_tickets().collect();
                for ticket in running {
                    self.cancel(ticket)?;
                }
            }
        }
        // Each wait ends by then: what stays silent is given up.
        while let Some(until) = self.next_silence() {
            self.pass(&until.max(self.now.clone()))?;
            self.give_up_the_silent()?;
        }
        Ok(())
    }

    /// A plan can only go on with what has started, and with what it may go on doing.
    fn cancel_what_cannot_go_on(&mut self) -> Result<(), Stop> {
        let breaking = self.belief.breaking().into_iter();
        let breaking: BTreeSet<Ticket> = breaking.map(|(ticket, _)| ticket).collect();
        let is_lost = |ticket: &Ticket| match self.belief.running().get(ticket) {
            Some(underway) => breaking.contains(ticket) || !underway.broken_parts().is_empty(),
            None => true,
        };
        let lost: Vec<Ticket> = self.account.open_tickets().filter(is_lost).collect();
        for ticket in &lost {
            self.cancel(*ticket)?;
        }
        // Until it has stopped, it counts as running.
        let has_begun = |run: &Self| {
            let mut lost = lost.iter();
            lost.any(|ticket| run.belief.running().contains_key(ticket))
        };
        while has_begun(self)
            && let Some(until) = self.next_silence()
        {
            self.pass(&until.max(self.now.clone()))?;
            self.give_up_the_silent()?;
        }
        Ok(())
    }

    /// Asks the planner, lets the time that this takes pass, and takes up the plan.
    pub(super) fn plan_from_here(&mut self, reason: &Reason) -> Result<(), Stop> {
        self.news.clear();
        if self.is_goal_certain() {
            return self.goal_reached();
        }
        let (situation, tickets) = self.situation();
        self.ports.recorder.record(&Entry::Planning {
            now: &self.now,
            reason,
            situation: &situation,
        });
        let mut task = Task::clone(&self.task);
        let planned = self.ports.planner.plan(&mut task, &situation);
        if (task.fact_count(), task.fluent_count())
            != (self.task.fact_count(), self.task.fluent_count())
        {
            self.know(Arc::new(task));
            self.ports.world.know(&self.task);
        }
        let took = match &self.settings.planning_time {
            PlanningTime::Seconds(seconds) => seconds.clone(),
            PlanningTime::Measured => planned.seconds.unwrap_or_default(),
        };
        if took > self.allowance {
            // The next plan is made for a later start.
            self.allowance.clone_from(&took);
        }
        let ready = &self.now + &took;
        let (plan, why_not) = match &planned.answer {
            PlanAnswer::Plan(plan) => (Some(plan), None),
            PlanAnswer::Unsolvable => (None, Some("no plan reaches the goal from here")),
            PlanAnswer::NotFound { why } => (None, Some(why.as_str())),
        };
        self.ports.recorder.record(&Entry::Planned {
            now: &ready,
            took: &took,
            plan,
            why_not,
            is_unsolvable: planned.answer == PlanAnswer::Unsolvable,
        });
        self.heed()?;
        match planned.answer {
            PlanAnswer::Unsolvable => return Err(Stop::Over(Verdict::Unsolvable)),
            PlanAnswer::NotFound { why } => return Err(Stop::Over(Verdict::NoPlan { why })),
            PlanAnswer::Plan(plan) => {
                // What ends from now on is no step of the plan that was given up, and not yet one
                // of the new plan: what it changes is news, and the new plan is told of its end.
                self.account.begin_plan(&BTreeMap::new());
                while self.now < ready {
                    self.pass(&ready)?;
                }
                // What happened while the plan was made, it does not know.
                let surprises = std::mem::take(&mut self.news);
                self.take_up(&plan, &situation, &tickets)?;
                self.news.splice(0..0, surprises);
            }
        }
        Ok(())
    }

    /// Where things will stand when the new plan can begin: after the time that planning is
    /// expected to take, and ε after whatever happens last before that.
    fn situation(&self) -> (Situation, Vec<Ticket>) {
        let epsilon = &self.settings.epsilon;
        let mut time = &self.now + &self.allowance;
        if self.now.is_positive() || self.account.started() > 0 {
            time += epsilon;
        }
        if time.is_zero() {
            return (Situation::initial(&self.task), Vec::new());
        }
        let mut state = self.belief.clone();
        loop {
            let _ = state.advance(&time);
            let past = state.timed_past().checked_sub(1);
            let last = past.map(|index| &self.task.timed()[index].time + epsilon);
            match last {
                Some(last) if last > time => time = last,
                _ => break,
            }
        }
        let running = state
            .running()
            .values()
            .map(|underway| {
                let elapsed = &time - &underway.start;
                // Who guesses "any moment now" again and again plans again and again.
                let expected = if underway.planned > elapsed {
                    underway.planned.clone()
                } else {
                    elapsed * Rational::new(5, 4)
                };
                state.running_action(underway, Interval::point(expected))
            })
            .collect::<Vec<RunningAction>>();
        let tickets = state.running().keys().copied().collect();
        let situation = Situation {
            state: state.state(),
            time,
            running,
        };
        (situation, tickets)
    }
}
