//! Requirements on a part: an interval without transitions, with constant rates of change.

use elbowroom_model::ground::{Condition, Expression};
use elbowroom_num::Rational;

use super::super::condition::StateView;
use super::next_event::crossing_times;
use super::{Phase, event_label, process_label};
use crate::linear::Linear;
use crate::obligations::Refusal;
use crate::obligations::dnf::Alternatives;
use crate::obligations::timeline::Timeline;

/// Part of the course that begins now.
pub(super) struct Segment {
    pub(super) to: Linear,
    /// Facts and values at its end.
    pub(super) end_state: Timeline,
    /// Ways in which the course can deviate from the nominal one.
    pub(super) expected: Vec<(String, Alternatives)>,
    /// Ways to violate the conditions that must hold throughout.
    pub(super) demanded: Vec<(String, Alternatives)>,
    /// An intermediate moment at which the part has to be split, because it cannot be checked as a
    /// whole. For example, a condition may be false throughout because of one conjunct at first and
    /// another one later.
    pub(super) split_at: Option<Linear>,
}

impl Phase<'_> {
    /// Returns the part that ends at a moment.
    pub(super) fn segment_until(&self, to: Linear) -> Result<Segment, Refusal> {
        let elapsed = to.minus(&self.at);
        let mut then = self.now.clone();
        for (fluent, rate) in &self.rates {
            let value = self.view(&self.now).value(&Expression::Fluent(*fluent))?;
            let change = rate.times(&elapsed).ok_or_else(|| Refusal::NotLinear {
                place: "processes and events".to_owned(),
                expression: self.compiler.task.fluent_name(*fluent),
            })?;
            then.put_value(*fluent, Some(value.plus(&change)));
        }
        let (mut expected, mut demanded) = (Vec::new(), Vec::new());
        let mut pauses = Vec::new();
        let autonomous = self.autonomous_of_task();
        let (before, after) = (self.view(&self.now), self.view(&then));
        let length = before.nominal_value(&elapsed);
        for event in &autonomous.events {
            let condition = &event.snap.condition;
            let broken = before.violations_throughout((&after, &elapsed), condition, false)?;
            self.split_times(&before, condition, (&broken, &length), &mut pauses)?;
            expected.push((event_label(event, false), broken));
        }
        for (process, on) in autonomous.processes.iter().zip(&self.is_active) {
            let condition = &process.condition;
            let broken = before.violations_throughout((&after, &elapsed), condition, *on)?;
            self.split_times(&before, condition, (&broken, &length), &mut pauses)?;
            expected.push((process_label(&process.name, *on), broken));
        }
        for (id, conditions) in &self.running {
            let (before, after) = (self.view_of(&self.now, *id), self.view_of(&then, *id));
            for condition in conditions {
                self.refuse_derived_numbers(condition, before.reading.location)?;
                let broken = before.violations_throughout((&after, &elapsed), condition, true)?;
                self.split_times(&before, condition, (&broken, &length), &mut pauses)?;
                demanded.push((self.invariant_label(*id, condition), broken));
            }
        }
        // Ties go to the first one found.
        let first = pauses
            .into_iter()
            .reduce(|first, other| if other.0 < first.0 { other } else { first });
        Ok(Segment {
            split_at: first.map(|(_, later)| self.at.plus(&later)),
            to,
            end_state: then,
            expected,
            demanded,
        })
    }

    /// Returns the moments within the part at which numbers of a condition reach their bounds, if
    /// the check of the whole part does not confirm the nominal course.
    fn split_times(
        &self,
        view: &StateView<'_>,
        condition: &Condition,
        (broken, length): (&Alternatives, &Rational),
        pauses: &mut Vec<(Rational, Linear)>,
    ) -> Result<(), Refusal> {
        if !self.holds_nominally(broken) {
            return Ok(());
        }
        for (elapsed, later) in crossing_times(view, condition)? {
            if let Some(later) = later
                && elapsed.is_positive()
                && elapsed < *length
            {
                pauses.push((elapsed, later));
            }
        }
        Ok(())
    }
}
