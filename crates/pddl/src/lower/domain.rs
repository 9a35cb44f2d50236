//! The sections of a domain file.

use crate::feature::Feature;
use crate::lower::Reader;
use crate::lower::sections::{Section, Sections};
use crate::syntax::Node;
use elbowroom_text::nearest;

/// The keywords of a domain.
const SECTIONS: &[&str] = &[
    ":requirements",
    ":types",
    ":constants",
    ":predicates",
    ":functions",
    ":synth-parameters",
    ":derived",
    ":action",
    ":durative-action",
    ":constraints",
    ":process",
    ":event",
    ":constraint",
    ":modules",
];

/// Requirement flags of domains and problems. All of them are always enabled.
const REQUIREMENTS: &[&str] = &[
    ":strips",
    ":typing",
    ":negative-preconditions",
    ":disjunctive-preconditions",
    ":equality",
    ":existential-preconditions",
    ":universal-preconditions",
    ":quantified-preconditions",
    ":conditional-effects",
    ":fluents",
    ":numeric-fluents",
    ":object-fluents",
    ":adl",
    ":durative-actions",
    ":duration-inequalities",
    ":continuous-effects",
    ":derived-predicates",
    ":timed-initial-literals",
    ":timed-initial-fluents",
    ":timed-effects",
    ":preferences",
    ":constraints",
    ":action-costs",
    ":goal-utilities",
    ":time",
    ":processes",
    ":events",
    ":modules",
    ":control-parameters",
    ":synth-parameters",
];

impl Reader {
    /// Reads a domain.
    pub(super) fn domain(&mut self, sections: &Sections) {
        sections.name.clone_into(&mut self.problem.domain);
        for section in sections.all(":requirements") {
            self.requirements(section);
        }
        let types = sections.single(":types", &mut self.report);
        self.types(types);
        if let Some(section) = sections.single(":constants", &mut self.report) {
            self.objects(section);
        }
        self.problem.constants = self.problem.objects.len();
        if let Some(section) = sections.single(":predicates", &mut self.report) {
            self.predicates(section);
        }
        if let Some(section) = sections.single(":functions", &mut self.report) {
            self.functions(section);
        }
        if let Some(section) = sections.single(":synth-parameters", &mut self.report) {
            self.problem.unknowns = self.unknowns(section.content);
        }
        let heads: Vec<_> = sections
            .all(":derived")
            .filter_map(|section| self.rule_head(section))
            .collect();
        for section in sections.iter() {
            match section.keyword.as_ref() {
                ":action" | ":durative-action" => self.action(section),
                ":constraints" => self.constraints(section),
                ":process" | ":event" => self.autonomous(section),
                ":constraint" => self.global_constraint(section),
                ":modules" => self.report_unsupported(section),
                keyword if !SECTIONS.contains(&keyword) => self.skip(section, SECTIONS),
                _ => {}
            }
        }
        self.problem.domain_constraints = self.problem.constraints.len();
        self.rules(heads);
    }

    pub(super) fn requirements(&mut self, section: &Section) {
        for node in section.content {
            let known = node
                .lower()
                .is_some_and(|flag| REQUIREMENTS.contains(&flag.as_ref()));
            if !known {
                let near = node
                    .word()
                    .and_then(|flag| nearest(flag, REQUIREMENTS.iter().copied()));
                self.report
                    .ignored(
                        Feature::UnknownRequirements,
                        node.span,
                        format!("unknown requirement `{}`", node.quote()),
                    )
                    .suggest(near);
            }
        }
    }

    /// Reports a section of another dialect as unsupported, with the name that it declares.
    fn report_unsupported(&mut self, section: &Section) {
        let feature = Feature::Modules;
        let name = section.content.first().and_then(Node::word);
        let named = name.map_or(String::new(), |name| format!(" `{name}`"));
        self.report.unsupported(
            feature,
            section.span,
            format!(
                "`{}`{named}: {} are not supported",
                section.keyword,
                feature.name()
            ),
        );
    }

    /// Ignores an unknown section, or reports it if its name is misspelt.
    pub(super) fn skip(&mut self, section: &Section, known: &[&str]) {
        let keyword = &section.keyword;
        let is_known = known.contains(&keyword.as_ref());
        match nearest(keyword, known.iter().copied()) {
            Some(near) if !is_known => {
                self.report
                    .error(section.span, format!("unknown section `{keyword}`"))
                    .suggest(Some(near));
            }
            _ => {
                self.report.ignored(
                    Feature::OtherSections,
                    section.span,
                    format!("section `{keyword}` is ignored"),
                );
            }
        }
    }
}
