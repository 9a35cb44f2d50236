//! Rates of spontaneous changes of facts.

use elbowroom_num::Rational;
use elbowroom_text::Span;
use toml::Spanned;

use super::section::Section;
use super::{Read, Reader};
use crate::model::Hazard;
use crate::model::hazard::{MAX_FACTS, count};
use crate::pattern::NameKind;

impl Reader<'_> {
    pub(super) fn hazard(&self, section: &Spanned<Section>, resolution: &Rational) -> Read<Hazard> {
        let given = section.get_ref();
        let own = [
            "fact",
            "becomes_true_per_second",
            "becomes_false_per_second",
            "reported",
        ];
        if let Some((span, message)) = given.first_superfluous_key("[[hazard]]", &own, false) {
            return Err(self.error_at(&span, message));
        }
        let fact = given.fact.as_ref();
        let fact = fact.ok_or_else(|| self.error_at(&section.span(), "`fact` is missing"))?;
        let pattern = self.pattern(fact, NameKind::Predicates)?;
        let Some(name) = pattern.name() else {
            let message = "name a predicate, `(predicate _ object)` or one fact";
            return Err(self.error_at(&fact.span(), message));
        };
        self.check_hazard_predicate(name, &fact.span())?;
        let (up, down) = (
            &given.becomes_true_per_second,
            &given.becomes_false_per_second,
        );
        if up.is_none() && down.is_none() {
            let message =
                "expected a rate: becomes_true_per_second, becomes_false_per_second, or both";
            return Err(self.error_at(&section.span(), message));
        }
        let rate = |rate: &Option<Spanned<f64>>| match rate {
            Some(rate) => self.rate(rate, resolution),
            None => Ok(0.0),
        };
        Ok(Hazard {
            becomes_true: rate(up)?,
            becomes_false: rate(down)?,
            is_reported: given.reported.as_ref().is_none_or(|it| *it.get_ref()),
            fact: pattern,
        })
    }

    /// Checks that the facts of a predicate can change by themselves, and are not too many.
    fn check_hazard_predicate(&self, name: &str, at: &Span) -> Read<()> {
        let Some(predicate) = self.problem.predicate(name) else {
            return Ok(());
        };
        let mut rules = self.problem.rules.iter();
        if rules.any(|rule| rule.predicate == predicate) {
            let message = format!("`{name}` is derived from other facts; give the rates of those");
            return Err(self.error_at(at, message));
        }
        let facts = count(&self.problem.predicates[predicate.index()], self.problem);
        if facts.is_none_or(|facts| facts > MAX_FACTS) {
            let message = format!(
                "`{name}` has more than {MAX_FACTS} facts, the limit for spontaneous changes; \
                 split the predicate, or use fewer objects"
            );
            return Err(self.error_at(at, message));
        }
        Ok(())
    }

    fn rate(&self, rate: &Spanned<f64>, resolution: &Rational) -> Read<f64> {
        let value = *rate.get_ref();
        if !value.is_finite() || value < 0.0 {
            let message = "a rate is a number of changes per second: 0 or more";
            return Err(self.error_at(&rate.span(), message));
        }
        if value * resolution.to_f64() > 1.0 {
            let message =
                "this is more than one change per step of `resolution`; give a smaller rate";
            return Err(self.error_at(&rate.span(), message));
        }
        Ok(value)
    }
}
