//! From a planner's output to a plan.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::ops::Range;
use std::sync::Arc;

use elbowroom_model::ground::{Action, Expression};
use elbowroom_model::problem::{FunctionId, ObjectId, SchemaId, Unknown};
use elbowroom_model::{InstantiateError, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use crate::plan_text::duration::{changing_functions, only_duration};
use crate::plan_text::line::{Line, RawStep, Word, line};
use crate::plan_text::write::decimal;
use crate::report::Report;
use crate::source::{FileId, Span};
use elbowroom_text::Source;
use elbowroom_text::{Diagnostic, Diagnostics};

/// Longest duration that planners print for an action which has none.
const NEGLIGIBLE: (i64, i64) = (1, 100);

/// Reads a plan: `0.000: (action argument …) [10.000]` on each line.
///
/// Tolerates what planners print around it, `;` comments, upper case, `[D:…; C:…]`. Of several
/// plans in one log, the last is read. Actions without times happen at 0, 1, 2, …. A duration
/// that is not given is taken from the domain if it is one fixed number there. The steps come
/// [in order](TimeTriggeredPlan::in_order), whatever the order of the lines.
///
/// # Errors
/// When actions, objects, types or numbers do not fit the task.
pub fn read_plan(
    source: &Source,
    task: &Task,
) -> Result<(TimeTriggeredPlan, Vec<Diagnostic>), Diagnostics> {
    let mut reader = PlanReader::new(source, task);
    let steps = reader.last_plan();
    let mut plan = TimeTriggeredPlan::default();
    let is_timed = steps.iter().any(|step| step.time.is_some());
    if let (Some(first), false) = (steps.first(), is_timed) {
        let message = "no action has a time: they are taken to start at 0, 1, 2, …";
        reader
            .report
            .warning(span(&first.words[0].range), message)
            .advise("write the time before the action: `0.000: (action argument …) [10.000]`");
    }
    for (index, step) in steps.iter().enumerate() {
        plan.steps.extend(reader.step(step, index, is_timed));
    }
    let plan = (!reader.report.is_failed()).then(|| plan.in_order());
    Diagnostics::outcome(plan, reader.report.into_diagnostics())
}

struct PlanReader<'a> {
    source: &'a Source,
    task: &'a Task,
    report: Report,
    schemas: BTreeMap<String, SchemaId>,
    objects: BTreeMap<String, ObjectId>,
    /// Those that were made.
    actions: BTreeMap<(SchemaId, Vec<ObjectId>), Arc<Action>>,
    /// Looked for when the first duration is missing.
    changing: OnceCell<BTreeSet<FunctionId>>,
    /// Whether it was said that a duration is missing.
    has_told_missing: bool,
}

impl<'a> PlanReader<'a> {
    fn new(source: &'a Source, task: &'a Task) -> Self {
        let problem = task.problem();
        let schemas = (0..problem.schemas.len()).map(SchemaId::from);
        let objects = (0..problem.objects.len()).map(ObjectId::from);
        Self {
            schemas: schemas
                .map(|id| (problem.schemas[id.index()].name.to_ascii_lowercase(), id))
                .collect(),
            objects: objects
                .map(|id| (problem.objects[id.index()].name.to_ascii_lowercase(), id))
                .collect(),
            actions: BTreeMap::new(),
            source,
            task,
            report: Report::new(source, source),
            changing: OnceCell::new(),
            has_told_missing: false,
        }
    }

