//! The process on a clock that is divided into cells: see [`timed`].

mod modules;

use std::fmt::Write as _;

use elbowroom_mdp::process::{ActionModel, Event, Facts, Needs, TimedWorld};
use elbowroom_mdp::{CellProbabilities, Settings, Side, cell_probabilities_of};
use elbowroom_model::Task;
use elbowroom_sim::WorldModel;

use super::formula::Formula;
use super::{PrismError, bare, checked};
use crate::names::distinct;

/// Direction of the bound on the best value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// The agent decides at the boundaries of cells, and happenings between them have the worst
    /// order for it: a game of two players.
    Lower,
    /// The agent knows the happenings of a cell at its beginning, and chooses their order.
    Upper,
}

/// Returns the process of the timed optimum ([`elbowroom_mdp`]) on a grid of `cells` cells, in the
/// language of PRISM. Its `Pmax=? [F "goal"]`, or, for the lower bound, `<<agent>> Pmax=? [F
/// "goal"]`, is a bound on the success probability of the best executor without foresight.
///
/// It has none of the shortcuts of [`optimum`](elbowroom_mdp::optimum): any action may be started or
/// cancelled whenever the state allows, in any order. So the upper bound is the same. The lower
/// bound is at least as great, because [`optimum`](elbowroom_mdp::optimum) sometimes assumes less
/// than the worst order.
///
/// # Errors
/// When the world has no timed optimum, when the number of cells is out of range, and when there
/// are more than [`MAX_COMMANDS`](super::MAX_COMMANDS) commands.
pub fn timed(
    task: &Task,
    model: &WorldModel,
    settings: &Settings,
    (cells, bound): (usize, Bound),
) -> Result<String, PrismError> {
    if cells == 0 || cells >= usize::from(u16::MAX) - 1 {
        return Err(PrismError::Cells { cells });
    }
    let world = TimedWorld::new(task, model, settings)?;
    if world.events.iter().any(Event::is_recurrent) {
        return Err(PrismError::Rates);
    }
    if world.has_numbers() {
        return Err(PrismError::Numbers);
    }
    let has_outcomes = |act: &ActionModel| {
        act.failures.len() > 1 || act.failures.iter().any(|way| way.delay > 0.0)
    };
    if world.acts.iter().any(has_outcomes) {
        return Err(PrismError::Outcomes);
    }
    let side = match bound {
        Bound::Lower => Side::Below,
        Bound::Upper => Side::Above,
    };
    let chances = cell_probabilities_of(&world, cells, side)?;
    let names = world.facts.iter().map(|fact| {
        let name = task.fact_name(*fact);
        format!("f_{}", bare(&name))
    });
    let acts = world.acts.iter().map(|act| bare(&act.name).to_owned());
    let process = Process {
        facts: distinct(names),
        acts: distinct(acts),
        bound,
        world: &world,
        chances: &chances,
    };
    let problem = task.problem();
    checked(process.text(&problem.name, &problem.domain))
}

/// A world on a grid, with names for its parts.
struct Process<'p> {
    world: &'p TimedWorld,
    chances: &'p CellProbabilities,
    bound: Bound,
    facts: Vec<String>,
    acts: Vec<String>,
}

/// Returns the facts that a failure of the action makes true and false, if all its failures have
/// the same outcome.
fn failure_effects(act: &ActionModel) -> (Facts, Facts) {
    let way = act.failures.first();
    way.map_or((0, 0), |way| (way.adds, way.deletes))
}

/// A happening of the process.
struct Happening {
    label: String,
    /// Its condition on facts.
    needs: Formula,
    adds: Facts,
    deletes: Facts,
    owner: Owner,
    /// `true` if the agent triggers it, `false` if the world does.
    is_agents: bool,
}

/// The module whose state it changes, and the change.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Owner {
    Started(usize),
    /// The end of an action, with the required value of the variable of its end: success, failure,
    /// or any.
    Ended(usize, Option<bool>),
    Event(usize),
}

