//! Summary of a variant over all instances, compared with the unchanged planner.

use std::cmp::Ordering;
use std::fmt::Write as _;
use std::time::Duration;

/// A plan, or a proof that there is none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Answered {
    pub(crate) states: u64,
    pub(crate) time: Duration,
}

/// Comparison of a variant with the unchanged planner over some instances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Comparison {
    /// Number of instances that the variant answers.
    pub(crate) answered: usize,
    /// Number that only the unchanged planner answers.
    pub(crate) lost: usize,
    /// Number that only the variant answers.
    pub(crate) gained: usize,
    /// Number that both answer.
    pub(crate) both: usize,
    /// Number of these for which the variant needs more states.
    pub(crate) more: usize,
    /// Number of these for which the variant needs fewer states.
    pub(crate) fewer: usize,
    /// Ratio of the variant's states to those of the unchanged planner: geometric mean over the
    /// instances that both answer. One is added to both counts, since a count may be zero.
    pub(crate) states: Option<f64>,
    /// Ratio of the variant's time to that of the unchanged planner, over the instances that both
    /// answer.
    pub(crate) time: Option<f64>,
}

impl Comparison {
    /// Compares instance by instance; `None` is an instance without an answer.
    pub(crate) fn of(variant: &[Option<Answered>], base: &[Option<Answered>]) -> Self {
        assert_eq!(variant.len(), base.len(), "both were run on each instance");
        let mut comparison = Self::default();
        let mut logarithms = 0.0;
        let (mut own, mut other) = (Duration::ZERO, Duration::ZERO);
        for pair in variant.iter().zip(base) {
            match pair {
                (Some(variant), Some(base)) => {
                    comparison.both += 1;
                    match variant.states.cmp(&base.states) {
                        Ordering::Greater => comparison.more += 1,
                        Ordering::Less => comparison.fewer += 1,
                        Ordering::Equal => {}
                    }
                    #[allow(clippy::cast_precision_loss, reason = "states are far fewer")]
                    let logarithm = |states: u64| (states as f64).ln_1p();
                    logarithms += logarithm(variant.states) - logarithm(base.states);
                    own += variant.time;
                    other += base.time;
                }
                (Some(_), None) => comparison.gained += 1,
                (None, Some(_)) => comparison.lost += 1,
                (None, None) => {}
            }
        }
        comparison.answered = comparison.both + comparison.gained;
        if comparison.both > 0 {
            #[allow(clippy::cast_precision_loss, reason = "instances are few")]
            let mean = logarithms / comparison.both as f64;
            comparison.states = Some(mean.exp());
        }
        if !other.is_zero() {
            comparison.time = Some(own.as_secs_f64() / other.as_secs_f64());
        }
        comparison
    }

    /// Returns a line of Markdown for each variant; the first one is the unchanged planner.
    pub(crate) fn table<'a>(
        variants: impl IntoIterator<Item = (&'a str, &'a Vec<Option<Answered>>)>,
    ) -> String {
        let mut variants = variants.into_iter();
        let Some((heading, base)) = variants.next() else {
            return String::new();
        };
        let mut text = format!(
            "| of {} instances | answered | lost | gained | more states | fewer | states | time |\n\
             |---|--:|--:|--:|--:|--:|--:|--:|\n",
            base.len()
        );
        let answered = base.iter().flatten().count();
        let _ = writeln!(text, "| {heading} | {answered} | | | | | | |");
        let ratio = |ratio: Option<f64>| ratio.map_or(String::new(), |ratio| format!("{ratio:.2}"));
        for (heading, variant) in variants {
            let own = Self::of(variant, base);
            let _ = writeln!(
                text,
                "| {heading} | {} | {} | {} | {} | {} | {} | {} |",
                own.answered,
                own.lost,
                own.gained,
                own.more,
                own.fewer,
                ratio(own.states),
                ratio(own.time)
            );
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[allow(clippy::unnecessary_wraps, reason = "an instance that is answered")]
    fn answered(states: u64, milliseconds: u64) -> Option<Answered> {
        Some(Answered {
            states,
            time: Duration::from_millis(milliseconds),
        })
    }

    #[test]
    fn state_ratio_is_geometric_mean_over_common_instances() {
        // Ratios 8 : 1, 1 : 2 and 4 : 4, with one state more each; the cubic root of 4.
        let variant = [answered(7, 30), answered(0, 10), answered(3, 20), None];
        let base = [
            answered(0, 10),
            answered(1, 10),
            answered(3, 10),
            answered(9, 500),
        ];
        let found = Comparison::of(&variant, &base);
        assert!((found.states.unwrap() - 4_f64.cbrt()).abs() < 1e-9);
        assert!((found.time.unwrap() - 2.0).abs() < 1e-9);
        let counts = (found.answered, found.both, found.more, found.fewer);
        assert_eq!(counts, (3, 3, 1, 1));
    }

    #[test]
    fn instance_answered_by_one_side_counts_as_lost_or_gained() {
        let variant = [None, None, answered(5, 1), None, None];
        let base = [answered(5, 1), answered(6, 1), None, None, None];
        let found = Comparison::of(&variant, &base);
        let expected = Comparison {
            answered: 1,
            lost: 2,
            gained: 1,
            ..Comparison::default()
        };
        assert_eq!(found, expected);
    }

    #[test]
    fn a_line_for_each_variant() {
        let (base, variant) = (vec![answered(9, 10), None], vec![answered(19, 15), None]);
        let text = Comparison::table([("all", &base), ("without nesting", &variant)]);
        let lines: Vec<&str> = text.lines().skip(2).collect();
        assert_eq!(
            lines,
            [
                "| all | 1 | | | | | | |",
                "| without nesting | 1 | 0 | 0 | 1 | 0 | 2.00 | 1.50 |"
            ]
        );
        assert!(text.starts_with("| of 2 instances |"));
    }

    #[test]
    #[should_panic(expected = "both were run on each instance")]
    fn different_instances_are_not_compared() {
        Comparison::of(&[None], &[]);
    }
}
