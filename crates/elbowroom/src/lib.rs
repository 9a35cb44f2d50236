//! Elbowroom.

mod box_text;
mod explain;
pub mod flow;
pub mod graph;
mod makespan;
mod plan_file;

pub use box_text::{BoxTextError, parse_box, write_box};
pub use elbowroom_envelope as envelope;
pub use elbowroom_model as model;
pub use elbowroom_num as num;
pub use elbowroom_pddl as pddl;
pub use elbowroom_plan as plan;
pub use elbowroom_stn as stn;
pub use explain::{Explainer, Explanation};
pub use makespan::earliest_end;
pub use plan_file::PlanKind;
