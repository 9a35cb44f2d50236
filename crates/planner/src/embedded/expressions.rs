//! Numbers as linear expressions over the times of happenings (COLIN; Coles, Coles, Fox & Long,
//! IJCAI 2009).

use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

use super::network::NodeId;

/// `constant + Σ coefficient · time of node`, in units of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Form {
    /// In ascending order, without zeros.
    pub(crate) terms: Vec<(NodeId, Rational)>,
    pub(crate) constant: Rational,
}

/// A number that changes continuously: `base + rate · now`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct LinearFunction {
    pub(crate) base: Form,
    pub(crate) rate: Rational,
}

/// The numbers of a state that depend on times, and the demands on them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Symbolic {
    /// By fluent. These fluents have no value in `State::values`.
    pub(crate) functions: Vec<(u32, LinearFunction)>,
    /// `form comparison 0`.
    pub(crate) demands: Vec<(Form, Comparison)>,
    /// Times of the happenings in the demands from the last solution, as a starting point for the
    /// next one. They are not part of the state.
    pub(crate) times: Vec<(NodeId, Rational)>,
}

impl PartialEq for Symbolic {
    fn eq(&self, other: &Self) -> bool {
        (&self.functions, &self.demands) == (&other.functions, &other.demands)
    }
}

/// The moment of evaluation: the time, and the duration of the evaluating action.
#[derive(Clone, Debug, Default)]
pub(crate) struct Moment {
    pub(crate) time: Form,
    pub(crate) duration: Option<Form>,
}

impl Form {
    pub(crate) fn constant(constant: Rational) -> Self {
        Self {
            terms: Vec::new(),
            constant,
        }
    }

    /// Returns the time of a node.
    pub(crate) fn node(node: NodeId) -> Self {
        Self {
            terms: vec![(node, Rational::ONE)],
            constant: Rational::ZERO,
        }
    }

    pub(crate) fn as_constant(&self) -> Option<&Rational> {
        self.terms.is_empty().then_some(&self.constant)
    }

    /// Returns `self + factor · other`.
    pub(crate) fn plus(mut self, factor: &Rational, other: &Self) -> Self {
        for (node, coefficient) in &other.terms {
            let change = factor * coefficient;
            match self.terms.binary_search_by_key(node, |term| term.0) {
                Ok(found) => self.terms[found].1 += change,
                Err(place) => self.terms.insert(place, (*node, change)),
            }
        }
        self.terms.retain(|term| !term.1.is_zero());
        self.constant += factor * &other.constant;
        self
    }

    pub(crate) fn times(&self, factor: &Rational) -> Self {
        Self::default().plus(factor, self)
    }

    pub(crate) fn at(&self, times: &[Rational]) -> Rational {
        let terms = self.terms.iter();
        terms.fold(self.constant.clone(), |sum, (node, coefficient)| {
            sum + coefficient * &times[usize::from(*node)]
        })
    }
}

impl Symbolic {
    pub(crate) fn linear_function(&self, fluent: u32) -> Option<&LinearFunction> {
        let place = self
            .functions
            .binary_search_by_key(&fluent, |entry| entry.0);
        place.ok().map(|place| &self.functions[place].1)
    }

    /// Returns `true` if the fluent's value depends on times.
    pub(crate) fn is_time_dependent(&self, fluent: u32) -> bool {
        self.linear_function(fluent).is_some()
    }

    /// Demands `form comparison 0`. Of two demands that differ only in the constant, the stronger
    /// one is kept.
    pub(crate) fn demand(&mut self, form: Form, comparison: Comparison) {
        for (known, other) in &mut self.demands {
            if known.terms != form.terms {
                continue;
            }
            let constants = (&known.constant, &form.constant);
            if implies((*other, constants.0), (comparison, constants.1)) {
                return;
            }
            if implies((comparison, constants.1), (*other, constants.0)) {
                known.constant = form.constant;
                *other = comparison;
                return;
            }
        }
        self.demands.push((form, comparison));
    }

    /// Returns `true` if there are demands to satisfy.
    pub(crate) fn has_demands(&self) -> bool {
        !self.demands.is_empty()
    }

    /// Returns an estimate of the memory, in bytes.
    pub(crate) fn size(&self) -> usize {
        let term = size_of::<(NodeId, Rational)>();
        let forms = self.functions.iter().map(|(_, course)| &course.base);
        let forms = forms.chain(self.demands.iter().map(|(form, _)| form));
        let forms: usize = forms.map(|form| 80 + term * form.terms.capacity()).sum();
        forms + term * self.times.capacity()
    }
}

/// Returns `true` if a comparison of a sum with zero implies another one, given their constants.
fn implies(known: (Comparison, &Rational), other: (Comparison, &Rational)) -> bool {
    use Comparison::{AtLeast, AtMost, Greater, Less};
    let (least, most) = (known.1, other.1);
    match (known.0, other.0) {
        (same, comparison) if same == comparison && least == most => true,
        (AtLeast | Greater, AtLeast) | (Greater, Greater) => least <= most,
        (AtLeast, Greater) => least < most,
        (AtMost | Less, AtMost) | (Less, Less) => least >= most,
        (AtMost, Less) => least > most,
        _ => false,
    }
}
