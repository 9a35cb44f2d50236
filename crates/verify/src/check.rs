//! Check that a certificate proves its claim: [`verify`].

mod cases;

use elbowroom_num::{Rational, enclosures};

use crate::bounds::EndExpression;
use crate::certificate::{Case, Certificate, Exact, Parameter, Proof, Reasons, Source, Stopped};
use crate::flaw::Flaw;
use crate::intervals::Intervals;
use crate::probability::{NEVER, VariableDistributions};
use crate::sound::{Control, Sound};
use crate::{claim, conditions, control, network, row, volume};

/// Result of a successful check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verified {
    /// Upper bound of the objective for all boxes inside the envelope: least slack as a share of
    /// the nominal value, weighted sum of widths, or sum of their logarithms.
    pub bound: Rational,
    /// Largest gap between value and bound for which the box counts as the best one: 0, or one
    /// millionth if logarithms are only enclosed.
    pub tolerance: Rational,
    /// Value of the box in the certificate.
    pub value: Rational,
    /// Number of proofs of inequalities.
    pub proofs: usize,
    /// Number of these proofs that are assumed by the certificate instead of derived from the
    /// network.
    pub assumed: usize,
    /// Number of inequalities proved from conditions on numbers, derived from problem and plan.
    pub from_conditions: usize,
    /// Result of the check that the box is inside the envelope; `None` if this is assumed.
    pub inside: Option<InsideCheck>,
    /// Claim of the certificate, in words.
    pub proves: String,
    /// Assumptions, in words.
    pub assumes: Vec<String>,
}

/// Result of the check that the box is inside the envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InsideCheck {
    /// `true` if it is proved that all points can be scheduled as the guarantee requires; assumed
    /// otherwise.
    pub is_controllable: bool,
    /// Number of conditions of the plan; `None` if all of them are assumed.
    pub conditions: Option<usize>,
    /// Number of these conditions that are assumed to hold in the box.
    pub assumed: usize,
}

impl InsideCheck {
    /// Returns `true` if nothing is assumed.
    pub fn is_proved(&self) -> bool {
        self.is_controllable && self.conditions.is_some() && self.assumed == 0
    }
}

/// `Σ factor · variable <= bound`.
struct Inequality {
    factors: Vec<Rational>,
    bound: Rational,
}

/// Checks a certificate.
///
/// # Errors
/// The first flaw.
pub fn verify(certificate: &Certificate) -> Result<Verified, Flaw> {
    let proves = claim::proves(certificate);
    let assumes = claim::assumes(certificate);
    if certificate.proves != proves || certificate.assumes != assumes {
        return Err(Flaw::Claim);
    }
    let checker = Checker::new(certificate)?;
    let inside = certificate.sound.as_ref();
    let inside = inside
        .map(|sound| check_inside(certificate, sound))
        .transpose()?;
    let bound = match &certificate.reasons {
        Reasons::LeastSlack(stopped) => checker.least_slack(stopped)?,
        Reasons::Widths(cases) => checker.widths(cases)?,
        Reasons::Volume { foot, cases } => checker.volume(foot, cases)?,
        Reasons::Probability(cases) => checker.probability(cases)?,
    };
    let value = match &certificate.reasons {
        Reasons::LeastSlack(_) => bound.clone(),
        Reasons::Widths(_) => checker.weighted_width_sum(),
        Reasons::Volume { foot, .. } => {
            let worth = volume::objective_value(foot, checker.widths_of_parameters());
            worth.ok_or(Flaw::Range("the volume of box", 0))?
        }
        Reasons::Probability(_) => {
            // `NEVER` means no probability at all, so a bound must be above it.
            if bound <= Rational::from(NEVER) {
                return Err(Flaw::Range("the probability of box", 0));
            }
            checker.chances.log_probability(&checker.slacks)
        }
    };
    let tolerance = match &certificate.reasons {
        Reasons::LeastSlack(_) | Reasons::Widths(_) => Rational::ZERO,
        Reasons::Volume { .. } | Reasons::Probability(_) => Rational::new(1, 1_000_000),
    };
    let is_assumed = |proof: &&Proof| matches!(proof, Proof::Assumed { .. });
    Ok(Verified {
        bound,
        value,
        tolerance,
        proofs: certificate.proofs.len(),
        assumed: certificate.proofs.iter().filter(is_assumed).count(),
        from_conditions: 0,
        inside,
        proves,
        assumes,
    })
}

