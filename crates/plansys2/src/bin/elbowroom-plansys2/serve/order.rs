//! The order in which the plan that is executed reaches the parts of its goal.

use std::sync::Arc;
use std::thread;

use elbowroom_plansys2::knowledge::{SubGoalsResponse, Tree};

use super::super::Input;
use super::super::command::{self, Patience};
use super::super::network::Asker;
use super::{Serving, told};

/// What is known of it.
#[derive(Default)]
pub(super) struct Order {
    known: Option<Result<Vec<Tree>, String>>,
    /// Who has asked before it was.
    pub(super) asked: Vec<Asker>,
}

impl Serving {
    /// Has a process of the command find it; what comes of it is an input.
    pub(super) fn find_order(&mut self, plan: String) {
        let Some(texts) = self.texts.clone() else {
            return;
        };
        let (number, inputs) = (self.runs, self.inputs.clone());
        let elbowroom = self.settings.elbowroom.clone();
        let patience = Patience {
            within: self.settings.plan_within,
            is_over: Arc::clone(&self.is_over),
        };
        thread::spawn(move || {
            let order = command::sub_goals(&elbowroom, &texts, plan, &patience);
            // Whoever receives is gone when the program ends.
            let _ = inputs.send(Input::Ordered(number, order));
        });
    }

    /// It was found, or cannot be.
    pub(super) fn ordered(&mut self, number: u64, order: Result<Vec<Tree>, String>) {
        let execution = self.execution.as_mut().filter(|it| it.number == number);
        let Some(execution) = execution else {
            return;
        };
        execution.order.known = Some(order);
        for who in std::mem::take(&mut execution.order.asked) {
            self.tell_order(who);
        }
    }

    /// Answers now, or when it is known.
    pub(super) fn tell_order(&mut self, who: Asker) {
        let Some(execution) = &mut self.execution else {
            return self.refuse_order(who, "no plan is being executed");
        };
        match execution.order.known.clone() {
            None => execution.order.asked.push(who),
            Some(Err(why)) => self.refuse_order(who, &why),
            Some(Ok(sub_goals)) => told(self.services.order.answer(
                who,
                SubGoalsResponse {
                    success: true,
                    sub_goals,
                    error_info: String::new(),
                },
            )),
        }
    }

    pub(super) fn refuse_order(&mut self, who: Asker, why: &str) {
        let response = SubGoalsResponse {
            error_info: why.to_owned(),
            ..SubGoalsResponse::default()
        };
        told(self.services.order.answer(who, response));
    }
}
