//! Subgoals of the executed plan, in the order of their times.

use std::sync::Arc;
use std::thread;

use elbowroom_plansys2::knowledge::{SubGoalsResponse, Tree};

use super::super::Input;
use super::super::command::{self, ChildLimits};
use super::super::network::RequestId;
use super::{Server, warn_on_error};

/// Order of the subgoals, and the clients that wait for it.
#[derive(Default)]
pub(super) struct Order {
    known: Option<Result<Vec<Tree>, String>>,
    /// Clients that have asked before the order was known.
    pub(super) waiting: Vec<RequestId>,
}

impl Server {
    /// Starts a process that computes the order. The result is an input.
    pub(super) fn find_order(&mut self, plan: String) {
        let Some(texts) = self.texts.clone() else {
            return;
        };
        let (number, inputs) = (self.runs, self.inputs.clone());
        let elbowroom = self.settings.elbowroom.clone();
        let patience = ChildLimits {
            within: self.settings.plan_within,
            is_over: Arc::clone(&self.is_over),
        };
        thread::spawn(move || {
            let order = command::sub_goals(&elbowroom, &texts, plan, &patience);
            // The receiver is dropped when the program ends.
            let _ = inputs.send(Input::Ordered(number, order));
        });
    }

    /// Takes the result, and answers the waiting clients.
    pub(super) fn ordered(&mut self, number: u64, order: Result<Vec<Tree>, String>) {
        let execution = self.execution.as_mut().filter(|it| it.number == number);
        let Some(execution) = execution else {
            return;
        };
        execution.order.known = Some(order);
        for who in std::mem::take(&mut execution.order.waiting) {
            self.send_order(who);
        }
    }

    /// Answers now if the order is known, and later otherwise.
    pub(super) fn send_order(&mut self, who: RequestId) {
        let Some(execution) = &mut self.execution else {
            return self.refuse_order(who, "no plan is being executed");
        };
        match execution.order.known.clone() {
            None => execution.order.waiting.push(who),
            Some(Err(why)) => self.refuse_order(who, &why),
            Some(Ok(sub_goals)) => warn_on_error(self.services.order.answer(
                who,
                SubGoalsResponse {
                    success: true,
                    sub_goals,
                    error_info: String::new(),
                },
            )),
        }
    }

    pub(super) fn refuse_order(&mut self, who: RequestId, why: &str) {
        let response = SubGoalsResponse {
            error_info: why.to_owned(),
            ..SubGoalsResponse::default()
        };
        warn_on_error(self.services.order.answer(who, response));
    }
}
