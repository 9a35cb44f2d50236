//! The promises of envelopes are kept without deviations, and in worlds with every duration inside
//! its interval, drawn or chosen by a spoiler.
//!
//! The tests cover our own plans, the cases, and a sample of the benchmarks if they are next to the
//! repository. `cargo run --release --example promise` covers everything.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]
#![allow(dead_code, reason = "the program uses the rest")]

#[path = "../../examples/promise/deviations.rs"]
mod deviations;
#[path = "../../examples/promise/handmade_plans.rs"]
pub(crate) mod handmade_plans;
#[path = "../../examples/promise/lateness.rs"]
mod lateness;
#[path = "../../examples/promise/planning.rs"]
mod planning;
#[path = "../../examples/promise/sources.rs"]
pub(crate) mod sources;
#[path = "../../examples/promise/subject.rs"]
mod subject;
#[path = "../../examples/promise/tally.rs"]
mod tally;
#[path = "../../examples/promise/trial.rs"]
mod trial;
#[path = "../../examples/promise/worlds.rs"]
mod worlds;

use crate::shared;
use std::collections::BTreeMap;
use std::path::Path;

use elbowroom::execution::Cause;
use elbowroom::execution::run::{Report, TimeoutRule};
use elbowroom::plan::{BoxEnd, Side};
use sources::Origin;
use subject::{Planning, Subject};
use tally::Tally;
use trial::{Ready, Search};
use worlds::Worlds;

const KEEP: [&str; 3] = ["guarded", "live", "stn"];

/// A limited search, to keep the test fast.
const SEARCH: Search<'static> = Search {
    most_checks: 60,
    may_continue: &|| true,
};

/// Returns our own plans, and those of the cases.
fn own_subjects() -> Vec<Subject> {
    let mut subjects: Vec<Subject> = handmade_plans::OWN
        .iter()
        .map(|[name, domain, problem, plan]| {
            let subject = Subject::of_texts(["own", name], [domain, problem, plan]);
            subject.unwrap_or_else(|why| panic!("{name}: {why}"))
        })
        .collect();
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases");
    let mut folders: Vec<_> = std::fs::read_dir(&cases)
        .expect("the cases")
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|folder| folder.join("plan.plan").is_file())
        .collect();
    folders.sort();
    for folder in folders {
        let file = |name: &str| std::fs::read_to_string(folder.join(name)).expect("a file");
        let name = folder.display().to_string();
        let texts = [
            &file("domain.pddl")[..],
            &file("problem.pddl"),
            &file("plan.plan"),
        ];
        let subject = Subject::of_texts(["cases", &name], texts);
        subjects.push(subject.unwrap_or_else(|why| panic!("{name}: {why}")));
    }
    subjects
}

/// Returns a few plans of each family of the benchmarks, without those of the embedded planner.
fn slice() -> Vec<Subject> {
    let Some(data) = shared::data() else {
        return Vec::new();
    };
    let how = Planning {
        cache: None,
        states: 0,
        time: None,
    };
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut sources = sources::sources(&data);
    sources.retain(|source| source.origin != Origin::Planned);
    let mut subjects = Vec::new();
    for source in &sources {
        let count = counts.entry(source.family.clone()).or_default();
        if *count >= 2 {
            continue;
        }
        if let Ok(subject) = Subject::of_source(source, &how)
            && subject.plan.steps.len() <= 30
        {
            *count += 1;
            subjects.push(subject);
        }
    }
    subjects
}

/// Returns the failures of a plan without deviations.
fn failures_as_planned(subject: &Subject) -> Vec<String> {
    let label = format!("{} {}", subject.family, subject.name);
    let ready = match Ready::new(subject, SEARCH) {
        Ok(ready) => ready,
        // Nonlinear numbers are rejected with a message, which is not a failure.
        Err(why) if why == "beyond exact analysis" => return Vec::new(),
        Err(why) => return vec![format!("{label}: {why}")],
    };
    let failed = KEEP.iter().filter_map(|executor| {
        let outcome = ready.run_as_planned(executor);
        let failure = outcome.failure?;
        Some(format!("{label}: {executor}: {failure}: {}", outcome.why))
    });
    failed.collect()
}

