//! Flaws of certificates: [`Flaw`].

/// The first flaw found in a certificate.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Flaw {
    /// A reference to something that does not exist.
    #[error("there is no {0} {1}")]
    UnknownReference(&'static str, usize),
    /// A list has the wrong length.
    #[error("there are {found} {what}, but {wanted} are needed")]
    Count {
        /// Name of the elements.
        what: &'static str,
        /// Number of elements found.
        found: usize,
        /// Number of elements expected.
        wanted: usize,
    },
    /// A number is out of its range.
    #[error("{0} {1} is out of range")]
    Range(&'static str, usize),
    /// A proof is valid for another guarantee only.
    #[error("a proof is for another guarantee")]
    WrongGuarantee,
    /// A proof uses a duration that the world does not decide.
    #[error("constraint {0} is not a duration that the world decides")]
    NotObserved(usize),
    /// An observed constraint is not a duration: it leads from a point to the same point, to time
    /// zero, to the end of another observed duration, or from a point that happens only after it.
    #[error(
        "constraint {0} is observed, but is not a duration from a time point to a later one that \
         no other constraint decides"
    )]
    NoDuration(usize),
    /// The claim or the assumptions do not match the proofs.
    #[error("`proves` or `assumes` differs from the statements and assumptions of the certificate")]
    Claim,
    /// A proof uses a bound that does not exist.
    #[error("a proof uses a bound that does not exist")]
    NoLimit,
    /// A proof has no parts.
    #[error("a proof has no parts")]
    Empty,
    /// The parts of a proof do not form a cycle.
    #[error("the parts of a proof do not form a cycle")]
    NoCycle,
    /// A rule does not apply where it is used.
    #[error("a proof uses a rule where it does not apply")]
    Rule,
    /// A proof has too many alternatives to be added up.
    #[error("a proof has too many alternatives")]
    TooLong,
    /// It does not follow that a variable is limited.
    #[error("it does not follow that the slack of variable {0} is maximal")]
    NotStopped(usize),
    /// The stated violation of inequalities is wrong.
    #[error(
        "the inequalities at position {0} of the reasons are not violated by the stated values"
    )]
    Over(usize),
    /// A variable is limited never, or twice.
    #[error("variable {0} must be limited exactly once")]
    Stopped(usize),
    /// The ways do not form a tree.
    #[error("path {0} is mentioned twice, or before its definition")]
    NoTree(usize),
    /// The cases do not form a tree.
    #[error("case {0} must be reached exactly once")]
    Tree(usize),
    /// A case is split at a value where no probability jumps.
    #[error("a case is split at a value of variable {0} where no probability is discontinuous")]
    Jump(usize),
    /// A sum of inequalities does not equal the stated bound.
    #[error("the inequalities of case {0} do not add up to its bound")]
    Sum(usize),
    /// A multiplier is negative.
    #[error("a multiplier in case {0} is negative")]
    Negative(usize),
    /// A case uses an inequality that does not hold in it.
    #[error("case {0} uses an inequality that does not hold in it")]
    InequalityNotInCase(usize),
    /// A time is given for a point that the world decides, or none for a point that the executor
    /// schedules.
    #[error(
        "a time must be given for exactly the points that the executor chooses; point {0} \
         violates this"
    )]
    NotChosen(usize),
    /// A point may come before time zero, or time zero is not at 0.
    #[error("the times given for point {0} are negative for some values in the box")]
    BeforeTimeZero(usize),
    /// Times do not satisfy a constraint.
    #[error("the given times violate constraint {0} for some values in the box")]
    ConstraintViolated(usize),
    /// The schedules do not form a tree.
    #[error("schedule {0} is not reached exactly once, or splits an unbounded interval")]
    Schedules(usize),
    /// Negative edges and waits form a cycle.
    #[error("the predecessors of point {0} also come after it")]
    NegativeCycle(usize),
    /// The network is not closed: the edge or wait that two edges imply is missing.
    #[error("the network is not closed: the edge that two edges at point {0} imply is missing")]
    NotClosed(usize),
    /// A sum of inequalities is not a contradiction.
    #[error("it does not follow that condition {0} holds for all values in the box")]
    Condition(usize),
    /// The answer disagrees with its certificate.
    #[error("the answer and its certificate differ in {0}")]
    Differs(String),
    /// The answer does not match the problem and the plan.
    #[error("the answer does not belong to these files: {0}")]
    Files(String),
}