/// Returns the proof without the parts that fail the check. These parts become assumptions.
fn assume_failed_parts(certificate: &Certificate, sound: &Sound) -> Result<Sound, Flaw> {
    let mut proved = sound.clone();
    let intervals = Intervals::new(certificate, &sound.endless)?;
    if control::check(certificate, &intervals, &sound.control).is_err() {
        proved.control = Control::Assumed;
    }
    for (index, condition) in proved.conditions.iter_mut().flatten().enumerate() {
        if conditions::check(certificate, &intervals, (index, condition)).is_err() {
            condition.cases.clear();
        }
    }
    Ok(proved)
}

/// Checks the proof that the box is inside the envelope. Assumed parts are skipped.
fn check_inside(certificate: &Certificate, sound: &Sound) -> Result<InsideCheck, Flaw> {
    let intervals = Intervals::new(certificate, &sound.endless)?;
    control::check(certificate, &intervals, &sound.control)?;
    let conditions = sound.conditions.as_deref().unwrap_or_default();
    let mut assumed = 0;
    for (index, condition) in conditions.iter().enumerate() {
        if condition.cases.is_empty() {
            assumed += 1;
        } else {
            conditions::check(certificate, &intervals, (index, condition))?;
        }
    }
    Ok(InsideCheck {
        is_controllable: sound.control != Control::Assumed,
        conditions: sound.conditions.as_ref().map(Vec::len),
        assumed,
    })
}

/// Completes a certificate: fills in the sums of its inequalities ([`Stopped::over`],
/// [`crate::certificate::Total::bound`]), its claim and its assumptions. Previous values are
/// overwritten. Parts of the proof that the box is inside the envelope that fail the check become
/// assumptions.
///
/// # Errors
/// A sum cannot be computed. The result may still prove nothing.
pub fn with_sums(mut certificate: Certificate) -> Result<Certificate, Flaw> {
    let checker = Checker::new(&certificate)?;
    let mut reasons = certificate.reasons.clone();
    let is_likely = matches!(reasons, Reasons::Probability(_));
    match &mut reasons {
        Reasons::LeastSlack(stopped) => {
            for one in stopped {
                if let Some(proof) = one.proof {
                    let over = checker.over(one.variable, proof)?;
                    one.over = over.into_iter().map(Exact).collect();
                }
            }
        }
        Reasons::Widths(cases) | Reasons::Volume { cases, .. } | Reasons::Probability(cases) => {
            let spans = checker.spans_of(cases)?;
            for (index, case) in cases.iter_mut().enumerate() {
                if let (Case::Sum(total) | Case::Impossible(total), Some(spans)) =
                    (case, &spans[index])
                {
                    let rows = total.of.iter().filter_map(|own| match own.source {
                        Source::Row(proof, row) => Some((proof, row)),
                        Source::Most(_) | Source::Least(_) => None,
                    });
                    let rows: Vec<(usize, usize)> = rows.collect();
                    let (factors, sum) = checker.sum(index, &total.of, (&rows, spans))?;
                    total.bound = sum;
                    if is_likely && !total.touches.is_empty() {
                        total.most = checker.chances.bound(total, &factors, spans).map(Exact);
                    }
                }
            }
        }
    }
    certificate.reasons = reasons;
    certificate.sound = certificate
        .sound
        .as_ref()
        .map(|own| assume_failed_parts(&certificate, own))
        .transpose()?;
    certificate.proves = claim::proves(&certificate);
    certificate.assumes = claim::assumes(&certificate);
    Ok(certificate)
}

struct Checker<'a> {
    certificate: &'a Certificate,
    /// Distributions of the parameters.
    chances: VariableDistributions,
    /// For each proof its inequalities, at least one of them true.
    rows: Vec<Vec<Inequality>>,
    /// For each variable: slack, scale, upper limit of the slack, and weight in the sum of widths.
    slacks: Vec<Rational>,
    scales: Vec<Rational>,
    most: Vec<Option<Rational>>,
    worths: Vec<Rational>,
}

