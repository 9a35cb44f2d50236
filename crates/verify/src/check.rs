//! That a certificate proves what it claims: [`verify`].

use elbowroom_num::Rational;

use crate::bounds::Ends;
use crate::certificate::{
    Case, Certificate, Exact, Multiplier, Proof, Reasons, Source, Stopped, Total,
};
use crate::row;

/// What a certificate proves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verified {
    /// What no box inside the envelope exceeds: the least slack as a share of the nominal value, or
    /// the weighted sum of widths.
    pub bound: Rational,
    /// The value of the box in the certificate.
    pub value: Rational,
    /// The number of proofs of inequalities.
    pub proofs: usize,
    /// How many of these are not proved from the network, but taken from the certificate.
    pub assumed: usize,
}

/// What is wrong with a certificate: the first thing that is found.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Flaw {
    /// Something is mentioned that does not exist.
    #[error("there is no {0} {1}")]
    NoSuch(&'static str, usize),
    /// A list has another length than what it is about.
    #[error("there are {found} {what}, but {wanted} are needed")]
    Count {
        /// What is counted.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        wanted: usize,
    },
    /// A number is out of its range.
    #[error("{0} {1} is out of range")]
    Range(&'static str, usize),
    /// A proof is of a guarantee that is not asked for.
    #[error("a proof is about another guarantee")]
    WrongGuarantee,
    /// A proof uses a duration that the world does not decide on.
    #[error("constraint {0} is no duration that the world decides on")]
    NotObserved(usize),
    /// A proof uses a bound that is not there.
    #[error("a proof uses a bound that is not there")]
    NoLimit,
    /// A proof has no parts.
    #[error("a proof has no parts")]
    Empty,
    /// The parts of a proof do not follow each other.
    #[error("the parts of a proof do not follow each other in a circle")]
    Broken,
    /// A rule is used where it may not be.
    #[error("a proof uses a rule where it does not apply")]
    Rule,
    /// A proof has too many alternatives to be added up.
    #[error("a proof has too many alternatives")]
    TooLong,
    /// Whether a variable is stopped does not follow.
    #[error("it does not follow that variable {0} can have no more slack")]
    NotStopped(usize),
    /// It is said wrongly by how much inequalities are broken.
    #[error("the inequalities at place {0} of the reasons are not broken by what is said")]
    Over(usize),
    /// A variable is stopped never, or twice.
    #[error("variable {0} is to be stopped exactly once")]
    Stopped(usize),
    /// Ways are no tree.
    #[error("way {0} is mentioned twice, or before it is told")]
    NoTree(usize),
    /// Cases are no tree.
    #[error("case {0} is reached never or twice")]
    Tree(usize),
    /// A sum of inequalities is not what it should be.
    #[error("the inequalities of case {0} do not add up to its bound")]
    Sum(usize),
    /// A multiplier is negative.
    #[error("a multiplier in case {0} is negative")]
    Negative(usize),
    /// A case uses an inequality that does not hold in it.
    #[error("case {0} uses an inequality that does not hold in it")]
    NotThere(usize),
    /// The answer says something else than its certificate.
    #[error("the answer and its certificate differ in {0}")]
    Differs(String),
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
    let checker = Checker::new(certificate)?;
    let bound = match &certificate.reasons {
        Reasons::LeastSlack(stopped) => checker.least_slack(stopped)?,
        Reasons::Widths(cases) => checker.widths(cases)?,
    };
    let value = match &certificate.reasons {
        Reasons::LeastSlack(_) => bound.clone(),
        Reasons::Widths(_) => checker.worth(),
    };
    let is_assumed = |proof: &&Proof| matches!(proof, Proof::Assumed { .. });
    Ok(Verified {
        bound,
        value,
        proofs: certificate.proofs.len(),
        assumed: certificate.proofs.iter().filter(is_assumed).count(),
    })
}

/// The certificate with what its inequalities add up to filled in ([`Stopped::over`],
/// [`Total::bound`]), whatever it says there.
///
/// # Errors
/// When nothing can be added up. Whether the certificate proves anything is not asked.
pub fn added_up(mut certificate: Certificate) -> Result<Certificate, Flaw> {
    let checker = Checker::new(&certificate)?;
    let mut reasons = certificate.reasons.clone();
    match &mut reasons {
        Reasons::LeastSlack(stopped) => {
            for one in stopped {
                if let Some(proof) = one.proof {
                    let over = checker.over(one.variable, proof)?;
                    one.over = over.into_iter().map(Exact).collect();
                }
            }
        }
        Reasons::Widths(cases) => {
            for (index, case) in cases.iter_mut().enumerate() {
                if let Case::Sum(total) | Case::Impossible(total) = case {
                    let rows = total.of.iter().filter_map(|own| match own.source {
                        Source::Row(proof, row) => Some((proof, row)),
                        Source::Most(_) | Source::Least(_) => None,
                    });
                    let rows: Vec<(usize, usize)> = rows.collect();
                    let Total { of, bound } = total;
                    *bound = checker.sum(index, of, &rows)?.1;
                }
            }
        }
    }
    certificate.reasons = reasons;
    Ok(certificate)
}

struct Checker<'a> {
    certificate: &'a Certificate,
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
        for (index, constraint) in certificate.constraints.iter().enumerate() {
            let points = certificate.points.len();
            if constraint.from >= points || constraint.to >= points {
                return Err(Flaw::Range("constraint", index));
            }
        }
        let mut scales = Vec::new();
        let mut most = Vec::new();
        let mut worths = Vec::new();
        for (index, parameter) in certificate.parameters.iter().enumerate() {
            if !parameter.scale.is_positive() {
                return Err(Flaw::Range("the scale of parameter", index));
            }
            let below = parameter.most_below.as_ref().map(|most| &most.0);
            let above = parameter.most_above.as_ref().map(|most| &most.0);
            if parameter.weight.is_negative() {
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
    /// slack is then no less than the smallest here, so what stops those that have it here stops them
    /// there; so its next one is no less than the next one here, and so on. Boxes inside the envelope
    /// have their sub-boxes there, so it is enough that the box breaks the inequality in which the
    /// others have no more than the variable that is stopped.
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

    /// That in each case the weighted sum of widths is at most a bound: the greatest of these.
    fn widths(&self, cases: &[Case]) -> Result<Rational, Flaw> {
        let mut bound: Option<Rational> = None;
        let mut is_seen = vec![false; cases.len()];
        // Each case with the inequalities, by proof and position, that hold in it.
        let mut open: Vec<(usize, Vec<(usize, usize)>)> = vec![(0, Vec::new())];
        while let Some((index, chosen)) = open.pop() {
            let case = cases.get(index).ok_or(Flaw::NoSuch("case", index))?;
            if std::mem::replace(&mut is_seen[index], true) {
                return Err(Flaw::Tree(index));
            }
            match case {
                Case::Either { proof, cases } => {
                    let rows = self.rows.get(*proof).ok_or(Flaw::NoSuch("proof", *proof))?;
                    if rows.len() != cases.len() {
                        return Err(Flaw::Count {
                            what: "cases",
                            found: cases.len(),
                            wanted: rows.len(),
                        });
                    }
                    for (row, case) in cases.iter().enumerate() {
                        let mut chosen = chosen.clone();
                        chosen.push((*proof, row));
                        open.push((*case, chosen));
                    }
                }
                Case::Sum(total) => {
                    let (factors, sum) = self.sum(index, &total.of, &chosen)?;
                    if factors != self.worths || sum != total.bound {
                        return Err(Flaw::Sum(index));
                    }
                    bound = Some(bound.map_or(sum.clone(), |bound| bound.max(sum)));
                }
                Case::Impossible(total) => {
                    let (factors, sum) = self.sum(index, &total.of, &chosen)?;
                    let is_free = factors.iter().all(Rational::is_zero);
                    if !is_free || !sum.is_negative() || sum != total.bound {
                        return Err(Flaw::Sum(index));
                    }
                }
            }
        }
        if let Some(index) = is_seen.iter().position(|is_seen| !is_seen) {
            return Err(Flaw::Tree(index));
        }
        // With nothing possible there would be no box, not even the nominal values.
        bound.ok_or(Flaw::Sum(0))
    }

    /// The sum of inequalities, each times its multiplier.
    fn sum(
        &self,
        case: usize,
        multipliers: &[Multiplier],
        chosen: &[(usize, usize)],
    ) -> Result<(Vec<Rational>, Rational), Flaw> {
        let mut factors = vec![Rational::ZERO; self.slacks.len()];
        let mut bound = Rational::ZERO;
        for Multiplier { source, factor } in multipliers {
            if factor.is_negative() {
                return Err(Flaw::Negative(case));
            }
            match *source {
                Source::Row(proof, row) => {
                    let rows = self.rows.get(proof).ok_or(Flaw::NoSuch("proof", proof))?;
                    if rows.len() != 1 && !chosen.contains(&(proof, row)) {
                        return Err(Flaw::NotThere(case));
                    }
                    let row = rows.get(row).ok_or(Flaw::NoSuch("inequality", row))?;
                    for (sum, own) in factors.iter_mut().zip(&row.factors) {
                        *sum += own * factor;
                    }
                    bound += &row.bound * factor;
                }
                Source::Most(variable) => {
                    let most = self.most.get(variable).and_then(Option::as_ref);
                    let most = most.ok_or(Flaw::NoSuch("variable", variable))?;
                    factors[variable] += factor;
                    bound += most * factor;
                }
                Source::Least(variable) => {
                    let sum = factors.get_mut(variable);
                    *sum.ok_or(Flaw::NoSuch("variable", variable))? -= factor;
                }
            }
        }
        Ok((factors, bound))
    }
}
