//! What can be wrong with a certificate: [`Flaw`].

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
    /// A duration that the world decides on is none: it leads from a point to the same one, or to
    /// time zero, or to where another such duration ends, or from a point that comes about only
    /// after it.
    #[error(
        "constraint {0} is observed, but is no duration from a time point to a later one that nothing \
         else decides on"
    )]
    NoDuration(usize),
    /// It is said wrongly what is proved, or what is taken for granted.
    #[error("`proves` or `assumes` is not what the certificate proves and takes for granted")]
    Claim,
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
    #[error(
        "the inequalities at position {0} of the reasons are not violated by the stated values"
    )]
    Over(usize),
    /// A variable is stopped never, or twice.
    #[error("variable {0} is to be stopped exactly once")]
    Stopped(usize),
    /// Ways are no tree.
    #[error("path {0} is mentioned twice, or before its definition")]
    NoTree(usize),
    /// Cases are no tree.
    #[error("case {0} is reached never or twice")]
    Tree(usize),
    /// A case is split where nothing jumps.
    #[error("a case is split at a value of variable {0} at which no probability jumps")]
    Jump(usize),
    /// A sum of inequalities is not what it should be.
    #[error("the inequalities of case {0} do not add up to its bound")]
    Sum(usize),
    /// A multiplier is negative.
    #[error("a multiplier in case {0} is negative")]
    Negative(usize),
    /// A case uses an inequality that does not hold in it.
    #[error("case {0} uses an inequality that does not hold in it")]
    NotThere(usize),
    /// A time is told for a point that the world decides on, or none for another.
    #[error(
        "a time has to be given for exactly the points that the executor chooses, not so for point {0}"
    )]
    NotChosen(usize),
    /// A point may come before time zero, or time zero is not zero.
    #[error("the times given for point {0} are not at 0 or later in all of the box")]
    Early(usize),
    /// Times do not satisfy a constraint.
    #[error("the given times do not satisfy constraint {0} in all of the box")]
    Unmet(usize),
    /// Schedules are no tree.
    #[error("schedule {0} is reached never or twice, or splits an interval that has no end")]
    Schedules(usize),
    /// Negative edges and waits form a circle.
    #[error("the predecessors of point {0} also come after it")]
    Circle(usize),
    /// What two edges say together is not said beside them.
    #[error("the network is not closed: an edge is missing beside two that meet at point {0}")]
    Open(usize),
    /// A sum of inequalities contradicts nothing.
    #[error("it does not follow that condition {0} holds in all of the box")]
    Condition(usize),
    /// The answer says something else than its certificate.
    #[error("the answer and its certificate differ in {0}")]
    Differs(String),
    /// The answer is not about the problem and the plan.
    #[error("the answer is not about these files: {0}")]
    Files(String),
}
