//! Reads all of the benchmark set.
use elbowroom_pddl::{Source, read_problem};
use std::path::PathBuf;

#[test]
fn scan() {
    let root = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/pddl"));
    let text = std::fs::read_to_string(root.join("manifest.csv")).unwrap();
    let mut read = 0;
    for line in text.lines().skip(1) {
        let f: Vec<_> = line.split(',').collect();
        let load = |p: &str| Source::from_bytes(p, &std::fs::read(root.join(p)).unwrap());
        match read_problem(&load(f[3]), &load(f[4])) {
            Ok((_, w)) => { read += 1; for w in w { println!("W {} {}", f[5], w); } }
            Err(d) => {
                for d in d.errors() { println!("E{} {} {}", if d.is_unsupported() {"U"} else {"M"}, f[5], d); }
            }
        }
    }
    println!("READ {read}");
}
