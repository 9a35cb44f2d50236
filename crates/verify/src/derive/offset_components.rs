//! Times as functions of few times and parameters: [`OffsetComponents`].

use std::collections::{BTreeMap, VecDeque};

use elbowroom_num::Rational;

use super::linear::Linear;
use crate::certificate::{Certificate, Limit};

/// Times in a normal form. The constraints of a network that set the difference of two times to a number or to a
/// parameter connect its points. Each time is that of the first point of its component plus such differences. So
/// the form is right for all values of the parameters.
pub(super) struct OffsetComponents {
    /// By point.
    times: Vec<Linear>,
    /// By point: the first point of its component.
    roots: Vec<usize>,
}

impl OffsetComponents {
    /// Collects the connections of a network. The moment inside an action, which has the position
    /// after the last point, has a separate component.
    pub(super) fn new(certificate: &Certificate) -> Self {
        let count = certificate.points.len() + 1;
        let mut edges: Vec<Vec<(usize, Linear)>> = vec![Vec::new(); count];
        for constraint in &certificate.constraints {
            let difference = match (&constraint.lower, &constraint.upper) {
                (Limit::Number(lower), Limit::Number(upper)) if lower == upper => {
                    Linear::number(lower.0.clone())
                }
                (Limit::Parameter(lower), Limit::Parameter(upper)) if lower == upper => {
                    Linear::parameter(*lower)
                }
                _ => continue,
            };
            let [from, to] = [constraint.from, constraint.to];
            if from < count && to < count {
                edges[to].push((from, difference.scaled(&Rational::from(-1))));
                edges[from].push((to, difference));
            }
        }
        let mut times: Vec<Option<Linear>> = vec![None; count];
        let mut roots = vec![0; count];
        for root in 0..count {
            if times[root].is_some() {
                continue;
            }
            times[root] = Some(Linear::time(root));
            roots[root] = root;
            let mut waiting = VecDeque::from([root]);
            while let Some(point) = waiting.pop_front() {
                let Some(here) = times[point].clone() else {
                    continue;
                };
                for (next, difference) in &edges[point] {
                    if times[*next].is_none() {
                        times[*next] = Some(here.plus(difference));
                        roots[*next] = root;
                        waiting.push_back(*next);
                    }
                }
            }
        }
        Self {
            times: times.into_iter().flatten().collect(),
            roots,
        }
    }

    /// Returns the time of a point.
    pub(super) fn time(&self, point: usize) -> Linear {
        let known = self.times.get(point);
        known.cloned().unwrap_or_else(|| Linear::time(point))
    }

    /// Returns the same expression in normal form.
    pub(super) fn normalised(&self, expression: &Linear) -> Linear {
        let mut normal = Linear {
            constant: expression.constant.clone(),
            times: BTreeMap::new(),
            parameters: expression.parameters.clone(),
        };
        for (point, factor) in &expression.times {
            normal.add_scaled(&self.time(*point), factor);
        }
        normal
    }

    /// Returns the points of the component of a root.
    pub(super) fn members(&self, root: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.roots.len()).filter(move |point| self.roots[*point] == root)
    }
}
