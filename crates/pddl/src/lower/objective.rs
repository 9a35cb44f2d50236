//! The sections of a problem file; its goal and metric.

use elbowroom_model::problem::{Condition, Metric};

use crate::feature::Feature;
use crate::lower::Reader;
use crate::lower::scope::Scope;
use crate::lower::sections::{Section, Sections};
use crate::syntax::Node;

/// What can stand in a problem.
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
        if let Some(section) = sections.only(":objects", &mut self.report) {
            self.objects(section);
        }
        match sections.only(":init", &mut self.report) {
            Some(section) => self.init(section),
            None => {
                self.report
                    .warning(sections.name_span, "a problem without `:init`")
                    .help("nothing is true at time 0");
            }
        }
        let goal = sections.only(":goal", &mut self.report);
        match goal {
            Some(section) => self.goal(section),
            None => {
                self.report
                    .warning(sections.name_span, "a problem without `:goal`")
                    .help("every plan reaches it; expected `(:goal condition)`");
            }
        }
        self.check_expansion(goal.map(|section| section.span));
        for section in sections.all(":constraints") {
            self.constraints(section);
        }
        if let Some(section) = sections.only(":metric", &mut self.report) {
            self.metric(section);
        }
        for section in sections.iter() {
            let keyword = section.keyword.as_ref();
            if !SECTIONS.contains(&keyword) || keyword == ":length" {
                self.skip(section, SECTIONS);
            }
        }
    }

    /// Whether the problem is of this domain.
    fn domain_name(&mut self, sections: &Sections) {
        let Some(section) = sections.only(":domain", &mut self.report) else {
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
            [goal] => self.condition(goal, &mut Scope::default()),
            [] => {
                self.report
                    .error(section.span, "an empty goal")
                    .help("`(:goal (and))` always holds");
                Condition::TRUE
            }
            [_, second, ..] => {
                self.report
                    .error(second.span, "a second condition in the goal")
                    .help("join them by `and`");
                Condition::TRUE
            }
        };
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
        let expression = if let Some(violated) = mention_of_violation(measure) {
            self.report.ignored(
                Feature::Preferences,
                violated.span,
                "preferences are not measured: the metric is ignored",
            );
            None
        } else {
            let scope = Scope {
                has_total_time: true,
                ..Scope::default()
            };
            Some(self.expression(measure, &scope))
        };
        self.problem.metric = Some(Metric {
            maximize,
            expression,
        });
    }

    fn wrong_metric(&mut self, section: &Section) {
        self.report
            .error(section.span, "this metric cannot be understood")
            .help("expected `(:metric minimize expression)` or `(:metric maximize expression)`");
    }
}

/// The first `(is-violated …)` in an expression.
fn mention_of_violation<'t, 's>(node: &'t Node<'s>) -> Option<&'t Node<'s>> {
    if node.is("is-violated") {
        return Some(node);
    }
    node.list()?.iter().find_map(mention_of_violation)
}
