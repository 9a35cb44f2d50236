//! Digests of recorded runs: the same seed gives the same record, to the byte, in all versions.
//!
//! `ELBOWROOM_UPDATE_RECORDED=1 cargo test -p elbowroom --test elbowroom execution::` updates them after an
//! intended change of records.

use std::fs;
use std::path::Path;

/// Compares the records of runs, in the order of their seeds, with `recorded/NAME.txt`.
#[track_caller]
pub(crate) fn assert_as_recorded(name: &str, records: &[Vec<String>]) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/elbowroom/execution/recorded");
    let file = folder.join(format!("{name}.txt"));
    let digests = records.iter().enumerate();
    let digests =
        digests.map(|(seed, lines)| format!("{seed} {} {:016x}", lines.len(), digest(lines)));
    let digests: Vec<String> = digests.collect();
    if std::env::var_os("ELBOWROOM_UPDATE_RECORDED").is_some() {
        fs::create_dir_all(&folder).expect("a folder can be made");
        fs::write(&file, digests.join("\n") + "\n").expect("the file can be written");
    }
    let text = fs::read_to_string(&file).expect("the digests were written");
    let recorded: Vec<&str> = text.lines().collect();
    assert_eq!(recorded.len(), digests.len(), "{name}: number of runs");
    for (recorded, now) in recorded.iter().zip(&digests) {
        assert_eq!(recorded, now, "{name}: seed, lines, digest");
    }
}

/// Returns FNV-1a over the lines with their line ends.
fn digest(lines: &[String]) -> u64 {
    let bytes = lines.iter().flat_map(|line| line.bytes().chain([b'\n']));
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}
