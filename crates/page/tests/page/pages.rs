//! Checks that the pages of real answers agree with the documents.

use std::path::Path;
use std::sync::Arc;

use elbowroom::answers::Exact;
use elbowroom::answers::NoObserver;
use elbowroom::answers::envelope::{EnvelopeFinding, EnvelopeRequest, envelope};
use elbowroom::answers::run::simulate;
use elbowroom::execute::{NamedText, RunInputs, RunSpec, WorldNames};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Source};
use elbowroom::report::trace::{Line, SnapshotLine, StartLine, Stored, TraceWriter, snapshot_text};
use elbowroom_page::document::{Chart, Document, Section, Table, Text, Tone};
use elbowroom_page::{PageError, document, page};
use indexmap::IndexMap;

/// Drives take longer than planned, and picking fails now and then.
const WORLD: &str = "
    format = 'elbowroom-world'
    version = 1
    [[duration]]
    action = 'drive'
    uniform = { from = 0.8, to = 1.6 }
    relative = true
    [[failure]]
    action = 'pick'
    probability = 0.3
";

fn source(name: &str) -> Source {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../cases")
        .join(name);
    Source::new(name, std::fs::read_to_string(path).expect("a case"))
}

fn read(case: &str) -> (Arc<Task>, TimeTriggeredPlan) {
    let file = |name: &str| source(&format!("{case}/{name}"));
    let problem = pddl::read_problem(&file("domain.pddl"), &file("problem.pddl"));
    let task = Task::new(problem.expect("a problem").0);
    let (plan, _) = pddl::read_plan(&file("plan.plan"), &task).expect("a plan");
    (Arc::new(task), plan)
}

fn trace(case: &str, seed: u64) -> String {
    let (task, plan) = read(case);
    let text = |name: &str| NamedText::from(&source(&format!("{case}/{name}")));
    let spec = RunSpec {
        world: (case == "delivery").then(|| WORLD.to_owned()),
        executor: "live".parse().expect("an executor"),
        has_plan: true,
        seed,
        ..RunSpec::new(text("domain.pddl"), text("problem.pddl"))
    };
    let mut lines = String::new();
    let mut sink = |line: &str| lines.push_str(line);
    let mut writer = TraceWriter::new(Arc::clone(&task), &mut sink);
    writer.header(&spec).expect("a header");
    let inputs = RunInputs::of(spec, Arc::clone(&task), &WorldNames::default()).expect("texts");
    let execution = inputs.execution(None).expect("a consistent specification");
    let execution = execution.beginning_with(plan).recorded_by(&mut writer);
    simulate(&inputs, execution, &mut NoObserver).expect("a run");
    lines
}

fn chart(document: &Document) -> &Chart {
    let found = document.sections.iter().find_map(|section| match section {
        Section::Chart(chart) => Some(chart),
        _ => None,
    });
    found.expect("a chart")
}

fn table<'a>(document: &'a Document, heading: &str) -> &'a Table {
    let found = document.sections.iter().find_map(|section| match section {
        Section::Table(table) if table.heading == heading => Some(table),
        _ => None,
    });
    found.unwrap_or_else(|| panic!("a table {heading}"))
}

fn words<'a>(document: &'a Document, text: &'a Text) -> &'a str {
    match text {
        Text::Own(text) => text,
        Text::Shared(position) => &document.texts[*position],
    }
}

#[test]
fn invalid_plan_page_names_repair_command() {
    let (task, mut plan) = read("delivery");
    let step = plan
        .steps
        .iter_mut()
        .find(|step| step.duration.is_some())
        .expect("a durative action");
    // Ten times the duration in the domain.
    step.duration = step.duration.take().map(|it| it * Rational::from(10));
    let answer = envelope(&EnvelopeRequest::new(&task, plan), &mut NoObserver);
    let json = serde_json::to_string(&answer.expect("an answer").answer).expect("JSON");
    let document = document("envelope.json", &json).expect("a document");
    assert_eq!(document.verdict.tone, Tone::Bad);
    let advice = document.sections.iter().any(|section| match section {
        Section::Prose(prose) => prose.paragraphs.iter().any(|it| it.contains("--repair")),
        _ => false,
    });
    assert!(advice);
}

