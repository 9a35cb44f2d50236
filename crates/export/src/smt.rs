//! The box check and the region in SMT-LIB 2.

use std::fmt::Write as _;

use elbowroom_envelope::Guarantee;
use elbowroom_envelope::linear_form::{LinearForm, inequality};
use elbowroom_envelope::obligations::{BadCase, Inequality};
use elbowroom_model::Task;
use elbowroom_num::{End, Rational};
use elbowroom_plan::{DecoupledEnvelope, ParameterId, ParametrizedPlan};
use elbowroom_stn::NodeId;
use elbowroom_stn::uncertain::UncertainNetwork;

use super::names;
use super::write::{Symbols, all, number};

/// A plan with its names.
pub(super) struct Text<'a> {
    task: &'a Task,
    plan: &'a ParametrizedPlan,
    form: &'a LinearForm,
    symbols: Symbols,
}

impl<'a> Text<'a> {
    pub(super) fn new(task: &'a Task, plan: &'a ParametrizedPlan, form: &'a LinearForm) -> Self {
        let times = names::points(&plan.plan).into_iter();
        let times = times.map(|name| format!("t_{name}"));
        let parameters = plan.parameters.iter();
        let parameters = parameters.map(|parameter| format!("p_{}", parameter.name));
        Self {
            task,
            plan,
            form,
            symbols: Symbols {
                // No node has this name, because names of nodes end in the kind of happening.
                times: times.chain(["moment".to_owned()]).collect(),
                parameters: names::distinct(parameters),
            },
        }
    }

    /// Returns the heading that explains the text to readers.
    pub(super) fn box_heading(&self, envelope: &DecoupledEnvelope, guarantee: Guarantee) -> String {
        let mut text = self.heading();
        let claim = match guarantee {
            Guarantee::Weak => {
                "Both answers are unsat exactly if, for all values in the box below, there is a\n\
                 schedule, and every schedule is valid (the weak guarantee)."
            }
            Guarantee::Strong => {
                "Both answers are unsat exactly if one schedule satisfies the bounds for all values\n\
                 in the box below, and every schedule is valid (the strong guarantee)."
            }
            _ => {
                "The answer is unsat exactly if every schedule is valid, for all values in the box\n\
                 below. That is one half of the dynamic guarantee. The other half, that an executor\n\
                 which observes values only at run time can follow a schedule, is a game and cannot be\n\
                 expressed here: a checker of dynamic controllability decides it for the network of\n\
                 `elbowroom export stnu`."
            }
        };
        comment(&mut text, claim);
        comment(&mut text, "");
        for (index, interval) in envelope.intervals().iter().enumerate() {
            let name = &self.symbols.parameters[index];
            let (words, interval) = (self.words(index), interval.to_string());
            comment(&mut text, &format!("{name}: {words}, in {interval}"));
        }
        text
    }

    fn heading(&self) -> String {
        let mut text = String::new();
        let problem = self.task.problem();
        let (problem, domain) = (&problem.name, &problem.domain);
        comment(
            &mut text,
            &format!("A plan for the problem {problem} of the domain {domain}."),
        );
        text
    }

    fn words(&self, parameter: usize) -> String {
        self.plan.describe(self.task, ParameterId::from(parameter))
    }

    /// Writes the query whether some schedule is invalid.
    pub(super) fn conditions(&self, envelope: &DecoupledEnvelope, text: &mut String) {
        part(
            text,
            "Is there a schedule, for some values in the box, that breaks a condition?\n\
             unsat: there is none.",
        );
        let logic = if self.has_products() {
            "QF_NRA"
        } else {
            "QF_LRA"
        };
        let _ = writeln!(text, "(set-logic {logic})");
        self.declare_parameters(text);
        self.declare_times(text);
        let _ = writeln!(text, "(declare-const {} Real)", self.moment());
        self.assert_box(envelope, text);
        for bound in &self.form.network {
            let _ = writeln!(
                text,
                "(assert {})",
                self.symbols.inequality(&bound.inequality)
            );
        }
        text.push_str("(assert ");
        self.broken(text);
        text.push_str(")\n(check-sat)\n");
    }

