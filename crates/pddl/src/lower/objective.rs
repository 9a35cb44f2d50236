//! The sections of a problem file; its goal and metric.

use elbowroom_model::problem::{
    Body, Change, Condition, Fluent, Metric, ObjectId, Term, TimedChange, UpdateOperator,
};

use crate::lower::Reader;
use crate::lower::scope::Scope;
use crate::lower::sections::{Section, Sections};

/// The keywords of a problem.
const SECTIONS: &[&str] = &[
    ":domain",
    ":requirements",
    ":objects",
    ":init",
    ":goal",
    ":constraints",
    ":metric",
    ":length",
];

impl Reader {
    /// Reads a problem, after its domain.
    pub(super) fn problem(&mut self, sections: &Sections) {
        sections.name.clone_into(&mut self.problem.name);
        self.domain_name(sections);
        for section in sections.all(":requirements") {
            self.requirements(section);
        }
        if let Some(section) = sections.single(":objects", &mut self.report) {
            self.objects(section);
        }
        match sections.single(":init", &mut self.report) {
            Some(section) => self.init(section),
            None => {
                self.report
                    .warning(sections.name_span, "a problem without `:init`")
                    .advise("nothing is true at time 0");
            }
        }
        let goal = sections.single(":goal", &mut self.report);
        match goal {
            Some(section) => self.goal(section),
            None => {
                self.report
                    .warning(sections.name_span, "a problem without `:goal`")
                    .advise("every plan reaches the goal; expected `(:goal condition)`");
            }
        }
        for section in sections.all(":constraints") {
            self.constraints(section);
        }
        self.check_expansion(goal.map(|section| section.span));
        if let Some(section) = sections.single(":metric", &mut self.report) {
            self.metric(section);
        }
        for section in sections.iter() {
            let keyword = section.keyword.as_ref();
            if !SECTIONS.contains(&keyword) || keyword == ":length" {
                self.skip(section, SECTIONS);
            }
        }
    }

    /// Checks that the problem belongs to this domain.
    fn domain_name(&mut self, sections: &Sections) {
        let Some(section) = sections.single(":domain", &mut self.report) else {
            self.report
                .warning(sections.name_span, "a problem without `:domain`");
            return;
        };
        let expected = self.problem.domain.clone();
        match section.content {
            [name] if name.is(&expected) => {}
            [name] => {
                self.report.warning(
                    name.span,
                    format!(
                        "a problem of domain `{}`, read with `{expected}`",
                        name.quote()
                    ),
                );
            }
            _ => {
                self.report
                    .error(section.span, "expected one name after `:domain`");
            }
        }
    }

    fn goal(&mut self, section: &Section) {
        self.problem.goal = match section.content {
            [goal] => {
                let mut scope = Scope::default();
                let condition = self.condition(goal, &mut scope);
                self.goal_preferences(scope.soft, section.span);
                condition
            }
            [] => {
                self.report
                    .error(section.span, "an empty goal")
                    .advise("`(:goal (and))` always holds");
                Condition::TRUE
            }
            [_, second, ..] => {
                self.report
                    .error(second.span, "a second condition in the goal")
                    .advise("join them by `and`");
                Condition::TRUE
            }
        };
        let mut undefined = Vec::new();
        self.undefined(&self.problem.goal, &mut undefined);
        for name in undefined {
            self.report
                .warning(
                    section.span,
                    format!("the goal reads `{name}`, which never gets a value"),
                )
                .advise(format!("write `(= {name} …)` under `:init`"));
        }
    }

    /// Collects the names of the fluents that a ground condition reads and that never get a value:
    /// not from the initial state, an action or a timed initial.
    fn undefined(&self, condition: &Condition, found: &mut Vec<String>) {
        match condition {
            Condition::Compare(_, left, right) => {
                for side in [left, right] {
                    side.visit_fluents(&mut |fluent| found.extend(self.undefined_fluent(fluent)));
                }
            }
            Condition::Not(part) => self.undefined(part, found),
            Condition::And(parts) | Condition::Or(parts) => {
                for part in parts {
                    self.undefined(part, found);
                }
            }
            _ => {}
        }
    }

    fn undefined_fluent(&self, fluent: &Fluent) -> Option<String> {
        let problem = &self.problem;
        let arguments: Vec<ObjectId> = fluent
            .arguments
            .iter()
            .map(|term| match term {
                Term::Object(object) => Some(*object),
                Term::Variable(_) => None,
            })
            .collect::<Option<_>>()?;
        let mut initial = problem.initial_values.iter();
        let is_initial = initial
            .any(|(function, objects, _)| *function == fluent.function && *objects == arguments);
        let is_timed = problem.timed.iter().any(|timed| {
            matches!(&timed.change, TimedChange::Assign(function, objects, _)
                if *function == fluent.function && *objects == arguments)
        });
        let is_assigned = problem.schemas.iter().any(|schema| {
            let (first, second) = match &schema.body {
                Body::Instantaneous { effects, .. } => (effects.as_slice(), [].as_slice()),
                Body::Durative {
                    start_effects,
                    end_effects,
                    ..
                } => (start_effects.as_slice(), end_effects.as_slice()),
            };
            first.iter().chain(second).any(|effect| {
                matches!(&effect.change, Change::Update { operator: UpdateOperator::Assign, fluent: changed, .. }
                    if changed.function == fluent.function)
            })
        });
        let name = &problem.functions[fluent.function.index()].name;
        let is_undefined = !(is_initial || is_timed || is_assigned);
        is_undefined.then(|| problem.apply_name(name, &arguments))
    }

    fn metric(&mut self, section: &Section) {
        let [direction, measure] = section.content else {
            self.wrong_metric(section);
            return;
        };
        let maximize = direction.is("maximize");
        if !maximize && !direction.is("minimize") {
            self.wrong_metric(section);
            return;
        }
        let scope = Scope {
            has_total_time: true,
            ..Scope::default()
        };
        let expression = self.expression(measure, &scope);
        self.problem.metric = Some(Metric {
            maximize,
            expression,
        });
    }

    fn wrong_metric(&mut self, section: &Section) {
        self.report
            .error(section.span, "invalid metric")
            .advise("expected `(:metric minimize expression)` or `(:metric maximize expression)`");
    }
}
