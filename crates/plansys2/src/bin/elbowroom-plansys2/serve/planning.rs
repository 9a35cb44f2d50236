//! Planning requests, each answered by a process of the command.

use std::sync::Arc;
use std::thread;

use elbowroom_plansys2::interface::{Plan, PlanRequest, PlanResponse};

use super::super::Input;
use super::super::command::{self, ChildLimits, Planned};
use super::super::network::RequestId;
use super::super::services::PLANNER;
use super::{Server, warn_on_error};

/// Maximum number of concurrent planners.
const MAX_PLANNERS: usize = 4;

impl Server {
    /// Starts a planner, unless the request is rejected. The result is an input.
    pub(super) fn plan(&mut self, who: RequestId, texts: PlanRequest) {
        self.work(move |elbowroom, refused, patience| {
            let planned = refused.and_then(|()| command::plan(elbowroom, &texts, patience));
            Input::Planned(who, texts, planned)
        });
    }

    pub(super) fn validate(&mut self, who: RequestId, domain: String) {
        self.work(move |elbowroom, refused, patience| {
            Input::Validated(
                who,
                refused.and_then(|()| command::validate(elbowroom, domain, patience)),
            )
        });
    }

    fn work(
        &mut self,
        work: impl FnOnce(&str, Result<(), String>, &ChildLimits) -> Input + Send + 'static,
    ) {
        let refused = if !self.nodes[PLANNER].serves() {
            Err("the planner is not active".to_owned())
        } else if self.planning >= MAX_PLANNERS {
            Err(format!("{MAX_PLANNERS} plans are being made already"))
        } else {
            Ok(())
        };
        self.planning += 1;
        let (inputs, elbowroom) = (self.inputs.clone(), self.settings.elbowroom.clone());
        let (within, is_over) = (self.settings.plan_within, Arc::clone(&self.is_over));
        thread::spawn(move || {
            // The receiver is dropped when the program ends.
            let _ = inputs.send(work(&elbowroom, refused, &ChildLimits { within, is_over }));
        });
    }

    pub(super) fn has_planned(
        &mut self,
        who: RequestId,
        texts: PlanRequest,
        planned: Result<Planned, String>,
    ) {
        self.planning -= 1;
        let response = match planned {
            Ok(planned) => {
                let plan = planned.plan.clone();
                (self.texts, self.planned) = (Some(texts), Some(planned));
                PlanResponse {
                    success: true,
                    plan,
                    error_info: String::new(),
                }
            }
            Err(error_info) => PlanResponse {
                success: false,
                plan: Plan::default(),
                error_info,
            },
        };
        warn_on_error(self.services.plan.answer(who, response));
    }
}
