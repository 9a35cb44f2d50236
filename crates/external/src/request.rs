//! Input files of a planner, and the translation of its plans.

use std::sync::Arc;

use elbowroom_model::{Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_pddl::{ProblemText, Source, end_times, read_problem, write_problem};

/// A planning request.
#[derive(Debug)]
pub struct Request<'a> {
    /// The task. Plans refer to it, and their facts are added to its table.
    pub task: &'a Task,
    /// The initial state of the plan.
    pub situation: &'a Situation,
    /// The text of its domain.
    pub domain: &'a Source,
    /// The text of its problem.
    pub problem: &'a Source,
}

/// Decimal digits of numbers without a finite decimal, in files for other programs.
const DIGITS: u32 = 9;

/// The problem in the planner's input.
#[derive(Debug)]
pub struct Question {
    /// The text of the problem file.
    pub(super) text: String,
    /// The task in the planner's input: time 0 is now.
    pub(super) task: Task,
    /// Assumed end times of the running actions, on the request's clock.
    ends: Vec<Rational>,
}

impl Question {
    /// Returns the user's own text at the beginning of the task, and otherwise writes a new
    /// problem.
    ///
    /// # Errors
    /// If the running actions cannot be expressed in a problem file.
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
        let (problem, _) =
            read_problem(request.domain, &Source::new("situation", text.as_str()))
                .map_err(|errors| format!("its state cannot be written as a problem: {errors}"))?;
        Ok(Self {
            text,
            task: Task::new(problem).with_epsilon(epsilon.clone()),
            ends,
        })
    }

    /// Returns the text of the problem file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the task in the planner's input: time 0 is now.
    pub fn task(&self) -> &Task {
        &self.task
    }

    /// Translates a plan for the planner's task to one for the request's task: times are on its
    /// clock, and running actions continue until their assumed ends.
    ///
    /// # Errors
    /// If an action cannot be instantiated. This cannot happen, because both tasks have the same
    /// objects.
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
