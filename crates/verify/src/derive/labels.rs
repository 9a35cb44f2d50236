//! Labels of parameters in answers: [`Label`].

use std::collections::BTreeMap;

use elbowroom_model::Task;
use elbowroom_model::ground::{Change, FactId, FluentId};

use super::subject::Subject;
use super::{BOUND, Quantity};

/// Words that an answer has to use for a parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Label {
    kind: &'static str,
    action: Option<String>,
    quantity: String,
    /// Possible names, before a number makes one unique. The options of the command choose between them. `None` if
    /// the plan file gives the name, which has been compared already.
    names: Option<Vec<String>>,
}

/// Words that an answer uses for a parameter. Older answers do not have all of them.
pub(crate) struct LabelText<'a> {
    pub(crate) name: &'a str,
    pub(crate) kind: Option<&'a str>,
    pub(crate) action: Option<&'a str>,
    pub(crate) quantity: Option<&'a str>,
}

impl Label {
    /// Returns `true` if the words mean this parameter. `earlier` are the names of the parameters before it.
    pub(crate) fn is_denoted_by(&self, told: &LabelText<'_>, earlier: &[&str]) -> bool {
        let is_named = |name: &String| told.name == unused(name, earlier);
        let names = self.names.as_ref();
        told.kind.is_none_or(|kind| kind == self.kind)
            && told.quantity.is_none_or(|own| own == self.quantity)
            && told.action == self.action.as_deref()
            && names.is_none_or(|names| names.iter().any(is_named))
    }
}

/// Returns the name, or the name with the least number that makes it unique.
fn unused(name: &str, earlier: &[&str]) -> String {
    let mut free = name.to_owned();
    let mut number = 2_u64;
    while earlier.contains(&free.as_str()) {
        free = format!("{name}_{number}");
        number += 1;
    }
    free
}

/// Returns the labels of all parameters, by position.
pub(super) fn labels(subject: &Subject<'_>, quantities: &[Quantity]) -> BTreeMap<usize, Label> {
    let task = subject.task;
    let own = quantities.iter().map(|own| {
        let label = Label {
            kind: own.kind,
            action: own.action.clone(),
            quantity: words(task, own),
            names: (!subject.is_given).then(|| names(task, own)),
        };
        (own.parameter, label)
    });
    let initials = subject.initials.iter().map(|(fluent, parameter)| {
        let label = Label {
            kind: "initial",
            action: None,
            quantity: format!("initial {}", task.fluent_name(*fluent)),
            names: Some(vec![format!("initial_{}", fluent_words(task, *fluent))]),
        };
        (*parameter, label)
    });
    own.chain(initials).collect()
}

/// Returns the description of a quantity in answers.
fn words(task: &Task, own: &Quantity) -> String {
    match (own.kind, &own.action, own.group) {
        ("duration", Some(action), _) => format!("duration of {action}"),
        ("constant", Some(action), _) => format!("number in {action}"),
        (BOUND, ..) => "bound between two time points".to_owned(),
        (_, _, Some(group)) => match task.timed()[group].changes.as_slice() {
            [Change::Delete(fact)] => format!("deadline of {}", task.fact_name(*fact)),
            [Change::Add(fact)] => format!("when {} becomes true", task.fact_name(*fact)),
            [Change::Update { fluent, .. }] => {
                format!("when {} changes", task.fluent_name(*fluent))
            }
            _ => {
                let time = task.timed()[group].time.to_decimal(6);
                format!("time of the timed initials at {time}")
            }
        },
        _ => "number of the domain".to_owned(),
    }
}

/// Returns the possible names of a duration, or of the time of timed initials. Those have the name of any fact or
/// fluent that they change. A deadline is the time at which a fact becomes false.
fn names(task: &Task, own: &Quantity) -> Vec<String> {
    if let Some(step) = own.step {
        return vec![format!("dur_{step}")];
    }
    let changes = own.group.map(|group| task.timed()[group].changes.iter());
    let names = changes.into_iter().flatten().flat_map(|change| {
        let timed = |words: &str| format!("timed_{words}");
        match change {
            Change::Add(fact) => vec![timed(&fact_words(task, *fact))],
            Change::Update { fluent, .. } => vec![timed(&fluent_words(task, *fluent))],
            Change::Delete(fact) => {
                let words = fact_words(task, *fact);
                vec![timed(&words), format!("deadline_{words}")]
            }
        }
    });
    names.collect()
}

fn fact_words(task: &Task, fact: FactId) -> String {
    let (predicate, arguments) = task.atom(fact);
    let problem = task.problem();
    let name = &problem.predicates[predicate.index()].name;
    let objects = arguments.iter();
    joined(name, objects.map(|own| &problem.objects[own.index()].name))
}

fn fluent_words(task: &Task, fluent: FluentId) -> String {
    let (function, arguments) = task.application(fluent);
    let problem = task.problem();
    let name = &problem.functions[function.index()].name;
    let objects = arguments.iter();
    joined(name, objects.map(|own| &problem.objects[own.index()].name))
}

fn joined<'a>(name: &str, objects: impl Iterator<Item = &'a String>) -> String {
    let mut words = name.to_owned();
    for object in objects {
        words.push('_');
        words.push_str(object);
    }
    words.to_lowercase()
}
