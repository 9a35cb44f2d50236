//! `:init`: facts and numbers at time 0, and timed initials.

use std::collections::BTreeMap;

use elbowroom_model::problem::{FunctionId, ObjectId, PredicateId, TimedChange, TimedInitial};
use elbowroom_num::Rational;

use crate::lower::Reader;
use crate::lower::expression::number;
use crate::lower::scope::Scope;
use crate::lower::sections::Section;
use crate::source::Span;
use crate::syntax::Node;

/// Index in the list of initial values of each fluent that has one.
type Valued = BTreeMap<(FunctionId, Vec<ObjectId>), usize>;

/// The subject of a timed initial.
#[derive(PartialEq)]
enum Subject<'a> {
    Fact(PredicateId, &'a [ObjectId]),
    Fluent(FunctionId, &'a [ObjectId]),
}

fn subject(change: &TimedChange) -> Subject<'_> {
    match change {
        TimedChange::Add(predicate, arguments) | TimedChange::Delete(predicate, arguments) => {
            Subject::Fact(*predicate, arguments)
        }
        TimedChange::Assign(function, arguments, _) => Subject::Fluent(*function, arguments),
    }
}

impl Reader {
    /// Reads the initial state and the timed initials.
    pub(super) fn init(&mut self, section: &Section) {
        let mut valued = Valued::new();
        for node in section.content {
            self.initial(node, &mut valued);
        }
        self.initial_cost(section.span, &valued);
    }

    /// Sets `total-cost` to 0 if the problem gives it no initial value, since otherwise no action
    /// with a cost would be applicable. PDDL 3.1 requires problems to state the value.
    fn initial_cost(&mut self, init: Span, valued: &Valued) {
        let Some(cost) = self.problem.function("total-cost") else {
            return;
        };
        let has_arguments = !self.problem.functions[cost.index()].parameters.is_empty();
        if has_arguments || valued.contains_key(&(cost, Vec::new())) {
            return;
        }
        self.report
            .warning(init, "`(total-cost)` has no initial value: read as 0")
            .advise("write `(= (total-cost) 0)`");
        self.problem
            .initial_values
            .push((cost, Vec::new(), Rational::ZERO));
    }

    fn initial(&mut self, node: &Node, valued: &mut Valued) {
        match node.form() {
            Some((head, parts)) if head == "and" => {
                for part in parts {
                    self.initial(part, valued);
                }
            }
            Some((head, [time, content]))
                if head == "at" && number(time).is_some() && content.list().is_some() =>
            {
                self.timed_initial(time, content, valued);
            }
            Some((head, parts)) if head == "at" && self.is_broken_timed(parts) => {
                let text = match parts {
                    [time, not, atom] if not.is("not") && atom.list().is_some() => {
                        format!("`(at {} (not {}))`", time.quote(), atom.quote())
                    }
                    _ => {
                        "`(at 120 (p …))`, `(at 120 (not (p …)))` or `(at 120 (= (f …) 5))`".into()
                    }
                };
                self.report
                    .error(node.span, "invalid timed initial")
                    .advise(format!("write {text}"));
            }
            Some((head, [fluent, _]))
                if matches!(head.as_ref(), "=" | "assign") && self.is_application(fluent) =>
            {
                self.initial_object(node);
            }
            _ => match self.initial_change(node) {
                // Facts that are not listed are false anyway.
                None | Some(TimedChange::Delete(..)) => {}
                Some(change) => self.initially(change, node.span, valued),
            },
        }
    }

    /// Returns `true` if `(at …)` begins with a number, as only timed initials do, and not with an
    /// object.
    fn is_broken_timed(&self, parts: &[Node]) -> bool {
        let Some((first, [_, ..])) = parts.split_first() else {
            return false;
        };
        let is_object = |word: &str| self.names.objects.contains_key(word);
        number(first).is_some() && !first.lower().is_some_and(|word| is_object(&word))
    }

    /// Reads `(at time (p …))`, `(at time (not (p …)))` or `(at time (= (f …) number))`.
    fn timed_initial(&mut self, time_node: &Node, content: &Node, valued: &mut Valued) {
        if let Some((head, parts)) = content.form()
            && head == "and"
        {
            for part in parts {
                self.timed_initial(time_node, part, valued);
            }
            return;
        }
        let time = number(time_node).unwrap_or_default();
        if time.is_negative() {
            self.report
                .error(time_node.span, "a time before 0")
                .advise("the plan begins at time 0");
        }
        if let Some((head, [fluent, _])) = content.form()
            && matches!(head.as_ref(), "=" | "assign")
            && self.is_application(fluent)
        {
            self.timed_object(&time, time_node.span, content);
            return;
        }
        let Some(change) = self.initial_change(content) else {
            return;
        };
        if time.is_zero() {
            self.report.warning(
                time_node.span,
                "at time 0: read as part of the initial state",
            );
            self.initially(change, content.span, valued);
        } else {
            self.refuse_contradiction(&time, &change, content);
            self.problem.timed.push(TimedInitial { time, change });
        }
    }