    /// Writes the query whether some values have no schedule.
    pub(super) fn schedules(&self, envelope: &DecoupledEnvelope, text: &mut String) {
        part(
            text,
            "Are there values in the box without any schedule?\nunsat: all have one.",
        );
        text.push_str("(set-logic LRA)\n");
        self.declare_parameters(text);
        self.assert_box(envelope, text);
        let _ = writeln!(text, "(assert (not {}))\n(check-sat)", self.has_schedule());
    }

    /// Writes the query whether no fixed times satisfy the network for all choices of the world.
    pub(super) fn fixed_times(&self, network: &UncertainNetwork<Rational>, text: &mut String) {
        part(
            text,
            "Can the world violate a bound for every schedule that the executor chooses?\n\
             unsat: no, some schedule satisfies the bounds for all choices of the world.",
        );
        text.push_str("(set-logic LRA)\n");
        let links = network.links();
        let delay =
            |link: usize| format!("d_{}", &self.symbols.times[links[link].end.index()][2..]);
        let time = |node: NodeId| {
            let own = |node: NodeId| match node.index() {
                0 => "0.0".to_owned(),
                index => self.symbols.times[index].clone(),
            };
            match links.iter().position(|link| link.end == node) {
                Some(link) => format!("(+ {} {})", own(links[link].activation), delay(link)),
                None => own(node),
            }
        };
        let is_chosen = |index: &usize| links.iter().all(|link| link.end.index() != *index);
        let chosen = (1..self.plan.plan.nodes.len()).filter(is_chosen);
        let chosen = chosen.map(|index| self.symbols.times[index].clone());
        let mut within = Vec::new();
        for (index, link) in links.iter().enumerate() {
            within.push(format!("(<= {} {})", number(&link.lower), delay(index)));
            if let Some(upper) = &link.upper {
                within.push(format!("(<= {} {})", delay(index), number(upper)));
            }
        }
        let requirements = network.requirements().constraints().iter();
        let kept: Vec<String> = requirements
            .map(|own| {
                let (from, to, bound) = (time(own.from), time(own.to), number(&own.bound));
                format!("(<= {to} (+ {from} {bound}))")
            })
            .collect();
        within.push(format!("(not {})", lines(&kept)));
        let delays = (0..links.len()).map(delay);
        let decided = quantified("exists", &delays.collect::<Vec<_>>(), &all(within));
        let chosen = quantified("forall", &chosen.collect::<Vec<_>>(), &decided);
        let _ = writeln!(text, "(assert {chosen})\n(check-sat)");
    }

    /// Returns the text about all values for which the plan works.
    pub(super) fn region(&self, ranges: &DecoupledEnvelope) -> String {
        let mut text = self.heading();
        comment(
            &mut text,
            "The values of its parameters for which it has a schedule and every schedule is valid,\n\
             as far as happenings keep the order that they have at the nominal values: the region\n\
             of the weak guarantee. The answer is sat if there are such values. Add assertions\n\
             about the parameters to restrict them: with all of them fixed, sat means that the plan\n\
             works with these values.",
        );
        comment(&mut text, "");
        for (index, parameter) in self.plan.parameters.iter().enumerate() {
            let (name, words) = (&self.symbols.parameters[index], self.words(index));
            let nominal = &parameter.nominal;
            comment(&mut text, &format!("{name}: {words}, nominal {nominal}"));
        }
        let logic = if self.has_products() { "NRA" } else { "LRA" };
        let _ = writeln!(text, "(set-logic {logic})");
        self.declare_parameters(&mut text);
        self.assert_box(ranges, &mut text);
        comment(&mut text, "There is a schedule.");
        let _ = writeln!(text, "(assert {})", self.has_schedule());
        comment(&mut text, "No schedule breaks a condition.");
        let mut broken = String::new();
        self.broken(&mut broken);
        let mut times = self.chosen_times();
        times.push(self.moment().to_owned());
        let network = self.network();
        let broken = quantified("exists", &times, &format!("(and {network}\n{broken})"));
        let _ = writeln!(text, "(assert (not {broken}))\n(check-sat)");
        text
    }

