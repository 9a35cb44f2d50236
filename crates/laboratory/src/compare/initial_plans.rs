//! First plans of executors that are chosen by their probability.

use elbowroom::execute::Choice;
use serde::{Deserialize, Serialize};

/// First plan of an executor in all trials of one problem in one column.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FirstPlanNote {
    /// Position of the problem, from 0.
    pub problem: usize,
    /// Position of the row.
    pub row: usize,
    /// Position of the column.
    pub column: usize,
    /// Number of its actions.
    pub actions: usize,
    /// End time, in seconds.
    pub ends: f64,
    /// Share of world samples in which the executor succeeded with it.
    pub probability: f64,
    /// Purpose for which it was made, in words; empty for the shortest plan.
    pub made_for: String,
}

impl FirstPlanNote {
    pub(super) fn of(choice: &Choice, (problem, row, column): (usize, usize, usize)) -> Self {
        let ends = choice.plan.steps.iter().map(elbowroom_model::Step::end);
        Self {
            problem,
            row,
            column,
            actions: choice.plan.steps.len(),
            ends: ends.max().unwrap_or_default().to_f64(),
            probability: choice.value.probability(),
            made_for: choice.made_for.clone(),
        }
    }

    fn position(&self) -> (usize, usize, usize) {
        (self.column, self.row, self.problem)
    }
}

/// Merges the first plans of two parts without duplicates, because parts of one experiment begin
/// with the same plans.
pub(super) fn merge(mine: &mut Vec<FirstPlanNote>, theirs: &[FirstPlanNote]) {
    mine.extend_from_slice(theirs);
    mine.sort_by_key(FirstPlanNote::position);
    mine.dedup_by_key(|it| it.position());
}

/// Returns a sentence for each row and column.
pub(super) fn notes(all: &[FirstPlanNote], rows: &[String], columns: &[String]) -> Vec<String> {
    let mut notes = Vec::new();
    for (column, name) in columns.iter().enumerate() {
        for (row, executor) in rows.iter().enumerate() {
            let own = |it: &&FirstPlanNote| (it.row, it.column) == (row, column);
            let own: Vec<&FirstPlanNote> = all.iter().filter(own).collect();
            if !own.is_empty() {
                notes.push(format!(
                    "`{executor}` in {name} begins with {}",
                    describe(&own)
                ));
            }
        }
    }
    notes
}

/// Describes the plans of one executor in one column.
#[allow(
    clippy::cast_precision_loss,
    reason = "an experiment has far fewer problems than 2^52"
)]
fn describe(own: &[&FirstPlanNote]) -> String {
    let percent = |share: f64| format!("{:.0} %", share * 100.0);
    if let [only] = own {
        let which = if only.made_for.is_empty() {
            "the shortest plan".to_owned()
        } else {
            format!("a plan made {}", only.made_for)
        };
        return format!(
            "{which}: {} actions, ends at {:.3}, works in {} of the samples",
            only.actions,
            only.ends,
            percent(only.probability)
        );
    }
    let count = own.len() as f64;
    let mean =
        |value: &dyn Fn(&FirstPlanNote) -> f64| own.iter().map(|it| value(it)).sum::<f64>() / count;
    let shortest = own.iter().filter(|it| it.made_for.is_empty()).count();
    format!(
        "the shortest plan in {shortest} of {} problems; plans end at {:.1} and work in {} of the \
         samples on average",
        own.len(),
        mean(&|it| it.ends),
        percent(mean(&|it| it.probability)),
    )
}

#[cfg(test)]
mod tests {
    use super::{FirstPlanNote, merge, notes};

    fn example(problem: usize, row: usize, made_for: &str) -> FirstPlanNote {
        FirstPlanNote {
            problem,
            row,
            column: 0,
            actions: 4,
            ends: 18.0 + 2.0 * f64::from(u8::try_from(problem).unwrap()),
            probability: 0.9,
            made_for: made_for.to_owned(),
        }
    }

    #[test]
    fn note_states_length_and_probability_of_plan() {
        let (rows, columns) = (["live".to_owned()], ["20.5".to_owned()]);
        let slow = example(0, 0, "of actions that rarely fail");
        assert_eq!(
            notes(&[slow], &rows, &columns).join("\n"),
            "`live` in 20.5 begins with a plan made of actions that rarely fail: 4 actions, \
             ends at 18.000, works in 90 % of the samples"
        );
        let many = [example(0, 0, ""), example(1, 0, "for the worst")];
        assert_eq!(
            notes(&many, &rows, &columns).join("\n"),
            "`live` in 20.5 begins with the shortest plan in 1 of 2 problems; plans end at \
             19.0 and work in 90 % of the samples on average"
        );
    }

    #[test]
    fn first_plans_of_parts_are_equal() {
        let mut mine = vec![example(1, 0, "")];
        merge(&mut mine, &[example(0, 0, ""), example(1, 0, "")]);
        assert_eq!(mine, [example(0, 0, ""), example(1, 0, "")]);
    }
}