#[test]
fn envelope_page_lists_actions_and_intervals() {
    for case in ["delivery", "battery", "match", "tank", "paintshop"] {
        let (task, plan) = read(case);
        let steps = plan.steps.len();
        let answer = envelope(&EnvelopeRequest::new(&task, plan), &mut NoObserver);
        let answer = answer.expect("an answer").answer;
        let json = serde_json::to_string(&answer).expect("JSON");
        let document = document("envelope.json", &json).expect("a document");
        let EnvelopeFinding::Envelope { parameters, .. } = &answer.finding else {
            panic!("{case} has an envelope");
        };
        assert_eq!(document.verdict.tone, Tone::Good);
        assert_eq!(chart(&document).bars.len(), steps, "{case}");
        let table_rows = &table(&document, "How far each quantity may deviate").rows;
        assert_eq!(table_rows.len(), parameters.len(), "{case}");
        for (row, limited) in table_rows.iter().zip(parameters) {
            assert_eq!(words(&document, &row[0]), limited.range.quantity.name);
            let cell =
                |column: usize| -> Option<Rational> { words(&document, &row[column]).parse().ok() };
            assert_eq!(cell(3).is_some(), limited.range.lower.value().is_some());
            let interval = limited.range.interval();
            for end in [cell(3), cell(4)].into_iter().flatten() {
                assert!(interval.contains(&end), "{case}: {end} is rounded outwards");
            }
            let limit = words(&document, &row[7]);
            assert_eq!(limit, limited.upper_limit.as_deref().unwrap_or_default());
        }
    }
}

#[test]
fn run_page_shows_planned_and_observed_times() {
    let (mut reached, mut failed) = (0, 0);
    for seed in 0..12 {
        let trace = trace("delivery", seed);
        let stored = Stored::read(&trace).expect("a trace");
        let Some(Line::Over(report)) = stored.lines.last() else {
            panic!("the run is over");
        };
        let document = document("run.jsonl", &trace).expect("a document");
        let chart = chart(&document);
        for done in &report.executed {
            let start = done.start.0.to_f64();
            let is_it = |bar: &&elbowroom_page::document::Bar| {
                bar.name == done.action
                    && bar
                        .actual
                        .is_some_and(|(begun, _)| begun.total_cmp(&start).is_eq())
            };
            let bar = chart.bars.iter().find(is_it).expect("a bar");
            assert_eq!(Some(bar.outcome), done.outcome.as_deref(), "seed {seed}");
            assert!(bar.planned.is_some(), "it was planned");
        }
        let decided = stored
            .lines
            .iter()
            .filter(|line| matches!(line, Line::Decided(_)));
        assert_eq!(chart.decisions.len(), decided.count());
        let is_good = report.verdict == "goal-reached";
        assert_eq!(document.verdict.tone == Tone::Good, is_good);
        reached += usize::from(is_good);
        failed += usize::from(!is_good);
        // The facts at the end are those of the final state of the run.
        let mut facts = std::collections::BTreeSet::new();
        for change in chart.changes.iter().filter(|change| change.kind == "fact") {
            let name = words(&document, &change.name).to_owned();
            match change.value {
                Some(_) => facts.insert(name),
                None => facts.remove(&name),
            };
        }
        assert_eq!(
            facts.contains("(lies parcel office)"),
            is_good,
            "seed {seed}: {facts:?}"
        );
    }
    assert!(
        reached > 0 && failed > 0,
        "{reached} reached, {failed} failed"
    );
}

#[test]
fn changing_numbers_match_validator_values() {
    let document = document("run.jsonl", &trace("battery", 0)).expect("a document");
    let series = document.sections.iter().find_map(|section| match section {
        Section::Series(series) => Some(series),
        _ => None,
    });
    let charge = series
        .expect("numbers")
        .lines
        .iter()
        .find(|line| line.name == "(charge rover)");
    let charge = charge.expect("the charge changes");
    // `elbowroom check` prints 20 for it at the end of the plan.
    let last = charge.points.last().expect("points").1;
    assert!((last - 20.0).abs() < 1e-9, "{}", charge.words);
}

#[test]
fn truncated_trace_page_reports_truncation() {
    let trace = trace("delivery", 3);
    let lines: Vec<&str> = trace.lines().collect();
    let cut = lines[..lines.len() / 2].join("\n");
    let document = document("run.jsonl", &cut).expect("a document");
    assert_eq!(document.verdict.tone, Tone::Plain);
    assert!(document.verdict.words.contains("before the run was over"));
}

