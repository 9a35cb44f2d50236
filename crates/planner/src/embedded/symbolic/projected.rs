//! Feasibility of a state's times, decided by the few happenings in its demands.
//!
//! These are starts and ends of actions whose duration can be chosen, and of continuous changes.
//! All other happenings only restrict them, and these restrictions form a network again: the
//! network of the least distances among them. Times that keep these distances extend to all other
//! happenings (the minimal network is decomposable: Dechter, Meiri & Pearl, AIJ 49, 1991), so that
//! the size of the linear program is the number of choices that are really open.
//!
//! Before that, two kinds of times are tried, for which no linear program is needed: the earliest
//! ones, and those of the state before, with the new happenings at their earliest times.

use elbowroom_model::problem::Comparison;
use elbowroom_num::simplex::{Simplex, VariableId};
use elbowroom_num::{Delta, Rational};

use super::super::expressions::Form;
use super::super::network::{Network, NodeId};
use super::super::time::{NEVER, Scale, Ticks};
use super::program::{Constraints, Limit, assert_comparison};

/// Distances of a network between some of its nodes.
struct Projected {
    /// In ascending order.
    nodes: Vec<NodeId>,
    earliest: Vec<Ticks>,
    latest: Vec<Ticks>,
    /// Minimum distance from each node to the end of the plan.
    tails: Vec<Ticks>,
    /// Earliest end of the plan.
    end: Ticks,
    /// The least distances, row by row; `-NEVER` if there is none.
    distances: Vec<Ticks>,
    scale: Scale,
}

/// Returns times of the happenings in the demands, and of `others`, that extend to times of all
/// happenings, and satisfy all demands and the limit. Returns `None` if there are none.
pub(super) fn times(
    network: &Network,
    others: &[NodeId],
    constraints: &Constraints<'_>,
) -> Option<Vec<(NodeId, Rational)>> {
    let &Constraints {
        symbolic,
        compiled,
        limit,
        ..
    } = constraints;
    let forms = symbolic.demands.iter().map(|demand| &demand.0);
    let forms = forms.chain(limit.map(|limit| &limit.spent));
    let mut nodes: Vec<NodeId> = forms
        .flat_map(|form| form.terms.iter().map(|term| term.0))
        .chain(others.iter().copied())
        .collect();
    nodes.sort_unstable();
    nodes.dedup();
    let projected = Projected::of(network, nodes, constraints);
    let is_met = |times: &[Rational]| {
        let demands = &mut symbolic.demands.iter();
        demands.all(|(form, comparison)| {
            comparison.holds(&projected.value(form, times), &Rational::ZERO)
        }) && limit.is_none_or(|limit| {
            let spent = projected.value(&limit.spent, times);
            limit.allows(&(spent + &limit.time * &projected.end_of(times)))
        })
    };
    let earliest: Vec<Rational> = projected
        .earliest
        .iter()
        .map(|&time| compiled.scale.units(time))
        .collect();
    let times = if is_met(&earliest) {
        earliest
    } else {
        let times = projected.extended(&symbolic.times);
        if is_met(&times) && projected.allows(&times) {
            times
        } else {
            projected.solve(&symbolic.demands, limit)?
        }
    };
    Some(projected.nodes.into_iter().zip(times).collect())
}

impl Projected {
    fn of(network: &Network, nodes: Vec<NodeId>, constraints: &Constraints<'_>) -> Self {
        let mut projected = Self {
            earliest: nodes.iter().map(|&node| network.earliest(node)).collect(),
            latest: Vec::with_capacity(nodes.len()),
            tails: Vec::with_capacity(nodes.len()),
            end: network.earliest_end(),
            distances: Vec::with_capacity(nodes.len() * nodes.len()),
            nodes,
            scale: constraints.compiled.scale,
        };
        for &node in &projected.nodes {
            let row = constraints.distances_from(network, node);
            projected.latest.push(network.latest_given(&row));
            let tail = row.iter().copied().max().unwrap_or(0);
            projected.tails.push(tail.max(0));
            let row = projected.nodes.iter().map(|&to| row[usize::from(to)]);
            projected.distances.extend(row);
        }
        projected
    }

    fn distance(&self, from: usize, to: usize) -> Ticks {
        self.distances[from * self.nodes.len() + to]
    }

    fn place(&self, node: NodeId) -> Option<usize> {
        self.nodes.binary_search(&node).ok()
    }

    fn value(&self, form: &Form, times: &[Rational]) -> Rational {
        let terms = form.terms.iter();
        terms.fold(form.constant.clone(), |sum, (node, coefficient)| {
            let place = self.place(*node);
            sum + place.map_or(Rational::ZERO, |place| coefficient * &times[place])
        })
    }

    /// Returns the end of all happenings.
    fn end_of(&self, times: &[Rational]) -> Rational {
        let tails = times.iter().zip(&self.tails);
        tails.fold(self.scale.units(self.end), |end, (time, &tail)| {
            end.max(time + &self.scale.units(tail))
        })
    }

    /// Returns the known times, and the earliest times of all others given these.
    fn extended(&self, known: &[(NodeId, Rational)]) -> Vec<Rational> {
        let mut times: Vec<Option<Rational>> = vec![None; self.nodes.len()];
        for (node, time) in known {
            if let Some(place) = self.place(*node) {
                times[place] = Some(time.clone());
            }
        }
        for to in 0..times.len() {
            if times[to].is_some() {
                continue;
            }
            let mut time = self.scale.units(self.earliest[to]);
            for (from, other) in times.iter().enumerate() {
                let distance = self.distance(from, to);
                if let Some(other) = other.as_ref().filter(|_| distance > -NEVER) {
                    time = time.max(other + &self.scale.units(distance));
                }
            }
            times[to] = Some(time);
        }
        times.into_iter().flatten().collect()
    }

