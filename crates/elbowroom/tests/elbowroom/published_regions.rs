//! Whole envelopes as published by the authors: formulas over the parameters that are true exactly
//! if the plan is valid. Our box check and our exact region must agree with them, point by point.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]

use crate::shared;
use std::path::Path;

use crate::shared::case::{Case, number};
use elbowroom::AnyPlan;
use elbowroom::answers::region::{RegionSettings, region};
use elbowroom::answers::{EnvelopeRequest, NoObserver};
use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, ParameterId, ParametrizedPlan};
use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Formula as printed by the authors' tool: `((1.0 <= param_dur_1_23) & (! (… <= …)))`.
struct Formula<'a> {
    words: Vec<&'a str>,
}

/// Value of a part of a formula at a point.
enum Value {
    Truth(bool),
    Number(Rational),
}

impl Value {
    fn truth(self) -> bool {
        match self {
            Self::Truth(value) => value,
            Self::Number(value) => panic!("{value} is no truth value"),
        }
    }

    fn number(self) -> Rational {
        match self {
            Self::Number(value) => value,
            Self::Truth(value) => panic!("{value} is no number"),
        }
    }
}

impl<'a> Formula<'a> {
    fn read(line: &'a str) -> Self {
        let mut words = Vec::new();
        for word in line.split_whitespace() {
            let open = word.len() - word.trim_start_matches('(').len();
            let inner = word[open..].trim_end_matches(')');
            let close = word.len() - open - inner.len();
            words.extend(std::iter::repeat_n("(", open));
            words.extend((!inner.is_empty()).then_some(inner));
            words.extend(std::iter::repeat_n(")", close));
        }
        Self { words }
    }

    /// Returns `true` if the formula holds for these values of the parameters.
    fn holds(&self, value_of: &dyn Fn(&str) -> Rational) -> bool {
        let mut rest = &self.words[..];
        let value = Self::value(&mut rest, value_of).truth();
        assert!(rest.is_empty(), "something follows: {rest:?}");
        value
    }

    fn value(rest: &mut &[&str], value_of: &dyn Fn(&str) -> Rational) -> Value {
        match take(rest) {
            "(" if rest[0] == "!" => {
                take(rest);
                let value = Self::value(rest, value_of).truth();
                assert_eq!(take(rest), ")");
                Value::Truth(!value)
            }
            "(" => {
                let mut value = Self::value(rest, value_of);
                loop {
                    value = match take(rest) {
                        ")" => return value,
                        operator => combined(value, operator, Self::value(rest, value_of)),
                    };
                }
            }
            word => Value::Number(match word.strip_prefix("param_") {
                // The tool numbers its symbols: `dur_1_23` is the parameter `dur_1`.
                Some(symbol) => value_of(symbol.rsplit_once('_').expect("NAME_NUMBER").0),
                None => number(word),
            }),
        }
    }

    /// Returns the numbers in it, which determine its borders.
    fn numbers(&self) -> Vec<Rational> {
        let words = self.words.iter();
        words.filter_map(|word| word.parse().ok()).collect()
    }
}

fn take<'a>(rest: &mut &[&'a str]) -> &'a str {
    let (&first, others) = rest.split_first().expect("the formula goes on");
    *rest = others;
    first
}

fn combined(left: Value, operator: &str, right: Value) -> Value {
    match operator {
        "&" => Value::Truth(left.truth() & right.truth()),
        "|" => Value::Truth(left.truth() | right.truth()),
        "<=" => Value::Truth(left.number() <= right.number()),
        "+" => Value::Number(left.number() + right.number()),
        "*" => Value::Number(left.number() * right.number()),
        other => panic!("unknown operator `{other}`"),
    }
}

/// Returns the folder of the rover with unrestricted use of its batteries.
fn rover(data: &Path) -> std::path::PathBuf {
    data.join("envelopes/solar_rover/flexible")
}

/// Returns the plan `plan` for the problem `NN`, with nominal values for its parameters.
fn case(data: &Path, domain: &str, problem: &str, plan: &str, declarations: &str) -> Case {
    let folder = rover(data);
    let plan = std::fs::read_to_string(folder.join(plan)).expect("a plan");
    Case::of_text(
        &folder.join(domain),
        &folder.join(format!("prob{problem}.pddl")),
        &format!("{declarations}\n{plan}"),
    )
}

