//! Journals on disks that are full, fill up, or cannot be written.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use super::command::root;
use super::skipped::skipped;
use super::{awaited, beginning, folder, judge, lines, python_is_there, started};

/// What was on the disk before the disk was full can be gone on with; nothing else was started.
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

/// A limit on the size of files stands for a disk that fills up while the run is under way.
#[test]
fn when_the_disk_is_full_the_run_ends_in_order_and_can_go_on() {
    if !python_is_there() {
        return;
    }
    let folder = folder("fills");
    let journal = folder.join("journal").display().to_string();
    let program = env!("CARGO_BIN_EXE_elbowroom");
    // In the shell's units, so that the first record fits and not all of them do. The signal that
    // would end the program is ignored, and writing fails.
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
    assert!(text.contains("the run was ended in order"), "{text}");
    let begun = lines(&folder, "begun").len();
    assert!((1..6).contains(&begun), "in the middle: {begun} begun");
    let resume = ["run".to_owned(), "--resume".to_owned(), journal];
    let output = awaited(started(&resume), "after the disk was full");
    judge(&folder, &output, "after the disk was full");
    fs::remove_dir_all(&folder).expect("the folder is there");
}

/// A file system that cannot be written is said so before anything is started.
#[test]
fn a_journal_on_a_disk_that_is_read_only_starts_nothing() {
    // Nobody makes files there, not even root.
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

/// A disk of a few pages fills up and grows again. As root, in name spaces of their own.
#[test]
fn a_run_goes_on_from_a_small_disk_that_was_full_when_there_is_room_again() {
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
    // The mount is gone with the last process of its name space: both runs are in one.
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
    assert!(first.contains("the run was ended in order"), "{first}");
    let half = lines(&folder, "half").len();
    assert!((1..6).contains(&half), "in the middle: {half} begun");
    judge(&folder, &output, "with room again");
    fs::remove_dir_all(&folder).expect("the folder is there");
}