    /// Refuses contradictory changes at one time. They have no order (PDDL 2.1's rule of no moving
    /// targets), so one fact cannot become both true and false, nor one fluent get two values.
    pub(super) fn refuse_contradiction(
        &mut self,
        time: &Rational,
        change: &TimedChange,
        content: &Node,
    ) {
        let contradicts = |other: &TimedInitial| {
            other.time == *time
                && other.change != *change
                && subject(&other.change) == subject(change)
        };
        if !self.problem.timed.iter().any(contradicts) {
            return;
        }
        let message = match change {
            TimedChange::Assign(..) => "a second value for this fluent at the same time",
            _ => "this fact becomes both true and false at one time",
        };
        self.report
            .error(content.span, message)
            .advise("changes at the same time have no order: remove one, or give it another time");
    }

    /// Reads a change at time 0 or later. Returns `None` if it is not understood; this is reported
    /// unless an object fluent is the cause.
    fn initial_change(&mut self, node: &Node) -> Option<TimedChange> {
        let scope = Scope::default();
        if let Some((head, parts)) = node.form() {
            match (head.as_ref(), parts) {
                ("=" | "assign", [fluent, value]) => {
                    let fluent = self.fluent(fluent, &scope)?;
                    let value = self.constant(value);
                    let arguments = Self::objects_only(&fluent.arguments)?;
                    return Some(TimedChange::Assign(fluent.function, arguments, value));
                }
                // Generated problems also list false facts. For a predicate that the domain does
                // not declare, such a statement is true.
                ("not", [atom]) if self.is_undeclared(atom) => {
                    self.report
                        .warning(atom.span, format!("unknown predicate `{}`", atom.quote()))
                        .label("ignored: it is false anyway");
                    return None;
                }
                ("not", [atom]) => {
                    let (predicate, arguments) = self.initial_fact(atom, &scope)?;
                    return Some(TimedChange::Delete(predicate, arguments));
                }
                (change @ ("increase" | "decrease" | "scale-up" | "scale-down"), _) => {
                    self.report
                        .error(node.span, format!("a timed `{change}`"))
                        .advise("only values can be given for a time, as in `(at 10 (= (f) 3))`");
                    return None;
                }
                ("=" | "assign" | "not" | "<" | "<=" | ">" | ">=", _) => {
                    self.not_initial(node);
                    return None;
                }
                _ => {
                    let (predicate, arguments) = self.initial_fact(node, &scope)?;
                    return Some(TimedChange::Add(predicate, arguments));
                }
            }
        }
        self.not_initial(node);
        None
    }

    fn is_undeclared(&self, atom: &Node) -> bool {
        atom.form()
            .is_some_and(|(head, _)| !self.names.predicates.contains_key(head.as_ref()))
    }

    fn initial_fact(&mut self, node: &Node, scope: &Scope) -> Option<(PredicateId, Vec<ObjectId>)> {
        let atom = self.atom(node, scope)?;
        self.refuse_derived(atom.predicate, node.span);
        let arguments = Self::objects_only(&atom.arguments)?;
        Some((atom.predicate, arguments))
    }

    fn not_initial(&mut self, node: &Node) {
        self.report
            .error(node.span, format!("unexpected `{}`", node.quote()))
            .advise(
                "expected `(predicate object …)`, `(= (function object …) number)`, \
                 or one of these in `(at time …)`",
            );
    }

    fn initially(&mut self, change: TimedChange, span: Span, valued: &mut Valued) {
        match change {
            TimedChange::Add(predicate, arguments) => {
                self.problem.initial_facts.push((predicate, arguments));
            }
            TimedChange::Delete(predicate, arguments) => {
                let deleted = (predicate, arguments);
                self.problem.initial_facts.retain(|fact| *fact != deleted);
            }
            TimedChange::Assign(function, arguments, value) => {
                self.initially_equal(function, arguments, value, span, valued);
            }
        }
    }

    fn initially_equal(
        &mut self,
        function: FunctionId,
        arguments: Vec<ObjectId>,
        value: Rational,
        span: Span,
        valued: &mut Valued,
    ) {
        let initial = &mut self.problem.initial_values;
        if let Some(&place) = valued.get(&(function, arguments.clone())) {
            if initial[place].2 != value {
                self.report
                    .warning(span, "a second initial value of this fluent")
                    .advise("the last one counts");
            }
            initial[place].2 = value;
        } else {
            valued.insert((function, arguments.clone()), initial.len());
            initial.push((function, arguments, value));
        }
    }
}