    fn has_products(&self) -> bool {
        let cases = self.form.obligations.iter().flat_map(|own| &own.bad_cases);
        let mut inequalities = cases.flat_map(|case| &case.inequalities);
        inequalities.any(|own| !own.expression.products.is_empty())
    }

    fn moment(&self) -> &str {
        &self.symbols.times[self.plan.plan.nodes.len()]
    }

    /// Returns the symbols of all times but zero.
    fn chosen_times(&self) -> Vec<String> {
        self.symbols.times[1..self.plan.plan.nodes.len()].to_vec()
    }

    fn declare_parameters(&self, text: &mut String) {
        for name in &self.symbols.parameters {
            let _ = writeln!(text, "(declare-const {name} Real)");
        }
    }

    fn declare_times(&self, text: &mut String) {
        for (node, _) in self.plan.plan.nodes().skip(1) {
            let words = one_line(&self.plan.plan.describe_node(self.task, node));
            let name = &self.symbols.times[node.index()];
            let _ = writeln!(text, "(declare-const {name} Real) ; {words}");
        }
    }

    fn assert_box(&self, envelope: &DecoupledEnvelope, text: &mut String) {
        for (name, interval) in self.symbols.parameters.iter().zip(envelope.intervals()) {
            let ends = [
                (&interval.lower, name, true),
                (&interval.upper, name, false),
            ];
            for (end, name, is_lower) in ends {
                let Some(value) = end.value() else { continue };
                let sign = if matches!(end, End::Open(_)) {
                    "<"
                } else {
                    "<="
                };
                let value = number(value);
                let (left, right) = if is_lower {
                    (&value, name)
                } else {
                    (name, &value)
                };
                let _ = writeln!(text, "(assert ({sign} {left} {right}))");
            }
        }
    }

    /// Returns the network as one term.
    fn network(&self) -> String {
        let bounds = self.form.network.iter();
        let bounds = bounds.map(|bound| self.symbols.inequality(&bound.inequality));
        lines(&bounds.collect::<Vec<_>>())
    }

    fn has_schedule(&self) -> String {
        quantified("exists", &self.chosen_times(), &self.network())
    }

    /// Writes the disjunction of all violations of requirements, each with a description.
    fn broken(&self, text: &mut String) {
        text.push_str("(or false\n");
        for obligation in &self.form.obligations {
            if obligation.bad_cases.is_empty() {
                continue;
            }
            let words = obligation.requirement.describe(self.task, &self.plan.plan);
            let _ = writeln!(text, "  ; not: {}", one_line(&words));
            for case in &obligation.bad_cases {
                let _ = writeln!(text, "  {}", self.case(case));
            }
        }
        text.push(')');
    }

    fn case(&self, case: &BadCase) -> String {
        let written = |own: &Inequality| self.symbols.inequality(own);
        let differences = case.differences.iter().map(|own| written(&inequality(own)));
        all(differences
            .chain(case.inequalities.iter().map(written))
            .collect())
    }
}

/// Returns the conjunction, with each part on a line.
fn lines(parts: &[String]) -> String {
    let parts: Vec<String> = parts.iter().map(|part| format!("\n  {part}")).collect();
    format!("(and true{})", parts.concat())
}

/// Adds a quantifier over real numbers, unless there are no names.
fn quantified(quantifier: &str, names: &[String], term: &str) -> String {
    if names.is_empty() {
        return term.to_owned();
    }
    let names: Vec<String> = names.iter().map(|name| format!("({name} Real)")).collect();
    format!("({quantifier} ({})\n{term})", names.join(" "))
}

/// Begins a query.
fn part(text: &mut String, words: &str) {
    text.push('\n');
    comment(text, words);
    text.push_str("(reset)\n");
}

fn comment(text: &mut String, words: &str) {
    if words.is_empty() {
        text.push_str(";\n");
    }
    for line in words.lines() {
        let _ = writeln!(text, "; {line}");
    }
}

/// Joins lines, so that the words stay within a comment.
fn one_line(words: &str) -> String {
    words.split_whitespace().collect::<Vec<_>>().join(" ")
}