#[test]
fn energy_limit_matches_published_value() {
    let Some(data) = shared::data() else { return };
    for (problem, limit) in [("01", 530), ("02", 530), ("03", 510), ("04", 505)] {
        let folder = rover(&data).join("results_aaai19/synthesize_pramDomain_stn_solar");
        let file = folder.join(format!("output_pramDomain_STN_{problem}prob"));
        let text = std::fs::read_to_string(file).expect("a formula");
        assert!(text.contains(&format!("<= {limit}.0)")), "{text}");
        let case = case(
            &data,
            "solarrover_linear_validation_pram.pddl",
            problem,
            &format!("STN_plans/output{problem}.stn"),
            "parameter ?energy_amount default 500;",
        );
        assert_eq!(case.limits(), format!("?energy_amount=[0,{limit}]"));
        let why_not = case.why_not(&format!("?energy_amount=[0,{limit}.001]"));
        assert_eq!(
            why_not.expect("too much").reason,
            "start of (senddata r) needs (>= (roverenergy r) ?energy_amount)"
        );
    }
}

#[test]
fn published_regions_are_reproduced() {
    let Some(data) = shared::data() else { return };
    let results = rover(&data).join("results_aaai19");
    let (mut regions, mut inside, mut outside) = (0, 0, 0);
    for (folder, domain) in [
        (
            "synthesize_solar_Ndomain_stn_pram",
            "solarrover_linear.pddl",
        ),
        (
            "synthesize_solar_pramDomain_STN_pram",
            "solarrover_linear_validation_pram.pddl",
        ),
    ] {
        let is_open = domain.ends_with("pram.pddl");
        for (count, problem) in
            (1..=4).flat_map(|count| ["01", "02", "03", "04"].map(|problem| (count, problem)))
        {
            let kind = if is_open { "pramDomain" } else { "Ndomain" };
            let file = format!("{folder}/output_{kind}_STN_{count}pram_{problem}prob");
            let Ok(text) = std::fs::read_to_string(results.join(file)) else {
                // Only the short formulas were published.
                continue;
            };
            let formula = Formula::read(text.lines().next().expect("a formula"));
            let declarations = if is_open {
                "parameter ?energy_amount default 500;"
            } else {
                ""
            };
            let plan = format!("stns_params_with_values/output{problem}_{count}pram.stn");
            let case = case(&data, domain, problem, &plan, declarations);
            let [yes, no] = compared(&case, &formula);
            assert!(yes > 0 && no > 0, "{folder} {count} {problem}: {yes} {no}");
            regions += 1;
            inside += yes;
            outside += no;
        }
    }
    println!("{regions} regions, {inside} points inside, {outside} outside");
    assert!(regions >= 20);
}

/// Compares all three at points near the borders, as many as `ELBOWROOM_POINTS` says. Returns the
/// numbers of points inside and outside.
fn compared(case: &Case, formula: &Formula<'_>) -> [usize; 2] {
    let points = std::env::var("ELBOWROOM_POINTS");
    let points = points.map_or(200, |count| count.parse().expect("a number"));
    let plan: AnyPlan = ParametrizedPlan::clone(&case.plan).into();
    let request = EnvelopeRequest::new(&case.task, plan);
    let outcome = region(&request, &RegionSettings::default(), &mut NoObserver);
    let outcome = outcome.expect("within exact reasoning");
    let own = outcome.plan.expect("a plan");
    let whole = outcome.region.expect("a region");
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut oracle = case.oracle();
    let mut counts = [0, 0];
    for _ in 0..points {
        let point = near_borders(case, formula, &mut rng);
        let expected = formula.holds(&|name| {
            let id = case.plan.find(name).expect("a parameter of the plan");
            point[id.index()].clone()
        });
        let envelope = DecoupledEnvelope::point(&point.iter().cloned().collect());
        let objection = oracle.objection(&envelope).expect("within reach");
        assert_eq!(objection.is_none(), expected, "{point:?}: {objection:?}");
        let value = |id: ParameterId| {
            let of = case.plan.find(&own.parameters[id.index()].name);
            point[of.expect("the same parameters").index()].clone()
        };
        assert_eq!(whole.contains(&value), expected, "{point:?}: {whole:#?}");
        counts[usize::from(!expected)] += 1;
    }
    counts
}

/// Draws durations of batteries: at a border, a thousandth next to it, or between 0 and 7. As all
/// are mostly multiples of a tenth, their sums and the required energy are also hit by chance.
fn near_borders(case: &Case, formula: &Formula<'_>, rng: &mut ChaCha8Rng) -> Vec<Rational> {
    let numbers = formula.numbers();
    let parameters = case.plan.parameters.iter();
    parameters
        .map(|parameter| {
            if parameter.name.starts_with('?') {
                return Rational::from(rng.random_range(480..540_i64));
            }
            let beside = Rational::new(*[-1, 0, 0, 0, 1].choose(rng).expect("not empty"), 1000);
            let border = numbers
                .choose(rng)
                .filter(|border| **border < Rational::from(9));
            let base = match border {
                Some(border) if rng.random_bool(0.3) => border.clone(),
                _ => Rational::new(rng.random_range(0..70), 10),
            };
            (base + beside).max(Rational::ZERO)
        })
        .collect()
}
