//! Runs shown elsewhere: exports for other viewers, and live pages. The live page itself is tested
//! in `crates/page/tests/browser/live.cjs`.

use std::fs;

use crate::command::{elbowroom, root};

const DELIVERY: [&str; 2] = ["cases/delivery/domain.pddl", "cases/delivery/problem.pddl"];

#[test]
fn viewer_files_of_run_match_report_of_its_trace() {
    let folder = root().join("target/tmp/shown");
    fs::create_dir_all(&folder).expect("a folder");
    let file = |name: &str| folder.join(name).display().to_string();
    let [trace, pf, mcap, other_pf, other_mcap] =
        ["t.jsonl", "a.pf", "a.mcap", "b.pf", "b.mcap"].map(file);
    let views = ["--perfetto", &pf, "--mcap", &mcap, "--trace", &trace];
    let done = elbowroom(&[&["run"], &DELIVERY[..], &views[..]].concat());
    assert!(done.status.success(), "{done:?}");
    let views = ["--perfetto", &other_pf, "--mcap", &other_mcap];
    let done = elbowroom(&[&["report", &trace], &views[..]].concat());
    assert!(done.status.success(), "{done:?}");
    for (one, other) in [(pf, other_pf), (mcap, other_mcap)] {
        let [one, other] = [one, other].map(|it| fs::read(it).expect("written"));
        assert!(one.len() > 1000);
        assert_eq!(one, other);
    }
}

#[test]
fn unwritable_viewer_file_is_reported_before_the_run() {
    let nowhere = "/nowhere/at/all";
    let tests: [(&[&str], &str); 5] = [
        (&["--perfetto", nowhere], "cannot write /nowhere/at/all"),
        (&["--realtime", "1", "--serve=east"], "expected an address"),
        (
            &["--realtime", "1", "--serve", "--token", nowhere],
            "cannot read the token",
        ),
        // The former name of the option.
        (
            &["--realtime", "1", "--serve", "--control", nowhere],
            "cannot read the token",
        ),
        (&["--serve"], "--realtime"),
    ];
    for (options, message) in tests {
        let done = elbowroom(&[&["run"], &DELIVERY[..], options].concat());
        let said = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(2), "{options:?}: {said}");
        assert!(said.contains(message), "{options:?}: {said}");
        assert!(done.stdout.is_empty(), "{options:?}");
    }
}
