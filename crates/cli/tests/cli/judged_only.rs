//! Language features that only the validator supports. Every other command refuses them by name;
//! `envelope` also supports processes and events.

use std::fs;
use std::path::PathBuf;

use crate::command::elbowroom;

/// Part of the domain, step of a plan for it, and the name in the refusal.
const FEATURES: [(&str, &str, &str); 3] = [
    (
        "(:process fills :parameters () :precondition (open) :effect (increase (level) (* #t 1)))
         (:durative-action wait :parameters () :duration (= ?duration 3) :effect (at end (seen)))",
        "(wait)",
        "processes and events (PDDL+)",
    ),
    (
        "(:event spills :parameters () :precondition (and (open) (>= (level) 5))
           :effect (not (open)))
         (:durative-action wait :parameters () :duration (= ?duration 3) :effect (at end (seen)))",
        "(wait)",
        "processes and events (PDDL+)",
    ),
    (
        "(:durative-action wait :parameters () :control (?amount - number)
           :duration (= ?duration 3) :condition (at start (<= ?amount 5))
           :effect (and (at end (seen)) (at end (increase (level) ?amount))))",
        "(wait 2)",
        "control parameters (`:control`)",
    ),
];

/// Commands with `D`, `P`, `PLAN`, `NETWORK`, `ODDS`, `WORLD` and `EXPERIMENT` for files.
const REJECTING: [&str; 19] = [
    "plan D P",
    "plan D P --time-limit 1",
    "plan D P --objective slack",
    "stn D P PLAN",
    "envelope D P PLAN",
    "envelope D P PLAN --method best",
    "envelope D P PLAN --method exact",
    "envelope D P NETWORK",
    "check D P NETWORK",
    "run D P",
    "run D P --plan PLAN",
    "run D P --plan NETWORK",
    "odds D P --likelihoods ODDS",
    "odds D P PLAN --likelihoods ODDS",
    "export smt2 D P PLAN --contains all=1%",
    "export stnu D P PLAN --contains all=1%",
    "export prism D P --likelihoods ODDS",
    "export prism D P --world WORLD",
    "compare EXPERIMENT",
];

/// Commands that support processes and events, or that do not accept a network at all.
const SUPPORTING_AUTONOMOUS: [&str; 4] = [
    "envelope D P PLAN",
    "envelope D P NETWORK",
    "check D P NETWORK",
    "run D P --plan NETWORK",
];

/// Creates a folder with the files of a domain that contains `content`.
fn folder(number: usize, (content, step, _): (&str, &str, &str)) -> PathBuf {
    let name = format!("elbowroom-{}-judged-{number}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    fs::create_dir_all(&folder).expect("a temporary folder can be made");
    let write = |name: &str, text: &str| {
        fs::write(folder.join(name), text).expect("a temporary file can be written");
    };
    let domain = format!(
        "(define (domain bath) (:requirements :fluents :durative-actions :time)
           (:predicates (open) (seen)) (:functions (level)) {content})"
    );
    write("D", &domain);
    let problem = "(define (problem evening) (:domain bath) (:init (open) (= (level) 0))
        (:goal (seen)))";
    write("P", problem);
    write("PLAN", &format!("0: {step} [3]\n"));
    write("NETWORK", "durative-action instance n0 : (wait);\n");
    write(
        "ODDS",
        "format = \"elbowroom-likelihoods\"\nversion = 1\n[defaults]\nbecomes_true = 0.0\n\
         becomes_false = 0.01\nstart = 0.7\neffect = 0.95\n",
    );
    write("WORLD", "format = \"elbowroom-world\"\nversion = 1\n");
    let planner = format!(
        "sh -c 'cat {}' {{domain}} {{problem}}",
        folder.join("PLAN").display()
    );
    write(
        "EXPERIMENT",
        &format!(
            "format = \"elbowroom-experiment\"\nversion = 1\ntitle = \"Bath\"\ndomain = \"D\"\n\
             problem = \"P\"\ntrials = 1\nexecutors = [\"guarded\"]\nplanner = \"{planner}\"\n\
             planner_time = 5\n[[column]]\nname = \"late\"\nworld = \"WORLD\"\n"
        ),
    );
    folder
}

#[test]
fn validator_only_features_are_rejected_by_name_elsewhere() {
    for (number, feature) in FEATURES.into_iter().enumerate() {
        let folder = folder(number, feature);
        let run = |command: &str| {
            let words = command.split(' ').map(|word| {
                let file = folder.join(word);
                if file.is_file() {
                    file.display().to_string()
                } else {
                    word.to_owned()
                }
            });
            let words: Vec<String> = words.collect();
            elbowroom(&words.iter().map(String::as_str).collect::<Vec<_>>())
        };
        let judged = run("check D P PLAN");
        assert_eq!(judged.status.code(), Some(0), "{judged:?}");
        let heeds_nature = feature.2.starts_with("processes");
        for command in REJECTING {
            if heeds_nature && SUPPORTING_AUTONOMOUS.contains(&command) {
                continue;
            }
            let output = run(command);
            assert_eq!(output.status.code(), Some(2), "{command}: {output:?}");
            assert!(output.stdout.is_empty(), "{command}: {output:?}");
            let said = String::from_utf8(output.stderr).expect("text");
            let (name, place) = (feature.2, &folder);
            assert!(
                said.contains(name),
                "{command} in {}: {said}",
                place.display()
            );
        }
        if heeds_nature {
            let output = run("envelope D P PLAN");
            assert_eq!(output.status.code(), Some(0), "{output:?}");
        }
        // The repair finds that no change is needed, but gives no guarantee, and states the reason.
        let repaired = run("envelope D P PLAN --repair");
        let said = String::from_utf8(repaired.stdout).expect("text");
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(said.contains("not guaranteed"), "{said}");
        assert!(said.contains(feature.2), "{said}");
        fs::remove_dir_all(&folder).expect("it is there");
    }
}

#[test]
fn compare_rejects_unsupported_features_first() {
    let folder = folder(FEATURES.len(), FEATURES[0]);
    let experiment = folder.join("EXPERIMENT").display().to_string();
    let output = elbowroom(&["compare", &experiment]);
    let said = String::from_utf8(output.stderr).expect("text");
    assert!(
        said.contains("processes and events (PDDL+), which executors do not support yet"),
        "{said}"
    );
    fs::remove_dir_all(&folder).expect("it is there");
}
