//! Inequality that a proof establishes: one of some sums of bounds is not negative.

use elbowroom_num::Rational;

use crate::bounds::EndExpression;
use crate::certificate::{Certificate, Constraint, End, Guarantee, Limit, Part, Path, Proof, Sum};
use crate::flaw::Flaw;

/// Largest number of sums of one proof.
const MAX_SUMS: usize = 256;

/// Returns sums such that, in every box inside the envelope, at least one is not negative.
///
/// # Errors
/// When the proof is not valid.
pub fn sums(certificate: &Certificate, proof: &Proof) -> Result<Vec<EndExpression>, Flaw> {
    let reader = PathReader {
        certificate,
        paths: &[],
    };
    let mut sums = match proof {
        Proof::Cycle(parts) => vec![reader.cycle(parts)?],
        Proof::Fixed(parts) if certificate.guarantee == Guarantee::Strong => {
            vec![reader.fixed(parts)?]
        }
        Proof::Semireducible { ways, cycle } if certificate.guarantee != Guarantee::Weak => {
            let reader = PathReader {
                certificate,
                paths: ways,
            };
            reader.is_tree(cycle)?;
            reader.semireducible(cycle)?
        }
        Proof::Fixed(_) | Proof::Semireducible { .. } => return Err(Flaw::WrongGuarantee),
        Proof::Assumed { sums, .. } => sums.iter().map(convert_sum).collect(),
    };
    // Duplicates are removed, so that alternatives have definite positions.
    let mut each: Vec<EndExpression> = Vec::new();
    for sum in sums.drain(..) {
        if !each.contains(&sum) {
            each.push(sum);
        }
    }
    Ok(each)
}

/// Converts a sum of the certificate.
fn convert_sum(sum: &Sum) -> EndExpression {
    let mut ends = EndExpression::number(sum.constant.clone());
    for term in &sum.terms {
        let end = 2 * term.parameter + usize::from(term.end == End::Upper);
        ends.add(end, &term.factor);
    }
    ends
}

struct PathReader<'a> {
    certificate: &'a Certificate,
    /// Ways that parts of the proof refer to by position.
    paths: &'a [Path],
}

