//! `elbowroom odds`: success probability of a plan.

use std::sync::Arc;

use elbowroom::RoundingRule;
use elbowroom::answers::odds::{LatticeFinding, OddsFinding, OddsRequest, OddsSettings, odds};
use elbowroom::probability::likelihoods;

use crate::args::OddsArgs;
use crate::exit::{Answer, Exit, Failure};
use crate::input;
use crate::interrupt::Interrupt;
use crate::output::{self, Output};
use crate::terminal::stdout_layout;
use crate::time_limit::Stopwatch;

/// Computes the success probability of a plan.
pub(crate) fn run(arguments: &OddsArgs, output: &mut Output) -> Answer {
    let settings = settings(arguments)?;
    let task = Arc::new(input::task(&arguments.problem, &arguments.epsilon, output)?);
    let plan = match &arguments.plan {
        Some(path) => Some(input::time_triggered(
            &task,
            path,
            &RoundingRule::default(),
            input::FIXED_TIMES_ADVICE,
            output,
        )?),
        None => None,
    };
    let text = input::source(&arguments.likelihoods, "likelihoods")?;
    let likelihoods = read_likelihoods(&text, &task)?;
    let world = arguments.world.as_deref();
    let world = world.map(|path| input::world(path, &task)).transpose()?;
    let request = OddsRequest {
        task: &task,
        plan,
        likelihoods: &likelihoods,
        world: world.as_ref(),
        settings,
    };
    let mut watch = Stopwatch::start(&Interrupt::listen());
    let answer = odds(&request, &mut watch).map_err(|error| {
        Failure::new(
            error,
            "docs/research/probability.md lists the plans whose probability can be computed",
        )
    })?;
    let title = format!("{}: the orders of its plan", answer.problem);
    let mut refusal = None;
    let mut written = Ok(());
    if let (Some(path), OddsFinding::Odds(odds)) = (&arguments.lattice, &answer.finding) {
        match &odds.lattice {
            Some(LatticeFinding::Lattice(lattice)) => {
                written = output::write_file(path, &lattice.picture(&title).svg());
            }
            Some(LatticeFinding::Refused(why)) => refusal = Some(why.clone()),
            None => {}
        }
    }
    // The answer is printed even if the picture cannot be written.
    if arguments.json {
        output.document(&answer)?;
    } else {
        let text = answer.text(arguments.layers, stdout_layout());
        output::print(&text)?;
    }
    written?;
    if let Some(why) = refusal {
        return Err(Failure::new(
            format!("no picture was written: {why}"),
            "leave out --lattice, or give a shorter plan",
        ));
    }
    Ok(match &answer.finding {
        OddsFinding::Odds(odds) if odds.order.probability > 0.0 => Exit::Yes,
        OddsFinding::None { .. } => Exit::Limit,
        _ => Exit::No,
    })
}

fn settings(arguments: &OddsArgs) -> Result<OddsSettings, Failure> {
    let mut settings = OddsSettings {
        semantics: arguments.semantics.into(),
        takes_best_order: arguments.best,
        most_sequences: arguments.most_sequences,
        with_lattice: arguments.lattice.is_some(),
        self_overlap: arguments.self_overlap,
        samples: arguments.samples,
        seed: arguments.seed,
        ..OddsSettings::default()
    };
    if !arguments.executor.is_empty() {
        let read = arguments.executor.iter().map(|name| name.parse());
        settings.executors = read.collect::<Result<_, _>>().map_err(
            |error: elbowroom::execution::executors::UnknownExecutor| {
                Failure::new(error, "`elbowroom run --help` describes them all")
            },
        )?;
    }
    Ok(settings)
}

/// Reads likelihoods in either format.
fn read_likelihoods(
    text: &elbowroom::text::Source,
    task: &elbowroom::model::Task,
) -> Result<Arc<elbowroom::probability::Likelihoods>, Failure> {
    let read = likelihoods::read(text.clone(), task).map_err(|wrong| {
        Failure::from(wrong)
            .with_default_advice("docs/reference/formats/likelihoods.md describes likelihood files")
    })?;
    Ok(Arc::new(read))
}
