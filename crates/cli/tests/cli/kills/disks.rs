//! Journals on disks that are full, fill up, or cannot be written.

use std::fs;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;

use super::{awaited, beginning, check_outcome, folder, lines, python_is_there, started};
use crate::command::root;
use crate::skipped::skipped;

/// A run can be resumed from the records written before the disk was full. Nothing was started
/// without a record.
#[test]
fn a_journal_that_cannot_be_written_starts_nothing() {
    if !Path::new("/dev/full").exists() {
        skipped("there is no /dev/full");
        return;
    }
    let folder = folder("full");
    let output = started(&beginning(&folder, "/dev/full", false))
        .wait_with_output()
        .expect("its output");
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(
        text.contains("cannot write the journal /dev/full"),
        "{text}"
    );
    assert!(text.contains("nothing was started"), "{text}");
    assert!(lines(&folder, "begun").is_empty());
    fs::remove_dir_all(&folder).expect("the folder is there");
}

/// A limit on the file size simulates a disk that fills up during the run.
#[test]
fn full_disk_ends_the_run_in_resumable_state() {
    if !python_is_there() {
        return;
    }
    let folder = folder("fills");
    let journal = folder.join("journal").display().to_string();
    let program = env!("CARGO_BIN_EXE_elbowroom");
    // In the shell's units, so that the first record fits and the rest does not. The signal that
    // would end the program is ignored, so that writing fails.
    let line = beginning(&folder, &journal, false)
        .iter()
        .map(|word| format!("'{word}'"))
        .collect::<Vec<_>>();
    let script = format!(
        "trap '' XFSZ; ulimit -f 8; exec '{program}' {}",
        line.join(" ")
    );
    let output = Command::new("bash")
        .args(["-c", &script])
        .current_dir(root())
        .output();
    let Ok(output) = output else {
        skipped("there is no bash");
        return;
    };
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(text.contains("the run was shut down"), "{text}");
    let begun = lines(&folder, "begun").len();
    assert!((1..6).contains(&begun), "in the middle: {begun} begun");
    let resume = ["run".to_owned(), "--resume".to_owned(), journal];
    let output = awaited(started(&resume), "after the disk was full");
    check_outcome(&folder, &output, "after the disk was full");
    fs::remove_dir_all(&folder).expect("the folder is there");
}

/// A read-only file system is reported before anything is started.
#[test]
fn a_journal_on_a_disk_that_is_read_only_starts_nothing() {
    // No user can create files there, not even root.
    let journal = "/proc/self/journal";
    if !Path::new("/proc/self").exists() {
        skipped("there is no /proc");
        return;
    }
    let folder = folder("read-only");
    let output = started(&beginning(&folder, journal, false))
        .wait_with_output()
        .expect("its output");
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(
        text.contains("cannot write the journal /proc/self/journal") && text.contains("help:"),
        "{text}"
    );
    assert!(lines(&folder, "begun").is_empty());
    fs::remove_dir_all(&folder).expect("the folder is there");
}

/// A disk of a few pages fills up and is enlarged. Needs root, and uses its own name spaces.
#[test]
fn run_resumes_after_space_is_freed() {
    let can_mount = Command::new("unshare").args(["-m", "true"]).output();
    if !python_is_there() || !can_mount.is_ok_and(|it| it.status.success()) {
        skipped("no disk can be mounted: that takes root");
        return;
    }
    let folder = folder("small");
    let disk = folder.join("disk");
    fs::create_dir(&disk).expect("a folder can be made");
    let journal = disk.join("journal").display().to_string();
    let program = env!("CARGO_BIN_EXE_elbowroom");
    let words = beginning(&folder, &journal, false);
    let words: Vec<_> = words.iter().map(|word| format!("'{word}'")).collect();
    // The mount disappears with the last process of its name space, so both runs share one.
    let script = format!(
        "mount -t tmpfs -o size=8k tmpfs '{disk}' || exit 77
         '{program}' {words} 2> '{folder}/first'; echo $? > '{folder}/code'; cp '{folder}/begun' '{folder}/half'
         mount -o remount,size=4m '{disk}' || exit 77
         exec '{program}' run --resume '{journal}'",
        disk = disk.display(),
        folder = folder.display(),
        words = words.join(" "),
    );
    let child = Command::new("unshare")
        .args(["-m", "sh", "-c", &script])
        .current_dir(root())
        .env("NO_COLOR", "1")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("unshare was there");
    let output = awaited(child, "on the small disk");
    if output.status.code() == Some(77) {
        skipped("no disk can be mounted: that takes root");
        return;
    }
    let first = lines(&folder, "first").join(" ");
    assert_eq!(lines(&folder, "code"), ["2"], "{first}");
    assert!(first.contains("the run was shut down"), "{first}");
    let half = lines(&folder, "half").len();
    assert!((1..6).contains(&half), "in the middle: {half} begun");
    check_outcome(&folder, &output, "with room again");
    fs::remove_dir_all(&folder).expect("the folder is there");
}

