//! Reads all of the benchmark set.
use elbowroom_pddl::{Source, read_problem};
use std::path::PathBuf;

#[test]
fn scan() {
    let root = PathBuf::from(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/data/pddl"
    ));
    let text = std::fs::read_to_string(root.join("manifest.csv")).unwrap();
    let mut read = 0;
    for line in text.lines().skip(1) {
        let f: Vec<_> = line.split(',').collect();
        let load = |p: &str| Source::from_bytes(p, &std::fs::read(root.join(p)).unwrap());
        match read_problem(&load(f[3]), &load(f[4])) {
            Ok((_, w)) => {
                read += 1;
                for w in w {
                    println!("W {} {}", f[5], w);
                }
            }
            Err(d) => {
                for d in d.errors() {
                    println!(
                        "E{} {} {}",
                        if d.is_unsupported() { "U" } else { "M" },
                        f[5],
                        d
                    );
                }
            }
        }
    }
    let text = std::fs::read_to_string(root.join("plans.csv")).unwrap();
    for line in text.lines().skip(1) {
        let f: Vec<_> = line.split(',').collect();
        let load = |p: &str| Source::from_bytes(p, &std::fs::read(root.join(p)).unwrap());
        match read_problem(&load(f[3]), &load(f[4])) {
            Ok((p, _)) => {
                let mut t = elbowroom_model::Task::new(p);
                match elbowroom_pddl::read_plan(&load(f[5]), &mut t) {
                    Ok((p, w)) => {
                        let n: usize = f[7].parse().unwrap();
                        println!("P {} {} {}", p.steps.len() == n, n, f[5]);
                        for w in w {
                            println!("PW {w}")
                        }
                        let text = elbowroom_pddl::write_plan(&t, &p);
                        let (again, _) =
                            elbowroom_pddl::read_plan(&Source::new("w", text), &mut t).unwrap();
                        let mut p = p;
                        p.steps.sort_by(|a, b| a.start.cmp(&b.start));
                        assert_eq!(again, p);
                    }
                    Err(e) => println!("PE {} {e}", f[8]),
                }
            }
            Err(_) => println!("PX {}", f[5]),
        }
    }
    println!("READ {read}");
}
