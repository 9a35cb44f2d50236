//! Integration tests of the command, as a process.

mod bug_reports;
mod calendars;
mod command;
mod compare;
mod complaints;
mod executive;
mod far_limits;
mod first_hour;
mod help;
mod init;
mod interrupt;
mod judged_only;
mod kills;
mod limits;
mod mcp;
mod readme;
mod refusals;
mod replay;
mod robots;
mod rounded_plans;
mod run_ends;
mod run_planner;
mod run_process;
mod self_overlap;
mod shell;
mod shown;
#[path = "../../../../testing/skipped.rs"]
mod skipped;
mod val;
mod web;
mod world_programs;
mod wrong_inputs;