    /// Returns `true` if the network allows these times.
    fn allows(&self, times: &[Rational]) -> bool {
        let units = |ticks| self.scale.units(ticks);
        let is_within = |(place, time): (usize, &Rational)| {
            let latest = self.latest[place];
            *time >= units(self.earliest[place]) && (latest >= NEVER || *time <= units(latest))
        };
        let count = times.len();
        times.iter().enumerate().all(is_within)
            && (0..count).all(|from| {
                (0..count).all(|to| {
                    let distance = self.distance(from, to);
                    distance <= -NEVER || times[to] >= &times[from] + &units(distance)
                })
            })
    }

    /// Returns for each node the first node at a fixed distance from it, or the node itself if
    /// there is no other one.
    fn leaders(&self) -> Vec<usize> {
        let is_fixed = |from: usize, to: usize| {
            let (there, back) = (self.distance(from, to), self.distance(to, from));
            there > -NEVER && back > -NEVER && there + back == 0
        };
        (0..self.nodes.len())
            .map(|to| {
                let mut earlier = 0..to;
                earlier.find(|&from| is_fixed(from, to)).unwrap_or(to)
            })
            .collect()
    }

    /// Returns `true` if a distance follows from two others. Among nodes without fixed distances,
    /// all implied distances can be removed at once (Muscettola, Morris & Tsamardinos, KR 1998).
    fn is_implied(&self, from: usize, to: usize, leaders: &[usize]) -> bool {
        let distance = self.distance(from, to);
        let latest = self.latest[from];
        let is_between = |middle: usize| {
            let (first, second) = (self.distance(from, middle), self.distance(middle, to));
            let is_other = middle != from && middle != to && leaders[middle] == middle;
            is_other && first > -NEVER && second > -NEVER && first + second >= distance
        };
        distance <= -NEVER
            || latest < NEVER && latest + distance <= self.earliest[to]
            || (0..leaders.len()).any(is_between)
    }

    fn solve(
        &self,
        demands: &[(Form, Comparison)],
        limit: Option<&Limit<'_>>,
    ) -> Option<Vec<Rational>> {
        let units = |ticks| self.scale.units(ticks);
        let leaders = self.leaders();
        let mut program = Simplex::new();
        let mut variables: Vec<VariableId> = Vec::with_capacity(leaders.len());
        for (place, &leader) in leaders.iter().enumerate() {
            if leader != place {
                variables.push(variables[leader]);
                continue;
            }
            let variable = program.add_variable();
            program.assert_lower(variable, Delta::from(units(self.earliest[place])), 0);
            if self.latest[place] < NEVER {
                program.assert_upper(variable, Delta::from(units(self.latest[place])), 0);
            }
            variables.push(variable);
        }
        let free = || (0..leaders.len()).filter(|&place| leaders[place] == place);
        for from in free() {
            for to in free() {
                if from != to && !self.is_implied(from, to, &leaders) {
                    let row = [
                        (variables[to], Rational::ONE),
                        (variables[from], Rational::from(-1)),
                    ];
                    let row = program.define(&row);
                    let distance = units(self.distance(from, to));
                    program.assert_lower(row, Delta::from(distance), 0);
                }
            }
        }
        // A form over the leaders: a row and a constant.
        let row_of = |form: &Form| {
            let mut leading = Form::constant(form.constant.clone());
            for (node, coefficient) in &form.terms {
                let Some(place) = self.place(*node) else {
                    continue;
                };
                let leader = leaders[place];
                let mut time = Form::node(self.nodes[leader]);
                time.constant = units(self.distance(leader, place));
                leading = leading.plus(coefficient, &time);
            }
            let row: Vec<(VariableId, Rational)> = leading
                .terms
                .iter()
                .filter_map(|(node, coefficient)| {
                    Some((variables[self.place(*node)?], coefficient.clone()))
                })
                .collect();
            (row, leading.constant)
        };
        for (form, comparison) in demands {
            let (row, constant) = row_of(form);
            assert_row(&mut program, &row, constant, *comparison)?;
        }
        if let Some(limit) = limit {
            let (mut row, constant) = row_of(&limit.spent);
            if limit.time.is_positive() {
                let end = program.add_variable();
                program.assert_lower(end, Delta::from(units(self.end)), 0);
                for place in free() {
                    let after = [(end, Rational::ONE), (variables[place], Rational::from(-1))];
                    let after = program.define(&after);
                    program.assert_lower(after, Delta::from(units(self.tails[place])), 0);
                }
                row.push((end, limit.time.clone()));
            }
            let (difference, comparison) = limit.as_demand(&constant);
            assert_row(&mut program, &row, difference, comparison)?;
        }
        program.check().ok()?;
        let model = program.model();
        let times = leaders.iter().enumerate().map(|(place, &leader)| {
            &model[variables[place].index()] + &units(self.distance(leader, place))
        });
        Some(times.collect())
    }
}

/// Asserts `row + constant comparison 0`. Returns `None` if it has no variable, and is false.
fn assert_row(
    program: &mut Simplex,
    row: &[(VariableId, Rational)],
    constant: Rational,
    comparison: Comparison,
) -> Option<()> {
    if row.is_empty() {
        return comparison.holds(&constant, &Rational::ZERO).then_some(());
    }
    assert_comparison(program, row, constant, comparison);
    Some(())
}

#[cfg(test)]
mod tests;