impl<'a> Checker<'a> {
    fn new(certificate: &'a Certificate) -> Result<Self, Flaw> {
        network::is_well_formed(certificate)?;
        let mut scales = Vec::new();
        let mut most = Vec::new();
        let mut worths = Vec::new();
        for (index, parameter) in certificate.parameters.iter().enumerate() {
            if !parameter.scale.is_positive() {
                return Err(Flaw::Range("the scale of parameter", index));
            }
            let below = parameter.most_below.as_ref().map(|most| &most.0);
            let above = parameter.most_above.as_ref().map(|most| &most.0);
            if !parameter.weight.is_positive() {
                return Err(Flaw::Range("the weight of parameter", index));
            }
            let own: &[_] = if certificate.symmetric {
                &[(below.min(above), 2)]
            } else {
                &[(below, 1), (above, 1)]
            };
            for (limit, ends) in own {
                scales.push(parameter.scale.clone());
                most.push(limit.cloned());
                worths.push(&parameter.weight * &Rational::from(*ends));
            }
        }
        let slacks: Vec<Rational> = certificate.slacks.iter().map(|own| own.0.clone()).collect();
        if slacks.len() != most.len() {
            return Err(Flaw::Count {
                what: "slacks",
                found: slacks.len(),
                wanted: most.len(),
            });
        }
        for (index, (slack, most)) in slacks.iter().zip(&most).enumerate() {
            if slack.is_negative() || most.as_ref().is_some_and(|most| slack > most) {
                return Err(Flaw::Range("slack", index));
            }
        }
        let mut checker = Self {
            certificate,
            chances: VariableDistributions::new(certificate)?,
            rows: Vec::new(),
            slacks,
            scales,
            most,
            worths,
        };
        for proof in &certificate.proofs {
            let mut rows = Vec::new();
            for sum in row::sums(certificate, proof)? {
                rows.push(checker.inequality(&sum)?);
            }
            checker.rows.push(rows);
        }
        Ok(checker)
    }

    /// Expresses in the variables that a sum of bounds is not negative.
    fn inequality(&self, sum: &EndExpression) -> Result<Inequality, Flaw> {
        let mut factors = vec![Rational::ZERO; self.slacks.len()];
        let mut bound = sum.constant.clone();
        for (&end, factor) in &sum.factors {
            let parameter = self.certificate.parameters.get(end / 2);
            let parameter = parameter.ok_or(Flaw::UnknownReference("parameter", end / 2))?;
            bound += &parameter.nominal * factor;
            let variable = if self.certificate.symmetric {
                end / 2
            } else {
                end
            };
            // A lower end is the nominal value minus the variable, an upper end the nominal value
            // plus the variable.
            factors[variable] += &if end % 2 == 0 {
                factor.clone()
            } else {
                -factor
            };
        }
        Ok(Inequality { factors, bound })
    }

    /// Returns the weighted sum of widths.
    fn weighted_width_sum(&self) -> Rational {
        let terms = self.worths.iter().zip(&self.slacks).map(|(w, s)| w * s);
        terms.sum()
    }

    /// Checks that more slack for one variable requires less slack for another one that has at most
    /// as much, and returns the resulting least slack.
    ///
    /// Order the variables by their slacks, and let another box be at least as good. Its smallest
    /// slack is not less than the smallest one here, so the inequalities that limit these variables
    /// here limit them there. Therefore its next slack is not less than the next one here, and so
    /// on. Every sub-box of a box inside the envelope is inside as well, so it is sufficient that
    /// the box violates the inequality when no other variable has more slack than the limited one.
    fn least_slack(&self, stopped: &[Stopped]) -> Result<Rational, Flaw> {
        let mut is_stopped = vec![false; self.slacks.len()];
        for (place, one) in stopped.iter().enumerate() {
            let Stopped {
                variable, proof, ..
            } = one;
            let variable = *variable;
            match is_stopped.get_mut(variable) {
                None => return Err(Flaw::UnknownReference("variable", variable)),
                Some(true) => return Err(Flaw::Stopped(variable)),
                Some(is_stopped) => *is_stopped = true,
            }
            let Some(proof) = *proof else {
                if self.most[variable].as_ref() != Some(&self.slacks[variable]) {
                    return Err(Flaw::NotStopped(variable));
                }
                continue;
            };
            let over = self.over(variable, proof)?;
            if over.iter().ne(one.over.iter().map(|over| &over.0)) {
                return Err(Flaw::Over(place));
            }
            for (row, over) in self.rows[proof].iter().zip(&over) {
                let breaks_beyond = over.is_zero() && row.factors[variable].is_positive();
                if !over.is_positive() && !breaks_beyond {
                    return Err(Flaw::NotStopped(variable));
                }
            }
        }
        if let Some(variable) = is_stopped.iter().position(|is_stopped| !is_stopped) {
            return Err(Flaw::Stopped(variable));
        }
        let mut least: Option<Rational> = None;
        for variable in 0..self.slacks.len() {
            let slack = self.relative_slack(variable)?;
            least = Some(least.map_or(slack.clone(), |least| least.min(slack)));
        }
        Ok(least.unwrap_or_default())
    }

