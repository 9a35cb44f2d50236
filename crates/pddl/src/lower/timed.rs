//! Conditions with time specifiers.

use elbowroom_model::problem::Condition;

use crate::feature::Feature;
use crate::lower::Reader;
use crate::lower::condition::without_preferences;
use crate::lower::scope::Scope;
use crate::syntax::Node;
use elbowroom_text::nearest;

/// The time specifier of a part of a durative action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Time {
    Start,
    OverAll,
    End,
}

/// A condition, split by the moment at which its parts are read. All three parts must hold.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Timed {
    pub(super) start: Condition,
    pub(super) over_all: Condition,
    pub(super) end: Condition,
}

/// Splits `(at start x)`, `(over all x)` or `(at end x)`.
pub(super) fn time_specifier<'t, 's>(node: &'t Node<'s>) -> Option<(Time, &'t Node<'s>)> {
    let [at, when, what] = node.list()? else {
        return None;
    };
    // An object may be called `start`; its predicate has no list as argument.
    what.list()?;
    let time = if at.is("at") && when.is("start") {
        Time::Start
    } else if at.is("at") && when.is("end") {
        Time::End
    } else if at.is("over") && when.is("all") {
        Time::OverAll
    } else {
        return None;
    };
    Some((time, what))
}

impl Timed {
    fn at(time: Time, condition: Condition) -> Self {
        let mut timed = Self::default();
        *timed.part(time) = condition;
        timed
    }

    fn part(&mut self, time: Time) -> &mut Condition {
        match time {
            Time::Start => &mut self.start,
            Time::OverAll => &mut self.over_all,
            Time::End => &mut self.end,
        }
    }

    /// Returns the condition with `change` applied to each part.
    pub(super) fn map(self, mut change: impl FnMut(Condition) -> Condition) -> Self {
        Self {
            start: change(self.start),
            over_all: change(self.over_all),
            end: change(self.end),
        }
    }

    /// Returns the only moment at which something is read, or `None` if there are several.
    fn single_time(&self) -> Option<Time> {
        match (
            self.start.is_trivial(),
            self.over_all.is_trivial(),
            self.end.is_trivial(),
        ) {
            (_, true, true) => Some(Time::Start),
            (true, false, true) => Some(Time::OverAll),
            (true, true, false) => Some(Time::End),
            _ => None,
        }
    }
}

/// Returns the conjunction, without superfluous nesting.
pub(super) fn conjunction(left: Condition, right: Condition) -> Condition {
    match (left, right) {
        (left, right) if right.is_trivial() => left,
        (left, right) if left.is_trivial() => right,
        (Condition::And(mut left), Condition::And(right)) => {
            left.extend(right);
            Condition::And(left)
        }
        (Condition::And(mut left), right) => {
            left.push(right);
            Condition::And(left)
        }
        (left, right) => Condition::And(vec![left, right]),
    }
}

impl Reader {
    /// Reads the condition of a durative action.
    pub(super) fn timed_condition(&mut self, node: &Node, scope: &mut Scope) -> Timed {
        if let Some((time, condition)) = time_specifier(node) {
            return Timed::at(time, self.condition(condition, scope));
        }
        if node.is_empty_list() {
            return Timed::default();
        }
        let Some((head, parts)) = node.form() else {
            self.missing_time(node);
            return Timed::default();
        };
        match (head.as_ref(), parts) {
            ("and", _) => {
                let mut all = Timed::default();
                for part in parts {
                    let part = self.timed_condition(part, scope);
                    all.start = conjunction(all.start, part.start);
                    all.over_all = conjunction(all.over_all, part.over_all);
                    all.end = conjunction(all.end, part.end);
                }
                all
            }
            ("forall", [variables, part]) => {
                let variables = self.variable_list(variables);
                let outside = scope.variables.len();
                scope.variables.extend(variables.iter().cloned());
                let part = self.timed_condition(part, scope);
                scope.variables.truncate(outside);
                part.map(|part| {
                    if part.is_trivial() {
                        part
                    } else {
                        Condition::Forall(variables.clone(), Box::new(part))
                    }
                })
            }
            ("preference", _) => {
                self.preference(node, scope, Self::timed_condition);
                Timed::default()
            }
            ("or", _) | ("not", [_]) | ("imply", [_, _]) => {
                self.read_at_single_time(&head, node, parts, scope)
            }
            ("exists", [variables, part]) => {
                let variables = self.variable_list(variables);
                let outside = scope.variables.len();
                scope.variables.extend(variables.iter().cloned());
                let part = without_preferences(scope, |scope| self.timed_condition(part, scope));
                scope.variables.truncate(outside);
                match part.single_time() {
                    Some(time) => {
                        part.map_single(time, |part| Condition::Exists(variables, Box::new(part)))
                    }
                    None => self.mixed_times(&head, node),
                }
            }
            ("not" | "imply" | "exists" | "forall", _) => {
                self.wrong_parts(&head, node);
                Timed::default()
            }
            _ => {
                self.missing_time(node);
                Timed::default()
            }
        }
    }

    /// Reads `or`, `not`, `imply` over parts that are all read at the same time.
    fn read_at_single_time(
        &mut self,
        head: &str,
        node: &Node,
        parts: &[Node],
        scope: &mut Scope,
    ) -> Timed {
        let parts: Vec<Timed> = without_preferences(scope, |scope| {
            parts
                .iter()
                .map(|part| self.timed_condition(part, scope))
                .collect()
        });
        let trivial = Timed::default();
        let mut time = None;
        for part in parts.iter().filter(|part| **part != trivial) {
            let own = part.single_time();
            if own.is_none() || time.is_some() && time != own {
                return self.mixed_times(head, node);
            }
            time = own;
        }
        let time = time.unwrap_or(Time::Start);
        let mut parts = parts.into_iter().map(|mut p| std::mem::take(p.part(time)));
        let negated = |part: Option<Condition>| Condition::Not(Box::new(part.unwrap_or_default()));
        let combined = match head {
            "or" => Condition::Or(parts.collect()),
            "not" => negated(parts.next()),
            _ => Condition::Or(
                std::iter::once(negated(parts.next()))
                    .chain(parts)
                    .collect(),
            ),
        };
        Timed::at(time, combined)
    }

    fn mixed_times(&mut self, head: &str, node: &Node) -> Timed {
        self.report.unsupported(
            Feature::MixedTimes,
            node.span,
            format!("the parts of this `{head}` are read at different times"),
        );
        Timed::default()
    }

    fn missing_time(&mut self, node: &Node) {
        let near = near_specifier(node);
        self.report
            .error(
                node.span,
                format!("`{}` has no time specifier", node.quote()),
            )
            .advise("expected `(at start …)`, `(over all …)` or `(at end …)`")
            .suggest(near);
    }
}

/// Returns the time specifier that a list like `(at strat x)` probably means.
pub(super) fn near_specifier(node: &Node) -> Option<&'static str> {
    let [at, when, what] = node.list()? else {
        return None;
    };
    what.list()?;
    let specifier = format!("{} {}", at.word()?, when.word()?);
    nearest(&specifier, ["at start", "over all", "at end"])
}

impl Timed {
    fn map_single(mut self, time: Time, change: impl FnOnce(Condition) -> Condition) -> Self {
        let part = std::mem::take(self.part(time));
        Self::at(time, change(part))
    }
}
