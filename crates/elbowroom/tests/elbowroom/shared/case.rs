//! STN plan with its problem, and queries to the library.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use elbowroom::{Explainer, Explanation, parse_box, write_box};
use elbowroom_envelope::obligations::Requirement;
use elbowroom_envelope::{Guarantee, Objection, Oracle, Settings, irr, sharpen};
use elbowroom_model::validate::{self, validate};
use elbowroom_model::{Task, Verdict};
use elbowroom_num::Rational;
use elbowroom_plan::{DecoupledEnvelope, ParameterKind, ParametrizedPlan, format};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::draw;

/// STN plan with its problem.
pub(crate) struct Case {
    pub(crate) task: Arc<Task>,
    pub(crate) plan: Arc<ParametrizedPlan>,
}

pub(crate) fn number(text: &str) -> Rational {
    text.parse()
        .unwrap_or_else(|_| panic!("`{text}` is no number"))
}

impl Case {
    /// Reads a plan file with its domain and problem.
    pub(crate) fn read(domain: &Path, problem: &Path, plan: &Path) -> Self {
        let text = std::fs::read_to_string(plan)
            .unwrap_or_else(|error| panic!("{}: {error}", plan.display()));
        Self::of_text(domain, problem, &text)
    }

    /// Reads a plan from a text.
    pub(crate) fn of_text(domain: &Path, problem: &Path, plan: &str) -> Self {
        let task = super::task(domain, problem).unwrap_or_else(|error| panic!("{error}"));
        let plan = format::read(plan.as_bytes(), &task).unwrap_or_else(|error| panic!("{error}"));
        Self {
            task: Arc::new(task),
            plan: Arc::new(plan),
        }
    }

    pub(crate) fn oracle(&self) -> Oracle {
        Oracle::new(&self.task, &self.plan, Guarantee::Weak).expect("within reach")
    }

    /// Returns `true` if the plan is valid everywhere in the box (`dur_0=[7/4,9]`; missing ones are
    /// nominal).
    pub(crate) fn has_inside(&self, text: &str) -> bool {
        self.why_not(text).is_none()
    }

    /// Returns the reason why the plan is not valid everywhere in the box.
    ///
    /// If there is a schedule that the validator can check, it must reject it as well.
    pub(crate) fn why_not(&self, text: &str) -> Option<Explanation> {
        let envelope = parse_box(text, &self.plan).expect("a box of this plan");
        let (objection, explanation) = self.objection(&envelope)?;
        let is_askable = self.plan.parameters.iter().all(|parameter| {
            matches!(
                parameter.kind,
                ParameterKind::Duration(_) | ParameterKind::Constant(_) | ParameterKind::Bound
            )
        });
        if is_askable && matches!(objection, Objection::Broken(_)) {
            assert!(explanation.verdict.is_some(), "{text}: {explanation:?}");
        }
        Some(explanation)
    }

    /// Returns the violated requirement at the nominal values.
    pub(crate) fn broken(&self) -> Option<Requirement> {
        match self.objection(&DecoupledEnvelope::point(&self.plan.nominal()))? {
            (Objection::Broken(broken), _) => Some(broken.requirement),
            (_, explanation) => panic!("{explanation:?}"),
        }
    }

    fn objection(&self, envelope: &DecoupledEnvelope) -> Option<(Objection, Explanation)> {
        let mut oracle = self.oracle();
        let objection = oracle.objection(envelope).expect("within reach")?;
        let explainer = Explainer::new(&self.task, &self.plan);
        let explanation = explainer.objection(&oracle, envelope, &objection);
        Some((objection, explanation))
    }

    /// Returns the box that the authors' search finds at this precision, and that box with all ends
    /// at their limits. Samples of both have been accepted by the validator.
    pub(crate) fn found(&self, precision: &str) -> [DecoupledEnvelope; 2] {
        let settings = Settings {
            precision: number(precision),
            ..Settings::default()
        };
        let mut oracle = self.oracle();
        let run =
            irr(&mut oracle, &settings, &mut |_| ControlFlow::Continue(())).expect("within reach");
        let envelope = run.envelope.expect("the start point is inside");
        let sharp = sharpen(&mut oracle, &envelope, &mut || ControlFlow::Continue(()))
            .expect("within reach")
            .expect("a box that was found is inside");
        assert!(sharp.includes(&envelope));
        self.assert_withstands(&envelope);
        self.assert_withstands(&sharp);
        [envelope, sharp]
    }

    /// Returns the box with its ends at their limits, as text.
    pub(crate) fn limits(&self) -> String {
        let [_, sharp] = self.found("1");
        write_box(&sharp, &self.plan)
    }

    /// Checks that the validator accepts random schedules for random values in the box.
    pub(crate) fn assert_withstands(&self, envelope: &DecoupledEnvelope) {
        const SAMPLES: usize = 20;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..SAMPLES {
            let valuation = draw::valuation(envelope, &mut rng);
            let schedule = draw::schedule(&self.plan.plan, &valuation, &mut rng)
                .unwrap_or_else(|| panic!("no schedule at {valuation:?}"));
            let fixed = self.plan.plan.at(&valuation).scheduled(&schedule);
            let verdict = validate(&self.task, &fixed, &validate::Settings::default());
            assert!(
                matches!(verdict, Verdict::Valid(_)),
                "{valuation:?} {verdict:?}"
            );
        }
    }
}
