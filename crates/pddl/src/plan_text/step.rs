//! One action of a plan: its name, its objects, its numbers, and its duration.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::ops::Range;
use std::sync::Arc;

use elbowroom_model::ground::{Action, Expression};
use elbowroom_model::problem::{FunctionId, ObjectId, SchemaId, Unknown};
use elbowroom_model::{InstantiateError, Step, Task};
use elbowroom_num::Rational;

use crate::plan_text::duration::{changing_functions, only_duration};
use crate::plan_text::line::Word;
use crate::plan_text::timing::{Duration, TimedStep};
use crate::plan_text::vocabulary::Vocabulary;
use crate::plan_text::write::decimal;
use crate::report::Report;
use crate::source::{FileId, Span};
use elbowroom_text::Source;

/// Longest duration that planners print for an instantaneous action.
const NEGLIGIBLE: (i64, i64) = (1, 100);

/// Reader of the actions of a plan, which reports their mistakes.
pub(super) struct StepReader<'a> {
    task: &'a Task,
    pub(super) report: Report,
    pub(super) vocabulary: Vocabulary,
    /// Ground actions, each instantiated once.
    actions: BTreeMap<(SchemaId, Vec<ObjectId>), Arc<Action>>,
    /// Functions that change, computed at the first missing duration.
    changing: OnceCell<BTreeSet<FunctionId>>,
    /// `true` if a missing duration has been reported.
    has_reported_missing: bool,
}

impl<'a> StepReader<'a> {
    pub(super) fn new(source: &Source, task: &'a Task) -> Self {
        Self {
            vocabulary: Vocabulary::of(task),
            actions: BTreeMap::new(),
            task,
            report: Report::new(source, source),
            changing: OnceCell::new(),
            has_reported_missing: false,
        }
    }

    /// Returns the step at `start`, or `None` if it contains a mistake.
    pub(super) fn step(&mut self, timed: &TimedStep<'_>, start: Rational) -> Option<Step> {
        let raw = &timed.raw;
        let (name, arguments) = raw.words.split_first()?;
        let schema = self.schema(name);
        let (arguments, chosen) = self.split_controls(schema, arguments);
        let arguments: Vec<_> = arguments.iter().map(|word| self.object(word)).collect();
        let schema = schema?;
        let controls = self.controls(schema, name, chosen)?;
        let arguments = arguments.into_iter().collect::<Option<Vec<_>>>()?;
        let action = match self.ground(schema, &arguments) {
            Ok(action) if controls.is_empty() => action,
            Ok(action) => Arc::new(with_controls(Action::clone(&action), &controls)),
            Err(error) => {
                let expected = self.signature(schema);
                self.report
                    .error(span(&raw.range()), error.to_string())
                    .advise(format!("expected `{expected}`"));
                return None;
            }
        };
        if let Some(unit) = &raw.unit {
            self.report
                .warning(span(&unit.range), format!("`{}` is ignored", unit.text))
                .advise("a duration is a number in brackets, in the domain's unit: `[10.000]`");
        }
        let duration = if action.durative().is_some() {
            Some(self.duration(timed, schema, &arguments)?)
        } else {
            let (numerator, denominator) = NEGLIGIBLE;
            let negligible = Rational::new(numerator, denominator);
            if matches!(&timed.duration, Duration::Given(it) if *it > negligible) {
                self.report.warning(
                    span(&name.range),
                    format!("`{}` takes no time: its duration is ignored", name.text),
                );
            }
            None
        };
        Some(Step {
            start,
            action,
            duration,
        })
    }

    /// Returns the duration of a durative action, or `None` if it is missing and not fixed by the domain.
    fn duration(
        &mut self,
        timed: &TimedStep<'_>,
        schema: SchemaId,
        arguments: &[ObjectId],
    ) -> Option<Rational> {
        let name = timed.raw.words.first()?;
        let (why, advice) = match &timed.duration {
            Duration::Given(duration) => return Some(duration.clone()),
            Duration::Instant => (
                "other actions of this plan have a start and an end".to_owned(),
                "write both: `time: start (action argument …)` and `time: end (action argument …)`",
            ),
            Duration::Missing => match self.only_duration(schema, arguments) {
                Ok(duration) => {
                    self.report_missing_duration(name, &duration);
                    return Some(duration);
                }
                Err(why) => (why, "write it after the action: `[10.000]`"),
            },
        };
        self.report
            .error(
                span(&name.range),
                format!("`{}` has no duration here", name.text),
            )
            .label(why)
            .advise(advice);
        None
    }

    /// Returns the ground action, instantiated at its first use.
    fn ground(
        &mut self,
        schema: SchemaId,
        arguments: &[ObjectId],
    ) -> Result<Arc<Action>, InstantiateError> {
        let own = (schema, arguments.to_vec());
        if let Some(known) = self.actions.get(&own) {
            return Ok(Arc::clone(known));
        }
        let action = Arc::new(self.task.instantiate(schema, arguments)?);
        self.actions.insert(own, Arc::clone(&action));
        Ok(action)
    }

    /// Reports the duration from the domain at the first action without a duration.
    fn report_missing_duration(&mut self, name: &Word, duration: &Rational) {
        if std::mem::replace(&mut self.has_reported_missing, true) {
            return;
        }
        let message = format!(
            "`{}` has no duration here: {duration} is used, from the domain",
            name.text
        );
        self.report
            .warning(span(&name.range), message)
            .advise("write it after the action, as in `[10.000]`; reported only once");
    }

