//! That a certificate proves what it claims: [`verify`].

mod cases;

use elbowroom_num::{Rational, enclosed};

use crate::bounds::Ends;
use crate::certificate::{Case, Certificate, Exact, Parameter, Proof, Reasons, Source, Stopped};
use crate::flaw::Flaw;
use crate::intervals::Intervals;
use crate::probability::{Chances, NEVER};
use crate::sound::{Control, Sound};
use crate::{claim, conditions, control, network, row, volume};

/// What a certificate proves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verified {
    /// What no box inside the envelope exceeds: the least slack as a share of the nominal value, the
    /// weighted sum of widths, or of their logarithms.
    pub bound: Rational,
    /// A box counts as the best one if its value is at most so much below the bound: 0, or a
    /// millionth where logarithms are only known between bounds.
    pub tolerance: Rational,
    /// The value of the box in the certificate.
    pub value: Rational,
    /// The number of proofs of inequalities.
    pub proofs: usize,
    /// How many of these are not proved from the network, but taken from the certificate.
    pub assumed: usize,
    /// The number of inequalities proved from conditions on numbers, derived from problem and plan.
    pub from_conditions: usize,
    /// What is proved of the box being inside the envelope; none if that is taken for granted.
    pub inside: Option<Inside>,
    /// What is proved, in words.
    pub proves: String,
    /// What is taken for granted, in words.
    pub assumes: Vec<String>,
}

/// What is proved of the box being inside the envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inside {
    /// Whether there are times for all points, as the guarantee demands; taken for granted otherwise.
    pub is_controllable: bool,
    /// The number of conditions of the plan; none if all of them are taken for granted.
    pub conditions: Option<usize>,
    /// How many of these are not proved to hold in the box, but only stated.
    pub assumed: usize,
}

