//! Scratch: run IRR on one STN file.
use elbowroom_envelope::*;
use elbowroom_num::Rational;
use std::ops::ControlFlow;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let src =
        |p: &String| elbowroom_pddl::Source::from_bytes(p.clone(), &std::fs::read(p).unwrap());
    let t0 = std::time::Instant::now();
    let (problem, _w) = match elbowroom_pddl::read_problem(&src(&args[1]), &src(&args[2])) {
        Ok(x) => x,
        Err(d) => {
            eprintln!("{}", d.render(false));
            return;
        }
    };
    let mut task = elbowroom_model::Task::new(problem);
    let plan = match elbowroom_plan::format::read(&std::fs::read(&args[3]).unwrap(), &mut task) {
        Ok(p) => p,
        Err(e) => {
            println!("{e:?}");
            return;
        }
    };
    let t1 = std::time::Instant::now();
    let eps = Rational::new(1, 1000);
    let mut oracle = match Oracle::new(&task, &plan, &eps) {
        Ok(o) => o,
        Err(e) => {
            println!("refused: {e}");
            return;
        }
    };
    let t2 = std::time::Instant::now();
    let mut first = None;
    let run = irr(&mut oracle, &Settings::default(), &mut |w| {
        if w.is_some() && first.is_none() {
            first = Some(std::time::Instant::now());
        }
        ControlFlow::Continue(())
    })
    .unwrap();
    let t3 = std::time::Instant::now();
    println!(
        "read {:?} compile {:?} first {:?} irr {:?} checks {} widenings {} refutations {} params {}",
        t1 - t0,
        t2 - t1,
        first.map(|f| f - t2),
        t3 - t2,
        run.checks,
        run.widenings,
        oracle.refutations(),
        plan.parameters.len()
    );
    match &run.envelope {
        Ok(b) => {
            for (p, i) in plan.parameters.iter().zip(&b.intervals) {
                print!("{}={} ", p.name, i.to_string().replace(", ", ","));
            }
        }
        Err(Objection::NoSchedule(v)) => print!("no schedule at {v:?}"),
        Err(Objection::Broken(b)) => print!(
            "broken: {} {:?}",
            b.requirement.describe(&task, &plan.plan),
            oracle.counterexample(
                &elbowroom_plan::DecoupledEnvelope::point(&plan.nominal()),
                b
            )
        ),
    }
    println!();
}
