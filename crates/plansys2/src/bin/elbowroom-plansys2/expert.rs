//! Client of `PlanSys2`'s problem expert. It writes the changes of a run there, and reports the
//! changes of others to the run.

use std::collections::VecDeque;
use std::time::Duration;

use elbowroom_plansys2::interface::Empty;
use elbowroom_plansys2::knowledge::{AffectRequest, AffectResponse, StatesResponse};
use elbowroom_plansys2::{Answer, Call, CallId, ExternalChange, ProblemSync};

use super::network::{Network, RequestId, ServiceClient, reliable};
use super::{Input, warn};

/// Maximum number of pending requests. Older ones are assumed to be lost.
const MAX_OPEN: usize = 64;

/// Message of the problem expert.
pub(super) enum ExpertMessage {
    /// Its state has changed.
    Changed,
    /// Answer to that request, which may be from another client.
    States(RequestId, StatesResponse),
    /// Answer to that request, which may be from another client.
    Done(RequestId, AffectResponse),
}

/// Client of the problem expert.
pub(super) struct Expert {
    mirror: ProblemSync,
    predicates: ServiceClient<Empty>,
    functions: ServiceClient<Empty>,
    add: ServiceClient<AffectRequest>,
    remove: ServiceClient<AffectRequest>,
    define: ServiceClient<AffectRequest>,
    update: ServiceClient<AffectRequest>,
    forget: ServiceClient<AffectRequest>,
    open: VecDeque<(RequestId, CallId)>,
}

impl Expert {
    /// Joins the topics and services of the problem expert.
    ///
    /// # Errors
    /// When DDS reports an error, which the text describes.
    pub(super) fn join(network: &mut Network) -> Result<Self, String> {
        network.subscribe(
            "problem_expert/update_notify",
            "std_msgs::msg::dds_::Empty_",
            &reliable(100),
            |_: Empty| Input::Expert(ExpertMessage::Changed),
        )?;
        let states = "plansys2_msgs::srv::dds_::GetStates";
        let mut ask_states = |name: &str| {
            network.ask(&format!("problem_expert/{name}"), states, |to, it| {
                Input::Expert(ExpertMessage::States(to, it))
            })
        };
        let predicates = ask_states("get_problem_predicates")?;
        let functions = ask_states("get_problem_functions")?;
        let affect = "plansys2_msgs::srv::dds_::AffectNode";
        let mut ask_to = |name: &str| {
            network.ask(&format!("problem_expert/{name}"), affect, |to, it| {
                Input::Expert(ExpertMessage::Done(to, it))
            })
        };
        Ok(Self {
            mirror: ProblemSync::default(),
            predicates,
            functions,
            add: ask_to("add_problem_predicate")?,
            remove: ask_to("remove_problem_predicate")?,
            define: ask_to("add_problem_function")?,
            update: ask_to("update_problem_function")?,
            forget: ask_to("remove_problem_function")?,
            open: VecDeque::new(),
        })
    }

    /// Starts a run. `problem` is its text, or empty if unknown.
    pub(super) fn begin(&mut self, problem: &str) {
        self.mirror.begin(problem);
    }

    /// Ends the run. Its pending changes are still written.
    pub(super) fn end(&mut self) {
        self.mirror.end();
    }

    /// Takes the beliefs of the run.
    pub(super) fn set_beliefs(
        &mut self,
        facts: &[(String, bool)],
        values: &[(String, Option<f64>)],
    ) {
        self.mirror.set_beliefs(facts, values);
    }

    /// Returns `true` if no change is pending.
    pub(super) fn is_idle(&self) -> bool {
        self.mirror.is_idle()
    }

    pub(super) fn handle(&mut self, heard: ExpertMessage) {
        let outcome = |success, why| if success { Ok(()) } else { Err(why) };
        let (to, answer) = match heard {
            ExpertMessage::Changed => return self.mirror.on_change(),
            ExpertMessage::States(to, it) => {
                let said = outcome(it.success, it.error_info);
                (to, Answer::States(said.map(|()| it.states)))
            }
            ExpertMessage::Done(to, it) => (to, Answer::Done(outcome(it.success, it.error_info))),
        };
        let place = self.open.iter().position(|(asked, _)| asked.matches(&to));
        if let Some((_, call)) = place.and_then(|place| self.open.remove(place)) {
            self.mirror.on_answer(call, answer);
        }
    }

    /// Sends the requests that are due, and returns the changes of others. To be called a few times
    /// a second.
    pub(super) fn settle(&mut self, now: Duration) -> Vec<ExternalChange> {
        let is_there = self.predicates.is_served()
            & self.functions.is_served()
            & self.add.is_served()
            & self.remove.is_served()
            & self.define.is_served()
            & self.update.is_served()
            & self.forget.is_served();
        self.mirror.set_available(is_there);
        self.mirror.tick(now);
        for (id, call) in self.mirror.calls() {
            let to = |requests: &mut ServiceClient<AffectRequest>, node| {
                requests.send(AffectRequest { node })
            };
            let asked = match call {
                Call::Predicates => self.predicates.send(Empty::default()),
                Call::Functions => self.functions.send(Empty::default()),
                Call::Add(node) => to(&mut self.add, node),
                Call::Remove(node) => to(&mut self.remove, node),
                Call::Define(node) => to(&mut self.define, node),
                Call::Update(node) => to(&mut self.update, node),
                Call::Forget(node) => to(&mut self.forget, node),
            };
            match asked {
                Ok(asked) => self.open.push_back((asked, id)),
                // The request is repeated after its time-out.
                Err(why) => warn(&why),
            }
        }
        while self.open.len() > MAX_OPEN {
            self.open.pop_front();
        }
        for text in self.mirror.remarks() {
            warn(&text);
        }
        self.mirror.seen()
    }
}