impl PathReader<'_> {
    fn path(&self, index: usize) -> Result<&Path, Flaw> {
        self.paths
            .get(index)
            .ok_or(Flaw::UnknownReference("way", index))
    }

    /// Checks that each way is mentioned once, by the cycle or by a later way.
    fn is_tree(&self, cycle: &[usize]) -> Result<(), Flaw> {
        let mut is_mentioned = vec![false; self.paths.len()];
        let inner = self.paths.iter().enumerate().flat_map(|(place, way)| {
            way.parts.iter().filter_map(move |part| match part {
                Part::Way(index) => Some((*index, place)),
                _ => None,
            })
        });
        let outer = cycle.iter().map(|&index| (index, self.paths.len()));
        for (index, place) in inner.chain(outer) {
            if index >= place || std::mem::replace(&mut is_mentioned[index], true) {
                return Err(Flaw::NoTree(index));
            }
        }
        Ok(())
    }

    fn constraint(&self, index: usize) -> Result<&Constraint, Flaw> {
        let constraint = self.certificate.constraints.get(index);
        constraint.ok_or(Flaw::UnknownReference("constraint", index))
    }

    /// Returns an observed constraint and its parameter.
    fn observed(&self, index: usize) -> Result<(&Constraint, usize), Flaw> {
        let constraint = self.constraint(index)?;
        match (&constraint.lower, &constraint.upper) {
            (Limit::Parameter(lower), Limit::Parameter(upper))
                if lower == upper && constraint.observed =>
            {
                Ok((constraint, *lower))
            }
            _ => Err(Flaw::NotObserved(index)),
        }
    }

    /// Returns the first and the last point of a part of a way.
    fn points(&self, part: &Part) -> Result<(usize, usize), Flaw> {
        Ok(match part {
            Part::Beginning(point) => (*point, 0),
            Part::Least(index) | Part::Late(index) => {
                let constraint = self.constraint(*index)?;
                (constraint.to, constraint.from)
            }
            Part::Most(index) | Part::Early(index) => {
                let constraint = self.constraint(*index)?;
                (constraint.from, constraint.to)
            }
            Part::Way(way) => self.ends_of(&self.path(*way)?.parts)?,
        })
    }

    /// Returns the first and the last point of consecutive parts.
    fn ends_of(&self, parts: &[Part]) -> Result<(usize, usize), Flaw> {
        let first = parts.first().ok_or(Flaw::Empty)?;
        let (begin, mut at) = self.points(first)?;
        for part in &parts[1..] {
            let (from, to) = self.points(part)?;
            if from != at {
                return Err(Flaw::NoCycle);
            }
            at = to;
        }
        Ok((begin, at))
    }

    /// Checks that parts form a cycle.
    fn is_cyclic(&self, parts: &[Part]) -> Result<(), Flaw> {
        let (begin, end) = self.ends_of(parts)?;
        (begin == end).then_some(()).ok_or(Flaw::NoCycle)
    }

    /// Returns the sum of a cycle at the worst values: each parameter counts with one sign in
    /// total.
    fn cycle(&self, parts: &[Part]) -> Result<EndExpression, Flaw> {
        self.is_cyclic(parts)?;
        let count = self.certificate.parameters.len();
        let mut counts = vec![0_i64; count];
        let mut constant = Rational::ZERO;
        for part in parts {
            let (limit, sign) = match part {
                Part::Beginning(_) => continue,
                Part::Least(index) => (&self.constraint(*index)?.lower, -1),
                Part::Most(index) => (&self.constraint(*index)?.upper, 1),
                Part::Early(_) | Part::Late(_) | Part::Way(_) => return Err(Flaw::Rule),
            };
            match limit {
                Limit::None => return Err(Flaw::NoLimit),
                Limit::Number(number) => constant += &number.0 * &Rational::from(sign),
                Limit::Parameter(parameter) => {
                    *counts
                        .get_mut(*parameter)
                        .ok_or(Flaw::UnknownReference("parameter", *parameter))? += sign;
                }
            }
        }
        let mut sum = EndExpression::number(constant);
        for (parameter, &count) in counts.iter().enumerate() {
            let end = match count {
                0 => continue,
                1.. => 2 * parameter,
                _ => 2 * parameter + 1,
            };
            sum.add_sum(&EndExpression::end(end, count));
        }
        Ok(sum)
    }

    /// Returns a bound that has to hold for all values of its parameter.
    fn requirement(&self, part: &Part) -> Result<EndExpression, Flaw> {
        let (index, is_most) = match part {
            Part::Beginning(_) => return Ok(EndExpression::default()),
            Part::Least(index) => (*index, false),
            Part::Most(index) => (*index, true),
            _ => return Err(Flaw::Rule),
        };
        let constraint = self.constraint(index)?;
        if constraint.observed {
            return Err(Flaw::Rule);
        }
        let (limit, sign) = if is_most {
            (&constraint.upper, 1)
        } else {
            (&constraint.lower, -1)
        };
        match limit {
            Limit::None => Err(Flaw::NoLimit),
            Limit::Number(number) => Ok(EndExpression::number(&number.0 * &Rational::from(sign))),
            // An upper bound counts with its least value, a lower bound with its greatest value.
            Limit::Parameter(parameter) if *parameter < self.certificate.parameters.len() => Ok(
                EndExpression::end(2 * parameter + usize::from(!is_most), sign),
            ),
            Limit::Parameter(parameter) => Err(Flaw::UnknownReference("parameter", *parameter)),
        }
    }

    /// Returns the latest preceding point that the executor schedules (or `point` itself), and the
    /// durations from there to `point`. Such a point exists because observed durations form no
    /// cycle ([`crate::network`]).
    fn chain(&self, point: usize) -> Result<(usize, Vec<usize>), Flaw> {
        let mut links = Vec::new();
        let mut root = point;
        loop {
            let ending = |constraint: &Constraint| constraint.observed && constraint.to == root;
            let Some(link) = self.certificate.constraints.iter().position(ending) else {
                links.reverse();
                return Ok((root, links));
            };
            links.push(link);
            root = self.constraint(link)?.from;
        }
    }

    /// Returns the sum of a cycle of bounds between points that the executor schedules. Each bound
    /// counts for the worst case of the durations between these points and the points of the bound.
    fn fixed(&self, parts: &[Part]) -> Result<EndExpression, Flaw> {
        let mut sum = EndExpression::default();
        let mut way: Option<(usize, usize)> = None;
        for part in parts {
            sum.add_sum(&self.requirement(part)?);
            let (from, to) = self.points(part)?;
            let (to_root, to_links) = self.chain(to)?;
            let (from_root, from_links) = self.chain(from)?;
            let shared = from_links
                .iter()
                .zip(&to_links)
                .take_while(|(one, other)| one == other)
                .count();
            for &link in &from_links[shared..] {
                sum.add_sum(&EndExpression::end(2 * self.observed(link)?.1, 1));
            }
            for &link in &to_links[shared..] {
                sum.add_sum(&EndExpression::end(2 * self.observed(link)?.1 + 1, -1));
            }
            way = match way {
                None => Some((from_root, to_root)),
                Some((begin, at)) if from_root == at => Some((begin, to_root)),
                Some(_) => return Err(Flaw::NoCycle),
            };
        }
        match way {
            None => Err(Flaw::Empty),
            Some((begin, end)) if begin != end => Err(Flaw::NoCycle),
            Some(_) => Ok(sum),
        }
    }

    /// Returns the sums of a semi-reducible cycle: its own, and those that have to be negative for
    /// the reduction rules to apply.
    fn semireducible(&self, cycle: &[usize]) -> Result<Vec<EndExpression>, Flaw> {
        let parts: Vec<Part> = cycle.iter().copied().map(Part::Way).collect();
        self.is_cyclic(&parts)?;
        let mut legal = Vec::new();
        let mut total = vec![EndExpression::default()];
        let mut flat = EndExpression::default();
        for &way in cycle {
            let way = self.path(way)?;
            if way.unlabelled.is_some() {
                return Err(Flaw::Rule);
            }
            let lengths = self.lengths(way, &mut legal)?;
            total = all_sums(total, &lengths)?;
            flat.add_sum(&self.flat(way)?);
        }
        if !flat.has_both_ends() {
            // With each parameter at one of its ends, the network has no schedule at all.
            return Ok(vec![flat]);
        }
        legal.extend(total);
        Ok(legal)
    }

    /// Returns the sum of all bounds of a way, with all waits in full.
    fn flat(&self, way: &Path) -> Result<EndExpression, Flaw> {
        let mut sum = EndExpression::default();
        for part in &way.parts {
            sum.add_sum(&match part {
                Part::Early(index) => EndExpression::end(2 * self.observed(*index)?.1, 1),
                Part::Late(index) => EndExpression::end(2 * self.observed(*index)?.1 + 1, -1),
                Part::Way(way) => self.flat(self.path(*way)?)?,
                requirement => self.requirement(requirement)?,
            });
        }
        Ok(sum)
    }

    /// Returns the possible lengths of a way; the greatest one counts. Adds to `legal` the sums
    /// that have to be negative for the rules to apply.
    fn lengths(
        &self,
        way: &Path,
        legal: &mut Vec<EndExpression>,
    ) -> Result<Vec<EndExpression>, Flaw> {
        self.ends_of(&way.parts)?;
        let waits_for = match way.parts.last() {
            Some(Part::Late(index)) => Some(*index),
            _ => None,
        };
        let mut lengths = vec![EndExpression::default()];
        for (place, part) in way.parts.iter().enumerate().rev() {
            let is_last = place + 1 == way.parts.len();
            let own = match part {
                // Another part must follow, and the way must not end with a wait for the same duration.
                Part::Early(index) if !is_last && Some(*index) != waits_for => {
                    legal.extend(lengths.iter().cloned());
                    vec![EndExpression::end(2 * self.observed(*index)?.1, 1)]
                }
                Part::Late(index) if is_last => {
                    vec![EndExpression::end(2 * self.observed(*index)?.1 + 1, -1)]
                }
                Part::Early(_) | Part::Late(_) => return Err(Flaw::Rule),
                Part::Way(inner) => {
                    let inner = self.path(*inner)?;
                    let ends_late = matches!(inner.parts.last(), Some(Part::Late(_)));
                    if ends_late && inner.unlabelled.is_none() {
                        return Err(Flaw::Rule);
                    }
                    self.lengths(inner, legal)?
                }
                requirement => vec![self.requirement(requirement)?],
            };
            lengths = all_sums(lengths, &own)?;
            if legal.len() > MAX_SUMS {
                return Err(Flaw::TooLong);
            }
        }
        if let Some(link) = way.unlabelled {
            if waits_for != Some(link) {
                return Err(Flaw::Rule);
            }
            lengths.push(EndExpression::end(2 * self.observed(link)?.1, -1));
        }
        Ok(lengths)
    }
}

/// Returns all sums of an element of each list.
fn all_sums(
    mut some: Vec<EndExpression>,
    others: &[EndExpression],
) -> Result<Vec<EndExpression>, Flaw> {
    if some.len() * others.len() > MAX_SUMS {
        return Err(Flaw::TooLong);
    }
    if let [other] = others {
        // This is the usual case, and a way may have thousands of parts.
        for one in &mut some {
            one.add_sum(other);
        }
        return Ok(some);
    }
    let sums = some.iter().flat_map(|one| {
        others.iter().map(move |other| {
            let mut sum = one.clone();
            sum.add_sum(other);
            sum
        })
    });
    Ok(sums.collect())
}
