//! Contents and errors of each format.

use crate::samples;
use elbowroom_network::{Duration, Format, NetworkFile, read, write_graphml, write_json};
use elbowroom_num::Rational;
use elbowroom_stn::NodeId;
use elbowroom_stn::uncertain::LinkId;

fn sample(name: &str) -> NetworkFile {
    let found = samples::ALL.iter().find(|(other, _)| *other == name);
    let (name, text) = found.expect("a sample");
    read(name, text.as_bytes()).expect("a network")
}

fn refused(name: &str, text: &str) -> String {
    match read(name, text.as_bytes()) {
        Ok(_) => panic!("read: {text}"),
        Err(mistakes) => mistakes.to_string(),
    }
}

/// Describes the network in words: requirements, then links.
fn words(file: &NetworkFile) -> String {
    let requirements = file.network.requirements();
    let mut lines: Vec<String> = requirements
        .constraint_ids()
        .map(|id| file.requirement_in_words(id))
        .collect();
    for id in file.network.link_ids() {
        lines.push(format!(
            "{}, {}",
            file.early_in_words(id),
            file.late_in_words(id)
        ));
    }
    lines.join("\n")
}

#[test]
fn heatlab_nodes_and_constraints_are_read() {
    let file = sample("one.json");
    assert_eq!(file.format, Format::Heatlab);
    assert_eq!(file.points, ["0", "1", "2", "3"]);
    insta::assert_snapshot!(words(&file), @r"
    0 not after 1
    2 at most 9000.5 after 0
    0 not after 2
    0 not after 3
    0 not after 1
    3 at most 20000 after 1
    3 at least 1 after 1
    2 may come as early as 2000 after 1, 2 may come as late as 3000 after 1
    3 may come as early as 0 after 2, 3 may come arbitrarily late after 2
    ");
    let normal = Duration::Normal {
        mean: Rational::from(4500),
        deviation: Rational::from(500),
    };
    assert_eq!(file.durations, [None, Some(normal)]);
}

#[test]
fn repeated_labels_and_correlations_are_read() {
    let file = sample("two.json");
    assert_eq!(file.points, ["start", "(drive a)_end", "(drive a)_end #2"]);
    assert_eq!(file.reference, Some(NodeId(0)));
    assert_eq!(file.correlations.len(), 1);
    assert_eq!(file.correlations[0].links, [LinkId(0), LinkId(1)]);
    // 1000000000 is that library's infinity.
    insta::assert_snapshot!(words(&file), @r"
    start not after (drive a)_end #2
    (drive a)_end may come as early as 0 after start, (drive a)_end may come arbitrarily late after start
    (drive a)_end #2 may come as early as 0 after start, (drive a)_end #2 may come arbitrarily late after start
    ");
}

#[test]
fn contingent_edges_with_and_without_labels_are_read() {
    let file = sample("three.stnu");
    assert_eq!(file.name, "kettle & cup");
    assert_eq!(file.reference, Some(NodeId(0)));
    insta::assert_snapshot!(words(&file), @r"
    X at most 5 after D
    X at least 1 after D
    C may come as early as 3 after A, C may come as late as 7 after A
    D may come as early as 1 after C, D may come as late as 2 after C
    ");
    assert_eq!(file.waits.len(), 1);
    assert_eq!(file.waits[0].delay, Some(Rational::from(7)));
}

#[test]
fn sections_of_plain_text_are_read() {
    let file = sample("four.plainstnu");
    insta::assert_snapshot!(words(&file), @r"
    C at most 12.5 after X
    C at least 7 after X
    C may come as early as 1 after A, C may come as late as 3 after A
    ");
}

#[test]
fn arcs_are_read_from_the_second_node_and_refinements_count() {
    let file = sample("five.txt");
    insta::assert_snapshot!(words(&file), @r"
    job_end at most 10 after job_start
    z not after job_start
    job_end at least 5 after job_start
    ");
}

#[test]
fn duplicate_inequalities_are_merged() {
    let file = sample("six.json");
    insta::assert_snapshot!(words(&file), @r"
    1 at most 10 after 0
    0 not after 1
    2 at least 3 after 1
    ");
}

#[test]
fn written_files_round_trip() {
    for (name, _) in samples::ALL {
        let file = sample(name);
        let text = write_json(&file);
        let mut again = read("again.json", text.as_bytes()).expect(&text);
        again.format = file.format;
        again.remarks.clone_from(&file.remarks);
        assert_eq!(again, file, "{text}");
        let text = write_graphml(&file).expect("all waits end");
        let again = read("again.stnu", text.as_bytes()).expect(&text);
        assert_eq!(again.points, file.points);
        assert_eq!(again.network, file.network, "{text}");
        assert_eq!(again.waits, file.waits);
    }
}

#[test]
fn the_dispatchable_form_is_read_back_with_its_waits() {
    let text = r#"{ "format": "elbowroom-network", "version": 1, "points": ["A", "C", "X"],
        "requirements": [{"from": "X", "to": "C", "lower": -1, "upper": 1}],
        "links": [{"activation": "A", "end": "C", "lower": 2, "upper": 5}] }"#;
    let file = read("f.json", text.as_bytes()).expect("a network");
    let form = file.network.dispatchable().expect("controllable");
    let dispatchable = file.dispatchable(&form);
    assert!(!dispatchable.waits.is_empty());
    let again = read("f.json", write_json(&dispatchable).as_bytes()).expect("what was written");
    assert_eq!(again, dispatchable);
    let graphml = write_graphml(&dispatchable).expect("all waits end");
    let again = read("f.stnu", graphml.as_bytes()).expect("what was written");
    assert_eq!(
        (again.network, again.waits),
        (dispatchable.network, dispatchable.waits)
    );
}

#[test]
fn minimal_network_contains_all_implied_bounds() {
    let text = r#"{"0": [[0, 1, 3], [1, 2, 4], [2, 0, -1]], "1": [], "2": []}"#;
    let file = read("f.json", text.as_bytes()).expect("a network");
    let minimal = file.minimal().expect("consistent");
    insta::assert_snapshot!(words(&minimal), @r"
    1 at most 3 after 0
    2 at most 7 after 0
    0 at most 3 after 1
    2 at most 4 after 1
    2 at least 1 after 0
    1 at most 2 after 2
    ");
}

#[test]
fn unsupported_formats_are_rejected_with_their_names() {
    let conditional = samples::GRAPHML.replace(">STNU<", ">CSTNU<");
    let message = refused("f.stnu", &conditional);
    assert!(
        message.starts_with("f.stnu:5:25: error: a network of the type CSTNU"),
        "{message}"
    );
    assert!(refused("f.cstn", samples::GRAPHML).contains("a conditional network (CSTN)"));
    assert!(refused("f.pstn", "").contains("a probabilistic network of the CSTNU Tool (PSTN)"));
    let observing = samples::GRAPHML.replace(
        r#"<node id="A"/>"#,
        r#"<node id="A"><data key="Obs">a</data></node>"#,
    );
    assert!(refused("f.stnu", &observing).contains("a conditional network is not supported"));
    let labelled = samples::GRAPHML.replace(
        r#"<data key="Value">5</data>"#,
        r#"<data key="LabeledValues">{(5, a)}</data>"#,
    );
    assert!(refused("f.stnu", &labelled).contains("values for several cases"));
    assert!(refused("0054", "Z=0, A=3, C(A)=7\n").contains("execution traces, not a network"));
    let kind = samples::PLAIN.replace("STNU", "DTNU");
    assert!(refused("f.txt", &kind).starts_with("f.txt:2:1: error: networks of the kind DTNU"));
}

#[test]
#[allow(
    clippy::too_many_lines,
    reason = "a list of mistakes, and what is said of them"
)]
fn mistakes_have_position_and_advice() {
    let mut messages = Vec::new();
    let mut wrong = |name: &str, text: &str, changes: &[(&str, &str)]| {
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            messages.push(refused(name, &text.replacen(from, to, 1)));
        }
    };
    wrong(
        "f.json",
        samples::HEATLAB,
        &[
            (r#""stcu""#, r#""stcx""#),
            ("N_4.5", "X_4.5"),
            ("2000,", r#""two","#),
            ("2000,", "4000,"),
            (r#""node_id": 1"#, r#""node_id": 3"#),
            (r#""second_node": 3, "min"#, r#""second_node": 7, "min"#),
            (r#""first_node": 2"#, r#""first_node": 3"#),
            ("0.0, ", "0.0; "),
        ],
    );
    wrong(
        "f.stnu",
        samples::GRAPHML,
        &[
            (">-3<", ">three<"),
            (">-3<", ">3<"),
            ("UC(D):-2", "UC(D)"),
            ("UC(C): -7", "UC(D):-7"),
            (r#"source="C" target="D""#, r#"source="X" target="D""#),
            ("</graph>", ""),
        ],
    );
    wrong(
        "f.plainstnu",
        samples::PLAIN,
        &[
            ("X 12.5", "Y 12.5"),
            ("12.5", "a"),
            ("1 3 'C'", "1 'C'"),
            ("# Ordinary Edges", "# Strange things"),
        ],
    );
    wrong(
        "f.txt",
        samples::DIMACS,
        &[("a 3 1", "a 4 1"), ("p sp 3 4", "c")],
    );
    wrong(
        "f.json",
        samples::PSTN_LIB,
        &[
            (r#""sd": 1.5"#, r#""sd": -1.5"#),
            ("0.5], [0.5", "0.5], [0.6"),
            (r#""ub": 1000000000"#, r#""ub": null"#),
        ],
    );
    wrong(
        "f.json",
        samples::INEQUALITIES,
        &[("[0, 1, 10.0]", "[0, 1]"), ("[2, 1, -3]", "[7, 1, -3]")],
    );
    wrong(
        "f.json",
        samples::ELBOWROOM,
        &[
            (r#""version": 1"#, r#""version": 2"#),
            (r#""gamma""#, r#""beta""#),
            (r#""until": "boiled""#, r#""until": "drunk""#),
            (r#""shape": 2"#, r#""shape": 0"#),
        ],
    );
    wrong(
        "f",
        "hello",
        &[("hello", ""), ("hello", "goodbye"), ("hello", "{}")],
    );
    insta::assert_snapshot!(messages.join("\n"), @r###"
    f.json:5:49: error: unknown type of constraint; expected "stc", "stcu" or "pstc"
    f.json:7:57: error: unknown distribution `X_4.5_0.5`; expected N_mean_deviation, U_from_to, E_rate_from or G_shape_(rate,from)
    f.json:5:73: error: this is not a number; write a decimal such as 12.5, a fraction such as "25/2", "inf" or "-inf"
    f.json:5:5: error: the contingent link from `1` to `2` has a lower bound above its upper bound; write the smaller number first; durations are not negative
    f.json:2:96: error: there are two time points `3`; give each a unique name
    f.json:4:38: error: there is no time point `1`; list it with the others, or correct the name
    f.json:5:20: error: there is no time point `1`; list it with the others, or correct the name
    f.json:8:20: error: there is no time point `1`; list it with the others, or correct the name
    f.json:8:38: error: there is no time point `7`; list it with the others, or correct the name
    f.json:6:5: error: the contingent link from `3` ends where it begins; a link connects two different time points
    f.json:4:75: error: expected `,` or `}`, found `;`; the file may be cut off or a comma missing
    f.stnu:9:1: error: this contingent edge has no counterpart; a contingent link consists of one edge in each direction
    f.stnu:10:88: error: this value is not a number; write a number
    f.stnu:9:1: error: this contingent edge and its counterpart do not define which node is the end; the value of the edge from the end to the beginning must be negative or 0
    f.stnu:11:1: error: this contingent edge has no counterpart; a contingent link consists of one edge in each direction
    f.stnu:12:95: error: `UC(D)` is not a labelled value; write `LC(C):4` or `UC(C):-7`, where C is the end of a contingent link
    f.stnu:15:1: error: no contingent link for this wait begins at the edge's target; `UC(C):-7` on an edge to A needs a contingent link from A to C
    f.stnu:11:1: error: this contingent edge has no counterpart; a contingent link consists of one edge in each direction
    f.stnu:12:1: error: this contingent edge has no counterpart; a contingent link consists of one edge in each direction
    f.stnu:16:1: error: expected `</graph>`, found `</graphml>`; close the innermost element first
    f.plainstnu:12:1: error: there is no time point `Y`; list it with the others, or correct the name
    f.plainstnu:12:3: error: `a` is not a number; write a decimal such as 12.5
    f.plainstnu:15:1: error: this is not a contingent link; write `A 1 3 C`: C comes 1 to 3 after A
    f.plainstnu:6:1: error: the file announces 2 ordinary edges, but contains none; the file may be cut off
    f.plainstnu:11:1: error: unknown heading; expected the kind of network, or the numbers or names of time points, ordinary edges and contingent links
    f.txt:8:1: error: there is no node 4; nodes are numbered from 1 to NODES of the line `p sp NODES ARCS`
    f.txt:1:1: error: there is no problem line; add `p sp NODES ARCS` before the arcs
    f.json:6:22: error: the deviation is negative; write it without its sign
    f.json:13:7: error: this is not one of the probabilistic constraints, or it is listed twice; list it under `constraints` with its distribution
    f.json:12:20: error: this is not a correlation matrix of these durations; expected a symmetric matrix with a row and a column for each, and 1 in its diagonal
    f.json:10:40: error: this is not a number; write a decimal such as 12.5, a fraction such as "25/2", "inf" or "-inf"
    f.json:1:8: error: this is not an inequality; write `[u, v, w]` for `v - u <= w`
    f.json:1:72: error: there is no time point `7`; list it with the others, or correct the name
    f.json:1:45: error: unsupported version of the format; expected version 1
    f.json:7:18: error: unknown distribution `beta`; expected normal, uniform, exponential or gamma
    f.json:9:13: error: this wait does not refer to the end of a contingent link; name the end of a link under `until`
    f.json:7:18: error: the numbers of this distribution are invalid; deviations and means must not be negative, shapes and scales must be positive, and from <= to
    f:1:1: error: the file is empty; give a file with a network
    f:1:1: error: unrecognised network format; expected JSON, GraphML, plain STNU text that begins with `# KIND OF NETWORK`, or DIMACS text
    f:1:1: error: this JSON is not a network of a known format; expected `nodes` and `constraints` (HEATlab), `timepoints` and `constraints` (PSTN-lib), lists of inequalities under the numbers of nodes, or `"format": "elbowroom-network"`
    "###);
}

#[test]
fn links_that_depend_on_their_own_end_are_refused() {
    let text = r#"{ "format": "elbowroom-network", "version": 1, "points": ["A", "B"],
        "requirements": [],
        "links": [{"activation": "A", "end": "B", "lower": 1, "upper": 2},
                  {"activation": "B", "end": "A", "lower": 1, "upper": 2}] }"#;
    assert!(refused("f", text).contains("depends on its own end"));
}

/// The second link is refused; later references to its end mean the first link.
#[test]
fn two_links_with_same_end_are_refused() {
    let link = "{\"source\": 0, \"sink\": 1, \"label\": \"one\", \"type\": \"pstc\",
     \"distribution\": {\"mean\": 10.0, \"sd\": 1.5}},";
    let text = samples::PSTN_LIB.replacen(link, &link.repeat(2), 1);
    assert_ne!(text, samples::PSTN_LIB);
    let said = refused("f.json", &text);
    assert!(said.contains("two contingent links end at"), "{said}");
}
