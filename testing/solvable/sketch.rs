//! A problem in the making, as text in parts.

use std::fmt::Write as _;

use super::Solvable;
use super::effects;
use super::features::Features;
use super::random::Random;
use super::schedule;
use super::world;

/// Problem in the making.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sketch {
    pub(crate) features: Features,
    /// Arity of each predicate, 0 or 1.
    pub(crate) predicates: Vec<usize>,
    /// Arity of each derived predicate.
    pub(crate) derived: Vec<usize>,
    pub(crate) rules: Vec<String>,
    /// Numeric fluents.
    pub(crate) functions: Vec<Function>,
    pub(crate) schemas: Vec<Schema>,
    pub(crate) initial: Vec<String>,
    pub(crate) steps: Vec<Step>,
    pub(crate) constraints: Vec<String>,
    pub(crate) goal: Vec<String>,
}

/// Numeric fluent.
#[derive(Clone, Debug)]
pub(crate) struct Function {
    pub(crate) arity: usize,
    /// Unit of its values and changes, in billionths.
    pub(crate) unit: i128,
}

/// Action of the domain.
#[derive(Clone, Debug)]
pub(crate) struct Schema {
    pub(crate) has_parameter: bool,
    /// `None`: an instantaneous action.
    pub(crate) duration: Option<Lasting>,
    pub(crate) conditions: Vec<String>,
    pub(crate) effects: Vec<String>,
}

/// Duration constraint, in billionths.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lasting {
    pub(crate) least: i128,
    pub(crate) most: i128,
}

/// Step of the witness plan, in billionths.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) schema: usize,
    pub(crate) object: &'static str,
    pub(crate) start: i128,
    pub(crate) duration: i128,
}

/// One, in billionths.
pub(crate) const ONE: i128 = 1_000_000_000;

/// The objects; all are constants of the domain.
pub(crate) const OBJECTS: [&str; 2] = ["a", "b"];

impl Sketch {
    /// Draws everything but conditions, constraints and goals.
    pub(crate) fn draw(random: &mut Random, features: Features) -> Self {
        let mut sketch = Self {
            features,
            ..Self::default()
        };
        world::draw(random, &mut sketch);
        effects::draw(random, &mut sketch);
        schedule::draw(random, &mut sketch);
        sketch
    }

    /// Places the steps of the plan one after the other, far from each other.
    pub(crate) fn spread_steps(&mut self) {
        let mut time = ONE / 4;
        for step in &mut self.steps {
            step.start = time;
            time += step.duration + ONE;
        }
    }

    pub(crate) fn domain(&self) -> String {
        let mut text = "(define (domain d)\n (:requirements :typing :adl :durative-actions \
            :numeric-fluents :timed-initial-literals :timed-initial-fluents :duration-inequalities \
            :continuous-effects :conditional-effects :derived-predicates :constraints)\n \
            (:types thing)\n (:constants a b - thing)\n (:predicates"
            .to_owned();
        let mut declare = |prefix: &str, arities: &mut dyn Iterator<Item = usize>| {
            for (number, arity) in arities.enumerate() {
                let parameter = if arity == 0 { "" } else { " ?x - thing" };
                let _ = write!(text, " ({prefix}{number}{parameter})");
            }
        };
        declare("p", &mut self.predicates.iter().copied());
        declare("d", &mut self.derived.iter().copied());
        text += ")\n";
        if !self.functions.is_empty() {
            text += " (:functions";
            for (number, function) in self.functions.iter().enumerate() {
                let parameter = if function.arity == 0 {
                    ""
                } else {
                    " ?x - thing"
                };
                let _ = write!(text, " (n{number}{parameter})");
            }
            text += ")\n";
        }
        for rule in &self.rules {
            let _ = writeln!(text, " {rule}");
        }
        for (number, schema) in self.schemas.iter().enumerate() {
            schema.write(number, &mut text);
        }
        text + ")\n"
    }

    pub(crate) fn problem(&self) -> String {
        let mut text = "(define (problem p) (:domain d)\n (:init".to_owned();
        for part in &self.initial {
            let _ = write!(text, " {part}");
        }
        let _ = write!(text, ")\n (:goal (and {}))", self.goal.join(" "));
        if !self.constraints.is_empty() {
            let _ = write!(
                text,
                "\n (:constraints (and {}))",
                self.constraints.join(" ")
            );
        }
        text + ")\n"
    }

    pub(crate) fn plan(&self) -> String {
        let mut text = String::new();
        for step in &self.steps {
            let schema = &self.schemas[step.schema];
            let argument = if schema.has_parameter {
                format!(" {}", step.object)
            } else {
                String::new()
            };
            let start = decimal(step.start);
            let _ = write!(text, "{start}: (act{}{argument})", step.schema);
            if schema.duration.is_some() {
                let _ = write!(text, " [{}]", decimal(step.duration));
            }
            text.push('\n');
        }
        text
    }

    pub(crate) fn finished(self) -> Solvable {
        Solvable {
            features: self.features,
            domain: self.domain(),
            problem: self.problem(),
            plan: self.plan(),
        }
    }
}

impl Schema {
    fn write(&self, number: usize, text: &mut String) {
        let kind = if self.duration.is_some() {
            "durative-action"
        } else {
            "action"
        };
        let parameter = if self.has_parameter { "?x - thing" } else { "" };
        let _ = writeln!(text, " (:{kind} act{number} :parameters ({parameter})");
        let condition = if let Some(Lasting { least, most }) = self.duration {
            let (least, most) = (decimal(least), decimal(most));
            let _ = if least == most {
                writeln!(text, "  :duration (= ?duration {least})")
            } else {
                writeln!(
                    text,
                    "  :duration (and (>= ?duration {least}) (<= ?duration {most}))"
                )
            };
            "condition"
        } else {
            "precondition"
        };
        let conditions = self.conditions.join(" ");
        let effects = self.effects.join(" ");
        let _ = writeln!(text, "  :{condition} (and {conditions})");
        let _ = writeln!(text, "  :effect (and {effects}))");
    }
}

/// Writes billionths as a decimal number.
pub(crate) fn decimal(billionths: i128) -> String {
    let sign = if billionths < 0 { "-" } else { "" };
    let (whole, rest) = (billionths.abs() / ONE, billionths.abs() % ONE);
    if rest == 0 {
        return format!("{sign}{whole}");
    }
    let digits = format!("{rest:09}");
    format!("{sign}{whole}.{}", digits.trim_end_matches('0'))
}