    fn only_duration(&self, schema: SchemaId, arguments: &[ObjectId]) -> Result<Rational, String> {
        let schema = &self.task.problem().schemas[schema.index()];
        let changing = self
            .changing
            .get_or_init(|| changing_functions(self.task.problem()));
        only_duration(self.task, schema, arguments, changing)
    }

    fn schema(&mut self, word: &Word) -> Option<SchemaId> {
        let name = word.text.to_ascii_lowercase();
        let found = self.vocabulary.schemas.get(&name).copied();
        if found.is_none() {
            let names = self.vocabulary.schemas.keys().map(String::as_str);
            let near = self.report.nearest(&name, names);
            let problem = self.task.problem();
            let is_event = problem.events.iter().any(|event| event.name == name);
            if is_event || problem.processes.iter().any(|own| own.name == name) {
                let kind = if is_event { "an event" } else { "a process" };
                self.report
                    .error(span(&word.range), format!("`{}` is {kind}", word.text))
                    .advise(
                        "events and processes happen by themselves and cannot be steps of \
                             plans",
                    );
                return None;
            }
            self.report
                .error(span(&word.range), format!("unknown action `{}`", word.text))
                .advise("the domain has no action with this name")
                .suggest(near);
        }
        found
    }

    /// Splits the words into those for objects and those for `:control` parameters.
    fn split_controls<'w, 's>(
        &self,
        schema: Option<SchemaId>,
        words: &'w [Word<'s>],
    ) -> (&'w [Word<'s>], &'w [Word<'s>]) {
        let problem = self.task.problem();
        match schema {
            Some(schema) if problem.controls.contains_key(&schema) => {
                let objects = problem.schemas[schema.index()].parameters.len();
                words.split_at(objects.min(words.len()))
            }
            _ => (words, &[]),
        }
    }

    /// Returns the numbers that the plan chooses for the `:control` parameters of an action, by
    /// unknown.
    fn controls(
        &mut self,
        schema: SchemaId,
        name: &Word,
        words: &[Word],
    ) -> Option<Vec<(u32, Rational)>> {
        let task = self.task;
        let Some(controls) = task.problem().controls.get(&schema) else {
            return Some(Vec::new());
        };
        if controls.len() != words.len() {
            let expected = self.signature(schema);
            let end = words.last().map_or(name.range.end, |word| word.range.end);
            let message = format!(
                "`{}` chooses {} of its {} numbers here",
                name.text,
                words.len(),
                controls.len()
            );
            self.report
                .error(span(&(name.range.start..end)), message)
                .advise(format!(
                    "expected `{expected}`, with the numbers after the objects"
                ));
            return None;
        }
        let mut chosen = Vec::with_capacity(controls.len());
        for (control, word) in controls.iter().zip(words) {
            match word.text.parse::<Rational>() {
                Ok(value) => chosen.push((*control, value)),
                Err(error) => {
                    self.report.error(span(&word.range), error.to_string());
                    return None;
                }
            }
        }
        Some(chosen)
    }

    fn object(&mut self, word: &Word) -> Option<ObjectId> {
        let name = word.text.to_ascii_lowercase();
        let found = self.vocabulary.objects.get(&name).copied();
        if found.is_none() {
            let names = self.vocabulary.objects.keys().map(String::as_str);
            let near = self.report.nearest(&name, names);
            let near = near.and_then(|near| self.vocabulary.objects.get(near));
            let near = near.map(|id| self.task.problem().objects[id.index()].name.as_str());
            self.report
                .error(span(&word.range), format!("unknown object `{}`", word.text))
                .advise("neither the domain nor the problem has an object with this name")
                .suggest(near);
        }
        found
    }

    /// Returns `(name ?x - type …)`.
    fn signature(&self, id: SchemaId) -> String {
        let problem = self.task.problem();
        let schema = &problem.schemas[id.index()];
        let mut text = format!("({}", schema.name);
        for parameter in &schema.parameters {
            let types: Vec<_> = parameter
                .types
                .iter()
                .map(|ty| problem.types[ty.index()].name.as_str())
                .collect();
            // Writing to a string cannot fail.
            let _ = write!(text, " {} - {}", parameter.name, types.join(" or "));
        }
        for control in problem.controls.get(&id).into_iter().flatten() {
            let _ = write!(text, " {} - number", schema.unknowns[*control as usize]);
        }
        text.push(')');
        text
    }
}

/// Returns the action with these numbers in place of its `:control` parameters, and in its name.
fn with_controls(action: Action, controls: &[(u32, Rational)]) -> Action {
    if controls.is_empty() {
        return action;
    }
    let mut chosen = action.map_leaves(&mut |leaf| match leaf {
        Expression::Unknown(Unknown::Action(index)) => {
            let (_, value) = controls.iter().find(|(control, _)| control == index)?;
            Some(Expression::Constant(value.clone()))
        }
        _ => None,
    });
    chosen.name.pop();
    for (_, value) in controls {
        chosen.name.push(' ');
        chosen.name.push_str(&decimal(value));
    }
    chosen.name.push(')');
    chosen
}

/// Returns the range in the plan's text as a span.
pub(super) fn span(range: &Range<usize>) -> Span {
    Span {
        file: FileId::Domain,
        start: range.start,
        end: range.end,
    }
}