    /// The steps of the last plan in the text. Reports broken lines of that plan only.
    fn last_plan(&mut self) -> Vec<RawStep<'a>> {
        let mut plans: Vec<Vec<Line>> = vec![Vec::new()];
        let mut start = 0;
        for text in self.source.text().split_inclusive('\n') {
            let line = line(text.trim_end(), start);
            start += text.len();
            match line {
                Line::Blank => {}
                Line::Separator | Line::Noise => {
                    if plans.last().is_some_and(|plan| !plan.is_empty()) {
                        plans.push(Vec::new());
                    }
                }
                line => plans.last_mut().expect("never empty").push(line),
            }
        }
        plans.retain(|plan| !plan.is_empty());
        // Logs quote other things in parentheses; where some lines have times, those are the plan.
        if plans.iter().any(|plan| plan.iter().any(is_timed)) {
            plans.retain(|plan| plan.iter().any(is_timed));
        }
        let count = plans.len();
        let mut steps = Vec::new();
        for line in plans.pop().unwrap_or_default() {
            match line {
                Line::Steps(more) => steps.extend(more),
                Line::Broken(at, expected) => {
                    self.report
                        .error(span(&(at..at)), "this is not an action of a plan")
                        .label(expected)
                        .advise("expected `time: (action argument …) [duration]`");
                }
                Line::Blank | Line::Separator | Line::Noise => {}
            }
        }
        if count > 1 {
            let first = steps
                .first()
                .map_or(0..0, |step| step.words[0].range.clone());
            self.report
                .warning(span(&first), format!("{count} plans in one text"))
                .label("the last one is read, from here");
        }
        if steps.is_empty() && !self.report.is_failed() {
            self.report
                .warning(span(&(0..0)), "no actions in this plan")
                .advise("expected lines such as `0.000: (action argument …) [10.000]`");
        }
        steps
    }

    /// The step that a line describes, the `index`th of its plan. In a plan that `is_timed`, it
    /// needs a time.
    fn step(&mut self, raw: &RawStep, index: usize, is_timed: bool) -> Option<Step> {
        let start = match &raw.time {
            Some(time) => self.time(time),
            None if is_timed => {
                self.report
                    .error(span(&raw.words[0].range), "an action without a time")
                    .label("other actions of this plan have one")
                    .advise("expected `time: (action argument …) [duration]`");
                None
            }
            None => Some(Rational::from(u32::try_from(index).unwrap_or(u32::MAX))),
        };
        let (name, arguments) = raw.words.split_first()?;
        let schema = self.schema(name);
        let (arguments, chosen) = self.apart(schema, arguments);
        let arguments: Vec<_> = arguments.iter().map(|word| self.object(word)).collect();
        let duration = raw.duration.as_ref().map(|word| self.time(word));
        let schema = schema?;
        let controls = self.controls(schema, name, chosen)?;
        let arguments = arguments.into_iter().collect::<Option<Vec<_>>>()?;
        let action = match self.ground(schema, &arguments) {
            Ok(action) if controls.is_empty() => action,
            Ok(action) => Arc::new(chosen_by_plan(Action::clone(&action), &controls)),
            Err(error) => {
                let end = raw.words.last().map_or(name.range.end, |w| w.range.end);
                let expected = self.signature(schema);
                self.report
                    .error(span(&(name.range.start..end)), error.to_string())
                    .advise(format!("expected `{expected}`"));
                return None;
            }
        };
        if let Some(stray) = &raw.stray {
            self.report
                .warning(span(&stray.range), format!("`{}` is ignored", stray.text))
                .advise("a duration is a number in brackets, in the domain's unit: `[10.000]`");
        }
        let duration = match (action.durative(), duration) {
            (Some(_), Some(duration)) => Some(duration?),
            (Some(_), None) => match self.only_duration(schema, &arguments) {
                Ok(duration) => {
                    self.tell_missing(name, &duration);
                    Some(duration)
                }
                Err(why) => {
                    self.report
                        .error(
                            span(&name.range),
                            format!("`{}` has no duration here", name.text),
                        )
                        .label(why)
                        .advise("write it behind the action: `[10.000]`");
                    return None;
                }
            },
            (None, duration) => {
                let (numerator, denominator) = NEGLIGIBLE;
                let negligible = Rational::new(numerator, denominator);
                if duration.flatten().is_some_and(|d| d > negligible) {
                    self.report.warning(
                        span(&name.range),
                        format!("`{}` takes no time: its duration is ignored", name.text),
                    );
                }
                None
            }
        };
        Some(Step {
            start: start?,
            action,
            duration,
        })
    }

    /// The action; where a plan has one many times, it is made once.
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

    /// Says at the first action without a duration what is taken instead.
    fn tell_missing(&mut self, name: &Word, duration: &Rational) {
        if std::mem::replace(&mut self.has_told_missing, true) {
            return;
        }
        let message = format!(
            "`{}` has no duration here: {duration} is taken, as the domain says",
            name.text
        );
        self.report
            .warning(span(&name.range), message)
            .advise("write it behind the action, as in `[10.000]`; this is said once for all");
    }

    fn only_duration(&self, schema: SchemaId, arguments: &[ObjectId]) -> Result<Rational, String> {
        let schema = &self.task.problem().schemas[schema.index()];
        let changing = self
            .changing
            .get_or_init(|| changing_functions(self.task.problem()));
        only_duration(self.task, schema, arguments, changing)
    }

    /// A time or duration, not before 0.
    fn time(&mut self, word: &Word) -> Option<Rational> {
        match word.text.parse::<Rational>() {
            Ok(time) if !time.is_negative() => Some(time),
            Ok(_) => {
                self.report
                    .error(span(&word.range), "a negative time")
                    .advise("times and durations are at least 0");
                None
            }
            Err(error) => {
                self.report.error(span(&word.range), error.to_string());
                None
            }
        }
    }

    fn schema(&mut self, word: &Word) -> Option<SchemaId> {
        let name = word.text.to_ascii_lowercase();
        let found = self.schemas.get(&name).copied();
        if found.is_none() {
            let near = self
                .report
                .nearest(&name, self.schemas.keys().map(String::as_str));
            let problem = self.task.problem();
            let is_event = problem.events.iter().any(|event| event.name == name);
            if is_event || problem.processes.iter().any(|own| own.name == name) {
                let kind = if is_event { "an event" } else { "a process" };
                self.report
                    .error(span(&word.range), format!("`{}` is {kind}", word.text))
                    .advise("events and processes happen by themselves, and do not stand in plans");
                return None;
            }
            self.report
                .error(span(&word.range), format!("unknown action `{}`", word.text))
                .advise("the domain has no action of this name")
                .suggest(near);
        }
        found
    }

    /// The words for objects, and those for `:control` parameters behind them.
    fn apart<'w>(
        &self,
        schema: Option<SchemaId>,
        words: &'w [Word<'a>],
    ) -> (&'w [Word<'a>], &'w [Word<'a>]) {
        let problem = self.task.problem();
        match schema {
            Some(schema) if problem.controls.contains_key(&schema) => {
                let objects = problem.schemas[schema.index()].parameters.len();
                words.split_at(objects.min(words.len()))
            }
            _ => (words, &[]),
        }
    }

    /// The numbers that the plan chooses for the `:control` parameters of an action, by unknown.
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
                    "expected `{expected}`, with the numbers behind the objects"
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
        let found = self.objects.get(&name).copied();
        if found.is_none() {
            let near = self
                .report
                .nearest(&name, self.objects.keys().map(String::as_str));
            self.report
                .error(span(&word.range), format!("unknown object `{}`", word.text))
                .advise("neither the domain nor the problem has an object of this name")
                .suggest(near);
        }
        found
    }

    /// `(name ?x - type …)`
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

/// The action with these numbers in the place of its `:control` parameters, and in its name.
fn chosen_by_plan(action: Action, controls: &[(u32, Rational)]) -> Action {
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

fn is_timed(line: &Line) -> bool {
    match line {
        Line::Steps(steps) => steps.iter().any(|step| step.time.is_some()),
        Line::Broken(..) => true,
        Line::Blank | Line::Separator | Line::Noise => false,
    }
}

fn span(range: &Range<usize>) -> Span {
    Span {
        file: FileId::Domain,
        start: range.start,
        end: range.end,
    }
}