#[test]
fn same_input_yields_same_bytes() {
    let trace = trace("delivery", 3);
    assert_eq!(page("run.jsonl", &trace), page("run.jsonl", &trace));
}

#[test]
fn non_document_is_rejected_with_one_sentence() {
    let refused = |text: &str| page("file", text).expect_err("no page").to_string();
    for text in [
        "",
        "hello",
        "{}",
        "[1, 2]",
        "\u{0}\u{1}",
        "{\"format\": 7}",
        "(define (domain d))",
    ] {
        let sentence = refused(text);
        assert!(
            sentence.starts_with("file has none of the formats"),
            "{text}: {sentence}"
        );
        assert!(!sentence.contains('\n'));
    }
    let other = refused("{\"format\": \"elbowroom-check\", \"version\": 1}");
    assert!(
        other.contains("a document of the format elbowroom-check"),
        "{other}"
    );
    for format in [
        "envelope",
        "plan",
        "run",
        "results",
        "perturbed-results",
        "course",
        "region",
        "trace",
    ] {
        let text = format!("{{\"format\": \"elbowroom-{format}\", \"version\": 1}}");
        let error = page("file", &text).expect_err("no page");
        assert!(
            matches!(error, PageError::Damaged { .. }),
            "{format}: {error}"
        );
    }
}

/// Page of a rotated journal: it contains actions that were running at the rotation or had ended
/// shortly before, and later reports about them.
#[test]
fn rotated_journal_page_includes_earlier_starts() {
    let exact = |number: i64| Exact(Rational::from(number));
    let start = |ticket, action: &str, began| StartLine {
        ticket,
        action: action.to_owned(),
        duration: Some(exact(10)),
        ordered: exact(began),
        started: Some(exact(began)),
        heard: None,
        completion: None,
        timed_out: None,
        in_doubt: false,
        ended: None,
        outcome: None,
        why: None,
        cancelled: None,
        warned: None,
        warned_timeout: None,
        measured_at_start: IndexMap::new(),
        measured_at_end: IndexMap::new(),
    };
    let over = StartLine {
        ended: Some(exact(99)),
        outcome: Some("failed".to_owned()),
        why: Some("the wheel slips".to_owned()),
        ..start(7, "(drive rover depot shelf)", 90)
    };
    let snapshot = SnapshotLine {
        now: exact(100),
        since: None,
        unsolvable: false,
        started: 9,
        allowance: exact(1),
        answers: 0,
        answers_since: exact(100),
        timed: 0,
        group: exact(100),
        facts: IndexMap::new(),
        numbers: IndexMap::new(),
        facts_before: IndexMap::new(),
        numbers_before: IndexMap::new(),
        doubtful_facts: Vec::new(),
        doubtful_numbers: Vec::new(),
        goals: Vec::new(),
        queued: Vec::new(),
        closed: Vec::new(),
        problem_goals: true,
        paused: true,
        replans: 0,
        refused: IndexMap::new(),
        refused_until: None,
        starts: vec![over, start(8, "(drive rover shelf office)", 95)],
        under_way: Vec::new(),
        plan: None,
    };
    let header = trace("delivery", 3);
    let header = header.lines().next().expect("a first line");
    let at = r#"{"exact":"106","decimal":106.0}"#;
    let ended = format!(
        r#"{{"event":"observed","now":{at},"observation":{{"type":"ended","ticket":8,"outcome":"succeeded","measured":{{}},"time":{at}}},"planned":{{"earliest":null,"latest":null}}}}"#
    );
    let record = format!("{header}\n{}\n{ended}\n", snapshot_text(&snapshot));
    let document = document("run.jsonl", &record).expect("a document");
    let bars: Vec<_> = chart(&document).bars.iter().collect();
    let of = |name: &str| {
        let bar = bars.iter().find(|bar| bar.name == name).expect("a bar");
        (bar.actual, bar.outcome)
    };
    let failed = of("(drive rover depot shelf)");
    assert_eq!(failed, (Some((90.0, 99.0)), "failed"));
    let succeeded = of("(drive rover shelf office)");
    assert_eq!(succeeded, (Some((95.0, 106.0)), "succeeded"));
    assert!(document.is_paused);
}