impl Inside {
    /// Whether nothing of it is taken for granted.
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
/// The first thing in it that is not so.
pub fn verify(certificate: &Certificate) -> Result<Verified, Flaw> {
    let proves = claim::proves(certificate);
    let assumes = claim::assumes(certificate);
    if certificate.proves != proves || certificate.assumes != assumes {
        return Err(Flaw::Claim);
    }
    let checker = Checker::new(certificate)?;
    let inside = certificate.sound.as_ref();
    let inside = inside
        .map(|sound| inside_of(certificate, sound))
        .transpose()?;
    let bound = match &certificate.reasons {
        Reasons::LeastSlack(stopped) => checker.least_slack(stopped)?,
        Reasons::Widths(cases) => checker.widths(cases)?,
        Reasons::Volume { foot, cases } => checker.volume(foot, cases)?,
        Reasons::Probability(cases) => checker.probability(cases)?,
    };
    let value = match &certificate.reasons {
        Reasons::LeastSlack(_) => bound.clone(),
        Reasons::Widths(_) => checker.worth(),
        Reasons::Volume { foot, .. } => {
            let worth = volume::worth(foot, checker.widths_of_parameters());
            worth.ok_or(Flaw::Range("the volume of box", 0))?
        }
        Reasons::Probability(_) => {
            // A bound below the least value would not bound this one.
            if bound <= Rational::from(NEVER) {
                return Err(Flaw::Range("the probability of box", 0));
            }
            checker.chances.worth(&checker.slacks)
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

/// What is proved of the box being inside the envelope; the rest is taken for granted.
fn proved(certificate: &Certificate, sound: &Sound) -> Result<Sound, Flaw> {
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

/// Checks that the box is inside the envelope, as far as that is not taken for granted.
fn inside_of(certificate: &Certificate, sound: &Sound) -> Result<Inside, Flaw> {
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
    Ok(Inside {
        is_controllable: sound.control != Control::Assumed,
        conditions: sound.conditions.as_ref().map(Vec::len),
        assumed,
    })
}

/// The certificate with what its inequalities add up to filled in ([`Stopped::over`],
/// [`crate::certificate::Total::bound`]), and with what it proves and assumes, whatever it says there.
/// What does not prove that the box is inside the envelope is taken away from it.
///
/// # Errors
/// When nothing can be added up. Whether the certificate proves anything is not asked.
pub fn added_up(mut certificate: Certificate) -> Result<Certificate, Flaw> {
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
        .map(|own| proved(&certificate, own))
        .transpose()?;
    certificate.proves = claim::proves(&certificate);
    certificate.assumes = claim::assumes(&certificate);
    Ok(certificate)
}

struct Checker<'a> {
    certificate: &'a Certificate,
    /// How the parameters are distributed.
    chances: Chances,
    /// Of each proof the inequalities of which one holds.
    rows: Vec<Vec<Inequality>>,
    /// Of each variable its slack, the size it is measured by, the most it can be, and its worth.
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
            chances: Chances::new(certificate)?,
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

    /// That a sum of bounds is not negative, in terms of the variables.
    fn inequality(&self, sum: &Ends) -> Result<Inequality, Flaw> {
        let mut factors = vec![Rational::ZERO; self.slacks.len()];
        let mut bound = sum.constant.clone();
        for (&end, factor) in &sum.factors {
            let parameter = self.certificate.parameters.get(end / 2);
            let parameter = parameter.ok_or(Flaw::NoSuch("parameter", end / 2))?;
            bound += &parameter.nominal * factor;
            let variable = if self.certificate.symmetric {
                end / 2
            } else {
                end
            };
            // A lower end is the nominal value less the variable, an upper one that and more.
            factors[variable] += &if end % 2 == 0 {
                factor.clone()
            } else {
                -factor
            };
        }
        Ok(Inequality { factors, bound })
    }

    /// The weighted sum of widths.
    fn worth(&self) -> Rational {
        let terms = self.worths.iter().zip(&self.slacks).map(|(w, s)| w * s);
        terms.sum()
    }

    /// That a variable with more slack has to take some from one that has no more: the least slack
    /// that follows.
    ///
    /// With the variables in the order of their slacks, let a box be at least as good. Its smallest
    /// slack is then no less than the smallest here, so what stops those that have it here stops
    /// them there; so its next one is no less than the next one here, and so on. Boxes inside the
    /// envelope have their sub-boxes there, so it is enough that the box breaks the inequality in
    /// which the others have no more than the variable that is stopped.
    fn least_slack(&self, stopped: &[Stopped]) -> Result<Rational, Flaw> {
        let mut is_stopped = vec![false; self.slacks.len()];
        for (place, one) in stopped.iter().enumerate() {
            let Stopped {
                variable, proof, ..
            } = one;
            let variable = *variable;
            match is_stopped.get_mut(variable) {
                None => return Err(Flaw::NoSuch("variable", variable)),
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
            let slack = self.relative(variable)?;
            least = Some(least.map_or(slack.clone(), |least| least.min(slack)));
        }
        Ok(least.unwrap_or_default())
    }

    /// The slack of a variable in relation to its scale.
    fn relative(&self, variable: usize) -> Result<Rational, Flaw> {
        let no_such = Flaw::NoSuch("variable", variable);
        let slack = self.slacks.get(variable).ok_or(no_such)?;
        let slack = slack.checked_div(&self.scales[variable]);
        slack.ok_or(Flaw::Range("the scale of variable", variable))
    }

    /// By how much each inequality of a proof is broken where no variable has more slack than this
    /// one, in relation to its scale.
    fn over(&self, variable: usize, proof: usize) -> Result<Vec<Rational>, Flaw> {
        let rows = self.rows.get(proof).ok_or(Flaw::NoSuch("proof", proof))?;
        let level = self.relative(variable)?;
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

    /// The width of each parameter's interval.
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

    /// That in each case the weighted sum of widths is at most a bound: the greatest of these.
    fn widths(&self, cases: &[Case]) -> Result<Rational, Flaw> {
        self.cases(cases, &|total, factors, _| {
            let is_that =
                factors == self.worths && total.slopes.is_empty() && total.touches.is_empty();
            let is_that = is_that && total.most.is_none();
            is_that.then(|| total.bound.clone())
        })
    }

    /// That in each case the logarithm of the product of widths is at most a bound: the greatest of
    /// these.
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

    /// That in each case the logarithm of the probability is at most a bound: the greatest of these.
    fn probability(&self, cases: &[Case]) -> Result<Rational, Flaw> {
        self.cases(cases, &|total, factors, spans| {
            let bound = self.chances.bound(total, factors, spans)?;
            let is_told = total.most.as_ref().is_some_and(|most| most.0 == bound);
            is_told.then(|| enclosed::billionths_above(&bound))
        })
    }
}