/// Slow disk: each record that must be synced waits until this test releases it. Until then no
/// command is sent.
#[test]
fn slow_disk_delays_commands_until_they_are_stored() {
    if !python_is_there() {
        return;
    }
    let folder = folder("slow");
    let Some(shim) = compiled(&folder) else {
        return;
    };
    let journal = folder.join("journal").display().to_string();
    let [asked, go] = ["asked", "go"].map(|name| pipe(&folder.join(name)));
    let mut child = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .current_dir(root())
        .args(beginning(&folder, &journal, false))
        .env("LD_PRELOAD", &shim)
        .env("ASKED", folder.join("asked"))
        .env("GO", folder.join("go"))
        // Uneven durations, so that one action starts while another one is running.
        .env("UNEVEN", "1")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command can be started");
    let (syncs, heard) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let mut asked = asked;
        let mut byte = [0];
        while asked.read_exact(&mut byte).is_ok() && syncs.send(()).is_ok() {}
    });
    let (mut released, mut held_for_long) = (0, 0);
    while child.try_wait().expect("it can be asked").is_none() {
        if heard.recv_timeout(Duration::from_millis(50)).is_err() {
            continue;
        }
        // The executive waits for the sync and can send nothing. The starts that the robot has
        // received by now must be on the disk.
        let told = commanded_starts(&journal);
        // All starts of one decision are synced together.
        let (before, held) = told.split_at(released);
        if held.is_empty() {
            // The record is a cancel. Late actions may be cancelled.
            (&go).write_all(b"g").expect("it waits for that");
            continue;
        }
        let done = lines(&folder, "done").len();
        if done < before.len() {
            // This sync is held until one of the running actions has ended.
            held_for_long += 1;
            while lines(&folder, "done").len() == done {
                assert!(
                    child.try_wait().expect("it can be asked").is_none(),
                    "it waits"
                );
                std::thread::sleep(Duration::from_millis(10));
            }
        }
        let begun = lines(&folder, "begun");
        assert!(
            begun.iter().all(|it| before.contains(it)),
            "told too early, while {held:?} waits: {begun:?}, {before:?}"
        );
        released = told.len();
        (&go).write_all(b"g").expect("it waits for that");
    }
    let output = child.wait_with_output().expect("its output");
    check_outcome(&folder, &output, "on the slow disk");
    assert!(released >= 6, "{released} starts were held");
    assert!(
        held_for_long > 0,
        "none was held until something else had ended"
    );
    fs::remove_dir_all(&folder).expect("the folder is there");
}

/// Compiles the library that slows down syncs. Returns `None`, and reports the test as skipped, if
/// it cannot be compiled.
fn compiled(folder: &Path) -> Option<PathBuf> {
    let shim = folder.join("slow_sync.so");
    let source = root().join("crates/cli/tests/files/slow_sync.c");
    let made = Command::new("cc")
        .args(["-shared", "-fPIC", "-o"])
        .args([&shim, &source])
        .output();
    if !cfg!(all(target_os = "linux", target_env = "gnu"))
        || !made.is_ok_and(|it| it.status.success())
    {
        skipped("no disk can be made slow: that takes a C compiler and Linux's C library");
        return None;
    }
    Some(shim)
}

/// Creates a named pipe, opened for reading and writing so that opening does not block.
fn pipe(path: &Path) -> fs::File {
    let made = Command::new("mkfifo").arg(path).status();
    assert!(made.is_ok_and(|it| it.success()), "{}", path.display());
    let mut options = fs::OpenOptions::new();
    options.read(true).write(true);
    options.open(path).expect("it was made")
}

/// Returns the starts in the journal, in the format of the robot's records.
fn commanded_starts(journal: &str) -> Vec<String> {
    let text = fs::read_to_string(journal).expect("there is a journal");
    let records = text.lines().filter_map(|line| {
        let (_, record) = line.split_once(' ')?;
        serde_json::from_str::<Value>(record).ok()
    });
    let starts = records.filter(|it| it["event"] == "command" && it["command"]["type"] == "start");
    let commands = starts.map(|it| it["command"].clone());
    let written = |it: Value| format!("{} {}", it["ticket"], it["action"].as_str().unwrap_or("?"));
    commands.map(written).collect()
}