impl Process<'_> {
    fn text(&self, problem: &str, domain: &str) -> String {
        let happenings = self.happenings();
        let mut text = String::new();
        self.heading(problem, domain, &happenings, &mut text);
        self.clock(&happenings, &mut text);
        self.fact_module(&happenings, &mut text);
        for act in (0..self.acts.len()).filter(|act| self.world.acts[*act].rest.is_some()) {
            self.act_module(act, &happenings, &mut text);
        }
        for event in 0..self.world.events.len() {
            self.event_module(event, &happenings, &mut text);
        }
        let goal = match self.bound {
            Bound::Lower => "phase=0 & goal",
            Bound::Upper => "(phase!=2 & goal) | (phase=2 & goal_in_hope)",
        };
        let _ = writeln!(text, "label \"goal\" = {goal};");
        text
    }

    fn heading(&self, problem: &str, domain: &str, happenings: &[Happening], text: &mut String) {
        let cells = self.chances.cells;
        let _ = writeln!(
            text,
            "// The problem {problem} of the domain {domain} in its world, with time in {cells} cells that end\n\
             // at {} seconds.",
            self.world.horizon
        );
        match self.bound {
            Bound::Lower => {
                text.push_str(
                    "// <<agent>> Pmax=? [F \"goal\"] is a lower bound: the agent decides at the boundaries of cells,\n\
                     // and the events between them happen in the order that is worst for it.\n\n\
                     smg\n\n",
                );
                let list = |is_agents: bool, others: &[&str]| {
                    let own = happenings.iter().filter(|it| it.is_agents == is_agents);
                    let own = own.map(|happening| happening.label.as_str());
                    let all = own.chain(others.iter().copied());
                    let all: Vec<String> = all.map(|label| format!("[{label}]")).collect();
                    all.join(", ")
                };
                // PRISM rejects a label without a command.
                let worlds: &[&str] = if self.has_initial_events() {
                    &["tick", "begin", "begun"]
                } else {
                    &["tick"]
                };
                let _ = writeln!(
                    text,
                    "player agent\n  {}\nendplayer\nplayer world\n  {}\nendplayer\n",
                    list(true, &["wait", "over"]),
                    list(false, worlds)
                );
            }
            Bound::Upper => text.push_str(
                "// Pmax=? [F \"goal\"] is an upper bound: the agent observes all events of a cell at its beginning,\n\
                 // and chooses their order.\n\n\
                 mdp\n\n",
            ),
        }
        let goal = self.holds(&self.world.goal);
        let _ = writeln!(text, "formula goal = {goal};");
        if self.bound == Bound::Upper {
            text.push_str(
                "// After the last cell: goals that can still be reached count as reached.\n",
            );
            let _ = writeln!(
                text,
                "formula goal_in_hope = {};",
                self.may_hold(&self.world.goal)
            );
        }
        text.push('\n');
    }

    /// Returns all happenings that are possible within a cell or at its boundary.
    fn happenings(&self) -> Vec<Happening> {
        let mut all = Vec::new();
        for (index, (act, name)) in self.world.acts.iter().zip(&self.acts).enumerate() {
            all.push(Happening {
                label: format!("start_{name}"),
                needs: self.can_start(act),
                adds: act.start.adds,
                deletes: act.start.deletes,
                owner: Owner::Started(index),
                is_agents: true,
            });
            let Some((_, end)) = &act.rest else {
                continue;
            };
            let ended = |label: &str, needs, (adds, deletes), is_well, is_agents| Happening {
                label: format!("{label}_{name}"),
                needs,
                adds,
                deletes,
                owner: Owner::Ended(index, is_well),
                is_agents,
            };
            let agents = self.bound == Bound::Upper;
            let needs = self.holds(&end.needs);
            // An end whose condition does not hold fails; the effects of the start remain.
            let lacks = needs.clone().negated();
            let effects = (end.adds, end.deletes);
            all.push(ended("end", needs, effects, Some(true), agents));
            if lacks != Formula::FALSE {
                all.push(ended("miss", lacks, (0, 0), Some(true), agents));
            }
            if act.midway_failure > 0.0 || act.end_failure > 0.0 {
                let effects = failure_effects(act);
                all.push(ended("fail", Formula::TRUE, effects, Some(false), agents));
            }
            all.push(ended("cancel", Formula::TRUE, (0, 0), None, true));
        }
        for (index, event) in self.world.events.iter().enumerate() {
            all.push(Happening {
                label: format!("event_{index}"),
                needs: Formula::TRUE,
                adds: event.adds,
                deletes: event.deletes,
                owner: Owner::Event(index),
                is_agents: self.bound == Bound::Upper,
            });
        }
        all
    }

    fn clock(&self, happenings: &[Happening], text: &mut String) {
        let cells = self.chances.cells;
        text.push_str("module clock\n");
        let _ = writeln!(text, "  cell : [0..{cells}] init 0;");
        match self.bound {
            Bound::Lower => {
                let begins = self.has_initial_events();
                let _ = writeln!(
                    text,
                    "  // 0: at the boundary before the cell; 1: in it; 2 and 3: initial events.\n  \
                     phase : [0..3] init {};",
                    if begins { 2 } else { 0 }
                );
                for happening in happenings {
                    let label = &happening.label;
                    let guard = match (happening.is_agents, happening.owner) {
                        (true, _) => format!("phase=0 & cell<{cells}"),
                        (false, Owner::Event(event)) if begins => {
                            let earlier = (0..event).map(|it| format!(" & e_{it}!=1"));
                            let earlier: String = earlier.collect();
                            format!("phase=1 | (phase=3{earlier})")
                        }
                        (false, _) => "phase=1".to_owned(),
                    };
                    let _ = writeln!(text, "  [{label}] {guard} -> true;");
                }
                let _ = writeln!(
                    text,
                    "  [wait] phase=0 & cell<{cells} -> (phase'=1);\n  \
                     [tick] phase=1 -> (phase'=0)&(cell'=cell+1);\n  \
                     [over] phase=0 & cell={cells} -> true;"
                );
                if begins {
                    text.push_str(
                        "  [begin] phase=2 -> (phase'=3);\n  [begun] phase=3 -> (phase'=0);\n",
                    );
                }
            }
            Bound::Upper => {
                text.push_str(
                    "  // 0: the events of the cell are drawn; 1: the agent chooses; 2: after the last cell.\n  \
                     phase : [0..2] init 0;\n",
                );
                for happening in happenings {
                    let _ = writeln!(text, "  [{}] phase=1 -> true;", happening.label);
                }
                let last = cells - 1;
                let _ = writeln!(
                    text,
                    "  [reveal] phase=0 -> (phase'=1);\n  \
                     [pass] phase=1 -> (cell'=cell+1)&(phase'=(cell={last} ? 2 : 0));\n  \
                     [over] phase=2 -> true;"
                );
            }
        }
        text.push_str("endmodule\n\n");
    }

    fn fact_module(&self, happenings: &[Happening], text: &mut String) {
        text.push_str("module facts\n");
        for (place, name) in self.facts.iter().enumerate() {
            let holds = self.world.initial & (1 << place) != 0;
            let _ = writeln!(text, "  {name} : bool init {holds};");
        }
        for happening in happenings {
            let changes = self.changes(happening.adds, happening.deletes);
            let _ = writeln!(
                text,
                "  [{}] {} -> {changes};",
                happening.label, happening.needs
            );
        }
        if self.bound == Bound::Upper {
            self.write_final_commands(text);
        }
        text.push_str("endmodule\n\n");
    }

    /// Writes the commands after the last cell: the facts that could still become true if no fact
    /// ever became false.
    fn write_final_commands(&self, text: &mut String) {
        text.push_str(
            "  // Facts that could still become true if facts never became false again.\n",
        );
        let mut hope = |guard: Formula, adds: Facts| {
            if adds != 0 && guard != Formula::FALSE {
                let guard = Formula::all([Formula::atom("phase=2"), guard]);
                let _ = writeln!(text, "  [] {guard} -> {};", self.changes(adds, 0));
            }
        };
        for (index, event) in self.world.events.iter().enumerate() {
            hope(Formula::atom(format!("e_{index}!=2")), event.adds);
        }
        for (act, name) in self.world.acts.iter().zip(&self.acts) {
            let can_start = self.may_hold(&act.start.needs);
            hope(can_start.clone(), act.start.adds);
            if let Some((over_all, end)) = &act.rest {
                let goes = Formula::atom(format!("a_{name}>0"));
                let either = [can_start.clone(), goes.clone()];
                hope(Formula::any(either), failure_effects(act).0);
                let begun = Formula::any([can_start, goes]);
                let needs = [self.may_hold(over_all), self.may_hold(&end.needs)];
                hope(Formula::all([begun].into_iter().chain(needs)), end.adds);
            }
        }
    }

    /// Returns `true` if an event may happen before the first decision.
    fn has_initial_events(&self) -> bool {
        self.chances.initial.iter().any(|p| *p > 0.0)
    }

    /// Returns the update that makes facts true and false; additions win.
    fn changes(&self, adds: Facts, deletes: Facts) -> String {
        let names = self.facts.iter().enumerate();
        let changes = names.filter_map(|(place, name)| {
            let bit = 1 << place;
            let truth = if adds & bit != 0 {
                true
            } else if deletes & bit != 0 {
                false
            } else {
                return None;
            };
            Some(format!("({name}'={truth})"))
        });
        let changes: Vec<String> = changes.collect();
        if changes.is_empty() {
            "true".to_owned()
        } else {
            changes.join("&")
        }
    }

    /// Returns a condition in the present state.
    fn holds(&self, needs: &Needs) -> Formula {
        self.after(needs, 0, 0)
    }

    /// Returns a condition after effects; additions win.
    fn after(&self, needs: &Needs, adds: Facts, deletes: Facts) -> Formula {
        let part = |part: &Needs| self.after(part, adds, deletes);
        match needs {
            Needs::All(parts) => Formula::all(parts.iter().map(part)),
            Needs::Any(parts) => Formula::any(parts.iter().map(part)),
            Needs::Not(inner) => part(inner).negated(),
            Needs::Fact(fact) if fact & adds != 0 => Formula::TRUE,
            Needs::Fact(fact) if fact & deletes != 0 => Formula::FALSE,
            Needs::Fact(0) => Formula::FALSE,
            Needs::Fact(fact) => Formula::atom(&self.facts[fact.trailing_zeros() as usize]),
        }
    }

    /// Returns the formula that a condition holds if some of the true facts are made false.
    fn may_hold(&self, needs: &Needs) -> Formula {
        match needs {
            Needs::All(parts) => Formula::all(parts.iter().map(|part| self.may_hold(part))),
            Needs::Any(parts) => Formula::any(parts.iter().map(|part| self.may_hold(part))),
            Needs::Not(part) => self.may_fail(part),
            Needs::Fact(_) => self.holds(needs),
        }
    }

    fn may_fail(&self, needs: &Needs) -> Formula {
        match needs {
            Needs::All(parts) => Formula::any(parts.iter().map(|part| self.may_fail(part))),
            Needs::Any(parts) => Formula::all(parts.iter().map(|part| self.may_fail(part))),
            Needs::Not(part) => self.may_hold(part),
            Needs::Fact(_) => Formula::TRUE,
        }
    }
}
