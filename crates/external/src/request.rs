//! What a planner is asked, in files, and its answer in our terms.

use std::sync::Arc;

use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_pddl::{ProblemText, Source, end_times, read_problem, write_problem};

/// A planning request.
#[derive(Debug)]
pub struct Request<'a> {
    /// The task. Plans are given in its terms; their facts enter its table.
    pub task: &'a Task,
    /// Where to begin.
    pub situation: &'a Situation,
    /// The text of its domain.
    pub domain: &'a Source,
    /// The text of its problem.
    pub problem: &'a Source,
}

/// The number of digits of numbers without a finite decimal, in files for other programs.
const DIGITS: u32 = 9;

/// The problem as the planner gets it.
#[derive(Debug)]
pub struct Question {
    /// The text of the problem file.
    pub(super) text: String,
    /// The task that the planner sees: time 0 is now.
    pub(super) task: Task,
    /// When running actions are assumed to end, on our clock.
    ends: Vec<Rational>,
}

impl Question {
    /// The user's own text at the beginning of the task; otherwise a new one.
    ///
    /// # Errors
    /// When what is running cannot be told in a problem file.
    pub fn of(request: &Request<'_>) -> Result<Self, String> {
        if *request.situation == Situation::initial(request.task) {
            return Ok(Self {
                text: request.problem.text().to_owned(),
                task: request.task.clone(),
                ends: Vec::new(),
            });
        }
        let epsilon = request.task.epsilon();
        let ends = end_times(request.situation, epsilon).map_err(|error| error.to_string())?;
        let how = ProblemText {
            ends: ends.clone(),
            digits: Some(DIGITS),
        };
        let text = write_problem(request.task, request.situation, &how)
            .map_err(|error| error.to_string())?;
        let (problem, _) = read_problem(request.domain, &Source::new("situation", text.as_str()))
            .map_err(|errors| {
            format!("its situation cannot be written as a problem: {errors}")
        })?;
        Ok(Self {
            text,
            task: Task::new(problem).with_epsilon(epsilon.clone()),
            ends,
        })
    }

    /// The text of the problem file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The task that the planner sees: time 0 is now.
    pub fn task(&self) -> &Task {
        &self.task
    }

    /// A plan for the planner's task, as one for ours: times on our clock, and what is running
    /// goes on to its assumed end.
    ///
    /// # Errors
    /// When an action cannot be instantiated, which the two tasks having the same objects rules
    /// out.
    pub fn translate(
        &self,
        plan: &TimeTriggeredPlan,
        request: &mut Request<'_>,
    ) -> Result<TimeTriggeredPlan, String> {
        let running = request.situation.running.iter().zip(&self.ends);
        let mut steps: Vec<Step> = running
            .map(|(running, end)| running.step(end - &running.start))
            .collect();
        for step in &plan.steps {
            let action = request
                .task
                .instantiate(step.action.schema, &step.action.arguments)
                .map_err(|error| error.to_string())?;
            steps.push(Step {
                start: &step.start + &request.situation.time,
                action: Arc::new(action),
                duration: step.duration.clone(),
            });
        }
        Ok(TimeTriggeredPlan { steps })
    }
}
