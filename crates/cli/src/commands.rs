//! Commands, with one module each.

pub(crate) mod check;
pub(crate) mod compare;
pub(crate) mod completions;
pub(crate) mod ctl;
pub(crate) mod envelope;
pub(crate) mod export;
pub(crate) mod init;
pub(crate) mod learn;
pub(crate) mod mcp;
pub(crate) mod network;
pub(crate) mod odds;
pub(crate) mod plan;
pub(crate) mod report;
pub(crate) mod run;
pub(crate) mod serve;
pub(crate) mod stn;
mod threads;
pub(crate) mod val;
pub(crate) mod verify;
pub(crate) mod world_check;
