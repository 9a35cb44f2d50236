//! Detection of a world whose clock does not advance.

use elbowroom_num::Rational;

/// Maximum number of answers of the world within one second of its clock. Plans with very many
/// steps permit more.
const MAX_ANSWERS: usize = 10_000;

/// Number of answers that each step of a plan may cause within a second: its start and its end,
/// each of them repeated once, and some facts.
const ANSWERS_PER_STEP: usize = 10;

/// Counter of the answers since the clock last advanced by a second.
///
/// Reports do not reset it, because a world may report forever without time passing. So the number
/// of answers in a run is bounded: by [`MAX_ANSWERS`] for each plan, and for each second until
/// [`RunSettings::time_limit`](super::RunSettings::time_limit).
#[derive(Clone, Debug, Default)]
pub(super) struct ClockWatchdog {
    /// Start time of the count of answers.
    since: Rational,
    answers: usize,
    /// The last message since then that could not be read, with the reason.
    unintelligible: Option<(String, String)>,
}

impl ClockWatchdog {
    /// Resets the counter for a new plan: repeated attempts of the last plan do not count. The
    /// number of plans has its own limit.
    pub(super) fn begin_plan(&mut self) {
        self.answers = 0;
        self.unintelligible = None;
    }

    /// Returns the start time of the count of answers, and the number of answers since then.
    pub(super) fn state(&self) -> (Rational, usize) {
        (self.since.clone(), self.answers)
    }

    /// Restores the state that [`state`](Self::state) returned.
    pub(super) fn restore(&mut self, since: Rational, answers: usize) {
        *self = Self {
            since,
            answers,
            unintelligible: None,
        };
    }

    /// Records a message that could not be read. It may explain why the clock stands still.
    pub(super) fn record_unreadable_message(&mut self, said: &str, why: &str) {
        self.unintelligible = Some((said.to_owned(), why.to_owned()));
    }

    /// Counts an answer at `now`. `steps` is the number of steps of the present plan.
    ///
    /// # Errors
    /// If the clock does not advance, in words.
    pub(super) fn count_answer(&mut self, now: &Rational, steps: usize) -> Result<(), String> {
        if *now >= &self.since + Rational::ONE {
            self.since.clone_from(now);
            self.answers = 0;
            self.unintelligible = None;
        }
        self.answers += 1;
        let most = MAX_ANSWERS.max(ANSWERS_PER_STEP.saturating_mul(steps));
        if self.answers <= most {
            return Ok(());
        }
        let hint = self
            .unintelligible
            .as_ref()
            .map_or_else(String::new, |(said, why)| {
                format!("; its last message could not be parsed: `{said}`: {why}")
            });
        Err(format!(
            "its clock does not advance: after {most} answers it has gone from {} to {} only; \
             without events, it must advance to the requested time{hint}",
            self.since.to_f64(),
            now.to_f64(),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::{ClockWatchdog, MAX_ANSWERS};
    use elbowroom_num::Rational;

    /// Returns the number of accepted answers if the n-th answer has the time `clock(n)`.
    fn accepted_answers(most: i64, steps: usize, clock: impl Fn(i64) -> Rational) -> i64 {
        let mut progress = ClockWatchdog::default();
        let mut taken = 0..most;
        taken
            .find(|&n| progress.count_answer(&clock(n), steps).is_err())
            .unwrap_or(most)
    }

    #[test]
    fn stalled_or_creeping_clock_is_detected() {
        let most = i64::try_from(MAX_ANSWERS).expect("a small number");
        assert_eq!(accepted_answers(3 * most, 0, |_| Rational::ZERO), most);
        let creeping = |n: i64| Rational::ONE - Rational::new(1, n + 1);
        assert_eq!(accepted_answers(3 * most, 0, creeping), most);
    }

    #[test]
    fn unreadable_messages_are_named_in_error() {
        let mut progress = ClockWatchdog::default();
        progress.record_unreadable_message("hello", "not JSON");
        let why = (0..=MAX_ANSWERS)
            .find_map(|_| progress.count_answer(&Rational::ZERO, 0).err())
            .expect("the clock does not advance");
        assert!(why.ends_with("parsed: `hello`: not JSON"), "{why}");
    }

    #[test]
    fn heartbeat_and_large_plan_are_accepted() {
        let most = i64::try_from(MAX_ANSWERS).expect("a small number");
        assert_eq!(
            accepted_answers(3 * most, 0, |n| Rational::new(n, 5000)),
            3 * most
        );
        assert_eq!(
            accepted_answers(3 * most, 3 * MAX_ANSWERS, |_| Rational::ZERO),
            3 * most
        );
    }
}