fn assert_kept_as_planned(subjects: &[Subject]) {
    let mut failures = Vec::new();
    for subject in subjects {
        failures.extend(failures_as_planned(subject));
        if let Some(turned) = subject.turned_round() {
            let turned = turned.expect("the same plan");
            failures.extend(failures_as_planned(&turned));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Runs each plan `runs` times in worlds inside its box.
fn assert_kept_inside(subjects: &[Subject], runs: u64) {
    let mut failures = Vec::new();
    let mut total = 0;
    for subject in subjects {
        let Ok(ready) = Ready::new(subject, SEARCH) else {
            continue;
        };
        let worlds = Worlds::new(&subject.task, &ready.open, ready.envelope());
        let mut tally = Tally::default();
        for number in 0..runs {
            tally::run(&ready, &worlds, number, &mut tally);
        }
        total += tally.runs();
        if let Some(failure) = tally.failure {
            failures.push(format!("{} {}: {failure}", subject.family, subject.name));
        }
    }
    println!("{total} runs of {} plans", subjects.len());
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn own_plans_succeed_without_deviations_for_any_line_order() {
    assert_kept_as_planned(&own_subjects());
}

#[test]
fn own_plans_succeed_inside_their_envelopes() {
    assert_kept_inside(&own_subjects(), 200);
}

#[test]
fn benchmark_sample_succeeds_without_deviations() {
    assert_kept_as_planned(&slice());
}

#[test]
fn benchmark_sample_succeeds_inside_envelopes() {
    assert_kept_inside(&slice(), 40);
}

/// Returns the plan of that name in [`handmade_plans::OWN`].
fn own_plan(name: &str) -> Subject {
    let found = handmade_plans::OWN.iter().find(|own| own[0] == name);
    let [name, domain, problem, plan] = found.expect("a plan of that name");
    Subject::of_texts(["own", name], [domain, problem, plan]).expect("a correct test")
}

/// The brooding ends before a late shot begins, which excuses the failure of the shot. It would not
/// if the start of the shot had been observed, if the brooding had not ended, if anything else had
/// failed, or if an action had been started that must wait for the shot.
#[test]
fn late_start_excuses_only_its_consequences() {
    let name = "an end that needs another end, which must not have come at the start";
    let subject = own_plan(name);
    let ready = Ready::new(&subject, SEARCH).expect("a box");
    let worlds = Worlds::new(&subject.task, &ready.open, ready.envelope());
    let excuses =
        |report: &Report, late: &str| lateness::excuses(&subject.task, &ready.open, report, late);
    let report = (0..400).find_map(|number| {
        let late = worlds.late_start(number)?;
        let report = ready.report("guarded", &mut worlds.late(&late, number));
        let is_failure = report.reasons.first()?.cause == Cause::Failed;
        (late.action == "(film)" && is_failure).then_some(report)
    });
    let report = report.expect("a start that is too late");
    assert!(excuses(&report, "(film)"), "{report:#?}");
    assert!(!excuses(&report, "(brood)"), "{report:#?}");
    let changed = |change: fn(&mut Report)| {
        let mut report = report.clone();
        change(&mut report);
        excuses(&report, "(film)")
    };
    assert!(!changed(|report| report.executed[0].ending = None));
    assert!(!changed(|report| report.reasons[0].action = None));
    assert!(!changed(
        |report| report.reasons[0].cause = Cause::GuaranteeLost
    ));
    assert!(!changed(|report| {
        let again = report.executed[0].clone();
        report.executed.push(again);
    }));
}

#[test]
fn adversary_defeats_executors_with_weak_boxes() {
    use elbowroom::envelope::Guarantee;
    use elbowroom::num::Rational;
    use elbowroom::plan::{DecoupledEnvelope, ParameterId};

    let subject = own_plan("an end that needs another end, which must not have come at the start");
    let ready = Ready::new(&subject, SEARCH).expect("a box");
    // Filming takes at least 5. If brooding takes 8 to 12, the plan is controllable, because
    // 12 - 8 is less than 5. If it takes 6 to 12, the plan is not.
    let plan = &ready.open.plan;
    let point = DecoupledEnvelope::point(&plan.nominal());
    let brood = BoxEnd {
        parameter: ParameterId::from(0),
        side: Side::Lower,
    };
    let wide = |lower: i64, upper: i64| {
        let envelope = brood.with_reach(&point, Some(Rational::from(-lower)));
        let later = BoxEnd {
            side: Side::Upper,
            ..brood
        };
        later.with_reach(&envelope, Some(Rational::from(upper)))
    };
    let kept = wide(8, 12);
    let broken = wide(6, 12);
    let plan = std::sync::Arc::new(plan.clone());
    let mut oracle = elbowroom::envelope::Oracle::new(&subject.task, &plan, Guarantee::Dynamic)
        .expect("within reach");
    assert_eq!(oracle.objection(&kept), Ok(None));
    assert!(matches!(
        oracle.objection(&broken),
        Ok(Some(elbowroom::envelope::Objection::Uncontrollable(_)))
    ));
    for (envelope, is_won) in [(kept, true), (broken, false)] {
        let worlds = Worlds::new(&subject.task, &ready.open, &envelope);
        let mut prepared = ready.open.clone();
        prepared.envelope = Some(envelope.clone());
        let nominal = ready.with_open(prepared);
        for executor in ["guarded", "live", "stn", "fixed:60", "esterel"] {
            // In the controllable box, only executors with a promise must succeed.
            if is_won && !["guarded", "live"].contains(&executor) {
                continue;
            }
            let mut world = worlds.spoiled(&TimeoutRule::Off).expect("a network");
            let outcome = nominal.run(executor, &mut world);
            assert_eq!(
                outcome.failure.is_none(),
                is_won,
                "{executor} in {envelope:?}: {outcome:?}"
            );
        }
    }
}
