//! All processes of a run, found in `/proc`.
//!
//! A process belongs to a run if it is in the run's process group, descends from its first process,
//! or has the run's mark in its environment. The mark finds processes that started their own
//! session and whose parents have ended. Only processes that also clear their environment are
//! missed.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::time::Duration;

use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};

/// Resource usage of a group of processes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Usage {
    /// Memory, in bytes. Shared pages count for each process.
    pub(super) memory: u64,
    /// Processor time, including that of ended children whose parents have waited for them.
    pub(super) work: Duration,
}

/// Environment variable with the mark.
pub(super) const MARK: &str = "ELBOWROOM_RUN";

/// A process: its number, and its start time, because numbers are reused.
type Identity = (i32, u64);

/// Used fields of `/proc/PID/stat`.
#[derive(Clone, Copy, Debug)]
struct Status {
    parent: i32,
    group: i32,
    start: u64,
    /// Memory in use, in pages.
    resident: u64,
    /// Processor time of its own and of the children that it has waited for, in clock ticks.
    worked: u64,
    is_dead: bool,
}

/// The processes of one run.
#[derive(Debug)]
pub(super) struct Processes {
    leader: i32,
    /// Start time of the leader; older processes do not belong to the run.
    since: Option<u64>,
    mark: String,
    page: u64,
    ticks_per_second: u64,
    members: BTreeSet<Identity>,
    unrelated: BTreeSet<Identity>,
}

impl Processes {
    /// Creates the set for the run whose first process is `leader`, and whose environment has
    /// `mark`.
    pub(super) fn of(leader: Pid, mark: &str) -> Self {
        Self {
            leader: leader.as_raw_nonzero().get(),
            since: None,
            mark: format!("{MARK}={mark}"),
            page: rustix::param::page_size() as u64,
            ticks_per_second: rustix::param::clock_ticks_per_second().max(1),
            members: BTreeSet::new(),
            unrelated: BTreeSet::new(),
        }
    }

    /// Measures the resources in use.
    pub(super) fn usage(&mut self) -> Usage {
        let (mut pages, mut ticks) = (0_u64, 0_u64);
        for (_, status) in self.find() {
            pages = pages.saturating_add(status.resident);
            ticks = ticks.saturating_add(status.worked);
        }
        Usage {
            memory: pages.saturating_mul(self.page),
            work: Duration::from_millis(ticks.saturating_mul(1000) / self.ticks_per_second),
        }
    }

    /// Kills all living members and returns their number.
    pub(super) fn kill(&mut self) -> usize {
        let found = self.find();
        for ((pid, start), _) in &found {
            kill_exactly(*pid, *start);
        }
        found.len()
    }

    /// Returns the living members.
    fn find(&mut self) -> Vec<(Identity, Status)> {
        let processes = all();
        let since = *self
            .since
            .get_or_insert_with(|| processes.get(&self.leader).map_or(0, |leader| leader.start));
        let mut found = Vec::new();
        // Children have higher numbers than their parents, unless numbers wrap around. The mark
        // finds those.
        for (&pid, &status) in &processes {
            let identity = (pid, status.start);
            if status.start < since || status.is_dead {
                continue;
            }
            let parent = processes.get(&status.parent);
            let is_child = parent.is_some_and(|p| self.members.contains(&(status.parent, p.start)));
            let is_member = pid == self.leader
                || status.group == self.leader
                || is_child
                || self.members.contains(&identity)
                || (!self.unrelated.contains(&identity) && self.is_marked(pid));
            if is_member {
                self.members.insert(identity);
                found.push((identity, status));
            } else {
                self.unrelated.insert(identity);
            }
        }
        found
    }

    fn is_marked(&self, pid: i32) -> bool {
        fs::read(format!("/proc/{pid}/environ")).is_ok_and(|environment| {
            environment
                .split(|&byte| byte == 0)
                .any(|entry| entry == self.mark.as_bytes())
        })
    }
}

/// Kills the process if it still has this start time.
fn kill_exactly(pid: i32, start: u64) {
    let Some(pid) = Pid::from_raw(pid) else {
        return;
    };
    // The descriptor refers to the same process even if its number is reused.
    let Ok(handle) = pidfd_open(pid, PidfdFlags::empty()) else {
        return;
    };
    let is_same = status(pid.as_raw_nonzero().get()).is_some_and(|s| s.start == start);
    if is_same {
        // It may have ended by itself.
        let _ = pidfd_send_signal(&handle, Signal::KILL);
    }
}

fn all() -> BTreeMap<i32, Status> {
    let Ok(entries) = fs::read_dir("/proc") else {
        return BTreeMap::new();
    };
    entries
        .flatten()
        .filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok())
        .filter_map(|pid| Some((pid, status(pid)?)))
        .collect()
}

fn status(pid: i32) -> Option<Status> {
    let text = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    parse(&text)
}

/// Parses `/proc/PID/stat`: `pid (name) state parent group …`; the name may contain anything.
fn parse(text: &str) -> Option<Status> {
    let (_, rest) = text.rsplit_once(')')?;
    let fields: Vec<&str> = rest.split_ascii_whitespace().collect();
    // proc(5) counts from 1 and the name is field 2, so field n is at n - 3.
    let field = |number: usize| fields.get(number - 3).copied();
    let worked = (14..=17).map(|number| field(number)?.parse::<u64>().ok());
    Some(Status {
        is_dead: matches!(field(3)?, "Z" | "X" | "x"),
        parent: field(4)?.parse().ok()?,
        group: field(5)?.parse().ok()?,
        start: field(22)?.parse().ok()?,
        resident: field(24)?.parse().ok()?,
        worked: worked.sum::<Option<u64>>()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn process_name_may_contain_parentheses_and_spaces() {
        let text = "7 (a) b (c) S 3 5 5 0 -1 4194304 1 0 0 0 5 6 7 8 20 0 1 0 987 1000 42 18446";
        let status = parse(text).unwrap();
        assert_eq!((status.parent, status.group), (3, 5));
        assert_eq!((status.start, status.resident), (987, 42));
        assert_eq!(status.worked, 5 + 6 + 7 + 8);
        assert!(!status.is_dead);
    }

    #[test]
    fn all_processes_include_this_one() {
        let own = i32::try_from(std::process::id()).unwrap();
        assert!(all().contains_key(&own));
    }
}
