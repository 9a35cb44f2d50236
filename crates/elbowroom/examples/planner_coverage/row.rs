//! A line of the results.

/// What became of one instance with one planner. Times in seconds; empty where there is nothing to
/// say.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Row {
    pub(crate) planner: String,
    /// `collection/domain`
    pub(crate) domain: String,
    pub(crate) instance: String,
    /// `deadlines`, `numbers`, `concurrency`, joined by spaces.
    pub(crate) kinds: String,
    /// [`Outcome::name`](elbowroom::planner::external::Outcome::name).
    pub(crate) outcome: String,
    pub(crate) first_seconds: String,
    pub(crate) first_makespan: String,
    pub(crate) best_makespan: String,
    pub(crate) plans: String,
    /// Plans that the judge refused.
    pub(crate) refused: String,
    /// Whether the times of the last plan had to be repaired.
    pub(crate) repaired: String,
    pub(crate) seconds: String,
    pub(crate) megabytes: String,
    /// What else is to be said.
    pub(crate) note: String,
}

pub(crate) const HEADER: &str = "planner,domain,instance,kinds,outcome,first_seconds,\
    first_makespan,best_makespan,plans,refused,repaired,seconds,megabytes,note";

impl Row {
    /// The line, without its line break. Commas and line breaks inside become other characters.
    pub(crate) fn line(&self) -> String {
        let plain = |field: &String| -> String {
            let same = |c: char| match c {
                ',' => ';',
                c if c.is_control() => ' ',
                c => c,
            };
            field.chars().map(same).collect()
        };
        let fields = [
            &self.planner,
            &self.domain,
            &self.instance,
            &self.kinds,
            &self.outcome,
            &self.first_seconds,
            &self.first_makespan,
            &self.best_makespan,
            &self.plans,
            &self.refused,
            &self.repaired,
            &self.seconds,
            &self.megabytes,
            &self.note,
        ];
        fields.map(plain).join(",")
    }

    /// The row of a line; `None` if it is none.
    pub(crate) fn parse(line: &str) -> Option<Self> {
        let fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        let fields: [String; 14] = fields.try_into().ok()?;
        let [
            planner,
            domain,
            instance,
            kinds,
            outcome,
            first_seconds,
            first_makespan,
            best_makespan,
            plans,
            refused,
            repaired,
            seconds,
            megabytes,
            note,
        ] = fields;
        Some(Self {
            planner,
            domain,
            instance,
            kinds,
            outcome,
            first_seconds,
            first_makespan,
            best_makespan,
            plans,
            refused,
            repaired,
            seconds,
            megabytes,
            note,
        })
    }

    pub(crate) fn is_solved(&self) -> bool {
        self.outcome == "plan"
    }

    /// What makes it the same run.
    pub(crate) fn key(&self) -> (String, String, String) {
        let plain = |text: &String| text.replace(',', ";");
        (
            plain(&self.planner),
            plain(&self.domain),
            plain(&self.instance),
        )
    }
}