    /// Returns the slack of a variable in relation to its scale.
    fn relative_slack(&self, variable: usize) -> Result<Rational, Flaw> {
        let no_such = Flaw::UnknownReference("variable", variable);
        let slack = self.slacks.get(variable).ok_or(no_such)?;
        let slack = slack.checked_div(&self.scales[variable]);
        slack.ok_or(Flaw::Range("the scale of variable", variable))
    }

    /// Returns by how much each inequality of a proof is violated when no variable has more slack,
    /// in relation to its scale, than this one.
    fn over(&self, variable: usize, proof: usize) -> Result<Vec<Rational>, Flaw> {
        let rows = self
            .rows
            .get(proof)
            .ok_or(Flaw::UnknownReference("proof", proof))?;
        let level = self.relative_slack(variable)?;
        let over = rows.iter().map(|row| {
            let mut sum = -&row.bound;
            for (other, factor) in row.factors.iter().enumerate() {
                let here = &level * &self.scales[other];
                sum += factor * &self.slacks[other].clone().min(here);
            }
            sum
        });
        Ok(over.collect())
    }

    /// Returns the width of each parameter's interval.
    fn widths_of_parameters(&self) -> impl Iterator<Item = (&'a Parameter, Rational)> {
        let parameters = self.certificate.parameters.iter().enumerate();
        parameters.map(|(index, parameter)| {
            let width = if self.certificate.symmetric {
                &self.slacks[index] + &self.slacks[index]
            } else {
                &self.slacks[2 * index] + &self.slacks[2 * index + 1]
            };
            (parameter, width)
        })
    }

    /// Returns an upper bound of the weighted sum of widths: the greatest bound of the cases.
    fn widths(&self, cases: &[Case]) -> Result<Rational, Flaw> {
        self.cases(cases, &|total, factors, _| {
            let is_that =
                factors == self.worths && total.slopes.is_empty() && total.touches.is_empty();
            let is_that = is_that && total.most.is_none();
            is_that.then(|| total.bound.clone())
        })
    }

    /// Returns an upper bound of the logarithm of the product of widths: the greatest bound of the
    /// cases.
    fn volume(&self, foot: &Rational, cases: &[Case]) -> Result<Rational, Flaw> {
        if !foot.is_positive() {
            return Err(Flaw::Range("foot", 0));
        }
        let parameters = &self.certificate.parameters;
        self.cases(cases, &|total, factors, _| {
            let mut slopes = total.slopes.iter().flat_map(|Exact(slope)| {
                if self.certificate.symmetric {
                    vec![slope + slope]
                } else {
                    vec![slope.clone(); 2]
                }
            });
            let is_that = factors
                .iter()
                .all(|own| slopes.next().as_ref() == Some(own));
            let bound = volume::bound(foot, parameters, &total.slopes, &total.bound);
            bound.filter(|_| is_that && total.touches.is_empty() && total.most.is_none())
        })
    }

    /// Returns an upper bound of the logarithm of the probability: the greatest bound of the cases.
    fn probability(&self, cases: &[Case]) -> Result<Rational, Flaw> {
        self.cases(cases, &|total, factors, spans| {
            let bound = self.chances.bound(total, factors, spans)?;
            let is_told = total.most.as_ref().is_some_and(|most| most.0 == bound);
            is_told.then(|| enclosures::ceil_to_billionth(&bound))
        })
    }
}
